"""The knowledge files of release 1.0: what is taken, and every mistake with its place."""
import json
import os
from pathlib import Path

import pytest

from behavior_controller import cli, folders
from behavior_controller.config import knowledge_files, phrases
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot.requests import Exhibit, Location, Point
from behavior_controller.config.knowledge_files import LANGUAGES, UTILITY_PHRASES
from behavior_controller.text import Source

ROOT = folders.share()

ENVIRONMENT = """robotLocationDescription      4 Café (#1)
robotLocationPose             4 -1.5 2.0 -90
gestureTarget                 4 0.0 0.0 0.0
preGestureMessageEnglish      4 Welcome! # 4 of us work here
postGestureMessageEnglish     4 Come along.
culturalKnowledge             4 SomeShape SomeBow

robotLocationDescription      9 Forge
robotLocationPose             9 3 .5 +2.7e2
gestureTarget                 9 -2.25 -7 0.82
preGestureMessageEnglish      9 It is hot.
postGestureMessageEnglish     9 It was hot.
preGestureMessageKinyarwanda  9 Nta kibazo.

tourSpecification 3 4 9 4
"""
CULTURE = """passingDistance             100
phraseLanguage              English
phraseGreetingEnglish       Greetings
""" + "\n".join("utilityPhraseEnglish{}       phrase {}".format(number, number)
                for number in range(1, 10)) + "\n"
POSE_FORM = "the form: robotLocationPose <id> <x in m> <y in m> <theta in degrees>"
TARGET_FORM = "the form: gestureTarget <id> <x in m> <y in m> <z in m>"
TOUR_FORM = "tourSpecification <number of locations> <id of the first> … <id of the last>"

CAFE = Exhibit("Café (#1)", "Welcome! # 4 of us work here", "Come along.",
               Location(-1.5, 2.0, -90.0), Point(0.0, 0.0, 0.0))
FORGE = Exhibit("Forge", "It is hot.", "It was hot.", Location(3.0, 0.5, 270.0),
                Point(-2.25, -7.0, 0.82))


def read(environment=ENVIRONMENT, culture=CULTURE):
    return knowledge_files.read(Source("e", environment), Source("c", culture))


def changed(text, *changes):
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def faults_of(environment=ENVIRONMENT, culture=CULTURE):
    with pytest.raises(ConfigurationError) as raised:
        read(environment, culture)
    return str(raised.value).split("\n")


POLICY = Path(os.path.join(ROOT, "config", "recoveryPolicy.ini")).read_text("utf-8")


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a folder with configuration and knowledge files, which ``load`` reads."""
    files = {
        "config/environmentKnowledgeBaseConfiguration.ini":
            "verboseMode false\nknowledgeBase places.dat\n",
        "config/cultureKnowledgeBaseConfiguration.ini":
            "knowledgeBase words.dat\nvalueTypes types.dat\n",
        "config/recoveryPolicy.ini": POLICY,
        "data/places.dat": ENVIRONMENT,
        "data/words.dat": CULTURE}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(folders, "config", lambda name: str(tmp_path / "config" / name))
    return tmp_path


def faults_of_load(package):
    with pytest.raises(ConfigurationError) as raised:
        knowledge_files.load()
    return str(raised.value).replace(str(package) + os.sep, "").split("\n")


# ----------------------------------------------------------------------------- what is in the files


def test_both_files_make_the_tour_and_the_phrases(package):
    found = knowledge_files.load()
    assert found.tour == (CAFE, FORGE, CAFE)
    assert (found.tour[0], found.tour[-1]) == (CAFE, CAFE)
    assert found.language == "English"
    assert found.phrases == {number: "phrase {}".format(number) for number in range(1, 9)}
    assert found.warnings == ()
    assert knowledge_files.read(*found.sources) == found


def test_the_tour_begins_and_ends_at_its_first_and_last_location():
    found = read(changed(ENVIRONMENT, ("3 4 9 4", "2 9 4")))
    assert found.tour == (FORGE, CAFE)
    assert (found.tour[0], found.tour[-1]) == (FORGE, CAFE)


def test_a_tour_of_one_location():
    found = read(changed(ENVIRONMENT, ("3 4 9 4", "1 9")))
    assert (found.tour[0], found.tour[-1], len(found.tour)) == (FORGE, FORGE, 1)


def test_the_language_chooses_messages_and_phrases():
    environment = changed(ENVIRONMENT,
                          ("3 4 9 4", "1 9")) + "postGestureMessageKinyarwanda 9 Murabeho.\n"
    found = read(environment, CULTURE.replace("English", "Kinyarwanda"))
    assert found.tour == (FORGE._replace(description1="Nta kibazo.", description2="Murabeho."),)
    assert (found.language, found.phrases[7]) == ("Kinyarwanda", "phrase 7")


@pytest.mark.parametrize("form", [
    lambda text: text.replace("\n", "\r\n"),
    lambda text: text.replace("\n", "\r"),
    lambda text: "\ufeff" + text,
    lambda text: text.rstrip("\n"),
    lambda text: text.replace("\n", " \t \n"),
    lambda text: text.replace("\n", "\n\n \n"),
    lambda text: "# a comment\n" + text.replace("\n", "\n  # robotLocationPose 4\n"),
    lambda text: "\n".join("\t{}\t {}".format(*line.split(None, 1))
                           for line in text.split("\n") if line)])
def test_forms_that_change_nothing(package, form):
    for name, text in [("places.dat", ENVIRONMENT), ("words.dat", CULTURE)]:
        (package / "data" / name).write_bytes(form(text).encode("utf-8"))
    found = knowledge_files.load()
    assert (found.tour, found.phrases[7], found.warnings) == ((CAFE, FORGE, CAFE), "phrase 7", ())


def test_a_file_in_utf_16(package):
    (package / "data" / "places.dat").write_bytes(ENVIRONMENT.encode("utf-16"))
    assert knowledge_files.load().tour[0].name == "Café (#1)"


def test_a_text_may_be_long():
    text = "Umwana wari ukuze " * 3000
    found = read(changed(ENVIRONMENT, ("It is hot.", text)), changed(CULTURE, ("phrase 7", text)))
    assert found.tour[1].description1 == found.phrases[7] == text.rstrip()


def test_keys_of_other_programs_in_the_culture_file_say_nothing():
    keys = ["phraseAddressOlderEnglish Hello", "phraseRhythmEnglish",
            "utilityPhraseKinyarwanda12 x", "x", "bow 30"]
    assert read(culture=CULTURE + "\n".join(keys * 2)).warnings == ()


def test_what_is_decided_on_purpose_is_no_warning():
    environment = changed(ENVIRONMENT, ("It is hot.", ""), ("-2.25 -7 0.82", "0 0 0"))
    found = read(environment)
    assert (found.tour[1].description1, found.tour[1].gesture,
            found.warnings) == ("", Point(0.0, 0.0, 0.0), ())


# ----------------------------------------------------------------------------------------- warnings


@pytest.mark.parametrize("change, warning", [
    (("gestureTarget                 9 -2.25 -7 0.82\n", ""),
     "e:14:23: warning: location 9 of the tour has no gestureTarget: the robot points at nothing "
     "there (if that is meant, add a line: gestureTarget 9 0 0 0)"),
    (("preGestureMessageEnglish      9 It is hot.\n", ""),
     "e:14:23: warning: location 9 of the tour has no preGestureMessageEnglish: the robot says "
     "nothing there (if that is meant, add a line: preGestureMessageEnglish 9 without a text)"),
    (("postGestureMessageEnglish     4 Come along.\n", ""),
     "e:14:21: warning: location 4 of the tour has no postGestureMessageEnglish: the robot says "
     "nothing there (if that is meant, add a line: postGestureMessageEnglish 4 without a text)"),
    (("culturalKnowledge             4 SomeShape", "culturalKnowlege 4 SomeShape"),
     "e:6:1: warning: unknown key culturalKnowlege: it is not used (did you mean "
     "culturalKnowledge?)"),
    (("\nrobotLocationDescription      9",
      " \n  GestureTarget 4 1 1 1\nGestureTarget 9\nrobotLocationDescription 9"),
     "e:8:3: warning: unknown key GestureTarget: it is not used (did you mean gestureTarget?)")])
def test_what_the_environment_may_lack_is_a_warning(change, warning):
    assert [str(fault) for fault in read(changed(ENVIRONMENT, change)).warnings] == [warning]


def test_an_unknown_key_that_is_like_no_other_is_told_with_those_that_there_are():
    warning, = read(ENVIRONMENT + "gestureArm 4 right\ngestureArm 9 left").warnings
    assert (warning.line, warning.column,
            warning.text) == (16, 1, "unknown key gestureArm: it is not used")
    assert warning.hint.startswith("the keys: ")
    assert set(warning.hint[len("the keys: "):].split(", ")) == {
        "robotLocationDescription", "robotLocationPose", "gestureTarget", "culturalKnowledge",
        "tourSpecification"
    } | {when + "GestureMessage" + language for when in ("pre", "post") for language in LANGUAGES}


@pytest.mark.parametrize("key, meant", [
    ("utilityPhraseEnglsh1", "utilityPhraseEnglish1"), ("phraseLangauge", "phraseLanguage"),
    ("utilityPhraseisiZulu3", "utilityPhraseIsiZulu3")])
def test_a_key_of_the_culture_file_that_is_like_a_known_one_is_a_warning(key, meant):
    warning, = read(culture="{} x\n{} x\n".format(key, key) + CULTURE).warnings
    assert str(
        warning) == "c:1:1: warning: unknown key {}: it is not used (did you mean {}?)".format(
            key, meant)


def test_many_warnings_are_no_reason_to_refuse():
    found = read(ENVIRONMENT + "\n".join("key{} x".format(number) for number in range(150)))
    assert found.tour == (CAFE, FORGE, CAFE)
    assert len(found.warnings) == 101
    assert str(found.warnings[-1]) == "e: warning: more than 100 warnings; the rest is not shown"


# ------------------------------------------------------------------------------------------- faults

NUMBER = "allowed: a number from -10000 to 10000"
ID = "allowed: a whole number from 0 to 1000000000"


@pytest.mark.parametrize("old, new, expected", [
    ("4 -1.5 2.0 -90", "4 -1.5 2.0", [
        "e:2:1: robotLocationPose 4 has 2 values, not 3 ({})".format(POSE_FORM)]),
    ("4 -1.5 2.0 -90", "4 -1.5 2.0 -90 # x", [
        "e:2:1: robotLocationPose 4 has 5 values, not 3 ({})".format(POSE_FORM)]),
    ("9 -2.25 -7 0.82", "9", [
        "e:10:1: gestureTarget 9 has 0 values, not 3 ({})".format(TARGET_FORM)]),
    ("-1.5 2.0 -90", "-1,5 2.0 nan", [
        'e:2:33: a value of robotLocationPose 4 cannot be "-1,5" ({})'.format(NUMBER),
        'e:2:42: a value of robotLocationPose 4 cannot be "nan" ({})'.format(NUMBER)]),
    ("-2.25 -7 0.82", "-2.25 -7 inf", [
        'e:10:42: a value of gestureTarget 9 cannot be "inf" ({})'.format(NUMBER)]),
    ("-2.25 -7 0.82", "-2.25 -7 10001", [
        'e:10:42: a value of gestureTarget 9 cannot be "10001" ({})'.format(NUMBER)]),
    ("culturalKnowledge             4", "culturalKnowledge Four", [
        'e:6:19: the id of culturalKnowledge cannot be "Four" ({})'.format(ID)]),
    ("culturalKnowledge             4", "culturalKnowledge -4", [
        'e:6:19: the id of culturalKnowledge cannot be "-4" ({})'.format(ID)]),
    ("culturalKnowledge             4 SomeShape SomeBow", "culturalKnowledge", [
        "e:6:1: the id of culturalKnowledge cannot be empty ({})".format(ID)]),
    ("culturalKnowledge             4 SomeShape SomeBow", "  gestureTarget 4 1 1 1", [
        "e:6:3: gestureTarget 4 is in line 3 already (keep one of them)"]),
    ("4 Café (#1)", "4", ["e:1:1: robotLocationDescription 4 cannot be empty (the form: "
                          "robotLocationDescription <id> <text>)"]),
    ("robotLocationPose             4", "robotLocationPose             5", [
        "e:15:21: location 4 of the tour has no robotLocationPose (add a line: robotLocationPose 4 "
        "<x in m> <y in m> <theta in degrees>)"]),
    ("robotLocationDescription      9", "robotLocationDescription      5", [
        "e:15:23: location 9 of the tour has no robotLocationDescription (add a line: "
        "robotLocationDescription 9 <text>)"]),
    ("3 4 9 4", "3 4 7 4", [
        "e:15:23: the tour goes to location 7, which has no entries (there are: 4, 9)"]),
    ("3 4 9 4", "3 7 9 7", [
        "e:15:21: the tour goes to location 7, which has no entries (there are: 4, 9)"]),
    ("3 4 9 4", "2 4 9 4",
     ["e:15:19: tourSpecification says 2 locations and lists 3 (the form: {})".format(TOUR_FORM)]),
    ("3 4 9 4", "1", [
        "e:15:19: tourSpecification says 1 location and lists 0 (the form: {})".format(TOUR_FORM)]),
    ("3 4 9 4", "0", ['e:15:19: the number of locations of tourSpecification cannot be "0" '
                      "(allowed: a whole number from 1 to 999)"]),
    ("3 4 9 4", "", ["e:15:1: the number of locations of tourSpecification cannot be empty "
                     "(allowed: a whole number from 1 to 999)"]),
    ("3 4 9 4", "3 4 x 4", ['e:15:23: an id of tourSpecification cannot be "x" ({})'.format(ID)]),
    ("3 4 9 4", "3 4 9 4\ntourSpecification 1 4", [
        "e:16:1: tourSpecification is in line 15 already (keep one of them)"]),
    ("tourSpecification 3 4 9 4", "", [
        "e: the required key tourSpecification is missing (add a line: {})".format(TOUR_FORM)]),
    ("tourSpecification", "tourspecification", [
        "e:15:1: warning: unknown key tourspecification: it is not used (did you mean "
        "tourSpecification?)",
        "e: the required key tourSpecification is missing (add a line: {})".format(TOUR_FORM)])])
def test_a_mistake_in_the_environment_file(old, new, expected):
    assert faults_of(changed(ENVIRONMENT, (old, new))) == expected


@pytest.mark.parametrize("old, new, expected", [
    ("Language              English", "Language  Englich ", [
        'c:2:17: phraseLanguage cannot be "Englich" '
        "(allowed: one of English, IsiZulu, Kinyarwanda)"]),
    ("Language              English", "Language  French ", [
        'c:2:17: phraseLanguage cannot be "French" '
        "(allowed: one of English, IsiZulu, Kinyarwanda)"]),
    ("Language              English", "Language  ", [
        "c:2:1: phraseLanguage cannot be empty (allowed: one of English, IsiZulu, Kinyarwanda)"]),
    ("phraseLanguage              English\n", "", [
        "c: the required key phraseLanguage is missing (add a line: phraseLanguage <one of "
        "English, IsiZulu, Kinyarwanda>)"]),
    ("utilityPhraseEnglish6       phrase 6", "", [
        "c: the required key utilityPhraseEnglish6 is missing (add a line: utilityPhraseEnglish6 "
        "<text>)"]),
    ("utilityPhraseEnglish7       phrase 7", "", [
        "c: the required key utilityPhraseEnglish7 is missing (add a line: utilityPhraseEnglish7 "
        "<text>)"]),
    ("utilityPhraseEnglish6       phrase 6", "utilityPhraseEnglish6  ", [
        "c:9:1: utilityPhraseEnglish6 cannot be empty (allowed: the text to say)"]),
    ("utilityPhraseEnglish6 ", "utilityPhraseEnglish5 ", [
        "c:9:1: utilityPhraseEnglish5 is in line 8 already (keep one of them)",
        "c: the required key utilityPhraseEnglish6 is missing (add a line: utilityPhraseEnglish6 "
        "<text>)"]),
    ("passingDistance ", "phraseLanguage English\n#", [
        "c:3:1: phraseLanguage is in line 1 already (keep one of them)"]),
    ("phraseLanguage              English\n", "phraseLanguage English\nphraseLanguage Klingon\n", [
        "c:3:1: phraseLanguage is in line 2 already (keep one of them)"])])
def test_a_mistake_in_the_culture_file(old, new, expected):
    assert faults_of(culture=changed(CULTURE, (old, new))) == expected


def test_a_language_without_any_message_is_one_fault():
    assert faults_of(culture=CULTURE.replace("English", "IsiZulu")) == [
        "e: there is neither preGestureMessageIsiZulu nor postGestureMessageIsiZulu for any "
        "location (the culture file's phraseLanguage is IsiZulu; there are messages in: English, "
        "Kinyarwanda)"]


def test_a_hundred_mistakes_are_enough():
    found = faults_of(ENVIRONMENT + "robotLocationPose x 1 1 1\n" * 150)
    assert len(found) == 101
    assert found[0].startswith("e:16:19: ") and '"x"' in found[0]
    assert found[-1].startswith(
        "e:116:1: ") and "100" in found[-1] and "robotLocationPose" not in found[-1]


def test_the_faults_of_both_files_come_at_once_in_the_order_of_each():
    found = faults_of(
        changed(ENVIRONMENT, ("3 4 9 4", "3 4 8 4"), ("4 -1.5", "4 x"), ("Café (#1)", "")),
        changed(CULTURE, ("phrase 3", ""), ("utilityPhraseEnglish1 ", "x ")))
    assert [fault.split(" ")[0]
            for fault in found] == ["e:1:1:", "e:2:33:", "e:15:23:", "c:6:1:", "c:"]


# ------------------------------------------------------------------------------------ configuration


def test_the_faults_of_all_four_files_come_at_once(package):
    (package / "config" /
     "environmentKnowledgeBaseConfiguration.ini").write_text("verboseMode maybe\nknowlegeBase x\n")
    (package / "data" / "words.dat").write_text("phraseLanguage English\nphraseLanguage English\n" +
                                                CULTURE)
    found = [fault.split(": ") for fault in faults_of_load(package)]
    assert [place for place, *_ in found] == [
        "config/environmentKnowledgeBaseConfiguration.ini:1:13",
        "config/environmentKnowledgeBaseConfiguration.ini:2:1",
        "config/environmentKnowledgeBaseConfiguration.ini", "data/words.dat:2:1",
        "data/words.dat:4:1"]
    assert all(word in said[0] for word, (_, *said) in zip(
        ('"maybe"', "knowlegeBase", "knowledgeBase", "phraseLanguage", "phraseLanguage"), found))


def test_a_configuration_that_is_missing(package):
    for name in os.listdir(str(package / "config")):
        (package / "config" / name).unlink()
    assert [fault.partition(":")[0] for fault in faults_of_load(package)] == [
        "config/" + kind + "KnowledgeBaseConfiguration.ini" for kind in ("environment", "culture")]


@pytest.mark.parametrize("name", ["nowhere.dat", "folder", "latin.dat"])
def test_a_knowledge_file_that_cannot_be_read_is_told_with_what_names_it(package, name):
    (package / "data" / "folder").mkdir()
    (package / "data" / "latin.dat").write_bytes(ENVIRONMENT.encode("latin-1"))
    (package / "config" / "environmentKnowledgeBaseConfiguration.ini").write_text(
        "knowledgeBase {}\n".format(name))
    fault, = faults_of_load(package)
    assert fault.startswith("data/{}: ".format(name))
    assert "knowledgeBase of config/environmentKnowledgeBaseConfiguration.ini" in fault


def test_files_that_were_interchanged(package):
    (package / "config" /
     "cultureKnowledgeBaseConfiguration.ini").write_text("knowledgeBase places.dat")
    assert faults_of_load(package) == [
        "data/places.dat: this is the environment file (the key "
        "knowledgeBase of config/cultureKnowledgeBaseConfiguration.ini names it)"]


@pytest.mark.parametrize("name",
                         ["lab/places.dat", "../elsewhere/places.dat", "{}/elsewhere/places.dat"])
def test_a_knowledge_file_may_be_in_another_folder(package, name):
    for folder in ("data/lab", "elsewhere"):
        (package / folder).mkdir()
        (package / folder / "places.dat").write_text(changed(ENVIRONMENT, ("3 4 9 4", "1 9")),
                                                     encoding="utf-8")
    (package / "config" / "environmentKnowledgeBaseConfiguration.ini").write_text(
        "knowledgeBase " + name.format(package))
    assert knowledge_files.load().tour == (FORGE,)


# --------------------------------------------------------------------------- a file given by itself


def checked(package, name):
    found = knowledge_files.check(str(package / name))
    return found if found is None else [
        str(fault).replace(str(package) + os.sep, "") for fault in found]


@pytest.mark.parametrize("name",
                         ["data/places.dat", "config/environmentKnowledgeBaseConfiguration.ini"])
def test_an_environment_file_by_itself_is_checked_in_the_languages_that_it_has(package, name):
    (package / "data" / "places.dat").write_text(
        changed(ENVIRONMENT, ("3 4 9 4", "2 9 8"),
                ("preGestureMessageEnglish      9 It is hot.\n", "")), encoding="utf-8")
    assert checked(package, name) == [
        "data/places.dat:14:21: warning: location 9 of the tour has no {0}: the robot says nothing "
        "there (if that is "
        "meant, add a line: {0} 9 without a text)".format(key)
        for key in ("preGestureMessageEnglish", "postGestureMessageKinyarwanda")] + [
        "data/places.dat:14:23: the tour goes to location 8, which has no entries (there are: 4, 9)"
    ]


@pytest.mark.parametrize("name", ["data/words.dat", "config/cultureKnowledgeBaseConfiguration.ini"])
def test_a_culture_file_by_itself(package, name):
    assert checked(package, name) == []
    (package / "data" / "words.dat").write_text(changed(CULTURE, ("phrase 2", "")))
    assert checked(package, name) == ["data/words.dat:5:1: utilityPhraseEnglish2 cannot be empty "
                                      "(allowed: the text to say)"]


@pytest.mark.parametrize("text, expected", [
    ("knowledgeBase x.dat\nx 1", ["config/other.ini:2:1"]),
    ("knowledgeBase places.dat", []),
    ("knowledgeBase words.dat", []),
    ("knowledgeBase x.dat", ["data/x.dat"])])
def test_a_configuration_of_another_name_may_name_either(package, text, expected):
    (package / "data" / "x.dat").write_text("x 1\n")
    (package / "config" / "other.ini").write_text(text)
    found = checked(package, "config/other.ini")
    assert [fault.split(": ")[0] for fault in found if "warning" not in fault] == expected


def test_what_is_neither_is_left_to_others(package):
    assert knowledge_files.check(folders.mission("lab_tour")) is None
    assert knowledge_files.check(str(package / "nowhere")) is None
    (package / "mission.xml").write_text("<root>\nphraseLanguage English\n</root>")
    assert knowledge_files.check(str(package / "mission.xml")) is None
    assert knowledge_files.check(os.path.join(ROOT, "config", "recoveryPolicy.ini")) is None


def test_a_file_of_value_types_is_no_culture_file(package):
    path = package / "data" / "cultureKnowledgeValueTypesInput.dat"
    path.write_text("phraseLanguage        WORD\nutilityPhraseEnglish1 PHRASE\n"
                    "bowExtentRespect      NUMBER\nbeatShape             UNDEFINED\n")
    assert knowledge_files.check(str(path)) == []
    package.joinpath("config", "cultureKnowledgeBaseConfiguration.ini").write_text(
        "knowledgeBase {}\n".format(path.name))
    with pytest.raises(ConfigurationError, match="this is the value types file"):
        knowledge_files.load()


def test_validate_mission_takes_them(package, capsys):
    places, words = (str(package / "data" / name) for name in ("places.dat", "words.dat"))
    (package / "data" / "places.dat").write_text(changed(ENVIRONMENT, (
        "preGestureMessageKinyarwanda  9 Nta kibazo.\n", ""), ("It is hot.", "")), encoding="utf-8")
    assert cli.validate([places, words]) == 0
    assert capsys.readouterr().out == (
        "checked for the robot D5.4.3 (by default)\n{}: 0 errors\n{}: 0 errors\n".format(
            places, words))
    (package / "data" / "words.dat").write_text(changed(CULTURE, ("phrase 2", "")))
    assert cli.validate([words, folders.mission("lab_tour")]) == 2
    assert capsys.readouterr().out.split("\n")[1].startswith(
        "{}:5:1: utilityPhraseEnglish2 cannot be empty".format(words))


# ------------------------------------------------------------------------------ files that were cut


@pytest.mark.parametrize("name, text",
                         [("places.dat", "\ufeff" + ENVIRONMENT.replace("\n", "\r\n")),
                          ("words.dat", CULTURE.replace("phrase 2", "phrase é")),
                          ("../config/environmentKnowledgeBaseConfiguration.ini",
                           "verboseMode TRUE\r\nknowledgeBase places.dat\r\n")])
def test_a_file_that_was_cut_anywhere_is_usable_or_has_faults(package, name, text):
    data = text.encode("utf-8")
    outcomes = set()
    for length in (*range(0, len(data), 11), len(data)):
        (package / "data" / name).write_bytes(data[:length])
        knowledge_files.check(str(package / "data" / name))
        try:
            outcomes.add(len(knowledge_files.load().tour))
        except ConfigurationError as error:
            assert any(not fault.is_warning
                       for fault in error.faults) and all(map(str, error.faults))
            outcomes.add("faults")
    assert outcomes == {"faults", 3}


# ------------------------------------------------------------------------------ the delivered files


def test_the_delivered_files_can_be_used_without_a_warning():
    found = knowledge_files.load()
    assert (found.language, found.warnings) == ("English", ())
    for name in ("config/environmentKnowledgeBaseConfiguration.ini",
                 "config/cultureKnowledgeBaseConfiguration.ini",
                 "data/environmentKnowledgeBase.dat", "data/cultureKnowledgeBase.dat"):
        assert knowledge_files.check(os.path.join(ROOT, name)) == []


def test_the_delivered_tour_shows_the_exhibits_of_the_simulated_lab():
    lab = json.loads(Path(folders.data("exhibits.json")).read_text("utf-8"))
    start, *shown, end = knowledge_files.load().tour
    assert shown == [Exhibit(place["name"], place["description1"], place["description2"],
                             Location(*place["location"]), Point(*place["gesture"]))
                     for place in lab["exhibits"]]
    assert (start.location, start.gesture) == (Location(*lab["home"]["location"]),
                                               Point(0.0, 0.0, 0.0))
    assert (end.location, end.gesture) == (Location(*lab["entrance"]["location"]),
                                           Point(*lab["entrance"]["gesture"]))


@pytest.mark.parametrize("language", ["English", "Kinyarwanda"])
def test_the_delivered_phrases_are_those_of_the_other_missions(language):
    with open(folders.data("cultureKnowledgeBase.dat"), encoding="utf-8") as file:
        keys = dict(
            line.split(None, 1) for line in file if line.startswith("utilityPhrase" + language))
    same = dict(zip(UTILITY_PHRASES, [
        "PressYesNoSpeech", "FollowMeSpeech", "MaybeAnotherTimeSpeech", "WelcomeSpeech",
        "QueryTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech"]))
    assert {key: text.strip() for key, text in keys.items()} == {
        "utilityPhrase{}{}".format(language, number): phrases.load(language).speeches[node]
        for number, node in same.items()}
