"""How nodes can end, as far as the file tells: judged by what the library does with children of
known ends."""
import pytest

from behavior_controller.bt.linter.facts import outcomes
from behavior_controller.bt.engine.possible_results import ANY_RESULT, FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.engine.possible_results import OF_A_LEAF as ANY_END
from behavior_controller.bt.engine.builtins import AlwaysSuccess, builtin_specs
from behavior_controller.bt.engine.controls import Sequence
from behavior_controller.bt.engine.decorators import Inverter
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec

LEAVES = {"Win": SUCCEEDS, "Lose": FAILS, "Skip": SKIPS, "WinOrSkip": SUCCEEDS | SKIPS,
          "LoseOrSkip": FAILS | SKIPS, "Either": None}
REGISTRY = Registry(builtin_specs() + [
    NodeSpec(name, Kind.ACTION, AlwaysSuccess, outcome=outcome) for name, outcome in LEAVES.items()
] + [NodeSpec("Own", Kind.DECORATOR, Inverter),
     NodeSpec("OwnControl", Kind.CONTROL, Sequence)])


def ends(body):
    """Return how the first node of ``body`` can end."""
    elements = parse("<BehaviorTree>{}</BehaviorTree>".format(body)).root.below
    return outcomes({"Main": elements}, REGISTRY)[id(elements[0])]


REPEAT = '<Repeat num_cycles="{}"><{}/></Repeat>'
RETRY = '<RetryUntilSuccessful num_attempts="{}"><{}/></RetryUntilSuccessful>'


@pytest.mark.parametrize(
    "body, expected",
    [
        # a Sequence succeeds after its last child, fails with one that fails, and is SKIPPED only
        # with all of them
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
        (RETRY.format("-1", "Lose"), 0),
        (RETRY.format("2", "LoseOrSkip"), FAILS | SKIPS),
        # no round is a SUCCESS, whatever the child; an endless one is none
        (REPEAT.format("2", "Win"), SUCCEEDS),
        (REPEAT.format("1", "Lose"), FAILS),
        (REPEAT.format("0", "Lose"), SUCCEEDS | FAILS),
        (REPEAT.format("-3", "Lose"), SUCCEEDS | FAILS),
        (REPEAT.format("{n}", "Lose"), SUCCEEDS | FAILS),
        (REPEAT.format("2", "WinOrSkip"), SUCCEEDS | SKIPS),
        (REPEAT.format("-1", "Win"), 0),
        (REPEAT.format("-1", "Either"), FAILS),
        (REPEAT.format("-1", "WinOrSkip"), SKIPS),
        # other decorators change the end of their child, or may end before it
        ("<Inverter><Win/></Inverter>", FAILS),
        ("<Inverter><Lose/></Inverter>", SUCCEEDS),
        ("<Inverter><LoseOrSkip/></Inverter>", SUCCEEDS | SKIPS),
        ("<Inverter><Skip/></Inverter>", SKIPS),
        ("<ForceSuccess><LoseOrSkip/></ForceSuccess>", SUCCEEDS | SKIPS),
        ("<ForceFailure><Win/></ForceFailure>", FAILS),
        ("<ForceFailure><Skip/></ForceFailure>", SKIPS),
        ("<KeepRunningUntilFailure><Either/></KeepRunningUntilFailure>", FAILS),
        ("<KeepRunningUntilFailure><WinOrSkip/></KeepRunningUntilFailure>", 0),
        ("<RunOnce><Win/></RunOnce>", SUCCEEDS | SKIPS),
        ('<Delay delay_msec="1"><Lose/></Delay>', FAILS),
        ('<Timeout msec="1"><Win/></Timeout>', SUCCEEDS | FAILS),
        ('<SkipUnlessUpdated entry="{e}"><Win/></SkipUnlessUpdated>', SUCCEEDS | SKIPS),
        ('<WaitValueUpdate entry="{e}"><Win/></WaitValueUpdate>', SUCCEEDS),
        ('<Precondition if="true"><Win/></Precondition>', SUCCEEDS | FAILS),
        ('<Precondition if="true" else="SKIPPED"><Win/></Precondition>', SUCCEEDS | SKIPS),
        ('<Precondition if="true" else="RUNNING"><Lose/></Precondition>', FAILS),
        ('<LoopInt queue="1"><Win/></LoopInt>', SUCCEEDS),
        ('<LoopInt queue="1" if_empty="SKIPPED"><Either/></LoopInt>', FAILS | SKIPS),
        ('<LoopInt queue="1" if_empty="RUNNING"><Either/></LoopInt>', FAILS),
        # a status in an entry may be any
        ('<Precondition if="true" else="{e}"><Win/></Precondition>', ANY_RESULT),
        ('<LoopInt queue="1" if_empty="{e}"><Win/></LoopInt>', ANY_RESULT),
        # a choice ends as what it may choose; without an else, its false condition is its end
        ("<IfThenElse><Either/><Win/><Skip/></IfThenElse>", SUCCEEDS | SKIPS),
        ("<IfThenElse><Either/><Win/></IfThenElse>", SUCCEEDS | FAILS),
        ("<IfThenElse><Win/><Skip/><Lose/></IfThenElse>", SKIPS),
        ("<IfThenElse><Lose/><Win/><Skip/></IfThenElse>", SKIPS),
        ("<WhileDoElse><Lose/><Win/></WhileDoElse>", FAILS),
        ('<Switch2 variable="{v}" case_1="1" case_2="2"><Win/><Lose/><Win/></Switch2>',
         SUCCEEDS | FAILS),
        ('<Switch2 variable="{v}" case_1="1" case_2="2"><Win/><Skip/><Win/></Switch2>',
         SUCCEEDS | SKIPS),
        # what catches a failure cannot undo it
        ("<TryCatch><Lose/><Win/></TryCatch>", FAILS),
        ("<TryCatch><Win/><Lose/></TryCatch>", SUCCEEDS),
        ("<TryCatch><Skip/><Skip/><Win/></TryCatch>", SKIPS),
        # a Parallel needs all of its children; those that are SKIPPED count as done
        ("<Parallel><Win/><Win/></Parallel>", SUCCEEDS),
        ("<Parallel><Win/><Lose/></Parallel>", FAILS),
        ("<Parallel><Lose/><Win/></Parallel>", FAILS),
        ("<Parallel><Win/><Either/></Parallel>", ANY_END),
        ("<Parallel><Skip/><Win/></Parallel>", SUCCEEDS),
        ("<Parallel><Skip/><Skip/></Parallel>", SUCCEEDS),
        ("<Parallel><LoseOrSkip/><Win/></Parallel>", ANY_END),
        ('<Parallel success_count="1"><Win/><Win/></Parallel>', ANY_RESULT),
        ('<Parallel failure_count="2"><Win/><Win/></Parallel>', ANY_RESULT),
        # a condition may end a node before it runs
        ('<Win _failureIf="x"/>', SUCCEEDS | FAILS),
        ('<Lose _successIf="x"/>', SUCCEEDS | FAILS),
        ('<Win _skipIf="x"/>', SUCCEEDS | SKIPS),
        ('<Win _while="x"/>', SUCCEEDS | SKIPS),
        ('<Win _post="x"/>', SUCCEEDS),
        # of a node type that declares nothing, anything is thought
        ("<Own><Lose/></Own>", ANY_RESULT),
        ("<OwnControl><Lose/></OwnControl>", ANY_RESULT),
        ("<Sequence><Own><Lose/></Own><Win/></Sequence>", ANY_END)])
def test_how_a_node_can_end(body, expected):
    assert ends(body) == expected
