"""A simulator, as far as its clock can tell."""
import threading
import time

import rospy
from rosgraph_msgs.msg import Clock

STEP = 0.02
"""Seconds between two messages of the clock."""


class Simulator:
    """Publishes the time, as a simulator does: while it is paused, nothing."""

    def __init__(self, topic, rate, begin=1000.0):
        self.rate, self.time, self.is_paused = rate, begin, False
        self._lock, self._is_over = threading.Lock(), threading.Event()
        self._publisher = rospy.Publisher(topic, Clock, queue_size=10)
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def _work(self):
        now = time.monotonic()
        while not self._is_over.wait(STEP):
            with self._lock:
                before, now = now, time.monotonic()
                if not self.is_paused:
                    self.time += (now - before) * self.rate
                    self._publisher.publish(Clock(rospy.Time.from_sec(self.time)))

    def jump(self, seconds):
        """Go on from a time that is ``seconds`` later."""
        with self._lock:
            self.time += seconds

    def stop(self):
        """Publish nothing any more."""
        self._is_over.set()
        self._thread.join()
        self._publisher.unregister()
