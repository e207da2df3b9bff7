"""How the nodes of a mission can end, as far as the file alone says."""
from typing import Dict, List, Mapping

from behavior_controller.bt.ends import ANY, FAILS, OF_A_LEAF, SKIPS, SUCCEEDS, by
from behavior_controller.bt.language.document import Element
from behavior_controller.bt.registry import Registry

_CONDITIONS = {"_failureIf": FAILS, "_successIf": SUCCEEDS, "_skipIf": SKIPS, "_while": SKIPS}


def outcomes(trees: Mapping[str, List[Element]], registry: Registry) -> Dict[int, int]:
    """Return how each element can end, by ``id(element)``.

    ``trees`` holds the elements of each tree in document order, called trees before those that call them.
    """
    known: Dict[int, int] = {}
    ends_of_tree: Dict[str, int] = {}
    for tree_id, elements in trees.items():
        for element in reversed(elements):  # so that children come before their parent
            known[id(element)] = _ends(element, known, ends_of_tree, registry)
        ends_of_tree[tree_id] = known[id(elements[0])]
    return known


def _ends(element: Element, known: Dict[int, int], trees: Dict[str, int], registry: Registry) -> int:
    children = [known[id(child)] for child in element.children]
    spec = registry.find(element.type_id)
    if element.tag == "SubTree":
        result = trees.get(element.attributes.get("ID", ""), ANY)
    elif spec is None or spec.outcome is None:
        result = ANY if children else OF_A_LEAF
    else:
        result = by(spec.outcome, element.attributes, children)
    for attribute, end in _CONDITIONS.items():
        if attribute in element.attributes:
            result |= end
    return result
