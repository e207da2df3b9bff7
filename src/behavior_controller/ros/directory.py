"""The addresses of services and publishers, from the ROS master, also after it stopped answering or was replaced.

A restarted master knows none of the running nodes. For what it has forgotten the last address is used, and this node
registers again. Every contact is bounded in time. rospy's own registrations are not used for it: they wait for a master
without a limit, and hold rospy's locks meanwhile.
"""
import threading
import time
from typing import Any, Dict, FrozenSet, Mapping, NamedTuple, Optional, Set, Tuple

import rospy

from behavior_controller.gateway import Cause
from behavior_controller.ros.connection import Trouble, ask, ask_master

LOOK_LIMIT = 1.5
"""Seconds after which a master that has not answered counts as away."""

FAREWELL_LIMIT = 0.2
"""Seconds to unregister each subscription at the end of the process."""


class Place(NamedTuple):
    """The address of a service, and whether the master lists it; otherwise it is the last known address."""

    uri: str
    is_listed: bool


class _Entry(NamedTuple):
    """Addresses, and the number of the registration under which the master listed them."""

    registration: int
    uris: Tuple[str, ...]


class Directory:
    """Asks the master, and remembers its answers. Any thread may ask; ``look`` belongs to one thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._services: Dict[str, _Entry] = {}
        self._topics: Dict[str, _Entry] = {}
        self._subscriptions: Dict[str, str] = {}  # topic: type
        self._publishing: Mapping[str, Any] = {}  # topic: names of the nodes that publish it
        self._offered: FrozenSet[str] = frozenset()
        self._is_registered = False
        self._registration = 0  # grows whenever the master has forgotten this node
        self._asked_at: Optional[float] = None  # when the unanswered question was asked
        self._unanswered = 0  # questions since the last answer

    @property
    def is_away(self) -> bool:
        """Whether the master did not answer at the last ``look``, or has not answered for too long."""
        return self._unanswered + self._is_late >= 1

    @property
    def is_lost(self) -> bool:
        """Whether it failed to answer twice in a row: over a poor link one question in a hundred is lost."""
        return self._unanswered + self._is_late >= 2

    @property
    def _is_late(self) -> bool:
        asked_at = self._asked_at
        return asked_at is not None and time.monotonic() - asked_at > LOOK_LIMIT

    @property
    def forgotten(self) -> Set[str]:
        """The services and topics that a former master knew and this one does not."""
        with self._lock:
            known = list(self._services.items()) + list(self._topics.items())
            return {name for name, entry in known
                    if entry.registration != self._registration and name not in self._offered}

    # -------------------------------------------------------------------------------------------------------- services

    def service(self, name: str, seconds: float, seconds_if_known: float = LOOK_LIMIT) -> Place:
        """Return the address of the service ``name``, or the last one if the master does not answer.

        ``seconds`` bounds each step of the lookup; ``seconds_if_known`` replaces it for a service that was found before.
        Raises ``Trouble`` if no node offers it, or if the master does not answer and the service was never found.
        """
        with self._lock:
            known = self._services.get(name, _Entry(0, ())).uris
        if known and self.is_away:
            return Place(known[0], False)
        try:
            uri = ask_master("lookupService", name, seconds=min(seconds, seconds_if_known) if known else seconds)
            if uri is None and known and self._is_unknown_to_master():
                return Place(known[0], False)
        except Trouble:
            if not known:
                raise
            return Place(known[0], False)
        found = self._settle(self._services, name, (uri,) if uri else ())
        if not found:
            raise Trouble(Cause.NOT_ADVERTISED, "no node offers this service")
        return Place(found[0], uri is not None)

    @staticmethod
    def _is_unknown_to_master() -> bool:
        """Return whether the master is a new one, which ``look`` has not seen yet."""
        return ask_master("lookupNode", rospy.get_name(), seconds=LOOK_LIMIT) is None

    def _settle(self, entries: Dict[str, _Entry], name: str, found: Tuple[str, ...]) -> Tuple[str, ...]:
        """Return ``found``; if it is empty and the master has forgotten this node since, the earlier result."""
        with self._lock:
            before = entries.get(name)
            if found:
                entries[name] = _Entry(self._registration, found)
            elif before is not None and before.registration != self._registration:
                return before.uris
            else:
                entries.pop(name, None)  # its node has unregistered
        return found

    # ---------------------------------------------------------------------------------------------------------- topics

    def subscribe(self, topic: str, message_type: str) -> None:
        """Have ``look`` keep a subscription to ``topic`` registered."""
        self._subscriptions[topic] = message_type

    def publishers(self, topic: str, known: Mapping[str, str]) -> Tuple[str, ...]:
        """Return the addresses of the nodes that published ``topic`` at the last ``look``.

        ``known`` has addresses of nodes that need no lookup. Raises ``Trouble`` if the master does not answer.
        """
        uris = [known.get(node) or self._ask("lookupNode", node) for node in self._publishing.get(topic, ())]
        return self._settle(self._topics, topic, tuple(uri for uri in uris if uri))

    def is_published(self, topic: str) -> bool:
        """Return whether any node published ``topic`` at the last ``look``."""
        return topic in self._publishing

    def look(self) -> None:
        """Read the master's state, and register what it does not know. Raises ``Trouble`` without an answer."""
        publishers, subscribers, services = self._ask("getSystemState") or ([], [], [])
        ours = {topic for topic, nodes in subscribers if rospy.get_name() in nodes}
        if not ours.issuperset(self._subscriptions):
            self._register()
        with self._lock:
            self._publishing = dict(publishers)
            self._offered = frozenset(name for name, _ in publishers + services)
        self._unanswered = 0  # only now it is known whether the master is a new one

    def _ask(self, method: str, *arguments: Any) -> Any:
        """Call the master, and note if it does not answer; its return is noted only after a whole ``look``."""
        self._asked_at = time.monotonic()
        try:
            return ask_master(method, *arguments, seconds=LOOK_LIMIT)
        except Trouble:
            self._unanswered += 1
            raise
        finally:
            self._asked_at = None

    def _register(self) -> None:
        """Register the subscriptions; with a master that has forgotten this node, also what rospy had registered."""
        me, uri = rospy.get_name(), rospy.core.get_node_uri()
        if self._ask("lookupNode", me) not in (None, uri) or rospy.core.is_shutdown_requested():
            return  # a newer node has our name and must keep it
        if self._is_registered:
            self._is_registered = False
            with self._lock:
                self._registration += 1
        if self._registration:
            for topic, message_type in ask(uri, "getPublications", seconds=LOOK_LIMIT) or ():
                self._ask("registerPublisher", topic, message_type, uri)
        for topic, message_type in self._subscriptions.items():
            self._ask("registerSubscriber", topic, message_type, uri)
        self._is_registered = True

    def sign_off(self) -> None:
        """Unregister the subscriptions, if the master answers."""
        try:
            for topic in self._subscriptions if self._is_registered and not self.is_away else ():
                ask_master("unregisterSubscriber", topic, rospy.core.get_node_uri(), seconds=FAREWELL_LIMIT)
        except Trouble:
            pass


DIRECTORY = Directory()
"""The directory of this process, as rospy has one node for each process."""
