"""Every kind of mistake in a mission, declared once: its code, what it means, and files that have it.

A message is made through its rule; rules that only a robot's own nodes can break are declared beside their checks.
docs/faults.md, the codes that ``validateMission --ignore`` takes and the tests of each example are derived from them. The
examples are judged with the node types of the mission vocabulary.
"""
import textwrap
from typing import Dict, NamedTuple, Tuple

MARK = "▸"
"""Stands in an example before the place where the mistake is told."""


EXAMPLE_NAME = "example.xml"
"""The name of the file that an example is."""


class Rule(NamedTuple):
    """One kind of mistake. ``code`` never changes once it has been released.

    An example is the content of a tree; with a ``<BehaviorTree>`` in it, the content of ``<root>``; with a ``<root``,
    or if ``is_whole``, the file. ``beside`` is the code that such a file must have too.
    """

    code: str
    meaning: str
    examples: Tuple[str, ...] = ()
    is_warning: bool = False
    is_whole: bool = False
    beside: str = ""


RULES: Dict[str, Rule] = {}


def _add(rule: Rule) -> Rule:
    if rule.code in RULES:
        raise ValueError("the rule {} is declared twice".format(rule.code))
    RULES[rule.code] = rule
    return rule


def error(code: str, meaning: str, *examples: str) -> Rule:
    """Declare a mistake with which the mission is not run."""
    return _add(Rule(code, meaning, examples))


def _markup(code: str, meaning: str, *examples: str) -> Rule:
    return _add(Rule(code, meaning, examples, is_whole=True))


def warning(code: str, meaning: str, *examples: str) -> Rule:
    """Declare a mistake of a mission that is run."""
    return _add(Rule(code, meaning, examples, is_warning=True))


def example_file(rule: Rule, example: str) -> Tuple[str, int, int]:
    """Return an example as the text of a file, and the line and column (from 1) where the mistake is told."""
    if not rule.is_whole and "<root" not in example:
        if "<BehaviorTree" not in example:
            example = '<BehaviorTree ID="Main">\n{}\n</BehaviorTree>'.format(textwrap.indent(example, "  "))
        example = '<root BTCPP_format="4">\n{}\n</root>'.format(textwrap.indent(example, "  "))
    before = example[:example.index(MARK)]
    line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
    return example.replace(MARK, ""), line, column

# --------------------------------------------------------------------------------------------------------------- markup

EMPTY_FILE = _markup("empty-file", "The file is empty, or has nothing but blanks.", "▸", "▸ \n")
NOT_TEXT = _markup("not-text", "The file is not UTF-8 text, nor UTF-16 with its mark.",
                   "<root>\n▸\0</root>")
NO_ELEMENT = _markup("no-element", 'The file has no element; a mission begins with <root BTCPP_format="4">.',
                     "▸a mission", "▸<!-- only a remark -->")
OUTSIDE_ROOT = _markup("outside-root", "A file holds one <root>, and nothing before and after it.",
                       "▸text\n<root/>", "<root/>\n▸<root/>", "<root/>\n▸text")
NOT_CLOSED = _markup("not-closed", "A comment, a CDATA section, an instruction or a closing tag has no end.",
                     "<root>\n▸<!-- remark </root>", "<root>\n▸<![CDATA[ text </root>", "▸<?xml <root/>",
                     "<root>\n▸</root")
DOCTYPE = _markup("doctype", "A mission may not declare entities.", "▸<!DOCTYPE r [<!ENTITY a 'b'>]>\n<root/>")
INSTRUCTION = _markup("instruction", "A processing instruction is not allowed inside <root>.",
                      "<root>\n▸<?php 1 ?></root>")
STRAY_BRACKET = _markup("stray-bracket", "A < begins no tag; in text it is written &lt;.",
                        "<root>\n  1 ▸< 2</root>", "<root>\n▸<!ELEMENT a></root>")
ELEMENT_NAME = _markup("element-name", "The name of an element is not one that XML knows.",
                       "<root>\n  ▸<1a/></root>", "<root>\n  ▸<x:Sequence/></root>")
TAG_NOT_ENDED = _markup("tag-not-ended", "A tag is not ended with >.",
                        "<root>\n  ▸<Sequence\n  <Script/></root>")
STRAY_CHARACTER = _markup("stray-character", "A tag holds a character that belongs to no attribute.",
                          '<root>\n  <Sleep msec="1"▸, name="a"/></root>')
ATTRIBUTE_VALUE = _markup("attribute-value", "An attribute has no value.", "<root>\n  <Sleep ▸msec/></root>")
ATTRIBUTE_QUOTES = _markup("attribute-quotes", "The value of an attribute must stand in quotes.",
                           "<root>\n  <Sleep ▸msec=5/></root>")
ATTRIBUTE_BLANK = _markup("attribute-blank", "A blank is missing between two attributes.",
                          '<root>\n  <Sleep name="a"▸msec="5"/></root>')
QUOTE_NOT_CLOSED = _markup("quote-not-closed", "The value of an attribute has no closing quote.",
                           '<root>\n  <Sleep ▸msec="5/></root>',
                           '<root>\n  <Sleep ▸name="a>\n  <Sleep name="b"/></root>')
ATTRIBUTE_TWICE = _markup("attribute-twice", "An element has the same attribute twice.",
                          '<root>\n  <Sleep msec="5" ▸msec="6"/></root>')
ATTRIBUTE_NAME = _markup("attribute-name", "The name of an attribute is not one that XML knows.",
                         '<root>\n  <Sleep ▸1st="5"/></root>')
FORBIDDEN_CHARACTER = _markup("forbidden-character", "A character that XML does not allow.",
                              '<root>\n  <Sleep ▸name="&#7;"/></root>', "<root>\n a▸\x01</root>")
ELEMENT_NOT_CLOSED = _markup("element-not-closed", "An element is not closed, or not before the one around it is.",
                             "<root>\n  ▸<Sequence>\n</root>", "<root>\n  ▸<Sequence>\n")
CLOSES_NOTHING = _markup("closes-nothing", "A closing tag has no element that it could close.",
                         "<root>\n  <Sequence>\n  ▸</Sequenz>\n</root>", "<root>\n</root>▸</root>")
NOT_WELL_FORMED = _markup("not-well-formed", "XML that cannot be read for another reason.")
STRAY_TEXT = warning("stray-text", "A text stands where only elements count; it is dropped.",
                     '<Sequence>\n  <Sleep msec="5"/>\n  ▸Navigate\n</Sequence>',
                     '<Sleep msec="5">▸a moment</Sleep>')
TOO_LARGE = error("too-large", "The mission is larger, longer or more deeply nested than is allowed.",
                  '<Sleep ▸name="{}" msec="5"/>'.format("a" * 100_001),
                  '▸<Sleep {} msec="5"/>'.format(" ".join('_a{}=""'.format(number) for number in range(500))))

# ---------------------------------------------------------------------------------------------------------------- files

UNREADABLE_FILE = error("unreadable-file", "A file cannot be read.")
INCLUDE_WITHOUT_PATH = error("include-without-path", "<include> needs the attribute path.",
                             '▸<include/>\n<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>',
                             '<include ▸path=""/>\n<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>')
INCLUDE_UNREADABLE = error("include-unreadable", "An included file cannot be read.",
                           '<include ▸path="no_such.xml"/>\n'
                           '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>')
INCLUDE_PACKAGE = error("include-package", "The ROS package that ros_pkg names is not found.",
                        '<include ▸ros_pkg="no_such_package" path="trees.xml"/>\n'
                        '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>')
INCLUDE_CIRCLE = error("include-circle", "A file includes itself, directly or through others.",
                       '<include ▸path="{}"/>\n'
                       '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>'.format(EXAMPLE_NAME))

# ----------------------------------------------------------------------------------------------------- <root> and trees

WRONG_ROOT = error("wrong-root", "The first element must be <root>.",
                   '▸<Root BTCPP_format="4">\n<!-- <root> --></Root>')
FORMAT_MISSING = warning("format-missing", '<root> does not say BTCPP_format="4".',
                         '▸<root>\n<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n</root>')
OTHER_FORMAT = warning("other-format", "BTCPP_format is not 4; the file is read as version 4 all the same.",
                       '<root ▸BTCPP_format="3">\n<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n'
                       "</root>")
IGNORED_BELOW_ROOT = warning("ignored-below-root", "An element below <root> means nothing there.",
                             '▸<Includes path="a.xml"/>\n<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>')
TWO_MODELS = error("two-models", "A file may hold only one <TreeNodesModel>.",
                   '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel/>\n'
                   "▸<TreeNodesModel/>")
TREE_WITHOUT_ID = error("tree-without-id", "A <BehaviorTree> needs an ID, unless it is all that the file has.",
                        '▸<BehaviorTree><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel/>',
                        '<BehaviorTree ▸id="Main"><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel/>')
TREE_CHILDREN = error("tree-children", "A <BehaviorTree> must have exactly one child.",
                      '▸<BehaviorTree ID="Main"/>',
                      '▸<BehaviorTree ID="Main"><Sleep msec="5"/><Sleep msec="6"/></BehaviorTree>')
TREE_TWICE = warning("tree-twice", "A tree is defined again; the last definition counts.",
                     '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n'
                     '<BehaviorTree ▸ID="Main"><Sleep msec="6"/></BehaviorTree>')
RESERVED_ID = error("reserved-id", "A tree cannot be called Root or root.",
                    '<BehaviorTree ▸ID="Root"><Sleep msec="5"/></BehaviorTree>')
ID_OF_A_NODE = error("id-of-a-node", "A tree cannot have the name of a node type.",
                     '<BehaviorTree ▸ID="Sequence"><Sleep msec="5"/></BehaviorTree>',
                     '<SubTree ▸ID="Sequence"/>')
ID_LETTERS = error("id-letters", "The ID of a tree holds a character that is not allowed.",
                   '<BehaviorTree ▸ID="a/b"><Sleep msec="5"/></BehaviorTree>')
ID_BLANKS = warning("id-blanks", "The ID of a tree holds a blank or a dot, which BehaviorTree.CPP 4.10 refuses.",
                    '<BehaviorTree ▸ID="lab tour"><Sleep msec="5"/></BehaviorTree>',
                    '<BehaviorTree ▸ID="tour.2"><Sleep msec="5"/></BehaviorTree>')
NO_TREE = error("no-tree", "The file has neither a <BehaviorTree> nor a palette.",
                '▸<root BTCPP_format="4">\n</root>')
MAIN_TREE_UNKNOWN = error("main-tree-unknown", "The main tree does not exist.",
                          '<root BTCPP_format="4" ▸main_tree_to_execute="Mian">\n'
                          '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n</root>')
MAIN_TREE_MISSING = error("main-tree-missing", "Nothing says which of several trees is the main tree.",
                          '▸<root BTCPP_format="4">\n<BehaviorTree ID="A"><Sleep msec="5"/></BehaviorTree>\n'
                          '<BehaviorTree ID="B"><Sleep msec="5"/></BehaviorTree>\n</root>')
TREE_CIRCLE = error("tree-circle", "A tree contains itself, directly or through others.",
                    '<SubTree ▸ID="Main"/>',
                    '<BehaviorTree ID="Main"><SubTree ID="A"/></BehaviorTree>\n'
                    '<BehaviorTree ID="A"><SubTree ID="B"/></BehaviorTree>\n'
                    '<BehaviorTree ID="B"><SubTree ▸ID="A"/></BehaviorTree>')
TREE_UNUSED = warning("tree-unused", "No tree of the mission calls this tree.",
                      '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
                      '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n'
                      '▸<BehaviorTree ID="Spare"><Sleep msec="5"/></BehaviorTree>\n</root>')

# ---------------------------------------------------------------------------------------------------------------- nodes

UNKNOWN_NODE = error("unknown-node", "An element names a node type that is not known.",
                     '▸<Sequense><Sleep msec="5"/></Sequense>', '<Action ▸ID="Slep" msec="5"/>',
                     "▸<alwaysSuccess/>", '▸<Selector><Sleep msec="5"/></Selector>',
                     '▸<SequenceStar><Sleep msec="5"/></SequenceStar>', '▸<Subtree ID="Main"/>')
ID_MISSING = error("id-missing", "An explicit element, a SubTree or a model lacks the attribute ID.",
                   "▸<Action/>", "▸<SubTree/>", '<SubTree ▸id="Main"/>', '<Action ▸Id="Sleep" msec="5"/>',
                   '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n'
                   "<TreeNodesModel>\n▸<SubTree/>\n</TreeNodesModel>",
                   '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel/>\n▸<Action/>')
ID_NOT_ALLOWED = error("id-not-allowed", "The compact form of a node has no attribute ID.",
                       '<Sleep ▸ID="wait" msec="5"/>')
TREE_IN_TREE = error("tree-in-tree", "A <BehaviorTree> cannot stand inside another.",
                     '<BehaviorTree ID="Main">\n▸<BehaviorTree ID="A"><Sleep msec="5"/></BehaviorTree>\n'
                     "</BehaviorTree>")
TREE_AS_NODE = error("tree-as-node", "A tree is called as if it were a node type.",
                     '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
                     '<BehaviorTree ID="Main">\n▸<Wait/>\n</BehaviorTree>\n'
                     '<BehaviorTree ID="Wait"><Sleep msec="5"/></BehaviorTree>\n</root>')
KIND_MISMATCH = warning("kind-mismatch", "The explicit element names another kind than the node type is of.",
                        '▸<Condition ID="Sleep" msec="5"/>')
NODE_TYPE_WARNING = warning("node-type-warning", "The node type has a warning for whoever uses it.")
EXPLICIT_IN_REACTIVE = error("explicit-in-reactive", "BehaviorTree.CPP refuses the explicit form below "
                             "ReactiveSequence.",
                             '<ReactiveSequence>\n  ▸<Action ID="Sleep" msec="5"/>\n</ReactiveSequence>')
TWO_ASYNC = error("two-async", "A ReactiveSequence cannot have more than one AsyncSequence child.",
                  '▸<ReactiveSequence>\n  <AsyncSequence><Sleep msec="5"/></AsyncSequence>\n'
                  '  <AsyncSequence><Sleep msec="6"/></AsyncSequence>\n</ReactiveSequence>')
LEAF_CHILDREN = error("leaf-children", "An action, a condition or a SubTree cannot have children.",
                      '▸<Sleep msec="5"><AlwaysSuccess/></Sleep>',
                      '▸<ScriptCondition code="1 == 1"><AlwaysSuccess/></ScriptCondition>',
                      '<BehaviorTree ID="Main">\n▸<SubTree ID="A"><Sleep msec="5"/></SubTree>\n</BehaviorTree>\n'
                      '<BehaviorTree ID="A"><Sleep msec="5"/></BehaviorTree>')
DECORATOR_CHILDREN = error("decorator-children", "A decorator must have exactly one child.",
                           "▸<Inverter/>", "▸<Inverter>\n  <AlwaysSuccess/>\n  <AlwaysSuccess/>\n</Inverter>")
NO_CHILD = error("no-child", "A control must have children.", "▸<Sequence/>", "▸<Fallback>\n</Fallback>")
FEW_CHILDREN = error("few-children", "A control has fewer children than it needs.",
                     "▸<TryCatch><AlwaysSuccess/></TryCatch>")
CHILD_COUNT = warning("child-count", "With this number of children the node fails whenever it is ticked.",
                      "▸<IfThenElse><IsVisitorDiscovered/></IfThenElse>",
                      '▸<Switch2 variable="{@given}" case_1="a" case_2="b">\n  <AlwaysSuccess/>\n'
                      "  <Script code=\"@given := 'a'\"/>\n</Switch2>")
SUBSTITUTE_UNKNOWN = error("substitute-unknown", "A substitution rule names a node type that does not exist.")
NODE_BROKEN = error("node-broken", "The code of a node type fails where it makes a node.")
NODE_REFUSES = error("node-refuses", "A node cannot be made with these attributes.",
                     "▸<Script/>", "▸<ScriptCondition/>", "▸<Precondition><AlwaysSuccess/></Precondition>",
                     '▸<LoopInt value="{a}"><AlwaysSuccess/></LoopInt>',
                     "▸<SkipUnlessUpdated><AlwaysSuccess/></SkipUnlessUpdated>", "▸<WasEntryUpdated/>",
                     '▸<LoopInt queue="1;two" value="{a}"><AlwaysSuccess/></LoopInt>',
                     '<Script ▸code="{never}"/>')
SAME_PATH = error("same-path", "Two SubTrees side by side have the same name.",
                  '<BehaviorTree ID="Main"><Sequence>\n  <SubTree ID="A" name="a"/>\n'
                  '  <SubTree ID="A" ▸name="a"/>\n</Sequence></BehaviorTree>\n'
                  '<BehaviorTree ID="A"><Sleep msec="5"/></BehaviorTree>')

# ---------------------------------------------------------------------------------------------------- ports and values

UNKNOWN_PORT = error("unknown-port", "The node type has no port of this name.",
                     '<Sleep ▸time="5" msec="5"/>', '<AlwaysFailure ▸onFailure="a := 1"/>',
                     '<Parallel ▸threshold="1"><AlwaysSuccess/></Parallel>', '<Sleep ▸mesc="5" msec="6"/>',
                     '<Sleep ▸skipIf="true" msec="5"/>')
WRONG_LITERAL = error("wrong-literal", "The text cannot be a value of the port's type.",
                      '<Sleep ▸msec="soon"/>', '<Sleep ▸msec="-5"/>', '<Sleep ▸msec=""/>',
                      '<Sleep ▸msec=" {pause} "/>',
                      '<RunOnce ▸then_skip="yes"><AlwaysSuccess/></RunOnce>',
                      '<Repeat ▸num_cycles="three"><AlwaysSuccess/></Repeat>',
                      '<Repeat ▸num_cycles="3000000000"><AlwaysSuccess/></Repeat>')
NUMBER_CUT_SHORT = warning("number-cut-short", "Only the beginning of the text is read as a number.",
                           '<Sleep ▸msec="2 min"/>', '<Sleep ▸msec="120,000"/>', '<Sleep ▸msec="1.5"/>',
                           '<Sleep ▸msec="12e4"/>', '<Timeout ▸msec="10s"><Sleep msec="5"/></Timeout>',
                           '<LoopDouble ▸queue="1.5;2,5" value="{x}"><AlwaysSuccess/></LoopDouble>',
                           '<Delay ▸delay_msec="1_000"><AlwaysSuccess/></Delay>',
                           '<BehaviorTree ID="Main"><SubTree ID="Wait" ▸pause="2 min"/></BehaviorTree>\n'
                           '<BehaviorTree ID="Wait"><Sleep msec="{pause}"/></BehaviorTree>')
PORT_MISSING = warning("port-missing", "A port that the node needs is not given.",
                       "▸<Sleep/>", "▸<Repeat><IsVisitorDiscovered/></Repeat>",
                       '▸<SetBlackboard value="a"/>', '▸<Timeout><Sleep msec="5"/></Timeout>')
NAME_ARGUMENT = error("name-argument", "The name of the node is its argument, and is missing or none that it takes.",
                     "▸<SetSpeechEvent/>", '<SetSpeechEvent ▸name="on"/>')
NAME_CHOOSES_NOTHING = warning("name-chooses-nothing", "The name of the node looks as if it chose what the node does, "
                               "and does not.",
                               "<Sequence>\n  <RetrieveListOfExhibits/>\n  <SelectExhibit/>\n"
                               '  <DescribeExhibitSpeech ▸name="3"/>\n</Sequence>')
COUNT_TOO_HIGH = warning("count-too-high", "There are fewer children than the number says.",
                         '<Parallel ▸success_count="3"><AlwaysSuccess/><AlwaysSuccess/></Parallel>',
                         '<ParallelAll ▸max_failures="3"><AlwaysSuccess/><AlwaysSuccess/></ParallelAll>')
COUNT_ZERO = warning("count-zero", "A count of 0 decides the node's end whatever its children do.",
                     '<Parallel ▸success_count="0"><AlwaysSuccess/><AlwaysSuccess/></Parallel>',
                     '<Parallel ▸failure_count="0"><AlwaysSuccess/><AlwaysSuccess/></Parallel>',
                     '<ParallelAll ▸max_failures="0"><AlwaysSuccess/><AlwaysSuccess/></ParallelAll>')
NEVER_RUN = warning("never-run", "The child is never run, because the number of rounds is 0 or negative.",
                    '<Repeat ▸num_cycles="0"><IsVisitorDiscovered/></Repeat>',
                    '<RetryUntilSuccessful ▸num_attempts="-3"><IsVisitorDiscovered/></RetryUntilSuccessful>')
BRACES_ODD = warning("braces-odd", "Braces that do not make the text a reference to an entry, or to another entry "
                     "than it seems.",
                     '<SetBlackboard output_key="a" ▸value="{goal"/>',
                     '<SetBlackboard output_key="a" ▸value="goal}"/>',
                     '<SetBlackboard output_key="a" ▸value="${goal}"/>',
                     '<Sequence>\n  <Script code="goal := 1"/>\n'
                     '  <SetBlackboard output_key="a" ▸value="{ goal }"/>\n</Sequence>')
BRACES_FORGOTTEN = warning("braces-forgotten", "The text is the name of an entry, but has no braces, so that it "
                           "is only a text.",
                           "<BehaviorTree ID=\"Main\"><Sequence>\n  <Script code=\"place := 'lab'\"/>\n"
                           '  <SubTree ID="Go" ▸target="place"/>\n</Sequence></BehaviorTree>\n'
                           "<BehaviorTree ID=\"Go\"><ScriptCondition code=\"target == 'lab'\"/></BehaviorTree>",
                           "<Sequence>\n  <Script code=\"place := 'lab'\"/>\n"
                           '  <Switch2 ▸variable="place" case_1="lab" case_2="hall">\n    <AlwaysSuccess/>\n'
                           "    <AlwaysSuccess/>\n    <AlwaysFailure/>\n  </Switch2>\n</Sequence>")
SWITCH_VARIABLE = warning("switch-variable", "A Switch that compares a fixed text always chooses the same child.",
                          '<Switch2 ▸variable="answer" case_1="yes" case_2="no">\n  <AlwaysSuccess/>\n'
                          "  <AlwaysSuccess/>\n  <AlwaysFailure/>\n</Switch2>")
SWITCH_CASE = warning("switch-case", "A case of a Switch can hardly be equal to anything, or is never reached.",
                      "<Sequence>\n  <Script code=\"answer := 'yes'\"/>\n"
                      '  <Switch2 variable="{answer}" ▸case_1="yes," case_2="no">\n    <AlwaysSuccess/>\n'
                      "    <AlwaysSuccess/>\n    <AlwaysFailure/>\n  </Switch2>\n</Sequence>",
                      "<Sequence>\n  <Script code=\"answer := 'yes'\"/>\n"
                      '  <Switch2 variable="{answer}" case_1="yes" ▸case_2="yes">\n    <AlwaysSuccess/>\n'
                      "    <AlwaysSuccess/>\n    <AlwaysFailure/>\n  </Switch2>\n</Sequence>",
                      "<Sequence>\n  <Script code=\"answer := 'yes'\"/>\n"
                      "  <Switch2 variable=\"{answer}\" ▸case_1=\"'yes'\" case_2=\"no\">\n    <AlwaysSuccess/>\n"
                      "    <AlwaysSuccess/>\n    <AlwaysFailure/>\n  </Switch2>\n</Sequence>")
STATUS_UNKNOWN = warning("status-unknown", "The text is not the name of a status; the node fails when it needs it.",
                         '<Precondition if="true" ▸else="OK"><AlwaysSuccess/></Precondition>',
                         '<LoopInt queue="1;2" value="{x}" ▸if_empty="success"><AlwaysSuccess/></LoopInt>')
CONDITION_MISSPELT = warning("condition-misspelt", "An attribute that begins with _ is ignored; a condition is spelt "
                             "nearly so.",
                             '<AlwaysSuccess ▸_skipif="true"/>', '<AlwaysSuccess ▸_onSucces="a := 1"/>',
                             '<BehaviorTree ID="Main"><SubTree ID="A" ▸_autoRemap="true"/></BehaviorTree>\n'
                             '<BehaviorTree ID="A"><Sleep msec="5"/></BehaviorTree>')
AUTOREMAP_MISPLACED = warning("autoremap-misplaced", "_autoremap means something only on a <SubTree>.",
                              '<Sequence ▸_autoremap="true"><AlwaysSuccess/></Sequence>')
ENTRY_TYPE = error("entry-type", "An entry is used by ports of different types, or its name cannot be.",
                   '<Sequence>\n  <Sleep msec="{wait}"/>\n  <Repeat ▸num_cycles="{wait}"><AlwaysSuccess/></Repeat>\n'
                   "</Sequence>",
                   '<Sleep ▸msec="{@a@b}"/>',
                   '<BehaviorTree ID="Main"><SubTree ID="A" wait="5"/></BehaviorTree>\n'
                   '<BehaviorTree ID="A"><Sleep ▸msec="{wait}"/></BehaviorTree>')

# ------------------------------------------------------------------------------------------------------------ SubTrees

_PART = '\n<BehaviorTree ID="Part"><Sleep msec="5"/></BehaviorTree>'
_MODEL = ('\n<TreeNodesModel>\n  <SubTree ID="Part"><input_port name="tries"/></SubTree>\n</TreeNodesModel>')
UNKNOWN_TREE = error("unknown-tree", "A SubTree calls a tree that does not exist.",
                     '<SubTree ▸ID="Mian"/>')
AUTOREMAP_VALUE = error("autoremap-value", "_autoremap must be true or false.",
                        '<BehaviorTree ID="Main"><SubTree ID="Part" ▸_autoremap="yes"/></BehaviorTree>' + _PART)
MODEL_PORT_MISSING = error("model-port-missing", "A port that the model of the tree asks for is not given.",
                           '<BehaviorTree ID="Main">▸<SubTree ID="Part"/></BehaviorTree>' + _PART + _MODEL,
                           '<BehaviorTree ID="Main"><SubTree ID="Part" ▸trys="3"/></BehaviorTree>' + _PART + _MODEL)
MODEL_PORT_UNKNOWN = warning("model-port-unknown", "The model of the tree has no port of this name.",
                             '<BehaviorTree ID="Main"><SubTree ID="Part" tries="3" ▸trys="3"/></BehaviorTree>'
                             + _PART + _MODEL)
MODEL_PORT_NAME = error("model-port-name", "The name of a port in a model of a tree is missing or not allowed.",
                        *('<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel>\n'
                          '<SubTree ID="Main">{}</SubTree>\n</TreeNodesModel>'.format(port) for port in (
                              "▸<input_port/>", '<input_port ▸name=""/>', '<input_port ▸name="_skipIf"/>',
                              '<inout_port ▸name="1st"/>', '<output_port ▸name="a b"/>')))
SUBTREE_PORT_UNKNOWN = warning("subtree-port-unknown", "The tree uses no entry of this name.",
                               '<BehaviorTree ID="Main"><SubTree ID="Go" _autoremap="true" ▸paus="{x}"/>'
                               '</BehaviorTree>\n<BehaviorTree ID="Go"><Sequence>\n'
                               '  <Script code="pause := 5"/>\n  <ScriptCondition code="pause == 5"/>\n'
                               "</Sequence></BehaviorTree>")
SUBTREE_OLD = warning("subtree-old", "The attribute means nothing in version 4.",
                      '<BehaviorTree ID="Main"><SubTree ID="Part" ▸__shared_blackboard="true"/></BehaviorTree>'
                      + _PART,
                      '<BehaviorTree ID="Main"><SubTree ID="Part" ▸__autoremap="true"/></BehaviorTree>' + _PART)
SUBTREE_CONDITION = warning("subtree-condition", "The attribute of a SubTree is taken for an entry; a condition "
                            "begins with _.",
                            '<BehaviorTree ID="Main"><SubTree ID="Part" ▸onFailure="a := 1"/></BehaviorTree>'
                            + _PART)
UNBRACED = _add(Rule("unbraced", "Version 3 took the text for the name of an entry; version 4 takes it for a text.", (
    '<root BTCPP_format="3" main_tree_to_execute="Main">\n<BehaviorTree ID="Main"><Sequence>\n'
    "  <Script code=\"place := 'lab'\"/>\n  <SubTree ID=\"Go\" ▸target=\"location\"/>\n</Sequence></BehaviorTree>\n"
    "<BehaviorTree ID=\"Go\"><ScriptCondition code=\"target == 'lab'\"/></BehaviorTree>\n</root>",),
    is_warning=True, beside=OTHER_FORMAT.code))

# ------------------------------------------------------------------------------------------------------------- scripts

SCRIPT_SYNTAX = error("script-syntax", "A script cannot be read.",
                      '<Script ▸code="a := "/>', "<Script ▸code='a := \"yes\"'/>", '<AlwaysSuccess ▸_post=""/>',
                      '<AlwaysSuccess ▸_skipIf="(a == 1"/>', '<ScriptCondition ▸code="a =&lt; 1"/>',
                      '<Precondition ▸if="a ? 1"><AlwaysSuccess/></Precondition>', '<Script ▸code="a++"/>',
                      "<Script ▸code=\"a := 'yes\"/>", '<Script ▸code="a := 5ms"/>', '<Script ▸code="a := b % 2"/>',
                      '<Script ▸code="a := 1, b := 2"/>', '<ScriptCondition ▸code="a === 1"/>')
SCRIPT_WORD = warning("script-word", "A word that other languages know means nothing in a script.",
                      '<ScriptCondition ▸code="not @seen" _onSuccess="@seen := true"/>',
                      '<ScriptCondition ▸code="@a == 1 and @b == 2" _post="@a := 1; @b := 1"/>',
                      '<ScriptCondition ▸code="@a == 1 or @b == 2" _post="@a := 1; @b := 1"/>',
                      '<Script ▸code="@a := True"/>', '<ScriptCondition ▸code="@a != null" _post="@a := 1"/>')
SCRIPT_NO_EFFECT = warning("script-no-effect", "A statement is evaluated, and its value is used for nothing.",
                           '<ScriptCondition ▸code="@a == 1 @b == 2" _post="@a := 1; @b := 1"/>',
                           '<Sequence>\n  <Script code="a := 1"/>\n  <Script ▸code="a == 2"/>\n</Sequence>',
                           '<Sequence>\n  <Script code="a := 1"/>\n'
                           '  <AlwaysSuccess ▸_onSuccess="a == 2"/>\n</Sequence>')
CONDITION_ASSIGNS = warning("condition-assigns", "A condition assigns a value instead of comparing with it.",
                            '<Sequence>\n  <Script code="a := true"/>\n  <AlwaysSuccess ▸_skipIf="a = false"/>\n'
                            "</Sequence>", '<ScriptCondition ▸code="a := 1"/>',
                            '<Sequence>\n  <Script code="a := 1"/>\n'
                            '  <Precondition ▸if="a = 2"><AlwaysSuccess/></Precondition>\n</Sequence>')
NOT_CREATED = warning("not-created", "An entry is assigned, and nothing creates it; := does.",
                      '<Script ▸code="count = 1"/>', '<Script ▸code="count += 1"/>',
                      '<Sequence>\n  <Script code="count := 0"/>\n  <Script ▸code="cuont += 1"/>\n</Sequence>',
                      '<AlwaysSuccess ▸_onSuccess="@done = true"/>')
TEXT_AND_NUMBER = warning("text-and-number", "A text is compared or calculated with a number.",
                          "<Sequence>\n  <Script code=\"answer := 'yes'\"/>\n"
                          '  <ScriptCondition ▸code="answer == 1"/>\n</Sequence>',
                          '<Sequence>\n  <Script code="count := 1"/>\n'
                          "  <ScriptCondition ▸code=\"count == 'one'\"/>\n</Sequence>",
                          "<Script ▸code=\"a := 'room' + 1\"/>", "<ScriptCondition ▸code=\"'yes' == 1\"/>")
KIND_CHANGES = warning("kind-changes", "An entry that holds a text is assigned a number, or the reverse.",
                       "<Script ▸code=\"a := 'yes'; a := 1\"/>",
                       "<Sequence>\n  <Script code=\"a := 1\"/>\n  <Script ▸code=\"a = 'one'\"/>\n</Sequence>")

# ----------------------------------------------------------------------------------------------------------------- data

NEVER_WRITTEN = warning("never-written", "An entry is read, and nothing writes it.",
                        '<Sleep ▸msec="{pause}"/>', '<ScriptCondition ▸code="lives > 1"/>',
                        '<Sequence>\n  <Script code="lifes := 1"/>\n'
                        '  <AlwaysSuccess ▸_skipIf="lives == 0"/>\n</Sequence>',
                        "▸<Navigate/>", "▸<DescribeExhibitSpeech/>",
                        '<SkipUnlessUpdated ▸entry="goal"><AlwaysSuccess/></SkipUnlessUpdated>',
                        '<BehaviorTree ID="Main"><Sequence>\n  <Script code="seen := 1"/>\n'
                        '  <SubTree ID="A"/>\n</Sequence></BehaviorTree>\n'
                        '<BehaviorTree ID="A"><ScriptCondition ▸code="seen == 1"/></BehaviorTree>',
                        '<BehaviorTree ID="Main"><Sequence>\n  <SubTree ID="A"/>\n'
                        '  <ScriptCondition ▸code="@seen == 1"/>\n</Sequence></BehaviorTree>\n'
                        '<BehaviorTree ID="A"><Script code="seen := 1"/></BehaviorTree>')
ENTRY_MISSPELT = warning("entry-misspelt", "A SubTree is given an entry that is named nowhere else, but nearly so.",
                         '<BehaviorTree ID="Main"><Sequence>\n  <Script code="place := \'lab\'"/>\n'
                         '  <SubTree ID="Go" ▸target="{plce}"/>\n</Sequence></BehaviorTree>\n'
                         '<BehaviorTree ID="Go"><ScriptCondition code="target == \'lab\'"/></BehaviorTree>')
# -------------------------------------------------------------------------------------------------------------- outcome

NEVER_REACHED = warning("never-reached", "A node is never ticked, because of how the one before it ends.",
                        '<Fallback>\n  <AlwaysSuccess/>\n  ▸<Sleep msec="5"/>\n</Fallback>',
                        '<Sequence>\n  <AlwaysFailure/>\n  ▸<Sleep msec="5"/>\n</Sequence>',
                        "<Sequence>\n  <KeepRunningUntilFailure><IsVisitorDiscovered/></KeepRunningUntilFailure>\n"
                        '  ▸<Sleep msec="5"/>\n</Sequence>')
NEVER_REPEATS = warning("never-repeats", "A repeat or retry whose child never ends as it would have to.",
                        '▸<RetryUntilSuccessful num_attempts="3"><Sleep msec="5"/></RetryUntilSuccessful>',
                        '▸<Repeat num_cycles="3"><AlwaysFailure/></Repeat>')
NEVER_WAITS = warning("never-waits", "A node repeats forever, and nothing in it waits.",
                      '<Repeat ▸num_cycles="-1"><AlwaysSuccess/></Repeat>',
                      '<RetryUntilSuccessful ▸num_attempts="-1"><IsVisitorDiscovered/></RetryUntilSuccessful>')
RECOVERY_MISPLACED = warning("recovery-misplaced", "A recovery stands where there is no failure before it.",
                             "<Sequence>\n  <IsVisitorDiscovered/>\n  ▸<HandleFallBack/>\n</Sequence>",
                             "<Fallback>\n  ▸<HandleFallBack/>\n  <IsVisitorDiscovered/>\n</Fallback>")

# -------------------------------------------------------------------------------------------------------------- palette

_TREE = '<BehaviorTree ID="Main"><Sleep msec="5"/></BehaviorTree>\n<TreeNodesModel>\n  {}\n</TreeNodesModel>'
PALETTE_UNKNOWN_NODE = warning("palette-unknown-node", "The palette has a node type that is not known.",
                               _TREE.format('<Action ▸ID="WelcomSpeech"/>'))
PALETTE_KIND = warning("palette-kind", "The palette has a node type as of another kind.",
                       _TREE.format('▸<Condition ID="Sleep"/>'))
PALETTE_PORT = warning("palette-port", "The palette has a port that the node type lacks.",
                       _TREE.format('<Action ID="Sleep"><input_port ▸name="time"/></Action>'))
PALETTE_DIRECTION = warning("palette-direction", "The palette has a port with another direction.",
                            _TREE.format('<Action ID="Sleep">▸<output_port name="msec"/></Action>'))
