"""BehaviorTree.CPP version 4 on py_trees. Knows neither ROS nor this robot.

A file goes through ``document`` (XML with places), ``checks`` (every fault), ``compiler`` (the tree); a tree runs
through ``node`` (the tick pipeline that all nodes share).
"""
