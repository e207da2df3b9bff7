"""Finds what keeps a mission from being loaded: its trees, and of a node its type, children, ports,
literals, scripts (BT.CPP 12.3).

What depends on an instance (types of entries, paths of SubTrees) is found when the tree is built.
"""
import re
from typing import Callable, Optional, Sequence

from behavior_controller.bt.loader import rules
from behavior_controller.bt.engine import ports
from behavior_controller.bt.values import values
from behavior_controller.bt.loader.document import Document, EXPLICIT, Element
from behavior_controller.bt.script.parser import ScriptSyntaxError, compile_script
from behavior_controller.bt.values.values import ValueFault
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port, Role, argument
from behavior_controller.bt.loader.structure import (
    AROUND_THEM, CONDITIONS, Trees, is_port_name, remaps_all)
from behavior_controller.text import did_you_mean, quoted

LONGEST_SCRIPT = 20_000  # characters

ELSEWHERE = {"SubTreePlus": "version 4 writes <SubTree>, and _autoremap for __autoremap",
             "SequenceStar": "version 4 calls it SequenceWithMemory",
             "FallbackStar": "version 4 calls it Fallback",
             "RetryUntilSuccesful": "version 4 spells it RetryUntilSuccessful",
             **dict.fromkeys(("BlackboardCheckInt", "BlackboardCheckDouble",
                              "BlackboardCheckString", "BlackboardCheckBool"),
                             "version 4 writes _skipIf, _failureIf or Precondition"),
             "ConsumeQueue": "version 4 has LoopString, LoopInt, LoopDouble and LoopBool",
             "ManualSelector": "version 4 has Switch2 to Switch6",
             "Selector": "BehaviorTree.CPP calls it Fallback",
             "include": "it belongs directly below <root>",
             "TreeNodesModel": "it belongs directly below <root>"}
"""Names of a node type in other versions and tools -> its name here."""
_OTHER_NAMES = {
    **dict.fromkeys(("Success", "Succeed", "Succeeder"), "AlwaysSuccess"),
    **dict.fromkeys(("Failure", "Fail", "Failer"), "AlwaysFailure"),
    **dict.fromkeys(("Wait", "Pause"), "Sleep, with the port msec"),
    **dict.fromkeys(("Not", "Invert", "Negate"), "Inverter"),
    **dict.fromkeys(("And", "All", "Steps"), "Sequence"),
    **dict.fromkeys(("Or", "Any", "Priority", "Select"), "Fallback"),
    **dict.fromkeys(("Retry", "RepeatUntilSuccess", "UntilSuccess"), "RetryUntilSuccessful"),
    **dict.fromkeys(("RepeatUntilFailure", "UntilFailure", "UntilFail"), "KeepRunningUntilFailure"),
    **dict.fromkeys(("Set", "SetVariable", "Assign"), "Script, or SetBlackboard for a text"),
    **dict.fromkeys(("If", "IfThen"), "IfThenElse"), "While": "WhileDoElse", "Try": "TryCatch",
    **dict.fromkeys(("Switch", "Case"), "Switch2 to Switch6"), "Once": "RunOnce",
    **dict.fromkeys(("Loop", "ForEach", "For"), "LoopString, LoopInt, LoopDouble or LoopBool"),
    **dict.fromkeys(("Check", "Compare", "CheckBlackboard"), "ScriptCondition")}
"""What other tools call a node type of the library, which another robot may have under that name
-> its name here."""
_PORTS_ELSEWHERE = {("Parallel", "threshold"): "version 4 writes success_count",
                    ("Parallel", "success_threshold"): "version 4 writes success_count",
                    ("Parallel", "failure_threshold"): "version 4 writes failure_count"}
_SUBTREE_ELSEWHERE = {"__shared_blackboard": "version 4 ignores it: write _autoremap=\"true\"",
                      "__autoremap": "version 4 ignores it: write _autoremap"}


def _check_node(trees: Trees, element: Element) -> None:
    """Check a node."""
    spec = trees.registry.get(element.type_id)
    if element.tag == "SubTree":
        _check_subtree(trees, element)
    elif not element.type_id:
        trees.report_no_id(element, "", "the ID is the node type")
    elif spec is None or spec.kind is Kind.SUBTREE:
        _report_unknown(trees, element, element.type_id)
    else:
        _check_known(trees, element, spec)


def _check_known(trees: Trees, element: Element, spec: NodeSpec) -> None:
    """Check a node whose type is known."""
    if spec.warning:
        trees.report(rules.NODE_TYPE_WARNING, element, spec.warning)
    if spec.names:
        _check_name(trees, element, spec)
    for child in element.children:
        if spec.refuses_explicit and child.tag in EXPLICIT and child.type_id:
            text = f"BehaviorTree.CPP refuses <{child.tag}> directly below {spec.id}"
            trees.report(rules.EXPLICIT_IN_REACTIVE, child, text, f"write <{child.type_id}/>")
    if [child.tag for child in element.children].count(spec.at_most_one) > 1:
        text = f"a {spec.id} cannot have more than one {spec.at_most_one} child"
        trees.report(rules.TWO_ASYNC, element, text)
    _check_children(trees, element, spec)
    for name, text in element.attributes.items():
        if name != "name":
            _check_attribute(trees, element, spec, name, text)


def _check_name(trees: Trees, element: Element, spec: NodeSpec) -> None:
    """Check the name of a node whose name is its argument."""
    name = element.attributes.get("name", "")
    text, attribute = f"{spec.id} takes an argument in its name, which is not given", None
    if argument(name):
        text, attribute = f"the name of {spec.id} cannot be {name}", "name"
    if argument(name) not in spec.names:
        hint = f"allowed: name=\"…\" with {', '.join(spec.names)}"
        trees.report(rules.NAME_ARGUMENT, element, text, hint, attribute)


def _report_unknown(trees: Trees, element: Element, node_id: str) -> None:
    attribute = "ID" if element.tag in EXPLICIT else None
    if node_id == "BehaviorTree":
        text = "a <BehaviorTree> cannot stand inside another"
        hint = "call it with <SubTree ID=\"…\"/>"
        trees.report(rules.TREE_IN_TREE, element, text, hint)
    elif node_id in trees.trees:
        text = f"{node_id} is a tree, not a node"
        hint = f"it is called with <SubTree ID=\"{node_id}\"/>"
        trees.report(rules.TREE_AS_NODE, element, text, hint, attribute)
    else:
        other = _OTHER_NAMES.get(node_id[:1].upper() + node_id[1:])
        hint = (ELSEWHERE.get(node_id) or (other and f"BehaviorTree.CPP calls it {other}")
                or trees.nearest(node_id, trees.registry)
                or "exportNodeModel prints every node type with its ports")
        text = f"unknown node {quoted(node_id)}"
        trees.report(rules.UNKNOWN_NODE, element, text, hint, attribute)


def _check_children(trees: Trees, element: Element, spec: NodeSpec) -> None:
    count = len(element.children)
    fewest, most = spec.child_range
    if fewest <= count <= most:
        return
    if most == 0:
        rule, text = rules.LEAF_CHILDREN, f"{spec.id} is a leaf and cannot have children"
    elif most == 1:
        text = f"{spec.id} has {count} children; a decorator must have exactly 1"
        rule = rules.DECORATOR_CHILDREN
    elif fewest > 1:
        text = f"{spec.id} must have at least {fewest} children: {spec.children}"
        rule = rules.FEW_CHILDREN
    else:
        rule, text = rules.NO_CHILD, f"{spec.id} has no child; it must have 1 or more"
    trees.report(rule, element, text, AROUND_THEM if most == 1 and count else "")


def _check_attribute(trees: Trees, element: Element, spec: NodeSpec, name: str, text: str) -> None:
    port = spec.port_named.get(name)
    if name in CONDITIONS:
        _check_script(trees, element, name, text)
    elif port is not None:
        _check_port(trees, element, port, text)
    elif name == "ID":
        if element.tag not in EXPLICIT:
            text = f"the attribute ID is not allowed in <{element.tag}>"
            hint = "write name=\"…\" for the name of the node"
            trees.report(rules.ID_NOT_ALLOWED, element, text, hint, "ID")
    elif is_port_name(name):
        hint = f"its argument is its name: {', '.join(spec.names)}"
        if not spec.names:
            hint = (_PORTS_ELSEWHERE.get((spec.id, name)) or condition_meant(name)
                    or trees.nearest(name, spec.port_named, "its ports"))
        text = f"{spec.id} has no port {name}"
        trees.report(rules.UNKNOWN_PORT, element, text, hint, name)


def _check_port(trees: Trees, element: Element, port: Port, text: str) -> None:
    wrong = ports.literal_fault(text, port, {})
    if wrong is not None:
        inner = text.strip("${} \t")
        if inner.isidentifier() and (inner != text or port.type != "bool"):
            wrong = f"{wrong}; an entry is written {{{inner}}}"
        text = f"port {port.name} of type {port.type} cannot be \"{text}\""
        trees.report(rules.WRONG_LITERAL, element, text, wrong, port.name)
    elif ports.reference(text, port.name) is not None:
        return
    elif port.direction is Direction.OUT:
        text = f"{element.type_id} cannot write its port {port.name} to the text \"{text}\""
        hint = f"an entry is written {{{port.name}}}"
        trees.report(rules.OUTPUT_IS_TEXT, element, text, hint, port.name)
    elif port.role is Role.SCRIPT and text:
        _check_script(trees, element, port.name, text)
    elif not is_cut_short(trees.report, element, port.name, port, port.literal or port.type):
        _check_list(trees, element, port, text)


def _check_list(trees: Trees, element: Element, port: Port, text: str) -> None:
    """Warn of a list of texts or truth values with commas, which is one element."""
    is_list = (port.literal or port.type) in values.VECTORS
    if is_list and "," in text and ";" not in text and not text.startswith("json:"):
        wrong = f"{port.name}=\"{text}\" is one element"
        trees.report(rules.LIST_SEPARATOR, element, wrong, _separated(text), port.name)


def _check_script(trees: Trees, element: Element, name: str, text: str) -> None:
    try:
        if len(text) > LONGEST_SCRIPT:
            raise ScriptSyntaxError(
                f"it has {len(text)} characters; at most {LONGEST_SCRIPT} are allowed")
        compile_script(text)
    except ScriptSyntaxError as wrong:
        said = f"the script of {name} cannot be read: {wrong}"
        trees.report(rules.SCRIPT_SYNTAX, element, said, wrong.hint or text, name, wrong.position)


def _check_subtree(trees: Trees, element: Element) -> None:
    tree_id = element.attributes.get("ID", "")
    for name, text in element.attributes.items():
        if name in CONDITIONS:
            _check_script(trees, element, name, text)
        elif name in _SUBTREE_ELSEWHERE:
            said = f"{name} means nothing in version 4"
            trees.report(rules.SUBTREE_OLD, element, said, _SUBTREE_ELSEWHERE[name], name)
    if not tree_id:
        trees.report_no_id(element, "", "the ID is that of a <BehaviorTree>")
    else:
        trees.check_id(element, tree_id)
    if element.children:
        said = f"<SubTree ID=\"{tree_id}\"> cannot have children"
        trees.report(rules.LEAF_CHILDREN, element, said)
    if id(element) not in trees.findings.faulty:
        _check_call(trees, element, tree_id)


def _check_call(trees: Trees, element: Element, tree_id: str) -> None:
    if tree_id not in trees.trees:
        trees.findings.faulty.add(id(element))
        if trees.is_complete:
            hint = trees.nearest(tree_id, trees.trees, "the trees")
            text = f"there is no tree {quoted(tree_id)}"
            trees.report(rules.UNKNOWN_TREE, element, text, hint, "ID")
    try:
        gets_all = remaps_all(element)
    except ValueFault as fault:
        trees.report(rules.AUTOREMAP_VALUE, element, str(fault), attribute="_autoremap")
        return
    for port in trees.models.get(tree_id, ()):
        if not gets_all and port.default is None and port.name not in element.attributes:
            _report_missing(trees, element, tree_id, port)
    is_old = element.document.root.attributes.get("BTCPP_format") != "4"
    for name, text in element.attributes.items():
        if (is_old and is_port_name(name) and text.isidentifier()
                and text not in ("true", "false")):
            said = f"{name}=\"{text}\" is the text {text} in version 4"
            hint = f"the entry of that name is written {{{text}}}"
            trees.report(rules.UNBRACED, element, said, hint, name)


def _report_missing(trees: Trees, element: Element, tree_id: str, port: Port) -> None:
    """Record that a port of a tree's model is not given; at the attribute that is meant for it,
    if there is one."""
    known, meant = [known.name for known in trees.models[tree_id]], f"did you mean {port.name}?"
    other = next((name for name in element.attributes if is_port_name(name)
                  and name not in known and did_you_mean(name, known) == meant), None)
    text = f"the model of {tree_id} asks for the port {port.name}, which is not given"
    hint = f"write {port.name}=\"{{{port.name}}}\""
    if other:
        text, hint = f"{text}; it has no port {other}", meant
        words = trees.words(tree_id)
        if other in words and port.name not in words:  # the model is what is misspelt
            element = trees.model_ports[tree_id, port.name]
            text = f"the tree {tree_id} does not use the port {port.name} of its model"
            other, hint = "name", f"did you mean {other}?"
    trees.report(rules.MODEL_PORT_MISSING, element, text, hint, other)


def is_cut_short(report: Callable[..., None], element: Element, attribute: str, port: Port,
                 type_name: str) -> bool:
    """Warn of a number that ``port`` does not read to its end; return whether that was done."""
    text = element.attributes[attribute]
    rest = values.unread(text, type_name)
    if rest:
        try:
            read = values.TYPES[type_name].from_text(text, {})
            if isinstance(read, list):
                read = ";".join(map(str, read))
        except ValueFault as fault:
            read = fault
        wrong = f"{attribute}=\"{text}\" is read only up to \"{rest}\": as {read}"
        report(rules.NUMBER_CUT_SHORT, element, wrong, _meant(text, port, type_name), attribute)
    return bool(rest)


def _separated(text: str) -> str:
    items = re.split(r"\s*[,;]\s*", text.strip(" []")) if "," in text else text.split()
    return f"elements are separated by semicolons: write {';'.join(items)}"


_THOUSANDS = re.compile(r"-?[0-9]{1,3}(?:[,._' ][0-9]{3})+")
_AMOUNT = re.compile(r"([0-9]+(?:[.,][0-9]+)?)\s*(ms|milli|s|min|h)[a-z]*", re.IGNORECASE)
_MILLISECONDS = {"ms": 1, "milli": 1, "s": 1000, "min": 60_000, "h": 3_600_000}


def _meant(text: str, port: Port, type_name: str) -> str:
    """Return what may be meant by a number that is read only in part."""
    if type_name in values.VECTORS and re.search(r"[0-9]\s*[,\s]\s*-?[0-9.]", text):
        return _separated(text)
    amount, number = _AMOUNT.fullmatch(text.strip()), values.whole_real(text.replace(",", "."))
    if amount is not None and port.name.endswith("msec"):
        figure, unit = amount.groups()
        milliseconds = float(figure.replace(",", ".")) * _MILLISECONDS[unit.lower()]
        return f"the number is of milliseconds: {text} is {milliseconds:.0f}"
    if _THOUSANDS.fullmatch(text):
        return f"a number has no separators: write {re.sub('[^-0-9]', '', text)}"
    if number is None:
        return f"the type is {type_name}"
    if type_name == "double":
        return f"write {text.replace(',', '.')}"
    if number.is_integer():
        return f"the type is {type_name}: write {number:.0f}"
    return f"the type is {type_name}, without fraction"


def condition_meant(name: str) -> str:
    """Return ``did you mean _…?`` if an attribute is a condition that lacks its underscore."""
    return did_you_mean("_" + name, CONDITIONS, likeness=0.8)


def check(documents: Sequence[Document], registry: Registry, main_tree: Optional[str] = None,
          strict: bool = False) -> Trees:
    """Check ``documents``, included ones first, the mission itself last, as BehaviorTree.CPP's
    loader does, and find every fault in one pass. ``main_tree`` overrides the file's choice.

    Without ``strict`` two things load that BehaviorTree.CPP refuses. If nothing names the main
    tree, it is the only one that no other tree calls (Groot2 drops the attribute when it saves).
    The ID of a tree may contain blanks and dots (as in published missions), with a warning.
    """
    trees = Trees(registry, "" if strict else " .")
    for document in documents:
        trees.add(document)
    trees.choose_main(main_tree, not strict)
    trees.check_calls()
    for tree_id, tree in trees.bodies:
        trees.findings.refuses_late = tree_id in trees.used and trees.trees[tree_id] is tree
        for element in tree.below:
            _check_node(trees, element)
    trees.findings.refuses_late = False
    return trees
