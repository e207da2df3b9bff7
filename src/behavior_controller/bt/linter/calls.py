"""Rules about what SubTrees are given and give back, and about entries that nothing writes."""
import os
from typing import Collection, List, Optional, Set

from behavior_controller.bt.loader import rules
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.loader.flow import CREATED, SUPPRESSED, READ, WRITTEN, Access, Name
from behavior_controller.bt.loader.checks import condition_meant, is_cut_short
from behavior_controller.bt.linter.scripts import FOREIGN_WORDS
from behavior_controller.bt.loader.structure import given, is_port_name, remaps_all
from behavior_controller.bt.linter.warnings import check_braces, check_ignored
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.values.values import TEXT
from behavior_controller.text import first_names, joined, meant, quoted


def check_call(facts: MissionFacts, call: Element, tree: str) -> None:
    """Apply the rules to a <SubTree> of ``tree``."""
    called = call.attributes["ID"]
    model = facts.trees.models.get(called, [])
    texts = given(call, model)
    forgotten = [name for name in facts.needs[called] if name not in texts]
    is_reported = check_ignored(facts, call)
    for name in texts:
        read = facts.flow.name(called, name).read
        if read is not None and texts[name] is not None:
            _check_literal(facts, call, name, read)
    for name, text in call.attributes.items():
        if not is_port_name(name):
            continue
        inner, outer = facts.flow.name(called, name), ports.subtree_reference(text, name)
        if outer is not None:
            _check_remapped(facts, call, name, outer, tree)
        if check_braces(facts, call, name, tree):
            continue
        if not inner.mentions and name not in [port.name for port in model]:
            is_reported |= _check_unused(facts, call, name, outer, tree, forgotten)
        elif outer is None and text.isidentifier() and inner.is_own and not inner.read:
            lost = f"{name}=\"{text}\" is the text {text}: what the tree {called} writes there"
            hint = f"the entry is written {{{text}}}"
            facts.report(rules.BRACES_FORGOTTEN, call, f"{lost} is lost", hint, name)
            facts.excuse(tree, text)
    if facts.is_host_known and facts.flow.is_known and not is_reported and not remaps_all(call):
        for name in forgotten:
            _check_forgotten(facts, call, name, tree)


def _check_unused(facts: MissionFacts, call: Element, name: str, outer: Optional[str], tree: str,
                  forgotten: List[str]) -> bool:
    """Warn of an entry that a tree is given and does not use, and that is ``outer`` of the caller;
    return whether that was done."""
    called = call.attributes["ID"]
    known = facts.used[called]
    model = sorted(port.name for port in facts.trees.models.get(called, []))
    names = {*known, *model}.difference(call.attributes)
    near = facts.findings.nearest(name, names) if len(name) > 2 else ""
    rule, hint = rules.SUBTREE_CONDITION, condition_meant(name)
    if hint:
        text = f"{name} is an entry of the tree {called}, no condition"
    elif name.lower() in ("autoremap", "auto_remap"):
        text = f"{name} is an entry of the tree {called}, and remaps nothing"
        hint = "did you mean _autoremap?"
    elif model:
        rule, text = rules.MODEL_PORT_UNKNOWN, f"the model of {called} has no port {name}"
        hint = near or f"its ports: {', '.join(model)}"
    elif near or (outer is not None and facts.flow.is_known):
        has = first_names(forgotten or sorted(known)) or "no entries"
        rule, text = rules.SUBTREE_PORT_UNKNOWN, f"the tree {called} uses no entry {name}"
        hint = near or f"the tree {called} has {has}"
    else:
        return False
    facts.report(rule, call, text, hint, name)
    if outer is not None:
        facts.excuse(tree, outer)
    return True


def _check_forgotten(facts: MissionFacts, call: Element, name: str, tree: str) -> None:
    """Warn of an entry that the call does not give to its tree."""
    near = facts.findings.nearest(name, facts.written[tree])
    hint = joined("; ", f"write {name}=\"{{…}}\", or {name}=\"…\"", near)
    if name in facts.written[tree]:
        hint = f"write {name}=\"{{{name}}}\""
    elif name in facts.defaults or name in facts.written[facts.trees.main]:
        hint = f"write {name}=\"{{@{name}}}\""
    text = f"the tree {call.attributes['ID']} needs the entry {name}, which this call does not give"
    facts.report(rules.SUBTREE_PORT_MISSING, call, text, hint)


def _check_literal(facts: MissionFacts, call: Element, name: str, read: Access) -> None:
    """Warn of a literal that a port of the called tree reads in part, or cannot read."""
    giver, attribute = facts.trees.giver(call, name)
    text, port = giver.attributes[attribute], facts.spec(read.element).port_named.get(
        read.attribute)
    is_text = ports.subtree_literal(text)[0] == TEXT
    if port is None or not is_text or ports.subtree_reference(text, name) is not None:
        return
    wrong = ports.literal_fault(text, port, {})
    if not is_cut_short(facts.report, giver, attribute, port, port.type) and wrong is not None:
        refused = f"{name}=\"{text}\" cannot be of type {port.type}, as the port {port.name} there"
        facts.report(rules.WRONG_LITERAL, giver, refused, wrong, attribute)


def _check_remapped(facts: MissionFacts, call: Element, name: str, outer: str, tree: str) -> None:
    """Warn of an entry that occurs only here in the tree, if a similar name occurs."""
    entry = facts.flow.name(tree, outer)
    if entry.mentions > 1 or not facts.findings.may_compare(len(facts.flow.names[entry.tree])):
        return
    near = _meant(entry.name, facts.used[entry.tree])
    if near:
        facts.excuse(tree, outer)
        text = f"the entry {quoted(outer)} is named nowhere else"
        facts.report(rules.ENTRY_MISSPELT, call, text, meant(entry.name, near), name)


def check_tree_models(facts: MissionFacts) -> None:
    """Warn of each port of a tree's model that the tree does not use, if it uses one of nearly its
    name that the model lacks."""
    for tree in facts.elements:
        names = {port.name for port in facts.trees.models.get(tree, ())}
        used = set(facts.used[tree])
        for name in sorted(names - used):
            near = _meant(name, used - names)
            if near:
                text = f"the tree {tree} does not use the port {name} of its model"
                element = facts.trees.model_ports[tree, name]
                facts.report(rules.MODEL_PORT_UNUSED, element, text, meant(name, near), "name")


# --------------------------------------------------------------------- entries that are not written


def check_entries(facts: MissionFacts) -> None:
    """Warn of entries that are read and never written; of those that a node reads by default, only
    of one."""
    if not facts.flow.is_known:
        return
    by_default: Set[int] = set()  # elements
    told: Set[int] = set()
    for use in facts.flow.all():
        if facts.is_host_known:
            _check_written(facts, use)
        read, name = use.read, use.name
        is_odd = name in FOREIGN_WORDS or name != name.strip() or "{" in name
        # what another tree reads, its callers must give it, if they can
        is_of_callers = use.tree != facts.trees.main and is_port_name(name)
        is_known = not use.entry.uses.isdisjoint((WRITTEN, SUPPRESSED))
        if read is None or is_odd or is_of_callers or is_known:
            continue
        if read.attribute not in read.element.attributes:
            if id(read.element) in by_default:
                continue
            by_default.add(id(read.element))
        told.add(id(read.element))
        _check_read(facts, use, read)
    for use in facts.flow.all():
        if facts.is_host_known and use.read is not None and id(use.read.element) not in told:
            _check_order(facts, use, use.read)


def _check_written(facts: MissionFacts, use: Name) -> None:
    """Warn of an entry that is only written, once, if one of a similar name is written and read."""
    place, name, uses = use.write, use.name, use.entry.uses
    others = facts.flow.names[use.tree].values()
    if (place is None or use.mentions > 1 or READ in uses or CREATED not in uses
            or name in facts.defaults or not facts.findings.may_compare(len(others))):
        return
    near = _meant(name, [other.name for other in others  # x_max and y_max are two entries
                         if other.name[:1] + other.name[-1:] == name[:1] + name[-1:]
                         and {READ, WRITTEN, CREATED} <= other.entry.uses])
    if near:
        text = f"the entry {quoted(name)} is written here, and read nowhere"
        element, attribute, at, _ = place
        facts.report(rules.ENTRY_MISSPELT, element, text, meant(name, near), attribute, at)


def _check_order(facts: MissionFacts, use: Name, read: Access) -> None:
    """Warn of a node that reads an entry before any other is ticked that writes it."""
    others = [name for name in use.entry.names if name is not use]
    is_given = any(name.is_given or name.writers for name in others) or use.is_given
    is_told = SUPPRESSED in use.entry.uses or read.script is not None
    if not use.writers or is_given or is_told:
        return
    if all(facts.is_before(read.element, writer) for writer in use.writers):
        writer = use.writers[0].type_id
        text = f"the entry {quoted(use.name)} is read here, before {writer} writes it"
        hint = "move it behind the node that writes it"
        facts.report(rules.READ_TOO_EARLY, read.element, text, hint, read.attribute, read.at)


def _check_read(facts: MissionFacts, use: Name, read: Access) -> None:
    name, written = use.name, facts.written[use.tree]
    hint = next((f"the tree {tree} writes one of its own; that of the whole mission is @{name}"
                 for tree, names in facts.written.items()
                 if tree != facts.trees.main and name in names), "")
    if not hint and not facts.is_host_known and not _meant(name, written):
        return
    hint = hint or facts.written_by(name) or facts.findings.nearest(name, written)
    if not hint and read.script is not None:
        operands = [assignment.value for assignment in read.script.facts.assignments]
        operands += [operation.right for operation in read.script.facts.operations]
        # compared or assigned, as a text would be
        if any(operand.name == name for operand in operands):
            hint = f"a text needs single quotes: '{name}'"
    text = f"the entry {quoted(name)} is read here, but nothing writes it"
    facts.report(rules.NEVER_WRITTEN, read.element, text, hint, read.attribute, read.at)


def _meant(name: str, known: Collection[str]) -> str:
    """Return the name of which this one is a misspelling; "" if there is none. Short names differ
    on purpose."""
    return next(
        (other for other in sorted(known) if len(other) > 3 and is_misspelling(name, other)), "")


def is_misspelling(word: str, other: str) -> bool:
    """Return whether two names differ by one letter left out, added or changed, or two exchanged.

    Names that differ by a digit or an s at the end count as different on purpose.
    """
    if word.rstrip("s0123456789") == other.rstrip("s0123456789"):
        return False
    begin = len(os.path.commonprefix([word, other]))
    one, two = word[begin:], other[begin:]
    end = len(os.path.commonprefix([one[::-1], two[::-1]]))
    one, two = one[:len(one) - end], two[:len(two) - end]
    return max(len(one), len(two)) < 2 or len(one) == 2 and one == two[::-1]
