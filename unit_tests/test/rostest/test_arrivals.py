#!/usr/bin/env python3
"""Do messages come on each topic at Poisson times of the configured rate?"""
import math
import sys
import threading
import time
import unittest

import rospy
import rostest

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
            self.assertLess(abs(len(times) - expected), 5 * math.sqrt(expected), topic)  # 5 standard deviations

    def test_gaps_vary_as_exponential_ones_do(self):
        for topic, times in self.arrivals.items():
            gaps = [after - before for before, after in zip(times, times[1:])]
            mean = sum(gaps) / len(gaps)
            deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
            self.assertAlmostEqual(deviation / mean, 1.0, delta=0.25, msg=topic)  # even gaps have 0

    def test_topics_do_not_keep_step(self):
        first, second, _ = self.arrivals.values()
        together = sum(any(abs(a - b) < 0.0005 for b in second) for a in first)
        self.assertLess(together, 0.3 * len(first))  # 5 % are expected by chance


if __name__ == "__main__":
    rospy.init_node("test_arrivals")
    rostest.rosrun("unit_tests", "arrivals", TestArrivals, sys.argv)
