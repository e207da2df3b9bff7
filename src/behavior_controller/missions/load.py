"""Builds a mission from its files, without ROS: for the node, a replay, a rehearsal and the tests.
"""
import os
from dataclasses import dataclass
from typing import Dict, Iterator, List, Optional, Sequence, Set, Tuple, Union

from behavior_controller import extensions, folders, leaves
from behavior_controller.config import knowledge_files, phrases, recovery_policy
from behavior_controller.config.knowledge_files import Knowledge
from behavior_controller.bt.linter.palette import others
from behavior_controller.bt.linter.walker import lint
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt import Clock, Registry, Tree
from behavior_controller.bt.engine.registry import argument
from behavior_controller.wakeup import WakeUp
from behavior_controller.bt.loader.document import Document, read, with_includes
from behavior_controller.bt.loader import rules
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, MissionError, attempt
from behavior_controller.run.observed_gateway import ObservedGateway
from behavior_controller.leaves import data
from behavior_controller.run.events import Events, TreeShown
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.missions.late_begin import late_begins
from behavior_controller.missions.left_out_steps import left_out_steps
from behavior_controller.missions.path_analysis import foresee
from behavior_controller.robot.gateway import FilesGateway, Gateway, Topics
from behavior_controller.run.health import Health
from behavior_controller.robot.declarations import Interface, Service, Topic
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.robot.requests import Say
from behavior_controller.leaves.base import MissionContext
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.settings import OPERATOR, Settings, defaults
from behavior_controller.text import did_you_mean

POLICY = "recoveryPolicy.ini"

_NOT_PUBLISHED = {
    "labTourAsync": "the published configuration of release 1.1 names it, but the file was not "
                    "published: release_1_1_tour is a tour of that kind"}
"""Missions that are asked for and exist nowhere."""


@dataclass(frozen=True)
class Mission:
    """All inputs of a run, without faults. ``file`` is the path of the mission.

    ``knowledge`` is set if files replace the robot's knowledge base.
    """

    settings: Settings
    file: str
    phrases: phrases.Phrases
    policy: recovery_policy.Policy
    tree: Tree
    knowledge: Optional[Knowledge] = None

    @property
    def language(self) -> str:
        """The language that the robot speaks."""
        return (self.knowledge or self.settings).language

    @property
    def offers(self) -> Tuple[Union[Service, Topic], ...]:
        """The services and topics that the mission's nodes use, or all of the robot's if
        ``startupCheck`` says so."""
        robot = self.settings.interface
        if self.settings.startup_check == "all":
            return robot.offers
        specs = [node.spec for node in self.tree.nodes if isinstance(node.spec, MissionSpec)]
        return robot.used({request for spec in specs for request in spec.calls},
                          {sense for spec in specs for sense in spec.listens})

    @property
    def warnings(self) -> Tuple[Fault, ...]:
        """The warnings of configuration, mission and knowledge files."""
        known = self.knowledge.warnings if self.knowledge is not None else ()
        return self.settings.warnings + tuple(self.tree.warnings) + known

    def context(self, gateway: Gateway, topics: Topics, events: Events,
                health: Optional[Health] = None) -> MissionContext:
        """Return the leaves' shared context for a run on ``gateway`` and ``topics``."""
        gateway = ObservedGateway(gateway, self.settings.interface, events.emit)
        known = self.knowledge
        if known is not None:
            places = {"exhibits": known.tour, "home": known.tour[:1], "entrance": known.tour[-1:]}
            gateway = FilesGateway(gateway, places)
        return MissionContext(gateway, topics, self.settings, self.phrases, self.policy,
                              self.tree.clock, events, health, known, self.offers)


def load(settings: Settings, clock: Optional[Clock] = None, wake: Optional[WakeUp] = None,
         documents: Optional[Sequence[Document]] = None) -> Mission:
    """Read all files that ``settings`` name. Raises FaultsFound with every fault of all files.

    ``documents`` are run instead of the mission file; the mission is the last of them. ``clock``
    and ``wake``: see ``build``.
    """
    name = settings.scenario_specification
    file = documents[-1].file if documents else find(name)
    faults: List[Fault] = []
    known, spoken, policy = robot_files(settings, name, faults)
    tree = attempt(lambda: build_tree(documents or with_includes(read(file)), None, clock, wake),
                   faults)
    faults += keys_without_meaning(settings, known)
    if tree is not None:
        tree.warnings += on_robot(tree, settings, known)
        faults += [fault for fault in tree.warnings if not fault.is_warning]
    if spoken is None or policy is None or tree is None or faults:
        raise FaultsFound(list(dict.fromkeys(faults)))
    return Mission(settings, file, spoken, policy, tree, known)


def robot_files(settings: Settings, mission: str, faults: List[Fault]) -> Tuple[
        Optional[Knowledge], Optional[phrases.Phrases], Optional[recovery_policy.Policy]]:
    """Return what the robot of ``settings`` knows, what it says in a mission, and its recovery
    policy; None for those with faults, which are added to ``faults``."""
    known = None
    if settings.interface.has_knowledge_files:
        known = attempt(lambda: knowledge_files.load(
            mission, settings.interface.takes_arm), faults)
    language, specs = (known or settings).language, leaves.mission_specs()
    return (known, attempt(lambda: phrases.load(language, mission), faults),
            attempt(lambda: recovery_policy.load(folders.config(POLICY), specs), faults))


def keys_without_meaning(settings: Settings, known: Optional[Knowledge]) -> Iterator[Fault]:
    """Yield a fault for each key that has no meaning for the robot, or without another key."""
    robot, usual = settings.interface, defaults()
    without: Dict[str, str] = {}  # keys that have no meaning, and why
    if robot.tells_pressed:
        without["tabletSuccessIs"] = (
            f"the tablet of the robot {robot.name} says which button was pressed")
    if not (robot.serves(Say) and robot.service(Say).answers_early(Say(""))):
        answers = f"the robot {robot.name} answers when it has spoken"
        without.update(waitForSpeech=answers, speechPace=answers)
    if settings.start_by == OPERATOR and not settings.ros_interface:
        yield Fault("startBy", 0, 0, "without rosInterface true no operator can start the mission",
                    "set rosInterface true, or leave startBy out")
    for key, why in without.items():
        if settings.values[key] != usual.values[key]:
            yield Fault(key, 0, 0, why, f"leave {key} out, or choose another robotInterface")
    if known is not None and settings.language not in (known.language, usual.language):
        yield Fault("language", 0, 0,
                    f"the culture file of the robot {robot.name} says {known.language}",
                    f"leave language out, or change phraseLanguage in {known.sources[1].file} too")


def on_robot(tree: Tree, settings: Settings, knowledge: Optional[Knowledge] = None) -> List[Fault]:
    """Return faults and warnings about a mission on the robot of ``settings``: what it lacks, and
    what cannot work there.

    ``knowledge`` is that of the robot's files, if it has any.
    """
    faults = unsupported(tree, settings.interface)
    for node in tree.nodes:
        spec, number = node.spec, argument(node.name)
        if (knowledge and isinstance(spec, MissionSpec) and spec.says_phrase
                and int(number) not in knowledge.phrases):
            text = f"the culture file has no utility phrase {number}"
            file, known = knowledge.sources[1].file, map(str, sorted(knowledge.phrases))
            hint = (f"there are: {', '.join(known) or 'none'}; or add a line to {file}: "
                    f"utilityPhrase{knowledge.language}{number} <text>")
            fault = node.element.fault(rules.PHRASE_MISSING, text, hint, "name")
            faults.append(fault._replace(is_warning=settings.interface.numbers_phrases))
    faults = [*dict.fromkeys(faults), *left_out_steps(tree), *late_begins(tree)]
    return faults + foresee(tree, settings)


def unsupported(tree: Tree, robot: Interface) -> List[Fault]:
    """Return faults of nodes that cannot work since the robot lacks their service or message, and
    a warning about each node type that does nothing then, at its first place."""
    faults: List[Fault] = []
    done_without: Set[str] = set()  # node types
    for node in tree.nodes:
        spec = node.spec
        if (not isinstance(spec, MissionSpec) or spec.id in done_without
                or not _lacking(spec, robot)):
            continue
        rule, effect = rules.ROBOT_LACKS, "cannot work"
        if spec.does_without:
            done_without.add(spec.id)
            rule, effect = rules.DOES_WITHOUT, "does nothing"
        lacking = _lacking(spec, robot)
        text = f"{spec.id} {effect} with the robot {robot.name}: it has no {lacking}"
        others = [name for name, other in INTERFACES.items() if not _lacking(spec, other)]
        hint = f"set robotInterface {' or '.join(others)}"
        if not others:
            hint = "no robot has one; declare it in the robot's interface"
        faults.append(node.element.fault(rule, text, hint))
    return faults


def _lacking(spec: MissionSpec, robot: Interface) -> str:
    """Return what a node needs and a robot does not offer."""
    services = [f"service for {request.__name__}" for request in spec.calls
                if not robot.serves(request) and request not in robot.never_asked]
    return ", ".join(services + [
        f"topic {sense.name}" if isinstance(sense, Topic) else f"message about {sense.noun}"
        for sense in spec.listens if not robot.tells(sense)])


def load_tree(path: str, main_tree: Optional[str] = None, clock: Optional[Clock] = None) -> Tree:
    """Return the tree of a mission file, with the linter's warnings. Raises MissionError with every
    fault."""
    return build_tree(with_includes(read(path)), main_tree, clock)


def build_tree(documents: Sequence[Document], main_tree: Optional[str] = None,
               clock: Optional[Clock] = None, wake: Optional[WakeUp] = None,
               registry: Optional[Registry] = None) -> Tree:
    """As ``load_tree``, given documents, the mission last, and optionally other node types."""
    if registry is None:
        registry = leaves.registry()
        MissionError.raise_any(list(others(documents, registry).values()))
    return build(documents, registry, clock, main_tree=main_tree, wake=wake, lint=lint)


def mission_folders() -> List[str]:
    """Return our data folder, and those of packages that export something to us."""
    exporting = dict.fromkeys(extension.folder for kind in extensions.EXPORTS
                              for extension in extensions.exported(kind))
    return [folders.data("")] + [os.path.join(folder, "data") for folder in exporting]


def find(name: str) -> str:
    """Return the path of a mission in our data folder, or in that of a package that exports
    something.

    Raises ConfigurationError with the names of those that exist.
    """
    known = {os.path.basename(path)[:-len(".xml")]: path for path in reversed(missions())}
    if name in known:
        return known[name]
    hint = (_NOT_PUBLISHED.get(name) or did_you_mean(name, known)
            or f"there are: {', '.join(sorted(known))}")
    text = "there is no mission " + folders.mission(name)
    raise ConfigurationError.of("scenarioSpecification", text, hint)


def missions() -> List[str]:
    """Return the paths of all missions that ``find`` finds, ours first."""
    return [os.path.join(place, file) for place in mission_folders() if os.path.isdir(place)
            for file in sorted(os.listdir(place)) if file.endswith(".xml")]


def describe(tree: Tree, number: int) -> TreeShown:
    """Return the event for a mission's tree that is going to run, the ``number``-th of the run."""
    return shown(tree, number, list(leaves.registry().values()), data.TIMES)
