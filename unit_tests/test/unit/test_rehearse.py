"""rehearseMission: each planted mistake is found by its name, and nothing in the lab tour."""
import html
import json
import math
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from behavior_controller import exits, folders
from behavior_controller.events import Recovered
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import Say
from behavior_controller.story import Sentence

from unit_tests import findings, rehearse, rehearse_page, scenes, visitor
from unit_tests.faults import KINDS, PlannedFault
from unit_tests.journal import Line
from unit_tests.recoveries import SPECS
from unit_tests.scenes import Outcome, Scene, Theatre
from unit_tests.stage import BUSY, START, Played
from unit_tests.survey import Found, Row, Share, Survey
from unit_tests.visitor import BEHAVIOURS

HERE = os.path.dirname(os.path.abspath(__file__))
ENGAGES, SILENT = ["--visitors", "engages"], ["--visitors", "silent"]
CALM = ["--faults", "none", "--limit", "900"]
PLANTED = [
    ("busy_loop", "busy-loop", CALM + ENGAGES),
    ("endless_retry", "endless", CALM + SILENT),
    ("endless_first_exhibit", "endless", CALM + ENGAGES),
    ("waits_for_ever", "waits-for-ever", CALM),
    ("exception", "exception", CALM),
    ("missing_data", "missing-data", CALM),
    ("budget_spent", "budget-spent", CALM),
    ("left_on", "left-on", CALM),
    ("not_home", "not-home", CALM),
    ("abandoned_drive", "abandoned-drive", CALM),
    ("goodbye_to_nobody", "goodbye-to-nobody", CALM),
    ("left_out", "left-out", CALM),
    ("unrecovered", "unrecovered", ["--kinds", "refused"]),
    ("never_off", "never-off", []),
    ("unreached", "unreached", []),
]


def planted(name):
    return os.path.join(HERE, "planted", name + ".xml")


def run(capsys, *words):
    """Return the exit code and what was printed."""
    code = rehearse.main(list(words) + ["--jobs", "1"])
    return code, capsys.readouterr().out


def found(capsys, *words):
    code, text = run(capsys, "--json", *words)
    told = json.loads(text)["found"]
    assert code == (exits.FOUND if told else 0)
    return told


@pytest.mark.parametrize("name, kind, words", PLANTED)
def test_each_planted_mistake_is_found_by_its_name(capsys, name, kind, words):
    told = found(capsys, planted(name), *words)
    assert {each["kind"] for each in told} == {kind}
    for each in told:
        assert (each["scene"] is None) is (kind in ("never-off", "unreached"))
        assert each["story"] or each["scene"] is None or kind in ("busy-loop", "endless", "waits-for-ever")


@pytest.mark.parametrize("name, line, column, words", [
    ("busy_loop", 13, 9, CALM + ENGAGES), ("waits_for_ever", 31, 9, CALM)])
def test_a_mission_that_does_not_end_is_found_at_the_node_that_runs(capsys, name, line, column, words):
    assert {each["place"].split(".xml:")[1] for each in found(capsys, planted(name), *words)} == {
        "{}:{}".format(line, column)}


def test_each_mistake_is_planted():
    assert {kind for _, kind, _ in PLANTED} == set(findings.BY_NAME) - {"senseless-request"}
    assert {name for name, _, _ in PLANTED} | {"good"} == {name[:-4] for name in os.listdir(os.path.join(HERE, "planted"))}


def test_nothing_is_found_in_the_mission_without_a_mistake(capsys):
    assert found(capsys, planted("good"), "--kinds", "unanswered", "--visitors", "engages,leaves") == []


def test_nothing_is_found_in_the_lab_tour_with_drawn_faults(capsys):
    assert found(capsys, "lab_tour", "--runs", "20", "--failureRate", "0.1") == []


def test_nothing_is_found_in_the_lab_tour_with_single_faults_and_each_node_is_reached():
    theatre = Theatre({}, folders.mission("lab_tour"), rehearse.LIMIT)
    survey = Survey(theatre)
    calm = scenes.calm(BEHAVIOURS, (True, False))
    for scene in calm + list(scenes.single(theatre, calm, ("crash",))):
        survey.take(theatre.look(scene))
    assert survey.found(is_complete=True) == []


def test_a_request_that_makes_no_sense_is_found():
    look = Theatre({}, planted("good"), 900.0).play(Scene("engages"))
    senseless = [line._replace(objection="there is no text") for line in look.played.journal[-1:]]
    found_now = findings.look_at(look._replace(played=look.played._replace(journal=senseless)))
    assert found_now == [("senseless-request", senseless[0].resource, "there is no text")]


def test_the_tour_of_release_1_0_is_rehearsed_too(capsys):
    code, text = run(capsys, "release_1_0_tour", "robotInterface:=release-1.0", "--faults", "none", *ENGAGES)
    assert "robot release-1.0: 2 plays" in text


def test_a_finding_is_told_with_its_place_its_story_and_the_command_that_plays_it_again(capsys):
    path = planted("goodbye_to_nobody")
    code, text = run(capsys, path, *CALM)
    assert code == exits.FOUND == 4
    line = [number for number, line in enumerate(open(path), 1) if "SayGoodByeSpeech" in line][0]
    assert "goodbye-to-nobody: The robot says goodbye although the visitor has left." in text
    assert re.search(r"SayGoodByeSpeech::\d+ \({}:{}:\d+\): the visitor had left \d+ s before".format(path, line), text)
    again = re.search("again: rosrun unit_tests rehearseMission (.*)", text).group(1).split()
    code, text = run(capsys, *again)
    assert code == exits.FOUND and ": 1 play in" in text and "goodbye-to-nobody" in text


def test_the_shortest_play_of_a_finding_has_the_fewest_faults():
    survey = Survey(Theatre({}, planted("good"), 900.0))
    finding = ("not-home", "", "x")
    faulty = Scene("engages", planned=(PlannedFault("textToSpeech", 1, "refused"),))
    for scene, seconds in ((faulty, 5.0), (Scene("leaves"), 90.0), (Scene("engages"), 80.0)):
        survey.take(Outcome(scene, "SUCCESS", seconds, 0, (finding,), frozenset(), frozenset()))
    told, = survey.found(False)
    assert (told.scene, told.plays, told.seconds) == (Scene("engages"), 3, 80.0)


def test_single_faults_are_each_call_in_each_way_and_each_silent_topic():
    theatre = Theatre({}, planted("unrecovered"), 900.0)
    made = list(scenes.single(theatre, [Scene("engages")], KINDS))
    calls = [("overtAttention", 1), ("textToSpeech", 1), ("overtAttention", 2), ("animateBehavior", 1)]
    assert [scene.planned for scene in made[:-3]] == [
        (PlannedFault(node, call, kind),) for node, call in calls for kind in KINDS]
    assert {scene.silent for scene in made[-3:]} == {("/faceDetection/data",), ("/overtAttention/mode",), ("/speechEvent/text",)}


def test_what_the_tablet_does_not_change_is_not_played_again():
    theatre = Theatre({}, planted("unrecovered"), 900.0)
    by_tablet = [scene for scene in scenes.single(theatre, [Scene("engages"), Scene("engages", False)], KINDS)
                 if not scene.by_voice]
    assert len(by_tablet) == 3 and all(scene.silent for scene in by_tablet)


def test_pairs_are_each_two_calls_and_each_call_with_its_repetition():
    theatre = Theatre({}, planted("unrecovered"), 900.0)
    made = list(scenes.pairs(theatre, [Scene("engages")], ("refused",)))
    assert len(set(made)) == len(made) == 6 + 4 - 1  # of four calls, two of which follow each other on one node


def test_the_share_of_successes_has_wilsons_interval():
    # n = 20, 12 successes: (0.6 + 0.09604 ± 1.96 * sqrt(0.012 + 0.0024010)) / 1.19208
    low, high = Share(0.3, 20, 12, 1.0).interval
    assert low == pytest.approx((0.69604 - 1.96 * math.sqrt(0.014401)) / 1.19208, abs=1e-6)
    assert high == pytest.approx((0.69604 + 1.96 * math.sqrt(0.014401)) / 1.19208, abs=1e-6)
    assert Share(0.0, 10, 10, 1.0).interval[1] == 1.0 and Share(1.0, 10, 0, 1.0).interval[0] == 0.0


def test_the_page_stands_alone_and_has_the_plot(capsys, tmp_path):
    path = str(tmp_path / "page.html")
    run(capsys, planted("good"), "--runs", "3", "--failureRate", "0,0.5", "--html", path)
    page = open(path, encoding="utf-8").read()
    assert page.count("<circle") == 2 and "<polyline" in page
    assert "http" not in page and "<script" not in page and "src=" not in page


def test_a_share_of_the_plot_stands_where_the_axes_say():
    plot = ElementTree.fromstring(rehearse_page.plot([Share(0.4, 10, 8, 1.0), Share(1.0, 10, 0, 1.0)]))
    left, top, wide, high = map(float, plot.get("viewBox").split())
    assert (plot.get("width"), plot.get("height")) == ("{:g}".format(wide), "{:g}".format(high))
    labels = {label.text: label for label in plot.findall("text")}
    assert list(labels) == [text for tenth in (0, 2, 4, 6, 8, 10) for text in (
        "{} %".format(tenth * 10), "{:g}".format(tenth / 10))] + ["failure rate"]
    assert all(0 < float(label.get("x")) - left < wide and 0 < float(label.get("y")) - top < high
               for label in labels.values())
    lines = [re.fullmatch(r"M([\d.]+) ([\d.]+)([HV])([\d.]+)", line.get("d")).groups() for line in plot.findall("path")]
    (begin, bottom, _, end), (_, height, _, _) = lines[0], lines[5]  # of 0 % and 100 %
    assert [line[1] for line in lines[:6]] == [labels["{} %".format(share)].get("y") for share in (0, 20, 40, 60, 80, 100)]
    assert (begin, end) == (labels["0"].get("x"), labels["1"].get("x"))

    def at(share):
        return pytest.approx(float(bottom) + share * (float(height) - float(bottom)), abs=0.1)

    point, last = plot.findall("circle")
    assert (point.get("cx"), last.get("cx")) == (labels["0.4"].get("x"), labels["1"].get("x"))
    assert (point.get("cy"), last.get("cy")) == (lines[4][1], bottom)
    assert point.find("title").text == "0.4; 10; 8; 80.0 %; 49.0 to 94.3 %; 1 s"  # by Wilson's formula as above
    assert lines[6][0] == point.get("cx") and lines[6][2] == "V"
    assert [float(lines[6][1]), float(lines[6][3])] == [at(0.490), at(0.943)]
    assert plot.find("polyline").get("points") == "{},{} {},{}".format(
        point.get("cx"), point.get("cy"), last.get("cx"), last.get("cy"))


def test_the_page_tells_the_visitors_the_shares_and_the_findings():
    rows = [Row("engages", True, "SUCCESS", 119.6, 5, (("SUCCESS", 7), ("", 2))), Row("leaves", False, "", 59.6, 0, ()),
            Row("silent", False, "FAILURE", 59.4, 0, ())]
    shares = [Share(0.5, 10, 8, 125.0), Share(1.0, 10, 0, float("nan"))]
    left_on, not_home = (findings.BY_NAME[name] for name in ("left-on", "not-home"))
    told = [Found(left_on, "Say::2", "m.xml:3:4", "<b> is on", 3, Scene("engages"), 80.0,
                  (Sentence(1.25, 1, "said", "info", "said “&”"),), "lab_tour --planned 'a b'"),
            Found(not_home, "", "", "far away", 0, None, 0.0, (), "")]
    parts = re.sub(r"(?s)<style>.*</style>|<svg.*</svg>", "", rehearse_page.to_html("a < b", rows, shares, told))
    parts = re.sub("<[^>]*>", "\n", parts).split("\n")
    assert [html.unescape(part) for part in parts if part] == [
        "a < b", "a < b", "Visitors", "visitor", "answers by", "outcome", "after", "exhibits", "with faults",
        "engages", "voice", "SUCCESS", "2 min 0 s", "5", "7 SUCCESS, 2 without an end",
        "leaves", "tablet", "no end", "1 min 0 s", "0", "-", "silent", "tablet", "FAILURE", "59 s", "0", "-",
        "Share of successes", "failure rate", "runs", "successes", "share", "95 % interval", "pass takes",
        "0.5", "10", "8", "80.0 %", "49.0 to 94.3 %", "2 min 5 s", "1", "10", "0", "0.0 %", "0.0 to 27.8 %", "-",
        "Findings", "left-on: Say::2", left_on.means, "<b> is on (", "m.xml:3:4", ")", "the shortest of 3 plays",
        "1.2 s", "said “&”", "Again: ", "lab_tour --planned 'a b'",
        "not-home: the mission", not_home.means, "far away"]


def test_a_page_without_visitors_shares_and_findings_has_no_tables():
    page = rehearse_page.to_html("a", [], [], [])
    assert "Nothing was found." in page and "<table" not in page and "<svg" not in page


@pytest.mark.parametrize("words, told", [
    (["lab_tour", "--falts", "none"], "did you mean --faults?"),
    (["lab_tour", "--faults", "singel"], "did you mean single?"),
    (["lab_tour", "--visitors", "engages,leafs"], "did you mean leaves?"),
    (["lab_tour", "--kinds", "crsh"], "did you mean crash?"),
    (["lab_tour", "--runs", "0"], "allowed: 1 to"),
    (["lab_tour", "--failureRate", "2", "--runs", "1"], "allowed: 0 to 1"),
    (["lab_tour", "--failureRate", "0.5"], "--failureRate is for --runs"),
    (["lab_tour", "--runs", "2", "--faults", "none"], "exclude each other"),
    (["lab_tour", "--kinds", "crash", "--faults", "none"], "--kinds is for"),
    (["lab_tour", "--planned", "textToSpeech"], "node:call:kind"),
])
def test_a_wrong_option_is_told_with_what_was_meant(capsys, words, told):
    with pytest.raises(SystemExit) as end:
        rehearse.main(words)
    assert end.value.code == exits.WRONG_INPUT and told in capsys.readouterr().err


@pytest.mark.parametrize("words, told", [
    (["lab_tuor"], "did you mean lab_tour?"),
    (["no/such/file.xml"], "no/such/file.xml"),
    (["lab_tour", "asrEnabeld:=true"], "did you mean asrEnabled?"),
    (["lab_tour", "asrEnabeld:=true"], "argument asrEnabeld:=true: this is not a key of the controller's configuration"),
    (["lab_tour", "asrEnabled:=perhaps"], "asrEnabled cannot be"),
    (["lab_tour", "--planned", "textToSpeach:1"], "did you mean textToSpeech?"),
    (["lab_tour", "--planned", "x:1"], "argument --planned: the robot D5.4.3 has no node x (there are: "),
    (["lab_tour", "--silent", "/faces"], "/faceDetection/data"),
    (["lab_tour", "--silent", "/x"], "argument --silent: the robot D5.4.3 has no topic /x (there are: "),
])
def test_what_cannot_be_played_is_told(capsys, words, told):
    code, text = run(capsys, *words)
    assert code == exits.WRONG_INPUT and told in text and "Traceback" not in text


def start(*words, complaints):
    """Start the command as a process in its own process group."""
    command = os.path.join(HERE, "..", "..", "nodes", "rehearseMission")
    return subprocess.Popen([sys.executable, command] + list(words), stdout=subprocess.PIPE, stderr=complaints,
                            env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)), start_new_session=True)


def test_several_processes_find_the_same(capsys):
    words = [planted("goodbye_to_nobody"), "--json", "--kinds", "refused,crash", "--visitors", "leaves"]
    process = start(*words, "--jobs", "2", complaints=subprocess.PIPE)
    text, complaints = process.communicate(timeout=120)
    assert (process.returncode, complaints) == (exits.FOUND, b"")
    here, there = json.loads(run(capsys, *words)[1]), json.loads(text)
    assert here["found"] == there["found"] and here["plays"] == there["plays"] > scenes.FEW


def test_a_terminal_shows_the_progress_and_ctrl_c_tells_what_was_found_so_far():
    terminal, far_end = pty.openpty()
    process = start("lab_tour", "--runs", "100000", "--failureRate", "0", "--jobs", "2", complaints=far_end)
    os.close(far_end)
    shown = b""
    while b" of 100000 plays" not in shown:
        assert select.select([terminal], [], [], 120)[0], shown
        shown += os.read(terminal, 1000)
    os.killpg(process.pid, signal.SIGINT)
    text, _ = process.communicate(timeout=60)
    assert process.returncode == exits.UNAVAILABLE
    assert re.search(rb"\d+ plays? in .* stopped before the other \d+", text)
    assert b"Traceback" not in shown + os.read(terminal, 10000) + text
    os.close(terminal)


GREETER = os.path.join(HERE, "..", "..", "..", "examples", "greeter")


def rehearse_package(folder, *words):
    """Return the exit code and the text of a rehearsal that finds the package in ``folder``."""
    pytest.importorskip("rospkg")
    command = os.path.join(HERE, "..", "..", "nodes", "rehearseMission")
    paths = [os.path.join(str(folder), "src")] + sys.path
    done = subprocess.run([sys.executable, command] + list(words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True, env=dict(os.environ, ROS_PACKAGE_PATH=str(folder), ROS_ROOT="",
                                                            PYTHONPATH=os.pathsep.join(paths)))
    return done.returncode, done.stdout


def test_the_missions_of_another_package_are_rehearsed_by_their_name():
    code, text = rehearse_package(GREETER, "greet", "--faults", "none")
    assert code == 0 and "greet.xml, robot D5.4.3: 12 plays" in text
    code, text = rehearse_package(GREETER, "greet", "--planned", "lights:1:refused", "--visitors", "engages")
    assert code == exits.FOUND and "unrecovered: " in text and "Lights::3" in text


def test_a_package_says_what_its_service_answers_in_a_rehearsal(tmp_path):
    folder = tmp_path / "greeter"
    shutil.copytree(GREETER, str(folder))
    leaves, interface = folder / "src" / "greeter" / "leaves.py", folder / "src" / "greeter" / "interface.py"
    leaves.write_text(leaves.read_text().replace("    asks = SetLights\n", """    asks = SetLights

    def accept(self, answer):
        raise RuntimeError("the answer was " + answer.response)
"""))
    interface.write_text("from behavior_controller.interface.records import Answer\n" + interface.read_text().replace(
        "as they are\")", "as they are\",\n            rehearsed=lambda request: Answer(response=request.colour))"))
    code, text = rehearse_package(folder, "greet", "--faults", "none", "--visitors", "engages")
    assert code == exits.FOUND and "exception: " in text and "the answer was blue" in text


def test_all_visitors_are_played():
    assert [scene.visitor for scene in scenes.calm(BEHAVIOURS, [True])] == list(BEHAVIOURS)


def a_look(nodes, **played):
    """Return a look at a play of 100 s of leaves of these types, that had not ended when its time was up."""
    told = dict(entries=[], journal=[], exit_code=None, cut_off="", error="", reached=frozenset(), waiting=(), seconds=100.0,
                asked=[], presence=[])
    tree = SimpleNamespace(nodes=[SimpleNamespace(spec=SPECS[node]) for node in nodes])
    stage = SimpleNamespace(mission=SimpleNamespace(tree=tree, policy=SimpleNamespace(most=10, seconds=60.0)))
    return findings.Look(stage, Played(**dict(told, **played)), visitor.ENGAGES, 0)


@pytest.mark.parametrize("node, played, waits", [
    ("IsVisitorDiscovered", {}, True), ("IsMutualGazeDiscovered", {}, False),
    ("IsVisitorDiscovered", {"exit_code": 0}, False), ("IsVisitorDiscovered", {"cut_off": BUSY}, False),
    ("IsVisitorDiscovered", {"asked": [(START + 79.0, Say("x"))]}, True),
    ("IsVisitorDiscovered", {"asked": [(START + 81.0, Say("x"))]}, False)])
def test_a_mission_waits_for_a_visitor_that_has_not_ended_and_asks_for_nothing_any_more(node, played, waits):
    assert findings.waits_for_a_visitor(a_look([node], waiting=(1,), **played)) is waits


@pytest.mark.parametrize("own, is_spent", [(0, False), (5, False), (6, True), (11, True)])
def test_a_budget_is_told_as_spent_if_most_of_it_went_where_no_fault_was(own, is_spent):
    resources = ["/calm"] * own + ["/faulty"] * (11 - own)
    recovered = [(START + at, Recovered("Navigate", "x", Failure(Cause.REFUSED, "no", resource), "-", 0, True, "done"))
                 for at, resource in enumerate(resources)]
    faults = [Line(START, "a node", "/faulty", 1, {}, fault="refused")]
    found = list(findings.BY_NAME["budget-spent"].see(a_look([], entries=recovered, journal=faults)))
    assert found == is_spent * [("x", "more than 10 recoveries in 60 s: whatever fails from here on is given up")]
