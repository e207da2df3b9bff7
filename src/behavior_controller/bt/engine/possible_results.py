"""How nodes can end, as flags, and how the end of a node follows from the ends of its children.

A safe estimate: whatever a node may do according to the file counts as possible.
"""
from functools import partial, reduce
from operator import or_
from typing import Callable, List, Mapping, Optional, Union

SUCCEEDS, FAILS, SKIPS = 1, 2, 4
OF_A_LEAF = SUCCEEDS | FAILS
ANY = SUCCEEDS | FAILS | SKIPS

Attributes = Mapping[str, str]
Outcome = Union[int, Callable[[Attributes, List[int]], int]]
"""How a node can end: always so, or by its attributes and the ends of its children."""

BY_NAME = {"SUCCESS": SUCCEEDS, "FAILURE": FAILS, "SKIPPED": SKIPS}


def by(outcome: Optional[Outcome], attributes: Attributes, children: List[int]) -> int:
    """Return how a node can end, by its ``outcome``; without one nothing is known of it."""
    if outcome is None:
        return ANY if children else OF_A_LEAF
    return outcome(attributes, children) if callable(outcome) else outcome


def of_any_child(_attributes: Attributes, children: List[int]) -> int:
    """Return the ends of all children."""
    return reduce(or_, children, 0)


def of_child(succeeded: int, failed: int, skipped: int = SKIPS, always: int = 0) -> Outcome:
    """Return the rule of a node that ends so after its child has SUCCEEDED, FAILED or was SKIPPED,
    and with ``always`` whatever the child does."""
    def outcome(_attributes: Attributes, children: List[int]) -> int:
        after = ((SUCCEEDS, succeeded), (FAILS, failed), (SKIPS, skipped))
        return reduce(or_, (ends for end, ends in after if children[0] & end), always)
    return outcome


def _chain(_attributes: Attributes, children: List[int], goes_on: int, ends: int) -> int:
    result = some = 0
    skips = SKIPS
    for child in children:
        result |= child & ends
        if not child & (goes_on | SKIPS):
            return result
        some |= child & goes_on
        skips &= child
    return result | some | skips


in_sequence = partial(_chain, goes_on=SUCCEEDS, ends=FAILS)
in_fallback = partial(_chain, goes_on=FAILS, ends=SUCCEEDS)


def in_sequence_before_the_last(attributes: Attributes, children: List[int]) -> int:
    """Return how a Sequence can end whose last child does not count."""
    return in_sequence(attributes, children[:-1])


def _in_rounds(attributes: Attributes, children: List[int], port: str, goes_on: int,
               ends: int) -> int:
    child, count = children[0], attributes.get(port, "")
    may_be_none = count != "-1" and not count.strip("0").isdigit()
    may_be_the_last = count != "-1" and child & goes_on
    return child & (ends | SKIPS) | (goes_on if may_be_none or may_be_the_last else 0)


repeated = partial(_in_rounds, port="num_cycles", goes_on=SUCCEEDS, ends=FAILS)
retried = partial(_in_rounds, port="num_attempts", goes_on=FAILS, ends=SUCCEEDS)


def in_parallel(attributes: Attributes, children: List[int]) -> int:
    """Return how a Parallel can end; with counts given, in any way."""
    if {"success_count", "failure_count"} & set(attributes):
        return ANY
    everyone = all(child & (SUCCEEDS | SKIPS) for child in children)
    return (of_any_child(attributes, children) & FAILS) | (SUCCEEDS if everyone else 0)


def chosen(_attributes: Attributes, children: List[int]) -> int:
    """Return how an IfThenElse can end."""
    condition, branches = children[0], children[1:]
    result = branches[0] if branches and condition & SUCCEEDS else 0
    otherwise = branches[1] if len(branches) > 1 else FAILS
    return result | otherwise if condition & FAILS else result


def with_precondition(attributes: Attributes, children: List[int]) -> int:
    """Return how a Precondition can end."""
    return children[0] | BY_NAME.get(attributes.get("else", "FAILURE"), 0)


def for_each_item(attributes: Attributes, children: List[int]) -> int:
    """Return how a Loop can end."""
    return children[0] & FAILS | BY_NAME.get(attributes.get("if_empty", "SUCCESS"), OF_A_LEAF)
