"""The outcome of each visit by people's measures: what a visitor would object to, whatever tree and
engine brought it about.

It reads the journal alone, between the times at which a pass began and ended. The rules are those
of a tour, a mission whose stops are exhibits, and of a reception, which asks for the wanted place.
"""
import math
from typing import Collection, Dict, Iterator, List, Mapping, NamedTuple, Optional

from behavior_controller.robot.requests import Exhibit, Location, Say
from behavior_controller.run.state import Visit
from behavior_controller.simulation.configuration import IDLE_ACTION
from behavior_controller.simulation.faults import WRONG
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.visitor import (
    DECLINES, ENGAGES, LEAVES, NO_GAZE, SILENT, UNCLEAR, WANTED)

from unit_tests.judge import reference
from unit_tests.judge.facts import Facts
from unit_tests.judge.files import KnownPlaces, YES
from unit_tests.judge.wire import FACES, SENT, node_of, robot_of

PROMPT_RATE = 600.0
"""Messages per minute on each topic from which on none comes too late for a visitor who engages."""

DOES = {ENGAGES: "engages", SILENT: "is silent", UNCLEAR: "is unclear", DECLINES: "declines",
        LEAVES: "leaves", NO_GAZE: "never looks back"}

NOTICED_BY = {**dict.fromkeys((DECLINES, SILENT, UNCLEAR), reference.ANSWERS),
              NO_GAZE: reference.GAZES, LEAVES: reference.PRESENCES}
"""The node types without which a mission does not ask what a visitor of a kind does."""


class Part(NamedTuple):
    """A part of an exhibit's description that was said, and where the robot had driven to."""

    text: str
    place: Location
    is_on_the_way: bool


class VisitOutcome:
    """What the visitor of one pass saw and heard, by the journal."""

    ALL_SHOWN = "the visitor was shown all exhibits"
    STAYS = True
    """Whether a visitor who leaves may be there to the end."""
    FAREWELLS = reference.FAREWELLS.keys() - {reference.REFUSED}
    """The node types of what a visitor who engages has to be told, if the mission has them."""

    def __init__(self, visit: Visit, facts: Facts, places: KnownPlaces,
                 node_types: Collection[str], farewells: Mapping[str, str]):
        """``node_types`` are those of the mission, ``farewells`` what is said at the end of a visit
        by each node that says it."""
        self._facts, self._places, self.visit = facts, places, visit
        self._node_types, self._farewells = set(node_types), farewells
        lines = [line for line in facts.journal
                 if visit.began <= line.time <= (visit.ended or math.inf)]
        self._lines = [line for line in lines if line.call]
        self._messages = [line for line in lines if not line.call]
        self._drives = [line for line in self._lines
                        if line.node == "robotNavigation" and line.done]
        self._exhibits: Dict[str, List[Exhibit]] = {}  # by each part of their descriptions
        self._goals = list(map(_goal, self._drives))
        for place in places.exhibits:
            for text in _parts(place):
                self._exhibits.setdefault(text, []).append(place)
        self.described = list(self._descriptions())
        self.shown = list(dict.fromkeys(
            place.name for part in self.described for place in self._exhibits[part.text][:1]))

    def _descriptions(self) -> Iterator[Part]:
        """Yield the parts of descriptions that were said."""
        both = {" ".join(_parts(place)): _parts(place) for place in self._places.exhibits}
        place, arrives = self._places.home[0].location, -math.inf
        for line in self._lines:
            if line in self._drives:
                place, arrives = _goal(line), line.time + line.seconds
            said = _said(line)
            for text in both.get(said) or [said] * (said in self._exhibits):
                yield Part(text, place, arrives > line.time + self._facts.early)

    def objections(self) -> Iterator[str]:
        """Object to what was said at the wrong place, to a tour that was not wanted, and to one
        that was not given."""
        behaviour = self._facts.test.visitor_behaviour
        is_asked = not self._node_types.isdisjoint(NOTICED_BY.get(behaviour, ()))
        yield from self._of_places()
        yield from self._of_drives()
        if behaviour == ENGAGES and self._is_calm and (
                not self._node_types.isdisjoint(reference.DESCRIBES)):
            yield from self._of_tour()
        elif behaviour == LEAVES and is_asked:
            yield from self._of_leaving()
        elif is_asked and not self._may_be_misread:
            elsewhere = [place.location for place in self._places.home + self._places.entrance]
            goals = [goal for goal in self._goals if goal not in elsewhere]
            if self.shown or goals:
                what = ", ".join(self.shown) or "driven to {:g}, {:g}, {:g}°".format(*goals[0])
                yield f"the visitor, who {DOES[behaviour]}, was shown {what}"
            if behaviour == DECLINES and self._is_calm:
                yield from self._not_told({reference.REFUSED})

    def _of_places(self) -> Iterator[str]:
        """Object to an exhibit that is described away from its place."""
        for part in self.described:
            exhibits = self._exhibits[part.text]
            what = f"{exhibits[0].name} was described"
            if part.place not in [place.location for place in exhibits]:
                yield what + " where the robot stood at {:g}, {:g}, {:g}°".format(*part.place)
                break  # the others may follow from it
            if part.is_on_the_way:
                yield what + " while the robot drove there"
                break

    def _of_drives(self) -> Iterator[str]:
        """Object to a drive that begins while the robot points, describes or takes its leave, if
        the mission does one after the other."""
        if any(node_type.endswith("Async") for node_type in self._node_types):
            return
        for drive in self._drives:
            for line in self._lines:
                is_there = line.time < drive.time < line.time + line.seconds - self._facts.early
                text = _said(line)
                is_seen = line.node == "gestureExecution" and line.done or (
                    text in self._exhibits or text in self._farewells.values())
                if is_there and is_seen:
                    yield "the robot drove away while it {}".format(
                        f"said “{text}”" if text else "made a gesture")

    @property
    def is_whole(self) -> bool:
        """Whether each exhibit was described, in their order, and the robot has driven home, if the
        mission has it do so."""
        due = [text for place in self._places.exhibits for text in _parts(place)]
        is_home = self._goals[-1:] == [self._places.home[0].location] or (
            self._node_types.isdisjoint(reference.LOOK_HOME))
        return [part.text for part in self.described] == due and is_home

    @property
    def is_right(self) -> bool:
        """Whether the visit ended as a visitor of that kind expects."""
        is_shown = self.is_whole or self._facts.test.visitor_behaviour != ENGAGES
        return is_shown and not any(self.objections())

    @property
    def _is_calm(self) -> bool:
        """Whether nothing was in the way of a tour: no fault or deadline, also just before, no
        message too late, no answer that cannot reach the robot, no mission that waits for nobody.
        """
        facts, settings = self._facts, self._facts.world.settings
        test, robot = facts.test, robot_of(settings)
        is_heard = robot.tells_pressed or settings.tablet_success_is == YES
        if settings.asr_enabled:
            is_heard = test.recognise_by != IDLE_ACTION
        has_all = not (test.absent_services or test.absent_actions or facts.real or any(
            stall.ends - stall.begins > facts.late for stall in facts.stalls))
        begins, ends = self.visit.began - facts.away, self.visit.ended or 0.0
        calls = (line for line in facts.journal if line.call and begins <= line.time <= ends)
        has_faults = any(not line.done or line.seconds + facts.late > settings.deadlines[
            line.node + "Deadline"] for line in calls)
        is_prompt = test.arrival_rate >= PROMPT_RATE and settings.topic_max_age >= facts.late
        waits = robot.has_files or settings.condition_wait > 0.0 or not (
            self._node_types.isdisjoint(reference.WAITS))
        return (bool(self.visit.outcome) and has_all and is_prompt and waits and is_heard
                and not has_faults)

    @property
    def _may_be_misread(self) -> bool:
        """Whether an answer without a meaning may have been taken for a yes."""
        return any(line.fault == WRONG and line.node == "tabletEvent" for line in self._lines)

    def _shown_in_short(self) -> str:
        """Return what a visitor who engages was shown, in words."""
        return "shown {} of {} exhibits in this order: {}".format(
            len(self.shown), len(self._places.exhibits), ", ".join(self.shown) or "none")

    def _of_tour(self) -> Iterator[str]:
        if not self.is_whole:
            yield f"the visitor, who engages, was {self._shown_in_short()}"
            return
        if self.visit.outcome != "SUCCESS":
            yield f"{self.ALL_SHOWN}, and the pass ended in {self.visit.outcome}"
        yield from self._not_told(self.FAREWELLS)

    def _not_told(self, farewells: Collection[str]) -> Iterator[str]:
        """Object to what the mission has these nodes say and the visitor was not told, if the
        journal has what is said."""
        if Say not in SENT:
            return
        said = list(map(_said, self._lines))
        for node in self._node_types.intersection(farewells):
            if self._farewells[node] not in said:
                yield "the visitor, who {}, was not told “{}”".format(
                    DOES[self._facts.test.visitor_behaviour], self._farewells[node])

    def _of_leaving(self) -> Iterator[str]:
        """Object to an exhibit that is begun, or a goodbye, for a visitor who has been gone for so
        long, by the sensors, that the robot has to know."""
        limit = self._facts.world.settings.topic_max_age + self._facts.late
        begins = [text for place in self._places.exhibits for text in _parts(place)[:1]]
        told = [line for line in self._lines
                if _said(line) in begins or _said(line) in self._farewells.values()]
        for line in told:
            seen = [(message.time, _sees(message)) for message in self._messages
                    if message.time < line.time and _sees(message) is not None]
            present = max((at for at, is_there in seen if is_there), default=0.0)
            gone = next((at for at, _ in seen if at > present), math.inf)
            if line.time > gone + limit and not self._is_held_up(line):
                yield f"“{_said(line)}” was said to a visitor who had left"
                return
        is_whole = self.STAYS and self.is_whole
        if is_whole and any(message.node == node_of(FACES) for message in self._messages):
            yield "the visitor, who leaves, was there to the end"

    def _is_held_up(self, said: JournalEntry) -> bool:
        """Return whether a call failed since the last drive: the mission may have looked for the
        visitor before that."""
        since = max((drive.time for drive in self._drives if drive.time < said.time), default=0.0)
        return any(not line.done for line in self._lines if since < line.time < said.time)


class ReceptionOutcome(VisitOutcome):
    """What the visitor of one pass of a reception saw and heard: the first description of a place
    asks whether it is the wanted one, the second tells the way to it."""

    ALL_SHOWN = "the visitor was told the way"
    STAYS = False  # but leaves on the way to the place, or before
    FAREWELLS = {reference.GOODBYE}

    @property
    def _told(self) -> List[Exhibit]:
        """The places to which the way was told."""
        return [place for part in self.described for place in self._exhibits[part.text][:1]
                if part.text == place.description2]

    @property
    def is_whole(self) -> bool:
        """Whether the way was told to the wanted place alone, and the robot is at home."""
        is_home = self._goals[-1:] in ([], [self._places.home[0].location])
        return self._told == self._wanted and is_home

    @property
    def _wanted(self) -> List[Exhibit]:
        """The place that the visitor looks for, if the robot knows it."""
        named = [place.name for place in self._facts.world.visitor.manners.places[:WANTED + 1]]
        return [place for place in self._places.exhibits if place.name in named[-1:]]

    def _of_places(self) -> Iterator[str]:
        """Object to the way to another place than the visitor was asked about last, unless a
        question may have failed."""
        asked = ""
        if not self._is_calm:
            return
        for part in self.described:
            place = self._exhibits[part.text][0]
            if part.text == place.description1:
                asked = place.name
            elif place.name != asked:
                yield f"the way to {place.name} was told to a visitor who was " + (
                    f"asked about {asked}" if asked else "not asked")
                return

    def _shown_in_short(self) -> str:
        told, wanted = (", ".join(place.name for place in places) or "no place"
                        for places in (self._told, self._wanted))
        goals = ["{:g}, {:g}, {:g}°".format(*goal) for goal in self._goals[-1:]]
        return f"told the way to {told}, looks for {wanted}, and the last drive led " + (
            f"to {goals[0]}" if goals else "nowhere")


def _said(line: JournalEntry) -> str:
    """Return what the robot said; empty: it did something else, or failed."""
    if line.node != "textToSpeech" or not line.done:
        return ""
    return str(line.content.get("message", line.content.get("text")))


def _sees(message: JournalEntry) -> Optional[bool]:
    """Return whether a message of a sensor says that somebody is there; None: it does not tell."""
    if message.node == node_of(FACES):
        return bool(message.content["face_label_id"])
    if message.content.get("state") != "social":
        return None
    return {1: False, 2: True}.get(message.content["value"])


def _goal(line: JournalEntry) -> Location:
    return Location(*(line.content[name] for name in ("goal_x", "goal_y", "goal_theta")))


def _parts(place: Exhibit) -> List[str]:
    """Return the parts of a description that are said."""
    return [text for text in (place.description1, place.description2) if text]
