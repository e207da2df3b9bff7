"""The arguments of a test: every key of both configurations, and the options of the test as a whole."""
import os
import shutil
import textwrap
from typing import Dict, List, Mapping, Sequence

from behavior_controller import folders, keys, phrases, settings
from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.interface import Interface
from behavior_controller.keys import Key, Reader, boolean

from unit_tests import configuration
from unit_tests.robot import NODES

LAUNCH_FILE = "behaviorControllerTest.launch"

SHORT = {"mission": "scenarioSpecification", "scenario": "visitorBehaviour", "seed": "randomSeed",
         "verbose": "verboseMode"}
"""Short name -> key."""

USE_REAL = "use_real_"

OWN = (Key("outputFile", Reader("a file", str), "", "where the report is written"),) + tuple(
    Key(USE_REAL + node, boolean, False, "the real {} is running; it is not simulated".format(node))
    for node in NODES)
"""Arguments that are in neither configuration."""

FOLDER, DRAWN, REPORT = "folder", "drawn", "report"
INTERNAL = (FOLDER, DRAWN, REPORT)
"""Internal arguments of the launch file: the run's folder, the seed if none is given, whether there is a verdict."""

CONTROLLER = {key.name for key in settings.KEYS}
TEST = {key.name for key in configuration.KEYS}

CONTROLLER_FILE = settings.FILE_NAME

NO_RECORD = "none"
"""The value of ``recordDirectory`` with which the controller records nothing."""

STARTUP_TIMEOUT = 30.0
"""Default of the seconds that the controller waits for the simulated nodes, which start at the same time."""


def names() -> List[str]:
    """Return the names of all arguments that a user may give."""
    both = [key.name for key in configuration.KEYS + settings.KEYS + OWN]
    return list(dict.fromkeys(both + list(SHORT)))


def read(given: Sequence[str], others: Sequence[str] = ()) -> Dict[str, str]:
    """Return key -> value of arguments of the form name:=value. Raises ConfigurationError with every unknown name.

    ``others`` are accepted in addition to the names that a user may give.
    """
    values: Dict[str, str] = {}
    faults: List[Fault] = []
    for argument in given:
        name, is_assignment, value = argument.partition(":=")
        key = SHORT.get(name, name)
        text = hint = ""
        if not is_assignment:
            text, hint = "this is not of the form name:=value", "--help lists the names"
        elif key not in names() and key not in others:
            text = "unknown"
            hint = did_you_mean(name.lstrip("_"), names()) or "rosrun unit_tests runTest --help lists all"
        elif key in values:
            text, hint = "{} is given twice".format(key), "leave out all but one"
        elif not value:
            text, hint = "it has no value", "leave it out, and the configuration decides"
        values[key] = value
        if text:
            faults.append(Fault("argument " + argument, 0, 0, text, hint))
    if faults:
        raise ConfigurationError(faults)
    return values


def check(given: Mapping[str, str]) -> None:
    """Raise ConfigurationError with every value that is not allowed."""
    faults: List[Fault] = []
    for load in (load_test, load_controller, _load_both, _load_phrases, _load_own):
        try:
            load(given)
        except ConfigurationError as error:
            faults += error.faults
    if faults:
        raise ConfigurationError(list(dict.fromkeys(faults)))


def load_test(given: Mapping[str, str]) -> configuration.Configuration:
    """Return the configuration of the test. Raises ConfigurationError, also for an unknown argument."""
    others = (CONTROLLER - TEST).union(INTERNAL, (key.name for key in OWN))
    return configuration.load({name: value for name, value in given.items() if name not in others})


def _load_both(given: Mapping[str, str]) -> None:
    """Raise ConfigurationError for keys of the test that do not apply to the controller's robot."""
    test = load_test(given)
    interface = load_controller(given).interface
    faults = []
    if test.recognise_by == configuration.ACTION and not any(topic.action for topic in interface.topics):
        faults.append(_not_of(interface, "recogniseBy", "recognises speech by no action"))
    for name in test.absent_services:
        if name not in (service.name for service in interface.services):
            faults.append(_not_of(interface, "absentServices", "does not have {} anyway".format(name)))
    if faults:
        raise ConfigurationError(faults)


def _not_of(interface: Interface, key: str, why: str) -> Fault:
    return Fault(key, 0, 0, "the robot {} {}".format(interface.name, why),
                 "leave it out, or choose another robotInterface")


def load_controller(given: Mapping[str, str]) -> settings.Settings:
    """Return the controller's configuration: it decides by which means the robot asks and what a gaze status means."""
    return settings.load(folders.config(CONTROLLER_FILE), {}, {
        name: value for name, value in given.items() if name in CONTROLLER - TEST})


def _load_phrases(given: Mapping[str, str]) -> None:
    phrases.load(load_controller({name: value for name, value in given.items() if name == "language"}).language)


def _load_own(given: Mapping[str, str]) -> None:
    """Raise ConfigurationError with every fault in an argument for the test as a whole."""
    faults = []
    for key in OWN:
        try:
            key.read(given.get(key.name, str(key.default)))
        except ValueError:
            faults.append(Fault("argument " + key.name, 0, 0, "{} cannot be \"{}\"".format(key.name, given[key.name]),
                                "allowed: {}".format(key.allowed)))
    if given.get("recordDirectory") == NO_RECORD:
        faults.append(Fault("argument recordDirectory", 0, 0, "a test needs its record",
                            "leave it out, or name a folder for a copy"))
    if faults:
        raise ConfigurationError(faults)


def usage(remarks: Mapping[str, str]) -> str:
    """Return the help text: all arguments with their current defaults. Raises ConfigurationError.

    ``remarks``: key -> text that is added to its meaning.
    """
    remarks = dict({"recordDirectory": "in a test a folder for a copy, and not none"}, **remarks)
    controller = dict(load_controller({}).values, startupTimeout=STARTUP_TIMEOUT, recordDirectory="")
    lines = ["usage: rosrun unit_tests runTest [name:=value ...]", "",
             "Runs the mission against the simulated robot. The last line is the verdict; exit code 0: passed, 1: failed, "
             "2: nothing was tested. The configuration files have the defaults, shown here after the names.",
             "", configuration.FILE_NAME + ":"]
    lines += _table(configuration.KEYS, keys.values_of(load_test({})), remarks)
    lines += ["", CONTROLLER_FILE + " (verboseMode and missionRuns, which it has too, are as above):"]
    lines += _table([key for key in settings.KEYS if key.name not in TEST], controller, remarks)
    lines += ["", "the test as a whole:"] + _table(OWN, {key.name: key.default for key in OWN}, remarks)
    lines += ["", "short for " + ", ".join("{}: {}".format(*pair) for pair in SHORT.items())]
    width = shutil.get_terminal_size().columns
    return "\n".join(line for text in lines for line in textwrap.wrap(
        text, width, subsequent_indent=" " * (len(text) - len(text.lstrip()))) or [""])


def _table(chosen: Sequence[Key], values: Mapping[str, object], remarks: Mapping[str, str]) -> List[str]:
    """Return two lines for each key: its name and current value; its meaning, allowed values, and default."""
    lines: List[str] = []
    for key in chosen:
        default = key.default_text if key.default is keys.REQUIRED else "default " + key.default_text
        remark = "; " + remarks[key.name] if remarks.get(key.name) else ""
        lines.append("  {:<26} {}".format(key.name, keys.to_text(values[key.name])).rstrip())
        lines.append("      {} ({}; {}){}".format(key.plain_meaning, key.allowed, default, remark))
    return lines


# ---------------------------------------------------------------------------------------------------------- roslaunch


def parent_command() -> List[str]:
    """Return the command line of the parent process; empty if it cannot be read."""
    try:
        with open("/proc/{}/cmdline".format(os.getppid()), "rb") as file:
            return file.read().decode(errors="replace").split("\0")[:-1]
    except OSError:
        return []


def given_to_roslaunch(command: Sequence[str]) -> List[str]:
    """Return the arguments that a command line passes to our launch file: roslaunch ignores those that it does not declare."""
    if LAUNCH_FILE not in map(os.path.basename, command):
        return []
    return [word for word in command if ":=" in word and not word.startswith("__")]


def is_by_run_test(command: Sequence[str]) -> bool:
    """Return whether a command line of roslaunch comes from runTest, which passes the run's folder."""
    return any(word.startswith(FOLDER + ":=") for word in given_to_roslaunch(command))


def is_roslaunch(command: Sequence[str]) -> bool:
    """Return whether a command line runs roslaunch, directly or through an interpreter."""
    return "roslaunch" in map(os.path.basename, command[:2])
