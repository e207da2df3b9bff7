"""The kinds of findings: what in a play is one, and what is none."""
import pytest

from behavior_controller import settings
from behavior_controller.bt.language.document import parse
from behavior_controller.events import LeafFinished, Noticed, PassFinished, Recovered
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import GoTo, Location, Say, SetAnimation, SetAttention

from unit_tests import findings
from unit_tests.findings import Look
from unit_tests.journal import Line
from unit_tests.stage import BUSY, START, Played, Stage
from unit_tests.visitor import DECLINES, ENGAGES

STAGE = Stage(settings.defaults(), [parse("""<root BTCPP_format="4"><BehaviorTree ID="M"><Fallback name="all">
    <Sequence name="some"><IsVisitorDiscovered name="see"/><Navigate name="drive"/><PressYesNoDialogue name="press"/></Sequence>
    <Sequence name="others"><SayGoodByeSpeech name="bye"/><IsMutualGazeDiscovered name="look"/><WelcomeSpeech name="hi"/></Sequence>
    <HandleFallBack name="help"/></Fallback></BehaviorTree></root>""")])
UIDS = {node.name: node.uid for node in STAGE.mission.tree.nodes}
HOME = STAGE.knowledge.home.location
TOUR = [GoTo(exhibit.location._replace(theta_deg=7.0)) for exhibit in STAGE.knowledge.exhibits]
BACK = GoTo(HOME._replace(theta_deg=7.0))  # how the robot stands there does not matter
NO_DATA, REFUSED = Failure(Cause.MISSING_DATA, "no {x}", "/x"), Failure(Cause.REFUSED, "no", "/x")
FAULT = Line(START, "a node", "/x", 1, {}, fault="refused")


def timed(*told):
    """Return what was told with its times: from 1 s after the beginning, a second apart."""
    return [(START + number, each) for number, each in enumerate(told, 1)]


def ended(outcome="SUCCESS"):
    return PassFinished(1, outcome, 100.0)


def leaf(name, status="SUCCESS", failure=None, seconds=0.0):
    return LeafFinished(UIDS[name], "", "path of " + name, status, "", seconds, failure)


def recovered(outcome, resource="/x"):
    return Recovered("Navigate", "x", REFUSED._replace(resource=resource), "-", 0, outcome != "given up", outcome)


def look(*entries, behaviour=ENGAGES, faults=0, calm="", asked=(), **played):
    """Return a look at a play of 100 s that ended, if nothing else is given."""
    told = dict(entries=timed(*entries), journal=[], exit_code=0, cut_off="", error="", reached=frozenset(), waiting=(),
                seconds=100.0, asked=timed(*asked), presence=[(START, True)])
    return Look(STAGE, Played(**dict(told, **played)), behaviour, faults, calm)


def waiting(*names):
    return {"waiting": tuple(UIDS[name] for name in names), "exit_code": None}


LATE, EARLY = [(START + 81.0, Say("x"))], [(START + 79.0, Say("x"))]


@pytest.mark.parametrize("seen, found", [
    (look(), []), (look(exit_code=None), [("waits-for-ever", "", "after 100 s it still waits here")]),
    (look(cut_off=BUSY, **waiting("see", "drive")),
     [("busy-loop", "drive", "it is ticked again and again and waits for nothing")]),
    (look(leaf("hi"), leaf("bye"), **waiting("drive")), [
        ("waits-for-ever", "drive", "after 100 s it still waits here")]),
    (look(error="ZeroDivisionError: no", exit_code=4), [("exception", "", "ZeroDivisionError: no")]),
    (look(Noticed("warning", "so what"), Noticed("error", "it raised")), [("exception", "", "it raised")]),
    (look(leaf("drive", "FAILURE", NO_DATA)), [("missing-data", "path of drive", "no {x}")]),
    (look(leaf("drive", "FAILURE", NO_DATA), leaf("drive", "FAILURE", NO_DATA)), [("missing-data", "path of drive", "no {x}")]),
    (look(leaf("drive", "FAILURE", REFUSED), leaf("drive", "FAILURE")), []),
    (look(leaf("press", "FAILURE", NO_DATA)), []),  # nothing was pressed
    (look(leaf("help", "FAILURE", NO_DATA)), []),  # it is the failure of another node
    (look(leaf("help", "FAILURE", NO_DATA._replace(resource=""))), [("missing-data", "path of help", "no {x}")]),
    (look(journal=[FAULT, FAULT._replace(fault=None, objection="there is no text")]),
     [("senseless-request", "/x", "there is no text")])])
def test_what_goes_wrong_in_a_play_is_found(seen, found):
    assert findings.look_at(seen) == found


def test_a_mission_that_goes_on_asking_is_endless():
    seen = look(leaf("hi"), leaf("bye"), **waiting("drive"))
    late, early = (seen._replace(played=seen.played._replace(asked=asked)) for asked in (LATE, EARLY))
    assert findings.look_at(late) == [("endless", "path of bye", "after 100 s it still repeats itself")]
    assert [name for name, _, _ in findings.look_at(early)] == ["waits-for-ever"]


@pytest.mark.parametrize("seen, is_for_visitor", [
    (look(**waiting("see")), True), (look(**waiting("look")), False), (look(**waiting("others", "see")), True),
    (look(**dict(waiting("see"), exit_code=0)), False), (look(cut_off=BUSY, **waiting("see")), False),
    (look(leaf("see", "FAILURE"), **waiting("drive")), True), (look(leaf("see"), **waiting("see")), False),
    (look(leaf("hi", "SUCCESS"), **waiting("see")), True), (look(leaf("hi", "FAILURE"), **waiting("drive")), False)])
def test_a_robot_may_wait_for_its_first_visitor(seen, is_for_visitor):
    assert findings.waits_for_a_visitor(seen) is is_for_visitor
    assert not is_for_visitor or findings.look_at(seen) == []


@pytest.mark.parametrize("asked, waits", [(EARLY, True), (LATE, False)])
def test_a_robot_that_goes_on_asking_does_not_wait_for_a_visitor(asked, waits):
    seen = look(**waiting("see"))
    assert findings.waits_for_a_visitor(seen._replace(played=seen.played._replace(asked=asked))) is waits


UNRECOVERED = look(leaf("hi", "FAILURE", REFUSED._replace(resource="/y")), leaf("drive", "FAILURE"),
                   leaf("bye", "FAILURE", REFUSED), leaf("hi", "FAILURE", REFUSED), ended("FAILURE"),
                   faults=1, calm="SUCCESS", journal=[FAULT, FAULT._replace(resource="/y", fault=None)])


def test_a_single_fault_that_ends_the_pass_without_a_recovery_is_unrecovered():
    assert findings.look_at(UNRECOVERED) == [
        ("unrecovered", "path of bye", "its failure ends the pass, and no recovery looks at it")]
    played, entries = UNRECOVERED.played, UNRECOVERED.played.entries
    for other in (UNRECOVERED._replace(faults=2), UNRECOVERED._replace(calm="FAILURE"),
                  UNRECOVERED._replace(played=played._replace(entries=entries[:-1] + timed(ended()))),
                  UNRECOVERED._replace(played=played._replace(entries=entries + timed(recovered("given up"))))):
        assert findings.look_at(other) == []


@pytest.mark.parametrize("own, most, seconds, is_spent", [
    (15, 31, 599.0, False), (16, 31, 599.0, True), (31, 31, 599.0, True),  # the policy's budget: 30 in 600 s
    (30, 30, 599.0, False), (31, 31, 600.0, False)])
def test_a_budget_is_told_as_spent_if_most_of_it_went_where_no_fault_was(own, most, seconds, is_spent):
    resources = ["/calm"] * own + ["/x"] * (most - own)
    entries = [(START + at * seconds / 30, recovered("done", resource)) for at, resource in enumerate(resources)]
    spent = [("budget-spent", "x", "more than 30 recoveries in 600 s: whatever fails from here on is given up")]
    assert findings.look_at(look(entries=entries, journal=[FAULT])) == is_spent * spent
    before = (START - 7000.0, recovered("done"))  # a budget that is spent later is spent too
    assert findings.look_at(look(entries=[before] + entries, journal=[FAULT])) == is_spent * spent


ON, OFF, STIR = SetAttention("scanning"), SetAttention("disabled"), SetAnimation("enabled")


@pytest.mark.parametrize("asked, outcome, found", [
    ([OFF, ON, BACK], "FAILURE", [("left-on", "/overtAttention/set_mode", "the last request after the tour is {}".format(ON))]),
    ([ON, OFF, BACK], "FAILURE", []), ([OFF, ON], "FAILURE", []), ([ON, BACK], "", []),
    ([OFF, STIR, BACK], "FAILURE", [
        ("left-on", "/animateBehaviour/set_activation", "the last request after the tour is {}".format(STIR))]),
    ([BACK, TOUR[0]], "FAILURE", [("not-home", "", "the last drive leads to 2, 1 and not home")]),
    ([TOUR[0], BACK], "FAILURE", []), ([TOUR[0]], "", []), ([], "FAILURE", []),
    ([GoTo(Location(HOME.x, HOME.y + 1.5, HOME.theta_deg))], "FAILURE",
     [("not-home", "", "the last drive leads to {:g}, {:g} and not home".format(HOME.x, HOME.y + 1.5))])])
def test_how_a_tour_leaves_the_robot(asked, outcome, found):
    assert findings.look_at(look(*[ended(outcome)] if outcome else [], asked=asked)) == found


@pytest.mark.parametrize("outcome, at, is_told", [("given up", 5.0, False), ("given up", 0.5, True), ("skipped", 5.0, True)])
def test_after_a_recovery_that_gave_up_the_operator_takes_the_robot_home(outcome, at, is_told):
    entries = [(START + at, recovered(outcome))] + timed(ended("FAILURE"))
    names = [name for name, _, _ in findings.look_at(look(entries=entries, asked=[TOUR[0]]))]
    assert names == is_told * ["not-home"]


@pytest.mark.parametrize("leaves, is_told", [
    ([leaf("drive", "IDLE")], True), ([leaf("drive", "IDLE"), leaf("drive")], False), ([leaf("drive")], False),
    ([leaf("drive"), leaf("drive", "IDLE"), leaf("hi")], True), ([leaf("drive"), leaf("hi", "IDLE")], False)])
def test_a_drive_that_is_halted_for_good_is_abandoned(leaves, is_told):
    assert findings.look_at(look(*leaves)) == is_told * [
        ("abandoned-drive", "path of drive", "it is halted while the robot drives, which no service can stop")]


@pytest.mark.parametrize("presence, seconds", [
    ([(1.0, True), (30.0, False)], 17), ([(1.0, True), (10.0, False), (12.0, True), (20.0, False)], 27),
    ([(1.0, True)], None), ([(1.0, True), (47.5, False)], None), ([(1.0, False), (47.0, True)], None),
    ([(1.0, True), (30.0, False), (48.0, True)], 17), ([(1.0, True), (30.0, False), (48.0, True), (49.0, False)], 17),
    ([(1.0, True), (47.0, False)], 0), ([], 47)])
def test_a_goodbye_is_for_a_visitor_who_is_there_when_it_begins(presence, seconds):
    entries = [(START + 50.0, leaf("bye", seconds=3.0)), (START + 50.0, leaf("hi", seconds=3.0)),
               (START + 60.0, leaf("bye", "IDLE", seconds=4.0))]
    seen = look(entries=entries, presence=[(START + at, is_here) for at, is_here in presence])
    assert findings.look_at(seen) == ([] if seconds is None else [
        ("goodbye-to-nobody", "path of bye", "the visitor had left {} s before".format(seconds))])


@pytest.mark.parametrize("entries, asked, behaviour, left_out", [
    ([ended()], TOUR[:3] + TOUR[4:] + [BACK], ENGAGES, ["Mobile base"]), ([ended()], TOUR[:4] + [BACK], ENGAGES, ["Workshop"]),
    ([ended()], TOUR + [BACK], ENGAGES, []), ([ended()], [BACK], ENGAGES, []),
    ([ended()], TOUR[:4] + [BACK], DECLINES, []), ([ended("FAILURE")], TOUR[:4] + [BACK], ENGAGES, []),
    ([recovered("skipped"), ended()], TOUR[:4] + [BACK], ENGAGES, []),
    ([recovered("done"), ended()], TOUR[:4] + [BACK], ENGAGES, ["Workshop"])])
def test_an_exhibit_is_left_out_of_a_tour_that_succeeds(entries, asked, behaviour, left_out):
    seen = look(*entries, asked=asked, behaviour=behaviour)
    assert findings.look_at(seen) == [
        ("left-out", name, "the visitor wants the tour, and the robot does not drive there") for name in left_out]
    assert findings.visited(seen) == len(asked) - 1


def test_of_a_branch_that_no_play_reaches_only_the_top_is_told():
    def told(*names):
        return findings.unreached(STAGE, frozenset(UIDS[name] for name in names))
    assert told() == [("unreached", "all", "with 7 mission leaves below it")]
    assert told("all", "some", "see", "help", "hi") == [
        ("unreached", "drive", "with 1 mission leaf below it"),
        ("unreached", "press", "with 1 mission leaf below it"),
        ("unreached", "others", "with 3 mission leaves below it")]
    assert told(*UIDS) == []


def test_what_is_switched_on_must_be_switched_off_in_some_play():
    assert findings.never_off(STAGE, frozenset([ON, STIR, SetAnimation("disabled")])) == [
        ("never-off", "/overtAttention/set_mode", "it is never asked for {}".format(OFF))]
    assert findings.never_off(STAGE, frozenset([ON, OFF])) == findings.never_off(STAGE, frozenset()) == []
