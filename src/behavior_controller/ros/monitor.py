"""Watches the robot while the mission runs: which node is gone or back, which topic silent, whether there is a master.

Each service has a thread that holds an idle connection to its server: its end tells at once that the server is gone,
and costs nothing while it is there. Topics and master are looked at twice a second. What changes goes to ``Health``.
"""
import threading
import time
from typing import Callable, Dict, List, Optional, Tuple

import rosgraph

from behavior_controller.events import HealthChanged
from behavior_controller.gateway import Topic
from behavior_controller.health import GONE, SILENT, Health
from behavior_controller.ros.connection import Connection, Trouble, ask_master
from behavior_controller.ros.probe import PARTS, STEP_LIMIT, Part
from behavior_controller.ros.services import open_service
from behavior_controller.ros.topics import Latch, RosTopics

ROUND = 0.5
"""Seconds between two looks at topics and master, and between two attempts to reach a server that is gone."""

CONTINUOUS = (Topic.FACES, Topic.ATTENTION)
"""Topics that are published all the time: their silence means something."""

SILENCE = 1.25
"""Seconds without a message after which a continuous topic is silent, unless its messages are rare."""

GAPS = 12
"""A topic is silent only after so many times its usual gap: where messages arrive at random, one gap may be long."""

FIRST_SILENCE = 10.0
"""The same as ``SILENCE`` while fewer than ``ENOUGH`` messages have told how often the topic speaks."""

ENOUGH = 5

NO_MASTER = ("the mission goes on with the nodes that run, but finds none that is started now; a new master knows no "
             "node: then start the robot's nodes and this one again")


class Monitor:
    """Watches ``PARTS`` and the master from ``start`` to ``close``."""

    def __init__(self, topics: RosTopics, health: Health, is_asr_enabled: Callable[[], bool]):
        """While ``is_asr_enabled()`` is false nobody listens to speech, and its topic is not watched."""
        self._health = health
        self._is_asr_enabled = is_asr_enabled
        self._latches: List[Tuple[Part, Latch]] = [
            (part, topics.latches[part.offer]) for part in PARTS if isinstance(part.offer, Topic)]
        self._services = [part for part in PARTS if not isinstance(part.offer, Topic)]
        self._connections: Dict[Part, Connection] = {}
        self._closed = threading.Event()
        self._lonely: Dict[Part, int] = {}  # rounds in a row that a topic had no connection

    def start(self) -> None:
        """Begin to watch."""
        for part in self._services:
            threading.Thread(target=self._watch, args=(part,), daemon=True, name="watch " + part.name).start()
        threading.Thread(target=self._look_around, daemon=True, name="watch topics and master").start()

    def close(self) -> None:
        """Stop watching; threads end by themselves."""
        self._closed.set()
        for connection in list(self._connections.values()):
            connection.close()

    # -------------------------------------------------------------------------------------------------------- services

    def _watch(self, part: Part) -> None:
        """Hold a connection to a server and report when it ends, and when there is one again."""
        while not self._closed.is_set():
            reason = self._hold(part)
            if reason is not None:
                self._tell_gone(part, reason)
                self._closed.wait(ROUND)

    def _hold(self, part: Part) -> Optional[str]:
        """Connect and wait for the end of the connection. Return why there was no connection, or None if there was."""
        connection = self._connections[part] = Connection()
        try:
            open_service(connection, part.name, "*", STEP_LIMIT, persistent="1")
        except Trouble as trouble:
            return "{}: {}".format(trouble.cause.value, trouble)
        self._tell_back(part)
        connection.notice_a_dead_host()
        connection.wait_without_limit()
        try:
            while not self._closed.is_set():
                connection.receive(1)
        except Trouble:
            pass
        connection.hang_up()
        return None

    def _tell_gone(self, part: Part, reason: str) -> None:
        self._health.report(GONE, HealthChanged(
            part.kind, part.name, part.node, False, "gone: " + reason, "until it is back, " + part.absence))

    def _tell_back(self, part: Part) -> None:
        self._health.report(GONE, HealthChanged(part.kind, part.name, part.node, True, "there again", ""))

    # ----------------------------------------------------------------------------------------------- topics and master

    def _look_around(self) -> None:
        while not self._closed.wait(ROUND):
            self._look_at_master()
            for part, latch in self._latches:
                if part.offer is not Topic.SPEECH or self._is_asr_enabled():
                    self._look_at(part, latch)

    def _look_at_master(self) -> None:
        name = rosgraph.get_master_uri()
        try:
            ask_master("getPid", seconds=STEP_LIMIT)
            change = HealthChanged("master", name, "", True, "answers again", "")
        except Trouble:
            change = HealthChanged("master", name, "", False, "does not answer", NO_MASTER)
        self._health.report(GONE, change)

    def _look_at(self, part: Part, latch: Latch) -> None:
        """Tell whether a topic is published at all, and whether it has been silent for too long."""
        if latch.count:
            self._health.heard[part.name] = latch.last_arrival
        if latch.is_connected:
            self._lonely[part] = 0
            self._tell_back(part)
        else:
            self._look_for_publisher(part, latch)
        if part.offer not in CONTINUOUS or not latch.is_connected:
            return
        silence, limit = time.monotonic() - latch.last_arrival, patience(latch.count, latch.usual_gap)
        is_well = silence <= limit
        self._health.report(SILENT, HealthChanged(
            part.kind, part.name, part.node, is_well, "heard again" if is_well else
            "silent for {:.1f} s".format(silence), "" if is_well else "until it is heard again, " + part.absence))

    def _look_for_publisher(self, part: Part, latch: Latch) -> None:
        """Tell that a topic has lost its publisher, or connect anew to one that is still there.

        rospy does not come back by itself when a connection breaks whose publisher stays registered.
        """
        self._lonely[part] = self._lonely.get(part, 0) + 1
        if self._lonely[part] < 2:
            return  # rospy may be about to connect
        self._tell_gone(part, "nobody publishes it")
        if self._lonely[part] % 4 == 2:
            latch.subscribe_anew()


def patience(count: int, usual_gap: float) -> float:
    """Return the seconds of silence that are normal for a topic with so many messages at that mean distance."""
    return FIRST_SILENCE if count < ENOUGH else max(SILENCE, GAPS * usual_gap)
