"""Which folder of both packages uses which, read from the sources."""
import ast
import functools
import os
from typing import Dict, Iterator, Set

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCES = ("src", "unit_tests/src")
COMMANDS = ("cli", "command", "replay_cli")
"""The modules beside the folders that use folders; the others there are the base, which all use."""


@functools.lru_cache(maxsize=None)
def imported() -> Dict[str, Set[str]]:
    """Return the modules of both packages that each of them imports, by their dotted names."""
    trees = {}
    for start in (os.path.join(ROOT, source) for source in SOURCES):
        for folder, _, files in os.walk(start):
            for path in (os.path.join(folder, file) for file in files if file.endswith(".py")):
                name = os.path.relpath(path, start)[:-len(".py")].replace(os.sep, ".")
                with open(path, encoding="utf-8") as text:
                    trees[name] = ast.parse(text.read())
    return {name: set(_imported(tree, set(trees))) for name, tree in trees.items()}


def used(depth: int = 1) -> Dict[str, Set[str]]:
    """Return the other folders that the modules of each folder import; a folder is at most ``depth``
    levels below its package."""
    uses: Dict[str, Set[str]] = {}
    for name, others in imported().items():
        uses.setdefault(_folder(name, depth), set()).update(
            _folder(other, depth) for other in others)
    return {folder: others - {folder} for folder, others in uses.items()}


def reached(uses: Dict[str, Set[str]], folder: str) -> Set[str]:
    """Return the folders, or modules, that one of them uses, also through others."""
    found: Set[str] = set()
    waiting = [folder]
    while waiting:
        new = uses.get(waiting.pop(), set()) - found
        found |= new
        waiting += new
    return found


def _folder(name: str, depth: int) -> str:
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
