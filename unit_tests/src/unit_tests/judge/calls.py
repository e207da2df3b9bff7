"""The requests on record."""
from dataclasses import dataclass
from typing import Any, Optional, Union

from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer

from unit_tests.judge.reference import HANDLERS, SAFE_STATE


@dataclass(eq=False)
class Query:
    """A request, the node that it was due for, and its result; ``dropped``: when the node was
    halted."""

    call: int
    request: Any
    service: str
    asked: float
    node: str = ""
    path: str = ""
    answered: Optional[float] = None
    result: Union[Answer, Failure, None] = None
    dropped: Optional[float] = None

    def __str__(self) -> str:
        return described(self.request)

    @property
    def asker(self) -> str:
        """What made the request: a node, or the end of the run; after a difference none is known.
        """
        return self.node or ("the safe state" if self.is_for_safety else "a later step")

    @property
    def is_for_safety(self) -> bool:
        """Whether it may be a part of the safe state: a recovery that gives up asks for it, and the
        end of the run."""
        return self.node in ("", *HANDLERS) and self.request in SAFE_STATE

    @property
    def cause(self) -> Optional[Cause]:
        """Why it failed, if it did."""
        return self.result.cause if isinstance(self.result, Failure) else None

    @property
    def outcome(self) -> str:
        """The result in words: an answer, or the cause of its failure."""
        if self.cause is not None:
            return self.cause.value
        return "an answer" if self.result is not None else "no answer"

    def drop(self, time: float) -> None:
        """Note that nothing waits for the answer any more."""
        if self.result is None:
            self.dropped = time


def described(request: Any) -> str:
    """Return a request in words."""
    words = request.words
    return f"{words.doing} {words.what}".strip() if words is not None else str(request)


def unlike(asked: Any, due: Any) -> str:
    """Return what is asked otherwise than it was due; empty: another kind of request."""
    if type(asked) is not type(due):
        return ""
    names = [name for name in due.__struct_fields__ if getattr(asked, name) != getattr(due, name)]
    fields = (f"{name} is {getattr(asked, name)!r} instead of {getattr(due, name)!r}"
              for name in names)
    return f" ({', '.join(fields)})"
