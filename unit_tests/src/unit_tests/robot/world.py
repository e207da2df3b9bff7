"""The world of the simulated robot: the building, the visitor, and the controller's configuration,
which all nodes know in addition to a request."""
import os
from typing import Mapping, NamedTuple

from behavior_controller.config import knowledge_files, phrases
from behavior_controller.config.settings import Settings
from behavior_controller.folders import of_mission

from unit_tests import folders
from unit_tests.robot import building
from unit_tests.robot.building import Building
from unit_tests.robot.visitor import Manners, Visitor


class World(NamedTuple):
    """What a node knows in addition to the request."""

    visitor: Visitor
    knowledge: Building
    settings: Settings  # the controller's: the robot's interface, and the meaning of a gaze status


def world(behaviour: str, settings: Settings) -> World:
    """Return the world before the robot's first request; ``behaviour`` is the visitor's. Raises
    ConfigurationError."""
    mission = settings.scenario_specification
    if settings.interface.has_knowledge_files:
        known = knowledge_files.load(mission)
        language, utility = phrases.load(known.language, mission), known.phrases
        knowledge = building.of_files(known)
    else:
        language, utility = phrases.load(settings.language, mission), {}
        knowledge = building.load(building_file(mission))
    return World(Visitor(_manners(behaviour, language, utility, knowledge)), knowledge, settings)


def building_file(mission: str = "") -> str:
    """Return the path of the building of a robot without knowledge files, for a mission that may
    have its own."""
    return of_mission(os.path.join(folders.share(), "data", "exhibits.json"), mission)


def _manners(behaviour: str, language: phrases.Phrases, utility: Mapping[int, str],
             knowledge: Building) -> Manners:
    """Return a visitor's manners; ``utility`` are the utility phrases of release 1.0, which add to
    the language."""
    asking = [speech for speech in phrases.SPEECHES if speech.asks]
    questions = [language.speech(speech.node) for speech in asking]
    questions += [utility[speech.utility] for speech in asking if speech.utility in utility]
    yes, no = language.tablet_options
    home = knowledge.home.location
    is_stop = knowledge.home in knowledge.exhibits
    return Manners(behaviour, questions, yes, no, None if is_stop else (home.x, home.y),
                   knowledge.exhibits)
