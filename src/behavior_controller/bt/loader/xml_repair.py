"""The markup of a mission as people write it: repairs before lxml reads it, and the faults if lxml
cannot.

BehaviorTree.CPP's reader accepts what is not XML: raw ``&&`` and ``<`` inside attributes, line
breaks in attributes that are kept, ``&`` in text. ``repaired`` makes XML of it with the same
meaning, and removes what has no meaning in a mission: comments, the declared encoding, DOCTYPE,
namespaces. So no entity is ever declared or expanded. Every pattern here is linear in the length of
the file, also where it does not match.
"""
import re
from itertools import starmap
from typing import Any, Iterator, List, Tuple

from behavior_controller.bt.loader import rules

MAX_ELEMENT_DEPTH = 2_040  # nested elements; libxml2 itself stops at 2,048
MOST_TAGS = 400_000
MOST_ATTRIBUTES = 500  # of one element; libxml2 2.9 compares each with each
LONGEST_NAME = 300
LONGEST_ATTRIBUTE = 100_000
MOST_MARKUP_FAULTS = 100
BEGINS = 'a mission begins with <root BTCPP_format="4">'

_BLANKS = " \t\r\n"
_BLANK = r"[ \t\r\n]"
_TAG = r"""[^ \t\r\n/>!?"'=<:]+"""
_NAME = r"""[^ \t\r\n=/>"'<]+"""
# repetitions are bounded: that keeps the memory of Python's pattern engine bounded too
_ATTRIBUTE = r"""{0}{{1,{2}}}{1}*={1}*(?:"[^"]{{0,{3}}}"|'[^']{{0,{3}}}')""".format(
    _NAME[:-1], _BLANK, LONGEST_NAME, LONGEST_ATTRIBUTE)
# pieces that lxml may read unchanged
_PLAIN_ATTRIBUTE = r"""(?!xmlns)[^ \t\r\n=/>"'<:]{{1,{0}}}="[^"&<\n\t\r]{{0,{1}}}\"""".format(
    LONGEST_NAME, LONGEST_ATTRIBUTE)
ATTRIBUTE = re.compile(rf"""({_NAME}){_BLANK}*={_BLANK}*("[^"]*"|'[^']*')""")
TOKEN = re.compile(
    r"""
    <{0}{{1,{5}}}(?:{1}+{2}){{0,{4}}}{1}*(?:(?P<leaf>/>)|(?P<open>>))
  | (?P<end></[^<>]*>)
  | <(?P<tag>{0}{{1,{5}}})(?P<attributes>(?:{1}+{3}){{0,{4}}}){1}*(?P<repair>/?)>
  | (?P<blank><!--.*?--> | <!\[CDATA\[.*?\]\]> | <!DOCTYPE[^\[<>]*>)
  | (?P<instruction><\?.*?\?>)
  | (?P<text>&[^<]*|\]\]>)
  | (?P<other><)
""".format(_TAG[:-1], _BLANK, _PLAIN_ATTRIBUTE, _ATTRIBUTE, MOST_ATTRIBUTES, LONGEST_NAME),
    re.VERBOSE | re.DOTALL)
STARTS = ("leaf", "open", "repair")
_OUTSIDE = re.compile(rf"""
    {_BLANK}+ | <!--.*?--> | <!\[CDATA\[.*?\]\]> | <!DOCTYPE[^\[<>]*> | <\?.*?\?> | (?P<wrong>.)
""", re.VERBOSE | re.DOTALL)
_RAW_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});)")
CHARACTER = re.compile(r"&(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});|\r\n|.", re.DOTALL)
"""One character of a value, as it may be written."""

_CHARACTER = re.compile(r"&#(?:(\d{1,7})|x([0-9a-fA-F]{1,6}));")
_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_PLAIN_NAME = re.compile(r"[^\W\d][\w.\-\u00b7]*")
TAG_NAME = re.compile(_TAG)
_GOOD_TAG = re.compile(r"<[A-Za-z_][\w.-]*(?:[ ]+[A-Za-z_][\w.-]*="
                       r'"[^&"\x00-\x1f\ud800-\udfff\ufffe\uffff]*")?[ ]*/?>')
_PERHAPS_TEXT = re.compile(rf">{_BLANK}*(?:[^ \t\r\n<]|<!\[CDATA\[)")
_NEXT_ATTRIBUTE = re.compile(f"{_BLANK}+({ATTRIBUTE.pattern})")
_NO_END = re.compile(f"{_BLANK}*(?:<|$)")
_REST_OF_TAG = re.compile(rf"""({_BLANK}*)({_NAME})?({_BLANK}*=)?{_BLANK}*(["']?)""")


class MarkupFault(Exception):
    """A fault of the markup, and the offset of its character."""

    def __init__(self, rule: rules.LintRule, text: str, offset: int, hint: str = ""):
        self.rule = rule
        self.text = text
        self.offset = offset
        self.hint = hint


# ------------------------------------------------------------------------------------------ repairs


def repaired(text: str) -> str:
    """Return ``text`` as XML, each element on its line. Raises MarkupFault where the pieces cannot
    be separated."""
    if text.count("<") > MOST_TAGS:
        wrong = f"the file has more than {MOST_TAGS} tags"
        raise MarkupFault(rules.TOO_LARGE, wrong, 0, "split the mission into several files")
    pieces: List[str] = []
    done = depth = end = 0
    first = None  # where the first element begins
    for match in TOKEN.finditer(text):
        kind = match.lastgroup
        if first is None and kind in STARTS:
            first = match.start()
        if kind == "end":
            depth -= 1
        elif kind == "open":
            depth += 1
        elif kind != "leaf":
            pieces += (text[done:match.start()], _repaired(match, depth))
            done = match.end()
            if kind == "repair" and not match.group("repair"):
                depth += 1
        if depth > MAX_ELEMENT_DEPTH:
            wrong = f"elements are nested deeper than {MAX_ELEMENT_DEPTH} levels"
            hint = "split the tree into SubTrees"
            raise MarkupFault(rules.TOO_LARGE, wrong, match.start(), hint)
        if depth == 0 and not end and kind in ("end", "leaf", "repair"):
            end = match.end()
    if first is None:
        raise MarkupFault(rules.NO_ELEMENT, "there is no element", 0, BEGINS)
    _check_outside(text, first, end)
    return "".join(pieces) + text[done:]


def _repaired(match: "re.Match[str]", depth: int) -> str:
    """Return the text that lxml reads instead of a token."""
    kind, token = match.lastgroup, match.group()
    if kind == "repair":
        tag, attributes, closed = match.group("tag", "attributes", "repair")
        clean = "".join(_repaired_attribute(*pair) for pair in ATTRIBUTE.findall(attributes))
        return "<{}{}{}{}>".format(tag, clean, "\n" * token.count("\n"), closed)
    if kind == "other" or (kind == "instruction" and depth > 0):
        raise _refusal(match.string, match.start())
    return "\n" * token.count("\n")


def _repaired_attribute(name: str, value: str) -> str:
    if ":" in name or name == "xmlns":
        return ""  # BehaviorTree.CPP ignores such names; XML treats them as namespaces
    quote, inner = value[0], _RAW_AMPERSAND.sub("&amp;", value[1:-1]).replace("<", "&lt;")
    inner = inner.replace("\r\n", "\n").replace("\r", "\n")
    inner = inner.replace("\n", "&#10;").replace("\t", "&#9;")
    return f" {name}={quote}{inner}{quote}"


def _check_outside(text: str, first: int, end: int) -> None:
    """Refuse text before the ``first`` element and after its ``end``, except comments and similar.
    """
    begin = len("\ufeff") if text.startswith("\ufeff") else 0
    outside = (("before", begin, first), ("after the end of", end or len(text), len(text)))
    for where, begin, stop in outside:
        for match in _OUTSIDE.finditer(text, begin, stop):
            if match.group("wrong"):
                what = "an element" if match.group("wrong") == "<" else "text"
                wrong = f"{what} {where} the first element"
                hint = "a file holds one <root> and nothing else"
                fault = MarkupFault(rules.OUTSIDE_ROOT, wrong, match.start(), hint)
                raise (diagnosis(text) or [fault])[0]


def stray_text(text: str) -> Iterator[MarkupFault]:
    """Yield each text in <root> and its trees, where only elements count; a palette's texts are
    descriptions."""
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
                content = match.start() + len("<![CDATA["), match.end() - len("]]>")
                yield from _dropped(text, *content)
        if kind == "end":
            del opened[-1:]
        elif _is_open(match):
            opened.append(_tag_name(match))
        end = match.end()


def _dropped(text: str, begin: int, end: int) -> Iterator[MarkupFault]:
    words = text[begin:end].strip(_BLANKS)
    if words:
        hint = "only elements count here; a remark is written <!-- … -->"
        offset = text.index(words, begin)
        yield MarkupFault(rules.STRAY_TEXT, f"this text is dropped: {words}", offset, hint)


# ------------------------------------------------------------------------------------ what is wrong

_UNENDED = (
    ("<!--", rules.NOT_CLOSED, "the comment is never closed", "it ends with -->"),
    ("<![CDATA[", rules.NOT_CLOSED, "the CDATA section is never closed", "it ends with ]]>"),
    ("<!DOCTYPE", rules.DOCTYPE, "declarations inside DOCTYPE are not allowed",
     "a mission needs no entities"),
    ("<!", rules.STRAY_BRACKET, "<! begins nothing that a mission may hold",
     "a comment begins with <!--"),
    ("</", rules.NOT_CLOSED, "the closing tag is not ended with >", ""),
)


def _refusal(text: str, offset: int) -> MarkupFault:
    """Return why the ``<`` at ``offset`` does not begin a tag."""
    if text.startswith("<?", offset):
        if "?>" not in text[offset:]:
            return MarkupFault(rules.NOT_CLOSED, "the instruction <? is never closed", offset)
        wrong = "a processing instruction <?…?> is not allowed inside <root>"
        return MarkupFault(rules.INSTRUCTION, wrong, offset)
    for begin, rule, wrong, hint in _UNENDED:
        if text.startswith(begin, offset):
            return MarkupFault(rule, wrong, offset, hint)
    name = TAG_NAME.match(text, offset + 1)
    if name is None:
        wrong, hint = "this < begins no tag", "in text it is written &lt;"
        return MarkupFault(rules.STRAY_BRACKET, wrong, offset, hint)
    if text[name.end():name.end() + 1] == ":":
        return MarkupFault(rules.ELEMENT_NAME, "the name of an element cannot hold a colon", offset)
    return _unfinished_tag(text, offset, name.group(), name.end())


def _unfinished_tag(text: str, offset: int, tag: str, at: int) -> MarkupFault:
    """Return why the tag at ``offset``, whose name ends at ``at``, does not end where it should."""
    if len(tag) > LONGEST_NAME:
        wrong = f"the name of the element is longer than {LONGEST_NAME} characters"
        return MarkupFault(rules.TOO_LARGE, wrong, offset)
    for _ in range(MOST_ATTRIBUTES):
        attribute = _NEXT_ATTRIBUTE.match(text, at)
        if attribute is None:
            return _no_attribute(text, offset, tag, at)
        name, value = attribute.group(2, 3)
        if "<" in value and "\n" in value:
            wrong = f"the value of {name} has no closing quote"
            return MarkupFault(rules.QUOTE_NOT_CLOSED, wrong, attribute.start(2))
        if len(name) > LONGEST_NAME or len(value) > LONGEST_ATTRIBUTE + 2:
            allowed = f"names may have {LONGEST_NAME} characters, values {LONGEST_ATTRIBUTE}"
            wrong = f"this attribute is too long: {allowed}"
            return MarkupFault(rules.TOO_LARGE, wrong, attribute.start(2))
        at = attribute.end()
    wrong = f"<{tag}> has more than {MOST_ATTRIBUTES} attributes"
    return MarkupFault(rules.TOO_LARGE, wrong, offset)


def _no_attribute(text: str, offset: int, tag: str, at: int) -> MarkupFault:
    """Return the fault at ``at``, where the tag at ``offset`` should continue with an attribute or
    end."""
    rest: Any = _REST_OF_TAG.match(text, at)
    blank, name, equals, quote = rest.groups()
    at = rest.end(1)
    if name is None or name[0] in ",;.+*#&@$%()[]{}|":
        seen = text[at:at + 1]
        if seen in ("", "<") or (seen == "/" and _NO_END.match(text, at + 1)):
            hint = "write /> in place of /" if seen == "/" else ""
            wrong = f"the tag <{tag}> is not ended with >"
            return MarkupFault(rules.TAG_NOT_ENDED, wrong, offset, hint)
        return MarkupFault(rules.STRAY_CHARACTER, f"unexpected {seen} in the tag <{tag}>", at)
    hint = f"write {name}=\"…\""
    if not equals:
        return MarkupFault(rules.ATTRIBUTE_VALUE, f"the attribute {name} has no value", at, hint)
    if not quote:
        wrong = f"the value of {name} must stand in quotes"
        return MarkupFault(rules.ATTRIBUTE_QUOTES, wrong, at, hint)
    if not blank:
        return MarkupFault(rules.ATTRIBUTE_BLANK, f"a blank is missing before {name}", at)
    return MarkupFault(rules.QUOTE_NOT_CLOSED, f"the value of {name} has no closing quote", at)


def diagnosis(text: str) -> List[MarkupFault]:
    """Return the likely faults for which lxml refused the repaired text, in the order of the file.
    """
    faults: List[MarkupFault] = []
    opened: List[Tuple[str, int]] = []
    for match in TOKEN.finditer(text):
        kind = match.lastgroup
        if kind in STARTS:
            if not _GOOD_TAG.fullmatch(match.group()):
                faults.extend(_tag_faults(match))
            if _is_open(match):
                opened.append((_tag_name(match), match.start()))
        elif kind == "end":
            name = match.group()[2:-1].rstrip(_BLANKS)
            if not opened or opened[-1][0] != name:
                # later faults may be consequences of it
                return faults[:MOST_MARKUP_FAULTS] + [_mismatch(name, match.start(), opened)]
            opened.pop()
    if opened:
        tag, offset = opened[-1]
        faults.append(MarkupFault(rules.ELEMENT_NOT_CLOSED, f"<{tag}> is never closed", offset))
    if not faults:
        wrong = "a character that XML does not allow"
        faults = [MarkupFault(rules.FORBIDDEN_CHARACTER, wrong, match.start())
                  for match in _NOT_IN_XML.finditer(text)]
    return faults[:MOST_MARKUP_FAULTS]


def _tag_name(match: "re.Match[str]") -> str:
    return TAG_NAME.match(match.string, match.start() + 1).group()  # type: ignore[union-attr]


def _is_open(match: "re.Match[str]") -> bool:
    """Return whether a token begins an element that another one has to close."""
    return match.lastgroup == "open" or (match.lastgroup == "repair" and not match.group("repair"))


def _mismatch(name: str, offset: int, opened: List[Tuple[str, int]]) -> MarkupFault:
    last, begin = opened[-1] if opened else ("", 0)
    if any(tag == name for tag, _ in opened):
        wrong = f"<{last}> is not closed before </{name}>"
        return MarkupFault(rules.ELEMENT_NOT_CLOSED, wrong, begin)
    hint = f"</{last}> is due" if opened else ""
    return MarkupFault(rules.CLOSES_NOTHING, f"</{name}> closes nothing", offset, hint)


def _tag_faults(match: "re.Match[str]") -> Iterator[MarkupFault]:
    """Yield what is wrong inside one start tag."""
    tag = _tag_name(match)
    if not _PLAIN_NAME.fullmatch(tag):
        wrong = f"{tag} cannot be the name of an element"
        yield MarkupFault(rules.ELEMENT_NAME, wrong, match.start())
    seen = set()
    for attribute in ATTRIBUTE.finditer(match.string, match.start(), match.end()):
        name, value = attribute.groups()
        offset = attribute.start()
        if name in seen:
            yield MarkupFault(rules.ATTRIBUTE_TWICE, f"the attribute {name} is given twice", offset)
        elif not _PLAIN_NAME.fullmatch(name) and ":" not in name:
            wrong = f"{name} cannot be the name of an attribute"
            yield MarkupFault(rules.ATTRIBUTE_NAME, wrong, offset)
        elif _NOT_IN_XML.search(value + "".join(starmap(_character, _CHARACTER.findall(value)))):
            wrong = f"the value of {name} holds a character that XML does not allow"
            yield MarkupFault(rules.FORBIDDEN_CHARACTER, wrong, offset)
        seen.add(name)


def _character(decimal: str, hexadecimal: str) -> str:
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return chr(code) if code <= 0x10FFFF else "\x00"
