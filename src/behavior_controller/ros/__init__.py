"""The robot's side of the seam: the only folder that imports rospy and the generated messages.

Reading order: ``connection`` (a connection with a peer, bounded in time), ``services`` and ``topics`` (for the leaves),
``probe`` (the start-up check), ``console`` (the operator's terminal) and ``node`` (the main program).
"""
