"""Whether what is declared fits the ROS types: what does not is told by name when it is declared.
"""
import dataclasses

import pytest

pytest.importorskip("rospy", reason="needs ROS")

import genpy  # noqa: E402

from behavior_controller.robot.d543 import INTERFACE, SPEECH  # noqa: E402
from behavior_controller.robot import release_1_1  # noqa: E402
from behavior_controller.robot.declarations import Publication, Success  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    GoTo, GoToGoal, Location, Request, Say, SayGoal)
from behavior_controller.ros.tcpros import Trouble  # noqa: E402
from behavior_controller.ros.types import TYPES, filled, message_class  # noqa: E402

SAY = INTERFACE.service(Say)
ACTION, SPOKEN = (release_1_1.INTERFACE.service(kind) for kind in (GoToGoal, SayGoal))


class Move(Request, frozen=True):
    """A request for a topic."""

    x: float


def goal(name):
    return Publication(Move, "/goal", "base", "geometry_msgs/PoseStamped",
                       lambda move: ({"stamp": "now"}, {name: {"x": move.x}}), None, 5.0, "none")


def changed(declared, **fields):
    return dataclasses.replace(declared, **fields)


@pytest.mark.parametrize("declared, told", [
    (changed(SAY, type="cssr_system/songService"),
     "the type cssr_system/songService of /textToSpeech/say_text is not built: the package "
     "cssr_system needs srv/songService.srv; build its workspace when that is there"),
    (changed(SAY, type="no_such_package/x"), "the package no_such_package needs srv/x.srv"),
    (changed(ACTION, type="cssr_system/dance"), "needs action/dance.action"),
    (changed(SPEECH, type="std_msgs/Song"), "needs msg/Song.msg"),
    (changed(SAY, success=Success("done", True, False)),
     "the response of cssr_system/textService has no field done, which is to tell the outcome of "
     "/textToSpeech/say_text; it has: success, response"),
    (changed(ACTION, success=Success("done", 1, 0)), "has no field done"),
    (changed(SAY, answer=lambda response: response.text),
     "the declaration of /textToSpeech/say_text reads a field that cssr_system/textService does "
     "not have: 'textServiceResponse' object has no attribute 'text'"),
    (changed(SPEECH, read=lambda message: message.text), "reads a field that std_msgs/String does"),
    (changed(ACTION, answer=lambda result: result.text), "reads a field that cssr_system/driveTo"),
    (changed(ACTION, feedback=lambda feedback: feedback.text),
     "reads a field that cssr_system/dri"),
    (changed(SAY, fields=lambda request: request.text), "returned ''; cssr_system/textService has "
     "the fields message: return a tuple with a value for each"),
    (changed(SPOKEN, fields=lambda request: (1.0,)), "cssr_system/sayText has the fields "),
    (goal("positon"), "No field name")])
def test_what_does_not_fit_its_type_is_told_by_name(declared, told):
    with pytest.raises(ImportError) as raised:
        message_class(declared)
    assert told in str(raised.value)


@pytest.mark.parametrize("declared, kind", [
    (SAY, TYPES[SAY]), (ACTION, TYPES[ACTION]), (SPEECH, TYPES[SPEECH]),
    # neither need have a meaning while it is empty
    (changed(SAY, answer=lambda response: response.response[0],
             fields=lambda request: (request.text[0],)), TYPES[SAY]), (goal("position"), None)])
def test_what_fits_has_its_class(declared, kind):
    assert message_class(declared) is kind or kind is None


def test_a_request_that_does_not_fit_the_message_is_not_sent():
    drive = INTERFACE.service(GoTo)

    def message_of(x):
        request = GoTo(Location(x, 2.0, 3.0))
        return filled(TYPES[drive]._request_class(), drive, request, genpy.Time)

    message = message_of(1.0)
    assert (message.goal_x, message.goal_y, message.goal_theta) == (1.0, 2.0, 3.0)
    with pytest.raises(Trouble, match="cannot be sent as cssr_system/robotNavigationService") as by:
        message_of("far")
    assert by.value.cause is Cause.TYPE_MISMATCH
