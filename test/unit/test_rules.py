"""Each kind of mistake: its examples are told at their place with its code, in these words;
docs/faults.md shows them."""
import ast
import os
import re

import pytest
import test_broken_leaves
import test_checks
import test_document
import test_lint
import test_load
import test_tree

from behavior_controller.config import settings
from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader.rules import RULES
from behavior_controller.errors import MissionError
from behavior_controller.robot.declarations import Interface, Sense
from fault_reference import EXAMPLE_NAME, examples, page, told
from mission_rig import Rig
from test_checks import LEAF, MANY, MODEL, chain, circle, main, root, tree

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = [(RULES[code], number, example) for code, some in examples().items()
            for number, example in enumerate(some, 1)]
WITHOUT_EXAMPLE = {
    "unreadable-file",  # what cannot be read is not a text
    "not-well-formed",  # no file is known that comes so far
    "substitute-unknown", "node-broken", "node-type-warning",  # not in the file, but beside it
    "robot-lacks", "phrase-missing", "does-without",  # the same
    "palette-empty",  # not a mission
}


@pytest.mark.parametrize("rule, number, example", EXAMPLES, ids=[
    "{}-{}{}".format(rule.code, number, "" if example.line else "-good")
    for rule, number, example in EXAMPLES])
def test_each_example_has_its_fault_at_its_place_and_no_other(rule, number, example, tmp_path,
                                                              monkeypatch):
    (tmp_path / EXAMPLE_NAME).write_bytes(example.text.encode("utf-8"))
    monkeypatch.chdir(tmp_path)
    found = [
        fault for fault in told(example.text) if fault.code != example.beside or not fault.code]
    expected = [(rule.code, example.line, example.column, rule.is_warning)]
    assert [(fault.code, fault.line, fault.column, fault.is_warning)
            for fault in found] == (expected if example.line else [])
    for fault in found:
        assert (fault.end_line, fault.end_column) > (fault.line, fault.column)


def test_there_are_many_bad_files_and_each_rule_has_one():
    bad = [(rule.code, example) for rule, _, example in EXAMPLES if example.line]
    assert len({example.text for _, example in bad}) == len(bad) >= 170
    assert set(RULES) - {code for code, _ in bad} == WITHOUT_EXAMPLE


def test_a_code_is_a_few_plain_words():
    assert [code for code in RULES if not re.fullmatch(r"[a-z]+(-[a-z]+){0,3}", code)] == []


def test_a_meaning_is_one_sentence():
    assert [
        rule.code for rule in RULES.values() if not re.fullmatch(r"[A-Z<_].*[^.]\.", rule.meaning)
    ] == []


def test_every_rule_is_used():
    """A rule that nothing tells would be a promise."""
    used = set()
    for folder, _, names in os.walk(os.path.join(ROOT, "src")):
        for name in names:
            if name.endswith(".py") and name != "rules.py":
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    nodes = ast.walk(ast.parse(file.read()))
                    used.update(node.attr for node in nodes if isinstance(node, ast.Attribute)
                                and isinstance(node.value, ast.Name) and node.value.id == "rules")
    declared = {name for name, value in vars(rules).items() if isinstance(value, rules.LintRule)}
    assert declared - used == set()


def test_a_rule_is_declared_once():
    with open(rules.__file__, encoding="utf-8") as file:
        names = [node.targets[0].id for node in ast.parse(file.read()).body
                 if isinstance(node, ast.Assign)]
    assert sorted(set(names)) == sorted(names) and rules.UNKNOWN_NODE.code == "unknown-node"


# ------------------------------------------------------------------------- scripts of several lines

LINES = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Script code="a := 1;{0}
                  a &lt;= 1;{0}
                  c := "/>
  </BehaviorTree>
</root>"""


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize("remark", ["", " d := '&amp;&lt;&#65;'; "])
def test_a_fault_in_a_later_line_of_a_script_is_told_in_that_line(line_end, remark):
    fault, = told(LINES.format(remark).replace("\n", line_end))
    assert (fault.code, fault.line, fault.column) == ("script-syntax", 5, 24)


def test_a_warning_in_a_later_line_of_a_script_is_told_in_that_line():
    fault, = told(LINES.format("").replace("c := ", "c := 2"))
    assert (fault.code, fault.line, fault.column) == ("script-no-effect", 4, 19)


# ---------------------------------------------------------------------------------------- the words
#
# What a fault says is asserted here alone; all other tests assert its code and its place.


def in_words(faults):
    return ["{} ({})".format(fault.text, fault.hint) for fault in faults]


def of_text(text):
    return in_words(test_checks.checked(text).faults)


def of_file(name):
    """Return what is said of a small bad file of test_checks."""
    return of_text(dict(test_checks.RULES, **test_checks.WARNINGS)[name][0])


def of_mission(name):
    """Return what is said of a small mission of test_lint."""
    return in_words(test_lint.faults(dict(test_lint.CANNOT_BE_MEANT, **test_lint.SCRIPTS)[name][0]))


def of_main_and_sub(main, sub, model=""):
    """Return what is said of a mission with a tree called Sub, and perhaps with its model."""
    model = model and '<TreeNodesModel><SubTree ID="Sub">{}</SubTree></TreeNodesModel>'.format(
        model)
    return in_words(test_lint.faults(main, test_lint.tree("Sub", sub), model))


def of_markup(text):
    return in_words(test_document.faults_of(text))


def of_reference(code):
    """Return the section about a code as ``make derived`` would write it."""
    return [sections(page())[code]]


def of_error(load, *arguments):
    """Return what is said of a mission that is not loaded."""
    with pytest.raises(MissionError) as caught:
        load(*arguments)
    return in_words(caught.value.faults)


def of_robot(facts, robot):
    """Return what is said of a node with these facts on a robot."""
    tree = test_load.tree_of(**facts)
    return in_words(test_load.load.unsupported(tree, robot) if facts.get("does_without")
                    else test_load.load.on_robot(tree, settings.defaults()))


def of_phrase(name):
    text = ('<root BTCPP_format="4"><BehaviorTree ID="M"><SayText name="{}"/></BehaviorTree></'
            'root>'.format(
        name))
    return in_words(Rig(text, robotInterface="release-1.0").tree.warnings)


def sections(text):
    """Return the parts of the reference by their headings; that of its first part is empty."""
    first, *others = text.split("\n### ")
    return dict({"": first}, **dict(other.split("\n", 1) for other in others))


with open(os.path.join(ROOT, "docs", "faults.md"), encoding="utf-8") as reference:
    REFERENCE = sections(reference.read())

FILES = {
    "wrong root": ["first element is <Root>", "must be <root>"],
    "no tree": ["no <BehaviorTree>"],
    "SubTree below root": ["<SubTree> lacks the attribute ID"],
    "two models": ["only one <TreeNodesModel>"],
    "stray action below root": ["<Action> lacks the attribute ID"],
    "tree without ID": ["<BehaviorTree> lacks the attribute ID"],
    "reserved ID": ["Root is a reserved name"],
    "ID of a node": ["Navigate is the name of a node type"],
    "colon in an ID": ["the ID a:b contains ':'"],
    "empty tree": ['<BehaviorTree ID="Main"> has 0 children', "exactly 1"],
    "two children": ["has 2 children", "put a Sequence around them"],
    "unknown main tree": ["no tree Main to execute", "did you mean Mein?"],
    "no main tree": [
        "main_tree_to_execute is not given",
        "called by no other: A, B",
        "name the main tree"],
    "unknown node": ["unknown node Navigat", "did you mean Navigate?"],
    "unknown node, other case": ["did you mean AlwaysSuccess?"],
    "unknown explicit node": ["unknown node Navigat", "did you mean Navigate?"],
    "explicit without ID": ["<Condition> lacks the attribute ID"],
    "ID in the compact form": ["ID is not allowed in <Sequence>", 'write name="…"'],
    "a tree as a node": ["Sub is a tree, not a node", '<SubTree ID="Sub"/>'],
    "a tree in a tree": ["cannot stand inside another"],
    "an include in a tree": ["unknown node include", "directly below <root>"],
    "explicit below ReactiveSequence": [
        "refuses <Action> directly below ReactiveSequence",
        "write <Navigate/>"],
    "two AsyncSequences": ["more than one AsyncSequence"],
    "decorator without a child": ["Inverter has 0 children", "exactly 1"],
    "decorator with two": ["Inverter has 2 children", "put a Sequence"],
    "control without children": ["Fallback has no child"],
    "TryCatch with one": ["TryCatch must have at least 2 children"],
    "a leaf with a child": ["Navigate is a leaf"],
    "a condition with a child": ["IsVisitorDiscovered is a leaf"],
    "unknown port": ["Typed has no port nummber", "did you mean number?"],
    "unknown port, none near": ["its ports: number, flag, list, out, text"],
    "a number": ['port number of type int cannot be "two"'],
    "a number too large": ["port number", "out of bound"],
    "a truth": ['port flag of type bool cannot be "yes"', "true false"],
    "a list": ["port list"],
    "blanks around a reference": ["port number"],
    "script syntax": ["the script of _skipIf", "position 3", "(a <)"],
    "syntax in a condition of a SubTree": ["the script of _post"],
    "empty script": ["the script of _post", "Empty Script"],
    "syntax in Script": ["the script of code", "position 3"],
    "syntax in Precondition": ["the script of if"],
    "a very long script": ["20004 characters", "at most 20000"],
    "SubTree without ID": ["<SubTree> lacks the attribute ID"],
    "unknown tree": ["there is no tree Sup", "did you mean Sub?"],
    "unknown tree, none near": ["the trees: Main"],
    "SubTree of a node": ["name of a node type", "<Navigate/>"],
    "SubTree with a child": ['SubTree ID="Sub"> cannot have children'],
    "bad _autoremap": ["bool conversion"],
    "contains itself": ["the tree Main contains itself: Main > Main"],
    "contains itself by another": ["Main > B > Main"],
    "model without ID": ["lacks the attribute ID"],
    "model port without name": ["<input_port> lacks the attribute name"],
    "mandatory port": ["asks for the port who", 'write who="{who}"'],
    "SubTreePlus": ["unknown node SubTreePlus", "version 4 writes <SubTree>", "_autoremap"],
    "SequenceStar": ["SequenceWithMemory"],
    "explicit SequenceStar": ["SequenceWithMemory"],
    "the old spelling of Retry": ["RetryUntilSuccessful"],
    "Parallel's threshold": ["no port threshold", "success_count"],
    "BlackboardCheckInt": ["_skipIf"],
    "ConsumeQueue": ["LoopString"],
    "ManualSelector": ["Switch2"],
    "Selector": ["Fallback"],
    "no format": ['lacks BTCPP_format="4"'],
    "another format": ["BTCPP_format is 3"],
    "ignored below root": ["<Includes> below <root> is ignored", "did you mean include?"],
    "a node below root": ["<Action> below <root> is ignored ()"],
    "a node with an ID below root": ["<Action> below <root> is ignored"],
    "blank in an ID": ["the ID a b contains ' '", "4.10"],
    "dot in an ID": ["the ID a.b contains '.'"],
    "tree defined twice": ["Main is defined again", "m.xml:2"],
    "__shared_blackboard": ["means nothing in version 4", '_autoremap="true"'],
    "__autoremap": ["_autoremap"],
    "warning of a node type": ["another spelling of Navigate"],
    "unknown port in an unused tree": ["did you mean number?"],
    "circle of unused trees": ["contains itself"],
    "bad script in an unused tree": ["script of code"],
}
MISSIONS = {
    "retry what never fails": ["never retries", "ForceSuccess never fails"],
    "retry a leaf that never fails": ["Begin never fails"],
    "repeat what never succeeds": ["never repeats", "never succeeds"],
    "fallback after a sure success": ["Act is never reached: Script before it never fails"],
    "reactive fallback after a sure success": [
        "Act x is never reached: Begin before it never fails"],
    "sequence after a sure failure": [
        "Act is never reached: AlwaysFailure before it never succeeds"],
    "sequence after an endless loop": ["never succeeds"],
    "a fallback that always ends well, retried": ["Fallback never fails"],
    "endless repeat without waiting": ["forever and never waits", "Sleep"],
    "endless retry without waiting": ["without waiting", "ReactiveFallback"],
    "no round": ["never run", "-1: no limit"], "no attempt": ["never run"],
    "more successes than children": ["only 2 children"],
    "no success wanted": ["decides the result"],
    "IfThenElse with one child": ["has 1 children; it must have 2 or 3"],
    "Switch without a default": ["must have 3"],
    "a port without a value": ["Sleep needs the port msec"],
    "a condition misspelled": ["_skipif is ignored", "did you mean _skipIf?"],
    "_autoremap on a node": ["only on a <SubTree>"],
    "recovery that comes first": ["Recover comes first"],
    "recovery in a Sequence": ["no failure to look at", "into a Fallback"],
    "another kind than it says": ["Act is of kind Action, not Condition"],
    "read, never written": ["the entry goal is read here, but nothing writes it"],
    "read in a script": ["the entry lives"],
    "read in a condition": ["the entry lives", "did you mean lifes?"],
    "read by default, never written": ["the entry goal is read here", "Aim writes it"],
    "read by default, one of two written": [
        "the entry pace is read here", "Hurry or Stroll writes it"],
    "an entry given in place of the default": [
        "the entry gaol is read here, but nothing writes it"],
    "an optional port's entry that the file gives": ["the entry mod is read here"],
    "any node of a kind, by its type": ["Act is never reached"],
    "what TryCatch tries": ["Act is never reached"],
    "a watched entry without its second brace": [
        'entry="{given" names no entry (write entry="{given}")'],
    "a brace is missing": ['in="{goal" is a text, no entry (the whole value is written {goal})'],
    "an entry in a text": ['in="go to {goal}" is a text, no entry (a text is not filled in: a '
                           'reference is the whole value)'],
    "a brace too many": ['out="{{x}" is the entry called "{x" (write {x})'],
    "a brace too many at the end": ['out="{x}}" is the entry called "x}" (write {x})'],
    "a choice by a text with a brace": ["is a text, no entry"],
    "a case in quotes": ['case_2="b; " is compared with all that stands in it (write case_2="b")'],
    "a case twice": ["case_2 is never chosen: case_1 is the same"],
    "an attribute whose value begins with a new line": ["_skipif is ignored"],
    "an entry whose attribute begins with a new line": ["the entry goal is read here"],
    "more successes than anything has children": ['success_count="1234567890", but there are only '
                                                  '1 children (it will fail when it is ticked)'],
    "watched, never written": ["the entry goal"],
    "the first word alone": ["True means nothing in a script (write true)"],
    "no effect": ["a statement of code has no effect (a value is assigned with :=)"],
    "two conditions": ["a statement of code has no effect (&& or || joins two conditions)"],
    "no effect, and assigns": ["a statement of code has no effect (&& or || joins two conditions)",
                               "code assigns to given instead of comparing (write given == …)"],
    "assigns among others": ["code assigns to given instead of comparing (write given == …)"],
    "not created, told once": [
        "count = …, but nothing creates the entry count (create it first: count := …)"],
    "not created, and not what is meant": [
        "a statement of code has no effect (a value is assigned with :=)",
        "count = …, but nothing creates the entry count (create it first: count := …)"],
    "created under a similar name": [
        "cuont += …, but nothing creates the entry cuont (did you mean count?)"],
    "another kind": ["a is assigned a number, but elsewhere a text (the first value decides the "
                     "kind of an entry)",
                     "b is assigned a text, but elsewhere a number (the first value decides the "
                     "kind of an entry)"],
    "texts that are no numbers": ["a is assigned a text, but elsewhere a number (the first value "
                                  "decides the kind of an entry)",
                                  "b is assigned a text, but elsewhere a number (the first value "
                                  "decides the kind of an entry)"],
    "compared": [
        "a >= b compares a text with a number (a text needs single quotes, a number none)",
        "… != 'y' compares a text with a number (a text needs single quotes, a number none)",
        "'z' == … compares a text with a number (a text needs single quotes, a number none)"],
    "calculated": ["a += 1 calculates with a text (texts are joined with ..)",
                   "a - a calculates with a text (texts are joined with ..)",
                   "given * a calculates with a text (texts are joined with ..)"]}
MODEL_PORTS = {
    "": "cannot be empty", "1x": "cannot start with a digit", "a b": "cannot contain blanks",
    "_skipIf": "reserved", "ID": "reserved", "a:b": "cannot contain", "a\x7f": "cannot contain"
}
MARKUP = [
    ("", "empty"),
    (" \n\t ", "empty"),
    ("just text", "no element"),
    ("<!-- only -->", "no element"),
    ("<root>\n  <a>\n  </b>\n</root>", "</b> closes nothing"),
    ("<root>\n  <a>\n</root>", "<a> is not closed before </root>"),
    ("<root>\n  <a>\n", "<a> is never closed"),
    ("<root>\n  <a", "<a> is not ended with >"),
    ("<root>\n  <a\n  <b/></root>", "<a> is not ended with >"),
    ("<root>\n  <a x=1/></root>", "x must stand in quotes"),
    ("<root>\n  <a x/></root>", "x has no value"),
    ('<root>\n  <a x="1 < 2" y/></root>', "y has no value"),
    ('<root>\n  <a x="1\n2" y/></root>', "y has no value"),
    ('<root>\n  <a x="1"y="2"/></root>', "blank is missing before y"),
    ('<root>\n  <a x="1"\n     x="2"/></root>', "x is given twice"),
    ('<root>\n  <a x="1/></root>', "x has no closing quote"),
    ('<root>\n  <a x="1>\n  <b y="2"/></root>', "x has no closing quote"),
    ("<root>\n  <!-- a </root>", "comment is never closed"),
    ("<root>\n  <![CDATA[ a </root>", "CDATA section is never closed"),
    ("<root>\n  <?php x ?></root>", "processing instruction"),
    ("<?xml <root/>", "never closed"),
    ("<root>\n  1 < 2</root>", "begins no tag"),
    ("<root>\n  <1a/></root>", "1a cannot be the name"),
    ('<root>\n  <a 1x="2"/></root>', "1x cannot be the name"),
    ("<root>\n  <x:a/></root>", "colon"),
    ('<root>\n  <a n="&#7;"/></root>', "XML does not allow"),
    ('<root>\n  <a n="&#x110000;"/></root>', "XML does not allow"),
    ("<root>\n  a\x01</root>", "XML does not allow"),
    ("<root/>\n<root/>", "an element after the end"),
    ("<root/>\n  text", "text after the end"),
    ("text <root/>", "text before"),
    ("\n\ufeff<root/>", "text before"),
    ("<root>\n</root></root>", "</root> closes nothing"),
    ("<root>\n <\x00/></root>", "NUL"),
    ("\ufeff x<root/>", "text before the first element"),
    ("\ufeff<root/>x", "text after the end of the first element"),
    ("<root><!-- a --><A/></root>\nx", "text after the end of the first element"),
    ("<root a=\"&\" b=\"\"><A></A><B/></root>\n<root/>",
     "an element after the end of the first element"),
    ('<!DOCTYPE r [\n<!ENTITY a "b">]><root/>', "declarations inside DOCTYPE"),
    ('<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><root/>',
     "declarations inside DOCTYPE"),
    ("<root>\n <a é".encode("latin-1"), "byte 0xe9 is not UTF-8"),
    ("<root n='éé\n".encode("utf-8") + b"  \xff'/>", "byte 0xff is not UTF-8"),
    ("<root/>".encode("utf-16-le"), "NUL"),
    ("<root/>".encode("utf-16") + b"\x00", "is not UTF-16"),
    (b"<root>\xed\xa0\x80</root>", "is not UTF-8"),
    ("<root><a></b></a></root>", "</a> is due"),
    (test_document.attributes(501), "<root> has more than 500 attributes"),
    ("<{}/>".format("r" * 301), "the name of the element is longer than 300"),
    ("<root {}='1'/>".format("a" * 301), "names may have 300 characters"),
    ("<root a='{}'/>".format("1" * 100_001), "values 100000"),
    ("<root>" + "<a>" * 3000, "deeper than 2040 levels"),
]
SUBTREES = [
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
     '"soon" cannot be of type int'),
]
SAID = [(of_file, (name,), words) for name, words in FILES.items()]
SAID += [(of_mission, (name,), words) for name, words in MISSIONS.items()]
SAID += [(of_text, (test_checks.port_called(name), ), [words])
         for name, words in MODEL_PORTS.items()]
SAID += [(of_markup, (text,), [words]) for text, words in MARKUP]
SAID += [(of_main_and_sub, files, [words]) for *files, words in SUBTREES]
SAID += [(of_reference, (code,), [REFERENCE.get(code)]) for code in RULES]
SAID += [
    (of_text, (root(test_checks.OLD_REMAPPING, 'main_tree_to_execute="Main"'), ),
     ['inner="outer" is the text outer in version 4 (the entry of that name is written {outer})']),
    (of_text, (main('<Sleep msec="2 min"/>'), ), ['msec="2 min" is read only up to "min": as 2']),
    (of_error, (test_broken_leaves.mistaken, "<Unsettled/>"), [
        "Unsettled cannot be made: KeyError: 'gripper' (",
        " (a mistake in the code of the node type, not in this file)"
    ]),
    (of_error, (test_tree.load_substituted, "Slep"), ["the substitute Slep is not a node type"]),
    (of_robot, (dict(listens=(test_load.DOORS, Sense.GAZE)), None), [
        "FixtureWaves cannot work with the robot D5.4.3: it has no service for FixtureWave, "
        "topic /doors/state (no robot has one; declare it in the robot's interface)"
    ]),
    (of_robot, (dict(calls=(), listens=(Sense.GAZE, ),
                     does_without=True), Interface("bare", (), (), (), {})),
     [
         "Waves does nothing with the robot bare: it has no message about the visitor's gaze "
         "(set robotInterface D5.4.3 or release-1.0 or release-1.1)"
     ]),
    (of_phrase, ("8", ), ["the culture file has no utility phrase 8"]),
    (of_text, (main("a text <Navigate/>"), ), ["this text is dropped: a text"]),
    (of_text, (main("<Sequence>{}</Sequence>".format("<Nope/>" * 1001)), ),
     ["1 more mistakes are not shown"]),
]


@pytest.mark.parametrize("of, what, words", SAID, ids=[
    "{}-{}".format(of.__name__, number) for number, (of, _, _) in enumerate(SAID)])
def test_a_fault_is_told_in_these_words(of, what, words):
    said = "\n".join(of(*what))
    assert [word for word in words if word not in said] == []


@pytest.mark.parametrize("text, expected", [
    (main('<Navigate skipif="true"/>'), "Navigate has no port skipif (did you mean _skipIf?)"),
    (main('<Navigate zzz="1"/>'), "Navigate has no port zzz (its ports: none)"),
    (root(tree('<SubTree ID="Zzz"/>') + MANY),
     "there is no tree Zzz (the trees: Main, {}, …)".format(", ".join("T{}".format(number)
                                                                      for number in range(19)))),
    (root(MANY, 'BTCPP_format="4"'),
     "main_tree_to_execute is not given, and these trees are called by no other: {}, … "
     "(name the main tree in <root main_tree_to_execute=\"…\">)".format(", ".join(
         "T{}".format(number) for number in range(20)))),
    (root(tree(LEAF, "Navigate"), 'BTCPP_format="4"'),
     "Navigate is the name of a node type; a tree cannot be called so ()"),
    (root(tree(LEAF, "a|b\x7f:c"),
          'BTCPP_format="4"'), "the ID a|b\\x7f:c contains ':' and '|' and '\\x7f'; "
     "not allowed are blanks and any of <>&\"'/\\:*?|. ()"),
    (circle(8), "the tree T0 contains itself: T0 > T1 > T2 > T3 > T4 > T5 > T6 > T7 > T0 ()"),
    (chain(27),
     "the mission unfolds to 536870909 nodes; at most 250000 are allowed (call fewer SubTrees)"),
    (chain(28),
     "the mission unfolds to a billion or more nodes; at most 250000 are allowed (call fewer "
     "SubTrees)"
     ),
    (main("<Attend/>"),
     "Attend takes an argument in its name, which is not given (allowed: name=\"…\" with social, "
     "seeking)"),
    (main('<Attend name="shy"/>'),
     "the name of Attend cannot be shy (allowed: name=\"…\" with social, seeking)"),
    (main('<Attend name=" Social" mode="1"/>'),
     "Attend has no port mode (its argument is its name: social, seeking)"),
    (root(tree('<SubTree ID="S" _post="1" where="1" when="2" wo="3"/>') + MODEL),
     "the model of S asks for the port who, which is not given; it has no port wo (did you mean "
     "who?)"
     ),
    (root(tree('<SubTree ID="S" where="1" when="2"/>') + MODEL),
     "the model of S asks for the port who, which is not given (write who=\"{who}\")"),
])
def test_a_fault_is_told_with_what_is_allowed_and_no_more(text, expected):
    assert in_words(fault for fault in test_checks.checked(text).faults
                    if not fault.is_warning) == [expected]


@pytest.mark.parametrize("body, expected", [
    ("<Success/>", "unknown node Success (BehaviorTree.CPP calls it AlwaysSuccess)"),
    ("<failure/>", "unknown node failure (BehaviorTree.CPP calls it AlwaysFailure)"),
    ('<Wait msec="5"/>', "unknown node Wait (BehaviorTree.CPP calls it Sleep, with the port msec)"),
    ("<N\u0430vigate/>", "unknown node N\u0430vigate (did you mean Navigate? \u0430 is CYRILLIC "
     "SMALL LETTER A)"),
    ("<\u0422imeout/>", "unknown node \u0422imeout (did you mean Timeout? \u0422 is CYRILLIC "
     "CAPITAL LETTER TE)"),
    ('<Sleep ms\u03b5c="5"/>', "Sleep has no port ms\u03b5c (did you mean msec? \u03b5 is GREEK "
     "SMALL LETTER EPSILON)"),
    ('<Sch\u00f6n/>', "unknown node Sch\u00f6n (exportNodeModel prints every node type with its "
     "ports)"),
    ('<SubTree ID="Main "/>', 'there is no tree "Main " (did you mean Main?)'),
    ('<Action ID="Navigate "/>', 'unknown node "Navigate " (did you mean Navigate?)'),
    ('<Script code="\u0430 := 1"/>', "the script of code cannot be read: Invalid token '\u0430' at "
     "position 0 (\u0430 is CYRILLIC SMALL LETTER A)"),
    ('<Script code="a := \u2018x\u2019"/>', "the script of code cannot be read: Invalid token "
     "'\u2018' at position 5 (\u2018 is LEFT SINGLE QUOTATION MARK)"),
    ('<Script code="a := 12,75"/>', "the script of code cannot be read: Invalid token ',' at "
     "position 7 (a number has a point: write 12.75)"),
    ('<Script code="a := min(b, 2)"/>', "the script of code cannot be read: Invalid token ',' at "
     "position 10 (a script has no functions; condition ? value : other chooses a value)"),
])
def test_advice_for_what_an_author_knows_from_elsewhere(body, expected):
    assert in_words(fault for fault in test_checks.checked(main(body)).faults
                    if not fault.is_warning) == [expected]


@pytest.mark.parametrize("node, queue, items", [
    ("LoopInt", "1,2,3", "1;2;3"), ("LoopDouble", "1.5, 2", "1.5;2"), ("LoopInt", "1 2", "1;2"),
    ("LoopString", "door, lift", "door;lift"), ("LoopBool", "true,false", "true;false"),
    ("LoopInt", "[1, -2]", "1;-2")])
def test_the_elements_of_a_list_are_separated_by_semicolons(node, queue, items):
    body = '<{} queue="{}" value="{{v}}"><Sleep msec="5"/></{}>'.format(node, queue, node)
    hint = "elements are separated by semicolons: write {}".format(items)
    assert hint in [fault.hint for fault in test_checks.checked(main(body)).faults]


def test_a_misspelt_port_of_a_model_is_told_at_the_model():
    text = root(tree('<SubTree ID="S" pause="500"/>') + tree(
        '<ScriptCondition code="pause > 1"/>', "S") + '<TreeNodesModel>\n<SubTree ID="S">'
        '<input_port name="pasue"/></SubTree></TreeNodesModel>', 'main_tree_to_execute="Main"')
    fault, = [fault for fault in test_checks.checked(text).faults if not fault.is_warning]
    assert (fault.line, fault.code, fault.hint) == (
        text[:text.index("<input_port")].count("\n") + 1, "model-port-missing",
        "did you mean pause?")


def test_a_model_of_a_tree_that_is_missing_is_compared_with_its_calls():
    text = root(tree('<SubTree ID="Other" wo="500"/>') + '<TreeNodesModel><SubTree ID="Other">'
                '<input_port name="who"/></SubTree></TreeNodesModel>',
                'main_tree_to_execute="Main"')
    assert {fault.code for fault in test_checks.checked(text).faults if not fault.is_warning} == {
        "unknown-tree", "model-port-missing"}


UNITS = {
    "ms": 1, "msec": 1, "milliseconds": 1, "s": 1000, "sec": 1000, "Second": 1000,
    "seconds": 1000, "min": 60_000, "minute": 60_000, "minutes": 60_000,
    "H": 3_600_000, "hour": 3_600_000, "hours": 3_600_000
}


@pytest.mark.parametrize(
    "body, hint", [('<Sleep msec="1.5{}"/>'.format(unit),
                    "the number is of milliseconds: 1.5{} is {:.0f}".format(unit, 1.5 * length))
                   for unit, length in UNITS.items() if length > 1] +
    [('<Sleep msec="20 {}"/>'.format(unit),
      "the number is of milliseconds: 20 {} is 20".format(unit))
     for unit, length in UNITS.items() if length == 1] + [
          ('<Sleep msec="0,5 s "/>', "the number is of milliseconds: 0,5 s  is 500"),
          ('<Sleep msec="2 rounds"/>', "the type is uint"),
          ('<Typed number="2 s"/>', "the type is int"),
          ('<Typed number="-12\'345 678"/>', "a number has no separators: write -12345678"),
          ('<Typed number="1,5"/>', "the type is int, without fraction"),
          ('<Typed number="12e2"/>', "the type is int: write 1200"),
          ('<Typed out="1,25"/>', "write 1.25"),
          ('<Typed out="1 m"/>', "the type is double"),
      ])
def test_what_may_be_meant_by_a_number_that_is_not_read_to_its_end(body, hint):
    assert [fault.hint for fault in test_checks.checked(main(body)).faults] == [hint]


# ------------------------------------------------------------------------------------ the reference


def test_the_reference_lists_the_codes_and_has_a_section_for_each():
    assert REFERENCE[""] == sections(page())[""]
    assert list(REFERENCE) == ["", *sorted(RULES, key=lambda code: RULES[code].is_warning)]


def test_the_reference_explains_a_code_with_what_is_told():
    fault, = told(examples()[rules.UNKNOWN_NODE.code][0].text)
    line = '\nNo node type has this name. `<Sequense><Sleep msec="5"/></Sequense>`\n\n'
    section = sections(page())[rules.UNKNOWN_NODE.code]
    assert line + "`{} ({})`\n".format(fault.text, fault.hint) in section
    repeated = sections(page())[rules.ATTRIBUTE_VALUE.code]  # its message has the meaning
    assert rules.ATTRIBUTE_VALUE.meaning not in repeated and "has no value" in repeated
