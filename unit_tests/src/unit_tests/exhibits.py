"""The building of the simulated robot: the exhibits in tour order, the entrance and the robot's home."""
import json
from typing import Any, NamedTuple, Tuple

from behavior_controller import knowledge_files
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.interface.records import Exhibit, Location, Point
from behavior_controller.text import Unreadable, read_text


class Knowledge(NamedTuple):
    """The places of one building."""

    exhibits: Tuple[Exhibit, ...]
    entrance: Exhibit
    home: Exhibit

    def query(self, what: str) -> Tuple[Exhibit, ...]:
        """Return what ``exhibits``, ``entrance`` or ``home`` (any case) means. Raises KeyError for the rest."""
        return {"exhibits": self.exhibits, "entrance": (self.entrance,), "home": (self.home,)}[what.lower()]


def of_files(known: knowledge_files.Knowledge) -> Knowledge:
    """Return the places of a tour of release 1.0."""
    return Knowledge(known.tour, known.end, known.start)


def load(path: str) -> Knowledge:
    """Read a file of places. Raises ConfigurationError if it cannot be used."""
    try:
        places = json.loads(read_text(path))
        return Knowledge(tuple(_place(place) for place in places["exhibits"]), _place(places["entrance"]),
                         _place(places["home"]))
    except Unreadable as error:
        raise ConfigurationError([Fault(path, 0, 0, "the exhibits cannot be read: {}".format(error))]) from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        reason = "{}: {}".format(type(error).__name__, error)
        raise ConfigurationError([Fault(path, 0, 0, "the exhibits cannot be read: {}".format(reason),
                                        "see the file that the package brings for the form")]) from error


def _place(place: Any) -> Exhibit:
    """Return one place; home needs no descriptions and no gesture."""
    return Exhibit(str(place["name"]), str(place.get("description1", "")), str(place.get("description2", "")),
                   Location(*map(float, place["location"])), Point(*map(float, place.get("gesture", (0, 0, 0)))))
