"""A gateway that emits an event for each request and for each answer that the mission reads."""
import itertools
from typing import Callable, List, Optional, Union

from behavior_controller.execution.events import Answered, Asked, Event, FeedbackReceived
from behavior_controller.robot.declarations import Interface
from behavior_controller.robot.gateway import Call, Failure, Gateway
from behavior_controller.robot.requests import Answer, Request


class ObservedGateway(Gateway):
    """Forwards to the robot's."""

    def __init__(self, inner: Gateway, interface: Interface, emit: Callable[[Event], None]):
        self._inner = inner
        self._interface = interface
        self._emit = emit
        self._numbers = itertools.count(1)
        self._open: List[_ObservedCall] = []

    def start(self, request: Request) -> Call:
        number = next(self._numbers)
        self._emit(Asked(number, self._interface.resource(type(request)), request))
        call = _ObservedCall(self._inner.start(request), number, self._emit)
        self._open = [*filter(_ObservedCall.is_awaited, self._open), call]
        return call

    @property
    def is_busy(self) -> bool:
        """Whether the robot has not yet done what it was asked for. What it has answered is read,
        so this is no question for a traversal.
        """
        return None in [call.result for call in self._open if call.is_awaited()]


class _ObservedCall(Call):
    """A call whose answer is an event when it is read."""

    def __init__(self, inner: Call, number: int, emit: Callable[[Event], None]):
        self._inner = inner
        self._number = number
        self._emit = emit
        self._is_read = False
        self._is_dropped = False
        self.request = inner.request
        inner.on_feedback = lambda text: emit(FeedbackReceived(number, text))

    @property
    def result(self) -> Optional[Union[Answer, Failure]]:  # type: ignore[override]
        """The result, or None while there is none."""
        result = self._inner.result
        if result is not None and not self._is_read:
            self._is_read = True
            self._emit(Answered(self._number, result))
        return result

    def is_awaited(self) -> bool:
        """Whether its result has not been read, and will be."""
        return not (self._is_read or self._is_dropped)

    def drop(self) -> None:
        """Drop the call."""
        self._is_dropped = True
        self._inner.drop()
