"""What the arguments of this process and the configurations say, for the simulated nodes, the controller and the report.

All of it is in arguments, which end with the process. Parameters on a master would outlive the test, and count in the
next one.
"""
import dataclasses
import os
import random
import sys
from typing import Dict, FrozenSet, List

from behavior_controller import phrases
from behavior_controller.keys import boolean
from behavior_controller.settings import split_arguments

from unit_tests import arguments, configuration, exhibits
from unit_tests.robot import NODES, World
from unit_tests.visitor import BEHAVIOURS, RANDOM, Manners, Visitor


def given() -> Dict[str, str]:
    """Return what this process was given."""
    return split_arguments(sys.argv)[1]


def for_rospy() -> List[str]:
    """Return the arguments that concern rospy: names."""
    return split_arguments(sys.argv)[0]


def is_launched() -> bool:
    """Return whether behaviorControllerTest.launch started this process, so that a report runs beside it."""
    return arguments.FOLDER in given()


def ros_home() -> str:
    """Return the folder where ROS lets programs of this user write."""
    return os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")


def folder() -> str:
    """Return the folder of this run's journal and record."""
    return given().get(arguments.FOLDER) or os.path.join(ros_home(), "unit_tests")


def read_configuration() -> configuration.Configuration:
    """Return the configuration of the test, with a seed. Raises ConfigurationError with every fault."""
    arguments.read(arguments.given_to_roslaunch(arguments.parent_command()))
    arguments.check(given())
    test = arguments.load_test(given())
    if test.random_seed is None:
        # a node that runs alone shares its seed with no other
        drawn = int(given().get(arguments.DRAWN) or random.randrange(configuration.SEEDS))
        test = dataclasses.replace(test, random_seed=drawn)
    if test.visitor_behaviour == RANDOM:
        behaviour = random.Random("{}/behaviour".format(test.random_seed)).choice(BEHAVIOURS)
        test = dataclasses.replace(test, visitor_behaviour=behaviour)
    return test


def real_nodes() -> FrozenSet[str]:
    """Return the robot's nodes that are not simulated in this test."""
    return frozenset(node for node in NODES if boolean(given().get(arguments.USE_REAL + node, "false")))


def read_world(test: configuration.Configuration) -> World:
    """Return the world before the robot's first move. Raises ConfigurationError."""
    knowledge = exhibits.load(os.path.join(configuration.share(), "data", "exhibits.json"))
    return World(Visitor(read_manners(test, knowledge)), knowledge,
                 arguments.load_controller(given()).mutual_gaze_value)


def read_manners(test: configuration.Configuration, knowledge: exhibits.Knowledge) -> Manners:
    """Return how the visitor behaves. Raises ConfigurationError."""
    language = phrases.load(arguments.load_controller(given()).language)
    questions = [language.speech(node) for node in ("QueryTourSpeech", "SayYesNoSpeech")]
    yes, no = language.tablet_options
    home = knowledge.home.location
    return Manners(test.visitor_behaviour, questions, yes, no, (home.x, home.y))
