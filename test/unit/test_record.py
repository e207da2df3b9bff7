"""The record: one JSON object a line, complete, and never a danger to the run."""
import hashlib
import json
import os

from behavior_controller.events import LeafFinished, PassFinished, RunStarted
from behavior_controller.gateway import Cause, Failure
from behavior_controller.record import Record


def lines(record):
    with open(record.path, encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def test_events_are_written_as_they_happen(tmp_path):
    mission = tmp_path / "m.xml"
    mission.write_text("<root/>")
    record = Record(str(tmp_path / "new folder"), complain=None)
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
    record = Record(str(tmp_path / "file"), complaints.append)
    record(PassFinished(1, "SUCCESS", 1.0))
    record(PassFinished(2, "SUCCESS", 1.0))
    assert len(complaints) == 1
    assert "the mission goes on" in complaints[0]


def test_a_disk_that_is_full_is_one_complaint(tmp_path):
    complaints = []
    record = Record(str(tmp_path), complaints.append)
    record._file = open("/dev/full", "w")
    record(PassFinished(1, "SUCCESS", 1.0))
    record(PassFinished(2, "SUCCESS", 1.0))
    assert len(complaints) == 1
