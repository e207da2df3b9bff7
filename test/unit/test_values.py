"""Text becomes a value and a value another as in BehaviorTree.CPP (sections 9.1 and 9.5); what
cannot be says why."""
import math
import time

import pytest

from behavior_controller.bt.values import values
from behavior_controller.bt.values.values import TYPES, ValueFault
from behavior_controller.bt.values.status import IDLE, RUNNING, SKIPPED

ENUMS = {"RED": 1}


@pytest.mark.parametrize("type_name, text, value", [
    ("int", "42", 42),
    ("int", "-42", -42),
    ("int", "2.9abc", 2),
    ("int", "0x10", 0),
    ("int", "2147483647", 2147483647),
    ("int", "-2147483648", -2147483648),
    ("int", "0" * 5000 + "7", 7),
    ("uint", "3000000000", 3000000000),
    ("int8", "-128", -128),
    ("uint8", "255", 255),
    ("int64", "9007199254740993", 9007199254740993),
    ("uint64", "18446744073709551615", 2**64 - 1),
    ("double", "2.5m", 2.5),
    ("double", ".5", 0.5),
    ("double", "-1.5e-3", -0.0015),
    ("double", "1e", 1.0),
    ("double", "1.", 1.0),
    ("double", "INF", math.inf),
    ("double", "-infinity", -math.inf),
    ("double", "1e2.5", 100.0),
    ("bool", "True", True),
    ("bool", "FALSE", False),
    ("bool", "False", False),
    ("string", " a\tb ", " a\tb "),
    ("enum", "RED", 1),
    ("enum", "-5", -5),
    ("NodeStatus", "IDLE", IDLE),
    ("NodeStatus", "SKIPPED", SKIPPED),
    ("vec_int", "", []),
    ("vec_int", "1;2;-3;", [1, 2, -3]),
    ("vec_int", "json:[4, 5]", [4, 5]),
    ("vec_int", "json: []", []),
    ("vec_double", "json:[1, 2.5]", [1.0, 2.5]),
    ("vec_bool", "json:[true]", [True]),
    ("vec_string", 'json:["a;b"]', ["a;b"])])
def test_from_text(type_name, text, value):
    found = TYPES[type_name].from_text(text, ENUMS)
    assert type(found) is type(value) and found == value
    if isinstance(value, list):
        assert [type(item) for item in found] == [type(item) for item in value]


@pytest.mark.parametrize("type_name, text, reason", [
    ("int", "", "Can't convert string [] to integer"),
    ("int", "x10", "[x10] to integer"),
    ("int", " 2", "[ 2] to integer"),
    ("int", "+2", "[+2] to integer"),
    ("int", "\u0662", "to integer"),
    ("int", "-", "to integer"),
    ("int", "2147483648", "out of bound"),
    ("int", "-2147483649", "out of bound"),
    ("int", "9" * 5000, "out of bound"),
    ("int", "-" + "9" * 5000, "out of bound"),
    ("int64", "9223372036854775808", "out of bound"),
    ("int8", "300", "-128 to 127"),
    ("uint", "-1", "Can't convert string [-1] to integer"),
    ("uint", "4294967296", "out of bound"),
    ("double", "abc", "to double"),
    ("double", "+1.5", "to double"),
    ("double", " 1", "to double"),
    ("double", ".", "to double"),
    ("double", "\u0131nf", "to double"),
    ("double", "1e999", "out of bound"),
    ("double", "9" * 400 + "e5", "out of bound"),
    ("bool", "2", "0 1 true false"),
    ("bool", "tRue", "invalid bool"),
    ("bool", " true", "invalid bool"),
    ("bool", "", "invalid bool"),
    ("enum", "PINK", "known names: RED"),
    ("enum", "1x", "enum"),
    ("enum", "1" * 5000, "enum"),
    ("NodeStatus", "MAYBE",
     "Cannot convert this to NodeStatus: MAYBE; allowed: IDLE RUNNING SUCCESS FAILURE SKIPPED"),
    ("vec_int", "1;;2", "[] to integer"),
    ("vec_int", "json:[1", "JSON"),
    ("vec_int", "json:{}", "JSON array"),
    ("vec_int", 'json:["1"]', "Expected `int`, got `str`"),
    ("vec_int", "json:[1.5]", "Expected `int`, got `float`"),
    ("vec_int", "json:[true]", "Expected `int`, got `bool`"),
    ("vec_bool", "json:[1]", "Expected `bool`, got `int`"),
    ("vec_int", "json:[2147483648]", "outside"),
    ("vec_double", "json:[null]", "got `null`"),
    ("vec_int", "json:" + "[" * 100000, "JSON"),
    ("vec_int", "json:[" + "9" * 5000 + "]", "")])
def test_text_that_cannot_be_converted(type_name, text, reason):
    with pytest.raises(ValueFault) as raised:
        TYPES[type_name].from_text(text, ENUMS)
    assert reason in str(raised.value)
    assert len(str(raised.value)) < 250 and "\n" not in str(raised.value)


# of the C++ types, on which the library's converters and casts depend
LIMITS = {
    "int": (-2**31, 2**31 - 1), "uint": (0, 2**32 - 1), "int8": (-128, 127), "uint8": (0, 255),
    "int64": (-2**63, 2**63 - 1), "uint64": (0, 2**64 - 1), "enum": (-2**31, 2**31 - 1)}


@pytest.mark.parametrize("type_name", sorted(LIMITS))
def test_the_limits_of_the_integers(type_name):
    low, high = LIMITS[type_name]
    for limit in (low, high):
        assert TYPES[type_name].from_text(str(limit), {}) == limit
        assert values.convert(limit, type_name, {}) == limit
    for beyond in (low - 1, high + 1):
        with pytest.raises(ValueFault):
            TYPES[type_name].from_text(str(beyond), {})
        with pytest.raises(ValueFault):
            values.convert(beyond, type_name, {})


@pytest.mark.parametrize("text", ["{}", "1;{}", "json:[{}]"])
def test_the_limits_of_the_items_of_a_vector(text):
    low, high = LIMITS["int"]
    for limit in (low, high):
        assert TYPES["vec_int"].from_text(text.format(limit), {})[-1] == limit
    for beyond in (low - 1, high + 1):
        with pytest.raises(ValueFault):
            TYPES["vec_int"].from_text(text.format(beyond), {})


def test_a_real_becomes_an_integer_of_64_bits_where_one_is_stored():
    assert values.same_kind(-2.0 ** 63, 1) == -2 ** 63
    assert values.same_kind(2.0 ** 62, 1) == 2 ** 62
    for beyond in (2.0 ** 63, -2.0 ** 63 - 2048):  # the next real below
        with pytest.raises(ValueFault):
            values.same_kind(beyond, 1)


@pytest.mark.parametrize("whole", [2 ** 53 - 1, 1 - 2 ** 53])
def test_an_integer_is_a_real_as_long_as_every_neighbour_is_one(whole):
    assert values.to_real(whole) == whole
    with pytest.raises(ValueFault):
        values.to_real(whole + (1 if whole > 0 else -1))


@pytest.mark.parametrize("value, text", [
    (3, "3"), (-3, "-3"), (2.0, "2.000000"), (1e-9, "0.000000"), ("x", "x"), (math.inf, "inf")])
def test_to_text(value, text):
    assert values.to_text(value) == text


@pytest.mark.parametrize("value, stored, result", [
    (2.0, 1, 2), (2, 1.5, 2.0), (5, 4, 5), ("b", "a", "b"), (2.5, None, 2.5), ([1], [2], [1])])
def test_a_value_takes_the_kind_that_is_stored(value, stored, result):
    found = values.same_kind(value, stored)
    assert type(found) is type(result) and found == result


@pytest.mark.parametrize("value, stored", [
    (2.5, 1), (math.nan, 1), (1e300, 1), (2 ** 53, 1.0), ("2", 1), (1, "2"), ([1], 1), (None, 1)])
def test_a_value_that_cannot_take_the_kind_that_is_stored(value, stored):
    with pytest.raises(ValueFault):
        values.same_kind(value, stored)


@pytest.mark.parametrize("value, held", [
    (True, 1), (False, 0), (RUNNING, 1), (SKIPPED, 4), (IDLE, 0), (2.5, 2.5), ("x", "x")])
def test_how_an_entry_holds_a_value(value, held):
    assert type(values.stored(value)) is type(held) and values.stored(value) == held


@pytest.mark.parametrize("text, line", [
    ("plain", "plain"),
    ("two\n\tlines", "two lines"),
    ("", ""),
    ("x" * 80, "x" * 80),
    ("x" * 81, "x" * 41 + " \u2026 " + "x" * 36),
    (" 2", " 2"),
    ("\x0c", "\\x0c"),
    ("a\x00b", "a\\x00b"),
    ("caf\u00e9", "caf\u00e9")])
def test_how_a_message_quotes_a_text(text, line):
    assert values.shown(text) == line


@pytest.mark.parametrize("type_name, text, rest", [
    ("int", "2 min", "min"), ("int", "12", ""), ("int", "x", ""), ("double", "1e", "e"),
    ("string", "2 min", ""), ("vec_int", "1;2.5;3 x", ".5"), ("vec_double", "1.5;2", ""),
    ("vec_int", "json:[1.5]", ""), ("vec_bool", "1 x", "")])
def test_what_is_passed_over_after_a_number(type_name, text, rest):
    assert values.unread(text, type_name) == rest


@pytest.mark.slow
def test_huge_texts_take_no_time():
    began = time.thread_time()
    for text in ("1" * 1000000, "1" * 1000000 + ".5", "0" * 1000000 + "1", "x" * 1000000):
        for type_name in ("int", "double", "bool", "enum"):
            try:
                TYPES[type_name].from_text(text, {})
            except ValueFault:
                pass
    assert time.thread_time() - began < 2.0
