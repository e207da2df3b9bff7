"""Rules about scripts that can be read, but hardly do what their author means."""
from typing import List, Optional, Set, Tuple

from behavior_controller.bt.linter import rules
from behavior_controller.bt.linter.dataflow import (
    CREATED, NUMERAL, SOME_TEXT, TOUCHED, WRITTEN, EntryFacts, Use, literal_kind)
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.possible_results import SUCCEEDS
from behavior_controller.bt.script.parser import Operand, Operation
from behavior_controller.bt.script.values import GENERIC
from behavior_controller.text import did_you_mean

WORDS = {"not": "write !", "and": "write &&", "or": "write ||", "True": "write true",
         "TRUE": "write true", "False": "write false", "FALSE": "write false",
         "null": "an entry is never null", "NULL": "an entry is never null",
         "None": "an entry is never null", "nil": "an entry is never null"}
"""What other languages mean by a word, and scripts do not."""

_COMPARISONS = ("==", "!=", "<", ">", "<=", ">=")
_TEXTS = {"text", NUMERAL, SOME_TEXT}


def check_scripts(facts: MissionFacts) -> None:
    """Apply the rules to each script of a mission, and to what its scripts and texts write."""
    _Scripts(facts).check()


class _Scripts:
    def __init__(self, facts: MissionFacts):
        self.facts = facts
        self.flow = facts.flow
        self.uncreated: Set[EntryFacts] = set()

    def check(self) -> None:
        """Apply the rules."""
        for use in self.flow.scripts:
            before = len(self.facts.findings.warnings)
            if not self._words(use):
                self._effects(use)
                self._assigning(use)
            is_excused = len(self.facts.findings.warnings) > before
            self._not_created(use, is_excused)
            if not is_excused:
                self._truth(use)
            self._mixed(use)
        for entry in dict.fromkeys(name.entry for name in self.flow.all()):
            self._changed(entry)
            self._emptied(entry)

    def _warn(self, rule: rules.LintRule, use: Use, text: str, hint: str, at: int) -> None:
        self.facts.report(rule, use.element, text, hint, use.attribute, at)

    def _words(self, use: Use) -> bool:
        for name, at in sorted(use.script.facts.read.items(), key=lambda item: item[1]):
            uses = self.flow.name(use.tree, name).entry.uses
            if name in WORDS and uses.isdisjoint((WRITTEN, TOUCHED)):
                text = f"{name} means nothing in a script"
                self._warn(rules.SCRIPT_WORD, use, text, WORDS[name], at)
                return True
        return False

    def _effects(self, use: Use) -> None:
        statements = use.script.facts.statements
        for statement in statements[:-1] if use.is_condition else statements:
            if not statement.assigns:
                text = f"a statement of {use.attribute} has no effect"
                hint = "a value is assigned with :="
                if use.is_condition:
                    hint = "&& or || joins two conditions"
                self._warn(rules.SCRIPT_NO_EFFECT, use, text, hint, statement.position)
                for name in use.script.facts.read:
                    self.facts.excuse(use.tree, name)
                return

    def _assigning(self, use: Use) -> None:
        last = use.script.facts.statements[-1]
        for assignment in use.script.facts.assignments if use.is_condition else ():
            is_last = assignment.position >= last.position
            if is_last and (last.is_assignment or assignment.sign == "="):
                text = f"{use.attribute} assigns to {assignment.name} instead of comparing"
                hint = f"write {assignment.name} == …"
                self._warn(rules.CONDITION_ASSIGNS, use, text, hint, assignment.position)
                return

    def _not_created(self, use: Use, is_excused: bool) -> None:
        """Warn of the first assignment to an entry that nothing creates; ``is_excused``: another
        warning is about the script."""
        if not self.flow.is_known or not self.facts.is_host_known:
            return
        for name, sign, _, position, _ in use.script.facts.assignments:
            entry = self.flow.name(use.tree, name).entry
            if not entry.uses.isdisjoint((CREATED, TOUCHED)) or entry in self.uncreated:
                continue
            self.uncreated.add(entry)
            if not is_excused:
                known = sorted(other.name for other in self.flow.names[use.tree].values()
                               if CREATED in other.entry.uses)
                near = did_you_mean(name, known, likeness=0.75)
                text = f"{name} {sign} …, but nothing creates the entry {name}"
                hint = near or f"create it first: {name} := …"
                self._warn(rules.NOT_CREATED, use, text, hint, position)

    # ---------------------------------------------------------------------------- texts and numbers

    def _truth(self, use: Use) -> None:
        """Warn of a number that is neither 0 nor 1 where a script needs a truth value."""
        facts = use.script.facts
        operands = [operand for sign, *both in facts.operations if sign in ("&&", "||")
                    for operand in both]
        if use.is_condition:
            operands.append(facts.statements[-1].value)
        for operand in operands:
            words, what = [operand.word], operand.word
            if operand.kind == "name":
                entry = self.flow.name(use.tree, operand.word).entry
                words = [value.word for value in entry.known_values if entry.kind == "number"]
            wrong = _no_truth(words)
            if wrong:
                if operand.kind == "name":
                    what = f"{operand.word}, which holds {wrong},"
                text = f"{what} is neither true nor false"
                hint = f"compare it, as in {operand.word} > 0"
                self._warn(rules.NUMBER_AS_TRUTH, use, text, hint, operand.position)
                return

    def _changed(self, entry: EntryFacts) -> None:
        """Warn of the first assignment of a number to an entry that holds a text, or the
        reverse."""
        known = [value for value in entry.known_values if value.kind in ("text", "number")
                 and not (value.is_own and value.kind == "number")]
        for name, element, attribute, kind, _, assignment in known:
            if kind != known[0].kind and assignment is not None:
                text = f"{name} is assigned a {kind}, but elsewhere a {known[0].kind}"
                hint = "the first value decides the kind of an entry"
                self.facts.report(
                    rules.KIND_CHANGES, element, text, hint, attribute, assignment.position)
                return

    def _emptied(self, entry: EntryFacts) -> None:
        """Warn of each text that is written to an entry that a script before it has made, which
        knows no conversion."""
        if not entry.types <= set(GENERIC):
            return
        made = [value.element for value in entry.known_values
                if value.assignment is not None and value.assignment.sign == ":="]
        for value in entry.known_values if made else ():
            if value.assignment is None and any(self._is_before(element, value.element)
                                                for element in made):
                text = f"the entry {value.name} was made by a script: this text empties it"
                hint = f"write it with a script: {value.name} := …"
                self.facts.report(rules.TEXT_EMPTIES, value.element, text, hint, value.attribute)

    def _is_before(self, one: Element, other: Element) -> bool:
        """Return whether a Sequence ticks ``one`` before ``other``."""
        if one.document is not other.document or one.last >= other.number:
            return False
        inner: Optional[Element] = one.document.root
        while inner is not None:
            around = inner
            inner = next((child for child in around.children if child.number <= one.number
                          and other.number <= child.last), None)
        spec = self.facts.registry.find(around.type_id)
        return spec is not None and spec.next_after == SUCCEEDS

    def _mixed(self, use: Use) -> None:
        facts = use.script.facts
        operations = list(facts.operations)
        for assignment in facts.assignments:
            if assignment.sign not in (":=", "="):
                target = Operand("name", assignment.name, assignment.position)
                operations.append(Operation(assignment.sign, target, assignment.value))
        for operation in operations:
            kinds = self._kind(use, operation.left), self._kind(use, operation.right)
            wrong = _wrong(operation, *kinds)
            if wrong:
                self._warn(rules.TEXT_AND_NUMBER, use, *wrong, operation.left.position)
        for signs, operand in facts.prefixed:
            if self._kind(use, operand) in _TEXTS:
                text = f"{signs}{operand.word} needs a number, and gets a text"
                self._warn(rules.TEXT_AND_NUMBER, use, text, "", operand.position)

    def _kind(self, use: Use, operand: Operand) -> str:
        if operand.kind == "name":
            return self.flow.name(use.tree, operand.word).entry.kind
        return literal_kind(operand)


def _no_truth(words: List[str]) -> str:
    """Return which of the numbers that an entry is assigned is neither true nor false; "" if none.
    """
    negative = next((word for word in words if word[:1] == "-" and word.strip("-0.")), "")
    integers = [word for word in words if word.isdecimal() or word[:2] in ("0x", "0X")]
    # an entry whose first value is a real holds reals, of which all but the negative ones are
    return negative or next((word for word in integers if len(integers) == len(words) and
                             word not in ("0", "1")), "")


def _wrong(operation: Operation, left: str, right: str) -> Optional[Tuple[str, str]]:
    """Return what is wrong with an operation on these kinds, and a hint."""
    sign, kinds = operation.sign, {left, right}
    said = f"{operation.left.word or '…'} {sign} {operation.right.word or '…'}"
    if sign in _COMPARISONS:
        if kinds == {"text", "number"}:
            hint = "a text needs single quotes, a number none"
            return f"{said} compares a text with a number", hint
    elif _TEXTS & kinds and sign != ".." and ("number" in kinds or sign not in ("+", "+=")):
        return f"{said} calculates with a text", "texts are joined with .."
    elif sign in ("+", "+=") and kinds == {NUMERAL}:
        return f"{said} joins two texts", "numbers stand in a script, without quotes"
    return None
