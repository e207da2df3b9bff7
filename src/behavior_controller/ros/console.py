"""The operator's lines: the story of the run on the terminal and on /rosout, and never a traceback.

Normal mode: start-up lines, the story's sentences, and a heartbeat. Verbose mode: also a line for
each leaf that finishes and for each attempt that failed. Each line is handed to the threads of its
sinks (terminal, log file, /rosout).
"""
import logging
import os
import stat
import tempfile
import time
import traceback
from datetime import timedelta
from functools import partial
from typing import Callable, Dict, Optional

import rospkg
import rospy
from rosgraph.roslogging import configure_logging, makedirs_with_parent_perms

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.command import no_resources
from behavior_controller.run.events import (
    HANGS, PULSE, Event, LeafFinished, Noticed, Retried, RunFinished, SafeStateReported,
    clock_shift, computer_now, unix_now)
from behavior_controller.run.fold import fold
from behavior_controller.run.state import State
from behavior_controller.run.moment import card, card_line, instruction, robot_line
from behavior_controller.run.record.recorder import EncodedLine, Record
from behavior_controller.ros.sinks import (
    Detached, LineHandler, Sink, drain, take_over_streams, use_line_handler)
from behavior_controller.run.story import Story
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.ros.shortage import is_shortage
from behavior_controller.text import clean, joined

WRITE_INTERVAL = 0.05
"""Seconds between two rounds of formatting lines, so that nothing the robot does waits for them."""

MOST_UNFORMATTED = 2000
"""The most events and lines that wait to be formatted."""

HEARTBEAT_INTERVAL = 10.0
"""Seconds between two ``running`` lines (the project's standard, D3.2)."""

ROSOUT_LOGGER = "rosout.behavior_controller"
"""The logger that reaches the terminal, the log file and /rosout."""

FILE_ONLY = "behavior_controller"
"""The logger that reaches the log file alone."""

ROBOT_SPAN = 2.0
"""Seconds in which the robot's line comes only once: a fault of the network has many nodes go at
the same moment."""

SHORTAGE_SPAN = 1.0
"""Seconds in which a shortage is reported only once: it hits many threads at the same moment."""


class Console:
    """Writes events as lines. A sink of ``Events``. No thread that reports something waits for the
    writing."""

    def __init__(self) -> None:
        """Redirect the standard streams. Raises RuntimeError if no thread can be started."""
        self.is_verbose = False  # until the configuration is known
        # what writes a line, or those of an event: rospy's logging takes longer than all that the
        # tick thread does with one
        self._lines = Sink("the console", lambda write: write(),
                           lambda text: partial(self._log, computer_now(), "warning", text),
                           MOST_UNFORMATTED, WRITE_INTERVAL)
        self._sinks = [self._lines, take_over_streams()]
        self._story = Story()
        self._instruction = instruction(State())  # in the robot's line that was written last
        self._robot_written_at = -ROBOT_SPAN
        self._unmet: Dict[int, Failure] = {}  # why conditions were false last, by node
        self._logger = logging.getLogger(ROSOUT_LOGGER)
        self._shortage_reported_at = -SHORTAGE_SPAN
        self._clock_shift = 0  # that was reported
        # of rospy's own lines; ours go by ``tell``
        logging.getLogger("rosout").addFilter(_make_safe)
        # no traceback on the terminal for a log that cannot be written
        logging.raiseExceptions = False
        self.attach()

    def attach(self) -> None:
        """Have lines written by our threads. To be called again when rospy has set up its logging.
        """
        use_line_handler()
        for logger in (logging.getLogger("rosout"), logging.getLogger()):
            for handler in list(logger.handlers):
                # a LineHandler writes into our stream, which does not block
                if not isinstance(handler, (LineHandler, Detached)):
                    logger.removeHandler(handler)
                    logger.addHandler(self._detach(handler))

    def _detach(self, handler: logging.Handler) -> Detached:
        detached = Detached(handler)
        self._sinks.append(detached.sink)
        return detached

    def _keep_details(self, text: str) -> str:
        """Have ``text`` written only to the log file, or to a separate file if there is none;
        return the path."""
        root = logging.getLogger()
        paths = [handler.path for handler in root.handlers
                 if isinstance(handler, Detached) and handler.path]
        if not paths:
            paths.append(os.path.join(
                tempfile.gettempdir(), f"behaviorController_{os.getpid()}.log"))
            root.addHandler(self._detach(logging.FileHandler(paths[0], delay=True)))
        logging.getLogger(FILE_ONLY).error(text)
        return paths[0]

    def drain(self, seconds: float) -> None:
        """Return when all lines are written, after ``seconds`` at the latest."""
        drain(self._sinks, seconds)

    def __call__(self, event: Event) -> None:
        """Have the story's sentences about ``event`` written."""
        self._lines.put(partial(self._log_event, computer_now(), event, self.is_verbose))

    def tell(self, severity: str, text: str) -> None:
        """Write ``text`` as one clean line at ``info``, ``warning`` or ``error``; from any thread.
        """
        self._lines.put(partial(self._log, computer_now(), severity, clean(text)))

    def warn(self, text: str) -> None:
        """Write ``text`` as a warning."""
        self.tell("warning", text)

    def _log_event(self, at: float, event: Event, is_verbose: bool) -> None:
        for sentence in self._story.take(at, event):
            self._log(at, sentence.severity, sentence.text)
        # another event follows that one, which may be the end
        if not isinstance(event, SafeStateReported):
            self._log_robot(at, isinstance(event, RunFinished))
        if not is_verbose:
            return
        if isinstance(event, LeafFinished) and not self._is_repeated(event):
            parts = [event.status, event.resource, f"{event.seconds:.3f} s",
                     reason(event.failure), event.summary.text if event.summary is not None else ""]
        elif isinstance(event, Retried):
            attempt = f"attempt {event.attempt + 1}" if event.attempt else "its substitute"
            parts = [attempt + " failed", event.failure.resource, reason(event.failure)]
        else:
            return
        what = joined(", ", *parts)
        self._log(at, "info", clean(f"{event.node} ({event.path}): {what}"))

    def _log_robot(self, at: float, is_end: bool = False) -> None:
        """Write the robot's line when a person has to do something else than before, and at the
        end.
        """
        state = self._story.state
        has_news = instruction(state) != self._instruction and (
            at - self._robot_written_at >= ROBOT_SPAN)
        if has_news or is_end:
            robot = robot_line(state)
            self._instruction, self._robot_written_at = robot.instruction, at
            self._log(at, "warning" if robot.instruction else "info", "robot: " + robot.text)

    def _is_repeated(self, event: LeafFinished) -> bool:
        """Whether a condition is false as it was when it was asked before."""
        failure, before = event.failure, self._unmet.pop(event.uid, None)
        if failure is None or failure.cause is not Cause.CONDITION_FALSE:
            return False
        self._unmet[event.uid] = failure
        return before == failure

    def _log(self, at: float, severity: str, text: str) -> None:
        """Write a line about what happened at that time (``computer_now``)."""
        level = getattr(logging, severity.upper())
        if self._logger.isEnabledFor(level):
            record = self._logger.makeRecord(self._logger.name, level, __file__, 0,
                                             "behaviorController: %s", (text,), None)
            record.created -= computer_now() - at
            record.msecs = record.created % 1.0 * 1000.0
            self._logger.handle(record)

    def report_internal_error(self, error: BaseException) -> None:
        """Report in one line an internal error and the place of its traceback, or that a resource
        is used up; the latter at most once in ``SHORTAGE_SPAN`` seconds."""
        if not is_shortage(error):
            text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
            place = self._keep_details("internal error\n" + text)
            self.tell("error", f"internal error ({type(error).__name__}: {error}); please report "
                               f"it with the details in {place}")
        elif time.monotonic() - self._shortage_reported_at >= SHORTAGE_SPAN:
            self._shortage_reported_at = time.monotonic()
            self.tell("error", no_resources(error))

    def start_heartbeat(self, clock: Clock, emit: Callable[[Event], None], record: Record) -> None:
        """Show every ten seconds that the tick thread still runs its timers, and what the run does,
        by the lines of ``record``; ``emit`` an event if the computer's clock has jumped."""
        run = _Now()
        record.add(run)

        def write(at: float) -> None:
            self._log_robot(at)
            self._log(at, "info", f"running. {card_line(card(run.state), unix_now())}")

        def beat() -> None:
            jump, self._clock_shift = clock_shift() - self._clock_shift, clock_shift()
            if jump:
                emit(Noticed("warning", jumped(jump)))
            self._lines.put(partial(write, computer_now()))
            clock.call_after(HEARTBEAT_INTERVAL, beat)

        clock.call_after(HEARTBEAT_INTERVAL, beat)
        _watch_pulse(clock, emit)


class _Now:
    """What is so after the newest line of a run: an output of its record."""

    def __init__(self) -> None:
        self.state = State()

    def put(self, line: EncodedLine) -> None:
        """Take the next line."""
        self.state = fold(self.state, line.time, line.event)

    def close(self) -> None:
        """Do nothing: the state is known to the end."""


def _make_safe(record: logging.LogRecord) -> bool:
    """Turn a message of rospy's into one clean line; a traceback goes only to the log file. A
    filter of its logger."""
    head, traceback_head, _ = record.getMessage().partition("\nTraceback (most recent call last)")
    details = ""
    if traceback_head:
        logging.getLogger(FILE_ONLY).error("%s", record.getMessage())
        details = " (details in the log file)"
    record.msg, record.args = clean(head) + details, ()
    return True


def _watch_pulse(clock: Clock, emit: Callable[[Event], None]) -> None:
    """Have an event emitted after each time in which the tick thread has stood still."""
    last = clock.source()

    def look() -> None:
        nonlocal last
        still, last = clock.source() - last - PULSE, clock.source()
        if still >= HANGS:
            emit(Noticed("warning", f"the controller stood still for {still:.0f} s"))
        clock.call_after(PULSE, look)

    clock.call_after(PULSE, look)


def jumped(seconds: int) -> str:
    """Return what an operator has to know when the computer's clock has jumped."""
    direction, length = "forward" if seconds > 0 else "back", timedelta(seconds=abs(seconds))
    return (f"the computer's clock jumped {direction} by {length} (h:min:s); the mission does not "
            "depend on it, and the times in the record go on without the jump")


def reason(failure: Optional[Failure]) -> str:
    """Return cause and message of a ``Failure`` on one line; empty for None."""
    if failure is None:
        return ""
    return f"{failure.cause.text}: {' '.join(failure.message.split())}"


def log_path() -> str:
    """Return the path of the log file of this node, whose name is known: that of ``__log``, or one
    in ROS' log folder."""
    given = rospy.names.get_mappings().get("__log")
    if given:
        return os.path.abspath(given)
    name = rospy.get_name().strip("/").replace("/", "_")
    return os.path.join(rospkg.get_log_dir(), name + ".log")


def open_log(path: str) -> None:
    """Have rospy write the log file. Raises OSError if that is not possible; may hang with the
    disk: rospy itself opens it under the lock that every line needs."""
    makedirs_with_parent_perms(os.path.dirname(path))
    if os.path.exists(path) and not stat.S_ISREG(os.stat(path).st_mode):
        raise OSError("it is not a regular file")
    os.close(os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666))
    # as rospy does, but without a link "latest" beside the folder that __log names
    configure_logging("rospy", filename=path, env={"ROS_LOG_DIR": os.path.dirname(path)})
