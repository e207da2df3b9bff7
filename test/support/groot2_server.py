"""A publisher of Groot2's protocol in this process, and trees whose leaves give chosen results."""
import itertools

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.run.record.codec import Decoder, encode, header
from behavior_controller.run.record.feed import Feed
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.viewer.groot2 import Groot2Publisher

RESULTS = {"R": RUNNING, "S": SUCCESS, "F": FAILURE}


class Script:
    """A leaf that gives one result after another, and then the last again."""

    def _next(self):
        results = SCRIPTS[self.name]
        return RESULTS[results.pop(0) if len(results) > 1 else results[0]]


class Act(Script, ActionLeaf):
    def on_start(self):
        return self._next()

    on_running = on_start


class Cond(Script, ConditionLeaf):
    def update(self):
        return self._next()


SCRIPTS = {}
SPECS = builtin_specs() + [NodeSpec("Act", Kind.ACTION, Act),
                           NodeSpec("Cond", Kind.CONDITION, Cond)]


class Served(Groot2Publisher):
    """A publisher that reads the lines of a run, and the controller's end of both."""

    def __init__(self, port, warn):
        self.port, self.events, self._numbers = port, [], itertools.count(1)
        self._feed, self._decoder = Feed(), Decoder("the test")
        self._decoder.read(header(1, 0.0))
        self._breakpoints = Breakpoints(self._emit, warn)
        super().__init__("127.0.0.1", port, warn, self._breakpoints.change)

    def show(self, tree):
        self._feed.follow(tree)
        self._feed.put(shown, tree, next(self._numbers), SPECS)
        self._breakpoints.show(tree)

    def _emit(self, event):
        self.events.append(event)
        self._feed(event)
        self._thread.call(self._catch_up)

    def _catch_up(self):
        for line in self._feed.lines():
            for read in self._decoder.read(encode(line.time, line.event)):
                self._fold(read)

    def _answer(self, frames, client):
        self._catch_up()  # so that a client is told of what the test has done
        return super()._answer(frames, client)


def tree_of(body, **scripts):
    """Return a tree whose leaves give these results, by their names."""
    SCRIPTS.update({name: list(results) for name, results in scripts.items()})
    return load_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'.format(body),
        Registry(SPECS))
