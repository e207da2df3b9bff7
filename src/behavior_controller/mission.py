"""Puts a mission together from its files, without ROS: for the node, a replay, a rehearsal and the tests."""
import os
from dataclasses import dataclass
from typing import Callable, List, Optional, Sequence, TypeVar

from behavior_controller import folders, leaves, phrases, policy
from behavior_controller.bt.compiler import build
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.bt.language.document import Document, read, with_includes
from behavior_controller.bt.registry import Registry, did_you_mean
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound
from behavior_controller.events import Events
from behavior_controller.gateway import Gateway, Topics
from behavior_controller.health import Health
from behavior_controller.leaves.base import MissionContext
from behavior_controller.phrases import Phrases
from behavior_controller.policy import Policy
from behavior_controller.settings import Settings

POLICY = "recoveryPolicy.ini"

Part = TypeVar("Part")


@dataclass(frozen=True)
class Mission:
    """All that decides about a run, found right. ``file`` is the path of the mission; its warnings are the tree's."""

    settings: Settings
    file: str
    phrases: Phrases
    policy: Policy
    tree: Tree

    def context(self, gateway: Gateway, topics: Topics, events: Events,
                health: Optional[Health] = None) -> MissionContext:
        """Return what the leaves share while the mission runs on ``gateway`` and ``topics``."""
        return MissionContext(gateway, topics, self.settings, self.phrases, self.policy, self.tree.clock, events, health)


def load(settings: Settings, clock: Optional[Clock] = None, wake: Optional[WakeUp] = None,
         documents: Optional[Sequence[Document]] = None) -> Mission:
    """Read all that ``settings`` name. Raises FaultsFound with every fault of all files.

    ``documents`` are what to run instead of the mission file, the mission last. ``clock`` and ``wake``: see ``build``.
    """
    file = documents[-1].file if documents else find(settings.scenario_specification)
    faults: List[Fault] = []

    def attempt(part: Callable[[], Part]) -> Optional[Part]:
        try:
            return part()
        except FaultsFound as found:
            faults.extend(found.faults)
            return None

    spoken = attempt(lambda: phrases.load(settings.language))
    rules = attempt(lambda: policy.load(folders.config(POLICY), leaves.SPECS))
    tree = attempt(lambda: build_tree(documents or with_includes(read(file)), clock=clock, wake=wake))
    if spoken is None or rules is None or tree is None:
        raise FaultsFound(faults)
    return Mission(settings, file, spoken, rules, tree)


def load_tree(path: str, main_tree: Optional[str] = None, clock: Optional[Clock] = None) -> Tree:
    """Return the tree of a mission file, with the linter's warnings. Raises MissionError with every fault."""
    return build_tree(with_includes(read(path)), main_tree, clock)


def build_tree(documents: Sequence[Document], main_tree: Optional[str] = None, clock: Optional[Clock] = None,
               wake: Optional[WakeUp] = None, registry: Optional[Registry] = None) -> Tree:
    """As ``load_tree``, for documents that were read already, the mission last, and perhaps with other node types."""
    return build(documents, registry or leaves.registry(), clock, main_tree=main_tree, wake=wake, with_lint=True)


def find(name: str) -> str:
    """Return the path of a mission in the data folder; raises ConfigurationError, which names those that are there."""
    path = folders.mission(name)
    if os.path.isfile(path):
        return path
    known = sorted(file[:-4] for file in os.listdir(folders.data("")) if file.endswith(".xml"))
    raise ConfigurationError([Fault("scenarioSpecification", 0, 0, "there is no mission {}".format(path),
                                    did_you_mean(name, known) or "there are: {}".format(", ".join(known)))])
