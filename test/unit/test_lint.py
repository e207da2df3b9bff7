"""Warnings for what cannot be meant, none for what can; judged by small missions and recorded
traces of the library."""
import os
import time

import harness as conformance
import pytest

from behavior_controller import folders
from behavior_controller.bt.loader import rules
from behavior_controller.bt.linter.facts import outcomes
from behavior_controller.bt.loader.structure import MOST_FINDINGS
from behavior_controller.bt.linter.walker import lint
from behavior_controller.bt.loader.checks import check
from behavior_controller.bt.engine.possible_results import FAILS, SUCCEEDS
from behavior_controller.bt.engine.builtins import AlwaysSuccess, builtin_specs
from behavior_controller.bt.engine.decorators import Inverter
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.missions.load import load_tree
from fault_words import unsaid

REGISTRY = Registry(builtin_specs() + [
    NodeSpec("Act", Kind.ACTION, AlwaysSuccess),
    NodeSpec("Cond", Kind.CONDITION, AlwaysSuccess),
    NodeSpec("Begin", Kind.ACTION, AlwaysSuccess, outcome=SUCCEEDS),
    NodeSpec("Take", Kind.ACTION, AlwaysSuccess, (Port("from", "any", Direction.INOUT), ),
             outcome=SUCCEEDS, is_instant=True),
    NodeSpec("Recover", Kind.ACTION, AlwaysSuccess, is_recovery=True),
    NodeSpec("In", Kind.ACTION, AlwaysSuccess, (Port("in", "any"), )),
    NodeSpec("Out", Kind.ACTION, AlwaysSuccess, (Port("out", "any", Direction.OUT), )),
    NodeSpec("Own", Kind.DECORATOR, Inverter),
    NodeSpec("Foreign", Kind.ACTION, AlwaysSuccess, (Port("in", "any", is_optional=True), ),
             is_stub=True),
    NodeSpec("Drive", Kind.ACTION, AlwaysSuccess, (Port("target", "int", default="{@goal}"),
                                                   Port("speed", "int", default="{@pace}"))),
    NodeSpec("Aim", Kind.ACTION, AlwaysSuccess, (Port("to", "int", Direction.OUT, "{@goal}"), )),
    NodeSpec("Hurry", Kind.ACTION, AlwaysSuccess, (Port("to", "int", Direction.OUT, "{@pace}"), )),
    NodeSpec("Stroll", Kind.ACTION, AlwaysSuccess,
             (Port("to", "int", Direction.OUT, "{@pace}"),
              Port("mood", "int", default="{@mood}", is_optional=True))),
    NodeSpec("Guess", Kind.ACTION, AlwaysSuccess,
             (Port("of", default="{@given}", is_optional=True), ))])
TRACES = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "conformance",
                      "random.jsonl.xz")


def faults(body, *more):
    """Return the warnings about a mission; ``body`` begins in the second line."""
    text = ('<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">'
            '\n{}</BehaviorTree>{}</root>')
    documents = [parse(text.format(body, "".join("\n" + tree for tree in more)), "m.xml")]
    checked = check(documents, REGISTRY)
    assert checked.faults == []
    found = lint(checked)
    assert all(fault.is_warning for fault in found if fault.code != "script-word")
    return found


def warnings(body, *more):
    """Return line, column and code of each warning."""
    return [(fault.line, fault.column, fault.code) for fault in faults(body, *more)]


def tree(name, body):
    return '<BehaviorTree ID="{}">{}</BehaviorTree>'.format(name, body)


RETRY = '<RetryUntilSuccessful num_attempts="3">{}</RetryUntilSuccessful>'
CANNOT_BE_MEANT = {
    "retry what never fails": (RETRY.format("<ForceSuccess><Act/></ForceSuccess>"), (2, 1),
                               "never-repeats", "never retries", "ForceSuccess never fails"),
    "retry a leaf that never fails": (
        '<RetryUntilSuccessful num_attempts="3"><Begin/></RetryUntilSuccessful>', (2, 1),
        "never-repeats", "Begin never fails"),
    "repeat what never succeeds": (
        '<Repeat num_cycles="3"><ForceFailure><Act/></ForceFailure></Repeat>', (2, 1),
        "never-repeats", "never repeats", "never succeeds"),
    "fallback after a sure success": ("<Fallback><Cond/><Script code=\"a:=1\"/>\n<Act/></Fallback>",
                                      (3, 1), "never-reached",
                                      "Act is never reached: Script before it never fails"),
    "reactive fallback after a sure success": (
        "<ReactiveFallback><Begin/>\n<Act name=\"x\"/></ReactiveFallback>", (3, 1), "never-reached",
        "Act x is never reached: Begin before it never fails"),
    "sequence after a sure failure": (
        "<Sequence><Act/><AlwaysFailure/>\n<Act/><Act/></Sequence>", (3, 1), "never-reached",
        "Act is never reached: AlwaysFailure before it never succeeds"),
    "sequence after an endless loop": (
        "<Sequence><KeepRunningUntilFailure><Act/></KeepRunningUntilFailure>\n<Act/></Sequence>",
        (3, 1), "never-reached", "never succeeds"),
    "a fallback that always ends well, retried": (
        '<RetryUntilSuccessful num_attempts="2"><Fallback><Act/><AlwaysSuccess/></Fallback>'
        '</RetryUntilSuccessful>', (2, 1), "never-repeats", "Fallback never fails"),
    "endless repeat without waiting": ('<Repeat\n num_cycles="-1"><Script code="a:=1"/></Repeat>',
                                       (3, 2), "never-waits", "forever and never waits", "Sleep"),
    "endless retry without waiting": (
        '<RetryUntilSuccessful\n num_attempts="-1"><Cond/></RetryUntilSuccessful>', (3, 2),
        "never-waits", "without waiting", "ReactiveFallback"),
    "no round": ('<Repeat num_cycles="0"><Act/></Repeat>', (2, 9), "never-run", "never run",
                 "-1: no limit"),
    "no attempt": ('<RetryUntilSuccessful num_attempts="-3"><Act/></RetryUntilSuccessful>', (2, 23),
                   "never-run", "never run"),
    "more successes than children": ('<Parallel success_count="3"><Act/><Act/></Parallel>', (2, 11),
                                     "count-too-high", "only 2 children"),
    "no success wanted": ('<Parallel success_count="0"><Act/><Act/></Parallel>', (2, 11),
                          "count-zero", "decides the result"),
    "IfThenElse with one child": ("<IfThenElse><Cond/></IfThenElse>", (2, 1), "child-count",
                                  "has 1 children; it must have 2 or 3"),
    "Switch without a default": (
        '<Switch2 variable="{given}" case_1="a" case_2="b"><Act/><Act/></Switch2>', (2, 1),
        "child-count", "must have 3"),
    "a port without a value": ("<Sleep/>", (2, 1), "port-missing", "Sleep needs the port msec"),
    "a condition misspelled": ('<Act _skipif="true"/>', (2, 6), "condition-misspelt",
                               "_skipif is ignored", "did you mean _skipIf?"),
    "_autoremap on a node": ('<Act _autoremap="true"/>', (2, 6), "autoremap-misplaced",
                             "only on a <SubTree>"),
    "recovery that comes first": ("<Fallback>\n<Recover/><Act/></Fallback>", (3, 1),
                                  "recovery-misplaced", "Recover comes first"),
    "recovery in a Sequence": ("<Sequence><Act/>\n<Recover/></Sequence>", (3, 1),
                               "recovery-misplaced", "no failure to look at", "into a Fallback"),
    "another kind than it says": ('<Sequence><Act/>\n<Condition ID="Act"/></Sequence>', (3, 1),
                                  "kind-mismatch", "Act is of kind Action, not Condition"),
    "the name from an entry of the robot": ('<SetBlackboard\noutput_key="{given}" value="1"/>',
                                            (3, 1), "name-from-entry"),
    "the name from an entry that nothing writes": ('<UnsetBlackboard\nkey="{x}"/>', (3, 1),
                                                   "name-from-entry"),
    "read before it is written": ('<Sequence><In\nin="{x}"/><Out out="{x}"/></Sequence>', (3, 1),
                                  "read-too-early"),
    "read before it is set": (
        '<Sequence><In\nin="{x}"/><SetBlackboard output_key="x" value="1"/></Sequence>', (3, 1),
        "read-too-early"),
    "read, never written": ('<In\nin="{goal}"/>', (3, 1), "never-written",
                            "the entry goal is read here, but nothing writes it"),
    "read in a script": ('<ScriptCondition code="lives > 1"/>', (2, 18), "never-written",
                         "the entry lives"),
    "read in a condition": (
        '<Sequence><Script code="lifes := 1"/><Act _skipIf="lives == 0"/></Sequence>', (2, 43),
        "never-written", "the entry lives", "did you mean lifes?"),
    "read by default, never written": ("<Sequence><Act/>\n<Drive/></Sequence>", (3, 1),
                                       "never-written", "the entry goal is read here",
                                       "Aim writes it"),
    "read by default, one of two written": ("<Sequence><Aim/>\n<Drive/></Sequence>", (3, 1),
                                            "never-written", "the entry pace is read here",
                                            "Hurry or Stroll writes it"),
    "an entry given in place of the default": (
        '<Sequence><Aim/><Hurry/>\n<Drive target="{gaol}"/></Sequence>', (3, 8), "never-written",
        "the entry gaol is read here, but nothing writes it"),
    "an optional port's entry that the file gives": ('<Stroll mood="{mod}"/>', (2, 9),
                                                     "never-written", "the entry mod is read here"),
    "any node of a kind, by its type": ('<Fallback><Begin/>\n<Action ID="Act"/></Fallback>', (3, 1),
                                        "never-reached", "Act is never reached"),
    "what TryCatch tries": ("<TryCatch><AlwaysFailure/>\n<Act/><Act/></TryCatch>", (3, 1),
                            "never-reached", "Act is never reached"),
    "a watched entry without its second brace": (
        '<Sequence><SkipUnlessUpdated\nentry="{given"><Act/></SkipUnlessUpdated></Sequence>',
        (3, 1), "braces-odd", 'entry="{given" names no entry (write entry="{given}")'),
    "a brace is missing": ('<In in="{goal"/>', (2, 5), "braces-odd",
                           'in="{goal" is a text, no entry (the whole value is written {goal})'),
    "an entry in a text": (
        '<In in="go to {goal}"/>', (2, 5), "braces-odd",
        'in="go to {goal}" is a text, no entry (a text is not filled in: a reference is the whole '
        'value)'),
    "a brace too many": ('<Sequence><Out out="{{x}"/></Sequence>', (2, 16), "braces-odd",
                         'out="{{x}" is the entry called "{x" (write {x})'),
    "a brace too many at the end": ('<Sequence><Out out="{x}}"/></Sequence>', (2, 16), "braces-odd",
                                    'out="{x}}" is the entry called "x}" (write {x})'),
    "a choice by a text with a brace": (
        '<Switch2 variable="{given" case_1="a" case_2="b"><Act/><Act/><Act/></Switch2>', (2, 10),
        "braces-odd", "is a text, no entry"),
    "a case in quotes": (
        "<Switch2 variable='{given}' case_1='a' case_2='b; '><Act/><Act/><Act/></Switch2>", (2, 40),
        "switch-case", 'case_2="b; " is compared with all that stands in it (write case_2="b")'),
    "a case twice": (
        "<Switch2 variable='{given}' case_1='a' case_2='a'><Act/><Act/><Act/></Switch2>", (2, 40),
        "switch-case", "case_2 is never chosen: case_1 is the same"),
    "an attribute whose value begins with a new line": ('<Act _skipif="\ntrue"/>', (2, 6),
                                                        "condition-misspelt", "_skipif is ignored"),
    "an entry whose attribute begins with a new line": (
        '<In in="\n{goal}"/>', (2, 5), "never-written", "the entry goal is read here"),
    "more successes than anything has children": (
        '<Parallel success_count="1234567890"><Act/></Parallel>', (2, 11), "count-too-high",
        'success_count="1234567890", but there are only 1 children (it will fail when it is '
        'ticked)'),
    "watched, never written": ('<SkipUnlessUpdated entry="goal"><Act/></SkipUnlessUpdated>',
                               (2, 20), "never-written", "the entry goal")}


@pytest.mark.parametrize("rule", sorted(CANNOT_BE_MEANT))
def test_what_cannot_be_meant(rule):
    body, place, code, *words = CANNOT_BE_MEANT[rule]
    assert warnings(body) == [place + (code,)]
    assert unsaid(words, faults(body)) == []


@pytest.mark.parametrize("body", [
    '<RetryUntilSuccessful num_attempts="3"><Act/></RetryUntilSuccessful>',
    RETRY.format('<ForceSuccess _failureIf="given"><Act/></ForceSuccess>'),
    '<RetryUntilSuccessful num_attempts="-1"><Sequence><Sleep msec="10"/><Cond/></Sequence>'
    '</RetryUntilSuccessful>',
    '<Repeat num_cycles="-1"><Act/></Repeat>', "<Fallback><Act/><Begin/></Fallback>",
    '<Fallback><Begin _skipIf="given == 1"/><Act/></Fallback>',
    "<Sequence><Begin/><Fallback><Act/><Recover/></Fallback></Sequence>",
    '<Sequence><RunOnce><AlwaysFailure/></RunOnce><Act/></Sequence>',
    '<Inverter><KeepRunningUntilFailure><Act/></KeepRunningUntilFailure></Inverter>',
    '<Sequence><Inverter><KeepRunningUntilFailure><Act/></KeepRunningUntilFailure></Inverter><Act/>'
    '</Sequence>',
    '<ReactiveFallback><Cond/><ForceFailure><Sleep msec="5"/></ForceFailure></ReactiveFallback>',
    "<ReactiveSequence><Begin/><AlwaysSuccess/><Cond/></ReactiveSequence>",
    '<Sequence><In in="{given}"/><In in="{@given}"/><In in="literal"/></Sequence>',
    '<Sequence><Out out="{x}"/><In in="{x}"/></Sequence>',
    '<Parallel><In in="{x}"/><SetBlackboard output_key="x" value="1"/></Parallel>',
    '<Repeat num_cycles="2"><Sequence><In in="{x}"/><Out out="{x}"/></Sequence></Repeat>',
    '<Sequence><Script code="a := 1; a += 1"/><ScriptCondition code="a > 1"/></Sequence>',
    '<Sequence><Script code="{given}"/><In in="{whatever}"/></Sequence>',
    '<LoopString queue="a;b" value="{item}"><In in="{item}"/></LoopString>',
    "<Sequence><Aim/><Hurry/><Drive/></Sequence>", '<Drive target="5" speed="3"/>',
    '<Sequence><Aim to="{x}"/><Hurry/><Drive target="{x}"/></Sequence>',
    '<Sequence><Script code="@goal:=1; @pace:=2"/><Drive/></Sequence>',
    '<Sequence><Stroll/><ScriptCondition code="@mood == 1"/></Sequence>',
    "<Sequence><Own><AlwaysFailure/></Own><Act/></Sequence>",
    "<Fallback><Own><Begin/></Own><Act/></Fallback>",
    '<Repeat num_cycles="-1"><Own><Begin/></Own></Repeat>',
    '<Act _uid="1" _fullpath="x" _description="y" _custom="z"/>',
    '<Parallel success_count="-1" failure_count="2"><Act/><Act/></Parallel>',
    '<Switch2 variable="{given}" case_1="a" case_2="b"><Act/><Act/><Act/></Switch2>',
    '<Switch2 variable="{given}" case_1="{given}" case_2=" {given} "><Act/><Act/><Act/></Switch2>',
    '<Precondition if="given == 1" else="{given}"><Act/></Precondition>',
    '<Fallback><Precondition if="given" else="{given}"><Begin/></Precondition><Act/></Fallback>',
    '<Sequence><Out out="{a b}"/><In in="a b"/></Sequence>', """<In in='json:["{given}"]'/>""",
    "<TryCatch><AlwaysFailure/><Recover/></TryCatch>",
    '<Repeat num_cycles="3"><AlwaysSuccess/></Repeat>', '<UnsetBlackboard key="x"/>', "<Out/>"])
def test_what_can_be_meant(body):
    assert warnings(body) == []


# ------------------------------------------------------------------------------------------ scripts


SEQUENCE = '<Sequence>\n<Script code="{}"/>\n{}</Sequence>'
SCRIPTS = {  # body -> line and code of each warning, and its words
    "the first word alone": (
        SEQUENCE.format("given := 1;\n given := True;\n given := null; given == 1", ""),
        [(4, "script-word")], "True means nothing in a script (write true)"),
    "a word that is an entry": (SEQUENCE.format("not := 1; given := not", ""), []),
    "no effect": (
        SEQUENCE.format("given := 1;\n given == 1; given == 2", ""), [(4, "script-no-effect")],
        "a statement of code has no effect (a value is assigned with :=)"),
    "no effect, of an entry that is not written": (
        SEQUENCE.format("a := 1", '<Script code="lost == 1"/>'), [(4, "script-no-effect")]),
    "two conditions": (
        SEQUENCE.format("given := 1", '<ScriptCondition code="given == 1\n given == 2\n '
                        'given == 3"/>'),
        [(4, "script-no-effect")],
        "a statement of code has no effect (&& or || joins two conditions)"),
    "no effect, and assigns": (
        SEQUENCE.format("given := 1", '<ScriptCondition code="given == 1;\n given = 2"/>'),
        [(4, "script-no-effect"), (5, "condition-assigns")],
        "a statement of code has no effect (&& or || joins two conditions)",
        "code assigns to given instead of comparing (write given == …)"),
    "assigns among others": (
        SEQUENCE.format("given := 1",
                        '<ScriptCondition code="given == 1 &amp;&amp; (given = 2)"/>'),
        [(4, "condition-assigns")],
        "code assigns to given instead of comparing (write given == …)"),
    "assigns on purpose": (SEQUENCE.format("given := 1", '<ScriptCondition code="given = 2; (a := '
                                                         '3) == given"/>'), []),
    "an empty condition": (SEQUENCE.format("given := 1", '<ScriptCondition code=""/>'), []),
    "not created, told once": (
        SEQUENCE.format("other := 1;\n count = 1", '<Script code="count += 1"/>'),
        [(4, "not-created")],
        "count = …, but nothing creates the entry count (create it first: count := …)"),
    "not created, and not what is meant": (
        SEQUENCE.format("count == 1", '<Script code="count = 1"/>'),
        [(3, "script-no-effect"), (4, "not-created")],
        "a statement of code has no effect (a value is assigned with :=)",
        "count = …, but nothing creates the entry count (create it first: count := …)"),
    "created under a similar name": (
        SEQUENCE.format("count := 1; cuont += 1", ""), [(3, "not-created")],
        "cuont += …, but nothing creates the entry cuont (did you mean count?)"),
    "given": (SEQUENCE.format("given = 1; @given = 2", ""), []),
    "created by a port": (SEQUENCE.format("count = 1", '<In in="{count}"/>'), []),
    "another kind": (
        SEQUENCE.format("a := 'x'; b := 2;\n a = 1", '<Script code="b = \'y\'"/>'),
        [(4, "kind-changes"), (5, "kind-changes")],
        "a is assigned a number, but elsewhere a text (the first value decides the kind of an "
        "entry)",
        "b is assigned a text, but elsewhere a number (the first value decides the kind of an "
        "entry)"),
    "another kind, in an entry of others": (SEQUENCE.format("x := 'a'; x = 1; given := 'a'; "
                                                            "given = 1",
                                                            '<Out out="{x}"/>'), []),
    "texts that are numbers, and what is not known": (
        SEQUENCE.format("a := 5; a = '6'; a = 'true'; a = 'false'; a = given; a = 'b' .. 'c'; a = "
                        "0x10", ""), []),
    "texts that are no numbers": (
        SEQUENCE.format("a := 1;\n a = 'untrue'", '<Script code="b := 1;\n b = \'m6\'"/>'),
        [(4, "kind-changes"), (6, "kind-changes")],
        "a is assigned a text, but elsewhere a number (the first value decides the kind of an "
        "entry)",
        "b is assigned a text, but elsewhere a number (the first value decides the kind of an "
        "entry)"),
    "compared": (
        SEQUENCE.format("a := 1; b := 'x'; c := given; c = 1; d := a &lt; 2;\n d := a &gt;"
                        "= b;\n d := (a - 1) != 'y'; d := c == b;\n d := 'z' == a * 2", ""),
        [(4, "text-and-number"), (5, "text-and-number"), (6, "text-and-number")],
        "a >= b compares a text with a number (a text needs single quotes, a number none)",
        "… != 'y' compares a text with a number (a text needs single quotes, a number none)",
        "'z' == … compares a text with a number (a text needs single quotes, a number none)"),
    "calculated": (
        SEQUENCE.format("a := 'x'; a += 'y'; b := a + 'z'; b := given + a; b := a .. 1;"
                        "\n a += 1;\n b := a - a;\n b := given * a", ""),
        [(4, "text-and-number"), (5, "text-and-number"), (6, "text-and-number")],
        "a += 1 calculates with a text (texts are joined with ..)",
        "a - a calculates with a text (texts are joined with ..)",
        "given * a calculates with a text (texts are joined with ..)")}


@pytest.mark.parametrize("rule", sorted(SCRIPTS))
def test_what_is_said_of_a_script(rule):
    body, expected, *words = SCRIPTS[rule]
    assert [(line, code) for line, _, code in warnings(body)] == expected
    assert unsaid(words, faults(body)) == []


@pytest.mark.parametrize("written, is_told", [
    ("n := 0; n = 1", False), ("n := 0x1; n = 0x0", False), ("n := 01", False),
    ("n := 2", True), ("n := 1; n = 2", True), ("n := 0x10", True), ("n := 0X2", True),
    ("n := 10", True), ("n := -1", True), ("n := 1; n = -1", True), ("n := -0.5", True),
    ("n := 2.5; n = -0.5", True), ("n := 2.5", False), ("n := -0.0", False),
    # the entry holds reals, of which all but negative ones are true or false
    ("n := 2.5; n = 3", False),
    ("n := 1 - 3", False), ("n := true", False), ("n := '1'", True), ("n := 'true'", True)])
def test_a_number_that_is_neither_true_nor_false_is_told_where_a_script_needs_that(written,
                                                                                   is_told):
    body = '<Sequence>\n<Script code="{}"/>\n<ScriptCondition code="{}"/></Sequence>'
    for code, needs_truth in (("n", True), ("n || true", True), ("false &amp;&amp; n", True),
                              ("n == 1", False)):
        found = [(line, rule) for line, _, rule in warnings(body.format(written, code))
                 if rule == "number-as-truth"]
        assert found == [(4, "number-as-truth")] * (is_told and needs_truth)


@pytest.mark.parametrize("code, is_told", [
    ("2", True), ("-1", True), ("-2.5", True), ("2.5", False), ("1", False), ("0", False),
    ("given &amp;&amp; 3", True), ("3 || given", True), ("given + 3", False), ("!2", False)])
def test_a_literal_is_told_that_is_neither_true_nor_false(code, is_told):
    found = [rule for _, _, rule in warnings('<ScriptCondition code="{}"/>'.format(code))]
    assert found == ["number-as-truth"] * is_told


@pytest.mark.parametrize("operation, text", [
    ("'x' * 2", "'x' * 2 calculates with a text"), ("2 - word", "2 - word calculates with a text"),
    ("(1 + 2) * word", "… * word calculates with a text"),
    ("word - (1 + 2)", "word - … calculates with a text"),
    ("'3' + '4'", "'3' + '4' joins two texts"),
    ("word == 2", "word == 2 compares a text with a number"),
    ("2 &lt; word", "2 &lt; word compares a text with a number"),
    ("-word", "-word needs a number, and gets a text"),
    ("!~'x'", "!~'x' needs a number, and gets a text"), ("word + 'y'", None), ("word .. 2", None),
    ("-given", None), ("-3", None), ("'3' == 2", None), ("given * 2", None),
    ("word == given", None), ("'x' + '4'", None)])
def test_what_is_done_with_a_text_and_a_number_is_said(operation, text):
    found = faults('<Script code="word := \'x\'; a := {}"/>'.format(operation))
    assert [fault.text.replace("<", "&lt;") for fault in found] == [text] * (text is not None)


@pytest.mark.parametrize("node, hint", [
    ('<Script code="given == 1; given := 2"/>', "a value is assigned with :="),
    ('<ScriptCondition code="given == 1; given == 2"/>', "&amp;&amp; or || joins two conditions")])
def test_a_statement_without_effect_has_a_hint_for_what_it_stands_in(node, hint):
    fault, = faults(node)
    assert (fault.code, fault.hint.replace("&", "&amp;")) == ("script-no-effect", hint)


def test_a_name_is_suggested_only_if_the_tree_itself_creates_it():
    fault, = faults('<Sequence><SubTree ID="Sub"/><Script code="count := 1"/></Sequence>',
                    tree("Sub", '<Script code="cuont += 1"/>'))
    assert fault.code == "not-created" and "cuont" in fault.hint and "count" not in fault.hint


# ----------------------------------------------------------------------------------------- subtrees


@pytest.mark.parametrize("main, sub, model, words", [
    ("<Act/>", "<Act/>", "", "the tree Sub is not used (the main tree is Main)"),
    ('<Fallback><SubTree ID="Sub"/><Act/></Fallback>', "<ForceSuccess><Act/></ForceSuccess>", "",
     "SubTree Sub before it never fails"),
    ('<Sequence><SubTree ID="Sub"/><In in="{x}"/></Sequence>', '<Out out="{x}"/>', "",
     "nothing writes it (the tree Sub writes one of its own; that of the whole mission is @x)"),
    ('<SubTree ID="Sub"/>', '<In in="{given}"/>', "",
     'the tree Sub needs the entry given, which this call does not give (write given="{@given}")'),
    ('<SubTree ID="Sub" place="{given}"/>', '<In in="{target}"/>', "",
     "the tree Sub uses no entry place (the tree Sub has target)"),
    ('<SubTree ID="Sub" autoremap="true"/>', '<In in="{@given}"/>', "",
     "autoremap is an entry of the tree Sub, and remaps nothing (did you mean _autoremap?)"),
    ('<SubTree ID="Sub" result="said"/>', '<Out out="{result}"/>', "",
     'result="said" is the text said: what the tree Sub writes there is lost (the entry is written '
     '{said})'),
    ("<Sequence><Script code='n := 3'/><SetBlackboard output_key='{n}' value='x'/>"
     "<SubTree ID='Sub'/></Sequence>", "<Act/>", "",
     'output_key="{n}" is the entry whose name n holds, which is a number (the entry itself is '
     'written output_key="n")'),
    ("<Sequence><Script code='n := 3'/><SetBlackboard output_key='n' value='x'/>"
     "<SubTree ID='Sub'/></Sequence>", "<Act/>", "",
     "the entry n was made by a script: this text empties it (write it with a script: n := …)"),
    ("<Sequence><Script code='n := 3'/><SubTree ID='Sub' _skipIf='n'/></Sequence>", "<Act/>", "",
     "n, which holds 3, is neither true nor false (compare it, as in n > 0)"),
    ("<Sequence><Script code='n := 3'/><SubTree ID='Sub' n='{n}'/></Sequence>",
     "<Switch2 variable='{n}' case_1='two' case_2='3'><Act/><Act/><Act/></Switch2>", "",
     "case_1 is never chosen: n holds a number, and two is none (write the number)"),
    ("<Sequence><Script code=\"place := 'lab'; place := hall\"/><SubTree ID='Sub'/></Sequence>",
     "<Act/>", "", "the entry hall is read here, but nothing writes it (a text needs single "
     "quotes: 'hall')"),
    ('<SubTree ID="Sub" abd="1"/>', '<Out out="{abc}"/>', "",
     "the tree Sub uses no entry abd (did you mean abc?)"),
    ('<SubTree ID="Sub" xyz="1"/>', '<Out out="{abc}"/>', '<input_port name="abc" default="1"/>',
     "the model of Sub has no port xyz (its ports: abc)"),
    ('<SubTree ID="Sub" post="1"/>', '<Out out="{abc}"/>', "",
     "post is an entry of the tree Sub, no condition (did you mean _post?)"),
    ("<Sequence><Script code=\"place := 'lab'\"/><SubTree ID='Sub' target='{plce}'/></Sequence>",
     "<ScriptCondition code=\"target == 'lab'\"/>", "", "the entry plce is named nowhere else"),
    ('<SubTree ID="Sub" x="soon"/>', '<Drive target="{x}" speed="5"/>', "",
     '"soon" cannot be of type int')])
def test_what_is_said_of_a_tree_and_its_call(main, sub, model, words):
    model = model and '<TreeNodesModel><SubTree ID="Sub">{}</SubTree></TreeNodesModel>'.format(
        model)
    assert unsaid([words], faults(main, tree("Sub", sub), model)) == []


def test_an_unused_tree_of_an_included_file_is_no_concern():
    documents = [
        parse('<root BTCPP_format="4"><BehaviorTree ID="Spare"><Act/></BehaviorTree></root>',
              "lib.xml"),
        parse('<root BTCPP_format="4"><BehaviorTree ID="Main"><Act/></BehaviorTree></root>',
              "m.xml")]
    assert lint(check(documents, REGISTRY)) == []


@pytest.mark.parametrize("call, inside, told", [
    ('<SubTree ID="Sub" x="{y}"/>', '<In in="{x}"/>', "never-written"),
    ('<Sequence><Out out="{y}"/><SubTree ID="Sub" x="{y}"/></Sequence>', '<In in="{x}"/>', None),
    ('<Sequence><Out out="{x}"/><SubTree ID="Sub"/></Sequence>', '<In in="{x}"/>',
     "subtree-port-missing"),
    ('<Sequence><Out out="{x}"/><SubTree ID="Sub" x="{=}"/></Sequence>', '<In in="{x}"/>', None),
    ('<Sequence><Out out="{x}"/><SubTree ID="Sub" _autoremap="true"/></Sequence>', '<In in="{x}"/>',
     None),
    ('<Sequence><Out out="{_x}"/><SubTree ID="Sub" _autoremap="true"/></Sequence>',
     '<In in="{_x}"/>', "never-written"),
    ('<Sequence><Out out="{x}"/><SubTree ID="Sub"/></Sequence>', '<In in="{@x}"/>', None),
    ('<SubTree ID="Sub" x="5"/>', '<In in="{x}"/>', None),
    ('<SubTree ID="Sub" x="="/>', '<In in="{x}"/>', None),
    ('<Sequence><In in="{y}"/><SubTree ID="Sub" x="{y}"/></Sequence>', '<Out out="{x}"/>', None),
    ('<SubTree ID="Sub"/>',
     '<Sequence><In in="{x}"/><SubTree ID="Deep" _autoremap="1"/></Sequence>', None),
    ('<SubTree ID="Sub" given="{given}"/>', '<In in="{given}"/>', None),
    ('<SubTree ID="Sub"/>', '<In in="{ID}"/>', "never-written"),
    ('<SubTree ID="Sub" _x="{given}"/>', '<In in="{_x}"/>', "never-written"),
    ('<Sequence><Out out="{x}"/><SubTree ID="Sub" x="{other}" _autoremap="1"/></Sequence>',
     '<In in="{x}"/>', "never-written")])
def test_entries_are_followed_through_subtrees(call, inside, told):
    deep = [tree("Deep", '<Out out="{x}"/>')] if "Deep" in inside else []
    found = warnings(call, tree("Sub", inside), *deep)
    assert [code for _, _, code in found] == ([told] if told else [])


@pytest.mark.parametrize("main, inside, place, code, hint", [
    ('<SubTree\n ID="Sub"/>', '<In in="{given}"/>', (2, 1), "subtree-port-missing",
     'write given="{@given}"'),
    ('<Sequence><Out out="{x}"/>\n<SubTree ID="Sub"/></Sequence>', '<In in="{x}"/>', (3, 1),
     "subtree-port-missing", 'write x="{x}"'),
    ('<SubTree ID="Sub"/>', '<Sequence><Out out="{pause}"/><In in="{paus}"/></Sequence>', (2, 1),
     "subtree-port-missing", 'write paus="{…}", or paus="…"'),
    ('<SubTree ID="Sub" x="{y}"/>', '<In in="{x}"/>', (2, 19), "never-written", ""),
    ('<Sequence><SubTree ID="Sub"/>\n<In in="{x}"/></Sequence>', '<Out out="{x}"/>', (3, 5),
     "never-written",
     "the tree Sub writes one of its own; that of the whole mission is @x"),
    ('<Sequence><SubTree ID="Sub"/>\n<In in="{x}"/></Sequence>', '<Out out="{other}"/>', (3, 5),
     "never-written", ""),
    ('<SubTree ID="Sub"/>', '<Drive target="1"/>', (3, 24), "never-written",
     "Hurry or Stroll writes it")])
def test_an_entry_that_is_not_written_is_told_where_it_can_be_mended(main, inside, place, code,
                                                                     hint):
    fault, = faults(main, tree("Sub", inside))
    assert ((fault.line, fault.column), fault.code, fault.hint) == (place, code, hint)


@pytest.mark.parametrize("second, told", [
    ('<SubTree ID="Sub" x="{y}"/>', []),
    ('<SubTree ID="Sub" x="5"/>', []),
    ('<SubTree ID="Sub"/>', ["subtree-port-missing"]),
    ('<SubTree ID="Sub" z="{y}"/>', ["subtree-port-unknown"]),
    ('<SubTree ID="Sub" autoremap="true"/>', ["subtree-condition"])])
def test_each_call_must_give_what_a_tree_needs(second, told):
    body = '<Sequence><Out out="{y}"/><SubTree ID="Sub" x="{y}"/>\n{}</Sequence>'.replace(
        "{}", second)
    found = warnings(body, tree("Sub", '<In in="{x}"/>'))
    assert [(line, code) for line, _, code in found] == [(3, code) for code in told]


@pytest.mark.parametrize("given, inside, told", [
    ("done", '<Out out="{result}"/>', ["braces-forgotten"]),
    ("{done}", '<Out out="{result}"/>', []),
    ("2 done", '<Out out="{result}"/>', []),
    ("idle", '<Sequence><In in="{result}"/><Out out="{result}"/></Sequence>', []),
    ("done", '<In in="{result}"/>', [])])
def test_a_result_needs_an_entry(given, inside, told):
    found = warnings('<SubTree ID="Sub" result="{}"/>'.replace("{}", given, 1), tree("Sub", inside))
    assert [code for _, _, code in found] == told


@pytest.mark.parametrize("call", ['<SubTree ID="Sub"/>', '<SubTree ID="Sub" _autoremap="true"/>'])
def test_an_entry_without_a_name_is_an_entry(call):
    assert warnings(call, tree("Sub", '<SetBlackboard output_key="" value="1"/>')) == []


def test_a_subtree_may_wait():
    assert warnings('<Repeat num_cycles="-1"><SubTree ID="Sub"/></Repeat>',
                    tree("Sub", '<Sleep msec="5"/>')) == []


@pytest.mark.parametrize("name, more, code, hinted", [
    ("ab", "", None, ""), ("abd", "", "subtree-port-unknown", "abc?"), ("xyz", "", None, ""),
    ("abd", "abc", "model-port-unknown", "abc?"),
    ("xyz", "who abc", "model-port-unknown", "abc, who"),
    ("post", "", "subtree-condition", "_post?"), ("abc", "who", None, "")])
def test_what_a_subtree_is_given_and_does_not_use(name, more, code, hinted):
    model = '<TreeNodesModel><SubTree ID="Sub">{}</SubTree></TreeNodesModel>'.format("".join(
        '<input_port name="{}" default="1"/>'.format(port) for port in more.split()))
    found = faults('<SubTree ID="Sub"\n{}="1"/>'.format(name), tree("Sub", '<Out out="{abc}"/>'),
                   model)
    assert [(fault.line, fault.column, fault.code, fault.hint.endswith(hinted))
            for fault in found] == ([] if code is None else [(3, 1, code, True)])


@pytest.mark.slow
@pytest.mark.parametrize("body", ['<In in="{{e{}}}"/>', '<Act _skipif="{}"/>'])
def test_so_many_warnings_are_told(body):
    for number in (MOST_FINDINGS - 1, MOST_FINDINGS + 1):
        found = warnings("<Sequence>{}</Sequence>".format("".join(map(body.format, range(number)))))
        assert len(found) == min(number, MOST_FINDINGS)


def test_defaults_of_a_model_are_written():
    model = ('<TreeNodesModel><SubTree ID="Sub"><input_port name="x" default="1"/></SubTree>'
             '</TreeNodesModel>')
    assert warnings('<SubTree ID="Sub"/>', tree("Sub", '<In in="{x}"/>'), model) == []


def test_defaults_of_a_model_do_not_count_where_all_entries_are_given():
    model = ('<TreeNodesModel><SubTree ID="Sub"><input_port name="pace" default="slow"/></SubTree>'
             '</TreeNodesModel>')
    call = '<SubTree ID="Sub" _autoremap="{}"/>'
    inside = '<ScriptCondition code="-pace > -3"/>'
    body = '<Sequence><Script code="pace := 2"/>{}</Sequence>'
    assert warnings(body.format(call.format("true")), tree("Sub", inside), model) == []
    assert "literal-in-script" in [code for *_, code in warnings(
        body.format(call.format("false")), tree("Sub", inside), model)]


@pytest.mark.parametrize("calls, is_told", [(1, True), (2, False)])
def test_an_entry_is_misspelt_if_it_is_named_once_only(calls, is_told):
    found = warnings("<Sequence><Script code=\"place := 'lab'\"/>{}</Sequence>".format(
                         "<SubTree ID='Go' target='{plce}'/>" * calls),
                     tree("Go", "<ScriptCondition code=\"target == 'lab'\"/>"))
    assert len(found) == 1 and (found[0][2] == "entry-misspelt") is is_told


def test_a_sole_equals_sign_is_a_literal_and_no_entry():
    assert warnings(
        "<Sequence><Script code=\"place := 'lab'\"/><SubTree ID='Go' plce='='/></Sequence>",
        tree("Go", "<ScriptCondition code=\"plce == '='\"/>")) == []


@pytest.mark.parametrize(
    "body", ["<In in='{ given}'/>", "<In in='{given }'/>", "<ScriptCondition code='and == 1'/>"])
def test_an_entry_that_is_told_in_other_words_is_not_told_again_as_unwritten(body):
    assert len(warnings(body)) == 1


def test_a_mission_with_faults_is_not_linted():
    body = "<Fallback><Begin/><Nope/></Fallback>"
    documents = [parse(
        '<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree></root>'.format(body))]
    found = lint(check(documents, REGISTRY))
    assert [fault.code for fault in found] == ["unknown-node"]


# ------------------------------------------------------------------------------------ real missions


def test_the_lab_tour_has_no_warning():
    assert load_tree(folders.mission("lab_tour")).warnings == []


def mission(*leaves):
    return ('<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>{}</Sequence></'
            'BehaviorTree></' 'root>'.format("".join("<{}/>".format(leaf) for leaf in leaves)))


@pytest.mark.parametrize("leaves, writers", [
    (["IsListWithExhibit", "SelectExhibit"], "RetrieveListOfExhibits"),
    (["RetrieveListOfExhibits", "DescribeExhibitSpeech"], "SelectExhibit"),
    (["PerformDeicticGesture"
      ], "SelectExhibit, LookUpEntrance, LookUpHome or RetrieveInitialLocation"),
    (['Navigate target="2;3.5;90"', 'PerformDeicticGesture target="1;2;3"'], None),
    (["LookUpHome", "Navigate"], None),
    (["Navigate"], "SelectExhibit"),
    (["RetrieveListOfExhibits", "SelectExhibit", "Navigate", "DescribeExhibitSpeech"], None),
    (["SeekingOvertAttentionMode", "IsMutualGazeDiscovered"], None),
    (["IsVisitorResponseYes"], "IsYesNoUttered")])
def test_what_the_mission_needs(tmp_path, leaves, writers):
    (tmp_path / "m.xml").write_text(mission(*leaves), encoding="utf-8")
    found = load_tree(str(tmp_path / "m.xml")).warnings
    assert [(fault.code, writers in fault.hint) for fault in found] == (
        [] if writers is None else [("never-written", True)])


def unfolded(checked):
    """Yield the element of each node in the order of their uids."""
    waiting = [checked.trees[checked.main].children[0]]
    while waiting:
        element = waiting.pop()
        yield element
        children = checked.trees[
            element.attributes["ID"]].children if element.tag == "SubTree" else element.children
        waiting.extend(reversed(children))


@pytest.mark.long
def test_nothing_wrong_is_told_of_the_recorded_traces():
    """2,000 trees run by BehaviorTree.CPP itself: the estimate allows every result; "never reached"
    never runs. No entry is missing: all are given by the host."""
    nodes = surely = 0
    for case in conformance.cases(TRACES):
        registry = conformance.registry_of(case, [])
        given = tuple(Port(name, default=f"{{@{name}}}", is_optional=True)
                      for name in case["blackboard"])
        registry.extend([NodeSpec("Host", Kind.ACTION, AlwaysSuccess, given)])
        checked = check([parse(case["xml"])], registry, strict=True)
        found = lint(checked)
        assert not {"never-written", "subtree-port-missing"} & {fault.code for fault in found}
        if any(item[:1] in "KI" for script in case["leaves"].values() for item in script):
            continue  # leaves that SKIP, which mission leaves never do
        ends = outcomes({tree_id: root.below for tree_id, root in reversed(
                            list(checked.trees.items()))}, registry)
        unreached = {fault[1:3] for fault in found if fault.code == "never-reached"}
        seen = {}
        for tick in case["expected"]["ticks"]:
            for event in tick["events"]:
                if event[0] == "status":
                    seen.setdefault(event[1], set()).add(event[4])
        for uid, element in enumerate(unfolded(checked), 1):
            nodes += 1
            results = seen.get(uid, set())
            surely += ends[id(element)] & (SUCCEEDS | FAILS) != SUCCEEDS | FAILS
            assert "SUCCESS" not in results or ends[id(element)] & SUCCEEDS, (case["name"],
                                                                              element.place())
            assert "FAILURE" not in results or ends[id(element)] & FAILS, (case["name"],
                                                                           element.place())
            assert not results or element.place() not in unreached, (case["name"], element.place())
    assert nodes > 10_000 and surely > 1_000


@pytest.mark.slow
@pytest.mark.parametrize("body", [
    "".join('<Script code="b{0} := a{0}"/>'.format(number) for number in range(5000)),
    "".join('<SubTree ID="Sub" x{0}="{{y{0}}}"/>'.format(number) for number in range(5000)),
], ids=["scripts", "subtrees"])
def test_a_large_mission_is_linted_in_a_moment(body):
    inside = '<Script code="{}"/>'.format(";".join("b{0}:=a{0}".format(number)
                                                   for number in range(1000)))
    began = time.thread_time()
    assert warnings("<Sequence>{}</Sequence>".format(body), tree("Sub", inside))
    assert time.thread_time() - began < 4.0


# --------------------------------------------------------------- names that choose what a node does


@pytest.mark.parametrize("name, is_told", [("3", True), ("description 1", True), ("01", True),
                                           ("1", False), ("2", False), ("Both descriptions", False),
                                           ("DescribeExhibitSpeech", False)])
def test_a_name_that_chooses_nothing_although_it_looks_so_is_told(tmp_path, name, is_told):
    path = tmp_path / "m.xml"
    path.write_text(
        """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence><RetrieveListOfExhibits/><SelectExhibit/>
 <DescribeExhibitSpeech name="{}"/><WelcomeSpeech name="3"/></Sequence></BehaviorTree></root>""".
        format(name))
    assert [(fault.file, fault.line, fault.column, fault.code)
            for fault in load_tree(str(path)).warnings
            ] == is_told * [(str(path), 2, 25, "name-chooses-nothing")]


def test_an_alias_that_says_what_it_does_may_have_any_name(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(
        """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence><RetrieveListOfExhibits/><SelectExhibit/>
 <DescribeExhibitSpeech_1 name="3"/></Sequence></BehaviorTree></root>""")
    assert load_tree(str(path)).warnings == []


@pytest.mark.parametrize("text, code", [("2 min", "number-cut-short"), ("soon", "wrong-literal"),
                                        ("=", "wrong-literal"), ("{given}", None), ("5", None)])
def test_a_literal_that_a_subtree_is_given_is_read_by_its_ports(text, code):
    inside = '<Drive target="{x}" speed="5"/>'
    found = warnings('<SubTree ID="Sub"\nx="{}"/>'.format(text), tree("Sub", inside))
    assert found == [(3, 1, code)] * (code is not None)


@pytest.mark.parametrize("text, code", [("2 min", "number-cut-short"), ("soon", "wrong-literal"),
                                        ("{given}", None), ("{=}", None), ("5", None)])
def test_a_default_of_a_model_is_read_by_the_ports_of_its_tree(text, code):
    model = '<TreeNodesModel><SubTree ID="Sub"><input_port name="x" \ndefault="{}"/></SubTree>'
    found = warnings('<Sequence><SubTree ID="Sub"/><SubTree ID="Sub" x="5"/></Sequence>',
                     tree("Sub", '<Drive target="{x}" speed="5"/>'),
                     model.format(text) + "</TreeNodesModel>")
    assert [place for place in found if place[2] != "never-written"] == [
        (5, 1, code)] * (code is not None)


@pytest.mark.parametrize("text, code, told", [
    ("3", "n := n - 1", ""), ("3", "n := n * 2", ""), ("3", "n := (3 > 2)", ""),
    ("3", "m := 4; n += -m", ""), ("3", "n := -0x10", ""), ("3", "n := 1e3", ""),
    ("3", "n := -2.5", "n := -2.5 gives an integer a fraction"),
    ("3", "n -= 1e-3", "n -= 1e-3 gives an integer a fraction"), ("3.5", "n := -2.5", ""),
    ("so on", "n := 2 * 3", "n := … changes a text to a number")])
def test_a_script_may_change_a_literal_within_its_kind(text, code, told):
    found = faults('<SubTree ID="Sub" n="{}"/>'.format(text),
                   tree("Sub", '<Script code="{}"/>'.format(code)))
    assert [fault.code for fault in found] == ["literal-in-script"] * bool(told)
    assert all(told in fault.text for fault in found)


def test_a_literal_that_a_subtree_only_writes_is_read_by_no_port():
    assert warnings('<SubTree ID="Sub" x="so on"/>', tree("Sub", '<Aim to="{x}"/>')) == []


@pytest.mark.parametrize("body, is_before", [
    ("<Script code='n := 3'/><SetBlackboard output_key='n' value='x'/>", True),
    ("<Sequence _onSuccess='n := 3'><Act/></Sequence><SetBlackboard output_key='n' value='x'/>",
     True),
    ("<SetBlackboard output_key='n' value='x'/><Script code='n := 3'/>", False),
    ("<Fallback><Script code='n := 3'/><SetBlackboard output_key='n' value='x'/></Fallback>",
     False),
    ("<Script code='n := 3'/><Fallback><Cond/><SetBlackboard output_key='n' value='x'/></Fallback>",
     True),
    ("<Sequence _onSuccess='n := 3'><SetBlackboard output_key='n' value='x'/></Sequence>", False),
    ("<Sequence _onSuccess='n := 3'><Act/><SetBlackboard output_key='n' value='x'/></Sequence>",
     False)])
def test_a_text_empties_what_a_script_before_it_has_made(body, is_before):
    found = {code for _, _, code in warnings("<Sequence>" + body + "</Sequence>")}
    assert (rules.TEXT_EMPTIES.code in found) is is_before


@pytest.mark.parametrize("written, read, is_told", [
    ("speed := 1; sped := 2", "speed > 0", True),
    ("speed := 1; sped := 2; sped = 3", "speed > 0", False),
    ("speed := 1; sped := 2", "speed + sped > 0", False),
    ("speed := 1; sped := 2", "true", False), ("x_max := 1; y_max := 2", "x_max > 0", False),
    ("speed1 := 1; speed2 := 2", "speed1 > 0", False)])
def test_an_entry_that_is_only_written_is_told_if_a_similar_one_is_read(written, read, is_told):
    found = warnings('<Sequence>\n<Script code="{}"/>\n<ScriptCondition code="{}"/></Sequence>'
                     .format(written, read))
    code = rules.ENTRY_MISSPELT.code
    assert [warning for warning in found if warning[2] == code] == [(3, 9, code)] * is_told


@pytest.mark.parametrize("action, is_told", [
    ("<Begin/>", True), ("<Take from='{list}'/>", True), ("<Script code='n += 1'/>", True),
    ("<Script code='n := 1'/>", False), ("<SetBlackboard output_key='n' value='1'/>", False),
    ("<UnsetBlackboard key='n'/>", False), ("<AlwaysSuccess/>", False)])
def test_an_action_that_is_done_at_every_tick_is_told_if_that_matters(action, is_told):
    found = warnings("<Sequence><Script code='n := 0; list := 1'/><ReactiveSequence>" + action +
                     "<Sleep msec='9000'/></ReactiveSequence></Sequence>")
    assert (rules.DONE_AGAIN.code in {code for _, _, code in found}) is is_told


SLEEP = "<Sleep msec='9000'/>"


@pytest.mark.parametrize("body, is_told", [
    # what Begin leads to is a success of its parent, a failure, or left to a condition
    ("<ReactiveSequence><ForceSuccess><Begin/></ForceSuccess>{}</ReactiveSequence>", True),
    ("<ReactiveSequence><Inverter><Begin/></Inverter>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Precondition if='given == 1' else='SUCCESS'><Begin/></Precondition>{}"
     "</ReactiveSequence>", False),
    ("<ReactiveSequence><Own><Begin/></Own>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Begin _skipIf='given == 1'/>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Foreign/>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Sequence><Cond/><Begin/></Sequence>{}</ReactiveSequence>", True),
    ("<ReactiveSequence><Sequence><Begin/><Cond/></Sequence>{}</ReactiveSequence>", True),
    ("<ReactiveSequence><Sequence><Begin/><AlwaysFailure/></Sequence>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Fallback><Cond/><Begin/></Fallback>{}</ReactiveSequence>", False),
    ("<ReactiveSequence><Fallback><Act/><Begin/></Fallback>{}</ReactiveSequence>", True),
    ("<ReactiveFallback><Begin/>{}</ReactiveFallback>", False),
    ("<ReactiveFallback><Inverter><Begin/></Inverter>{}</ReactiveFallback>", True),
    ("<WhileDoElse><Begin/>{}<Cond/></WhileDoElse>", True),
    ("<WhileDoElse><Cond/><Begin/>{}</WhileDoElse>", False)])
def test_an_action_is_done_again_if_a_later_child_runs_after_its_success(body, is_told):
    found = {code for _, _, code in warnings(body.format(SLEEP))}
    assert (rules.DONE_AGAIN.code in found) is is_told
    assert rules.DONE_AGAIN.code not in {code for _, _, code in warnings(body.format("<Cond/>"))}


@pytest.mark.parametrize("node, is_told", [
    ('<In in="place"/>', True), ('<In in="{place}"/>', False), ('<In in="palace"/>', False),
    # what the ports of a node of another robot mean is not known
    ('<Foreign in="place"/>', False)])
def test_a_text_that_is_the_name_of_an_entry_lacks_its_braces(node, is_told):
    body = "<Sequence><Script code=\"place := 'lab'\"/>\n{}</Sequence>".format(node)
    assert ((3, node.index("in="), "braces-forgotten") in [
        (line, column - 1, code) for line, column, code in warnings(body)]) is is_told


@pytest.mark.parametrize("name", ["HandleFallBack", "HandleFallback"])
def test_both_spellings_of_a_recovery_need_a_failure_before_them(tmp_path, name):
    path = tmp_path / "m.xml"
    path.write_text(
        """<root BTCPP_format="4"><BehaviorTree ID="Main"><Fallback><{}/><WelcomeSpeech/></Fallback></BehaviorTree>
</root>""".format(name))
    assert "recovery-misplaced" in [fault.code for fault in load_tree(str(path)).warnings]
