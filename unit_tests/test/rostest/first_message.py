"""Waits for a topic whose publisher may only just begin."""
import time

import rospy

PATIENCE = 5.0  # seconds until the topic is subscribed to anew


def wait_for_first_message(topic, limit):
    """Wait at most ``limit`` seconds for a message; raises ROSException if none comes.

    It subscribes again and again: rospy may lose a publisher that registers while it subscribes,
    since it takes the master's older answer for the newer one.
    """
    ends = time.monotonic() + limit
    while True:
        try:
            return rospy.wait_for_message(topic, rospy.AnyMsg, PATIENCE)
        except rospy.ROSException:
            if rospy.is_shutdown() or time.monotonic() >= ends:
                raise
