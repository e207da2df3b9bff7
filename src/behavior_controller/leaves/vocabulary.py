"""The node types that missions are read with, and the loader of mission files."""
from typing import Any

from behavior_controller import leaves
from behavior_controller.bt.checking.checks import check
from behavior_controller.bt.checking.lint import lint
from behavior_controller.bt.checking.models import stale_models
from behavior_controller.bt.compiler import build
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.document import read, with_includes
from behavior_controller.bt.registry import Registry

def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(builtin_specs() + list(leaves.SPECS))


def load(path: str, **options: Any) -> Tree:
    """Return the tree of a mission file; ``tree.warnings`` has those of the linter too. Raises MissionError.

    Options are those of ``bt.compiler.build``.
    """
    documents, types = with_includes(read(path)), registry()
    tree = build(documents, types, **options)
    checked = check(documents, types, options.get("main_tree"))
    tree.warnings += stale_models(documents, types) + lint(documents, checked, types)
    tree.warnings.sort(key=lambda fault: (fault.file, fault.line, fault.column))
    return tree
