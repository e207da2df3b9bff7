"""How the nodes of a mission can end, as far as the file alone says: with SUCCESS, with FAILURE, SKIPPED.

An estimate to the safe side: what a node may do for all we know counts as possible.
"""
from typing import Any, Callable, Dict, Iterable, List, Mapping

from behavior_controller.bt.language.document import Element

SUCCEEDS, FAILS, SKIPS = 1, 2, 4
ANY_END = SUCCEEDS | FAILS
_NEVER_FAIL = ("AlwaysSuccess", "Script", "UnsetBlackboard", "Sleep")
_CONDITIONS = {"_failureIf": FAILS, "_successIf": SUCCEEDS, "_skipIf": SKIPS, "_while": SKIPS}
_BY_NAME = {"SUCCESS": SUCCEEDS, "FAILURE": FAILS, "SKIPPED": SKIPS}


def in_sequence(children: Iterable[int], goes_on: int = SUCCEEDS, ends: int = FAILS) -> int:
    """Return how a Sequence of children with these ends can end; with the last two exchanged, a Fallback."""
    result = some = 0
    skips = SKIPS
    for child in children:
        result |= child & ends
        if not child & (goes_on | SKIPS):
            return result
        some |= child & goes_on
        skips &= child
    return result | some | skips


def in_fallback(children: Iterable[int]) -> int:
    """Return how a Fallback of children with these ends can end."""
    return in_sequence(children, FAILS, SUCCEEDS)


def _swapped(child: int) -> int:
    return (child & SKIPS) | (SUCCEEDS if child & FAILS else 0) | (FAILS if child & SUCCEEDS else 0)


def _forced(child: int, end: int) -> int:
    return (child & SKIPS) | (end if child & ANY_END else 0)


def _union(children: List[int]) -> int:
    result = 0
    for child in children:
        result |= child
    return result


def _repeat(element: Element, child: int) -> int:
    endless = element.attributes.get("num_cycles") == "-1"
    return child & (FAILS | SKIPS) | (0 if endless and child & SUCCEEDS else SUCCEEDS)


def _retry(element: Element, child: int) -> int:
    attempts = element.attributes.get("num_attempts", "")
    gives_up = child & FAILS and attempts != "-1"
    return child & (SUCCEEDS | SKIPS) | (FAILS if gives_up or not _at_least_one(attempts) else 0)


def _at_least_one(rounds: str) -> bool:
    """Return whether a number of rounds in the file means that the child runs."""
    return rounds == "-1" or (rounds.isdigit() and int(rounds[:9]) > 0)


def _parallel(element: Element, children: List[int]) -> int:
    if {"success_count", "failure_count"} & set(element.attributes):
        return ANY_END | SKIPS
    everyone = all(child & (SUCCEEDS | SKIPS) for child in children)
    return (_union(children) & FAILS) | (SUCCEEDS if everyone else 0)


def _if_then_else(_element: Element, children: List[int]) -> int:
    condition, branches = children[0], children[1:]
    otherwise = branches[1] if len(branches) > 1 else FAILS
    return (branches[0] if branches and condition & SUCCEEDS else 0) | (otherwise if condition & FAILS else 0)


_RULES: Dict[str, Callable[[Element, List[int]], int]] = {
    "Parallel": _parallel,
    "ParallelAll": lambda element, children: ANY_END | SKIPS,
    "IfThenElse": _if_then_else,
    "WhileDoElse": _if_then_else,
    "TryCatch": lambda element, children: in_sequence(children[:-1]),
    "Inverter": lambda element, children: _swapped(children[0]),
    "ForceSuccess": lambda element, children: _forced(children[0], SUCCEEDS),
    "ForceFailure": lambda element, children: _forced(children[0], FAILS),
    "KeepRunningUntilFailure": lambda element, children: children[0] & FAILS,
    "Repeat": lambda element, children: _repeat(element, children[0]),
    "RetryUntilSuccessful": lambda element, children: _retry(element, children[0]),
    "RunOnce": lambda element, children: children[0] | SKIPS,
    "Precondition": lambda element, children: children[0] | _BY_NAME.get(
        element.attributes.get("else", "FAILURE"), 0),
    "Timeout": lambda element, children: children[0] | FAILS,
    "SkipUnlessUpdated": lambda element, children: children[0] | SKIPS,
}
for _name in ("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence"):
    _RULES[_name] = lambda element, children: in_sequence(children)
for _name in ("Fallback", "AsyncFallback", "ReactiveFallback"):
    _RULES[_name] = lambda element, children: in_fallback(children)
for _name in ("LoopInt", "LoopBool", "LoopDouble", "LoopString"):
    _RULES[_name] = lambda element, children: children[0] & FAILS | _BY_NAME.get(
        element.attributes.get("if_empty", "SUCCESS"), ANY_END)


def outcomes(trees: Mapping[str, List[Element]], leaves: Mapping[str, int]) -> Dict[int, int]:
    """Return how each element can end, by ``id(element)``.

    ``trees`` holds the elements of each tree in document order, called trees before those that call them; ``leaves``
    the ends of node types that are known to have but one.
    """
    known: Dict[int, int] = {}
    ends_of_tree: Dict[str, int] = {}
    for tree_id, elements in trees.items():
        for element in reversed(elements):  # so that children come before their parent
            known[id(element)] = _ends(element, known, ends_of_tree, leaves)
        ends_of_tree[tree_id] = known[id(elements[0])] if elements else ANY_END | SKIPS
    return known


def _ends(element: Element, known: Dict[int, int], trees: Dict[str, int], leaves: Mapping[str, int]) -> int:
    node_id = element.type_id
    children: Any = [known[id(child)] for child in element.children]
    if element.tag == "SubTree":
        result = trees.get(element.attributes.get("ID", ""), ANY_END | SKIPS)
    elif children:
        rule = _RULES.get(node_id)
        result = rule(element, children) if rule else _union(children)
    elif node_id == "AlwaysFailure":
        result = FAILS
    else:
        result = SUCCEEDS if node_id in _NEVER_FAIL else leaves.get(node_id, ANY_END)
    for attribute, end in _CONDITIONS.items():
        if attribute in element.attributes:
            result |= end
    return result
