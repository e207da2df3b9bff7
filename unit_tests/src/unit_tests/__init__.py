"""Simulated robot for testing the mission interpreter: nodes with a visitor in front of them, and a
verdict.

Reading order: ``robot.options``, what a test can be told; ``robot.visitor``, ``robot.faults`` and
``robot.arrivals``, the three models; ``robot.behaviour``, what each service answers and each topic
publishes; ``robot.simulated_node``, one node of them, which ``robot.ros_nodes`` carries to the wire
and ``robot.virtual_robot`` to virtual time; ``robot.journal``, where the nodes write the requests
they received; ``run``, the processes of a test; ``judge``, its evaluation; ``rehearsal``, many
plays of one mission in virtual time and their evaluation.
"""
