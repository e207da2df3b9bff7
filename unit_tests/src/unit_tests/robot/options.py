"""The options of a test: the keys of both configurations, and those of the test as a whole.

They are declared here, and each process of a test reads and checks them once.
All of them are arguments, which end with the process: parameters on a master would outlive the test
and change the next one.
"""
import dataclasses
import math
import os
import random
import re
import shutil
import sys
import textwrap
from dataclasses import dataclass
from functools import partial
from typing import (Callable, Collection, Dict, Iterable, List, Mapping, NamedTuple,
                    Optional, Sequence, Tuple, TypeVar)

from behavior_controller import folders as controller_folders, ros_arguments
from behavior_controller.config import config_file, settings
from behavior_controller.config.config_file import (
    Key, REQUIRED, Reader, boolean, collected, filled, integer, key, keys_of, number, one_of,
    read_source)
from behavior_controller.config.settings import Settings, split_arguments, unread
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, attempt
from behavior_controller.robot.declarations import Interface
from behavior_controller.ros_arguments import ASSIGNMENT
from behavior_controller.text import Source, did_you_mean

from unit_tests import folders
from unit_tests.robot.behaviour import NODES, OPTIONAL, SERVERS
from unit_tests.robot.faults import KINDS, PlannedFault, REFUSED, parse_planned_fault
from unit_tests.robot.visitor import ALIASES, BEHAVIOURS, ENGAGES, RANDOM
from unit_tests.robot.world import World, world

LAUNCH_FILE = "behaviorControllerTest.launch"
ROBOT_LAUNCH = "simulatedRobot.launch"

FILE_NAME = "behaviorControllerTestConfiguration.ini"

TOPIC, ACTION = "topic", "action"

AUTO, REAL, NONE = "auto", "real", "none"

VISIT = 300.0
"""Seconds that are enough for a tour whose calls take as long as on a robot."""

SEEDS = 10 ** 9
"""How many seeds there are."""

STARTUP_TIMEOUT = 30.0
"""Default of the seconds that the controller waits for the simulated nodes, which start at the same
time."""

Value = TypeVar("Value")

# ------------------------------------------------------------------------------------- declarations


def _several(allowed: str, read_one: Callable[[str], Value]) -> Reader[Tuple[Value, ...]]:
    """Return a reader of values with commas or spaces between them."""
    return Reader(allowed, lambda text: tuple(map(read_one, re.findall(r"[^,\s]+", text))))


def _some_of(names: Sequence[str]) -> Reader[Tuple[str, ...]]:
    return _several(f"some of {', '.join(names)}, with commas between them", one_of(*names))


_BEHAVIOURS = one_of(*BEHAVIOURS, RANDOM, *ALIASES)
_SEED = integer(0, SEEDS - 1)


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(map("`{}`".format, names))


@dataclass(frozen=True)
class Configuration:
    """The checked configuration of the simulated robot. A field is the key of that name in
    camelCase."""

    failure_rate: float = key(number(0, 1), 0.1, "share of the service calls that go wrong, 0 to 1")
    arrival_rate: float = key(
        number(1, infinite=True, of="messages per minute"), REQUIRED,
        "messages per minute on each topic, on average; 1 or more, `inf` allowed")
    verbose_mode: bool = key(boolean, REQUIRED,
                             "`true`: a line for every request and every new message")
    visitor_behaviour: str = key(
        Reader(_BEHAVIOURS.allowed, lambda text: ALIASES.get(text) or _BEHAVIOURS(text)), ENGAGES,
        f"what the visitor does: {_quoted(BEHAVIOURS)}, or `{RANDOM}`: one of them at random")
    mission_runs: int = key(integer(1, 10 ** 6), 1, "visitors until the test ends")
    random_seed: Optional[int] = key(
        Reader(_SEED.allowed + ", or nothing", lambda text: _SEED(text) if text else None), None,
        "the same seed, the same faults and gaps between messages; empty: random, and printed")
    fault_kinds: Tuple[str, ...] = key(
        dataclasses.replace(_some_of(KINDS), is_allowed=re.compile(r"[^,\s]").search), (REFUSED,),
        f"in which ways calls go wrong: {_quoted(KINDS)}, with commas between them")
    planned_faults: Tuple[PlannedFault, ...] = key(
        _several(
            "node:call or node:call:kind, with commas between them, where node is one of {}, "
            "call counts from 1 and kind is one of {}".format(", ".join(SERVERS), ", ".join(KINDS)),
            lambda word: parse_planned_fault(word, SERVERS)), (),
        "calls that go wrong in any case, such as `robotNavigation:3, textToSpeech:1:crash`")
    recognise_by: str = key(
        one_of(TOPIC, ACTION), TOPIC,
        "how a robot of release 1.0 reports what it hears: `topic` is "
        "`/speechEvent/text`, `action` is `/speechEvent/recognise_speech_action`")
    absent_services: Tuple[str, ...] = key(
        _some_of(OPTIONAL), (),
        f"what a robot of release 1.0 does not offer: {_quoted(OPTIONAL)}, with commas between "
        "them")
    call_times: str = key(
        one_of(AUTO, REAL, NONE), AUTO,
        "how long simulated calls take: `real` as on a robot, `none` no time at all, `auto` as "
        "on a robot if testTimeout has {:g} s for each visitor".format(VISIT))
    test_timeout: float = key(number(1, 10 ** 6, of="seconds"), 900.0,
                              "seconds after which a mission that has not ended has failed")

    @property
    def takes_time(self) -> bool:
        """Whether simulated calls take as long as those of a robot."""
        has_time = self.test_timeout >= VISIT * self.mission_runs
        return self.call_times == REAL or self.call_times == AUTO and has_time


KEYS = tuple(keys_of(Configuration).values())

USE_REAL = {node: "use_real_" + node for node in NODES}
"""Node -> the key that leaves the simulated one out."""

OWN = (Key("outputFile", Reader("a file", str), "",
           "where the report is written: a new file, or in place of an earlier report"),
       *(Key(name, boolean, False, f"the real {node} is running; it is not simulated")
         for node, name in USE_REAL.items()))
"""The keys of the test as a whole, which are in neither configuration."""

FOLDER, DRAWN, REPORT = "folder", "drawn", "report"
INTERNAL = (FOLDER, DRAWN, REPORT)
"""Internal arguments of the launch file: the run's folder, the seed if none is given, whether there
is a verdict."""

TEST = {declared.name for declared in KEYS}
CONTROLLER = {declared.name for declared in settings.KEYS}
OF_THE_TEST = {declared.name for declared in OWN}

ROBOT = tuple(declared.name for declared in KEYS
              if declared.name not in ("missionRuns", "testTimeout")) + (
                  "scenarioSpecification", "robotInterface", "tabletSuccessIs", "language",
                  "mutualGazeValue")
"""The keys of both configurations that the simulated nodes read."""

SHORT = {"mission": "scenarioSpecification", "scenario": "visitorBehaviour", "seed": "randomSeed",
         "verbose": "verboseMode"}
"""Short name -> key."""


NAMES = list(dict.fromkeys(declared.name for declared in KEYS + settings.KEYS + OWN)) + list(SHORT)
"""The names of all arguments that a user may give."""


def defaults(**given: object) -> Configuration:
    """Return a configuration of the required keys alone, changed by ``given`` (camelCase)."""
    values = {declared.name: declared.default for declared in KEYS}
    return filled(Configuration, {**values, "arrivalRate": math.inf, "verboseMode": False, **given})


# ------------------------------------------------------------------------- what a process was given


class Arguments(NamedTuple):
    """What a process of a test was given; no file is read, and no value is checked."""

    words: List[str]  # for rospy: the program, remapped names
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
        """The folder of this run's journal and record."""
        return self.values.get(FOLDER) or os.path.join(controller_folders.ros_home(), "unit_tests")

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
    faults = unread(words, [declared.name for declared in KEYS])
    faults += [Fault("argument " + word, 0, 0, "the node does not read it",
                     "allowed: _key:=value, /name:=/other_name")
               for word in words if ASSIGNMENT not in word]
    if faults:
        raise ConfigurationError(faults)


def parse(words: Sequence[str], names: Collection[str] = NAMES) -> Dict[str, str]:
    """Return key -> value of arguments of the form name:=value. Raises ConfigurationError with
    every one that is not of the allowed ``names``."""
    values: Dict[str, str] = {}
    faults: List[Fault] = []
    for word in words:
        name, is_assignment, value = word.partition(ASSIGNMENT)
        key_name = SHORT.get(name, name)
        text, hint = "", "rosrun unit_tests runTest --help lists all"
        if not is_assignment:
            text = "this is not of the form name:=value"
        elif name not in names:
            text, hint = "unknown", did_you_mean(name.lstrip("_"), names) or hint
        elif key_name in values:
            text, hint = "{} is given twice".format(key_name), "leave out all but one"
        elif not value:
            text, hint = "it has no value", "leave it out, and the configuration decides"
        values[key_name] = value
        if text:
            faults.append(Fault("argument " + word, 0, 0, text, hint))
    if faults:
        raise ConfigurationError(faults)
    return values


def given_to_roslaunch(command: Sequence[str], launch_file: str = LAUNCH_FILE) -> List[str]:
    """Return the arguments that a command line passes to a launch file of ours."""
    return ros_arguments.given_to_roslaunch(command, "unit_tests", launch_file)


def is_by_run_test(command: Sequence[str]) -> bool:
    """Return whether a command line of roslaunch comes from runTest, which passes the run's folder.
    """
    return any(word.startswith(FOLDER + ASSIGNMENT) for word in given_to_roslaunch(command))


# ---------------------------------------------------------------------------- what the files decide


@dataclass(frozen=True)
class Options:
    """All options of a process of a test, checked."""

    arguments: Arguments
    test: Configuration  # with a seed and a visitor
    world: World  # with the controller's settings


def read(arguments: Arguments) -> Options:
    """Read each file once. Raises ConfigurationError with every fault of files, arguments and of
    what roslaunch was given."""
    command = ros_arguments.parent_command()  # roslaunch ignores what it does not declare
    parse(given_to_roslaunch(command), [*NAMES, *INTERNAL])
    parse(given_to_roslaunch(command, ROBOT_LAUNCH), [*ROBOT, *USE_REAL.values()])
    values = arguments.values
    faults: List[Fault] = []
    test = attempt(lambda: _drawn(load_test(values), values), faults)
    controller = attempt(lambda: load_controller(values), faults)
    faults += collected(Source("", ""), OWN, {}, _chosen(values, OF_THE_TEST)).faults
    if values.get("recordDirectory") == "none":
        faults.append(Fault("argument recordDirectory", 0, 0, "a test needs its record",
                            "leave it out, or name a folder for a copy"))
    if values.get("outputFile"):
        faults += _output_faults(values["outputFile"])
    around = None
    if controller is not None:
        behaviour = test.visitor_behaviour if test is not None else ENGAGES
        around = attempt(partial(world, behaviour, controller), faults)
        faults += _not_of_robot(test, controller.interface) if test is not None else ()
    if faults or test is None or around is None:
        raise ConfigurationError(faults)
    return Options(arguments, test, around)


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


def load_test(values: Mapping[str, str]) -> Configuration:
    """Return the configuration of the test. Raises ConfigurationError, also for an unknown
    argument."""
    others = (CONTROLLER - TEST).union(INTERNAL, OF_THE_TEST)
    path = os.path.join(folders.share(), "config", FILE_NAME)
    source = read_source(path, "the configuration")
    given = _chosen(values, set(values) - others)
    return filled(Configuration, collected(source, KEYS, {}, given).result())


def load_controller(values: Mapping[str, str]) -> Settings:
    """Return the controller's configuration: it decides by which means the robot asks and what a
    gaze status means."""
    path = controller_folders.config(settings.FILE_NAME)
    return settings.load(path, {}, _chosen(values, CONTROLLER - TEST))


def _chosen(values: Mapping[str, str], names: Collection[str]) -> Dict[str, str]:
    return {name: value for name, value in values.items() if name in names}


def _drawn(test: Configuration, values: Mapping[str, str]) -> Configuration:
    """Return a configuration with a seed and a visitor for those that are to be random."""
    seed, behaviour = test.random_seed, test.visitor_behaviour
    if seed is None:
        # a node that runs alone needs no common seed
        seed = int(values.get(DRAWN) or random.randrange(SEEDS))
    if behaviour == RANDOM:
        behaviour = random.Random("{}/behaviour".format(seed)).choice(BEHAVIOURS)
    return dataclasses.replace(test, random_seed=seed, visitor_behaviour=behaviour)


def _not_of_robot(test: Configuration, interface: Interface) -> List[Fault]:
    """Return a fault for each key of the test that does not apply to the controller's robot."""
    reasons = [("absentServices", "does not have {} anyway".format(name))
               for name in test.absent_services
               if name not in (service.name for service in interface.services)]
    if test.recognise_by == ACTION and not any(topic.action for topic in interface.topics):
        reasons.insert(0, ("recogniseBy", "recognises speech by no action"))
    return [Fault(name, 0, 0, "the robot {} {}".format(interface.name, why),
                  "leave it out, or choose another robotInterface") for name, why in reasons]


# ----------------------------------------------------------------------------------------- the help


USAGE = (
    "usage: rosrun unit_tests runTest [name:=value ...]", "",
    "Runs the mission against the simulated robot. The last lines are the verdict and the path of "
    "its page; exit code 0: "
    "passed, 1: failed, 2: nothing was tested. The configuration files have the defaults, shown "
    "here after the names.")

SECTIONS: Mapping[str, Sequence[Key]] = {
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
    lines = list(USAGE)
    for title, keys in SECTIONS.items():
        lines += ["", title + ":"]
        for declared in keys:
            value = config_file.to_text(values.get(declared.name, declared.default))
            default = "" if declared.default is REQUIRED else "default "
            allowed = f"{declared.read.allowed}; {default}{declared.default_text}"
            text = f"      {declared.plain_meaning} ({allowed})"
            lines += [f"  {declared.name:<26} {value}".rstrip(),
                      "; ".join(filter(None, [text, remarks.get(declared.name)]))]
    lines += ["", "short for " + ", ".join("{}: {}".format(*pair) for pair in SHORT.items())]
    width = shutil.get_terminal_size().columns
    return "\n".join(
        textwrap.fill(text, width, subsequent_indent=" " * (len(text) - len(text.lstrip())))
        for text in lines)
