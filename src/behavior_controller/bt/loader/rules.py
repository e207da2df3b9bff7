"""Every kind of mistake in a mission, declared once: its code (``NO_CHILD`` is ``no-child``) and
what it means.

A mistake is reported through its rule. docs/faults.md and the codes that ``validateMission
--ignore`` takes are derived from them; test/fixtures/mistakes.txt has missions with each mistake,
and missions beside them that have none.
"""
from dataclasses import dataclass
from functools import partial
from typing import Any, Dict, Mapping


@dataclass(eq=False)
class LintRule:
    """One kind of mistake; with an error the mission is not run. ``code`` is the name of the
    constant in small letters with hyphens, and never changes once it has been released."""

    meaning: str
    is_warning: bool
    is_late: bool = False  # BehaviorTree.CPP notices it only when it makes a node
    code: str = ""


error = partial(LintRule, is_warning=False)
late = partial(error, is_late=True)
warning = partial(LintRule, is_warning=True)

# ------------------------------------------------------------------------------------------- markup

EMPTY_FILE = error("The file holds nothing but blanks.")
NOT_TEXT = error("The file is not UTF-8 text, nor UTF-16 with its mark.")
NO_ELEMENT = error("The file has no element.")
OUTSIDE_ROOT = error("Something stands outside <root>.")
NOT_CLOSED = error("A comment, CDATA section, instruction or closing tag has no end.")
DOCTYPE = error("A mission may not declare entities.")
INSTRUCTION = error("A processing instruction stands inside <root>.")
STRAY_BRACKET = error("A < begins no tag.")
ELEMENT_NAME = error("XML does not allow this name of an element.")
TAG_NOT_ENDED = error("A tag has no >.")
STRAY_CHARACTER = error("A character in a tag belongs to no attribute.")
ATTRIBUTE_VALUE = error("An attribute has no value.")
ATTRIBUTE_QUOTES = error("A value stands outside quotes.")
ATTRIBUTE_BLANK = error("A blank is missing between two attributes.")
QUOTE_NOT_CLOSED = error("A value has no closing quote.")
ATTRIBUTE_TWICE = error("An element has the same attribute twice.")
ATTRIBUTE_NAME = error("XML does not allow this name of an attribute.")
FORBIDDEN_CHARACTER = error("XML does not allow this character.")
ELEMENT_NOT_CLOSED = error("An element is not closed before the one around it.")
CLOSES_NOTHING = error("A closing tag closes no element.")
NOT_WELL_FORMED = error("The XML cannot be read for another reason.")
COMMENT_IN_COMMENT = warning("A comment begins inside a comment.")
STRAY_TEXT = warning("A text stands where only elements are allowed.")
TOO_LARGE = error("The mission is too large, too long or too deeply nested.")

# -------------------------------------------------------------------------------------------- files

UNREADABLE_FILE = error("A file cannot be read.")
INCLUDE_WITHOUT_PATH = error("<include> names no file.")
INCLUDE_UNREADABLE = error("An included file cannot be read.")
INCLUDE_PACKAGE = error("The ROS package of ros_pkg is not found.")
INCLUDE_CIRCLE = error("A file includes itself, directly or through others.")

# --------------------------------------------------------------------------------- <root> and trees

ATTRIBUTE_IGNORED = warning("The attribute means nothing on this element.")
WRONG_ROOT = error("The first element is not <root>.")
FORMAT_MISSING = warning("<root> has no BTCPP_format.")
OTHER_FORMAT = warning("BTCPP_format is not 4.")
IGNORED_BELOW_ROOT = warning("The element means nothing below <root>.")
TWO_MODELS = error("A file has more than one <TreeNodesModel>.")
TREE_WITHOUT_ID = error("A <BehaviorTree> has no ID.")
TREE_CHILDREN = error("A <BehaviorTree> has no child, or several.")
TREE_TWICE = warning("Two trees have one ID.")
RESERVED_ID = error("A tree is called Root or root.")
ID_OF_A_NODE = error("A tree has the name of a node type.")
ID_LETTERS = error("The ID of a tree holds a forbidden character.")
ID_BLANKS = warning("The ID of a tree holds a blank or a dot.")
NO_TREE = error("The file has neither a <BehaviorTree> nor a palette.")
MAIN_TREE_UNKNOWN = error("The main tree does not exist.")
MAIN_TREE_MISSING = error("Several trees could be the main tree.")
TREE_CIRCLE = late("A tree contains itself, directly or through others.")
TREE_UNUSED = warning("No tree of the mission calls this tree.")

# -------------------------------------------------------------------------------------------- nodes

UNKNOWN_NODE = error("No node type has this name.")
ID_MISSING = error("An explicit element, SubTree or model has no ID.")
ID_NOT_ALLOWED = late("The compact form of a node has an ID.")
TREE_IN_TREE = late("A <BehaviorTree> stands inside another.")
TREE_AS_NODE = error("A tree is called like a node type.")
KIND_MISMATCH = warning("The explicit element is of another kind than the node type.")
NODE_TYPE_WARNING = warning("The node type has a warning for its users.")
EXPLICIT_IN_REACTIVE = error("An explicit element stands below ReactiveSequence.")
TWO_ASYNC = error("A ReactiveSequence has more than one AsyncSequence.")
LEAF_CHILDREN = error("An action, a condition or a SubTree has a child.")
DECORATOR_CHILDREN = error("A decorator has no child, or several.")
NO_CHILD = error("A control has no child.")
FEW_CHILDREN = error("A control has too few children.")
CHILD_COUNT = warning("With this number of children the node always fails.")
SUBSTITUTE_UNKNOWN = error("A substitution rule names an unknown node type.")
NODE_BROKEN = error("The code of a node type raises in its constructor or set-up.")
NODE_REFUSES = error("The node refuses its attributes.")
SAME_PATH = error("Two SubTrees side by side have one name.")

# --------------------------------------------------------------------------------- ports and values

UNKNOWN_PORT = late("The node type has no port of this name.")
WRONG_LITERAL = late("The text has not the type of the port.")
NUMBER_CUT_SHORT = warning("Only the beginning of the text is a number.")
LIST_SEPARATOR = warning("A list has commas instead of semicolons.")
OUTPUT_IS_TEXT = warning("A node would write to a fixed text.")
PORT_MISSING = warning("The node needs a port that is not given.")
NAME_ARGUMENT = late("The node's name, which is its argument, is missing or wrong.")
NAME_CHOOSES_NOTHING = warning("The name has no effect, but looks as if it had.")
COUNT_TOO_HIGH = warning("The node has fewer children than the number.")
COUNT_ZERO = warning("The count 0 decides the result, whatever the children do.")
NEVER_RUN = warning("With this number of rounds the child is never run.")
BRACES_ODD = warning("The braces name no entry, or an unexpected one.")
BRACES_FORGOTTEN = warning("A text is the name of an entry, without braces.")
SWITCH_VARIABLE = warning("A Switch compares a fixed text.")
SWITCH_CASE = warning("A case of a Switch can hardly be chosen.")
STATUS_UNKNOWN = warning("The text is not the name of a status.")
CONDITION_MISSPELT = warning("An ignored attribute is spelt nearly like a condition.")
AUTOREMAP_MISPLACED = warning("_autoremap stands on another element than <SubTree>.")
ENTRY_TYPE = error("Ports of different types use one entry, or its name is not allowed.")

# ----------------------------------------------------------------------------------------- SubTrees

UNKNOWN_TREE = late("No tree has this ID.")
AUTOREMAP_VALUE = late("_autoremap is neither true nor false.")
MODEL_PORT_MISSING = late("A call lacks a port of the tree's model.")
MODEL_PORT_UNUSED = warning("The tree uses a port spelt nearly like one of its model.")
MODEL_PORT_UNKNOWN = warning("The model of the tree lacks this port.")
MODEL_PORT_NAME = error("A port in a tree's model has no name, or a forbidden one.")
SUBTREE_PORT_UNKNOWN = warning("The tree uses no entry of this name.")
SUBTREE_OLD = warning("The attribute means nothing in version 4.")
SUBTREE_CONDITION = warning("A condition or _autoremap of a SubTree lacks its _.")
SUBTREE_PORT_MISSING = warning("A tree reads an entry that no call gives and no node in it writes.")
UNBRACED = warning("Version 3 read the text as an entry, version 4 does not.")

# ------------------------------------------------------------------------------------------ scripts

SCRIPT_SYNTAX = late("A script cannot be read.")
SCRIPT_WORD = late("A word, call or character reference means nothing in a script.")
SCRIPT_NO_EFFECT = warning("The value of a statement is not used.")
CONDITION_ASSIGNS = warning("A condition assigns instead of comparing.")
NOT_CREATED = warning("Nothing creates the entry that = assigns.")
TEXT_AND_NUMBER = warning("A script compares or combines a text with a number.")
KIND_CHANGES = warning("An entry is assigned a text here and a number there.")
NUMBER_AS_TRUTH = warning("A text, or a number but 0 and 1, is used as a condition.")
TEXT_EMPTIES = warning("SetBlackboard sets a text on an entry of a script, which empties it.")
LITERAL_IN_SCRIPT = warning("A value given to a SubTree makes a script in it fail.")
NAME_FROM_ENTRY = warning("An entry's text is taken for the name of another entry.")
NAME_IS_NUMBER = warning("An entry with a number is taken for the name of another entry.")

# --------------------------------------------------------------------------------------------- data

NEVER_WRITTEN = warning("An entry is read, and nothing writes it.")
READ_TOO_EARLY = warning("An entry is read before any node writes it.")
ENTRY_MISSPELT = warning("An entry that is named once has nearly the name of another.")

# ------------------------------------------------------------------------------------------ outcome

NEVER_REACHED = warning("The node before it ends so that it is never ticked.")
TIMEOUT_TOO_SHORT = warning("A Timeout ends before the child can succeed.")
NEVER_REPEATS = warning("A child never ends so that it is repeated or retried.")
NEVER_WAITS = warning("A node repeats for ever without a wait.")
RETRIES_FOR_EVER = warning("A loop without limit and pause calls a service that may fail at once.")
DONE_AGAIN = warning("A reactive control repeats at every tick a step that has succeeded.")
ASKED_LATE = warning("A reactive control asks a condition only after a wait.")
RECOVERY_MISPLACED = warning("A recovery has no failure before it.")

# ------------------------------------------------------------------------------------------ palette

PALETTE_UNKNOWN_NODE = warning("The palette has an unknown node type.")
PALETTE_OTHER_NODE = error("The palette is of another robot.")
PALETTE_EMPTY = warning("The file is a palette without node types.")
PALETTE_KIND = warning("The palette gives a node type another kind.")
PALETTE_PORT = warning("The palette gives a node type an unknown port, or one twice.")
PALETTE_DIRECTION = warning("The palette gives a port another direction.")

# ------------------------------------------------------------------------------------------- robot

MODE_MISSING = warning("A condition needs a mode of attention that no node before it sets.")
FAREWELL_TO_NOBODY = warning("The mission says goodbye to a visitor who has left.")
STEP_LEFT_OUT = warning("A failure before it leaves out a step that no policy may skip.")
BEGINS_LATE = warning("A pass begins after a node has asked the robot for something.")
EARLIER_ANSWER = warning("An earlier answer counts when the visitor is asked again and is silent.")
NO_STOP = warning("Without speech recognition the mission never reaches its stops.")
ROBOT_LACKS = error("A node cannot work, because the configured robot lacks a part.")
DOES_WITHOUT = warning("A node does nothing, because the configured robot lacks a part.")
PHRASE_MISSING = warning("The robot's culture file lacks a phrase: with release 1.1 an error.")


def _by_code(names: Mapping[str, Any]) -> Dict[str, LintRule]:
    """Give each rule its code, and return the rules by their codes."""
    by_code = {name.lower().replace("_", "-"): rule for name, rule in names.items()
             if isinstance(rule, LintRule)}
    for code, rule in by_code.items():
        rule.code = code
    return by_code


RULES = _by_code(globals())
