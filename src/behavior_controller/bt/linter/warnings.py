"""Rules about single nodes: what loads, but is probably a mistake.

Only the NodeSpecs say what nodes do. A warning must be worth reading: if the file and the node
types do not decide, there is none.
"""
import math
import re
from typing import Iterator, Tuple

from behavior_controller.bt.loader import rules
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.linter.least_times import milliseconds
from behavior_controller.bt.loader.structure import CONDITIONS, is_port_name
from behavior_controller.bt.engine.possible_results import FAILS, OF_A_LEAF, SKIPS, SUCCEEDS
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import EXPLICIT, Element
from behavior_controller.bt.values.values import whole_real
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port, Role
from behavior_controller.bt.values.status import BY_NAME
from behavior_controller.text import did_you_mean

IGNORED_ON_PURPOSE = ("_uid", "_fullpath", "_description", "__shared_blackboard", "__autoremap")
_REPEATS = {SUCCEEDS: ("repeats", "succeeds", "repeats forever and never waits",
                       "put a Sleep inside"),
            FAILS: ("retries", "fails", "asks again and again without waiting",
                    "a ReactiveFallback of the condition and a Sleep waits for it")}
_CHAINS = {
    SUCCEEDS: ("succeeds", "is reached only if all before it succeeded: there is no failure to "
               "look at", "it belongs into a Fallback, after the step that may fail"),
    FAILS: ("fails", "comes first: there is no failure before it to look at",
            "it belongs after the step that may fail")}
WILL_FAIL = "will fail when it is ticked"
_ODD_BRACES = re.compile(r"^\{[^{}]*$|^[^{}]*\}$|\$\{|\{=?[A-Za-z_@][A-Za-z0-9_]*\}")


def check_node(facts: MissionFacts, element: Element, tree: str) -> None:
    """Apply the rules to a node of ``tree``."""
    spec, report = facts.spec(element), facts.report
    check_ignored(facts, element)
    for port in spec.ports:
        if port.name in element.attributes:
            _check_port(facts, element, port, tree)
        else:
            _check_missing(facts, element, spec, port)
    if element.tag in EXPLICIT and element.tag != spec.kind.value:
        kind = f"{spec.id} is of kind {spec.kind.value}, not {element.tag}"
        report(rules.KIND_MISMATCH, element, f"<{element.tag} ID=\"{spec.id}\">: {kind}")
    count = len(element.children)
    if spec.child_counts and count not in spec.child_counts:
        allowed = " or ".join(map(str, spec.child_counts))
        text = f"{spec.id} has {count} children; it must have {allowed}"
        report(rules.CHILD_COUNT, element, text, f"{spec.children}; it {WILL_FAIL}")
    if spec.advances_on:
        _check_chain(facts, element, spec)
    if spec.repeats_on in _REPEATS:
        _check_repeat(facts, element, spec)
    if spec.is_reactive and not _check_done_again(facts, element, spec) and spec.advances_on:
        _check_asked_late(facts, element, spec)
    limit = milliseconds(element.attributes, spec.limit)
    if limit:
        child = element.children[0]
        least = facts.least_times[id(child)][SUCCEEDS]
        if limit < least < math.inf:
            text = (f"{spec.id} ends its child after {limit:.0f} ms, and {_called(child)} needs at "
                    f"least {least:.0f} ms to succeed")
            hint = "give it more time, or its child less to wait for"
            report(rules.TIMEOUT_TOO_SHORT, element, text, hint, spec.limit)


def check_ignored(facts: MissionFacts, element: Element) -> bool:
    """Warn of attributes that begin with _ and mean nothing, but nearly do; return whether there is
    one."""
    before, ports_known = len(facts.findings.warnings), facts.spec(element).port_named
    for name in element.attributes:
        if name in CONDITIONS or name in IGNORED_ON_PURPOSE:
            continue
        if name[0] != "_":
            near = not name.isascii() and did_you_mean(name, ports_known)
            if near and name not in ports_known and not is_port_name(name):
                facts.report(rules.ATTRIBUTE_IGNORED, element, f"{name} is ignored", near, name)
            continue
        near = did_you_mean(name, CONDITIONS + ("_autoremap",))
        if name != "_autoremap" and near:
            facts.report(rules.CONDITION_MISSPELT, element, f"{name} is ignored", near, name)
        elif name == "_autoremap" and element.tag != "SubTree":
            text = "_autoremap means something only on a <SubTree>"
            facts.report(rules.AUTOREMAP_MISPLACED, element, text, attribute=name)
    return len(facts.findings.warnings) > before


# -------------------------------------------------------------------------------------------- ports


def _check_port(facts: MissionFacts, element: Element, port: Port, tree: str) -> None:
    text, name, report = element.attributes[port.name], port.name, facts.report
    is_literal = ports.reference(text, name) is None
    if port.type == "NodeStatus" and text not in BY_NAME and is_literal:
        wrong, hint = f"{name}=\"{text}\" is not a status", f"allowed: {' '.join(BY_NAME)}"
        report(rules.STATUS_UNKNOWN, element, wrong, hint, name)
    elif port.role is Role.CHILDREN:
        count = len(element.children)
        if text.isdecimal() and int(text[:9]) > count:
            wrong = f"{name}=\"{text}\", but there are only {count} children"
            report(rules.COUNT_TOO_HIGH, element, wrong, f"it {WILL_FAIL}", name)
        elif text == "0":
            wrong = f"{name}=\"0\" decides the result, whatever the children do"
            report(rules.COUNT_ZERO, element, wrong, "-1 is all children", name)
    elif port.role is Role.WATCHED and is_literal and set(text) & set("{}$"):
        hint = f"write {name}=\"{{{text.strip('{}$ ')}}}\""
        report(rules.BRACES_ODD, element, f"{name}=\"{text}\" names no entry", hint, name)
    elif port.role is Role.CASE:
        _check_case(facts, element, port, tree)
    elif port.role in (Role.WRITES, Role.NAMES):
        _check_name(facts, element, port, tree)
    elif port.role in (Role.DATA, Role.CHOICE):
        is_odd = check_braces(facts, element, name, tree)
        if port.role is Role.CHOICE and is_literal and not is_odd:
            wrong = f"{name} compares the text {text}, which never changes"
            report(rules.SWITCH_VARIABLE, element, wrong, f"an entry is written {{{text}}}", name)


def _check_missing(facts: MissionFacts, element: Element, spec: NodeSpec, port: Port) -> None:
    if port.direction is not Direction.OUT and port.default is None and not port.is_optional:
        text = f"{spec.id} needs the port {port.name}, which is not given"
        facts.report(rules.PORT_MISSING, element, text, f"it {WILL_FAIL}")
    name = element.attributes.get("name", spec.id)
    has_digit = any(letter.isdigit() for letter in name)
    if port.names and name not in port.names + (spec.id,) and has_digit:
        allowed = f"{spec.id} allows the names {' and '.join(port.names)}"
        text = f"the name {name} has no effect; {allowed}"
        facts.report(rules.NAME_CHOOSES_NOTHING, element, text, spec.description, "name")


def check_braces(facts: MissionFacts, element: Element, attribute: str, tree: str) -> bool:
    """Warn of a text that is nearly a reference to an entry; return whether it is."""
    text = element.attributes[attribute]
    key, inner = ports.reference(text, attribute), text.strip("${} \t")
    is_written = text in facts.written[tree] and text.isidentifier()
    is_stub = element.tag != "SubTree" and facts.spec(element).is_stub
    rule = rules.BRACES_ODD
    if key is None and is_written and not is_stub:
        rule, hint = rules.BRACES_FORGOTTEN, f"the entry is written {{{text}}}"
        wrong = f"is the text {text}, not the entry"
    elif key is None and not text.startswith("json:") and _ODD_BRACES.search(text):
        wrong, hint = "is a text, no entry", f"the whole value is written {{{inner}}}"
        if not inner.isidentifier():
            hint = "a text is not filled in: a reference is the whole value"
    elif key is not None and (key != key.strip() or "{" in key or "}" in key):
        wrong, hint = f"is the entry called \"{key}\"", f"write {{{inner}}}"
    else:
        return False
    facts.report(rule, element, f"{attribute}=\"{text}\" {wrong}", hint, attribute)
    return True


def _check_name(facts: MissionFacts, element: Element, port: Port, tree: str) -> None:
    """Warn of an entry that is taken for the name of another, unless all that it is known to hold
    are names of entries."""
    key = ports.reference(element.attributes[port.name], port.name)
    if key is None:
        return
    name = facts.flow.name(tree, key)
    held = [value.word.strip("'") for value in name.entry.known_values]
    held += [literal.text for literal in facts.flow.literals if name in literal.name.below()]
    rule, text = rules.NAME_FROM_ENTRY, ""
    if name.entry.is_number:
        rule, text = rules.NAME_IS_NUMBER, ", which is a number"
    elif held and all(facts.flow.is_named(word) for word in held):
        return
    text = f"{port.name}=\"{{{key}}}\" is the entry whose name {key} holds{text}"
    hint = f"the entry itself is written {port.name}=\"{key}\""
    facts.report(rule, element, text, hint, port.name)
    facts.excuse(tree, key)


def _check_case(facts: MissionFacts, element: Element, port: Port, tree: str) -> None:
    spec, text = facts.spec(element), element.attributes[port.name]
    bare = text.strip(" \t,;'\"")
    same = next(other.name for other in spec.ports if other.role is Role.CASE
                and element.attributes.get(other.name) == text)
    choice = next(other.name for other in spec.ports if other.role is Role.CHOICE)
    key = ports.reference(element.attributes.get(choice, ""), choice)
    wrong, hint = f"{port.name} is never chosen: ", ""
    if same != port.name:
        wrong += f"{same} is the same"
    elif ports.reference(text, port.name) is not None:
        return
    elif bare != text:
        wrong = f"{port.name}=\"{text}\" is compared with all that stands in it"
        hint = f"write {port.name}=\"{bare}\""
    elif key and whole_real(text) is None and facts.flow.name(tree, key).entry.is_number:
        wrong, hint = f"{wrong}{key} holds a number, and {text} is none", "write the number"
    else:
        return
    facts.report(rules.SWITCH_CASE, element, wrong, hint, port.name)


# ----------------------------------------------------------------------------------------- children


def _check_chain(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Apply the rules of a control that ticks its next child after a certain end of the last one.
    """
    children = spec.in_turn(element.children)
    is_sequence, wanted = spec.advances_on == SUCCEEDS, spec.advances_on | SKIPS
    what, wrong, hint = _CHAINS[spec.advances_on]
    for child, following in zip(children, children[1:]):
        if not facts.ends[id(child)] & wanted:
            text = f"{_called(following)} is never reached: {_called(child)} before it never {what}"
            facts.report(rules.NEVER_REACHED, following, text)
            break
    # the first of a Sequence may follow the failure of what is before the Sequence
    for child in children[1:] if is_sequence else children[:1]:
        if facts.spec(child).is_recovery:
            facts.report(rules.RECOVERY_MISPLACED, child, f"{child.type_id} {wrong}", hint)


def _check_repeat(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    child, rounds = element.children[0], element.attributes.get(spec.rounds, "")
    repeats, ends, _, _ = _REPEATS[spec.repeats_on]
    if not facts.ends[id(child)] & spec.repeats_on:
        text = f"{spec.id} never {repeats}: {_called(child)} never {ends}"
        facts.report(rules.NEVER_REPEATS, element, text)
    elif rounds == "-1":
        _check_pause(facts, element, spec)
    if rounds == "0" or (rounds[:1] == "-" and rounds[1:].isdigit() and rounds != "-1"):
        text = f"{spec.rounds}=\"{rounds}\": the child is never run"
        facts.report(rules.NEVER_RUN, element, text, "-1: no limit", spec.rounds)


def _check_pause(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Warn of a loop without a limit in which nothing is known to wait, at least if a service
    fails."""
    _, _, endlessly, hint = _REPEATS[spec.repeats_on]
    inside = list(facts.inside(element.children[0]))
    asking = next((inner for inner in inside if facts.spec(inner).may_fail_at_once), None)
    if not all(_is_instant(facts.spec(inner)) for inner in inside):
        return
    if asking is None:
        facts.report(rules.NEVER_WAITS, element, f"{spec.id} {endlessly}", hint, spec.rounds)
    elif spec.repeats_on == FAILS or not facts.ends[id(element.children[0])] & FAILS:
        called = _called(asking)
        text = f"{spec.id} never ends and never pauses if {called} fails at once"
        hint = f"give {spec.rounds} a limit, and put a Delay around {called}"
        facts.report(rules.RETRIES_FOR_EVER, element, text, hint, spec.rounds)


def _is_instant(spec: NodeSpec) -> bool:
    """Return whether a node is known to add no waiting, at least if what it needs is gone."""
    is_known = spec.is_instant or spec.may_fail_at_once
    return (is_known or spec.kind in (Kind.CONDITION, Kind.SUBTREE)) and not spec.is_recovery


def _called(element: Element) -> str:
    name = element.attributes.get("name") or element.attributes.get("ID") or element.type_id
    return element.type_id if name == element.type_id else f"{element.type_id} {name}"


# -------------------------------------------------------------------------------- reactive controls


def _check_done_again(facts: MissionFacts, element: Element, spec: NodeSpec) -> bool:
    """Warn of the first action that succeeds and is done again while a later child runs; return
    whether there is one."""
    goes_on = (spec.advances_on or OF_A_LEAF) | SKIPS
    for index, child in enumerate(element.children if spec.advances_on else element.children[:1]):
        if not any(_may_run(facts, later) for later in element.children[index + 1:]):
            break
        for leaf, ends in _done_first(facts, child):
            if ends & goes_on:
                text = (f"{leaf.type_id} succeeds and is done again, at every tick of {spec.id} "
                        "while a later child runs")
                facts.report(rules.DONE_AGAIN, leaf, text, f"put it before {spec.id}")
                return True
    return False


def _check_asked_late(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Warn of the first condition behind a child that only waits, if none stands before it."""
    children = iter(element.children)
    for child in children:
        if _asks(facts, child) or not facts.ends[id(child)] & (spec.advances_on | SKIPS):
            return
        if _may_run(facts, child):
            break
    late = next((later for later in children if _asks(facts, later)), None)
    if late is not None and all(_is_wait(facts.spec(inner)) for inner in facts.inside(child)):
        text = f"{_called(late)} is not asked while {_called(child)} is under way"
        facts.report(rules.ASKED_LATE, late, text, f"put it first in {spec.id}")


def _is_wait(spec: NodeSpec) -> bool:
    return spec.is_instant or spec.pause != "" or spec.kind in (Kind.SUBTREE, Kind.DECORATOR)


def _asks(facts: MissionFacts, element: Element) -> bool:
    """Return whether a condition is in ``element``, as a node or as an attribute."""
    return any(facts.spec(inner).kind is Kind.CONDITION or _is_conditional(inner)
               for inner in facts.inside(element))


def _is_conditional(element: Element) -> bool:
    return not element.attributes.keys().isdisjoint(CONDITIONS)


def _may_run(facts: MissionFacts, element: Element) -> bool:
    """Return whether a node is known to take time."""
    return any(spec.kind in (Kind.ACTION, Kind.DECORATOR) and not (spec.is_instant or spec.is_stub)
               for spec in map(facts.spec, facts.inside(element)))


def _done_first(facts: MissionFacts, element: Element) -> Iterator[Tuple[Element, int]]:
    """Yield the actions below ``element`` that are done whenever it begins anew, if none of them
    fails, each with the ways in which it can end after that one has succeeded: not actions that a
    condition, or a failure, leads to."""
    spec, children = facts.spec(element), element.children
    if _is_conditional(element):
        return
    if spec.kind is Kind.SUBTREE:
        yield from _done_first(facts, facts.elements[element.attributes["ID"]][0])
    elif spec.kind is Kind.ACTION:
        if not spec.is_stub and not spec.is_recovery and _does_more(facts, element, spec):
            yield element, SUCCEEDS
    # else it may leave its child out
    elif spec.kind is not Kind.DECORATOR or not spec.ends(element.attributes, [0]):
        for index, child in enumerate(children if spec.advances_on == SUCCEEDS else children[:1]):
            after = [facts.ends[id(later)] for later in children[index + 1:]]
            for leaf, ends in _done_first(facts, child):
                yield leaf, spec.ends(element.attributes, [SUCCEEDS] * index + [ends] + after)


def _does_more(facts: MissionFacts, leaf: Element, spec: NodeSpec) -> bool:
    """Return whether it matters that an action is done twice: it takes time, or goes on from what
    it wrote before."""
    if not spec.is_instant or any(port.direction is Direction.INOUT
                                  and port.role is not Role.WRITES for port in spec.ports):
        return True
    return any(assignment.is_own or assignment.sign not in (":=", "=")
               for use in facts.flow.scripts if use.element is leaf
               for assignment in use.script.facts.assignments)
