"""What an operator sees in the moments for which the page is opened: card and robot line, against
the model of the run and against the truth of each situation."""
import dataclasses
import re
import time
import urllib.request

import pytest
from msgspec.structs import asdict, replace

from behavior_controller import bt
from behavior_controller.bt.engine.builtins import AlwaysSuccess
from behavior_controller.bt.engine.controls import Sequence
from behavior_controller.bt.engine.decorators import ForceSuccess
from behavior_controller.bt.engine.possible_results import FAILS, SUCCEEDS, of_child
from behavior_controller.bt.engine.successors import MOST_STEPS
from behavior_controller.config import settings
from behavior_controller.run.events import (
    Answered, Asked, BreakpointChanged, HealthChanged, LeafFinished, LeafSummary, Line,
    PassFinished, PassStarted, Paused, Recovered, Recovering, RunFinished, RunStarted, SafePart,
    SafeStateReported, Sources, StepStarted, TreeNode, TreeShown)
from behavior_controller.run.health import FAILING, GONE, NEW, SHORT, SILENT, SLOW
from behavior_controller.run.history import Run
from behavior_controller.run.state import (
    UNDER_WAY, Exchange, Robot, State, Step, Stop as Place, Visit)
from behavior_controller.leaves.recovery import RETURN_LIMIT
from behavior_controller.run.from_viewer import (
    BEFORE, BREAKPOINT, SET, Hook, HookChange)
from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.run.moment import card, next_node, robot_line
from behavior_controller.run.moment import Card, RobotLine, card_line
from behavior_controller.run.record.tree_shown import shown as tree_shown
from behavior_controller.robot.d543 import FACES, INTERFACE
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, Faces, GoTo, Location, PerformGesture, Say, SetAnimation, SetAttention, SetPose)
from browser import IS_WHOLE, SCREENS
from mission_rig import Rig, hanging, one_leaf, refusal, refusing, service_of, visitor_who
from page_rig import Situation, is_second_text, open_page, text, use_time_of, wait_until
from told_visits import walks_off
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission

OFF = "attention and lifelike movement are off"


def gone(respect=GONE):
    status = "gone: connection refused" if respect == GONE else "failing: 3 calls in a row"
    return HealthChanged("service", service_of(GoTo), "robotNavigation" if respect == GONE else "",
                         False, status, "until it is back, the robot cannot drive", respect)


def gone_for(resource):
    return Failure(Cause.NOT_REACHABLE, "refused", resource)


def engages():
    played = Situation(Rig(answer=lambda request: None if (
        isinstance(request, Say) and request.text == "second text 1") else NotImplemented))
    played.play(visitor_who("yes"), lambda: getattr(played.asked, "text", "") == "second text 1")
    now, robot = played.card, played.robot
    assert (now.kind, now.until - now.since) == ("step", 60.0)
    assert "second text 1" in now.what and "exhibit 1 of 2" in now.where
    assert service_of(Say) in now.waits_for and now.next == "is an exhibit left to visit"
    assert robot.is_well and (robot.place, robot.movement) == ("at exhibit 1", "off")
    return played, ["nothing runs", "gone"]


def leaves():
    played = Situation(Rig(answer=lambda request: None if (
        isinstance(request, GoTo) and request.goal.x == 0.5) else NotImplemented))
    played.play(walks_off, lambda: isinstance(played.asked, GoTo) and played.asked.goal.x == 0.5)
    assert (played.card.kind, played.card.what) == ("step", "driving home")
    assert played.robot.place == "driving home" and played.robot.is_well
    visit = played.run.state.visit
    assert visit.stops[-1].why.kind == "left" and visit.stops[-1].why.blind is None
    return played, ["nothing runs", "could not be seen"]


def node_killed_in_a_drive():
    played = Situation(Rig(answer=hanging(GoTo)))
    played.play(visitor_who("yes"), lambda: isinstance(played.asked, GoTo))
    assert played.robot.place == "driving to exhibit 1"
    played.rig.clock.advance(4.0)
    lost = Failure(Cause.CONNECTION_LOST, "the connection broke", service_of(GoTo))
    played.rig.gateway.calls[-1].finish(lost)
    played.report(GONE, gone())
    played.rig.tick()
    played.rig.clock.advance(6.0)  # the pause before the retry, and the wait for the node
    played.rig.tick()
    played.report(FAILING, gone(FAILING))
    now, robot = played.card, played.robot
    assert (now.kind, now.what) == ("wait", "waiting for /robotNavigation to return")
    assert now.until - now.since == RETURN_LIMIT and (now.attempt, now.attempts) == (2, 3)
    assert now.next.startswith("drives")  # again, not what the mission does when it has arrived
    assert robot.alive == service_of(GoTo) + " is gone"
    assert "at the start" in robot.place and "to exhibit 1" in robot.place
    assert re.match("Restart /robotNavigation; take the robot home$", robot.instruction)
    return played, ["nothing runs", "failing", "in use answer"]


def topic_frozen():
    played = Situation(Rig())
    frozen = HealthChanged("topic", "/overtAttention/mode", "overtAttention", False,
                           "silent for 1.3 s",
                           "until it is heard again, mutual gaze is not noticed", SILENT)
    played.report(SILENT, frozen)

    def seen(rig):
        rig.clock.advance(0.5)
        rig.topics.publish(FACES, Faces(("1",), (True,)))

    played.play(seen, lambda: len(played.run.visits) == 1, runs=2)
    why = played.run.visits[0].why
    assert (why.kind, why.blind) == ("failed", frozen)
    assert "overtAttention" in played.robot.instruction and not played.robot.is_well
    return played, ["did not look", "nothing runs"]


def breakpoint_of_groot2():
    rig = one_leaf("<Sequence><WelcomeSpeech/><SayGoodByeSpeech/></Sequence>")
    played = Situation(rig)
    hooks = Breakpoints(rig.mission.events.emit, lambda text: None)
    hooks.show(rig.tree)
    hooks.change(HookChange(SET, Hook(3, BEFORE, BREAKPOINT, False, True, "SKIPPED"), 1, 1))
    rig.clock.run_posted()
    rig.tick()
    rig.clock.advance(7.0)
    rig.tick()
    assert [event.is_held for event in rig.of(BreakpointChanged)] == [True]
    assert (played.card.kind, played.card.uid) == ("held", 3)
    assert "SayGoodByeSpeech" in played.card.what and played.card.since == 1000.0
    assert "Groot2" in played.card.waits_for
    assert played.robot.instruction == "Release the breakpoint in Groot2, or disconnect Groot2"
    return played, ["nothing runs", "saying"]


def sleep():
    rig = one_leaf("<Sequence><Sleep msec='30000'/><WelcomeSpeech/></Sequence>")
    played = Situation(rig)
    rig.tick()
    rig.clock.advance(7.0)
    now = played.card
    assert (now.kind, now.since, now.until, now.next) == (
        "asleep", 1000.0, 1030.0, "welcomes the visitor")
    return played, ["nothing runs"]


def budget_spent():
    played = Situation(Rig(answer=refusing(Say, PerformGesture)))
    played.play(visitor_who("yes"), lambda: played.card.kind == "paused", runs=9)
    now = played.card
    assert now.until > now.since and "recoveries" in now.what
    assert played.robot.instruction.startswith("Check ")
    return played, ["nothing runs", "between two"]


def stopped():
    played = Situation(Rig(answer=hanging(GoTo)))
    played.rig.run(visitor_who("yes"), is_stopped=lambda: isinstance(played.asked, GoTo))
    assert played.card.kind == "ended" and "no pass is over" in played.card.trouble
    robot, visit = played.robot, played.run.visits[-1]
    assert robot.safe == f"{OFF}; may still be driving to exhibit 1" and robot.is_well
    assert (robot.attention, robot.movement) == ("off", "off")
    assert robot.instruction == "Keep the stop button at hand; take the robot home"
    assert "on the way to exhibit 1" in robot.place
    assert (visit.outcome, visit.why.kind) == ("", "stopped")
    return played, ["nothing runs", "safe:"]


SITUATIONS = [engages, leaves, node_killed_in_a_drive, topic_frozen, breakpoint_of_groot2, sleep,
              budget_spent, stopped]
FIELDS = """
const text = id => document.getElementById(id).innerText;
return {what: text("now"), waits: text("waits"), next: text("next"), elapsed: text("elapsed"),
        kind: byId("card").dataset.kind,
        robot: ["alive", "place", "attention", "movement", "safe", "instruction"].map(text),
        all: text("card") + text("robot") + text("alarms")}"""


@pytest.mark.slow
@pytest.mark.parametrize("situation", SITUATIONS)
def test_card_and_robot_line_say_what_is_so(situation, monkeypatch, show, browser):
    shows = []

    def init(self, rig, begin=Situation.__init__):
        begin(self, rig)
        use_time_of(rig, monkeypatch)
        shows.append(show(rig))

    monkeypatch.setattr(Situation, "__init__", init)
    played, wrong = situation()
    now, robot = played.card, played.robot
    open_page(browser, shows[-1])
    wait_until(lambda: browser.execute_script(FIELDS)["kind"] == now.kind)
    seen = browser.execute_script(FIELDS)
    assert seen["what"] == now.what
    assert seen["next"] == ("next: " + now.next if now.next else "")
    assert now.waits_for in seen["waits"] and now.trouble in seen["waits"]
    switches = ["attention " + robot.attention, "lifelike movement " + robot.movement]
    if robot.safe:  # which says it
        switches = ["", ""]
    assert seen["robot"] == [robot.alive, robot.place, *switches, robot.safe, robot.instruction]
    assert [words for words in wrong if words in seen["all"]] == []
    left = now.until - played.rig.clock.now() if now.until is not None else 0.0
    if now.kind in ("wait", "asleep", "paused"):
        assert abs(float(re.search(r"(\d+) s more", seen["elapsed"])[1]) - left) <= 2.0
    line = card_line(now, played.rig.clock.now())
    assert all(words in line for words in (now.where, now.what, now.waits_for, now.next))
    assert robot.instruction in robot.text
    assert browser.execute_script("return byId('visits-list').childElementCount") == len(
        played.run.visits)


def ticked(mission, seconds, answer=lambda request: NotImplemented):
    """Return the situation of a mission after so many seconds."""
    played = Situation(one_leaf(mission, answer))
    tick(played.rig, seconds)
    return played


def tick(rig, seconds):
    for _ in range(int(2 * seconds)):
        rig.tick()
        rig.clock.advance(0.5)


DRIVE_WITH_RECOVERY = "<Fallback><Navigate/><HandleFallBack/></Fallback>"


def test_a_retry_ends_when_its_recovery_is_halted():
    drives = []

    def refuse_once(request):
        if not isinstance(request, GoTo):
            return NotImplemented
        drives.append(request)
        return refusal(request) if len(drives) == 1 else None

    played = ticked("<Sequence><LookUpHome/><ForceSuccess><Timeout msec='5000'>{}</Timeout>"
                    "</ForceSuccess><Sleep msec='60000'/></Sequence>".format(DRIVE_WITH_RECOVERY),
                    4, refuse_once)
    assert (played.card.kind, played.card.attempt) == ("step", 2)
    tick(played.rig, 3)
    assert played.card.kind == "asleep" and not played.run.state.steps
    assert played.run.state.robot.goal is None and not played.run.state.exchanges


def test_a_recovery_that_asks_for_the_safe_state_says_so():
    def answer(request):
        if isinstance(request, SetAttention):
            return None
        return refusal(request) if isinstance(request, GoTo) else NotImplemented

    played = ticked("<Sequence><LookUpHome/>{}</Sequence>".format(DRIVE_WITH_RECOVERY), 8, answer)
    now = played.card
    assert (now.kind, now.what) == ("step", SetAttention("disabled").words.doing)
    assert (now.since, now.attempt) == (1003.0, 1) and service_of(SetAttention) in now.waits_for


def test_the_safe_state_is_reported_until_something_of_it_is_asked_for():
    other = ("<Sequence><Sleep msec='5000'/>{}<EnableAnimateBehavior/>"
             "<Sleep msec='9000'/></Sequence>")
    played = ticked("<Sequence><LookUpHome/><Fallback>{}{}</Fallback></Sequence>".format(
        DRIVE_WITH_RECOVERY, other.format("<WelcomeSpeech/>")), 5, refusing(GoTo))
    assert played.card.kind == "asleep" and played.robot.safe == "safe: " + OFF
    tick(played.rig, 5)
    assert (played.robot.movement, played.robot.safe) == ("on", "")


def test_a_wait_is_over_when_its_time_is():
    played = ticked("<Sequence><ForceSuccess><ReactiveFallback><IsVisitorDiscovered/><ForceFailure>"
                    "<Sleep msec='2000'/></ForceFailure></ReactiveFallback></ForceSuccess>"
                    "<Sleep msec='30000'/></Sequence>", 1)
    assert (played.card.kind, played.card.until) == ("wait", 1002.0)
    tick(played.rig, 4)
    assert (played.card.kind, played.card.since) == ("asleep", 1002.0)


def test_a_wait_says_what_is_wrong_with_its_topic():
    played = ticked("<ReactiveFallback><IsVisitorDiscovered/><Sleep msec='90000'/>"
                    "</ReactiveFallback>", 1)
    assert (played.card.kind, played.card.trouble) == ("wait", "")
    played.report(SILENT, HealthChanged("topic", "/faceDetection/data", "faceDetection", False,
                                        "silent for 1.3 s", "visitors are not noticed", SILENT))
    assert played.card.trouble == "/faceDetection/data is silent"


@pytest.mark.parametrize("following, expected", [
    ("<Sequence><SayGoodByeSpeech/></Sequence>", "says goodbye"),
    ("<DescribeExhibitSpeech name='1'/>", "describes the current exhibit"),
    ("<Script code='x := 2'/><SayGoodByeSpeech/>", "says goodbye"),
    ("<SayGoodBye/>", "says goodbye"), ("<IsASREnabled/>", "is speech recognised"),
    ("<Sleep msec='9000'/>", "a pause"), ("<Navigate name='go there'/>", "go there"),
    ("<Sequence _skipIf='false'><SayGoodByeSpeech/></Sequence>", ""),
    ("<Sequence><SayGoodByeSpeech _while='true'/></Sequence>", ""),
    ("<Switch2 variable='{x}' case_1='1' case_2='2'><WelcomeGesture/><AlwaysSuccess/>"
     "<SayGoodByeSpeech/></Switch2>", "")])
def test_what_comes_next_is_said_if_it_is_certain(following, expected):
    played = ticked("<Sequence><Script code='x := 1'/><WelcomeSpeech/>{}</Sequence>".format(
        following), 1, lambda request: None)
    assert played.card.next == expected


@pytest.mark.parametrize("mission, what_follows", [
    ("<Sequence><Script code='x := 1'/><Fallback><WelcomeSpeech/><HandleFallBack/></Fallback>"
     "</Sequence>", "the end of the visit"),
    ("<Inverter><WelcomeSpeech/></Inverter>", "the end of the visit")])
def test_after_the_last_step_the_visit_ends(mission, what_follows):
    assert ticked(mission, 1, lambda request: None).card.next == what_follows


def test_what_has_the_same_trouble_is_named_if_it_is_not_too_much():
    played = ticked("<WelcomeSpeech/>", 1, lambda request: None)
    for number, kind in enumerate(["service", "topic", "service", "service"]):
        name = "/n{}/do".format(number)
        played.report(FAILING, HealthChanged(kind, name, "", False, "failing", "", FAILING))
        if number == 1:
            assert played.robot.alive == "/n0/do and /n1/do are failing"
    assert played.robot.alive == "3 services and 1 topic are failing"
    assert played.robot.instruction == ("Check /n0/do, /n1/do, /n2/do and /n3/do: they are failing")


def test_a_robot_that_could_not_drive_home_is_to_be_fetched_until_it_drives():
    drives = []

    def cannot_return(request):
        if not isinstance(request, GoTo):
            return NotImplemented
        drives.append(request)
        return refusal(request) if len(drives) > 1 and played.run.state.visit_count == 1 else None

    played = Situation(Rig(answer=cannot_return))
    seen = []

    def visitor(rig):
        if rig.gateway.calls[-1].result is None and len(drives) == 1:
            rig.gateway.calls[-1].finish(Answer())
        seen.append((played.run.state.visit_count, played.robot.instruction))
        visitor_who("yes")(rig)

    played.play(visitor, lambda: played.run.state.visit_count == 2 and
                isinstance(played.asked, GoTo), runs=2)
    assert {told for visit, told in seen if visit == 1} == {""}
    # the visitor is there already, and is greeted
    assert {told for visit, told in seen if visit == 2} == {""}
    assert played.run.at(played.run.visits[0].ended).robot.is_lost
    assert played.robot.instruction == "" and played.robot.place == "driving to exhibit 1"


def test_a_visit_goes_on_from_a_stop_when_the_robot_can_drive_again():
    played = Situation(Rig(answer=lambda request: None if isinstance(request, PerformGesture) and (
        played.robot.place == "at exhibit 1") else NotImplemented))
    played.play(visitor_who("yes"), lambda: (
        isinstance(played.asked, PerformGesture) and played.robot.place == "at exhibit 1"))
    played.report(GONE, gone())
    assert played.robot.instruction == "Restart /robotNavigation"


def test_what_a_node_was_asked_for_is_unknown_when_it_comes_back():
    played = ticked("<Sequence><SeekOvertAttentionMode/><EnableAnimateBehavior/>"
                    "<Sleep msec='60000'/></Sequence>", 1)
    assert (played.robot.attention, played.robot.movement) == ("on (seeking)", "on")
    lost = replace(gone(), name=service_of(SetAttention), node="overtAttention")
    played.report(GONE, lost)
    played.report(GONE, replace(lost, is_well=True, consequence=""))
    assert (played.robot.attention, played.robot.movement) == ("unknown", "on")


@pytest.mark.slow
def test_retries_of_one_incident_are_one_entry(show, browser):
    shown = show(Rig(answer=refusing(PerformGesture)))
    open_page(browser, shown)
    shown.run_until(is_second_text)
    sentences = shown.page.board.part("story")["sentences"]
    incidents = {told["incident"] for told in sentences if told["incident"]}
    assert len(incidents) == 2 and len([told for told in sentences if told["incident"]]) > 4
    for rows in ("[data-incident]", "details"):
        wait_until(lambda: len(browser.find_elements("css selector", "#transcript " + rows)) == 2)


# ----------------------------------------------------------------------- the cards of given models


ARM, STOPPED = Location(1.0, 2.5, 90.0), RunFinished("stopped", 0)
VISIT = Visit(3, 100.0, arrived=110.0)
STOP = Place(2, 5, "arm", UNDER_WAY, None, 0.0, noun="exhibit")
SPEAKS = ASKED = Exchange(7, "/say", Say("hello"), 120.0, 0, words="saying “hello”")

DRIVING = Exchange(8, "/go", GoTo(ARM), 120.0, 0, words="driving to the arm")


# leaves that take time, and decorators and a control of another package
TYPES = bt.Registry(bt.builtin_specs() + [
    *[bt.NodeSpec(name, bt.Kind.ACTION, AlwaysSuccess) for name in "ABCD"],
    bt.NodeSpec("Own", bt.Kind.DECORATOR, ForceSuccess),
    bt.NodeSpec("OwnNot", bt.Kind.DECORATOR, ForceSuccess, outcome=FAILS),
    bt.NodeSpec("OwnLoop", bt.Kind.DECORATOR, ForceSuccess, outcome=of_child(0, FAILS),
                repeats_on=SUCCEEDS),
    bt.NodeSpec("OwnControl", bt.Kind.CONTROL, Sequence),
    bt.NodeSpec("OwnChain", bt.Kind.CONTROL, Sequence, advances_on=SUCCEEDS),
    bt.NodeSpec("OwnWait", bt.Kind.ACTION, AlwaysSuccess, (bt.Port("for"),), pause="for")])


def rows(body):
    """Return a tree as the record has it."""
    return replace(tree_shown(bt.load_text(
        "<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>" + body +
        "</BehaviorTree><BehaviorTree ID='S'><A/></BehaviorTree></root>", TYPES)),
                   summaries={name: name for name in "ABCD"})


def around(kind, body="<A/>"):
    """Return an element with its attributes around ``body``."""
    return "<{}>{}</{}>".format(kind, body, kind.split()[0])


END = "the end of the visit"
SWITCH = "Switch2 variable='{x}' case_1='1' case_2='2'"
CASES, PAIR = "<A/><B/><C/>", "<Sequence><A/><B/></Sequence>"


@pytest.mark.parametrize("body, leaf, expected", [
    *[(around(kind, "<A/><B/>"), "A", "B") for kind in (
        "Sequence", "SequenceWithMemory", "ReactiveSequence", "AsyncSequence", "OwnChain",
        "IfThenElse", "WhileDoElse")],
    # nodes that succeed when their child does
    *[("<Sequence>{}<B/></Sequence>".format(around(kind)), "A", "B") for kind in (
        "Fallback", "ReactiveFallback", "AsyncFallback", "ForceSuccess", "Timeout msec='9'",
        "Delay delay_msec='9'", "RetryUntilSuccessful num_attempts='3'", "RunOnce",
        "Precondition if='x'", "Precondition if='x' else='SKIPPED'", "Repeat num_cycles='1'",
        "SkipUnlessUpdated entry='{x}'", "WaitValueUpdate entry='{x}'", "Own", "Parallel")],
    ("<Sequence><SubTree ID='S'/><B/></Sequence>", "A", "B"),
    # and those after whose child the same leaf may come again
    *[("<Sequence>{}<B/></Sequence>".format(around(kind)), "A", "A or B") for kind in (
        "Repeat num_cycles='3'", "Repeat num_cycles='{n}'", "LoopString queue='a;b'",
        "LoopInt queue='{q}'")],
    ("<LoopString queue='a;b'>" + PAIR + "</LoopString>", "B", "A or " + END),
    ("<LoopString queue='a;b'>" + PAIR + "</LoopString>", "A", "B"),
    *[("<Sequence>{}<C/></Sequence>".format(around(kind, PAIR)), "B", "A") for kind in (
        "KeepRunningUntilFailure", "Repeat num_cycles='-1'", "OwnLoop")],
    # a child's success may be a failure
    *[("<Fallback><Sequence>{}<B/></Sequence><C/></Fallback>".format(around(kind)), "A", "C")
      for kind in ("Inverter", "ForceFailure", "OwnNot")],
    ("<Sequence><Inverter><A/></Inverter><B/></Sequence>", "A", END),
    ("<RetryUntilSuccessful num_attempts='2'><Inverter><A/></Inverter></RetryUntilSuccessful>",
     "A", "A or " + END),
    ("<Sequence><TryCatch><A/><B/><C/></TryCatch><D/></Sequence>", "A", "B"),
    ("<Sequence><TryCatch><A/><B/><C/></TryCatch><D/></Sequence>", "B", "D"),
    ("<Fallback><TryCatch><A/><B/><C/></TryCatch><D/></Fallback>", "C", "D"),
    ("<Sequence><IfThenElse><A/><B/><C/></IfThenElse><D/></Sequence>", "B", "D"),
    ("<Sequence>{}<D/></Sequence>".format(around(SWITCH, CASES)), "B", "D"),
    # leaves that take no time are passed
    *[("<Sequence><A/>{}<B/></Sequence>".format(leaf), "A", "B") for leaf in (
        "<Script code='x:=1'/>", "<SetBlackboard output_key='x' value='1'/>",
        "<UnsetBlackboard key='x'/>", "<AlwaysSuccess/>",
        "<Fallback><AlwaysSuccess/><C/></Fallback>")],
    ("<Fallback><Sequence><A/><AlwaysFailure/><B/></Sequence><C/></Fallback>", "A", "C"),
    ("<Sequence><A/><Script code='x:=1'/></Sequence>", "A", END),
    ("<KeepRunningUntilFailure><Script code='x:=1'/></KeepRunningUntilFailure>", "Script", ""),
    ("<Sequence><A/><B/></Sequence>", "B", END),
    ("<Sequence><A/><B/></Sequence>", "Sequence", END),
    ("<Fallback><A/><B/></Fallback>", "A", END),
    ("<Sequence><Fallback><A/><B/></Fallback><C/></Sequence>", "A", "C"),
    ("<Sequence><A/><Sequence><Inverter><B/></Inverter><C/></Sequence></Sequence>", "A", "B"),
    # open: what runs at once, what a condition or a value decides, a control that says nothing
    *[("<Sequence>{}<C/></Sequence>".format(around(kind, "<A/><B/>")), "A", "")
      for kind in ("Parallel", "ParallelAll", "OwnControl")],
    ("<Sequence><A/><B _skipIf='x'/></Sequence>", "A", ""),
    ("<Sequence><A _skipIf='x'/><B/></Sequence>", "A", "B"),
    ("<Sequence><A/><Sequence _while='x'><B/></Sequence></Sequence>", "A", ""),
    ("<Sequence><A/><Sequence><B _successIf='x'/></Sequence></Sequence>", "A", ""),
    ("<Sequence><A/><Sequence><B/><C _skipIf='x'/></Sequence></Sequence>", "A", "B"),
    ("<Sequence><A/><Precondition if='x'><B/></Precondition></Sequence>", "A", ""),
    ("<Sequence><D/>{}</Sequence>".format(around(SWITCH, CASES)), "D", "")])
def test_what_follows_a_node_that_succeeds(body, leaf, expected):
    tree = rows(body)
    uid = next(uid for uid, node in enumerate(tree.nodes, 1) if node.type == leaf)
    assert next_node(State(tree=tree), uid) == expected.lower()


def test_no_node_follows_one_that_the_tree_lacks():
    assert [next_node(State(tree=rows("<A/>")), uid) for uid in (0, 2)] == ["", ""]


def test_what_follows_in_loops_within_loops_is_found_quickly():
    deep = 20 * "<Repeat num_cycles='2'><Fallback>" + "<A/>" + 20 * "</Fallback></Repeat>"
    assert next_node(State(tree=rows("<Sequence>" + deep + "<B/></Sequence>")), 42) == "a or b"


def test_a_way_to_the_next_leaf_that_is_too_long_is_left_open():
    instant = MOST_STEPS * "<AlwaysSuccess/>"
    assert next_node(State(tree=rows("<Sequence><A/>" + instant + "<B/></Sequence>")), 2) == ""


@pytest.mark.parametrize("robot, expected", [
    (Robot(), "place unknown"),
    (Robot(last_place="arm"), "place unknown"),
    (Robot(goal=ARM), "driving to 1, 2.5"),
    (Robot(goal=ARM, goal_name="arm", last_place="cup"), "driving to arm"),
    (Robot(goal=ARM, goal_name="home"), "driving home"),
    (Robot(place=ARM), "at 1, 2.5"),
    (Robot(place=ARM, last_place="arm", goal_name="arm"), "at arm"),
    (Robot(goal_name="arm"), "place unknown"),
    (Robot(way="arm", goal_name="home"), "last seen at the start, on the way to arm"),
    (Robot(way="arm", last_place="cup"), "last seen at cup, on the way to arm"),
    (Robot(way="home", last_place="cup"), "last seen at cup, on the way home")])
def test_where_the_robot_is(robot, expected):
    assert robot_line(State(robot=robot)).place == expected


USES_SPEECH = State(started=RunStarted("m.xml", [], {}, Sources((), ("", ""), ("", ""), ""),
                                       requests=["Say"]))


@pytest.mark.parametrize("mission, expected", [
    ("<WelcomeSpeech/>", []), ("<EnableAnimateBehavior/>", ["lifelike movement unknown"]),
    ("<ScanningOvertAttentionMode/>", ["attention unknown"])])
def test_a_robot_line_says_unknown_only_of_what_the_mission_uses(mission, expected):
    rig = Rig("<Sequence>{}</Sequence>".format(mission))
    rig.run(visitor_who(), runs=1)
    started = next(number for number, event in enumerate(rig.events)
                   if isinstance(event, RunStarted))
    run = Run([Line(0.0, event) for event in rig.events[:started + 1]])
    parts = robot_line(run.state).text.split(" · ")
    assert [part for part in parts if part.endswith(" unknown")
            and not part.startswith("place")] == expected


@pytest.mark.parametrize("state, expected", [
    (State(), ("unknown", "unknown", "not yet asked", "")),
    (State(started=RunStarted("m.xml", [], {}, Sources((), ("", ""), ("", ""), ""))),
     ("unknown", "unknown", "all nodes in use answer", "")),
    (USES_SPEECH, ("", "", "all nodes in use answer", "")),
    (replace(USES_SPEECH, robot=Robot(SetAttention("disabled"))),
     ("off", "", "all nodes in use answer", "")),
    (State(robot=Robot(SetAttention("disabled"), SetAnimation("disabled"))),
     ("off", "off", "not yet asked", "")),
    (State(robot=Robot(SetAttention("social"), SetAnimation("enabled"))),
     ("on (social)", "on", "not yet asked", "")),
    (State(safe_state=SafeStateReported((SafePart("attention", "/a", None),), 1.0)),
     ("unknown", "unknown", "not yet asked", "safe: attention is off")),
    (State(safe_state=SafeStateReported((), 1.0)), ("unknown", "unknown", "not yet asked", "safe")),
    (State(safe_state=SafeStateReported((), 1.0), robot=Robot(unfinished=(SPEAKS,))),
     ("unknown", "unknown", "not yet asked", "may still be saying “hello”"))])
def test_what_is_on_and_what_is_safe(state, expected):
    line = robot_line(state)
    assert (line.attention, line.movement, line.alive, line.safe) == expected
    assert line.is_well and line.instruction == ""


def ill(*changes, **fields):
    """Return a robot with these troubles: (kind, name, node, respect)."""
    troubles = [HealthChanged(kind, name, node, False, respect, "", respect)
                for kind, name, node, respect in changes]
    return Robot(troubles={(change.name, change.respect): change for change in troubles},
                 ill_since=dict.fromkeys((change.name for change in troubles), 1.0),
                 services={"GoTo": "/nav/go"}, **fields)


NAV = ("service", "/nav/go", "nav")
MASTER = ("master", "http://m:11311", "")


DRIVE = StepStarted(2, "Navigate", "all/go", "driving", "to the arm", 180.0, False)
HOMEWARD = replace(DRIVE, what="home")
LATE = Failure(Cause.NO_ANSWER, "late", service_of(GoTo))


def to_drive(step, call, *results):
    """Return the events of a drive with these results."""
    answers = [Answered(call, result) for result in results]
    ends = [LeafFinished(2, "Navigate", "all/go", "FAILURE" if isinstance(result, Failure) else
                         "SUCCESS", "", 1.0, result if isinstance(result, Failure) else None)
            for result in results]
    return [step, Asked(call, service_of(GoTo), GoTo(ARM)), *answers, *ends]


ARRIVES = LeafFinished(9, "Seen", "all/seen", "SUCCESS", "", 0.0, None,
                       LeafSummary("visit", "", "arrived"))
AT_ARM, AT_HOME = to_drive(DRIVE, 1, Answer()), to_drive(HOMEWARD, 1, Answer())
UNSENT = to_drive(HOMEWARD, 2, gone_for(service_of(GoTo)))
POSE_SET = [Asked(4, "/pose", SetPose(ARM)), Answered(4, Answer())]
RETRY = Recovering(7, "Navigate", "all/go", LATE, 1, 2)
WHERE = {
    "never drove": [], "at home": AT_HOME, "at a stop": AT_ARM, "drives": to_drive(DRIVE, 1),
    "drives from home": AT_HOME + to_drive(DRIVE, 2), "drives home": AT_ARM + to_drive(HOMEWARD, 2),
    "drive failed": to_drive(DRIVE, 1, LATE), "home failed": AT_ARM + to_drive(HOMEWARD, 2, LATE),
    "recovering": to_drive(DRIVE, 1, LATE) + [RETRY],
    "retried": to_drive(DRIVE, 1, LATE) + [RETRY, Asked(3, service_of(GoTo), GoTo(ARM))],
    "home not sent": AT_ARM + UNSENT, "not sent from home": AT_HOME + to_drive(
        DRIVE, 2, gone_for(service_of(GoTo))),
    "never sent": UNSENT, "not sent from its pose": POSE_SET + UNSENT,
    "at home, pose set": AT_HOME + POSE_SET,
    "drive failed, pose set": to_drive(DRIVE, 1, LATE) + POSE_SET}
FAILS, SUCCEEDS = PassFinished(1, "FAILURE", 9.0), PassFinished(1, "SUCCESS", 9.0)
PAUSE = Paused(LATE, "/robotNavigation")
WHEN = [  # the columns of the table
    [], [FAILS], [SUCCEEDS], [FAILS, PAUSE], [FAILS, PassStarted(2, 9.0)],
    [FAILS, PassStarted(2, 9.0), ARRIVES], [FAILS, PassStarted(2, 9.0), ARRIVES, SUCCEEDS],
    [STOPPED]]
# H: the robot is to be taken home. In the tour; the visit failed; it succeeded; the mission waits
# for a node; the next visitor is awaited; is greeted; has declined; the run has ended. Then the
# same while the node that drives is gone. A visit does not end in the middle of a step (.)
FETCHED = {"never drove": ("--------", "--------"), "at home": ("--------", "--------"),
           "at a stop": ("-H-HH-HH", "-H-HH-HH"), "drives": ("-......H", "-......H"),
           "drives from home": ("-......H", "-......H"), "drives home": ("-......H", "-......H"),
           "drive failed": ("-HHHH-HH", "HHHHH-HH"), "home failed": ("-HHHH-HH", "HHHHH-HH"),
           "recovering": ("-......H", "H......H"), "retried": ("-......H", "-......H"),
           "home not sent": ("-HHHH-HH", "-HHHH-HH"),
           "not sent from home": ("--------", "--------"), "never sent": ("--------", "--------"),
           "not sent from its pose": ("--------", "--------"),
           "at home, pose set": ("--------", "--------"),
           "drive failed, pose set": ("-HHHH-HH", "HHHHH-HH")}
BACK = replace(gone(), is_well=True, consequence="")


@pytest.mark.parametrize("health, column", [([], 0), ([gone()], 1), ([gone(), BACK], 0)])
@pytest.mark.parametrize("where", WHERE)
def test_when_a_person_has_to_take_the_robot_home(where, health, column):
    for letter, when in zip(FETCHED[where][column], WHEN):
        if letter != ".":
            run = Run(Line(float(at), event) for at, event in enumerate(
                [PassStarted(1, 0.0), ARRIVES, *WHERE[where], *health, *when]))
            told = "take the robot home" in robot_line(run.state).instruction.lower()
            assert (letter, when) == ("H" if told else "-", when)


@pytest.mark.parametrize("is_over, safe", [(True, "safe: " + OFF), (False, "may still be saying")])
def test_what_a_retry_says_after_its_answer_is_under_way_until_it_is_over(is_over, safe):
    refused = []

    def refuse_once(request):
        if not isinstance(request, Say) or refused:
            return NotImplemented
        return refused.append(request) or refusal(request)

    played = Situation(one_leaf("<Fallback><SayText name='4'/><HandleFallBack/></Fallback>",
                                refuse_once, robotInterface="release-1.0", waitForSpeech="all"))
    played.rig.run(lambda rig: rig.clock.advance(0.25),
                   is_stopped=lambda: not is_over and played.rig.clock.now() > 1001.0)
    assert safe in played.robot.safe and len(refused) == 1


@pytest.mark.parametrize("result, safe", [
    (refusal(GoTo(ARM)), "safe"), (gone_for(service_of(GoTo)), "safe"), (Answer(), "safe"),
    (LATE, "may still be driving to the arm"), (None, "may still be driving to the arm")])
def test_what_was_under_way_when_the_safe_state_was_reported_may_end(result, safe):
    """As in one branch of a Parallel while another gives up."""
    results = [] if result is None else [Answered(1, result)]
    run = Run(Line(float(at), event) for at, event in enumerate(
        [*to_drive(DRIVE, 1), SafeStateReported((), 0.1), *results]))
    assert robot_line(run.state).safe == safe


@pytest.mark.parametrize("state, expected", [
    (State(robot=Robot(goal_name="arm", last_place="cup")), ""),
    (State(robot=Robot(unfinished=(DRIVING,))), ""),
    (State(robot=Robot(unfinished=(DRIVING,)), safe_state=SafeStateReported((), 1.0)),
     "Keep the stop button at hand"),
    (State(robot=Robot(unfinished=(SPEAKS,)), safe_state=SafeStateReported((), 1.0)), ""),
    (State(robot=Robot(goal_name="arm", is_lost=True)), "Take the robot home"),
    (State(robot=Robot(is_lost=True), finished=STOPPED), ""),
    (State(robot=Robot(goal_name="arm"), finished=STOPPED), "Take the robot home"),
    (State(robot=Robot(goal_name="arm", place=ARM, last_place="arm"), finished=STOPPED),
     "Take the robot home"),
    (State(robot=Robot(goal_name="home", place=ARM, last_place="home"), finished=STOPPED), ""),
    # it had been at home, and was on its way
    (State(robot=Robot(goal_name="arm", last_place="home"), finished=STOPPED),
     "Take the robot home"),
    (State(robot=ill((*NAV, GONE), goal_name="arm")), "Restart /nav; take the robot home"),
    (State(robot=ill((*NAV, GONE), goal_name="arm", place=ARM)), "Restart /nav"),
    (State(robot=ill((*NAV, GONE))), "Restart /nav"),
    (State(robot=ill((*NAV, FAILING), goal_name="arm")), "Check /nav: it is failing"),
    (State(robot=ill((*NAV, SLOW), goal_name="arm")), ""),
    (State(robot=ill(("service", "/say", "tts", GONE), goal_name="arm")), "Restart /tts"),
    (State(robot=ill(("service", "/say", "", GONE))), "Restart /say"),
    (State(robot=ill((*NAV, GONE), ("topic", "/nav/pose", "nav", GONE))), "Restart /nav"),
    (State(robot=ill(("topic", "/faces", "faces", SILENT), ("service", "/say", "tts", FAILING),
                     ("service", "/show", "tablet", FAILING))),
     "Check /faces: it is silent; check /tts and /tablet: they are failing"),
    (State(robot=ill(*[("service", f"/{name}/do", name, GONE) for name in "abcd"])),
     "Restart /a, /b, /c and /d"),
    (State(robot=ill(*[("service", f"/{name}/do", name, GONE) for name in "abcde"])),
     "Restart 5 nodes"),
    (State(robot=ill((*MASTER, GONE))),
     "Check the ROS master, and start it again if it has ended"),
    (State(robot=ill((*MASTER, NEW))), "Restart the robot's nodes as soon as it is free"),
    (State(robot=ill((*NAV, NEW))), ""),
    (State(robot=ill(("computer", "lab-pc", "", SHORT))),
     "End what uses up the files, threads or memory of lab-pc"),
    (State(held={1: 120.0}), "Release the breakpoint in Groot2, or disconnect Groot2"),
    (State(safe_state=SafeStateReported((
        SafePart("attention", "/a", None), SafePart("movement", "/m", gone_for("/m"))), 1.0)),
     "Switch movement off by hand")])
def test_what_a_person_has_to_do(state, expected):
    assert robot_line(state).instruction == expected


@pytest.mark.parametrize("awaited, respect, expected", [
    ("", None, "Check /nav/go: not reachable"), ("/nav", None, ""), ("/nav", GONE, "Restart /nav"),
    ("", GONE, "Restart /nav"), ("", SLOW, "")])
def test_what_fails_in_a_pause_is_to_be_repaired_unless_more_is_known(awaited, respect, expected):
    pause = Paused(gone_for("/nav/go"), awaited)
    state = State(steps=(Step("", 1.0, 0.0, 0, True, cause=pause),),
                  robot=Robot() if respect is None else ill((*NAV, respect)))
    found = robot_line(state).instruction
    assert found.startswith(expected) and bool(found) == bool(expected)
    assert card(state).kind == "paused" and card(state).next == "the next visit"


DELAY = TreeShown("", rows("<Delay delay_msec='4500'><A/></Delay>").nodes[:1])


@pytest.mark.parametrize("state, expected", [
    (State(), Card("idle", "nothing runs")),
    (State(visits=(VISIT,)), Card("idle", "between two steps", "visitor 3")),
    (State(visits=(Visit(3, 100.0),)), Card("idle", "between two steps")),
    (State(visits=(replace(VISIT, outcome="SUCCESS", ended=130.0),)),
     Card("idle", "between two visits")),
    (State(visits=(replace(VISIT, stops=(STOP,)),)),
     Card("idle", "between two steps", "visitor 3 · exhibit 2 of 5, arm")),
    (State(exchanges=(ASKED, replace(ASKED, service="/other"))),
     Card("step", "saying “hello”", "", 120.0, waits_for="the answer of /say")),
    (State(tree=rows(PAIR), letters="RR-", running={2: 120.0}),
     Card("busy", "runs A", "", 120.0, next="b", uid=2)),
    (State(tree=rows(PAIR), letters="RS-"),
     Card("busy", "runs Sequence", next="the end of the visit", uid=1)),
    (State(tree=rows("<Sleep msec='{ms}'/>"), letters="R", running={1: 120.0}),
     Card("asleep", "asleep", "", 120.0, next="the end of the visit", uid=1)),
    (State(tree=rows("<Sequence><Sleep msec='{ms}'/><A/></Sequence>"), letters="RR-"),
     Card("asleep", "asleep", next="a", uid=2)),
    (State(tree=DELAY, letters="R", running={1: 120.0}),
     Card("asleep", "asleep", "", 120.0, 124.5, next="the end of the visit", uid=1)),
    (State(tree=DELAY, letters="R"),
     Card("asleep", "asleep", next="the end of the visit", uid=1)),
    (State(tree=rows("<OwnWait for='4500'/>"), letters="R", running={1: 120.0}),
     Card("asleep", "asleep", "", 120.0, 124.5, next="the end of the visit", uid=1)),
    (State(tree=rows("<A name='d'/>"), letters="R", running={1: 120.0}),
     Card("busy", "runs d (A)", "", 120.0, next="the end of the visit", uid=1)),
    (State(tree=TreeShown("", [TreeNode("d", "Wait", "", 0)]), letters="R"),
     Card("busy", "runs Wait", uid=1)),
    (State(tree=rows("<A/>"), held={9: 100.0, 1: 120.0}),
     Card("held", "held by a breakpoint of Groot2 at A", "", 120.0,
          waits_for="its release in Groot2", uid=1)),
    (State(held={1: 120.0}),
     Card("held", "held by a breakpoint of Groot2 at node 1", "", 120.0,
          waits_for="its release in Groot2", uid=1)),
    (State(suspended=("waits for start", 120.0), visits=(VISIT,)),
     Card("paused", "waits for start", "visitor 3", 120.0, waits_for="the operator")),
    (State(suspended=("waits for start", 120.0), resume="/lab/tour/start"),
     Card("paused", "waits for start", "", 120.0,
          waits_for="the operator: rosservice call /lab/tour/start")),
    (State(at=130.0, finished=STOPPED, held={1: 120.0}), Card("ended", "stopped", "", 130.0))])
def test_the_card_of_a_model(state, expected):
    assert card(state) == expected


@pytest.mark.parametrize("step, expected", [
    (Step("driving", 100.0, 180.0, 2, False, call=7),
     Card("step", "driving", "", 100.0, 280.0, 1, 1, "the answer of /say", "", "b", 2)),
    (Step("driving", 100.0, 0.0, 3, False, attempt=2, attempts=3, call=8),
     Card("step", "driving", "", 100.0, None, 2, 3, "", "", "the end of the visit", 3)),
    (Step("waiting", 100.0, 0.0, 2, True), Card("wait", "waiting", "", 100.0, next="b", uid=2))])
def test_the_card_of_a_step(step, expected):
    state = State(tree=rows(PAIR), steps=(step,), exchanges=(ASKED,))
    assert card(state) == expected
    due = "the end of the safe state"
    assert card(replace(state, due=due)) == replace(expected, next=due)


SHIFTS = """
window.moved = 0; window.shifted = [];  // the page has a shift of its own
new PerformanceObserver(list => { for (const entry of list.getEntries()) {
  if (entry.hadRecentInput) continue;
  moved += entry.value;
  if (entry.value > 0.01)
    shifted.push(entry.sources.map(({node}) => node && (node.id || node.nodeName)));
} }).observe({type: "layout-shift", buffered: true});"""


HEADS = """
return arguments[0].map(robot => {
  showRobot(robot);
  return document.querySelector("header").offsetHeight})"""
IS_SHOWN = """
const box = byId("robot-state").getBoundingClientRect();
return ["alive", "place", "attention", "movement"].every(
  id => byId(id).getBoundingClientRect().bottom <= box.bottom + 1)"""


WELL = RobotLine(True, "all nodes in use answer", "off", "off", "at home")
LOST = RobotLine(False, "/robotNavigation/set_goal is gone", "on (scanning)", "unknown",
                 "last seen at Robot arm, on the way to Camera wall", "",
                 "Restart /robotNavigation; take the robot home")
FREE_BELOW = """
return [byId("head").getBoundingClientRect().bottom - byId("movement").getBoundingClientRect().bottom,
  parseFloat(getComputedStyle(byId("robot")).lineHeight)]"""


@pytest.mark.slow
def test_what_is_so_with_the_robot_moves_nothing_and_fills_the_head(show, browser, screen):
    drives = replace(WELL, place="driving to Camera wall", attention="on (scanning)")
    open_page(browser, show(Rig()))
    for width, height in SCREENS + [(320, 640)]:
        screen(width, height)
        heads = browser.execute_script(HEADS, [asdict(robot) for robot in (WELL, drives, LOST)])
        assert len(set(heads)) == 1  # the instruction takes the place of the status
        browser.execute_script("showRobot(arguments[0])", asdict(WELL))
        assert browser.execute_script(IS_SHOWN)  # without a touch
        browser.execute_script("showRobot(arguments[0]); byId('robot').focus()", asdict(LOST))
        assert browser.execute_script(IS_SHOWN)  # that has stepped aside, with one
        browser.execute_script("byId('robot').blur(); showRobot(arguments[0])",
                               asdict(replace(WELL, attention="on (scanning)", movement="on")))
        free, line = browser.execute_script(FREE_BELOW)
        # each of the lines that are kept for the robot has something in it
        assert free < 0.5 * line or width == 320, width


@pytest.mark.slow
def test_what_a_person_has_to_do_is_never_cut(show, browser, screen):
    line = RobotLine(False, "/robotNavigation/set_goal is gone", "on", "unknown", "at home",
                     "safe state not reached: attention and lifelike movement may be on")
    open_page(browser, show(Rig()))
    for width, height in SCREENS + [(320, 640), (320, 256), (640, 360)]:
        screen(width, height)
        for words in (1, 8, 20, 40):
            robot = replace(line, instruction=" ".join(["Restart", "/robotNavigation,"] * words))
            browser.execute_script("showRobot(arguments[0]); keepHeight()", asdict(robot))
            assert browser.execute_script(IS_WHOLE, ["instruction", "safe"]), (width, words)


def shift_on_page(browser, act):
    """Return by how much the layout of the page shifts while ``act()`` happens."""
    time.sleep(0.5)
    browser.execute_script(SHIFTS)
    act()
    time.sleep(0.5)
    width, shift, places = browser.execute_script("return [innerWidth, moved, shifted]")
    print("layout shift at {} px: {:.3f} {}".format(width, shift, places[:20]))
    return shift


@pytest.mark.slow
@pytest.mark.parametrize("width, height", [(320, 640), (1280, 800)])
def test_a_long_instruction_moves_the_page_once(show, browser, screen, width, height):
    line = RobotLine(False, "x is gone", "on", "unknown", "at home")

    def act():
        for text in ("Restart /{}; take the robot home".format(", /".join(["robotNavigation"] * 9)),
                     "", "Take the robot home") * 4:
            browser.execute_script("showRobot(arguments[0]); keepHeight()",
                                   asdict(replace(line, instruction=text)))
            time.sleep(0.05)

    screen(width, height)
    open_page(browser, show(Rig()))
    assert shift_on_page(browser, act) < 0.1  # to and fro, it would be ten times as much


@pytest.mark.slow
@pytest.mark.parametrize("width, height", [(400, 800), (800, 1180), (1280, 800)])
def test_nothing_jumps_during_a_tour_with_failures(show, browser, screen, width, height):
    rig = Rig(answer=refusing(PerformGesture))
    visitor, waits = visitor_who("yes"), []

    def seen_by_the_page(rig):
        waits.append(time.sleep(0.15))
        if len(waits) == 6:
            rig.mission.health.report(GONE, gone())
        elif len(waits) == 9:
            rig.mission.health.report(GONE, BACK)
        visitor(rig)

    screen(width, height)
    open_page(browser, show(rig))
    shift = shift_on_page(browser, lambda: rig.run(seen_by_the_page, runs=2))
    assert len(waits) > 10 and shift < 0.1


SEEN_ON_PAGE = (HealthChanged, PassFinished, Paused, Recovered, Recovering)


def nearly_all_calls_fail():
    """Return what happens on six visits, with the times."""
    test = dataclasses.replace(CALM, arrival_rate=600.0, random_seed=1, failure_rate=0.9,
                               mission_runs=6)
    played = LoadedMission(settings.defaults()).play(test)
    return [line for line in played.events if not isinstance(line[1], TreeShown)]


@pytest.mark.long
@pytest.mark.timing
@pytest.mark.parametrize("width, height", [(400, 800), (1280, 800)])
def test_nothing_jumps_while_nearly_all_fails(show, browser, screen, monkeypatch, width, height):
    rig = Rig()
    use_time_of(rig, monkeypatch)
    shown, instructions = show(rig), set()

    def happens(event):
        rig.mission.events.emit(event)
        if isinstance(event, SEEN_ON_PAGE):
            time.sleep(0.15)
            instructions.add(shown.page.board.part("now")["robot"]["instruction"])

    def act():
        for at, event in nearly_all_calls_fail():
            rig.clock.set_to(at)
            happens(event)
        for service in INTERFACE.services:
            happens(replace(gone(), name=service.name, node=service.node))

    screen(width, height)
    open_page(browser, shown)
    assert shift_on_page(browser, act) < 0.3  # on six visits, and with all that is lost
    assert browser.execute_script("return innerWidth") == width
    assert "" in instructions and max(map(len, instructions)) > 100
    assert browser.execute_script(IS_WHOLE, ["instruction", "safe"])


SCRUB = """
const [at, done] = arguments, began = performance.now(), scrub = byId("scrub"), show = travels.show;
travels.show = parts => {
  show(parts);
  travels.show = show;
  requestAnimationFrame(() => setTimeout(() => done(performance.now() - began)));
};
[scrub.min, scrub.max, scrub.value] = [0, 2 * at, at];
scrub.dispatchEvent(new Event("input"))"""
SEEN = """
const rows = [...document.querySelectorAll("#transcript [data-number]")].map(one => Number(one.dataset.at));
const entries = [...byId("blackboard").tBodies[0].rows].map(row => [...row.cells].map(cell => cell.textContent));
const ill = document.querySelectorAll("#health .ill").length, alarms = byId("alarms").childElementCount;
return {ill: ill && alarms, letters, stops: byId("stops").childElementCount, told: rows, entries: Object.fromEntries(entries)}"""


def scrub(browser, at):
    """Choose a moment, and return in how many milliseconds it is on the screen."""
    return browser.execute_async_script(SCRUB, at)


@pytest.mark.slow
def test_any_moment_can_be_shown_again_and_now_comes_back(show, browser, monkeypatch):
    rig = Rig(answer=refusing(PerformGesture))
    use_time_of(rig, monkeypatch)
    played, shown, moments = Situation(rig), show(rig), []

    def loses_a_node(rig):
        moments.append(rig.clock.now())
        if len(moments) == 6:
            rig.mission.health.report(GONE, gone())
        visitor_who("yes")(rig)

    rig.run(loses_a_node)
    lost = moments[5]
    open_page(browser, shown)
    wait_until(lambda: "ended" in browser.execute_script("return document.body.className"))
    assert browser.execute_script("return document.getElementById('ready').hidden")
    times = sorted({line.time for line in played.run.lines})
    assert len(times) > 8
    for at in times[1:-1:3]:
        scrub(browser, at)
        state = played.run.at(at)
        fields, seen = browser.execute_script(FIELDS), browser.execute_script(SEEN)
        assert (fields["kind"], fields["what"]) == (card(state).kind, card(state).what)
        assert fields["robot"][1] == robot_line(state).place
        assert seen["letters"] == state.letters
        assert seen["stops"] == len(state.visit.stops)
        assert seen["told"] and max(seen["told"]) <= at
        assert seen["entries"].get("currentExhibit") == state.entries.get("currentExhibit")
        assert seen["ill"] == len(state.robot.ill) == (0 if at < lost else 1)
    assert "currentExhibit" in played.run.state.entries
    chosen = browser.execute_script("""
        const one = document.querySelectorAll("#transcript time")[2];
        const at = Number(one.parentElement.dataset.at);
        one.click();
        return at""")
    wait_until(lambda: browser.execute_script(SEEN)["letters"] == played.run.at(chosen).letters)
    assert browser.execute_script("return frozen") == chosen
    browser.execute_script("byId('live').click()")
    assert browser.execute_script(FIELDS)["kind"] == "ended"
    assert browser.execute_script(SEEN)["letters"] == played.run.state.letters


@pytest.mark.timing
def test_a_run_of_a_day_stays_quick(show, browser, monkeypatch):
    rig, visits = Rig(answer=refusing(PerformGesture)), 200
    use_time_of(rig, monkeypatch)
    visit = Situation(rig)
    rig.run(visitor_who("yes"))
    began, length = visit.run.lines[0].time, rig.clock.now() - visit.run.lines[0].time
    other = Rig()
    use_time_of(other, monkeypatch)
    shown = show(other)
    for number in range(visits):
        for line in visit.run.lines[2:-1]:
            other.clock.set_to(began + number * length + line.time - began)
            event = line.event
            if isinstance(event, PassStarted):
                event = replace(event, number=number + 1)
            other.mission.events.emit(event)
    open_page(browser, shown)
    wait_until(lambda: text(browser, "#visitor").startswith("Visitor {}".format(visits)), 60.0)
    took = []
    for number in range(0, visits, 7):
        took.append(scrub(browser, began + (number + 0.9) * length))
        assert text(browser, "#visitor").startswith("Visitor {}".format(number + 1))
    print("{} events; a scrub takes {:.0f} ms, at most {:.0f}".format(
        visits * len(visit.run.lines), sorted(took)[len(took) // 2], max(took)))
    assert sorted(took)[len(took) // 2] < 300.0  # of a fold of the whole day: seconds


@pytest.mark.slow
def test_the_stream_of_a_tour_weighs_little(show):
    shown = show(Rig(answer=refusing(PerformGesture)))
    request = urllib.request.Request(shown.url + "events", headers={"Accept-Encoding": "gzip"})
    with urllib.request.urlopen(request, timeout=5) as stream:
        wait_until(lambda: shown.page.streams)
        first, visitor = len(stream.read1(1_000_000)), visitor_who("yes")

        def slowly(rig):
            time.sleep(0.02)
            visitor(rig)

        began = time.monotonic()
        shown.rig.run(slowly, runs=3)
        took, sent = time.monotonic() - began, 0
        shown.page.close()
        for part in iter(lambda: stream.read1(1_000_000), b""):
            sent += len(part)
    told = len(shown.page.board.part("story")["sentences"])
    print("{} bytes at first, then {} for {} sentences in {:.1f} s".format(first, sent, told, took))
    assert told > 50 and sent < 400 * told
