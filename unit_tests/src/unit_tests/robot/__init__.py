"""The simulated robot: its behaviour, the visitor, faults and arrivals; as ROS nodes and in virtual
time."""
