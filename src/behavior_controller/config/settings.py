"""The controller's configuration: its keys, each with its type, default and meaning, as one frozen
record."""
import re
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Collection, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple

from behavior_controller.ros_arguments import ASSIGNMENT, ROS_WORDS
from behavior_controller.errors import Fault
from behavior_controller.robot.declarations import Interface, Plain, Service
from behavior_controller.robot.interfaces import DEFAULT, INTERFACES, Remapped, interface_of
from behavior_controller.config.config_file import (
    Key, KeyReader, REQUIRED, bind_address, boolean, collected, filled, folder, integer, key,
    keys_of, language_name, mission_name, namespace, number, one_of, port, read_source, seconds,
    values_of)
from behavior_controller.config.phrases import YES
from behavior_controller.text import Source, did_you_mean

FILE_NAME = "behaviorControllerConfiguration.ini"

UNUSED = ("audioDebugMode", "audioMode")
"""Keys of the releases' own controller that have no meaning here."""

DESCRIPTIONS = "descriptions"
"""The value of ``waitForSpeech`` that means the descriptions of exhibits alone."""

OPERATOR = "operator"
"""The value of ``startBy`` with which a mission waits for its start."""


@dataclass(frozen=True)
class Settings:
    """The checked configuration. A field is the key of that name in camelCase: ``asr_enabled`` is
    ``asrEnabled``.

    ``deadlines`` has the seconds of each key of a deadline: see ``deadline``. ``warnings`` are
    about keys without effect. ``remapped`` are names that are no keys: see ``interface``.
    """

    deadlines: Mapping[str, float]
    warnings: Tuple[Fault, ...]
    scenario_specification: str = key(mission_name, REQUIRED,
                                      "the mission to run: `data/<name>.xml`")
    verbose_mode: bool = key(boolean, REQUIRED, "`true`: a line for every leaf that finishes")
    asr_enabled: bool = key(boolean, REQUIRED,
                            "`true`: visitors answer by voice; `false`: on the tablet")
    robot_interface: str = key(one_of(*INTERFACES), DEFAULT.name, "the interface of the robot's "
                               "nodes: " + " or ".join(map("`{}`".format, INTERFACES)))
    robot: str = key(namespace, "", "`robot1`: all names, also the controller's, are below "
                                    "`/robot1`; empty: as in the document")
    tablet_success_is: str = key(one_of("done", YES), "done", "release-1.0, release-1.1: `yes` "
                                 "counts any press on the tablet as yes, `done` as no answer")
    wait_for_speech: str = key(one_of(DESCRIPTIONS, "all", "none"), DESCRIPTIONS, "release-1.0, in "
                               "English: the speeches that last as long as their words")
    speech_pace: float = key(number(0.1, 100.0, of="words per second"), 3.0, "release-1.0, in "
                             "English: the words that the robot speaks per second")
    language: str = key(language_name, "English",
                        "the robot's phrases: `data/phrases_<language>.ini`")
    mission_runs: int = key(integer(0, 10 ** 9), 0, "passes (visitors) to run; 0: no limit")
    startup_timeout: float = key(seconds(), 0.0,
                                 "seconds to wait for missing robot nodes at the start")
    startup_check: str = key(one_of("mission", "all"), "mission", "checked at the start and "
                             "monitored: the services and topics of the `mission`, or `all` of the "
                             "robot")
    topic_max_age: float = key(seconds(0.001), 2.0,
                               "seconds after which a face or gaze message counts as absent")
    condition_wait: float = key(seconds(), 0.0, "seconds that a condition waits for its evidence, "
                                "for missions that do not wait themselves")
    mutual_gaze_value: int = key(integer(1, 2), 1, "the value of `/overtAttention/mode` that means "
                                 "mutual gaze: 1 in the document, 2 on the robot")
    welcome_gesture_id: int = key(integer(0, 255), 1, "the iconic gesture of WelcomeGesture")
    goodbye_gesture_id: int = key(integer(0, 255), 3, "the iconic gesture of GoodbyeGesture")
    deictic_gesture_id: int = key(integer(0, 255), 1, "the gesture of PerformDeicticGesture")
    gesture_duration: int = key(integer(1, 600000, "milliseconds"), 3000,
                                "duration of a gesture, in ms")
    groot2_port: int = key(port(65534), 1667,
                           "port for Groot2, which also uses the next one; 0: none")
    groot2_address: str = key(bind_address, "127.0.0.1", "bind address for Groot2: `127.0.0.1` "
                              "serves this computer alone, `0.0.0.0` all networks")
    monitor_port: int = key(port(65535), 8080,
                            "port of the page that shows the mission; 0: no page")
    monitor_address: str = key(bind_address, "127.0.0.1",
                               "bind address for the page, as `groot2Address`")
    ros_interface: bool = key(boolean, False, "`true`: publishes `/diagnostics` and `~state`, "
                              "offers `~start`, `~pause`, `~stop` and `~reload`")
    start_by: str = key(one_of("robot", OPERATOR), "robot", "`operator`: the first visitor waits "
                        "for a call of `~start` (with `rosInterface true`)")
    record_directory: str = key(folder, "", "folder for the records; empty: one among ROS' "
                                            "logs; `none`: no record")
    remapped: Remapped = ()

    def deadline(self, service: Service) -> float:
        """Return the seconds that a call of ``service`` may take."""
        return self.deadlines[service.deadline_key]

    @property
    def interface(self) -> Interface:
        """What the robot offers."""
        return interface_of(self.robot_interface, self.robot, self.remapped)

    @property
    def tablet_tells(self) -> bool:
        """Whether a visitor can answer on the tablet."""
        return self.interface.tells_pressed or self.tablet_success_is == YES

    @property
    def gaze_value(self) -> int:
        """The value of /overtAttention/mode that means mutual gaze."""
        return self.interface.gaze_value or self.mutual_gaze_value

    @property
    def values(self) -> Dict[str, Plain]:
        """The value of each key."""
        return dict(values_of(self), **self.deadlines)


def _deadlines() -> Iterator[Key]:
    """Yield the keys of the deadlines; the services of a node share one."""
    by_key: Dict[str, List[Service]] = {}
    for robot in INTERFACES.values():
        for service in robot.services:
            by_key.setdefault(service.deadline_key, []).append(service)
    for name, services in by_key.items():
        names = " or ".join(dict.fromkeys(f"`{service.name}`" for service in services))
        yield Key(name, seconds(0.001), services[0].deadline, f"seconds for {names}")


_DEADLINES = tuple(_deadlines())
KEYS: Tuple[Key, ...] = tuple(keys_of(Settings).values()) + _DEADLINES


def _settings(values: Mapping[str, object], warnings: Sequence[Fault] = ()) -> Settings:
    """Return the settings that have these values, one for each of ``KEYS``."""
    deadlines = {key.name: values[key.name] for key in _DEADLINES}
    return filled(Settings, values, deadlines=MappingProxyType(deadlines), warnings=tuple(warnings))


def defaults(**given: Plain) -> Settings:
    """Return the settings of a configuration of the required keys alone, changed by ``given``
    (camelCase)."""
    values = {key.name: key.default for key in KEYS}
    values.update(scenarioSpecification="lab_tour", verboseMode=False, asrEnabled=True)
    return _settings({**values, **given})


_PRIVATE = re.compile(f"_(?!_)(.*?){ASSIGNMENT}(.*)", re.DOTALL)


def split_arguments(argv: Sequence[str]) -> Tuple[List[str], Dict[str, str]]:
    """Return the arguments for rospy, and key -> value of each ``_key:=value``.

    rospy would put the latter on the parameter server, where they outlive the process and a later
    process reads them.
    """
    others = [argument for argument in argv if not _PRIVATE.fullmatch(argument)]
    given = {match[1]: match[2] for match in map(_PRIVATE.fullmatch, argv) if match}
    return others, given


def unread(words: Iterable[str], keys: Optional[Sequence[str]] = None) -> List[Fault]:
    """Return a fault for each ``name:=value`` that a node would ignore: it seems to mean a key, or
    one of ``ROS_WORDS``.

    A name with a slash is a remapping, and a ``_key`` belongs to the configuration. The node's ROS
    names have slashes. ``keys`` are those of the node; None: the controller's.
    """
    known = ["_" + name for name in ([key.name for key in KEYS] if keys is None else keys)]
    faults = []
    for word in words:
        name, is_assignment, value = word.partition(ASSIGNMENT)
        if not is_assignment or "/" in name or name in (*ROS_WORDS, "rosout"):
            continue
        text, hint = f"the node does not read {name}", did_you_mean("_" + name, known)
        if name.startswith("__"):
            hint = did_you_mean(name, ROS_WORDS) or f"allowed: {', '.join(ROS_WORDS)}"
        elif not hint and ASSIGNMENT in value:
            text = "this is not of the form name:=other_name"
        elif not hint:
            continue
        faults.append(Fault("argument " + word, 0, 0, text, hint))
    return faults


def load(path: str, overrides: Mapping[str, object] = {},
         arguments: Mapping[str, str] = {}) -> Settings:
    """Read the controller's configuration. Raises ConfigurationError with every fault."""
    reader = collected(read_source(path, "the configuration"), KEYS, overrides, arguments, UNUSED)
    return _settings(reader.result(), reader.warnings)


def valid_values(path: str, overrides: Mapping[str, object],
                 arguments: Mapping[str, str]) -> Dict[str, Plain]:
    """Return the value of each key of a configuration; of one with a mistake the default. Raises
    ConfigurationError if it cannot be read."""
    source = read_source(path, "the configuration")
    found = collected(source, KEYS, overrides, arguments, UNUSED).values
    return {**defaults().values, **{name: value for name, value in found.items()
                                    if value is not None}}


def recorded(values: Mapping[str, object], where: str, names: Collection[str] = ()) -> Settings:
    """Return settings from their values in a record, and from the resolved ``names`` of all that
    the robot offers. Raises ConfigurationError with every fault."""
    reader = KeyReader(Source(where, ""), KEYS)
    for name, value in values.items():
        reader.given(name, value, where)
    chosen = _settings(reader.result())
    usual = {offer.name: chosen.interface.name_of(offer) for offer in chosen.interface.offers}
    if len(names) != len(usual):  # of another release, or two have one name
        return chosen
    return replace(chosen, remapped=tuple(
        (canonical, name) for canonical, name in zip(usual, names) if name != usual[canonical]))
