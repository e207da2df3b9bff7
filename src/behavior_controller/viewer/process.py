"""The viewer that the controller starts as a child: fed with the lines of the run, and started
again if it ends or hangs.

The robot's program waits for nothing of it: lines are queued, and written by a thread of their own.
"""
import collections
import contextlib
import os
import select
import subprocess
import sys
import threading
import time
from typing import Callable, Deque, List, Optional

from behavior_controller.run import from_viewer
from behavior_controller.run.events import unix_now
from behavior_controller.run.from_viewer import HookChange, ViewerTold
from behavior_controller.run.record.outset import Outset
from behavior_controller.run.record.recorder import EncodedLine

MOST_FOR_VIEWER = 100_000
"""The most lines that wait for a viewer; with more it is started again."""

LINES_POLL = 0.02
"""Seconds between two looks for lines."""

NO_SIGN_LIMIT = 10.0
"""Seconds without a sign of life after which a viewer is started again."""

PAUSES = (1.0, 30.0)
"""Seconds from one start to the next, at least: the first time, and at most."""

_LAST_LINES = 0.5
"""Seconds at the end to hand over the last lines."""

LONGEST_FROM_VIEWER = 65_536
"""The most bytes of a line from the viewer."""

VIEWER_COMMAND = [sys.executable, "-m", "behavior_controller.viewer.main", "-", "--child"]


class ViewerProcess:
    """A child process that shows the run; an output of its record."""

    def __init__(self, arguments: List[str], changed: Callable[[HookChange], None],
                 cut_off: Callable[[], None], warn: Callable[[str], None],
                 serves: Callable[[int, int], None]):
        """Start it with these arguments. On other threads, ``changed`` gets changes of hooks,
        ``cut_off`` is called when none comes any more, ``warn`` gets lines for the operator, and
        ``serves`` gets the ports of page and Groot2 when one of them is there."""
        self._arguments = arguments
        self._changed, self._cut_off, self._warn, self._serves = changed, cut_off, warn, serves
        self.ports = (0, 0)
        """Those of page and Groot2; 0: it is not served."""
        self._waiting: Deque[EncodedLine] = collections.deque()
        self._has_lost = False
        self._outset = Outset()
        self._lines = 0  # that were handed over
        self._trouble = ""
        self._child: Optional["subprocess.Popen[bytes]"] = None
        self._lived = self._started = self._checked = 0.0
        self._pause = PAUSES[0]
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._work, name="viewer", daemon=True)
        self._thread.start()

    def put(self, line: EncodedLine) -> None:
        """Queue a line."""
        if len(self._waiting) >= MOST_FOR_VIEWER:
            self._has_lost = True
        else:
            self._waiting.append(line)

    def close(self) -> None:
        """Hand over the last lines, for ``_LAST_LINES`` seconds at most. The viewer shows the end,
        and ends by itself; one that hangs is killed."""
        self._is_over.set()
        self._thread.join(_LAST_LINES)
        child = self._child
        if child is not None and time.monotonic() - self._lived > NO_SIGN_LIMIT / 4:
            child.kill()

    # -------------------------------------------------------------------------------- on its thread

    def _work(self) -> None:
        while True:
            is_last = self._is_over.wait(LINES_POLL)
            if self._is_in_trouble() and not is_last:
                self._restart()
            with contextlib.suppress(OSError):  # it has ended: the next round sees that
                self._hand_over()
            if is_last:
                break
        if self._child is not None and self._child.stdin is not None:
            self._child.stdin.close()

    def _is_in_trouble(self) -> bool:
        """Whether the viewer has to be started again; the first reason counts."""
        self._trouble = self._trouble or self._find_trouble()
        return self._trouble != ""

    def _find_trouble(self) -> str:
        if self._child is None:
            return "it has not been started"
        code = self._child.poll()
        if code is not None:
            return f"it was ended by signal {-code}" if code < 0 else f"it ended with code {code}"
        now, before, self._checked = time.monotonic(), self._checked, time.monotonic()
        if now - before > NO_SIGN_LIMIT / 4:
            self._lived = now  # this process was stopped, and has not read what came
        if now - self._lived > NO_SIGN_LIMIT:
            return f"it gave no sign of life for {NO_SIGN_LIMIT:g} s"
        return "it did not take the lines of the run in time" if self._has_lost else ""

    def _restart(self) -> None:
        now, child = time.monotonic(), self._child
        if child is not None:
            child.kill()
        if self._started:
            if now - self._started < self._pause:
                return
            self._pause = min(PAUSES[1], 2 * self._pause)
            if self._lived - self._started > PAUSES[1]:  # it was stable
                self._pause = PAUSES[0]
        if child is not None:
            child.wait()
            self._warn(f"the viewer (page, Groot2) is started again: {self._trouble}; the mission "
                       "goes on")
        self._started = self._lived = now
        self._has_lost, self._trouble, self._child = False, "", None
        try:
            self._child = self._new_child()
        except (OSError, RuntimeError) as error:
            self._warn(f"the viewer (page, Groot2) cannot be started: {error}; it is tried again")
            return
        with contextlib.suppress(OSError):
            self._write(self._outset.head(self._lines, unix_now()))

    def _new_child(self) -> "subprocess.Popen[bytes]":
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
        child = subprocess.Popen(
            VIEWER_COMMAND + self._arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, bufsize=0, env=environment,
            cwd="/",  # Python's -m looks for modules in the working directory first
            start_new_session=True)  # Ctrl-C in the terminal is for the controller alone
        assert child.stdin is not None
        os.set_blocking(child.stdin.fileno(), False)
        threading.Thread(target=self._listen, args=(child,), name="from viewer",
                         daemon=True).start()
        return child

    def _hand_over(self) -> None:
        """Write the lines that wait. Raises OSError if the viewer does not take them."""
        while self._waiting:
            line = self._waiting.popleft()
            self._lines += 1
            self._outset.take(line.time, line.event)
            self._write(line.text)

    def _write(self, data: bytes) -> None:
        child = self._child
        if child is None or child.stdin is None or child.poll() is not None:
            return  # the next one gets it
        pipe, rest, room = child.stdin.fileno(), memoryview(data), select.poll()
        room.register(pipe, select.POLLOUT)
        while rest:
            if room.poll(1000 * LINES_POLL):
                rest = rest[os.write(pipe, rest[:select.PIPE_BUF]):]
            elif self._is_in_trouble():
                child.kill()
                return

    # ------------------------------------------------------------------------ what the viewer sends

    def _listen(self, child: "subprocess.Popen[bytes]") -> None:
        output = child.stdout
        assert output is not None
        for line in iter(lambda: output.readline(LONGEST_FROM_VIEWER), b""):
            with contextlib.suppress(ValueError):  # a torn line of a viewer that was killed
                self._take(from_viewer.decode(line))
        self.ports = (0, 0)
        self._cut_off()

    def _take(self, sent: from_viewer.FromViewer) -> None:
        self._lived = time.monotonic()
        if isinstance(sent, HookChange):
            self._changed(sent)
        elif isinstance(sent, ViewerTold):
            self._warn(sent.text)
        elif self.ports != (sent.page, sent.groot2):
            self.ports = (sent.page, sent.groot2)
            self._serves(*self.ports)
