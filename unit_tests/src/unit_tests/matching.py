"""Matches injected faults and recorded failures, and finds those without a partner."""
from typing import Dict, Iterator, List, Tuple

from behavior_controller import leaves
from behavior_controller.gateway import Cause
from behavior_controller.interface import Sense
from behavior_controller.interface.records import Prompt

from unit_tests.facts import Event, Facts
from unit_tests.faults import CRASH, EXCEPTION, REFUSED, UNANSWERED, WRONG
from unit_tests.journal import Line
from unit_tests.visitor import DECLINES, SILENT, UNCLEAR

CAUSE_OF = {REFUSED: Cause.REFUSED.value, EXCEPTION: Cause.HANDLER_EXCEPTION.value, UNANSWERED: Cause.NO_ANSWER.value,
            CRASH: Cause.CONNECTION_LOST.value, WRONG: Cause.UNUSABLE_ANSWER.value}
"""How the controller must record each kind of fault."""

AWAY = {Cause.NOT_REACHABLE.value, Cause.NOT_ADVERTISED.value, Cause.CONNECTION_LOST.value}
"""How calls fail between the crash of a node and its return."""

RECOVERY = {spec.id for spec in leaves.mission_specs() if spec.is_recovery}
PROMPTS = {spec.id for spec in leaves.mission_specs() if Prompt in spec.calls}
LISTENERS = {spec.id for spec in leaves.mission_specs() if Sense.UTTERANCE in spec.listens}


class Matching:
    """Which injected fault each recorded failure comes from.

    A leaf's failure, and that of each attempt of a recovery, comes from the newest fault of its service before it. How
    the requests for the safe state went and what became of a halted leaf's call is not on record, so the faults of those
    services between the leaf's failure and that event belong to it.
    """

    def __init__(self, facts: Facts):
        self.in_recovery: List[Tuple[Line, Event]] = []  # faults of the safe state's calls
        self.injected: List[Event] = []  # failures of leaves that come from a fault, or from a node that is away
        self._facts = facts
        self._open: List[Line] = [line for line in facts.journal if line.fault is not None]
        self._failed_at: Dict[str, float] = {}  # path of a leaf -> when it failed last
        self._not_injected: List[Event] = []
        self._not_pressed: List[Event] = []  # answers on the tablet of a visitor who gives none
        for event in facts.events:
            if event["event"] == "LeafFinished":
                self._leaf(event)
            elif event["event"] == "Retried":
                self._failed(event)
            elif event["event"] == "Recovered" and not event["success"]:
                self._gave_up(event)

    def objections(self) -> Iterator[str]:
        """Object to failures that were not injected, and to faults without a failure on record."""
        for event in self._not_injected:
            yield "{} failed and nothing was injected there: {}: {}".format(
                event["node"], event["failure"]["cause"], event["failure"]["message"])
        for event in self._not_pressed:
            yield "{} ended with SUCCESS, and the visitor pressed nothing".format(event["node"])
        for line in self._open:
            yield "call {} of {} was made to fail ({}) and is not on record as a failure".format(
                line.call, line.resource, line.fault)

    def _leaf(self, event: Event) -> None:
        resource = event["resource"]
        if event["status"] == "SUCCESS" and event["node"] in PROMPTS and self._facts.behaviour == SILENT \
                and not self._is_real(resource):
            self._not_pressed.append(event)
        if event["status"] == "IDLE" and event["node"] in RECOVERY:
            self._halted(event)
        elif event["status"] == "IDLE":
            self._take(resource, self._failed_at.get(event["path"], 0.0), event["time"], 1)
        elif event["status"] == "FAILURE" and event["node"] not in RECOVERY:
            self._failed_at[event["path"]] = event["time"]
            self._failed(event)

    def _failed(self, event: Event) -> None:
        if self._is_natural(event):
            return
        is_injected = self._is_away(event) or self._take_fault(event)
        (self.injected if is_injected else self._not_injected).append(event)

    def _is_natural(self, event: Event) -> bool:
        """Whether the failure is the mission's way to say no: a false condition, a visitor who does not say yes."""
        return event["failure"]["cause"] == Cause.CONDITION_FALSE.value or self._is_no_answer(event)

    def _is_no_answer(self, event: Event) -> bool:
        """Whether the visitor caused the missing answer: none was heard or pressed, or a tablet reported no yes."""
        cause, behaviour = event["failure"]["cause"], self._facts.behaviour
        if event["node"] in LISTENERS:
            return cause == Cause.UNUSABLE_ANSWER.value and behaviour == UNCLEAR
        if event["node"] not in PROMPTS:
            return False
        if self._facts.interface.tells_pressed:
            return cause == Cause.MISSING_DATA.value and behaviour == SILENT
        return cause == Cause.REFUSED.value and behaviour in (SILENT, DECLINES, UNCLEAR) \
            and all(line.done for line in self._before(event)[-1:])

    def _is_away(self, event: Event) -> bool:
        """Whether the service that failed is not simulated: a real node does it, or it has crashed and is not back."""
        resource = event["failure"]["resource"]
        node = next((service.node for service in self._facts.interface.services if service.name == resource), None)
        asked = [line for line in self._facts.journal if line.call and line.time <= event["time"]
                 and (line.node == node or line.resource == resource)][-1:]
        if asked and asked[0].fault == CRASH and asked[0] not in self._open and event["failure"]["cause"] in AWAY:
            return True
        return not any(line.resource == resource and line.call for line in self._facts.journal) and (
            resource in self._facts.absent or self._is_real(resource))

    def _is_real(self, resource: str) -> bool:
        return any(service.name == resource and service.node in self._facts.real
                   for service in self._facts.interface.services)

    def _before(self, event: Event) -> List[Line]:
        """Return the calls of the service that failed up to then."""
        return [line for line in self._facts.journal if line.resource == event["failure"]["resource"] and line.call
                and line.time <= event["time"]]

    def _take_fault(self, event: Event) -> bool:
        """Match the fault that a failure comes from: the first while the leaf ran, or else the newest before."""
        failure, began = event["failure"], event["time"] - event.get("seconds", 0.0)
        found = [line for line in self._open if line.resource == failure["resource"] and line.time <= event["time"]
                 and CAUSE_OF[line.fault or ""] == failure["cause"]]
        for line in [line for line in found if line.time >= began][:1] or found[-1:]:
            self._open.remove(line)
        return bool(found)

    def _gave_up(self, event: Event) -> None:
        """Match the faults of the requests for the safe state; the record does not have their results."""
        began = self._failed_at.get(event["path"], 0.0)
        quiet = {self._facts.interface.service(type(request)).node for request in self._facts.interface.safe_state}
        for resource in sorted({line.resource for line in self._open if line.node in quiet}):
            self.in_recovery += [(line, event) for line in self._take(resource, began, event["time"], 1)]

    def _halted(self, event: Event) -> None:
        """Match the faults of what a recovery had under way when it was halted: a retry, or the safe state."""
        for resource in sorted({line.resource for line in self._open}):
            self._take(resource, event["time"] - event["seconds"], event["time"], 1)

    def _take(self, resource: str, after: float, until: float, most: int) -> List[Line]:
        """Match and return up to ``most`` faults of a service between two moments."""
        found = [line for line in self._open if line.resource == resource and after < line.time <= until][:most]
        for line in found:
            self._open.remove(line)
        return found
