"""What the nodes of a test register at the master, and which living nodes of others hold any of it.

ROS gives a name to the node that registers it last, and shuts the earlier one down. So a test asks
first, and again while it runs. A master's entry outlives its node: where no process listens any
more, nothing is held. A node that does not answer holds what it has: it may be frozen, or its link
down.
"""
import os
import socket
from contextlib import suppress
from functools import partial
from typing import Any, Callable, Dict, FrozenSet, Iterable, List, NamedTuple, Sequence, Tuple

import rosgraph
import rosgraph.network
from rosgraph.names import get_ros_namespace, load_mappings, resolve_name

from behavior_controller.ros.master import NAME_IS_TAKEN, USE_SIM_TIME
from behavior_controller.ros.types import CLOCK
from behavior_controller.ros.timeouts import Late, run_apart, run_together
from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import ConfigurationError, Fault, NodesMissing
from behavior_controller.robot.declarations import Action
from behavior_controller.ros.tcpros import NO_ANSWER, Trouble, ask, ask_master
from behavior_controller.simulation import behaviour
from behavior_controller.simulation.simulated_node import offers_of

from unit_tests.folders import note, noted
from unit_tests.robot.options import Arguments, CLOCK_NODE, Options, SPEED, USE_REAL

CONTROLLER, REPORT = "behaviorController", "behaviorControllerTest"
"""The nodes of a test that are not the robot's."""

ANSWER_LIMIT = 3.0
"""Seconds after which a node counts as unable to answer, and a master as out of order."""

_UNKNOWN = 0
"""The process of a node that does not answer."""

REPLACED = "replaced"
"""File in the folder of a test's run with a line about the first node that was replaced."""

_GONE = (ConnectionRefusedError, socket.gaierror)
"""What shows that no process of a node is left, or that none was ever here."""

CLAIMS_LIMIT = 20.0
"""Seconds for all answers together."""


class Claim(NamedTuple):
    """What a node of a test registers. ``resources`` are services and topics that only one node may
    have."""

    node: str  # as the launch files name it
    name: str  # its resolved name
    resources: FrozenSet[str] = frozenset()


class Holder(NamedTuple):
    """A node that is not of this launch and holds a part of a claim."""

    claim: Claim
    name: str
    resources: Tuple[str, ...]
    machine: str
    process: int

    @property
    def fault(self) -> Fault:
        """The reason why the claiming node must not start, and what a person can do."""
        holds = "runs already"
        if self.name != self.claim.name:
            holds = "already has " + ", ".join(self.resources)
        hint = "stop it, or test under a master of its own (ROS_MASTER_URI)"
        if self.claim.node in behaviour.NODES:
            hint = f"{USE_REAL[self.claim.node]}:=true leaves the simulated one out; or stop it"
        elif self.claim.node == CLOCK_NODE:
            hint = f"without {SPEED.name} the test goes by that clock; or stop it"
        return Fault("node " + self.name, 0, 0, f"it {holds} {self._place}", hint)

    @property
    def replacement(self) -> str:
        """A line for a verdict: how it came into a running test."""
        if self.name == self.claim.name:
            return f"node {self.name} was replaced during the test by another one {self._place}"
        return (f"during the test {', '.join(self.resources)} came from node {self.name} "
                f"{self._place}, not from {self.claim.name} alone")

    @property
    def _place(self) -> str:
        place = f"on machine {self.machine}, "
        if self.process == _UNKNOWN:
            return place + "and does not answer (rosnode cleanup if it is gone)"
        return place + f"process {self.process}"


class NoMaster(NodesMissing):
    """No program listens where the master should be."""


class Taken(ConfigurationError):
    """Living nodes hold what is claimed."""


class OneTaken(Taken):
    """They hold what one node claims: others of the launch run, and go on without it."""


# ---------------------------------------------------------------------------------- what is claimed


def of_test(options: Options, others: Sequence[str] = (CONTROLLER, REPORT)) -> List[Claim]:
    """Return the claims of all nodes of a test with these options: the simulated ones and
    ``others``."""
    robot = options.world.settings.interface
    simulated = [node for node in behaviour.nodes(robot) if node in options.arguments.simulated]
    clocks = [CLOCK_NODE] * options.has_clock
    return [_claim(node, node, options) for node in [*clocks, *simulated, *others]]


def of_process(node: str, options: Options) -> List[Claim]:
    """Return the claims of the launch that started this process, or of this node if it was started
    alone."""
    if options.arguments.is_launched:
        return of_test(options)
    if options.arguments.is_in_launch:
        return of_test(options, ())
    return [_claim(node, load_mappings(options.words).get("__name", node), options)]


def _claim(node: str, name: str, options: Options) -> Claim:
    offers = offers_of(node, options.world.settings.interface, options.test)
    resources = [service.name + ("/result" if isinstance(service, Action) else "")
                 for service in offers.services]
    resources += [CLOCK.name] * (node == CLOCK_NODE)
    if offers.topic is not None:
        resources.append(offers.publisher + ("/result" if offers.action is not None else ""))
    return Claim(node, _resolved(name, options.words),
                 frozenset(_resolved(resource, options.words) for resource in resources))


def _resolved(name: str, words: List[str]) -> str:
    """Return a name as rospy will resolve it in a process with that command line."""
    node = get_ros_namespace(argv=words) + "node"  # names are relative to that of a node
    mappings = {resolve_name(one, node): resolve_name(other, node)
                for one, other in load_mappings(words).items() if not one.startswith("__")}
    return resolve_name(name, node, mappings)


# ------------------------------------------------------------------------------------- who holds it


def check(node: str, options: Options) -> None:
    """Raise ``Taken`` if ``node`` must not start in this process.

    In a launch of which nothing runs yet, that is so if any claim of the launch is held; later, if
    its own is. Raises ``NodesMissing`` without a master that answers.
    """
    others, is_under_way = find_others(of_process(node, options), options.arguments)
    if is_under_way or not options.arguments.is_in_launch:
        others = [holder for holder in others if holder.claim.node == node]
    if others:
        raise (OneTaken if is_under_way else Taken)([holder.fault for holder in others])


def check_controller(options: Options) -> None:
    """Do the same for the controller, and delete the parameters below its name: roslaunch would
    delete them unchecked."""
    with suppress(NodesMissing):  # the controller reports a missing master
        check(CONTROLLER, options)
        _ask_master("deleteParam", _resolved(CONTROLLER, options.words))
        if options.has_clock:  # its node may not be there yet
            simulate_time()


def simulate_time() -> None:
    """Have nodes that start from now on go by /clock. A launch file would set the parameter for a
    launch that is refused too, and for later ones."""
    _ask_master("setParam", USE_SIM_TIME, True)


def end_simulated_time() -> None:
    """Have nodes that start from now on go by the computer's time again."""
    with suppress(NodesMissing):
        _ask_master("deleteParam", USE_SIM_TIME)


def is_time_simulated(options: Options) -> bool:
    """Return whether the nodes of a test go by /clock: that of the test, or that of a simulator."""
    return options.has_clock or _ask_master("getParam", USE_SIM_TIME) is True


def check_test(options: Options) -> None:
    """Raise ``Taken`` if a test with these options would displace a node, ``NodesMissing`` if the
    master is mute."""
    with suppress(NoMaster):  # roslaunch starts one
        others, _ = find_others(of_test(options), options.arguments)
        if others:
            raise Taken([holder.fault for holder in others])


def note_replacement(node: str, options: Options, reason: str) -> None:
    """Write how this process' node was replaced, if the master ends it for that ``reason``, for the
    report, which asks the master only now and then."""
    if NAME_IS_TAKEN in reason and options.arguments.is_launched:
        name = _resolved(node, options.words)
        gone = f"node {name} was replaced during the test by another one, which is gone"
        note(options.arguments.folder, REPLACED, replacement(options) or gone)


def replacement(options: Options) -> str:
    """Return a line about a node that has, or had, the place of one of the report's launch; empty
    without any."""
    claims, arguments = of_process(REPORT, options), options.arguments
    known = noted(arguments.folder, REPLACED)
    with suppress(NodesMissing):  # the controller's record shows what a lost master leads to
        # twice: a node of ours that ends between its answer and the check of its process looks like
        # another's
        if not known and find_others(claims, arguments)[0]:
            known = "".join(other.replacement for other in find_others(claims, arguments)[0][:1])
    return known


def find_others(claims: Sequence[Claim], arguments: Arguments) -> Tuple[List[Holder], bool]:
    """Return the living nodes of others that hold a claim, and whether any node of this launch
    runs.

    Raises ``NodesMissing`` if the master does not answer as a master does.
    """
    try:
        holders: List[Holder] = run_apart(lambda: _holders(claims), WakeUp(), lambda: False,
                                          CLAIMS_LIMIT)
    except Late:
        raise NodesMissing(f"the ROS master at {rosgraph.get_master_uri()} did not answer all "
                           f"questions within {CLAIMS_LIMIT:g} s")
    others = [holder for holder in holders if not _is_of_this_launch(holder, arguments)]
    return others, len(others) < len(holders)


def _holders(claims: Sequence[Claim]) -> List[Holder]:
    """Return the living nodes that hold a claim, of this launch and of others."""
    publishers, _, services = _ask_master("getSystemState")
    listed = dict(publishers + services)
    held: Dict[Tuple[Claim, str], List[str]] = {(claim, claim.name): [] for claim in claims}
    for claim in claims:
        for resource in sorted(claim.resources):
            for node in listed.get(resource, ()):
                held.setdefault((claim, node), []).append(resource)
    living = _living({node for _, node in held})
    return [Holder(claim, node, tuple(resources), *living[node])
            for (claim, node), resources in held.items() if node in living]


def _living(nodes: Iterable[str]) -> Dict[str, Tuple[str, int]]:
    """Return machine and process of each of the nodes whose process has not ended."""
    uris = {node: _ask_master("lookupNode", node) for node in sorted(nodes)}
    answers: Dict[str, Tuple[str, int]] = {}

    def greet(node: str, uri: str) -> None:
        try:
            process = _ask_twice(partial(ask, uri, "getPid", seconds=ANSWER_LIMIT))
        except Trouble as trouble:
            if not _is_silent(trouble):
                return
            process = _UNKNOWN
        answers[node] = uri.rpartition(":")[0].partition("//")[2], process

    run_together([partial(greet, node, uri) for node, uri in uris.items() if uri],
                 2 * ANSWER_LIMIT + 1.0)
    return dict(answers)


def _ask_master(method: str, *values: Any) -> Any:
    """Return the master's answer; None if it reports a failure."""
    try:
        return _ask_twice(partial(ask_master, method, *values, seconds=ANSWER_LIMIT))
    except Trouble as trouble:
        if isinstance(trouble.__cause__, ConnectionRefusedError):
            uri = rosgraph.get_master_uri()
            raise NoMaster(f"no ROS master at {uri}: start roscore, or use the launch file")
        raise NodesMissing(str(trouble))


def _ask_twice(question: Callable[[], Any]) -> Any:
    """Return an answer. Silence is answered by a second question; raises ``Trouble``.

    On a computer that starts ten nodes at once an answer may come late. A node that is just ending
    does not answer, and is gone then.
    """
    try:
        return question()
    except Trouble as trouble:
        if not _is_silent(trouble):
            raise
    return question()


def _is_silent(trouble: Trouble) -> bool:
    """Return whether what was asked may be there: it is not if its entry outlived it (refused), or
    if another program has its port (it answers otherwise)."""
    return trouble.fault == NO_ANSWER and not isinstance(trouble.__cause__, _GONE)


def _is_of_this_launch(holder: Holder, arguments: Arguments) -> bool:
    """Return whether the roslaunch that started this process started that node too."""
    if not arguments.is_in_launch or holder.name != holder.claim.name:
        return False
    is_here = holder.machine == rosgraph.network.get_host_name()
    # a node of ours may be slow to answer while ten processes start
    return is_here and (holder.process == _UNKNOWN or _descends(holder.process, os.getppid()))


def _descends(process: int, ancestor: int) -> bool:
    with suppress(OSError):  # there is no such process
        while process > 1 and process != ancestor:
            with open("/proc/{}/stat".format(process)) as file:
                process = int(file.read().rpartition(")")[2].split()[1])
    return process == ancestor > 1
