"""Reads the environment and culture knowledge files of release 1.0, which replace the missing knowledge base.

A line is ``key [id] values`` separated by white space; empty lines and lines that begin with ``#`` are ignored.
"""
import os
import re
from dataclasses import dataclass
from types import MappingProxyType
from typing import Callable, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Set, Tuple, TypeVar

from behavior_controller import folders
from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.interface.records import Exhibit, Location, Point
from behavior_controller.keys import (MOST_FAULTS, REQUIRED, Key, Reader, boolean, configured, integer, number,
                                      read_source, too_many_faults)
from behavior_controller.text import Source, Unreadable, read_text

LANGUAGES = ("English", "IsiZulu", "Kinyarwanda")
UTILITY_PHRASES = range(1, 9)
"""The numbers of the utility phrases that missions say."""

LAST_REQUIRED = 7
"""The number of the last required phrase; the culture file of release 1.0 has no further ones."""

_ENVIRONMENT, _CULTURE, _CONFIGURATION = "environment", "culture", "configuration"
_CONFIGURATIONS = {kind: "{}KnowledgeBaseConfiguration.ini".format(kind) for kind in (_ENVIRONMENT, _CULTURE)}
"""The files in ``config`` that name the knowledge files."""

_TOUR, _POSE, _NAME, _TARGET = "tourSpecification", "robotLocationPose", "robotLocationDescription", "gestureTarget"
_LANGUAGE = "phraseLanguage"
_KNOWLEDGE_BASE = "knowledgeBase"
_MESSAGES = {language: ("preGestureMessage" + language, "postGestureMessage" + language) for language in LANGUAGES}
_PHRASES = {language: {each: "utilityPhrase{}{}".format(language, each) for each in UTILITY_PHRASES}
            for language in LANGUAGES}
_FORMS = {_POSE: "<id> <x in m> <y in m> <theta in degrees>", _TARGET: "<id> <x in m> <y in m> <z in m>",
          _NAME: "<id> <text>", "culturalKnowledge": "<id> <keys>",
          **{key: "<id> <text>" for keys in _MESSAGES.values() for key in keys}}
"""The values of each key of a location. The cultural knowledge of a location is not used."""
_TOUR_FORM = "<number of locations> <id of the first> … <id of the last>"
_ENVIRONMENT_KEYS = (*_FORMS, _TOUR)
_CULTURE_KEYS = (_LANGUAGE, *(key for keys in _PHRASES.values() for key in keys.values()))
_ANY_PHRASE = re.compile("utilityPhrase({})[0-9]+".format("|".join(LANGUAGES)))

_NEAR = 0.9
"""The similarity from which on an unknown key counts as mistyped: ``gestureArm`` of other releases does not."""

_LANGUAGE_NAMES = "one of {}".format(", ".join(LANGUAGES))
_ID = integer(0, 10 ** 9)
_COUNT = integer(1, 999)
_COORDINATE = number(-10000, 10000)
_WORD = re.compile(r"\S+")

Value = TypeVar("Value")


def _not_empty(text: str) -> str:
    if not text:
        raise ValueError(text)
    return text


_FILE = Reader("a file in the folder data beside the configuration's folder, or a path", _not_empty)
_CONFIGURATION_KEYS = (
    Key(_KNOWLEDGE_BASE, _FILE, REQUIRED, "the knowledge file"),
    Key("verboseMode", boolean, None, "for the release's own programs"),
    Key("valueTypes", _FILE, None, "for the release's own programs"),
)


@dataclass(frozen=True)
class Knowledge:
    """The content of both files, in the ``language`` that the culture file chooses.

    ``tour``: the places in the order of ``tourSpecification``. Each of them is shown as an exhibit, the first and the
    last too: the published controller of release 1.0 visits the whole list, and the messages of these two places open
    and close the tour. A place may be in it twice. An exhibit's descriptions are the messages before and after the
    gesture.
    ``phrases``: the utility phrases by number. ``sources``: the environment file and the culture file as read.
    """

    tour: Tuple[Exhibit, ...]
    language: str
    phrases: Mapping[int, str]
    sources: Tuple[Source, Source]
    warnings: Tuple[Fault, ...] = ()

    @property
    def start(self) -> Exhibit:
        """Where the robot starts: the first place of the tour."""
        return self.tour[0]

    @property
    def end(self) -> Exhibit:
        """Where the tour ends: its last place."""
        return self.tour[-1]


# ------------------------------------------------------------------------------------------------------ a file of entries


class _TooManyFaults(Exception):
    """The rest of a file is not read."""


class _Line:
    def __init__(self, line_number: int, text: str):
        self.number = line_number
        self.text = text.rstrip()
        self.words = list(_WORD.finditer(text))
        self.key = self.words[0].group()

    def column(self, index: int) -> int:
        """Return the column of the word at ``index``, from 1, or of the key if there is no such word."""
        return self.words[index if index < len(self.words) else 0].start() + 1

    def rest(self, index: int) -> str:
        """Return the text from the word at ``index`` to the end of the line."""
        return self.text[self.words[index].start():] if index < len(self.words) else ""


def _lines(text: str) -> Iterator[_Line]:
    for line_number, line in enumerate(text.split("\n"), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield _Line(line_number, line)


class _File:
    """The entries of one file, and their faults and warnings."""

    def __init__(self, source: Source):
        self.source = source
        self.faults: List[Fault] = []
        self.warnings: List[Fault] = []
        self.end: List[Fault] = []
        self.line_of: Dict[str, int] = {}  # of each entry, valid or not

    def read(self) -> None:
        """Process each line, then check for missing entries."""
        try:
            for line in _lines(self.source.text):
                self.take(line)
            self.finish()
        except _TooManyFaults:
            self.end.append(too_many_faults(self.source.file, self.faults[-1].line))

    def found(self) -> List[Fault]:
        """Return faults and warnings in the order of the file, then those about missing entries."""
        found = sorted(self.faults + self.warnings, key=lambda fault: (not fault.line, fault.line, fault.column))
        return found + self.end

    def take(self, line: _Line) -> None:
        raise NotImplementedError

    def finish(self) -> None:
        raise NotImplementedError

    def fault(self, place: Tuple[int, int], text: str, hint: str) -> None:
        if len(self.faults) == MOST_FAULTS:
            raise _TooManyFaults
        self.faults.append(Fault(self.source.file, *place, text, hint))

    def warn(self, place: Tuple[int, int], text: str, hint: str) -> None:
        if len(self.warnings) == MOST_FAULTS:
            place, text, hint = (0, 0), "more than {} warnings; the rest is not shown".format(MOST_FAULTS), ""
        if len(self.warnings) <= MOST_FAULTS:
            self.warnings.append(Fault(self.source.file, *place, text, hint, True))

    def is_first(self, line: _Line, entry: str) -> bool:
        """Note an entry; return False, with a fault, if it is a duplicate."""
        if entry in self.line_of:
            self.fault((line.number, line.column(0)), "{} is in line {} already".format(entry, self.line_of[entry]),
                       "keep one of them")
            return False
        self.line_of[entry] = line.number
        return True

    def value(self, line: _Line, index: int, what: str, read: Reader[Value]) -> Optional[Value]:
        """Return the value of the word at ``index``, or None, with a fault."""
        text = line.words[index].group() if index < len(line.words) else ""
        try:
            return read(text)
        except ValueError:
            self.fault((line.number, line.column(index)), "{} cannot be {}".format(what, _quoted(text)),
                       "allowed: {}".format(read.allowed))
            return None

    def unknown(self, line: _Line, keys: Iterable[str], otherwise: str = "") -> None:
        """Warn of the first line with an unknown key: without the hint ``otherwise`` only if a known key is near."""
        hint = "" if line.key in self.line_of else did_you_mean(line.key, keys, _NEAR) or otherwise
        if hint:
            self.line_of[line.key] = line.number
            self.warn((line.number, line.column(0)), "unknown key {}: it is not used".format(line.key), hint)


def _quoted(text: str) -> str:
    return "\"{}\"".format(text) if text else "empty"


class _Culture(_File):
    def __init__(self, source: Source):
        super().__init__(source)
        self.language: Optional[str] = None
        self.texts: Dict[str, str] = {}
        self.read()

    def take(self, line: _Line) -> None:
        """Keep the language and the phrases; all other keys are for other programs."""
        if line.key == _LANGUAGE:
            if self.is_first(line, line.key):
                self._choose(line)
        elif line.key in _CULTURE_KEYS:
            if self.is_first(line, line.key):
                self.texts[line.key] = line.rest(1)
        elif not _ANY_PHRASE.fullmatch(line.key):
            self.unknown(line, _CULTURE_KEYS)

    def _choose(self, line: _Line) -> None:
        language = line.rest(1)
        if language in LANGUAGES:
            self.language = language
        else:
            self.fault((line.number, line.column(1)), "{} cannot be {}".format(_LANGUAGE, _quoted(language)),
                       did_you_mean(language, LANGUAGES) or "allowed: {}".format(_LANGUAGE_NAMES))

    def finish(self) -> None:
        """Report the missing phrases of the chosen language."""
        if _LANGUAGE not in self.line_of:
            self.fault((0, 0), "the required key {} is missing".format(_LANGUAGE),
                       "add a line: {} <{}>".format(_LANGUAGE, _LANGUAGE_NAMES))
        for each, key in _PHRASES[self.language].items() if self.language else ():
            if key not in self.line_of:
                if each <= LAST_REQUIRED:
                    self.fault((0, 0), "the required key {} is missing".format(key), "add a line: {} <text>".format(key))
            elif not self.texts[key]:
                self.fault((self.line_of[key], 1), "{} cannot be empty".format(key), "allowed: the text to say")

    def phrases(self, language: str) -> Mapping[int, str]:
        """Return the utility phrases, if there are no faults."""
        return MappingProxyType({each: self.texts[key] for each, key in _PHRASES[language].items()
                                 if key in self.texts})


class _Environment(_File):
    """``languages`` are those of the tour; by default all languages of the file's messages."""

    def __init__(self, source: Source, languages: Optional[Sequence[str]] = None):
        super().__init__(source)
        self.languages = languages
        self.tour: List[Tuple[int, Tuple[int, int]]] = []  # each id, and its place
        self.ids: Set[int] = set()
        self.texts: Dict[Tuple[str, int], str] = {}
        self.poses: Dict[int, Location] = {}
        self.targets: Dict[int, Point] = {}
        self.read()

    def take(self, line: _Line) -> None:
        """Keep an entry of a location, or the tour."""
        if line.key == _TOUR:
            if self.is_first(line, line.key):
                self._take_tour(line)
        elif line.key in _FORMS:
            location = self.value(line, 1, "the id of {}".format(line.key), _ID)
            if location is not None:
                self.ids.add(location)
                if self.is_first(line, _entry(line.key, location)):
                    self._take_entry(line, location)
        else:
            self.unknown(line, _ENVIRONMENT_KEYS, "the keys: {}".format(", ".join(_ENVIRONMENT_KEYS)))

    def _take_tour(self, line: _Line) -> None:
        count = self.value(line, 1, "the number of locations of {}".format(_TOUR), _COUNT)
        listed = range(2, len(line.words))
        if count is not None and count != len(listed):
            self.fault((line.number, line.column(1)), "{} says {} and lists {}".format(
                _TOUR, _locations(count), len(listed)), "the form: {} {}".format(_TOUR, _TOUR_FORM))
        for index in listed:
            location = self.value(line, index, "an id of {}".format(_TOUR), _ID)
            if location is not None:
                self.tour.append((location, (line.number, line.column(index))))

    def _take_entry(self, line: _Line, location: int) -> None:
        if line.key == _POSE:
            self._take_numbers(line, location, Location, self.poses)
        elif line.key == _TARGET:
            self._take_numbers(line, location, Point, self.targets)
        elif line.key == _NAME and not line.rest(2):
            self.fault((line.number, line.column(0)), "{} cannot be empty".format(_entry(line.key, location)),
                       "the form: {} {}".format(line.key, _FORMS[line.key]))
        else:
            self.texts[line.key, location] = line.rest(2)

    def _take_numbers(self, line: _Line, location: int, record: Callable[[float, float, float], Value],
                      records: Dict[int, Value]) -> None:
        entry = _entry(line.key, location)
        if len(line.words) != 5:
            self.fault((line.number, line.column(0)), "{} has {} values, not 3".format(entry, len(line.words) - 2),
                       "the form: {} {}".format(line.key, _FORMS[line.key]))
            return
        values = [self.value(line, index, "a value of {}".format(entry), _COORDINATE) for index in range(2, 5)]
        numbers = [value for value in values if value is not None]
        if len(numbers) == 3:
            records[location] = record(*numbers)

    def finish(self) -> None:
        """Report what the tour needs and the file lacks."""
        if _TOUR not in self.line_of:
            self.fault((0, 0), "the required key {} is missing".format(_TOUR),
                       "add a line: {} {}".format(_TOUR, _TOUR_FORM))
        written = {key for key, _ in self.texts}
        spoken = [language for language in LANGUAGES if not written.isdisjoint(_MESSAGES[language])]
        languages = spoken if self.languages is None else self.languages
        for language in set(languages).difference(spoken):
            self.fault((0, 0), "there is neither {} nor {} for any location".format(*_MESSAGES[language]),
                       "the culture file's {} is {}; there are messages in: {}".format(
                           _LANGUAGE, language, ", ".join(spoken) or "no language"))
        places = dict(reversed(self.tour))  # of each location the first
        for location, place in places.items():
            self._check_location(location, place, [language for language in spoken if language in languages])

    def _check_location(self, location: int, place: Tuple[int, int], languages: Sequence[str]) -> None:
        if location not in self.ids:
            self.fault(place, "the tour goes to location {}, which has no entries".format(location),
                       "there are: {}".format(", ".join(map(str, sorted(self.ids))) or "no locations"))
            return
        for key in (_POSE, _NAME):
            if _entry(key, location) not in self.line_of:
                self.fault(place, "location {} of the tour has no {}".format(location, key),
                           "add a line: {} {}".format(key, _FORMS[key].replace("<id>", str(location))))
        lacks = [(_TARGET, "points at nothing", " 0 0 0")]
        lacks += [(key, "says nothing", " without a text") for language in languages for key in _MESSAGES[language]]
        for key, consequence, on_purpose in lacks:
            if _entry(key, location) not in self.line_of:
                self.warn(place, "location {} of the tour has no {}: the robot {} there".format(
                    location, key, consequence), "if that is meant, add a line: {}{}".format(
                        _entry(key, location), on_purpose))

    def exhibits(self, language: str) -> Tuple[Exhibit, ...]:
        """Return the tour, if there are no faults."""
        before, after = _MESSAGES[language]
        return tuple(Exhibit(self.texts[_NAME, location], self.texts.get((before, location), ""),
                             self.texts.get((after, location), ""), self.poses[location],
                             self.targets.get(location, Point(0.0, 0.0, 0.0))) for location, _ in self.tour)


def _entry(key: str, location: int) -> str:
    return "{} {}".format(key, location)


def _locations(count: int) -> str:
    return "{} location{}".format(count, "" if count == 1 else "s")


# ------------------------------------------------------------------------------------------------------------ both files


def load() -> Knowledge:
    """Return the knowledge of the files named in ``config``. Raises ConfigurationError with every fault of all four files."""
    faults: List[Fault] = []
    environment, culture = (_named(folders.config(_CONFIGURATIONS[kind]), kind, faults) for kind in _CONFIGURATIONS)
    return _put_together(environment, culture, faults)


def read(environment: Source, culture: Source) -> Knowledge:
    """Return the knowledge of two files, given their texts. Raises ConfigurationError with every fault."""
    return _put_together(environment, culture, [])


def check(path: str) -> Optional[List[Fault]]:
    """Return the faults of a knowledge file, or of a configuration and the file that it names.

    None if the file is neither: its keys decide.
    """
    try:
        source = Source(path, read_text(path))
    except Unreadable:
        return None
    kind = None if source.text.lstrip().startswith("<") else _kind(source.text)
    if kind == _CONFIGURATION:
        by_name = {name: kind for kind, name in _CONFIGURATIONS.items()}
        try:
            source = _source(source, by_name.get(os.path.basename(path), ""))
        except ConfigurationError as error:
            return list(error.faults)
        kind = _kind(source.text)
    if kind is None:
        return None
    return (_Culture if kind == _CULTURE else _Environment)(source).found()


def _put_together(environment: Optional[Source], culture: Optional[Source], faults: List[Fault]) -> Knowledge:
    chosen = _Culture(culture) if culture else None
    language = chosen.language if chosen else None
    places = _Environment(environment, [language] if language else []) if environment else None
    found = faults + [fault for file in (places, chosen) if file for fault in file.found()]
    if any(not fault.is_warning for fault in found):
        raise ConfigurationError(found)
    assert chosen and language and places
    return Knowledge(places.exhibits(language), language, chosen.phrases(language), (places.source, chosen.source),
                     tuple(found))


def _named(configuration: str, kind: str, faults: List[Fault]) -> Optional[Source]:
    """Return the knowledge file that a configuration names, or None, with a fault."""
    try:
        return _source(read_source(configuration, "the configuration"), kind)
    except ConfigurationError as error:
        faults.extend(error.faults)
        return None


def _source(configuration: Source, kind: str) -> Source:
    """As ``_named``, given the text of the configuration. Raises ConfigurationError.

    Without a ``kind`` it may name a file of either.
    """
    name = configured(configuration, _CONFIGURATION_KEYS)[_KNOWLEDGE_BASE]
    path = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(configuration.file))), "data", name)
    hint = "the key {} of {} names it".format(_KNOWLEDGE_BASE, configuration.file)
    try:
        source = read_source(path, "the knowledge file")
    except ConfigurationError as error:
        raise ConfigurationError([fault._replace(hint=hint) for fault in error.faults]) from error
    found = _kind(source.text)
    if found not in ((kind, None) if kind else _CONFIGURATIONS):
        text = "this is the {} file".format(found) if found else "this is not a knowledge file of release 1.0"
        raise ConfigurationError([Fault(path, 0, 0, text, hint)])
    return source


def _kind(text: str) -> Optional[str]:
    """Return the kind of a file by its keys, None for another kind of file."""
    keys = {line.key for line in _lines(text)}
    kinds = ((_ENVIRONMENT, _ENVIRONMENT_KEYS), (_CULTURE, _CULTURE_KEYS), (_CONFIGURATION, (_KNOWLEDGE_BASE,)))
    return next((kind for kind, known in kinds if not keys.isdisjoint(known)), None)
