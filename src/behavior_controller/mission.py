"""Builds a mission from its files, without ROS: for the node, a replay, a rehearsal and the tests."""
import os
from dataclasses import dataclass
from typing import Callable, Iterator, List, Optional, Sequence, Tuple, TypeVar, Union

from behavior_controller import extensions, folders, knowledge_files, leaves, phrases, policy
from behavior_controller.bt.compiler import build
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.bt.language.document import Document, Element, read, with_includes
from behavior_controller.bt.registry import Registry, did_you_mean
from behavior_controller.bt.rules import Rule, error, warning
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound
from behavior_controller.events import Events
from behavior_controller.foresight import foresee
from behavior_controller.gateway import FilesGateway, Gateway, Topics
from behavior_controller.health import Health
from behavior_controller.interface import Interface, Service, Topic
from behavior_controller.interface.robots import INTERFACES
from behavior_controller.knowledge_files import Knowledge
from behavior_controller.leaves.base import MissionContext
from behavior_controller.leaves.release_1_0 import SayText
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.phrases import YES, Phrases
from behavior_controller.policy import Policy
from behavior_controller.settings import Settings

POLICY = "recoveryPolicy.ini"

_ROBOT_LACKS = error("robot-lacks", "A node cannot work, because the configured robot lacks what it asks for.")
_DOES_WITHOUT = warning("does-without", "A node does nothing, because the configured robot lacks what it asks for; the "
                                        "start tells it, not validateMission.")
_UNSAID = warning("phrase-missing", "A node says a phrase that the robot's culture file does not have.")

Part = TypeVar("Part")


@dataclass(frozen=True)
class Mission:
    """All inputs of a run, without faults. ``file`` is the path of the mission.

    ``knowledge`` is set if files replace the robot's knowledge base.
    """

    settings: Settings
    file: str
    phrases: Phrases
    policy: Policy
    tree: Tree
    knowledge: Optional[Knowledge] = None

    @property
    def language(self) -> str:
        """The language that the robot speaks."""
        return self.settings.language if self.knowledge is None else self.knowledge.language

    @property
    def offers(self) -> Tuple[Union[Service, Topic], ...]:
        """The services and topics that the mission's nodes use, or all of the robot's if ``startupCheck`` says so."""
        robot = self.settings.interface
        if self.settings.startup_check == "all":
            return robot.offers
        specs = [node.spec for node in self.tree.nodes if isinstance(node.spec, MissionSpec)]
        return robot.used({request for spec in specs for request in spec.calls},
                          {sense for spec in specs for sense in spec.listens})

    @property
    def warnings(self) -> Tuple[Fault, ...]:
        """The warnings of mission and knowledge files."""
        return tuple(self.tree.warnings) + (self.knowledge.warnings if self.knowledge is not None else ())

    def context(self, gateway: Gateway, topics: Topics, events: Events,
                health: Optional[Health] = None) -> MissionContext:
        """Return the leaves' shared context for a run on ``gateway`` and ``topics``."""
        known = self.knowledge
        if known is not None:
            gateway = FilesGateway(gateway, {"exhibits": known.tour, "home": (known.start,), "entrance": (known.end,)})
        return MissionContext(
            gateway, topics, self.settings, self.phrases, self.policy, self.tree.clock, events, health, known,
            self.offers)


def load(settings: Settings, clock: Optional[Clock] = None, wake: Optional[WakeUp] = None,
         documents: Optional[Sequence[Document]] = None) -> Mission:
    """Read all files that ``settings`` name. Raises FaultsFound with every fault of all files.

    ``documents`` are run instead of the mission file; the mission is the last of them. ``clock`` and ``wake``: see ``build``.
    """
    file = documents[-1].file if documents else find(settings.scenario_specification)
    faults: List[Fault] = []

    def attempt(part: Callable[[], Part]) -> Optional[Part]:
        try:
            return part()
        except FaultsFound as found:
            faults.extend(found.faults)
        except extensions.BrokenExtension as broken:
            faults.append(Fault("package.xml", 0, 0, str(broken)))
        return None

    known = attempt(knowledge_files.load) if settings.interface.has_knowledge_files else None
    spoken = attempt(lambda: phrases.load(settings.language if known is None else known.language))
    rules = attempt(lambda: policy.load(folders.config(POLICY), leaves.mission_specs()))
    tree = attempt(lambda: build_tree(documents or with_includes(read(file)), clock=clock, wake=wake))
    if settings.interface.tells_pressed and settings.tablet_success_is == YES:
        faults.append(Fault("tabletSuccessIs", 0, 0, "the tablet of the robot {} says which button was pressed".format(
            settings.robot_interface), "leave tabletSuccessIs out, or choose another robotInterface"))
    told = [] if tree is None else done_without(tree, settings.interface) + on_robot(tree, settings, known)
    faults += [fault for fault in told if not fault.is_warning]
    if spoken is None or rules is None or tree is None or faults:
        raise FaultsFound(list(dict.fromkeys(faults)))
    tree.warnings += told
    return Mission(settings, file, spoken, rules, tree, known)


def on_robot(tree: Tree, settings: Settings, knowledge: Optional[Knowledge] = None) -> List[Fault]:
    """Return faults and warnings about a mission on the robot of ``settings``: what it lacks, and what cannot work there.

    ``knowledge`` is that of the robot's files, if it has any.
    """
    misfits = [_misfit(_ROBOT_LACKS, element, spec, settings.interface)
               for element, spec in _mission_nodes(tree) if not spec.does_without]
    unsaid = [] if knowledge is None else [
        node.element.fault(_UNSAID, "the culture file has no utility phrase {}".format(node.number),
                           knowledge.sources[1].file, "name")
        for node in tree.nodes if isinstance(node, SayText) and node.number not in knowledge.phrases]
    return [fault for fault in dict.fromkeys(misfits + unsaid) if fault is not None] + foresee(tree, settings)


def done_without(tree: Tree, robot: Interface) -> List[Fault]:
    """Return warnings about node types that do nothing since the robot lacks their service, each at its first place."""
    first = {spec.id: (element, spec) for element, spec in reversed(_mission_nodes(tree)) if spec.does_without}
    found = [_misfit(_DOES_WITHOUT, element, spec, robot) for element, spec in first.values()]
    return [fault for fault in found if fault is not None]


def _mission_nodes(tree: Tree) -> List[Tuple[Element, MissionSpec]]:
    return [(node.element, node.spec) for node in tree.nodes if isinstance(node.spec, MissionSpec)]


def _misfit(rule: Rule, element: Element, spec: MissionSpec, robot: Interface) -> Optional[Fault]:
    """Return a fault if the robot lacks what a node needs, or None."""
    lacking = ", ".join(_lacking(spec, robot))
    if not lacking:
        return None
    others = " or ".join(name for name, other in INTERFACES.items() if not list(_lacking(spec, other)))
    return element.fault(rule, "{} {} with the robot {}: it has no {}".format(
        spec.id, "does nothing" if spec.does_without else "cannot work", robot.name, lacking),
        "set robotInterface {}".format(others) if others else "no robot has one; declare it in the robot's interface")


def _lacking(spec: MissionSpec, robot: Interface) -> Iterator[str]:
    """Return what a node needs and a robot does not offer."""
    for request in spec.calls:
        if not robot.serves(request):
            yield "service for {}".format(request.__name__)
    for sense in spec.listens:
        if not robot.tells(sense):
            yield ("topic {}".format(sense.name) if isinstance(sense, Topic) else
                   "message that tells of the visitor's {}".format(sense.value))


def load_tree(path: str, main_tree: Optional[str] = None, clock: Optional[Clock] = None) -> Tree:
    """Return the tree of a mission file, with the linter's warnings. Raises MissionError with every fault."""
    return build_tree(with_includes(read(path)), main_tree, clock)


def build_tree(documents: Sequence[Document], main_tree: Optional[str] = None, clock: Optional[Clock] = None,
               wake: Optional[WakeUp] = None, registry: Optional[Registry] = None) -> Tree:
    """As ``load_tree``, given documents, the mission last, and optionally other node types."""
    return build(documents, registry or leaves.registry(), clock, main_tree=main_tree, wake=wake, with_lint=True)


def find(name: str) -> str:
    """Return the path of a mission in our data folder, or in that of a package that exports leaves.

    Raises ConfigurationError with the names of those that exist.
    """
    places = [folders.data("")] + [os.path.join(extension.folder, "data") for extension in extensions.found("leaves")]
    for place in places:
        path = os.path.join(place, name + ".xml")
        if os.path.isfile(path):
            return path
    known = sorted(file[:-4] for place in places if os.path.isdir(place) for file in os.listdir(place)
                   if file.endswith(".xml"))
    raise ConfigurationError([Fault("scenarioSpecification", 0, 0, "there is no mission " + folders.mission(name),
                                    did_you_mean(name, known) or "there are: {}".format(", ".join(known)))])
