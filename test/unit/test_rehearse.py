"""rehearseMission: what it plays, and how it tells what it finds."""
import html
import importlib.util
import io
import json
import math
import os
import pty
import re
import select
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from msgspec import structs

from behavior_controller import exit_codes
from behavior_controller.robot.requests import SetAttention
from behavior_controller.run.story import Sentence

from behavior_controller.simulation.rehearsal import cli
from behavior_controller.simulation.rehearsal import blocked_leaf, findings, html_report, plays
from behavior_controller.simulation.rehearsal.findings import RobotCall, Finding
from behavior_controller.simulation.rehearsal.plays import Outcome, Scenario, Search, ScenarioRunner
from behavior_controller.simulation.rehearsal.summary import (
    FindingSummary, VisitorRow, Share, Survey, shortened)
from behavior_controller.simulation.configuration import SEEDS
from behavior_controller.simulation.faults import KINDS, PlannedFault
from behavior_controller.simulation.visitor import BEHAVIOURS

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
ENGAGES, SILENT = ["--visitors", "engages"], ["--visitors", "silent"]
CALM = ["--faults", "none", "--limit", "900"]
def planted(name):
    return os.path.join(HERE, "planted", name + ".xml")


def run(capsys, *words):
    """Return the exit code and what was printed."""
    code = cli.main(list(words) + ["--jobs", "1"])
    printed = capsys.readouterr()
    assert printed.err == ""
    return code, printed.out


def found(capsys, *words):
    code, text = run(capsys, "--json", *words)
    told = json.loads(text)["found"]
    assert code == (exit_codes.FINDINGS if told else 0)
    return told


@pytest.mark.slow
def test_nothing_is_found_in_the_lab_tour_with_drawn_faults(capsys):
    assert found(capsys, "lab_tour", "--runs", "20", "--failureRate", "0.1") == []


TWO_KINDS = ["--kinds", "refused,unanswered"]


@pytest.mark.long
@pytest.mark.parametrize("words", [
    ["lab_tour"], ["reception", *TWO_KINDS],
    ["release_1_0_tour", "robotInterface:=release-1.0", *TWO_KINDS],
    ["release_1_0_reception", "robotInterface:=release-1.0", "tabletSuccessIs:=yes", *TWO_KINDS]])
def test_nothing_is_found_in_the_delivered_missions_with_each_single_fault(words):
    assert cli.rehearse(cli.Plan(cli.read(words)), jobs=2).findings == []


ORDER = """<Sequence><START_OF_TREE/><Parallel success_count="2" failure_count="1">
<Sequence><WelcomeSpeech/><Script code="last := 'speech'"/></Sequence>
<Sequence><WelcomeGesture/><Script code="last := 'gesture'"/></Sequence></Parallel>
<Fallback><ScriptCondition code="last == 'speech'"/><DescribeExhibitSpeech/></Fallback></Sequence>
"""


def test_of_two_steps_at_once_each_ends_first_in_one_play(capsys, tmp_path):
    """The greeting takes more than the 3 s of the gesture, and the mission needs that."""
    file = mission(tmp_path, ORDER) + ".xml"
    os.rename(file[:-len(".xml")], file)
    assert found(capsys, file, *CALM, *ENGAGES) == []
    told = found(capsys, file, "--kinds", "refused", *ENGAGES, "asrEnabled:=true")
    wrong, = [each for each in told if each["kind"] == "missing-data"]
    assert wrong["scene"]["quick"] == ["textToSpeech"]
    again = wrong["command"].split()[3:]
    assert [each["kind"] for each in found(capsys, *again)] == ["missing-data"]


def test_a_visitor_who_is_not_understood_is_no_finding(capsys):
    assert found(capsys, "release_1_0_tour", "robotInterface:=release-1.0", "--faults", "none",
                 "--visitors", "unclear", "asrEnabled:=true") == []


@pytest.mark.slow
def test_a_finding_is_told_with_its_place_its_story_and_the_command_that_plays_it_again(capsys):
    path = planted("goodbye_to_nobody")
    code, text = run(capsys, path, *CALM)
    assert code == exit_codes.FINDINGS == 4
    line = [number for number, line in enumerate(open(path), 1) if "SayGoodByeSpeech" in line][0]
    assert "goodbye-to-nobody: The robot says goodbye although the visitor has left." in text
    assert re.search(
        r"SayGoodByeSpeech::\d+ \({}:{}:\d+\): the visitor had left \d+ s before".format(
            path, line), text)
    again = re.search("again: rosrun cssr_system rehearseMission (.*)", text).group(1).split()
    code, text = run(capsys, *again)
    assert code == exit_codes.FINDINGS and ": 1 simulated run in" in text
    assert "goodbye-to-nobody" in text


def outcome(scene, ended, seconds, exhibits=0, *found, calls=(), reached=()):
    stops = tuple(("stop {}".format(number), 1) for number in range(exhibits))
    return Outcome(scene, ended, seconds, stops, found, frozenset(reached), frozenset(), (),
                   tuple(calls))


TALK = [RobotCall("overtAttention", 1, 3, "a", True), RobotCall("textToSpeech", 1, 4, "b", True),
        RobotCall("textToSpeech", 2, 4, "c", True)]
"""The calls of a pass: a leaf's, and two of another leaf."""


def test_single_faults_are_each_call_in_each_way_each_service_for_good_and_each_silent_topic():
    calm = Scenario("engages")
    made = list(plays.single([outcome(calm, "SUCCESS", 9.0, calls=TALK)], KINDS, ["/x"]))
    planned = [fault for scene in made for fault in scene.planned]
    assert [fault for fault in planned if not fault.is_lasting] == [
        PlannedFault(node, number, kind) for node, number, *_ in TALK for kind in KINDS]
    assert [fault for fault in planned if fault.is_lasting] == [
        PlannedFault("overtAttention", 1, "refused", True),
        PlannedFault("textToSpeech", 1, "refused", True)]
    assert [scene.silent for scene in made if scene.silent] == [("/x",)]
    assert len(made) == 3 * 5 + 2 + 1


def test_four_visitors_in_a_row_have_no_successor():
    assert [Scenario("engages", then=("declines",) * others).may_have_successors
            for others in range(5)] == [True, True, True, False, False]


@pytest.mark.parametrize("ended, is_played", [
    ("SUCCESS", True), ("FAILURE", True), (plays.NO_VISITOR, False), ("", False)])
def test_a_pass_that_does_not_end_without_a_fault_is_not_played_with_one(ended, is_played):
    made = plays.single([outcome(Scenario("engages"), ended, 9.0, calls=TALK)], KINDS, ["/x"])
    assert any(made) is is_played


def test_what_the_tablet_does_not_change_is_not_played_again():
    both = [outcome(Scenario("engages"), "SUCCESS", 9.0, calls=TALK[:2]),
            outcome(Scenario("engages", False), "SUCCESS", 9.0, calls=TALK)]
    made = list(plays.single(both, ["crash"], []))
    assert [scene.planned for scene in made if not scene.by_voice] == [
        (PlannedFault("textToSpeech", 2, "crash"),),
        (PlannedFault("textToSpeech", 2, "crash", True),)]
    every = list(plays.single(both, ["crash"], [], is_every=True))
    assert [scene.planned[0][:2] for scene in every if not scene.planned[0].is_lasting] == [
        call[:2] for call in TALK[:2] + TALK]


def test_pairs_are_each_later_call_that_meets_what_no_call_has_met():
    calm = Scenario("engages")
    met = [call._replace(situation=bytes([number])) for number, call in enumerate(TALK)]
    again = met[1]._replace(number=3, situation=b"again")
    unknown = [call._replace(situation=b"") for call in met]  # up to the first fault
    singles = [
        # the second call is done again, then all goes on as without the fault; with crash it is
        # not, and what comes after it differs
        outcome(calm.with_fault(PlannedFault(*met[1][:2], kind)), "SUCCESS", 9.0, calls=calls)
        for kind, calls in (("refused", [*unknown[:2], again, met[2]]),
                            ("wrong", [*unknown[:2], again, met[2]]),
                            ("crash", [*unknown[:2], met[2]._replace(situation=b"away")]))]
    other = PlannedFault(*met[0][:2], "crash")
    not_played = [  # a pass that does not end, and a fault that lasts
        outcome(calm.with_fault(other), "", 9.0, calls=[*unknown[:1], again]),
        outcome(calm.with_fault(other._replace(is_lasting=True)), "SUCCESS", 9.0,
                calls=[*unknown[:1], again])]
    made = [scene.planned for scene in plays.pairs(
        [outcome(calm, "SUCCESS", 9.0, calls=met), *not_played, *singles], KINDS)]
    first = {kind: PlannedFault("textToSpeech", 1, kind) for kind in KINDS}
    assert made == [(first["refused"], PlannedFault("textToSpeech", 3, kind)) for kind in KINDS] + [
        (first["crash"], PlannedFault("textToSpeech", 2, kind)) for kind in KINDS]


ONE_AFTER_THE_OTHER = """<Sequence>
    <Script code="lost := 0"/>
    <Fallback><WelcomeSpeech/><Script code="{}"/></Fallback>
    <Fallback><ScanningOvertAttentionMode/><Script code="lost += 1"/></Fallback>
    <EndTourSpeech/>
</Sequence>"""


@pytest.mark.parametrize("script, number", [("lost += 1", 2), ("lost := 0", 1)])
def test_what_the_first_fault_leaves_behind_is_played_with_a_second_one(tmp_path, script, number):
    runner = plan(tmp_path, ONE_AFTER_THE_OTHER.format(script), "--faults", "pairs").runner
    calm = runner.evaluate(Scenario("engages"))
    assert [call.node for call in calm.calls] == ["textToSpeech", "overtAttention", "textToSpeech"]
    one = runner.evaluate(
        Scenario("engages").with_fault(PlannedFault("textToSpeech", 1, "refused")))
    made = [scene.planned[1][:2] for scene in plays.pairs([calm, one], ["refused"])]
    assert len(made) == 2 * (number - 1)


def test_faults_are_planned_towards_a_node_until_it_is_reached(tmp_path):
    path = mission(tmp_path, """<Sequence><ScanningOvertAttentionMode/><Fallback>
        <RetryUntilSuccessful num_attempts="5"><WelcomeSpeech/></RetryUntilSuccessful>
        <PressYesNoSpeech/><AlwaysSuccess name="last"/></Fallback></Sequence>""")
    runner = ScenarioRunner({}, path, 900.0)
    nodes = runner.stage(True).mission.tree.nodes
    outcomes = [runner.evaluate(Scenario("engages"))]
    reached = set(outcomes[0].reached)
    search = Search(nodes, reached, outcomes, "refused")
    assert [node.registration_id for node in search.targets()] == ["PressYesNoSpeech"]
    for scenes in search.rounds():
        for scene in scenes:
            outcomes.append(runner.evaluate(scene))
            reached |= outcomes[-1].reached
    assert search.targets() == [] and not search.is_cut
    assert search.plays < 100


def search_of(tmp_path, body, *calls, planned=(PlannedFault("a", 1, "crash"),), silent=()):
    """Return a search for EndTourSpeech, with four plays that have made these calls: two of them
    without a fault and two with those, two of a visitor who engages."""
    nodes = runner_of(tmp_path, body).stage(True).mission.tree.nodes
    uids = {node.registration_id: node.uid for node in nodes}
    made = [RobotCall(node, number, uids[leaf], "", is_done)
            for node, number, leaf, is_done in calls]
    reached = set(uids.values()) - {uids["EndTourSpeech"]}
    outcomes = [outcome(scene, "SUCCESS", 9.0, calls=made, reached=reached)
                for visitor in ("engages", "silent") for scene in (
                    Scenario(visitor), Scenario(visitor, planned=planned, silent=silent))]
    return Search(nodes, reached, outcomes, "refused")


WAY_TO_THE_LAST = """<Sequence><ScanningOvertAttentionMode/>
    <Fallback><WelcomeSpeech/><EndTourSpeech/></Fallback></Sequence>"""


def test_a_further_fault_is_at_a_call_below_the_sibling_that_was_carried_out(tmp_path):
    search = search_of(
        tmp_path, WAY_TO_THE_LAST, ("overtAttention", 1, "ScanningOvertAttentionMode", True),
        ("overtAttention", 2, "ScanningOvertAttentionMode", False),
        ("textToSpeech", 1, "WelcomeSpeech", True), ("textToSpeech", 2, "WelcomeSpeech", False))
    scenes = next(search.rounds())
    added = {fault for scene in scenes for fault in scene.planned if fault.node != "a"}
    once = PlannedFault("textToSpeech", 1, "refused")
    assert added == {once, once._replace(is_lasting=True)}
    # else the next round could not extend them
    assert all(scene.is_listed for scene in scenes) and len({*scenes}) == 8


def test_no_play_is_planned_twice(tmp_path):
    search = search_of(tmp_path, WAY_TO_THE_LAST, ("textToSpeech", 1, "WelcomeSpeech", True),
                       ("textToSpeech", 2, "WelcomeSpeech", True),
                       planned=(PlannedFault("textToSpeech", 1, "refused"),))
    planned = [scene for scenes in search.rounds() for scene in scenes]
    row = tuple(PlannedFault("textToSpeech", call, "refused") for call in (1, 2))
    assert len(set(planned)) == len(planned) and row in [scene.planned for scene in planned]


def test_the_nearest_plays_get_a_further_fault_first(tmp_path, monkeypatch):
    monkeypatch.setattr(plays, "MOST_BASES", 2)
    search = search_of(tmp_path, WAY_TO_THE_LAST, ("textToSpeech", 1, "WelcomeSpeech", True))
    bases = [{scene._replace(planned=tuple(fault for fault in scene.planned if fault.node == "a"),
                             is_traced=False) for scene in scenes}
             for scenes, _ in zip(search.rounds(), range(2))]
    first = PlannedFault("a", 1, "crash")
    assert bases == [{Scenario("engages"), Scenario("silent")},
                     {Scenario("engages", planned=(first,)), Scenario("silent", planned=(first,))}]


@pytest.mark.parametrize("condition, habit", [
    ("IsMutualGazeDiscovered", "; a simulated visitor returns the second attempt at a gaze, or "
                               "none"),
    ("IsYesNoUttered", "; a simulated visitor gives each question the same answer, or never one"),
    ("IsASREnabled", "")])
def test_a_node_behind_a_sign_is_told_with_the_habit_of_simulated_visitors(tmp_path, condition,
                                                                          habit):
    nodes = plan(tmp_path, f"<Sequence><{condition}/><WelcomeSpeech/></Sequence>"
                 ).stage.mission.tree.nodes
    (uid, what), = Search(nodes, {1, 2}, [], "refused").unreached()
    assert nodes[uid - 1].name == "WelcomeSpeech"
    assert what == "no visitor and no fault brings the mission here, in 0 simulated runs" + habit


@pytest.mark.parametrize("most, is_cut, told", [
    (7, True, "not reached by 4 simulated runs"), (10, True, "not reached by 4 simulated runs"),
    (11, False, "no visitor and no fault brings the mission here, in 4 simulated runs")])
def test_a_search_that_would_take_too_long_is_cut(tmp_path, monkeypatch, most, is_cut, told):
    monkeypatch.setattr(plays, "MOST_PLAYS", most)
    search = search_of(tmp_path, WAY_TO_THE_LAST, ("textToSpeech", 1, "WelcomeSpeech", True))
    # four plays with a fault once and for good, then rows of 2, 3 and 4 of a visitor who engages
    scenes = [scene for scenes in search.rounds() for scene in scenes]
    assert (len(scenes), search.plays, search.is_cut) == (most, most, is_cut)
    assert [what for _, what in search.unreached()] == [told]


@pytest.mark.parametrize("scene, is_faultless, is_calm, is_listed", [
    (Scenario("engages"), True, True, True), (Scenario("engages", False), True, True, True),
    (Scenario("engages", seed=1), True, False, False),
    (Scenario("engages", rate=0.5, seed=1), False, False, False),
    (Scenario("engages", silent=("/x",)), False, False, True),
    (Scenario("engages", planned=(PlannedFault("a", 1, "crash"),)), False, False, True),
    (Scenario("engages", planned=2 * (PlannedFault("a", 1, "crash"),)), False, False, False),
    (Scenario("engages", planned=2 * (PlannedFault("a", 1, "crash"),), is_traced=True),
     False, False, True)])
def test_which_scenes_have_faults_and_whose_calls_are_listed(scene, is_faultless, is_calm,
                                                             is_listed):
    assert (scene.is_faultless, scene.is_calm, scene.is_listed) == (is_faultless, is_calm,
                                                                    is_listed)


@pytest.mark.parametrize("by_voice", [True, False])
def test_who_answers_on_the_tablet_is_not_heard(tmp_path, by_voice):
    runner = runner_of(tmp_path, '<Sleep msec="5000"/>')
    journal = runner.play(Scenario("engages", by_voice)).played.journal
    assert ("/speechEvent/text" in {line.resource for line in journal}) is by_voice


def test_bursts_are_faults_in_a_row_and_two_services_for_a_visitor_who_engages(tmp_path):
    search = search_of(tmp_path, """<Sequence><ScanningOvertAttentionMode/><WelcomeSpeech/>
        <Fallback><AlwaysSuccess/><EndTourSpeech/></Fallback></Sequence>""",
                       ("overtAttention", 1, "ScanningOvertAttentionMode", True),
                       ("textToSpeech", 1, "WelcomeSpeech", True),
                       ("textToSpeech", 2, "WelcomeSpeech", True), silent=("/x",))
    rows = [tuple(PlannedFault(node, call, "refused") for call in range(1, 1 + length))
            for node in ("overtAttention", "textToSpeech") for length in (2, 3, 4)]
    both = tuple(PlannedFault(node, 1, "refused", True)
                 for node in ("overtAttention", "textToSpeech"))
    made, = search.rounds()
    assert made == [
        Scenario("engages", planned=planned, is_traced=True) for planned in (*rows, both)]


def test_random_scenes_have_the_visitors_in_turn_and_a_seed_for_each_run():
    both = [Scenario("engages"), Scenario("silent", False)]
    first = [Scenario("engages", rate=0.5, seed=7, kinds=("crash",)),
             Scenario("silent", False, rate=0.5, seed=8, kinds=("crash",)),
             Scenario("engages", rate=0.5, seed=9, kinds=("crash",))]
    assert plays.random(both, 3, (0.5, 0.0), 7,
                         ["crash"]) == first + [each._replace(rate=0.0) for each in first]


def test_a_scene_counts_its_faults_and_knows_how_it_goes_without(tmp_path):
    runner = ScenarioRunner(
        {}, mission(tmp_path, "<Sequence><ScanningOvertAttentionMode/><WelcomeSpeech/></Sequence>"),
        900.0)
    calm, faulty = (runner.play(scene) for scene in (
        Scenario("engages"), Scenario("engages", True, TWO[:1], ("/x", "/y"))))
    assert (calm.outcome, calm.faults, calm.calm) == ("SUCCESS", 0, None)
    assert (faulty.outcome, faulty.faults, faulty.calm.outcome) == ("FAILURE", 3, "SUCCESS")
    assert runner.evaluate(Scenario("engages")).switched == ((SetAttention("scanning"), 2),)


@pytest.mark.slow
def test_a_service_that_fails_for_good_fails_at_each_later_call(tmp_path):
    body = '<RetryUntilSuccessful num_attempts="-1"><WelcomeSpeech/></RetryUntilSuccessful>'
    scene = Scenario("engages", planned=(PlannedFault("textToSpeech", 1, "exception", True),))
    play = ScenarioRunner({}, mission(tmp_path, body), 9000.0).play(scene)
    assert play.played.has_timed_out and len(play.exchanges) > 1000 and play.faults >= 1000


@pytest.mark.parametrize("oldest, gap", [(1.0, 0.5), (60.0, 1.0)])
def test_messages_are_never_late(tmp_path, oldest, gap):
    path = mission(tmp_path, '<Sleep msec="5000"/>')
    runner = ScenarioRunner({"topicMaxAge": oldest}, path, 900.0)
    times = [line.time for line in runner.play(Scenario("engages")).played.journal if line.node
             == "faceDetection"]
    assert [later - sooner
            for sooner, later in zip(times, times[1:])] == pytest.approx([gap] * int(5 / gap - 1))


def test_a_pass_without_an_end_says_why(tmp_path):
    for body, silent, ended in (
        ("<ReactiveFallback><IsVisitorDiscovered/><Sleep msec='9999999'/></ReactiveFallback>",
         ("/faceDetection/data", ), plays.NO_VISITOR), ("<Sleep msec='9999999'/>", (), "")):
        assert ScenarioRunner({}, mission(tmp_path, body),
                       10.0).evaluate(Scenario("engages", silent=silent)).outcome == ended


@pytest.mark.parametrize("number, jobs", [(61, 1), (60, 8)])
def test_a_few_plays_start_no_process(number, jobs):
    runner = SimpleNamespace(evaluate=str)  # which another process could not make
    with plays.players(runner, jobs) as play_all:
        assert list(play_all(range(number))) == [str(each) for each in range(number)]


def test_the_share_of_successes_has_wilsons_interval():
    # n = 20, 12 successes: (0.6 + 0.09604 ± 1.96 * sqrt(0.012 + 0.0024010)) / 1.19208
    low, high = Share(0.3, 20, 12, 1.0).interval
    assert low == pytest.approx((0.69604 - 1.96 * math.sqrt(0.014401)) / 1.19208, abs=1e-6)
    assert high == pytest.approx((0.69604 + 1.96 * math.sqrt(0.014401)) / 1.19208, abs=1e-6)
    assert Share(0.0, 10, 10, 1.0).interval[1] == 1.0 and Share(1.0, 10, 0, 1.0).interval[0] == 0.0


def test_a_share_of_the_plot_stands_where_the_axes_say():
    plot = ElementTree.fromstring(html_report.plot([Share(0.4, 10, 8, 1.0),
                                                    Share(1.0, 10, 0, 1.0)]))
    left, top, wide, high = map(float, plot.get("viewBox").split())
    assert (plot.get("width"), plot.get("height")) == ("{:g}".format(wide), "{:g}".format(high))
    labels = {label.text: label for label in plot.findall("text")}
    assert list(labels) == [text for tenth in (0, 2, 4, 6, 8, 10) for text in (
        "{} %".format(tenth * 10), "{:g}".format(tenth / 10))] + ["failure rate"]
    assert all(0 < float(label.get("x")) - left < wide and 0 < float(label.get("y")) - top < high
               for label in labels.values())
    lines = [re.fullmatch(r"M([\d.]+) ([\d.]+)([HV])([\d.]+)", line.get("d")).groups()
             for line in plot.findall("path")]
    (begin, bottom, _, end), (_, height, _, _) = lines[0], lines[5]  # of 0 % and 100 %
    assert [line[1] for line in lines[:6]
            ] == [labels["{} %".format(share)].get("y") for share in (0, 20, 40, 60, 80, 100)]
    assert (begin, end) == (labels["0"].get("x"), labels["1"].get("x"))

    def at(share):
        return pytest.approx(float(bottom) + share * (float(height) - float(bottom)), abs=0.1)

    point, last = plot.findall("circle")
    assert (point.get("cx"), last.get("cx")) == (labels["0.4"].get("x"), labels["1"].get("x"))
    assert (point.get("cy"), last.get("cy")) == (lines[4][1], bottom)
    # by Wilson's formula as above
    assert point.find("title").text == "0.4; 10; 8; 80.0 %; 49.0 to 94.3 %; 1 s"
    assert lines[6][0] == point.get("cx") and lines[6][2] == "V"
    assert [float(lines[6][1]), float(lines[6][3])] == [at(0.490), at(0.943)]
    assert plot.find("polyline").get("points") == "{},{} {},{}".format(
        point.get("cx"), point.get("cy"), last.get("cx"), last.get("cy"))


def test_the_page_tells_the_visitors_the_shares_and_the_findings():
    rows = [VisitorRow("engages", True, "SUCCESS", 119.6, 5, (("SUCCESS", 7), ("", 2))),
            VisitorRow("leaves", False, "", 59.6, 0, ()),
            VisitorRow("silent", False, "FAILURE", 59.4, 0, ())]
    shares = [Share(0.5, 10, 8, 125.0), Share(1.0, 10, 0, None)]
    left_on, not_home = (findings.KIND_BY_NAME[name] for name in ("left-on", "not-home"))
    told = [FindingSummary(left_on, "Say::2", "m.xml:3:4", "<b> is on", 3, Scenario("engages"),
                           80.0, (Sentence(1.25, 1, "said", "info", "said “&”", 0, ""),),
                           "lab_tour --planned 'a b'",
                           (FindingSummary(not_home, "Go::3", "m.xml:5:6", "to <c>"),)),
            FindingSummary(not_home, "M::1", "m.xml:1:2", "far away")]
    parts = re.sub(r"(?s)<style>.*</style>|<svg.*</svg>", "",
                   html_report.to_html("a < b", rows, shares, told))
    parts = re.sub("<[^>]*>", "\n", parts).split("\n")
    assert [html.unescape(part) for part in parts if part] == [
        "a < b", "To the report", "a < b", "Visitors", " ", "Successes", " ", "Findings", " ",
        "Visitors", "visitor", "answers by", "outcome", "after", "stops", "with faults",
        "engages", "voice", "SUCCESS", "2 min 0 s", "5", "7 SUCCESS, 2 without an end", "leaves",
        "tablet", "no end", "1 min 0 s", "0", "-", "silent", "tablet", "FAILURE", "59 s", "0", "-",
        "Successes", "failure rate", "runs", "successes", "share", "95 % interval", "pass takes",
        "0.5", "10", "8", "80.0 %", "49.0 to 94.3 %", "2 min 5 s", "1", "10", "0", "0.0 %",
        "0.0 to 27.8 %", "-", "Findings", "left-on: Say::2", left_on.means, "<b> is on (",
        "m.xml:3:4", ")", "As a consequence, not-home at Go::3 (", "m.xml:5:6", "): to <c>",
        "the shortest of 3 simulated runs", "1.2 s", "said “&”", "Again: ",
        "lab_tour --planned 'a b'", "not-home: M::1", not_home.means, "far away (", "m.xml:1:2", ")"
    ]


@pytest.mark.slow
def test_each_run_can_be_listed_by_its_end_and_played_again(capsys, tmp_path):
    """A speech without a recovery: the pass fails with the speech, and with nothing else."""
    mission, page = tmp_path / "m.xml", tmp_path / "page.html"
    mission.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><START_OF_TREE/><Fallback>'
        '<WelcomeGesture/><HandleFallBack/></Fallback><WelcomeSpeech/></Sequence></BehaviorTree>'
        '</root>', encoding="utf-8")
    _, text = run(capsys, "--json", str(mission))
    runs = json.loads(text)["runs"]
    ends = {end: [each["command"] for each in runs if each["outcome"] == end]
            for end in ("SUCCESS", "FAILURE")}
    assert len(runs) == sum(map(len, ends.values())) and all(
        ("textToSpeech:" in command) is (end == "FAILURE") for end, those in ends.items()
        for command in those if "--planned" in command)
    for end, commands in ends.items():
        _, listed = run(capsys, str(mission), "--list", end.lower(), "--html", str(page))
        assert re.findall(r"again: (.*)", listed)[:len(commands)] == commands
        folded, = re.findall(fr"(?s)<summary>(\d+) {end}</summary>(.*?)</details>",
                             page.read_text(encoding="utf-8"))
        assert int(folded[0]) == len(commands) == folded[1].count("<code>")
        for command in commands[::5]:
            _, again = run(capsys, "--json", *shlex.split(command)[3:])
            assert [each["outcome"] for each in json.loads(again)["runs"]] == [end]
            _, story = run(capsys, *shlex.split(command)[3:])
            assert f": {end} after" in story


def test_a_page_without_visitors_shares_and_findings_has_no_tables():
    page = html_report.to_html("a", [], [], [])
    assert "Nothing was found." in page and "<table" not in page and "<svg" not in page


@pytest.mark.parametrize(
    "words, told",
    [
        ([], "the following arguments are required: MISSION\n"),
        (["lab_tour", "--falts", "none"], "did you mean --faults?"),
        (["lab_tour", "--falts=none"
          ], "unrecognized arguments: --falts=none (did you mean --faults?)"),
        # an abbreviation may mean another option tomorrow
        (["lab_tour", "--fault", "none"], "did you mean --faults?"),
        (["lab_tour", "--xyz"], "unrecognized arguments: --xyz\n"),
        (["lab_tour", "--runs"], "argument --runs: expected one argument\n"),
        (["lab_tour", "--faults", "singel"
          ], "argument --faults: it cannot be singel (did you mean single?)"),
        (["lab_tour", "--faults", ""], "it cannot be empty (allowed: one of none, single, pairs)"),
        (["lab_tour", "--visitors", "engages,leafs"], "did you mean leaves?"),
        (["lab_tour", "--kinds", "crsh"], "did you mean crash?"),
        (["lab_tour", "--runs", "0"], "it cannot be 0 (allowed: a whole number from 1 to 1000000)"),
        (["lab_tour", "--runs", "1.5"], "it cannot be 1.5 (allowed: a whole number from"),
        (["lab_tour", "--failureRate", "0.5, 2", "--runs", "1"
          ], "it cannot be 2 (allowed: a number from 0 to 1)"),
        (["lab_tour", "--failureRate=-0.1", "--runs", "1"], "it cannot be -0.1 (allowed: a "),
        (["lab_tour", "--seed", "0", "--runs", "1"], "it cannot be 0 (allowed: a whole "),
        (["lab_tour", "--limit", "0.5"], "it cannot be 0.5 (allowed: a number from 1"),
        (["lab_tour", "--jobs", "0"], "it cannot be 0 (allowed: a whole number"),
        (["lab_tour", "--jobs", "1025"], "it cannot be 1025 (allowed: a whole"),
        (["lab_tour", "--failureRate", "0.5"], "--failureRate is for --runs"),
        (["lab_tour", "--seed", "1"], "--seed is for --runs"),
        (["lab_tour", "--runs", "2", "--faults", "none"], "--faults and --runs exclude each other"),
        (["lab_tour", "--planned", "x:1", "--silent", "/x", "--runs", "2"
          ], "--planned and --runs exclude each other"),
        (["lab_tour", "--planned", "x:1", "--silent", "/x", "--faults", "none"
          ], "--faults and --silent exclude each other"),
        (["lab_tour", "--kinds", "crash", "--faults", "none"
          ], "--kinds is for --faults and --runs"),
        (["lab_tour", "--kinds", "crash", "--planned", "x:1"
          ], "--kinds is for --faults and --runs"),
        (["lab_tour", "--kinds", "crash", "--silent", "/x"], "--kinds is for --faults and --runs"),
        (["lab_tour", "--planned", "textToSpeech"
          ], "textToSpeech is not of the form node:call:kind"),
        (["lab_tour", "--planned", ":1"], ":1 is not of the form node:call:kind"),
        (["lab_tour", "--planned", "textToSpeech:0"
          ], "textToSpeech:0 is not of the form node:call:kind"),
        (["lab_tour", "--planned", "textToSpeech:-1"
          ], "textToSpeech:-1 is not of the form node:call:kind"),
        (["lab_tour", "--planned", "textToSpeech:1:crsh"
          ], "it cannot be crsh (did you mean crash?)")])
def test_a_wrong_option_is_told_with_what_was_meant(capsys, words, told):
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == exit_codes.WRONG_INPUT and told in capsys.readouterr().err


def test_numbers_are_allowed_up_to_their_bounds():
    many = "--jobs 1024 --seed 1000000000 --runs 1000000 --limit 1000000 --failureRate 0,1"
    few = "--jobs 1 --seed 1 --runs 1 --limit 1"
    assert [vars(cli.read(["m", *words.split()])) for words in (many, few)] == [
        dict(vars(cli.read(["m"])), jobs=jobs, seed=seed, runs=runs, limit=limit, failureRate=rates)
        for jobs, seed, runs, limit, rates in ((1024, 10**9, 10**6, 1e6, [0.0, 1.0]),
                                               (1, 1, 1, 1.0, None))]
    assert cli.read(["m"]).jobs == len(os.sched_getaffinity(0))


@pytest.mark.slow
def test_a_planned_fault_that_no_call_meets_is_reported(capsys):
    planned = "knowledgeBase:1:refused,robotNavigation:99:crash"
    cli.main(["lab_tour", "--visitors", "engages", "--planned", planned, "--jobs", "1"])
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if "in vain" in line] == [
        "planned in vain: robotNavigation:99:crash, since no play makes that call"]


def test_a_fault_that_the_first_of_two_visitors_meets_is_not_planned_in_vain(capsys, tmp_path):
    planned = "textToSpeech:1:refused,textToSpeech:5:refused"
    _, text = run(capsys, mission(tmp_path, meeting(SPEECH)), "asrEnabled:=true", *ENGAGES,
                  "--planned", planned, "--then", "silent", "--json")
    assert json.loads(text)["planned_in_vain"] == ["textToSpeech:5:refused"]


def test_a_share_without_a_pass_that_ended_has_no_seconds_in_json(capsys, tmp_path):
    _, text = run(capsys, mission(tmp_path, "<Sleep msec='90000'/>"), "--limit", "10", "--json",
                  "--runs", "1", "--failureRate", "0.5")
    assert [share["seconds"] for share in json.loads(text)["shares"]] == [None]


@pytest.mark.parametrize("words, told", [
    (["lab_tuor"], " lab_tour?"),
    (["no/such/file.xml"], "no/such/file.xml"),
    (["lab_tour", "asrEnabeld:=true"], " asrEnabled?"),
    (["lab_tour", "asrEnabeld:=true"
      ], "argument asrEnabeld:=true: unknown (did you mean asrEnabled?)"),
    (["lab_tour", "asrEnabled:=perhaps"], '"perhaps"'),
    (["lab_tour", "--planned", "textToSpeach:1"], " textToSpeech?"),
    (["lab_tour", "lnguage:=English", "asrEnabled"
      ], "argument asrEnabled: this is not of the form name:=value ("),
    (["lab_tour", "seed:=3"], "argument seed:=3: unknown ("),
    (["lab_tour", "xyz"], "(config/behaviorControllerConfiguration.ini lists all)"),
    (["lab_tour", "--planned", "x:1"
      ], "argument --planned: the robot D5.4.3 has no node x (there are: "),
    (["lab_tour", "--quick", "robotLocalization"
      ], "argument --quick: the robot D5.4.3 has no node robotLocalization ("),
    (["lab_tour", "--silent", "/faces"], "/faceDetection/data"),
    (["lab_tour", "--silent", "/x"
      ], "argument --silent: the robot D5.4.3 has no topic /x (there are: ")])
def test_what_cannot_be_played_is_told(capsys, words, told):
    code, text = run(capsys, *words)
    assert code == exit_codes.WRONG_INPUT and told in text and "Traceback" not in text


UNREACHED = "<Fallback><AlwaysSuccess/><WelcomeSpeech/></Fallback>"
SPEECH = "<Fallback><WelcomeSpeech/><AlwaysSuccess/></Fallback>"
TWO_SPEECHES = "<Sequence><WelcomeSpeech/><EndTourSpeech/></Sequence>"
MEETS = "<Fallback><IsVisitorDiscovered/><AlwaysSuccess/></Fallback>"


def meeting(body):
    """Return a mission that also looks for a visitor: else each kind of visitor is the same."""
    return "<Sequence>{}{}</Sequence>".format(MEETS, body)


def mission(folder, body):
    """Write a mission and return its path, which does not look like one."""
    path = folder / "mission"
    path.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'.format(body))
    return str(path)


def runner_of(folder, body=SPEECH, **chosen):
    return ScenarioRunner(chosen, mission(folder, body), 900.0)


def survey_of(folder, body=SPEECH, outcomes=()):
    """Return the survey of a mission, with these outcomes."""
    survey = Survey(runner_of(folder, body), True, ())
    for each in outcomes:
        survey.take(each)
    return survey


def plan(folder, body, *words):
    return cli.Plan(cli.read([mission(folder, body), *words]))


def first_round(todo):
    return next(todo.rounds(None, None))


@pytest.mark.parametrize("words, number, is_complete", [
    # six visitors by voice and by tablet
    ([], 12, True), (["--faults", "single", "--limit", "3600"], 12, True),
    (["--faults", "pairs"], 12, True), (["--visitors", ",".join(BEHAVIOURS)], 12, True),
    (["--limit", "3599"], 12, False), (["--faults", "none"], 12, False),
    (["asrEnabled:=true"], 6, False), (["--kinds", "crash"], 12, False),
    (["--visitors", "engages, partial03"], 4, False),
    (["--silent", "/faceDetection/data"], 12, False),
    (["--planned", "textToSpeech:1", "--silent", "/faceDetection/data"], 12, False),
    # of a visitor who engages, at each of eight failure rates
    (["--runs", "2"], 2 * 8, False),
    (["--runs", "3", "--failureRate", "0, 1", "--seed", "5"], 3 * 2, False)])
def test_what_is_played_first_and_whether_it_is_all(tmp_path, words, number, is_complete):
    todo = plan(tmp_path, meeting(UNREACHED), *words)
    scenes = first_round(todo)
    assert (len(scenes), todo.is_complete) == (number, is_complete)
    assert {scene.by_voice
            for scene in scenes} == ({True} if "asrEnabled:=true" in words else {True, False})


def test_the_topics_of_the_robot_are_not_silent(tmp_path):
    todo = plan(tmp_path, "<IsVisitorDiscovered/>")
    assert todo.silent == [] and "/faceDetection/data" in todo.topics


@pytest.mark.slow
@pytest.mark.parametrize("words, number", [
    # by tablet the call is the same; three topics may be silent; then another visitor each way
    (["--visitors", "engages"], 2 + (5 + 1) + 2 * 3 + 2),
    (["--visitors", "engages", "--kinds", "crash, refused"], 2 + (2 + 1) + 2 * 3 + 2),
    # then all faults by tablet too, and no call comes after the only one
    (["--visitors", "engages", "--kinds", "crash", "--faults", "pairs"],
     2 + 2 * (1 + 1) + 2 * 3 + 2),
    (["--visitors", "engages", "--faults", "none"], 2 + 2),
    (["--visitors", "engages", "--faults", "none", "asrEnabled:=true"], 1)])
def test_how_many_plays_there_are(tmp_path, words, number):
    result = cli.rehearse(plan(tmp_path, meeting(SPEECH), *words), jobs=1)
    assert (result.plays, result.planned) == (number, number)


@pytest.mark.parametrize("body, visitors, ways", [
    (SPEECH, 1, 1), ("<Sequence><LookUpHome/><Navigate/></Sequence>", 1, 1),
    ("<Fallback><IsASREnabled/><WelcomeSpeech/></Fallback>", 1, 2),
    ("<IsVisitorDiscovered/>", 6, 2), ("<PressYesNoDialogue/>", 6, 2),
    ("<Sequence><WelcomeSpeech/><Fallback><IsYesNoUttered/><AlwaysSuccess/></Fallback></Sequence>",
     6, 2)])
def test_a_robot_without_visitors_is_rehearsed_once(tmp_path, body, visitors, ways):
    todo = plan(tmp_path, body)
    scenes = first_round(todo)
    assert (len({scene.visitor for scene in scenes}), len({scene.by_voice for scene in scenes}),
            len(scenes), todo.is_complete) == (visitors, ways, visitors * ways, True)
    assert len(first_round(plan(tmp_path, body, "--visitors", "silent,leaves"))) == 2 * ways


def test_a_mission_without_visitors_that_always_fails_never_succeeds(capsys, tmp_path):
    code, text = run(capsys, mission(tmp_path, "<Sequence><WelcomeSpeech/><AlwaysFailure/>"
                                               "</Sequence>"), "--faults", "none")
    assert code == exit_codes.FINDINGS and "each of 1 pass fails" in text
    assert "pass 1: FAILURE" in text  # the story of the only play


def test_the_only_play_is_told(capsys, tmp_path):
    path = mission(tmp_path, "<Fallback><WelcomeSpeech/><EndTourSpeech/></Fallback>")
    words = [path, "language:=Kinyarwanda", "asrEnabled:=true", "--faults", "none"]
    assert cli.Plan(cli.read(words)).chosen == [path, "language:=Kinyarwanda"]
    code, text = run(capsys, *words, "--visitors", "engages")
    lines = text.splitlines()
    assert re.fullmatch(r"mission, robot D5.4.3: 1 simulated run in \d\.\d s", lines[0])
    assert [line.split() for line in lines[1:4]
            ] == [[], "visitor answers by outcome after stops with faults".split(),
                  "engages voice SUCCESS 4 s 0 -".split()]
    assert lines[5].startswith("    0.0 s  ") and lines[-2:] == ["", "nothing was found"]
    assert "0.0 s  " not in run(capsys, *words, "--visitors", "engages,silent")[1]


SAID = Sentence(0.5, 1, "said", "info", "the robot says hello", 0, "")
TWO = (PlannedFault("textToSpeech", 1, "crash"), PlannedFault("textToSpeech", 2, "crash"))
FINDINGS = [
    FindingSummary(findings.KIND_BY_NAME["busy-loop"], "Loop", "m.xml:3:5",
                   "it is ticked again and again", 12, Scenario("engages", True, TWO, ("/faces",)),
                   4.0, (SAID, structs.replace(SAID, at=61.04, text="it waits")), "again 1"),
    FindingSummary(findings.KIND_BY_NAME["busy-loop"], "M", "m.xml:1:1", "and again", 1,
                   Scenario("silent", False, rate=0.5, seed=7), 4.0, (SAID,), "again 2"),
    FindingSummary(findings.KIND_BY_NAME["not-home"], "M", "m.xml:1:1", "the last drive", 1,
                   Scenario("silent"), 4.0, (SAID,), "again 3",
                   (FindingSummary(findings.KIND_BY_NAME["left-on"], "Nod", "m.xml:6:7", "on"),)),
    FindingSummary(findings.UNREACHED, "Nap", "m.xml:4:5", "not reached by 7 simulated runs")]
TOLD = """
mission, robot D5.4.3: 7 simulated runs in 1.5 s, stopped before the other 5

visitor  answers by  outcome  after      stops  with faults
engages  voice       SUCCESS  1 min 5 s  5      1 without an end, 3 SUCCESS
silent   tablet      no end   9 s        0      -

failure rate  runs  successes  share   95 % interval  pass takes
0.5           4     1          25.0 %  4.6 to 69.9 %  59 s

busy-loop: The mission never waits: it takes a whole core, and nothing else of the robot gets a turn. Put a Sleep or a
  Delay into the loop.
  Loop (m.xml:3:5): it is ticked again and again
    in 12 simulated runs, the shortest: visitor engages, by voice, textToSpeech:1:crash, textToSpeech:2:crash, /faces silent
          0.5 s  the robot says hello
         61.0 s  it waits
    again: again 1
  M (m.xml:1:1): and again
    in 1 simulated run, the shortest: visitor silent, by tablet, failure rate 0.5, seed 7
    again: again 2

not-home: The last drive of a pass does not lead home.
  M (m.xml:1:1): the last drive
    as a consequence, left-on at Nod (m.xml:6:7): on
    in 1 simulated run, the shortest: visitor silent, by voice, no fault
          0.5 s  the robot says hello
    again: again 3

unreached: No play brings the mission to this node.
  Nap (m.xml:4:5): not reached by 7 simulated runs

found: 4 findings of 3 kinds"""


@pytest.fixture(name="result")
def made_result(tmp_path):
    """A result with all that can be in it."""
    todo = plan(tmp_path, SPEECH, "--faults", "none")
    rows = [VisitorRow("engages", True, "SUCCESS", 65.0, 5, (("", 1), ("SUCCESS", 3))),
            VisitorRow("silent", False, "", 9.0, 0, ())]
    return cli.Result(todo, rows, [Share(0.5, 4, 1, 59.0)], FINDINGS, 7, 12, 1.5, ("one line",))


def test_a_result_is_told_as_text(result):
    # Wilson's interval of 1 in 4: (0.25 + 0.4802 ± 1.96 * sqrt(0.046875 + 0.060025)) / 1.9604
    assert "\n" + cli.as_text(result) == TOLD
    assert cli.as_text(
        result._replace(findings=FINDINGS[2:3])).endswith("\n\nfound: 1 finding of 1 kind")
    calm = result._replace(rows=[], shares=[], findings=[], plays=12)
    assert cli.as_text(
        calm
    ) == "mission, robot D5.4.3: 12 simulated runs in 1.5 s\n\none line\n\nnothing was found"
    assert cli.as_text(calm._replace(
        story=())) == "mission, robot D5.4.3: 12 simulated runs in 1.5 s\n\nnothing was found"


def test_a_result_is_data_for_other_programs(result):
    told = json.loads(json.dumps(cli.as_json(result)))
    assert (os.path.basename(told["mission"]), told["plays"], told["planned_plays"]) == ("mission",
                                                                                         7, 12)
    assert [(row["visitor"], row["with_faults"]) for row in told["visitors"]] == [
        ("engages", {"": 1, "SUCCESS": 3}), ("silent", {})]
    assert [(share["rate"], share["share"]) for share in told["shares"]] == [(0.5, 0.25)]
    first, last = told["found"][0], told["found"][-1]
    assert (first["kind"], first["place"], first["plays"]) == ("busy-loop", "m.xml:3:5", 12)
    assert first["scene"]["planned"] == ["textToSpeech:1:crash", "textToSpeech:2:crash"]
    assert [sentence["text"] for sentence in first["story"]] == ["the robot says hello", "it waits"]
    assert (last["kind"], last["scene"], last["story"]) == ("unreached", None, [])


def test_the_rows_count_the_plays_of_a_visitor(tmp_path):
    survey = survey_of(tmp_path)
    for each in [
            outcome(Scenario("engages"), "SUCCESS", 60.0, 5),
            outcome(Scenario("engages", False), "SUCCESS", 70.0, 4),
            outcome(Scenario("silent"), "", 900.0),
            outcome(Scenario("engages", silent=("/x", )), "", 900.0),
            outcome(Scenario("engages", planned=TWO), "FAILURE", 5.0),
            outcome(Scenario("engages", planned=TWO[:1]), "SUCCESS", 5.0),
            outcome(Scenario("engages", False, TWO), "FAILURE", 5.0),
            outcome(Scenario("silent", True, TWO), "SUCCESS", 5.0)]:
        survey.take(each)
    assert len(survey.outcomes) == 8 and survey.shares() == []
    assert survey.rows() == [
        VisitorRow("engages", True, "SUCCESS", 60.0, 5, (("", 1), ("FAILURE", 1), ("SUCCESS", 1))),
        VisitorRow("engages", False, "SUCCESS", 70.0, 4, (("FAILURE", 1), )),
        VisitorRow("silent", True, "", 900.0, 0, (("SUCCESS", 1), ))]


def test_a_share_is_counted_for_each_failure_rate(tmp_path):
    survey = survey_of(tmp_path)
    drawn = [Scenario("engages", rate=rate, seed=seed) for rate in (0.5, 0.0) for seed in (1, 2, 3)]
    for scene, ended, seconds in zip(drawn, ("SUCCESS", "FAILURE", "", "", "", ""),
                                     (10.0, 20.0, 900.0) + 3 * (900.0, )):
        survey.take(outcome(scene, ended, seconds))
    none, half = survey.shares()
    assert half == Share(0.5, 3, 1, 15.0) and none == Share(0.0, 3, 0, None)


@pytest.mark.parametrize("scene, words", [
    (Scenario("engages"), "--visitors engages --faults none asrEnabled:=true"),
    (Scenario("silent", False, TWO, ("/speechEvent/text", "/faceDetection/data")),
     "--visitors silent --planned textToSpeech:1:crash,textToSpeech:2:crash --silent "
     "/speechEvent/text,/faceDetection/data asrEnabled:=false"),
    (Scenario("silent", planned=(TWO[0], TWO[1]._replace(is_lasting=True))),
     "--visitors silent --planned textToSpeech:1:crash,textToSpeech:2+:crash asrEnabled:=true"),
    (Scenario("engages", rate=0.25, seed=7),
     "--visitors engages --runs 1 --failureRate 0.25 --seed 7 asrEnabled:=true"),
    (Scenario("engages", rate=0.25, seed=7, kinds=("crash", "wrong")),
     "--visitors engages --runs 1 --failureRate 0.25 --seed 7 --kinds crash,wrong "
     "asrEnabled:=true")])
def test_a_command_plays_its_scene_again(tmp_path, scene, words):
    path = mission(tmp_path, SPEECH)
    survey = Survey(ScenarioRunner({}, path, 900.0), True, [path, "language:=a b"])
    assert survey.command(
        scene) == "rosrun cssr_system rehearseMission {} 'language:=a b' {}".format(path, words)
    assert [each._replace(is_traced=False)
            for each in first_round(cli.Plan(cli.read([path] + words.split())))] == [scene]


def test_the_commands_of_runs_have_their_limit_their_exact_rate_and_seeds_in_range(tmp_path):
    todo = plan(tmp_path, SPEECH, "--limit", "10.25", "--runs", "2", "--seed", str(SEEDS),
                "--failureRate", "0.123456789", "asrEnabled:=true")
    scenes = first_round(todo)
    survey = Survey(todo.runner, True, todo.chosen)
    again = [cli.Plan(cli.read(shlex.split(survey.command(scene))[3:])) for scene in scenes]
    assert [scene.seed for scene in scenes] == [SEEDS, 1]
    assert [(each.runner.limit, first_round(each)) for each in again] == [
        (10.25, [scene]) for scene in scenes]


@pytest.mark.parametrize("words, scene", [
    (["--planned", "textToSpeech:3"],
     Scenario("engages", planned=(PlannedFault("textToSpeech", 3, "refused"),))),
    (["--runs", "1", "--failureRate", "0.5"], Scenario("engages", rate=0.5, seed=1))])
def test_a_call_is_refused_and_a_seed_is_1_if_not_told_otherwise(tmp_path, words, scene):
    words = [mission(tmp_path, SPEECH), "--visitors", "engages", "asrEnabled:=true"] + words
    assert [each._replace(is_traced=False)
            for each in first_round(cli.Plan(cli.read(words)))] == [scene]


def test_what_is_found_comes_in_the_order_of_the_kinds_and_then_of_the_time(tmp_path):
    survey = survey_of(tmp_path, UNREACHED)
    later, sooner, other = (Finding("left-on", uid, "x") for uid in (3, 2, 1))
    survey.take(outcome(Scenario("silent"), "SUCCESS", 4.0, 0, later, sooner,
                        Finding("left-out", 1, "y"), reached=[1, 2]))
    survey.take(outcome(Scenario("engages"), "SUCCESS", 3.0, 0, other, reached=[1, 2]))
    told = survey.findings()
    assert [(each.kind.name, each.where) for each in told] == [
        ("left-out", "Fallback::1"), ("left-on", "Fallback::1"), ("left-on", "AlwaysSuccess::2"),
        ("left-on", "WelcomeSpeech::3")]
    assert [each.place.partition(":")[2] for each in told] == ["1:45", "1:45", "1:55", "1:71"]
    assert told[1].story[0].at == pytest.approx(0.0,
                                                abs=0.01) and told[1].command.startswith("rosrun ")


def test_what_only_all_plays_show_is_told_once_all_are_played(tmp_path):
    survey = survey_of(tmp_path, UNREACHED)
    search = Search(survey.nodes, survey.reached, survey.outcomes, "refused")
    survey.take(outcome(Scenario("silent"), "SUCCESS", 4.0, reached=[1, 2]))
    assert survey.findings() == []
    told, = survey.findings(search)
    assert told == FindingSummary(findings.UNREACHED, "WelcomeSpeech::3", told.place,
                                  "no visitor and no fault brings the mission here, in "
                                  "1 simulated run", 0, None, 0.0, (), "", ())
    survey.take(outcome(Scenario("leaves"), "", 900.0))
    assert survey.findings(search) == [], "what is behind a pass that does not end is not known"


VOICE, TABLET, QUIET = Scenario("engages"), Scenario("engages", False), Scenario("silent")
FAULTY = VOICE.with_fault(PlannedFault("textToSpeech", 1, "refused"))
CAUSE, HERE_TOO, THERE = (Finding("missing-data", 2, "x"), Finding("left-on", 2, "y"),
                          Finding("left-on", 3, "z"))


@pytest.mark.parametrize("plays_with, unreached, expected", [
    # at the same place, whatever the play
    ([(VOICE, 1, CAUSE), (QUIET, 1, HERE_TOO)], [], {"missing-data": ["left-on"]}),
    ([(VOICE, 1, CAUSE), (QUIET, 1, THERE)], [], {"missing-data": [], "left-on": []}),
    ([(VOICE, 1, CAUSE, THERE)], [], {"missing-data": ["left-on"]}),
    ([(VOICE, 1, CAUSE, THERE), (QUIET, 1, THERE)], [], {"missing-data": [], "left-on": []}),
    # a cause stands before its consequence in the list of kinds, and left-on is none
    ([(VOICE, 1, HERE_TOO, Finding("not-home", 3, "x"))], [], {"left-on": [], "not-home": []}),
    # what all plays together show may follow from what each calm play of an engaged visitor has
    ([(VOICE, 1, CAUSE), (TABLET, 1, CAUSE), (FAULTY, 1), (QUIET, 1)], [3],
     {"missing-data": ["unreached"]}),
    ([(VOICE, 1, CAUSE), (TABLET, 1)], [3], {"missing-data": [], "unreached": []}),
    ([(FAULTY, 1, CAUSE), (QUIET, 1, CAUSE), (VOICE, 1)], [3],
     {"missing-data": [], "unreached": []}),
    ([(QUIET, 1, CAUSE)], [3], {"missing-data": [], "unreached": []}),
    # a stop that is reached one way only may follow from what one of the ways has
    ([(VOICE, 1), (TABLET, 0, CAUSE)], [], {"missing-data": ["one-way-only"]}),
    ([(VOICE, 1), (TABLET, 0), (QUIET, 0, CAUSE)], [], {"missing-data": [], "one-way-only": []}),
    # and brings nothing about
    ([(VOICE, 1), (TABLET, 0), (QUIET, 1, THERE)], [], {"one-way-only": [], "left-on": []}),
    # what is known of a place is enough, and of two causes the first
    ([(VOICE, 1, THERE)], [3], {"left-on": []}),
    ([(VOICE, 1, Finding("exception", 1, "e"), CAUSE, THERE)], [],
     {"exception": ["missing-data", "left-on"]})])
def test_what_follows_from_what(tmp_path, plays_with, unreached, expected):
    survey = survey_of(tmp_path, TWO_SPEECHES)
    for scene, stops, *found in plays_with:
        survey.take(outcome(scene, "SUCCESS", 4.0, stops, *found))
    search = SimpleNamespace(unreached=lambda: [(uid, "not reached") for uid in unreached])
    assert consequences(survey.findings(search)) == list(expected.items())


@pytest.mark.parametrize("voice, tablet, release, expected", [
    (3, 1, {}, "by tablet the robot does not come to stop 1, stop 2"),
    (1, 2, {}, "by voice the robot does not come to stop 1"), (2, 2, {}, None),
    # a tablet of release 1.0 does not tell what was pressed
    (3, 1, {"robotInterface": "release-1.0", "tabletSuccessIs": "press"}, None)])
def test_a_stop_that_is_reached_one_way_only_is_told_with_the_other_way(tmp_path, voice, tablet,
                                                                        release, expected):
    survey = Survey(ScenarioRunner(release, mission(tmp_path, TWO_SPEECHES), 900.0), True, ())
    for scene, stops in ((VOICE, voice), (TABLET, tablet), (QUIET, 5)):
        survey.take(outcome(scene, "SUCCESS", 4.0, stops))
    assert [(each.kind, each.what) for each in survey.findings()] == (
        [] if expected is None else [(findings.ONE_WAY, expected)])


def consequences(told):
    return [(each.kind.name, [other.kind.name for other in each.consequences]) for each in told]


@pytest.mark.parametrize("ended, reached, found, expected", [
    ("FAILURE", [], [THERE], [("never-succeeds", ["left-on"])]),
    ("FAILURE", [], [THERE._replace(uid=1)], [("never-succeeds", ["left-on"])]),
    ("SUCCESS", [2, 3], [], [("never-true", []), ("never-true", [])]),
    ("SUCCESS", [2], [THERE], [("never-true", ["left-on"])])])
def test_what_never_comes_to_its_end_brings_about_all_else_but_its_like(tmp_path, ended, reached,
                                                                        found, expected):
    survey = survey_of(tmp_path, TWO_SPEECHES)
    for visitor in BEHAVIOURS:
        survey.take(outcome(Scenario(visitor), ended, 4.0, 0, reached=reached))
    survey.take(outcome(FAULTY, ended, 4.0, 0, *found))
    told = survey.findings(SimpleNamespace(unreached=lambda: ()))
    assert consequences(told) == expected


@pytest.mark.parametrize("seed, outcomes, told", [
    (0, dict.fromkeys(BEHAVIOURS, "FAILURE"), ["each of 6 passes fails"]),
    (0, dict.fromkeys(BEHAVIOURS[1:], "FAILURE"), []),
    (0, dict(dict.fromkeys(BEHAVIOURS, "FAILURE"), silent="SUCCESS"), []),
    (0, dict(dict.fromkeys(BEHAVIOURS, "FAILURE"), silent=plays.NO_VISITOR), []),
    (0, dict(dict.fromkeys(BEHAVIOURS, "FAILURE"), silent=""), []),
    (1, {"engages": "FAILURE"}, ["each of 1 pass fails"]), (1, {"silent": "FAILURE"}, []),
    (0, {"engages": "FAILURE"}, [])])
def test_a_mission_never_succeeds_if_no_visitor_brings_it_to_success(tmp_path, seed, outcomes,
                                                                     told):
    survey = survey_of(tmp_path, meeting(TWO_SPEECHES))
    for visitor, ended in outcomes.items():
        survey.take(outcome(Scenario(visitor, seed=seed), ended, 4.0))
    survey.take(outcome(Scenario("engages", rate=0.5, seed=1), "SUCCESS", 4.0))
    assert [(each.kind, each.what) for each in survey.findings()] == [
        (findings.NEVER_SUCCEEDS, what) for what in told]


def test_a_long_story_is_cut_in_its_middle():
    story = [structs.replace(SAID, at=float(number), text=str(number)) for number in range(490)]
    told = shortened(story)
    assert [told[place].text for place in (0, 19, 21, -1)] == ["0", "19", "470", "489"]
    assert "450 sentences" in told[20].text and len(told) == 41
    assert shortened(story[:40]) == tuple(story[:40])


@pytest.mark.parametrize("shorter, longer", [
    (Scenario("noGaze"), Scenario("engages", silent=("/x",))),
    (Scenario("noGaze", planned=TWO, silent=("/x",)), Scenario("engages", rate=0.5, seed=1)),
    (Scenario("engages"), Scenario("silent")), (Scenario("silent"), Scenario("silent", False)),
    (Scenario("noGaze", planned=TWO[:1]),
     Scenario("engages", planned=(TWO[0]._replace(is_lasting=True),))),
    (Scenario("engages", planned=(PlannedFault("a", 9, "refused"),)),
     Scenario("engages", planned=(PlannedFault("a", 1, "crash"),)))])
@pytest.mark.parametrize("turn", [1, -1])
def test_of_two_plays_the_shorter_is_told(tmp_path, shorter, longer, turn):
    survey = survey_of(tmp_path)
    for scene in (shorter, longer)[::turn]:
        survey.take(outcome(
            scene, "SUCCESS", 5.0 + 0.1 * (scene is shorter), 0, Finding("not-home", 1, "x")))
    assert survey.findings()[0].scene == shorter


class Terminal(io.StringIO):
    """A terminal on which Ctrl-C may be pressed; it shows what is flushed."""

    shown, pressed_at = "", ""

    def isatty(self):
        return True

    def flush(self):
        self.shown = self.getvalue()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self.pressed_at and self.shown.endswith(self.pressed_at):
            raise KeyboardInterrupt


@pytest.mark.parametrize("pressed_at, code, told", [("", 0, "4 simulated runs in"),
                                                    ("left\x1b[K", 1, "1 simulated run in")])
def test_the_bar_grows_with_the_plays_until_ctrl_c(capsys, monkeypatch, tmp_path, pressed_at, code,
                                                   told):
    terminal = Terminal()
    terminal.pressed_at = pressed_at
    monkeypatch.setattr(sys, "stderr", terminal)
    returned, text = run(capsys, mission(tmp_path, meeting(SPEECH)), "--faults", "none", *ENGAGES)
    shown = re.sub(r", \d+ s left", ", N s left", terminal.shown)
    half = "\r[{}{}] 1 of 2 simulated runs, N s left\x1b[K".format("#" * 15, "." * 15)
    whole = "\r[{}] 2 of 2 simulated runs, N s left\x1b[K".format("#" * 30)
    assert shown == (half if pressed_at else 2 * (half + whole))  # and then the next visitors
    assert terminal.getvalue()[len(terminal.shown):] == "\r\x1b[K"
    assert returned == code and told in text and ("s, stopped before the other 1\n"
                                                  in text) is bool(pressed_at)
    # the result is printed: Ctrl-C may cut it short
    assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL


def test_the_time_left_is_that_of_the_runs_left_at_the_pace_so_far(monkeypatch):
    terminal, times = io.StringIO(), iter([100.0, 110.0, 140.0, 160.0])
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(cli, "time", SimpleNamespace(monotonic=times.__next__))
    assert list(cli.with_progress("abc", of=9)) == list("abc")
    # 10 s, 20 s and 20 s for each of the 8, 7 and 6 others
    assert re.findall(r"simulated runs, (.*?) left", terminal.getvalue()) == [
        "1 min 20 s", "2 min 20 s", "2 min 0 s"]


COMMAND = os.path.join(ROOT, "src", "behavior_controller", "rehearseMission")


def start(*words, complaints):
    """Start the command as a process in its own process group."""
    return subprocess.Popen(
        [sys.executable, COMMAND] + list(words), stdout=subprocess.PIPE, stderr=complaints,
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)), start_new_session=True)


@pytest.mark.slow
def test_several_processes_find_the_same(capsys, tmp_path):
    path = mission(tmp_path, "<Sequence>" + 12 * "<WelcomeSpeech/>" + "</Sequence>") + ".xml"
    os.rename(path[:-len(".xml")], path)
    words = [path, "--json", "--visitors", "engages"]
    process = start(*words, "--jobs", "2", complaints=subprocess.PIPE)
    text, complaints = process.communicate(timeout=120)
    assert (process.returncode, complaints) == (exit_codes.FINDINGS, b"")
    here, there = json.loads(run(capsys, *words)[1]), json.loads(text)
    assert here["found"] == there["found"] and here["plays"] == there["plays"] > plays.FEW


@pytest.mark.slow
def test_a_terminal_shows_the_progress_and_ctrl_c_tells_what_was_found_so_far():
    terminal, far_end = pty.openpty()
    process = start("lab_tour", "--runs", "100000", "--failureRate", "0", "--jobs", "2",
                    complaints=far_end)
    os.close(far_end)
    shown = b""
    while b" of 100000 simulated runs" not in shown:
        assert select.select([terminal], [], [], 120)[0], shown
        shown += os.read(terminal, 1000)
    os.killpg(process.pid, signal.SIGINT)
    text, _ = process.communicate(timeout=60)
    assert process.returncode == exit_codes.UNAVAILABLE
    assert re.search(rb"\d+ simulated runs? in .* stopped before the other \d+", text)
    assert b"Traceback" not in shown + os.read(terminal, 10000) + text
    os.close(terminal)


WITHOUT_ROS = """
import importlib, pkgutil, sys
sys.modules.update(dict.fromkeys({!r}))
from behavior_controller import simulation
for module in pkgutil.walk_packages(simulation.__path__, simulation.__name__ + "."):
    importlib.import_module(module.name)
sys.exit(sys.modules["behavior_controller.simulation.rehearsal.cli"].main(sys.argv[1:]))
"""
ROS = ("actionlib", "cssr_system", "genpy", "rosgraph", "roslib", "rospkg", "rospy", "unit_tests")


@pytest.mark.slow
def test_a_rehearsal_needs_neither_ros_nor_the_test_package():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS.format(ROS), planted("good"), "--visitors", "engages",
         "--faults", "none", "--jobs", "1"], stdout=subprocess.PIPE, encoding="utf-8",
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)),
                 ROS_MASTER_URI="http://localhost:1"))
    assert done.returncode == exit_codes.SUCCESS and "nothing was found" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("cssr_system") is None,
                    reason="needs the workspace's shell")
def test_the_former_place_of_the_command_names_the_new_one():
    done = subprocess.run(["rosrun", "unit_tests", "rehearseMission", "--version"], check=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8")
    assert re.fullmatch(r"rehearseMission \d+\.\d+\.\d+\n", done.stdout)
    assert done.stderr == "rehearseMission has moved: rosrun cssr_system rehearseMission\n"


GREETER = os.path.join(ROOT, "examples", "greeter")
LEAVES, INTERFACE = ("src", "greeter", "leaves.py"), ("src", "greeter", "interface.py")
ALONE = (("data", "greet.xml"), "<HandleFallBack/>", "")
"""A change: a file, what is replaced in it, "" stands for its end, and by what."""

ONCE = ("--faults", "none", "--visitors", "engages")


def greeter(folder, *changes):
    """Return a copy of the package with these changes."""
    copy = folder / "greeter"
    shutil.copytree(GREETER, str(copy), ignore=shutil.ignore_patterns("__pycache__"))
    for parts, old, new in changes:
        path = copy.joinpath(*parts)
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new) if old else text + new)
    return copy


def rehearse_package(folder, *words):
    """Return the exit code and the text of a rehearsal that finds the package in ``folder``."""
    pytest.importorskip("rospkg")
    paths = [os.path.join(str(folder), "src")] + sys.path
    done = subprocess.run([sys.executable, COMMAND, *words], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True,
                          env=dict(os.environ, ROS_PACKAGE_PATH=str(folder), ROS_ROOT="",
                                   PYTHONPATH=os.pathsep.join(paths)))
    return done.returncode, done.stdout


@pytest.mark.slow
def test_the_missions_of_another_package_are_rehearsed_by_their_name():
    code, text = rehearse_package(GREETER, "greet", "--faults", "none")
    assert code == 0 and "greet.xml, robot D5.4.3: 1 simulated run " in text
    code, text = rehearse_package(GREETER, "greet", "--planned", "lights:1:refused", "--visitors",
                                  "engages")
    assert code == exit_codes.SUCCESS and "greet.xml, robot D5.4.3: 1 simulated run " in text


@pytest.mark.slow
@pytest.mark.parametrize("kind, cause", [
    ("exception", "refused, aborted (call 1 of move_base fails on purpose) (/move_base)"),
    ("unanswered", "no answer in time, waited 120 s (/move_base)")])
def test_an_action_of_another_package_fails_in_a_rehearsal_as_a_service_does(tmp_path, kind, cause):
    words = ("greet", "--planned", "move_base:1:" + kind, "--visitors", "engages")
    assert rehearse_package(GREETER, *words)[0] == exit_codes.SUCCESS  # tried again
    code, text = rehearse_package(greeter(tmp_path, ALONE), *words)
    assert code == exit_codes.FINDINGS and "DriveTo failed: " + cause in text


ACCEPT = """    asks = SetLights

    def accept(self, answer):
        raise RuntimeError("the answer was " + answer.response)
"""
ANSWERS = 'as they are", simulated_answer=lambda request: Answer(response=request.colour))'


@pytest.mark.slow
def test_a_package_says_what_its_service_answers_in_a_rehearsal(tmp_path):
    changed = greeter(tmp_path, (LEAVES, "    asks = SetLights\n", ACCEPT),
                      (INTERFACE, "NO_EFFECT, ", "NO_EFFECT, Answer, "),
                      (INTERFACE, 'as they are")', ANSWERS))
    code, text = rehearse_package(changed, "greet", *ONCE)
    assert code == exit_codes.FINDINGS and "exception: " in text and "the answer was blue" in text


@pytest.mark.slow
@pytest.mark.parametrize("fields", ("(request.colour)", "(request.color,)"))
def test_a_service_whose_fields_do_not_fit_is_told_with_both_places(tmp_path, fields):
    changed = greeter(tmp_path, (INTERFACE, "(request.colour,)", fields), ALONE)
    code, text = rehearse_package(changed, "greet", *ONCE)
    assert code == exit_codes.FINDINGS
    assert re.search(r"Lights failed: type mismatch, its declaration: .*greeter/interface\.py:\d+",
                     text), text


@pytest.mark.slow
def test_a_leaf_that_does_not_return_is_an_exception_in_its_code(tmp_path):
    changed = greeter(tmp_path, (LEAVES, '        """Set the colour."""\n',
                                 "        while True:\n            pass\n"))
    code, text = rehearse_package(changed, "greet", *ONCE)
    assert code == exit_codes.FINDINGS
    source = changed.joinpath(*LEAVES).read_text()
    line = source[:source.index("while True")].count("\n") + 1
    places = re.search(r"Lights.*TimeoutError: .*\(greeter/leaves\.py:(\d+)\)", text)
    assert places is not None and int(places.group(1)) in (line, line + 1), text


@pytest.mark.slow
def test_an_alarm_that_was_set_before_a_play_comes_after_it():
    alarm = threading.Event()
    limit = signal.alarm(0)  # of whoever runs the tests
    before = signal.signal(signal.SIGALRM, lambda number, frame: alarm.set())
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        with blocked_leaf.ended():
            assert not alarm.wait(0.02)
        assert alarm.wait(10.0)
        with blocked_leaf.ended():
            pass
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)  # none was set
        signal.setitimer(signal.ITIMER_REAL, 50.0)
        with blocked_leaf.ended():
            pass
        assert 40.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 50.0
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.alarm(limit)


DOOR = """
from behavior_controller.extend import Topic

DOOR = Topic("/door/state", "door", "std_msgs/String", str, lambda message: message.data,
             "the door is not noticed", is_continuous=True{})
TOPICS = (DOOR,)
"""

IS_OPEN = """
from behavior_controller.extend import Evidence, TopicCondition

from greeter.interface import DOOR


class FixtureIsDoorOpen(TopicCondition):
    own_evidence = Evidence(DOOR, lambda state, gaze_value: state == "open")


SPECS += (leaf_spec("FixtureIsDoorOpen", FixtureIsDoorOpen, "Is the door open?"),)
"""

UNTIL_OPEN = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveFallback><FixtureIsDoorOpen/>
    <ForceFailure><Sleep msec="9000"/></ForceFailure></ReactiveFallback></BehaviorTree></root>"""


@pytest.mark.slow
@pytest.mark.parametrize("declared, outcome, is_silent", [
    ("", "FAILURE", True),
    (", simulated_value=lambda seconds: 'open' if seconds > 5 else None", "SUCCESS", False),
    (", simulated_value=lambda seconds: 'closed'", "FAILURE", False)])
def test_a_package_says_what_its_topic_publishes_in_a_rehearsal(tmp_path, declared, outcome,
                                                                is_silent):
    changed = greeter(tmp_path, (INTERFACE, "", DOOR.format(declared)), (LEAVES, "", IS_OPEN))
    (tmp_path / "m.xml").write_text(UNTIL_OPEN)
    _, text = rehearse_package(changed, str(tmp_path / "m.xml"), *ONCE)
    assert "engages  voice       " + outcome in text, text
    assert ("silent: /door/state" in text) is is_silent


@pytest.mark.slow
@pytest.mark.parametrize("declared, told", [
    (", simulated_value=lambda seconds: 'open'", "engages  voice       SUCCESS"),
    (", simulated_value=lambda seconds: 'closed'", "FixtureIsDoorOpen does not hold"),
    ("", "FixtureIsDoorOpen: no message on /door/state yet")])
def test_a_rehearsed_mission_begins_before_the_first_message_of_a_state(tmp_path, declared, told):
    changed = greeter(tmp_path, (INTERFACE, "", DOOR.format(declared)), (LEAVES, "", IS_OPEN))
    (tmp_path / "m.xml").write_text("""<root BTCPP_format="4"><BehaviorTree ID="M">
        <FixtureIsDoorOpen/></BehaviorTree></root>""")
    _, text = rehearse_package(changed, str(tmp_path / "m.xml"), *ONCE)
    assert told in text, text
