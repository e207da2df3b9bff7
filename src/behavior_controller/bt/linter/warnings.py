"""Rules about single nodes: what loads, but is probably a mistake.

Only the NodeSpecs say what nodes do. A warning must be worth reading: if the file and the node
types do not decide, there is none.
"""
import re
from typing import List

from behavior_controller.bt.linter import rules
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.linter.reactive import check_reactive
from behavior_controller.bt.linter.structure import CONDITIONS
from behavior_controller.bt.possible_results import FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import EXPLICIT, Element
from behavior_controller.bt.script.values import whole_real
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, Role
from behavior_controller.bt.status import BY_NAME
from behavior_controller.text import did_you_mean

IGNORED_ON_PURPOSE = ("_uid", "_fullpath", "_description", "__shared_blackboard", "__autoremap")
_REPEATS = {SUCCEEDS: ("repeats", "succeeds", "repeats forever and never waits",
                       "put a Sleep inside"),
            FAILS: ("retries", "fails", "asks again and again without waiting",
                    "a ReactiveFallback of the condition and a Sleep waits for it")}
_ODD_BRACES = re.compile(r"^\{[^{}]*$|^[^{}]*\}$|\$\{|\{=?[A-Za-z_@][A-Za-z0-9_]*\}")


def check_node(facts: MissionFacts, element: Element, tree: str) -> None:
    """Apply the rules to a node of ``tree``."""
    spec, warn = facts.spec(element), facts.warn
    check_ignored(facts, element)
    for port in spec.ports:
        if port.name in element.attributes:
            _check_port(facts, element, spec, port, tree)
        else:
            _check_missing(facts, element, spec, port)
    if element.tag in EXPLICIT and element.tag != spec.kind.value:
        warn(rules.KIND_MISMATCH, element, f"<{element.tag} ID=\"{spec.id}\">: {spec.id} is of "
             f"kind {spec.kind.value}, not {element.tag}")
    if spec.child_counts and len(element.children) not in spec.child_counts:
        allowed = " or ".join(map(str, spec.child_counts))
        warn(rules.CHILD_COUNT, element,
             f"{spec.id} has {len(element.children)} children; it must have {allowed}",
             f"{spec.children}; it will fail when it is ticked")
    if spec.next_after:
        _check_chain(facts, element, spec)
    if spec.repeats_on:
        _check_repeat(facts, element, spec)
    if spec.is_reactive:
        check_reactive(facts, element, spec)


def check_ignored(facts: MissionFacts, element: Element) -> bool:
    """Warn of attributes that begin with _ and mean nothing, but nearly do; return whether there is
    one."""
    before = len(facts.findings.warnings)
    for name in element.attributes:
        if name[0] != "_" or name in CONDITIONS or name in IGNORED_ON_PURPOSE:
            continue
        if name == "_autoremap":
            if element.tag != "SubTree":
                facts.warn(rules.AUTOREMAP_MISPLACED, element,
                           "_autoremap means something only on a <SubTree>", attribute=name)
            continue
        near = did_you_mean(name, CONDITIONS + ("_autoremap",))
        if near:
            facts.warn(rules.CONDITION_MISSPELT, element, f"{name} is ignored", near, name)
    return len(facts.findings.warnings) > before


# -------------------------------------------------------------------------------------------- ports


def _check_port(facts: MissionFacts, element: Element, spec: NodeSpec, port: Port,
                tree: str) -> None:
    text, warn = element.attributes[port.name], facts.warn
    is_literal = ports.reference(text, port.name) is None
    if port.type == "NodeStatus" and text not in BY_NAME and is_literal:
        warn(rules.STATUS_UNKNOWN, element, f"{port.name}=\"{text}\" is not a status",
             f"allowed: {' '.join(BY_NAME)}", port.name)
    elif port.role is Role.CHILDREN:
        _check_count(facts, element, port, text)
    elif port.role is Role.WATCHED and is_literal and set(text) & set("{}$"):
        warn(rules.BRACES_ODD, element, f"{port.name}=\"{text}\" names no entry",
             f"write {port.name}=\"{{{text.strip('{}$ ')}}}\"", port.name)
    elif port.role is Role.CASE:
        _check_case(facts, element, spec, port, tree)
    elif port.role in (Role.WRITES, Role.NAMES):
        _check_name(facts, element, port, tree)
    elif port.role in (Role.DATA, Role.CHOICE):
        is_odd = check_braces(facts, element, port.name, tree)
        if port.role is Role.CHOICE and is_literal and not is_odd:
            warn(rules.SWITCH_VARIABLE, element,
                 f"{port.name} compares the text {text}, which never changes",
                 f"an entry is written {{{text}}}", port.name)


def _check_missing(facts: MissionFacts, element: Element, spec: NodeSpec, port: Port) -> None:
    if port.direction is not Direction.OUT and port.default is None and not port.is_optional:
        facts.warn(rules.PORT_MISSING, element,
                   f"{spec.id} needs the port {port.name}, which is not given",
                   "it will fail when it is ticked")
    name = element.attributes.get("name", spec.id)
    has_digit = any(letter.isdigit() for letter in name)
    if port.names and name not in port.names + (spec.id,) and has_digit:
        facts.warn(
            rules.NAME_CHOOSES_NOTHING, element,
            f"the name {name} has no effect; {spec.id} allows the names {' and '.join(port.names)}",
            spec.description, "name")


def check_braces(facts: MissionFacts, element: Element, attribute: str, tree: str) -> bool:
    """Warn of a text that is nearly a reference to an entry; return whether it is."""
    text, warn = element.attributes[attribute], facts.warn
    key = ports.reference(text, attribute)
    inner = text.strip("${} \t")
    is_written = text in facts.written.get(tree, ()) and text.isidentifier()
    is_stub = element.tag != "SubTree" and facts.spec(element).is_stub
    if key is None and is_written and not is_stub:
        warn(rules.BRACES_FORGOTTEN, element,
             f"{attribute}=\"{text}\" is the text {text}, not the entry",
             f"the entry is written {{{text}}}", attribute)
    elif key is None and not text.startswith("json:") and _ODD_BRACES.search(text):
        hint = "a text is not filled in: a reference is the whole value"
        if inner.isidentifier():
            hint = f"the whole value is written {{{inner}}}"
        warn(rules.BRACES_ODD, element, f"{attribute}=\"{text}\" is a text, no entry", hint,
             attribute)
    elif key is not None and (key != key.strip() or "{" in key or "}" in key):
        warn(rules.BRACES_ODD, element, f"{attribute}=\"{text}\" is the entry called \"{key}\"",
             f"write {{{inner}}}", attribute)
    else:
        return False
    return True


def _check_name(facts: MissionFacts, element: Element, port: Port, tree: str) -> None:
    """Warn of an entry that is taken for the name of another, and holds a number."""
    key = ports.reference(element.attributes[port.name], port.name)
    if key is not None and facts.kinds.is_number(tree, key):
        facts.warn(
            rules.NAME_IS_NUMBER, element,
            f"{port.name}=\"{{{key}}}\" is the entry whose name {key} holds, which is a number",
            f"the entry itself is written {port.name}=\"{key}\"", port.name)


def _check_case(facts: MissionFacts, element: Element, spec: NodeSpec, port: Port,
                tree: str) -> None:
    text, warn = element.attributes[port.name], facts.warn
    for other in spec.ports:
        if other.name == port.name:
            break
        if other.role is Role.CASE and element.attributes.get(other.name) == text:
            warn(rules.SWITCH_CASE, element,
                 f"{port.name} is never chosen: {other.name} is the same", attribute=port.name)
            return
    if ports.reference(text, port.name) is not None:
        return
    bare = text.strip(" \t,;'\"")
    choice = next(other.name for other in spec.ports if other.role is Role.CHOICE)
    key = ports.reference(element.attributes.get(choice, ""), choice)
    if bare != text:
        warn(rules.SWITCH_CASE, element,
             f"{port.name}=\"{text}\" is compared with all that stands in it",
             f"write {port.name}=\"{bare}\"", port.name)
    elif key is not None and whole_real(text) is None and text not in facts.defaults.given \
            and facts.kinds.is_number(tree, key):
        warn(rules.SWITCH_CASE, element,
             f"{port.name} is never chosen: {key} holds a number, and {text} is none",
             "write the number", port.name)


def _check_count(facts: MissionFacts, element: Element, port: Port, text: str) -> None:
    attribute, count = port.name, len(element.children)
    if text.isdigit() and int(text[:9]) > count:
        facts.warn(rules.COUNT_TOO_HIGH, element,
                   f"{attribute}=\"{text}\", but there are only {count} children",
                   "it will fail when it is ticked", attribute)
    elif text == "0":
        facts.warn(rules.COUNT_ZERO, element, f"{attribute}=\"0\" {port.if_zero}",
                   "-1 is all children", attribute)


# ----------------------------------------------------------------------------------------- children


def _check_chain(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Apply the rules of a control that ticks its next child after a certain end of the last one.
    """
    children = element.children[:-1] if spec.last_is_apart else element.children
    is_sequence = spec.next_after == SUCCEEDS
    wrong = "comes first: there is no failure before it to look at"
    hint = "it belongs after the step that may fail"
    if is_sequence:
        wrong = "is reached only if all before it succeeded: there is no failure to look at"
        hint = "it belongs into a Fallback, after the step that may fail"
    _check_reached(facts, children, spec.next_after | SKIPS, "succeeds" if is_sequence else "fails")
    # the first of a Sequence may follow the failure of what is before the Sequence
    for child in children[1:] if is_sequence else children[:1]:
        child_spec = facts.registry.find(child.type_id)
        if child_spec is not None and child_spec.is_recovery:
            facts.warn(rules.RECOVERY_MISPLACED, child, child.type_id + " " + wrong, hint)


def _check_reached(facts: MissionFacts, children: List[Element], wanted: int, what: str) -> None:
    for child, following in zip(children, children[1:]):
        if not facts.ends[id(child)] & wanted:
            facts.warn(
                rules.NEVER_REACHED, following,
                f"{_called(following)} is never reached: {_called(child)} before it never {what}")
            return


def _check_repeat(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    child, rounds = element.children[0], element.attributes.get(spec.rounds, "")
    repeats, ends, _, _ = _REPEATS[spec.repeats_on]
    if not facts.ends[id(child)] & spec.repeats_on:
        facts.warn(rules.NEVER_REPEATS, element,
                   f"{spec.id} never {repeats}: {_called(child)} never {ends}")
    elif rounds == "-1":
        _check_pause(facts, element, spec)
    if rounds == "0" or (rounds[:1] == "-" and rounds[1:].isdigit() and rounds != "-1"):
        facts.warn(rules.NEVER_RUN, element, f"{spec.rounds}=\"{rounds}\": the child is never run",
                   "-1: no limit", spec.rounds)


def _check_pause(facts: MissionFacts, element: Element, spec: NodeSpec) -> None:
    """Warn of a loop without a limit in which nothing is known to wait, at least if a service
    fails."""
    _, _, endlessly, hint = _REPEATS[spec.repeats_on]
    inside = list(facts.inside(element.children[0]))
    asks = [element for element in inside if facts.spec(element).may_fail_at_once]
    goes_on = spec.repeats_on == FAILS or not facts.ends[id(element.children[0])] & FAILS
    if not all(_is_instant(facts.spec(element)) for element in inside):
        return
    if not asks:
        facts.warn(rules.NEVER_WAITS, element, f"{spec.id} {endlessly}", hint, spec.rounds)
    elif goes_on:
        called = _called(asks[0])
        facts.warn(rules.RETRIES_FOR_EVER, element,
                   f"{spec.id} never ends and never pauses if {called} fails at once",
                   f"give {spec.rounds} a limit, and put a Delay around {called}", spec.rounds)


def _is_instant(spec: NodeSpec) -> bool:
    """Return whether a node is known to add no waiting, at least if what it needs is gone."""
    is_known = spec.is_instant or spec.may_fail_at_once
    return (is_known or spec.kind in (Kind.CONDITION, Kind.SUBTREE)) and not spec.is_recovery


def _called(element: Element) -> str:
    name = element.attributes.get("name") or element.attributes.get("ID") or element.type_id
    return element.type_id if name == element.type_id else f"{element.type_id} {name}"
