"""The robot's side of the seam: the only folder that imports rospy and the generated messages.

Reading order: ``connection`` (one conversation with a peer, bounded in time), ``services`` and ``topics`` (what leaves
ask for), ``probe`` (the start-up check), ``console`` (what an operator sees) and ``node`` (the main program).
"""
