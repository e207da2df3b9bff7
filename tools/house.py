"""The house of docs/architecture.md, read from the sources: its rooms, what each module is for, and
which room uses which."""
import ast
import os
from typing import Dict, Iterator, Set

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SOURCES = ("src", "unit_tests/src")
COMMANDS = ("cli", "command", "replay_cli")
"""The modules beside the rooms that use rooms; the others there are the base, which all use."""


def modules() -> Dict[str, ast.Module]:
    """Return the syntax tree of each module of both packages, by its dotted name."""
    trees = {}
    for start in (os.path.join(ROOT, source) for source in SOURCES):
        for folder, _, files in os.walk(start):
            for path in (os.path.join(folder, file) for file in files if file.endswith(".py")):
                name = os.path.relpath(path, start)[:-len(".py")].replace(os.sep, ".")
                with open(path, encoding="utf-8") as text:
                    trees[name] = ast.parse(text.read())
    return trees


def table() -> str:
    """Return a table of the rooms and their modules, with the first sentence of each docstring."""
    rows = ["| room, module | its job |", "|---|---|"]
    trees = modules()
    for name in sorted(trees, key=lambda name: name.rpartition(".")[::2]):
        first = (ast.get_docstring(trees[name]) or "").split("\n\n")[0]
        job = " ".join(first.split()).split(". ")[0].rstrip(".")
        place, _, module = name.replace("behavior_controller.", "", 1).rpartition(".")
        place = place.replace(".", "/") + "/" if place else ""
        is_room = module == "__init__"
        row = "| **`{}`** | **{}** |" if is_room else "| `{}.py` | {} |"
        rows.append(row.format(place or "src/" if is_room else place + module, job))
    return "\n".join(rows)


def drawing() -> str:
    """Return the rooms as a Mermaid graph in which an arrow points to a room that is used.

    An arrow is left out if others lead to the same room.
    """
    uses = used()
    lines = ["```mermaid", "graph TD"]
    for room in sorted(uses):
        direct = {other for other in uses[room]
                  if not any(other in reached(uses, between) for between in uses[room] - {other})}
        lines += [f"  {room} --> {other}" for other in sorted(direct)]
    return "\n".join(lines + ["```"])


def used(depth: int = 1) -> Dict[str, Set[str]]:
    """Return the other rooms that the modules of each room import; a room is a folder of at most
    ``depth`` levels below its package."""
    trees = modules()
    uses: Dict[str, Set[str]] = {}
    for name, tree in trees.items():
        others = {_room(other, depth) for other in _imported(tree, set(trees))}
        uses.setdefault(_room(name, depth), set()).update(others)
    return {room: others - {room} for room, others in uses.items()}


def reached(uses: Dict[str, Set[str]], room: str) -> Set[str]:
    """Return the rooms that ``room`` uses, also through others."""
    rooms: Set[str] = set()
    waiting = [room]
    while waiting:
        new = uses.get(waiting.pop(), set()) - rooms
        rooms |= new
        waiting += new
    return rooms


def _room(name: str, depth: int) -> str:
    """Return the folder of a module below its package, ``commands`` or ``base``."""
    package, *inner = name.split(".")
    folders = ([package] if package == "unit_tests" else []) + inner[:-1][:depth]
    return "/".join(folders) or ("commands" if inner[0] in COMMANDS else "base")


def _imported(tree: ast.Module, names: Set[str]) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = node.module + "." + alias.name
                candidates = inner, inner + ".__init__", node.module, node.module + ".__init__"
                yield from [name for name in candidates if name in names][:1]
