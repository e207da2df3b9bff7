"""The robot and its visitors as a pure model, in virtual time and for the simulated ROS nodes; and
the command that rehearses missions with it."""
