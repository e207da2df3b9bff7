"""Warns of what cannot work in a mission, by following every path through its tree.

The state on a path is the mode of attention that was set last, whether the visitor has left, and
whether an answer is stored. Where the file does not decide (scripts, the recovery policy), the
visitor counts as present.
"""
import itertools
from typing import Any, Dict, FrozenSet, Iterable, Iterator, List, NamedTuple, Set, Tuple

from behavior_controller.bt.linter import rules
from behavior_controller.bt.possible_results import FAILS, SKIPS, SUCCEEDS, by, chosen
from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.errors import Fault
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Prompt
from behavior_controller.leaves.attention import MODES, OvertAttentionMode
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.data import CURRENT_EXHIBIT, VISITOR_RESPONSE
from behavior_controller.leaves.dialogue import IsVisitorResponseYes, IsYesNoUttered
from behavior_controller.leaves.lifecycle import IsASREnabled
from behavior_controller.leaves.release_1_0 import HasVisitorResponded
from behavior_controller.config.settings import Settings

DEEPEST, LARGEST = 150, 2_000
"""Levels and elements of a mission beyond which its paths are not followed: no mission drawn by
hand has so many."""

_ENDS = (SUCCEEDS, FAILS, SKIPS)


class PathState(NamedTuple):
    """The state on a path to a node. ``mode`` is empty before one was set."""

    mode: str = ""
    missed_by: str = ""  # the node type that last looked for the visitor, if it found none
    has_answer: bool = False


States = FrozenSet[PathState]
Ways = Set[Tuple[int, PathState]]
"""The ends of a node, each one of the flags, and the state then."""


def foresee(tree: Tree, settings: Settings) -> List[Fault]:
    """Return the warnings about a mission on the robot of ``settings``. Speech recognition is
    considered on and off."""
    levels: Dict[Any, int] = {None: 0}
    for node in tree.nodes:  # parents come before their children
        levels[node] = levels[node.parent] + 1
    nodes = list({id(node.element): node for node in tree.nodes}.values())  # each element once
    if max(levels.values()) > DEEPEST or len(nodes) > LARGEST:
        return []
    heard, deaf = _Follower(tree, settings, True), _Follower(tree, settings, False)
    faults = [fault for node in nodes for fault in _of_one(node, heard.seen_at(node), settings)]
    return faults + list(_without_recognition(nodes, heard, deaf))


def _of_one(node: Any, states: States, settings: Settings) -> Iterator[Fault]:
    """Yield the warnings about a mission leaf that is reached with ``states``."""
    if isinstance(node, TopicCondition) and states and settings.interface.tells(node.sense):
        mode = settings.interface.evidence(node.sense).mode
        modes = {state.mode for state in states}
        if mode and mode not in modes:
            setter = next(name for name, state, _, _ in MODES if state == mode)
            others = " or ".join(sorted(modes - {""}))
            yield node.element.fault(
                rules.MODE_MISSING,
                f"{node.registration_id} can never succeed: overtAttention reports "
                f"{node.sense.noun} only in the mode {mode}",
                f"the mode set last before it is {others}; {setter} sets that one" if others
                else f"no node before it sets that mode, as {setter} does")
    missed_by = sorted({state.missed_by for state in states} - {""})
    if missed_by and isinstance(node, MissionLeaf) and node.spec.says_goodbye(node.name):
        yield node.element.fault(rules.FAREWELL_TO_NOBODY,
                                 f"{node.registration_id} says goodbye to a visitor who has "
                                 f"left: the mission goes on to it after {missed_by[0]} failed",
                                 "end the mission, or the branch, with FAILURE before it")


def _without_recognition(
        nodes: List[Any], heard: "_Follower", deaf: "_Follower") -> Iterator[Fault]:
    """Yield a warning if the mission takes its stops with speech recognition alone."""
    stops = [node for node in nodes
             if isinstance(node, MissionLeaf) and node.spec.writes(CURRENT_EXHIBIT.name)]
    if not any(map(heard.seen_at, stops)) or any(map(deaf.seen_at, stops)):
        return
    asked = [node for node in nodes
             if isinstance(node, IsVisitorResponseYes) and heard.seen_at(node)]
    node = (asked + stops)[0]
    how = "never succeeds" if deaf.seen_at(node) else "is never reached"
    yield node.element.fault(
        rules.NO_STOP,
        f"with asrEnabled false {node.registration_id} {how}, and the mission never comes to its "
        "stops",
        "without speech recognition, the mission stores no yes on a way to it")


class _Follower:
    """Follows the paths through a tree; ``is_heard``: speech is recognised."""

    def __init__(self, tree: Tree, settings: Settings, is_heard: bool):
        self._is_heard = is_heard
        self._tablet_stores = settings.tablet_tells
        # by id() of the element: a tree is the same wherever it is used
        self._known: Dict[Tuple[int, States], Ways] = {}
        self._seen: Dict[int, States] = {}
        self._ways(tree.root, frozenset([PathState()]))

    def seen_at(self, node: Any) -> States:
        """Return the states in which the element of ``node`` is reached, wherever its tree is used.
        """
        return self._seen.get(id(node.element), frozenset())

    def _ways(self, node: Any, states: States) -> Ways:
        """Return how ``node`` can end if it is reached with any of ``states``."""
        is_conditional = not node.attributes.keys().isdisjoint(PRE_CONDITIONS)
        if is_conditional:
            states = _forgotten(states)
        key = id(node.element), states
        if key not in self._known:
            self._seen[key[0]] = self.seen_at(node) | states
            ways = self._inside(node, states)
            if is_conditional:
                ways = ways | _each(_ENDS, states)
            if "_while" in node.attributes:
                ways = ways | _each([SKIPS], _forgotten(self._during(node)))
            self._known[key] = ways
        return self._known[key]

    def _during(self, node: Any) -> States:
        """Return the states in which ``node`` can be halted, or asked again."""
        return frozenset().union(*map(self.seen_at, node.iterate()))

    def _inside(self, node: Any, states: States) -> Ways:
        """Follow what a node does, again if it may begin anew with other states."""
        if not node.children:
            return {way for state in states for way in self._leaf(node, state)}
        while True:
            if node.spec.next_after:
                ways, again = self._chain(node, states), states
            elif node.spec.outcome is chosen:
                ways, again = self._choice(node.children, states), states
            elif len(node.children) == 1:
                ways, again = self._decorator(node, states)
            else:  # it may run any of its children in any order
                after = _states(way for child in node.children for way in self._ways(child, states))
                ways, again = _each(_ENDS, after), _forgotten(after)
            if node.spec.is_reactive:
                again = self._during(node)
            if again <= states:
                return ways
            states |= again

    def _leaf(self, node: Any, state: PathState) -> Ways:
        if isinstance(node, MissionLeaf):
            return {(end, self._after(node, state, end)) for end in (SUCCEEDS, FAILS)
                    if self._may(node, state, end)}
        can_end = by(node.spec.outcome, node.attributes, [])
        if can_end not in _ENDS:  # it may be a look for the visitor
            state = state._replace(missed_by="")
        return {(end, state) for end in _ENDS if end & can_end}

    def _may(self, node: MissionLeaf, state: PathState, end: int) -> bool:
        """Return whether a mission leaf can end with ``end``."""
        if isinstance(node, IsASREnabled):
            return (end == SUCCEEDS) == self._is_heard
        if end == SUCCEEDS and isinstance(node, (IsVisitorResponseYes, HasVisitorResponded)):
            return state.has_answer
        if end == SUCCEEDS and isinstance(node, IsYesNoUttered):
            return self._is_heard
        return bool(by(node.spec.outcome, node.attributes, []) & end)

    def _after(self, node: MissionLeaf, state: PathState, end: int) -> PathState:
        """Return ``state`` after a mission leaf has ended with ``end``. A mode that could not be
        set counts as set: no mission counts on such a failure."""
        if isinstance(node, OvertAttentionMode):
            state = state._replace(mode=node.state)
        if end == FAILS:
            is_look = node.sense in (Sense.VISITOR, Sense.PRESENCE)
            return state._replace(missed_by=node.registration_id) if is_look else state
        if node.spec.is_recovery or node.sense in (Sense.VISITOR, Sense.PRESENCE, Sense.GAZE):
            return state._replace(missed_by="")
        return state._replace(has_answer=state.has_answer or self._stores_answer(node))

    def _stores_answer(self, node: MissionLeaf) -> bool:
        by_voice, by_tablet = Sense.UTTERANCE in node.spec.listens, Prompt in node.spec.calls
        return (node.spec.writes(VISITOR_RESPONSE.name) and (self._is_heard or not by_voice)
                and (self._tablet_stores or not by_tablet))

    def _chain(self, node: Any, states: States) -> Ways:
        """Follow a control that goes on to the next child after one end, and ends after the other.
        """
        goes_on, ended = node.spec.next_after, set()
        children = node.children[:-1] if node.spec.last_is_apart else node.children
        for child in children:
            ways = self._ways(child, states)
            states = _states(way for way in ways if way[0] & (goes_on | SKIPS))
            ended |= {way for way in ways if not way[0] & (goes_on | SKIPS)}
        if node.spec.last_is_apart:
            ended = _each([FAILS], _states(self._ways(node.children[-1], _states(ended))))
        return ended | _each([goes_on], states)

    def _choice(self, children: List[Any], states: States) -> Ways:
        """Follow an IfThenElse or a WhileDoElse."""
        condition = self._ways(children[0], states)
        yes, no = (_states(way for way in condition if way[0] == end) for end in (SUCCEEDS, FAILS))
        otherwise = self._ways(children[2], no) if len(children) > 2 else _each([FAILS], no)
        return (self._ways(children[1], yes) | otherwise) if len(children) > 1 else otherwise

    def _decorator(self, node: Any, states: States) -> Tuple[Ways, States]:
        """Follow a node with one child; return the states too with which it repeats that."""
        # the ends that it has by itself, whatever its child does: a Timeout, for one
        ways, again = self._ended(node, 0, _forgotten(self._during(node))), set()
        for end, state in self._ways(node.children[0], states):
            after = self._ended(node, end, [state])
            ways |= after
            if not after or end & node.spec.repeats_on:
                again.add(state)
        return ways, frozenset(again)

    @staticmethod
    def _ended(node: Any, end: int, states: Iterable[PathState]) -> Ways:
        """Return how a node with one child ends when that ends with ``end``."""
        can_end = by(node.spec.outcome, node.attributes, [end])
        return _each([flag for flag in _ENDS if flag & can_end], states)


def _states(ways: Iterable[Tuple[int, PathState]]) -> States:
    return frozenset(state for _, state in ways)


def _each(ends: Iterable[int], states: Iterable[PathState]) -> Ways:
    return set(itertools.product(ends, states))


def _forgotten(states: Iterable[PathState]) -> States:
    """Return ``states`` without what is known of the visitor."""
    return frozenset(state._replace(missed_by="") for state in states)
