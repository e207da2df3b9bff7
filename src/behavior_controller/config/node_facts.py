"""Facts about a node of the mission vocabulary for recovery, policy and reports, as fields of its
NodeSpec."""
from dataclasses import dataclass
from typing import Any, Callable, Optional, Tuple, Union

from behavior_controller.bt.engine.registry import Direction, NodeSpec, argument
from behavior_controller.robot.declarations import Sense, Topic


@dataclass(frozen=True)
class MissionSpec(NodeSpec):
    """A node of the mission vocabulary."""

    calls: Tuple[type, ...] = ()  # the kinds of requests that it makes
    # the signs of the visitor that it checks, or topics of other packages
    listens: Tuple[Union[Sense, Topic], ...] = ()
    # on a robot without a service for its request it succeeds and does nothing
    does_without: bool = False
    is_indispensable: bool = False  # no policy may skip it
    leave_out: Optional[Callable[[Any], bool]] = None
    """Notes that the mission goes on without the node, through the ports of the leaf that recovers
    from its failure.

    Returns whether the mission may.
    """
    begins_pass: bool = False  # it clears what belongs to one visitor
    is_farewell: bool = False  # it makes no sense after the visitor has left
    farewells: Tuple[str, ...] = ()  # names of an instance that make it a farewell
    # the mode of attention that it sets; "": the one that its name says; None: it sets none
    sets_mode: Optional[str] = None
    setting: str = ""  # the field of the settings that it answers, as a condition
    says_phrase: bool = False  # the phrase of the culture file whose number is its name

    def says_goodbye(self, name: str) -> bool:
        """Return whether an instance of that name is a farewell."""
        return self.is_farewell or argument(name) in self.farewells

    def mode(self, name: str) -> str:
        """Return the mode of attention that an instance of that name sets; empty: none."""
        return argument(name) if self.sets_mode == "" else self.sets_mode or ""

    def needs(self, entry: str) -> bool:
        """Return whether the node cannot do without that entry of the whole mission, if the file
        gives it no other."""
        return any(port.direction is not Direction.OUT and not port.is_optional
                   and port.default == whole_mission(entry) for port in self.ports)

    def writes(self, entry: str) -> bool:
        """Return whether the node writes that entry of the whole mission, if the file gives it no
        other."""
        return any(port.direction is not Direction.IN and port.default == whole_mission(entry)
                   for port in self.ports)


def whole_mission(entry: str) -> str:
    """Return the text of a port that refers to an entry of the whole mission."""
    return f"{{@{entry}}}"
