"""A mission file as elements with their places, and the files that it includes. The only user of
lxml."""
import bisect
import itertools
import os
import re
import types
from typing import Any, Dict, List, Optional, Set, Tuple, Union

from lxml import etree

from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader.xml_repair import (
    ATTRIBUTE, BEGINS, CHARACTER, MarkupFault, STARTS, TAG_NAME, TOKEN, diagnosis, remarks,
    repaired)
from behavior_controller.ros_packages import package_folder
from behavior_controller.errors import Fault, MissionError, attempt
from behavior_controller.foreign_code import described
from behavior_controller.interpreter import garbage_collection_paused
from behavior_controller.text import Unreadable, clean, decode, did_you_mean, read_bytes

LARGEST = 10_000_000  # bytes of one file; a tree of 100,000 nodes takes 3 to 10 million
MOST_FILES = 500  # that one mission may include
DEEPEST_INCLUDE = 50
AS_UTF_8 = "save the file as UTF-8"
EXPLICIT = ("Action", "Condition", "Control", "Decorator")
_LONGEST = 300  # characters of a fault's text: names and values in it are as long as the file wants


class Element:
    """One element: its tag, attributes and child elements, and its place in the file."""

    __slots__ = ("tag", "type_id", "attributes", "children", "document", "number", "last")

    def __init__(self, tag: str, attributes: Dict[str, str], document: "Document", number: int):
        self.tag = tag
        # the node type: the tag of the compact form, the ID of the explicit one (<Action ID="…"/>)
        self.type_id = tag
        if tag in EXPLICIT:
            self.type_id = attributes.get("ID", "")
        self.attributes = attributes
        self.children: List["Element"] = []
        self.document = document
        self.number = number  # in document order, from 0
        self.last = number  # the number of the last element within

    @property
    def below(self) -> List["Element"]:
        """Every element within this one, in document order."""
        return self.document.elements[self.number + 1:self.last + 1]

    def place(self, attribute: Optional[str] = None) -> Tuple[int, int]:
        """Return line and column, from 1, of the element, or of one of its attributes if it has it.
        """
        return self.document.position(self.document.span(self.number, attribute)[0])

    def where(self, attribute: Optional[str] = None) -> str:
        """Return ``file:line:column`` of that place."""
        return "{}:{}:{}".format(clean(self.document.file), *self.place(attribute))

    def fault(self, rule: rules.LintRule, text: str, hint: str = "",
              attribute: Optional[str] = None, is_warning: Optional[bool] = None,
              at: int = 0) -> Fault:
        """Return a fault at this place; its text is made one line.

        ``is_warning`` overrides the rule. ``at`` is the index of the character in the attribute's
        value, which matters if the value has several lines.
        """
        span = self.document.span(self.number, attribute, at)
        return self.document.fault_between(rule, *span, text, hint, is_warning)

    def broken(self, type_id: str, step: str, error: BaseException, owner: object) -> Fault:
        """Return the fault of a node whose code failed before any tick; ``step`` is what cannot be
        done with the node, ``owner`` its class or factory. Raises a Ctrl-C."""
        text = f"{type_id} cannot be {step}: {described(error, owner)}"
        hint = "a mistake in the code of the node type, not in this file"
        return self.fault(rules.NODE_BROKEN, text, hint)


class Document:
    """One parsed file. ``root`` is its first element, which the checks want to be ``<root>``."""

    def __init__(self, file: str, text: str):
        self.file, self.text = file, text
        self.root: Element = None  # type: ignore[assignment]
        self.elements: List[Element] = []  # in document order
        self.faults: List[Fault] = []  # of what it includes
        self._starts: List[int] = []  # these two are made when the first place is asked for
        self._lines: List[int] = []

    def span(self, number: int, attribute: Optional[str] = None, at: int = 0) -> Tuple[int, int]:
        """Return where an attribute of an element begins and ends, as offsets; of its tag's name if
        it has none such.

        It begins with the character ``at`` of the value if that stands on a later line.
        """
        if not self._starts:
            self._starts = [
                match.start() for match in TOKEN.finditer(self.text) if match.lastgroup in STARTS]
        offset = self._starts[number]
        if attribute is not None:
            tag: Any = TOKEN.match(self.text, offset)
            for match in ATTRIBUTE.finditer(self.text, offset, tag.end()):
                if match.group(1) == attribute:
                    return self._in_value(match, at) or match.start(), match.end()
        return offset, TAG_NAME.match(self.text, offset + 1).end()  # type: ignore[union-attr]

    def _in_value(self, attribute: Any, at: int) -> int:
        """Return the offset of a character of the value if there is a line break before it, else 0.
        """
        begin, end = attribute.start(2) + 1, attribute.end(2) - 1
        pieces = itertools.islice(CHARACTER.finditer(self.text, begin, end), at, None)
        offset = next((piece.start() for piece in pieces), end)
        return offset if self.position(offset)[0] > self.position(begin)[0] else 0

    def position(self, offset: int) -> Tuple[int, int]:
        """Return line and column, from 1, of a character of the file."""
        if not self._lines:
            self._lines = [0] + [match.end() for match in re.finditer("\r\n?|\n", self.text)]
        line = bisect.bisect_right(self._lines, offset)
        return line, offset - self._lines[line - 1] + 1

    def fault(self, fault: MarkupFault) -> Fault:
        """Return a fault of the markup with its place."""
        end = fault.offset + 1
        return self.fault_between(fault.rule, fault.offset, end, fault.text, fault.hint)

    def fault_between(self, rule: rules.LintRule, begin: int, end: int, text: str, hint: str = "",
                      is_warning: Optional[bool] = None) -> Fault:
        """Return a fault about the characters from ``begin`` to before ``end``."""
        text, hint = clean(text, _LONGEST), clean(hint, _LONGEST)
        if is_warning is None:
            is_warning = rule.is_warning
        place, after = self.position(begin), self.position(end)
        return Fault(self.file, *place, text, hint, is_warning, rule.code, *after)

    def refused(self, first: MarkupFault) -> MissionError:
        """Return the error with all faults of the markup, given the one that was met first."""
        faults = [first]
        if first.rule not in (rules.TOO_LARGE, rules.EMPTY_FILE, rules.NO_ELEMENT, rules.NOT_TEXT):
            faults = diagnosis(self.text) or faults
        return MissionError([self.fault(fault)._replace(is_warning=False) for fault in faults])

    def remarks(self, most: int) -> List[Fault]:
        """Return the first ``most`` warnings of comments inside comments, and of texts that stand
        where only elements count."""
        return list(map(self.fault, itertools.islice(remarks(self.text), most)))


# ----------------------------------------------------------------------------------------- one file


def read(path: str) -> Document:
    """Read and parse a file. Raises MissionError with the fault."""
    try:
        data = read_bytes(path, LARGEST)
    except Unreadable as error:
        text, code = f"the file cannot be read: {error}", rules.UNREADABLE_FILE.code
        raise MissionError([Fault(path, 0, 0, text, code=code)]) from error
    return parse(data, path)


def parse(data: Union[str, bytes], file: str = "<text>") -> Document:
    """Parse text or bytes. Raises MissionError with the faults of the markup, at their places in
    ``data``."""
    document = Document(file, data if isinstance(data, str) else _decoded(data, file))
    text = document.text
    try:
        if not text.strip("\ufeff \t\r\n"):
            raise MarkupFault(rules.EMPTY_FILE, "the file is empty", 0, BEGINS)
        if "\x00" in text:
            wrong = "a NUL character: the file is not UTF-8 text"
            raise MarkupFault(rules.NOT_TEXT, wrong, text.index("\x00"), AS_UTF_8)
        with garbage_collection_paused():
            document.root = _parsed(repaired(text), document)
    except MarkupFault as fault:
        raise document.refused(fault) from fault
    except (etree.XMLSyntaxError, UnicodeError) as error:
        unknown = MarkupFault(rules.NOT_WELL_FORMED, f"not well-formed XML: {error}", 0)
        raise document.refused(unknown) from error
    return document


def _decoded(data: bytes, file: str) -> str:
    try:
        return decode(data)
    except UnicodeDecodeError as error:
        # what comes before the first wrong byte is text, and says where it is
        before = Document(file, decode(data[:error.start], "ignore"))
        encoding = "UTF-16" if error.encoding.startswith("utf-16") else "UTF-8"
        wrong = f"byte 0x{data[error.start]:02x} is not {encoding}"
        fault = MarkupFault(rules.NOT_TEXT, wrong, len(before.text), AS_UTF_8)
        raise MissionError([before.fault(fault)]) from error


def _parsed(clean: str, document: Document) -> Element:
    elements, above = document.elements, Element("", {}, document, -1)
    opened: List[Element] = [above]

    # closures, because this runs for each element
    def start(tag: str, attributes: Any) -> None:
        element = Element(tag, dict(attributes), document, len(elements))
        elements.append(element)
        opened[-1].children.append(element)
        opened.append(element)

    def end(_tag: str) -> None:
        opened.pop().last = len(elements) - 1

    target = types.SimpleNamespace(
        start=start, end=end, close=lambda: above.children[0] if above.children else None)
    return etree.fromstring(clean.encode("utf-8"), etree.XMLParser(target=target, huge_tree=True))


# ----------------------------------------------------------------------------------- included files


def with_includes(document: Document) -> List[Document]:
    """Return the document after all that it includes, each file once, in the order in which their
    trees count.

    A failed include is a fault of the including document (``Document.faults``).
    """
    documents: List[Document] = []
    _include(document, documents, {os.path.realpath(document.file)}, ())
    return documents


def _include(document: Document, documents: List[Document], seen: Set[str],
             chain: Tuple[str, ...]) -> None:
    chain += (os.path.realpath(document.file),)
    root = document.root
    for element in root.children:
        if root.tag == "root" and element.tag == "include":
            included = attempt(lambda: _included(element, seen, chain), document.faults)
            if included is not None:
                _include(included, documents, seen, chain)
    documents.append(document)


def included_path(element: Element) -> str:
    """Return the path of the file that an <include> names. Raises MissionError."""
    path, package = element.attributes.get("path", ""), element.attributes.get("ros_pkg")
    folder: Optional[str] = os.path.dirname(element.document.file)
    if not path:
        text, hint = "<include> lacks the attribute path", "it is relative to this file"
        raise MissionError([element.fault(rules.INCLUDE_WITHOUT_PATH, text, hint, "path")])
    if package is not None and not os.path.isabs(path):
        folder = package_folder(package)
    if folder is None:
        text = f"no ROS package {package} is found for ros_pkg"
        hint = "ROS_PACKAGE_PATH says where packages are: source the workspace's setup.bash"
        raise MissionError([element.fault(rules.INCLUDE_PACKAGE, text, hint, "ros_pkg")])
    return os.path.join(folder, path)


def _included(element: Element, seen: Set[str], chain: Tuple[str, ...]) -> Optional[Document]:
    """Return the document that an <include> names, or None if it was read before. Raises
    MissionError."""
    path = included_path(element)
    real = os.path.realpath(path)
    if real in chain:
        way = [os.path.basename(file) for file in chain[chain.index(real):] + (real,)]
        text = f"{path} includes itself: {' > '.join(way)}"
        raise MissionError([element.fault(rules.INCLUDE_CIRCLE, text, attribute="path")])
    if real in seen:
        return None
    seen.add(real)
    if len(seen) > MOST_FILES + 1 or len(chain) > DEEPEST_INCLUDE:
        text = f"more than {MOST_FILES} files are included, or {DEEPEST_INCLUDE} deep"
        raise MissionError([element.fault(rules.TOO_LARGE, text)])
    try:
        return read(path)
    except MissionError as error:
        if error.faults[0].line:
            raise
        text, hint = f"cannot include {path}: {error.faults[0].text}", _file_meant(path)
        raise MissionError([element.fault(rules.INCLUDE_UNREADABLE, text, hint, "path")]) from error


def _file_meant(path: str) -> str:
    """Return ``did you mean …?`` if a file beside ``path`` has nearly its name."""
    folder, name = os.path.split(path)
    try:
        beside = sorted(os.listdir(folder or "."))
    except OSError:
        return ""
    return did_you_mean(name, [other for other in beside if other.endswith((".xml", ".btproj"))])
