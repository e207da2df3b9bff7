"""Requests, ends of leaves, decisions and entries: on record, and as they had to be. They are
compared after each traversal."""
import itertools
from dataclasses import dataclass
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from msgspec.structs import asdict

from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.run.events import (
    EntriesWritten, LeafFinished, Recovered, Recovering, Retried, StepStarted, StopChanged)
from behavior_controller.run.record.feed import Entries, written
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer

from unit_tests.judge import reference
from unit_tests.judge.foreign import Foreign
from unit_tests.judge.reference import Decision, ReferenceNode


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
        """The origin of the request: a node, or the end of the run; after a difference none is
        known."""
        if self.is_for_safety and not self.node:
            return "the safe state"
        return self.node or "a later step"

    @property
    def is_for_safety(self) -> bool:
        """Whether it may be a part of the safe state: a recovery that gives up asks for it, and the
        end of the run."""
        return self.node in ("", *reference.HANDLERS) and self.request in reference.SAFE_STATE

    @property
    def cause(self) -> Optional[Cause]:
        """Why it failed, if it did."""
        return self.result.cause if isinstance(self.result, Failure) else None

    @property
    def outcome(self) -> str:
        """The result in words: an answer, or the cause of its failure."""
        if self.result is None:
            return "no answer"
        return "an answer" if self.cause is None else self.cause.value

    def drop(self, time: float) -> None:
        """Note that nothing waits for the answer any more."""
        if self.result is None:
            self.dropped = time


def described(request: Any) -> str:
    """Return a request in words."""
    if request.words is None:
        return str(request)
    return f"{request.words.doing} {request.words.what}".strip()


def result_words(one: Any, other: Any) -> Tuple[str, str]:
    """Return two different results in words; of two answers the first parts that differ."""
    if isinstance(one, Answer) and isinstance(other, Answer):
        parts = itertools.zip_longest((one.response, *one.exhibits),
                                      (other.response, *other.exhibits))
        return next((repr(its), repr(due)) for its, due in parts if its != due)
    return _words(one), _words(other)


def _words(result: Any) -> str:
    if isinstance(result, Cause):
        return result.value
    if result is not None and result.response:
        return repr(result.response)
    return "an answer"


def request_difference(asked: Any, due: Any) -> str:
    """Return the fields that differ from the due request; empty: another kind of request."""
    if type(asked) is not type(due):
        return ""
    names = [name for name in due.__struct_fields__ if getattr(asked, name) != getattr(due, name)]
    fields = (f"{name} is {getattr(asked, name)!r} instead of {getattr(due, name)!r}"
              for name in names)
    return f" ({', '.join(fields)})"


class Traversal:
    """One traversal of the tree and what was reported since the one before: on record, and as it
    had to be."""

    def __init__(self, last: str = ""):
        self.last = last  # the leaf that had ended last before
        # changes of status: the node's number and a letter, or 0 and what is wrong with a request
        self.recorded: Sequence[Tuple[int, str]] = ()
        self.changes: List[Tuple[int, str]] = []
        # of nodes without a row, the statuses on record that they have not taken yet
        self.letters: Dict[int, Iterator[str]] = {}
        self.finished: List[LeafFinished] = []
        self.decisions: List[Decision] = []
        self.due: List[Decision] = []
        self._ends: Dict[int, List[str]] = {}

    def ended(self, node: ReferenceNode, end: str) -> None:
        """Note how a leaf had to end: SUCCESS, IDLE, or the cause of its failure."""
        self._ends.setdefault(node.uid, []).append(end)

    def cause(self, uid: int) -> str:
        """Return why a leaf had to fail; empty: it had not."""
        return next((end for end in self._ends.get(uid, ()) if end not in ("SUCCESS", "IDLE")), "")

    def decided(self, node: ReferenceNode, step: str, cause: str = "", handler: int = 0) -> None:
        """Note a decision that the record has to have."""
        self.due.append(Decision(node.registration_id, node.full_path, cause, step, handler))

    def unlike_reports(self, nodes: Sequence[Any]) -> Iterator[str]:
        """Yield the differences between the reports and those that had to be."""
        reported: Dict[int, List[str]] = {}
        for event in self.finished:
            reported.setdefault(event.uid, []).append(_value(event))
        for uid in {**self._ends, **reported}:
            node, wanted, values = nodes[uid - 1], self._ends.get(uid, []), reported.get(uid, [])
            if isinstance(node, Foreign):
                values = [value for value in values if value != "IDLE"]
            # a condition that is asked again and again is on record when it changes
            is_false = isinstance(node, reference.Sign) and wanted[-1:] not in ([], ["SUCCESS"])
            is_quiet = isinstance(node, Foreign) or is_false
            if values != wanted and not (is_quiet and set(values) <= set(wanted)):
                yield "{} ended with {}; on record is {}".format(
                    label(node), ", ".join(wanted) or "nothing", ", ".join(values) or "nothing")
        # decisions of recoveries first, then what is begun: of both the order counts
        for due, other in itertools.zip_longest(*(
                sorted(decisions, key=lambda decision: not decision.cause)
                for decisions in (self.due, self.decisions))):
            if due != other:
                yield f"this had to happen: {due or 'nothing'}; on record is: {other or 'nothing'}"


def _value(ended: LeafFinished) -> str:
    """Return how a leaf ended: SUCCESS, IDLE, or the cause of its failure."""
    has_failed = ended.status == "FAILURE"
    if ended.failure is None:
        return ended.status + " although it did not fail" * has_failed
    if not has_failed:
        return f"{ended.status} although it failed"
    return ended.failure.cause.value


STEP_TEXTS = {
    StepStarted: reference.STEP_BEGINS, StopChanged: reference.STOP_STATE,
    Recovering: reference.RETRIED, Retried: reference.FAILED_AGAIN, Recovered: reference.ENDED}
"""The words for an event on record about a step."""


def decision(event: Union[StepStarted, StopChanged, Recovering, Retried, Recovered]) -> Decision:
    """Return the decision about a step, a stop or a recovery that is on record."""
    facts, step = asdict(event), STEP_TEXTS[type(event)]
    if isinstance(event, (StepStarted, StopChanged)):
        return Decision(event.node, event.path, "", step.format(**facts))
    if facts.get("substitute"):
        step = reference.SUBSTITUTE_USED
    gives_up = facts.get("policy", "").partition(": ")[0].endswith("give up")
    step = step.format(rule="give up" if gives_up else "skip", **facts)
    return Decision(event.node, event.path, event.failure.cause.value, step, facts.get("uid", 0))


class WrittenEntries:
    """Entries of the blackboards: on record, and as they had to be."""

    def __init__(self, tree: Tree):
        self._tree, self._entries = tree, Entries(tree)
        self._before: Dict[str, Optional[str]] = {}  # at the last comparison
        # on record since the last comparison, and the newest event of these
        self._news: Dict[str, Optional[str]] = {}
        self._newest: Sequence[Tuple[str, Optional[str]]] = ()
        self._values: Dict[str, Any] = {}  # of those that differ from their text
        self._writers: Dict[str, str] = {}

    def note(self, event: EntriesWritten) -> bool:
        """Note entries on record; return whether they are there twice."""
        is_again = bool(event.entries) and event.entries == self._newest
        self._newest = event.entries
        self._news.update(event.entries)
        self._values.update(event.values)
        return is_again

    def stored(self, node: ReferenceNode, port: str) -> None:
        """Note that a node wrote an entry."""
        self._writers[_entry_of(node, port).lstrip("@")] = node.registration_id

    def copy(self, node: ReferenceNode, port: str) -> None:
        """Write an entry of a node without a row, if the record has it now."""
        board, key = node.blackboard.home(_entry_of(node, port))
        path = next(path for path, other in self._tree.blackboards.items() if other is board)
        name = f"{path}/{key}" if path else key
        record = self._values.get(name)
        if self._news.get(name) is not None:
            kind, value = node.spec.port_named[port].type, self._news[name]
            if isinstance(record, dict) and kind in reference.RECORDS:
                value = reference.RECORDS[kind](**record)
            board.set(key, value)
        elif name in self._news:
            board.unset(key)

    def differences(self, last: str) -> Iterator[str]:
        """Yield entries of another value than on record, or that one side wrote alone, and forget
        who wrote them; ``last`` is the leaf that ended last."""
        due = dict(written(*self._entries.news()).entries)
        for name in sorted({**due, **self._news}):
            before = self._before.get(name)
            wanted, text = due.get(name, before), self._news.get(name, before)
            is_written = (due.get(name) is None) is (self._news.get(name) is None)
            if wanted != text or not is_written:
                writer = self._writers.get(name.rpartition("/")[2]) or last
                yield (f"{writer} had to leave {name} = {_left(wanted, name in due)}; on record is "
                       f"{_left(text, name in self._news)}")
        self._before.update(self._news)
        self._newest = ()
        self._news.clear()
        self._values.clear()
        self._writers.clear()


def _left(value: Optional[str], is_news: bool) -> str:
    """Return in words what a traversal left in an entry."""
    if value is None:
        return "nothing"
    if not is_news:
        return f"{value}, from before"
    return value


def _entry_of(node: ReferenceNode, port: str) -> str:
    """Return the name of the entry that a port of a node stands for."""
    return ports.reference(node.attributes.get(port, ""), port) or port


def label(node: Any) -> str:
    """Return the name of a node for a tester: its type, and its own name if that says more."""
    name = node.registration_id
    if isinstance(node, reference.RecoveryTask) and node.remark:
        return f"{name} ({node.remark})"
    if node.name in (name, ""):
        return name
    return f"{name} {node.name}"
