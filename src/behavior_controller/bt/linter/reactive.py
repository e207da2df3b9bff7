"""The rule about an action that a reactive control does anew at every tick."""
from typing import Iterator

from behavior_controller.bt.linter import rules
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.linter.structure import CONDITIONS
from behavior_controller.bt.possible_results import OF_A_LEAF, SKIPS, SUCCEEDS, by
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Role


def check_reactive(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Warn of the first action that succeeds and is done again while a later child runs."""
    goes_on = (spec.next_after or OF_A_LEAF) | SKIPS
    for index, child in enumerate(element.children if spec.next_after else element.children[:1]):
        running = next((later for later in element.children[index + 1:] if _may_run(facts, later)),
                       None)
        for leaf in _done_first(facts, child) if running is not None else ():
            if _ends_after(facts, child, leaf) & goes_on:
                facts.warn(
                    rules.DONE_AGAIN, leaf, f"{leaf.type_id} succeeds and is done again, at every "
                    f"tick of {spec.id} while a later child runs", f"put it before {spec.id}")
                return


def _may_run(facts: MissionFacts, element: Element) -> bool:
    """Return whether a node is known to take time."""
    specs = map(facts.spec, facts.inside(element))
    return any(spec.kind in (Kind.ACTION, Kind.DECORATOR) and not spec.is_instant
               and not spec.is_stub for spec in specs)


def _done_first(facts: MissionFacts, element: Element) -> Iterator[Element]:
    """Yield the actions below ``element`` that are done whenever it begins anew, if none of them
    fails: not those that a condition, or a failure, leads to."""
    spec = facts.spec(element)
    if not element.attributes.keys().isdisjoint(CONDITIONS):
        return
    if spec.kind is Kind.ACTION:
        if not spec.is_stub and not spec.is_recovery and _does_more(facts, element, spec):
            yield element
        return
    children = element.children
    if spec.kind is Kind.SUBTREE:
        children = facts.elements[element.attributes["ID"]][:1]
    elif spec.kind is Kind.DECORATOR and by(spec.outcome, element.attributes, [0]):
        return  # it may leave its child out
    elif spec.kind is Kind.CONTROL and spec.next_after != SUCCEEDS:
        children = children[:1]
    for child in children:
        yield from _done_first(facts, child)


def _does_more(facts: MissionFacts, leaf: Element, spec: NodeSpec) -> bool:
    """Return whether it matters that an action is done twice: it takes time, or goes on from what
    it wrote before."""
    goes_on = any(port.direction is Direction.INOUT and port.role is not Role.WRITES
                  for port in spec.ports)
    assignments = [assignment for use in facts.flow.scripts if use.element is leaf
                   for assignment in use.script.facts.assignments]
    return not spec.is_instant or goes_on or any(
        assignment.is_own or assignment.sign not in (":=", "=") for assignment in assignments)


def _ends_after(facts: MissionFacts, element: Element, leaf: Element) -> int:
    """Return how ``element`` can end after ``leaf`` in it has succeeded."""
    if element is leaf:
        return SUCCEEDS
    spec = facts.spec(element)
    if spec.kind is Kind.SUBTREE:
        return _ends_after(facts, facts.elements[element.attributes["ID"]][0], leaf)
    ends, before = [], True
    for child in element.children:
        holds = any(element is leaf for element in facts.inside(child))
        before = before and not holds
        after = _ends_after(facts, child, leaf) if holds else facts.ends[id(child)]
        ends.append(spec.next_after if before and spec.next_after else after)
    return by(spec.outcome, element.attributes, ends)
