"""Bounded queues to threads that write: a terminal or log that blocks stops its own thread and
nothing else."""
import collections
import contextlib
import io
import itertools
import logging
import os
import re
import select
import sys
import textwrap
import threading
import time
import unicodedata
from datetime import datetime
from typing import Any, Callable, Deque, Iterable, NamedTuple

from rosgraph.roslogging import _logging_to_rospy_names, RosStreamHandler

from behavior_controller.text import LONGEST, clean

COLOURS = re.compile(r"(?:\x1b\[[\d;]*m)*")
"""The control sequences with which rospy begins a coloured line."""

RESET = "\x1b[0m"
"""Their end. rospy writes it after the line's end, where it would stay in the buffer until the next
line."""

LONGEST_SHOWN = 2 * LONGEST
"""The most characters of a line: a text from outside, and the message around it."""

MOST_UNWRITTEN = 1000
"""The most items that wait for a blocked sink."""

MOST_IN_ROW = 100
"""The most items that a sink with a rest writes before it rests again."""

FLOOD = 1000
"""The number of waiting items from which such a sink does not try to keep up, because that would
slow down the robot."""

MOST_IN_FLOOD = 10
"""The most items that it then writes before it rests again."""

INDENT = "    "
"""The indentation of continued lines, where a line is broken to fit the terminal."""


class Sink:
    """A daemon thread that writes the items of its queue. ``put`` never waits; items that do not
    fit are counted."""

    def __init__(self, name: str, write: Callable[[Any], object], item: Callable[[str], Any],
                 most: int = MOST_UNWRITTEN, rest: float = 0.0):
        """``item`` makes an item of the text that reports how many were lost. Raises RuntimeError
        if no thread can be started.

        With a ``rest`` in seconds ``put`` wakes no thread: the sink checks its queue at that
        interval and writes at most ``MOST_IN_ROW`` items each time, ``MOST_IN_FLOOD`` in a flood,
        so that it delays nothing that the robot waits for.
        """
        self._name, self._write, self._item = name, write, item
        self._most, self._rest = most, rest
        self._since_rest = 0  # items written
        self._is_drained = False  # a thread waits until everything is written
        self._waiting: Deque[Any] = collections.deque()  # the first one is being written
        self._losses = itertools.count(1)
        self._lost = self._reported = 0  # how many items did not fit, and how many of them are told
        self._news = threading.Condition()
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def put(self, item: Any) -> None:
        """Queue ``item`` for writing; if the queue is full, count it as lost."""
        # both without the lock: the threads that report something must not wait for each other
        if self._lost > self._reported or len(self._waiting) > self._most:
            self._lost = next(self._losses)
            return
        self._waiting.append(item)
        if not self._rest:
            with self._news:
                self._news.notify_all()

    def drain(self, seconds: float) -> None:
        """Return when everything is written, after ``seconds`` at the latest; the sink does not
        rest meanwhile."""
        with self._news:
            self._is_drained = True
            self._news.notify_all()
            self._news.wait_for(lambda: not self._waiting, seconds)
            self._is_drained = False

    def _work(self) -> None:
        while True:
            with self._news:
                while not self._waiting or self._must_rest():
                    self._news.wait_for(
                        lambda: self._waiting and (self._is_drained or not self._rest),
                        self._rest or None)
                    self._since_rest = 0
                self._since_rest += 1
                lost = self._lost - self._reported
                # at most half of them wait besides the first
                if lost > 0 and len(self._waiting) - 1 <= self._most // 2:
                    self._waiting.append(self._item(
                        f"{lost} lines left out: {self._name} did not take them in time"))
                    self._reported += lost
            self._write(self._waiting[0])
            with self._news:
                self._waiting.popleft()
                self._news.notify_all()

    def _must_rest(self) -> bool:
        most = MOST_IN_ROW if len(self._waiting) < FLOOD else MOST_IN_FLOOD
        return bool(self._rest) and self._since_rest >= most


def drain(sinks: Iterable[Sink], seconds: float) -> None:
    """Drain all of ``sinks``, within ``seconds`` together."""
    ends = time.monotonic() + seconds
    for sink in sinks:
        sink.drain(max(0.0, ends - time.monotonic()))


# ----------------------------------------------------------------------------- the standard streams


class ColouredLine(NamedTuple):
    """A line without its end; the terminal's ``colours`` precede it, and end with it."""

    colours: str
    text: str


class LineStream(io.TextIOBase):
    """A text stream whose whole lines go into a sink."""

    def __init__(self, sink: Sink, original: Any):
        """``original`` is the stream that this one replaces."""
        self._sink, self._original = sink, original
        self._lock = threading.Lock()
        self._part = ""  # of a line that has not ended

    def write(self, text: str) -> int:
        """Queue ``text``; characters that would control the terminal are escaped."""
        with self._lock:
            *lines, self._part = (self._part + text).split("\n")
            for line in lines:
                colours = COLOURS.match(line).group()  # type: ignore[union-attr]
                shown = clean(line[len(colours):], LONGEST_SHOWN)
                self._sink.put(ColouredLine(colours.replace(RESET, ""), shown))
        return len(text)

    def isatty(self) -> bool:
        """Whether this is a terminal, so that lines may have colours: see https://no-color.org."""
        return self._original.isatty() and not os.environ.get("NO_COLOR")

    def fileno(self) -> int:
        """Return the descriptor of the original."""
        return self._original.fileno()


NAMED = "]: behaviorController: "
"""What a terminal, which shows one program, does without; other readers get the node's name."""

HEARTBEAT = NAMED + "running."
"""The only line that keeps it (D3.2)."""


def take_over_streams() -> Sink:
    """Redirect ``sys.stdout`` and ``sys.stderr`` to a sink for standard output, and return it: only
    the lines of one stream keep their order."""
    stream = sys.stdout

    def warning(text: str) -> ColouredLine:
        return ColouredLine("", f"[WARN] [{time_of_day(time.time())}]{NAMED}{text}")

    def write(line: ColouredLine) -> None:
        text, end = line.text, RESET if line.colours else ""
        with contextlib.suppress(OSError):  # the terminal is gone
            if stream.isatty():
                if HEARTBEAT not in text:
                    text = text.replace(NAMED, "]: ", 1)
                text = fitted(text, os.get_terminal_size(stream.fileno()).columns)
            data = f"{line.colours}{text}{end}\n".encode(stream.encoding, "backslashreplace")
            _write_all(stream.fileno(), data)

    sink = Sink("the terminal", write, warning)
    sys.stdout = sys.stderr = LineStream(sink, stream)
    return sink


def fitted(text: str, width: int) -> str:
    """Return a line broken between words into lines of at most ``width`` characters; 0: as it is.
    """
    if any(unicodedata.east_asian_width(letter) in "WF" for letter in text):
        width //= 2  # such letters take two columns
    if len(text) <= width or width <= len(INDENT):
        return text
    is_path = "/" in max(text.split(), key=len, default="")  # is copied: the terminal breaks it
    return "\n".join(textwrap.wrap(text, width, subsequent_indent=INDENT, break_on_hyphens=False,
                                   break_long_words=not is_path))


def _write_all(descriptor: int, data: bytes) -> None:
    """Write ``data`` without a time limit."""
    while data:
        try:
            data = data[os.write(descriptor, data):]
        except BlockingIOError:  # another process has made the terminal non-blocking
            select.select([], [descriptor], [])


# ------------------------------------------------------------------------------------------ logging


FORMAT_VARIABLE = "ROSCONSOLE_FORMAT"
"""The environment variable with the user's format of a line."""


def time_of_day(at: float) -> str:
    """Return a time in seconds since 1970 as the time of day, to the millisecond."""
    return datetime.fromtimestamp(at).time().isoformat("milliseconds")


class LineHandler(RosStreamHandler):
    """Writes lines as rospy does. Without a format of the user's they begin with the time of day:
    rospy's own default has seconds since 1970."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write ``record``."""
        if FORMAT_VARIABLE in os.environ:
            super().emit(record)
            return
        level, colour = _logging_to_rospy_names[record.levelname]
        text = logging.Formatter().format(record)
        self._write(self._stdout, f"[{level}] [{time_of_day(record.created)}]: {text}\n", colour)


def use_line_handler() -> None:
    """Have the lines for the terminal written by a ``LineHandler``, to standard output alone. To be
    called again when rospy has set up its logging."""
    rosout = logging.getLogger("rosout")
    for handler in list(rosout.handlers):
        if type(handler) is RosStreamHandler:
            rosout.removeHandler(handler)
    if not any(isinstance(handler, LineHandler) for handler in rosout.handlers):
        rosout.addHandler(LineHandler(stdout=sys.stdout, stderr=sys.stdout))
        rosout.setLevel(logging.INFO)  # rospy sets up nothing if it cannot write its log file


class Detached(logging.Handler):
    """Passes records to another handler on a separate thread."""

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(handler.level)
        self.path: str = getattr(handler, "baseFilename", "")
        """The stream of the log file, if ``handler`` writes one."""

        def warning(text: str) -> logging.LogRecord:
            return logging.LogRecord("rosout", logging.WARNING, __file__, 0,
                                     "behaviorController: %s", (text,), None)

        def write(record: logging.LogRecord) -> None:
            with contextlib.suppress(OSError):  # the file cannot be opened
                handler.handle(record)

        self.sink = Sink(self.path or "/rosout", write, warning)

    def emit(self, record: logging.LogRecord) -> None:
        """Queue ``record``."""
        self.sink.put(record)
