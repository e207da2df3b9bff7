"""What the robot says, and what it takes for a yes or a no."""
import time
from types import ModuleType

import pytest

from behavior_controller import extensions, folders
from behavior_controller.config import phrases
from behavior_controller.errors import ConfigurationError

ENGLISH = phrases.load("English")


@pytest.mark.parametrize(
    "utterance, meaning",
    [
        ("yes", "yes"),
        ("Yes.", "yes"),
        ("YES PLEASE!", "yes"),
        ("yeah, sure", "yes"),
        ("of course", "yes"),
        ("why not", "yes"),
        ("okay", "yes"),
        ("no", "no"),
        ("No, thank you.", "no"),
        ("nope", "no"),
        ("not now", "no"),
        ("I don't want to", "no"),
        ("I don’t want to", "no"),
        ("yes... no!", "no"),
        # from the contract: none of these is a yes
        ("not good", "no"),
        ("goodbye", None),
        ("I know", None),
        ("", None),
        ("hello robot", None),
        ("yesterday", None),
        ("nothing", None),
        ("Error: no speech", None),
        ("error yes", None),
        ("I don't know", None),
        ("good morning", None),
        # polite words and set phrases that decide nothing
        ("please wait", None),
        ("say that again please", None),
        ("I'm fine, thanks", None),
        ("I am good", None),
        ("no problem", None),
        ("I can't wait!", None),
        ("are you sure?", None),
        ("good question", None),
        ("know", None),
        ("yes, no problem", "yes"),
        ("yes, I can't wait", "yes"),
        ("please do", "yes"),
        ("I'd love to", "yes"),
        ("I would like that", "yes"),
        ("I would not", "no"),
        ("I would rather not", "no"),
        ("no, please don't", "no")])
def test_spoken_answers(utterance, meaning):
    assert ENGLISH.spoken_answer(utterance) == meaning


def test_the_longest_phrase_counts():
    language = phrases.Phrases({}, ("Yes", "No"),
                               {"yes": [("sure", )], "no": [("sure", "never")], "unclear": []})
    assert [language.spoken_answer(text)
            for text in ("sure", "sure, never", "never")] == ["yes", "no", None]


@pytest.mark.parametrize("utterance, is_so", [("Error: no speech", True), ("  error yes", True),
                                              ("the recognition: Error 3", True), ("yes", False),
                                              ("no error", False)])
def test_what_the_recognition_says_itself(utterance, is_so):
    assert phrases.is_error(utterance) is is_so


@pytest.mark.parametrize("response, meaning", [
    ("Yes", "yes"), ("yes", "yes"), (" YES ", "yes"), ("1", "yes"), ("No", "no"), ("no", "no"),
    ("2", "no"), ("", None), ("0", None), ("3", None), ("maybe", None)])
def test_pressed_answers(response, meaning):
    assert ENGLISH.pressed_answer(response) == meaning


@pytest.mark.parametrize("node, words", [
    ("WelcomeSpeech", "welcome"),
    ("QueryTourSpeech", "tour"),
    ("SayYesNoSpeech", "only understand yes or no"),
    ("PressYesNoSpeech", "press yes or no"),
    ("FollowMeSpeech", "follow me"),
    ("MaybeAnotherTimeSpeech", "another time"),
    ("EndTourSpeech", "last exhibit"),
    ("EndTourSpeech", "hope you enjoyed"),
    ("EndTourSpeech", "way out"),
    ("HereIsTheDoorSpeech", "here is the door"),
    ("SayGoodByeSpeech", "goodbye")])
def test_the_english_phrases_say_what_table_4_asks_for(node, words):
    assert words in ENGLISH.speeches[node].lower()


def test_each_utility_phrase_of_release_1_0_is_what_a_speech_says():
    assert [ENGLISH.utility(number) for number in range(1, 9)] == [
        ENGLISH.speeches[node]
        for node in ("PressYesNoSpeech", "FollowMeSpeech", "MaybeAnotherTimeSpeech",
                     "WelcomeSpeech", "QueryTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech")
    ] + [None]


def test_the_kinyarwanda_draft_is_complete_and_says_that_it_is_one():
    kinyarwanda = phrases.load("Kinyarwanda")
    assert all(kinyarwanda.speeches[speech.node] for speech in phrases.SPEECHES)
    assert (kinyarwanda.spoken_answer("Yego"), kinyarwanda.spoken_answer("oya")) == ("yes", "no")
    with open(folders.data("phrases_Kinyarwanda.ini"), encoding="utf-8") as file:
        first = file.readline()
    assert "DRAFT" in first and "native speaker" in first


def test_a_language_that_is_not_there_is_a_clear_error():
    with pytest.raises(ConfigurationError) as raised:
        phrases.load("isiZulu")
    assert str(raised.value) == (
        "language: there are no phrases in isiZulu (there are: English, Kinyarwanda; "
        "another language is a file data/phrases_isiZulu.ini)")
    with pytest.raises(ConfigurationError, match="did you mean English"):
        phrases.load("english")


def broken(tmp_path, monkeypatch, *changes):
    """Return the faults of the English file after some changes."""
    with open(folders.data("phrases_English.ini"), encoding="utf-8") as file:
        text = file.read()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "phrases_Broken.ini").write_text(text, encoding="utf-8")
    monkeypatch.setattr(folders, "data", lambda name: str(tmp_path / name))
    with pytest.raises(ConfigurationError) as raised:
        phrases.load("Broken")
    return raised.value.faults


def test_faults_of_a_language_come_at_once(tmp_path, monkeypatch):
    found = broken(tmp_path, monkeypatch,
                   ("tabletYes               Yes", "tabletYes               Yes|Yeah"),
                   ("FollowMeSpeech ", "FolowMeSpeech "), ("unclear ", "unclear #"))
    assert all(word in fault.text for word, fault in zip(
        ("FolowMeSpeech", '"Yes|Yeah"', "unclear", "FollowMeSpeech"), found))
    assert "FollowMeSpeech?" in found[0].hint and "words with commas between them" in found[2].hint
    with open(str(tmp_path / "phrases_Broken.ini"), encoding="utf-8") as file:
        keys = [line.split(" ")[0] for line in file]
    assert [fault.line for fault in found] == [
        keys.index("FolowMeSpeech") + 1, keys.index("tabletYes") + 1, keys.index("unclear") + 1, 0]


def test_no_phrase_has_two_meanings(tmp_path, monkeypatch):
    found = broken(tmp_path, monkeypatch, ("no        no,", "no        no, Of  Course,"),
                   ("unclear   ", "unclear   nope, "))
    assert [(fault.text, fault.hint) for fault in found] == [
        ("\"of course\" is in yes and in no", "keep one of them"),
        ("\"nope\" is in no and in unclear", "keep one of them")]
    assert str(found[0]) == "{}: \"of course\" is in yes and in no (keep one of them)".format(
        found[0].file)


@pytest.mark.parametrize("yes, no, texts", [
    ("Yes", "yes", ['tabletYes is "Yes", and tabletNo is "yes"']),
    ("2", "No", ["tabletYes cannot be 2, which is the number of the other button"]),
    ("2", "1", ["tabletYes cannot be 2, which is the number of the other button",
                "tabletNo cannot be 1, which is the number of the other button"])])
def test_no_button_is_also_the_other_one(tmp_path, monkeypatch, yes, no, texts):
    found = broken(tmp_path, monkeypatch,
                   ("tabletYes               Yes", "tabletYes               " + yes),
                   ("tabletNo                No", "tabletNo                " + no))
    assert [fault.text for fault in found] == texts


# ------------------------------------------------------------------------ what another package says


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return the folder ``data`` of a package that adds a speech."""
    module = ModuleType("greeter.phrases")
    module.SPEECHES = (phrases.Speech("CuriousSpeech", False, "Wonders about a visitor."),)
    monkeypatch.setattr(extensions, "exported", lambda kind:
                        (extensions.Extension("greeter", str(tmp_path), module), ))
    (tmp_path / "data").mkdir()
    return tmp_path / "data"


def faults_of_load(language="English"):
    with pytest.raises(ConfigurationError) as raised:
        phrases.load(language)
    return str(raised.value).split("\n")


def test_a_package_says_its_speech_in_its_own_file(package):
    (package / "phrases_English.ini").write_text("CuriousSpeech   Who are you?\n")
    found = phrases.load("English")
    assert (found.speeches["CuriousSpeech"], found.speeches["WelcomeSpeech"]) == (
        "Who are you?", ENGLISH.speeches["WelcomeSpeech"])


def test_a_fault_of_a_package_is_in_its_file(package):
    path = package / "phrases_English.ini"
    fault, = faults_of_load()
    assert fault.startswith("{}: ".format(path)) and "greeter" in fault
    path.write_text("CuriosSpeech Who?\n")
    unknown, missing = faults_of_load()
    assert unknown.startswith("{}:1:1: ".format(path)) and " CuriousSpeech?" in unknown
    assert missing.startswith("{}: ".format(path)) and "CuriousSpeech <" in missing


SPOKEN = phrases.Speech("RoomSpeech", True, "Says a room.", variables=("person", "room"))


@pytest.fixture
def speaking(package):
    extensions.exported("phrases")[0].module.SPEECHES = (SPOKEN,)
    return package / "phrases_English.ini"


@pytest.mark.parametrize("text, is_right", [
    ("{person} is in {room}.", True), ("In {room} is {person}: {room}!", True),
    ("{person} is here.", False), ("{person} is in {rom}.", False),
    ("{person} is in {room} of {building}.", False), ("Who?", False)])
def test_each_variable_of_a_speech_stands_in_its_text_and_nothing_else_in_braces(speaking, text,
                                                                                   is_right):
    speaking.write_text(f"RoomSpeech {text}\n")
    if is_right:
        assert phrases.load("English").speeches["RoomSpeech"] == text
    else:
        fault, = faults_of_load()
        assert fault == (f'{speaking}:1:12: RoomSpeech cannot be "{text}" (allowed: the text to '
                         "say, with {person} and {room})")


def test_a_text_is_filled_once_and_known_again():
    values = {"person": "{room}", "room": "B203"}
    text = "{person} is in {room} (floor 2)."
    assert phrases.filled(text, values.__getitem__) == "{room} is in B203 (floor 2)."
    pattern = SPOKEN.pattern(text)
    assert pattern.fullmatch("Ana López is in B203 (floor 2).")
    assert not pattern.fullmatch("Ana López is in B203, floor 2.")
    assert phrases.Speech("A", False, "a").pattern("{x}").fullmatch("{x}")


def test_the_speech_of_a_package_is_no_key_of_the_language_itself(package, monkeypatch):
    with open(folders.data("phrases_English.ini"), encoding="utf-8") as file:
        (package / "phrases_Ours.ini").write_text("CuriousSpeech Who?\n" + file.read(),
                                                  encoding="utf-8")
    monkeypatch.setattr(folders, "data", lambda name: str(package / name))
    first = faults_of_load("Ours")[0]
    assert first.startswith("{}:1:1: ".format(
        package / "phrases_Ours.ini")) and "CuriousSpeech" in first


@pytest.mark.slow
def test_a_long_utterance_takes_linear_time():
    many = [("word{}".format(number),) for number in range(3000)]
    language = phrases.Phrases({}, ("Yes", "No"), {"yes": many, "no": [("no",)], "unclear": []})
    began = time.thread_time()
    assert language.spoken_answer("hello " * 100_000 + "no") == "no"
    assert time.thread_time() - began < 5.0  # each word against each phrase takes minutes
