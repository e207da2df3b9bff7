"""No warning says of a node, or of a tour, what a play of the same mission disproves: seeded random
variations of the lab tour are checked and played.

``VARIATIONS`` sets how many are tried, ``VARIATIONS_SEED`` which.
"""
import copy
import os
import random
from xml.etree import ElementTree

import pytest

from behavior_controller.bt.loader import rules
from behavior_controller import folders
from behavior_controller.errors import FaultsFound

from behavior_controller.simulation.rehearsal.plays import Scenario, ScenarioRunner

pytestmark = pytest.mark.long

COUNT = int(os.environ.get("VARIATIONS", "40"))
SEED = int(os.environ.get("VARIATIONS_SEED", "1"))
LIMIT = 900.0  # seconds of the mission's time
SCENES = [Scenario("engages", by_voice=False), Scenario("engages", by_voice=True),
          Scenario("leaves", by_voice=True)]
DECORATORS = {
    "Timeout": {"msec": "60000"}, "Delay": {"delay_msec": "500"}, "Repeat": {"num_cycles": "2"},
    "RetryUntilSuccessful": {"num_attempts": "2"}, "ForceSuccess": {}, "ForceFailure": {},
    "Inverter": {}, "KeepRunningUntilFailure": {}, "RunOnce": {}}
ALIKE = [("Sequence", "ReactiveSequence", "SequenceWithMemory", "AsyncSequence"),
         ("Fallback", "ReactiveFallback", "AsyncFallback")]


def varied(draw):
    """Return the text of the lab tour with one to three changes."""
    root = ElementTree.parse(folders.mission("lab_tour")).getroot()
    for _ in range(draw.randint(1, 3)):
        trees = root.findall("BehaviorTree")
        parents = [element for tree in trees for element in tree.iter()
                   if len(element) and element.tag != "BehaviorTree"]
        parent = draw.choice(parents)
        draw.choice([left_out, twice, exchanged, decorated, timed_loop, another_control,
                     conditional])(parent, draw)
    return ElementTree.tostring(root, encoding="unicode")


def left_out(parent, draw):
    if len(parent) > 1:
        parent.remove(draw.choice(list(parent)))


def twice(parent, draw):
    parent.insert(draw.randrange(len(parent)), copy.deepcopy(draw.choice(list(parent))))


def exchanged(parent, draw):
    children = list(parent)
    draw.shuffle(children)
    parent[:] = children


def decorated(parent, draw):
    wrapped(parent, draw, draw.choice(sorted(DECORATORS)))


def timed_loop(parent, draw):
    wrapped(parent, draw, "Timeout", "KeepRunningUntilFailure")


def wrapped(parent, draw, *tags):
    index = draw.randrange(len(parent))
    child = parent[index]
    for tag in reversed(tags):
        around = ElementTree.Element(tag, DECORATORS[tag])
        around.append(child)
        child = around
    parent[index] = child


def another_control(parent, draw):
    for tags in ALIKE:
        if parent.tag in tags:
            parent.tag = draw.choice(tags)


def conditional(parent, draw):
    attribute = draw.choice(["_skipIf", "_failureIf", "_successIf", "_while"])
    draw.choice(list(parent)).set(attribute, draw.choice(["true", "false"]))


def disproved(path):
    """Return the warnings about a mission that its plays disprove, and whether a tour is given."""
    runner = ScenarioRunner({}, path, LIMIT)
    plays = []
    for scene in SCENES:
        try:
            plays.append((runner.evaluate(scene), runner.play(scene)))
        except FaultsFound:
            return [], False
    nodes = runner.stage(True).mission.tree.nodes
    ticked = {nodes[uid - 1].element.place() for outcome, _ in plays for uid in outcome.reached}
    succeeded = {nodes[result.uid - 1].element.place() for _, play in plays
                 for result in play.run.results if result.letter == "S"}
    has_tour = bool(plays[0][0].stops)
    wrong = []
    for fault in runner.stage(True).mission.tree.warnings:
        place = (fault.line, fault.column)
        if fault.code == rules.NO_STOP.code and has_tour or \
                fault.code == rules.NEVER_REACHED.code and place in ticked or \
                fault.code == rules.MODE_MISSING.code and place in succeeded:
            wrong.append(str(fault))
    return wrong, has_tour


@pytest.mark.parametrize("first", range(0, COUNT, 10))
def test_no_warning_is_disproved_by_a_play(first, tmp_path):
    tours = 0
    for number in range(first, min(first + 10, COUNT)):
        path = tmp_path / "m.xml"
        path.write_text(varied(random.Random("{}.{}".format(SEED, number))), encoding="utf-8")
        wrong, is_tour = disproved(str(path))
        assert wrong == [], "variation {} of seed {}:\n{}".format(
            number, SEED, path.read_text(encoding="utf-8"))
        tours += is_tour
    assert COUNT < 10 or tours
