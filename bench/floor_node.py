#!/usr/bin/env python3
"""A minimal rospy node: a topic's callback calls a service over a persistent connection, and back
to back."""
import sys

import rospy
from cssr_system.msg import faceDetectionMessage
from cssr_system.srv import textService

FACES, SAY = "/faceDetection/data", "/textToSpeech/say_text"


def main(what):
    """``reaction``: a call for each message; ``step``: one call after the other."""
    rospy.init_node("floor")
    say = rospy.ServiceProxy(SAY, textService, persistent=True)
    say("warm up")
    if what == "reaction":
        rospy.Subscriber(FACES, faceDetectionMessage, lambda message: say("hello"), queue_size=1,
                         tcp_nodelay=True)
        rospy.spin()
    while not rospy.is_shutdown():
        say("hello")


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except rospy.ServiceException:
        pass  # the bench has ended the robot
