"""tryRobot: which words it understands, which request they mean, and how it tells the result."""
import pytest

from behavior_controller.config import settings
from behavior_controller.robot import d543
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, PerformGesture, Point, Say, SetAttention)
from behavior_controller.ros import try_robot
from behavior_controller.ros.try_robot import read_words, request_of

pytestmark = pytest.mark.slow

SETTINGS = settings.defaults(language="Kinyarwanda", welcomeGestureId=7, gestureDuration=1500)


@pytest.mark.parametrize("words, request_meant", [
    ("say Hello", Say("Hello", "Kinyarwanda")),
    ("say Hello -5 times", Say("Hello -5 times", "Kinyarwanda")),
    ("gesture welcome", PerformGesture("iconic", 7, 1500)),
    ("gesture goodbye", PerformGesture("iconic", 3, 1500)),
    *((f"attention {mode}", SetAttention(mode))
      for mode in ("disabled", "social", "scanning", "seeking")),
    ("attention location 2 -1 1.5", SetAttention("location", Point(2.0, -1.0, 1.5)))])
def test_the_request_that_words_mean(words, request_meant):
    assert request_of(*read_words(words.split()), SETTINGS) == request_meant


def test_a_robot_of_a_release_speaks_the_language_of_its_culture_file():
    chosen = settings.defaults(robotInterface="release-1.0", language="Kinyarwanda")
    assert request_of("say", ["Hello"], chosen) == Say("Hello", "English")


@pytest.mark.parametrize("words, said", [
    ([], "required: kind, words"), (["say"], "required: words"), (["say", " "], "no text to say"),
    (["sing", "a song"], "choose from"),
    (["gesture", "goodby"],
     "no gesture 'goodby'; allowed: welcome, goodbye (did you mean goodbye?"),
    (["gesture", "welcome", "2"], "nothing follows welcome, not '2'"),
    (["attention", "sleeping"], "no mode of attention 'sleeping'; allowed: disabled, social, "
                                "scanning, seeking, location"),
    (["attention", "social", "1", "2", "3"], "nothing follows social, not '1'"),
    (["attention", "location"], "location needs three numbers: X Y Z"),
    (["attention", "location", "1", "2", "nan"], "location needs three numbers: X Y Z"),
    (["attention", "location", "1", "2", "up"], "location needs three numbers: X Y Z"),
    (["say", "Hello", "--loud"], "unrecognized arguments: --loud")])
def test_words_that_mean_nothing_are_told_with_those_that_are_allowed(capsys, words, said):
    with pytest.raises(SystemExit) as ended:
        read_words(words)
    assert ended.value.code == 2 and said in capsys.readouterr().err


GESTURE = d543.INTERFACE.service(PerformGesture)
SPEECH = d543.INTERFACE.service(Say)
MODE = d543.INTERFACE.service(SetAttention)
WAVE = PerformGesture("iconic", 1, 3000)
OFF = "with: rosrun cssr_system tryRobot attention disabled"


def failed(cause):
    return Failure(cause, "so", "/x")


@pytest.mark.parametrize("asked, service, result, code, lines", [
    (WAVE, GESTURE, Answer(), 0, ["done, after 1.2 s"]),
    (WAVE, GESTURE, failed(Cause.REFUSED), 3, ["refused: so"]),
    (WAVE, GESTURE, failed(Cause.NO_ANSWER), 3,
     ["no answer in time: so",
      "may still be making iconic gesture 1: keep the stop button at hand"]),
    (WAVE, GESTURE, failed(Cause.NOT_ADVERTISED), 1, ["not there: so"]),
    (WAVE, GESTURE, failed(Cause.NOT_REACHABLE), 1, ["not there: so"]),
    (WAVE, GESTURE, failed(Cause.TYPE_MISMATCH), 1, ["of another type: so"]),
    (Say("x"), SPEECH, failed(Cause.CONNECTION_LOST), 3,
     ["connection lost: so", "may still be saying “x”"]),
    (SetAttention("social"), MODE, Answer(), 0,
     ["done", "attention stays on; switch it off " + OFF]),
    (SetAttention("social"), MODE, failed(Cause.NO_ANSWER), 3,
     ["no answer in time", "attention may stay on; switch it off " + OFF]),
    (SetAttention("social"), MODE, failed(Cause.REFUSED), 3, ["refused"]),
    (SetAttention("disabled"), MODE, Answer(), 0, ["done"])])
def test_what_is_said_of_a_result(capsys, asked, service, result, code, lines):
    assert try_robot._report(asked, service, result, 1.23) == code
    out, err = capsys.readouterr()
    told = (err if code else out).splitlines()
    assert bool(out) is not bool(code) and len(told) == len(lines)
    assert told[0].startswith(f"tryRobot: {service.name}: ")
    assert all(words in line for words, line in zip(lines, told))


def test_what_a_robot_does_not_offer_is_told_and_nothing_is_asked(capsys, monkeypatch):
    monkeypatch.setattr(try_robot, "check_unused", pytest.fail)
    robot = SETTINGS.interface
    mute = type(robot)(robot.name, tuple(each for each in robot.services if each is not SPEECH),
                       robot.topics, robot.safe_state, robot.senses)
    monkeypatch.setattr(type(SETTINGS), "interface", mute)
    assert try_robot._try(SETTINGS, Say("x"), []) == 2
    assert capsys.readouterr().err == "tryRobot: the robot D5.4.3 does not offer this\n"


# -------------------------------------------------------- the whole program, beside a robot in here


@pytest.fixture
def rig(tmp_path):
    from node_rig import Rig  # not where there is no ROS
    made = Rig(tmp_path)
    yield made
    made.close()


TRY = "import sys; sys.exit(try_robot.main())"


def test_the_robot_is_asked_and_its_answer_told(rig):
    code, text = rig.start("say", "Good", "day", run=TRY).code()
    assert code == 0, text
    assert [request[8:] for request in rig.services[SPEECH].requests] == [b"Good day"]
    asks, answer = text.splitlines()
    assert asks == ("tryRobot: asks the service /textToSpeech/say_text: saying “Good day”; waits "
                    "up to 60 s")
    assert answer.startswith("tryRobot: /textToSpeech/say_text: done, after 0.")


def test_a_ctrl_c_ends_the_wait_for_an_answer_and_says_what_may_be(rig):
    from ros_peers import HANG, until
    rig.offers(SPEECH, HANG)
    node = rig.start("say", "Good", "day", run=TRY)
    until(lambda: rig.services[SPEECH].requests)
    node.says("waits up to 60 s")
    code, text, seconds = node.stop()
    assert code == 3 and seconds < 4.0, text
    assert "connection lost: stopped by Ctrl-C" in text and "may still be saying" in text


@pytest.mark.parametrize("arguments, code, words", [
    (["_langauge:=English"], 2, "langauge"), (["_robotInterface:=release-3"], 2, "release-3"),
    (["robotInterface:=release-3"], 2, "release-3"),  # as roslaunch gives it
    (["__name:=a b"], 2, "is not the name of a node")])
def test_what_keeps_the_program_from_asking(rig, arguments, code, words):
    found, text = rig.start("say", "x", *arguments, run=TRY).code()
    assert found == code and words in text and "Traceback" not in text, text
    assert not rig.services[SPEECH].requests


def test_without_a_master_the_robot_is_asked_nothing(rig):
    rig.master.close()
    code, text = rig.start("say", "x", run=TRY).code()
    assert code == 1 and "tryRobot: no ROS master at" in text, text


def test_while_a_mission_uses_the_robot_nothing_is_asked(rig):
    from ros_peers import RpcPeer
    other = RpcPeer()
    other.servicesInUse = lambda caller: (1, "", [True, [SPEECH.name]])
    rig.master.publishers["/rosout"], rig.master.nodes["/c"] = ["/c"], other.uri
    code, text = rig.start("say", "x", run=TRY).code()
    assert code == 1 and "node /c already controls this robot" in text, text
    assert not rig.services[SPEECH].requests
    other.close()
