"""A mission file as elements with their places, and the files that it includes. The only user of lxml."""
import bisect
import contextlib
import gc
import itertools
import os
import re
from typing import Any, Callable, Dict, Iterator, List, Optional, Set, Tuple, Union

from lxml import etree

from behavior_controller.bt import rules
from behavior_controller.bt.language.markup import (ATTRIBUTE, CHARACTER, STARTS, TAG_NAME, TOKEN, MarkupFault,
                                                    diagnosis, repaired, stray_text)
from behavior_controller.bt.language.packages import package_folder
from behavior_controller.bt.rules import Rule
from behavior_controller.errors import Fault, MissionError
from behavior_controller.text import Unreadable, clean, decode, read_bytes

LARGEST = 10_000_000  # bytes of one file; a tree of 100,000 nodes takes 3 to 10 million
MOST_FILES = 500  # that one mission may include
DEEPEST_INCLUDE = 50
EXPLICIT = ("Action", "Condition", "Control", "Decorator")
_LONGEST = 300  # characters of a fault's text: names and values in it are as long as the file wants


class Element:
    """One element: its tag, attributes and child elements, and its place in the file."""

    __slots__ = ("tag", "attributes", "children", "document", "number")

    def __init__(self, tag: str, attributes: Dict[str, str], document: "Document", number: int):
        self.tag = tag
        self.attributes = attributes
        self.children: List["Element"] = []
        self.document = document
        self.number = number

    @property
    def type_id(self) -> str:
        """The node type: the tag of the compact form, the ID of the explicit one (``<Action ID="…"/>``)."""
        return self.attributes.get("ID", "") if self.tag in EXPLICIT else self.tag

    def place(self, attribute: Optional[str] = None) -> Tuple[int, int]:
        """Return line and column, from 1, of the element, or of one of its attributes if it has it."""
        return self.document.place(self.number, attribute)

    def fault(self, rule: Rule, text: str, hint: str = "", attribute: Optional[str] = None,
              is_warning: Optional[bool] = None, at: int = 0) -> Fault:
        """Return a fault at this place; its text is made one line.

        ``is_warning`` overrides the rule. ``at`` is the index of the character in the attribute's value, which matters if
        the value has several lines.
        """
        begin, end = self.document.span(self.number, attribute, at)
        return self.document.fault_between(rule, begin, end, text, hint, is_warning)


class Document:
    """One parsed file. ``root`` is its first element, which the checks want to be ``<root>``."""

    def __init__(self, file: str, text: str):
        self.file = file
        self.text = text
        self.root: Element = None  # type: ignore[assignment]
        self.faults: List[Fault] = []  # of what it includes
        self._starts: List[int] = []  # these two are made when the first place is asked for
        self._lines: List[int] = []

    def place(self, number: int, attribute: Optional[str] = None) -> Tuple[int, int]:
        """Return line and column of the element with that number in document order, or of one of its attributes."""
        return self.position(self.span(number, attribute)[0])

    def span(self, number: int, attribute: Optional[str] = None, at: int = 0) -> Tuple[int, int]:
        """Return where an attribute of an element begins and ends, as offsets; of its tag's name if it has none such.

        It begins with the character ``at`` of the value if that stands on a later line.
        """
        if not self._starts:
            self._starts = [match.start() for match in TOKEN.finditer(self.text) if match.lastgroup in STARTS]
        offset = self._starts[number]
        if attribute is not None:
            tag: Any = TOKEN.match(self.text, offset)
            for found in ATTRIBUTE.finditer(self.text, offset, tag.end()):
                if found.group(1) == attribute:
                    return self._in_value(found, at) or found.start(), found.end()
        return offset, TAG_NAME.match(self.text, offset + 1).end()  # type: ignore[union-attr]

    def _in_value(self, attribute: Any, at: int) -> int:
        """Return the offset of a character of the value if there is a line break before it, else 0."""
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
        return self.fault_between(fault.rule, fault.offset, fault.offset + 1, fault.text, fault.hint)

    def fault_between(self, rule: Rule, begin: int, end: int, text: str, hint: str = "",
                      is_warning: Optional[bool] = None) -> Fault:
        """Return a fault about the characters from ``begin`` to before ``end``."""
        return Fault(self.file, *self.position(begin), clean(text, _LONGEST), clean(hint, _LONGEST),
                     rule.is_warning if is_warning is None else is_warning, rule.code, *self.position(end))

    def stray_text(self, most: int) -> List[Fault]:
        """Return warnings of the first ``most`` texts that stand where only elements count."""
        found = itertools.islice(stray_text(self.text), most)
        return [self.fault(fault) for fault in found]


# ------------------------------------------------------------------------------------------------------------- one file


def read(path: str) -> Document:
    """Read and parse a file. Raises MissionError with the fault."""
    try:
        data = read_bytes(path, LARGEST)
    except Unreadable as error:
        raise MissionError([Fault(path, 0, 0, "the file cannot be read: {}".format(error),
                                  code=rules.UNREADABLE_FILE.code)]) from error
    return parse(data, path)


def parse(data: Union[str, bytes], file: str = "<text>") -> Document:
    """Parse text or bytes. Raises MissionError with the faults of the markup, at their places in ``data``."""
    document = Document(file, data if isinstance(data, str) else _decoded(data, file))
    text = document.text
    try:
        if not text.strip("\ufeff \t\r\n"):
            raise MarkupFault(rules.EMPTY_FILE, "the file is empty", 0,
                              "a mission begins with <root BTCPP_format=\"4\">")
        if "\x00" in text:
            raise MarkupFault(rules.NOT_TEXT, "a NUL character: the file is not UTF-8 text", text.index("\x00"),
                              "save the file as UTF-8")
        with garbage_collection_paused():
            document.root = _parsed(repaired(text), document)
    except MarkupFault as fault:
        raise MissionError([document.fault(fault)]) from fault
    except (etree.XMLSyntaxError, UnicodeError) as error:
        raise _not_well_formed(document, error) from error
    return document


def _decoded(data: bytes, file: str) -> str:
    try:
        return decode(data)
    except UnicodeDecodeError as error:
        # what comes before the first wrong byte is text, and says where it is
        before = Document(file, decode(data[:error.start], "ignore"))
        encoding = "UTF-16" if error.encoding.startswith("utf-16") else "UTF-8"
        wrong = MarkupFault(rules.NOT_TEXT, "byte 0x{:02x} is not {}".format(data[error.start], encoding),
                            len(before.text), "save the file as UTF-8")
        raise MissionError([before.fault(wrong)]) from error


@contextlib.contextmanager
def garbage_collection_paused() -> Iterator[None]:
    """Keep Python's garbage collector from scanning a growing mission, which has no garbage, again and again."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class _Target:
    """lxml's parser target: makes Elements without lxml's tree."""

    def __init__(self, start: Callable[[str, Any], None], end: Callable[[str], None],
                 close: Callable[[], Optional[Element]]):
        self.start = start
        self.end = end
        self.close = close


def _parsed(clean: str, document: Document) -> Element:
    numbers = itertools.count()
    above = Element("", {}, document, -1)
    opened: List[Element] = [above]

    # closures, because this runs for each element
    def start(tag: str, attributes: Any) -> None:
        element = Element(tag, dict(attributes), document, next(numbers))
        opened[-1].children.append(element)
        opened.append(element)

    def end(_tag: str) -> None:
        opened.pop()

    parser = etree.XMLParser(target=_Target(start, end, lambda: above.children[0] if above.children else None),
                             huge_tree=True)
    return etree.fromstring(clean.encode("utf-8"), parser)


def _not_well_formed(document: Document, error: Exception) -> MissionError:
    unknown = MarkupFault(rules.NOT_WELL_FORMED, "not well-formed XML: {}".format(error), 0)
    return MissionError([document.fault(fault) for fault in diagnosis(document.text) or [unknown]])


# ------------------------------------------------------------------------------------------------------- included files


def with_includes(document: Document) -> List[Document]:
    """Return the document after all that it includes, each file once, in the order in which their trees count.

    A failed include is a fault of the including document (``Document.faults``).
    """
    found: List[Document] = []
    _include(document, found, {os.path.realpath(document.file)}, ())
    return found


def _include(document: Document, found: List[Document], seen: Set[str], chain: Tuple[str, ...]) -> None:
    chain += (os.path.realpath(document.file),)
    for element in document.root.children if document.root.tag == "root" else ():
        if element.tag == "include":
            path = _included_path(element)
            if path is None:
                continue
            real = os.path.realpath(path)
            if real in chain:
                document.faults.append(element.fault(rules.INCLUDE_CIRCLE, "{} includes itself".format(path),
                                                     attribute="path"))
            elif real not in seen:
                seen.add(real)
                _include_file(element, path, found, seen, chain)
    found.append(document)


def _included_path(element: Element) -> Optional[str]:
    path = element.attributes.get("path", "")
    faults = element.document.faults
    if not path:
        faults.append(element.fault(rules.INCLUDE_WITHOUT_PATH, "<include> lacks the attribute path",
                                    "it is relative to this file", "path"))
    elif "ros_pkg" in element.attributes and not os.path.isabs(path):
        package = element.attributes["ros_pkg"]
        folder = package_folder(package)
        if folder is not None:
            return os.path.join(folder, path)
        faults.append(element.fault(rules.INCLUDE_PACKAGE, "no ROS package {} is found for ros_pkg".format(package),
                                    "ROS_PACKAGE_PATH says where packages are: source the workspace's setup.bash",
                                    "ros_pkg"))
    else:
        return os.path.join(os.path.dirname(element.document.file), path)
    return None


def _include_file(element: Element, path: str, found: List[Document], seen: Set[str], chain: Tuple[str, ...]) -> None:
    faults = element.document.faults
    if len(seen) > MOST_FILES + 1 or len(chain) > DEEPEST_INCLUDE:
        faults.append(element.fault(rules.TOO_LARGE, "more than {} files are included, or {} deep".format(
            MOST_FILES, DEEPEST_INCLUDE)))
        return
    try:
        included = read(path)
    except MissionError as error:
        fault = error.faults[0]
        faults.append(fault if fault.line else element.fault(
            rules.INCLUDE_UNREADABLE, "cannot include {}: {}".format(path, fault.text), attribute="path"))
        return
    _include(included, found, seen, chain)
