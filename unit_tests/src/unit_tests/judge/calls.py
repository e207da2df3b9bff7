"""The requests on record, which the nodes of the reference take one after the other."""
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple, Union

from behavior_controller.execution.events import Answered, Asked
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, Request

from unit_tests.judge.comparison import label
from unit_tests.judge.reference import HANDLERS, SAFE_STATE, Duty


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


class Calls:
    """The requests of one mission."""

    def __init__(self) -> None:
        self.queries: Dict[int, Query] = {}
        self.unexplained: List[Query] = []  # that no node has made yet
        self.asker = ""  # the node that made the newest request

    def note_asked(self, event: Asked, time: float) -> Query:
        """Note a request on record."""
        query = self.queries.setdefault(
            event.call, Query(event.call, event.request, event.service, time))
        self.unexplained.append(query)
        return query

    def note_answer(self, event: Answered, time: float) -> str:
        """Note an answer on record; return why there can be none."""
        query = self.queries.get(event.call)
        if query is None:
            return ""
        if query.result is not None or query.dropped is not None:
            return f"{query.node} has an answer on record that nothing waits for: {query}"
        query.answered, query.result = time, event.result
        return ""

    def next_is(self, request: Union[Request, type, Tuple[type, ...]]) -> bool:
        """Return whether the next request is that one, or of that kind or one of these."""
        if not self.unexplained:
            return False
        asked = self.unexplained[0].request
        return asked == request if isinstance(request, Request) else isinstance(asked, request)

    def take(self, node: Duty) -> Query:
        """Return the next request, which is that of the node."""
        self.asker, query = label(node), self.unexplained.pop(0)
        query.node, query.path = node.registration_id, node.full_path
        return query

    def unlike(self, request: Union[Request, type]) -> str:
        """Return what is on record instead of a request that was due."""
        what = "" if isinstance(request, type) else ": " + described(request)
        if not self.unexplained:
            return f"was due{what}; nothing was asked"
        asked = self.unexplained[0]
        text = f"was due{what}; what was asked: {self.described(asked)}"
        if type(asked.request) is type(request):
            text += f" ({_unlike_fields(asked.request, request)})"
        return text

    def described(self, asked: Query) -> str:
        """Return a request in words, and which node has made the same before."""
        before = [query.node for query in self.queries.values()
                  if query.request == asked.request and query.node]
        return f"{asked}, as {before[-1]} did before" if before else str(asked)


def described(request: Any) -> str:
    """Return a request in words."""
    words = request.words
    return f"{words.doing} {words.what}".strip() if words is not None else str(request)


def _unlike_fields(asked: Any, due: Any) -> str:
    names = [name for name in due.__struct_fields__ if getattr(asked, name) != getattr(due, name)]
    return ", ".join(f"{name} is {getattr(asked, name)!r} instead of {getattr(due, name)!r}"
                     for name in names)
