#!/usr/bin/env python3
"""Do messages come on each topic at Poisson times of the configured rate?"""
import math
import statistics
import sys
import threading
import time
import unittest

import rospy
import rostest

from first_message import wait_for_first_message

RATE = 3000  # messages per minute, as in the launch file
SECONDS = 10.0
TOPICS = ("/faceDetection/data", "/overtAttention/mode", "/speechEvent/text")


class TestArrivals(unittest.TestCase):
    """Listens to the three topics at once."""

    @classmethod
    def setUpClass(cls):
        cls.arrivals = {topic: [] for topic in TOPICS}
        heard = {topic: threading.Event() for topic in TOPICS}

        def receive(_message, topic):
            cls.arrivals[topic].append(time.monotonic())
            heard[topic].set()

        for topic in TOPICS:
            wait_for_first_message(topic, 30.0)
            rospy.Subscriber(topic, rospy.AnyMsg, receive, topic, tcp_nodelay=True)
        if not all(heard[topic].wait(30.0) for topic in TOPICS):
            raise AssertionError("not every topic is published")
        began = time.monotonic()
        time.sleep(SECONDS)
        cls.arrivals = {topic: [each - began for each in times if began <= each < began + SECONDS]
                        for topic, times in cls.arrivals.items()}

    def test_the_number_of_messages_is_that_of_the_rate(self):
        expected = RATE / 60 * SECONDS
        for topic, times in self.arrivals.items():
            # 5 standard deviations
            self.assertLess(abs(len(times) - expected), 5 * math.sqrt(expected), topic)

    def test_gaps_vary_as_exponential_ones_do(self):
        for topic, times in self.arrivals.items():
            # even gaps have 0
            self.assertAlmostEqual(in_most_seconds(variation, times), 1.0, delta=0.25, msg=topic)

    def test_topics_do_not_keep_step(self):
        first, second, _ = self.arrivals.values()

        def together(times):
            return sum(any(abs(a - b) < 0.0005 for b in second) for a in times) / len(times)

        self.assertLess(in_most_seconds(together, first), 0.3)  # 5 % are expected by chance


def in_most_seconds(measure, times):
    """Return the median over the seconds: a machine that stands still for a moment spoils one of
    them, not the sum."""
    seconds = [[time for time in times if second <= time < second + 1]
               for second in range(int(SECONDS))]
    return statistics.median(measure(each) for each in seconds if len(each) > 2)


def variation(times):
    """Return the standard deviation of the gaps in units of their mean."""
    gaps = [after - before for before, after in zip(times, times[1:])]
    return statistics.pstdev(gaps) / statistics.mean(gaps)


if __name__ == "__main__":
    rospy.init_node("test_arrivals")
    rostest.rosrun("unit_tests", "arrivals", TestArrivals, sys.argv)
