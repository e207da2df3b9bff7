"""A fault is one line that says where and what."""
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, MissionError, attempt


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


def test_what_is_not_known_of_a_fault_is_nothing():
    fault = Fault("a.xml", 3, 1, "odd")
    assert fault == Fault("a.xml", 3, 1, "odd", hint="", is_warning=False, code="", end_line=0,
                          end_column=0)


def test_an_error_of_a_single_mistake_has_no_place():
    error = ConfigurationError.of("a.ini", "odd", "mend it")
    assert isinstance(error, ConfigurationError) and error.faults == (
        Fault("a.ini", 0, 0, "odd", "mend it"),)


def test_a_part_that_has_faults_leaves_these_and_no_value():
    def faulty():
        raise FaultsFound([Fault("a.xml", 1, 2, "second"), Fault("a.xml", 3, 4, "third")])

    faults = [Fault("a.xml", 0, 0, "first")]
    assert attempt(lambda: 7, faults) == 7 and len(faults) == 1
    assert attempt(faulty, faults) is None
    assert [fault.text for fault in faults] == ["first", "second", "third"]
