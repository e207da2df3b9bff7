"""Random trees that are ticked on demand do what they do when they are ticked every 10 ms, as
BehaviorTree.CPP ticks them, and never wait while that goes on.

``TICKS_TREES`` sets how many trees are tried, ``TICKS_SEED`` which.
"""
import os
import random

import pytest

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.engine.leaf import ActionLeaf
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.values.status import NAMES, RUNNING

pytestmark = pytest.mark.slow

TREES = int(os.environ.get("TICKS_TREES", "400"))
SEED = int(os.environ.get("TICKS_SEED", "5"))
PERIOD, LIMIT = 0.01, 5.0  # seconds of the tree's clock
CONDITIONS = ("x == 1", "x != 1", "x &lt; 2", "true", "false")
IN_ORDER = ("Sequence", "Fallback", "AsyncFallback", "SequenceWithMemory",
            "ReactiveSequence", "ReactiveFallback", "TryCatch", "Parallel", "ParallelAll")
AROUND = ("Inverter", "ForceSuccess", "KeepRunningUntilFailure", "RunOnce", "Repeat num_cycles='2'",
          "RetryUntilSuccessful num_attempts='2'", "Precondition if='x == 1' else='RUNNING'",
          "Delay delay_msec='170'", "Timeout msec='790'", "SkipUnlessUpdated entry='x'",
          "WaitValueUpdate entry='x'", "LoopInt queue='1;2' if_empty='SKIPPED'")
LEAVES = ("Sleep msec='310'", "Sleep msec='1130'", "Endless", "Script code='x := 1'",
          "Script code='x := 2'", "AlwaysSuccess", "AlwaysFailure", "ScriptCondition code='x == 1'",
          "WasEntryUpdated entry='x'")


class Endless(ActionLeaf):
    """An action that is never done."""

    def on_start(self):
        return RUNNING

    on_running = on_start


REGISTRY = Registry([*builtin_specs(), NodeSpec("Endless", Kind.ACTION, Endless)])


def element(draw, depth):
    """Return a random element with up to ``depth`` levels."""
    kind, count = draw.choice(LEAVES), 0
    if depth and draw.random() < 0.85:
        kind, count = draw.choice([(draw.choice(IN_ORDER), draw.randint(2, 3)),
                                   (draw.choice(("IfThenElse", "WhileDoElse")), draw.randint(2, 3)),
                                   (draw.choice(AROUND), 1)])
    condition = ""
    if draw.random() < 0.15:
        attribute = draw.choice(("_skipIf", "_successIf", "_failureIf", "_while"))
        condition = " {}='{}'".format(attribute, draw.choice(CONDITIONS))
    children = "".join(element(draw, depth - 1) for _ in range(count))
    return "<{}{}>{}</{}>".format(kind, condition, children, kind.split()[0])


def outcome(text, on_demand):
    """Return how a tree ends, and when: "waits" if it does not; "races" if that is cut short."""
    tree = load_text(text, REGISTRY, clock=ManualClock())
    tree.blackboard.set("x", 0.0)
    clock, ticks = tree.clock, 0
    while clock.now() < LIMIT:
        ticks += 1
        try:
            result = tree.tick_once()
        except Exception as error:
            return type(error).__name__, clock.now()
        if tree.busy_loops or ticks > 1000:
            return "races", clock.now()
        if result is not RUNNING:
            return NAMES.get(result, "SKIPPED"), clock.now()
        clock.advance(PERIOD if not on_demand or tree.is_tick_wanted else 0.0)
        while on_demand and not (tree.is_tick_wanted or tree.wake.is_set):
            if clock.next_due() is None:
                return "waits", clock.now()
            clock.advance(clock.next_due() - clock.now())
        tree.wake.test_and_clear()
    return "waits", clock.now()


@pytest.mark.parametrize("seed", range(SEED, SEED + 4))
def test_a_tree_that_is_ticked_on_demand_ends_as_one_that_is_ticked_all_the_time(seed):
    draw, ended = random.Random(seed), 0
    for _ in range(TREES // 4):
        text = ("<root BTCPP_format='4'><BehaviorTree ID='M'>" + element(draw, 4)
                + "</BehaviorTree></root>")
        result, at = outcome(text, on_demand=True)
        expected, expected_at = outcome(text, on_demand=False)
        assert result == expected, text
        assert abs(at - expected_at) < 0.2 or result == "waits", text
        ended += result in ("SUCCESS", "FAILURE")
    assert ended > TREES // 10
