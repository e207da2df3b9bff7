"""The safe state (attention and lifelike movement off): the one way to ask for it and to report it.
"""
import math
from typing import Callable, Container, Dict, Iterator, Optional

from behavior_controller.run.events import SafePart, SafeStateReported
from behavior_controller.robot.gateway import Call, Cause, Failure, Gateway
from behavior_controller.robot.declarations import Interface, Offer

SAFE_STATE_LIMIT = 1.0
"""Seconds that the requests may take when the run ends."""

AGAIN_AFTER = 0.1
"""Seconds from the failure of a request to its next attempt when the run ends."""

FINAL = (Cause.NO_ANSWER, Cause.NOT_ADVERTISED, Cause.TYPE_MISMATCH)
"""The causes of a failure that another attempt within the limit cannot mend."""


class SafeState:
    """The requests for the safe state, all sent at once.

    It belongs to the thread that owns the gateway and the clock of ``now``. A thread that cannot
    use those of the tick thread makes its own.
    """

    def __init__(self, gateway: Gateway, interface: Interface, used: Container[Offer],
                 now: Callable[[], float]):
        """``used`` are the services and topics that the mission cannot do without."""
        self._gateway, self._interface, self._used, self._now = gateway, interface, used, now
        self._began = now()
        self._calls = [gateway.start(request) for request in interface.safe_state]
        self._due: Dict[Call, float] = {}  # when a request that failed is sent again
        self._before: Dict[Call, Failure] = {}  # how the attempt before this one failed

    @property
    def result(self) -> Optional[SafeStateReported]:
        """The report, or None while a request has no result."""
        if any(call.result is None for call in self._calls):
            return None
        return self.report()

    def drop(self) -> None:
        """Drop the requests under way."""
        for call in self._calls:
            call.drop()

    def wait(self, wait: Callable[[float], None],
             seconds: float = SAFE_STATE_LIMIT) -> SafeStateReported:
        """Return the report when every request was carried out, after ``seconds`` at the latest. A
        request that fails is sent again meanwhile.

        ``wait`` returns when a result may have come, after that many seconds at the latest.
        """
        deadline = self._began + seconds
        while self._now() < deadline:
            due = self._ask_again()
            if due == math.inf and self.result is not None:
                break
            wait(max(0.0, min(due, deadline) - self._now()))  # time goes on meanwhile
        return self.report()

    def _ask_again(self) -> float:
        """Send again what failed ``AGAIN_AFTER`` ago, and return when the next one is due."""
        now, next_due = self._now(), math.inf
        for place, call in enumerate(self._calls):
            failure = call.result
            if isinstance(failure, Failure) and self._due.get(call, math.inf) <= now:
                call = self._calls[place] = self._gateway.start(call.request)
                self._before[call], failure = failure, call.result
            if isinstance(failure, Failure) and failure.cause not in FINAL:
                next_due = min(next_due, self._due.setdefault(call, now + AGAIN_AFTER))
        return next_due

    def report(self) -> SafeStateReported:
        """Return what was reached, and drop the requests without a result."""
        return SafeStateReported(tuple(self._parts()), self._now() - self._began)

    def _parts(self) -> Iterator[SafePart]:
        for call in self._calls:
            service, result = self._interface.service(type(call.request)), call.result
            name = self._interface.name_of(service)
            if result is None:
                call.drop()
                waited = f"waited {self._now() - self._began:.1f} s"
                if call in self._before:
                    waited += f"; {self._before[call].cause.text} before"
                result = Failure(Cause.NO_ANSWER, waited, name)
            failure = result if isinstance(result, Failure) else None
            is_lacking = failure is not None and failure.cause is Cause.NOT_ADVERTISED
            if not is_lacking or service in self._used:
                yield SafePart(call.request.switches or name, name, failure)
