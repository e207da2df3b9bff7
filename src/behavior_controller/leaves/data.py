"""The data of a mission: each entry that leaves share on the root blackboard, and the types of
records in them."""
import math
from typing import Any, Callable, NamedTuple

from behavior_controller.bt import Direction, Port, PortType, ValueFault
from behavior_controller.bt.values.values import TEXT, shown, whole_real
from behavior_controller.robot.requests import Location, Point
from behavior_controller.config.node_facts import whole_mission


def _reader(record: Any, form: str) -> Callable[[str], object]:
    def read(text: str) -> object:
        numbers = [whole_real(part.strip()) for part in text.split(";")]
        are_known = all(number is not None and math.isfinite(number) for number in numbers)
        if len(numbers) != len(record._fields) or not are_known:
            raise ValueFault(
                f"Can't convert string [{shown(text)}] to {record.__name__}; write {form}")
        return record(*numbers)
    return read


_LOCATION = PortType("Location", Location, _reader(Location, "x;y;theta, in metres and degrees"))
_POINT = PortType("Point", Point, _reader(Point, "x;y;z, in metres"))
_EXHIBITS = PortType("Exhibits", list)


class Datum(NamedTuple):
    """One entry; it belongs to one visitor and is cleared when the next pass begins."""

    name: str
    type: str
    meaning: str

    def _port(self, direction: Direction, name: str, is_optional: bool = False) -> Port:
        return Port(name or self.name, self.type, direction, whole_mission(self.name), self.meaning,
                    is_optional=is_optional)

    def read(self, port: str = "", is_optional: bool = False) -> Port:
        """Return a port that reads it, with the entry's name or ``port``; for ``is_optional`` see
        Port."""
        return self._port(Direction.IN, port, is_optional)

    def written(self, port: str = "") -> Port:
        """Return a port that writes it."""
        return self._port(Direction.OUT, port)

    def changed(self, port: str = "", is_optional: bool = False) -> Port:
        """Return a port that reads and writes it."""
        return self._port(Direction.INOUT, port, is_optional)


VISITOR_RESPONSE = Datum("visitorResponse", TEXT, "the visitor's answer, yes or no")
EXHIBITS = Datum("exhibits", _EXHIBITS, "the exhibits, in tour order")
NEXT_EXHIBIT = Datum("nextExhibit", "int", "number of the exhibit to select next, from 0")
CURRENT_EXHIBIT = Datum("currentExhibit", TEXT, "name of the selected exhibit")
LEFT_OUT = Datum("leftOutExhibits", "vec_int", "numbers of the exhibits that a recovery left out")
DESCRIPTION_1 = Datum("description1", TEXT, "the exhibit's first description")
DESCRIPTION_2 = Datum("description2", TEXT, "the exhibit's second description")
TARGET_LOCATION = Datum("targetLocation", _LOCATION,
                        "where to drive: x;y;theta, in metres and degrees")
GESTURE_TARGET = Datum("gestureTarget", _POINT,
                       "where to point or look: x;y;z, in metres; 0;0;0 is nothing")
QUESTION_ASKED_AT = Datum("questionAskedAt", "double",
                          "when the question had been asked, in s: answers come later")
ATTENTION_SET_AT = Datum("attentionSetAt", "double",
                         "when the mode of attention was set, in s: gazes come later")

TIMES = (QUESTION_ASKED_AT.name, ATTENTION_SET_AT.name)
"""The entries with a time of the mission's clock."""

ALL = tuple(datum for datum in tuple(globals().values()) if isinstance(datum, Datum))
