"""Monitors the robot while the mission runs: nodes that go or return, silent topics, the master.

Each service has a thread with an idle connection to its server: the end of the connection shows at once that the server
is gone, and the wait costs nothing. Topics and master are judged four times a second by the state of ``RosTopics`` and
``Directory``, so that no judgement waits for a master. Changes go to ``Health``.
"""
import threading
import time
from typing import Callable, Dict, FrozenSet, Iterable, Set, Tuple, Union

import rosgraph

from behavior_controller.events import HealthChanged
from behavior_controller.health import GONE, NEW, SILENT, Health
from behavior_controller.interface import Interface, Sense, Service, Topic
from behavior_controller.ros.connection import Connection, Trouble
from behavior_controller.ros.directory import DIRECTORY
from behavior_controller.ros.probe import Part, parts_of
from behavior_controller.ros.services import open_service_at
from behavior_controller.ros.subscription import STEP_LIMIT
from behavior_controller.ros.topics import Latch, RosTopics

LOOK = 0.25
"""Seconds between two checks of topics and master: their changes must be reported within two seconds."""

ROUND = 0.5
"""Seconds between two attempts to reach a server that is gone."""

SILENCE = 1.25
"""Seconds without a message after which a continuous topic is silent, unless its messages are rare."""

GAPS = 12
"""A topic is silent only after this many times its usual gap: with random arrivals a single gap may be long."""

FIRST_SILENCE = 10.0
"""The same as ``SILENCE`` until ``ENOUGH`` messages have shown the topic's rate."""

ENOUGH = 5

LONELY = 0.9
"""Seconds without a connection after which a topic is gone: a broken connection is first made again.

Over a link of 100 ms that takes 0.85 s.
"""

RECONNECT = 3.0
"""Seconds between two new connections to a continuous topic that is silent although its publisher is connected."""

RETURN_LIMIT = 1.3
"""Seconds for each step of a connection to a server whose last one broke; then it is gone.

It is long enough for one lost packet. The connection to an unreachable host breaks after three and a half seconds, so
that is reported within five.
"""

RETRY = 0.05
"""Seconds between a broken connection and the next one: a server may end each at once."""

NO_MASTER = ("the mission goes on with the nodes where they were last, but finds none that is started now")

NEW_MASTER = ("the mission goes on with them where they were last, as long as they run; start them again as soon as "
              "the robot is free, or no node that starts from now on finds them")


class Monitor:
    """Monitors the ``include``d services and topics, and the master, until ``close``."""

    def __init__(self, interface: Interface, topics: RosTopics, health: Health, is_asr_enabled: Callable[[], bool]):
        """While ``is_asr_enabled()`` is false, speech is not used, and its topic is not monitored."""
        self._parts: Tuple[Part, ...] = ()
        self._topics = topics
        self._speech = interface.evidence(Sense.UTTERANCE).topic
        self._health = health
        self._is_asr_enabled = is_asr_enabled
        self._connections: Dict[Part, Connection] = {}
        self._reported: Dict[Tuple[str, str], bool] = {}  # whether it was all right, by name and respect
        self._closed = threading.Event()
        self._was_there: Set[Part] = set()  # the services that the robot has
        self._may_lack: FrozenSet[Part] = frozenset()
        self._lonely: Dict[Part, float] = {}  # since when a topic has had no connection
        # of a silent topic: time of its last message, and the silence after which to reconnect
        self._silent: Dict[Part, Tuple[float, float]] = {}

    def include(self, offers: Iterable[Union[Service, Topic]], may_lack: bool = False) -> None:
        """Monitor these services and topics too. ``may_lack``: those that never existed are not reported."""
        parts = parts_of(offers)
        added = [part for part in parts if part not in self._parts]
        self._parts += tuple(added)
        self._may_lack = self._may_lack.union(added) if may_lack else self._may_lack.difference(parts)
        for part in added:
            if not isinstance(part.offer, Topic):
                threading.Thread(target=self._watch, args=(part,), daemon=True, name="monitor " + part.name).start()

    def start(self) -> None:
        """Start monitoring topics and the master."""
        threading.Thread(target=self._look_around, daemon=True, name="monitor topics and master").start()

    def close(self) -> None:
        """Let the threads end; does not wait for them."""
        self._closed.set()
        for connection in list(self._connections.values()):
            connection.close()

    # -------------------------------------------------------------------------------------------------------- services

    def _watch(self, part: Part) -> None:
        """Keep a connection to a server and report its loss and return."""
        while not self._closed.is_set():
            try:
                self._hold(part)
            except Trouble as trouble:
                if part in self._was_there or not (part.is_optional or part in self._may_lack):
                    self._tell_gone(part, "{}: {}".format(trouble.cause.text, trouble))
                self._closed.wait(ROUND)

    def _hold(self, part: Part) -> None:
        """Stay connected to a server. Raises ``Trouble`` if it cannot be connected to, at first or after a break."""
        place, limit = DIRECTORY.service(part.name, STEP_LIMIT), STEP_LIMIT
        while not self._closed.is_set():
            connection = self._connections[part] = Connection()
            open_service_at(place, connection, part.name, "*", limit, persistent="1")
            self._was_there.add(part)
            self._tell_back(part)
            self._wait_for_end(connection)
            self._closed.wait(RETRY)
            limit = RETURN_LIMIT

    def _wait_for_end(self, connection: Connection) -> None:
        """Return when the connection has ended."""
        connection.notice_a_dead_host()
        connection.wait_without_limit()
        try:
            while not self._closed.is_set():
                connection.receive(1)
        except Trouble:
            pass
        connection.hang_up()

    def _report(self, respect: str, change: HealthChanged) -> None:
        """Report a changed state to the health; only changes, since each wakes the tree. Each thread has its own parts."""
        if self._reported.get((change.name, respect), True) is not change.is_well:
            self._reported[change.name, respect] = change.is_well
            self._health.report(respect, change)

    def _tell_gone(self, part: Part, reason: str) -> None:
        self._report(GONE, HealthChanged(
            part.kind, part.name, part.node, False, "gone: " + reason, "until it is back, " + part.absence))

    def _tell_back(self, part: Part) -> None:
        self._report(GONE, HealthChanged(part.kind, part.name, part.node, True, "available again", ""))

    # ----------------------------------------------------------------------------------------------- topics and master

    def _look_around(self) -> None:
        while not self._closed.wait(LOOK):
            self._look_at_master()
            for part in self._parts:
                if isinstance(part.offer, Topic) and (part.offer is not self._speech or self._is_asr_enabled()):
                    self._look_at(part, self._topics.latches[part.offer])

    def _look_at_master(self) -> None:
        """Report whether the master answers, and whether it has forgotten the robot's nodes."""
        name, forgotten = rosgraph.get_master_uri(), DIRECTORY.forgotten
        if DIRECTORY.is_lost:
            self._report(GONE, HealthChanged("master", name, "", False, "does not answer", NO_MASTER))
            return
        nodes = sorted({part.node for part in self._parts if part.name in forgotten})
        back = "another one answers" if nodes else "answers again"
        self._report(GONE, HealthChanged("master", name, "", True, back, ""))
        self._report(NEW, HealthChanged(
            "master", name, "", not nodes, "a new one, or its memory was cleared: it does not know {}".format(
                ", ".join(nodes)) if nodes else "knows the robot's nodes again", NEW_MASTER if nodes else ""))

    def _look_at(self, part: Part, latch: Latch) -> None:
        """Report whether a topic is published, and whether it has been silent for too long."""
        if latch.count:
            self._health.hear(part.name, latch.last_arrival)
        now = time.monotonic()
        if not latch.is_connected:
            if now - self._lonely.setdefault(part, now) > LONELY:
                self._tell_gone(part, _absence(latch))
            return
        self._lonely.pop(part, None)
        self._tell_back(part)
        if latch.is_continuous:
            self._look_at_silence(part, latch, now - latch.last_arrival)

    def _look_at_silence(self, part: Part, latch: Latch, silence: float) -> None:
        """Report when a continuous topic falls silent, and reconnect to its publisher meanwhile."""
        heard, again_at = self._silent.get(part, (0.0, 0.0))
        if heard == latch.last_arrival:  # still silent: a new connection alone proves nothing
            if silence >= again_at:
                self._silent[part] = heard, silence + RECONNECT
                latch.reconnect()
            return
        is_well = silence <= patience(latch.count, latch.usual_gap)
        if is_well:
            self._silent.pop(part, None)
        else:
            self._silent[part] = latch.last_arrival, silence + RECONNECT
        self._report(SILENT, HealthChanged(
            part.kind, part.name, part.node, is_well, "heard again" if is_well else
            "silent for {:.1f} s".format(silence), "" if is_well else "until it is heard again, " + part.absence))


def _absence(latch: Latch) -> str:
    """Return why a topic is not connected, if that is known."""
    if latch.wrong_publishers:
        return "published by {}; expected is {}".format(", ".join(latch.wrong_publishers), latch.type_name)
    if latch.unreachable:
        return "its publisher at {} cannot be reached".format(", ".join(latch.unreachable))
    return "no node publishes it" + latch.no_action


def patience(count: int, usual_gap: float) -> float:
    """Return the seconds of silence that are normal for a topic with so many messages at that mean distance."""
    return FIRST_SILENCE if count < ENOUGH else max(SILENCE, GAPS * usual_gap)
