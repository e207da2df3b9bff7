"""How nodes can end, as far as the file tells: judged by what the library does with children of known ends."""
import pytest

from behavior_controller.bt.checking.checks import below
from behavior_controller.bt.checking.outcomes import outcomes
from behavior_controller.bt.ends import ANY, FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.ends import OF_A_LEAF as ANY_END
from behavior_controller.bt.engine.builtins import AlwaysSuccess, builtin_specs
from behavior_controller.bt.engine.controls import Sequence
from behavior_controller.bt.engine.decorators import Inverter
from behavior_controller.bt.language.document import parse
from behavior_controller.bt.registry import Kind, NodeSpec, Registry

LEAVES = {"Win": SUCCEEDS, "Lose": FAILS, "Skip": SKIPS, "WinOrSkip": SUCCEEDS | SKIPS, "LoseOrSkip": FAILS | SKIPS,
          "Either": None}
REGISTRY = Registry(builtin_specs() + [
    NodeSpec(name, Kind.ACTION, AlwaysSuccess, outcome=outcome) for name, outcome in LEAVES.items()] + [
    NodeSpec("Own", Kind.DECORATOR, Inverter), NodeSpec("OwnControl", Kind.CONTROL, Sequence)])


def ends(body):
    """Return how the first node of ``body`` can end."""
    elements = below(parse("<BehaviorTree>{}</BehaviorTree>".format(body)).root)
    return outcomes({"Main": elements}, REGISTRY)[id(elements[0])]


RETRY = '<RetryUntilSuccessful num_attempts="{}"><{}/></RetryUntilSuccessful>'


@pytest.mark.parametrize("body, expected", [
    # a Sequence succeeds after its last child, fails with one that fails, and is SKIPPED only with all of them
    ("<Sequence><Win/><Win/></Sequence>", SUCCEEDS),
    ("<Sequence><Win/><Lose/></Sequence>", FAILS),
    ("<Sequence><Lose/><Win/></Sequence>", FAILS),
    ("<Sequence><Win/><Either/></Sequence>", ANY_END),
    ("<Sequence><Skip/><Skip/></Sequence>", SKIPS),
    ("<Sequence><WinOrSkip/><Win/></Sequence>", SUCCEEDS),
    ("<Sequence><Win/><WinOrSkip/></Sequence>", SUCCEEDS),
    ("<Sequence><WinOrSkip/><WinOrSkip/></Sequence>", SUCCEEDS | SKIPS),
    ("<Sequence><Skip/><Lose/></Sequence>", FAILS),
    # a Fallback is its mirror image
    ("<Fallback><Lose/><Lose/></Fallback>", FAILS),
    ("<Fallback><Lose/><Win/></Fallback>", SUCCEEDS),
    ("<Fallback><Win/><Lose/></Fallback>", SUCCEEDS),
    ("<Fallback><Skip/><Skip/></Fallback>", SKIPS),
    ("<Fallback><LoseOrSkip/><Lose/></Fallback>", FAILS),
    ("<Fallback><LoseOrSkip/><LoseOrSkip/></Fallback>", FAILS | SKIPS),
    # no attempt is a FAILURE, whatever the child; an endless one is none
    (RETRY.format("2", "Win"), SUCCEEDS),
    (RETRY.format("1", "Win"), SUCCEEDS),
    (RETRY.format("0", "Win"), SUCCEEDS | FAILS),
    (RETRY.format("-3", "Win"), SUCCEEDS | FAILS),
    (RETRY.format("{n}", "Win"), SUCCEEDS | FAILS),
    (RETRY.format("1" + 9 * "0", "Win"), SUCCEEDS),
    (RETRY.format("2", "Either"), ANY_END),
    (RETRY.format("-1", "Either"), SUCCEEDS),
    (RETRY.format("-1", "Win"), SUCCEEDS),
    # a Parallel needs all of its children; those that are SKIPPED count as done
    ("<Parallel><Win/><Win/></Parallel>", SUCCEEDS),
    ("<Parallel><Win/><Lose/></Parallel>", FAILS),
    ("<Parallel><Lose/><Win/></Parallel>", FAILS),
    ("<Parallel><Win/><Either/></Parallel>", ANY_END),
    ("<Parallel><Skip/><Win/></Parallel>", SUCCEEDS),
    ("<Parallel><Skip/><Skip/></Parallel>", SUCCEEDS),
    # of a node type that declares nothing, anything is thought
    ("<Own><Lose/></Own>", ANY),
    ("<OwnControl><Lose/></OwnControl>", ANY),
    ("<Sequence><Own><Lose/></Own><Win/></Sequence>", ANY_END),
])
def test_how_a_node_can_end(body, expected):
    assert ends(body) == expected
