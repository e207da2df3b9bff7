"""The example of a receptionist: its mission is sound, and hears names by voice and on the tablet.
"""
import os
import re
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

pytest.importorskip("rospkg")
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLE = os.path.join(ROOT, "examples", "receptionist")
BY_VOICE, BY_TABLET = "asrEnabled:=true", "asrEnabled:=false"


def run(tool, *words, folder=EXAMPLE):
    """Return the exit code and the text of a tool that finds the package in ``folder``."""
    paths = [os.path.join(str(folder), "src")] + sys.path
    done = subprocess.run(
        [sys.executable, os.path.join(ROOT, "src", "behavior_controller", tool), *words],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
        env=dict(os.environ, ROS_PACKAGE_PATH=os.pathsep.join([str(folder), ROOT]), ROS_ROOT="",
                 PYTHONPATH=os.pathsep.join(paths)))
    return done.returncode, done.stdout


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(EXAMPLE, str(tmp_path / "receptionist"),
                    ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "receptionist"


@pytest.mark.parametrize("robot", ["D5.4.3", "release-1.0"])
def test_it_is_valid(robot):
    code, text = run("validateMission", "--interface", robot, "receptionist")
    assert code == 0 and re.search(r"can be run, \d+ nodes, 0 warnings", text), text


@pytest.mark.parametrize("words", [
    ["--kinds", "refused", "--visitors", "engages"], pytest.param([], marks=pytest.mark.long)],
    ids=["a visitor", "all"])
def test_a_rehearsal_with_every_fault_finds_nothing(words):
    code, text = run("rehearseMission", "receptionist", *words)
    assert code == 0 and "nothing was found" in text, text


OUTCOMES = {"engages": "SUCCESS", "declines": "SUCCESS", "silent": "SUCCESS", "unclear": "SUCCESS",
            "noGaze": "FAILURE", "leaves": "SUCCESS"}


def test_each_visitor_of_a_robot_of_release_1_0_gets_the_right_visit():
    code, text = run("rehearseMission", "receptionist", "robotInterface:=release-1.0", BY_VOICE,
                     "--faults", "none")
    assert code == 0 and dict(re.findall(r"(\w+) +voice +(\w+)", text)) == OUTCOMES, text


def story(copy, words):
    """Return what is told of a visitor: the pass is made to fail, since rehearsals tell findings.
    """
    mission, way = copy / "data" / "receptionist.xml", '<SubTree ID="ShowTheWay"/>'
    mission.write_text(mission.read_text().replace(
        way, f"<Sequence>{way}<AlwaysFailure/></Sequence>"))
    return run("rehearseMission", "receptionist", "--faults", "none", "--visitors", "engages",
               words, folder=copy)[1]


@pytest.mark.parametrize("words, heard", [
    (BY_VOICE, "heard “I would like to see Doctor Vernan”: David Vernon?"),
    (BY_TABLET, "the visitor typed “I would like to see Doctor Vernan”: David Vernon?")])
def test_its_story_is_told_in_sentences_for_people(copy, words, heard):
    wanted = [heard, "asked “Did you mean David Vernon?”", "showing the way to room B203",
              "said “David Vernon is in room B203.”", "looked at room B203",
              "pointed at room B203", "said “It is in that direction.”"]
    text = story(copy, words)
    places = [text.find(sentence) for sentence in wanted]
    assert -1 not in places and places == sorted(places), text


def test_what_is_wrong_in_the_file_of_people_is_told_with_its_place_before_the_start(copy):
    people = copy / "data" / "people.ini"
    people.write_text("room B203 1 2 3\nperson B204 Ana\nperson\n")
    for tool in ("validateMission", "rehearseMission"):
        code, text = run(tool, "receptionist", folder=copy)
        assert code == 2 and "Traceback" not in text, text
        assert set(re.findall(r"(?m)^\S+/people\.ini:(\d+:\d+): ", text)) == {"2:8", "3:1"}, text
    people.unlink()
    code, text = run("validateMission", "receptionist", folder=copy)
    assert code == 2 and "people.ini: the file of people and rooms cannot be read" in text, text


def test_a_name_that_stands_in_no_braces_of_a_text_is_a_fault_of_the_text(copy):
    phrases = copy / "data" / "phrases_English.ini"
    lines = phrases.read_text().split("\n")
    phrases.write_text(phrases.read_text().replace("{room}", "{rom}"))
    number = 1 + next(number for number, line in enumerate(lines) if "{room}" in line)
    code, text = run("validateMission", "receptionist", folder=copy)
    assert code == 2 and re.search(rf"phrases_English\.ini:{number}:21: RoomSpeech cannot be .*"
                                   r"with \{person\} and \{room\}", text), text
