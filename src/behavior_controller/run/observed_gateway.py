"""A gateway that emits an event for each request and for each answer that the mission reads."""
import itertools
from typing import Callable, Optional, Set, Union

from behavior_controller.run.events import Answered, Asked, Event, FeedbackReceived
from behavior_controller.robot.declarations import Interface
from behavior_controller.robot.gateway import Call, Failure, Gateway
from behavior_controller.robot.requests import Answer, Request


class ObservedGateway(Gateway):
    """Forwards to the robot's."""

    def __init__(self, inner: Gateway, interface: Interface, emit: Callable[[Event], None]):
        self._inner, self._interface, self._emit = inner, interface, emit
        self._numbers = itertools.count(1)
        self._awaited: Set[_ObservedCall] = set()

    def start(self, request: Request) -> Call:
        number = next(self._numbers)
        self._emit(Asked(number, self._interface.resource(type(request)), request))
        call = _ObservedCall(self._inner.start(request), number, self._emit, self._awaited)
        self._awaited.add(call)
        return call

    @property
    def is_busy(self) -> bool:
        """Whether the robot has not yet done what it was asked for. What it has answered is read,
        so this is no question for a traversal.
        """
        return None in [call.result for call in list(self._awaited)]


class _ObservedCall(Call):
    """A call whose answer is an event when it is read."""

    def __init__(self, inner: Call, number: int, emit: Callable[[Event], None],
                 awaited: "Set[_ObservedCall]"):
        """``awaited`` are the calls whose results have not been read, and will be."""
        self._inner, self._number, self._emit, self._awaited = inner, number, emit, awaited
        self.request, self._is_read = inner.request, False
        inner.on_feedback = self._report

    @property
    def result(self) -> Optional[Union[Answer, Failure]]:  # type: ignore[override]
        """The result, or None while there is none."""
        result = self._inner.result
        if result is not None and not self._is_read:
            self._is_read = True
            self._awaited.discard(self)
            self._emit(Answered(self._number, result))
        return result

    def _report(self, feedback: str) -> None:
        self._emit(FeedbackReceived(self._number, feedback))

    def drop(self) -> None:
        """Drop the call."""
        self._awaited.discard(self)
        self._inner.drop()
