"""The record: one JSON object a line, complete, and never a danger to the run."""
import hashlib
import json
import os

import pytest

from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.events import LeafFinished, PassFinished, RunStarted
from behavior_controller.gateway import Cause, Failure
from behavior_controller.watch import record as module
from behavior_controller.watch.record import Record, new_folder


def lines(record):
    record.close()
    with open(record.path, encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def test_events_are_written_as_they_happen(tmp_path):
    mission = tmp_path / "m.xml"
    mission.write_text("<root/>")
    record = Record(str(tmp_path / "new folder"), ManualClock(), complain=None)
    record(RunStarted(str(mission), [["a", "Navigate"]], {"asrEnabled": True}))
    record(LeafFinished(7, "Navigate", "go/a", "FAILURE", "/robotNavigation/set_goal", 0.5,
                        Failure(Cause.REFUSED, "no", "/robotNavigation/set_goal")))
    first, second = lines(record)
    assert (first["event"], first["pid"], first["leaves"]) == ("RunStarted", os.getpid(), [["a", "Navigate"]])
    assert first["sha256"] == hashlib.sha256(b"<root/>").hexdigest()
    assert second["failure"] == {"cause": "refused", "message": "no", "resource": "/robotNavigation/set_goal"}
    assert (second["node"], second["path"], second["status"], second["seconds"]) == ("Navigate", "go/a", "FAILURE", 0.5)


def test_a_folder_that_cannot_be_written_is_one_complaint(tmp_path):
    (tmp_path / "file").write_text("")
    complaints = []
    record = Record(str(tmp_path / "file"), ManualClock(), complaints.append)
    record(PassFinished(1, "SUCCESS", 1.0))
    record.close()
    assert len(complaints) == 1
    assert "the mission goes on" in complaints[0]


def test_a_disk_that_is_full_is_one_complaint(tmp_path):
    os.symlink("/dev/full", str(tmp_path / "mission.jsonl"))
    complaints = []
    record = Record(str(tmp_path), ManualClock(), complaints.append)
    for number in range(3):
        record(PassFinished(number, "SUCCESS", 1.0))
    record.close()
    assert len(complaints) == 1 and "No space left" in complaints[0]


def test_a_record_does_not_grow_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_BYTES", 1000)
    complaints = []
    record = Record(str(tmp_path), ManualClock(), complaints.append)
    for number in range(100):
        record(PassFinished(number, "SUCCESS", 1.0))
    assert 5 < len(lines(record)) < 20
    assert len(complaints) == 1 and "1000 bytes" in complaints[0]


@pytest.mark.parametrize("there, kept", [(0, 0), (19, 19), (20, 19), (30, 19)])
def test_old_records_make_room(tmp_path, there, kept):
    place = tmp_path / "behaviorController_records"
    for number in range(there):
        (place / "20260101-0000{:02}_1".format(number)).mkdir(parents=True)
    folder = new_folder(str(tmp_path))
    left = sorted(os.listdir(str(place))) if there else []
    assert len(left) == kept and os.path.dirname(folder) == str(place)
    assert left == ["20260101-0000{:02}_1".format(number) for number in range(there - kept, there)]
