"""Rules about scripts that can be read, but hardly do what their author means."""
from typing import Dict, Iterator, List, Optional, Tuple

from behavior_controller.bt.loader import rules
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.loader.flow import (CREATED, NUMERAL, SOME_TEXT, TOUCHED, UNCREATED,
                                                WRITTEN, Literal, Use, Value, literal_kind)
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.engine.possible_results import SUCCEEDS
from behavior_controller.bt.script.parser import NO_FUNCTIONS, Assignment, Operand, Operation
from behavior_controller.bt.values.status import BY_NAME
from behavior_controller.bt.values.values import GENERIC, TEXT, whole_real
from behavior_controller.text import did_you_mean

FOREIGN_WORDS = {
    **dict.fromkeys(("if", "then", "else", "elif"), "write condition ? value : other"),
    "is": "write ==", "xor": "write !=", "in": "compare with each", "return": "leave it out",
    "not": "write !", "and": "write &&", "or": "write ||", "True": "write true",
    "TRUE": "write true", "False": "write false", "FALSE": "write false",
    **dict.fromkeys(("null", "NULL", "None", "nil"), "an entry is never null")}
"""What other languages mean by a word, and scripts do not."""
_CHARACTERS = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}
"""What XML writes as &lt; and the like."""

_COMPARISONS = ("==", "!=", "<", ">", "<=", ">=")
_TEXTS = {"text", NUMERAL, SOME_TEXT}


Finding = Tuple[rules.LintRule, str, str, int]
"""A rule, the text, the hint, and the position in the script."""


def check_scripts(facts: MissionFacts) -> None:
    """Apply the rules to each script of a mission, and to what its scripts and texts write."""
    # a name that nothing writes fails, unless another robot may give it a meaning
    facts.findings.refuses_late = facts.is_host_known and facts.flow.is_known
    for use in facts.flow.scripts:
        findings = list(_words(facts, use)) or [*_effects(facts, use), *_assigning(use)]
        not_created = list(_not_created(facts, use))
        if not findings:
            findings = not_created + list(_truth(facts, use))
        findings += _mixed(facts, use)
        for rule, text, hint, at in findings:
            facts.report(rule, use.element, text, hint, use.attribute, at)
    facts.findings.refuses_late = False
    _check_literals(facts)
    for entry in dict.fromkeys(name.entry for name in facts.flow.all()):
        for values in entry.instances():
            _check_changed(facts, values)
            if entry.types <= set(GENERIC):
                _check_emptied(facts, values)


def _words(facts: MissionFacts, use: Use) -> Iterator[Finding]:
    for name, at in sorted(use.script.facts.read.items(), key=lambda item: item[1]):
        uses = facts.flow.name(use.tree, name).entry.uses
        text, hint = f"{name} means nothing in a script", FOREIGN_WORDS.get(name, "")
        sign = _CHARACTERS.get(name.lower())
        if sign and use.script.text[at - 1:at] == "&":
            text = f"&{name} is no character reference"
            hint = f"write &{name.lower()}; with its semicolon, for {sign}"
        elif name in use.script.facts.calls and not hint:
            text, hint = f"{name}(…) would call a function", NO_FUNCTIONS
        elif name in BY_NAME and facts.is_host_known:
            text = f"the status {name} means nothing in a script"
            hint = "let _onSuccess or _onFailure set an entry, and compare that"
        if hint and uses.isdisjoint((WRITTEN, TOUCHED)):
            facts.excuse(use.tree, name)
            yield rules.SCRIPT_WORD, text, hint, at
            return


def _effects(facts: MissionFacts, use: Use) -> Iterator[Finding]:
    statements = use.script.facts.statements
    for statement in statements[:-1] if use.is_condition else statements:
        if not statement.assigns:
            text = f"a statement of {use.attribute} has no effect"
            hint = "a value is assigned with :="
            if use.is_condition:
                hint = "&& or || joins two conditions"
            yield rules.SCRIPT_NO_EFFECT, text, hint, statement.position
            for name in use.script.facts.read:
                facts.excuse(use.tree, name)
            return


def _assigning(use: Use) -> Iterator[Finding]:
    last = use.script.facts.statements[-1]
    for assignment in use.script.facts.assignments:
        is_last = assignment.position >= last.position
        if use.is_condition and is_last and (last.is_assignment or assignment.sign == "="):
            text = f"{use.attribute} assigns to {assignment.name} instead of comparing"
            hint = f"write {assignment.name} == …"
            yield rules.CONDITION_ASSIGNS, text, hint, assignment.position
            return


def _not_created(facts: MissionFacts, use: Use) -> Iterator[Finding]:
    """Warn of the first assignment to an entry that nothing creates, and note the entry."""
    for name, sign, _, position, _ in use.script.facts.assignments:
        uses = facts.flow.name(use.tree, name).entry.uses
        is_created = not uses.isdisjoint((CREATED, TOUCHED, UNCREATED))
        if not is_created and facts.flow.is_known and facts.is_host_known:
            uses.add(UNCREATED)
            known = sorted(other.name for other in facts.flow.names[use.tree].values()
                           if CREATED in other.entry.uses)
            text = f"{name} {sign} …, but nothing creates the entry {name}"
            hint = did_you_mean(name, known, likeness=0.75) or f"create it first: {name} := …"
            yield rules.NOT_CREATED, text, hint, position


# -------------------------------------------------------------------------------- texts and numbers


def _truth(facts: MissionFacts, use: Use) -> Iterator[Finding]:
    """Warn of a number that is neither 0 nor 1 where a script needs a truth value."""
    script = use.script.facts
    for operand in _conditions(use):
        words, what = [operand.word], operand.word
        if operand.kind == "name":
            entry = facts.flow.name(use.tree, operand.word).entry
            words = [value.word for value in entry.known_values if entry.kind == "number"]
            what = f"{operand.word}, which holds {_no_truth(words)},"
            if entry.kind in ("text", NUMERAL) and entry.types <= {*GENERIC, TEXT}:
                words, what = ["2"], f"{operand.word}, which holds a text,"
        if operand.kind == "text" or _no_truth(words):
            hint = f"compare it, as in {operand.word} > 0"
            if operand.kind == "text" or what.endswith("a text,"):
                hint = f"compare it, as in {operand.word} == 'yes'"
            yield (rules.NUMBER_AS_TRUTH, f"{what} is neither true nor false", hint,
                   operand.position)
            return


def _conditions(use: Use) -> List[Operand]:
    """Return the operands of a script that must be true or false."""
    script = use.script.facts
    operands = [operand for sign, *both in script.operations if sign in ("&&", "||")
                for operand in both]
    return operands + ([script.statements[-1].value] if use.is_condition else [])


def _operations(use: Use) -> List[Operation]:
    """Return the operations of a script, with those of += and the like."""
    operations = list(use.script.facts.operations)
    for assignment in use.script.facts.assignments:
        if assignment.sign not in (":=", "="):
            target = Operand("name", assignment.name, assignment.position)
            operations.append(Operation(assignment.sign, target, assignment.value))
    return operations


def _mixed(facts: MissionFacts, use: Use) -> Iterator[Finding]:
    script = use.script.facts
    for operation in _operations(use):
        kinds = _kind(facts, use, operation.left), _kind(facts, use, operation.right)
        wrong = _wrong(operation, *kinds)
        if wrong:
            yield (rules.TEXT_AND_NUMBER, *wrong, operation.left.position)
    for signs, operand in script.prefixed:
        if _kind(facts, use, operand) in _TEXTS:
            text = f"{signs}{operand.word} needs a number, and gets a text"
            yield rules.TEXT_AND_NUMBER, text, "", operand.position


def _check_literals(facts: MissionFacts) -> None:
    """Warn of each text or number that a SubTree gives its tree, and with which a script in it, or
    in a tree below it, fails."""
    uses: Dict[Tuple[str, str], List[Use]] = {}
    for use in facts.flow.scripts if facts.flow.literals else ():
        written = [assignment.name for assignment in use.script.facts.assignments]
        for name in {*use.script.facts.read, *written}:
            uses.setdefault((use.tree, name), []).append(use)
    known: Dict[Tuple[str, str, str], Optional[Tuple[Use, str, str]]] = {}
    for literal in facts.flow.literals:
        key = literal.name.tree, literal.name.name, literal.text
        if literal.text.isidentifier() and literal.name.is_own and not literal.name.read:
            continue  # told already: what the tree writes there is lost
        if key not in known:
            known[key] = next((
                (use, *wrong) for name in literal.name.below()
                for use in uses.get((name.tree, name.name), ()) if facts.findings.may_compare(1)
                for wrong in _with_literal(facts, use, name.name, literal)), None)
        found = known[key]
        if found is not None:
            use, wrong, hint = found
            name, where = literal.name.name, use.element.where(use.attribute)
            text = f"with {name}=\"{literal.text}\" {use.attribute} fails: {wrong} ({where})"
            entry = literal.text.strip(":${} ")
            if entry.isidentifier() and entry not in ("true", "false"):
                hint = f"an entry is written {{{entry}}}"
            giver, attribute = facts.trees.giver(literal.call, name)
            facts.report(rules.LITERAL_IN_SCRIPT, giver, text, hint, attribute)


def _with_literal(facts: MissionFacts, use: Use, name: str,
                  literal: Literal) -> Iterator[Tuple[str, str]]:
    """Yield what fails in a script if ``name`` is a literal, and a hint."""
    def kind_of(operand: Operand) -> str:
        if operand.name == name:
            return literal.kind
        return _kind(facts, use, operand)

    for operation in _operations(use):
        if name in (operation.left.word, operation.right.word):
            wrong = _wrong(operation, kind_of(operation.left), kind_of(operation.right))
            if wrong:
                yield wrong
    for signs, operand in use.script.facts.prefixed:
        if operand.word == name and literal.kind != "number":
            yield f"{signs}{name} needs a number", ""
    for operand in _conditions(use):
        if operand.name == name and (literal.kind != "number" or _no_truth([literal.text])):
            yield f"{name} is neither true nor false", f"compare it, as in {name} == …"
    for assignment in use.script.facts.assignments:
        if assignment.name == name:
            yield from _wrong_value(assignment, literal)


def _wrong_value(assignment: Assignment, literal: Literal) -> Iterator[Tuple[str, str]]:
    """Yield what is wrong with a value that is assigned to an entry which holds a literal."""
    kind, word = literal_kind(assignment.value), assignment.value.word
    sets = assignment.sign in (":=", "=")
    said, real = f"{assignment.name} {assignment.sign} {word or '…'}", whole_real(word)
    if sets and kind == "number" and literal.kind != "number":
        yield f"{said} changes a text to a number", "the first value decides the kind of an entry"
    elif sets and kind == "text" and literal.kind == "number":
        yield f"{said} changes a number to a text", "the first value decides the kind of an entry"
    elif assignment.sign in (":=", "=", "+=", "-=") and kind == "number" and (
            real is not None and not real.is_integer()
            and ports.subtree_literal(literal.text)[0] in ("int", "int64")):
        yield f"{said} gives an integer a fraction", f"write {assignment.name}=\"{literal.text}.0\""


def _kind(facts: MissionFacts, use: Use, operand: Operand) -> str:
    if operand.kind == "name":
        return facts.flow.name(use.tree, operand.word).entry.kind
    return literal_kind(operand)


def _check_changed(facts: MissionFacts, values: List[Value]) -> None:
    """Warn of the first assignment of a number to an entry that holds a text, or the
    reverse."""
    known = [value for value in values if value.kind in ("text", "number")
             and not (value.is_own and value.kind == "number")]
    for name, element, attribute, kind, _, assignment in known:
        if kind != known[0].kind and assignment is not None:
            text = f"{name} is assigned a {kind}, but elsewhere a {known[0].kind}"
            hint = "the first value decides the kind of an entry"
            facts.report(rules.KIND_CHANGES, element, text, hint, attribute, assignment.position)
            return


def _check_emptied(facts: MissionFacts, values: List[Value]) -> None:
    """Warn of each text that is written to an entry that a script before it has made, which
    knows no conversion."""
    made = [value.element for value in values
            if value.assignment is not None and value.assignment.sign == ":="]
    for value in values:
        if value.assignment is None and any(_is_before(facts, element, value.element)
                                            for element in made):
            text = f"the entry {value.name} was made by a script: this text empties it"
            hint = f"write it with a script: {value.name} := …"
            facts.report(rules.TEXT_EMPTIES, value.element, text, hint, value.attribute)


def _is_before(facts: MissionFacts, one: Element, other: Element) -> bool:
    """Return whether a Sequence ticks ``one`` before ``other``."""
    if one.document is not other.document or one.last >= other.number:
        return False
    inner: Optional[Element] = one.document.root
    while inner is not None:
        around = inner
        inner = next((child for child in around.children if child.number <= one.number
                      and other.number <= child.last), None)
    spec = facts.registry.get(around.type_id)
    return spec is not None and spec.advances_on == SUCCEEDS


def _no_truth(words: List[str]) -> str:
    """Return which of the numbers that an entry is assigned is neither true nor false; "" if none.
    """
    negative = next((word for word in words if word[:1] == "-" and word.strip("-0.")), "")
    integers = [word for word in words if word.isdecimal() or word[:2] in ("0x", "0X")]
    # an entry whose first value is a real holds reals, of which all but the negative ones are
    return negative or next((word for word in integers if len(integers) == len(words) and
                             word.lstrip("0xX") not in ("", "1")), "")


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
