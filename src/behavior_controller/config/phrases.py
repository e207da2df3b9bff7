"""The robot's speech and labels in one language, and the words of a visitor that mean yes or no.

A language is a file ``data/phrases_<language>.ini`` in the form of the configuration.
"""
import glob
import itertools
import os
import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Callable, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Pattern, Tuple

from behavior_controller import extensions, folders
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.config.config_file import (
    Key, REQUIRED, Reader, collected, read_source, some_text)
from behavior_controller.text import Source, did_you_mean


_VARIABLE = re.compile(r"\{(\w+)\}")


class Speech(NamedTuple):
    """A mission node that says a fixed text; ``asks``: the visitor's answer may follow. See
    MissionSpec too.

    ``utility`` is the number of release 1.0's utility phrase that says the same; 0: none does.
    ``variables`` are the ports whose values the text has in braces, in every language.
    ``simulated_answer`` is what a simulated visitor answers who agrees, if that is not a yes.
    """

    node: str
    asks: bool
    description: str
    is_farewell: bool = False
    utility: int = 0
    variables: Tuple[str, ...] = ()
    simulated_answer: str = ""

    def pattern(self, text: str) -> Pattern[str]:
        """Return what matches its text with any values."""
        parts = _VARIABLE.split(text)[::2] if self.variables else [text]
        return re.compile(".+".join(map(re.escape, parts)), re.DOTALL)


SPEECHES = (
    Speech("WelcomeSpeech", False, "Welcomes the visitor.", utility=4),
    Speech("QueryTourSpeech", True, "Asks whether the visitor would like a tour.", utility=5),
    Speech("SayYesNoSpeech", True, "Says that it only understands yes or no."),
    Speech("PressYesNoSpeech", True, "Asks to press yes or no on the tablet.", utility=1),
    Speech("FollowMeSpeech", False, "Asks the visitor to follow.", utility=2),
    Speech("MaybeAnotherTimeSpeech", False, "Lets a visitor go without a tour.", utility=3),
    Speech("EndTourSpeech", False, "Closes the tour after the last exhibit.", True),
    Speech("HereIsTheDoorSpeech", False, "Shows the way out in words.", True, 6),
    Speech("SayGoodByeSpeech", False, "Says goodbye.", True, 7))

YES, NO, UNCLEAR = "yes", "no", "unclear"
_WORD = re.compile(r"[^\W_]+(?:['’][^\W_]+)*")

Words = Tuple[str, ...]


def _sentence(text: str) -> Words:
    return tuple(_WORD.findall(text.lower().replace("’", "'")))


def _phrase_list(text: str) -> Tuple[Words, ...]:
    return tuple(_sentence(part) for part in text.split(","))


_TEXT = some_text("the text to say")
_LABEL = some_text("a label without |", "|")
_PHRASES = Reader("words with commas between them", _phrase_list,
                  lambda text: () not in _phrase_list(text))


def _keys_of(speeches: Iterable[Speech]) -> Tuple[Key, ...]:
    return tuple(Key(said.node, _text(said), REQUIRED, f"what {said.node} says")
                 for said in speeches)


def _text(said: Speech) -> Reader[str]:
    if not said.variables:
        return _TEXT
    names = " and ".join(map("{{{}}}".format, said.variables))
    return Reader(f"{_TEXT.allowed}, with {names}", str,
                  lambda text: set(_VARIABLE.findall(text)) == set(said.variables))


PHRASE_KEYS = _keys_of(SPEECHES) + (
    Key("tabletYes", _LABEL, REQUIRED, "a button on the tablet"),
    Key("tabletNo", _LABEL, REQUIRED, "a button on the tablet"),
    Key(YES, _PHRASES, REQUIRED, "what means yes"),
    Key(NO, _PHRASES, REQUIRED, "what means no"),
    Key(UNCLEAR, _PHRASES, (), "what is not an answer although it sounds like one"))
_OF_ANSWERS = frozenset(key.name for key in PHRASE_KEYS[len(SPEECHES):])


@dataclass(frozen=True)
class Phrases:
    """One language: the text of each speech, the labels of yes and no, and the phrases of visitors
    by what they mean.

    ``source`` is the file it was read from.
    """

    speeches: Mapping[str, str]
    tablet_options: Tuple[str, str]
    meanings: Mapping[str, Tuple[Words, ...]]
    source: Source = Source("", "")

    @cached_property
    def _meaning_of(self) -> Mapping[str, str]:
        return {" ".join(phrase): meaning for meaning, phrases in self.meanings.items()
                for phrase in phrases}

    @cached_property
    def _phrase(self) -> Pattern[str]:
        """Matches the longest phrase, so that "why not" is not taken for its "not"."""
        longest_first = sorted(self._meaning_of, key=len, reverse=True)
        return re.compile(rf"(?<!\S)(?:{'|'.join(longest_first)})(?!\S)")

    def utility(self, number: int) -> Optional[str]:
        """Return the text of the speech that says the same as release 1.0's utility phrase of that
        number, or None."""
        return next((self.speeches[speech.node] for speech in SPEECHES if speech.utility == number),
                    None)

    def spoken_answer(self, utterance: str) -> Optional[str]:
        """Return ``yes`` or ``no`` for what a visitor said, or None. A no outweighs a yes;
        ``Error…`` is not an answer."""
        if begins_with_error(utterance):
            return None
        said = self._phrase.findall(" ".join(_sentence(utterance)))
        meanings = {self._meaning_of[phrase] for phrase in said}
        return next((answer for answer in (NO, YES) if answer in meanings), None)

    def is_answer(self, utterance: str) -> bool:
        """Return whether a visitor said yes or no."""
        return self.spoken_answer(utterance) is not None

    def pressed_answer(self, response: str) -> Optional[str]:
        """Return ``yes`` or ``no`` for a button's label or number (``1`` is the first), or None."""
        yes, no = map(str.lower, self.tablet_options)
        return {"2": NO, no: NO, "1": YES, yes: YES}.get(response.strip().lower())


def is_error(utterance: str) -> bool:
    """Return whether this is an error of the speech recognition, and not a visitor's words."""
    return "Error" in utterance or begins_with_error(utterance)


def begins_with_error(utterance: str) -> bool:
    """Return whether the utterance is in the form of an error of D5.4.3's speech recognition."""
    return utterance.lstrip().lower().startswith("error")


def languages() -> List[str]:
    """Return the languages that have a file of phrases."""
    paths = glob.glob(folders.data("phrases_*.ini"))
    return sorted(os.path.basename(path)[len("phrases_"):-len(".ini")] for path in paths)


def filled(text: str, value: Callable[[str], str]) -> str:
    """Return a text with the ``value`` of each variable."""
    return _VARIABLE.sub(lambda found: value(found[1]), text)


def added() -> Tuple[Speech, ...]:
    """Return the speeches of other packages."""
    return tuple(speech for extension in extensions.exported("phrases")
                 for speech in extension.declared("SPEECHES", Speech))


def load(language: str, mission: str = "") -> Phrases:
    """Return the phrases of ``language``, for a mission that may have its own, and of each package
    that has some.

    Raises ConfigurationError with every fault of the first file that has any.
    """
    known = languages()
    if language not in known:
        hint = did_you_mean(language, known) or (
            f"there are: {', '.join(known)}; another language is a file "
            f"data/phrases_{language}.ini")
        raise ConfigurationError.of("language", f"there are no phrases in {language}", hint)
    name = f"phrases_{language}.ini"
    own = read_source(folders.of_mission(folders.data(name), mission), "the file of phrases")
    found = _phrases(own, PHRASE_KEYS)
    for extension in extensions.exported("phrases"):
        source = read_source(os.path.join(extension.folder, "data", name),
                             f"the file of phrases of the package {extension.package}")
        texts = collected(source, _keys_of(extension.declared("SPEECHES", Speech))).result()
        both = Source(own.file, f"{found.source.text}\n{source.text}")
        found = replace(found, speeches={**found.speeches, **texts}, source=both)
    return found


def recorded(source: Source) -> Phrases:
    """Return the phrases of a record. It has all that its mission says; what packages have declared
    since then is said by its name."""
    written = re.findall(r"^\s*(\w+)", source.text, re.MULTILINE)
    names = dict.fromkeys(written + [speech.node for speech in SPEECHES + added()])
    texts = tuple(Key(name, _TEXT, name, "") for name in names if name not in _OF_ANSWERS)
    return _phrases(source, texts + PHRASE_KEYS[len(SPEECHES):])


def _phrases(source: Source, keys: Tuple[Key, ...]) -> Phrases:
    """Return the phrases of a file with these keys. Raises ConfigurationError with every fault."""
    values = collected(source, keys).result()
    faults = [Fault(source.file, 0, 0, f"\"{' '.join(phrase)}\" is in {one} and in {other}",
                    "keep one of them")
              for one, other in itertools.combinations((YES, NO, UNCLEAR), 2)
              for phrase in sorted(set(values[one]).intersection(values[other]))]
    labels = values["tabletYes"], values["tabletNo"]
    ConfigurationError.raise_any(faults + list(_ambiguous(source.file, *labels)))
    return Phrases({name: values[name] for name in values if name not in _OF_ANSWERS}, labels,
                   {meaning: values[meaning] for meaning in (YES, NO, UNCLEAR)}, source)


def _ambiguous(file: str, yes: str, no: str) -> Iterator[Fault]:
    """Yield a fault for each label of a button that is a label or number of the other one too."""
    if yes.lower() == no.lower():
        text = f"tabletYes is \"{yes}\", and tabletNo is \"{no}\""
        yield Fault(file, 0, 0, text, "choose labels that differ in more than capital letters")
    for key, label, number in (("tabletYes", yes, "2"), ("tabletNo", no, "1")):
        if label == number:
            text = f"{key} cannot be {number}, which is the number of the other button"
            yield Fault(file, 0, 0, text, "choose another label")
