"""The findings of a rehearsal: one declaration for each kind, with its meaning and how it is detected in a play."""
from typing import Callable, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.status import NAMES, IDLE
from behavior_controller.events import LeafFinished, Noticed, PassFinished, Recovered
from behavior_controller.gateway import Cause
from behavior_controller.interface import Sense
from behavior_controller.interface.records import GoTo, Prompt
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.recovery import SKIPPED
from behavior_controller.text import clean

from unit_tests.stage import BUSY, START, Played, Stage
from unit_tests.visitor import ENGAGES

END_SHARE = 0.2
"""A mission that sends requests in this last share of its time repeats itself; any other is waiting."""


class Look(NamedTuple):
    """A play of one visitor's pass, and its scene. ``calm``: the outcome of the same pass without faults."""

    stage: Stage
    played: Played
    behaviour: str
    faults: int  # injected, and topics that were silent
    calm: str = ""

    @property
    def outcome(self) -> str:
        """SUCCESS or FAILURE; empty if the pass did not end."""
        return next((event.outcome for _, event in self.played.events if isinstance(event, PassFinished)), "")

    def of_leaves(self) -> Iterator[Tuple[float, LeafFinished, MissionSpec]]:
        """Yield each end of a mission leaf, with its time and node type."""
        nodes = self.stage.mission.tree.nodes
        for at, event in self.played.events:
            if isinstance(event, LeafFinished):
                spec = nodes[event.uid - 1].spec
                assert isinstance(spec, MissionSpec)
                yield at, event, spec

    def drives(self) -> List[GoTo]:
        """Return the requests to drive."""
        return [request for _, request in self.played.asked if isinstance(request, GoTo)]

    def is_visitor_here(self, at: float) -> bool:
        """Return whether a visitor was present at that time."""
        return next((is_here for since, is_here in reversed(self.played.presence) if since <= at), False)


Seen = Tuple[str, str]
"""Where something is wrong (a node of the mission, or a name), and what is wrong, in words."""


class Kind(NamedTuple):
    """A kind of finding. ``see`` yields its places in a play; ``means`` explains it to the author of the mission."""

    name: str
    means: str
    see: Callable[[Look], Iterator[Seen]]


# ------------------------------------------------------------------------------------------------------------- no end


def _busy(look: Look) -> Iterator[Seen]:
    if look.played.cut_off == BUSY:
        yield _where_it_waits(look), "it is ticked again and again and waits for nothing"


def _endless(look: Look) -> Iterator[Seen]:
    if _is_cut_off(look) and _repeats_itself(look):
        last = [event for _, event, _ in look.of_leaves()][-1]
        yield last.path, "after {:.0f} s it still repeats itself".format(look.played.seconds)


def _waits(look: Look) -> Iterator[Seen]:
    if _is_cut_off(look) and not _repeats_itself(look) and not waits_for_a_visitor(look):
        yield _where_it_waits(look), "after {:.0f} s it still waits here".format(look.played.seconds)


def _is_cut_off(look: Look) -> bool:
    return look.played.exit_code is None and look.played.cut_off != BUSY


def _repeats_itself(look: Look) -> bool:
    return any(at > START + look.played.seconds * (1 - END_SHARE) for at, _ in look.played.asked)


def waits_for_a_visitor(look: Look) -> bool:
    """Return whether no visitor has been seen to the end: a robot may wait for a visitor without a limit."""
    if not _is_cut_off(look) or _repeats_itself(look):
        return False
    nodes = look.stage.mission.tree.nodes
    seekers = [(event, spec) for _, event, spec in look.of_leaves() if Sense.VISITOR in spec.listens]
    if any(event.status == "SUCCESS" for event, _ in seekers):
        return False
    waiting = [nodes[uid - 1].spec for uid in look.played.waiting]
    return bool(seekers) or any(isinstance(spec, MissionSpec) and Sense.VISITOR in spec.listens for spec in waiting)


def _where_it_waits(look: Look) -> str:
    nodes = look.stage.mission.tree.nodes
    return nodes[look.played.waiting[-1] - 1].full_path if look.played.waiting else ""


# ------------------------------------------------------------------------------------------------------- what goes wrong


def _exceptions(look: Look) -> Iterator[Seen]:
    if look.played.error:
        yield "", look.played.error
    for _, event in look.played.events:
        if isinstance(event, Noticed) and event.level == "error":
            yield "", event.text


def _missing_data(look: Look) -> Iterator[Seen]:
    for _, event, spec in look.of_leaves():
        # pressing nothing is the visitor's answer, and a recovery reports another node's failure
        if event.failure is not None and event.failure.cause is Cause.MISSING_DATA \
                and Prompt not in spec.calls and not (spec.is_recovery and event.failure.resource):
            yield event.path, event.failure.message


def _senseless(look: Look) -> Iterator[Seen]:
    for line in look.played.journal:
        if line.objection is not None:
            yield line.resource, line.objection


def _unrecovered(look: Look) -> Iterator[Seen]:
    """Find a single fault that ended the pass without a HandleFallBack dealing with it."""
    if look.outcome != "FAILURE" or look.calm != "SUCCESS" or look.faults != 1:
        return
    faulty = {line.resource for line in look.played.journal if line.fault is not None}
    if any(isinstance(event, Recovered) for _, event in look.played.events):
        return
    for _, event, _ in look.of_leaves():
        if event.failure is not None and event.failure.resource in faulty:
            yield event.path, "its failure ends the pass, and no recovery looks at it"
            return


def _budget(look: Look) -> Iterator[Seen]:
    """Find a budget of recoveries that is spent, most of it on failures that no fault caused."""
    policy = look.stage.mission.policy
    recovered = [(at, event) for at, event in look.played.events if isinstance(event, Recovered)]
    faulty = {line.resource for line in look.played.journal if line.fault is not None}
    own = sum(event.failure.resource not in faulty for _, event in recovered)
    for (at, event), (began, _) in zip(recovered[policy.most:], recovered):
        if at - began < policy.seconds and 2 * own > policy.most:
            yield event.path, "more than {} recoveries in {:g} s: whatever fails from here on is given up".format(
                policy.most, policy.seconds)
            return


# --------------------------------------------------------------------------------------------------------------- the end


def _left_on(look: Look) -> Iterator[Seen]:
    """Find what a tour leaves switched on; a request to switch it off counts even if it was refused."""
    if not look.outcome or not look.drives():
        return
    for safe in look.stage.settings.interface.safe_state:
        asked = [request for _, request in look.played.asked if type(request) is type(safe)]
        if asked and asked[-1] != safe:
            service = look.stage.settings.interface.service(type(safe))
            yield service.name, "the last request after the tour is {}".format(asked[-1])


def _not_home(look: Look) -> Iterator[Seen]:
    drives, home = look.drives(), look.stage.knowledge.home.location
    if look.outcome and drives and drives[-1].goal[:2] != home[:2] and not _is_home_unknown(look):
        yield "", "the last drive leads to {:g}, {:g} and not home".format(*drives[-1].goal)


def _is_home_unknown(look: Look) -> bool:
    """Whether a recovery gave up after the last drive: the operator is then asked to take the robot home."""
    last = max(at for at, request in look.played.asked if isinstance(request, GoTo))
    return any(at > last and isinstance(event, Recovered) and not event.success for at, event in look.played.events)


def _abandoned(look: Look) -> Iterator[Seen]:
    """Find a drive that was halted and not followed by another drive."""
    last: Optional[LeafFinished] = None
    for _, event, spec in look.of_leaves():
        if GoTo in spec.calls:
            last = event
    if last is not None and last.status == NAMES[IDLE]:
        yield last.path, "it is halted while the robot drives, which no service can stop"


def _goodbye(look: Look) -> Iterator[Seen]:
    for at, event, spec in look.of_leaves():
        name, began = event.path.rpartition("/")[2], at - event.seconds
        if spec.says_goodbye(name) and event.status == "SUCCESS" and not look.is_visitor_here(began):
            yield event.path, "the visitor had left {:.0f} s before".format(began - _left(look, began))


def _left(look: Look, at: float) -> float:
    return max((since for since, is_here in look.played.presence if not is_here and since <= at), default=START)


def _left_out(look: Look) -> Iterator[Seen]:
    """Find an exhibit that a tour did not reach without a recorded reason."""
    drives = {drive.goal[:2] for drive in look.drives()}
    if look.outcome != "SUCCESS" or look.behaviour != ENGAGES or not _is_tour(look, drives):
        return
    if any(isinstance(event, Recovered) and event.outcome == SKIPPED for _, event in look.played.events):
        return
    for exhibit in look.stage.knowledge.exhibits:
        if exhibit.location[:2] not in drives:
            yield exhibit.name, "the visitor wants the tour, and the robot does not drive there"


def _is_tour(look: Look, drives: FrozenSet[Tuple[float, ...]]) -> bool:
    return any(exhibit.location[:2] in drives for exhibit in look.stage.knowledge.exhibits)


def visited(look: Look) -> int:
    """Return how many exhibits the robot was sent to."""
    drives = {drive.goal[:2] for drive in look.drives()}
    return sum(exhibit.location[:2] in drives for exhibit in look.stage.knowledge.exhibits)


KINDS = (
    Kind("busy-loop", "The mission never waits: it takes a whole core, and nothing else of the robot gets a turn. Put a "
                      "Sleep or a Delay into the loop.", _busy),
    Kind("endless", "The pass never ends: a loop without a bound repeats the same requests.", _endless),
    Kind("waits-for-ever", "The pass never ends: what the robot waits for does not come, and no limit ends the wait.",
         _waits),
    Kind("exception", "A node raises an exception, which ends the pass at once.", _exceptions),
    Kind("missing-data", "A node reads an entry or an answer that is not there.", _missing_data),
    Kind("senseless-request", "A node of the robot is asked for something that it does not know.", _senseless),
    Kind("unrecovered", "A single fault ends the pass, because no HandleFallBack stands beside the node.", _unrecovered),
    Kind("budget-spent", "Recoveries use up the budget of the policy although hardly a call fails: what fails later is "
                         "given up at once.", _budget),
    Kind("left-on", "Attention or lifelike movement is on when a tour is over.", _left_on),
    Kind("not-home", "The robot does not drive home after a tour.", _not_home),
    Kind("abandoned-drive", "The mission stops waiting for a drive, and the robot drives on.", _abandoned),
    Kind("goodbye-to-nobody", "The robot says goodbye although the visitor has left.", _goodbye),
    Kind("left-out", "The tour succeeds, and an exhibit is left out without a failure that explains it.", _left_out),
)
"""What a single play can show."""

UNREACHED = Kind("unreached", "No visitor and no fault brings the mission to this node.", lambda look: iter(()))
NEVER_OFF = Kind("never-off", "Attention or lifelike movement is switched on, and no pass switches it off.",
                 lambda look: iter(()))
"""What only all plays together can show: see ``unreached`` and ``never_off``."""

BY_NAME: Dict[str, Kind] = {kind.name: kind for kind in KINDS + (UNREACHED, NEVER_OFF)}


def look_at(look: Look) -> List[Tuple[str, str, str]]:
    """Return name, place and words of each finding of a play."""
    return list(dict.fromkeys((kind.name, clean(where), clean(what)) for kind in KINDS for where, what in kind.see(look)))


def unreached(stage: Stage, reached: FrozenSet[int]) -> List[Tuple[str, str, str]]:
    """Return the nodes that no play has reached; of a whole branch only the topmost."""
    nodes = [node for node in stage.mission.tree.nodes
             if node.uid not in reached and (node.parent is None or node.parent.uid in reached)]
    return [(UNREACHED.name, clean(node.full_path), "with {} below it".format(_leaves_below(node)))
            for node in nodes]


def _leaves_below(node: Node) -> str:
    number = sum(isinstance(below, MissionLeaf) for below in node.iterate())
    return "{} mission {}".format(number, "leaf" if number == 1 else "leaves")


def never_off(stage: Stage, asked: FrozenSet[object]) -> List[Tuple[str, str, str]]:
    """Return what no play has switched off; ``asked`` are all requests of the kinds that the safe state sends."""
    found = []
    for safe in stage.settings.interface.safe_state:
        if safe not in asked and any(type(request) is type(safe) for request in asked):
            service = stage.settings.interface.service(type(safe))
            found.append((NEVER_OFF.name, service.name, "it is never asked for {}".format(safe)))
    return found
