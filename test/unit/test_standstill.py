"""Is a leaf that blocks the tick thread named once, and nothing else?"""
import threading

from behavior_controller.bt.loader.tree_builder import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import SyncActionLeaf
from behavior_controller.bt.registry import Kind, NodeSpec, Registry
from behavior_controller.bt.status import SUCCESS
from behavior_controller.missions.runner import Runner, Running
from behavior_controller.missions.blocked_tick import CHECKS, Standstill
from mission_rig import one_leaf


class Blocks(SyncActionLeaf):
    """Acts while its tick is under way."""

    act = staticmethod(lambda: None)

    def update(self):
        self.act()
        return SUCCESS


def watched(monkeypatch, act, ticks=1):
    """Tick a tree with the leaf, whose tick calls ``act(standstill)``; return the lines of the
    watch."""
    tree = load_text("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence>\n<Blocks "
                     "name='grip'/></Sequence></BehaviorTree></root>",
                     Registry(builtin_specs() + [NodeSpec("Blocks", Kind.ACTION, Blocks)]), "m.xml")
    lines = []
    runner = Runner(Running(tree, one_leaf("<AlwaysSuccess/>").mission, "m.xml", 1), lambda: False)
    watch = Standstill(runner, lambda severity, text: lines.append((severity, text)))
    tree.wake.emit()
    runner.wait(None)  # it is awake now
    monkeypatch.setattr(Blocks, "act", lambda self: act(watch))
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


def test_a_leaf_that_blocks_is_named_once_with_both_places(monkeypatch):
    (severity, text), = watched(monkeypatch, lambda watch: checks(watch, 3 * CHECKS), ticks=2)
    assert severity == "warning"
    assert text.startswith(
        "m.xml:2:1: the leaf 'grip' [Blocks] has not returned from unit/test_standstill.py:")


def test_a_leaf_that_is_often_met_but_returns_is_not_named(monkeypatch):
    assert watched(monkeypatch, lambda watch: checks(watch, CHECKS), ticks=3) == []


def test_a_thread_that_waits_for_an_event_is_not_blocked():
    rig = one_leaf("<AlwaysSuccess/>")
    assert Runner(Running(rig.tree, rig.mission, "m.xml", 1), lambda: False).moment() is None
