"""The options of a test: the keys of both configurations, and those of the test as a whole.

An argument has one form from runTest on, the ``_key:=value`` that the nodes take from a user too:
parameters on a master would outlive the test and change the next one. Each process reads its
command line once (``of_process``), checks it once (``read``), and hands the ``Options`` on.
"""
import dataclasses
import os
import random
import shutil
import sys
import textwrap
from dataclasses import dataclass
from functools import partial
from typing import Collection, Dict, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

from behavior_controller import folders as controller_folders, ros_arguments
from behavior_controller.config import config_file, settings
from behavior_controller.config.config_file import (
    Key, REQUIRED, Reader, boolean, collected, filled, number, read_source)
from behavior_controller.config.settings import split_arguments, unread
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, attempt
from behavior_controller.robot.declarations import Action, Interface, Service
from behavior_controller.ros_arguments import ASSIGNMENT
from behavior_controller.simulation import behaviour
from behavior_controller.simulation.behaviour import NODES
from behavior_controller.simulation.configuration import (
    CONTROLLER, Configuration, KEYS, SEEDS, SHORT, TOPIC, load_controller, parse)
from behavior_controller.simulation.visitor import BEHAVIOURS, ENGAGES, RANDOM
from behavior_controller.simulation.world import World, world
from behavior_controller.text import Source, joined

from unit_tests import folders

LAUNCH_FILE = "behaviorControllerTest.launch"
ROBOT_LAUNCH = "simulatedRobot.launch"

FILE_NAME = "behaviorControllerTestConfiguration.ini"

STARTUP_TIMEOUT = 30.0
"""The default of ``startupTimeout`` in a test, in seconds."""

# ------------------------------------------------------------------------------------- declarations

USE_REAL = {node: "use_real_" + node for node in NODES}
"""Node -> the key that leaves the simulated one out."""

CLOCK_NODE = "simulatedClock"
"""The node that publishes /clock."""

SPEED = Key("speed", number(0.1, 20.0), 1.0, "how many times as fast as the computer's time the "
            "simulated time goes, which a node publishes on `/clock`; 1: no simulated time")

OWN = (Key("outputFile", Reader("a file", str), "",
           "where the report is written: a new file, or in place of an earlier report"),
       SPEED, *(Key(name, boolean, False, f"the real {node} is running; it is not simulated")
         for node, name in USE_REAL.items()))
"""The keys of the test as a whole, which are in neither configuration."""

FOLDER, DRAWN, _REPORT = "folder", "drawn", "report"
INTERNAL = (FOLDER, DRAWN, _REPORT)
"""Internal arguments of the launch file: the run's folder, the seed if none is given, whether there
is a verdict."""

TEST = {declared.name for declared in KEYS}
OF_THE_TEST = {declared.name for declared in OWN}

ROBOT = tuple(declared.name for declared in KEYS
              if declared.name not in ("missionRuns", "testTimeout")) + (
                  "scenarioSpecification", "robotInterface", "robot", "tabletSuccessIs",
                  "language", "mutualGazeValue")
"""The keys of both configurations that the simulated nodes read."""

NAMES = list(dict.fromkeys(declared.name for declared in KEYS + settings.KEYS + OWN)) + list(SHORT)
"""The names of all arguments that a user may give."""

HELP = "rosrun unit_tests runTest --help"

DECLARED = {LAUNCH_FILE: [*NAMES, *INTERNAL],
            ROBOT_LAUNCH: [*ROBOT, SPEED.name, *USE_REAL.values()]}
"""The arguments of each launch file."""


# ------------------------------------------------------------------------- what a process was given


class Arguments(NamedTuple):
    """What a process of a test was given; no file is read, and no value is checked."""

    words: List[str]  # the program, remapped names
    values: Mapping[str, str]  # by key

    @property
    def is_launched(self) -> bool:
        """Whether behaviorControllerTest.launch started the process, so that a report runs too."""
        return FOLDER in self.values

    @property
    def is_in_launch(self) -> bool:
        """Whether a launch file of this package started the process, so that roslaunch started the
        other nodes too."""
        return DRAWN in self.values

    @property
    def folder(self) -> str:
        """The folder of this run's journal and record; nodes that were started alone share one."""
        if self.is_in_launch and not self.is_launched:  # what was drawn is the launch's own
            return os.path.join(controller_folders.ros_home(), "log",
                                "simulatedRobot_" + self.values[DRAWN])
        own = ["unit_tests", self.values.get("robot", "").strip("/")]
        return self.values.get(FOLDER) or os.path.join(controller_folders.ros_home(),
                                                       *filter(None, own))

    @property
    def startup_timeout(self) -> str:
        """How many seconds the controller waits for the simulated nodes, which start at the same
        time."""
        return self.values.get("startupTimeout", "{:g}".format(STARTUP_TIMEOUT))

    @property
    def simulated(self) -> List[str]:
        """The nodes that the launch file starts, in its order: those that are not real."""
        return [node for node in NODES if self.values.get(USE_REAL[node], "").lower() != "true"]


def of_process() -> Arguments:
    """Return the arguments of this process."""
    return Arguments(*split_arguments(sys.argv))


def check_words(arguments: Arguments) -> None:
    """Raise ConfigurationError for each word of the command line that no simulated node reads."""
    words = arguments.words[1:]
    faults = unread(words, [declared.name for declared in (*KEYS, SPEED)])
    faults += [Fault("argument " + word, 0, 0, "the node does not read it",
                     "allowed: _key:=value, /name:=/other_name")
               for word in words if ASSIGNMENT not in word]
    ConfigurationError.raise_any(faults)


# ---------------------------------------------------------------------------- what the files decide


@dataclass(frozen=True)
class Options:
    """All options of a process of a test, checked."""

    arguments: Arguments
    test: Configuration  # with a seed and a visitor
    world: World  # with the controller's settings
    speed: float = 1.0  # of the simulated time

    @property
    def has_clock(self) -> bool:
        """Whether a node of the test publishes /clock."""
        return self.speed != 1.0

    @property
    def words(self) -> List[str]:
        """The command line for rospy. Raises ConfigurationError as ``words_of``."""
        from behavior_controller.ros.names import words_of  # who only reads options has no ROS
        return words_of(self.world.settings.robot, self.arguments.words)


def read(arguments: Arguments) -> Options:
    """Read each file once. Raises ConfigurationError with every fault of files, arguments and of
    what roslaunch was given."""
    command = ros_arguments.parent_command()  # roslaunch ignores what is not declared
    for launch_file, names in DECLARED.items():
        parse(ros_arguments.given_to_roslaunch(command, "unit_tests", launch_file), names, HELP)
    values = arguments.values
    faults: List[Fault] = []
    test = attempt(lambda: _drawn(load_test(values), values), faults)
    controller = attempt(lambda: load_controller(values), faults)
    of_test = collected(Source("", ""), OWN, {}, _chosen(values, OF_THE_TEST))
    faults += of_test.faults
    if values.get("recordDirectory") == "none":
        faults.append(Fault("argument recordDirectory", 0, 0, "a test needs its record",
                            "leave it out, or name a folder for a copy"))
    if values.get("outputFile"):
        faults += _output_faults(values["outputFile"])
    around = None
    if controller is not None:
        visitor = test.visitor_behaviour if test is not None else ENGAGES
        around = attempt(partial(world, visitor, controller), faults)
        if test is not None:
            faults += _without_effect(test, controller.interface, arguments)
    if faults or test is None or around is None:
        raise ConfigurationError(faults)
    return Options(arguments, test, around, of_test.result()[SPEED.name])


def _output_faults(report: str) -> Sequence[Fault]:
    """Return a fault if the report, or the page beside it, may not be written there."""
    try:
        folders.REPORT.check(report)
        folders.PAGE.check(folders.page_beside(report))
    except FaultsFound as refused:
        return refused.faults
    except OSError as error:
        return [Fault(error.filename, 0, 0, f"it cannot be written: {error.strerror}")]
    return []


def path() -> str:
    """Return the path of the configuration of the test."""
    return os.path.join(folders.share(), "config", FILE_NAME)


def load_test(values: Mapping[str, str]) -> Configuration:
    """Return the configuration of the test. Raises ConfigurationError, also for an unknown
    argument."""
    others = (CONTROLLER - TEST).union(INTERNAL, OF_THE_TEST)
    source = read_source(path(), "the configuration")
    given = _chosen(values, set(values) - others)
    return filled(Configuration, collected(source, KEYS, {}, given).result())


def _chosen(values: Mapping[str, str], names: Collection[str]) -> Dict[str, str]:
    return {name: value for name, value in values.items() if name in names}


def _drawn(test: Configuration, values: Mapping[str, str]) -> Configuration:
    """Return a configuration with a seed and a visitor for those that are to be random."""
    seed, visitor = test.random_seed, test.visitor_behaviour
    if seed is None:
        # a node that runs alone needs no common seed
        seed = int(values.get(DRAWN) or random.randrange(SEEDS))
    if visitor == RANDOM:
        visitor = random.Random("{}/behaviour".format(seed)).choice(BEHAVIOURS)
    return dataclasses.replace(test, random_seed=seed, visitor_behaviour=visitor)


def _without_effect(test: Configuration, robot: Interface, arguments: Arguments) -> List[Fault]:
    """Return a fault for each key that changes nothing: it is about what the controller's robot
    lacks, or about a node that is real."""
    about, real = list(_nodes_meant(test, robot)), set(NODES).difference(arguments.simulated)
    lacks = [(key, why) for key, why, nodes in about if not nodes]
    lacks += [(USE_REAL[node], f"does not have {node} anyway")
              for node in sorted(real.difference(behaviour.nodes(robot)))]
    reasons = [(key, f"the robot {robot.name} {why}", "choose another robotInterface")
               for key, why in lacks]
    reasons += [(key, f"{node} is real, and not simulated", USE_REAL[node])
                for key, _, nodes in about for node in nodes if node in real]
    return [Fault(("argument " if name in arguments.values else path() + ": ") + name, 0, 0, why,
                  "leave it out, or " + hint) for name, why, hint in reasons]


def _nodes_meant(test: Configuration, robot: Interface) -> Iterator[Tuple[str, str, List[str]]]:
    """Yield each key that is about some nodes of the robot, the reason against it if there are none
    such, and these nodes."""
    if test.recognise_by != TOPIC:
        yield ("recogniseBy", "recognises speech by no action",
               [topic.node for topic in robot.topics if topic.action])
    for key, names, kind in (("absentServices", test.absent_services, Service.kind),
                             ("absentActions", test.absent_actions, Action.kind)):
        for name in names:
            yield (key, f"does not have {name} anyway", [
                service.node for service in robot.services
                if (service.kind, service.name) == (kind, name)])
    for key, names in (("plannedFaults", tuple(fault.node for fault in test.planned_faults)),
                       ("quickNodes", test.quick_nodes)):
        for node in dict.fromkeys(names):
            yield key, f"has no service of {node}", [node] * (node in behaviour.servers(robot))


# ----------------------------------------------------------------------------------------- the help


_USAGE = (
    "usage: rosrun unit_tests runTest [name:=value ...]", "",
    "Runs the mission against the simulated robot. The last lines are the verdict and the path of "
    "its page; exit code 0: passed, 1: failed, 2: nothing was tested, 3: cut off. The "
    "configuration files have the defaults, shown here after the names.")

_SECTIONS: Mapping[str, Sequence[Key]] = {
    FILE_NAME: KEYS,
    settings.FILE_NAME + " (verboseMode and missionRuns, which it has too, are as above)":
        [declared for declared in settings.KEYS if declared.name not in TEST],
    "the test as a whole": OWN
}


def usage(of_rate: str = "") -> str:
    """Return the help text: all arguments with their current values. ``of_rate`` is added to the
    meaning of the arrival rate. Raises ConfigurationError."""
    remarks = {"recordDirectory": "in a test a folder for a copy, and not none",
               "arrivalRate": of_rate}
    values = dict(load_controller({}).values, startupTimeout=STARTUP_TIMEOUT, recordDirectory="")
    values.update(config_file.values_of(load_test({})))
    lines = list(_USAGE)
    for title, keys in _SECTIONS.items():
        lines += ["", title + ":"]
        for declared in keys:
            value = config_file.to_text(values.get(declared.name, declared.default))
            default = "" if declared.default is REQUIRED else "default "
            allowed = f"{declared.read.allowed}; {default}{declared.default_text}"
            text = f"      {declared.plain_meaning} ({allowed})"
            lines += [f"  {declared.name:<26} {value}".rstrip(),
                      joined("; ", text, remarks.get(declared.name, ""))]
    lines += ["", "short for " + ", ".join("{}: {}".format(*pair) for pair in SHORT.items())]
    width = shutil.get_terminal_size().columns
    return "\n".join(
        textwrap.fill(text, width, subsequent_indent=" " * (len(text) - len(text.lstrip())))
        for text in lines)
