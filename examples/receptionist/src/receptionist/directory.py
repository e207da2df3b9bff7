"""Who works here and where: reads data/people.ini, and finds names in what a visitor says."""
import difflib
import functools
import os
import unicodedata
from typing import Dict, Iterator, List, NamedTuple, Tuple

from behavior_controller.extend import (
    FaultsFound, LineReader, Point, TextLine, number, package_folder, read_source)

LIKENESS = 0.8
"""How like a name a part of an utterance has to be, by the ratio of difflib, from 0 to 1 (equal):
one wrong letter of five."""

SHORT = 3
"""A name of so many letters has to be said exactly; a shorter word of a longer name does not count.
"""

MOST_NAMES = 3
"""The most names that a visitor is asked about; an utterance with more is not understood."""

MOST_WORDS = 30
"""The words of an utterance that are looked at."""

FORMS = {"room": "room <room> <x in m> <y in m> <z in m>", "person": "person <room> <name>"}
COORDINATE = number(-10000, 10000)


class Heard(NamedTuple):
    """The names that an utterance may mean, the likeliest first. ``is_certain``: it has one alone,
    and whole or as the family name, without a wrong letter."""

    names: Tuple[str, ...]
    is_certain: bool

    def __str__(self) -> str:
        return " or ".join(self.names) + "?" * (not self.is_certain)


class _Form(NamedTuple):
    """A name, or one word of it, as it may be said: its letters, and the number of words."""

    name: str
    letters: str
    size: int
    is_enough: bool  # it is no first name


class _Part(NamedTuple):
    """The words ``first`` to ``end`` - 1 of an utterance, and a form to which they are like."""

    common: int  # the number of letters that both have
    likeness: float
    form: _Form
    first: int
    end: int


class Directory:
    """The people by name, each with the room, and where each room is."""

    def __init__(self, people: Dict[str, str], rooms: Dict[str, Point]):
        self.people, self.rooms = people, rooms
        self._forms = [form for name in people for form in _forms(name)]
        # each tick looks at an utterance again
        self.heard = functools.lru_cache(maxsize=100)(self._heard)

    def _heard(self, utterance: str) -> Heard:
        """Return the names in an utterance. Of parts with words in common the one with the most
        letters of a name counts, or all that are equal in this."""
        chosen: List[_Part] = []
        parts = self._parts(words_of(utterance)[:MOST_WORDS])
        for part in sorted(parts, key=lambda part: part[:2], reverse=True):
            rivals = (other for other in chosen
                      if part.first < other.end and other.first < part.end)
            if all(part[:2] == other[:2] and part.form.name != other.form.name for other in rivals):
                chosen.append(part)
        names = tuple(dict.fromkeys(part.form.name for part in chosen))
        if len(names) > MOST_NAMES:
            return Heard((), False)
        is_exact = any(part.likeness == 1.0 and part.form.is_enough for part in chosen)
        return Heard(names, len(names) == 1 and is_exact)

    def _parts(self, words: List[str]) -> Iterator[_Part]:
        """Yield each part of an utterance that is like a form of a name; a word more or less may
        be a blank that was misheard."""
        matcher = difflib.SequenceMatcher(autojunk=False)
        for form in self._forms:
            matcher.set_seq2(form.letters)
            size, least = len(form.letters), LIKENESS if len(form.letters) > SHORT else 1.0
            for first, end in _places(len(words), form.size):
                said = "".join(words[first:end])
                if 2 * min(len(said), size) < least * (len(said) + size):
                    continue  # by their lengths alone they are not alike
                matcher.set_seq1(said)
                likeness = matcher.ratio() if matcher.quick_ratio() >= least else 0.0
                if likeness >= least:
                    common = sum(block.size for block in matcher.get_matching_blocks())
                    yield _Part(common, likeness, form, first, end)


def _forms(name: str) -> Iterator[_Form]:
    """Yield the whole name, and its words."""
    words = words_of(name)
    yield _Form(name, "".join(words), len(words), True)
    for number, word in enumerate(words if len(words) > 1 else (), 1):
        if len(word) >= SHORT:
            yield _Form(name, word, 1, number == len(words))


def _places(words: int, size: int) -> Iterator[Tuple[int, int]]:
    """Yield the first word and the end of each part that has about so many words."""
    for first in range(words):
        for end in range(first + max(1, size - 1), min(first + size + 1, words) + 1):
            yield first, end


def words_of(text: str) -> List[str]:
    """Return the words of a text, without accents, capitals and punctuation, in any script."""
    plain = (char for char in unicodedata.normalize("NFKD", text.casefold())
             if not unicodedata.combining(char))
    return "".join(char if char.isalnum() or unicodedata.category(char).startswith("M") else " "
                   for char in plain).split()


class _PeopleReader(LineReader):
    """Reads the rooms and the people, and collects all faults."""

    def __init__(self, path: str):
        super().__init__(read_source(path, "the file of people and rooms"))
        self.people: Dict[str, str] = {}
        self.rooms: Dict[str, Point] = {}
        self._places: Dict[str, tuple] = {}  # of the room in the line of each person

    def line(self, line: TextLine) -> None:
        """Read one line that has words."""
        read = {"room": self._room, "person": self._person}.get(line.key)
        if read is None:
            self.fault(line.place(), f"unknown key {line.key}", "allowed: room, person")
        elif len(line.words) < 3 or line.key == "room" and len(line.words) != 5:
            self.fault(line.place(), f"this is not a line of the form: {FORMS[line.key]}")
        else:
            read(line)

    def _room(self, line: TextLine) -> None:
        room = line.words[1].group()
        if self._is_new(line, room, room, "keep one of them"):
            values = [self.parsed(COORDINATE, line.words[index].group(), axis, line.place(index))
                      for index, axis in enumerate("xyz", 2)]
            self.rooms[room] = Point(*(value or 0.0 for value in values))
            if not any(values) and None not in values:
                self.fault(line.place(2), "0 0 0 is nowhere to point at", "give another point")

    def _person(self, line: TextLine) -> None:
        name, room = " ".join(line.rest(2).split()), line.words[1].group()
        if not words_of(name) or ";" in name:
            self.fault(line.place(2), f"a name cannot be {name}", "it needs letters, and no ;")
        elif self._is_new(line, "".join(words_of(name)), name, "two people need different names"):
            self.people[name], self._places[name] = room, line.place(1)

    def _is_new(self, line: TextLine, entry: str, shown: str, hint: str) -> bool:
        """Return whether no line before has that room or name; else it is a fault."""
        first = self.lines.setdefault(f"{line.key} {entry}", line.number)
        if first != line.number:
            self.fault(line.place(), f"the {line.key} {shown} is in line {first} already", hint)
        return first == line.number

    def finish(self) -> None:
        """Check that each person's room is there."""
        for name, room in self.people.items():
            if room not in self.rooms:
                near = difflib.get_close_matches(room, self.rooms, 1)
                self.fault(self._places[name], f"no line says where the room {room} is",
                           f"did you mean {near[0]}?" if near else f"add a line: {FORMS['room']}")
        if not self.people and not self.faults:
            self.fault(None, "there is nobody in it", f"add a line: {FORMS['person']}")


def load() -> Directory:
    """Read data/people.ini of this package. Raises FaultsFound with every fault of the file."""
    reader = _PeopleReader(os.path.join(package_folder("receptionist"), "data", "people.ini"))
    reader.read()
    FaultsFound.raise_any(reader.faults)
    return Directory(reader.people, reader.rooms)
