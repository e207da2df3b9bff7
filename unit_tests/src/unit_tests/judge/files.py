"""The files that a mission goes by, as the judge reads them: phrases, words for yes and no, places.

It shares no reader with the controller. A file has been checked when the mission was loaded, so
that nothing is reported here.
"""
import json
import os
import re
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

from behavior_controller import folders
from behavior_controller.robot.requests import Exhibit, Location, Point
from behavior_controller.text import read_text

YES, NO, UNCLEAR = "yes", "no", "unclear"
_WORD = re.compile(r"[^\W_]+(?:'[^\W_]+)*")
_COMMENT, _COMMENT_LINE = r"(?:^|\s)#", r"^\s*#"


def path_of(name: str, mission: str) -> str:
    """Return the path of a file in ``data``, or of that which the mission has in its place."""
    own = folders.data(f"{mission}_{name}")
    if os.path.isfile(own):
        return own
    return folders.data(name)


def on_file(mission: str, language: str, has_files: bool) -> List[str]:
    """Return the texts that a mission has to go by: its phrases, and on a robot with knowledge
    files those of environment and culture."""
    paths = [path_of(f"phrases_{language}.ini", mission)]
    for kind in ("environment", "culture") if has_files else ():
        lines = _lines(read_text(folders.config(f"{kind}KnowledgeBaseConfiguration.ini")), _COMMENT)
        name = next(value for key, value, *_ in lines if key == "knowledgeBase")
        paths.append(path_of(name.lstrip("= "), mission))
    return list(map(read_text, paths))


def words_of(text: str) -> Tuple[str, ...]:
    """Return the words of what is said, in small letters."""
    return tuple(_WORD.findall(text.lower().replace("’", "'")))


def _lines(text: str, comment: str) -> Iterator[List[str]]:
    """Yield the lines of a file, each as its first word and the rest."""
    for line in text.split("\n"):
        words = re.split(comment, line)[0].split(None, 1)
        if words:
            yield [words[0], *(word.strip() for word in words[1:]), ""]


# ------------------------------------------------------------------------------------------ phrases


class PhrasesFile(NamedTuple):
    """The file of a language: the text of each speech, the labels of yes and no, and the phrases of
    visitors by what they mean."""

    speeches: Mapping[str, str]
    tablet_options: Tuple[str, str]
    meanings: Mapping[str, Sequence[Tuple[str, ...]]]


def phrases(text: str) -> PhrasesFile:
    """Return the phrases of a file."""
    values = {}
    for key, value, *_ in _lines(text, _COMMENT):
        key, is_assigned, begun = key.partition("=")
        if is_assigned:
            value = f"{begun} {value}".strip()
        values[key] = re.sub(r"^=\s*", "", value)
    meanings = {meaning: [words_of(part) for part in values.get(meaning, "").split(",")
                          if words_of(part)] for meaning in (YES, NO, UNCLEAR)}
    return PhrasesFile(values, (values["tabletYes"], values["tabletNo"]), meanings)


# ------------------------------------------------------------------------------------------- places


class KnownPlaces(NamedTuple):
    """The places that the knowledge base has, by what asks for them."""

    exhibits: Tuple[Exhibit, ...]
    entrance: Tuple[Exhibit, ...]
    home: Tuple[Exhibit, ...]


def building(text: str) -> KnownPlaces:
    """Return the places of exhibits.json, in metres and degrees."""
    known = json.loads(text)
    return KnownPlaces(tuple(map(_place, known["exhibits"])), (_place(known["entrance"]),),
                    (_place(known["home"]),))


def _place(known: Mapping[str, Any]) -> Exhibit:
    return Exhibit(known["name"], known.get("description1", ""), known.get("description2", ""),
                   Location(*known["location"]), Point(*known.get("gesture", (0.0, 0.0, 0.0))))


class KnowledgeFiles(NamedTuple):
    """The knowledge files of a release: the places of the tour in its order, the language, the
    utility phrases by number, and how the robot points."""

    tour: Tuple[Exhibit, ...]
    language: str
    phrases: Mapping[int, str]
    arm: str
    shape: str

    @property
    def building(self) -> KnownPlaces:
        """The tour begins at home and ends at the entrance."""
        return KnownPlaces(self.tour, self.tour[-1:], self.tour[:1])


def places(mission: str, has_files: bool) -> KnownPlaces:
    """Return the places that the files of a mission have."""
    if not has_files:
        return building(read_text(path_of("exhibits.json", mission)))
    _, environment, culture = on_file(mission, "English", True)
    return knowledge(environment, culture).building


def knowledge(environment: str, culture: str, takes_arm: bool = False) -> KnowledgeFiles:
    """Return the knowledge of the texts of both files."""
    chosen = {key: value for key, value, *_ in reversed(list(_lines(culture, _COMMENT_LINE)))}
    language, facts = chosen["phraseLanguage"], _facts(environment)
    utility = {int(key[len(start):]): text for start in ["utilityPhrase" + language]
               for key, text in chosen.items()
               if key.startswith(start) and key[len(start):].isdecimal()}
    arm, shape = chosen.get("gestureArm", "EITHER"), chosen.get("deicticShape", "PALM_UPWARDS")
    tour = []
    for place in facts["tourSpecification"].split()[1:]:
        name, before, after, pose, target = (facts.get(f"{key} {int(place)}", "") for key in (
            "robotLocationDescription", f"preGestureMessage{language}",
            f"postGestureMessage{language}", "robotLocationPose", "gestureTarget"))
        tour.append(Exhibit(name, before, after, Location(*map(float, pose.split())),
                            Point(*map(float, (target or "0 0 0").split()))))
    return KnowledgeFiles(tuple(tour), language, utility, arm * takes_arm, shape * takes_arm)


def _facts(environment: str) -> Dict[str, str]:
    """Return the lines of the environment file by key and the number of the place."""
    facts: Dict[str, str] = {}
    for key, value, *_ in _lines(environment, _COMMENT_LINE):
        if key == "tourSpecification":
            facts.setdefault(key, value)
        elif value:
            place, text, *_ = [*value.split(None, 1), ""]
            facts.setdefault(f"{key} {int(place)}", text.strip())
    return facts
