"""The simulated robot on the wire: its nine ROS nodes, their options, and the names they claim."""
