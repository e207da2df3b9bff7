"""Monitors the robot while the mission runs: nodes that go or return, silent topics, the master.

Each service, and the status of each action, has a thread with a connection to its server: the end
of the connection shows at once that the server is gone, and the wait costs next to nothing. Topics
and master are judged four times a second by the state of ``RosTopics`` and ``Directory``, so that
no judgement waits for a master. Changes go to ``Health``.
"""
import contextlib
import socket
import threading
import time
from typing import Any, Callable, Dict, Iterable, Set, Tuple

import rosgraph

from behavior_controller.run.events import HealthChanged
from behavior_controller.run.health import (
    GONE, Health, NEW, SHORT, SILENT, SIMULATED_TIME, SLOW, available_again, gone)
from behavior_controller.robot.declarations import (
    Action, Interface, Offer, Publication, Sense, Service, Topic)
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.rhythm import SILENCE, Rhythm
from behavior_controller.ros.tcpros import (
    RECONNECT_PAUSE, READ_SIZE, Connection, RETRY_INTERVAL, STEP_LIMIT, Trouble, open_publisher)
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.service_client import open_service
from behavior_controller.ros.shortage import SHORTAGE
from behavior_controller.ros.subscriber import TopicBuffer, RosTopics
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.ros.types import CLOCK, resolved
from behavior_controller.text import bracketed, clean

CHECK_EVERY = 0.25
"""Seconds between two checks of topics and master: their changes must be reported within two
seconds."""

NO_CONNECTION_LIMIT = 0.9
"""Seconds without a connection after which a topic is gone: a broken connection is first made
again.

Over a link of 100 ms that takes 0.85 s.
"""

RECONNECT_AFTER = 3.0
"""Seconds between two new connections to a continuous topic that is silent although its publisher
is connected."""

RECONNECT_LIMIT = 1.3
"""Seconds for each step of a connection to a server whose last one broke; then it is gone.

It is long enough for one lost packet. The connection to an unreachable host breaks after three and
a half seconds, so that is reported within five.
"""

LOST_AFTER = 2
"""A master is lost after this number of unanswered rounds: over a poor link one question in a
hundred is lost."""

SLOW_IN_A_ROW = 4
"""A master is slow after this number of slow answers in a row: over a poor link a tenth are slow.
"""

NO_MASTER = (
    "the mission goes on with the nodes where they were last, but finds none that is started now")

SLOW_MASTER = "nodes that are started, or started again, are found later"

NEW_MASTER = ("the mission goes on with them where they were last, as long as they run; start them "
              "again as soon as the robot is free, or no node that starts from now on finds them")


SHORT_COMPUTER = "until it does, what is started anew is not found, and steps may fail"

Connect = Callable[[Connection, float], object]
"""Connects to a server; each step takes at most so many seconds."""


class Monitor:
    """Monitors the ``include``d services and topics, and the master, until ``close``."""

    def __init__(self, interface: Interface, topics: RosTopics, health: Health,
                 is_asr_enabled: Callable[[], bool], gaze_value: Callable[[], int] = lambda: 1):
        """While ``is_asr_enabled()`` is false, speech is not used, and its topic is not monitored.
        ``gaze_value`` returns the value of the attention mode that means mutual gaze."""
        self._offers: Tuple[Offer, ...] = ()
        self._robot, self._topics, self._health = interface, topics, health
        self._speech = interface.evidence(Sense.UTTERANCE).topic
        self._is_asr_enabled, self._gaze_value = is_asr_enabled, gaze_value
        # whether it was all right, by name and respect
        self._reported: Dict[Tuple[str, str], bool] = {}
        self._closed = threading.Event()
        self._needed: Set[Offer] = set()
        self._lonely: Dict[Topic, float] = {}  # since when a topic has had no connection
        # of a silent topic: time of its last message, and the silence after which to reconnect
        self._silent: Dict[Topic, Tuple[float, float]] = {}

    def include(self, offers: Iterable[Offer], may_lack: bool = False) -> None:
        """Monitor these services and topics too. ``may_lack``: those that never existed are not
        reported."""
        self._topics.include(offers)
        if not may_lack:
            self._needed.update(offers)
        for offer in offers:
            # a subscriber has no address to connect to
            if offer in self._offers or isinstance(offer, (Topic, Publication)):
                continue
            # health is that of a name: its service and its action stand in for each other
            if self._robot.substitute(offer) not in self._offers:
                start_thread("monitor " + offer.name, self._watch, offer)
            self._offers += (offer,)
        self._offers += tuple(offer for offer in offers if offer not in self._offers)

    def start(self) -> None:
        """Start monitoring topics and the master."""
        start_thread("monitor topics and master", self._check_all)

    def close(self) -> None:
        """Let the threads end, each at its next event; does not wait for them."""
        self._closed.set()

    # ------------------------------------------------------------------------------------- services

    def _watch(self, offer: Service) -> None:
        """Keep a connection to a server and report its loss and return."""
        while not self._closed.is_set():
            try:
                self._hold(offer)
            except Trouble as trouble:
                is_needed = offer in self._needed and not offer.is_optional
                is_known = is_needed or (resolved(offer), GONE) in self._reported
                if is_known and trouble.shortage is None:
                    self._tell_gone(offer, trouble.reason)
                self._closed.wait(RETRY_INTERVAL)

    def _hold(self, offer: Service) -> None:
        """Stay connected to a server. Raises ``Trouble`` if it cannot be connected to, at first or
        after a break."""
        connect, limit = self._connect_to(offer), STEP_LIMIT
        while not self._closed.is_set():
            connection = Connection()
            connect(connection, limit)
            self._tell_back(offer)
            connection.notice_a_dead_host()
            connection.wait_without_limit()
            with contextlib.suppress(Trouble):
                while not self._closed.is_set():
                    connection.receive_some(READ_SIZE)
            connection.hang_up()
            self._closed.wait(RECONNECT_PAUSE)
            limit = RECONNECT_LIMIT

    def _judge(self, respect: str, kind: str, name: str, status: str, consequence: str,
               node: str = "") -> None:
        """Report a ``status``, which is good if it has no ``consequence``."""
        self._report(respect, HealthChanged(kind, name, node, not consequence, status, consequence))

    def _connect_to(self, offer: Service) -> Connect:
        """As ``_connect_to``; to its substitute if no node offers it."""
        try:
            return _connect_to(offer)
        except Trouble as trouble:
            substitute = self._robot.substitute(offer)
            if substitute is None or trouble.cause is not Cause.NOT_ADVERTISED:
                raise
        return _connect_to(substitute)

    def _report(self, respect: str, change: HealthChanged) -> None:
        """Report a changed state to the health; only changes, since each wakes the tree. Each
        thread reports on its own."""
        was_well = self._reported.get((change.name, respect), True)
        self._reported[change.name, respect] = change.is_well
        if was_well is not change.is_well:
            self._health.report(respect, change)

    def _tell_gone(self, offer: Offer, reason: str) -> None:
        self._report(GONE, gone(offer.kind, resolved(offer), self._robot.node_of(offer), reason,
                                offer.impact_if_missing))

    def _tell_back(self, offer: Offer) -> None:
        self._report(GONE, available_again(offer.kind, resolved(offer), self._robot.node_of(offer)))

    # ---------------------------------------------------------------------------- topics and master

    def _check_all(self) -> None:
        while not self._closed.wait(CHECK_EVERY):
            self._check_computer()
            self._check_master()
            for offer in self._offers:
                is_unused = offer is self._speech and not self._is_asr_enabled()
                if isinstance(offer, Topic) and not is_unused:
                    self._check_topic(offer, self._topics.buffers[offer])

    def _check_computer(self) -> None:
        """Report whether this computer gives the node what it needs."""
        short = SHORTAGE.now
        status, consequence = "gives this node files, threads and memory again", ""
        if short:
            status = f"gives this node no more files, threads or memory: {short}"
            consequence = SHORT_COMPUTER
        self._judge(SHORT, "computer", socket.gethostname(), status, consequence)

    def _check_master(self) -> None:
        """Report whether the master answers, and whether it has forgotten the robot's nodes."""
        master, forgotten = ("master", rosgraph.get_master_uri()), DIRECTORY.forgotten
        if DIRECTORY.unanswered >= LOST_AFTER:
            self._judge(GONE, *master, DIRECTORY.fault, NO_MASTER)
            return
        if DIRECTORY.slow_answers >= SLOW_IN_A_ROW:
            self._judge(SLOW, *master, "answers slowly", SLOW_MASTER)
        else:
            self._judge(SLOW, *master, "answers in time again", "")
        nodes = sorted({self._robot.node_of(offer) for offer in self._offers
                        if resolved(offer) in forgotten})
        if nodes:
            self._judge(GONE, *master, "another one answers", "")
            self._judge(NEW, *master, "is a new one, or its memory was cleared: it does not know "
                        f"{', '.join(nodes)}", NEW_MASTER)
        else:
            self._judge(GONE, *master, "answers again", "")
            self._judge(NEW, *master, "knows the robot's nodes again", "")

    def _check_topic(self, topic: Topic, buffer: TopicBuffer) -> None:
        """Report whether a topic is published, and whether it has been silent for too long."""
        if topic is CLOCK:
            self._check_silence(topic, buffer, buffer.clock.source())
            return
        if buffer.rhythm.count:
            self._health.hear(buffer.name, buffer.rhythm.last, self._words(topic, buffer.newest),
                              buffer.rhythm.rate)
        now = time.monotonic()
        if not buffer.is_connected:
            if buffer.is_searched and now - self._lonely.setdefault(topic, now) > (
                    NO_CONNECTION_LIMIT):
                self._tell_gone(topic, buffer.absence)
                # its silence is counted from its return
                buffer.rhythm = Rhythm(buffer.clock.source())
            return
        self._lonely.pop(topic, None)
        self._tell_back(topic)
        if topic.is_continuous:
            self._check_silence(topic, buffer, buffer.clock.source())

    def _words(self, topic: Topic, value: Any) -> str:
        """Return a message in words."""
        try:
            said = [clean(topic.words(value))]
        except Exception:  # of another package's declaration
            said = [clean(repr(value))]
        for sense, evidence in self._robot.senses.items():
            if evidence.topic is topic and evidence.mode and evidence.mode == value.state:
                is_given = evidence.is_given(value, self._gaze_value())
                said.append(sense.noun if is_given else sense.awaiting)
        return ", ".join(said)

    def _check_silence(self, topic: Topic, buffer: TopicBuffer, now: float) -> None:
        """Report when a continuous topic falls silent, and reconnect to its publisher meanwhile."""
        last_arrival, again_at = self._silent.get(topic, (None, 0.0))
        silence = now - buffer.rhythm.last
        if last_arrival == buffer.rhythm.last:
            # still silent: a new connection alone proves nothing
            if silence >= again_at:
                self._silent[topic] = last_arrival, silence + RECONNECT_AFTER
                buffer.reconnect()
            return
        status, consequence = "heard again", ""
        # at a high speed of the simulated time it takes no more than a busy computer
        if buffer.rhythm.is_silent(now) and time.monotonic() - buffer.heard_at > SILENCE:
            self._silent[topic] = buffer.rhythm.last, silence + RECONNECT_AFTER
            status = f"silent for {silence:.1f} s"
            consequence = "until it is heard again, " + topic.impact_if_missing
        elif not buffer.rhythm.count:
            return  # it was gone, and is not heard yet
        kind = topic.kind
        if topic is CLOCK:
            kind = SIMULATED_TIME
            status = _standing(buffer, silence) if consequence else "goes on"
        self._judge(SILENT, kind, buffer.name, status, consequence, self._robot.node_of(topic))


def _standing(clock: TopicBuffer, seconds: float) -> str:
    """Return since when the simulated time stands still, and why if that is known."""
    since = time.strftime("%H:%M:%S", time.localtime(time.time() - seconds))
    why = "" if clock.is_connected else bracketed(clock.absence)
    return f"stands still since {since}{why}"


def _connect_to(offer: Service) -> Connect:
    """Return what connects to a server, which is looked up now: of an action, to its status. Raises
    ``Trouble``."""
    name = resolved(offer)
    if isinstance(offer, Action):
        uri = DIRECTORY.server(name, STEP_LIMIT)
        return lambda connection, _: open_publisher(connection, uri, name + "/status", "_monitor")
    place = DIRECTORY.service(name, STEP_LIMIT)
    return lambda connection, limit: open_service(place, connection, name, "*", limit,
                                                  persistent="1")
