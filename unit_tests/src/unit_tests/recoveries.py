"""Whether each recovery did what the policy prescribes for the failures that it met.

Written from the words at the head of recoveryPolicy.ini, beside the controller's own recovery: all that is read as the
controller reads it are the lines of the policy's rules and what the node types are declared to be.
"""
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Set

from behavior_controller import leaves, policy
from behavior_controller.interface import Interface
from behavior_controller.leaves import data
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.text import Source

from unit_tests.facts import Event, Facts, Tree, count, started

DONE, SUBSTITUTED, SKIPPED, GIVEN_UP = "done", "substituted", "skipped", "given up"

AT_ONCE = 0.01
"""Seconds within which two recoveries begin at one moment, so that either may have begun first."""

NEARLY = 0.5
"""Seconds by which the record's times may be wrong about which recoveries the budget still counts."""

SPECS: Dict[str, MissionSpec] = {spec.id: spec for spec in leaves.mission_specs()}
RECOVERY = {name for name, spec in SPECS.items() if spec.is_recovery}


class Round(NamedTuple):
    """One recovery from the record. ``failures``: the step's own, then those of its retries."""

    recovered: Event
    fallback: Event  # how HandleFallBack ended
    failures: List[Event]
    instead: List[Event]  # failures of the substitute

    @property
    def began(self) -> float:
        return float(self.fallback["time"] - self.fallback["seconds"])

    @property
    def outcome(self) -> str:
        return str(self.recovered["outcome"])

    @property
    def helped(self) -> bool:
        """Whether the step, or its substitute, was done after all."""
        return self.outcome in (DONE, SUBSTITUTED)

    @property
    def is_idle(self) -> bool:
        """Whether there was nothing to recover from: what is on record is HandleFallBack itself."""
        return bool(self.recovered["path"] == self.fallback["path"])


def rounds(events: Sequence[Event]) -> Iterator[Round]:
    """Yield all recoveries, in the order of their ends."""
    met: Dict[str, List[Event]] = {}  # path -> the failures there since the leaf, or HandleFallBack, ran last
    recovered: Optional[Event] = None
    for event in events:
        if event["event"] == "Retried":
            met.setdefault(event["path"], []).append(event)
        elif event["event"] == "Recovered":
            recovered = event
        elif event["event"] == "LeafFinished" and event["node"] not in RECOVERY:
            if event["status"] == "FAILURE":
                met[event["path"]] = [event]
        elif event["event"] == "LeafFinished":
            instead = met.pop(event["path"], [])
            if recovered is not None and event["status"] != "IDLE":
                yield Round(recovered, event, met.get(recovered["path"], []), instead)
                # what is left to an outer HandleFallBack is the failure of the step itself
                met[recovered["path"]] = met.get(recovered["path"], [])[:1]
            recovered = None


class Recoveries:
    """The recoveries of a run against the policy in its record. Nothing is judged if the record has no tree or policy."""

    def __init__(self, facts: Facts, tree: Tree, recoveries: Sequence[Round]):
        self._facts = facts
        self._tree = tree
        self._policy = _policy(facts)
        self._tour = _Tour(len(facts.knowledge.exhibits), bool(facts.real))
        self._all = recoveries
        idle = {id(each.fallback) for each in self._all if each.is_idle}
        self._begun = [event["time"] - event["seconds"] for event in facts.events
                       if event["event"] == "LeafFinished" and event["node"] in RECOVERY and id(event) not in idle]

    def objections(self) -> Iterator[str]:
        """Object to each recovery that tried too often or not often enough, or ended as it may not."""
        if self._policy is None or not self._tree:
            return
        by_end = {id(each.fallback): each for each in self._all}
        for event in self._facts.events:
            self._tour.take(event)
            if id(event) in by_end:
                each = by_end[id(event)]
                may_skip = self._leave_out(each)
                if not each.is_idle:
                    yield from self._judge(each, may_skip)
        yield from self._quiet_tries()

    def _leave_out(self, each: Round) -> Optional[bool]:
        """Return whether the mission may go on without the steps; None if that is unknown."""
        types = (self._tree.types[uid] for uid in self._tree.before(each.fallback["uid"]))
        if each.helped or not any(kind in SPECS and SPECS[kind].leave_out is not None for kind in types):
            return True
        return self._tour.leave_out()

    def _judge(self, each: Round, may_skip: Optional[bool]) -> Iterator[str]:
        node = each.recovered["node"]
        can_redo = bool(each.failures and node in SPECS and SPECS[node].calls) and self._tree.are_neighbours(
            each.failures[0]["uid"], each.fallback["uid"])
        is_spent = self._is_spent(each.began)
        verdicts = [list(self._told(each, can_redo, spent, may)) for spent in ([is_spent] if is_spent is not None else
                    [False, True]) for may in ([may_skip] if may_skip is not None else [False, True])]
        if all(verdicts):  # in doubt, the controller is right
            yield "the recovery from {} of {} {}".format(
                each.failures[0]["failure"]["cause"] if each.failures else "a failure", node, verdicts[0][0])

    def _told(self, each: Round, can_redo: bool, is_spent: bool, may_skip: bool) -> Iterator[str]:
        """Yield the objections to a recovery, given whether it can redo the step, afford it, and leave it out."""
        spec, rule, causes = SPECS.get(each.recovered["node"]), None, [_cause(event) for event in each.failures]
        if spec is None or not causes:
            yield "is on record without the failure"
            return
        tries = len(causes) - 1 + (each.outcome == DONE)
        for number, cause in enumerate(causes):
            rule = self._rule(spec, cause)
            allowed = rule.retries if can_redo and not is_spent else 0
            if number < tries and number >= allowed:
                yield "made {} where the policy allows {}".format(count(tries, "retry", "retries"), allowed)
                return
        assert rule is not None
        if each.outcome == DONE:
            return
        if tries < allowed:
            yield "ended after {} where the policy prescribes {}".format(count(tries, "retry", "retries"), allowed)
        instead = rule.substitute.id if rule.substitute is not None and can_redo and not is_spent else None
        tried = {event["node"] for event in each.instead}
        if tried - {instead} or each.outcome == SUBSTITUTED and instead is None:
            yield "did something else instead, which the policy does not prescribe"
        elif each.outcome != SUBSTITUTED:
            if instead is not None and not tried:
                yield "left out {}, which the policy prescribes instead".format(instead)
            expected = SKIPPED if rule.then == policy.SKIP and not is_spent and may_skip else GIVEN_UP
            if each.outcome != expected:
                yield "ended with: {}; the policy says: {}".format(each.outcome, expected)

    def _rule(self, spec: MissionSpec, cause: str) -> policy.Rule:
        """Return the first line that fits; what the tour cannot do without is given up where a line would skip it."""
        assert self._policy is not None
        for rule in self._policy.rules:
            if rule.node in ("*", spec.id) and rule.cause in ("*", cause):
                is_kept = rule.then == policy.SKIP and spec.is_indispensable
                return rule._replace(then=policy.GIVE_UP, substitute=None) if is_kept else rule
        return policy.Rule("*", "*", 0, 0.0, policy.GIVE_UP)

    def _is_spent(self, began: float) -> Optional[bool]:
        """Return whether the budget was spent when a recovery began; None if its times are too near to decide."""
        assert self._policy is not None
        oldest = began - self._policy.seconds
        sure = 1 + sum(oldest + NEARLY < other < began - AT_ONCE for other in self._begun)
        perhaps = sum(oldest - NEARLY < other < began + AT_ONCE for other in self._begun)
        if sure > self._policy.most:
            return True
        return False if perhaps <= self._policy.most else None

    def _quiet_tries(self) -> Iterator[str]:
        """Object to a step that was carried out otherwise than the record says: a retry that helped, and no other."""
        interface = self._facts.interface
        calm = {interface.service(type(request)).name for request in interface.safe_state}
        for each in self._all:
            names = _services(each.recovered["node"], interface)
            is_told = each.outcome == DONE or each.outcome != SUBSTITUTED and not names & calm
            if not names or not each.failures or not is_told or self._is_shared(each, names):
                continue
            done = sum(line.resource in names and line.done and
                       each.failures[0]["time"] < line.time <= each.recovered["time"] for line in self._facts.journal)
            if done != (each.outcome == DONE):
                yield "the recovery of {} is on record as {}, and its request was carried out {}".format(
                    each.recovered["node"], each.outcome, count(done, "time", "times"))

    def _is_shared(self, each: Round, names: Set[str]) -> bool:
        """Whether a real node has the service, or another leaf or the safe state used it meanwhile."""
        began, ended = each.failures[0]["time"], each.recovered["time"]
        return any(service.name in names and service.node in self._facts.real
                   for service in self._facts.interface.services) or any(
            event["time"] > began and event["time"] - event.get("seconds", 0.0) < ended
            and (event["event"] == "LeafFinished" and event["resource"] in names and event["node"] not in RECOVERY
                 or event["event"] == "Recovered" and not event["success"] and event is not each.recovered)
            for event in self._facts.events if event["event"] in ("LeafFinished", "Recovered"))


def _cause(event: Event) -> str:
    return str(event["failure"]["cause"])


def _services(node: str, interface: Interface) -> Set[str]:
    calls = SPECS[node].calls if node in SPECS else ()
    return {service.name for service in interface.services if service.request in calls}


def _policy(facts: Facts) -> Optional[policy.Policy]:
    """Return the policy in the record."""
    source = started(facts).get("sources", {}).get("policy")
    return policy.read(Source(source["file"], source["text"]), leaves.mission_specs()) if source else None


class _Tour:
    """Which exhibits a pass has left out so far. A tour may not leave out every one of them."""

    def __init__(self, number: int, is_unknown: bool):
        self._number, self._is_unknown = number, is_unknown
        self._begin()

    def _begin(self) -> None:
        self._left_out: Set[float] = set()
        self._current: Optional[float] = None  # when the exhibit was chosen on whose behalf the robot is under way

    def take(self, event: Event) -> None:
        """Follow the leaves that choose where the robot goes."""
        if event["event"] == "PassStarted":
            self._begin()
        is_done = event["event"] == "LeafFinished" and event["status"] == "SUCCESS" \
            or event["event"] == "Recovered" and event["outcome"] == DONE
        spec = SPECS.get(event["node"]) if is_done else None
        if spec is None:
            return
        if spec.writes(data.EXHIBITS.name):
            self._begin()
        elif spec.writes(data.CURRENT_EXHIBIT.name):
            self._current = event["time"]
        elif spec.writes(data.TARGET_LOCATION.name):
            self._current = None

    def leave_out(self) -> Optional[bool]:
        """Leave the exhibit under way out; return whether the tour may, None if the number of exhibits is not known."""
        if self._current is None:
            return True
        self._left_out.add(self._current)
        return None if self._is_unknown else len(self._left_out) < self._number
