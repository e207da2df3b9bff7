"""Each kind of mistake: its examples are told at their place with its code, in these words;
docs/faults.md shows them."""
import ast
import os
import re

import pytest

from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader.rules import RULES
from fault_reference import EXAMPLE_NAME, examples, page, told
from fault_words import in_words
from small_missions import LEAF, chain, checked, circle, main, model, root, tree

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


@pytest.mark.slow
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
    assert [rule.code for rule in RULES.values() if not re.fullmatch(
        r"[A-Z<_].*[^.]\.", rule.meaning)] == []


@pytest.mark.slow
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
# What a fault of a small mission says beyond the rows of test_checks, test_lint and test_document.


def sections(text):
    """Return the parts of the reference by their headings; that of its first part is empty."""
    first, *others = text.split("\n### ")
    return dict({"": first}, **dict(other.split("\n", 1) for other in others))


with open(os.path.join(ROOT, "docs", "faults.md"), encoding="utf-8") as reference:
    REFERENCE = sections(reference.read())
MANY = "".join(tree(LEAF, "T{}".format(number)) for number in range(21))
MODEL = tree(LEAF, "S") + model('<input_port name="who"/><input_port name="where"/>')


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
     "SubTrees)"),
    (main("<Attend/>"),
     "Attend takes an argument in its name, which is not given (allowed: name=\"…\" with social, "
     "seeking)"),
    (main('<Attend name="shy"/>'),
     "the name of Attend cannot be shy (allowed: name=\"…\" with social, seeking)"),
    (main('<Attend name=" Social" mode="1"/>'),
     "Attend has no port mode (its argument is its name: social, seeking)"),
    (root(tree('<SubTree ID="S" _post="1" where="1" when="2" wo="3"/>') + MODEL),
     "the model of S asks for the port who, which is not given; it has no port wo (did you mean "
     "who?)"),
    (root(tree('<SubTree ID="S" where="1" when="2"/>') + MODEL),
     "the model of S asks for the port who, which is not given (write who=\"{who}\")")])
def test_a_fault_is_told_with_what_is_allowed_and_no_more(text, expected):
    assert in_words(fault for fault in checked(text).faults if not fault.is_warning) == [expected]


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
     "position 10 (a script has no functions; condition ? value : other chooses a value)")])
def test_advice_for_what_an_author_knows_from_elsewhere(body, expected):
    assert in_words(fault for fault in checked(main(body)).faults
                    if not fault.is_warning) == [expected]


@pytest.mark.parametrize("node, queue, items", [
    ("LoopInt", "1,2,3", "1;2;3"), ("LoopDouble", "1.5, 2", "1.5;2"), ("LoopInt", "1 2", "1;2"),
    ("LoopString", "door, lift", "door;lift"), ("LoopBool", "true,false", "true;false"),
    ("LoopInt", "[1, -2]", "1;-2")])
def test_the_elements_of_a_list_are_separated_by_semicolons(node, queue, items):
    body = '<{} queue="{}" value="{{v}}"><Sleep msec="5"/></{}>'.format(node, queue, node)
    hint = "elements are separated by semicolons: write {}".format(items)
    assert hint in [fault.hint for fault in checked(main(body)).faults]


def test_a_misspelt_port_of_a_model_is_told_at_the_model():
    text = root(tree('<SubTree ID="S" pause="500"/>') + tree(
        '<ScriptCondition code="pause > 1"/>', "S") + '<TreeNodesModel>\n<SubTree ID="S">'
        '<input_port name="pasue"/></SubTree></TreeNodesModel>', 'main_tree_to_execute="Main"')
    fault, = [fault for fault in checked(text).faults if not fault.is_warning]
    assert (fault.line, fault.code, fault.hint) == (
        text[:text.index("<input_port")].count("\n") + 1, "model-port-missing",
        "did you mean pause?")


def test_a_model_of_a_tree_that_is_missing_is_compared_with_its_calls():
    text = root(tree('<SubTree ID="Other" wo="500"/>') + '<TreeNodesModel><SubTree ID="Other">'
                '<input_port name="who"/></SubTree></TreeNodesModel>',
                'main_tree_to_execute="Main"')
    assert {fault.code for fault in checked(text).faults if not fault.is_warning} == {
        "unknown-tree", "model-port-missing"}


# ------------------------------------------------------------------------------------ the reference


def test_the_reference_is_what_make_derived_writes_with_a_section_for_each_code():
    written = sections(page())
    assert {code for code in written if REFERENCE.get(code) != written[code]} == set()
    assert list(REFERENCE) == ["", *sorted(RULES, key=lambda code: RULES[code].is_warning)]


@pytest.mark.slow
def test_the_reference_explains_a_code_with_what_is_told():
    fault, = told(examples()[rules.UNKNOWN_NODE.code][0].text)
    line = '\nNo node type has this name. `<Sequense><Sleep msec="5"/></Sequense>`\n\n'
    section = sections(page())[rules.UNKNOWN_NODE.code]
    assert line + "`{} ({})`\n".format(fault.text, fault.hint) in section
    repeated = sections(page())[rules.ATTRIBUTE_VALUE.code]  # its message has the meaning
    assert rules.ATTRIBUTE_VALUE.meaning not in repeated and "has no value" in repeated
