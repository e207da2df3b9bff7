"""What the robot says stays on the line that quotes it, and does nothing to a terminal."""
import logging

import pytest

from behavior_controller.events import (HealthChanged, LeafFinished, Noticed, PassFinished, Recovered, Retried,
                                        RunFinished, RunStarted)
from behavior_controller.gateway import Cause, Failure
from behavior_controller.ros import console as console_module
from behavior_controller.ros.connection import Trouble

ODD = "\x1b[2J\n[INFO] behaviorController: pass 1: SUCCESS\r\t\x9b\u202e\ud800"
FAILURE = Failure(Cause.HANDLER_EXCEPTION, ODD, ODD)


@pytest.fixture
def told():
    """The lines that reach the terminal, the log file and /rosout."""
    lines = []
    handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage())
    logger = logging.getLogger(console_module.ROSOUT)
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    yield lines
    logger.removeHandler(handler)
    logger.setLevel(before)


@pytest.fixture
def console(monkeypatch):
    """A console that leaves the test's streams and log handlers alone."""
    monkeypatch.setattr(console_module, "take_over_streams", list)
    monkeypatch.setattr(logging, "raiseExceptions", logging.raiseExceptions)
    for name in ("", "rosout"):
        monkeypatch.setattr(logging.getLogger(name), "handlers", [])
    return console_module.Console()


@pytest.mark.parametrize("event", [
    RunStarted(ODD, [], {}), LeafFinished(1, ODD, ODD, "FAILURE", ODD, 1.0, FAILURE), Retried(ODD, ODD, 1, FAILURE),
    Recovered(ODD, ODD, FAILURE, ODD, 1, False, ODD), HealthChanged("service", ODD, ODD, False, ODD, ODD),
    PassFinished(1, ODD, 1.0), Noticed("error", ODD), RunFinished(ODD, 3)])
def test_each_event_is_one_line(told, console, event):
    console.is_verbose = True
    console(event)
    assert len(told) == 1 and told[0].isprintable() and told[0].startswith("behaviorController: ")
    assert "\\x1b[2J" in told[0]


def test_what_another_node_answers_is_one_line():
    assert str(Trouble(Cause.HANDLER_EXCEPTION, ODD)).isprintable()
