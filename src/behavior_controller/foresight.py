"""Warns of what cannot work in a mission, by following every path through its tree.

The state on a path is the mode of attention that was set last, whether the visitor has left, and whether an answer is
stored. Where the file does not decide (scripts, the recovery policy), the visitor counts as present.
"""
from typing import Any, Dict, FrozenSet, Iterable, Iterator, List, NamedTuple, Set, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.ends import ANY, FAILS, OF_A_LEAF, SKIPS, SUCCEEDS, chosen
from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.errors import Fault
from behavior_controller.interface import Sense
from behavior_controller.interface.records import Prompt
from behavior_controller.leaves.attention import MODES, OvertAttentionMode
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.data import CURRENT_EXHIBIT, VISITOR_RESPONSE
from behavior_controller.leaves.dialogue import IsVisitorResponseYes, IsYesNoUttered
from behavior_controller.leaves.lifecycle import IsASREnabled
from behavior_controller.leaves.release_1_0 import HasVisitorResponded
from behavior_controller.phrases import YES
from behavior_controller.settings import Settings

DEEPEST, LARGEST = 150, 2_000
"""Levels and elements of a mission beyond which its paths are not followed: no mission drawn by hand has so many."""

_CONDITIONS = frozenset(PRE_CONDITIONS)
_MODE_MISSING = rules.warning(
    "mode-missing", "A sign of the visitor is asked for, and no node before sets the mode of attention that tells it.",
    "▸<IsMutualGazeDiscovered/>",
    "<Sequence>\n  <SocialOvertAttentionMode/>\n  ▸<IsMutualGazeDiscovered/>\n</Sequence>")
_FAREWELL = rules.warning(
    "farewell-to-nobody", "The mission says goodbye to a visitor who has left.",
    "<Fallback>\n  <IsVisitorDiscovered/>\n  ▸<SayGoodByeSpeech/>\n</Fallback>")
_NO_TOUR = rules.warning(
    "no-tour", "Without speech recognition no tour is ever given.",
    "<Sequence>\n  <RetrieveListOfExhibits/>\n  <IsYesNoUttered/>\n  ▸<IsVisitorResponseYes/>\n  <SelectExhibit/>\n"
    "</Sequence>")
_ENDS = (SUCCEEDS, FAILS, SKIPS)


class State(NamedTuple):
    """The state on a path to a node. ``mode`` is empty before one was set."""

    mode: str = ""
    missed_by: str = ""  # the node type that last looked for the visitor, if it found none
    has_answer: bool = False


class Way(NamedTuple):
    """One of the ends of a node, as a flag of ``ends``, and the state then."""

    end: int
    state: State


Ways = FrozenSet[Way]


def foresee(tree: Tree, settings: Settings) -> List[Fault]:
    """Return the warnings about a mission on the robot of ``settings``. Speech recognition is considered on and off."""
    if not _is_drawn_by_hand(tree):
        return []
    found = _Follower(settings, is_heard=True)
    found.ways(tree.root, State())
    faults = [fault for node in _once(tree.nodes) for fault in _of_one(node, found.seen_at(node), settings)]
    deaf = _Follower(settings, is_heard=False)
    deaf.ways(tree.root, State())
    return faults + list(_without_recognition(tree, found, deaf))


def _is_drawn_by_hand(tree: Tree) -> bool:
    levels: Dict[int, int] = {}
    for node in tree.nodes:  # parents come before their children
        levels[node.uid] = levels[node.parent.uid] + 1 if node.parent is not None else 1
    return max(levels.values()) <= DEEPEST and len({id(node.element) for node in tree.nodes}) <= LARGEST


def _once(nodes: Iterable[Any]) -> List[Any]:
    """Return one node for each element of the file."""
    return list({id(node.element): node for node in nodes}.values())


def _of_one(node: Any, states: Set[State], settings: Settings) -> Iterator[Fault]:
    """Yield the warnings about a mission leaf that is reached with ``states``."""
    if isinstance(node, TopicCondition) and states and settings.interface.tells(node.sense):
        mode = settings.interface.evidence(node.sense).mode
        if mode and mode not in {state.mode for state in states}:
            yield node.element.fault(
                _MODE_MISSING, "{} can never succeed: overtAttention tells of the visitor's {} only in the mode {}"
                .format(node.registration_id, node.sense.value, mode),
                "no node before it sets that mode, as {} does".format(
                    next(name for name, state, _, _ in MODES if state == mode)))
    if isinstance(node, MissionLeaf) and node.spec.says_goodbye(node.name):
        for missed_by in sorted({state.missed_by for state in states} - {""})[:1]:
            yield node.element.fault(
                _FAREWELL, "{} says goodbye to a visitor who has left: the mission goes on to it after {} failed"
                .format(node.registration_id, missed_by), "end the mission, or the branch, with FAILURE before it")


def _without_recognition(tree: Tree, found: "_Follower", deaf: "_Follower") -> Iterator[Fault]:
    """Yield a warning if there is a tour with speech recognition and none without."""
    tours = [node for node in _once(tree.nodes)
             if isinstance(node, MissionLeaf) and node.spec.writes(CURRENT_EXHIBIT.name)]
    if not any(found.seen_at(node) for node in tours) or any(deaf.seen_at(node) for node in tours):
        return
    asked = [node for node in _once(tree.nodes) if isinstance(node, IsVisitorResponseYes) and found.seen_at(node)]
    node = (asked + tours)[0]
    how = "never succeeds" if deaf.seen_at(node) else "is never reached"
    yield node.element.fault(_NO_TOUR, "with asrEnabled false {} {}, and no tour is ever given".format(
        node.registration_id, how), "without speech recognition, the mission stores no yes on a way to it")


class _Follower:
    """Follows the paths through a tree; ``is_heard``: speech is recognised."""

    def __init__(self, settings: Settings, is_heard: bool):
        self._is_heard = is_heard
        self._tablet_stores = settings.interface.tells_pressed or settings.tablet_success_is == YES
        self._known: Dict[Tuple[int, State], Ways] = {}  # by id() of the element: a tree is the same wherever it is used
        self._seen: Dict[int, Set[State]] = {}  # id() of an element -> the states in which it is reached

    def seen_at(self, node: Any) -> Set[State]:
        """Return the states in which the element of ``node`` is reached, wherever its tree is used."""
        return self._seen.get(id(node.element), set())

    def ways(self, node: Any, state: State) -> Ways:
        """Return how ``node`` can end if it is reached with ``state``."""
        key = id(node.element), state
        known = self._known.get(key)
        if known is None:
            is_conditional = not _CONDITIONS.isdisjoint(node.attributes)
            if is_conditional:
                state = state._replace(missed_by="")
            self._seen.setdefault(key[0], set()).add(state)
            found = set(self._inside(node, state))
            if is_conditional:
                found.update(Way(end, state) for end in _ENDS)
            known = self._known[key] = frozenset(found)
        return known

    def _inside(self, node: Any, state: State) -> Iterable[Way]:
        children, spec = node.children, node.spec
        if not children:
            return self._leaf(node, state)
        if spec.next_after:
            return self._chain(node, state)
        if spec.outcome is chosen:
            return self._choice(children, state)
        if len(children) == 1:
            return self._decorator(node, state)
        return self._in_any_order(children, state)

    def _leaf(self, node: Any, state: State) -> Iterable[Way]:
        if not isinstance(node, MissionLeaf):
            forgotten = state._replace(missed_by="")
            outcome = node.spec.outcome
            return [Way(end, state if outcome in _ENDS else forgotten)
                    for end in _ENDS if end & (outcome if isinstance(outcome, int) else OF_A_LEAF)]
        return [Way(end, self._after(node, state, end)) for end in (SUCCEEDS, FAILS) if self._may(node, state, end)]

    def _may(self, node: MissionLeaf, state: State, end: int) -> bool:
        """Return whether a mission leaf can end with ``end``."""
        if isinstance(node, IsASREnabled):
            return (end == SUCCEEDS) == self._is_heard
        if end == SUCCEEDS and isinstance(node, (IsVisitorResponseYes, HasVisitorResponded)):
            return state.has_answer
        if end == SUCCEEDS and isinstance(node, IsYesNoUttered):
            return self._is_heard
        return not isinstance(node.spec.outcome, int) or bool(node.spec.outcome & end)

    def _after(self, node: MissionLeaf, state: State, end: int) -> State:
        """Return ``state`` after a mission leaf has ended with ``end``."""
        if node.sense in (Sense.VISITOR, Sense.PRESENCE, Sense.GAZE):
            is_missed = end == FAILS and node.sense is not Sense.GAZE
            missed_by = node.registration_id if is_missed else "" if end == SUCCEEDS else state.missed_by
            return state._replace(missed_by=missed_by)
        if end == FAILS:
            return state
        if node.spec.is_recovery:
            return state._replace(missed_by="")
        if isinstance(node, OvertAttentionMode):
            return state._replace(mode=node.state)
        return state._replace(has_answer=state.has_answer or self._stores_answer(node))

    def _stores_answer(self, node: MissionLeaf) -> bool:
        by_voice, by_tablet = Sense.UTTERANCE in node.spec.listens, Prompt in node.spec.calls
        return (node.spec.writes(VISITOR_RESPONSE.name) and (self._is_heard or not by_voice)
                and (self._tablet_stores or not by_tablet))

    def _chain(self, node: Any, state: State) -> Iterable[Way]:
        """Follow a control that goes on to the next child after one end, and ends after the other."""
        goes_on, reached, found = node.spec.next_after, {state}, set()
        children = node.children[:-1] if node.spec.last_is_apart else node.children
        for child in children:
            after: Set[State] = set()
            for way in self._all(child, reached):
                if way.end & (goes_on | SKIPS):
                    after.add(way.state)
                else:
                    found.add(way)
            reached = after
        if node.spec.last_is_apart:
            found = {way._replace(end=FAILS) for way in self._all(node.children[-1], {way.state for way in found})}
        return found.union(Way(goes_on, each) for each in reached)

    def _all(self, node: Any, states: Iterable[State]) -> Set[Way]:
        return {way for state in states for way in self.ways(node, state)}

    def _choice(self, children: List[Any], state: State) -> Iterable[Way]:
        """Follow an IfThenElse or a WhileDoElse."""
        for end, branch in zip((SUCCEEDS, FAILS), children[1:] + [None]):
            for way in self.ways(children[0], state):
                if way.end == end:
                    yield from self.ways(branch, way.state) if branch is not None else (Way(FAILS, way.state),)

    def _decorator(self, node: Any, state: State) -> Iterable[Way]:
        """Follow a node with one child, again and again if it repeats that."""
        reached, waiting = {state}, [state]
        found: Set[Way] = set()
        while waiting:
            for way in self.ways(node.children[0], waiting.pop()):
                outcome = node.spec.outcome
                after = outcome(node.attributes, [way.end]) if callable(outcome) else ANY & way.end
                found.update(Way(end, way.state) for end in _ENDS if end & after)
                if (not after or way.end & node.spec.repeats_on) and way.state not in reached:
                    reached.add(way.state)
                    waiting.append(way.state)
        return found

    def _in_any_order(self, children: List[Any], state: State) -> Iterable[Way]:
        """Follow a control that may run any of its children in any order."""
        modes, found = {state.mode}, set()
        for _ in children:
            found = {way for child in children for mode in modes for way in self.ways(child, state._replace(mode=mode))}
            modes |= {way.state.mode for way in found}
        return {Way(end, way.state) for way in found for end in _ENDS}
