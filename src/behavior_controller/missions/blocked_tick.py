"""Reports a leaf whose code blocks the tick thread: the tree stands still then, and nothing else
can report it."""
import threading
import time
from typing import Any, Callable, Optional, Tuple
from weakref import WeakSet

from behavior_controller.bt.engine.failure import node_on
from behavior_controller.foreign_code import place
from behavior_controller.interpreter import frame_of
from behavior_controller.missions.runner import Runner

INTERVAL = 0.25
"""Seconds between two checks."""

NO_LEAF = None, "the tick thread has not reacted"
"""The leaf and the words when the tick thread is in the code of no leaf."""

CHECKS = 4
"""A leaf that has been in the same tick at so many checks in a row, for a second, is reported."""


class BlockedTickMonitor:
    """Watches the tick thread, which is the one that makes this object."""

    def __init__(self, runner: Runner, tell: Callable[[str, str], None]):
        """``tell`` gets severity and text of a line, on the thread of the watch."""
        self._runner, self._tell = runner, tell
        self._tick_thread = threading.get_ident()
        self._before: Optional[Tuple[object, Any]] = None  # moment and leaf of the last check
        self._checks = 0
        # not by number: another mission, after a reload, has the same numbers
        self._reported: "WeakSet[Any]" = WeakSet()

    def start(self) -> None:
        """Check from now on, on a separate thread."""
        threading.Thread(target=self._watch, name="standstill", daemon=True).start()

    def _watch(self) -> None:
        while True:
            time.sleep(INTERVAL)
            self.check()

    def check(self) -> None:
        """Report the leaf that blocks the tick thread, once."""
        # counted, not timed: a machine that was suspended has blocked nothing
        moment = self._runner.moment()
        leaf, text = self._leaf() if moment is not None else NO_LEAF
        self._checks += 1
        if leaf is None or (moment, leaf) != self._before:
            self._checks = 0
        self._before = moment, leaf
        if self._checks == CHECKS and leaf not in self._reported:
            self._reported.add(leaf)
            self._tell("warning", f"{text} for {CHECKS * INTERVAL:g} s: the mission stands still "
                                  "until it returns")

    def is_blocked(self, seconds: float) -> bool:
        """Return whether the tick thread stays where it is for that long, and does not wait for an
        event there."""
        moment = self._runner.moment()
        time.sleep(seconds)
        return moment is not None and moment == self._runner.moment()

    def blocking(self) -> str:
        """Return which leaf's code the tick thread is in, as the beginning of a sentence."""
        return self._leaf()[1]

    def _leaf(self) -> Tuple[Any, str]:
        """Return the leaf in whose code the tick thread is, and the words for that, or ``NO_LEAF``.
        """
        node, frame = node_on(frame_of(self._tick_thread))
        if node is None or frame is None:
            return NO_LEAF
        return node, "{}the leaf '{}' [{}] has not returned from {}".format(
            node.place_in_file(), node.full_path, node.registration_id,
            place(frame.f_code.co_filename, frame.f_lineno))
