"""BehaviorTree.CPP version 4 on py_trees. Knows neither ROS nor this robot.

A file goes through ``language`` (XML with places, scripts), ``checking`` (every fault), ``compiler`` (the tree); a tree
runs through ``engine`` (the tick pipeline that all nodes share). ``registry`` declares the node types.
"""
