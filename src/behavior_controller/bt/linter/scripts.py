"""Rules about scripts that can be read, but hardly do what their author means."""
from typing import List, Optional, Set, Tuple

from behavior_controller.bt.linter import rules
from behavior_controller.bt.linter.dataflow import Key, Use
from behavior_controller.bt.linter.facts import (
    NUMERAL, SOME_TEXT, MissionFacts, Write, literal_kind)
from behavior_controller.bt.script.parser import Operand, Operation
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
        self.given = facts.defaults.known
        self.written = {name for _, name in facts.flow.written}.union(self.given)
        self.created = {self.flow.first(key) for key in self.flow.created}
        self.uncreated: Set[Key] = set()

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
        for writes in self.facts.kinds.all():
            self._changed(writes)
        for place in self.flow.texts:
            if self.facts.kinds.emptied(place):
                text = f"the entry {place.name} was made by a script: this text empties it"
                hint = f"write it with a script: {place.name} := …"
                self.facts.report(rules.TEXT_EMPTIES, place.element, text, hint, place.attribute)

    def _warn(self, rule: rules.LintRule, use: Use, text: str, hint: str, at: int) -> None:
        self.facts.report(rule, use.element, text, hint, use.attribute, at)

    def _words(self, use: Use) -> bool:
        for name, at in sorted(use.script.facts.read.items(), key=lambda item: item[1]):
            if name in WORDS and name not in self.written:
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
            key = self.flow.first(self.flow.key(use.tree, name))
            is_created = sign == ":=" or key in self.created or name.lstrip("@") in self.given
            if is_created or key in self.uncreated:
                continue
            self.uncreated.add(key)
            if not is_excused:
                known = sorted(other for tree, other in self.created if tree == use.tree)
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
        if use.is_condition and facts.statements:
            operands.append(facts.statements[-1].value)
        for operand in operands:
            words = [operand.word]
            if operand.kind == "name":
                is_number = self._kind(use, operand) == "number"
                writes = self.facts.kinds.writes(use.tree, operand.word)
                words = [write.word for write in writes if is_number]
            wrong = _no_truth(words)
            if wrong:
                what = operand.word
                if operand.kind == "name":
                    what = f"{operand.word}, which holds {wrong},"
                text = f"{what} is neither true nor false"
                hint = f"compare it, as in {operand.word} > 0"
                self._warn(rules.NUMBER_AS_TRUTH, use, text, hint, operand.position)
                return

    def _changed(self, writes: List[Write]) -> None:
        known = [write for write in writes if write.kind in ("text", "number")
                 and not (write.is_own and write.kind == "number")]
        for write in known:
            if write.kind != known[0].kind and write.use is not None and write.assignment:
                name, kind, first = write.assignment.name, write.kind, known[0].kind
                text = f"{name} is assigned a {kind}, but elsewhere a {first}"
                hint = "the first value decides the kind of an entry"
                self._warn(rules.KIND_CHANGES, write.use, text, hint, write.assignment.position)
                return

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
            return self.facts.kinds.of(use.tree, operand.word)
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
