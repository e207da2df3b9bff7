"""Reads the environment and culture knowledge files of release 1.0, which replace the missing
knowledge base.

A line is ``key [id] values`` separated by white space; empty lines and lines that begin with ``#``
are ignored.
"""
import os
import re
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, List, Mapping, Optional, Sequence, Set, Tuple

from behavior_controller import folders
from behavior_controller.errors import ConfigurationError, Fault, attempt
from behavior_controller.robot.requests import Exhibit, Location, Point
from behavior_controller.config.config_file import (
    Key, LineReader, MOST_FAULTS, Place, REQUIRED, Reader, TextLine, Value, boolean, collected,
    integer, lines_of, number, one_of, read_source, some_text)
from behavior_controller.text import Source, count, did_you_mean

LANGUAGES = ("English", "IsiZulu", "Kinyarwanda")
UTILITY_PHRASES = range(1, 9)
"""The numbers of the utility phrases that missions say."""

LAST_REQUIRED = 7
"""The number of the last phrase that release 1.0 requires. In release 1.1 the mission says which it
needs."""

_KINDS = _ENVIRONMENT, _CULTURE = "environment", "culture"
_CONFIGURATION, _VALUE_TYPES = "configuration", "value types"
_TYPE_NAMES = ("NUMBER", "WORD", "PHRASE", "UNDEFINED")
"""The values in a file of value types, which belongs to the release's own programs."""

_CONFIGURATIONS = {f"{kind}KnowledgeBaseConfiguration.ini": (kind,) for kind in _KINDS}
"""The files in ``config`` that name the knowledge files, and of which kind these are."""

_TOUR = "tourSpecification"
_POSE, _NAME, _TARGET = "robotLocationPose", "robotLocationDescription", "gestureTarget"
_LANGUAGE = "phraseLanguage"
_KNOWLEDGE_BASE = "knowledgeBase"
_MESSAGES = {language: ("preGestureMessage" + language, "postGestureMessage" + language)
             for language in LANGUAGES}
_PHRASES = {language: {number: f"utilityPhrase{language}{number}" for number in UTILITY_PHRASES}
            for language in LANGUAGES}
_FORMS = {
    _POSE: "<id> <x in m> <y in m> <theta in degrees>", _TARGET: "<id> <x in m> <y in m> <z in m>",
    _NAME: "<id> <text>", "culturalKnowledge": "<id> <keys>",
    **{key: "<id> <text>" for keys in _MESSAGES.values() for key in keys},
    _TOUR: "<number of locations> <id of the first> … <id of the last>"}
"""The values of each key. The cultural knowledge of a location is not used."""
_ANY_PHRASE = re.compile(f"utilityPhrase({'|'.join(LANGUAGES)})[0-9]+")

_NEAR = 0.9
"""The similarity from which on an unknown key counts as mistyped: ``gestureArm`` of other releases
does not."""

_LANGUAGE_READER = one_of(*LANGUAGES)
_GESTURES: Mapping[str, Tuple[Reader[str], str]] = {
    "gestureArm": (one_of("EITHER", "LEFT", "RIGHT"), "EITHER"),
    "deicticShape": (some_text("PALM_UPWARDS, or another word", " "), "PALM_UPWARDS")}
"""What a robot of release 1.1 is told about pointing, each with its default."""
_ID = integer(0, 10 ** 9)
_COUNT = integer(1, 999)
_COORDINATE = number(-10000, 10000)

_FILE = some_text("a file in the folder data beside the configuration's folder, or a path")
_CONFIGURATION_KEYS = (Key(_KNOWLEDGE_BASE, _FILE, REQUIRED, "the knowledge file"),
                       Key("verboseMode", boolean, None, "for the release's own programs"),
                       Key("valueTypes", _FILE, None, "for the release's own programs"))


@dataclass(frozen=True)
class Knowledge:
    """The content of both files, in the ``language`` that the culture file chooses.

    ``tour``: the places in the order of ``tourSpecification``, from where the robot starts to where
    the tour ends. Each of them is shown as an exhibit, the first and the last too: the published
    controller of release 1.0 visits the whole list, and the messages of these two places open and
    close the tour. A place may be in it twice. An exhibit's descriptions are the messages before
    and after the gesture. ``phrases``: the utility phrases by number. ``sources``: the environment
    file and the culture file as read. ``arm`` and ``shape``: those of a deictic gesture, for a
    robot that takes them.
    """

    tour: Tuple[Exhibit, ...]
    language: str
    phrases: Mapping[int, str]
    sources: Tuple[Source, Source]
    warnings: Tuple[Fault, ...] = ()
    arm: str = ""
    shape: str = ""


# -------------------------------------------------------------------------------- a file of entries


class _EntryReader(LineReader):
    """Reads the entries of one file."""

    keys: Sequence[str]

    def __init__(self, source: Source):
        super().__init__(source)
        attempt(self.read, [])  # too many faults: the last one says so

    def line(self, line: TextLine) -> None:
        is_known = line.key in self.keys
        entry = self.entry(line)
        if not entry:
            return
        first = self.lines.setdefault(entry, line.number)
        if first == line.number and is_known:
            self.values[entry] = self.taken(line, entry)
        elif first == line.number and self.meant(line.key):
            self.fault(line.place(), f"unknown key {line.key}: it is not used",
                       self.meant(line.key), is_warning=True)
        elif is_known:
            self.fault(line.place(), f"{entry} is in line {first} already", "keep one of them")

    def findings(self) -> List[Fault]:
        """Return faults and warnings in the order of the file, then those about missing entries."""
        if len(self.warnings) > MOST_FAULTS:
            del self.warnings[MOST_FAULTS:]
            self.fault(None, f"more than {MOST_FAULTS} warnings; the rest is not shown", "", True)
        return sorted(self.faults + self.warnings,
                      key=lambda fault: (not fault.line, fault.line, fault.column))

    def entry(self, line: TextLine) -> str:
        """Return the name of an entry; empty, with a fault, if it has none."""
        return line.key

    def meant(self, key: str) -> str:
        """Return a hint about an unknown key; without one it is no mistake."""
        return did_you_mean(key, self.keys, _NEAR)

    def taken(self, line: TextLine, entry: str) -> Any:
        """Return what an entry holds; its faults are added."""
        raise NotImplementedError

    def value(self, line: TextLine, index: int, what: str, read: Reader[Value]) -> Optional[Value]:
        """Return the value of the word at ``index``, or None, with a fault."""
        text = next((word.group() for word in line.words[index:]), "")
        return self.parsed(read, text, what, line.place(index))


class _Culture(_EntryReader):
    """The language and the phrases; all other keys are for other programs."""

    keys = (_LANGUAGE, *(key for keys in _PHRASES.values() for key in keys.values()))

    def __init__(self, source: Source, takes_arm: bool):
        self.gestures = _GESTURES if takes_arm else {}
        self.keys = (*self.keys, *self.gestures)
        super().__init__(source)

    def meant(self, key: str) -> str:
        if _ANY_PHRASE.fullmatch(key):
            return ""
        return super().meant(key)

    def taken(self, line: TextLine, entry: str) -> Any:
        if entry in self.gestures:
            return self.parsed(self.gestures[entry][0], line.rest(1), entry, line.place(1))
        if entry == _LANGUAGE:
            return self.parsed(_LANGUAGE_READER, line.rest(1), _LANGUAGE, line.place(1))
        return line.rest(1)

    def finish(self) -> None:
        """Report what is missing, in the chosen language."""
        self.require(_LANGUAGE, f"<{_LANGUAGE_READER.allowed}>")
        for key, (_, default) in self.gestures.items():
            if key not in self.lines:
                self.fault(None, f"there is no {key}: the robot points with {default}",
                           f"if that is meant, add a line: {key} {default}", is_warning=True)
        for number, key in _PHRASES.get(self.values.get(_LANGUAGE, ""), {}).items():
            if number <= LAST_REQUIRED and not self.gestures:
                self.require(key, "<text>")
            if self.values.get(key) == "":
                place = self.source.file, self.lines[key], 1
                self.fault(place, f"{key} cannot be empty", "allowed: the text to say")

    def phrases(self, language: str) -> Mapping[int, str]:
        """Return the utility phrases, if there are no faults."""
        keys = _PHRASES[language]
        return MappingProxyType(
            {number: self.values[key] for number, key in keys.items() if key in self.values})


class _Environment(_EntryReader):
    """``languages`` are those of the tour; by default all languages of the file's messages."""

    keys = tuple(_FORMS)

    def __init__(self, source: Source, languages: Optional[Sequence[str]] = None):
        self.languages = languages
        self.ids: Set[int] = set()
        super().__init__(source)

    def meant(self, key: str) -> str:
        return super().meant(key) or f"the keys: {', '.join(self.keys)}"

    def entry(self, line: TextLine) -> str:
        if line.key == _TOUR or line.key not in self.keys:
            return line.key
        location = self.value(line, 1, f"the id of {line.key}", _ID)
        if location is None:
            return ""
        self.ids.add(location)
        return f"{line.key} {location}"

    def taken(self, line: TextLine, entry: str) -> Any:
        form = f"the form: {line.key} {_FORMS[line.key]}"
        if line.key == _TOUR:
            return self._tour(line, form)
        if line.key in (_POSE, _TARGET):
            if len(line.words) == 5:
                return [self.value(line, index, f"a value of {entry}", _COORDINATE)
                        for index in range(2, 5)]
            self.fault(line.place(), f"{entry} has {len(line.words) - 2} values, not 3", form)
        elif line.key == _NAME and not line.rest(2):
            self.fault(line.place(), f"{entry} cannot be empty", form)
        return line.rest(2)

    def _tour(self, line: TextLine, form: str) -> List[Tuple[Optional[int], Place]]:
        """Return each id, and its place."""
        stated = self.value(line, 1, f"the number of locations of {_TOUR}", _COUNT)
        listed = range(2, len(line.words))
        if stated is not None and stated != len(listed):
            locations = count(stated, "location")
            self.fault(line.place(1), f"{_TOUR} says {locations} and lists {len(listed)}", form)
        return [(self.value(line, index, f"an id of {_TOUR}", _ID), line.place(index))
                for index in listed]

    def finish(self) -> None:
        """Report what the tour needs and the file lacks."""
        self.require(_TOUR, _FORMS[_TOUR])
        written = {entry.split()[0] for entry in self.lines}
        spoken = [language for language in LANGUAGES if not written.isdisjoint(_MESSAGES[language])]
        languages = spoken if self.languages is None else self.languages
        for language in set(languages).difference(spoken):
            self.fault(
                None, "there is neither {} nor {} for any location".format(*_MESSAGES[language]),
                f"the culture file's {_LANGUAGE} is {language}; there are messages in: "
                f"{', '.join(spoken) or 'no language'}")
        messages = [key for language in spoken if language in languages
                    for key in _MESSAGES[language]]
        places = dict(reversed(self.values.get(_TOUR, [])))  # of each location the first
        for location, place in places.items():
            if location in self.ids:
                self._check_location(location, place, messages)
            elif location is not None:
                known = ", ".join(map(str, sorted(self.ids))) or "no locations"
                self.fault(place, f"the tour goes to location {location}, which has no entries",
                           f"there are: {known}")

    def _check_location(self, location: int, place: Place, messages: List[str]) -> None:
        lacking = f"location {location} of the tour has no"
        for key in (_POSE, _NAME):
            if f"{key} {location}" not in self.lines:
                form = _FORMS[key].replace("<id>", str(location))
                self.fault(place, f"{lacking} {key}", f"add a line: {key} {form}")
        effects = {_TARGET: ("points at nothing", "0 0 0")}
        effects.update(dict.fromkeys(messages, ("says nothing", "without a text")))
        for key, (effect, on_purpose) in effects.items():
            if f"{key} {location}" not in self.lines:
                hint = f"if that is meant, add a line: {key} {location} {on_purpose}"
                self.fault(place, f"{lacking} {key}: the robot {effect} there", hint, True)

    def exhibits(self, language: str) -> Tuple[Exhibit, ...]:
        """Return the tour, if there are no faults."""
        keys = (_NAME, *_MESSAGES[language], _POSE, _TARGET)
        exhibits = []
        for location, _ in self.values[_TOUR]:
            name, before, after, pose, target = [
                self.values.get(f"{key} {location}", "") for key in keys]
            exhibits.append(Exhibit(
                name, before, after, Location(*pose), Point(*target or (0.0, 0.0, 0.0))))
        return tuple(exhibits)


# --------------------------------------------------------------------------------------- both files


def load(mission: str = "", takes_arm: bool = False) -> Knowledge:
    """Return the knowledge of the files named in ``config``, or of those that the mission has of
    its own in their place. ``takes_arm``: see ``Interface``. Raises ConfigurationError with every
    fault of all four files."""
    faults: List[Fault] = []
    environment, culture = [
        attempt(lambda: _source(read_source(path, "the configuration"), mission), faults)
        for path in map(folders.config, _CONFIGURATIONS)]
    return read(environment, culture, takes_arm=takes_arm, faults=faults)


def read(environment: Optional[Source], culture: Optional[Source], *,
         takes_arm: bool = False, faults: Sequence[Fault] = ()) -> Knowledge:
    """Return the knowledge of two files, given their texts. Raises ConfigurationError with every
    fault; ``faults`` are those of the files that could not be read."""
    findings, nothing = list(faults), Source("", "")
    chosen = _Culture(culture or nothing, takes_arm)
    languages = list(filter(None, [chosen.values.get(_LANGUAGE)]))
    places = _Environment(environment or nothing, languages)
    if environment:
        findings += places.findings()
    if culture:
        findings += chosen.findings()
    ConfigurationError.raise_any(findings)
    language, = languages
    gestures = {key: default for key, (_, default) in chosen.gestures.items()}
    gestures.update(chosen.values)
    arm, shape = [gestures.get(key, "") for key in _GESTURES]
    return Knowledge(places.exhibits(language), language, chosen.phrases(language),
                     (places.source, chosen.source), tuple(findings), arm, shape)


def check(path: str, takes_arm: bool = False) -> Optional[List[Fault]]:
    """Return the faults of a knowledge file, or of a configuration and the file that it names.
    ``takes_arm``: see ``Interface``.

    None if the file is neither: its keys decide.
    """
    source = attempt(lambda: read_source(path, "the file"), [])
    if source is None or source.text.lstrip().startswith("<"):
        return None
    kind = _kind(source.text)
    if kind == _CONFIGURATION:
        try:
            source = _source(source)
        except ConfigurationError as error:
            return list(error.faults)
        kind = _kind(source.text)
    if kind == _CULTURE:
        return _Culture(source, takes_arm).findings()
    if kind == _ENVIRONMENT:
        return _Environment(source).findings()
    return [] if kind == _VALUE_TYPES else None


def _source(configuration: Source, mission: str = "") -> Source:
    """Return the knowledge file that a configuration names. Raises ConfigurationError.

    A configuration of another name than the two may name a file of either kind.
    """
    name = collected(configuration, _CONFIGURATION_KEYS).result()[_KNOWLEDGE_BASE]
    path = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(configuration.file))),
                        "data", name)
    hint = f"the key {_KNOWLEDGE_BASE} of {configuration.file} names it"
    source = read_source(folders.of_mission(path, mission), "the knowledge file", hint)
    kind = _kind(source.text)
    if kind not in _CONFIGURATIONS.get(os.path.basename(configuration.file), _KINDS):
        text = f"this is the {kind} file" if kind else "this is not a knowledge file of release 1.0"
        raise ConfigurationError.of(path, text, hint)
    return source


def _kind(text: str) -> Optional[str]:
    """Return the kind of a file by its keys, None for another kind of file."""
    lines = list(lines_of(Source("", text)))
    values = {line.rest(1) for line in lines}
    if values and values.issubset(_TYPE_NAMES):
        return _VALUE_TYPES
    keys = {line.key for line in lines}
    kinds = {_ENVIRONMENT: _Environment.keys, _CULTURE: _Culture.keys,
             _CONFIGURATION: (_KNOWLEDGE_BASE,)}
    return next((kind for kind, known in kinds.items() if not keys.isdisjoint(known)), None)
