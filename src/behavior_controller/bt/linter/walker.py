"""Warns of what loads, but is probably a mistake: the one walk over a checked mission's elements,
on which each rule looks at each of them."""
from typing import List

from behavior_controller.bt.linter.calls import check_call, check_entries, check_tree_models
from behavior_controller.bt.linter.facts import MissionFacts
from behavior_controller.bt.linter.palette import check_models
from behavior_controller.bt.linter.scripts import check_scripts
from behavior_controller.bt.loader.structure import Trees
from behavior_controller.bt.linter.warnings import check_node
from behavior_controller.errors import Fault


def lint(trees: Trees) -> List[Fault]:
    """Return the findings about a checked mission; if it has no errors, with warnings."""
    if not trees.findings.errors:
        check_models(trees.documents, trees.registry, trees.findings)
        trees.check_unused()
        facts = MissionFacts(trees)
        for tree, element in facts.walk():
            (check_call if element.tag == "SubTree" else check_node)(facts, element, tree)
        check_tree_models(facts)
        check_scripts(facts)
        check_entries(facts)
    return trees.faults
