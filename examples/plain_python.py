"""Runs a mission drawn in Groot2 with leaves of its own, without ROS:
plain_python.py plain_python.xml"""
import sys
from collections import namedtuple

from behavior_controller import bt

Spot = namedtuple("Spot", "x y")
robot = {"at": Spot(0.0, 0.0), "battery": 3}


class Drive(bt.ActionLeaf):  # an action of several ticks
    def on_start(self):
        self.goal = self.get_input("to")
        return bt.RUNNING

    def on_running(self):
        robot.update(at=self.goal, battery=robot["battery"] - 1)
        self.set_output("battery", robot["battery"])
        return bt.SUCCESS


def is_charged(leaf):  # one tick: True is SUCCESS
    return robot["battery"] >= leaf.get_input("at_least")


spot = bt.PortType("Spot", Spot, lambda text: Spot(*map(float, text.split(";"))))
registry = bt.Registry()
registry.register_action("Drive", Drive, [
    bt.Port("to", spot), bt.Port("battery", "int", direction=bt.Direction.OUT)])
registry.register_condition("IsCharged", is_charged, [bt.Port("at_least", "int", default="1")])

try:
    tree = bt.load(sys.argv[1], registry)
except bt.MissionError as error:  # every mistake of the file, a line each
    sys.exit(str(error))
tree.blackboard["home"] = robot["at"]
print(tree.tick_while_running().name, robot, tree.blackboard["battery"])
