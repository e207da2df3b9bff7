"""The configuration of the simulated robot: behaviorControllerTestConfiguration.ini and what overrides it."""
import math
import os
import re
from dataclasses import dataclass
from typing import List, Mapping, Optional, Tuple

from behavior_controller.keys import (REQUIRED, Reader, boolean, filled, integer, key, keys_of, number, one_of,
                                      read_configuration)

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


@dataclass(frozen=True)
class Configuration:
    """The checked values. A field is the key of that name in camelCase."""

    failure_rate: float = key(number(0, 1), 0.1, "share of the service calls that go wrong, 0 to 1")
    arrival_rate: float = key(number(1, infinite=True, of="messages per minute"), REQUIRED,
                              "messages per minute on each topic, on average; 1 or more, `inf` allowed")
    verbose_mode: bool = key(boolean, REQUIRED, "`true`: a line for every request and every new message")
    visitor_behaviour: str = key(Reader(_BEHAVIOURS.allowed, _behaviour), ENGAGES,
                                 "what the visitor does: {}, or {}: one of them at random".format(
                                     ", ".join(map("`{}`".format, BEHAVIOURS)), "`{}`".format(RANDOM)))
    mission_runs: int = key(integer(1, 10 ** 6), 1, "visitors until the test ends")
    random_seed: Optional[int] = key(Reader(_SEED.allowed + ", or nothing", _seed), None,
                                     "the same seed, the same faults and gaps between messages; empty: random, and printed")
    fault_kinds: Tuple[str, ...] = key(
        Reader("some of {}, with commas between them".format(", ".join(KINDS)), _kinds), (REFUSED,),
        "in which ways calls go wrong: {}, with commas between them".format(", ".join(map("`{}`".format, KINDS))))
    planned_faults: Tuple[PlannedFault, ...] = key(Reader(
        "node:call or node:call:kind, with commas between them, where node is one of {}, call counts from 1 and kind is "
        "one of {}".format(", ".join(SERVERS), ", ".join(KINDS)), _planned_faults), (),
        "calls that go wrong in any case, such as `robotNavigation:3, textToSpeech:1:crash`")
    recognise_by: str = key(one_of(TOPIC, ACTION), TOPIC, "how a robot of release 1.0 reports what it hears: `topic` is "
                            "`/speechEvent/text`, `action` is `/speechEvent/recognise_speech_action`")
    absent_services: Tuple[str, ...] = key(
        Reader("some of {}, with commas between them".format(", ".join(OPTIONAL)), _services), (),
        "what a robot of release 1.0 does not offer: {}, with commas between them".format(
            ", ".join(map("`{}`".format, OPTIONAL))))
    test_timeout: float = key(number(1, 10 ** 6, of="seconds"), 900.0,
                              "seconds after which a mission that has not ended has failed")


KEYS = tuple(keys_of(Configuration).values())


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
    path = os.path.join(share(), "config", FILE_NAME)
    return filled(Configuration, read_configuration(path, KEYS, {}, arguments))


def defaults(**given: object) -> Configuration:
    """Return a configuration of the required keys alone, changed by ``given`` (camelCase)."""
    values = {each.name: each.default for each in KEYS}
    values.update(arrivalRate=math.inf, verboseMode=False)
    values.update(given)
    return filled(Configuration, values)
