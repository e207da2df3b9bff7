"""One small bad file for each rule, with the place, code and words of its fault, and unusual files
that must load."""
import time

import pytest

from behavior_controller.bt.loader.structure import MOST_FINDINGS, MOST_NODES
from behavior_controller.bt.loader.checks import check
from behavior_controller.bt.mission import load_mission, load_text
from behavior_controller.bt.loader.document import parse
from behavior_controller.errors import MissionError
from fault_words import unsaid
from small_missions import LEAF, REGISTRY, chain, checked, main, model, root, tree


def errors(found):
    return [fault for fault in found.faults if not fault.is_warning]


def told(text, **options):
    """Return the faults as (line, column, is warning, code)."""
    return [(fault.line, fault.column, fault.is_warning, fault.code)
            for fault in checked(text, **options).faults]


RULES = {
    # the document
    "wrong root": (
        "<Root>\n</Root>", (1, 1), "wrong-root", "first element is <Root>", "must be <root>"),
    "no tree": (root("", 'BTCPP_format="4"'), (1, 1), "no-tree", "no <BehaviorTree>"),
    "SubTree below root": (
        root(tree(LEAF) + "\n <TreeNodesModel/>\n <SubTree/>"), (6, 2), "id-missing",
        "<SubTree> lacks the attribute ID"),
    "two models": (
        root(tree(LEAF) + "\n <TreeNodesModel/>\n <TreeNodesModel/>"), (6, 2), "two-models",
        "only one <TreeNodesModel>"),
    "stray action below root": (
        root(tree(LEAF) + "\n <TreeNodesModel/>\n <Action/>"), (6, 2), "id-missing",
        "<Action> lacks the attribute ID"),
    # trees
    "tree without ID": (
        root(tree(LEAF) + "\n<BehaviorTree>{}</BehaviorTree>".format(LEAF)), (5, 1),
        "tree-without-id", "<BehaviorTree> lacks the attribute ID"),
    "reserved ID": (
        root(tree(LEAF) + "\n" + tree(LEAF, "Root")), (5, 17), "reserved-id",
        "Root is a reserved name"),
    "ID of a node": (
        root(tree(LEAF) + "\n" + tree(LEAF, "Navigate")), (5, 17), "id-of-a-node",
        "Navigate is the name of a node type"),
    "colon in an ID": (
        root(tree(LEAF) + "\n" + tree(LEAF, "a:b")), (5, 17), "id-letters",
        "the ID a:b contains ':'"),
    "empty tree": (
        root('  <BehaviorTree ID="Main"/>'), (2, 3), "tree-children",
        '<BehaviorTree ID="Main"> has 0 children', "exactly 1"),
    "two children": (
        main(LEAF + LEAF), (2, 3), "tree-children", "has 2 children", "put a Sequence around them"),
    # the main tree
    "unknown main tree": (
        root(tree(LEAF, "Mein")), (1, 24), "main-tree-unknown", "no tree Main to execute",
        "did you mean Mein?"),
    "no main tree": (
        root(tree(LEAF, "A") + tree(LEAF, "B"), 'BTCPP_format="4"'), (1, 1), "main-tree-missing",
        "main_tree_to_execute is not given", "called by no other: A, B", "name the main tree"),
    # nodes
    "unknown node": (
        main("<Navigat/>"), (3, 5), "unknown-node", "unknown node Navigat",
        "did you mean Navigate?"),
    "unknown node, other case": (
        main("<alwayssuccess/>"), (3, 5), "unknown-node", "did you mean AlwaysSuccess?"),
    "unknown explicit node": (
        main('<Action name="x"\n  ID="Navigat"/>'), (4, 3), "unknown-node", "unknown node Navigat",
        "did you mean Navigate?"),
    "explicit without ID": (
        main("<Condition/>"), (3, 5), "id-missing", "<Condition> lacks the attribute ID"),
    "ID in the compact form": (
        main('<Sequence ID="x">{}</Sequence>'.format(LEAF)), (3, 15), "id-not-allowed",
        "ID is not allowed in <Sequence>", 'write name="…"'),
    "a tree as a node": (
        root(tree("<Sub/>") + tree(LEAF, "Sub")), (3, 5), "tree-as-node",
        "Sub is a tree, not a node", '<SubTree ID="Sub"/>'),
    "a tree in a tree": (
        main("<BehaviorTree ID=\"x\">{}</BehaviorTree>".format(LEAF)), (3, 5), "tree-in-tree",
        "cannot stand inside another"),
    "an include in a tree": (
        main("<include path=\"x\"/>"), (3, 5), "unknown-node", "unknown node include",
        "directly below <root>"),
    "explicit below ReactiveSequence": (
        main('<ReactiveSequence>\n<Action ID="Navigate"/></ReactiveSequence>'), (4, 1),
        "explicit-in-reactive", "refuses <Action> directly below ReactiveSequence",
        "write <Navigate/>"),
    "two AsyncSequences": (
        main("<ReactiveSequence>{0}{0}</ReactiveSequence>".format(
        "<AsyncSequence>{}</AsyncSequence>".format(LEAF))),
        (3, 5), "two-async", "more than one AsyncSequence"),
    "decorator without a child": (
        main("<Inverter/>"), (3, 5), "decorator-children", "Inverter has 0 children", "exactly 1"),
    "decorator with two": (
        main("<Inverter>{0}{0}</Inverter>".format(LEAF)), (3, 5), "decorator-children",
        "Inverter has 2 children", "put a Sequence"),
    "control without children": (
        main("<Fallback>\n</Fallback>"), (3, 5), "no-child", "Fallback has no child"),
    "TryCatch with one": (
        main("<TryCatch>{}</TryCatch>".format(LEAF)), (3, 5), "few-children",
        "TryCatch must have at least 2 children"),
    "a leaf with a child": (
        main("<Navigate>{}</Navigate>".format(LEAF)), (3, 5), "leaf-children",
        "Navigate is a leaf"),
    "a condition with a child": (
        main("<IsVisitorDiscovered>{}</IsVisitorDiscovered>".format(LEAF)), (3, 5), "leaf-children",
        "IsVisitorDiscovered is a leaf"),
    # ports and scripts
    "unknown port": (
        main('<Typed\n  nummber="1"/>'), (4, 3), "unknown-port", "Typed has no port nummber",
        "did you mean number?"),
    "unknown port, none near": (
        main('<Typed zzz="1"/>'), (3, 12), "unknown-port",
        "its ports: number, flag, list, out, text"),
    "a number": (
        main('<Typed number="two"/>'), (3, 12), "wrong-literal",
        'port number of type int cannot be "two"'),
    "a number too large": (
        main('<Typed number="3000000000"/>'), (3, 12), "wrong-literal", "port number",
        "out of bound"),
    "a truth": (
        main('<Typed text="a"\nflag="yes"/>'), (4, 1), "wrong-literal",
        'port flag of type bool cannot be "yes"', "true false"),
    "a list": (main('<Typed list="1;;2"/>'), (3, 12), "wrong-literal", "port list"),
    "blanks around a reference": (
        main('<Typed number=" {k} "/>'), (3, 12), "wrong-literal", "port number"),
    "script syntax": (
        main('<Navigate _skipIf="a &lt;"/>'), (3, 15), "script-syntax", "the script of _skipIf",
        "position 3", "(a <)"),
    "syntax in a condition of a SubTree": (
        root(tree('<SubTree ID="S" _post="1 +"/>') + tree(LEAF, "S")), (3, 21), "script-syntax",
        "the script of _post"),
    "empty script": (
        main('<Navigate _post=""/>'), (3, 15), "script-syntax", "the script of _post",
        "Empty Script"),
    "syntax in Script": (
        main('<Script code="1 +"/>'), (3, 13), "script-syntax", "the script of code", "position 3"),
    "syntax in Precondition": (
        main('<Precondition if="("><Navigate/></Precondition>'), (3, 19), "script-syntax",
        "the script of if"),
    "a very long script": (
        main('<Script code="a:=1{}"/>'.format("+1" * 10_000)), (3, 13), "script-syntax",
        "20004 characters", "at most 20000"),
    # SubTrees
    "SubTree without ID": (
        main("<SubTree/>"), (3, 5), "id-missing", "<SubTree> lacks the attribute ID"),
    "unknown tree": (
        root(tree('<SubTree\nID="Sup"/>') + tree(LEAF, "Sub")), (4, 1), "unknown-tree",
        "there is no tree Sup", "did you mean Sub?"),
    "unknown tree, none near": (
        main('<SubTree ID="Zzz"/>'), (3, 14), "unknown-tree", "the trees: Main"),
    "SubTree of a node": (
        main('<SubTree ID="Navigate"/>'), (3, 14), "id-of-a-node", "name of a node type",
        "<Navigate/>"),
    "SubTree with a child": (
        root(tree('<SubTree ID="Sub">{}</SubTree>'.format(LEAF)) + tree(LEAF, "Sub")), (3, 5),
        "leaf-children", 'SubTree ID="Sub"> cannot have children'),
    "bad _autoremap": (
        root(tree('<SubTree ID="Sub" _autoremap="yes"/>') + tree(LEAF, "Sub")), (3, 23),
        "autoremap-value", "bool conversion"),
    "contains itself": (
        main('<SubTree ID="Main"/>'), (3, 14), "tree-circle",
        "the tree Main contains itself: Main > Main"),
    "contains itself by another": (
        root(tree('<SubTree ID="B"/>') + "\n" + tree('<SubTree ID="Main"/>', "B")), (6, 14),
        "tree-circle", "Main > B > Main"),
    # models
    "model without ID": (
        root(tree(LEAF) + "\n<TreeNodesModel>\n<SubTree/></TreeNodesModel>"), (6, 1), "id-missing",
        "lacks the attribute ID"),
    "model port without name": (
        root(tree(LEAF) + "\n" + model("<input_port/>")), (6, 1), "model-port-name",
        "<input_port> lacks the attribute name"),
    "mandatory port": (
        root(tree('<SubTree ID="S"/>') + tree(LEAF, "S") + model('<input_port name="who"/>')),
        (3, 5), "model-port-missing", "asks for the port who", 'write who="{who}"'),
    # version 3
    "SubTreePlus": (
        main('<SubTreePlus ID="X"/>'), (3, 5), "unknown-node", "unknown node SubTreePlus",
        "version 4 writes <SubTree>", "_autoremap"),
    "SequenceStar": (
        main("<SequenceStar>{}</SequenceStar>".format(LEAF)), (3, 5), "unknown-node",
        "SequenceWithMemory"),
    "explicit SequenceStar": (
        main('<Control ID="SequenceStar">{}</Control>'.format(LEAF)), (3, 14), "unknown-node",
        "SequenceWithMemory"),
    "the old spelling of Retry": (
        main("<RetryUntilSuccesful>{}</RetryUntilSuccesful>".format(LEAF)), (3, 5), "unknown-node",
        "RetryUntilSuccessful"),
    "Parallel's threshold": (
        main('<Parallel threshold="1">{}</Parallel>'.format(LEAF)), (3, 15), "unknown-port",
        "no port threshold", "success_count"),
    "BlackboardCheckInt": (
        main("<BlackboardCheckInt>{}</BlackboardCheckInt>".format(LEAF)), (3, 5), "unknown-node",
        "_skipIf"),
    "ConsumeQueue": (
        main("<ConsumeQueue>{}</ConsumeQueue>".format(LEAF)), (3, 5), "unknown-node", "LoopString"),
    "ManualSelector": (
        main("<ManualSelector>{}</ManualSelector>".format(LEAF)), (3, 5), "unknown-node",
        "Switch2"),
    # elsewhere
    "Selector": (main("<Selector>{}</Selector>".format(LEAF)), (3, 5), "unknown-node", "Fallback")}


@pytest.mark.parametrize("rule", sorted(RULES))
def test_each_rule_has_its_fault_at_its_place(rule):
    text, place, code, *words = RULES[rule]
    assert told(text) == [place + (False, code)]
    assert unsaid(words, checked(text).faults) == []


@pytest.mark.parametrize("text, place",
                         [(root(tree(LEAF, "\n:")), (2, 17)),
                          (root(tree('<SubTree ID="S" __autoremap="\n1"/>') + tree(LEAF, "S")),
                           (3, 21)), (main('<Sleep msec="\nsoon"/>'), (3, 12))],
                         ids=["fault", "warning", "fault in use"])
def test_a_value_that_begins_with_a_new_line_is_named_where_its_attribute_begins(text, place):
    assert place in [fault[:2] for fault in told(text)]


@pytest.mark.parametrize("port, entry", [
    ('number="goal"', "goal"), ('number=" {goal} "', "goal"), ('number="${goal}"', "goal"),
    ('flag="{goal"', "goal"), ('number="two words"', None), ('number="a-b"', None),
    ('flag="maybe"', None)])  # a word in place of a truth is a truth misspelt
def test_what_may_be_meant_for_an_entry_is_said_how_an_entry_is_written(port, entry):
    fault, = checked(main("<Typed {}/>".format(port))).faults
    assert fault.code == "wrong-literal"
    assert fault.hint.endswith("; an entry is written {{{}}}".format(entry)) is (entry is not None)
    assert ("an entry is written" in fault.hint) is (entry is not None)


@pytest.mark.parametrize("name, words", [
    ("", "cannot be empty"), ("1x", "cannot start with a digit"),
    ("a b", "cannot contain blanks"), ("_skipIf", "reserved"), ("ID", "reserved"),
    ("a:b", "cannot contain"), ("a\x7f", "cannot contain")])
def test_names_of_ports_in_models(name, words):
    text = root(tree(LEAF) + "\n" + model('<input_port name="{}"/>'.format(name)))
    assert told(text) == [(6, 13, False, "model-port-name")]
    assert unsaid([words], checked(text).faults) == []


WARNINGS = {
    "no format": (root(tree(LEAF), ""), (1, 1), "format-missing", 'lacks BTCPP_format="4"'),
    "another format": (root(tree(LEAF), 'BTCPP_format="3"'), (1, 7), "other-format",
                       "BTCPP_format is 3"),
    "ignored below root": (root(tree(LEAF) + "\n<Includes/>"), (5, 1), "ignored-below-root",
                           "<Includes> below <root> is ignored", "did you mean include?"),
    "a node below root": (root(tree(LEAF) + "\n<Action/>"), (5, 1), "ignored-below-root",
                          "<Action> below <root> is ignored ()"),
    "a node with an ID below root": (root(tree(LEAF) + '<TreeNodesModel/>\n<Action ID="x"/>'),
                                     (5, 1), "ignored-below-root",
                                     "<Action> below <root> is ignored"),
    "blank in an ID": (root(tree('<SubTree ID="a b"/>') + "\n" + tree(LEAF, "a b")), (5, 17),
                       "id-blanks", "the ID a b contains ' '", "4.10"),
    "dot in an ID": (root(tree('<SubTree ID="a.b"/>') + "\n" + tree(LEAF, "a.b")), (5, 17),
                     "id-blanks", "the ID a.b contains '.'"),
    "tree defined twice": (root(tree(LEAF) + "\n" + tree(LEAF)), (5, 17), "tree-twice",
                           "Main is defined again", "m.xml:2"),
    "__shared_blackboard": (root(tree('<SubTree ID="S" __shared_blackboard="true"/>')
                                 + tree(LEAF, "S")), (3, 21), "subtree-old",
                            "means nothing in version 4", '_autoremap="true"'),
    "__autoremap": (root(tree('<SubTree ID="S" __autoremap="true"/>') + tree(LEAF, "S")), (3, 21),
                    "subtree-old", "_autoremap"),
    "warning of a node type": (main("<Old/>"), (3, 5), "node-type-warning",
                               "another spelling of Navigate"),
    "unknown port in an unused tree": (root(tree(LEAF) + "\n" + tree('<Typed nummber="1"/>', "B")),
                                       (6, 12), "unknown-port", "did you mean number?"),
    "circle of unused trees": (root(tree(LEAF) + "\n" + tree('<SubTree ID="B"/>', "B")), (6, 14),
                               "tree-circle", "contains itself"),
    "bad script in an unused tree": (root(tree(LEAF) + "\n" + tree('<Script code="("/>', "B")),
                                     (6, 13), "script-syntax", "script of code")}


@pytest.mark.parametrize("rule", sorted(WARNINGS))
def test_what_loads_but_is_likely_a_mistake_is_a_warning(rule):
    text, place, code, *words = WARNINGS[rule]
    assert told(text) == [place + (True, code)]
    assert unsaid(words, checked(text).faults) == []
    assert len(load_text(text, REGISTRY).warnings) == 1


OLD_REMAPPING = tree('<SubTree ID="S" inner="outer" n="1" _x="y" yes="true"/>') + tree(LEAF, "S")


def test_version_3_remapping_without_braces_is_a_warning_in_files_that_do_not_say_4():
    old = root(OLD_REMAPPING, 'main_tree_to_execute="Main"')
    assert [fault for fault in told(old) if fault[3] != "format-missing"] == [
        (3, 21, True, "unbraced")]
    assert unsaid(['inner="outer" is the text outer in version 4 (the entry of that name is '
                   'written {outer})'], checked(old).faults) == []
    assert told(root(OLD_REMAPPING)) == []


@pytest.mark.parametrize("body", [
    '<Typed number="2 " flag="True" list="1;2;" out="{x}" text="3 rooms"/>',
    '<Typed list="json:[1, 2]" out="-1.5e3" number="007"/>',
    '<Typed number="{k}" flag="{=}" text=" = "/>',
    '<Typed xmlns:a="b" c.d="e" ü="f" _uid="7" _fullpath="x" _description="y" name="tab	and '
    '{braces}"/>', '<Control ID="Navigate"/>', '<Script code=""/>', '<Script code="{code}"/>',
    '<Script code="a:=1 b:=2"/>', '<Navigate _skipIf="1 < 2 && 3 > 2"/>',
    '<ReactiveSequence><SubTree ID="Other"/><AsyncSequence><Action ID="Navigate"/></AsyncSequence>'
    '</ReactiveSequence>', '<SubTree ID="Other" _autoremap="1" _x="{y}" a="{=}" b="=" c="2"/>',
    '<IfThenElse><AlwaysSuccess/></IfThenElse>', '<Sleep/>'])
def test_what_behaviortree_cpp_accepts_is_no_fault(body):
    assert told(root(tree(body) + tree(LEAF, "Other"))) == []


@pytest.mark.parametrize("call, inside", [
    ('<SubTree ID="S" who="1"/>', '<input_port name="who"/><MetadataFields/>'),
    ('<SubTree ID="S"/>', '<input_port name="who" default="2"/>'),
    ('<SubTree ID="S" _autoremap="1"/>', '<input_port name="who"/>')])
def test_what_a_model_asks_for_may_be_given_in_three_ways(call, inside):
    assert told(root(tree(call) + tree(LEAF, "S") + model(inside))) == []


# ------------------------------------------------------------------------------------ the main tree


TWO = tree('<SubTree ID="B"/>', "A") + "\n" + tree(LEAF, "B")


@pytest.mark.parametrize("text, strict, expected", [
    (root(TWO, 'BTCPP_format="4" main_tree_to_execute="B"'), False, "B"),
    (root(tree(LEAF, "A"), 'BTCPP_format="4"'), True, "A"),
    ("<root BTCPP_format=\"4\"><BehaviorTree>{}</BehaviorTree></root>".format(LEAF), True,
     "BehaviorTree_1"),
    (root(TWO, 'BTCPP_format="4"'), False, "A"),
    (root(TWO, 'BTCPP_format="4"'), True, "")])
def test_the_main_tree(text, strict, expected):
    found = checked(text, strict=strict)
    assert found.main == expected
    assert bool(errors(found)) == (not expected)


def test_trees_in_a_circle_leave_no_main_tree():
    text = root(
        tree('<SubTree ID="B"/>', "A") + "\n" + tree('<SubTree ID="A"/>', "B"), 'BTCPP_format="4"')
    assert told(text) == [(1, 1, False, "main-tree-missing"), (6, 14, False, "tree-circle")]
    assert "A > B > A" in checked(text).faults[1].text


def test_another_main_tree_may_be_asked_for():
    assert checked(root(TWO), main_tree="B").main == "B"
    assert [fault[:2] for fault in told(root(TWO), main_tree="C")] == [(1, 1)]


def test_a_mission_without_a_tree_runs_the_only_one_that_it_includes():
    included = parse(root(tree(LEAF, "A"), 'BTCPP_format="4"'), "lib.xml")
    found = check([included, parse('<root BTCPP_format="4"/>', "m.xml")], REGISTRY, strict=True)
    assert (found.main, found.faults) == ("A", [])


def test_the_only_tree_of_the_mission_itself_goes_before_those_it_includes():
    included, own = parse(root(TWO), "lib.xml"), parse(root(tree(LEAF, "Own"), 'BTCPP_format="4"'),
                                                       "m.xml")
    assert check([included, own], REGISTRY).main == "Own"


@pytest.mark.parametrize("tree_id", ["a b", "a.b"])
def test_strict_refuses_blanks_and_dots_as_the_library_does(tree_id):
    text = root(tree(LEAF, tree_id), 'BTCPP_format="4"')
    assert not errors(checked(text))
    refused = errors(checked(text, strict=True))
    assert [(fault.line, fault.column) for fault in refused] == [(2, 17)]


# ----------------------------------------------------------------------------------------- together


def test_every_fault_is_told_in_one_pass_in_the_order_of_the_file():
    text = root("\n".join([
        '<BehaviorTree ID="Main"><Sequence>', "<Navigat/>", '<Typed number="x" flag="y"/>',
        '<SubTree ID="Nope"/>', '<Script code="1 +"/>', "<Inverter/>", "</Sequence></BehaviorTree>",
        '<BehaviorTree ID="Unused">', "<Fallback/>", "</BehaviorTree>", '<BehaviorTree ID="a/b">',
        "<Nope/>", "</BehaviorTree>"]))
    assert [fault[:2] for fault in told(text)] == [(3, 1), (4, 8), (4, 19), (5, 10), (6, 9), (7, 1),
                                                   (10, 1), (12, 15), (13, 1)]
    with pytest.raises(MissionError) as caught:
        load_text(text, REGISTRY)
    assert [fault.line for fault in caught.value.faults] == [3, 4, 4, 5, 6, 7, 10, 12, 13]


def test_what_is_wrong_inside_a_faulty_element_is_told_too():
    text = main('<Sequnce>\n<Script/><Precondition if="("><Repeat num_cycles="x">\n<Script/>'
                '</Repeat></Precondition></Sequnce>')
    with pytest.raises(MissionError) as caught:
        load_text(text, REGISTRY)
    assert [(fault.line, fault.column)
            for fault in caught.value.faults] == [(3, 5), (4, 1), (4, 24), (4, 39), (5, 1)]


@pytest.mark.parametrize("text", [
    root(tree('<SubTree ID="S"/>') + tree(LEAF + LEAF, "S")), main(LEAF + LEAF)])
def test_a_tree_of_two_nodes_is_one_fault(text):
    with pytest.raises(MissionError) as caught:
        load_text(text, REGISTRY)
    assert [fault.code for fault in caught.value.faults] == ["tree-children"]


def test_a_tree_that_is_defined_again_is_checked_too():
    text = root(tree('<Sequence><Navigat/>\n<Typed nummber="1"/></Sequence>') + "\n" + tree(LEAF))
    assert told(text) == [(3, 15, False, "unknown-node"), (4, 8, True, "unknown-port"),
                          (6, 17, True, "tree-twice")]


def test_a_missing_file_does_not_make_its_trees_unknown(tmp_path):
    (tmp_path / "m.xml").write_text(
        root('<include path="lib.xml"/>' + tree('<SubTree ID="FromLib"/>')), encoding="utf-8")
    for missing in ("lib.xml", "deep.xml"):  # the second is included by the first
        with pytest.raises(MissionError) as caught:
            load_mission(str(tmp_path / "m.xml"), REGISTRY)
        assert [missing in fault.text for fault in caught.value.faults] == [True]
        (tmp_path / "lib.xml").write_text(root('<include path="deep.xml"/>'), encoding="utf-8")


def test_what_is_faulty_is_marked_for_the_compiler():
    found = checked(main("<Sequence><Navigat/><Navigate/></Sequence>"))
    wrong, right = found.trees["Main"].children[0].children
    assert id(wrong) in found.findings.faulty and id(right) not in found.findings.faulty


def test_trees_calls_and_use():
    found = checked(root(TWO + tree(LEAF, "C"), 'BTCPP_format="4" main_tree_to_execute="A"'))
    assert list(found.trees) == ["A", "B", "C"]
    assert [call.attributes["ID"] for call in found.calls["A"]] == ["B"]
    assert list(found.used.items()) == [("B", 1), ("A", 2)]


# --------------------------------------------------------------------- what is read in part, or not


def warned(text):
    """Return the warnings about a mission without a fault."""
    found = checked(text).faults
    assert all(fault.is_warning for fault in found)
    return found


# BehaviorTree.CPP takes the longest beginning that is a number
@pytest.mark.parametrize("body, column, rest, read_as", [
    ('<Sleep msec="2 min"/>', 12, "min", "2"),
    ('<Sleep msec="120,000"/>', 12, ",000", "120"),
    ('<Typed number="1.5"/>', 12, ".5", "1"),
    ('<Typed number="12e4"/>', 12, "e4", "12"),
    ('<Typed number="-3 {k}"/>', 12, "{k}", "-3"),
    ('<Typed out="2,5"/>', 12, ",5", "2.0"),
    ('<Typed out="1e"/>', 12, "e", "1.0"),
    ('<Typed list="1;2.5;3"/>', 12, ".5", "1;2;3"),
    ('<LoopInt queue="1;2 x" value="{v}"><Navigate/></LoopInt>', 14, "x", "1;2"),
    ('<LoopDouble queue="1,5;2" value="{v}"><Navigate/></LoopDouble>', 17, ",5", "1.0;2.0")])
def test_a_number_that_is_not_read_to_its_end_is_told_with_what_is_read(
        body, column, rest, read_as):
    fault, = warned(main(body))
    assert (fault.line, fault.column, fault.code) == (3, column, "number-cut-short")
    assert fault.text.endswith(' is read only up to "{}": as {}'.format(rest, read_as))
    load_text(main(body), REGISTRY)


UNITS = {"ms": 1, "msec": 1, "milliseconds": 1, "s": 1000, "sec": 1000, "Second": 1000,
         "seconds": 1000, "min": 60_000, "minute": 60_000, "minutes": 60_000, "H": 3_600_000,
         "hour": 3_600_000, "hours": 3_600_000}


@pytest.mark.parametrize("body, hint", [
    *[('<Sleep msec="20 {}"/>'.format(unit),
       "the number is of milliseconds: 20 {} is {}".format(unit, 20 * length))
      for unit, length in UNITS.items()],
    ('<Sleep msec="0 s"/>', "the number is of milliseconds: 0 s is 0"),
    ('<Sleep msec="1.5min"/>', "the number is of milliseconds: 1.5min is 90000"),
    ('<Sleep msec="0,5 s "/>', "the number is of milliseconds: 0,5 s  is 500"),
    ('<Sleep msec="2 rounds"/>', "the type is uint"),
    ('<Typed out="0,0"/>', "write 0.0"), ('<Typed out="1,25"/>', "write 1.25"),
    ('<Typed out="-0,5"/>', "write -0.5"), ('<Typed out="1e"/>', "the type is double"),
    ('<Typed out="1 m"/>', "the type is double"),
    ('<Typed number="0.0"/>', "the type is int: write 0"),
    ('<Typed number="0,0"/>', "the type is int: write 0"),
    ('<Typed number="3.0"/>', "the type is int: write 3"),
    ('<Typed number="12e2"/>', "the type is int: write 1200"),
    ('<Typed number="1.5"/>', "the type is int, without fraction"),
    ('<Typed number="1,5"/>', "the type is int, without fraction"),
    ('<Typed number="2 min"/>', "the type is int"),
    ('<Typed number="-1,000"/>', "a number has no separators: write -1000"),
    ('<Typed number="-12\'345 678"/>', "a number has no separators: write -12345678")])
def test_what_is_meant_by_a_number_that_is_not_read_to_its_end(body, hint):
    fault, = warned(main(body))
    assert fault.hint == hint


@pytest.mark.parametrize("queue", ["a;b", "{items}", "=", "1 a;2"])
def test_a_list_that_is_no_list_of_numbers_is_not_judged_as_one(queue):
    assert warned(
        main('<LoopString queue="{}" value="{{v}}"><Navigate/></LoopString>'.format(queue))) == []


def test_a_text_where_an_element_is_due_is_told_at_its_place():
    text = root(
        """first
  <!-- a remark -> none --><BehaviorTree ID="Main"> second &amp; <Sequence>
    <!-- not > this -->  third
    <Script code="a := 1 > 2"> fourth </Script><![CDATA[ fifth ]]><![CDATA[ ]]>
  </Sequence></BehaviorTree>&amp;
  <TreeNodesModel> of the palette <Action ID="Navigate"><input_port name="x"> description </input_port></Action>
  </TreeNodesModel>""", 'BTCPP_format="4"')
    places = {(2, 1): "first", (3, 53): "second &amp;", (4, 26): "third",
              (5, 32): "fourth", (5, 58): "fifth", (6, 29): "&amp;"}
    dropped = [fault for fault in warned(text) if fault.code == "stray-text"]
    assert [(fault.line, fault.column) for fault in dropped] == list(places)
    assert [fault.text for fault in dropped] == [
        "this text is dropped: " + said for said in places.values()]


@pytest.mark.slow
def test_texts_without_end_are_no_trouble():
    found = timed(main("<Sequence>{}</Sequence>".format("a <Navigate/>" * 20000)))
    assert 0 < len(found.faults) <= MOST_FINDINGS


# ------------------------------------------------------------------------------------------- limits


def timed(text):
    began = time.thread_time()
    found = checked(text)
    assert time.thread_time() - began < 3.0  # what it guards against takes minutes
    return found


def test_a_mission_that_unfolds_without_end_is_refused_before_it_is_built():
    fault, = errors(timed(chain(64)))
    assert fault.code == "too-large" and str(MOST_NODES) in fault.text


@pytest.mark.parametrize("more, is_taken", [(0, True), (1, False)])
def test_the_number_of_nodes_has_an_end(more, is_taken):
    # 499 nodes, and the SubTree that calls it
    called = tree("<Sequence>{}</Sequence>".format(LEAF * 498), "T")
    calls = "<Sequence>{}{}</Sequence>".format('<SubTree ID="T"/>' * 499, LEAF * (499 + more))
    found = errors(checked(root(tree(calls) + called)))
    assert [(fault.code, "250001" in fault.text)
            for fault in found] == ([] if is_taken else [("too-large", True)])


@pytest.mark.parametrize("length, is_taken", [(20_000, True), (20_001, False)])
def test_the_length_of_a_script_has_an_end(length, is_taken):
    found = checked(main('<Script code="a:={}"/>'.format("1" * (length - 3))))
    assert bool(errors(found)) is not is_taken


@pytest.mark.parametrize("faults", [999, 1000, 1001])
def test_a_thousand_faults_are_told(faults):
    found = checked(main("<Sequence>{}</Sequence>".format("<Nope/>" * faults))).faults
    assert len([fault for fault in found if fault.line]) == min(faults, 1000)
    assert [(fault.file, fault.column, fault.text) for fault in found
            if not fault.line] == [("m.xml", 0, "1 more mistakes are not shown")] * (faults > 1000)


@pytest.mark.parametrize("inside", ["<Old/>", "a text <Navigate/>"])
def test_a_thousand_warnings_are_told(inside):
    found = checked(root(tree("<Sequence>{}</Sequence>".format(inside * 1001)),
                         'main_tree_to_execute="Main"')).faults
    assert [fault.is_warning for fault in found] == [True] * 1000


@pytest.mark.parametrize("length, is_compared", [(59, True), (60, False)])
def test_a_long_name_is_compared_with_no_other(length, is_compared):
    name = "N" * (length - 1)
    text = root(tree('<SubTree ID="{}x"/>'.format(name)) + tree(LEAF, name + "y"))
    assert (name + "y?" in checked(text).faults[0].hint) is is_compared


@pytest.mark.slow
def test_thousands_of_trees_that_call_each_other_are_no_trouble():
    trees = "".join(
        '<BehaviorTree ID="T{0}"><Sequence><SubTree ID="T{1}"/>{2}</Sequence></BehaviorTree>'.
        format(
            number, number + 1, "".join('<SubTree ID="T{}"/>'.format(back)
                                        for back in range(max(0, number - 20), number)))
        for number in range(1500)) + tree(LEAF, "T1500")
    found = timed(root(trees, 'BTCPP_format="4" main_tree_to_execute="T0"'))
    assert len(errors(found)) == MOST_FINDINGS + 1 and not found.faults[-1].line


@pytest.mark.slow
@pytest.mark.parametrize("bodies", [
    ['<SubTree ID="U{}"/>'.format(number) for number in range(5000)],
    ["<Navigat{}/>".format(number) for number in range(5000)],
    ['<Typed nummber{}="1"/>'.format(number) for number in range(5000)]])
def test_thousands_of_mistakes_are_no_trouble(bodies):
    trees = "".join(tree(body, "T{}".format(number)) for number, body in enumerate(bodies))
    main_tree = tree("<Sequence>{}</Sequence>".format("".join(
        '<SubTree ID="T{}"/>'.format(number) for number in range(len(bodies)))))
    found = timed(root(main_tree + trees))
    assert len(errors(found)) == MOST_FINDINGS + 1
    assert found.faults[-1].text.split()[0] == str(len(bodies) - MOST_FINDINGS)


def test_ten_thousand_nodes_are_checked_in_a_moment():
    inner = '<Sequence name="s">' + '<AlwaysSuccess name="n"/>' * 99 + "</Sequence>"
    document = parse(main("<Sequence>{}</Sequence>".format(inner * 100)))
    began = time.thread_time()
    assert check([document], REGISTRY).faults == []
    assert time.thread_time() - began < 1.5


@pytest.mark.parametrize("body, column, code", [
    ('<Action ID="Sleep" msec="soon"/>', 24, "wrong-literal"),
    ('<Action ID="Typed" nummber="1"/>', 24, "unknown-port"),
    ('<Action ID="Navigate"><AlwaysSuccess/></Action>', 5, "leaf-children"),
    ('<Condition ID="ScriptCondition" code="1 +"/>', 37, "script-syntax"),
    ('<Decorator ID="Inverter"/>', 5, "decorator-children"),
    ('<Control ID="ReactiveSequence"/>', 5, "no-child"),
    ('<Action ID="Navigate" _skipIf="1 +"/>', 27, "script-syntax")])
def test_the_explicit_form_is_checked_as_the_compact_one(body, column, code):
    assert told(main(body)) == [(3, column, False, code)]
