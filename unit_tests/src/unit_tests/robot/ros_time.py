"""The time by which the simulated robot lives: the computer's, or that of /clock, which a node of
its own publishes at a chosen speed."""
import math
import threading
import time
from contextlib import suppress
from typing import Any, Optional

import genpy
import rospy

from behavior_controller.ros.action_client import REGISTER_AGAIN
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.tcpros import Trouble
from behavior_controller.ros.types import CLOCK, TYPES
from behavior_controller.run.events import unix_now

STEP = 0.01
"""Seconds of the computer between two messages of the clock."""

LONGEST_STEP = 0.05
"""Seconds that one message goes on at most: a machine that is too busy slows the clock down, and
does not make it leap."""


class ComputerTime:
    """The computer's time, in Unix seconds."""

    jumped = 0.0
    """By how many seconds /clock has jumped back."""

    def __init__(self) -> None:
        self._ended = threading.Event()

    def await_first(self) -> bool:
        """Return when the time has begun, and whether the node ends instead."""
        return self._ended.is_set()

    def now(self) -> float:
        """Return the time of an entry of the journal."""
        return unix_now()

    def wait(self, seconds: float) -> bool:
        """Wait so long, and return whether the node ends. Any thread may."""
        return self._ended.wait(None if math.isinf(seconds) else seconds)

    def end(self) -> None:
        """End all waits, now and later."""
        self._ended.set()


class RosTime(ComputerTime):
    """The time on /clock. Where that jumps back, this one goes on from where it was, as the
    controller's does: nothing that has a time has to be changed then."""

    def __init__(self) -> None:
        super().__init__()
        self._ros: Optional[float] = None
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(CLOCK.name, TYPES[CLOCK], self._hear, tcp_nodelay=True)

    def await_first(self) -> bool:
        while not self._begins_within(REGISTER_AGAIN):
            rospy.loginfo_once("waiting for the time on %s", CLOCK.name)
            with suppress(Trouble):  # see GoalThread._register_again
                DIRECTORY.register(self._subscriber)
        return self._ended.is_set()

    def _begins_within(self, seconds: float) -> bool:
        with self._changed:
            return self._changed.wait_for(
                lambda: self._ros is not None or self._ended.is_set(), seconds)

    def _hear(self, message: Any) -> None:
        ros = message.clock.to_sec()
        with self._changed:
            if self._ros is not None:
                self.jumped += max(0.0, self._ros - ros)
            self._ros = ros
            self._changed.notify_all()

    def now(self) -> float:
        with self._changed:
            return (self._ros or 0.0) + self.jumped

    def wait(self, seconds: float) -> bool:
        due = self.now() + seconds
        with self._changed:
            self._changed.wait_for(lambda: self._ended.is_set() or self.now() >= due)
        return self._ended.is_set()

    def end(self) -> None:
        with self._changed:
            self._ended.set()
            self._changed.notify_all()


def publish_clock(speed: float) -> None:
    """Publish the time until ROS shuts down: from the computer's on, ``speed`` times as fast."""
    publisher = rospy.Publisher(CLOCK.name, TYPES[CLOCK], queue_size=10, tcp_nodelay=True)
    now, before = time.time(), time.monotonic()
    while not rospy.is_shutdown():
        time.sleep(STEP)
        elapsed, before = time.monotonic() - before, time.monotonic()
        now += speed * min(elapsed, LONGEST_STEP)
        publisher.publish(genpy.Time.from_sec(now))
