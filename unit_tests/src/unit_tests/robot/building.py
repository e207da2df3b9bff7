"""The building of the simulated robot: the places of a mission, the entrance, the robot's home."""
import re
from typing import NamedTuple, Tuple

import msgspec

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


class _Place(msgspec.Struct, forbid_unknown_fields=True):
    """A place as the file has it; home needs no descriptions and no gesture."""

    name: str
    location: Tuple[float, float, float]
    description1: str = ""
    description2: str = ""
    gesture: Tuple[float, float, float] = (0.0, 0.0, 0.0)

    def exhibit(self) -> Exhibit:
        """Return it as the knowledge base answers it."""
        return Exhibit(self.name, self.description1, self.description2, Location(*self.location),
                       Point(*self.gesture))


class _Places(msgspec.Struct, forbid_unknown_fields=True):
    exhibits: Tuple[_Place, ...]
    entrance: _Place
    home: _Place


FORM = ("there are exhibits (a list), entrance and home; each place has name and location "
        "[x, y, degrees], and may have description1, description2 and gesture [x, y, z]")


def load(path: str) -> Building:
    """Read a file of places. Raises ConfigurationError if it cannot be used."""
    text = ""
    try:
        text = read_text(path)
        places = msgspec.json.decode(text.encode("utf-8"), type=_Places)
    except (Unreadable, msgspec.MsgspecError, RecursionError) as error:
        reason = "the places cannot be read: {}".format(error)
        raise ConfigurationError([Fault(path, *_place_of(error, text), reason, FORM)]) from error
    return Building(tuple(place.exhibit() for place in places.exhibits),
                    places.entrance.exhibit(), places.home.exhibit())


def _place_of(error: Exception, text: str) -> Tuple[int, int]:
    """Return line and column at which malformed JSON breaks off; 0, 0 for another error."""
    byte = re.search(r"\(byte (\d+)\)", str(error))
    if byte is None:
        return 0, 0
    lines = text.encode("utf-8")[:int(byte.group(1))].decode("utf-8", "ignore").split("\n")
    return len(lines), len(lines[-1]) + 1
