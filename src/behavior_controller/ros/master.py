"""What the ROS master knows: the addresses of services and publishers, also after it stopped
answering or was replaced, and this node's name.

A restarted master knows none of the running nodes. For what it has forgotten the last address is
used, and this node registers again. Every contact is bounded in time. rospy's own registrations are
not used for it: they wait for a master without a limit, and hold rospy's locks meanwhile.

A master keeps one node for each name: the last that registered anything. It asks the one before to
end. Several nodes that start at the same moment register in turn, so that the master asks each of
them to end. So a node that is asked checks who has the name after its own registrations are
complete: the registered node stays, and a node that gives way registers nothing any more. Thus
exactly one node stays, whatever the order was.
"""
import contextlib
import socket
import threading
import time
import urllib.parse
from typing import Any, Dict, FrozenSet, Iterator, List, Mapping, NamedTuple, Optional, Set, Tuple

import rosgraph
import rospy
import rospy.impl.init
from rospy.impl.masterslave import ROSHandler
from rospy.impl.paramserver import get_param_server_cache
from rospy.impl.registration import Registration, get_service_manager, get_topic_manager

from behavior_controller.errors import ConfigurationError, NodesMissing
from behavior_controller.robot.gateway import Cause, NO_ACTION, NOT_OFFERED
from behavior_controller.ros.names import enter
from behavior_controller.ros.tcpros import Named, Trouble, ask, ask_master
from behavior_controller.ros.timeouts import Stopped

QUERY_LIMIT = 1.5
"""Seconds after which a master that has not answered counts as away.

It is long enough for a lost first packet at 100 ms each way.
"""

SLOW_ANSWER = 0.8
"""Seconds that no answer of a master takes, unless a packet is lost."""

NAME_IS_TAKEN = "new node registered with same name"
"""The master's reason when it asks a node to end because another has registered under its name."""

ROSOUT_TOPIC = "/rosout"

NO_TOPICS_IN_ROSOUT = "/rosout_disable_topics_generation"

USE_SIM_TIME = "/use_sim_time"
"""The parameter that says whether time is simulated."""

IN_USE_METHOD = "servicesInUse"
"""The question to another controller: see ``_Handler``."""

PARTING_LIMIT = 2.5
"""Seconds that the former node of the name may take to end; ours take 2 at most."""


class Place(NamedTuple):
    """The address of a service, and whether the master lists it; otherwise it is the last known
    address."""

    uri: str
    is_listed: bool


class Directory:
    """Asks the master, and remembers its answers. Any thread may ask; ``refresh`` belongs to one
    thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.registering = threading.Lock()
        """Held while this node registers anything: in between it checks whether another has taken
        its name."""
        # addresses by kind and name: those that this master lists, and those of a former one
        self._known: Dict[Tuple[str, str], Tuple[str, ...]] = {}
        self._former: Dict[Tuple[str, str], Tuple[str, ...]] = {}
        self.is_keeping_up = False
        """Whether ``refresh`` registers what the master does not know."""
        self._subscriptions: Dict[str, str] = {}  # topic: type
        self._publishing: Mapping[str, Any] = {}  # topic: names of the nodes that publish it
        self._offered: FrozenSet[str] = frozenset()
        self.unanswered = 0
        """Rounds with an unanswered question since the last without."""
        self._has_failed = self._is_short = False  # a question of this round
        self.slow_answers = 0
        """Slow answers since the last that was not slow."""
        self.fault = ""
        """What is wrong with a master that is away: ``does not answer``, or how it answers."""

    @property
    def forgotten(self) -> Set[str]:
        """The services and topics that a former master knew and this one does not."""
        with self._lock:
            return {name for _, name in self._former}.difference(self._offered)

    # ------------------------------------------------------------------------------------- services

    def service(self, name: str, seconds: float, seconds_if_known: float = QUERY_LIMIT) -> Place:
        """Return the address of the service ``name``, or the last one if the master does not
        answer.

        ``seconds`` bounds each step of the lookup; ``seconds_if_known`` replaces it for a service
        that was found before. Raises ``Trouble`` if no node offers it, or if the master does not
        answer and the service was never found.
        """
        key, uri = ("service", name), None
        with self._lock:
            known = self._known.get(key) or self._former.get(key, ())
        try:
            if not (known and self.unanswered):
                limit = min(seconds, seconds_if_known) if known else seconds
                uri = ask_master("lookupService", name, seconds=limit)
                # a new master, which ``refresh`` has not seen yet, does not know this node either
                if uri or not known or ask_master(
                        "lookupNode", rospy.get_name(), seconds=QUERY_LIMIT):
                    known = self._settle(key, (uri,) if uri else ())
        except Trouble:
            if not known:
                raise
        if not known:
            raise Trouble(Cause.NOT_ADVERTISED, NOT_OFFERED)
        return Place(known[0], uri is not None)

    def _settle(self, key: Tuple[str, str], uris: Tuple[str, ...]) -> Tuple[str, ...]:
        """Return the addresses that the master lists; if there are none and it has forgotten this
        node since, the earlier ones."""
        with self._lock:
            if uris:
                self._known[key] = uris
                self._former.pop(key, None)
            else:
                self._known.pop(key, None)  # its node has unregistered
            return uris or self._former.get(key, ())

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
        return self._settle(("topic", topic), tuple(uri for uri in uris if uri))

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
        """Count the round of questions inside as answered, or as unanswered; as neither if this
        computer could not ask."""
        self._has_failed = self._is_short = False
        try:
            yield
        finally:
            if self._has_failed:
                self.unanswered += 1
            elif not self._is_short:
                self.unanswered = 0

    def refresh(self) -> None:
        """Read the master's state, and register what it does not know (``is_keeping_up``). Raises
        ``Trouble`` without an answer."""
        publishers, subscribers, services = self._ask("getSystemState")
        missing = self._missing(publishers, subscribers, services)
        if self.is_keeping_up and missing:
            self._register(missing)
        with self._lock:
            self._publishing = dict(publishers)
            self._offered = frozenset(name for name, _ in publishers + services)

    def _missing(self, publishers: Named, subscribers: Named,
                 services: Named) -> List[Tuple[str, str, str]]:
        """Return what this node has and the master does not list: the method that registers it, its
        name, and its type or address."""
        me, topics = rospy.get_name(), get_topic_manager()
        subscribed = {**dict(topics.get_subscriptions()), **self._subscriptions}
        # without rospy's lock, which it holds while it waits for a master
        offered = [(name, service.uri) for name, service in list(get_service_manager().map.items())]
        kinds = [("registerPublisher", topics.get_publications(), dict(publishers)),
                 ("registerSubscriber", subscribed.items(), dict(subscribers)),
                 ("registerService", offered, dict(services))]
        return [(method, name, value) for method, own, nodes in kinds
                for name, value in own if me not in nodes.get(name, ())]

    def _ask(self, method: str, *arguments: Any) -> Any:
        """Call the master, and note if it fails to answer; its return is noted after a whole
        ``round``."""
        asked_at = time.monotonic()
        try:
            return ask_master(method, *arguments, seconds=QUERY_LIMIT)
        except Trouble as trouble:
            if trouble.shortage is not None:
                self._is_short = True
            else:
                self.fault, self._has_failed = trouble.fault, True
            raise
        finally:
            is_slow = time.monotonic() - asked_at > SLOW_ANSWER
            self.slow_answers = self.slow_answers + 1 if is_slow else 0

    def register(self, *topics: rospy.topics.Topic) -> None:
        """Register topics of this node once more: the master then sends each side the addresses of
        the other. Raises ``Trouble`` without an answer."""
        kinds = {Registration.PUB: "registerPublisher", Registration.SUB: "registerSubscriber"}
        self._register([(kinds[each.reg_type], each.resolved_name, each.type) for each in topics])

    def _register(self, missing: List[Tuple[str, str, str]]) -> None:
        """Register what is missing; end if another node has our name."""
        me, uri = rospy.get_name(), rospy.core.get_node_uri()
        with self.registering:
            if rospy.core.is_shutdown_requested():
                return
            if self._ask("lookupNode", me) in (None, uri):
                self._register_all(missing, uri)
                return
        # the master asks the older node to end only once, and that may be lost
        rospy.signal_shutdown(NAME_IS_TAKEN)

    def _register_all(self, missing: List[Tuple[str, str, str]], uri: str) -> None:
        # rospy registers /rosout first of all: without it the master has forgotten this node
        if rospy.resolve_name(ROSOUT_TOPIC) in (name for _, name, _ in missing):
            with self._lock:
                self._former.update(self._known)
                self._known.clear()
        for method, name, value in missing:
            answer = self._ask(method, name, value, uri)
            if method == "registerSubscriber" and answer:
                # rospy connects to the publishers that it is told of
                ask(uri, "publisherUpdate", name, answer, seconds=QUERY_LIMIT)

    def sign_off(self) -> None:
        """Unregister the subscriptions, if the master answers; rospy is shutting down, so none is
        registered later."""
        if self.unanswered or not self.registering.acquire(timeout=QUERY_LIMIT):
            return
        with contextlib.suppress(Trouble):
            for topic in self._subscriptions:
                ask_master("unregisterSubscriber", topic, rospy.core.get_node_uri(),
                           seconds=QUERY_LIMIT)
        self.registering.release()


DIRECTORY = Directory()
"""The directory of this process, as rospy has one node for each process."""


class ServicesInUse:
    """The resolved names of the services that this controller asks, and whether it runs."""

    services: FrozenSet[str] = frozenset()
    is_running = False


IN_USE = ServicesInUse()
"""Those of this process."""


# ------------------------------------------------------------------------------- the node's name


def adopt(name: str, argv: List[str]) -> Any:
    """Have rospy resolve names as the node ``name`` does, without registering it at the master.
    Return the value of ``USE_SIM_TIME``.

    Raises NodesMissing if no master answers, and ConfigurationError as ``set_names``.
    """
    is_silent = ask_at_start("getParam", NO_TOPICS_IN_ROSOUT)
    # rospy would ask the master at each line for /rosout. A master that hangs would hold the lines
    # back, and that question registers the node: asked by a node whose name was taken, it would
    # shut down the one that took it.
    get_param_server_cache().set(NO_TOPICS_IN_ROSOUT, bool(is_silent))
    set_names(name, argv)
    # leaves are set up before the name is taken, and may ask for the time
    rospy.rostime.set_rostime_initialized(True)
    return ask_at_start("getParam", USE_SIM_TIME)


def set_names(name: str, argv: List[str]) -> None:
    """Have rospy resolve names as the node ``name`` with that command line does. Raises
    ConfigurationError for a ``__name`` that is not allowed."""
    enter(argv)
    rospy.names.reload_mappings(argv)
    name = rospy.names.get_mappings().get("__name", name)
    if not rosgraph.names.is_legal_base_name(name):
        raise ConfigurationError.of(
            "argument __name:=" + name, "this is not the name of a node",
            "allowed: a letter, then letters, digits and _; __ns:= sets the namespace")
    resolved = rosgraph.names.resolve_name(name, rospy.get_name())
    rospy.names._set_caller_id(resolved)
    rospy.names.initialize_mappings(resolved)


def ask_at_start(method: str, *arguments: str) -> Any:
    """Return the master's answer. Raises NodesMissing without one."""
    try:
        return ask_master(method, *arguments)
    except Trouble as trouble:
        if trouble.shortage is not None:
            raise trouble.shortage
        if isinstance(trouble.__cause__, ConnectionRefusedError):
            raise NodesMissing(f"no ROS master at {rosgraph.get_master_uri()}: start roscore or "
                               "the robot, or set ROS_MASTER_URI")
        raise NodesMissing(f"{trouble}; check roscore's computer and ROS_MASTER_URI")


def join(name: str, argv: List[str]) -> Optional[str]:
    """Register the node ``name`` at the master; a running node of that name ends.

    Return the address of the former node if it has not ended in ``PARTING_LIMIT`` seconds. Raises
    ``Stopped``, ConfigurationError, and NodesMissing without a master.
    """
    former = ask_at_start("lookupNode", rospy.get_name())
    rospy.impl.init.ROSHandler = _Handler
    try:
        with DIRECTORY.registering:
            # the time is that of ``SimulatedTime``, which does not wait for a master
            rospy.init_node(name, argv=argv, disable_signals=True, disable_rostime=True)
    except (rospy.ROSException, ValueError) as error:
        if rospy.is_shutdown():
            raise Stopped("rospy has ended meanwhile")  # and has reported the reason
        raise ConfigurationError.of("command line", str(error))
    if former in (None, rospy.core.get_node_uri()) or _ends(former):
        return None
    return former


class _Handler(ROSHandler):
    """Answers the master and other nodes in rospy's place."""

    def servicesInUse(self, caller_id: str) -> object:
        """Tell another controller whether this one runs, and which services it asks."""
        return 1, "services", [IN_USE.is_running, sorted(IN_USE.services)]

    def shutdown(self, caller_id: str, msg: str = "") -> object:
        """End the node, unless the reason is another node of its name, and that one is not
        registered."""
        if NAME_IS_TAKEN in msg and _has_name():
            return 1, "the name is still taken by this node", 0
        return super().shutdown(caller_id, msg)


def _has_name() -> bool:
    """Return whether no other node has our name, once our registrations under way are complete."""
    with DIRECTORY.registering:
        try:
            return ask_master("lookupNode", rospy.get_name()) in (None, rospy.core.get_node_uri())
        except Trouble:
            return False


def _ends(uri: str) -> bool:
    """Return whether the process of the node at ``uri`` ends in time: its end closes every
    connection."""
    address = urllib.parse.urlsplit(uri)
    try:
        with socket.create_connection((address.hostname, address.port),
                                      PARTING_LIMIT) as connection:
            return not connection.recv(1)
    except socket.timeout:
        return False
    except (OSError, ValueError, TypeError):
        return True
