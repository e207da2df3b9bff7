"""Whether an entry holds a text or a number, as far as the scripts and the texts of the file tell.
"""
from typing import Collection, Dict, Iterator, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.linter.dataflow import Flow, Key, EntryPlace, Use
from behavior_controller.bt.possible_results import SUCCEEDS
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.registry import Registry
from behavior_controller.bt.script.operators import ScriptError, leading_number
from behavior_controller.bt.script.parser import Assignment, Operand
from behavior_controller.bt.script.values import GENERIC, TEXT, TYPES

NUMERAL = "numeral"
"""The kind of a text that is a number to a comparison, though not to a calculation."""

SOME_TEXT = "some text"
"""The kind of a text that only the running mission knows."""


class Write(NamedTuple):
    """A value of known text that is written to an entry: by a script (``use`` and ``assignment``),
    or as a text."""

    element: Element
    kind: str  # text, number, NUMERAL; empty: not known
    word: str
    use: Optional[Use] = None
    assignment: Optional[Assignment] = None

    @property
    def is_own(self) -> bool:
        """Whether it is calculated from the entry itself, and so has the kind that this has."""
        return self.assignment is not None and self.assignment.is_own


class Kinds:
    """The kinds of entries that only scripts and texts write. ``given`` are entries that come from
    elsewhere, and enums."""

    def __init__(self, flow: Flow, given: Collection[str], registry: Registry):
        self._flow = flow
        self._registry = registry
        self._writes: Dict[Key, List[Write]] = {}
        for key, write in self._all():
            self._writes.setdefault(flow.first(key), []).append(write)
        self._touched = {flow.first(key) for key in flow.touched}
        for key in list(self._writes):
            if key in self._touched or key[1] in given:
                del self._writes[key]
            else:
                self._writes[key].sort(key=lambda write: (write.element.document.file,
                                                          write.element.number))
        self._types = {flow.first(key): types for key, types in flow.types.items()}

    def _all(self) -> Iterator[Tuple[Key, Write]]:
        for use in self._flow.scripts:
            for assignment in use.script.facts.assignments:
                if assignment.sign in (":=", "="):
                    value = assignment.value
                    write = Write(use.element, literal_kind(value), value.word, use, assignment)
                    yield self._flow.key(use.tree, assignment.name), write
        for tree, name, element, attribute in self._flow.texts:
            text = element.attributes.get(attribute, "")
            yield self._flow.key(tree, name), Write(element, _kind_of_text(text), text)

    def writes(self, tree: str, name: str) -> List[Write]:
        """Return the values that are written to an entry, in the order of the files; empty if it is
        written otherwise too."""
        return self._writes.get(self._flow.first(self._flow.key(tree, name)), [])

    def all(self) -> Iterator[List[Write]]:
        """Yield the values of each entry."""
        return iter(self._writes.values())

    def of(self, tree: str, name: str) -> str:
        """Return the kind of what an entry holds."""
        key = self._flow.first(self._flow.key(tree, name))
        if key in self._touched and self._types.get(key) == {TEXT}:
            return SOME_TEXT
        kinds = {write.kind for write in self.writes(tree, name) if not write.is_own}
        return kinds.pop() if len(kinds) == 1 else ""

    def is_number(self, tree: str, name: str) -> bool:
        """Return whether an entry holds a number, also by the type of the ports that refer to it.
        """
        types = self._types.get(self._flow.first(self._flow.key(tree, name)), set()) - set(GENERIC)
        numeric = {type_name for type_name in types if TYPES[type_name].number is not None}
        return self.of(tree, name) == "number" or bool(types) and types == numeric

    def emptied(self, place: EntryPlace) -> bool:
        """Return whether a text is written to an entry that a script before it has made, which
        knows no conversion."""
        types = self._types.get(self._flow.first(self._flow.key(place.tree, place.name)), set())
        return types <= set(GENERIC) and any(
            write.use is not None and write.assignment is not None and write.assignment.sign == ":="
            and self.is_before(write.element, place.element)
            for write in self.writes(place.tree, place.name))

    def is_before(self, one: Element, other: Element) -> bool:
        """Return whether a Sequence ticks ``one`` before ``other``."""
        if one.document is not other.document or one.last >= other.number:
            return False
        trees = [tree for tree in one.document.root.children if tree.number < one.number
                 and other.number <= tree.last]
        around = trees[0] if trees else None
        while around is not None:
            inner = next((child for child in around.children if child.number <= one.number
                          and other.number <= child.last), None)
            if inner is None:
                break
            around = inner
        spec = None if around is None else self._registry.find(around.type_id)
        return spec is not None and spec.next_after == SUCCEEDS


def literal_kind(value: Operand) -> str:
    """Return the kind of an operand of a script, if that is a literal."""
    if value.kind == "text":
        return _kind_of_text(value.word[1:-1]) if value.word else ""
    return value.kind if value.kind == "number" else ""


def _kind_of_text(text: str) -> str:
    if text in ("true", "false"):
        return NUMERAL
    try:
        leading_number(text)
    except ScriptError:
        return "text"
    return NUMERAL
