"""A node of a robot: stand_in.py NAME [SERVICE|TOPIC]. It registers at a line on its input, and
prints ``ready``."""
import sys

import rospy

from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.requests import Answer
from behavior_controller.ros.types import TYPES
from unit_tests.robot.ros_messages import response

sys.stdin.readline()
rospy.init_node(sys.argv[1])
for offer in INTERFACE.offers:
    if offer.name in sys.argv[2:] and offer in INTERFACE.services:
        rospy.Service(offer.name, TYPES[offer],
                      lambda request, service=offer: response(service, Answer()))
    elif offer.name in sys.argv[2:]:
        rospy.Publisher(offer.name, TYPES[offer], queue_size=1)
print("ready", flush=True)
rospy.spin()
