"""A fault is one line that says where and what."""
from behavior_controller.errors import Fault, MissionError


def test_a_fault_names_its_place_and_its_hint():
    fault = Fault("lab_tour.xml", 12, 5, "unknown node WelcomSpeech", "did you mean WelcomeSpeech?")
    assert str(
        fault) == "lab_tour.xml:12:5: unknown node WelcomSpeech (did you mean WelcomeSpeech?)"


def test_an_unknown_place_is_left_out_and_a_warning_says_so():
    assert str(Fault("lab_tour.xml", 0, 0,
                     "the file is empty")) == "lab_tour.xml: the file is empty"
    assert str(Fault("a.xml", 3, 1, "odd", is_warning=True)) == "a.xml:3:1: warning: odd"


def test_an_error_lists_every_fault_on_a_line_of_its_own():
    error = MissionError([Fault("a.xml", 1, 2, "first"), Fault("a.xml", 3, 4, "second")])
    assert str(error) == "a.xml:1:2: first\na.xml:3:4: second"
