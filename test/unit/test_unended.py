"""What a start that is refused says of the robot, from the record of a run that was killed."""
import fcntl
import os
import shutil

import pytest

from behavior_controller.run.events import (
    KILLED, MISSING, READY, Answered, Asked, Checked, Line, SafePart, SafeStateReported,
    StepStarted)
from behavior_controller.run.fold import fold
from behavior_controller.run.history import Run
from behavior_controller.run.state import BROKEN_OFF, State
from behavior_controller.run.moment import left_running
from behavior_controller.run.readiness import is_ready, readiness
from behavior_controller.run.record import files, unended
from behavior_controller.run.record.tail import RunTail, follow
from behavior_controller.run.record.unended import may_be_live
from behavior_controller.run.record.reader import read_record
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, GoTo, Location, SetAnimation, SetAttention
from behavior_controller.viewer.report import story_lines
from mission_rig import recorded, visitor_who

LOOKS, MOVES = Asked(1, "/a", SetAttention("social")), Asked(2, "/b", SetAnimation("enabled"))
STILL, STIFF = Asked(1, "/a", SetAttention("disabled")), Asked(2, "/b", SetAnimation("disabled"))
DRIVES = (StepStarted(1, "Navigate", "n", "driving", "to Pepper", 180.0, False),
          Asked(3, "/c", GoTo(Location(1.0, 2.0, 0.0))))
FIRST, SECOND, THIRD = (Answered(number, Answer("")) for number in (1, 2, 3))
REFUSED = Answered(1, Failure(Cause.REFUSED, "no", "/a"))
OFF = SafeStateReported((SafePart("attention", "/a", None),
                         SafePart("lifelike movement", "/b", None)), 0.1)
BY_HAND = "attention may be on: switch it off by hand"
BOTH = "attention and lifelike movement may be on: switch them off by hand"
MAY_DRIVE = "may still be driving to Pepper: keep the stop button at hand"


@pytest.mark.parametrize("events, expected", [
    ([], ""), ([LOOKS, FIRST], BY_HAND), ([LOOKS], BY_HAND), ([LOOKS, REFUSED], BY_HAND),
    ([LOOKS, MOVES, FIRST, SECOND], BOTH), ([LOOKS, FIRST, STILL, REFUSED], BY_HAND),
    ([LOOKS, FIRST, STILL, FIRST], ""), ([LOOKS, MOVES, OFF], ""),
    ([STILL, STIFF, FIRST, SECOND], ""), (DRIVES, MAY_DRIVE), ([*DRIVES, THIRD], ""),
    ([*DRIVES, Answered(3, Failure(Cause.NO_ANSWER, "", "/c"))], MAY_DRIVE),
    ([LOOKS, *DRIVES, FIRST], f"{BY_HAND}; {MAY_DRIVE}")])
def test_what_may_be_on_or_under_way_after_a_run_that_was_killed(events, expected):
    state = State()
    for at, event in enumerate([*events, KILLED]):
        state = fold(state, float(at), event)
    assert left_running(state) == (f"the robot may be live: {expected}" if expected else "")


def test_a_run_that_was_killed_in_a_drive(tmp_path, killed_run):
    said = may_be_live(str(tmp_path))
    # attention and lifelike movement are off then
    assert said.startswith("the robot may be live: may still be driving to ")
    assert killed_run in said
    assert "keep the stop button at hand" in said and "\n" not in said


def test_a_name_like_that_of_the_end_is_no_end(tmp_path, killed_run):
    said = may_be_live(str(tmp_path))
    with open(killed_run, "rb+") as file:
        data = file.read().replace(b'"Navigate"', b'"RunFinished"')
        assert data.count(b'"RunFinished"') > 1
        file.seek(0)
        file.write(data)
    assert may_be_live(str(tmp_path)) == said != ""


def test_nothing_is_ready_after_it(killed_run):
    assert is_ready(readiness(State(checks={"m": Checked("mission", "m", READY)})))
    state = Run(follow(killed_run)).state
    first = readiness(state)[0]
    assert (first.kind, first.state) == ("run", MISSING) and not is_ready(readiness(state))


def test_its_story_and_its_visit_say_that_the_record_has_no_end(killed_run):
    lines = read_record(killed_run)
    assert lines[-1] == Line(lines[-2].time, KILLED)
    *_, visit, end = story_lines(lines)
    assert KILLED.outcome in visit and end.endswith(f"ends: {KILLED.outcome}")
    visit, = Run(lines).visits
    assert visit.result == visit.stops[-1].state == BROKEN_OFF
    assert visit.seconds == pytest.approx(lines[-1].time - visit.arrived)


@pytest.mark.parametrize("name", [files.FILE_NAME, "mission.7.jsonl"])
def test_a_run_that_goes_on_has_no_end_yet(killed_run, name):
    path = os.path.join(os.path.dirname(killed_run), name)
    with open(killed_run, "a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if path != killed_run:  # of a further file nothing says that it is the last one
            shutil.copy(killed_run, path)
        assert KILLED not in [line.event for line in read_record(path)]


def test_only_the_newest_run_counts(tmp_path, killed_run):
    recorded(tmp_path, visitor_who(says="no"))
    assert may_be_live(str(tmp_path)) == ""


def test_a_node_that_still_runs_is_not_called_dead(tmp_path, killed_run):
    with open(killed_run, "a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert may_be_live(str(tmp_path)) == ""


def test_a_long_run_is_known_from_its_last_files(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "FILE_BYTES", 2000)
    path = recorded(tmp_path, visitor_who(says="yes"))
    monkeypatch.setattr(files, "FILE_BYTES", 10 ** 6)
    parts = files.parts(path)
    last = next(place for place, part in enumerate(parts)
                if b'"_type":"GoTo"' in open(part, "rb").read()) + 1
    for part in parts[last:]:
        os.remove(part)
    expected = left_running(Run(read_record(path)).state)
    read, added = [], RunTail._added
    monkeypatch.setattr(RunTail, "_added",
                        lambda tail, file: read.append(file) or added(tail, file))
    assert expected in may_be_live(str(tmp_path))
    assert read == parts[last - 2:last] and last > 10


@pytest.mark.slow
@pytest.mark.parametrize("limit, value", [("TIME_LIMIT", -1.0), ("NEWEST_FILES", 1)])
def test_a_record_that_cannot_be_read_or_not_in_time_is_said_to_be_so(
        tmp_path, killed_run, monkeypatch, limit, value):
    monkeypatch.setattr(unended, limit, value)
    if limit != "TIME_LIMIT":
        with open(killed_run, "r+") as file:
            file.seek(300)
            file.write("]")
    assert may_be_live(str(tmp_path)).startswith(unended.UNKNOWN)


def test_without_a_record_nothing_is_said(tmp_path):
    assert may_be_live(str(tmp_path / "none")) == may_be_live(str(tmp_path)) == ""
