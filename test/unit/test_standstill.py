"""Is a leaf that blocks the tick thread named once, and nothing else?"""
import queue
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import SyncActionLeaf
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.values.status import SUCCESS
from behavior_controller.missions import blocked_tick
from behavior_controller.missions.runner import Runner, Running
from behavior_controller.missions.blocked_tick import CHECKS, BlockedTickMonitor
from mission_rig import one_leaf


class Blocks(SyncActionLeaf):
    """Acts while its tick is under way."""

    act = staticmethod(lambda: None)

    def update(self):
        self.act()
        return SUCCESS


def blocking_tree():
    return load_text("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence>\n<Blocks "
                     "name='grip'/></Sequence></BehaviorTree></root>",
                     Registry(builtin_specs() + [NodeSpec("Blocks", Kind.ACTION, Blocks)]), "m.xml")


def watched(monkeypatch, act, ticks=1, reloads=0):
    """Tick a tree with the leaf, whose tick calls ``act(standstill)``, and then what is reloaded;
    return the lines of the watch."""
    tree = blocking_tree()
    lines = []
    runner = Runner(Running(tree, one_leaf("<AlwaysSuccess/>").mission, "m.xml", 1), lambda: False)
    watch = BlockedTickMonitor(runner, lambda severity, text: lines.append((severity, text)))
    tree.wake.emit()
    runner.wait(None)  # it is awake now
    monkeypatch.setattr(Blocks, "act", lambda self: act(watch))
    for tree in [tree] + [blocking_tree() for _ in range(reloads)]:
        for _ in range(ticks):
            tree.tick_once()
    return lines


def checks(watch, count):
    """Check from another thread, as the watch does."""
    def check():
        for _ in range(count):
            watch.check()

    thread = threading.Thread(target=check)
    thread.start()
    thread.join()


@pytest.mark.parametrize("count", [CHECKS + 1, 3 * CHECKS])
def test_a_leaf_that_blocks_is_named_once_with_both_places(monkeypatch, count):
    (severity, text), = watched(monkeypatch, lambda watch: checks(watch, count), ticks=2)
    assert severity == "warning" and " for 1 s: " in text
    assert text.startswith(
        "m.xml:2:1: the leaf 'grip' [Blocks] has not returned from unit/test_standstill.py:")


def test_a_leaf_of_a_mission_that_was_reloaded_is_another_one(monkeypatch):
    assert len(watched(monkeypatch, lambda watch: checks(watch, CHECKS + 1), 2, reloads=1)) == 2


def test_a_leaf_that_is_often_met_but_returns_is_not_named(monkeypatch):
    assert watched(monkeypatch, lambda watch: checks(watch, CHECKS), ticks=3) == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_the_watch_checks_each_quarter_of_a_second_until_the_program_ends(monkeypatch):
    checked, slept = queue.Queue(), []
    monkeypatch.setattr(blocked_tick, "time", SimpleNamespace(sleep=slept.append))

    def check():
        checked.put((threading.current_thread(), list(slept)))
        if len(slept) == 2:
            sys.exit()

    watch = BlockedTickMonitor(None, pytest.fail)
    watch.check = check
    watch.start()
    times = [checked.get(timeout=5.0) for _ in range(2)]
    assert [slept for _, slept in times] == [[0.25], [0.25, 0.25]]
    assert all(thread.daemon for thread, _ in times)
    times[-1][0].join(5.0)  # so that its end is noticed in this test


def elsewhere(call):
    """Return the result of a call on another thread."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(call).result()


def test_a_leaf_s_code_in_which_the_tick_thread_stays_is_named(monkeypatch):
    found = []
    watched(monkeypatch, lambda watch: found.extend(
        elsewhere(lambda: (watch.is_blocked(0.0), watch.blocking()))))
    assert found[0] and found[1].startswith("m.xml:2:1: the leaf 'grip' [Blocks] has not returned")


@pytest.mark.parametrize("moments, is_blocked", [
    ([(1.0, None), (1.0, None)], True), ([(1.0, 5.0), (1.0, 5.0)], True),
    ([(1.0, None), (2.0, None)], False), ([(1.0, 5.0), (1.0, 6.0)], False),
    ([None, None], False), ([None, (1.0, None)], False), ([(1.0, None), None], False)])
def test_a_thread_is_blocked_that_neither_waits_nor_goes_on(moments, is_blocked):
    runner = SimpleNamespace(moment=lambda moments=iter(moments): next(moments))
    watch = BlockedTickMonitor(runner, pytest.fail)
    assert watch.is_blocked(0.0) is is_blocked
    assert elsewhere(watch.blocking) == "the tick thread has not reacted"


def test_a_thread_is_blocked_only_if_it_stays_there_for_that_long(monkeypatch):
    moments = [1.0, 1.0]

    def sleep(seconds):
        assert seconds == 0.5 and len(moments) == 1  # between two looks
        moments[0] = 2.0

    monkeypatch.setattr(blocked_tick, "time", SimpleNamespace(sleep=sleep))
    watch = BlockedTickMonitor(SimpleNamespace(moment=lambda: moments.pop()), pytest.fail)
    assert not watch.is_blocked(0.5) and not moments


def test_a_thread_that_waits_for_an_event_is_not_blocked():
    rig = one_leaf("<AlwaysSuccess/>")
    assert Runner(Running(rig.tree, rig.mission, "m.xml", 1), lambda: False).moment() is None
