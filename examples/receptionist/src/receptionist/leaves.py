"""The node types of this package: a name that is heard or typed, and the way to that person."""
from typing import Optional

from behavior_controller.extend import (
    Answer, Cause, Direction, Failure, GESTURE_TARGET, InstantAction, LeafSummary, Port, Prompt,
    Request, ServiceLeaf, UtteranceCondition, Words, leaf_spec)

from receptionist import directory

PERSON = Port("person", "string", Direction.OUT, "{@person}", "the name, if it is certain")
CANDIDATES = Port("candidates", "string", Direction.OUT, "{@candidates}",
                  "the names to ask about, with ; between them; empty: the name is certain")


class OfPeople:
    """A leaf that needs the file of people: what is wrong with it is told before the start."""

    def configure(self) -> None:
        """Read the file."""
        super().configure()
        self.directory = directory.load()

    def write_names(self, heard: directory.Heard) -> None:
        """Write the ports PERSON and CANDIDATES."""
        self.set_output("person", heard.names[0])
        self.set_output("candidates", "" if heard.is_certain else ";".join(heard.names))


class IsNameUttered(OfPeople, UtteranceCondition):
    """``<IsNameUttered/>``: SUCCESS for an utterance with the name of somebody, or one like it."""

    PORTS = (PERSON, CANDIDATES)
    otherwise = "no name heard"
    awaiting = "listening for a name"
    without_meaning = "no name understood"

    def meaning(self, utterance: str) -> Optional[str]:
        """Return the names in it."""
        heard = self.directory.heard(utterance)
        return str(heard) if heard.names else None

    def keep(self, utterance: str) -> None:
        """Store the names."""
        self.write_names(self.directory.heard(utterance))


class TypeName(OfPeople, ServiceLeaf):
    """``<TypeName/>``: has a name typed on the tablet; nothing typed is a failure."""

    asks = Prompt
    PORTS = (PERSON, CANDIDATES)

    def request(self):
        """Show the text that has been said."""
        if not self.mission.interface.tells_pressed:
            return Failure(Cause.UNUSABLE_ANSWER, "this robot's tablet does not tell what is typed")
        return Prompt((self.mission.phrases.speeches["TypeNameSpeech"],))

    def words(self, request: Request) -> Words:
        """What an operator is told."""
        return Words("asking for a name on the tablet")

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the names."""
        typed = answer.response.strip()
        heard = self.directory.heard(typed)
        if not heard.names:
            text = f"no name understood in “{typed}”" if typed else "the visitor typed nothing"
            return Failure(Cause.MISSING_DATA, text, self.resource)
        self.write_names(heard)
        text = f"the visitor typed “{typed}”: {heard}"
        self.summary = LeafSummary("pressed", text, "understood")
        return None


class LookUpPerson(OfPeople, InstantAction):
    """``<LookUpPerson/>``: looks up the room of a person and where it is."""

    PORTS = (Port("person", "string", default="{@person}", description="whose room it is"),
             Port("room", "string", Direction.OUT, "{@room}", "the room"),
             GESTURE_TARGET.written("target"))

    def act(self) -> Optional[Failure]:
        """Write the room, and where to point."""
        name = self.get_input("person")
        if name not in self.directory.people:
            return Failure(Cause.MISSING_DATA, f"{name} is not in the file of people")
        room = self.directory.people[name]
        self.set_output("room", room)
        self.set_output("target", self.directory.rooms[room])
        self.mission.name_place(f"room {room}", self.directory.rooms[room])
        self.summary = LeafSummary("notice", f"showing the way to room {room}", "helped")
        return None


SPECS = (
    leaf_spec("IsNameUttered", IsNameUttered, "Did the visitor say a name?"),
    leaf_spec("TypeName", TypeName, "Has a name typed on the tablet."),
    leaf_spec("LookUpPerson", LookUpPerson, "Looks up the way to a person."),
)
