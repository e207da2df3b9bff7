"""The results of a run as a bounded number of bars on a timeline: results that are alike and near form one bar."""
import math
from typing import Dict, Iterator, List, Optional, Tuple

MOST = 20_000
"""The most bars of a run; with more results, bars are coarser."""

GRAIN = 1.0
"""The shortest gap, in seconds, that separates two alike results of a lane into two bars."""


class Bar:
    """``count`` results of a kind, from ``begin`` to ``end``; ``note`` is a further text that they share."""

    __slots__ = ("begin", "end", "kind", "note", "count")

    def __init__(self, begin: float, end: float, kind: str, note: str = ""):
        self.begin = begin
        self.end = end
        self.kind = kind
        self.note = note
        self.count = 1


class Lanes:
    """The bars of each lane. Takes results in order of their ends; lanes have numbers."""

    def __init__(self) -> None:
        self.grain = GRAIN
        self.results = self.bars = 0
        self._most = MOST
        self._lanes: Dict[int, _Lane] = {}
        self._last: Optional[int] = None  # the lane of the last result

    def add(self, key: int, bar: Bar, is_asked_again: bool = False) -> None:
        """Add a result to a lane. ``is_asked_again``: alike results in a row are one bar, with any pause between them."""
        is_in_a_row = is_asked_again and self._last == key
        self._last = key
        self.results += 1
        lane = self._lanes.setdefault(key, _Lane())
        self.bars += lane.add(bar, math.inf if is_in_a_row else self.grain)
        if self.bars > self._most:
            self._coarsen()

    def end_wait(self, key: int, kind: str, end: float) -> None:
        """Have the last bar of a lane, if it is of that kind, last until ``end``; what is asked next is asked anew."""
        self._last = None
        bars = self._lanes[key].bars if key in self._lanes else []
        if bars and bars[-1].kind == kind:
            bars[-1].end = max(bars[-1].end, end)

    def _coarsen(self) -> None:
        self.grain *= 2
        old, self._lanes = self._lanes, {}
        for key, lane in old.items():
            self._lanes[key] = _Lane()
            for bar in lane.bars:
                self._lanes[key].add(bar, self.grain)
        self.bars = sum(len(lane.bars) for lane in self._lanes.values())
        self._most = max(MOST, self.bars * 5 // 4)  # kinds and notes without number cannot be joined

    def __contains__(self, key: int) -> bool:
        return key in self._lanes

    def __iter__(self) -> Iterator[Tuple[int, List[Bar]]]:
        return iter((key, self._lanes[key].bars) for key in sorted(self._lanes))


class _Lane:
    """Bars in order of their beginning, except those that others were joined to."""

    def __init__(self) -> None:
        self.bars: List[Bar] = []
        self._newest: Dict[Tuple[str, str], Bar] = {}  # of each kind and note

    def add(self, bar: Bar, grain: float) -> int:
        """Add a bar, or join it to the newest one of its kind; return the number of bars added."""
        newest = self._newest.get((bar.kind, bar.note))
        if newest is not None and bar.begin - newest.end < grain:
            newest.end = max(newest.end, bar.end)
            newest.count += bar.count
            return 0
        self._newest[bar.kind, bar.note] = bar
        self.bars.append(bar)
        return 1
