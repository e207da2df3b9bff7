"""Warns of what cannot work in a mission, by following every path through its tree.

The state on a path is the mode of attention that was set last, whether the visitor has left,
whether an answer is stored, and what the mission has found out about it. Where the file does not
decide (scripts, the recovery policy), the visitor counts as present.
"""
import itertools
from typing import Any, Dict, FrozenSet, Iterable, Iterator, List, NamedTuple, Set, Tuple

from behavior_controller.bt.loader import rules
from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.possible_results import ANY_RESULT, EACH, FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.engine.registry import Kind
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.errors import Fault
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Prompt
from behavior_controller import leaves
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.config.node_facts import whole_mission
from behavior_controller.leaves.data import (
    CURRENT_EXHIBIT, QUESTION_ASKED_AT, VISITOR_RESPONSE)
from behavior_controller.config.settings import Settings

MAX_PATH_DEPTH, MAX_ELEMENTS = 150, 2_000
"""Levels and elements of a mission beyond which its paths are not followed: no mission drawn by
hand has so many."""


class PathState(NamedTuple):
    """The state on a path to a node. ``mode`` is empty before one was set."""

    is_heard: bool  # speech is recognised
    mode: str = ""
    missed_by: str = ""  # the node type that last looked for the visitor, if it found none
    has_answer: bool = False
    is_asked_again: bool = False  # since that answer, which may be a yes
    is_unanswered: bool = False  # no answer was stored when it was asked again
    known: FrozenSet[Tuple[str, int]] = frozenset()  # of conditions on the answer, how each ended


States = FrozenSet[PathState]
Ways = Set[Tuple[int, PathState]]
"""The ends of a node, each one of the flags, and the state then."""


def foresee(tree: Tree, settings: Settings) -> List[Fault]:
    """Return the warnings about a mission on the robot of ``settings``. Speech recognition is
    considered on and off."""
    levels: Dict[Any, int] = {None: 0}
    for node in tree.nodes:  # parents come before their children
        levels[node] = levels[node.parent] + 1
    once = {id(node.element): node for node in tree.nodes}
    if max(levels.values()) > MAX_PATH_DEPTH or len(once) > MAX_ELEMENTS:
        return []
    nodes = [node for node in once.values() if isinstance(node, MissionLeaf)]
    follower = _Follower(tree, settings.tablet_tells)
    heard, deaf = ({node: {state for state in follower.seen_at(node) if state.is_heard is is_heard}
                    for node in nodes} for is_heard in (True, False))
    faults = [fault for node in nodes for fault in _of_one(node, heard[node], settings)]
    return faults + list(_without_recognition(nodes, heard, deaf))


def _of_one(node: MissionLeaf, states: Set[PathState], settings: Settings) -> Iterator[Fault]:
    """Yield the warnings about a mission leaf that is reached with ``states``."""
    if node.sense is not None and states and settings.interface.tells(node.sense):
        mode = settings.interface.evidence(node.sense).mode
        modes = {state.mode for state in states}
        if mode and mode not in modes:
            setter = next(spec.id for spec in leaves.mission_specs() if spec.sets_mode == mode)
            others = " or ".join(sorted(modes - {""}))
            hint = f"the mode set last before it is {others}; {setter} sets that one"
            if not others:
                hint = f"no node before it sets that mode, as {setter} does"
            text = (f"{node.registration_id} can never succeed: overtAttention reports "
                    f"{node.sense.noun} only in the mode {mode}")
            yield node.element.fault(rules.MODE_MISSING, text, hint)
    if _needs_answer(node) and any(state.is_unanswered for state in states):
        text = (f"{node.registration_id} may count the answer to an earlier question: the visitor "
                "is asked again, and may be silent")
        hint = "clear it before that question: <Script code=\"@visitorResponse := ''\"/>"
        yield node.element.fault(rules.EARLIER_ANSWER, text, hint)
    missed_by = sorted({state.missed_by for state in states} - {""})
    is_known = settings.interface.numbers_phrases or not node.spec.says_phrase
    if missed_by and is_known and node.spec.says_goodbye(node.name):
        text = (f"{node.registration_id} says goodbye to a visitor who has left: the mission goes "
                f"on to it after {missed_by[0]} failed")
        hint = "end the mission, or the branch, with FAILURE before it"
        yield node.element.fault(rules.FAREWELL_TO_NOBODY, text, hint)


def _without_recognition(nodes: List[MissionLeaf], heard: Dict[Any, Set[PathState]],
                         deaf: Dict[Any, Set[PathState]]) -> Iterator[Fault]:
    """Yield a warning if the mission takes its stops with speech recognition alone."""
    stops = [node for node in nodes if node.spec.writes(CURRENT_EXHIBIT.name)]
    if any(heard[node] for node in stops) and not any(deaf[node] for node in stops):
        asked = [node for node in nodes if _needs_answer(node) and heard[node]]
        # rather one that is reached and never succeeds
        node = (sorted(asked, key=lambda node: not deaf[node]) + stops)[0]
        how = "never succeeds" if deaf[node] else "is never reached"
        text = (f"with asrEnabled false {node.registration_id} {how}, and the mission never comes "
                "to its stops")
        hint = "without speech recognition, the mission stores no yes on a way to it"
        yield node.element.fault(rules.NO_STOP, text, hint)


class _Follower:
    """Follows the paths through a tree; ``tablet_stores``: an answer at the tablet is stored."""

    def __init__(self, tree: Tree, tablet_stores: bool):
        self._tablet_stores = tablet_stores
        answer = whole_mission(VISITOR_RESPONSE.name)
        # what scripts do with answers is not known
        self._is_answer_kept = not any(
            answer[1:-1] in text and text != answer
            for node in tree.nodes for text in node.attributes.values())
        # by id() of the element: a tree is the same wherever it is used
        self._known: Dict[Tuple[int, States], Tuple[Ways, States]] = {}
        self._seen: Dict[int, States] = {}
        self._ways(tree.root, frozenset([PathState(True), PathState(False)]))

    def seen_at(self, node: Any) -> States:
        """Return the states in which the element of ``node`` is reached, wherever its tree is used.
        """
        return self._seen.get(id(node.element), frozenset())

    def _ways(self, node: Any, states: States) -> Tuple[Ways, States]:
        """Return how ``node`` can end if it is reached with any of ``states``, and the states in
        which it can then be halted, or asked again."""
        is_conditional = not node.attributes.keys().isdisjoint(PRE_CONDITIONS)
        if is_conditional:
            states = _forgotten(states)
        key = id(node.element), states
        if key not in self._known:
            self._seen[key[0]], during = self.seen_at(node) | states, set(states)
            if node.children:
                ways = self._inside(node, states, during)
            else:
                ways = {way for state in states for way in self._leaf(node, state)}
            if is_conditional:
                ways = ways | _each(ANY_RESULT, states)
            if "_while" in node.attributes:
                ways = ways | _each(SKIPS, _forgotten(during))
            self._known[key] = ways, frozenset(during)
        return self._known[key]

    def _inside(self, node: Any, states: States, during: Set[PathState]) -> Ways:
        """Follow what a node with children does, until no child is reached with further states;
        ``during`` gets those of the children."""
        spec, count = node.spec, len(node.children)
        first = spec.first(count)
        reached = [set(states) if index in first else set() for index in range(count)]
        ways: Ways = set()
        before = -1
        while sum(map(len, reached)) > before:
            before = sum(map(len, reached))
            for index, child in enumerate(node.children):
                ends_of_child, below = self._ways(child, frozenset(reached[index]))
                during |= below
                for end, state in ends_of_child:
                    ends, following = spec.after(node.attributes, count, index, end)
                    ways |= _each(ends, [state])
                    if ends == ANY_RESULT:
                        state = state._replace(missed_by="")
                    for other in following:
                        reached[other].add(state)
            if spec.is_reactive or len(first) > 1:
                for index in first:
                    reached[index] |= during
        if count == 1:
            # the ends that it has by itself, whatever its child does: a Timeout, for one
            ways |= _each(spec.ends(node.attributes, [0]), _forgotten(during))
        return ways

    def _leaf(self, node: Any, state: PathState) -> Ways:
        can_end = node.spec.ends(node.attributes, [])
        if isinstance(node, MissionLeaf):
            return {(end, self._after(node, state, end)) for end in (SUCCEEDS, FAILS)
                    if end & can_end and self._may(node, state, end)}
        if can_end not in EACH:  # it may be a look for the visitor
            state = state._replace(missed_by="")
        return _each(can_end, [state])

    @staticmethod
    def _may(node: MissionLeaf, state: PathState, end: int) -> bool:
        """Return whether a mission leaf can end with ``end`` in that state."""
        if node.spec.setting == "asr_enabled":
            return (end == SUCCEEDS) == state.is_heard
        if (node.registration_id, FAILS + SUCCEEDS - end) in state.known:
            return False
        if end == FAILS or node.spec.kind is not Kind.CONDITION:
            return True
        is_deaf = Sense.UTTERANCE in node.spec.listens and not state.is_heard
        return not is_deaf and (state.has_answer or not _needs_answer(node))

    def _after(self, node: MissionLeaf, state: PathState, end: int) -> PathState:
        """Return ``state`` after a mission leaf has ended with ``end``. A mode that could not be
        set counts as set: no mission counts on such a failure."""
        state = self._with_answer(node, state, end)
        state = state._replace(mode=node.spec.mode(node.name) or state.mode)
        if end == FAILS:
            if node.sense in (Sense.VISITOR, Sense.PRESENCE):
                return state._replace(missed_by=node.registration_id)
            return state
        if node.spec.is_recovery or node.sense in (Sense.VISITOR, Sense.PRESENCE, Sense.GAZE):
            return state._replace(missed_by="")
        return state

    def _with_answer(self, node: MissionLeaf, state: PathState, end: int) -> PathState:
        """Return ``state`` with what is stored as the answer, and known of it, after that end."""
        spec, is_prompt = node.spec, Prompt in node.spec.calls
        if spec.begins_pass:
            return state._replace(has_answer=False, is_asked_again=False, is_unanswered=False,
                                  known=frozenset())
        if spec.writes(VISITOR_RESPONSE.name):
            state = state._replace(known=frozenset())
            if (end == SUCCEEDS and (state.is_heard or Sense.UTTERANCE not in spec.listens)
                    and (self._tablet_stores or not is_prompt)):
                return state._replace(has_answer=True, is_asked_again=False, is_unanswered=False)
            if spec.kind is Kind.CONDITION or is_prompt:  # another may clear it before
                return state._replace(is_unanswered=state.is_asked_again)
        elif self._is_answer_kept and _needs_answer(node):
            return state._replace(known=state.known | {(node.registration_id, end)})
        elif (spec.kind is Kind.ACTION and spec.writes(QUESTION_ASKED_AT.name) and state.has_answer
              and self._is_answer_kept and FAILS not in {end for _, end in state.known}):
            return state._replace(is_asked_again=True)
        return state


def _needs_answer(node: MissionLeaf) -> bool:
    """Return whether a condition is false while no answer is stored."""
    return node.spec.kind is Kind.CONDITION and node.spec.needs(VISITOR_RESPONSE.name)


def _each(ends: int, states: Iterable[PathState]) -> Ways:
    """Return each of the flags ``ends`` with each of ``states``."""
    return set(itertools.product([end for end in EACH if end & ends], states))


def _forgotten(states: Iterable[PathState]) -> States:
    """Return ``states`` without what is known of the visitor."""
    return frozenset(state._replace(missed_by="") for state in states)
