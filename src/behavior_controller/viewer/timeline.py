"""The results of a run as a bounded number of bars on a timeline: results that are alike and near
form one bar."""
import math
from typing import Dict, Iterator, List, Optional, Tuple

from msgspec import Struct

MOST_BARS = 20_000
"""The most bars of a run; with more results, bars are coarser."""

GRAIN = 1.0
"""The shortest gap, in seconds, that separates two alike results of a lane into two bars."""


class Bar(Struct):
    """``count`` results of a kind, from ``begin`` to ``end``; ``note`` is a further text that they
    share."""

    begin: float
    end: float
    kind: str
    note: str = ""
    count: int = 1


class Lanes:
    """The bars of each lane, in order of their beginning, except those that others were joined to.

    Takes results in order of their ends; lanes have numbers.
    """

    def __init__(self) -> None:
        self.grain = GRAIN
        self.results = self.bars = 0
        self._most = MOST_BARS
        self._lanes: Dict[int, List[Bar]] = {}
        self._newest: Dict[Tuple[int, str, str], Bar] = {}  # of each lane, kind and note
        self._last: Optional[int] = None  # the lane of the last result

    def add(self, key: int, bar: Bar, is_asked_again: bool = False) -> None:
        """Add a result to a lane. ``is_asked_again``: alike results in a row are one bar, with any
        pause between them."""
        is_in_a_row = is_asked_again and self._last == key
        self._last = key
        self.results += 1
        self._put(key, bar, math.inf if is_in_a_row else self.grain)
        if self.bars > self._most:
            self._coarsen()

    def _put(self, key: int, bar: Bar, grain: float) -> None:
        """Add a bar, or join it to the newest one of its kind."""
        newest = self._newest.get((key, bar.kind, bar.note))
        if newest is not None and bar.begin - newest.end < grain:
            newest.end = max(newest.end, bar.end)
            newest.count += bar.count
            return
        self._newest[key, bar.kind, bar.note] = bar
        self._lanes.setdefault(key, []).append(bar)
        self.bars += 1

    def end_wait(self, key: int, kind: str, end: float) -> None:
        """Have the last bar of a lane, if it is of that kind, last until ``end``; what is asked
        next is asked anew."""
        self._last = None
        bars = self._lanes.get(key)
        if bars and bars[-1].kind == kind:
            bars[-1].end = max(bars[-1].end, end)

    def _coarsen(self) -> None:
        self.grain *= 2
        old, self._lanes, self._newest, self.bars = self._lanes, {}, {}, 0
        for key, bars in old.items():
            for bar in bars:
                self._put(key, bar, self.grain)
        # kinds and notes without number cannot be joined
        self._most = max(MOST_BARS, self.bars * 5 // 4)

    def __contains__(self, key: int) -> bool:
        return key in self._lanes

    def __iter__(self) -> Iterator[Tuple[int, List[Bar]]]:
        return iter(sorted(self._lanes.items()))
