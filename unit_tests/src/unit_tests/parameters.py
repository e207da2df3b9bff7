"""What the launch file and the configurations say, as the simulated nodes and the report read it from ROS."""
import os
import random
from typing import Any, Dict, FrozenSet

import rospy

from behavior_controller import folders, phrases, settings

from unit_tests import configuration, exhibits
from unit_tests.robot import NODES, World
from unit_tests.visitor import BEHAVIOURS, RANDOM, Manners, Visitor

NAMESPACE = "/unit_tests"
"""Parameters below it override the configuration of all nodes; a private parameter that of one node."""

FOLDER = NAMESPACE + "/folder"
DRAWN_SEED = NAMESPACE + "/drawn"
"""The seed that the launch file draws, so that all nodes have the same; it counts where no randomSeed is given."""

CONTROLLER = "/behaviorController"


def is_launched() -> bool:
    """Return whether behaviorControllerTest.launch started this process, so that a report runs beside it."""
    return rospy.has_param(FOLDER)


def ros_home() -> str:
    """Return the folder where ROS lets programs of this user write."""
    return os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")


def folder() -> str:
    """Return the folder of this run's journal and record."""
    return rospy.get_param(FOLDER, os.path.join(ros_home(), "unit_tests"))


def _below(name: str) -> Dict[str, Any]:
    values = rospy.get_param(name, {})
    return values if isinstance(values, dict) else {}


def read_configuration(node: str = "") -> configuration.Configuration:
    """Return the configuration of the test for ``node``, with a seed. Raises ConfigurationError with every fault."""
    given = {key: value for key, value in _below(NAMESPACE).items() if not key.startswith("use_real_")}
    test = configuration.load(dict(given, **(_below(node) if node else {})))
    if test.random_seed is None:
        # a node that runs alone has nobody to share its seed with
        test = test._replace(random_seed=rospy.get_param(DRAWN_SEED, random.randrange(configuration.SEEDS)))
    if test.visitor_behaviour == RANDOM:
        behaviour = random.Random("{}/behaviour".format(test.random_seed)).choice(BEHAVIOURS)
        test = test._replace(visitor_behaviour=behaviour)
    return test


def real_nodes() -> FrozenSet[str]:
    """Return the robot's nodes that are not simulated in this test."""
    return frozenset(node for node in NODES if rospy.get_param("{}/use_real_{}".format(NAMESPACE, node), False))


def read_world(test: configuration.Configuration) -> World:
    """Return the world before the robot's first move. Raises ConfigurationError."""
    knowledge = exhibits.load(os.path.join(configuration.share(), "data", "exhibits.json"))
    return World(Visitor(read_manners(test, knowledge)), knowledge, _read_controller().mutual_gaze_value)


def _read_controller() -> settings.Settings:
    """Return the controller's configuration: it decides how the robot asks and what a gaze status means."""
    return settings.load(folders.config("behaviorControllerConfiguration.ini"), _below(CONTROLLER))


def read_manners(test: configuration.Configuration, knowledge: exhibits.Knowledge) -> Manners:
    """Return how the visitor behaves. Raises ConfigurationError."""
    language = phrases.load(_read_controller().language)
    questions = [language.speech(node) for node in ("QueryTourSpeech", "SayYesNoSpeech")]
    yes, no = language.tablet_options
    home = knowledge.home.location
    return Manners(test.visitor_behaviour, questions, yes, no, (home.x, home.y))
