"""One thread owns the tree: what belongs to it fails at once on another thread, which may only
enqueue."""
import threading

import pytest
from msgspec.structs import replace

from behavior_controller import thread_check
from behavior_controller.thread_check import WrongThread
from behavior_controller.run.events import HealthChanged
from behavior_controller.robot.gateway import Call, Cause, Failure
from behavior_controller.run.health import GONE, Health
from behavior_controller.robot.requests import Answer, Say
from behavior_controller.run.from_viewer import SET, Hook, HookChange
from behavior_controller.missions.breakpoints import Breakpoints
from mission_rig import one_leaf

CHANGE = HealthChanged("service", "/say", "", False, "gone", "")


def elsewhere(function):
    """Call ``function`` on another thread and return what it raised."""
    raised = []

    def work():
        try:
            function()
        except Exception as error:
            raised.append(error)

    thread = threading.Thread(target=work, name="worker")
    thread.start()
    thread.join(10.0)
    return raised[0] if raised else None


class Owned:
    @thread_check.checked
    def use(self):
        return "used"


def test_the_first_thread_is_the_owner_until_it_ends():
    owned = Owned()
    assert elsewhere(owned.use) is None
    assert owned.use() == "used"  # that thread has ended
    error = elsewhere(owned.use)
    assert isinstance(error, WrongThread)
    assert str(error) == "Owned.use on the thread 'worker': it belongs to 'MainThread'"


def test_without_the_variable_the_check_is_not_there_at_all(monkeypatch):
    assert thread_check.IS_CHECKED, "conftest.py has it on in all tests"
    monkeypatch.setattr(thread_check, "IS_CHECKED", False)
    assert thread_check.tick_thread_only(elsewhere) is elsewhere


def used():
    """Return a rig whose tick thread is this one."""
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.tick()
    return rig


@pytest.mark.parametrize("break_it", [
    lambda rig: rig.clock.call_after(1.0, print),
    lambda rig: rig.clock.next_due(),
    lambda rig: rig.clock.run_due(),
    lambda rig: rig.clock.run_posted(),
    lambda rig: rig.tree.tick_once(),
    lambda rig: rig.tree.halt(),
    lambda rig: rig.gateway.calls[0].finish(Answer()),
    lambda rig: rig.gateway.calls[0].drop(),
    lambda rig: rig.mission.health.publish(rig.mission.events),
    lambda rig: rig.mission.health.ended("/say", 1.0, 2.0, False),
    lambda rig: rig.mission.health.slow("/say", 2.0),
    lambda rig: rig.mission.health.is_gone("/say"),
    lambda rig: rig.mission.failures.add(rig.tree.root, Failure(Cause.REFUSED, "no"))])
def test_another_thread_fails_at_the_line_that_breaks_the_rule(break_it):
    rig = used()
    assert isinstance(elsewhere(lambda: break_it(rig)), WrongThread)
    assert rig.gateway.calls[0].result is None and rig.clock.next_due() is None


def test_another_thread_cannot_cancel_a_timer():
    rig, seen = used(), []
    timer = rig.clock.call_after(1.0, lambda: seen.append(True))
    assert isinstance(elsewhere(timer.cancel), WrongThread)
    rig.clock.advance(2.0)
    assert seen == [True]


def test_another_thread_may_enqueue_and_wake():
    rig, seen = used(), []
    hooks = Breakpoints(seen.append, seen.append)
    hooks.show(rig.tree)
    assert elsewhere(lambda: [
        rig.clock.now(), rig.clock.post(lambda: seen.append("posted")), rig.tree.wake.emit(),
        rig.mission.health.report(GONE, CHANGE), rig.mission.health.hear("/faces", 5.0),
        hooks.change(HookChange(SET, Hook(1, 0, 1, False, True, "FAILURE"), 1, 1))]) is None
    assert seen == [] and rig.tree.root.hook is None
    rig.tick()
    rig.mission.health.publish(rig.mission.events)
    assert seen[0] == "posted" and rig.tree.root.hook is not None
    assert rig.of(HealthChanged) == [replace(CHANGE, respect=GONE)
                                     ] and rig.mission.health.last_arrivals == {"/faces": 5.0}


def test_a_call_and_a_health_belong_to_the_thread_that_makes_them():
    for made, use in ((Health(), Health.is_gone), (Call(Say("x"), print), Call.finish)):
        assert isinstance(elsewhere(lambda: use(made, Answer())), WrongThread)
