"""Every kind of mistake in a mission, declared once: its code (``NO_CHILD`` is ``no-child``) and
what it means.

A finding is made through its rule. docs/faults.md and the codes that ``validateMission --ignore``
takes are derived from them; test/fixtures/mistakes.txt has missions with each mistake, and missions
beside them that have none.
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

EMPTY_FILE = error("The file is empty, or has nothing but blanks.")
NOT_TEXT = error("The file is not UTF-8 text, nor UTF-16 with its mark.")
NO_ELEMENT = error('The file has no element; a mission begins with <root BTCPP_format="4">.')
OUTSIDE_ROOT = error("A file has one <root>, and nothing before or after it.")
NOT_CLOSED = error("A comment, a CDATA section, an instruction or a closing tag has no end.")
DOCTYPE = error("A mission may not declare entities.")
INSTRUCTION = error("A processing instruction is not allowed inside <root>.")
STRAY_BRACKET = error("A < begins no tag; in text it is written &lt;.")
ELEMENT_NAME = error("The name of an element is not one that XML knows.")
TAG_NOT_ENDED = error("A tag is not ended with >.")
STRAY_CHARACTER = error("A tag holds a character that belongs to no attribute.")
ATTRIBUTE_VALUE = error("An attribute has no value.")
ATTRIBUTE_QUOTES = error("The value of an attribute must stand in quotes.")
ATTRIBUTE_BLANK = error("A blank is missing between two attributes.")
QUOTE_NOT_CLOSED = error("The value of an attribute has no closing quote.")
ATTRIBUTE_TWICE = error("An element has the same attribute twice.")
ATTRIBUTE_NAME = error("The name of an attribute is not one that XML knows.")
FORBIDDEN_CHARACTER = error("A character that XML does not allow.")
ELEMENT_NOT_CLOSED = error("An element is not closed, or not before the one around it is.")
CLOSES_NOTHING = error("A closing tag has no element that it could close.")
NOT_WELL_FORMED = error("XML that cannot be read for another reason.")
COMMENT_IN_COMMENT = warning("A comment begins inside a comment; the first --> ends both.")
STRAY_TEXT = warning("A text is where only elements are allowed; it is dropped.")
TOO_LARGE = error("The mission is larger, longer or more deeply nested than is allowed.")

# -------------------------------------------------------------------------------------------- files

UNREADABLE_FILE = error("A file cannot be read.")
INCLUDE_WITHOUT_PATH = error("<include> needs the attribute path.")
INCLUDE_UNREADABLE = error("An included file cannot be read.")
INCLUDE_PACKAGE = error("The ROS package that ros_pkg names is not found.")
INCLUDE_CIRCLE = error("A file includes itself, directly or through others.")

# --------------------------------------------------------------------------------- <root> and trees

ATTRIBUTE_IGNORED = warning("An attribute means nothing on its element, and may be misspelt.")
WRONG_ROOT = error("The first element must be <root>.")
FORMAT_MISSING = warning('<root> does not say BTCPP_format="4".')
OTHER_FORMAT = warning("BTCPP_format is not 4; the file is read as version 4 all the same.")
IGNORED_BELOW_ROOT = warning("An element below <root> means nothing there.")
TWO_MODELS = error("A file may hold only one <TreeNodesModel>.")
TREE_WITHOUT_ID = error("A <BehaviorTree> needs an ID, unless it is all that the file has.")
TREE_CHILDREN = error("A <BehaviorTree> must have exactly one child.")
TREE_TWICE = warning("A tree is defined again; the last definition counts.")
RESERVED_ID = error("A tree cannot be called Root or root.")
ID_OF_A_NODE = error("A tree cannot have the name of a node type.")
ID_LETTERS = error("The ID of a tree holds a character that is not allowed.")
ID_BLANKS = warning("The ID of a tree holds a blank or a dot, which BehaviorTree.CPP 4.10 refuses.")
NO_TREE = error("The file has neither a <BehaviorTree> nor a palette.")
MAIN_TREE_UNKNOWN = error("The main tree does not exist.")
MAIN_TREE_MISSING = error("Nothing says which of several trees is the main tree.")
TREE_CIRCLE = late("A tree contains itself, directly or through others.")
TREE_UNUSED = warning("No tree of the mission calls this tree.")

# -------------------------------------------------------------------------------------------- nodes

UNKNOWN_NODE = error("An element names a node type that is not known.")
ID_MISSING = error("An explicit element, a SubTree or a model lacks the attribute ID.")
ID_NOT_ALLOWED = late("The compact form of a node has no attribute ID.")
TREE_IN_TREE = late("A <BehaviorTree> cannot stand inside another.")
TREE_AS_NODE = error("A tree is called as if it were a node type.")
KIND_MISMATCH = warning("The explicit element names another kind than the node type is of.")
NODE_TYPE_WARNING = warning("The node type has a warning for its users.")
EXPLICIT_IN_REACTIVE = error("BehaviorTree.CPP refuses the explicit form below ReactiveSequence.")
TWO_ASYNC = error("A ReactiveSequence cannot have more than one AsyncSequence child.")
LEAF_CHILDREN = error("An action, a condition or a SubTree cannot have children.")
DECORATOR_CHILDREN = error("A decorator must have exactly one child.")
NO_CHILD = error("A control must have children.")
FEW_CHILDREN = error("A control has fewer children than it needs.")
CHILD_COUNT = warning("With this number of children the node fails whenever it is ticked.")
SUBSTITUTE_UNKNOWN = error("A substitution rule names a node type that does not exist.")
NODE_BROKEN = error("The code of a node type fails where it makes a node or sets it up.")
NODE_REFUSES = error("A node cannot be made with these attributes.")
SAME_PATH = error("Two SubTrees side by side have the same name.")

# --------------------------------------------------------------------------------- ports and values

UNKNOWN_PORT = late("The node type has no port of this name.")
WRONG_LITERAL = late("The text cannot be a value of the port's type.")
NUMBER_CUT_SHORT = warning("Only the beginning of the text is read as a number.")
LIST_SEPARATOR = warning("A list has commas; its elements are separated by semicolons.")
OUTPUT_IS_TEXT = warning("What a node writes needs an entry, and the port has a fixed text.")
PORT_MISSING = warning("A port that the node needs is not given.")
NAME_ARGUMENT = late("The name of the node is its argument, and is missing or none that it takes.")
NAME_CHOOSES_NOTHING = warning("The name looks as if it chose what the node does, and does not.")
COUNT_TOO_HIGH = warning("There are fewer children than the number says.")
COUNT_ZERO = warning("A count of 0 decides the node's end whatever its children do.")
NEVER_RUN = warning("The child is never run, because the number of rounds is 0 or negative.")
BRACES_ODD = warning("The braces make no reference to an entry, or one to another than it seems.")
BRACES_FORGOTTEN = warning("The text is the name of an entry, but is no reference without braces.")
SWITCH_VARIABLE = warning("A Switch that compares a fixed text always chooses the same child.")
SWITCH_CASE = warning("A case of a Switch can hardly be equal to anything, or is never reached.")
STATUS_UNKNOWN = warning("The text is not the name of a status; the node fails when it needs it.")
CONDITION_MISSPELT = warning("An ignored attribute with _ is spelt nearly like a condition.")
AUTOREMAP_MISPLACED = warning("_autoremap means something only on a <SubTree>.")
ENTRY_TYPE = error("An entry is used by ports of different types, or its name cannot be.")

# ----------------------------------------------------------------------------------------- SubTrees

UNKNOWN_TREE = late("A SubTree calls a tree that does not exist.")
AUTOREMAP_VALUE = late("_autoremap must be true or false.")
MODEL_PORT_MISSING = late("A port that the model of the tree asks for is not given.")
MODEL_PORT_UNUSED = warning("The tree does not use a port of its model, but one spelt nearly so.")
MODEL_PORT_UNKNOWN = warning("The model of the tree has no port of this name.")
MODEL_PORT_NAME = error("The name of a port in a model of a tree is missing or not allowed.")
SUBTREE_PORT_UNKNOWN = warning("The tree uses no entry of this name.")
SUBTREE_OLD = warning("The attribute means nothing in version 4.")
SUBTREE_CONDITION = warning("A condition or _autoremap without its _ is taken for an entry.")
SUBTREE_PORT_MISSING = warning("A tree reads an entry that it does not write and is not given.")
UNBRACED = warning("Version 3 took the text for the name of an entry; version 4 keeps it a text.")

# ------------------------------------------------------------------------------------------ scripts

SCRIPT_SYNTAX = late("A script cannot be read.")
SCRIPT_WORD = late("A word, a call or a character reference means nothing in a script: it fails.")
SCRIPT_NO_EFFECT = warning("A statement is evaluated, and its value is used for nothing.")
CONDITION_ASSIGNS = warning("A condition assigns a value instead of comparing with it.")
NOT_CREATED = warning("An entry is assigned, and nothing creates it; := does.")
TEXT_AND_NUMBER = warning("A text is compared or calculated with a number.")
KIND_CHANGES = warning("An entry that holds a text is assigned a number, or the reverse.")
NUMBER_AS_TRUTH = warning("A text, or a number but 0 and 1, is taken for a truth value: it fails.")
TEXT_EMPTIES = warning("A text is set on an entry that a script has made, which makes it empty.")
LITERAL_IN_SCRIPT = warning("A text or number that a SubTree is given makes a script in it fail.")
NAME_FROM_ENTRY = warning("The braces take the name of an entry from another entry's text.")
NAME_IS_NUMBER = warning("The name of an entry is taken from an entry that holds a number.")

# --------------------------------------------------------------------------------------------- data

NEVER_WRITTEN = warning("An entry is read, and nothing writes it.")
READ_TOO_EARLY = warning("An entry is read before any node that writes it is ticked.")
ENTRY_MISSPELT = warning("An entry is named once, and another that is used has nearly its name.")

# ------------------------------------------------------------------------------------------ outcome

NEVER_REACHED = warning("A node is never ticked, because of how the one before it ends.")
TIMEOUT_TOO_SHORT = warning("A Timeout ends before the child can succeed.")
NEVER_REPEATS = warning("A repeat or retry whose child never ends as it would have to.")
NEVER_WAITS = warning("A node repeats forever, and nothing in it waits.")
RETRIES_FOR_EVER = warning("A loop without limit or pause asks a service that may fail at once.")
DONE_AGAIN = warning("A reactive control does again at every tick what has succeeded.")
RECOVERY_MISPLACED = warning("A recovery has no failure before it.")

# ------------------------------------------------------------------------------------------ palette

PALETTE_UNKNOWN_NODE = warning("The palette has a node type that is not known.")
PALETTE_OTHER_NODE = error("The palette defines a node type of ours otherwise: for another robot.")
PALETTE_EMPTY = warning("A file holds a palette alone, and that has no node types.")
PALETTE_KIND = warning("The palette has a node type as of another kind.")
PALETTE_PORT = warning("The palette has a port that the node type lacks.")
PALETTE_DIRECTION = warning("The palette has a port with another direction.")

# ------------------------------------------------------------------------------------------- robot

MODE_MISSING = warning("A node checks a sign that no mode of attention set before it reports.")
FAREWELL_TO_NOBODY = warning("The mission says goodbye to a visitor who has left.")
STEP_LEFT_OUT = warning("A step that no policy may skip is left out when a step before it fails, "
                        "because one recovery stands behind both.")
BEGINS_LATE = warning("A pass begins after a node has asked the robot for something.")
NO_STOP = warning("Without speech recognition the mission never comes to its stops.")
ROBOT_LACKS = error("A node cannot work, because the configured robot lacks what it needs.")
DOES_WITHOUT = warning("A node does nothing, because the configured robot lacks what it needs.")
PHRASE_MISSING = warning("A node says a phrase that the robot's culture file does not have. "
                         "With a robot of release 1.1 this is an error.")


def _by_code(names: Mapping[str, Any]) -> Dict[str, LintRule]:
    """Give each rule its code, and return the rules by their codes."""
    by_code = {name.lower().replace("_", "-"): rule for name, rule in names.items()
             if isinstance(rule, LintRule)}
    for code, rule in by_code.items():
        rule.code = code
    return by_code


RULES = _by_code(globals())
