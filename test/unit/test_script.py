"""Scripts do what BehaviorTree.CPP's do (section 11), and no text of a script can harm the process.
"""
import json
import math
import os
import random
import re
import time
from xml.etree import ElementTree

import pytest

from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.script.parser import (
    Assignment, Operand, ScriptError, ScriptSyntaxError, compile_script, to_bool)
from behavior_controller.bt.values.values import ValueFault

TRACES = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "conformance",
                      "hand")
# the library's names of types that differ from ours
TYPES = {"BT::AnyTypeAllowed": "any", "std::string": "string", "long": "int64"}
ENUMS = {"RED": 1, "GREEN": 2}


def run(text, enums=None, **entries):
    """Return the value of a script and the blackboard it ran on, which holds ``entries`` as scripts
    make them."""
    blackboard = Blackboard()
    for key, value in entries.items():
        blackboard.create(key).replace(value)
    return compile_script(text).run(blackboard, enums or {}), blackboard


def same(expected, found):
    """Return whether two values are equal and of one kind; the traces write reals without a finite
    value as text."""
    if isinstance(found, float) and not math.isfinite(found):
        return expected == str(found)
    return type(expected) is type(found) and expected == found


# ------------------------------------------------------------------------------ the recorded traces


def single_scripts():
    """Yield the name, the script and the trace of every recorded case whose tree is one Script
    node."""
    with open(os.path.join(TRACES, "script.json"), encoding="utf-8") as file:
        recorded = json.load(file)
    for case in recorded:
        nodes = list(ElementTree.fromstring(case["xml"]).find("BehaviorTree").iter())[1:]
        if [node.tag for node in nodes] == ["Script"] and list(nodes[0].attrib) == ["code"]:
            code = nodes[0].attrib["code"]
            if not code.startswith("{"):
                yield case["name"], code, case


SINGLE = list(single_scripts())


def test_there_are_many_recorded_scripts():
    assert len(SINGLE) > 90


def test_a_script_ends_as_it_was_recorded():
    for name, code, case in SINGLE:
        if case["expected"].get("error"):
            with pytest.raises(ScriptSyntaxError) as raised:
                compile_script(code)
            assert str(raised.value) == case["expected"]["message"], name
        else:
            check_run(name, compile_script(code, allow_empty=True), case)


@pytest.mark.parametrize("text", ["", " ", "\n\t"])
def test_an_empty_script_is_told_where_it_is_compiled(text):
    with pytest.raises(ScriptSyntaxError, match="Empty Script"):
        compile_script(text)


def test_an_empty_script_that_a_port_may_bring_fails_each_time_that_it_runs():
    script = compile_script("", allow_empty=True)
    for _ in range(2):
        with pytest.raises(ScriptError, match="bad_function_call: the script is empty"):
            script.run(Blackboard(), {})
    assert compile_script("0", allow_empty=True).run(Blackboard(), {}) == 0


def check_run(name, script, case):
    blackboard = Blackboard()
    for key, value in case.get("blackboard", {}).items():
        blackboard.set(key, value, "vec_int" if isinstance(value, list) else None)
    for tick in case["expected"]["ticks"]:
        if tick.get("exception"):
            with pytest.raises(ScriptError):
                script.run(blackboard, case.get("enums", {}))
        elif script.text:
            script.run(blackboard, case.get("enums", {}))
    expected = case["expected"]["blackboard"][""]
    assert set(blackboard.local) == set(expected), name
    for key, entry in blackboard.local.items():
        assert same(expected[key], entry.value), (name, key, entry.value)
        declared, original = case["expected"]["blackboard_types"][""][key]
        assert entry.type == TYPES.get(declared,
                                       declared) or declared.startswith("std::vector"), (name, key)
        assert entry.origin == ("" if original == "empty" else TYPES.get(original, original)) or \
            original.startswith("std::vector"), (name, key)


# ------------------------------------------------------------------------------------- reading text


@pytest.mark.parametrize("text, reason", [
    ("", "Empty Script"),
    (" \t\r\n", "Empty Script"),
    ("a := #", "Invalid token '#' at position 5"),
    ("a := \u0663", "Invalid token '\u0663' at position 5"),  # a digit elsewhere, not here
    ("a\x0c:= 1", "Invalid token '\\x0c' at position 1"),
    ("a := 1_000", "Invalid token '1_000' at position 5"),
    ("a := 1.5.2", "Invalid token '.' at position 8"),
    ("a := 2e-", "Invalid token '2e-' at position 5"),
    ("a := 0x1G", "Invalid token '0x1G' at position 5"),
    ("'a' 'b", "Invalid token ''b' at position 4"),
    ("1 +", "Expected operand at position 3 (got '')"),
    ("1 + * 2", "Expected operand at position 4 (got '*')"),
    ("()", "Expected operand at position 1 (got ')')"),
    ("(1", "Parse error at position 2: expected ')' (got '')"),
    ("(1 2)", "Parse error at position 3: expected ')' (got '2')"),
    ("1 ? 2", "Parse error at position 5: expected ':' in ternary expression (got '')"),
    ("1 ? 2 ; 3", "Parse error at position 6: expected ':' in ternary expression (got ';')")])
def test_what_cannot_be_read_is_refused_with_its_place(text, reason):
    with pytest.raises(ScriptSyntaxError) as raised:
        compile_script(text)
    assert str(raised.value) == reason
    assert raised.value.position == int((re.findall(r"at position (\d+)", reason) or [0])[-1])


@pytest.mark.parametrize(
    "text, value",
    [
        ("1 + 2 * 3 - 4 / 2", 5.0),
        ("2 * 3 & 7 | 8", 14.0),
        ("6 ^ 3 & 1", 7.0),
        ("10 - 3 - 2", 5.0),
        ("1 < 2 == 2", 1.0),  # a chain: 1 < 2 and 2 == 2
        ("3 > 2 == 1", 0.0),  # likewise: 2 is not 1
        ("1 < 2 < 3 && 3 > 2", 1.0),
        ("0 || 1 && 0", 0.0),
        ("-2 * -3", 6.0),
        ("!0 + 1", 2.0),
        ("0 ? 1 : 0 ? 2 : 3", 3),
        ("1 ? 0 ? 4 : 5 : 6", 5),
        ("0 ? 2 : 0 || 1", 1.0),
        ("x := y := 3", 3),
        ("1 2 3", 3),
        ("end := 3", 3),
        ("name := 1 integer := 2 real := 3 text := 4", 4),
        ("operator := 5; end := operator; end", 5),
        ("5..'x'", "5x"),
        ("5.5..'x'", "5.500000x")])
def test_precedence(text, value):
    assert same(value, run(text)[0])


def test_names_that_are_read_and_written_are_known():
    facts = compile_script("a := b; c += d ? @e : true; f = g = (h) - 1; i; j + k < l; -m").facts
    assert set(facts.read) == {"b", "c", "d", "@e", "h", "i", "j", "k", "l", "m"}
    assert [assignment.name for assignment in facts.assignments] == ["a", "c", "g", "f"]


def test_which_statements_assign_is_known():
    statements = compile_script("a; b := 1 (c = 2) + 1;; d").facts.statements
    assert [(position, *assigns) for position, _, *assigns in statements] == [
        (0, False, False), (3, True, True), (10, False, True), (24, False, False)]
    assert [value.word for _, value, *_ in statements] == ["a", "1", "", "d"]


@pytest.mark.parametrize("text, kind, word, position", [
    ("a := b", "name", "b", 5),
    ("a := (b)", "name", "b", 6),
    ("a := 'b'", "text", "'b'", 5),
    ("a := 1.5", "number", "1.5", 5),
    ("a := true", "number", "true", 5),
    ("a := -b", "number", "", 6),
    ("a := b := c", "", "c", 10),
    ("a := b := 'c'", "text", "'c'", 10),
    ("a := b ? c : d", "", "d", 13),
    ("a := b + c", "", "", 5),
    ("a := b + 1", "", "", 5),
    ("a := 1 + 2", "number", "", 5),
    ("a := 'b' + 'c'", "text", "", 5),
    ("a := b .. c", "text", "", 5),
    ("a := b - c", "number", "", 5),
    ("a := b < c", "number", "", 5)])
def test_what_the_text_of_a_script_tells_of_a_value(text, kind, word, position):
    assert compile_script(text).facts.assignments[-1] == Assignment(
        "a", ":=", Operand(kind, word, position), 0)


@pytest.mark.parametrize("text, operations", [
    ("a < b < 'c'", [("<", ("name", "a"), ("name", "b")), ("<", ("name", "b"), ("text", "'c'"))]),
    ("1 + 2 .. a", [("+", ("number", "1"), ("number", "2")),
                    ("..", ("number", ""), ("name", "a"))]),
    ("1 * a + 2", [("*", ("number", "1"), ("name", "a")), ("+", ("number", ""), ("number", "2"))]),
    ("a + (b + c)", [("+", ("name", "b"), ("name", "c")), ("+", ("name", "a"), ("", ""))])])
def test_what_a_script_joins(text, operations):
    found = compile_script(text).facts.operations
    assert [(sign, left[:2], right[:2]) for sign, left, right in found] == operations


def test_where_an_entry_is_read_first():
    assert compile_script("a := b + c; c := b; @d").facts.read == {"b": 5, "c": 9, "@d": 20}


# ---------------------------------------------------------------------------------- running scripts


@pytest.mark.parametrize("text, value", [
    ("7 / 2", 3.5),
    ("4 / 2", 2.0),
    ("1 / 0", math.inf),
    ("-1 / 0", -math.inf),
    ("1 / (0 * -1)", -math.inf),
    ("~0", -1.0),
    ("~9223372036854774784.0", -9223372036854774784.0),
    ("-9223372036854775808.0 & -2", -2.0**63),
    ("~1.5", -2.0),
    ("!2", 0.0),
    ("!0.0", 1.0),
    ("- - 3", 3.0),
    ("-~1", 2.0),
    ("6.0 & 3", 2.0),
    ("5 ^ 3", 6.0),
    ("2.0 && 1", 1.0),
    ("0 || 0.0", 0.0),
    ("1.0 == 1.00000001", 1.0),
    ("0 == 1.1920929e-07", 1.0),
    ("0 != 1.1920929e-07", 0.0),
    ("1.0 >= 1.00000001", 0.0),
    ("1 != 1.000001", 1.0),
    ("'abc' < 'abd'", 1.0),
    ("'Z' < 'a'", 1.0),
    ("'\u00e9' > 'z'", 1.0),
    ("'ab' < 'abc'", 1.0),
    ("'3abc' == 3", 1.0),
    ("'true' == 1", 1.0),
    ("GREEN == 'GREEN'", 1.0),
    ("2 < '10'", 1.0),
    ("3 < 2 < nope", 0.0),
    ("'1' ? 'yes' : nope", "yes"),
    ("'0' ? nope : 'no'", "no"),
    ("0.5 ? 1 : 2", 1),
    ("'x' .. 1", "x1"),
    ("'x' .. 1.5", "x1.500000"),
    ("'a' + 'b' + 'c'", "abc"),
    ("RED + 1", 2.0),
    ("0x1F", 31),
    ("007", 7),
    ("9223372036854775807", 2**63 - 1),
    ("9223372036854775808", 0),
    ("0xFFFFFFFFFFFFFFFF", 0),
    ("0" * 50 + "7", 7),
    ("0x" + "0" * 50 + "f", 15)])
def test_values(text, value):
    found = run(text, ENUMS)[0]
    assert type(found) is type(value) and found == value


@pytest.mark.parametrize("text, reason", [
    ("nope", "Variable not found: nope"),
    ("a = 1", "doesn't exist, yet"),
    ("3 := 4", "Assignment left operand not a blackboard entry"),
    ("true := 1", "Assignment left operand not a blackboard entry"),
    ("(a := 1) := 2", "Assignment left operand not a blackboard entry"),
    ("n 3 := 4", "Assignment left operand not a blackboard entry"),
    ("(0 ? 1 : n) := 4", "Assignment left operand not a blackboard entry"),
    ("-n := 4", "Assignment left operand not a blackboard entry"),
    ("n + n := 4", "Assignment left operand not a blackboard entry"),
    ("none + 1", "The left operand of the operator [+] is not initialized"),
    ("1 == none", "The right operand of the operator [==] is not initialized"),
    ("none ? 1 : 2", "is not initialized"),
    ("-none", "is not initialized"),
    ("a := 1 .. 2", "The right operand of the operator [:=] is not initialized"),
    ("none += 1", "The left operand of the operator [+=] is not initialized"),
    ("'x' + 1", "Operation not permitted: [+] on a text and a number"),
    ("'x' - 'y'", "Operation not permitted: [-] on a text and a text"),
    ("'true' && true", "Operation not permitted: [&&] on a text and a number"),
    ("1 || 'true'", "Operation not permitted: [||] on a number and a text"),
    ("list .. 1", "Operation not permitted: [..] on list and a number"),
    ("'x' & 1", "Operation not permitted: [&] on a text and a number"),
    ("1 * none", "The right operand of the operator [*] is not initialized"),
    ("2 && 1", "Logic operators are not allowed"),
    ("5.5 | 2", "Binary operators are not allowed"),
    ("~(1 / 0)", "out of range"),
    ("~9223372036854775808.0", "out of range"),
    ("-1e300 & 1", "Binary operators are not allowed"),
    ("1 | 9223372036854775808.0", "Binary operators are not allowed"),
    ("-'x'", "Invalid operator [-]"),
    ("'abc' == 3", "Can't convert string [abc] to double"),
    ("'abc' ? 1 : 2", "Can't convert string [abc] to double"),
    ("9007199254740993 + 0", "Loss of precision"),
    ("9007199254740992 + 0", "Loss of precision"),
    ("minus + 0", "Loss of precision"),
    ("0.5 + 9007199254740992", "Loss of precision"),
    ("9007199254740992 + 0.5", "Loss of precision"),
    ("list == 1", "Can't mix different types in Comparison"),
    ("list == '1'", "Can't mix different types in Comparison"),
    ("list ? 1 : 2", "must be a number"),
    ("n := 1.5", "Error assigning a value to entry [n]"),
    ("n := 'zz'", "Can't convert string [zz] to double"),
    ("n /= 2", "Invalid floating point to integer conversion"),
    ("n += '2'", "Operation not permitted: [+=] on a number and a text"),
    ("s := 1", "Error assigning a value to entry [s]"),
    ("s += 2", "Operation not permitted: [+=] on a text and a number"),
    ("s -= 'x'", "Operation not permitted: [-=] on a text and a text"),
    ("list := 'x'", "Error assigning a text"),
    ("1e300 & 1", "Binary operators are not allowed")])
def test_failures_name_their_cause_and_the_script(text, reason):
    with pytest.raises(ScriptError) as raised:
        run(text, none=None, list=[1], n=3, s="text", minus=-2 ** 53)
    assert reason in str(raised.value)
    assert "Error in script [{}]: ".format(text) in str(raised.value)


def test_what_no_number_divided_by_nothing_is():
    assert math.isnan(run("0 / 0")[0]) and math.isnan(run("(0 / 0) / 0")[0])


def test_a_message_is_one_line_and_not_long():
    with pytest.raises(ScriptError) as raised:
        run("a := 1;\n\tnope;" + " " * 1000 + "b;" * 500)
    shown = "a := 1; nope; " + "b;" * 13 + "b … " + "b;" * 18
    assert str(raised.value) == f"Error in script [{shown}]: Variable not found: nope"
    with pytest.raises(ScriptSyntaxError) as unread:
        compile_script("'" + "\n" * 1000)
    assert "\n" not in str(unread.value) and len(str(unread.value)) < 200


@pytest.mark.parametrize("text, kept", [
    ("a := 1; a := 2.0", 2), ("a := 1.5; a := 2", 2.0), ("a := 1; a := '2'", 2.0),
    ("a := 1; a := 'true'", 1.0), ("a := 4; a += 3; a /= 7", 1), ("a := true", 1.0),
    ("a := -1", -1.0), ("a := 1 + 1", 2.0), ("a := 'x'; a += 'y'", "xy"), ("(a) := 3", 3)])
def test_the_first_value_decides_the_kind(text, kept):
    value, blackboard = run(text)
    assert same(kept, blackboard.get("a")) and same(kept, value)


def test_what_was_done_before_a_failure_stays():
    blackboard = Blackboard()
    with pytest.raises(ScriptError):
        compile_script("a := 1; b := nope; c := 3").run(blackboard, {})
    assert {key: entry.value for key, entry in blackboard.local.items()} == {"a": 1, "b": None}


def test_both_sides_of_a_logic_operator_are_evaluated():
    assert run("true || (x := 1)", x=0)[1].get("x") == 1


def test_every_write_counts_same_value_or_not():
    _, blackboard = run("a := 1; a := 1; a += 0")
    assert blackboard.local["a"].sequence == 3


@pytest.mark.parametrize("declared, text, stored, origin", [
    ("int", "v = '42'", 42, "int"),
    ("int", "v = 1 + 1", 2.0, "double"),
    ("int", "v = 1.5", 1.5, "double"),
    ("bool", "v = 'true'", 1, "bool"),
    ("double", "v = '2'", 2.0, "double"),
    ("string", "v = 'x'", "x", "string")])
def test_an_empty_entry_that_a_port_declared(declared, text, stored, origin):
    blackboard = Blackboard()
    entry = blackboard.create("v", declared)
    compile_script(text).run(blackboard, {})
    assert same(stored, entry.value) and (entry.type, entry.origin) == (declared, origin)


def test_a_copy_keeps_the_type_that_the_value_had():
    blackboard = Blackboard()
    blackboard.set("host", 5)  # an int, not a script's int64
    compile_script("a := host; b := (host); c := host + 0; d := 5").run(blackboard, {})
    assert [blackboard.local[key].origin for key in "abcd"] == ["int", "int", "double", "int64"]


@pytest.mark.parametrize("value, truth", [
    (0, False), (1, True), (0.0, False), (-0.0, False), (2.5, True), (math.nan, True)])
def test_truth(value, truth):
    assert to_bool(value) is truth


@pytest.mark.parametrize("value, reason", [
    (2, "2 is neither 0 nor 1"),
    (-1, "-1 is neither 0 nor 1"),
    (-0.5, "-0.5 is negative"),
    ("true", "no known safe conversion"),
    ("", "no known safe conversion"),
    (None, "it is empty"),
    ([1], "no known safe conversion")])
def test_what_is_neither_true_nor_false(value, reason):
    with pytest.raises(ValueFault, match=reason):
        to_bool(value)


# ---------------------------------------------------------------------------------- hostile scripts


@pytest.mark.slow
@pytest.mark.parametrize("shape", [
    "({})",
    "-({})",
    "1 || 1 && 1 == 1 | 1 & 1 + 1 * ({})",
    "a := {}",
    "a := ({})",
    "1 ? {} : 2",
    "0 ? 1 : ({})",
    "1 ? a := {} : 2"])
def test_nesting_is_limited_long_before_the_stack_ends(shape):
    before, after = shape.split("{}")
    for depth in (1, 10, 100, 1000, 100000):
        text = before * depth + "1" + after * depth
        try:
            compile_script(text).run(Blackboard(), {})
            assert depth <= 100
        except ScriptSyntaxError as error:
            assert "Nested too deeply" in str(error) and depth > 10


def test_ninety_nine_parentheses_are_fine_and_no_more():
    """Each takes two of the 200 levels, like its content; what is closed before counts no more."""
    for before in ("", "a := (1) + 2; "):
        assert run(before + "(" * 99 + "1" + ")" * 99)[0] == 1
        with pytest.raises(ScriptSyntaxError) as raised:
            compile_script(before + "(" * 100 + "1" + ")" * 100)
        assert str(raised.value
                   ) == "Nested too deeply at position {}: at most 200 levels are allowed".format(
                       len(before) + 100)


@pytest.mark.slow
@pytest.mark.parametrize("text, value", [
    ("1" + " + 1" * 20000, 20001.0),
    ("-" * 20000 + "1", 1.0),
    ("0 ? 1 : " * 20000 + "2", 2),
    ("1;" * 20000, 1),
    ("1" + " < 2 < 1" * 20000, 0.0),
    ("a := " + "9" * 1000000, 0),
    ("0." + "1" * 1000000 + " < 1", 1.0),
    ("'" + "x" * 1000000 + "' == 'x'", 0.0)])
def test_long_scripts_take_time_in_proportion(text, value):
    began = time.thread_time()
    assert run(text)[0] == value
    assert time.thread_time() - began < 5.0


def test_a_text_cannot_grow_without_end():
    assert len(run("a := '" + "x" * 999999 + "'; a += 'y'")[0]) == 1000000
    with pytest.raises(ScriptError, match="1000000 characters"):
        run("a := 'x';" + "a += a;" * 64)
    with pytest.raises(ScriptError, match="1000000 characters"):
        run("a := 'x';" + "a := a .. a;" * 64)


OPERATORS = [":=", "=", "+=", "-=", "*=", "/=", "==", "!=", "<", ">", "<=", ">=", "&&", "||", "&",
             "|", "^", "+", "*", "/", "..", "-", "? b :", "? (", ";"]
OPERANDS = ["a", "b", "none", "list", "RED", "@a", "true", "1", "0", "2.5", "1e400", "9" * 25,
            "0xff", "'x'", "- 2", "!a", "(a := 1)"]
RUBBISH = [
    "'", ".", "0x", "1.", "\u00e9", "\u0663", "\x00", "\n", "#", "{", "$", "(", ")", "?", ":", "~"]


def random_script(source):
    words = []
    for _ in range(source.randrange(1, 6)):
        words += [source.choice(OPERANDS), source.choice(OPERATORS)]
    if source.random() < 0.7:
        words.pop()
    if source.random() < 0.3:
        words.insert(source.randrange(len(words) + 1), source.choice(RUBBISH))
    return source.choice(("", " ")).join(words)


@pytest.mark.slow
def test_random_scripts_fail_cleanly_or_run():
    source = random.Random(4)
    outcomes = {"ran": 0, ScriptSyntaxError: 0, ScriptError: 0}
    began = time.thread_time()
    for _ in range(4000):
        text = random_script(source)
        try:
            run(text, ENUMS, a=1, b="b", none=None, list=[1])
            outcomes["ran"] += 1
        except (ScriptSyntaxError, ScriptError) as error:
            outcomes[type(error)] += 1
    assert time.thread_time() - began < 20.0
    assert min(outcomes.values()) > 200  # else the mixture tests too little


@pytest.mark.parametrize("script, hint", [
    ("a =< b", "write <="), ("a => b", "write >="), ("a === b", "write =="),
    ("a !== b", "write !="), ("a &&& b", "write &&"), ("a ||| b", "write ||"),
    ("a <> b", "write !="), ("a++", "write a += 1 or a -= 1"), ("a--", "write a += 1 or a -= 1"),
    (")", ""), ("a * )", ""), ("a + )", ""), ("a * ;", ""),
    ("a := 'x", "the text has no closing quote"), ("a := 5s", "a number is followed by no unit"),
    ('a := "x"', "a text needs single quotes: 'yes'"), ("a % 2", "scripts have no remainder"),
    ("a := 1, b := 2", "statements are separated by ;"), ("\u00e9", ""),
    ("{a} := 1", "a script names an entry without braces")])
def test_what_may_be_meant_instead(script, hint):
    with pytest.raises(ScriptSyntaxError) as raised:
        compile_script(script)
    assert raised.value.hint == hint
