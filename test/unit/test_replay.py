"""A recorded run takes the same path again, and a mission that was edited says where it parts."""
import json
import os
import shutil
import subprocess
import sys

import pytest

from behavior_controller import folders
from behavior_controller.errors import MissionError
from behavior_controller.events import HealthChanged, PassFinished
from behavior_controller.gateway import AttentionStatus, Cause, Faces, Failure, GoTo, SetAttention, Topic
from behavior_controller.health import GONE
from behavior_controller.watch.record import Record, new_folder
from behavior_controller.watch.replay import main, read_record, replay
from mission_rig import ASKS_WITHOUT_START_OF_TREE, Rig, recorded, visitor_who

SOURCE = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "src")


def visitors():
    """Return one visitor of each kind, by name; True: by voice."""
    def leaving(rig):
        scans = [n for n, request in enumerate(rig.requests) if request == SetAttention("scanning")]
        if not any(isinstance(request, GoTo) for request in rig.requests[scans[-1]:]):
            visitor_who(says="yes")(rig)
        else:
            rig.clock.advance(0.5)
            rig.topics.publish(Topic.FACES, Faces((), ()))
            rig.topics.publish(Topic.ATTENTION, AttentionStatus("seeking", 0))

    return [("engages", visitor_who(says="yes"), True), ("by tablet", visitor_who(), False),
            ("declines", visitor_who(says="no"), True), ("silent", visitor_who(), True),
            ("noGaze", visitor_who(gazes=False), True), ("leaves", leaving, True)]


@pytest.fixture
def mission(tmp_path, monkeypatch):
    """A copy of the lab tour that a test may edit."""
    shutil.copytree(folders.data(""), str(tmp_path / "data"))
    path = str(tmp_path / "data" / "lab_tour.xml")
    monkeypatch.setattr(folders, "mission", lambda name: path)
    return path


@pytest.mark.parametrize("failure_rate, seed", [(0.0, 0), (0.1, 1), (0.3, 2), (0.6, 3)])
@pytest.mark.parametrize("kind, visitor, by_voice", visitors())
def test_a_recorded_run_takes_the_same_path(tmp_path, kind, visitor, by_voice, failure_rate, seed):
    path = recorded(tmp_path, visitor, by_voice, failure_rate, seed, runs=2)
    outcome = replay(read_record(path))
    assert (outcome.parting, outcome.is_edited, outcome.passes) == ("", False, 2)
    changes = sum(len(line["changes"]) for line in read_record(path) if line["event"] == "Tick")
    assert outcome.changes == changes > 50


def edited(path, old, new):
    with open(path) as file:
        text = file.read()
    assert old in text
    with open(path, "w") as file:
        file.write(text.replace(old, new, 1))


@pytest.mark.parametrize("old, new, where", [
    ("<WelcomeGesture/>", "<GoodbyeGesture/>", "PerformGesture"),
    ("<WelcomeSpeech/>", "<AlwaysSuccess/>", "WelcomeSpeech"),
    ('<SubTree ID="VisitExhibits"/>\n        <SubTree ID="EndTour"/>',
     '<SubTree ID="EndTour"/>\n        <SubTree ID="VisitExhibits"/>', "GiveTour"),
    ('num_attempts="3"', 'num_attempts="2"', None),
])
def test_an_edited_mission_says_where_it_parts(tmp_path, mission, old, new, where):
    path = recorded(tmp_path, visitor_who(says="yes"), mission=mission)
    edited(mission, old, new)
    outcome = replay(read_record(path))
    assert outcome.is_edited
    if where is None:
        assert outcome.parting == ""  # three attempts were not needed
    else:
        assert where in outcome.parting and outcome.parting.startswith("in pass 1, ")
        assert "recorded is" in outcome.parting and ", now " in outcome.parting


def test_a_replay_forgets_each_visitor_when_the_run_did(tmp_path, mission):
    with open(mission, "w") as file:
        file.write("<root BTCPP_format='4'><BehaviorTree ID='M'>{}</BehaviorTree></root>".format(ASKS_WITHOUT_START_OF_TREE))

    def says_yes_in_the_first_pass(rig):
        visitor_who(says=None if rig.of(PassFinished) else "yes")(rig)

    lines = read_record(recorded(tmp_path, says_yes_in_the_first_pass, mission=mission, runs=2))
    assert [line["outcome"] for line in lines if line["event"] == "PassFinished"] == ["SUCCESS", "FAILURE"]
    assert replay(lines).parting == ""
    # the second visitor would be taken for one who has said yes
    assert "in pass 2" in replay([line for line in lines if line["event"] != "PassStarted"]).parting


def test_another_answer_in_the_record_leads_elsewhere(tmp_path):
    path = recorded(tmp_path, visitor_who(says="yes"))
    lines = read_record(path)
    navigate = next(line for line in lines if line["event"] == "Asked" and line["request"][0] == "GoTo")
    answered = next(line for line in lines if line["event"] == "Answered" and line["call"] == navigate["call"])
    del answered["answer"]
    answered["failure"] = {"cause": "type mismatch", "message": "-", "resource": "/robotNavigation/set_goal"}
    assert "Navigate" in replay(lines).parting


def changed(lines, kind, change, number):
    """Return the lines after a change of the ``number``-th of one kind; a change that returns None drops the line."""
    places = [place for place, line in enumerate(lines) if line["event"] == kind and line.get("changes", [1])]
    place = places[number]
    new = change(dict(lines[place]))
    return lines[:place] + ([new] if new else []) + lines[place + 1:]


@pytest.mark.parametrize("kind, number, change, expected", [
    ("Tick", 5, lambda line: dict(line, changes=line["changes"][:-1]), "recorded is no further change, now it is "),
    ("Tick", 5, lambda line: dict(line, changes=line["changes"] + [[1, "F"]]), ", now it is no further change"),
    ("Asked", 5, lambda line: dict(line, request=[line["request"][0], {"x": 1}]), "{'x': 1}], now it asks /"),
    ("Asked", -1, lambda line: None, "recorded is no request, now it asks /"),
])
def test_statuses_alone_and_requests_alone_are_another_path(tmp_path, kind, number, change, expected):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    parting = replay(changed(lines, kind, change, number)).parting
    assert parting.startswith("in pass 1, ") and expected in parting
    if kind == "Tick":
        assert "request" not in parting and "it asks" not in parting


def test_a_request_that_is_no_longer_made_is_another_path(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    place = [place for place, line in enumerate(lines) if line["event"] == "Tick"][5]
    more = {"event": "Asked", "time": 1.0, "call": 99, "service": "/x", "request": ["Say", {"text": "x"}]}
    parting = replay(lines[:place] + [more] + lines[place:]).parting
    assert "recorded is the request ['Say', {'text': 'x'}], now there is none" in parting


def test_a_record_that_lacks_lines_says_so(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    assert "the record lacks 7 lines" in replay(lines[:-1] + [{"event": "Lost", "lines": 7}] + lines[-1:]).parting


def test_what_was_known_of_the_robots_nodes_is_replayed(tmp_path):
    states = {"gone": 0}

    def visitor(rig):
        drives = sum(isinstance(request, GoTo) for request in rig.requests)
        if drives == 1 and not states["gone"]:
            states["gone"] = 1
            rig.mission.health.report(GONE, HealthChanged("service", GoTo.service, "", False, "gone", "", ""))
        elif states["gone"]:
            states["gone"] += 1
            if states["gone"] == 12:
                rig.mission.health.report(GONE, HealthChanged("service", GoTo.service, "", True, "there again", "", ""))
        visitor_who(says="yes")(rig)

    rig = Rig(answer=lambda request: Failure(Cause.CONNECTION_LOST, "-", GoTo.service)
              if isinstance(request, GoTo) and states["gone"] == 0 else NotImplemented)
    record = Record(str(tmp_path), rig.clock, pytest.fail)
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.gateway, rig.mission.topics = record.gateway(rig.gateway), record.topics(rig.topics)
    rig.mission_file = folders.mission("lab_tour")
    assert rig.run(visitor) == 0
    record.close()
    lines = read_record(record.path)
    assert replay(lines).parting == ""
    assert replay([line for line in lines if line["event"] != "HealthChanged"]).parting != ""


def test_a_torn_record_is_replayed_as_far_as_it_goes(tmp_path):
    path = recorded(tmp_path, visitor_who(says="yes"))
    with open(path, "rb") as file:
        data = file.read()
    with open(path, "wb") as file:
        file.write(data[:len(data) // 2])
    outcome = replay(read_record(path))
    assert outcome.parting == "" and outcome.passes == 0 and outcome.changes > 20


NOTICED = '{"event": "Noticed", "time": 1.5, "level": "info", "text": "-"}\n'


@pytest.mark.parametrize("text, expected", [
    ("", "the record has no mission in it"), ("{}\n{}\n{}\n", "1:1: this is no line of a record"),
    (NOTICED + "[1]\n" + NOTICED, "2:1: this is no line of a record: it has no event"),
    (NOTICED, "the record has no mission in it"), (None, "cannot be read"),
    (NOTICED + '{"event": "Dance"}\n', "2:1: this is no line of a record: the event Dance is unknown"),
    (NOTICED + "\n", "2:1: this is no line of a record: it is not JSON"),
    (NOTICED + "[" * 200_000 + "\n", "2:1: this is no line of a record: it is nested too deeply"),
    (NOTICED.replace("1.5", "9" * 100_000), "1:1: this is no line of a record: a whole number has more than 18 digits"),
    (NOTICED.replace("1.5", "NaN"), "1:1: this is no line of a record: the field time of Noticed is wrong"),
    ('{"event": "Noticed", "time": 1.5, "level": "info"}\n', "the field text of Noticed is missing"),
])
def test_what_is_no_record_is_named(tmp_path, text, expected):
    path = tmp_path / "r.jsonl"
    if text is not None:
        path.write_text(text)
    with pytest.raises(MissionError) as raised:
        read_record(str(path))
    assert expected in str(raised.value.faults[0]) and str(path) in str(raised.value.faults[0])


def command(*arguments):
    done = subprocess.run([sys.executable, os.path.join(SOURCE, "behavior_controller", "replayMission")] + list(arguments),
                          env=dict(os.environ, PYTHONPATH=SOURCE), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True)
    return done.returncode, done.stdout


def test_the_command(tmp_path, mission):
    path = recorded(tmp_path, visitor_who(says="yes"), mission=mission)
    code, printed = command(path)
    assert code == 0 and printed.startswith("the same path: 1 passes, ")
    edited(mission, "<WelcomeSpeech/>", "<AlwaysSuccess/>")
    code, printed = command(path)
    assert code == 3 and "has changed since" in printed and "the paths part in pass 1" in printed
    assert command(str(tmp_path))[0] == 3  # the record's folder
    code, printed = command(str(tmp_path / "none.jsonl"))
    assert code == 2 and printed.count("\n") == 1
    os.remove(mission)
    code, printed = command(path)
    assert code == 2 and "Traceback" not in printed


@pytest.mark.parametrize("variable, logs", [("ROS_LOG_DIR", ""), ("ROS_HOME", "log"), ("HOME", ".ros/log")])
def test_the_newest_record_of_the_default_folder(tmp_path, monkeypatch, capsys, variable, logs):
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    assert main(["latest"]) == 2
    assert capsys.readouterr().err == "{}: there is no record yet (name a record or its folder)\n".format(
        tmp_path / logs / "behaviorController_records" / "*" / "mission.jsonl")
    folder = new_folder(str(tmp_path / logs))
    recorded(folder, visitor_who(says="no"))
    place = tmp_path / logs / "behaviorController_records"
    (place / "20200101-000000_1").mkdir()
    (place / "20200101-000000_1" / "mission.jsonl").write_text("")
    (place / "29990101-000000_1").mkdir()  # of a run that could not write
    assert main(["latest"]) == 0 and capsys.readouterr().out.startswith("the same path: 1 pass")


def test_a_report_that_cannot_be_written_is_one_line(tmp_path, capsys):
    path = recorded(tmp_path, visitor_who(says="no"))
    assert main(["--report", "/dev/full", path]) == 2
    assert capsys.readouterr().err == "/dev/full: the report cannot be written: No space left on device\n"


def test_the_report(tmp_path):
    path = recorded(tmp_path, visitor_who(says="yes"), failure_rate=0.2, seed=4)
    page = str(tmp_path / "report.html")
    assert command("--report", page, path)[0] == 0
    with open(page, encoding="utf-8") as file:
        text = file.read()
    assert "http" not in text and "<script" not in text
    assert text.count('<li class="node') == len([line for line in read_record(path) if line["event"] == "Tree"][0]["nodes"])
    assert "WelcomeSpeech" in text and "recovery" in text.lower()
    assert json.dumps("drawn")[1:-1] in text
