"""The robot of release 1.1 and the nodes of its missions: what each asks of the robot, and what
comes of an answer that it gives."""
import pytest

from behavior_controller import leaves
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import FaultsFound
from behavior_controller.leaves.release_1_1 import SPECS
from behavior_controller.robot import release_1_1
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    GoTo, GoToGoal, Location, PerformGestureGoal, Point, SayGoal)
from mission_rig import one_leaf, write

RELEASE = "release-1.1"
ENGLISH = "English"


def rig_of(element, answer=lambda request: NotImplemented, robot=RELEASE, **entries):
    rig = one_leaf(element, answer, robotInterface=robot)
    write(rig, currentExhibit="Forge", description1="First.", description2="Second.",
          targetLocation=Location(1.0, 2.0, 90.0), gestureTarget=Point(1.0, 2.0, 0.5))
    write(rig, **entries)
    return rig


def test_the_six_nodes_are_there():
    assert [spec.id for spec in SPECS] == [
        "SayTextAsync", "DescribeExhibitSpeechAsync", "NavigateAsync",
        "PerformDeicticGestureAsync", "PerformIconicGestureAsync", "GetVisitorResponseAsync"]
    assert {spec.id for spec in leaves.SPECS} >= {spec.id for spec in SPECS}


@pytest.mark.parametrize("element, request_", [
    ("<SayTextAsync name='2'/>", SayGoal("Please follow me.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync/>", SayGoal("First. Second.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync name='1'/>", SayGoal("First. Second.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync name='x'/>", SayGoal("First. Second.", ENGLISH)),
    ("<NavigateAsync/>", GoToGoal(Location(1.0, 2.0, 90.0))),
    ("<PerformIconicGestureAsync name='welcome'/>", PerformGestureGoal("iconic", 1, 3000)),
    ("<PerformIconicGestureAsync name='goodbye'/>", PerformGestureGoal("iconic", 3, 3000))])
def test_what_a_node_asks_of_the_robot(element, request_):
    rig = rig_of(element)
    assert rig.tick() is SUCCESS
    assert rig.requests == [request_] and type(rig.requests[0]) is type(request_)


def test_a_target_at_the_origin_is_not_pointed_at():
    rig = rig_of("<PerformDeicticGestureAsync/>", gestureTarget=Point(0.0, 0.0, 0.0))
    assert (rig.tick(), rig.requests) == (SUCCESS, [])
    # the release's controller takes a sum of 0 for no target
    rig = rig_of("<PerformDeicticGestureAsync/>", gestureTarget=Point(1.0, -1.5, 0.5))
    assert rig.tick() is SUCCESS and rig.requests[0].target == Point(1.0, -1.5, 0.5)


def test_another_gesture_is_a_mistake_at_its_place():
    with pytest.raises(FaultsFound) as caught:
        rig_of("<PerformIconicGestureAsync name='wave'/>")
    fault, = caught.value.faults
    assert fault.line and "wave" in fault.text and "welcome, goodbye" in fault.hint


@pytest.mark.parametrize("element", [
    "<NavigateAsync/>", "<PerformDeicticGestureAsync/>", "<DescribeExhibitSpeechAsync/>"])
def test_without_its_data_a_node_fails_and_asks_nothing(element):
    rig = one_leaf(element, robotInterface=RELEASE)
    assert (rig.tick(), rig.requests) == (FAILURE, [])


def test_a_node_is_running_until_the_result_and_a_halt_cancels_its_goal():
    rig = rig_of("<NavigateAsync/>", lambda request: None)
    assert (rig.tick(), rig.tick()) == (RUNNING, RUNNING)
    rig.tree.halt()
    assert rig.gateway.dropped == [GoToGoal(Location(1.0, 2.0, 90.0))]


def test_a_goal_that_fails_is_a_failure():
    refusal = Failure(Cause.REFUSED, "aborted", "/robotNavigation/set_goal")
    assert rig_of("<NavigateAsync/>", lambda request: refusal).tick() is FAILURE


# ------------------------------------------------------------------- the answer, and substitutes


def test_an_answer_is_heard_and_a_halt_leaves_no_earlier_one():
    told = []
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="yes")
    rig.topics.listen = lambda topic, *more: told.append((topic.name,) + more)
    assert rig.tick() is RUNNING
    assert told == [("/speechEvent/text", 10.0, True)]
    rig.tree.halt()
    assert rig.tree.blackboard.get("visitorResponse") == ""


@pytest.mark.parametrize("said, result, stored", [
    ("YES please", SUCCESS, "yes"), ("no", SUCCESS, "no"), ("Error: sound", FAILURE, "")])
def test_what_was_heard_is_stored(said, result, stored):
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="no")
    assert rig.tick() is RUNNING
    rig.clock.advance(0.1)
    rig.topics.publish(release_1_1.INTERFACE.topic("/speechEvent/text"), said)
    assert rig.tick() is result
    assert rig.tree.blackboard.get("visitorResponse") == stored


def test_nothing_heard_in_ten_seconds_is_no_answer_and_no_failure():
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="yes")
    assert rig.tick() is RUNNING
    rig.clock.advance(9.9)
    assert rig.tick() is RUNNING
    rig.clock.advance(0.2)
    assert (rig.tick(), rig.tree.blackboard.get("visitorResponse")) == (SUCCESS, "")


@pytest.mark.parametrize("robot", ["D5.4.3", "release-1.0"])
def test_a_robot_without_actions_carries_out_the_nodes_by_its_services(robot):
    rig = rig_of("<NavigateAsync/>", robot=robot)
    service = rig.mission.interface.service(GoToGoal)
    assert service is rig.mission.interface.service(GoTo)
    assert rig.mission.interface.used({GoToGoal}, ()) == (service,)
    assert rig.tick() is SUCCESS


def test_service_and_action_of_one_name_stand_in_for_each_other():
    robot = release_1_1.INTERFACE
    pairs = [(GoTo, GoToGoal)] + [(kind.__mro__[1], kind) for kind in (SayGoal, PerformGestureGoal)]
    for plain, goal in pairs:
        service, action = robot.service(plain), robot.service(goal)
        assert (service.kind, action.kind) == ("service", "action")
        assert (robot.substitute(service), robot.substitute(action)) == (action, service)
    assert robot.substitute(robot.services[0]) is None
