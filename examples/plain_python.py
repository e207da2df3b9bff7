"""Runs a mission drawn in Groot2 with leaves of its own, without ROS:
plain_python.py plain_python.xml"""
import sys
from collections import namedtuple

from behavior_controller import bt

Spot = namedtuple("Spot", "x y")


class Drive(bt.ActionLeaf):
    def setup(self, **kwargs):
        self.robot = kwargs["robot"]

    def on_start(self):
        self.goal = self.get_input("to")
        return bt.RUNNING

    def on_running(self):
        self.robot.update(at=self.goal, battery=self.robot["battery"] - 1)
        self.set_output("battery", self.robot["battery"])
        return bt.SUCCESS


class IsCharged(bt.ConditionLeaf):
    setup = Drive.setup

    def update(self):
        return bt.SUCCESS if self.robot["battery"] >= self.get_input("at_least") else bt.FAILURE


SPOT = bt.PortType("Spot", Spot, lambda text: Spot(*map(float, text.split(";"))))
PORTS = (bt.Port("to", SPOT), bt.Port("battery", "int", direction=bt.Direction.OUT))
LIMIT = bt.Port("at_least", "int", default="1")
REGISTRY = bt.Registry(bt.builtin_specs() + [
    bt.NodeSpec("Drive", bt.Kind.ACTION, Drive, PORTS),
    bt.NodeSpec("IsCharged", bt.Kind.CONDITION, IsCharged, (LIMIT,))])

try:
    tree = bt.load(sys.argv[1], REGISTRY)
except bt.MissionError as error:  # every fault of the file, a line each
    sys.exit(str(error))
robot = {"at": Spot(0.0, 0.0), "battery": 3}
tree.blackboard.set("home", robot["at"])
tree.setup(robot=robot)
print(tree.tick_while_running().name, robot, tree.blackboard.get("battery"))
