"""The reference of all mistakes as docs/faults.md has it; ``make derived`` writes it."""
from typing import Iterator, List

from behavior_controller import settings
from behavior_controller.bt.language.document import parse, with_includes
from behavior_controller.bt.rules import EXAMPLE_NAME, RULES, Rule, example_file
from behavior_controller.errors import Fault, MissionError
from behavior_controller.mission import build_tree, on_robot

_LONGEST = 600  # characters of an example
_HEAD = """# What validateMission tells

Every kind of mistake has a code that stays the same. `error`: the file is not run. `warning`: it is run, but hardly
does what its author means; `validateMission --ignore CODE` leaves out the warnings with a code. What is an error may be
a warning in a tree that the mission does not use. This page is written by `make derived`;
a test checks each example.

## The JSON of an editor

`validateMission --json FILE…` prints an array with an object for each mistake:

| member | type | meaning |
|---|---|---|
| `file` | string | the path, as it was given or included |
| `range` | object or null | `start` and `end`, each with `line` and `column`, from 1; null: no place is known |
| `severity` | string | `error` or `warning` |
| `code` | string | one of the codes below; empty for a file that is not a mission |
| `text` | string | what is wrong, on one line |
| `hint` | string | what to do, or what is allowed; may be empty |

`end` is after the last character. With `--watch` an array follows at each change.

## The codes
"""


def page() -> str:
    """Return the page as Markdown."""
    lines = [_HEAD, "| code | severity | meaning |", "|---|---|---|"]
    lines += ["| [{0}](#{0}) | {1} | {2} |".format(rule.code, _severity(rule), _escaped(rule.meaning))
              for rule in RULES.values()]
    for rule in RULES.values():
        lines += ["", "### {}".format(rule.code), "", "{}: {}".format(_severity(rule), _escaped(rule.meaning))]
        for example in rule.examples[:1]:
            lines += list(_example(rule, example))
    return "\n".join(lines) + "\n"


def _severity(rule: Rule) -> str:
    return "warning" if rule.is_warning else "error"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("_", "\\_")


def _example(rule: Rule, example: str) -> Iterator[str]:
    text, line, column = example_file(rule, example)
    found = [str(fault) for fault in told(text) if (fault.line, fault.column) == (line, column)]
    yield from ("", "```xml", _shown(text), "```", "")
    yield from ("`{}`".format(_cut(words)) for words in found)


def told(text: str) -> List[Fault]:
    """Return the messages about an example on the robot of the default configuration."""
    try:
        tree = build_tree(with_includes(parse(text, EXAMPLE_NAME)))
    except MissionError as error:
        return list(error.faults)
    return tree.warnings + on_robot(tree, settings.defaults())


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else text[:_LONGEST // 2] + "…" + text[-40:]


def _shown(text: str) -> str:
    return "".join(letter if letter.isprintable() or letter == "\n" else ascii(letter)[1:-1] for letter in _cut(text))
