"""The settings of a test, for the simulated nodes, the controller and the report.

All of them are arguments, which end with the process. Parameters on a master would outlive the test and change the next
one.
"""
import dataclasses
import os
import random
import sys
from typing import Dict, FrozenSet, List, Mapping

from behavior_controller import knowledge_files, phrases
from behavior_controller.errors import ConfigurationError
from behavior_controller.keys import boolean
from behavior_controller.settings import Settings, split_arguments

from unit_tests import arguments, configuration, exhibits
from unit_tests.robot import NODES, World, nodes
from unit_tests.visitor import BEHAVIOURS, RANDOM, Manners, Visitor


def given() -> Dict[str, str]:
    """Return the arguments of this process."""
    return split_arguments(sys.argv)[1]


def for_rospy() -> List[str]:
    """Return the arguments for rospy: remapped names."""
    return split_arguments(sys.argv)[0]


def is_launched() -> bool:
    """Return whether behaviorControllerTest.launch started this process, so that a report runs too."""
    return arguments.FOLDER in given()


def ros_home() -> str:
    """Return ROS_HOME, the folder where ROS programs of this user may write."""
    return os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")


def folder() -> str:
    """Return the folder of this run's journal and record."""
    return given().get(arguments.FOLDER) or os.path.join(ros_home(), "unit_tests")


def read_configuration() -> configuration.Configuration:
    """Return the configuration of the test, with a seed. Raises ConfigurationError with every fault."""
    arguments.read(arguments.given_to_roslaunch(arguments.parent_command()), arguments.INTERNAL)
    arguments.check(given())
    test = arguments.load_test(given())
    if test.random_seed is None:
        # a node that runs alone needs no common seed
        drawn = int(given().get(arguments.DRAWN) or random.randrange(configuration.SEEDS))
        test = dataclasses.replace(test, random_seed=drawn)
    if test.visitor_behaviour == RANDOM:
        behaviour = random.Random("{}/behaviour".format(test.random_seed)).choice(BEHAVIOURS)
        test = dataclasses.replace(test, visitor_behaviour=behaviour)
    return test


def seed(test: configuration.Configuration, node: str, purpose: str) -> str:
    """Return the seed of a node's random generator: the same in a test and in virtual time."""
    return "{}/{}/{}".format(test.random_seed, node, purpose)


def real_nodes() -> FrozenSet[str]:
    """Return the robot's nodes that are not simulated in this test."""
    return frozenset(node for node in NODES if boolean(given().get(arguments.USE_REAL + node, "false")))


def present_nodes() -> FrozenSet[str]:
    """Return the nodes of the configured robot; the nodes of all robots, if the configuration does not say which."""
    try:
        return frozenset(nodes(arguments.load_controller(given()).interface))
    except ConfigurationError:
        return frozenset(NODES)


def read_world(test: configuration.Configuration) -> World:
    """Return the world before the robot's first request. Raises ConfigurationError."""
    return world(test.visitor_behaviour, arguments.load_controller(given()))


def world(behaviour: str, controller: Settings) -> World:
    """Return the world of a controller with this configuration. Raises ConfigurationError."""
    if controller.interface.has_knowledge_files:
        known = knowledge_files.load()
        knowledge, language, utility = exhibits.of_files(known), phrases.load(known.language), known.phrases
    else:
        knowledge = exhibits.load(os.path.join(configuration.share(), "data", "exhibits.json"))
        language, utility = phrases.load(controller.language), {}
    manners = _manners(behaviour, language, utility, knowledge)
    return World(Visitor(manners), knowledge, controller)


def _manners(behaviour: str, language: phrases.Phrases, utility: Mapping[int, str],
             knowledge: exhibits.Knowledge) -> Manners:
    """Return a visitor's manners; ``utility`` are the utility phrases of release 1.0, which add to the language."""
    asking = [speech for speech in phrases.SPEECHES if speech.asks]
    questions = [language.speech(speech.node) for speech in asking]
    questions += [utility[speech.utility] for speech in asking if speech.utility in utility]
    yes, no = language.tablet_options
    home = knowledge.home.location
    is_on_tour = knowledge.home in knowledge.exhibits
    return Manners(behaviour, questions, yes, no, None if is_on_tour else (home.x, home.y))
