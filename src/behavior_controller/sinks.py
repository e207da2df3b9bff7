"""Bounded queues to threads that write: a terminal or log that blocks stops its own thread and nothing else."""
import collections
import io
import logging
import os
import re
import select
import sys
import textwrap
import threading
import time
import unicodedata
from typing import Any, Callable, Deque, Iterable, List

from behavior_controller.text import LONGEST, clean

COLOURS = re.compile(r"(?:\x1b\[[\d;]*m)*")
"""What rospy begins a line with on a terminal."""

RESET = "\x1b[0m"
"""What ends them. rospy writes it after the line's end, where it would wait for the next line of the same stream."""

LONGEST_LINE = 2 * LONGEST
"""Characters of a line: a text from outside, and what is told of it."""

MOST_WAITING = 1000
"""Items that may wait for a sink that takes none."""

AT_ONCE = 10
"""Items that a sink with a rest writes before it rests again."""

INDENT = "    "
"""What the second line and further ones begin with, where a line is broken to fit the terminal."""

LEFT_OUT = "%d lines left out: %s did not take them in time"


class Sink:
    """A daemon thread that writes what is put into its queue. ``put`` never waits; what does not fit is counted."""

    def __init__(self, name: str, write: Callable[[Any], object], left_out: Callable[[int], Any],
                 most: int = MOST_WAITING, rest: float = 0.0):
        """``left_out`` makes the item that tells how many were lost. Raises RuntimeError if there is no thread.

        With a ``rest`` in seconds ``put`` wakes no thread: the sink looks for itself each time that long has passed, and
        then writes at most ``AT_ONCE`` items, so that it competes with nothing that the robot waits for.
        """
        self._write = write
        self._left_out = left_out
        self._most = most
        self._rest = rest
        self._since_rest = 0  # items written
        self._is_drained = False  # somebody waits for the end of what is written
        self._waiting: Deque[Any] = collections.deque()
        self._lost = 0
        self._is_busy = False
        self._news = threading.Condition()
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def put(self, item: Any) -> None:
        """Have ``item`` written soon, in order; while the queue is full it is counted instead."""
        with self._news:
            if self._lost or len(self._waiting) >= self._most:
                self._lost += 1
            else:
                self._waiting.append(item)
                if not self._rest:
                    self._news.notify_all()

    def drain(self, seconds: float) -> None:
        """Return when everything is written, after ``seconds`` at the latest; nothing rests meanwhile."""
        with self._news:
            self._is_drained = True
            self._news.notify_all()
            self._news.wait_for(lambda: not (self._waiting or self._is_busy), seconds)
            self._is_drained = False

    def _work(self) -> None:
        while True:
            self._write(self._next())

    def _next(self) -> Any:
        """Wait for the next item and return it."""
        with self._news:
            self._is_busy = False
            self._news.notify_all()
            if self._rest:
                self._wait_for_look()
            else:
                self._news.wait_for(lambda: self._waiting)
            self._is_busy = True
            item = self._waiting.popleft()
            if self._lost and len(self._waiting) <= self._most // 2:
                self._waiting.append(self._left_out(self._lost))
                self._lost = 0
            return item

    def _wait_for_look(self) -> None:
        """Return when there is something, and it is time to write it."""
        while not self._waiting or self._since_rest >= AT_ONCE:
            self._news.wait_for(lambda: self._is_drained and self._waiting, self._rest)
            self._since_rest = 0
        self._since_rest += 1


def drain(sinks: Iterable[Sink], seconds: float) -> None:
    """Drain all of ``sinks``, within ``seconds`` together."""
    ends = time.monotonic() + seconds
    for sink in sinks:
        sink.drain(max(0.0, ends - time.monotonic()))


# ------------------------------------------------------------------------------------------------- the standard streams


class LineStream(io.TextIOBase):
    """A text stream whose whole lines go into a sink as bytes."""

    def __init__(self, sink: Sink, original: Any):
        """``original`` is the stream that this one stands for."""
        self._sink = sink
        self._original = original
        self._is_terminal = original.isatty()
        self._lock = threading.Lock()
        self._part = ""  # of a line that has not ended

    def write(self, text: str) -> int:
        """Take ``text``; a character that the terminal does not have, or that would control it, gets its code."""
        with self._lock:
            whole, newline, self._part = (self._part + text).rpartition("\n")
            for line in whole.split("\n") if newline else []:
                colours = COLOURS.match(line).group()  # type: ignore[union-attr]
                text = clean(line[len(colours):], LONGEST_LINE)
                colours = colours.replace(RESET, "")
                line = colours + text + (RESET if colours else "") + newline
                self._sink.put(line.encode(self._original.encoding, "backslashreplace"))
        return len(text)

    def isatty(self) -> bool:
        """Whether this is a terminal, so that lines may have colours."""
        return self._is_terminal

    def fileno(self) -> int:
        """Return the descriptor of the original."""
        return self._original.fileno()


def take_over_streams() -> List[Sink]:
    """Let ``sys.stdout`` and ``sys.stderr`` feed sinks, and return these: one if both are the same file."""
    out, err = sys.stdout, sys.stderr
    sinks = [_stream_sink(out)]
    if not os.path.sameopenfile(out.fileno(), err.fileno()):
        sinks.append(_stream_sink(err))
    sys.stdout, sys.stderr = LineStream(sinks[0], out), LineStream(sinks[-1], err)
    return sinks


def _stream_sink(stream: Any) -> Sink:
    descriptor = stream.fileno()

    def left_out(count: int) -> bytes:
        return "[WARN] [{:f}]: behaviorController: {}\n".format(time.time(), LEFT_OUT % (count, "the terminal")).encode()

    def write(data: bytes) -> None:
        if stream.isatty():
            data = fitted(data.decode(stream.encoding), columns(descriptor)).encode(stream.encoding)
        _write_all(descriptor, data)

    return Sink("stream {}".format(descriptor), write, left_out)


def columns(descriptor: int) -> int:
    """Return the width of a terminal in characters; 0 if it does not tell."""
    try:
        return os.get_terminal_size(descriptor).columns
    except OSError:
        return 0


def fitted(line: str, width: int) -> str:
    """Return a line with its end, broken between words into lines of at most ``width`` characters; 0: as it is."""
    colours = COLOURS.match(line).group()  # type: ignore[union-attr]
    text = line[len(colours):].rstrip("\n")
    end = RESET if colours and text.endswith(RESET) else ""
    text = text[:len(text) - len(end)]
    if any(unicodedata.east_asian_width(letter) in "WF" for letter in text):
        width //= 2  # such letters take two columns
    if len(text) <= width or width <= len(INDENT):
        return line
    return colours + "\n".join(textwrap.wrap(text, width, subsequent_indent=INDENT, break_on_hyphens=False)) + end + "\n"


def _write_all(descriptor: int, data: bytes) -> None:
    """Write ``data``, however long that takes; to a terminal that has gone away nothing is written."""
    try:
        while data:
            try:
                data = data[os.write(descriptor, data):]
            except BlockingIOError:  # another process has made the terminal non-blocking
                select.select([], [descriptor], [])
    except OSError:
        pass


# -------------------------------------------------------------------------------------------------------------- logging


class Detached(logging.Handler):
    """Hands records to another handler on a thread of its own."""

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(handler.level)
        self.path: str = getattr(handler, "baseFilename", "")
        """Of the log file, if ``handler`` writes one."""
        name = self.path or "/rosout"

        def left_out(count: int) -> logging.LogRecord:
            return logging.LogRecord("rosout", logging.WARNING, __file__, 0, "behaviorController: " + LEFT_OUT, (count, name), None)

        self.sink = Sink(name, handler.handle, left_out)

    def emit(self, record: logging.LogRecord) -> None:
        """Have ``record`` handled soon."""
        self.sink.put(record)
