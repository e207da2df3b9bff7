"""The requests of the tour of release 1.0 to the robot, in order: derived by hand from
data/release_1_0_tour.xml."""
from behavior_controller.config import knowledge_files

from expected import animate, attend, describe, drive, iconic, point

FILES = knowledge_files.load()
START = FILES.tour[0]


def say(number):
    return ("textToSpeech", FILES.phrases[number])


def recognition(state):
    return ("speechEvent", state)


SET_POSE = ("robotLocalization", tuple(START.location))
PREPARE = [recognition("English"), SET_POSE, recognition("false")]
WELCOME = [animate("enabled"), attend("scanning"), animate("disabled"), iconic(1), say(4),
           attend("seeking"), attend("social")]
QUESTION = [say(5), recognition("true"), recognition("false")]


def visit(place):
    pointing = [point(place)] if any(place.gesture) else []
    return ([say(2)] + drive(place) + [attend("social"), describe(place.description1)] + pointing
            + [describe(place.description2)])


TOUR = [request for place in FILES.tour for request in visit(place)]
END = [attend("social"), say(6), iconic(3), say(7)] + drive(START) + [SET_POSE]
