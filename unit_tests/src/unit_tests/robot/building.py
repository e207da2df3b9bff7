"""The building of the simulated robot: the places of a mission, the entrance, the robot's home."""
import json
from typing import Any, NamedTuple, Tuple

from behavior_controller.config import knowledge_files
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.robot.requests import Exhibit, Location, Point
from behavior_controller.text import Unreadable, read_text


class Building(NamedTuple):
    """Its places."""

    exhibits: Tuple[Exhibit, ...]
    entrance: Exhibit
    home: Exhibit

    def query(self, what: str) -> Tuple[Exhibit, ...]:
        """Return what ``exhibits``, ``entrance`` or ``home`` (any case) means. Raises KeyError for
        the rest."""
        places = {"exhibits": self.exhibits, "entrance": (self.entrance,), "home": (self.home,)}
        return places[what.lower()]


def of_files(known: knowledge_files.Knowledge) -> Building:
    """Return the places of release 1.0's files."""
    return Building(known.tour, known.tour[-1], known.tour[0])


def load(path: str) -> Building:
    """Read a file of places. Raises ConfigurationError if it cannot be used."""
    try:
        places = json.loads(read_text(path))
        return Building(tuple(_place(place) for place in places["exhibits"]),
                         _place(places["entrance"]), _place(places["home"]))
    except Unreadable as error:
        raise ConfigurationError(
            [Fault(path, 0, 0, "the places cannot be read: {}".format(error))]) from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        reason = "{}: {}".format(type(error).__name__, error)
        fault = Fault(path, 0, 0, "the places cannot be read: {}".format(reason),
                      "see the file that the package brings for the form")
        raise ConfigurationError([fault]) from error


def _place(place: Any) -> Exhibit:
    """Return one place; home needs no descriptions and no gesture."""
    return Exhibit(str(place["name"]), str(place.get("description1", "")),
                   str(place.get("description2", "")), Location(*map(float, place["location"])),
                   Point(*map(float, place.get("gesture", (0, 0, 0)))))
