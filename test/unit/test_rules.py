"""Each kind of mistake: its examples are told, at their place, with its code; docs/faults.md is derived from them."""
import ast
import os
import re

import pytest

from behavior_controller.bt import rules
from behavior_controller.bt.rules import EXAMPLE_NAME, MARK, RULES, example_file
from behavior_controller.faults_page import page, told

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = [(rule, text) for rule in RULES.values() for text in rule.examples]
WITHOUT_EXAMPLE = {
    "unreadable-file",  # what cannot be read is not a text
    "not-well-formed",  # no file is known that comes so far
    "substitute-unknown", "node-broken", "node-type-warning",  # not in the file, but beside it
    "robot-lacks", "phrase-missing", "does-without",  # the same
}


@pytest.mark.parametrize("rule, example", EXAMPLES, ids=["{}-{}".format(
    rule.code, rule.examples.index(text) + 1) for rule, text in EXAMPLES])
def test_each_example_has_its_fault_at_its_place_and_no_other(rule, example, tmp_path, monkeypatch):
    text, line, column = example_file(rule, example)
    (tmp_path / EXAMPLE_NAME).write_bytes(text.encode("utf-8"))
    monkeypatch.chdir(tmp_path)
    found = [fault for fault in told(text) if not rule.beside or fault.code != rule.beside]
    assert [(fault.code, fault.line, fault.column, fault.is_warning) for fault in found] == [
        (rule.code, line, column, rule.is_warning)]
    assert (found[0].end_line, found[0].end_column) > (line, column)


def test_there_are_many_bad_files_and_each_rule_has_one():
    assert len({text for _, text in EXAMPLES}) == len(EXAMPLES) >= 120
    assert {rule.code for rule in RULES.values() if not rule.examples} == WITHOUT_EXAMPLE


def test_a_code_is_a_few_plain_words():
    assert [code for code in RULES if not re.fullmatch(r"[a-z]+(-[a-z]+){0,3}", code)] == []


def test_a_meaning_is_one_sentence():
    assert [rule.code for rule in RULES.values() if not re.fullmatch(r"[A-Z<_].*[^.]\.", rule.meaning)] == []


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
    declared = {name for name, value in vars(rules).items() if isinstance(value, rules.Rule)}
    assert declared - used == set()


def test_a_mark_is_in_each_example_once():
    assert [text for _, text in EXAMPLES if text.count(MARK) != 1] == []


def test_a_rule_is_declared_once():
    with pytest.raises(ValueError, match="declared twice"):
        rules.error(rules.UNKNOWN_NODE.code, "Another meaning.")


# -------------------------------------------------------------------------------------------- scripts of several lines

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


# ------------------------------------------------------------------------------------------------------ the reference


def test_the_reference_explains_each_code_with_what_is_told():
    text = page()
    assert all("\n### {}\n".format(code) in text for code in RULES)
    assert "`example.xml:3:5: unknown node Sequense (did you mean Sequence?)`" in text
