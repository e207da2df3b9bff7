"""What the receptionist says; the texts are in data/phrases_<language>.ini."""
from behavior_controller.extend import Speech

MISHEARD = "I would like to see Doctor Vernan"
"""What a simulated visitor says, or types, when asked for a name: near to a name of people.ini, so
that a rehearsal asks whether it is meant."""

SPEECHES = (
    Speech("ReceptionGreeting", False, "Greets as a receptionist, and offers directions."),
    Speech("AskNameSpeech", True, "Asks for the name of the person looked for.",
           simulated_answer=MISHEARD),
    Speech("TypeNameSpeech", True, "Asks to type the name of the person looked for.",
           simulated_answer=MISHEARD),
    Speech("DidYouMeanSpeech", True, "Asks whether that person is meant.", variables=("person",)),
    Speech("NoNameSpeech", False, "Lets a visitor go who has named nobody."),
    Speech("RoomSpeech", False, "Says in which room the person is.", variables=("person", "room")),
    Speech("DirectionSpeech", False, "Says that the room is in the direction shown."),
    Speech("ReceptionGoodbye", False, "Says goodbye.", is_farewell=True),
)
