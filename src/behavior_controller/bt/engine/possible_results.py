"""How nodes can end, as flags, and how the end of a node follows from the ends of its children.

A safe estimate: whatever a node may do according to the file counts as possible.
"""
from functools import reduce
from operator import or_
from typing import Callable, List, Mapping, Union

SUCCEEDS, FAILS, SKIPS = 1, 2, 4
OF_A_LEAF = SUCCEEDS | FAILS
ANY_RESULT = SUCCEEDS | FAILS | SKIPS
EACH = (SUCCEEDS, FAILS, SKIPS)

Attributes = Mapping[str, str]
Rule = Callable[[Attributes, List[int]], int]
Outcome = Union[int, Rule]
"""How a node can end: always so, or by its attributes and the ends of its children."""

ENDS_BY_NAME = {"SUCCESS": SUCCEEDS, "FAILURE": FAILS, "SKIPPED": SKIPS, "RUNNING": 0, "IDLE": 0}


def of_any_child(_attributes: Attributes, children: List[int]) -> int:
    """Return the ends of all children."""
    return reduce(or_, children, 0)


def of_child(succeeded: int, failed: int, skipped: int = SKIPS, always: int = 0) -> Rule:
    """Return the rule of a node that ends so after its child has SUCCEEDED, FAILED or was SKIPPED,
    and with ``always`` whatever the child does."""
    def outcome(_attributes: Attributes, children: List[int]) -> int:
        after = zip(EACH, (succeeded, failed, skipped))
        return reduce(or_, (ends for end, ends in after if children[0] & end), always)
    return outcome


def in_chain(children: List[int], advances_on: int) -> int:
    """Return how a Sequence can end, which advances on SUCCEEDS, or a Fallback, on FAILS."""
    result = some = 0
    skips = SKIPS
    for child in children:
        result |= child & OF_A_LEAF & ~advances_on
        if not child & (advances_on | SKIPS):
            return result
        some |= child & advances_on
        skips &= child
    return result | some | skips


def in_rounds(child: int, rounds: str, repeats_on: int) -> int:
    """Return how a Repeat can end, which repeats on SUCCEEDS, or a Retry, on FAILS."""
    if rounds != "-1" and (child & repeats_on or not rounds.strip("0").isdigit()):
        return child | repeats_on
    return child & ~repeats_on


def of_branches(children: List[int]) -> int:
    """Return how an IfThenElse can end, whose first child chooses the second or the third."""
    _, then, otherwise = children[:3] + [0, 0, FAILS][len(children):]
    return of_child(then, otherwise, skipped=0)({}, children)


def in_parallel(attributes: Attributes, children: List[int]) -> int:
    """Return how a Parallel can end; with counts given, in any way."""
    if {"success_count", "failure_count"} & set(attributes):
        return ANY_RESULT
    everyone = all(child & (SUCCEEDS | SKIPS) for child in children)
    return (of_any_child(attributes, children) & FAILS) | (SUCCEEDS if everyone else 0)


def with_precondition(attributes: Attributes, children: List[int]) -> int:
    """Return how a Precondition can end."""
    return children[0] | ENDS_BY_NAME.get(attributes.get("else", "FAILURE"), ANY_RESULT)


def for_each_item(attributes: Attributes, children: List[int]) -> int:
    """Return how a Loop can end."""
    return children[0] & FAILS | ENDS_BY_NAME.get(attributes.get("if_empty", "SUCCESS"), ANY_RESULT)
