"""The robot's side of the seam: the only folder that imports rospy and the generated messages.

Reading order: ``tcpros`` (a connection with a peer, bounded in time), ``service_client`` and
``subscriber`` (for the leaves), ``startup_check``, ``console`` (the operator's terminal) and
``node`` (the main program).
"""
