"""A mission file as elements that know where they stand. The only user of lxml.

Groot2 users write by hand what is not XML, and BehaviorTree.CPP's reader takes it: raw ``&&`` and ``<`` inside attributes,
line breaks in attributes that are kept. A first pass escapes those, and blanks out what has no meaning in a mission
(comments, DOCTYPE with its entities, the encoding declaration), before lxml judges whether the rest is well formed.
"""
import bisect
import os
import re
from typing import Any, Dict, List, Optional, Sequence, Tuple

from lxml import etree

from behavior_controller.errors import Fault, MissionError

LARGEST = 20_000_000  # bytes; a tree of 100,000 nodes takes 3 million
DEEPEST = 2_040  # nested elements; libxml2 itself stops at 2,048

_MARKUP = re.compile(r"""
    (?P<blank><!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?xml\s.*?\?>|<!DOCTYPE[^\[>]*(?:\[.*?\]\s*)?>)
  | <(?P<start>[^\s/>!?"'=<]+)(?P<attributes>(?:\s*[^\s=/>"'<]+\s*=\s*(?:"[^"]*"|'[^']*'))*)\s*(?P<closed>/?)>
  | (?P<end></[^<>]*>)
  | (?P<instruction><\?)
""", re.VERBOSE | re.DOTALL)
_ATTRIBUTE = re.compile(r"""([^\s=/>"'<]+)\s*=\s*("[^"]*"|'[^']*')""", re.DOTALL)
_NOT_PLAIN = re.compile(r"[&<\n\t\r:]")
_RAW_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|\#\d{1,7}|\#x[0-9a-fA-F]{1,6});)")


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
        """Return line and column of the element, or of one of its attributes."""
        return self.document.place(self.number, attribute)

    def fault(self, text: str, hint: str = "", attribute: Optional[str] = None, is_warning: bool = False) -> Fault:
        """Return a fault at this place."""
        line, column = self.place(attribute)
        return Fault(self.document.file, line, column, text, hint, is_warning)


EXPLICIT = ("Action", "Condition", "Control", "Decorator")


class Document:
    """One parsed file. ``root`` is its ``<root>`` element."""

    def __init__(self, file: str, text: str):
        self.file = file
        self.text = text
        self.root: Element = None  # type: ignore[assignment]
        self._starts: List[int] = []
        self._lines: List[int] = []

    def place(self, number: int, attribute: Optional[str] = None) -> Tuple[int, int]:
        """Return line and column, from 1, of the element with that number in document order."""
        offset = self._starts[number]
        if attribute is not None:
            match = _MARKUP.match(self.text, offset)
            for found in _ATTRIBUTE.finditer(self.text, offset + len(match.group("start")) + 1, match.end()):
                if found.group(1) == attribute:
                    offset = found.start()
                    break
        return self.position(offset)

    def position(self, offset: int) -> Tuple[int, int]:
        """Return line and column, from 1, of a character of the file."""
        if not self._lines:
            self._lines = [0] + [match.end() for match in re.finditer("\n", self.text)]
        line = bisect.bisect_right(self._lines, offset)
        return line, offset - self._lines[line - 1] + 1


def read(path: str) -> Document:
    """Read and parse a file. Raises MissionError with the fault."""
    try:
        size = os.path.getsize(path)
        if size > LARGEST:
            raise _error(path, "the file is too large: {} bytes; at most {} are read".format(size, LARGEST))
        with open(path, "rb") as file:
            data = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        raise _error(path, "the file cannot be read: {}".format(getattr(error, "strerror", None) or error)) from error
    return parse(data, path)


def parse(data: Any, file: str = "<text>") -> Document:
    """Parse text or bytes. Raises MissionError with the first fault of the XML, at its place in ``data``."""
    document = Document(file, data if isinstance(data, str) else _decoded(data, file))
    if not document.text.strip("\ufeff \t\r\n"):
        raise _error(file, "the file is empty", hint="a mission begins with <root BTCPP_format=\"4\">")
    cleaned, edits = _clean(document)
    parser = etree.XMLParser(target=_Builder(document), huge_tree=True, no_network=True)
    try:
        document.root = etree.fromstring(cleaned.encode("utf-8", "surrogatepass"), parser)
    except etree.XMLSyntaxError as error:
        raise _syntax_error(document, error, cleaned, edits) from error
    except UnicodeError as error:
        raise _error(file, "the file is not text: {}".format(error)) from error
    return document


def _error(file: str, text: str, line: int = 0, column: int = 0, hint: str = "") -> MissionError:
    return MissionError([Fault(file, line, column, text, hint)])


def _decoded(data: bytes, file: str) -> str:
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - (data.rfind(b"\n", 0, error.start) + 1) + 1
        raise _error(file, "byte 0x{:02x} is not valid {}".format(data[error.start], encoding[:6].upper()), line, column,
                     "save the file as UTF-8") from error


def _clean(document: Document) -> Tuple[str, List[Tuple[int, int]]]:
    """Return text for lxml, and for each copied piece (its offset there, its offset in the file)."""
    text = document.text
    pieces: List[str] = []
    edits: List[Tuple[int, int]] = []
    size = done = depth = 0

    def emit(piece: str, offset: int) -> None:
        nonlocal size
        pieces.append(piece)
        edits.append((size, offset))
        size += len(piece)

    if text[:1] == "\ufeff":
        done = 1
    for match in _MARKUP.finditer(text):
        if match.group("start") is not None:
            document._starts.append(match.start())
            if ":" in match.group("start"):
                raise _error(document.file, "the element name {} contains ':'".format(match.group("start")),
                             *document.position(match.start()))
            depth += not match.group("closed")
            if depth > DEEPEST:
                raise _error(document.file, "elements are nested deeper than {} levels".format(DEEPEST),
                             *document.position(match.start()), hint="split the tree into SubTrees")
            if _NOT_PLAIN.search(match.group("attributes")):
                emit(text[done:match.start("attributes")], done)
                emit(_ATTRIBUTE.sub(_escaped, match.group("attributes")), match.start("attributes"))
                done = match.end("attributes")
        elif match.group("end") is not None:
            depth -= 1
        elif match.group("blank") is not None:
            emit(text[done:match.start()], done)
            emit(re.sub(r"[^\n]", " ", match.group()), match.start())
            done = match.end()
        elif depth > 0:
            raise _error(document.file, "a processing instruction <?…?> is not allowed inside <root>",
                         *document.position(match.start()))
    emit(text[done:].rstrip(), done)
    return "".join(pieces).lstrip(), _shifted(edits, "".join(pieces))


def _shifted(edits: List[Tuple[int, int]], text: str) -> List[Tuple[int, int]]:
    blanks = len(text) - len(text.lstrip())
    return [(max(clean - blanks, 0), original + max(blanks - clean, 0)) for clean, original in edits]


def _escaped(match: "re.Match[str]") -> str:
    name, value = match.group(1), match.group(2)
    if ":" in name:  # such attributes mean nothing in a mission, and their prefix need not be declared
        return " " * len(match.group())
    inner = _RAW_AMPERSAND.sub("&amp;", value[1:-1]).replace("<", "&lt;")
    inner = inner.replace("\r\n", "\n").replace("\n", "&#10;").replace("\t", "&#9;").replace("\r", "&#13;")
    return "{}={}{}{}".format(name, value[0], inner, value[0])


class _Builder:
    """lxml's parser target: makes Elements without a tree of lxml's own."""

    def __init__(self, document: Document):
        self._document = document
        self._open: List[Element] = []
        self._count = 0
        self._root: Optional[Element] = None

    def start(self, tag: str, attributes: Any) -> None:
        element = Element(tag, dict(attributes), self._document, self._count)
        self._count += 1
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def end(self, _tag: str) -> None:
        self._open.pop()

    def data(self, _text: str) -> None:
        """Text means nothing in a mission."""

    def close(self) -> Optional[Element]:
        return self._root


def _syntax_error(document: Document, error: Any, cleaned: str, edits: Sequence[Tuple[int, int]]) -> MissionError:
    line, column = error.position if error.position and error.position[0] else (1, 1)
    offset = 0
    for _ in range(line - 1):
        offset = cleaned.find("\n", offset) + 1
    offset += max(column - 1, 0)
    index = max(bisect.bisect_right([clean for clean, _ in edits], offset) - 1, 0)
    clean, original = edits[index]
    place = document.position(min(original + offset - clean, len(document.text)))
    message = re.sub(r", line \d+, column \d+.*|\bline \d+ ", "", error.msg or "").strip()
    return _error(document.file, "not well-formed XML: {}".format(message), *place)
