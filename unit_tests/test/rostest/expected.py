"""The requests of the lab tour to the robot, in order: derived by hand from data/lab_tour.xml.

A request is (simulated node, what is asked). A frozenset holds what a Parallel asks at once, in any
order.
"""

from behavior_controller.config import phrases
from behavior_controller.simulation.world import building_file, load_building

KNOWLEDGE = load_building(building_file())
SPEECHES = phrases.load("English").speeches


def say(phrase):
    return ("textToSpeech", SPEECHES[phrase])


def describe(text):
    return ("textToSpeech", text)


def animate(state):
    return ("animateBehavior", state)


def attend(state):
    return ("overtAttention", state)


def ask(what):
    return ("knowledgeBase", what)


def iconic(number):
    return ("gestureExecution", ("iconic", number))


def point(place):
    return ("gestureExecution", ("deictic", 1) + tuple(place.gesture))


def drive(place):
    """Return the requests of the subtree NavigateToLocation."""
    return [attend("disabled"), animate("disabled"), ("robotNavigation", tuple(place.location))]


AWAIT_MUTUAL_GAZE = [attend("seeking"), attend("social")]

WELCOME = [frozenset((animate("enabled"), attend("scanning"))),  # DetectVisitor
           # EngageVisitor
           animate("disabled"), iconic(1), animate("enabled"), say("WelcomeSpeech")]
WELCOME += AWAIT_MUTUAL_GAZE
QUESTION = [say("QueryTourSpeech")]
TABLET = [say("PressYesNoSpeech"), ("tabletEvent", "Yes|No")]
FAREWELL = [say("MaybeAnotherTimeSpeech")]


def visit(exhibit):
    """Return the requests of the subtree VisitExhibit."""
    return ([say("FollowMeSpeech")] + drive(exhibit) + AWAIT_MUTUAL_GAZE + [
        describe(exhibit.description1), point(exhibit), attend("social"),
        describe(exhibit.description2)])


VISITS = [request for exhibit in KNOWLEDGE.exhibits for request in visit(exhibit)]
END = ([say("EndTourSpeech"), ask("entrance")] + drive(KNOWLEDGE.entrance) + AWAIT_MUTUAL_GAZE + [
    say("HereIsTheDoorSpeech"),
    point(KNOWLEDGE.entrance),
    frozenset((iconic(3), say("SayGoodByeSpeech")))])
HOME = [ask("home")] + drive(KNOWLEDGE.home)
TOUR = [ask("exhibits")] + VISITS + END + HOME
