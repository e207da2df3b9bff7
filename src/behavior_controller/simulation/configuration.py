"""The options of a simulated robot and its visitor: the keys of a test, and those of the controller
that a rehearsal is given."""
import dataclasses
import math
import re
from dataclasses import dataclass
from typing import (Callable, Collection, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple,
                    TypeVar)

from behavior_controller import folders
from behavior_controller.config import settings
from behavior_controller.config.config_file import (
    REQUIRED, Reader, boolean, filled, integer, key, keys_of, number, one_of)
from behavior_controller.config.settings import Settings
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.robot.declarations import Action, Interface, Service
from behavior_controller.ros_arguments import ASSIGNMENT
from behavior_controller.text import did_you_mean

from behavior_controller.simulation.behaviour import ACTIONS, OPTIONAL, SERVERS
from behavior_controller.simulation.faults import KINDS, PlannedFault, REFUSED, parse_planned_fault
from behavior_controller.simulation.visitor import ALIASES, BEHAVIOURS, ENGAGES, RANDOM

TOPIC, ACTION, IDLE_ACTION = "topic", "action", "idleAction"

AUTO, REAL, NONE = "auto", "real", "none"

VISIT = 300.0
"""Seconds that are enough for a tour whose calls take as long as on a robot."""

SEEDS = 10 ** 9
"""How many seeds there are."""

Value = TypeVar("Value")


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
        f"the visitor: {_quoted(BEHAVIOURS)}, or `{RANDOM}`")
    mission_runs: int = key(integer(1, 10 ** 6), 1, "visitors until the test ends")
    random_seed: Optional[int] = key(
        Reader(_SEED.allowed + ", or nothing", lambda text: _SEED(text) if text else None), None,
        "the same seed, the same faults and gaps between messages; empty: random, and printed")
    fault_kinds: Tuple[str, ...] = key(
        dataclasses.replace(_some_of(KINDS), is_allowed=re.compile(r"[^,\s]").search), (REFUSED,),
        f"how calls go wrong: {_quoted(KINDS)}, with commas between them")
    planned_faults: Tuple[PlannedFault, ...] = key(
        _several(
            "node:call or node:call:kind, with commas between them, where node is one of {}, "
            "call counts from 1 and kind is one of {}".format(", ".join(SERVERS), ", ".join(KINDS)),
            lambda word: parse_planned_fault(word, SERVERS)), (),
        "calls that go wrong in any case, such as `robotNavigation:3, textToSpeech:1:crash`")
    recognise_by: str = key(
        one_of(TOPIC, ACTION, IDLE_ACTION), TOPIC,
        "how a robot of release 1.0 or 1.1 reports speech: by `topic`, by `action`, "
        "or by an action that never handles a goal (`idleAction`)")
    absent_services: Tuple[str, ...] = key(
        _some_of(OPTIONAL), (),
        "services that a robot of release 1.0 or 1.1 lacks, with commas between them")
    absent_actions: Tuple[str, ...] = key(
        _some_of(ACTIONS), (),
        "actions that a robot of release 1.1 lacks, with commas between them")
    quick_nodes: Tuple[str, ...] = key(
        _some_of(SERVERS), (), "nodes whose calls take no time, with commas between them")
    call_times: str = key(
        one_of(AUTO, REAL, NONE), AUTO,
        "how long simulated calls take: `real` as on a robot, `none` no time at all, `auto` as "
        "on a robot if testTimeout has {:g} s for each visitor".format(VISIT))
    test_timeout: float = key(number(1, 10 ** 6, of="seconds"), 900.0,
                              "seconds after which a mission that has not ended is cut off")

    def lacks(self, service: Service) -> bool:
        """Return whether the robot does not offer that service, or action."""
        if isinstance(service, Action):
            return service.name in self.absent_actions
        return service.name in self.absent_services

    def carrier(self, service: Service, robot: Interface) -> Service:
        """Return what carries out the requests to a service: what stands in for it, if the robot
        lacks it and has that."""
        if not self.lacks(service):
            return service
        other = robot.substitute(service)
        return service if other is None or self.lacks(other) else other

    @property
    def takes_time(self) -> bool:
        """Whether simulated calls take as long as those of a robot."""
        has_time = self.test_timeout >= VISIT * self.mission_runs
        return self.call_times == REAL or self.call_times == AUTO and has_time


KEYS = tuple(keys_of(Configuration).values())


def defaults(**given: object) -> Configuration:
    """Return a configuration of the required keys alone, changed by ``given`` (camelCase)."""
    values = {declared.name: declared.default for declared in KEYS}
    return filled(Configuration, {**values, "arrivalRate": math.inf, "verboseMode": False, **given})


CONTROLLER = {declared.name for declared in settings.KEYS}

SHORT = {"mission": "scenarioSpecification", "scenario": "visitorBehaviour", "seed": "randomSeed",
         "verbose": "verboseMode"}
"""Short name -> key."""


def parse(words: Sequence[str], names: Collection[str], lists_all: str) -> Dict[str, str]:
    """Return key -> value of arguments of the form name:=value. Raises ConfigurationError with
    every one that is not of the allowed ``names``, which ``lists_all`` shows."""
    values: Dict[str, str] = {}
    faults: List[Fault] = []
    for word in words:
        name, is_assignment, value = word.partition(ASSIGNMENT)
        key_name = SHORT.get(name, name)
        text, hint = "", lists_all + " lists all"
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


def load_controller(values: Mapping[str, str]) -> Settings:
    """Return the controller's configuration: it decides by which means the robot asks and what a
    gaze status means."""
    names = CONTROLLER.difference(declared.name for declared in KEYS)
    chosen = {name: value for name, value in values.items() if name in names}
    return settings.load(folders.config(settings.FILE_NAME), {}, chosen)
