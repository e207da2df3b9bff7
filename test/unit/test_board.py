"""What there is to see of a mission, as data."""
import base64
import itertools
import json
import re
import sys
import time
import types
import zlib
from functools import partial

import msgspec
import pytest
from py_trees.common import Status

from behavior_controller.cli import create_tree
from behavior_controller.run import history as run_module
from behavior_controller.run.events import (
    PULSE, Answered, Asked, EntriesWritten, HealthChanged, LeafFinished, LeafSummary, Noticed,
    PassFinished, PassStarted, Recovering, RunFinished, RunStarted, StepStarted,
    Suspended, Tick, TreeNode, TreeShown)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.run.state import State
from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.requests import Answer, GoTo, PerformGesture, Say
from behavior_controller.leaves import registry
from behavior_controller.run.story import Story, cause, how_it_ended
from behavior_controller.viewer import board as board_module
from behavior_controller.viewer import view
from behavior_controller.viewer import status_tool
from behavior_controller.viewer.view import PARTS
from behavior_controller.run.moment import robot_line
from behavior_controller.run.moment import Card, RobotLine, card_line
from behavior_controller.run.record import feed, recorder
from behavior_controller.viewer import report_moments as moments_module
from behavior_controller.viewer.report_moments import Moments
from behavior_controller.run.record.reader import read_record
from behavior_controller.viewer.timeline import Bar
from mission_rig import (
    RUN, LiveBoard, Rig, board_of, one_leaf, refusal, refusing, service_of, visitor_who)
from recorded_tours import recorded_day

ENDED = "all passes are done; pass {} was a SUCCESS; attention and lifelike movement are off"
GONE_AWAY = HealthChanged("service", "/robotNavigation/set_goal", "robotNavigation", False, "gone",
                          "it cannot drive")


def let_time_stand(monkeypatch, now):
    """Have the clocks of the board show ``now[0]`` seconds, the one of the day a million more."""
    monkeypatch.setattr(board_module, "time", types.SimpleNamespace(monotonic=lambda: now[0]))
    for module in (view, recorder.events):
        monkeypatch.setattr(module, "unix_now", lambda: 1_000_000.0 + now[0])
    monkeypatch.setattr(recorder.events, "unix_at", lambda at: 1_000_000.0 + at)


def time_of_day(at):
    return time.strftime("%H:%M:%S", time.localtime(1_000_000.0 + at))


def letters(board):
    return board.part("statuses")["letters"]


def test_the_tree_has_the_nodes_of_the_mission_with_their_names_and_types():
    rig = Rig()
    nodes = board_of(rig).part("mission")["nodes"]
    assert [(node["uid"], node["name"], node["path"]) for node in nodes] == [
        (node.uid, node.name, node.full_path) for node in rig.tree.nodes]
    assert [[child.uid for child in node.children] for node in rig.tree.nodes] == [
        [node["uid"] for node in nodes if node["parent"] == uid]
        for uid in range(1, len(nodes) + 1)]
    assert len([node for node in nodes if node["subtree"]]) == len(
        [node for node in rig.tree.nodes if node.registration_id == "SubTree"])


@pytest.mark.slow
def test_a_tree_of_many_levels_is_data_that_json_carries():
    rig = one_leaf("<Inverter>" * 1900 + "<WelcomeSpeech/>" + "</Inverter>" * 1900)
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(300)
    try:
        sent = json.loads(json.dumps(board_of(rig).part("mission")))
    finally:
        sys.setrecursionlimit(before)
    assert [node["parent"] for node in sent["nodes"]] == list(range(1901))


def test_nodes_are_called_what_py_trees_render_calls_them():
    rig = Rig()
    board = board_of(rig)
    rig.mission.events.emit(RUN)

    labels = [" ".join(filter(None, (node["name"], node["kind"])))
              for node in board.part("mission")["nodes"]]
    assert sorted(labels) == sorted(node.name for node in create_tree("lab_tour").iterate())


def test_the_letter_of_each_node_and_the_leaf_that_runs():
    rig = one_leaf("<Sequence><WelcomeSpeech/><FollowMeSpeech/><SayGoodByeSpeech/></Sequence>",
                   lambda request: None if "ollow" in request.text else Answer())
    board = board_of(rig)
    assert board.part("statuses") == {"letters": "----", "tip": 0}
    rig.tick()
    assert board.part("statuses") == {"letters": "RSR-", "tip": 3}
    rig.gateway.calls[-1].finish(refusal(rig.requests[-1]))
    rig.tick()
    assert board.part("statuses") == {"letters": "fsf-", "tip": 0}
    rig.tick()
    rig.tree.halt()
    assert board.part("statuses") == {"letters": "rsr-", "tip": 0}
    assert [each["letter"] for each in board.node(3)["results"]] == ["-", "F"]


def test_the_letters_of_what_ended_before_the_first_look():
    rig = one_leaf("<Sequence><WelcomeSpeech/></Sequence>")
    board = board_of(rig)
    rig.tick()
    assert letters(board) == "ss"


def test_each_part_has_a_version_that_grows_with_it(monkeypatch):
    rig = Rig(answer=refusing(PerformGesture))
    board = board_of(rig)
    before = dict(board.versions)
    rig.mission.health.report(GONE, GONE_AWAY)
    rig.run(visitor_who(says="yes"))
    board.refresh()
    assert [name for name in PARTS if board.versions[name] == before[name]] == []
    monkeypatch.setattr(board_module, "PULSE", 1000.0)
    before = dict(board.versions)
    board.refresh()
    assert board.versions == before


@pytest.mark.parametrize("before, event, changed", [
    ([], RUN, "health mission now ready story"), ([], PassStarted(1, 0.0), "now story timeline"),
    ([PassStarted(1, 0.0)], PassFinished(1, "SUCCESS", 1.0), "now story visits"),
    ([], PassFinished(1, "SUCCESS", 1.0), ""),
    ([], StepStarted(1, "x", "x", "driving", "", 0.0, False), "now timeline"),
    ([StepStarted(1, "x", "x", "driving", "", 0.0, False)],
     LeafFinished(1, "x", "x", "SUCCESS", "", 1.0, None), "now timeline"),
    ([], LeafFinished(1, "x", "x", "SUCCESS", "", 1.0, None), ""),
    ([], Noticed("info", "so"), "story"), ([], Noticed("warning", "so"), "story"),
    ([], GONE_AWAY, "health now ready story"),
    ([], RunFinished("stopped", 0), "now ready story visits")])
def test_an_event_changes_what_it_is_about_and_nothing_else(monkeypatch, before, event, changed):
    let_time_stand(monkeypatch, [50.0])
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    for each in before:
        rig.mission.events.emit(each)
    board.refresh()
    versions = dict(board.versions)
    rig.mission.events.emit(event)
    board.refresh()
    assert [name for name in sorted(PARTS)
            if board.versions[name] != versions[name]] == changed.split()


@pytest.mark.slow
def test_a_part_changes_with_each_field_of_the_model_that_it_shows(tmp_path, monkeypatch):
    read = set()

    class Observed(State):
        def __getattribute__(self, name):
            read.add(name)
            return super().__getattribute__(name)

    path = recorded_day(tmp_path, monkeypatch, 8)
    shown = view.View()
    for line in read_record(path):
        shown.take(line.time, line.event)
        state = shown.state
        for name in view.MOMENT:
            shown.state = Observed(*map(partial(getattr, state), State.__struct_fields__))
            read.clear()
            shown.part(name)
            # the others change with these, or together with them
            known = {"at", "course", "letters", "running", "uids", "visits", "visit_count"}
            assert read.intersection(State.__struct_fields__) <= known.union(PARTS[name])
        shown.state = state


def test_a_pause_of_the_operator_is_a_moment_of_the_record():
    moments, shown = Moments(), view.View()
    for event in (RUN, Suspended("paused by the operator")):
        shown.take(1.0, event)
        moments.take(shown, 1.0)
    (_, packed), = moments.packed()
    (_, _), (_, news) = json.loads(zlib.decompress(base64.b64decode(packed)))
    assert news["now"]["card"]["kind"] == "paused"


@pytest.mark.parametrize("every", [2, 100])
def test_the_moments_of_a_record_have_what_was_shown_at_each_of_them(monkeypatch, every):
    monkeypatch.setattr(moments_module, "STRETCH_MOMENTS", every)
    happens = [
        TreeShown("M", [TreeNode("a", "A", "a", 0)]), RUN, PassStarted(1, 0.0),
        StepStarted(1, "x", "x", "driving", "", 0.0, False), Tick(0.0, True, [(1, "R")]),
        EntriesWritten([("a", "1")]), Noticed("info", "so"), EntriesWritten([("a", "1")]),
        GONE_AWAY, LeafFinished(1, "x", "x", "SUCCESS", "", 1.0, None), Tick(0.0, True, [(1, "S")]),
        PassFinished(1, "SUCCESS", 1.0), RunFinished("stopped", 0)]
    moments, shown, expected = Moments(), view.View(), []
    for at, event in enumerate(happens):
        shown.take(float(at), event)
        moments.take(shown, float(at))
        parts = shown.shown(moments_module.AT_MOMENTS)
        parts["story"] = parts["story"]["visit"]  # the report's page has the sentences itself
        if not expected or expected[-1][1] != parts:
            expected.append((at, parts))
    found = []
    for _, packed in moments.packed():
        known = {}
        for number, (at, news) in enumerate(json.loads(zlib.decompress(base64.b64decode(packed)))):
            assert number < every
            known.update(news)
            found.append((at, dict(known, story=known["story"]["visit"])))
    assert found == expected and len(found) > 8


def test_each_stretch_of_moments_begins_at_its_first_one(monkeypatch):
    monkeypatch.setattr(moments_module, "STRETCH_MOMENTS", 2)
    moments, shown = Moments(), view.View()
    for at, event in enumerate((RUN, Suspended("paused"), Suspended(""), Suspended("again"))):
        shown.take(1.0 + at, event)
        moments.take(shown, float(at))
    stretches = [(begins, json.loads(zlib.decompress(base64.b64decode(packed))))
                 for begins, packed in moments.packed()]
    assert [(begins, [at for at, _ in kept]) for begins, kept in stretches] == [
        (0, [0, 1]), (2, [2, 3])]


def test_what_is_no_event_is_shown_when_it_changes(monkeypatch):
    now = [50.0]
    let_time_stand(monkeypatch, now)
    rig = one_leaf("<AlwaysSuccess/>")
    board = board_of(rig)
    versions = {}

    def changed():
        board.refresh()
        before, versions[0] = versions.get(0, board.versions), dict(board.versions)
        return {name for name in PARTS if board.versions[name] != before[name]}

    changed()
    rig.tick()
    assert changed() == {"statuses", "now"} and changed() == set()
    rig.tree.blackboard.set("key", 1)
    rig.tick()
    assert changed() == {"statuses", "now", "blackboard", "values"} and changed() == set()
    now[0] += board_module.PULSE
    assert changed() == {"alive", "health"} and changed() == set()
    board.show(one_leaf("<AlwaysFailure/>").tree)
    assert changed() == {"mission", "statuses", "now", "blackboard", "values"}
    assert changed() == set()
    board.close()
    assert changed() == {"now", "alive", "ready"} and not board.part("ready")["is_ready"]
    assert board.part("now")["ended"] == "the controller has stopped"


def test_story_visits_health_trouble_and_blackboard():
    rig = Rig(answer=refusing(PerformGesture))
    board = board_of(rig)
    rig.mission.health.report(GONE, GONE_AWAY)
    rig.run(visitor_who(says="yes"))
    incomplete = ENDED.format(1).replace("SUCCESS", "SUCCESS, complete without 2 steps "
                                           "(WelcomeGesture and GoodbyeGesture)")
    assert (board.part("now")["count"], board.part("now")["ended"]) == (1, incomplete)
    newest, = board.part("visits")["newest"]
    assert incomplete.partition("SUCCESS, ")[2].partition(";")[0] in newest["ending"]
    assert board.part("now")["last"] == "visitor 1: " + newest["ending"]
    ill = [part for part in board.part("health").values() if not part["well"]]
    assert [(part["name"], part["status"], part["consequence"]) for part in ill] == [
        ("/robotNavigation/set_goal", "gone", "it cannot drive")]
    assert len(board.part("health")) == len(INTERFACE.offers)
    story = Story()  # what it makes of the same events is what is shown
    told = [sentence for event in rig.events for sentence in story.take(0.0, event)]
    shown = board.part("story")["sentences"]
    assert [(each["visit"], each["text"], each["uid"]) for each in shown] == [
        (sentence.visit, sentence.text, sentence.uid) for sentence in told]
    assert [each["number"] for each in shown] == list(range(1, len(told) + 1))
    assert [each["trouble"].partition(" is ")[0] for each in ill] == ["/robotNavigation/set_goal"]
    assert board.part("visits")["counted"] == ("1 visit: 1 complete without steps")
    assert [(each["number"], each["outcome"], [
        (one["name"], one["state"]) for one in each["stops"]
    ]) for each in board.part("visits")["newest"]] == [(1, "SUCCESS", [("exhibit 1", "completed"),
                                                                       ("exhibit 2", "completed")])]
    assert board.part("visits")["newest"][0]["ending"] == how_it_ended(story.state.visit) != ""
    entries = board.part("blackboard")
    assert (entries["currentExhibit"], entries["exhibits"]) == ("exhibit 2", "exhibit 1, exhibit 2")


def test_an_entry_of_a_subtree_is_shown_with_the_subtree_s_path():
    rig = Rig("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'><SubTree "
              "ID='Inner' name='inner'/></BehaviorTree><BehaviorTree ID='Inner'><Script code='a := "
              "3; @b := 4'/></BehaviorTree></root>")
    board = board_of(rig)
    rig.tick()
    assert board.part("blackboard") == {"b": "4", "inner/a": "3"}


def test_a_step_has_its_age_and_its_limit(monkeypatch):
    now = [1000.0]
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    let_time_stand(monkeypatch, now)
    board = board_of(rig)
    rig.tick()
    now[0] = 1004.26
    card, limit = board.part("now")["card"], rig.settings.deadline(
        rig.mission.interface.service(Say))
    assert (card["kind"], card["since"], card["until"],
            card["uid"]) == ("step", 1001000.0, 1001000.0 + limit, 1)
    assert card["waits_for"].endswith(service_of(Say))
    rig.gateway.calls[-1].finish(refusal(rig.requests[-1]))
    now[0] = 1004.256
    rig.tick()
    assert [each["seconds"] for each in board.part("timeline")] == [4.26]
    result, = board.node(1)["results"]
    assert (result["time"], result["seconds"]) == (time_of_day(1004.256), pytest.approx(4.256))


def test_the_steps_of_a_visit_are_kept_for_its_timeline_until_the_next_visit():
    rig = Rig()
    board = board_of(rig)
    ends = []

    def visitor(rig):
        ends.append([step["words"] for step in board.part("timeline")])
        visitor_who(says="no")(rig)

    rig.run(visitor, runs=2)
    words = [step["words"] for step in board.part("timeline")]
    assert words.count("making the welcome gesture") == 1
    assert max(each.count("making the welcome gesture") for each in ends) == 1
    assert all(step["uid"] for step in board.part("timeline"))


def test_what_there_is_to_know_of_a_node():
    rig = Rig(answer=refusing(GoTo))
    board = board_of(rig)
    assert board.node(0) is None and board.node(len(rig.tree.nodes) + 1) is None
    node = next(node for node in rig.tree.nodes if node.name == "Navigate")
    before = board.node(node.uid)
    assert before["results"] == [] and before["ports"] == [{
        "name": "target", "text": "{@targetLocation}", "value": "–"}]
    with open(node.element.document.file, encoding="utf-8") as file:
        line = file.read().split("\n")[int(before["place"].split(":")[1]) - 1]
    assert "<Navigate/>" in line and before["type"] == "Navigate"
    assert before["description"] == registry()["Navigate"].summary != ""
    fixed = board_of(one_leaf('<Navigate target="1;2;90"/>')).node(1)
    assert fixed["ports"] == [{"name": "target", "text": "1;2;90", "value": ""}]
    rig.run(visitor_who(says="yes"))
    found = board.node(node.uid)
    assert [(each["letter"], each["why"], each["times"]) for each in found["results"]] == [
        ("F", cause(Failure(Cause.REFUSED, "the server refused", service_of(GoTo))), 1)]
    assert "x 0.5 m" in found["ports"][0]["value"] and json.dumps(found)


def test_the_newest_results_of_a_node_are_kept_and_those_alike_are_one(monkeypatch):
    monkeypatch.setattr(view, "INSTANT", 1000.0)
    rig = one_leaf("<Sequence><WelcomeSpeech/></Sequence>")
    board = board_of(rig)
    for _ in range(7):
        rig.tick()
    assert [(each["letter"], each["times"]) for each in board.node(2)["results"]] == [("S", 7)]
    monkeypatch.setattr(view, "INSTANT", 0.0)
    for _ in range(7):
        rig.tick()
    assert [(each["letter"], each["times"])
            for each in board.node(2)["results"]] == [("S", 1)] * view.RESULTS


@pytest.mark.parametrize("took, times", [
    ([0.5, 0.5, 0.5], [3]), ([0.5, 1.0, 0.5], [1, 1, 1]), ([1.0, 1.0], [1, 1]),
    ([0.5, 0.5, 2.0], [1, 2])])
def test_results_that_each_took_less_than_an_instant_are_one(monkeypatch, took, times):
    monkeypatch.setattr(view, "INSTANT", 1.0)
    shown, at = view.View(), 100.0
    shown.take(at, TreeShown("M", [TreeNode("a", "A", "a", 0)]))
    for seconds in took:
        shown.take(at, Tick(0.0, True, [(1, "R")]))
        at += seconds
        shown.take(at, Tick(0.0, True, [(1, "S")]))
    assert [each["times"] for each in shown.node(1)["results"]] == times


@pytest.mark.parametrize("path, uid, tip", [("go", 3, 2), ("go", 1, 3), ("unknown", 3, 3)])
def test_where_the_run_is_while_a_recovery_does_a_node_again(path, uid, tip):
    busy = Failure(Cause.REFUSED, "busy", "/go")
    shown = view.View()
    for event in (TreeShown("M", [TreeNode("all", "Fallback", "all", 0),
                                  TreeNode("go", "Navigate", "go", 1),
                                  TreeNode("help", "HandleFallBack", "help", 1)]),
                  LeafFinished(2, "Navigate", "go", "FAILURE", "", 1.0, busy),
                  Tick(0.0, True, [(1, "R"), (2, "F"), (3, "R")])):
        shown.take(1.0, event)
    assert msgspec.to_builtins(shown.statuses()) == {"letters": "RFR", "tip": 3}
    shown.take(2.0, Recovering(uid, "Navigate", path, busy, 1, 2))
    assert msgspec.to_builtins(shown.statuses()) == {"letters": "RFR", "tip": tip}


def test_results_that_differ_are_not_one_and_a_failure_is_that_of_its_tick():
    answers = [Answer(), Failure(Cause.REFUSED, "a"), Failure(Cause.REFUSED, "b"),
               Failure(Cause.REFUSED, "b"), Answer()]
    rig = one_leaf("<ForceSuccess><WelcomeSpeech/></ForceSuccess>", lambda request: answers.pop(0))
    board = board_of(rig)
    rig.mission.events.emit(
        LeafFinished(2, "x", "x", "FAILURE", "", 0.0, Failure(Cause.REFUSED, "of another tick")))
    for _ in range(5):
        rig.tick()
    assert [(each["letter"], each["why"], each["times"])
            for each in board.node(2)["results"]] == [("S", "", 1),
                                                      ("F", cause(Failure(Cause.REFUSED, "b")), 2),
                                                      ("F", cause(Failure(Cause.REFUSED, "a")), 1),
                                                      ("S", "", 1)]


def test_each_of_the_failures_of_a_tick_is_that_of_its_attempt():
    causes = iter((Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER))
    rig = one_leaf("<RetryUntilSuccessful num_attempts='3'><WelcomeSpeech/></RetryUntilSuccessful>",
                   lambda request: Failure(next(causes), "m"))
    board = board_of(rig)
    assert rig.tick() is Status.FAILURE
    assert [each["why"] for each in board.node(2)["results"]] == [
        cause(Failure(kind, "m")) for kind in (Cause.NO_ANSWER, Cause.NOT_REACHABLE, Cause.REFUSED)]


def test_what_only_says_how_the_mission_is_put_together_is_bare():
    board = board_of(Rig())
    nodes = board.part("mission")["nodes"]
    assert {node["name"] for node in nodes if node["bare"]} == {
        "Fallback", "ForceFailure", "ForceSuccess", "HandleFallBack", "Inverter",
        "KeepRunningUntilFailure", "Parallel", "ReactiveFallback", "Sequence"
    } & {node["name"] for node in nodes}
    assert not any(node["bare"] for node in nodes
                   if node["subtree"] or not node["parent"] or "(" in node["kind"])


def test_the_newest_sentences_are_kept():
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    for number in range(101):
        rig.mission.events.emit(Noticed("warning", "line {}".format(number)))
        rig.mission.events.emit(Noticed("info", "no trouble"))
    assert [line["number"] for line in board.part("story")["sentences"]] == list(range(103, 203))


def test_calls_and_the_age_of_topics_are_part_of_the_health(monkeypatch):
    now = [50.0]
    let_time_stand(monkeypatch, now)
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.mission.health.last_arrivals["/faceDetection/data"] = 47.0
    board = board_of(rig)
    rig.mission.events.emit(RUN)
    rig.tick()
    now[0] = 50.2516
    rig.gateway.calls[0].finish(refusal(Say("")))
    rig.tick()
    parts = board.part("health")
    said, seen = parts["/textToSpeech/say_text"], parts["/faceDetection/data"]
    assert (said["calls"], said["failures"], said["seconds"], said["age"]) == (1, 1, 0.252, None)
    assert seen["age"] == 3.3
    goal = parts["/robotNavigation/set_goal"]
    assert (goal["calls"], goal["failures"], goal["seconds"], goal["age"]) == (0, 0, None, None)


def test_calls_are_counted():
    shown, failed = view.View(), Failure(Cause.REFUSED, "-", "/say")
    for call, (seconds, result) in enumerate(((0.5, Answer()), (2.0, failed), (1.0, failed)), 1):
        shown.take(10.0 * call, Asked(call, "/say", Say("")))
        shown.take(10.0 * call + seconds, Answered(call, result))
    assert shown.calls["/say"] == (3, 2, 1.0)


@pytest.mark.slow
def test_there_is_a_sign_of_life_every_second_though_nothing_happens():
    board = board_of(one_leaf("<Sleep msec='9000'/>"))
    board.refresh()
    before, ends = dict(board.versions), time.monotonic() + 5.0
    while board.versions["alive"] == before["alive"] and time.monotonic() < ends:
        time.sleep(0.01)
        board.refresh()
    assert [name for name in PARTS if board.versions[name] != before[name]] == ["health", "alive"]


def test_a_tick_thread_that_hangs_is_told_by_the_age_of_its_last_sign(monkeypatch):
    now = [50.0]
    let_time_stand(monkeypatch, now)
    rig = one_leaf("<Sleep msec='9000'/>")
    board = LiveBoard(rig)

    def alive():
        part = board.part("alive")
        return part["age"], part["hangs"]

    assert alive() == (None, False) and board.part("mission")["nodes"] == []
    assert board.part("now")["card"]["what"] == "nothing runs"
    board.show(rig.tree, {"/faceDetection/data": 50.0})
    rig.mission.events.emit(RUN)
    for now[0], expected in ((50.0, (0.0, False)), (51.26, (1.3, False)), (52.9, (2.9, False)),
                             (53.0, (3.0, True))):
        assert alive() == expected
        assert expected[0] in [part["age"] for part in board.part("health").values()]
    rig.clock.advance(PULSE)  # the tick thread runs its timers again
    assert alive() == (0.0, False)
    rig.mission.events.emit(RunFinished("stopped", 0))
    now[0] = 60.0
    assert alive() == (None, False)


def test_statuses_of_a_visitor_end_with_the_pass():
    seen = {}
    rig = Rig()
    board = board_of(rig)
    welcome, declined = (next(node.uid for node in rig.tree.nodes if node.name == name)
                         for name in ("QueryVisitorResponse", "Declined"))

    def visitor(rig):
        passes = len(rig.of(PassFinished))
        greeted = sum(isinstance(request, Say) and request.text.startswith("Hello")
                      for request in rig.requests)
        if greeted > passes and passes not in seen:
            seen[passes] = letters(board), board.part("now")
        visitor_who(says="no")(rig)

    assert rig.run(visitor, runs=2) == 0
    for shown, _ in seen.values():  # nothing beyond the welcome has run
        assert "R" in shown[:welcome - 1] and set(shown[welcome - 1:]) == {"-"}
    assert letters(board)[declined - 1] == "s"  # the last visitor's, when no pass follows
    assert [
        re.findall(r"\d+", seen[number][1]["card"]["where"])[0] for number in (0, 1)] == ["1", "2"]
    assert board.part("now")["ended"] == ENDED.format(2)


def test_statuses_of_the_visit_before_are_gone_when_the_next_begins():
    rig = Rig()
    board = board_of(rig)
    rig.run(visitor_who(says="no"))
    assert "s" in letters(board)
    rig.mission.events.emit(PassStarted(2, rig.clock.now()))
    assert letters(board) == "-" * len(rig.tree.nodes)


@pytest.mark.parametrize("outcome, expected", [(None, "the controller has stopped"),
                                               ("stopped", "stopped")])
def test_the_end_is_told_even_if_the_mission_does_not_tell_it(outcome, expected):
    rig = Rig()
    board = board_of(rig)
    if outcome is not None:
        rig.mission.events.emit(RunFinished(outcome, 0))
    before = board.versions["now"]
    board.close()
    assert board.part("now")["ended"] == expected and board.versions["now"] > before


def test_what_the_robot_says_stays_on_its_line():
    odd = "\x1b[2J\n\u202e\ud800"
    rig = one_leaf('<Sequence name="a&#10;b&#x202e;"><WelcomeSpeech/></Sequence>',
                   lambda request: Failure(Cause.HANDLER_EXCEPTION, odd, odd))
    board = board_of(rig)
    rig.tick()
    rig.mission.events.emit(Noticed("error", odd))
    rig.mission.events.emit(HealthChanged("service", service_of(Say), odd, False, odd, ""))
    state = {name: board.part(name) for name in PARTS}
    assert all(line["text"].isprintable() for line in state["story"]["sentences"])
    assert all(part["status"].isprintable() for part in state["health"].values())
    assert "\\n" in state["mission"]["nodes"][0]["name"]
    assert "\\x1b[2J\\n\\u202e\\ud800" in "".join(
        status_tool.lines(msgspec.convert(state, status_tool.ShownState), True))


def test_lines_that_are_missing_are_told(monkeypatch):
    monkeypatch.setattr(feed, "MOST_EVENTS", 3)
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    board.refresh()
    for number in range(9):
        rig.mission.events.emit(Noticed("info", f"line {number}"))
    board.refresh()
    rig.mission.events.emit(Noticed("info", "the last line"))
    told = [line["text"] for line in board.part("story")["sentences"]]
    assert told == ["line 0", "line 1", "line 2", "6 events are missing", "the last line"]
    assert board.state.lost == 6


def test_that_a_visit_begins_is_shown_though_no_node_was_ticked_yet():
    rig = Rig()
    board = board_of(rig)
    board.refresh()
    before = dict(board.versions)
    rig.mission.events.emit(PassStarted(2, 0.0))
    board.refresh()
    assert {"now", "timeline"} <= {part for part in PARTS if board.versions[part] != before[part]}


def test_a_visit_has_the_time_of_the_arrival_and_until_then_that_of_its_begin(monkeypatch):
    rig, now = Rig(), [0.0]
    let_time_stand(monkeypatch, now)
    board = board_of(rig)
    for told in (None, LeafSummary("visit", "", "arrived")):
        rig.mission.events.emit(PassStarted(1, 0.0) if told is None else
                                LeafFinished(1, "x", "x", "SUCCESS", "", 0.0, None, told))
        board.refresh()
        assert board.part("story")["visit"]["time"] == time_of_day(now[0])
        now[0] += 75.0


def test_the_results_of_a_node_are_forgotten_with_its_tree():
    rig, other = one_leaf("<WelcomeSpeech/>"), one_leaf("<FollowMeSpeech/>")
    board = board_of(rig)
    rig.tick()
    assert len(board.node(1)["results"]) == 1
    board.show(other.tree)
    assert board.node(1)["type"] == "FollowMeSpeech" and board.node(1)["results"] == []


def test_a_node_of_another_tree_has_not_run_since_the_first_one_did(monkeypatch):
    now = [50.0]
    let_time_stand(monkeypatch, now)
    rig, other = one_leaf("<WelcomeSpeech/>", lambda request: None), one_leaf("<FollowMeSpeech/>")
    board = board_of(rig)
    rig.tick()
    board.show(other.tree)
    now[0] = 60.0
    other.tick()
    assert [each["seconds"] for each in board.node(1)["results"]] == [0.0]


def test_a_change_of_health_is_shown_at_once(monkeypatch):
    monkeypatch.setattr(board_module, "PULSE", 1000.0)
    rig = Rig()
    board = board_of(rig)
    board.refresh()
    before = board.versions["health"]
    rig.mission.events.emit(GONE_AWAY)
    board.refresh()
    assert board.versions["health"] != before


# -------------------------------------------------------------------- earlier moments, what is sent


@pytest.mark.slow
def test_an_earlier_moment_is_shown_as_it_was_shown_then(monkeypatch):
    monkeypatch.setattr(run_module, "STRETCH_EVENTS", 40)
    rig, then = Rig(answer=refusing(PerformGesture)), {}
    numbers = itertools.count(1)  # every event has a time of its own
    monkeypatch.setattr(board_module, "STRETCHES", 99)
    monkeypatch.setattr(recorder.events, "unix_now", lambda: float(next(numbers)))
    board = board_of(rig)

    def visitor(rig):
        then[next(numbers)] = {name: board.part(name) for name in [*view.MOMENT, "health"]}
        if len(then) == 9:
            rig.mission.health.report(GONE, GONE_AWAY)
        visitor_who(says="yes")(rig)

    rig.run(visitor, runs=2)
    assert len(then) > 10 and board.at(0.0)["now"]["card"]["what"] == "nothing runs"
    for moment, parts in then.items():
        # how often each service was called is known for now only
        health = {name: dict(offer, calls=0, failures=0, seconds=None, age=None)
                  for name, offer in parts["health"].items()}
        assert board.at(moment) == dict(parts, health=health)
    assert len({offer["well"] for parts in then.values()
                for offer in parts["health"].values()}) == 2


def test_a_time_of_the_mission_s_clock_is_shown_as_the_time_of_day(monkeypatch):
    rig = Rig()
    let_time_stand(monkeypatch, [50.0])
    board = board_of(rig)
    rig.mission.events.emit(PassStarted(1, rig.clock.now()))
    asked = [(name, str(rig.clock.now() + 75.0)) for name in ("questionAskedAt", "other")]
    rig.mission.events.emit(EntriesWritten(asked))
    assert board.part("blackboard") == {"questionAskedAt": time_of_day(125.0), "other": asked[1][1]}


@pytest.mark.parametrize("name, text, has_visit, expected", [
    ("questionAskedAt", "75.0", True, 175.0), ("attentionSetAt", "75.0", True, 175.0),
    ("questionAskedAt", "75.0", False, "75.0"), ("other", "75.0", True, "75.0"),
    ("questionAskedAt", "soon", True, "soon"), ("questionAskedAt", "1e300", True, "1e300")])
def test_which_entries_are_shown_as_a_time_of_day(name, text, has_visit, expected):
    shown = view.View()
    shown.take(1_000_100.0, TreeShown("", [], times=["questionAskedAt", "attentionSetAt"]))
    if has_visit:
        shown.take(1_000_110.0, PassStarted(1, 10.0))
    shown.take(1_000_110.0, EntriesWritten([(name, text)]))
    told = time_of_day(expected) if isinstance(expected, float) else expected
    assert shown.blackboard() == {name: told}


def subclasses(kind):
    return {each for own in kind.__subclasses__() for each in {own} | subclasses(own)}


def test_what_several_threads_read_cannot_be_changed():
    """A thread that shows an event, a state or a part of the page must not see it half changed."""
    ours = {kind for kind in subclasses(msgspec.Struct) - {Bar}
            if kind.__module__.startswith("behavior_controller.")}
    assert len(ours) > 60 and {RunStarted, Card, State} < ours
    assert [kind for kind in ours if not kind.__struct_config__.frozen] == []


@pytest.mark.parametrize("card, expected", [
    (Card("idle", "nothing runs"), "nothing runs"),
    (Card("ended", "stopped", since=100.0), "stopped"),
    (Card("busy", "runs a", since=100.0), "runs a, 60 s"),
    (Card("busy", "runs a", since=200.0), "runs a, 0 s"),  # a clock that was set back
    (Card("step", "driving", "visitor 1", 100.0, 280.0),
     "visitor 1 · driving, 60 s of at most 180 s"),
    (Card("step", "driving", attempt=2, attempts=3), "driving (attempt 2 of 3)"),
    # its words say it
    (Card("retry", "retrying, 1 of 2", attempt=2, attempts=3), "retrying, 1 of 2"),
    (Card("wait", "waiting", "", 100.0, None, 1, 3, "the answer of /a", "/a is gone", "Go"),
     "waiting, 60 s; /a is gone · waits for the answer of /a · next: Go")])
def test_a_card_on_one_line(card, expected):
    assert card_line(card, 160.0) == expected


@pytest.mark.parametrize("more, expected", [
    ((), "all answer · attention off · lifelike movement on · at home"),
    (("safe state reached",),
     "all answer · attention off · lifelike movement on · at home · safe state reached"),
    (("", "Take it home"),
     "all answer · attention off · lifelike movement on · at home. Take it home")])
def test_the_robot_on_one_line(more, expected):
    assert RobotLine(True, "all answer", "off", "on", "at home", *more).text == expected


def test_nothing_is_known_of_a_robot_before_the_mission_starts():
    story = Story()
    before = robot_line(story.state).text
    story.take(1.0, RUN)
    assert "not yet" in before and "not yet" not in robot_line(story.state).text


def test_a_pass_that_is_stopped_before_a_visitor_comes_is_no_visit():
    rig = Rig()
    board = board_of(rig)
    rig.run(lambda rig: rig.clock.advance(0.5), is_stopped=lambda: rig.clock.now() > 1010.0)
    assert board.part("visits") == {"counted": "no visit completed", "newest": []}
    assert board.part("now")["last"] == ""
    assert board.part("now")["card"]["what"] == "stopped before a visitor came"
