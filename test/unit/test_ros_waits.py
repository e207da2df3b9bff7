"""What waits for the robot costs no processor time: a wake-up is cleared before the next wait."""
import dataclasses
import time

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.bt.engine.clock import Clock, SimulatedClock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.config import settings  # noqa: E402
from behavior_controller.errors import NodesMissing  # noqa: E402
from behavior_controller.missions import load  # noqa: E402
from behavior_controller.robot.gateway import Call  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    Answer, Say, SetAnimation, SetAttention)
from behavior_controller.ros import (  # noqa: E402
    node, service_client, simulated_time, startup_check, try_robot)
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.outputs import Outputs  # noqa: E402
from behavior_controller.ros.signals import Signals  # noqa: E402
from behavior_controller.ros.simulated_time import SimulatedTime  # noqa: E402
from behavior_controller.ros.startup_check import StartUpCheck  # noqa: E402
from behavior_controller.ros.subscriber import RosTopics  # noqa: E402
from behavior_controller.run.events import Events, SafeStateReported  # noqa: E402
from ros_peers import HANG, Master, Service  # noqa: E402


class CountedWakeUp(WakeUp):
    """Counts the waits of all instances."""

    waits = 0

    def wait(self, seconds):
        CountedWakeUp.waits += 1
        super().wait(seconds)


@pytest.fixture
def wake(monkeypatch):
    """A wake-up that something else has set."""
    monkeypatch.setattr(CountedWakeUp, "waits", 0)
    found = CountedWakeUp()
    found.emit()
    return found


@pytest.fixture
def master(monkeypatch):
    found = Master()
    monkeypatch.setenv("ROS_MASTER_URI", found.uri)
    rospy.rostime.set_rostime_initialized(True)  # as the node does at its start
    for module in (service_client, simulated_time):
        monkeypatch.setattr(module, "DIRECTORY", Directory())
    yield found
    found.close()


def plan_with(wake, **values):
    chosen = dataclasses.replace(settings.defaults(), **values)
    return load.load(chosen, SimulatedClock(wake.emit), wake)


@pytest.mark.slow
def test_while_the_safe_state_is_awaited(master, wake, console, monkeypatch):
    """One service answers and the other hangs: the answer wakes the wait once."""
    plan = plan_with(wake)
    robot = plan.settings.interface
    answers = Service(master, robot.service(SetAnimation))
    hangs = Service(master, robot.service(SetAttention), HANG)
    told, events = [], Events()
    events.subscribe(told.append)
    run = node._Run(plan, RosTopics(robot.topics, wake.emit, print, plan.tree.clock),
                    Outputs(events, console.tell), console, events,
                    Signals(console, wake.emit, lambda: None), ())
    monkeypatch.setattr(node, "WakeUp", CountedWakeUp)
    began = time.monotonic()
    run.leave_safe(0.5)
    assert 0.5 <= time.monotonic() - began < 3.0
    assert 1 <= CountedWakeUp.waits < 10
    report = next(event for event in told if isinstance(event, SafeStateReported))
    assert {part.service: part.failure and part.failure.cause.value for part in report.parts} == {
        "/overtAttention/set_mode": "no-answer", "/animateBehaviour/set_activation": None}
    run._robot.close()
    for each in (answers, hangs):
        each.close()


@pytest.mark.slow
def test_while_nodes_are_awaited_at_the_start(master, wake, monkeypatch):
    monkeypatch.setattr(startup_check, "RETRY_INTERVAL", 0.2)
    plan = plan_with(wake, startup_timeout=0.6)
    check = StartUpCheck(plan, lambda severity, text: None, wake, lambda: False)
    with pytest.raises(NodesMissing, match="without it"):
        check.run()
    assert CountedWakeUp.waits < 40


@pytest.mark.slow
def test_while_the_simulated_time_is_awaited(master, wake, monkeypatch):
    monkeypatch.setattr(simulated_time, "RETRY_INTERVAL", 0.2)
    awaited = SimulatedTime(SimulatedClock(wake.emit), print)
    began = time.monotonic()
    with pytest.raises(NodesMissing, match="no time comes on /clock: no node publishes it"):
        awaited.await_first(0.6, lambda severity, text: None, wake, lambda: False)
    assert 0.6 <= time.monotonic() - began < 3.0
    assert CountedWakeUp.waits < 20


@pytest.mark.slow
def test_while_an_answer_is_awaited_after_it_was_told_how_far_the_robot_is(wake):
    clock, call = Clock(), Call(Say("hello"), wake.emit, lambda: None)
    clock.call_after(0.3, lambda: call.finish(Answer()))
    try_robot._await(call, clock, wake)
    assert CountedWakeUp.waits < 10
