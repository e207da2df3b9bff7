"""A recorded run takes the same path again, and a mission that was edited says where it parts."""
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from behavior_controller import folders
from behavior_controller.errors import MissionError
from behavior_controller.run.events import (Answered, Asked, HealthChanged, LeafFinished,
                                                  Line, Lost, Message, PassFinished, PassStarted,
                                                  RunStarted, RecognitionPending, Tick)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.robot.d543 import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.robot.requests import AttentionStatus, Faces, GoTo, Say, SetAttention
from behavior_controller.text import Source
from behavior_controller.missions.replay import RecordedTopics, Replayed, replay
from behavior_controller.replay_cli import main
from behavior_controller.run.record.reader import find_record, read_record
from mission_rig import (
    ASKS_WITHOUT_START_OF_TREE, FileRecord, Rig, recorded, service_of, visitor_who)
from recorded_tours import recorded_day

SOURCE = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))),
                      "src")


HEADER = '{"format": "behaviorController record", "version": 11, "pid": 7, "time": 1.5}\n'
# the clock was set back
OLD, RUN_9, RUN_10 = "20991231-000000_7", "000009_20260102-000000_7", "000010_20200101-000000_8"


def events_of(lines):
    return [line.event for line in lines]


def visitors():
    """Return one visitor of each kind, by name; True: by voice."""
    def leaving(rig):
        scans = [n for n, request in enumerate(rig.requests) if request == SetAttention("scanning")]
        if not any(isinstance(request, GoTo) for request in rig.requests[scans[-1]:]):
            visitor_who(says="yes")(rig)
        else:
            rig.clock.advance(0.5)
            rig.topics.publish(FACES, Faces((), ()))
            rig.topics.publish(ATTENTION, AttentionStatus("seeking", 0))

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


@pytest.mark.slow
@pytest.mark.parametrize("failure_rate, seed", [(0.0, 0), (0.1, 1), (0.3, 2), (0.6, 3)])
@pytest.mark.parametrize("kind, visitor, by_voice", visitors())
def test_a_recorded_run_takes_the_same_path(tmp_path, kind, visitor, by_voice, failure_rate, seed):
    path = recorded(tmp_path, visitor, by_voice, failure_rate, seed, runs=2)
    outcome = replay(read_record(path))
    assert (outcome.divergence, outcome.passes) == ("", 2)
    changes = sum(len(event.changes) for event in events_of(read_record(path))
                  if isinstance(event, Tick) and event.first is not None)
    assert outcome.changes == changes > 50


@pytest.mark.parametrize("utterances", [("yes", "where is the exit"), ("hm", "no", "yes"),
                                        ("hm", ) * 150 + ("yes", "hm")])
def test_utterances_that_come_together_are_heard_as_they_were(tmp_path, utterances):
    def visitor(rig):
        visitor_who()(rig)
        for utterance in utterances:
            rig.clock.advance(0.001)
            rig.topics.publish(SPEECH, utterance)

    lines = read_record(recorded(tmp_path, visitor, runs=2))
    assert any(event.summary is not None and event.summary.mark in ("yes", "no")
               for event in events_of(lines) if isinstance(event, LeafFinished))
    outcome = replay(lines)
    assert (outcome.divergence, outcome.passes) == ("", 2)


def test_a_mission_that_follows_in_the_same_record_knows_the_messages_from_before(tmp_path):
    rig = Rig(
        "<root BTCPP_format='4'><BehaviorTree ID='M'><IsVisitorDiscovered/></BehaviorTree></root>")
    record = FileRecord(str(tmp_path), pytest.fail).open()
    rig.mission.events.subscribe(record)
    rig.mission.topics = record.topics(rig.topics)
    rig.topics.publish(FACES, Faces(("1",), (True,)))
    for _ in range(2):
        record.show(rig.tree)
        assert rig.run(lambda rig: None) == 0
    record.close()
    outcome = replay(read_record(record.path))
    assert (outcome.divergence, outcome.passes) == ("", 2)


def test_a_message_is_returned_from_the_read_on_that_was_the_first_to_return_it():
    topics = RecordedTopics(INTERFACE)
    for read, text in ((1, "a"), (2, "b"), (2, "c"), (4, "d")):
        topics.take(Message(SPEECH.name, read, text, 5.0))
    topics.begin()
    assert topics.recent(FACES) == ()  # reads of another topic do not count
    for heard in ("a", "abc", "abc", "abcd", "abcd"):
        assert [sample.value for sample in topics.recent(SPEECH)] == list(heard)
    topics.take(Message(SPEECH.name, 2, "e", 6.0))
    topics.begin()  # of the next traversal, whose reads are counted anew
    for heard in ("abcd", "abcde"):
        assert [sample.value for sample in topics.recent(SPEECH)] == list(heard)


def test_that_something_is_still_heard_is_known_as_often_as_it_is_recorded():
    topics = RecordedTopics(INTERFACE)
    for topic in (SPEECH, FACES, SPEECH):
        topics.take(RecognitionPending(topic.name))
    assert [topics.is_hearing(SPEECH) for _ in range(3)] == [True, True, False]
    assert [topics.is_hearing(FACES) for _ in range(2)] == [True, False]


@pytest.mark.parametrize("replayed, line", [
    (Replayed(1, 1), "the same path: 1 pass, 1 change of status"),
    (Replayed(2, 0), "the same path: 2 passes, 0 changes of status"),
    (Replayed(1, 1, "in pass 2, \x1b[2J"), "the runs diverge in pass 2, \\x1b[2J")])
def test_what_a_replay_found_is_one_line(replayed, line):
    assert str(replayed) == line


@pytest.mark.parametrize("files, name, expected", [
    (["r/mission.jsonl"], "r", "r/mission.jsonl"),
    (["r/mission.jsonl"], "r/mission.jsonl", "r/mission.jsonl"),
    (["r/mission.jsonl", "r/1/mission.jsonl", "r/2/mission.jsonl"], "r", "r/mission.jsonl"),
    (["r/1/mission.jsonl"], "r", "r/1/mission.jsonl"),
    (["r/x"], "r", "r/mission.jsonl"),
    (["[r]/1/mission.jsonl", "r/2/mission.jsonl"], "[r]", "[r]/1/mission.jsonl"),
    # the newest run: numbered, else by its name; folders and files of a user do not count
    ([f"r/{OLD}/mission.jsonl", f"r/{RUN_9}/mission.jsonl", f"r/{RUN_10}/mission.jsonl",
      "r/saved/mission.jsonl", "r/mission.jsonl"], "r", f"r/{RUN_10}/mission.jsonl"),
    ([f"records/{OLD}/mission.jsonl", f"records/{RUN_9}/mission.jsonl", "records/zz/mission.jsonl",
      "records/mission.jsonl", "latest/mission.jsonl"], "latest",
     f"records/{RUN_9}/mission.jsonl"),
    ([f"records/{OLD}/mission.jsonl", f"records/{RUN_10}/x", f"records/{RUN_9} copy/mission.jsonl"],
     "latest", f"records/{OLD}/mission.jsonl")])
def test_which_file_is_the_record(tmp_path, monkeypatch, files, name, expected):
    for path in map(tmp_path.joinpath, files):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(HEADER)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(folders, "records", lambda: "records")
    assert find_record(name) == expected


def edited(path, old, new):
    text = Path(path).read_text()
    assert old in text
    Path(path).write_text(text.replace(old, new, 1))


def test_answers_that_take_their_time_come_when_they_came(tmp_path, monkeypatch):
    lines = read_record(recorded_day(tmp_path, monkeypatch, 2, ("declines", "no gaze")))
    outcome = replay(lines)
    assert (outcome.divergence, outcome.passes) == ("", 2)


def test_a_replay_needs_no_file_but_the_record(tmp_path, mission, monkeypatch):
    data = os.path.dirname(mission)
    with open(os.path.join(data, "tour.xml"), "w") as file:
        file.write("<root BTCPP_format='4' main_tree_to_execute='LabTour'><include "
                   "path='sub/one.xml'/></root>")
    os.mkdir(os.path.join(data, "sub"))
    shutil.copy(mission, os.path.join(data, "sub", "tour.xml"))
    with open(os.path.join(data, "sub", "one.xml"), "w") as file:
        file.write("<root BTCPP_format='4'><include path='tour.xml'/></root>")
    monkeypatch.setattr(folders, "mission", lambda name: os.path.join(data, "tour.xml"))
    lines = read_record(
        recorded(tmp_path / "record", visitor_who(says="no"), failure_rate=0.3, seed=5))
    started = next(event for event in events_of(lines) if isinstance(event, RunStarted))
    assert [os.path.relpath(source.file, data) for source in started.sources.documents] == [
        "sub/tour.xml", "sub/one.xml", "tour.xml"]
    shutil.rmtree(data)
    monkeypatch.setattr(folders, "share", lambda: str(tmp_path / "nowhere"))
    outcome = replay(lines)
    assert outcome.divergence == "" and outcome.passes == 1 and outcome.changes > 50


def started_with(lines, **sources):
    return [replace(line, event=replace(line.event, sources=replace(line.event.sources, **sources)))
            if isinstance(line.event, RunStarted) else line for line in lines]


@pytest.mark.parametrize("part, old, new, expected", [
    ("phrases", "Hello, and welcome", "Welcome",
     "now it asks /textToSpeech/say_text for Say(text='Welcome"),
    ("policy", "budget", "WelcomeGesture * 3 0 giveUp\nbudget", "now ")])
def test_phrases_and_policy_are_those_of_the_record(tmp_path, part, old, new, expected):
    lines = read_record(recorded(tmp_path, visitor_who(says="yes"), failure_rate=1.0))
    source = getattr(
        next(event for event in events_of(lines) if isinstance(event, RunStarted)).sources, part)
    assert old in source.text and replay(lines).divergence == ""
    changed_text = source._replace(text=source.text.replace(old, new, 1))
    assert expected in replay(started_with(lines, **{part: changed_text})).divergence


@pytest.mark.parametrize("old, new", [
    ("SayYesNoSpeech", "ForgottenSpeech"),  # both are by now: one is missing, one unknown
    ("SayYesNoSpeech", "# ")])
def test_a_record_from_before_the_phrases_of_today_is_replayed(tmp_path, old, new):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    started = next(event for event in events_of(lines) if isinstance(event, RunStarted))
    text = started.sources.phrases
    assert "\n" + old in text.text
    before = text._replace(text=text.text.replace("\n" + old, "\n" + new, 1))
    assert replay(started_with(lines, phrases=before)).divergence == ""


def test_a_record_of_another_interface_is_refused(tmp_path):
    lines = started_with(read_record(recorded(tmp_path, visitor_who(says="no"))),
                         interface="release 7")
    with pytest.raises(MissionError) as raised:
        replay(lines)
    assert str(raised.value) == (
        "the record: its interface is release 7; this release has D5.4.3, release-1.0, "
        "release-1.1 (replay it with the release that wrote it)")


def test_knowledge_files_for_a_robot_with_a_knowledge_base_are_refused(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    with pytest.raises(MissionError) as raised:
        replay(started_with(lines, knowledge=(Source("environment", "x"), Source("culture", "y"))))
    assert str(raised.value) == (
        "the record: it cannot be used: sources.knowledge: 2 files do not fit the robot "
        "D5.4.3 (replay it with the release that wrote it)")


@pytest.mark.parametrize("bad, first, more",
                         [({"missionRuns": -7}, '"-7"', ""),
                          ({"missionRuns": -7, "asrEnabled": 3, "dance": 1}, '"3"', " 2 more")])
def test_settings_that_this_release_cannot_use_are_one_line(tmp_path, bad, first, more):
    lines = [replace(line, event=replace(line.event, settings=dict(line.event.settings, **bad)))
             if isinstance(line.event, RunStarted) else line
             for line in read_record(recorded(tmp_path, visitor_who(says="no")))]
    with pytest.raises(MissionError) as raised:
        replay(lines)
    fault, = raised.value.faults
    assert " settings: " in fault.text and first in fault.text and fault.text.endswith(more)
    assert "\n" not in str(raised.value) and '"-7"' not in fault.text.replace(first, "")


@pytest.mark.slow
@pytest.mark.parametrize("old, new, where", [
    ("<WelcomeGesture/>", "<GoodbyeGesture/>", "PerformGesture"),
    ("<WelcomeSpeech/>", "<AlwaysSuccess/>", "WelcomeSpeech"),
    ('<SubTree ID="VisitExhibits"/>\n        <SubTree ID="EndTour"/>',
     '<SubTree ID="EndTour"/>\n        <SubTree ID="VisitExhibits"/>', "GiveTour"),
    ('num_attempts="3"', 'num_attempts="2"', None)])
def test_an_edited_mission_says_where_it_parts(tmp_path, mission, old, new, where):
    path = recorded(tmp_path, visitor_who(says="yes"), mission=mission)
    edited(mission, old, new)
    lines = read_record(path)
    assert replay(lines).divergence == ""  # of what the record holds
    outcome = replay(lines, mission)
    if where is None:
        assert outcome.divergence == ""  # three attempts were not needed
    else:
        assert where in outcome.divergence and outcome.divergence.startswith("in pass 1, ")
        assert "recorded is" in outcome.divergence and ", now " in outcome.divergence


def test_a_replay_forgets_each_visitor_when_the_run_did(tmp_path, mission):
    with open(mission, "w") as file:
        file.write("<root BTCPP_format='4'><BehaviorTree ID='M'>{}</BehaviorTree></root>".format(
            ASKS_WITHOUT_START_OF_TREE))

    def says_yes_in_the_first_pass(rig):
        visitor_who(says=None if rig.of(PassFinished) else "yes")(rig)

    lines = read_record(recorded(tmp_path, says_yes_in_the_first_pass, mission=mission, runs=2))
    assert [event.outcome for event in events_of(lines)
            if isinstance(event, PassFinished)] == ["SUCCESS", "FAILURE"]
    assert replay(lines).divergence == ""
    # the second visitor would count as having said yes
    assert "in pass 2" in replay(
        [line for line in lines if not isinstance(line.event, PassStarted)]).divergence


def test_a_replay_halts_the_tree_after_an_error_and_only_then(tmp_path, mission):
    with open(mission, "w") as file:
        file.write(
            """<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence><AlwaysSuccess _onHalted='x := 7'/>
                      <ScriptCondition code='x == 7'/><Script code='x := 8'/></Sequence></BehaviorTree></root>"""
        )
    lines = read_record(recorded(tmp_path, visitor_who(), mission=mission, runs=3))
    # x is not known in the first pass, known after the halt, and 8 after a pass that is not halted
    assert [event.outcome for event in events_of(lines)
            if isinstance(event, PassFinished)] == ["FAILURE", "SUCCESS", "FAILURE"]
    assert replay(lines).divergence == ""


@pytest.mark.slow
def test_another_answer_in_the_record_leads_elsewhere(tmp_path):
    path = recorded(tmp_path, visitor_who(says="yes"))
    lines = read_record(path)
    call = next(event.call for event in events_of(lines)
                if isinstance(event, Asked) and isinstance(event.request, GoTo))
    place = next(place for place, event in enumerate(events_of(lines))
                 if isinstance(event, Answered) and event.call == call)
    failure = Failure(Cause.TYPE_MISMATCH, "-", "/robotNavigation/set_goal")
    lines[place] = replace(lines[place], event=Answered(call, failure))
    assert "Navigate" in replay(lines).divergence


def changed(lines, kind, change, number):
    """Return the lines after a change of the ``number``-th of one kind; a change that returns None
    drops the line."""
    places = [place for place, event in enumerate(events_of(lines)) if isinstance(event, kind)
              and getattr(event, "changes", [1]) and getattr(event, "first", True) is not None]
    place = places[number]
    new = change(lines[place].event)
    return lines[:place] + ([replace(lines[place], event=new)] if new else []) + lines[place + 1:]


@pytest.mark.parametrize("kind, number, change, expected", [
    (Tick, 5, lambda event: replace(event, changes=event.changes[:-1]),
     "recorded is no further change, now it is "),
    (Tick, 5, lambda event: replace(event, changes=event.changes + [(1, "F")]),
     ", now it is no further change"),
    (Asked, 5, lambda event: replace(event, request=Say("x")),
     "Say(text='x', language='English'), now it asks /"),
    (Asked, -3, lambda event: None, "recorded is no request, now it asks /")])
def test_statuses_alone_and_requests_alone_are_another_path(tmp_path, kind, number, change,
                                                            expected):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    divergence = replay(changed(lines, kind, change, number)).divergence
    assert divergence.startswith("in pass 1, ") and expected in divergence
    if kind is Tick:
        assert "request" not in divergence and "it asks" not in divergence


def test_a_divergence_has_its_time_since_the_mission_began(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    ticks = [event for event in events_of(lines)
             if isinstance(event, Tick) and event.first is not None]
    last = [event for event in ticks if event.changes][-1]
    seconds = last.at - ticks[0].at
    divergence = replay(changed(lines, Tick, lambda event: replace(event, changes=[(1, "F")]),
                                -1)).divergence
    assert seconds > 1.0 and divergence.startswith(
        "in pass 1, {:.1f} s after its mission began: ".format(seconds))


def test_a_request_that_is_no_longer_made_is_another_path(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="no")))
    place = [place for place, event in enumerate(events_of(lines)) if isinstance(event, Tick)][5]
    more = Line(1.0, Asked(99, "/x", Say("x")))
    divergence = replay(lines[:place] + [more] + lines[place:]).divergence
    assert ("recorded is the request Say(text='x', language='English'), now there is "
            "none" in divergence)


def test_a_replay_leaves_out_the_pass_that_lacks_lines_and_says_so(tmp_path):
    lines = read_record(recorded(tmp_path, visitor_who(says="yes"), runs=3))
    ticks = [place for place, event in enumerate(events_of(lines)) if isinstance(event, Tick)]
    ends = [place for place, event in enumerate(events_of(lines))
            if isinstance(event, PassFinished)]
    first = next(place for place in ticks if place > ends[0] + 9)
    for last in (first + 20, ends[1] + 40):  # within the second pass, and into the third
        outcome = replay(lines[:first] + [Line(1.0, Lost(7, "it was full"))] + lines[last:])
        assert (outcome.divergence, outcome.passes) == ("", 1 if last > ends[1] else 2)
        assert "; 7 events are missing: it was full: left out up to the next pass" in str(outcome)


def test_what_was_known_of_the_robots_nodes_is_replayed(tmp_path):
    states = {"gone": 0}

    def visitor(rig):
        drives = sum(isinstance(request, GoTo) for request in rig.requests)
        if drives == 1 and not states["gone"]:
            states["gone"] = 1
            rig.mission.health.report(
                GONE, HealthChanged("service", service_of(GoTo), "", False, "gone", "", ""))
        elif states["gone"]:
            states["gone"] += 1
            if states["gone"] == 12:
                rig.mission.health.report(
                    GONE, HealthChanged("service", service_of(GoTo), "", True, "back", "", ""))
        visitor_who(says="yes")(rig)

    rig = Rig(answer=lambda request: Failure(Cause.CONNECTION_LOST, "-", service_of(GoTo))
              if isinstance(request, GoTo) and states["gone"] == 0 else NotImplemented)
    record = FileRecord(str(tmp_path), pytest.fail).open()
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.topics = record.topics(rig.topics)
    rig.mission_file = folders.mission("lab_tour")
    assert rig.run(visitor) == 0
    record.close()
    lines = read_record(record.path)
    assert replay(lines).divergence == ""
    assert replay([line for line in lines
                   if not isinstance(line.event, HealthChanged)]).divergence != ""


def test_a_torn_record_is_replayed_as_far_as_it_goes(tmp_path):
    path = recorded(tmp_path, visitor_who(says="yes"))
    data = Path(path).read_bytes()
    Path(path).write_bytes(data[:data.index(b"PassFinished")])
    outcome = replay(read_record(path))
    assert outcome.divergence == "" and outcome.passes == 0 and outcome.changes > 50


NOTICED = HEADER + '{"time": 1.5, "event": {"_type": "Noticed", "level": "info", "text": "-"}}\n'
NO_LINE = "3:1: this is not a line of a record: "
VERSION_3 = ('{"event": "Header", "time": 1.5, "format": "behaviorController record", "version": '
             '3, "pid": 7}\n')


@pytest.mark.parametrize("text, expected", [
    ("", "the record has no mission in it"), ("{}\n{}\n{}\n", "1:1: this is no record: "),
    (NOTICED + "[1]\n" + NOTICED, NO_LINE + "Expected `object`, got `array`"),
    (NOTICED, "the record has no mission in it"), (None, "the record cannot be read: "),
    (NOTICED + '{"time": 1, "event": {"_type": "Dance"}}\n',
     NO_LINE + "Invalid value 'Dance' - at `$.event._type`"),
    (NOTICED + "\n", NO_LINE + "Input data was truncated"), (NOTICED + "\\u\n", NO_LINE),
    (NOTICED + '{"time": 1, "x": ' + "[" * 200_000 + "\n", NO_LINE + "it is nested too deeply"),
    (NOTICED + NOTICED[len(HEADER):].replace("1.5", "9" * 100_000),
     NO_LINE + "Number out of range - at `$.time`"),
    (NOTICED + NOTICED[len(HEADER):].replace("1.5", "NaN"), NO_LINE + "JSON is malformed"),
    (NOTICED + '{"time": 1.5, "event": {"_type": "Noticed", "level": "info"}}\n',
     NO_LINE + "Object missing required field `text` - at `$.event`"),
    (NOTICED[len(HEADER):], "1:1: this is no record: it does not begin with the header of one "
                            "(name the mission.jsonl of a run)"),
    (VERSION_3, "1:1: the record has the version 3; this release reads version 11 (replay it with "
                "the release that wrote it)"),
    (HEADER.replace("behaviorController ", "other "), "1:1: this is no record: ")])
def test_what_is_no_record_is_named(tmp_path, text, expected):
    path = tmp_path / "r.jsonl"
    if text is not None:
        path.write_text(text)
    with pytest.raises(MissionError) as raised:
        read_record(str(path))
    place = ":" if expected[0].isdigit() else ": "
    assert str(raised.value.faults[0]).startswith(str(path) + place + expected)


def command(*arguments):
    done = subprocess.run([sys.executable, os.path.join(
                              SOURCE, "behavior_controller", "replayMission")] + list(arguments),
                          env=dict(os.environ, PYTHONPATH=SOURCE), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True)
    return done.returncode, done.stdout


@pytest.mark.slow
def test_the_command(tmp_path, mission):
    path = recorded(tmp_path, visitor_who(says="yes"), mission=mission)
    code, printed = command(path)
    assert code == 0 and printed.startswith("the same path: 1 pass, ")
    edited(mission, "<WelcomeSpeech/>", "<AlwaysSuccess/>")
    assert command(path) == (0, printed)
    code, printed = command("--mission", mission, path)
    assert code == 3 and printed.startswith("the runs diverge in pass 1")
    assert command("--mission", mission, str(tmp_path))[0] == 3  # the record's folder
    code, printed = command(str(tmp_path / "none.jsonl"))
    assert code == 2 and printed.count("\n") == 1
    os.remove(mission)
    code, printed = command("--mission", mission, path)
    assert code == 2 and printed.count("\n") == 1
    assert command("--mission", mission, "--report", "x.html", path)[0] == 2


@pytest.mark.parametrize("variable, logs", [("ROS_LOG_DIR", ""), ("ROS_HOME", "log"),
                                            ("HOME", ".ros/log")])
def test_the_newest_record_of_the_default_folder(tmp_path, monkeypatch, capsys, variable, logs):
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    assert main(["latest"]) == 2
    place = tmp_path / logs / "behaviorController_records"
    assert capsys.readouterr(
    ).err == "{}: there is no record yet (name a record or its folder)\n".format(
        place / "*" / "mission.jsonl")
    recorded(place, visitor_who(says="no"))
    for name in (OLD, RUN_10):  # empty, and of a run that could not write
        (place / name).mkdir()
    (place / OLD / "mission.jsonl").write_text("")
    assert main(["latest"]) == 0 and capsys.readouterr().out.startswith("the same path: 1 pass")


def test_a_folder_of_one_record_is_that_record_and_of_several_is_refused(tmp_path, capsys):
    for name in ("monday", "tuesday"):
        shutil.copytree(os.path.dirname(recorded(tmp_path / "runs", visitor_who(says="no"))),
                        str(tmp_path / "saved" / name))
        if name == "monday":
            assert main([str(tmp_path / "saved")]) == 0
            assert capsys.readouterr().out.startswith("the same path: 1 pass")
    assert main([str(tmp_path / "saved")]) == 2
    assert capsys.readouterr(
    ).err == "{}: the folder has the records of 2 runs (name one)\n".format(tmp_path / "saved")
    assert main([str(tmp_path / "none")]) == 2
    assert capsys.readouterr(
    ).err == "{}: the record cannot be read: No such file or directory\n".format(tmp_path / "none")


def test_the_report(tmp_path, capsys):
    path = recorded(tmp_path, visitor_who(says="yes"), failure_rate=0.2, seed=4)
    page = str(tmp_path / "report.html")
    assert main(["--report", page, path]) == 0 and page in capsys.readouterr().out
    text = Path(page).read_text("utf-8")
    assert text.count('<li id="n') == len(read_record(path)[0].event.nodes)
    assert "WelcomeSpeech" in text and "recovery" in text.lower()
    assert json.dumps("drawn")[1:-1] in text
