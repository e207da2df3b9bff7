"""The configuration: a file of ``key value`` lines, overridden by ROS parameters and arguments, checked as a whole.

``read_configuration`` works on any list of keys; the test package reads its own file with it.
"""
import ipaddress
import math
import re
from types import MappingProxyType
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.interface import Service
from behavior_controller.interface.document import INTERFACE
from behavior_controller.text import Source, Unreadable, read_text

MOST_FAULTS = 100
"""A file with more mistakes is no configuration; the rest of it is not read."""

REQUIRED = object()
"""The default of a key that must be given."""

# float() and \d alone would also take "1_0" and the digits of other scripts
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?inf", re.IGNORECASE)
_INTEGER = re.compile(r"-?[0-9]{1,18}")
# each takes linear time
_NAME_END = re.compile(r"[\s=#]|$")
_COMMENT = re.compile(r"(?<!\S)#|$")


class Key(NamedTuple):
    """One key. ``read`` turns text into a value or raises ValueError; ``allowed`` says in words what it takes."""

    name: str
    read: Callable[[str], Any]
    allowed: str
    default: Any
    meaning: str


def boolean(text: str) -> bool:
    """Return the truth that ``true`` or ``false`` (any case) means."""
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


def number(low: float = -math.inf, high: float = math.inf, infinite: bool = False) -> Callable[[str], float]:
    """Return a reader of numbers from ``low`` to ``high``; only an ``infinite`` one takes ``inf``."""
    def read(text: str) -> float:
        if not _NUMBER.fullmatch(text):
            raise ValueError(text)
        value = float(text)
        if (math.isinf(value) and not infinite) or not low <= value <= high:
            raise ValueError(text)
        return value
    return read


def integer(low: int, high: int) -> Callable[[str], int]:
    """Return a reader of integers from ``low`` to ``high``."""
    def read(text: str) -> int:
        if not _INTEGER.fullmatch(text) or not low <= int(text) <= high:
            raise ValueError(text)
        return int(text)
    return read


def one_of(*words: str) -> Callable[[str], str]:
    """Return a reader of exactly these words."""
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(text)
        return text
    return read


def file_name(text: str) -> str:
    """Return a name without a folder."""
    if not re.fullmatch(r"[^/\\\0]+", text) or text in (".", ".."):
        raise ValueError(text)
    return text


def mission_name(text: str) -> str:
    """Return the name of a mission file without ``.xml`` and without a folder."""
    name = file_name(text)
    return name[:-4] if name.endswith(".xml") else name


def address(text: str) -> str:
    """Return an IP address or the name of a host.

    What merely looks like an address is refused: the system's resolver takes nothing, 0 and 0x0 for all addresses.
    """
    labels = text.lower().split(".")
    if ":" in text or re.fullmatch("[0-9]*|0x[0-9a-f]*", labels[-1]):
        return str(ipaddress.ip_address(text))
    if len(text) > 253 or not all(re.fullmatch("[0-9a-z_][0-9a-z_-]{0,62}", label) for label in labels):
        raise ValueError(text)
    return text


def words(text: str) -> str:
    """Return any text."""
    return text


_SECONDS = "a number of seconds, 0 or more"
_ADDRESS = "an address or a host name of this computer, 127.0.0.1 for itself alone, 0.0.0.0 for all networks"
_POSITIVE = "a number of seconds, more than 0 and at most 86400"


KEYS: Tuple[Key, ...] = (
    Key("scenarioSpecification", mission_name, "the name of a mission in the data folder, without .xml", REQUIRED,
        "the mission to run: data/<name>.xml"),
    Key("verboseMode", boolean, "true or false", REQUIRED, "a line for every leaf that finishes"),
    Key("asrEnabled", boolean, "true or false", REQUIRED, "visitors answer by voice; else on the tablet"),
    Key("language", file_name, "the name of a language, such as English", "English",
        "the robot's phrases: data/phrases_<language>.ini"),
    Key("missionRuns", integer(0, 10 ** 9), "a whole number, 0 or more", 0, "passes (visitors) to run; 0 is for ever"),
    Key("startupTimeout", number(0.0, 86400.0), _SECONDS, 0.0, "how long to wait for missing robot nodes at the start"),
    Key("topicMaxAge", number(0.001, 86400.0), _POSITIVE, 2.0,
        "an older message of a continuously published topic counts as absent"),
    Key("conditionWait", number(0.0, 86400.0), _SECONDS, 0.0,
        "how long a condition waits for its evidence, where the mission itself does not"),
    Key("mutualGazeValue", integer(1, 2), "1 or 2", 1,
        "the value of /overtAttention/mode that means mutual gaze: 1 in the document, 2 on the robot"),
    Key("welcomeGestureId", integer(0, 255), "a whole number from 0 to 255", 1, "the iconic gesture of WelcomeGesture"),
    Key("goodbyeGestureId", integer(0, 255), "a whole number from 0 to 255", 3, "the iconic gesture of GoodbyeGesture"),
    Key("deicticGestureId", integer(0, 255), "a whole number from 0 to 255", 1, "the gesture of PerformDeicticGesture"),
    Key("gestureDuration", integer(1, 600000), "milliseconds, a whole number from 1 to 600000", 3000,
        "how long a gesture takes, in ms"),
) + tuple(
    Key(service.deadline_key, number(0.001, 86400.0), _POSITIVE, service.deadline,
        "how long {} may take".format(service.name)) for service in INTERFACE.services
) + (
    Key("groot2Port", integer(0, 65534), "a port from 1 to 65534, or 0", 1667,
        "where Groot2 connects, with the port after it; 0: nobody can"),
    Key("groot2Address", address, _ADDRESS, "127.0.0.1",
        "who may connect: 127.0.0.1 this computer alone, 0.0.0.0 everybody on the network"),
    Key("monitorPort", integer(0, 65535), "a port from 1 to 65535, or 0", 8080,
        "where a browser sees the mission; 0: nobody does"),
    Key("monitorAddress", address, _ADDRESS, "127.0.0.1", "who may look, as groot2Address"),
    Key("recordDirectory", words, "a folder, nothing, or none", "",
        "where to write the record mission.jsonl; empty: a new folder among ROS' logs; none: nowhere"),
)

class Settings:
    """The checked configuration, frozen: one attribute for each key in snake_case (``asrEnabled`` is ``asr_enabled``).

    ``values`` holds the same under the names of the keys.
    """

    values: Mapping[str, Any]

    def __init__(self, values: Mapping[str, Any]):
        self.__dict__["values"] = MappingProxyType(dict(values))
        for key, value in values.items():
            self.__dict__[re.sub("[A-Z]", lambda capital: "_" + capital.group().lower(), key)] = value

    def __getattr__(self, name: str) -> Any:
        """Refuse a name that is no key; the values themselves are found without this."""
        raise AttributeError("there is no setting {}".format(name))

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to change anything."""
        raise AttributeError("settings are fixed: {} cannot be set".format(name))

    def deadline(self, service: Service) -> float:
        """Return the seconds that a call of ``service`` may take."""
        return self.values[service.deadline_key]


def defaults(**given: Any) -> Settings:
    """Return the settings of a configuration with nothing but the required keys, changed by ``given`` (camelCase)."""
    values = {key.name: key.default for key in KEYS}
    values.update(scenarioSpecification="lab_tour", verboseMode=False, asrEnabled=True)
    values.update(given)
    return Settings(values)


def split_arguments(argv: Sequence[str]) -> Tuple[List[str], Dict[str, str]]:
    """Return the arguments that rospy is to see, and key -> value of each ``_key:=value``.

    rospy would put the latter on the parameter server, where they outlive the process and a later one finds them.
    """
    others: List[str] = []
    given: Dict[str, str] = {}
    for argument in argv:
        name, is_assignment, value = argument.partition(":=")
        if is_assignment and name.startswith("_") and not name.startswith("__"):
            given[name[1:]] = value
        else:
            others.append(argument)
    return others, given


def load(path: str, overrides: Optional[Mapping[str, Any]] = None,
         arguments: Optional[Mapping[str, str]] = None) -> Settings:
    """Read the controller's configuration. Raises ConfigurationError with every fault."""
    return Settings(read_configuration(path, KEYS, overrides, arguments))


def recorded(values: Mapping[str, Any], where: str) -> Settings:
    """Return settings from their values as a record has them. Raises ConfigurationError with every fault."""
    reader = _Reader(where, {key.name: key for key in KEYS})
    for name, value in values.items():
        reader.given_value(name, value, where)
    return Settings(reader.result())


def read_configuration(path: str, keys: Sequence[Key], overrides: Optional[Mapping[str, Any]] = None,
                       arguments: Optional[Mapping[str, str]] = None) -> Dict[str, Any]:
    """Return a value for each of ``keys`` from a file, overriding ROS parameters, and ``arguments``, which override both.

    Raises ConfigurationError with every fault: unreadable file, unknown or duplicate key, bad value, missing key.
    """
    return configured(read_source(path, "the configuration"), keys, overrides, arguments)


def configured(source: Source, keys: Sequence[Key], overrides: Optional[Mapping[str, Any]] = None,
               arguments: Optional[Mapping[str, str]] = None) -> Dict[str, Any]:
    """As ``read_configuration``, for a file that was read already."""
    reader = _Reader(source.file, {key.name: key for key in keys})
    for line_number, line in enumerate(source.text.split("\n"), 1):
        reader.line(line_number, line)
        if len(reader.faults) > MOST_FAULTS:
            raise ConfigurationError(reader.faults[:MOST_FAULTS] + [too_many_faults(source.file, line_number)])
    for name, value in (overrides or {}).items():
        reader.override(name, value)
    for name, text in (arguments or {}).items():
        reader.argument(name, text)
    return reader.result()


def read_source(path: str, what: str) -> Source:
    """Return a text file that a person writes. Raises ConfigurationError, which says ``what`` it is."""
    try:
        return Source(path, read_text(path))
    except Unreadable as error:
        raise ConfigurationError([Fault(path, 0, 0, "{} cannot be read: {}".format(what, error))]) from error


def too_many_faults(path: str, line_number: int) -> Fault:
    """Return the fault that ends the reading of a file."""
    return Fault(path, line_number, 1, "more than {} mistakes; the rest is not read".format(MOST_FAULTS))


class _Reader:
    """Collects values and faults of one configuration."""

    def __init__(self, path: str, keys: Dict[str, Key]):
        self.path = path
        self.keys = keys
        self.values: Dict[str, Any] = {}
        self.given: Dict[str, int] = {}
        self.faults: List[Fault] = []

    def line(self, line_number: int, line: str) -> None:
        """Take one line of the file."""
        column = len(line) - len(line.lstrip()) + 1
        content = line.strip()
        name = content[:_NAME_END.search(content).start()]  # type: ignore[union-attr]
        if not name:
            if content and content[0] != "#":
                self._fault(line_number, 1, "this is not a line of the form: key value")
            return
        rest = content[len(name):].lstrip()
        rest = rest[1:].lstrip() if rest.startswith("=") else rest
        text = rest[:_COMMENT.search(rest).start()].rstrip()  # type: ignore[union-attr]
        if name not in self.keys:
            self._fault(line_number, column, "unknown key {}".format(name), self._nearest(name))
        elif name in self.given:
            self._fault(line_number, column, "the key {} stands in line {} already".format(name, self.given[name]))
        else:
            self.given[name] = line_number
            self._value(name, text, line_number, column + len(content) - len(rest) if text else column)

    def override(self, name: str, value: Any) -> None:
        """Take one private ROS parameter."""
        where = "parameter ~{}".format(name)
        if name not in self.keys:
            hint = did_you_mean(name, self.keys)
            if hint:  # other parameters below our name are none of our business
                self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name), hint))
            return
        self.given_value(name, value, where)

    def given_value(self, name: str, value: Any, where: str) -> None:
        """Take a value that is not in the file, but a parameter or in a record."""
        self.given.setdefault(name, 0)
        if name not in self.keys:
            self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name)))
        elif not isinstance(value, (int, float, str)):  # ROS also has lists, mappings, dates, bytes and null
            self.faults.append(Fault(where, 0, 0, "{} cannot be of type {}".format(name, type(value).__name__),
                                     "allowed: {}".format(self.keys[name].allowed)))
        else:
            self._value(name, str(value).lower() if isinstance(value, bool) else str(value), 0, 0, where)

    def argument(self, name: str, text: str) -> None:
        """Take one argument of the command line."""
        where = "argument {}".format(name)
        if name in self.keys:
            self.given.setdefault(name, 0)
            self._value(name, text, 0, 0, where)
        else:
            self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name), self._nearest(name)))

    def _nearest(self, name: str) -> str:
        return did_you_mean(name, self.keys) or "the keys: {}".format(", ".join(self.keys))

    def _value(self, name: str, text: str, line_number: int, column: int, where: str = "") -> None:
        key = self.keys[name]
        try:
            self.values[name] = key.read(text)
        except ValueError:
            self.faults.append(Fault(where or self.path, line_number, column, "{} cannot be {}".format(
                name, "\"{}\"".format(text) if text else "empty"), "allowed: {}".format(key.allowed)))

    def _fault(self, line_number: int, column: int, text: str, hint: str = "") -> None:
        self.faults.append(Fault(self.path, line_number, column, text, hint))

    def result(self) -> Dict[str, Any]:
        """Return all values, or raise ConfigurationError."""
        for key in self.keys.values():
            if key.default is REQUIRED and key.name not in self.given:
                self.faults.append(Fault(self.path, 0, 0, "the required key {} is missing".format(key.name),
                                         "add a line: {} <{}>".format(key.name, key.allowed)))
        if self.faults:
            raise ConfigurationError(self.faults)
        return {name: self.values.get(name, key.default) for name, key in self.keys.items()}
