"""The configuration of the simulated robot: behaviorControllerTestConfiguration.ini and what overrides it."""
import os
import re
from typing import List, Mapping, NamedTuple, Optional, Tuple

from behavior_controller.keys import REQUIRED, Key, Reader, boolean, integer, number, one_of, read_configuration

from unit_tests.faults import KINDS, REFUSED, PlannedFault, parse_planned_fault
from unit_tests.robot import OPTIONAL, SERVERS
from unit_tests.visitor import ALIASES, BEHAVIOURS, ENGAGES, RANDOM

FILE_NAME = "behaviorControllerTestConfiguration.ini"

TOPIC, ACTION = "topic", "action"

SEEDS = 10 ** 9
"""How many seeds there are."""


def _items(text: str) -> List[str]:
    return [item for item in re.split(r"[,\s]+", text) if item]


def _kinds(text: str) -> Tuple[str, ...]:
    read = one_of(*KINDS)
    kinds = tuple(read(item) for item in _items(text))
    if not kinds:
        raise ValueError(text)
    return kinds


_BEHAVIOURS = one_of(*BEHAVIOURS, RANDOM, *ALIASES)


def _behaviour(text: str) -> str:
    return ALIASES.get(text) or _BEHAVIOURS(text)


def _planned_faults(text: str) -> Tuple[PlannedFault, ...]:
    return tuple(parse_planned_fault(item, SERVERS) for item in _items(text))


_SERVICE = one_of(*OPTIONAL)


def _services(text: str) -> Tuple[str, ...]:
    return tuple(_SERVICE(item) for item in _items(text))


_SEED = integer(0, SEEDS - 1)


def _seed(text: str) -> Optional[int]:
    return _SEED(text) if text else None


KEYS = (
    Key("failureRate", number(0, 1), 0.1, "share of the service calls that go wrong"),
    Key("arrivalRate", number(1, infinite=True, of="messages per minute"), REQUIRED,
        "average rate of the messages on each topic"),
    Key("verboseMode", boolean, REQUIRED, "a line for every request and for every new message"),
    Key("visitorBehaviour", Reader(_BEHAVIOURS.allowed, _behaviour), ENGAGES, "what the visitor does"),
    Key("missionRuns", integer(1, 10 ** 6), 1, "passes (visitors) until the test ends"),
    Key("randomSeed", Reader(_SEED.allowed + ", or nothing", _seed), None,
        "the same seed, the same faults and gaps; nothing: it is drawn"),
    Key("faultKinds", Reader("some of {}, with commas between them".format(", ".join(KINDS)), _kinds), (REFUSED,),
        "in which ways calls go wrong"),
    Key("plannedFaults", Reader(
        "node:call or node:call:kind, with commas between them, where node is one of {}, call counts from 1 and kind is "
        "one of {}".format(", ".join(SERVERS), ", ".join(KINDS)), _planned_faults), (),
        "calls that go wrong in any case"),
    Key("recogniseBy", one_of(TOPIC, ACTION), TOPIC,
        "how a robot of release 1.0 tells what it hears: action is /speechEvent/recognise_speech_action"),
    Key("absentServices", Reader("some of {}, with commas between them".format(", ".join(OPTIONAL)), _services), (),
        "what a robot of release 1.0 does not offer"),
    Key("testTimeout", number(1, 10 ** 6, of="seconds"), 900.0, "a mission that has not ended by then has failed"),
)


class Configuration(NamedTuple):
    """The checked values, under the names of the keys in snake_case."""

    failure_rate: float
    arrival_rate: float
    verbose_mode: bool
    visitor_behaviour: str
    mission_runs: int
    random_seed: Optional[int]  # None: it is to be drawn
    fault_kinds: Tuple[str, ...]
    planned_faults: Tuple[PlannedFault, ...]
    recognise_by: str
    absent_services: Tuple[str, ...]
    test_timeout: float


def share() -> str:
    """Return the folder that holds ``config`` and ``data``: the package in the source tree, or its share folder."""
    package = os.path.dirname(os.path.realpath(__file__))
    source = os.path.dirname(os.path.dirname(package))
    if os.path.isdir(os.path.join(source, "config")):
        return source
    prefix = os.path.abspath(os.path.join(package, *[os.pardir] * 4))  # <prefix>/lib/python3/dist-packages/unit_tests
    return os.path.join(prefix, "share", "unit_tests")


def load(arguments: Mapping[str, str]) -> Configuration:
    """Read the configuration, overridden by ``arguments``. Raises ConfigurationError with every fault."""
    return Configuration(*read_configuration(os.path.join(share(), "config", FILE_NAME), KEYS, {}, arguments).values())
