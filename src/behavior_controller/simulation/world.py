"""The world of the simulated robot: the building, the visitor, and the controller's configuration,
which all nodes know in addition to a request."""
import json
from typing import Mapping, NamedTuple, Tuple

import msgspec
from msgspec.structs import astuple

from behavior_controller import folders
from behavior_controller.config import knowledge_files, phrases
from behavior_controller.config.settings import Settings
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.robot.requests import Exhibit, Location, Point
from behavior_controller.text import Unreadable, read_text

from behavior_controller.simulation.visitor import Manners, Visitor


class Building(NamedTuple):
    """The places of a mission, the entrance, the robot's home."""

    exhibits: Tuple[Exhibit, ...]
    entrance: Exhibit
    home: Exhibit

    def query(self, what: str) -> Tuple[Exhibit, ...]:
        """Return what ``exhibits``, ``entrance`` or ``home`` (any case) means. Raises KeyError for
        the rest."""
        places = {"exhibits": self.exhibits, "entrance": (self.entrance,), "home": (self.home,)}
        return places[what.lower()]


class World(NamedTuple):
    """What a node knows in addition to the request."""

    visitor: Visitor
    knowledge: Building
    settings: Settings  # the controller's: the robot's interface, and the meaning of a gaze status


def world(behaviour: str, settings: Settings) -> World:
    """Return the world before the robot's first request; ``behaviour`` is the visitor's. Raises
    ConfigurationError."""
    mission = settings.scenario_specification
    utility: Mapping[int, str] = {}  # the phrases of release 1.0, which add to the language
    if settings.interface.has_knowledge_files:
        known = knowledge_files.load(mission, settings.interface.takes_arm)
        language = phrases.load(known.language, mission)
        if settings.interface.numbers_phrases:
            utility = known.phrases
        knowledge = building_of(known)
    else:
        language = phrases.load(settings.language, mission)
        knowledge = load_building(building_file(mission))
    asking = [speech for speech in phrases.SPEECHES if speech.asks]
    questions = [language.speeches[speech.node] for speech in asking]
    questions += [utility[speech.utility] for speech in asking if speech.utility in utility]
    home = None if knowledge.home in knowledge.exhibits else knowledge.home.location[:2]
    answers = [(speech.pattern(language.speeches[speech.node]), speech.simulated_answer)
               for speech in phrases.added() if speech.asks]
    manners = Manners(behaviour, questions, *language.tablet_options, home, knowledge.exhibits,
                      answers, knowledge.home.location[:2])
    return World(Visitor(manners), knowledge, settings)


def building_file(mission: str = "") -> str:
    """Return the path of the building of a robot without knowledge files, for a mission that may
    have its own."""
    return folders.of_mission(folders.data("exhibits.json"), mission)


# ------------------------------------------------------------------------------------- the building


def building_of(known: knowledge_files.Knowledge) -> Building:
    """Return the places of release 1.0's files."""
    return Building(known.tour, known.tour[-1], known.tour[0])


class _Place(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A place as the file has it, with the fields of an Exhibit; home needs no descriptions and no
    gesture."""

    name: str
    description1: str = ""
    description2: str = ""
    location: Location
    gesture: Point = Point(0.0, 0.0, 0.0)


class _Places(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    exhibits: Tuple[_Place, ...]
    entrance: _Place
    home: _Place


FORM = ("there are exhibits (a list), entrance and home; each place has name and location "
        "[x, y, degrees], and may have description1, description2 and gesture [x, y, z]")


def load_building(path: str) -> Building:
    """Read a file of places. Raises ConfigurationError if it cannot be used."""
    try:
        places = msgspec.convert(json.loads(read_text(path)), _Places)
    except (Unreadable, json.JSONDecodeError, msgspec.MsgspecError, RecursionError) as error:
        place = getattr(error, "lineno", 0), getattr(error, "colno", 0)
        reason = "the places cannot be read: {}".format(error)
        raise ConfigurationError([Fault(path, *place, reason, FORM)]) from error
    exhibits, entrance, home = astuple(places)
    return Building(tuple(Exhibit(*astuple(place)) for place in exhibits),
                    Exhibit(*astuple(entrance)), Exhibit(*astuple(home)))
