"""The documents: links lead somewhere, commands are there, and no picture is older than what it
shows."""
import glob
import importlib.util
import os
import re

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOCUMENTS = ["README.md"] + sorted(
    os.path.relpath(path, ROOT) for path in glob.glob(os.path.join(ROOT, "docs", "*.md")))
MOST_BYTES = 1_000_000  # all pictures
MOST_WORDS_OF_ALL = 26_000
A_MINUTE = 250  # words
GENERATED = {"docs/faults.md"}
MOST_WORDS, MOST_LONG, MOST_SEMICOLONS = 16.0, 6.0, 5.0
"""Limits of a document: words per sentence, sentences of more than 30 words and semicolons per 100
sentences."""


def text_of(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def prose_of(path):
    return re.sub(r"^```.*?^```", "", text_of(path), flags=re.M | re.S)


def sentences_of(document):
    """Return the sentences outside code, tables, headings and pictures; a link counts as its text,
    quoted code as one word."""
    text = re.sub(r"<!--.*?-->", "", prose_of(document), flags=re.S)
    text = re.sub(r"!\[[^]]*\]\([^)]*\)|^(\||#).*$", "", text, flags=re.M)
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "Code", text))
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:[*-]|\d+\.) )", text)
    plain = [" ".join(re.sub(r"^\s*(?:[*-]|\d+\.) ", "", block).split()) for block in blocks]
    return [sentence for block in plain for sentence in re.split(r"(?<=[.!?]) (?=[^a-z])", block)
            if re.search(r"\w", sentence)]


def figures_of(document):
    """Return the words of a document, and the figures of its sentences that MOST_… limits."""
    sentences = sentences_of(document)
    lengths = [len(sentence.split()) for sentence in sentences] or [0]
    shares = [sum(length > 30 for length in lengths), "".join(sentences).count(";")]
    return (len(text_of(document).split()), sum(lengths) / len(lengths),
            *(100 * share / len(lengths) for share in shares))


def links_of(document):
    """Return the files of the repository that a document links to or shows, each with its anchor or
    an empty text."""
    targets = re.findall(r"\]\(([^)\s]+)\)", prose_of(document))
    folder = os.path.dirname(document)
    return [(os.path.normpath(os.path.join(folder, path)) if path else document, anchor)
            for path, _, anchor in (target.partition("#") for target in targets
                                    if "://" not in target)]


def anchors_of(document):
    """Return the anchors of a document's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", prose_of(document), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.fixture(name="pictures", scope="module")
def picture_command():
    spec = importlib.util.spec_from_file_location("pictures",
                                                  os.path.join(ROOT, "tools", "pictures.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_link_leads_somewhere(document):
    lost = [(path, anchor) for path, anchor in links_of(document)
            if not os.path.exists(os.path.join(ROOT, path)) or anchor
            and anchor not in anchors_of(path)]
    assert not lost


def test_sentences_are_short():
    """pytest -rP prints the figures."""
    row, too_hard = "{:30}{:>7}{:>11}{:>9}{:>12}", set()
    print(row.format("document", "words", "a sentence", "over 30", "semicolons"))
    for document in sorted(set(DOCUMENTS) - GENERATED):
        words, *figures = figures_of(document)
        print(row.format(document, words, *("{:.1f}".format(figure) for figure in figures)))
        if any(figure > most for figure, most in zip(figures, (MOST_WORDS, MOST_LONG,
                                                               MOST_SEMICOLONS))):
            too_hard.add(document)
    assert not too_hard


def test_all_documents_together_are_short():
    assert sum(figures_of(document)[0] for document in DOCUMENTS) <= MOST_WORDS_OF_ALL


@pytest.mark.parametrize("task", ["Run it", "Connect a robot", "Write a mission", "Test a mission",
                                  "Add a leaf"])
def test_each_task_begins_within_a_minute_of_reading(task):
    """From the first line of README, which links to the tasks, to the first command."""
    head, section = text_of("README.md").partition("\n## ")[0], text_of("README.md").partition(
        "\n## " + task + "\n")[2].partition("\n## ")[0]
    assert "(#{})".format(task.lower().replace(" ", "-")) in head
    before, command = re.match(r"(?s)(.*?)(```\n\w|`(?:rosrun|make) )", section).groups()
    assert command and len((head + before).split()) <= A_MINUTE


def test_readme_and_limits_name_what_was_never_tried():
    for document in ("README.md", "docs/limits.md"):
        text = text_of(document)
        assert "never" in text
        for name in ("Pepper", "Noetic", "Gazebo", "Groot2's own program"):
            assert name in text, document


def test_the_figures_of_sentences(tmp_path):
    (tmp_path / "a.md").write_text(
        "# A heading\n\nOne `two words` [three](b.md#c). Four; five!\n* six\n  seven\n1. {}\n\n"
        "| a | table; |\n```\ncode; it is.\n```\n".format("word " * 31))
    assert sentences_of(str(tmp_path / "a.md"))[:3] == ["One Code three.", "Four; five!",
                                                        "six seven"]
    assert figures_of(str(tmp_path / "a.md"))[1:] == (38 / 4, 25.0, 25.0)


def test_every_document_is_in_the_index():
    linked = {path for path, _ in links_of(os.path.join("docs", "README.md"))}
    assert set(DOCUMENTS) - linked == {os.path.join("docs", "README.md")}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_is_there(document):
    text = text_of(document)
    code = "\n".join(re.findall(r"^```.*?^```|`make [^`]*`", text, re.M | re.S)).replace("`", "")
    targets = set(re.findall(r"^([\w-]+):", text_of("Makefile"), re.M))
    assert set(re.findall(r"^make (\w+)", code, re.M)) <= targets
    for package, folder in (("cssr_system", "src/behavior_controller"), ("unit_tests",
                                                                         "unit_tests/nodes")):
        for command in set(re.findall(r"rosrun {} (\w+)".format(package), text)):
            assert os.access(os.path.join(ROOT, folder, command), os.X_OK), command


def test_no_file_names_a_document_that_is_not_there():
    named = set()
    for folder in ("config", "src", "tools", "unit_tests", "test"):
        for path in glob.glob(os.path.join(ROOT, folder, "**", "*"), recursive=True):
            if os.path.isfile(path) and "__pycache__" not in path:
                with open(path, encoding="utf-8", errors="replace") as file:
                    named.update(re.findall(r"docs/\w+\.md", file.read()))
    assert named and [
        path for path in sorted(named) if not os.path.isfile(os.path.join(ROOT, path))] == []


def test_no_picture_is_older_than_what_it_shows(pictures):
    older = pictures.outdated()
    assert not older, "make pictures takes {} again".format(", ".join(older))


def test_every_picture_is_shown_and_they_are_small(pictures):
    shown = {os.path.basename(path) for document in DOCUMENTS for path, _ in links_of(document)
             if os.path.dirname(path) == os.path.join("docs", "pictures")}
    files = {name for name in os.listdir(pictures.PICTURES) if name != "made_from.json"}
    assert shown == files == set(pictures.SOURCES)
    assert sum(os.path.getsize(os.path.join(pictures.PICTURES, name))
               for name in files) < MOST_BYTES


def test_a_change_of_what_a_picture_shows_makes_it_old(pictures, tmp_path, monkeypatch):
    (tmp_path / "a.xml").write_text("<a/>")
    monkeypatch.setattr(pictures, "ROOT", str(tmp_path))
    monkeypatch.setattr(pictures, "PICTURES", str(tmp_path))
    monkeypatch.setattr(pictures, "MADE_FROM", str(tmp_path / "made_from.json"))
    monkeypatch.setattr(pictures, "SOURCES", {"a.svg": ("*.xml",), "b.svg": ("*.xml",)})
    (tmp_path / "a.svg").write_text("")
    (tmp_path / "made_from.json").write_text('{{"a.svg": "{0}", "b.svg": "{0}"}}'.format(
        pictures.digest("a.svg")))
    assert pictures.outdated() == ["b.svg"]  # it is not there
    (tmp_path / "a.xml").write_text("<b/>")
    assert pictures.outdated() == ["a.svg", "b.svg"]


def test_an_animation_holds_the_image_of_each_frame(pictures):
    def still(image):
        chunk = pictures._chunk(b"VP8 ", image)
        return pictures._chunk(b"RIFF",
                               b"WEBP" + pictures._chunk(b"VP8X", b"\0" * 10) + chunk), chunk

    (first, one), (second, other) = still(b"123"), still(b"4567")
    made = pictures.animation([first, first, second], 400, 800)
    assert made[:4] + made[8:12] == b"RIFFWEBP" and int.from_bytes(made[4:8],
                                                                   "little") == len(made) - 8
    assert made[12:30] == b"VP8X\x0a\0\0\0\x02\0\0\0\x8f\x01\0\x1f\x03\0"  # animated, 400 x 800
    assert made.count(b"ANMF") == 2 and made.index(one) < made.index(other)
