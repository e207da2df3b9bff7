"""For how long does the tree around a condition ask it again and again?"""
import math

import pytest

from behavior_controller import bt
from behavior_controller.bt.engine.builtins import AlwaysSuccess
from behavior_controller.bt.engine.controls import Fallback
from behavior_controller.bt.engine.decorators import ForceSuccess
from behavior_controller.bt.engine.possible_results import FAILS, SUCCEEDS, of_child
from behavior_controller.leaves.waits import MOST_BESIDE, is_asked_again, wait_for
from mission_rig import one_leaf

SEEN, SAYS = "<IsVisitorDiscovered/>", "<WelcomeSpeech/>"
PAUSE = "<Sequence><Sleep msec='200'/><AlwaysFailure/></Sequence>"
ROUND = "<Fallback>" + SEEN + PAUSE + "</Fallback>"


def retried(attempts, body):
    return "<RetryUntilSuccessful num_attempts='{}'>{}</RetryUntilSuccessful>".format(
        attempts, body)


def until(body):
    return "<ReactiveFallback>{}{}</ReactiveFallback>".format(SEEN, body)


def condition(mission):
    return next(node for node in one_leaf(mission).tree.nodes
                if node.registration_id == "IsVisitorDiscovered")


@pytest.mark.parametrize("mission, seconds", [
    (SEEN, None),
    ("<Sequence>" + SEEN + SAYS + "</Sequence>", None),
    # a ReactiveFallback waits as long as what stands after the condition
    (until("<Sleep msec='3000'/>"), 3.0),
    (until("<Sleep msec='3000'/><Sleep msec='500'/>"), 3.5),
    (until("<Delay delay_msec='1500'><AlwaysFailure/></Delay>"), 1.5),
    (until("<AlwaysFailure/>"), None),
    (until(SAYS), math.inf),
    (until("<Sleep msec='{given}'/>"), math.inf),
    (until("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>"), math.inf),
    # a loop waits for the pauses of all its rounds
    (retried(5, ROUND), 1.0),
    (retried(-1, ROUND), math.inf),
    (retried(4, "<Delay delay_msec='250'>" + SEEN + "</Delay>"), 1.0),
    (retried(5, "<Fallback>" + PAUSE + SEEN + "</Fallback>"), 1.0),
    (retried(5, "<Sequence>" + SEEN + PAUSE + "</Sequence>"), None),
    (retried(5, SEEN), None),
    # as long as a Timeout lets it
    ("<Timeout msec='500'>" + until("<Sleep msec='3000'/>") + "</Timeout>", 0.5),
    ("<Timeout msec='9000'>" + until("<Sleep msec='3000'/>") + "</Timeout>", 3.0),
    ("<Timeout msec='500'>" + SEEN + "</Timeout>", None),
    # a robot that does something else meanwhile does not wait
    (retried(5, "<Fallback>" + SEEN + "<ForceFailure>" + SAYS + "</ForceFailure></Fallback>"),
     None)])
def test_the_mission_waits_for_a_condition(mission, seconds):
    assert wait_for(condition(mission)) == pytest.approx(seconds)


@pytest.mark.parametrize("number, seconds", [(MOST_BESIDE, 0.1 * MOST_BESIDE),
                                             (MOST_BESIDE + 1, math.inf)])
def test_a_round_of_too_many_nodes_takes_nobody_knows_how_long(number, seconds):
    wait = until("<Sleep msec='100'/>" * number)
    assert wait_for(condition(wait)) == pytest.approx(seconds)
    limited = "<Timeout msec='500'>{}</Timeout>".format(wait)
    assert wait_for(condition(limited)) == (0.5 if math.isfinite(seconds) else math.inf)


@pytest.mark.parametrize("mission, is_so", [
    (until(SAYS), True),
    ("<ReactiveFallback><AlwaysFailure/>" + SEEN + "</ReactiveFallback>", False),
    ("<ReactiveSequence>" + SEEN + SAYS + "</ReactiveSequence>", True),
    ("<Sequence>" + SEEN + SAYS + "</Sequence>", False),
    ("<ReactiveSequence><Inverter>" + SEEN + "</Inverter>" + SAYS + "</ReactiveSequence>", True),
    ("<WhileDoElse>" + SEEN + SAYS + "</WhileDoElse>", True),
    ("<WhileDoElse><AlwaysSuccess/>" + SEEN + SAYS + "</WhileDoElse>", False)])
def test_a_condition_is_asked_again_while_a_later_node_runs(mission, is_so):
    assert is_asked_again(condition(mission)) is is_so


# what other packages may declare; how these nodes really run does not matter
OWN = bt.Registry(bt.builtin_specs() + [
    bt.NodeSpec("Is", bt.Kind.CONDITION, AlwaysSuccess),
    bt.NodeSpec("OwnRest", bt.Kind.ACTION, AlwaysSuccess, (bt.Port("ms"),), outcome=SUCCEEDS,
                pause="ms"),
    bt.NodeSpec("OwnTries", bt.Kind.DECORATOR, ForceSuccess, (bt.Port("tries"),), rounds="tries",
                repeats_on=FAILS),
    bt.NodeSpec("OwnForEver", bt.Kind.DECORATOR, ForceSuccess, outcome=of_child(FAILS, 0),
                repeats_on=FAILS),
    bt.NodeSpec("OwnLimit", bt.Kind.DECORATOR, ForceSuccess, (bt.Port("ms"),), limit="ms",
                outcome=of_child(SUCCEEDS, FAILS, always=FAILS)),
    bt.NodeSpec("OwnEither", bt.Kind.CONTROL, Fallback, advances_on=FAILS, is_reactive=True),
    bt.NodeSpec("OwnBranches", bt.Kind.CONTROL, Fallback, first_child_chooses=True,
                is_reactive=True)])
OWN_ROUND = "<Fallback><Is/><Sequence><OwnRest ms='250'/><AlwaysFailure/></Sequence></Fallback>"


@pytest.mark.parametrize("body, seconds, is_again", [
    ("<OwnTries tries='4'>" + OWN_ROUND + "</OwnTries>", 1.0, False),
    ("<OwnTries tries='-1'>" + OWN_ROUND + "</OwnTries>", math.inf, False),
    ("<OwnForEver><Is/></OwnForEver>", math.inf, False),
    ("<OwnEither><Is/><OwnRest ms='3000'/></OwnEither>", 3.0, True),
    ("<OwnLimit ms='500'><OwnEither><Is/><OwnRest ms='3000'/></OwnEither></OwnLimit>", 0.5, True),
    ("<OwnEither><OwnRest ms='3000'/><Is/></OwnEither>", None, False),
    ("<OwnBranches><Is/><OwnRest ms='3000'/></OwnBranches>", None, True),
    ("<OwnBranches><AlwaysSuccess/><Is/></OwnBranches>", None, False),
    # items are counted by the queue
    ("<LoopInt queue='1;2'><ForceSuccess>" + OWN_ROUND + "</ForceSuccess></LoopInt>", math.inf,
     False),
    ("<LoopInt queue='1;2'><ForceSuccess><Is/></ForceSuccess></LoopInt>", None, False)])
def test_nodes_of_other_packages_wait_as_they_declare(body, seconds, is_again):
    tree = bt.load_text("<root BTCPP_format='4'><BehaviorTree ID='M'>" + body +
                        "</BehaviorTree></root>", OWN)
    node = next(node for node in tree.nodes if node.registration_id == "Is")
    assert (wait_for(node), is_asked_again(node)) == (seconds, is_again)
