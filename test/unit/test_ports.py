"""What an attribute of a node means, and reading and writing through it (BT.CPP sections 9.4, 9.5
and 10)."""
import math

import pytest

from behavior_controller.bt.engine import ports
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.engine.ports import PortError
from behavior_controller.bt.values.values import ValueFault
from behavior_controller.bt.engine.registry import Port
from behavior_controller.bt.values.status import FAILURE, IDLE, SKIPPED, SUCCESS

ENUMS = {"RED": 1, "BLUE": 3}


def port(type_name, name="p"):
    return Port(name, type_name)


def script_made(**entries):
    """Return a blackboard with entries as scripts make them."""
    board = Blackboard()
    for key, value in entries.items():
        board.create(key).replace(value)
    return board


@pytest.mark.parametrize("text, key", [
    ("{k}", "k"), (" {k}\t", "k"), ("\r\n{k}", "k"), ("{ k }", " k "), ("{=}", "p"), ("=", "p"),
    ("{@g}", "@g"), ("{}}", "}"), ("", None), ("k", None), ("{}", None), ("{k", None),
    ("a{b}c", None), (" = ", None), ("== ", None), ("\x0b{k}", None)])
def test_what_is_a_reference(text, key):
    assert ports.reference(text, "p") == key


@pytest.mark.parametrize(
    "type_name, text, accepted",
    [
        ("int", "42", True),
        ("int", "2.9abc", True),
        ("int", "x", False),
        ("int", "", False),
        ("int", " 2", False),
        ("int", "{k}", True),
        ("int", "{=}", True),
        ("int", "=", False),
        ("int", " {k} ", False),
        ("int", "{}", False),
        ("string", "=", True),
        ("string", " {k} ", True),
        ("string", "", True),
        ("int8", "300", False),
        ("uint", "-1", False),
        ("double", "+1.5", False),
        ("bool", "yes", False),
        ("vec_int", "1;;2", False),
        ("vec_int", "1;2;", True),
        # found when they are read
        ("any", "anything", True),
        ("NodeStatus", "MAYBE", True),
        ("enum", "PINK", True)])
def test_which_text_is_refused_at_load(type_name, text, accepted):
    assert (ports.literal_fault(text, port(type_name), ENUMS) is None) is accepted


@pytest.mark.parametrize("type_name, text, value", [
    ("int", "42", 42),
    ("int", "0x10", 0),
    ("string", " a b ", " a b "),
    ("string", "{}", "{}"),
    ("any", "42", "42"),
    ("double", "3", 3.0),
    ("bool", "TRUE", True),
    ("bool", "0", False),
    ("NodeStatus", "FAILURE", FAILURE),
    ("enum", "BLUE", 3),
    ("enum", "2", 2),
    ("vec_bool", "1;false", [True, False]),
    ("vec_string", "a; b ;c", ["a", " b ", "c"])])
def test_literals(type_name, text, value):
    found = ports.read(text, port(type_name), Blackboard(), ENUMS)
    assert type(found) is type(value) and found == value


@pytest.mark.parametrize("stored, type_name, value", [
    (7, "int", 7),
    (3.0, "int", 3),
    (3, "double", 3.0),
    (2**53 - 1, "double", float(2**53 - 1)),
    (1, "bool", True),
    (2.5, "bool", True),
    (0.0, "bool", False),
    (3, "string", "3"),
    (1.5, "string", "1.500000"),
    ("12x", "int", 12),
    ("1;2", "vec_int", [1, 2]),
    ("v", "string", "v"),
    (3, "any", 3),
    ([1], "any", [1]),
    ([1, 2], "vec_int", [1, 2]),
    ("RED", "enum", 1),
    (2, "enum", 2),
    ("SUCCESS", "NodeStatus", SUCCESS),
    (3, "NodeStatus", FAILURE),
    (0, "NodeStatus", IDLE),
    (4, "NodeStatus", SKIPPED),
    (255, "uint8", 255)])
def test_reading_an_entry(stored, type_name, value):
    found = ports.read("{k}", port(type_name), script_made(k=stored), ENUMS)
    assert type(found) is type(value) and found == value


@pytest.mark.parametrize("stored, type_name, reason", [
    (None, "int", "the entry [k] is empty"),
    (3.5, "int", "Invalid floating point to integer"),
    (math.inf, "int", "Invalid floating point"),
    (math.nan, "int", "Invalid floating point"),
    (2**31, "int", "outside"),
    (-1.0, "uint", "outside"),
    (256, "uint8", "outside"),
    (2**53, "double", "Loss of precision"),
    (2, "bool", "Implicit casting to bool"),
    ("yes", "bool", "bool conversion"),
    ("x", "int", "Can't convert string [x] to integer"),
    ([1], "string", "no known safe conversion"),
    (5, "vec_int", "no known safe conversion"),
    ([1.5], "vec_int", "no known safe conversion"),
    ([1], "int", "not a number"),
    (5, "NodeStatus", "outside"),
    ("PINK", "enum", "RED BLUE")])
def test_an_entry_that_cannot_be_read(stored, type_name, reason):
    with pytest.raises(PortError) as raised:
        ports.read("{k}", port(type_name, "speed"), script_made(k=stored), ENUMS)
    assert str(raised.value).startswith("port [speed]: ") and reason in str(raised.value)


def test_a_missing_entry_is_named():
    with pytest.raises(PortError, match=r"port \[p\]: the blackboard has no entry \[k\]"):
        ports.read("{k}", port("int"), Blackboard(), {})
    with pytest.raises(PortError, match="no entry"):
        ports.entry_value("a literal", "p", Blackboard())


@pytest.mark.parametrize("type_name, value, stored", [
    ("int", 4, 4),
    ("double", 4, 4.0),
    ("int", 4.0, 4),
    ("bool", True, 1),
    ("string", "x", "x"),
    ("any", [1], [1]),
    ("NodeStatus", SUCCESS, 2),
    ("vec_double", [1, 2.5], [1.0, 2.5]),
    ("vec_bool", [True], [True]),
    ("enum", 3, 3)])
def test_writing(type_name, value, stored):
    board = Blackboard()
    ports.write("{k}", port(type_name), board, value)
    found = board.get("k")
    assert type(found) is type(stored) and found == stored
    if isinstance(stored, list):
        assert [type(item) for item in found] == [type(item) for item in stored]


@pytest.mark.parametrize("type_name, text, value", [
    ("int", "5", 4), ("int", "", 4), ("int", "{k}", "4"), ("int", "{k}", 4.5),
    ("int", "{k}", 2**31), ("string", "{k}", 4), ("uint", "{k}", -1), ("vec_int", "{k}", ["x"]),
    ("vec_int", "{k}", 1), ("int", "{k}", None)])
def test_what_cannot_be_written(type_name, text, value):
    board = Blackboard()
    with pytest.raises(PortError):
        ports.write(text, port(type_name), board, value)
    assert board.local == {}


def test_an_untyped_port_declares_what_it_writes():
    board = Blackboard()
    ports.write("{k}", port("any"), board, 6)
    assert (board.local["k"].type, board.local["k"].origin) == ("int", "int")


def test_writing_what_another_port_declared():
    board = Blackboard()
    ports.declare("{k}", port("string"), board)
    with pytest.raises(PortError, match="shall not change"):
        ports.write("{k}", port("int"), board, 4)


def test_an_entry_is_emptied_through_a_port_if_there_is_one():
    board = script_made(k=5, p=6)
    for text in ("{k}", "{none}", "k"):
        ports.clear(text, port("int"), board)
    assert {key: entry.value for key, entry in board.local.items()} == {"k": None, "p": 6}
    ports.clear("{=}", port("int"), board)
    assert board.get("p") is None


# ---------------------------------------------------------------------------------- entries at load


@pytest.mark.parametrize(
    "first, then, clash",
    [
        ("int", "int", False),
        ("int", "double", True),
        ("double", "int", True),
        ("int", "string", True),
        ("string", "int", False),  # what is declared as a text first takes any type
        ("any", "int", False),
        ("int", "any", False),
        ("Any", "string", False)])
def test_types_of_ports_at_one_entry(first, then, clash):
    board = Blackboard()
    ports.declare("{k}", port(first), board)
    if clash:
        with pytest.raises(PortError,
                           match=r"\[k\] has type \[{}\].*has type \[{}\]".format(first, then)):
            ports.declare("{k}", port(then), board)
    else:
        ports.declare(" {k} ", port(then), board)
    assert (board.local["k"].type, board.local["k"].value) == (first, None)


def test_literals_and_the_port_s_own_name():
    board = Blackboard()
    ports.declare("5", port("int", "speed"), board)
    assert board.local == {}
    ports.declare("{=}", port("int", "speed"), board)
    assert list(board.local) == ["speed"]


def test_an_entry_of_the_root_is_made_there_and_at_once_means_only_that():
    root = Blackboard()
    subtree = Blackboard(root)
    ports.declare("{@g}", port("int"), subtree)
    assert list(root.local) == ["g"] and not subtree.local
    with pytest.raises(PortError, match="'@' used multiple times"):
        ports.declare("{@a@b}", port("int"), subtree)


# ------------------------------------------------------------- literals of subtrees, items of loops


@pytest.mark.parametrize("text, type_name, value", [
    ("42", "int", 42),
    ("-3", "int", -3),
    ("007", "int", 7),
    ("2147483648", "int64", 2147483648),
    ("-9223372036854775808", "int64", -2**63),
    ("9223372036854775808", "double", 9223372036854775808.0),
    ("2.5", "double", 2.5),
    ("2.0", "double", 2.0),
    (".5", "double", 0.5),
    ("2.", "double", 2.0),
    ("1e3", "double", 1000.0),
    ("inf", "double", math.inf),
    ("-Infinity", "double", -math.inf),
    ("", "string", ""),
    ("true", "string", "true"),
    ("0x10", "string", "0x10"),
    (" 5", "string", " 5"),
    ("5 ", "string", "5 "),
    ("+5", "string", "+5"),
    ("1;2", "string", "1;2"),
    ("2x", "string", "2x"),
    ("'a'", "string", "'a'"),
    ("-", "string", "-"),
    ("5\n", "string", "5\n"),
    ("\u0665", "string", "\u0665"),
    ("1e999", "string", "1e999"),
    ("=", "string", "=")])
def test_a_literal_of_a_subtree_has_the_type_that_it_looks_like(text, type_name, value):
    found_type, found = ports.subtree_literal(text)
    assert (found_type, type(found), found) == (type_name, type(value), value)


def test_a_literal_of_thousands_of_digits_is_no_integer():
    assert ports.subtree_literal("1" * 5000) == ("string", "1" * 5000)
    assert ports.subtree_literal("0" * 5000 + "1") == ("int", 1)


@pytest.mark.parametrize("text, item_type, items", [
    ("1;2;3", "int", [1, 2, 3]),
    ("ab;c d;", "string", ["ab", "c d"]),
    ("", "int", []),
    ("1.5;2", "double", [1.5, 2.0]),
    ("true;0;FALSE", "bool", [True, False, False]),
    (";", "string", [""])])
def test_the_items_of_a_loop(text, item_type, items):
    assert ports.loop_items(text, item_type) == items


@pytest.mark.parametrize("text", ["1;x", "1;;2", "json:[1,2]"])
def test_items_that_a_loop_cannot_take(text):
    with pytest.raises(ValueFault, match="to integer"):
        ports.loop_items(text, "int")


@pytest.mark.parametrize("left, right, same", [
    ("blue", "blue", True),
    ("blue", "Blue", False),
    ("02", "2", True),
    ("2.000000", "2", True),
    ("2abc", "2", False),
    ("3", "BLUE", True),
    ("3.000000", "BLUE", True),
    ("3.1", "BLUE", False),
    ("RED", "BLUE", False),
    ("RED", "2", False),
    ("2", "3", False),
    ("0.30000001", "0.3", True),
    ("0.3001", "0.3", False),
    ("-0", "0", True),
    (" 2", "2", False),
    ("", "0", False),
    ("0" * 5000 + "2", "2", True),
    ("\u0662", "2", False),
    ("2147483648", "2147483648.0", True)])
def test_what_switch_holds_for_equal(left, right, same):
    assert ports.same_text_or_number(left, right, ENUMS) is same
    assert ports.same_text_or_number(right, left, ENUMS) is same
