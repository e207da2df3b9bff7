"""Leaves of the knowledge base (/knowledgeBase/query) and of the list of exhibits."""
from functools import partial
from typing import Optional

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import Answer, QueryKnowledge, Request
from behavior_controller.leaves.base import (CURRENT_EXHIBIT, DESCRIPTION_1, DESCRIPTION_2, EXHIBITS, GESTURE_TARGET,
                                             LEFT_OUT, NEXT_EXHIBIT, TARGET_LOCATION, InstantAction, InstantCondition,
                                             MissionLeaf, ServiceLeaf)


class RetrieveListOfExhibits(ServiceLeaf):
    """``<RetrieveListOfExhibits/>``: asks for all exhibits, in tour order.

    Writes ``exhibits``, ``nextExhibit``; clears ``leftOutExhibits``.
    """

    asks = QueryKnowledge

    def request(self) -> Request:
        """Ask."""
        return QueryKnowledge("exhibits")

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Keep the list; an empty one is a failure."""
        if not answer.exhibits:
            return Failure(Cause.MISSING_DATA, "the knowledge base has no exhibits", self.resource)
        self.remember(EXHIBITS, list(answer.exhibits))
        self.remember(NEXT_EXHIBIT, 0)
        self.remember(LEFT_OUT, [])
        return None


class IsListWithExhibit(InstantCondition):
    """``<IsListWithExhibit/>``: SUCCESS if an exhibit has not been selected. Reads ``exhibits``, ``nextExhibit``."""

    otherwise = "no exhibit is left"

    def holds(self) -> bool:
        """Return whether one is left."""
        return (self.recall(NEXT_EXHIBIT) or 0) < len(self.recall(EXHIBITS) or ())


class SelectExhibit(InstantAction):
    """``<SelectExhibit/>``: takes the next exhibit of the list.

    Writes ``nextExhibit``, ``currentExhibit``, ``targetLocation``, ``gestureTarget``, ``description1`` and
    ``description2``.
    """

    def act(self) -> Optional[Failure]:
        """Select."""
        exhibits, index = self.recall(EXHIBITS) or (), self.recall(NEXT_EXHIBIT) or 0
        if index >= len(exhibits):
            return Failure(Cause.MISSING_DATA, "no exhibit is left to select")
        exhibit = exhibits[index]
        self.remember(NEXT_EXHIBIT, index + 1)
        self.remember(CURRENT_EXHIBIT, exhibit.name)
        self.remember(TARGET_LOCATION, exhibit.location)
        self.remember(GESTURE_TARGET, exhibit.gesture)
        self.remember(DESCRIPTION_1, exhibit.description1)
        self.remember(DESCRIPTION_2, exhibit.description2)
        return None


def leave_out_exhibit(leaf: MissionLeaf) -> bool:
    """Note that the exhibit under way is left out; return whether the tour may still be called one without it.

    It may not if every exhibit has been left out. The last one then goes back to the list, once: IsListWithExhibit asks
    for exhibits that have not been visited, and a mission must not take such a tour for a finished one.
    """
    exhibits, index = leaf.recall(EXHIBITS) or (), (leaf.recall(NEXT_EXHIBIT) or 0) - 1
    if not 0 <= index < len(exhibits) or leaf.recall(TARGET_LOCATION) != exhibits[index].location:
        return True  # the robot is on no exhibit's behalf under way
    before = leaf.recall(LEFT_OUT) or []
    left_out = sorted({index}.union(before))
    leaf.remember(LEFT_OUT, left_out)
    if len(left_out) < len(exhibits):
        return True
    if index not in before:
        leaf.remember(NEXT_EXHIBIT, index)
    return False


class LookUp(ServiceLeaf):
    """``<LookUpEntrance/>``: asks where a place is. Writes ``targetLocation``, ``gestureTarget`` (or clears it)."""

    asks = QueryKnowledge

    def __init__(self, name: str, place: str, has_gesture: bool):
        super().__init__(name)
        self.place = place
        self.has_gesture = has_gesture

    def request(self) -> Request:
        """Ask."""
        return QueryKnowledge(self.place)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Keep the place."""
        if len(answer.exhibits) != 1:
            return Failure(Cause.UNUSABLE_ANSWER, "the knowledge base has {} places for {}; exactly 1 is needed".format(
                len(answer.exhibits), self.place), self.resource)
        self.remember(TARGET_LOCATION, answer.exhibits[0].location)
        self.forget(GESTURE_TARGET)
        if self.has_gesture:
            self.remember(GESTURE_TARGET, answer.exhibits[0].gesture)
        return None


SPECS = (
    NodeSpec("RetrieveListOfExhibits", Kind.ACTION, RetrieveListOfExhibits, description="Gets the exhibits to show."),
    NodeSpec("IsListWithExhibit", Kind.CONDITION, IsListWithExhibit, description="Is an exhibit left to visit?"),
    NodeSpec("SelectExhibit", Kind.ACTION, SelectExhibit, description="Takes the next exhibit."),
    NodeSpec("LookUpEntrance", Kind.ACTION, partial(LookUp, place="entrance", has_gesture=True),
             description="Makes the entrance the target."),
    NodeSpec("LookUpHome", Kind.ACTION, partial(LookUp, place="home", has_gesture=False),
             description="Makes the robot's home the target."),
)
