"""Warnings about scripts that can be read, but hardly do what their author means."""
from typing import Collection, Dict, Iterator, List, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.checking.dataflow import Flow, Key, Use
from behavior_controller.bt.language.operators import ScriptError, leading_number
from behavior_controller.bt.language.script import Assignment, Operand, Operation
from behavior_controller.bt.registry import did_you_mean
from behavior_controller.bt.rules import Rule

WORDS = {"not": "write !", "and": "write &&", "or": "write ||", "True": "write true", "TRUE": "write true",
         "False": "write false", "FALSE": "write false", "null": "an entry is never null",
         "NULL": "an entry is never null", "None": "an entry is never null", "nil": "an entry is never null"}
"""What other languages mean by a word, and scripts do not."""

_COMPARISONS = ("==", "!=", "<", ">", "<=", ">=")


class Remark(NamedTuple):
    """A warning about a script; ``at`` is where in its text."""

    rule: Rule
    use: Use
    text: str
    hint: str
    at: int


def remarks(flow: Flow, given: Collection[str]) -> Iterator[Remark]:
    """Yield what is to be said of a mission's scripts; ``given`` are entries that come from elsewhere, and enums."""
    written = {name for _, name in flow.written}.union(given)
    told: Set[Key] = set()
    for use in flow.scripts:
        found = list(_words(use, written)) or list(_effects(use)) + list(_assigning(use))
        if flow.is_known:
            yield from _not_created(use, flow, given, told, bool(found))
        yield from found
    yield from _kinds(flow, given)


def _words(use: Use, written: Collection[str]) -> Iterator[Remark]:
    for name, at in sorted(use.script.facts.names.items(), key=lambda item: item[1]):
        if name in WORDS and name not in written:
            yield Remark(rules.SCRIPT_WORD, use, "{} means nothing in a script".format(name), WORDS[name], at)
            return


def _effects(use: Use) -> Iterator[Remark]:
    statements = use.script.facts.statements
    for statement in statements[:-1] if use.is_condition else statements:
        if not statement.assigns:
            hint = "&& or || joins two conditions" if use.is_condition else "a value is assigned with :="
            yield Remark(rules.SCRIPT_NO_EFFECT, use, "a statement of {} has no effect".format(use.attribute), hint,
                         statement.position)
            return


def _assigning(use: Use) -> Iterator[Remark]:
    facts = use.script.facts
    if not use.is_condition:
        return
    last = facts.statements[-1]
    for assignment in facts.assignments:
        if assignment.position >= last.position and (last.is_assignment or assignment.sign == "="):
            yield Remark(rules.CONDITION_ASSIGNS, use, "{} assigns to {} instead of comparing".format(
                use.attribute, assignment.name), "write {} == …".format(assignment.name), assignment.position)
            return


def _not_created(use: Use, flow: Flow, given: Collection[str], told: Set[Key], is_excused: bool) -> Iterator[Remark]:
    created = flow.created_first()
    for assignment in use.script.facts.assignments:
        key = flow.first(flow.key(use.tree, assignment.name))
        if assignment.sign == ":=" or key in created or key in told or assignment.name.lstrip("@") in given:
            continue
        told.add(key)
        if not is_excused:
            yield Remark(rules.NOT_CREATED, use, "{} {} …, but nothing creates the entry {}".format(
                assignment.name, assignment.sign, assignment.name),
                _near(assignment.name, created, use.tree) or "create it first: {} := …".format(assignment.name),
                assignment.position)


def _near(name: str, created: Collection[Key], tree: str) -> str:
    return did_you_mean(name, sorted(other for of_tree, other in created if of_tree == tree), likeness=0.75)


# ------------------------------------------------------------------------------------------------- texts and numbers


class _Written(NamedTuple):
    """An assignment, and the script in which it stands."""

    use: Use
    assignment: Assignment


def _kinds(flow: Flow, given: Collection[str]) -> Iterator[Remark]:
    by_key: Dict[Key, List[_Written]] = {}
    for use in sorted(flow.scripts, key=lambda use: (use.element.document.file, use.element.number)):
        for assignment in use.script.facts.assignments:
            if assignment.sign in (":=", "="):
                key = flow.first(flow.key(use.tree, assignment.name))
                by_key.setdefault(key, []).append(_Written(use, assignment))
    touched = {flow.first(key) for key in flow.touched}
    known: Dict[Key, str] = {}
    for key, writes in by_key.items():
        if key not in touched and key[1] not in given:
            changed = _changed(writes)
            if changed is not None:
                yield changed
            else:
                known[key] = _kind_of_all(writes)
    for use in flow.scripts:
        yield from _mixed(use, flow, known)


def _literal_kind(value: Operand) -> str:
    """Return the kind of an operand; a text that is read as a number beside one is of any kind."""
    return "" if value.kind == "name" or (value.kind == "text" and _is_numeric(value.word)) else value.kind


def _is_numeric(word: str) -> bool:
    if word[1:-1] in ("true", "false"):
        return True
    try:
        leading_number(word[1:-1])
    except ScriptError:
        return not word  # what is put together is not known
    return True


def _changed(writes: List[_Written]) -> Optional[Remark]:
    first = next((kind for kind in (_literal_kind(write.assignment.value) for write in writes) if kind), "")
    for use, assignment in writes:
        kind = _literal_kind(assignment.value)
        if kind and kind != first:
            return Remark(rules.KIND_CHANGES, use, "{} is assigned a {}, but elsewhere a {}".format(
                assignment.name, kind, first), "the first value decides the kind of an entry", assignment.position)
    return None


def _kind_of_all(writes: List[_Written]) -> str:
    kinds = {_literal_kind(write.assignment.value) for write in writes}
    return kinds.pop() if len(kinds) == 1 else ""


def _mixed(use: Use, flow: Flow, known: Dict[Key, str]) -> Iterator[Remark]:
    def kind(operand: Operand) -> str:
        if operand.kind == "name":
            return known.get(flow.first(flow.key(use.tree, operand.word)), "")
        return _literal_kind(operand)

    facts = use.script.facts
    compound = [Operation(assignment.sign, Operand("name", assignment.name, assignment.position), assignment.value)
                for assignment in facts.assignments if assignment.sign not in (":=", "=")]
    for operation in facts.operations + compound:
        wrong = _wrong(operation, kind(operation.left), kind(operation.right))
        if wrong:
            yield Remark(rules.TEXT_AND_NUMBER, use, wrong[0], wrong[1], operation.left.position)


def _wrong(operation: Operation, left: str, right: str) -> Optional[Tuple[str, str]]:
    """Return what is wrong with an operation on these kinds, and a hint."""
    sign = operation.sign
    said = "{} {} {}".format(operation.left.word or "…", sign, operation.right.word or "…")
    if sign in _COMPARISONS:
        if {left, right} == {"text", "number"}:
            return "{} compares a text with a number".format(said), "a text needs single quotes, a number none"
    elif "text" in (left, right) and sign != ".." and (sign not in ("+", "+=") or "number" in (left, right)):
        return "{} calculates with a text".format(said), "texts are joined with .."
    return None
