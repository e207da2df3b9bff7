"""A whole run: its state now, all that has come to an end in it, and its state at any moment."""
import bisect
import math
import pickle
import zlib
from collections import deque
from itertools import takewhile
from typing import Any, Deque, Dict, Iterable, Iterator, List, Optional, Tuple, Union, get_args

from behavior_controller.run.events import Line, Noticed, TreeShown
from behavior_controller.run.fold import fold
from behavior_controller.run.state import (
    Exchange, Fact, LeafFailure, NodeResult, RecoveryRound, State, Step, Stop, Visit)

STRETCH_EVENTS = 250
"""Number of events between two states that a ``History`` keeps.

For any other moment at most so many are folded again.
"""

MOST_STRETCHES = 4000
"""The most states that a ``History`` keeps: a million events."""


class History:
    """The events of a run in bounded memory: what was so at any moment.

    It keeps each ``STRETCH_EVENTS``-th state, and packed the events after it. The oldest go when
    there are ``MOST_STRETCHES`` such stretches.
    """

    def __init__(self, is_packed: bool = True) -> None:
        """``is_packed``: False where the events are kept elsewhere, too."""
        self._is_packed = is_packed
        self._times: Deque[float] = deque(maxlen=MOST_STRETCHES)  # when each stretch began
        self._states: Deque[State] = deque(maxlen=MOST_STRETCHES)  # before it
        self._packed: Deque[Union[bytes, List[Line]]] = deque(maxlen=MOST_STRETCHES)
        self._lines: List[Line] = []  # of the stretch under way
        self._latest = -math.inf  # a clock that was set back does not take events back

    @property
    def began(self) -> Optional[float]:
        """The earliest moment that is kept; None before the first event."""
        return self._times[0] if self._times else None

    def take(self, before: State, line: Line) -> None:
        """Keep the next event, given what was so before it."""
        self._latest = max(self._latest, line.time)
        if len(self._lines) in (0, STRETCH_EVENTS):
            if self._lines and self._is_packed:
                self._packed[-1] = _packed(self._lines)
            self._lines = []
            self._times.append(self._latest)
            self._states.append(before)
            self._packed.append(self._lines)
        self._lines.append(line)

    def until(self, time: float, stretches: int = 1) -> Tuple[State, List[Line]]:
        """Return the events up to that time, of the last ``stretches``, and the state before them.
        """
        last = bisect.bisect_right(self._times, time)
        if not last:
            return State(), []
        first = max(0, last - stretches)
        lines = (line for place in range(first, last) for line in _unpacked(self._packed[place]))
        return self._states[first], list(takewhile(lambda line: line.time <= time, lines))

    def newest(self, count: int) -> List[Line]:
        """Return the last ``count`` events that are kept."""
        lines: List[Line] = []
        for packed in reversed(self._packed):
            if len(lines) >= count:
                break
            lines = _unpacked(packed) + lines
        return lines[-count:]


def with_tree(lines: Iterable[Line]) -> Iterator[Tuple[Line, TreeShown]]:
    """Yield each line with the tree that was shown last."""
    tree = TreeShown("", [])
    for line in lines:
        if isinstance(line.event, TreeShown):
            tree = line.event
        yield line, tree


def _packed(lines: List[Line]) -> Union[bytes, List[Line]]:
    try:
        return zlib.compress(pickle.dumps(lines, pickle.HIGHEST_PROTOCOL), 1)
    except Exception:  # another package's request may be of any kind
        return lines


def _unpacked(packed: Union[bytes, List[Line]]) -> List[Line]:
    return pickle.loads(zlib.decompress(packed)) if isinstance(packed, bytes) else packed


class Run:
    """A run with its whole history: ``state`` is what is so now, the lists are what has come to an
    end, in that order.

    ``at`` returns what was so at any moment, within milliseconds however long the run was.
    """

    def __init__(self, lines: Iterable[Line] = ()):
        self.state = State()
        self.lines: List[Line] = []
        self._facts: Dict[type, List[Any]] = {kind: [] for kind in get_args(Fact)}
        self.visits: List[Visit] = self._facts[Visit]
        self.stops: List[Stop] = self._facts[Stop]
        self.steps: List[Step] = self._facts[Step]
        self.exchanges: List[Exchange] = self._facts[Exchange]
        self.failures: List[LeafFailure] = self._facts[LeafFailure]
        self.recoveries: List[RecoveryRound] = self._facts[RecoveryRound]
        self.results: List[NodeResult] = self._facts[NodeResult]
        self.errors: List[Noticed] = self._facts[Noticed]
        self._history = History(is_packed=False)
        self.extend(lines)

    def extend(self, lines: Iterable[Line]) -> None:
        """Fold the next events."""
        for line in lines:
            self.take(line)

    def take(self, line: Line) -> State:
        """Fold the next event, and return what is so now."""
        self.lines.append(line)
        self._history.take(self.state, line)
        self.state = fold(self.state, line.time, line.event)
        for fact in self.state.facts:
            self._facts[type(fact)].append(fact)
        return self.state

    def at(self, time: float) -> State:
        """Return what was so at that time: after all events up to then."""
        state, lines = self._history.until(time)
        for line in lines:
            state = fold(state, line.time, line.event)
        return state
