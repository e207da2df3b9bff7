"""Controllers with one mistake each, as the code that causes it."""

IGNORES_REFUSALS = """
from behavior_controller.leaves.base import ServiceLeaf
try_once = ServiceLeaf.try_once
def always_done(self):
    yield from try_once(self)
ServiceLeaf.try_once = always_done
"""
RECOVERS_ALWAYS = """
from py_trees.common import Status
from behavior_controller.leaves.recovery import HandleFallBack
update = HandleFallBack.update
HandleFallBack.update = lambda self: {Status.FAILURE: Status.SUCCESS}.get(result := update(self), result)
"""
RAISES_IN_EACH_SPEECH = """
from behavior_controller.leaves.speech import FixedSpeech
def request(self):
    raise RuntimeError("broken on purpose")
FixedSpeech.request = request
"""
ENDS_A_PASS_AFTER_FIVE_CALLS = """
from py_trees.common import Status
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.leaves.base import ServiceLeaf
try_once, tick_once = ServiceLeaf.try_once, Tree.tick_once
calls = []
def counted(self):
    calls.append(self)
    return try_once(self)
def cut_short(self):
    result = tick_once(self)
    if len(calls) < 5:
        return result
    calls.clear()
    self.halt()
    return Status.FAILURE
ServiceLeaf.try_once, Tree.tick_once = counted, cut_short
"""

ALL = {name: code for name, code in list(globals().items()) if name.isupper()}
