"""Checks a mission without running it: the one walk over its elements, on which each rule looks at
each of them.

``check`` accepts what BehaviorTree.CPP's loader accepts, reports every fault in one pass, and warns
of what version 4 ignores. ``lint`` warns of what loads, but is probably a mistake.
"""
from typing import List, Optional, Sequence

from behavior_controller.bt.linter.calls import check_call, check_entries
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.linter.nodes import Nodes
from behavior_controller.bt.linter.palette import check_models
from behavior_controller.bt.linter.scripts import check_scripts
from behavior_controller.bt.linter.structure import Trees
from behavior_controller.bt.linter.warnings import check_node
from behavior_controller.bt.loader.document import Document
from behavior_controller.bt.registry import Registry
from behavior_controller.errors import Fault


def check(documents: Sequence[Document], registry: Registry, main_tree: Optional[str] = None,
          strict: bool = False) -> Trees:
    """Check ``documents``, included ones first, the mission itself last. ``main_tree`` overrides
    the file's choice.

    Without ``strict`` two things load that BehaviorTree.CPP refuses. If nothing names the main
    tree, it is the only one that no other tree calls (Groot2 drops the attribute when it saves).
    The ID of a tree may contain blanks and dots (as in published missions), with a warning.
    """
    trees = Trees(registry, "" if strict else " .")
    for document in documents:
        trees.add(document)
    trees.choose_main(main_tree, not strict)
    trees.check_calls()
    nodes = Nodes(trees)
    for tree_id, tree in trees.bodies:
        trees.findings.refuses_late = tree_id in trees.used and trees.trees[tree_id] is tree
        for element in tree.below:
            nodes.check(element)
    trees.findings.refuses_late = False
    return trees


def lint(trees: Trees) -> List[Fault]:
    """Return the findings about a checked mission; if it has no errors, with warnings."""
    if not trees.findings.errors:
        check_models(trees.documents, trees.registry, trees.findings)
        trees.check_unused()
        facts = MissionFacts(trees)
        for tree, element in facts.walk():
            (check_call if element.tag == "SubTree" else check_node)(facts, element, tree)
        check_scripts(facts)
        check_entries(facts)
    return trees.faults
