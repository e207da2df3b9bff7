"""The addresses of services and publishers, from the ROS master, also after it stopped answering or
was replaced.

A restarted master knows none of the running nodes. For what it has forgotten the last address is
used, and this node registers again. Every contact is bounded in time. rospy's own registrations are
not used for it: they wait for a master without a limit, and hold rospy's locks meanwhile.
"""
import contextlib
import threading
import time
from typing import Any, Dict, FrozenSet, Iterator, Mapping, NamedTuple, Set, Tuple

import rospy

from behavior_controller.robot.gateway import Cause, NO_ACTION, NOT_OFFERED
from behavior_controller.ros.tcpros import Trouble, ask, ask_master

QUERY_LIMIT = 1.5
"""Seconds after which a master that has not answered counts as away.

It is long enough for a lost first packet at 100 ms each way.
"""

SLOW = 0.8
"""Seconds that no answer of a master takes, unless a packet is lost."""

SLOW_IN_A_ROW = 4
"""A master is slow after this number of slow answers in a row: over a poor link a tenth are slow.
"""

NAME_IS_TAKEN = "new node registered with same name"
"""The master's reason when it asks a node to end because another has registered under its name."""

ROSOUT = "/rosout"


class Place(NamedTuple):
    """The address of a service, and whether the master lists it; otherwise it is the last known
    address."""

    uri: str
    is_listed: bool


class _Entry(NamedTuple):
    """Addresses, and the number of the registration under which the master listed them."""

    registration: int
    uris: Tuple[str, ...]


class Directory:
    """Asks the master, and remembers its answers. Any thread may ask; ``refresh`` belongs to one
    thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.registering = threading.Lock()
        """Held while this node registers anything: in between it checks whether another has taken
        its name."""
        self._services: Dict[str, _Entry] = {}
        self._topics: Dict[str, _Entry] = {}
        self._subscriptions: Dict[str, str] = {}  # topic: type
        self._publishing: Mapping[str, Any] = {}  # topic: names of the nodes that publish it
        self._offered: FrozenSet[str] = frozenset()
        self._is_registered = False
        self._registration = 0  # grows whenever the master has forgotten this node
        self._unanswered = 0  # rounds with an unanswered question since the last without
        self._has_failed = False  # a question of this round
        self._slow_answers = 0  # since the last that was not slow
        self.fault = ""
        """What is wrong with a master that is away: ``does not answer``, or how it answers."""

    @property
    def is_away(self) -> bool:
        """Whether the master did not answer in the last ``round``."""
        return self._unanswered >= 1

    @property
    def is_lost(self) -> bool:
        """Whether it failed in two rounds in a row: over a poor link one question in a hundred is
        lost."""
        return self._unanswered >= 2

    @property
    def is_slow(self) -> bool:
        """Whether it answers, but has answered slowly several times in a row."""
        return self._slow_answers >= SLOW_IN_A_ROW

    @property
    def forgotten(self) -> Set[str]:
        """The services and topics that a former master knew and this one does not."""
        with self._lock:
            known = list(self._services.items()) + list(self._topics.items())
            return {name for name, entry in known
                    if entry.registration != self._registration and name not in self._offered}

    # ------------------------------------------------------------------------------------- services

    def service(self, name: str, seconds: float, seconds_if_known: float = QUERY_LIMIT) -> Place:
        """Return the address of the service ``name``, or the last one if the master does not
        answer.

        ``seconds`` bounds each step of the lookup; ``seconds_if_known`` replaces it for a service
        that was found before. Raises ``Trouble`` if no node offers it, or if the master does not
        answer and the service was never found.
        """
        with self._lock:
            known = self._services.get(name, _Entry(0, ())).uris
        uri = None
        try:
            if not (known and self.is_away):
                limit = min(seconds, seconds_if_known) if known else seconds
                uri = ask_master("lookupService", name, seconds=limit)
                # a new master, which ``refresh`` has not seen yet, does not know this node either
                if uri or not known or ask_master(
                        "lookupNode", rospy.get_name(), seconds=QUERY_LIMIT):
                    known = self._settle(self._services, name, (uri,) if uri else ())
        except Trouble:
            if not known:
                raise
        if not known:
            raise Trouble(Cause.NOT_ADVERTISED, NOT_OFFERED)
        return Place(known[0], uri is not None)

    def _settle(self, entries: Dict[str, _Entry], name: str,
                uris: Tuple[str, ...]) -> Tuple[str, ...]:
        """Return the addresses that the master lists; if there are none and it has forgotten this
        node since, the earlier ones."""
        with self._lock:
            before = entries.get(name)
            if uris:
                entries[name] = _Entry(self._registration, uris)
            elif before is not None and before.registration != self._registration:
                return before.uris
            else:
                entries.pop(name, None)  # its node has unregistered
        return uris

    # --------------------------------------------------------------------------------------- topics

    def subscribe(self, topic: str, message_type: str) -> None:
        """Have ``refresh`` keep a subscription to ``topic`` registered."""
        self._subscriptions[topic] = message_type

    def publishers(self, topic: str, known: Mapping[str, str]) -> Tuple[str, ...]:
        """Return the addresses of the nodes that published ``topic`` at the last ``refresh``.

        ``known`` has addresses of nodes that need no lookup. Raises ``Trouble`` if the master does
        not answer.
        """
        uris = [known.get(node) or self._ask("lookupNode", node)
                for node in self._publishing.get(topic, ())]
        return self._settle(self._topics, topic, tuple(uri for uri in uris if uri))

    @staticmethod
    def server(action: str, seconds: float) -> str:
        """Return the address of the node that offers an action (resolved), as the master lists it
        now. Raises ``Trouble``."""
        publishers, _, _ = ask_master("getSystemState", seconds=seconds)
        for node in dict(publishers).get(action + "/status", ()):
            uri = ask_master("lookupNode", node, seconds=seconds)
            if uri:
                return uri
        raise Trouble(Cause.NOT_ADVERTISED, NO_ACTION)

    def is_published(self, topic: str) -> bool:
        """Return whether any node published ``topic`` at the last ``refresh``."""
        return topic in self._publishing

    @contextlib.contextmanager
    def round(self) -> Iterator[None]:
        """Count the round of questions inside as answered, or as unanswered."""
        self._has_failed = False
        try:
            yield
        finally:
            self._unanswered = self._unanswered + 1 if self._has_failed else 0

    def refresh(self) -> None:
        """Read the master's state, and register what it does not know. Raises ``Trouble`` without
        an answer."""
        publishers, subscribers, services = self._ask("getSystemState")
        ours = {topic for topic, nodes in publishers + subscribers if rospy.get_name() in nodes}
        # rospy registers /rosout first, so it is missing if another node of our name has removed
        # anything
        if self._subscriptions and not ours.issuperset({ROSOUT, *self._subscriptions}):
            self._register()
        with self._lock:
            self._publishing = dict(publishers)
            self._offered = frozenset(name for name, _ in publishers + services)

    def _ask(self, method: str, *arguments: Any) -> Any:
        """Call the master, and note if it fails to answer; its return is noted after a whole
        ``round``."""
        asked_at = time.monotonic()
        try:
            return ask_master(method, *arguments, seconds=QUERY_LIMIT)
        except Trouble as trouble:
            self.fault, self._has_failed = trouble.fault, True
            raise
        finally:
            is_slow = time.monotonic() - asked_at > SLOW
            self._slow_answers = self._slow_answers + 1 if is_slow else 0

    def _register(self) -> None:
        """Register the subscriptions, and what rospy had registered; end if another node has our
        name."""
        me, uri = rospy.get_name(), rospy.core.get_node_uri()
        with self.registering:
            if rospy.core.is_shutdown_requested():
                return
            if self._ask("lookupNode", me) in (None, uri):
                self._register_all(uri)
                return
        # the master asks the older node to end only once, and that may be lost
        rospy.signal_shutdown(NAME_IS_TAKEN)

    def _register_all(self, uri: str) -> None:
        if self._is_registered:
            self._is_registered = False
            with self._lock:
                self._registration += 1
        # a node that started at the same moment may have removed them
        for topic, message_type in ask(uri, "getPublications", seconds=QUERY_LIMIT):
            self._ask("registerPublisher", topic, message_type, uri)
        for topic, message_type in self._subscriptions.items():
            self._ask("registerSubscriber", topic, message_type, uri)
        self._is_registered = True

    def sign_off(self) -> None:
        """Unregister the subscriptions, if the master answers; rospy is shutting down, so none is
        registered later."""
        if self.is_away or not self.registering.acquire(timeout=QUERY_LIMIT):
            return
        try:
            for topic in self._subscriptions:
                ask_master("unregisterSubscriber", topic, rospy.core.get_node_uri(),
                           seconds=QUERY_LIMIT)
        except Trouble:
            pass
        finally:
            self.registering.release()


DIRECTORY = Directory()
"""The directory of this process, as rospy has one node for each process."""
