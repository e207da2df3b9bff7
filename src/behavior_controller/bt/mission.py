"""From a mission to its tree in one call: read, checked, built, and linted if that is wanted."""
from typing import Any, Dict, Optional

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.wakeup import WakeUp
from behavior_controller.bt.linter.walker import lint
from behavior_controller.bt.loader.document import Document, parse, read, with_includes
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.values.blackboard import Blackboard


def load_mission(path: str, registry: Registry, main_tree: Optional[str] = None,
                 blackboard: Optional[Blackboard] = None, clock: Optional[Clock] = None,
                 wake: Optional[WakeUp] = None, enums: Optional[Dict[str, int]] = None,
                 substitutes: Optional[Dict[str, Any]] = None, strict: bool = False,
                 with_lint: bool = False) -> Tree:
    """Read a mission file and what it includes, and build its tree. Raises MissionError.

    ``main_tree`` is the tree to run, if the file does not say it; ``blackboard`` has entries of the
    host; ``clock`` and ``wake`` are those of another tree; ``enums`` are names of integers for
    scripts; ``substitutes`` are BehaviorTree.CPP's substitution rules; ``strict``: see
    ``checks.check``; ``with_lint`` adds the linter's warnings.
    """
    return _built(read(path), registry, main_tree=main_tree, blackboard=blackboard, clock=clock,
                  wake=wake, enums=enums, substitutes=substitutes, strict=strict,
                  with_lint=with_lint)


def load_text(text: str, registry: Registry, file: str = "<text>", main_tree: Optional[str] = None,
              blackboard: Optional[Blackboard] = None, clock: Optional[Clock] = None,
              wake: Optional[WakeUp] = None, enums: Optional[Dict[str, int]] = None,
              substitutes: Optional[Dict[str, Any]] = None, strict: bool = False,
              with_lint: bool = False) -> Tree:
    """As ``load_mission``, for a mission that is not a file; ``file`` is its name in messages, and
    includes are relative to the working directory."""
    return _built(parse(text, file), registry, main_tree=main_tree, blackboard=blackboard,
                  clock=clock, wake=wake, enums=enums, substitutes=substitutes, strict=strict,
                  with_lint=with_lint)


def _built(document: Document, registry: Registry, with_lint: bool, **options: Any) -> Tree:
    if with_lint:
        options["lint"] = lint
    return build(with_includes(document), registry, **options)
