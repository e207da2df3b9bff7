"""The people and their names, without ROS: python3 -m unittest discover -s test"""
import os
import tempfile
import unittest
from unittest import mock

from behavior_controller.extend import FaultsFound, Point

from receptionist import directory

PEOPLE = ("David Vernon", "Ana López", "Ana Vernon", "Jean-Paul Habimana", "Jürgen Müller",
          "Дмитрий Иванов", "አበበ ቢቂላ", "Kim Le")


def heard(utterance, people=PEOPLE):
    """Return the names in an utterance, and whether that is certain."""
    found = directory.Directory(dict.fromkeys(people, "B203"), {}).heard(utterance)
    return list(found.names), found.is_certain


class TestNames(unittest.TestCase):
    def test_a_whole_name_is_certain_whatever_stands_around_it(self):
        for utterance in ("David Vernon", "Where is Dr. DAVID VERNON, please?", "davidvernon"):
            self.assertEqual(heard(utterance), (["David Vernon"], True), utterance)

    def test_a_family_name_of_one_person_is_certain_and_a_first_name_is_not(self):
        self.assertEqual(heard("Mr Habimana"), (["Jean-Paul Habimana"], True))
        self.assertEqual(heard("I am David"), (["David Vernon"], False))

    def test_one_wrong_letter_of_five_is_like_a_name_and_two_are_not(self):
        people = ("Ines Marks",)
        self.assertEqual(heard("marka", people), (["Ines Marks"], False))  # 2 * 4 / 10 = 0.8
        self.assertEqual(heard("marca", people), ([], False))  # 2 * 3 / 10
        self.assertEqual(heard("David Vernan"), (["David Vernon"], False))

    def test_a_short_name_has_to_be_said_exactly(self):
        self.assertEqual(heard("an answer"), ([], False))  # Ana, by 2 * 2 / 5
        self.assertEqual(heard("Kim"), (["Kim Le"], False))
        self.assertEqual(heard("le"), ([], False))

    def test_what_several_people_are_called_means_each_of_them(self):
        self.assertEqual(heard("Professor Vernon"), (["David Vernon", "Ana Vernon"], False))
        self.assertEqual(heard("Ana"), (["Ana López", "Ana Vernon"], False))
        self.assertEqual(heard("Ana Vernon"), (["Ana Vernon"], True))

    def test_two_names_in_an_utterance_are_both_meant_the_longer_first(self):
        self.assertEqual(heard("I am Ana López, for David Vernon"),
                         (["David Vernon", "Ana López"], False))

    def test_more_names_than_a_visitor_is_asked_about_are_none(self):
        people = ["{} Habimana".format(name) for name in ("Eric", "Aline", "Jean", "Grace")]
        self.assertEqual(heard("Habimana", people), ([], False))
        self.assertEqual(len(heard("Habimana", people[:3])[0]), 3)

    def test_accents_and_hyphens_do_not_matter(self):
        for utterance in ("ana lopez", "ANA LÓPEZ", "ana lo\u0301pez"):
            self.assertEqual(heard(utterance), (["Ana López"], True), utterance)
        self.assertEqual(heard("jean paul habimana"), (["Jean-Paul Habimana"], True))
        self.assertEqual(heard("Jurgen Muller"), (["Jürgen Müller"], True))
        self.assertEqual(heard("Herr Mueller"), (["Jürgen Müller"], False))

    def test_letters_of_other_scripts_are_letters(self):
        self.assertEqual(heard("где ДМИТРИЙ ИВАНОВ?"), (["Дмитрий Иванов"], True))
        self.assertEqual(heard("አበበ ቢቂላ"), (["አበበ ቢቂላ"], True))

    def test_anything_else_is_no_name(self):
        for utterance in ("", "?!", "yes", "What a bright room", "I do not know the name"):
            self.assertEqual(heard(utterance), ([], False), utterance)

    def test_a_name_after_very_many_words_is_not_looked_at(self):
        self.assertEqual(heard("well " * 29 + "Müller"), (["Jürgen Müller"], True))
        self.assertEqual(heard("well " * 30 + "Müller"), ([], False))


class TestFile(unittest.TestCase):
    def load(self, text):
        """Return the content of a file with this text."""
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(os.path.join(folder, "data"))
            self.path = os.path.join(folder, "data", "people.ini")
            if text is not None:
                with open(self.path, "w", encoding="utf-8") as file:
                    file.write(text)
            with mock.patch.object(directory, "package_folder", lambda name: folder):
                return directory.load()

    def faults(self, text):
        """Return the faults of a file, without its path."""
        with self.assertRaises(FaultsFound) as raised:
            self.load(text)
        return [line.replace(self.path + ":", "") for line in str(raised.exception).split("\n")]

    def test_the_people_and_their_rooms_are_read(self):
        found = self.load("# people\nperson  B203   Ana  López\nroom B203 1 -2.5 1.2\n")
        self.assertEqual((found.people, found.rooms),
                         ({"Ana López": "B203"}, {"B203": Point(1.0, -2.5, 1.2)}))

    def test_the_delivered_file_is_read(self):
        found = directory.load()
        self.assertEqual(found.people["David Vernon"], "B203")
        self.assertLessEqual(set(found.people.values()), set(found.rooms))

    def test_every_mistake_is_a_line_with_its_place(self):
        self.assertEqual(self.faults(
            "room B203 1 2 far\nroom B204 1 2\nperson B20 Ana\nperson B203\n  office B203 Eric\n"
            "person B203 ANA\nroom B203 1 1 1\nperson B203 12;3\nroom B1 0 0 0\n"), [
                '1:15: z cannot be "far" (allowed: a number from -10000 to 10000)',
                "2:1: this is not a line of the form: room <room> <x in m> <y in m> <z in m>",
                "4:1: this is not a line of the form: person <room> <name>",
                "5:3: unknown key office (allowed: room, person)",
                "6:1: the person ANA is in line 3 already (two people need different names)",
                "7:1: the room B203 is in line 1 already (keep one of them)",
                "8:13: a name cannot be 12;3 (it needs letters, and no ;)",
                "9:9: 0 0 0 is nowhere to point at (give another point)",
                "3:8: no line says where the room B20 is (did you mean B203?)"])

    def test_a_file_without_people_and_a_missing_one_are_told(self):
        self.assertEqual(self.faults("room B203 1 2 3\n"),
                         [" there is nobody in it (add a line: person <room> <name>)"])
        self.assertIn("the file of people and rooms cannot be read", self.faults(None)[0])


if __name__ == "__main__":
    unittest.main()
