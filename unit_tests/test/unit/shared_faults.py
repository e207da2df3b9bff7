"""Faults in code that the controller, the simulated robot and the judge share, each made in all of
them at once: readers, phrases, places, units, names, the visitor, the engine."""
import contextlib
import dataclasses
import math
import operator
from unittest import mock

from behavior_controller.bt.engine import controls, decorators
from behavior_controller.bt.engine.node import Interception, Node, Timed
from behavior_controller.bt.script import operators
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.config import knowledge_files, phrases
from behavior_controller.robot import d543, release_1_0, requests
from behavior_controller.simulation import world
from behavior_controller.simulation.visitor import Visitor

RELEASE = {"robotInterface": "release-1.0", "scenarioSpecification": "release_1_0_tour"}
TABLET, KINYARWANDA = {"asrEnabled": False}, {"language": "Kinyarwanda"}

FAULTS = {}
"""Fault -> the context in which it is made; the visitor, what is replaced in the mission's text,
and the mission's keys that show it."""


def fault(what, made, visitor="engages", edits=(), **mission):
    assert what not in FAULTS
    FAULTS[what] = made, visitor, edits, mission


@contextlib.contextmanager
def given(thing, **fields):
    """Have a frozen record with other fields."""
    before = {name: getattr(thing, name) for name in fields}
    for name, value in fields.items():
        object.__setattr__(thing, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            object.__setattr__(thing, name, value)


def after(thing, name, change):
    """Return the context in which the results of a function are changed."""
    function = getattr(thing, name)
    return lambda: mock.patch.object(
        thing, name, lambda *args, **named: change(function(*args, **named)))


def replaced(thing, name, value):
    return lambda: mock.patch.object(thing, name, value)


# ----------------------------------------------------------------------------------------- messages


def reads(topic, change):
    read = topic.read
    return lambda: given(topic, read=lambda message: change(read(message)))


SOMEBODY, NOBODY = requests.Faces(("visitor",), (False,)), requests.Faces((), ())
fault("every message shows a face", reads(d543.FACES, lambda faces: SOMEBODY), "leaves")
fault("no message shows a face", reads(d543.FACES, lambda faces: NOBODY))
fault("the value of attention is one more", reads(
    d543.ATTENTION, lambda status: status._replace(value=status.value + 1)))
fault("attention always reports a gaze", reads(
    d543.ATTENTION, lambda status: status._replace(value=1)), "noGaze")
fault("the mode of attention is not read", reads(
    d543.ATTENTION, lambda status: status._replace(state="")))
fault("a release's attention always finds somebody", reads(
    release_1_0.ATTENTION, lambda status: status._replace(value=2)), "noGaze", **RELEASE)
fault("each utterance is read as Yes", reads(d543.SPEECH, lambda text: "Yes"), "declines")
fault("each utterance is read as No", reads(d543.SPEECH, lambda text: "No"))
fault("no utterance is read", reads(d543.SPEECH, lambda text: ""))
fault("the first letter of an utterance is lost", reads(d543.SPEECH, lambda text: text[1:]))
fault("a release's utterance is read as Yes", reads(
    release_1_0.SPEECH, lambda text: "Yes"), "declines", **RELEASE)


# ------------------------------------------------------------------------------ services of table 3


def on_place(change):
    """Return the context in which the places of an answer are read otherwise."""
    return after(d543, "_exhibit", change)


def moved(change):
    return lambda place: place._replace(location=change(place.location))


EXCHANGED = moved(lambda place: place._replace(x=place.y, y=place.x))
RADIANS = moved(lambda place: place._replace(theta_deg=math.radians(place.theta_deg)))
MILLIMETRES = moved(lambda place: place._replace(x=place.x * 1000.0, y=place.y * 1000.0))
PLACES = {"x and y exchanged": EXCHANGED, "its angle in radians": RADIANS,
          "millimetres for metres": MILLIMETRES,
          "its descriptions exchanged": lambda place: place._replace(
              description1=place.description2, description2=place.description1),
          "no gesture target": lambda place: place._replace(gesture=requests.Point(0.0, 0.0, 0.0)),
          "no name": lambda place: place._replace(name="")}
for what, change in PLACES.items():
    fault("a place is read from an answer with " + what, on_place(change))

for service in d543.SERVICES:
    if service.success is not None:
        field, done, refused = service.success
        swapped = service.success._replace(done=refused, refused=done)
        mission = TABLET if service.request is requests.Prompt else {}
        fault(f"done and refused are exchanged at {service.name}",
              lambda service=service, swapped=swapped: given(service, success=swapped), **mission)
        fault(f"{service.name} has another name",
              lambda service=service: given(service, name=service.name + "s"), **mission)

PROMPT = next(service for service in d543.SERVICES if service.request is requests.Prompt)
fault("each press is read as Yes", lambda: given(
    PROMPT, answer=lambda response: requests.Answer(response="Yes")), "declines", **TABLET)
fault("no press is read", lambda: given(
    PROMPT, answer=lambda response: requests.Answer()), **TABLET)


def sends(kind, change, service=None):
    service = next(one for one in d543.SERVICES if one.request is kind)
    fields = service.fields
    return lambda: given(service, fields=lambda request: change(fields(request)))


for what, kind, change in (
        ("a goal's x and y are exchanged", requests.GoTo, lambda goal: (goal[1], goal[0], goal[2])),
        ("a goal's angle is sent in radians", requests.GoTo,
         lambda goal: (*goal[:2], math.radians(goal[2]))),
        ("a goal is sent in millimetres", requests.GoTo,
         lambda goal: (goal[0] * 1000, goal[1] * 1000, goal[2])),
        ("a gesture's time is sent in seconds", requests.PerformGesture,
         lambda gesture: (*gesture[:2], gesture[2] // 1000, *gesture[3:])),
        ("a gesture's target has y and z exchanged", requests.PerformGesture,
         lambda gesture: (*gesture[:5], gesture[6], gesture[5])),
        ("lifelike movement is switched the wrong way", requests.SetAnimation,
         lambda state: ({"enabled": "disabled", "disabled": "enabled"}[state[0]],)),
        ("attention is always set to social", requests.SetAttention,
         lambda mode: ("social", *mode[1:])),
        ("the last word of a text is not sent", requests.Say,
         lambda text: (text[0].rpartition(" ")[0] or text[0],)),
        ("the entrance is asked for in place of home", requests.QueryKnowledge,
         lambda what: (what[0].replace("home", "entrance"),))):
    fault(what, sends(kind, change))
fault("the tablet shows its options the wrong way round", sends(
    requests.Prompt, lambda options: ("|".join(options[0].split("|")[::-1]),)), **TABLET)


# ------------------------------------------------------------------------------------------ phrases


def with_phrases(change):
    return after(phrases, "load", change)


def with_meaning(**lists):
    return with_phrases(lambda found: dataclasses.replace(found, meanings={**found.meanings, **{
        name: change(found.meanings) for name, change in lists.items()}}))


SHOWN_TO = {"MaybeAnotherTimeSpeech": "declines", "SayYesNoSpeech": "silent"}
for speech in phrases.SPEECHES:
    name = speech.node
    mission = TABLET if name == "PressYesNoSpeech" else {}
    fault(f"{name} has another text", with_phrases(
        lambda found, name=name: dataclasses.replace(
            found, speeches={**found.speeches, name: found.speeches[name] + " Please"})),
        SHOWN_TO.get(name, "engages"), **mission)
_load = phrases.load
fault("the phrases of the first language are those of the second", replaced(
    phrases, "load", lambda language, mission="": _load("Kinyarwanda", mission)))
fault("the phrases of the second language are those of the first", replaced(
    phrases, "load", lambda language, mission="": _load("English", mission)), **KINYARWANDA)
fault("a mission's own phrases are not read", replaced(
    phrases, "load", lambda language, mission="": _load(language)),
    scenarioSpecification="reception")
fault("a speech of the second language has another text", with_phrases(
    lambda found: dataclasses.replace(found, speeches={
        **found.speeches, "WelcomeSpeech": "Muraho"})), **KINYARWANDA)
fault("the labels of the tablet are exchanged", with_phrases(
    lambda found: dataclasses.replace(found, tablet_options=found.tablet_options[::-1])), **TABLET)
fault("the labels of the tablet are exchanged, and a visitor speaks", with_phrases(
    lambda found: dataclasses.replace(found, tablet_options=found.tablet_options[::-1])),
    "declines")
fault("the words for yes and no are exchanged", with_meaning(
    yes=lambda found: found["no"], no=lambda found: found["yes"]), "declines")
fault("there are no words for yes", with_meaning(yes=lambda found: (("hm",),)))
fault("what is unclear counts as yes", with_meaning(
    yes=lambda found: found["yes"] + found["unclear"], unclear=lambda found: ()), "unclear")
fault("the words of the second language are those of the first", with_phrases(
    lambda found: dataclasses.replace(found, meanings=_load("English").meanings)), **KINYARWANDA)
fault("an utterance without yes or no is a yes", replaced(
    phrases.Phrases, "spoken_answer", lambda self, text: "yes"), "unclear")


# ------------------------------------------------------------------------------------------- places


def in_building(change):
    return after(world, "load_building", change)


def each_exhibit(change):
    return lambda building: building._replace(exhibits=tuple(map(change, building.exhibits)))


for what, change in PLACES.items():
    fault("a place is read from exhibits.json with " + what, in_building(each_exhibit(change)))
fault("the exhibits are read in reverse", in_building(
    lambda building: building._replace(exhibits=building.exhibits[::-1])))
fault("one exhibit is not read", in_building(
    lambda building: building._replace(exhibits=building.exhibits[:-1])))
fault("home is read as the entrance", in_building(
    lambda building: building._replace(home=building.entrance)))


def in_files(change):
    return after(knowledge_files, "read", change)


def each_place(change):
    return lambda known: dataclasses.replace(known, tour=tuple(map(change, known.tour)))


for what, change in PLACES.items():
    if "millimetres" not in what:
        fault("a place is read from the knowledge files with " + what, in_files(each_place(change)),
              **RELEASE)
fault("the tour of the knowledge files is read in reverse", in_files(
    lambda known: dataclasses.replace(known, tour=known.tour[::-1])), **RELEASE)
fault("each utility phrase is that of the next number", in_files(
    lambda known: dataclasses.replace(known, phrases={
        number: known.phrases.get(number % 7 + 1, "") for number in known.phrases})), **RELEASE)
fault("the language of the knowledge files is another", in_files(
    lambda known: dataclasses.replace(known, language="Kinyarwanda")), **RELEASE)


# -------------------------------------------------------------------------------------- the visitor

fault("a visitor who declines presses yes", replaced(
    Visitor, "press", lambda self, options: options[0]), "declines", **TABLET)
fault("each visitor agrees", replaced(Visitor, "_agrees", True), "declines")
fault("a silent visitor agrees", replaced(
    Visitor, "utterance", lambda self: self.manners.yes), "silent")
fault("each visitor looks back", replaced(Visitor, "looks_back", True), "noGaze")
fault("no visitor ever leaves", replaced(
    Visitor, "_REACTIONS", {name: reaction for name, reaction in Visitor._REACTIONS.items()
                            if name != "robotNavigation"}), "leaves")


# --------------------------------------------------------------------------------------- the engine


def wrapped(kind, name, around):
    method = getattr(kind, name)
    return lambda: mock.patch.object(
        kind, name, lambda self, *args, **named: around(method, self, *args, **named))


def sleeps(change):
    return wrapped(Timed, "start_timer", lambda method, self, msec: method(self, change(msec)))


fault("a Sleep is 0.5 s short", sleeps(lambda msec: max(msec - 500, 0)), "silent")
fault("a Sleep takes seconds for milliseconds", sleeps(lambda msec: msec // 1000))
fault("a Sleep is ten times as long", sleeps(lambda msec: msec * 10), "silent")


def _without_halt(method, self):
    """ReactiveFallback leaves its other children running."""
    self.begin()
    for child in self.children:
        result = child.execute()
        if result is not self.goes_on_at:
            return result
    return self.goes_on_at


fault("a ReactiveFallback does not halt", wrapped(
    controls.ReactiveFallback, "update", _without_halt))


def _first_success(method, self):
    result = method(self)
    if result is RUNNING and any(child.status is SUCCESS for child in self.children):
        return self.complete(SUCCESS)
    return result


fault("a Parallel ends at its first success", wrapped(controls.Parallel, "update", _first_success))
fault("a Parallel needs one success more", wrapped(
    controls.ParallelBase, "threshold", lambda method, self, port, verb: method(
        self, port, verb) + (port == "success_count")))


def attempts(more):
    get_input = Node.get_input
    return lambda: mock.patch.object(
        decorators.RetryUntilSuccessful, "get_input",
        lambda self, port: get_input(self, port) + more * (port == "num_attempts"))


ASKED = (("<IsVisitorResponseYes/>", "<ScriptCondition code='told &gt;= 1'/>"), (
    '<SubTree ID="QueryVisitorResponse"/>',
    """<SubTree ID="QueryVisitorResponse"/><Script code="told := 0"/><ForceSuccess>
    <IsVisitorResponseYes _onSuccess="told := 1"/></ForceSuccess>"""))
SKIPPED_TOUR = (("<IsVisitorResponseYes/>", "<AlwaysSuccess/>"), (
    '<Sequence name="Accepted">', "<Sequence name='Accepted' _skipIf='told == 0'>"), ASKED[1])
"""What is replaced in the lab tour, so that a script asks for the visitor's answer."""

fault("> for >=", lambda: mock.patch.dict(operators._OF_NUMBERS, {">=": operator.gt}), edits=ASKED)
fault("_skipIf is ignored", wrapped(Interception, "_check_before", lambda method, self, node: None),
      "declines", edits=SKIPPED_TOUR)
fault("one attempt more", attempts(1), "silent")
fault("one attempt less", attempts(-1), "silent")


fault("a Sequence goes on after a failure", replaced(controls.Sequence, "goes_on_at", FAILURE))
fault("a Fallback ends at a failure", lambda: mock.patch.multiple(
    controls.Fallback, ends_at=FAILURE, goes_on_at=SUCCESS))
fault("an Inverter does not invert", wrapped(
    decorators.Inverter, "update", lambda method, self: (self.begin(), self.tick_child())[1]))
fault("ForceFailure returns SUCCESS", replaced(
    decorators.ForceFailure, "forced", SUCCESS), "noGaze")
fault("KeepRunningUntilFailure ends after a round", wrapped(
    decorators.KeepRunningUntilFailure, "update",
    lambda method, self: (self.begin(), FAILURE if self.tick_child() is not RUNNING else RUNNING)[1]
))


# --------------------------------------------------------------------------------- in the reception


def _other_branch(method, self):
    """IfThenElse takes the other branch."""
    condition, *branches = self.children
    self.children[:] = [condition, *branches[::-1]]
    try:
        return method(self)
    finally:
        self.children[:] = [condition, *branches]


NO_INVERTER = FAULTS["an Inverter does not invert"][0]
fault("an Inverter does not invert, and a visitor declines", NO_INVERTER, "declines")
RECEPTION = {"scenarioSpecification": "reception"}
OTHER_BRANCH = wrapped(controls.IfThenElse, "update", _other_branch)
fault("IfThenElse takes the other branch", OTHER_BRANCH, **RECEPTION)
fault("IfThenElse takes the other branch, and a visitor declines", OTHER_BRANCH, "declines",
      **RECEPTION)
fault("IfThenElse takes the other branch at a release's reception", OTHER_BRANCH,
      **dict(RELEASE, scenarioSpecification="release_1_0_reception"))
fault("an Inverter of the reception does not invert", NO_INVERTER, **RECEPTION)
fault("ForceSuccess of the reception returns FAILURE, and a visitor declines", replaced(
    decorators.ForceSuccess, "forced", FAILURE), "declines", **RECEPTION)
for holds in (True, False):
    fault(f"== is always {str(holds).lower()}", replaced(
        operators, "_holds", lambda *given, holds=holds: holds), **RECEPTION)
fault("! does nothing", replaced(operators, "_unary", lambda sign, value: value), **RECEPTION)

