"""From a mission to its tree in one call: read, checked, built, and linted if that is wanted."""
from typing import Any

from behavior_controller.bt.engine.registry import Registry
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.linter.walker import lint
from behavior_controller.bt.loader.document import Document, parse, read, with_includes
from behavior_controller.bt.loader.tree_builder import build


def load_mission(path: str, registry: Registry, **options: Any) -> Tree:
    """Read a mission file and what it includes, and ``build`` it with ``options``; ``with_lint``
    adds the linter's warnings. Raises MissionError."""
    return _built(read(path), registry, **options)


def load_text(text: str, registry: Registry, file: str = "<text>", **options: Any) -> Tree:
    """As ``load_mission``, for a mission that is not a file. Includes are relative to the working
    directory."""
    return _built(parse(text, file), registry, **options)


def _built(document: Document, registry: Registry, with_lint: bool = False,
           **options: Any) -> Tree:
    if with_lint:
        options["lint"] = lint
    return build(with_includes(document), registry, **options)
