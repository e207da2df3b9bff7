"""Leaves for the knowledge base (/knowledgeBase/query) and the list of exhibits."""
from typing import Optional, Sequence

from behavior_controller.bt.engine.registry import Port
from behavior_controller.bt.values.values import TEXT
from behavior_controller.run.events import BEGUN, OMITTED, OVER, StopChanged
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, Exhibit, QueryKnowledge, Request
from behavior_controller.leaves.base import (
    InstantAction, InstantCondition, MissionLeaf, ServiceLeaf, leaf_spec)
from behavior_controller.leaves.data import (
    CURRENT_EXHIBIT, DESCRIPTION_1, DESCRIPTION_2, EXHIBITS, GESTURE_TARGET, LEFT_OUT,
    NEXT_EXHIBIT, TARGET_LOCATION)


def advance(leaf: MissionLeaf, exhibits: Sequence[Exhibit], index: int, state: str,
            noun: str = "") -> None:
    """Emit the state of the exhibit ``index`` (from 0) of the list."""
    leaf.mission.events.emit(
        StopChanged(leaf.uid, leaf.registration_id, leaf.full_path, index + 1, len(exhibits),
                    exhibits[index].name, state, noun))


class RetrieveListOfExhibits(ServiceLeaf):
    """``<RetrieveListOfExhibits/>``: asks for all exhibits, in tour order."""

    asks = QueryKnowledge
    PORTS = (EXHIBITS.written(), NEXT_EXHIBIT.written(), LEFT_OUT.written())

    def request(self) -> Request:
        return QueryKnowledge("exhibits")

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the list; an empty list is a failure."""
        if not answer.exhibits:
            return Failure(Cause.MISSING_DATA, "the knowledge base has no exhibits", self.resource)
        self.set_output("exhibits", list(answer.exhibits))
        self.set_output("nextExhibit", 0)
        self.set_output("leftOutExhibits", [])
        return None


class IsListWithExhibit(InstantCondition):
    """``<IsListWithExhibit/>``: SUCCESS if an exhibit has not been selected; without a list
    FAILURE."""

    PORTS = (EXHIBITS.read(), NEXT_EXHIBIT.read())
    otherwise = "no exhibit is left"

    def holds(self) -> bool:
        """Return whether one is left."""
        following, exhibits = self.get_input_or("nextExhibit", 0), self.get_input_or("exhibits", ())
        if 0 < following <= len(exhibits):
            advance(self, exhibits, following - 1, OVER)
        return following < len(exhibits)


STOP = Port("stop", TEXT, default="exhibit",
            description="what the story calls an item of the list; the plural adds an s")


class SelectExhibit(InstantAction):
    """``<SelectExhibit/>``: takes the next exhibit of the list."""

    PORTS = (EXHIBITS.read(), NEXT_EXHIBIT.changed(), CURRENT_EXHIBIT.written(),
             TARGET_LOCATION.written(), GESTURE_TARGET.written(), DESCRIPTION_1.written(),
             DESCRIPTION_2.written(), STOP)

    def act(self) -> Optional[Failure]:
        exhibits, index = self.get_input("exhibits"), self.get_input_or("nextExhibit", 0)
        if index >= len(exhibits):
            return Failure(Cause.MISSING_DATA, "no exhibit is left to select")
        exhibit = exhibits[index]
        self.set_output("nextExhibit", index + 1)
        self.set_output("currentExhibit", exhibit.name)
        self.mission.name_place(exhibit.name, exhibit.location, exhibit.gesture)
        self.set_output("targetLocation", exhibit.location)
        self.set_output("gestureTarget", exhibit.gesture)
        self.set_output("description1", exhibit.description1)
        self.set_output("description2", exhibit.description2)
        advance(self, exhibits, index, BEGUN, self.get_input(STOP.name))
        return None


LEAVING_OUT = (EXHIBITS.read(is_optional=True), TARGET_LOCATION.read(is_optional=True),
               NEXT_EXHIBIT.changed(is_optional=True), LEFT_OUT.changed(is_optional=True))
"""The ports that a leaf needs for ``leave_out_exhibit``."""


def leave_out_exhibit(leaf: MissionLeaf) -> bool:
    """Note that the current exhibit is left out; return whether the tour is still a tour without
    it.

    It is not if every exhibit has been left out. Then the last one goes back to the list, once:
    IsListWithExhibit asks for exhibits that have not been visited, and a mission must not treat
    such a tour as finished.

    Raises PortError.
    """
    exhibits, index = leaf.get_input_or("exhibits", ()), leaf.get_input_or("nextExhibit", 0) - 1
    if not 0 <= index < len(exhibits):
        return True  # no exhibit is under way
    if leaf.get_input_or("targetLocation", None) != exhibits[index].location:
        return True  # the robot goes elsewhere
    advance(leaf, exhibits, index, OMITTED)
    before = leaf.get_input_or("leftOutExhibits", [])
    left_out = sorted({index}.union(before))
    leaf.set_output("leftOutExhibits", left_out)
    if len(left_out) < len(exhibits):
        return True
    if index not in before:
        leaf.set_output("nextExhibit", index)
    return False


class LookUp(ServiceLeaf):
    """``<LookUpEntrance/>``: looks up the location of a place and, for some, its gesture target."""

    asks = QueryKnowledge
    PORTS = (TARGET_LOCATION.written(), GESTURE_TARGET.written())
    place: str
    has_gesture: bool

    def request(self) -> Request:
        return QueryKnowledge(self.place)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the place."""
        count = len(answer.exhibits)
        if count != 1:
            text = f"the knowledge base has {count} places for {self.place}; exactly 1 is needed"
            return Failure(Cause.UNUSABLE_ANSWER, text, self.resource)
        place = answer.exhibits[0]
        name = "its home" if self.place == "home" else "the " + self.place
        self.mission.name_place(name, place.location, place.gesture)
        self.set_output("targetLocation", place.location)
        if self.has_gesture:
            self.set_output("gestureTarget", place.gesture)
        else:
            self.clear_output("gestureTarget")
        return None


SPECS = (
    leaf_spec("RetrieveListOfExhibits", RetrieveListOfExhibits, "Gets the exhibits to show.",
              is_indispensable=True),
    leaf_spec("IsListWithExhibit", IsListWithExhibit, "Is an exhibit left to visit?"),
    leaf_spec("SelectExhibit", SelectExhibit, "Takes the next exhibit.", is_indispensable=True,
              leave_out=leave_out_exhibit),
    leaf_spec("LookUpEntrance", LookUp, "Makes the entrance the target.", is_indispensable=True,
              arguments={"place": "entrance", "has_gesture": True}),
    leaf_spec("LookUpHome", LookUp, "Makes the robot's home the target.", is_indispensable=True,
              arguments={"place": "home", "has_gesture": False}))
