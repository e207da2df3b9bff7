"""Tests the mission interpreter on ROS: nine simulated nodes, and a verdict.

Reading order: ``robot.options``, what a test can be told; ``robot.ros_nodes``, which carries the
simulated robot of ``behavior_controller.simulation`` to the wire; ``run``, the processes of a test;
``judge``, its evaluation.
"""
