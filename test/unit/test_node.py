"""The whole node, as a process of its own, beside a robot and a master in this process."""
import contextlib
import os
import signal
import struct
import time
import types
import xmlrpc.client

import pytest

pytest.importorskip("rospy", reason="needs ROS")

from std_srvs.srv import Trigger, TriggerResponse  # noqa: E402

from behavior_controller.robot.d543 import INTERFACE  # noqa: E402
from behavior_controller.robot.requests import Say, SetAnimation, SetAttention  # noqa: E402
from behavior_controller.ros import node  # noqa: E402
from behavior_controller.ros.master import Place  # noqa: E402
from behavior_controller.ros.service_client import open_service  # noqa: E402
from behavior_controller.ros.tcpros import Connection, open_publisher  # noqa: E402
from behavior_controller.ros.types import CLOCK  # noqa: E402
from node_rig import Rig, SAYS  # noqa: E402
from ros_peers import HANG, TcprosPeer, answer_of, hang, read_block, until  # noqa: E402

pytestmark = pytest.mark.slow

SPEECH = INTERFACE.service(Say)
SAFE = [INTERFACE.service(kind) for kind in (SetAnimation, SetAttention)]
ME = "/behaviorController"


@pytest.fixture
def rig(tmp_path, monkeypatch):
    made = Rig(tmp_path)
    monkeypatch.setenv("ROS_MASTER_URI", made.master.uri)
    yield made
    made.close()


def calls(rig, method):
    return [call[1:] for call in rig.master.calls if call[0] == method]


def uri_of(rig):
    """Return the address of the node, which registers at the master."""
    until(lambda: calls(rig, "registerPublisher"))
    return calls(rig, "registerPublisher")[0][2]


@pytest.mark.parametrize("answer, code, outcome", [
    ({}, 0, "all passes are done; pass 1 was a SUCCESS (exit code 0)"),
    ({"success": False}, 3, "all passes are done; pass 1 was a FAILURE (exit code 3)")])
def test_a_run_from_its_announcement_to_the_safe_state(rig, answer, code, outcome):
    rig.offers(SPEECH, *[answer_of(SPEECH, **answer)] * 5)
    rig.master.parameters[ME] = {"missionRuns": 7, "asrEnabled": False}
    found, text = rig.start(recordDirectory=rig.folder + "/r").code()
    assert found == code, text
    for words in ("parameters of the node override the configuration: scenarioSpecification m, ",
                  "asrEnabled False, missionRuns 1", "3 nodes; language English; speech "
                  "recognition off; verbose mode off", outcome, "record: " + rig.folder,
                  "record of this run: " + rig.folder, "attention and lifelike movement are off"):
        assert words in text, text
    assert "Traceback" not in text and "page" not in text
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


@pytest.mark.parametrize("arguments, words", [
    (["walk"], ["command line: unknown argument 'walk'", "allowed: _key:=value, /name:=/other_"]),
    (["_missionRuns:=x"], ["missionRuns cannot be \"x\"", "1 mistake, see above"]),
    (["__name:=a b"], ["argument __name:=a b: this is not the name of a node"])])
def test_what_is_wrong_with_the_input_is_told_and_nothing_is_started(rig, arguments, words):
    code, text = rig.start(*arguments).code()
    assert code == 2 and all(each in text for each in words), text
    assert not calls(rig, "registerPublisher") and not rig.services[SPEECH].connections


@pytest.mark.parametrize("wish, words", [
    ("--help", ["usage: rosrun", "missionRuns", "exit codes: 0"]),
    ("--version", ["behaviorController "])])
def test_what_asks_for_words_starts_nothing(rig, wish, words):
    code, text = rig.start(wish).code()
    assert code == 0 and all(each in text for each in words), text
    assert not rig.master.calls


def test_what_is_missing_is_told_with_the_node_that_has_it(rig):
    del rig.master.services[SPEECH.name]
    code, text = rig.start().code()
    assert code == 1, text
    assert "1 of the 1 services and topics that the mission needs are missing:" in text
    assert "service /textToSpeech/say_text (of node /textToSpeech): not advertised" in text
    assert not calls(rig, "registerPublisher")


def test_without_a_master_nothing_is_started(rig):
    rig.master.close()
    code, text = rig.start().code()
    assert code == 1 and "no ROS master at " + rig.master.uri in text, text
    assert "ROS_MASTER_URI" in text and text.count("\n") == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_asks_for_the_safe_state_and_ends_in_time(rig, number):
    rig.offers(SPEECH, HANG)
    node = rig.start()
    until(lambda: rig.services[SPEECH].requests)
    code, text, seconds = node.stop(number)
    assert code in (0, 3) and seconds < 4.0, text
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


def test_a_stop_while_the_robot_is_awaited(rig):
    del rig.master.services[SPEECH.name]
    node = rig.start(startupTimeout=60)
    node.says(" s for /textToSpeech/say_text")
    code, text, _ = node.stop()
    assert code == 1 and "stopped before the mission began" in text
    assert not any(rig.services[each].requests for each in SAFE)


def test_a_leaf_that_blocks_does_not_keep_the_robot_from_the_safe_state(rig):
    rig.mission("<Sleep msec='1'/>")
    node = rig.start(run="import time; from behavior_controller.bt.engine.builtins import Sleep"
                            "\nSleep.on_start = lambda self: time.sleep(60)\nnode.run()")
    node.says("a pass begins")
    time.sleep(0.5)
    code, text, seconds = node.stop()
    assert code == 4 and seconds < 4.0 and "stopping without the tree: " in text, text
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


def test_an_internal_error_makes_the_robot_safe_and_shows_no_traceback(rig):
    code, text = rig.start(run="node.Runner.run = lambda self: 1 / 0; node.run()").code()
    assert code == 4 and "internal error (ZeroDivisionError: division by zero)" in text, text
    assert "Traceback" not in text
    with open(text.partition("with the details in ")[2].split("\n")[0], encoding="utf-8") as file:
        assert "Traceback" in file.read()
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


def test_a_node_that_cannot_stop_is_ended_all_the_same(rig):
    node = rig.start(run="import time; node.Runner.run = lambda self: time.sleep(60); node.run()")
    until(lambda: calls(rig, "registerService"))
    time.sleep(0.5)
    code, text, seconds = node.stop()
    assert code == 4 and 1.7 < seconds < 4.0, text
    assert "[ERROR] did not stop in time: ending now; make sure that the robot has stopped" in text


# ----------------------------------------------------------------------------- while others ask it


def ask(rig, method, *arguments):
    return getattr(xmlrpc.client.ServerProxy(uri_of(rig)), method)("/t", *arguments)


def test_what_other_nodes_ask_it(rig):
    rig.offers(SPEECH, HANG)
    node = rig.start()
    until(lambda: rig.services[SPEECH].requests)
    asked = sorted(each.name for each in (SPEECH, *SAFE))
    assert ask(rig, "servicesInUse") == [1, "services", [True, asked]]
    # its name is its own: only a node that has taken it ends it
    taken = "[/x] Reason: new node registered with same name"
    assert ask(rig, "shutdown", taken)[1] == "the name is still taken by this node"
    assert node.process.poll() is None
    rig.master.nodes[ME] = "http://other:1/"
    with contextlib.suppress(OSError):  # it may have seen that in the master's list before
        ask(rig, "shutdown", taken)
    code, text = node.code()
    assert code == 0 and "another node was started under the name " + ME in text, text
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


def test_a_node_that_another_asks_to_end_makes_the_robot_safe(rig):
    rig.offers(SPEECH, HANG)
    node = rig.start()
    until(lambda: rig.services[SPEECH].requests)
    with contextlib.suppress(OSError):  # it may end without an answer
        ask(rig, "shutdown", "user request")
    code, text = node.code()
    assert code in (0, 3) and "internal error" not in text, text
    assert [len(rig.services[each].requests) for each in SAFE] == [1, 1]


def call(rig, name):
    """Call an operator's service; return whether it is done, and what it says."""
    until(lambda: [each for each in calls(rig, "registerService") if each[0] == ME + name])
    uri = next(each[1] for each in calls(rig, "registerService") if each[0] == ME + name)
    connection = Connection()
    open_service(Place(uri, True), connection, ME + name, Trigger._md5sum, 5.0)
    connection.send(b"\0\0\0\0")
    ok, length = connection.receive(1), connection.receive(4)
    answer = TriggerResponse().deserialize(connection.receive(int.from_bytes(length, "little")))
    connection.hang_up()
    assert ok == b"\1"
    return answer.success, answer.message


def test_an_operator_starts_pauses_reloads_and_stops(rig):
    node = rig.start(rosInterface="true", startBy="operator", missionRuns=0)
    node.says("waiting for the operator")
    assert call(rig, "/start") == (True, "the mission goes on")
    until(lambda: rig.services[SPEECH].requests)
    assert call(rig, "/start") == (True, "the mission runs")
    assert call(rig, "/pause")[0]
    node.says("paused by the operator")
    rig.mission(SAYS + SAYS)
    done, words = call(rig, "/reload")
    assert done and "the files are read" in words
    node.says("reloaded: this mission follows")
    connection = Connection()
    header = open_publisher(connection, uri_of(rig), ME + "/state")
    assert header["latching"] == "1"
    until(lambda: b"paused by the operator" in read_block(connection._socket))
    connection.hang_up()
    before = len(rig.services[SPEECH].requests)
    call(rig, "/start")
    until(lambda: len(rig.services[SPEECH].requests) >= before + 2)
    assert call(rig, "/stop") == (True, "the robot is asked for the safe state, and the node ends")
    code, text = node.code()
    assert code == 0 and "4 nodes" in text, text


@pytest.mark.parametrize("change, words", [
    (lambda rig: rig.mission("<Unknown/>"), "refused, the running mission stays: 1 mistake"),
    (lambda rig: rig.master.parameters.update({ME: {"robotInterface": "release-1.0"}}),
     "robotInterface release-1.0 cannot follow D5.4.3 while the node runs; start the node again"),
    (lambda rig: rig.mission(SAYS + SAYS), "reloaded: this mission follows when the visitor's pass "
                                           "is over")])
def test_a_hang_up_has_the_files_read_again(rig, change, words):
    rig.offers(SPEECH, HANG)
    node = rig.start(missionRuns=0)
    until(lambda: rig.services[SPEECH].requests)
    change(rig)
    node.process.send_signal(signal.SIGHUP)
    node.says(words)
    assert node.process.poll() is None and node.stop()[0] in (0, 3)


# ----------------------------------------------------------------------------------------- the rest


@pytest.mark.parametrize("value, words", [
    ("yes", "the parameter /use_sim_time is 'yes', and must be true or false"),
    (False, ""), (True, "and no time comes on /clock: no node publishes it")])
def test_whether_the_time_is_simulated(rig, value, words):
    rig.master.parameters["/use_sim_time"] = value
    code, text = rig.start().code()
    assert code == (1 if value is True else 0) and words in text, text
    assert ("use_sim_time" in text) is bool(words)


@pytest.mark.parametrize("path, words", [
    ("run.log", ""), ("config", "no log file is written to {}: it is not a regular file; the node "
                                "goes on")])
def test_the_log_file(rig, path, words):
    path = os.path.join(rig.folder, path)
    code, text = rig.start("__log:=" + path).code()
    assert code == 0 and words.format(path) in text, text
    assert ("no log file" in text) is bool(words)
    if not words:
        with open(path, encoding="utf-8") as file:
            assert "pass 1: SUCCESS" in file.read()


def test_what_the_start_knows_of_others(rig):
    """A former node that goes on beside this one, and a package that is not as it should be."""
    former = TcprosPeer(hang)
    rig.master.nodes[ME] = "http://127.0.0.1:{}/".format(former.port)
    code, text = rig.start(run="from behavior_controller.ros import master\n"
                               "master.PARTING_LIMIT = 0.3\n"
                               "node.extensions.doubts.append('an odd package')\nnode.run()").code()
    assert code == 0 and f"[WARN] the former node of the name {ME} (at http://127" in text, text
    assert "[WARN] an odd package" in text
    former.close()


def test_after_a_start_that_is_refused_it_is_said_what_the_run_before_may_still_do(rig):
    code, text = rig.start("walk", run="node.may_be_live = lambda *_: 'it drives'\n"
                                       "node.run()").code()
    assert code == 2 and text.endswith("[WARN] it drives"), text


HANGS = """import time
real, calls = node.read_plan, []
def read(*arguments):
    calls.append(1)
    if len(calls) > {}:
        time.sleep(60)
    return real(*arguments)
node.read_plan, node.START_STEP_LIMIT = read, 1.5
node.run()"""


@pytest.mark.parametrize("may_answer, code, words", [
    (False, 1, "no longer answers: start it again"),
    (True, 2, "configuration and mission (their files, or the parameters of the ROS master): no "
              "answer within 1.5 s")])
def test_what_hangs_ends_the_start(rig, may_answer, code, words):
    if not may_answer:
        rig.master.may_answer.clear()
    found, text = rig.start(run=HANGS.format(0)).code()
    rig.master.may_answer.set()
    assert found == code and words in text, text


def test_files_that_hang_are_read_once_and_the_mission_goes_on(rig):
    node = rig.start(run=HANGS.format(1), missionRuns=0, rosInterface="true", startBy="operator")
    node.says("waiting for the operator")
    assert call(rig, "/reload")[0]
    assert call(rig, "/reload") == (False, "the files are still being read since the call before")
    node.process.send_signal(signal.SIGHUP)
    node.says("SIGHUP ignored: the files are still being read since the one before")
    assert call(rig, "/start")[0]
    until(lambda: rig.services[SPEECH].requests)
    assert node.stop()[0] == 0


def test_a_robot_that_does_not_answer_delays_the_end_no_more_than_is_allowed(rig):
    rig.offers(SPEECH, HANG)
    rig.offers(SAFE[0], HANG)
    node = rig.start()
    until(lambda: rig.services[SPEECH].requests)
    code, text, seconds = node.stop()
    assert code in (0, 3) and 0.9 < seconds < 4.0, text
    assert "stopping without the tree" not in text
    assert len(rig.services[SAFE[1]].requests) == 1


def test_a_mission_goes_by_the_time_of_its_topic(rig):
    clock = rig.publishes(CLOCK)
    rig.master.parameters["/use_sim_time"] = True
    node = rig.start()
    for seconds in range(5, 400):
        if node.process.poll() is not None:
            break
        with contextlib.suppress(AssertionError, OSError):
            until(lambda: clock.ready, 0.05)
            clock.send(struct.pack("<III", 8, seconds, 0))
        time.sleep(0.05)
    code, text = node.code()
    assert code == 0 and "the mission goes by the simulated time on /clock" in text, text


@pytest.mark.parametrize("error, package, told", [
    (SystemExit(), None, []), (ValueError("x"), None, ["internal ValueError('x')"]),
    (ValueError("x"), "package p: x", ["error package p: x"]),
    (RuntimeError("can't start new thread"), "p", ["internal RuntimeError(\"can't start new thread"
                                                   "\")"])])
def test_what_has_ended_a_thread(monkeypatch, error, package, told):
    found = []
    console = types.SimpleNamespace(
        report_internal_error=lambda error: found.append(f"internal {error!r}"),
        tell=lambda severity, text: found.append(f"{severity} {text}"))
    monkeypatch.setattr(node.extensions, "thread_failure", lambda error: package)
    node._report_thread(console, error)
    assert found == told
