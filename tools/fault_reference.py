"""The reference of all mistakes as docs/faults.md has it, with their examples; ``make derived``
writes it."""
import os
import re
import textwrap
from typing import Dict, List, NamedTuple

from behavior_controller.config import settings
from behavior_controller.bt.loader.document import parse, with_includes
from behavior_controller.bt.loader.rules import RULES
from behavior_controller.errors import Fault, MissionError
from behavior_controller.missions.load import build_tree, on_robot

EXAMPLE_NAME = "example.xml"
"""The name of the file that an example is."""

_EXAMPLES = os.path.join(
    os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "test", "fixtures", "mistakes.txt")
_MARK = "▸"
_STANDS_FOR = {"␤": "\n", "␀": "\0", "␁": "\x01", "⟨long⟩": "a" * 100_001, "⟨many⟩": " ".join(
    f'_a{number}=""' for number in range(500))}
_LONGEST = 100  # characters of an example's line
_HEAD = """# Mistakes by code

`validateMission` prints these. A file with an error is not run. A file with a warning is run, but
hardly does what its author means; `validateMission --ignore CODE` leaves out such warnings. Each
entry has a line with the mistake, and the message with the remedy in brackets, some the meaning
before. An error in an unused tree may be a warning.

## The JSON of an editor

`validateMission --json FILE…` prints an array with an object for each mistake, ordered by file,
place, code and text. With `--watch` an array follows at each change.

* `file`: the path, as it was given or included
* `range`: `start` and `end` (after the last character), each `line` and `column` from 1; or null
* `severity`: `error` or `warning`
* `code`: one of the codes below, or empty for a file that is not a mission
* `text`, `hint`: the message, and the part in brackets, which may be empty
"""


class Example(NamedTuple):
    """A mission with a mistake at ``line`` and ``column``, or without one: both are 0 then.

    ``beside`` is the code of a mistake that it has too.
    """

    text: str
    line: int
    column: int
    beside: str


def examples() -> Dict[str, List[Example]]:
    """Return the examples of each rule by its code, from test/fixtures/mistakes.txt."""
    with open(_EXAMPLES, encoding="utf-8") as file:
        sections = re.split("^=== ", file.read(), flags=re.MULTILINE)[1:]
    found = {}
    for section in sections:
        head, body = section.rstrip("\n").split("\n", 1)
        code, _, what = head.partition(" (")
        beside = what[len("with "):-1] if what.startswith("with ") else ""
        parts = re.split(r"\n(---|\+\+\+)\n", body)
        found[code] = [_example_of(text, kind != "+++", what == "file)", beside)
                       for kind, text in zip(["---"] + parts[1::2], parts[::2])]
    return found


def _example_of(text: str, is_bad: bool, is_file: bool, beside: str) -> Example:
    assert text.count(_MARK) == is_bad, text
    for sign, meaning in _STANDS_FOR.items():
        text = text.replace(sign, meaning)
    if not is_file and "<root" not in text:
        if "<BehaviorTree" not in text:
            text = '<BehaviorTree ID="Main">\n{}\n</BehaviorTree>'.format(
                textwrap.indent(text, "  "))
        text = '<root BTCPP_format="4">\n{}\n</root>'.format(textwrap.indent(text, "  "))
    if not is_bad:
        return Example(text, 0, 0, beside)
    before = text[:text.index(_MARK)]
    return Example(text.replace(_MARK, ""), before.count("\n") + 1,
                   len(before) - before.rfind("\n"), beside)


def page() -> str:
    """Return the page as Markdown."""
    lines, shown = [_HEAD], examples()
    for heading, is_warning in (("Errors", False), ("Warnings", True)):
        lines += [f"## {heading}", ""]
        for rule in RULES.values():
            if rule.is_warning is is_warning:
                example = "".join(map(_example, shown.get(rule.code, [])[:1]))
                is_told = example and _says(f"{rule.code} {example}", rule.meaning)
                meaning = "" if is_told else _escaped(rule.meaning)
                lines += [f"### {rule.code}", "", f"{meaning}{example}".lstrip(), ""]
    return "\n".join(lines)


def _says(text: str, meaning: str) -> bool:
    """Return whether a text has half the words of a meaning, which then need not be repeated."""
    wanted, said = ({word[:4] for word in re.findall(r"\w{4,}", some.lower())}
                    for some in (meaning, text))
    return len(wanted & said) >= 0.5 * len(wanted)


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("_", "\\_")


def _example(example: Example) -> str:
    line = _shown(example.text.split("\n")[example.line - 1].strip())
    messages = [str(fault._replace(is_warning=False)).partition(": ")[2]
                for fault in told(example.text)
                if (fault.line, fault.column) == (example.line, example.column)]
    return f" `{line}`" * bool(line) + "".join(f"\n\n`{text}`" for text in messages)


def told(text: str) -> List[Fault]:
    """Return the messages about an example on the robot of the default configuration."""
    try:
        tree = build_tree(with_includes(parse(text, EXAMPLE_NAME)))
    except MissionError as error:
        return list(error.faults)
    return tree.warnings + on_robot(tree, settings.defaults())


def _shown(line: str) -> str:
    if len(line) > _LONGEST:
        line = line[:_LONGEST // 2] + "…" + line[-20:]
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in line)
