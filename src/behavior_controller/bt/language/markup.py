"""The markup of a mission as people write it: repairs before lxml reads it, and the faults if lxml cannot.

BehaviorTree.CPP's reader accepts what is not XML: raw ``&&`` and ``<`` inside attributes, line breaks in attributes that
are kept, ``&`` in text. ``repaired`` makes XML of it with the same meaning, and removes what has no meaning in a mission:
comments, the declared encoding, DOCTYPE, namespaces. So no entity is ever declared or expanded.
Every pattern here is linear in the length of the file, also where it does not match.
"""
import re
from typing import Any, Iterator, List, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.rules import Rule

DEEPEST = 2_040  # nested elements; libxml2 itself stops at 2,048
MOST_TAGS = 400_000
MOST_ATTRIBUTES = 500  # of one element; libxml2 2.9 compares each with each
LONGEST_NAME = 300
LONGEST_VALUE = 100_000
MOST_FAULTS = 100

BLANKS = " \t\r\n"
_BLANK = r"[ \t\r\n]"
_TAG = r"""[^ \t\r\n/>!?"'=<:]+"""
_NAME = r"""[^ \t\r\n=/>"'<]+"""
# repetitions are bounded: that keeps the memory of Python's pattern engine bounded too
_ATTRIBUTE = r"""{0}{{1,{2}}}{1}*={1}*(?:"[^"]{{0,{3}}}"|'[^']{{0,{3}}}')""".format(
    _NAME[:-1], _BLANK, LONGEST_NAME, LONGEST_VALUE)
# pieces that lxml may read unchanged
_PLAIN_ATTRIBUTE = r"""(?!xmlns)[^ \t\r\n=/>"'<:]{{1,{0}}}="[^"&<\n\t\r]{{0,{1}}}\"""".format(LONGEST_NAME,
                                                                                              LONGEST_VALUE)
ATTRIBUTE = re.compile(r"""({0}){1}*={1}*("[^"]*"|'[^']*')""".format(_NAME, _BLANK))
TOKEN = re.compile(r"""
    <{0}{{1,{5}}}(?:{1}+{2}){{0,{4}}}{1}*(?:(?P<leaf>/>)|(?P<open>>))
  | (?P<end></[^<>]*>)
  | <(?P<tag>{0}{{1,{5}}})(?P<attributes>(?:{1}+{3}){{0,{4}}}){1}*(?P<repair>/?)>
  | (?P<blank><!--.*?--> | <!\[CDATA\[.*?\]\]> | <!DOCTYPE[^\[<>]*>)
  | (?P<instruction><\?.*?\?>)
  | (?P<text>&[^<]*|\]\]>)
  | (?P<other><)
""".format(_TAG[:-1], _BLANK, _PLAIN_ATTRIBUTE, _ATTRIBUTE, MOST_ATTRIBUTES, LONGEST_NAME), re.VERBOSE | re.DOTALL)
STARTS = ("leaf", "open", "repair")
_OUTSIDE = re.compile(r"""
    {0}+ | <!--.*?--> | <!\[CDATA\[.*?\]\]> | <!DOCTYPE[^\[<>]*> | <\?.*?\?> | (?P<wrong>.)
""".format(_BLANK), re.VERBOSE | re.DOTALL)
_RAW_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});)")
CHARACTER = re.compile(r"&(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});|\r\n|.", re.DOTALL)
"""One character of a value, as it may be written."""

_CHARACTER = re.compile(r"&#(?:(\d{1,7})|x([0-9a-fA-F]{1,6}));")
_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_PLAIN_NAME = re.compile(r"[^\W\d][\w.\-\u00b7]*")
TAG_NAME = re.compile(_TAG)
_GOOD_TAG = re.compile(
    r"""<[A-Za-z_][\w.-]*(?:[ ]+[A-Za-z_][\w.-]*="[^&"\x00-\x1f\ud800-\udfff\ufffe\uffff]*")?[ ]*/?>""")
_PERHAPS_TEXT = re.compile(r">{0}*(?:[^ \t\r\n<]|<!\[CDATA\[)".format(_BLANK))
_NEXT_ATTRIBUTE = re.compile("{0}+({1})".format(_BLANK, ATTRIBUTE.pattern))
_REST_OF_TAG = re.compile(r"""({0}*)({1})?({0}*=)?{0}*(["']?)""".format(_BLANK, _NAME))


class MarkupFault(Exception):
    """A fault of the markup, and the offset of its character."""

    def __init__(self, rule: Rule, text: str, offset: int, hint: str = ""):
        self.rule = rule
        self.text = text
        self.offset = offset
        self.hint = hint


# ------------------------------------------------------------------------------------------------------------- repairs


def repaired(text: str) -> str:
    """Return ``text`` as XML, each element on its line. Raises MarkupFault where the pieces cannot be separated."""
    if text.count("<") > MOST_TAGS:
        raise MarkupFault(rules.TOO_LARGE, "the file has more than {} tags".format(MOST_TAGS), 0,
                          "split the mission into several files")
    pieces: List[str] = []
    done = depth = end = 0
    for match in TOKEN.finditer(text):
        kind = match.lastgroup
        if kind == "end":
            depth -= 1
        elif kind == "open":
            depth += 1
        elif kind != "leaf":
            pieces += (text[done:match.start()], _repaired(match, depth))
            done = match.end()
            depth += kind == "repair" and not match.group("repair")
        if depth > DEEPEST:
            raise MarkupFault(rules.TOO_LARGE, "elements are nested deeper than {} levels".format(DEEPEST),
                              match.start(), "split the tree into SubTrees")
        if depth == 0 and not end and kind in ("end", "leaf", "repair"):
            end = match.end()
    _check_outside(text, end)
    return "".join(pieces) + text[done:]


def _repaired(match: "re.Match[str]", depth: int) -> str:
    """Return the text that lxml reads instead of a token."""
    kind, token = match.lastgroup, match.group()
    if kind == "repair":
        return _repaired_tag(match)
    if kind == "other" or (kind == "instruction" and depth > 0):
        raise _refusal(match.string, match.start())
    return "\n" * token.count("\n")


def _repaired_tag(match: "re.Match[str]") -> str:
    tag, attributes, closed = match.group("tag", "attributes", "repair")
    clean = "".join(_repaired_attribute(name, value) for name, value in ATTRIBUTE.findall(attributes))
    return "<{}{}{}{}>".format(tag, clean, "\n" * match.group().count("\n"), closed)


def _repaired_attribute(name: str, value: str) -> str:
    if ":" in name or name == "xmlns":
        return ""  # BehaviorTree.CPP ignores such names; XML treats them as namespaces
    inner = _RAW_AMPERSAND.sub("&amp;", value[1:-1]).replace("<", "&lt;").replace("\r\n", "\n").replace("\r", "\n")
    return " {}={}{}{}".format(name, value[0], inner.replace("\n", "&#10;").replace("\t", "&#9;"), value[0])


def _check_outside(text: str, end: int) -> None:
    """Refuse text before the first element and after its ``end``, except comments and similar."""
    first = next((match.start() for match in TOKEN.finditer(text) if match.lastgroup in STARTS), None)
    if first is None:
        raise MarkupFault(rules.NO_ELEMENT, "there is no element", 0, "a mission begins with <root BTCPP_format=\"4\">")
    for begin, stop in ((text.startswith("\ufeff"), first), (end or len(text), len(text))):
        for match in _OUTSIDE.finditer(text, begin, stop):
            if match.group("wrong"):
                for fault in diagnosis(text):
                    raise fault
                what = "an element" if match.group("wrong") == "<" else "text"
                raise MarkupFault(rules.OUTSIDE_ROOT, "{} {} the first element".format(
                    what, "after the end of" if begin > 1 else "before"),
                                  match.start("wrong"), "a file holds one <root> and nothing else")


def stray_text(text: str) -> Iterator[MarkupFault]:
    """Yield each text in <root> and its trees, where only elements count; a palette's texts are descriptions."""
    if not _PERHAPS_TEXT.search(text):
        return
    opened: List[str] = []
    end = 0
    for match in TOKEN.finditer(text):
        kind = match.lastgroup
        if kind == "text":
            continue
        if opened[:1] == ["root"] and opened[1:2] in ([], ["BehaviorTree"]):
            yield from _dropped(text, end, match.start())
            if match.group().startswith("<![CDATA["):
                yield from _dropped(text, match.start() + len("<![CDATA["), match.end() - len("]]>"))
        if kind == "end":
            del opened[-1:]
        elif kind == "open" or (kind == "repair" and not match.group("repair")):
            opened.append(_tag_name(match))
        end = match.end()


def _dropped(text: str, begin: int, end: int) -> Iterator[MarkupFault]:
    words = text[begin:end].strip(BLANKS)
    if words:
        yield MarkupFault(rules.STRAY_TEXT, "this text is dropped: {}".format(words), text.index(words, begin),
                          "only elements count here; a remark is written <!-- … -->")


# ------------------------------------------------------------------------------------------------------- what is wrong

_UNENDED = (
    ("<!--", rules.NOT_CLOSED, "the comment is never closed", "it ends with -->"),
    ("<![CDATA[", rules.NOT_CLOSED, "the CDATA section is never closed", "it ends with ]]>"),
    ("<!DOCTYPE", rules.DOCTYPE, "declarations inside DOCTYPE are not allowed", "a mission needs no entities"),
    ("<!", rules.STRAY_BRACKET, "<! begins nothing that a mission may hold", "a comment begins with <!--"),
    ("</", rules.NOT_CLOSED, "the closing tag is not ended with >", ""),
)


def _refusal(text: str, offset: int) -> MarkupFault:
    """Return why the ``<`` at ``offset`` does not begin a tag."""
    if text.startswith("<?", offset):
        if "?>" not in text[offset:]:
            return MarkupFault(rules.NOT_CLOSED, "the instruction <? is never closed", offset)
        return MarkupFault(rules.INSTRUCTION, "a processing instruction <?…?> is not allowed inside <root>", offset)
    for begin, rule, wrong, hint in _UNENDED:
        if text.startswith(begin, offset):
            return MarkupFault(rule, wrong, offset, hint)
    name = TAG_NAME.match(text, offset + 1)
    if name is None:
        return MarkupFault(rules.STRAY_BRACKET, "this < begins no tag", offset, "in text it is written &lt;")
    if text[name.end():name.end() + 1] == ":":
        return MarkupFault(rules.ELEMENT_NAME, "the name of an element cannot hold a colon", offset)
    return _unfinished_tag(text, offset, name.group(), name.end())


def _unfinished_tag(text: str, offset: int, tag: str, at: int) -> MarkupFault:
    """Return why the tag at ``offset``, whose name ends at ``at``, does not end where it should."""
    if len(tag) > LONGEST_NAME:
        return MarkupFault(rules.TOO_LARGE, "the name of the element is longer than {} characters".format(LONGEST_NAME),
                           offset)
    for _ in range(MOST_ATTRIBUTES):
        found = _NEXT_ATTRIBUTE.match(text, at)
        if found is None:
            return _no_attribute(text, offset, tag, at)
        name, value = found.group(2, 3)
        if "<" in value and "\n" in value:
            return MarkupFault(rules.QUOTE_NOT_CLOSED, "the value of {} has no closing quote".format(name),
                               found.start(2))
        if max(len(name) - LONGEST_NAME, len(value) - LONGEST_VALUE - 2) > 0:
            return MarkupFault(rules.TOO_LARGE, "this attribute is too long: names may have {} characters, values {}"
                               .format(LONGEST_NAME, LONGEST_VALUE), found.start(2))
        at = found.end()
    return MarkupFault(rules.TOO_LARGE, "<{}> has more than {} attributes".format(tag, MOST_ATTRIBUTES), offset)


def _no_attribute(text: str, offset: int, tag: str, at: int) -> MarkupFault:
    """Return the fault at ``at``, where the tag at ``offset`` should continue with an attribute or end."""
    rest: Any = _REST_OF_TAG.match(text, at)
    blank, name, equals, quote = rest.groups()
    at = rest.end(1)
    if name is None or name[0] in ",;.+*#&@$%()[]{}|":
        seen = text[at:at + 1]
        if seen in ("", "<"):
            return MarkupFault(rules.TAG_NOT_ENDED, "the tag <{}> is not ended with >".format(tag), offset)
        return MarkupFault(rules.STRAY_CHARACTER, "unexpected {} in the tag <{}>".format(seen, tag), at)
    if not equals:
        return MarkupFault(rules.ATTRIBUTE_VALUE, "the attribute {} has no value".format(name), at,
                           "write {}=\"…\"".format(name))
    if not quote:
        return MarkupFault(rules.ATTRIBUTE_QUOTES, "the value of {} must stand in quotes".format(name), at,
                           "write {}=\"…\"".format(name))
    if not blank:
        return MarkupFault(rules.ATTRIBUTE_BLANK, "a blank is missing before {}".format(name), at)
    return MarkupFault(rules.QUOTE_NOT_CLOSED, "the value of {} has no closing quote".format(name), at)


def diagnosis(text: str) -> List[MarkupFault]:
    """Return the likely faults for which lxml refused the repaired text, in the order of the file."""
    faults: List[MarkupFault] = []
    opened: List[Tuple[str, int]] = []
    for match in TOKEN.finditer(text):
        kind = match.lastgroup
        if kind in STARTS:
            if not _GOOD_TAG.fullmatch(match.group()):
                faults.extend(_tag_faults(match))
            if kind == "open" or (kind == "repair" and not match.group("repair")):
                opened.append((_tag_name(match), match.start()))
        elif kind == "end":
            name = match.group()[2:-1].rstrip(BLANKS)
            if not opened or opened[-1][0] != name:
                # later faults may be consequences of it
                return faults[:MOST_FAULTS] + [_mismatch(name, match.start(), opened)]
            opened.pop()
    if opened:
        faults.append(MarkupFault(rules.ELEMENT_NOT_CLOSED, "<{}> is never closed".format(opened[-1][0]),
                                  opened[-1][1]))
    if not faults:
        faults = [MarkupFault(rules.FORBIDDEN_CHARACTER, "a character that XML does not allow", match.start())
                  for match in _NOT_IN_XML.finditer(text)]
    return faults[:MOST_FAULTS]


def _tag_name(match: "re.Match[str]") -> str:
    return TAG_NAME.match(match.string, match.start() + 1).group()  # type: ignore[union-attr]


def _mismatch(name: str, offset: int, opened: List[Tuple[str, int]]) -> MarkupFault:
    if any(tag == name for tag, _ in opened):
        return MarkupFault(rules.ELEMENT_NOT_CLOSED, "<{}> is not closed before </{}>".format(opened[-1][0], name),
                           opened[-1][1])
    return MarkupFault(rules.CLOSES_NOTHING, "</{}> closes nothing".format(name), offset,
                       "</{}> is due".format(opened[-1][0]) if opened else "")


def _tag_faults(match: "re.Match[str]") -> Iterator[MarkupFault]:
    """Yield what is wrong inside one start tag."""
    if not _PLAIN_NAME.fullmatch(_tag_name(match)):
        yield MarkupFault(rules.ELEMENT_NAME, "{} cannot be the name of an element".format(_tag_name(match)),
                          match.start())
    seen = set()
    for found in ATTRIBUTE.finditer(match.string, match.start(), match.end()):
        name, value = found.groups()
        if name in seen:
            yield MarkupFault(rules.ATTRIBUTE_TWICE, "the attribute {} is given twice".format(name), found.start())
        elif not _PLAIN_NAME.fullmatch(name) and ":" not in name:
            yield MarkupFault(rules.ATTRIBUTE_NAME, "{} cannot be the name of an attribute".format(name), found.start())
        elif _NOT_IN_XML.search(value + "".join(_character(*code) for code in _CHARACTER.findall(value))):
            yield MarkupFault(rules.FORBIDDEN_CHARACTER,
                              "the value of {} holds a character that XML does not allow".format(name), found.start())
        seen.add(name)


def _character(decimal: str, hexadecimal: str) -> str:
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return chr(code) if code <= 0x10FFFF else "\x00"
