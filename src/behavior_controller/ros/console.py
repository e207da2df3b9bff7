"""What an operator sees: events as lines on the terminal and on /rosout, and never a traceback.

Normal mode: start-up lines, warnings, errors, begin and end of each pass, and a heartbeat. Verbose mode: also a line for each
leaf that finishes. Every line comes at once, also into a pipe or a file.
"""
import logging
import os
import sys
import tempfile
import traceback
from typing import Any, Callable, Dict

from rosgraph.roslogging import RosStreamHandler

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.text import clean
from behavior_controller.events import (Event, HealthChanged, LeafFinished, Noticed, PassFinished, PassStarted,
                                        Recovered, Retried, RunFinished, RunStarted)

HEARTBEAT = 10.0
"""Seconds between two ``running`` lines (the project's standard, D3.2)."""

ROSOUT = "rosout.behavior_controller"
"""The logger that reaches the terminal, the log file and /rosout."""

FILE_ONLY = "behavior_controller"
"""The logger that reaches the log file alone."""


def flush_every_line() -> None:
    """Let nothing wait in a buffer, and no character of a message fail on a terminal that does not have it."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(line_buffering=True, errors="backslashreplace")


class Console:
    """Writes events as lines. A sink of ``Events``."""

    def __init__(self, is_verbose: bool = False):
        """``is_verbose`` may be set later, when the configuration is known."""
        self.is_verbose = is_verbose
        self._logger = logging.getLogger(ROSOUT)
        self._lines: Dict[type, Callable[[Any], None]] = {
            RunStarted: self._run_started, LeafFinished: self._leaf_finished, Retried: self._retried,
            Recovered: self._recovered, HealthChanged: self._health_changed, PassFinished: self._pass_finished,
            PassStarted: lambda event: None, Noticed: self._noticed, RunFinished: self._run_finished}

    def attach(self) -> None:
        """Make sure that lines reach the terminal; rospy sets up no logging when it has nowhere for its log file."""
        logger = logging.getLogger("rosout")
        if not any(isinstance(handler, RosStreamHandler) for handler in logger.handlers):
            logger.addHandler(RosStreamHandler())
            logger.setLevel(logging.INFO)

    def __call__(self, event: Event) -> None:
        """Write the line of ``event``, if it has one."""
        self._lines[type(event)](event)

    def tell(self, level: str, text: str) -> None:
        """Write ``text`` as one line, whatever outside text it quotes, at ``info``, ``warning`` or ``error``."""
        try:
            getattr(self._logger, level)("behaviorController: %s", clean(text))
        except (OSError, ValueError):
            pass  # the terminal has gone away; the mission goes on

    def start_heartbeat(self, clock: Clock) -> None:
        """Show every ten seconds that the tick thread still runs its timers."""
        def beat() -> None:
            self.tell("info", "running.")
            clock.call_after(HEARTBEAT, beat)

        clock.call_after(HEARTBEAT, beat)

    # ------------------------------------------------------------------------------------------------ one event each

    def _run_started(self, event: RunStarted) -> None:
        self.tell("info", "mission {} starts, {} mission leaves".format(event.mission, len(event.leaves)))

    def _leaf_finished(self, event: LeafFinished) -> None:
        if not self.is_verbose:
            return
        parts = [event.status, event.resource, "{:.3f} s".format(event.seconds), reason(event.failure)]
        self.tell("info", "{} ({}): {}".format(event.node, event.path, ", ".join(part for part in parts if part)))

    def _retried(self, event: Retried) -> None:
        if self.is_verbose:
            self.tell("info", "{} ({}): retry {} failed, {}, {}".format(
                event.node, event.path, event.attempt, event.failure.resource, reason(event.failure)))

    def _recovered(self, event: Recovered) -> None:
        self.tell("warning", "recovery at {}: {}{}; policy: {}; {} attempt{}: {}".format(
            event.path, reason(event.failure), " at " + event.failure.resource if event.failure.resource else "",
            event.policy, event.attempts, "" if event.attempts == 1 else "s", event.outcome))

    def _health_changed(self, event: HealthChanged) -> None:
        self.tell("info" if event.is_well else "warning", "{} {}{}: {}{}".format(
            event.kind, event.name, " (of node /{})".format(event.node) if event.node else "", event.status,
            "; " + event.consequence if event.consequence else ""))

    def _pass_finished(self, event: PassFinished) -> None:
        level = "info" if event.outcome == "SUCCESS" else "warning"
        self.tell(level, "pass {}: {} after {:.1f} s".format(event.number, event.outcome, event.seconds))

    def _noticed(self, event: Noticed) -> None:
        self.tell(event.level, event.text)

    def _run_finished(self, event: RunFinished) -> None:
        self.tell("info", "ends: {} (exit code {})".format(event.outcome, event.exit_code))


def reason(failure: Any) -> str:
    """Return cause and message of a ``Failure`` on one line; empty for None."""
    return "{}: {}".format(failure.cause.value, " ".join(failure.message.split())) if failure is not None else ""


def report_internal_error(console: Console, error: BaseException) -> None:
    """Tell of a mistake of ours in one line, and where its traceback is."""
    text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    path = os.environ.get("ROS_LOG_FILENAME")  # rospy's log file, once it has one
    if path:
        logging.getLogger(FILE_ONLY).error("internal error\n%s", text)
    else:
        path = os.path.join(tempfile.gettempdir(), "behaviorController_internal_error_{}.log".format(os.getpid()))
        with open(path, "w") as file:
            file.write(text)
    console.tell("error", "internal error ({}: {}); please report it with the details in {}".format(
        type(error).__name__, error, path))
