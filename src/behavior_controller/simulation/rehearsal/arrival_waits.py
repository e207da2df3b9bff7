"""The effect of an arrival rate on a mission: the chance that the messages that a condition needs
come while it waits.

Messages come at Poisson times, so this is arithmetic; nothing is run.
"""
import itertools
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.missions import load as missions
from behavior_controller.bt.engine.possible_results import FAILS
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.run.events import Events
from behavior_controller.robot.gateway import FakeGateway, FakeTopics
from behavior_controller.robot.requests import Answer, Say, SetAttention
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.waits import is_asked_again, wait_for
from behavior_controller.text import count

from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.behaviour import TOPICS
from behavior_controller.simulation.world import World
from behavior_controller.simulation.visitor import Visitor

SUFFICIENT_SHARE = 0.95
"""The share of waits in which messages should come in time; a lower share is reported before the
start."""

MESSAGE_NUMBERS = range(1, 21)
"""Evidence that has not come in so many messages does not come from this visitor, whatever the
rate."""


class Wait(NamedTuple):
    """A condition of a mission, with the number of messages that it needs and the seconds for them.

    ``after``: it is asked only if one of these has failed, as in a Fallback; empty: it is always
    asked.
    """

    node: str
    messages: int
    seconds: float
    after: Tuple["Wait", ...] = ()

    def chance(self, rate: float) -> float:
        """Return the chance that the messages come in time at ``rate`` per minute."""
        if math.isinf(rate):
            return 1.0
        mean = rate / 60 * self.seconds
        return 1 - sum(math.exp(-mean) * mean**number / math.factorial(number)
                       for number in range(self.messages))

    def missed(self, rate: float) -> float:
        """Return in which share of the visits the condition is asked, and the messages come too
        late."""
        asked = 1.0
        if self.after:
            asked = min(1.0, sum(1 - wait.chance(rate) for wait in self.after))
        return asked * (1 - self.chance(rate))

    def warning(self, rate: float) -> str:
        """Return in a line what ``rate`` means for it."""
        share = 100 * self.chance(rate)
        often = f"about {share:.0f}" if share >= 1 else "less than 1"
        messages = count(self.messages, "message")
        return (f"arrivalRate {rate:g}: {self.node} needs {messages} within {self.seconds:g} s, "
                f"which happens in {often} % of waits")


def warnings(waits: Sequence[Wait], rate: float) -> List[str]:
    """Return a line for each condition whose messages often come too late at ``rate``, and from
    which rate on none does."""
    late = [wait for wait in waits if wait.missed(rate) > 1 - SUFFICIENT_SHARE]
    worst = [max((wait for wait in late if wait.node == node), key=lambda wait: wait.missed(rate))
             for node in dict.fromkeys(wait.node for wait in late)]
    if not worst:
        return []
    return [*(wait.warning(rate) for wait in worst), sufficient(waits)]


def sufficient(waits: Sequence[Wait]) -> str:
    """Return in a line from which rate on messages come in time."""
    return (f"from arrivalRate {lowest_rate(waits)} on, all that this mission waits for comes in "
            f"time in {100 * SUFFICIENT_SHARE:.0f} % of waits")


def lowest_rate(waits: Sequence[Wait]) -> int:
    """Return the lowest whole number of messages per minute of which enough come in time, at least
    1."""
    return next(rate for rate in itertools.count(1)
                if all(wait.missed(rate) <= 1 - SUFFICIENT_SHARE for wait in waits))


# -------------------------------------------------------------------------------------- the mission


def of_mission(world: World) -> List[Wait]:
    """Return the waits of the configured mission that have a bound; none if the mission cannot be
    loaded."""
    try:
        loaded = missions.load(world.settings)
    except BehaviorControllerError:
        return []  # the controller reports it
    tree, gateway = loaded.tree, FakeGateway(lambda: None, lambda request: Answer())
    tree.setup(mission=loaded.context(gateway, FakeTopics(tree.clock.now), Events()))
    waits: Dict[Any, Wait] = {}
    for node in tree.nodes:  # those of a Fallback that come before stand before
        if isinstance(node, TopicCondition):
            seconds, messages = _seconds(node), _messages(node, world)
            if seconds is not None and messages is not None:
                after = tuple(waits[before] for before in _asked_before(node) if before in waits)
                waits[node] = Wait(node.registration_id, messages, seconds, after)
    return list(waits.values())


def _asked_before(node: Any) -> Iterator[Any]:
    """Yield the nodes that have failed when ``node`` is asked: those before it in the Fallbacks
    around it."""
    while node.parent is not None:
        spec = node.parent.spec
        if spec.advances_on == FAILS and not spec.is_reactive:
            for sibling in node.parent.children[:node.parent.children.index(node)]:
                yield from sibling.iterate()
        node = node.parent


def _seconds(node: TopicCondition) -> Optional[float]:
    """Return how long messages may take to come; None: without a limit, or the mission file does
    not say."""
    seconds = wait_for(node)
    if seconds is None:
        if is_asked_again(node):
            return None
        seconds = node.wait
    if node.topic.is_continuous:  # a message that came before the question still counts for so long
        seconds = max(seconds, node.mission.settings.topic_max_age)
    if not 0 < seconds < math.inf:
        return None
    return seconds


def _messages(node: TopicCondition, world: World) -> Optional[int]:
    """Return how many messages it takes until this visitor, who is there and was asked, gives the
    evidence."""
    if node.topic.name not in TOPICS:
        return None
    visitor, robot = Visitor(world.visitor.manners), world.settings.interface
    for question in visitor.manners.questions:
        visitor.notice(JournalEntry(0.0, robot.service(Say).node, "", 1, {"message": question}))
    if node.evidence.mode:
        visitor.notice(JournalEntry(0.0, robot.service(SetAttention).node, "", 1,
                                    {"state": node.evidence.mode}))
    for number in MESSAGE_NUMBERS:
        value = TOPICS[node.topic.name].content(world._replace(visitor=visitor))
        if value is not None and node.is_evidence(value):
            return number
    return None
