"""Entries by name: where a key leads, what a write may change, and how often it was written (BT.CPP
section 9)."""
import pytest

from behavior_controller.bt.values.blackboard import Blackboard, Entry
from behavior_controller.bt.values.values import ValueFault
from behavior_controller.bt.values.status import RUNNING


def chain(*levels):
    """Return one blackboard for each level below a root; a level is a dict of remappings or "auto".
    """
    boards = [Blackboard()]
    for remappings in levels:
        board = Blackboard(boards[-1])
        if remappings == "auto":
            board.autoremap = True
        else:
            for inner, outer in remappings.items():
                board.remapping[inner] = outer
        boards.append(board)
    return boards


def contents(board):
    return {key: entry.value for key, entry in board.local.items()}


# -------------------------------------------------------------------------------- where a key leads


@pytest.mark.parametrize("levels, key, leads_to", [
    ([], "x", (0, "x")),
    ([{}], "x", (1, "x")),                                   # isolated unless remapped
    ([{"x": "y"}], "x", (0, "y")),
    ([{"x": "y"}], "y", (1, "y")),
    ([{"a": "top"}, {"b": "a"}, {"c": "b"}], "c", (0, "top")),
    ([{"a": "top"}, {}], "a", (2, "a")),                     # a broken chain
    (["auto"], "x", (0, "x")),
    (["auto"], "_x", (1, "_x")),                             # private keys stay
    (["auto", "auto"], "x", (0, "x")),
    ([{}, "auto"], "x", (1, "x")),                           # each level decides for itself
    ([{}, {}], "@x", (0, "x")),
    ([{"_p": "y"}], "_p", (0, "y")),                         # an explicit remapping leads anywhere
    ([{}, {"x": "@y"}], "x", (0, "y"))])
def test_where_an_entry_is_made_and_found(levels, key, leads_to):
    boards = chain(*levels)
    assert boards[-1].find(key) is None
    made = boards[-1].create(key)
    level, name = leads_to
    assert boards[level].local == {name: made}
    assert all(not board.local for index, board in enumerate(boards) if index != level)
    assert boards[-1].find(key) is made


def test_a_root_has_nowhere_to_lead_to():
    root = Blackboard()
    root.autoremap = True
    root.remapping["x"] = "y"
    assert root.find("x") is None and root.root is root
    root.set("x", 1)
    assert contents(root) == {"x": 1}


def test_what_is_stored_here_hides_what_is_remapped():
    root, board = chain({"x": "y"})
    root.set("y", 1)
    board.local["x"] = Entry("any", board)
    board.local["x"].replace(2)
    assert board.get("x") == 2 and root.get("y") == 1


def test_a_global_blackboard_is_the_root_even_of_the_mission():
    outside = Blackboard()
    mission = Blackboard(outside)
    subtree = Blackboard(mission)
    subtree.set("@g", 6)
    assert contents(outside) == {"g": 6} and mission.get("g") is None and subtree.get("@g") == 6


def test_get_answers_the_default_for_no_entry_and_an_empty_one():
    board = Blackboard()
    board.create("empty")
    assert board.get("empty") is None and board.get("empty", 7) == 7 and board.get("none", 8) == 8


@pytest.mark.parametrize("first, then, clash", [
    ("int", "int", False), ("any", "int", False), ("int", "any", False), ("Any", "double", False),
    ("int", "double", True), ("string", "int", True)])
def test_a_strong_type_is_declared_once(first, then, clash):
    board = Blackboard()
    entry = board.create("k", first)
    if clash:
        with pytest.raises(
                ValueFault,
                match=r"\[k\]: once declared.*\[{}\], current type \[{}\]".format(first, then)):
            board.create("k", then)
    else:
        assert board.create("k", then) is entry
    assert entry.type == first


# ------------------------------------------------------------------------------------------ writing


@pytest.mark.parametrize("value, declared", [
    (2 ** 31 - 1, "int"), (-2 ** 31, "int"), (2 ** 31, "int64"), (-2 ** 31 - 1, "int64"),
    (1.5, "double"), (True, "bool"), ("text", "any"), ([1], "list")])
def test_the_first_write_declares_the_type_except_a_text(value, declared):
    board = Blackboard()
    board.set("k", value)
    assert board.local["k"].type == declared and board.get("k") == value


def test_the_second_text_declares_a_text():
    board = Blackboard()
    board.set("k", "one")
    board.set("k", "two")
    assert board.local["k"].type == "string"
    with pytest.raises(ValueFault, match="shall not change"):
        board.set("k", 3)


def test_a_truth_and_a_status_are_stored_as_integers():
    board = Blackboard()
    board.set("truth", True)
    board.set("status", RUNNING, "NodeStatus")
    assert [(type(entry.value), entry.value) for entry in board.local.values()] == [(int, 1),
                                                                                    (int, 1)]


@pytest.mark.parametrize("declared, value, value_type, stored", [
    ("int", 2.0, "double", 2.0),     # the first value of an empty entry is taken as it is
    ("double", 2, "int", 2),
    ("int", "42", "string", 42),
    ("int", "42x", "string", 42),
    ("bool", "true", "string", 1),
    ("double", "2.5", "string", 2.5),
    ("uint8", 255, "int", 255),
    ("vec_int", "1;2", "string", [1, 2]),
    ("vec_int", [1, 2], None, [1, 2]),
    ("vec_double", [], None, []),
    ("string", "x", "string", "x"),
    ("int64", 5, "int", 5)])
def test_what_an_empty_typed_entry_takes(declared, value, value_type, stored):
    board = Blackboard()
    board.create("k", declared)
    board.set("k", value, value_type)
    entry = board.local["k"]
    assert (type(entry.value), entry.value, entry.type) == (type(stored), stored, declared)


@pytest.mark.parametrize("declared, value, value_type", [
    ("int", 2.5, "double"), ("int", 2**31, "int64"), ("uint", -1, "int"), ("uint8", 300, "int"),
    ("int", "x", "string"), ("int8", 200, "int"), ("double", 2**53 + 1, "int64"),
    ("bool", 1, "int"), ("string", 1, "int"), ("vec_int", [1.5], None), ("vec_int", ["1"], None),
    ("vec_int", [True], None), ("int", [1], None), ("list", "x", "string")])
def test_what_a_typed_entry_refuses(declared, value, value_type):
    board = Blackboard()
    entry = board.create("k", declared)
    with pytest.raises(ValueFault):
        board.set("k", value, value_type)
    assert entry.value is None and entry.sequence == 0


def test_the_stored_kind_stays():
    board = Blackboard()
    board.create("k").replace(1.5)  # as a script makes it
    board.local["k"].type = "int"   # and a port declared it before
    board.set("k", 4, "int")
    assert type(board.get("k")) is float and board.get("k") == 4.0


def test_a_generic_entry_takes_the_writer_s_type_and_value():
    board = Blackboard()
    board.create("k").replace("text")
    board.set("k", 4, "int")
    assert (board.get("k"), board.local["k"].type, board.local["k"].origin) == (4, "int", "int")


def test_writing_through_a_remapping_replaces_the_kind():
    root, board = chain({"i": "o"})
    root.create("o").replace(1.5)
    board.set("i", 4, "int")
    assert type(root.get("o")) is int and contents(board) == {}


def test_writing_through_a_remapping_respects_the_type():
    root, board = chain({"i": "o"})
    root.create("o", "string")
    with pytest.raises(ValueFault, match=r"\[o\]: once declared.*\[string\], current type \[int\]"):
        board.set("i", 4, "int")


@pytest.mark.parametrize("value, value_type, origin", [
    (4, "int", "int"), (True, "bool", "bool"), (3, None, "int"), (1.5, None, "double"),
    ("x", None, "string"), (3000000000, "uint", "uint"), ([3], "vec_int", "vec_int")])
def test_a_value_remembers_what_it_was(value, value_type, origin):
    board = Blackboard()
    board.set("k", value, value_type)
    assert board.local["k"].origin == origin
    declared = Blackboard()
    declared.create("k", board.local["k"].type).replace(value, origin)
    declared.set("k", value, value_type)
    assert declared.local["k"].origin == origin


def test_a_text_that_an_entry_converts_is_of_the_entry_s_type():
    board = Blackboard()
    board.create("k", "int")
    board.set("k", "7")
    assert board.local["k"].origin == "int"


# ------------------------------------------------------ SetBlackboard and UnsetBlackboard use these


def test_a_value_of_any_type_must_be_of_the_entry_s_own():
    board = Blackboard()
    board.create("k", "int")
    with pytest.raises(ValueFault, match=r"\[int\], current type \[Any\]"):
        board.set_any("k", 5, "int64")  # a script's integer into an int
    board.set_any("k", 5, "int")
    assert board.get("k") == 5


def test_a_new_entry_gets_the_type_of_what_is_copied():
    board = Blackboard()
    board.set_any("k", "42", "string")
    board.set_any("@j", 2.5, "double")
    assert [(entry.type, entry.value) for entry in board.local.values()] == [("string", "42"),
                                                                             ("double", 2.5)]


def test_a_text_empties_an_entry_of_generic_type():
    board = Blackboard()
    entry = board.create("k")
    entry.replace(1)
    assert entry.from_text("42") is None  # a generic type knows no conversion
    board.set_any("k", entry.from_text("42"), entry.type)
    assert (entry.value, entry.type, entry.sequence) == (None, "Any", 2)


def test_an_entry_of_the_root_is_written_as_the_root_itself_would():
    root, board = chain({})
    root.create("k").replace(1)
    board.set_any("@k", 5, "int64")
    board.set("@text", "one")
    board.set("@text", "two")
    assert [(key, entry.type) for key, entry in root.local.items()] == [("k", "Any"),
                                                                        ("text", "string")]


def test_unset_reaches_the_local_storage_alone():
    root, board = chain({"i": "x"})
    root.set("x", 1)
    board.unset("i")
    board.unset("@x")
    board.unset("nothing")
    assert contents(root) == {"x": 1}
    root.unset("x")
    assert root.find("x") is None
    root.set("x", "of another type")


# ----------------------------------------------------------------------------------------- counting


def test_every_write_counts():
    board = Blackboard()
    entry = board.create("k")
    assert entry.sequence == 0 and board.writes == 0
    board.set("k", 1)
    board.set("k", 1)
    entry.update(2)
    board.set_any("k", 3, "int")
    assert entry.sequence == 4 and board.writes == 4
    entry.clear()
    assert entry.sequence == 5 and board.writes == 5
    board.unset("k")
    assert board.writes == 6
    board.unset("k")  # there is nothing left to remove
    assert board.writes == 6


def test_a_refused_write_does_not_count():
    board = Blackboard()
    board.set("k", 1)
    with pytest.raises(ValueFault):
        board.local["k"].update("text")
    with pytest.raises(ValueFault):
        board.local["k"].update(1.5)
    assert board.local["k"].sequence == 1 and board.get("k") == 1
