"""The markup of a mission as people write it: repairs before lxml reads it, and the faults if lxml
cannot.

BehaviorTree.CPP's reader accepts what is not XML: raw ``&&`` and ``<`` inside attributes, line
breaks in attributes that are kept, ``&`` in text. ``repaired`` makes XML of it with the same
meaning, and removes what has no meaning in a mission: comments, the declared encoding, DOCTYPE,
namespaces. So no entity is ever declared or expanded. Every pattern here is linear in the length of
the file, also where it does not match.
"""
import itertools
import re
from typing import Any, Iterator, List, Optional, Tuple

from behavior_controller.bt.loader import rules
from behavior_controller.text import did_you_mean

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
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_QUOTED = re.compile(r""""[^"]*"|'[^']*'""")
_NEXT_ATTRIBUTE = re.compile(f"{_BLANK}+({ATTRIBUTE.pattern})")
_NO_END = re.compile(f"{_BLANK}*(?:<|$)")
_REST_OF_TAG = re.compile(rf"""({_BLANK}*)({_NAME})?({_BLANK}*=)?{_BLANK}*(["']?)""")


class MarkupFault(Exception):
    """A fault of the markup, the offset of its character, and that from which the file can be read
    on."""

    def __init__(self, rule: rules.LintRule, text: str, offset: int, hint: str = "",
                 after: int = 0):
        self.rule, self.text, self.hint = rule, text, hint
        self.offset, self.after = offset, after or offset + 1


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
            raise MarkupFault(rules.TOO_LARGE, wrong, match.start(), "split the tree into SubTrees")
        if depth == 0 and not end and kind in ("end", "leaf", "repair"):
            end = match.end()
    if first is None:
        raise MarkupFault(rules.NO_ELEMENT, "there is no element", 0, BEGINS)
    for fault in _outside(text, first, end or len(text)):
        raise fault
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


def _outside(text: str, first: int, end: int) -> Iterator[MarkupFault]:
    """Yield a fault if there is text before the ``first`` element, and one if there is some after
    its ``end``; comments and similar do not count."""
    begin = int(text.startswith("\ufeff"))
    for where, begin, stop in (("before", begin, first), ("after the end of", end, len(text))):
        match = next((match for match in _OUTSIDE.finditer(text, begin, stop)
                      if match.group("wrong")), None)
        if match is not None:
            what = "an element" if match.group("wrong") == "<" else "text"
            wrong = f"{what} {where} the first element"
            hint = "a file holds one <root> and nothing else"
            yield MarkupFault(rules.OUTSIDE_ROOT, wrong, match.start(), hint)


def remarks(text: str) -> Iterator[MarkupFault]:
    """Yield each comment inside a comment, and each text in <root> and its trees, where only
    elements count; a palette's texts are descriptions."""
    yield from filter(None, map(nested_comment, _COMMENT.finditer(text)))
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


def nested_comment(comment: "re.Match[str]") -> Optional[MarkupFault]:
    """Return the fault of a comment in which another one begins; the file can be read on after the
    end of both."""
    text, begin = comment.string, comment.string.find("<!--", comment.start() + 4, comment.end())
    if begin < 0:
        return None
    end, following = (text.find(sign, comment.end()) for sign in ("-->", "<!--"))
    after = comment.end()
    if 0 <= end and not 0 <= following < end:
        after = end + 3
    wrong = "a comment begins inside a comment, and the first --> ends both"
    return MarkupFault(rules.COMMENT_IN_COMMENT, wrong, begin, "end the first one before it", after)


def _dropped(text: str, begin: int, end: int) -> Iterator[MarkupFault]:
    words = text[begin:end].strip(_BLANKS)
    if words and not words.endswith("-->"):  # that follows a comment inside a comment
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
    ("</", rules.NOT_CLOSED, "the closing tag is not ended with >", ""))


_SWALLOWS = ("<!--", "<![CDATA[")  # all that follows


def _refusal(text: str, offset: int) -> MarkupFault:
    """Return why the ``<`` at ``offset`` does not begin a tag."""
    if text.startswith("<?", offset):
        if "?>" not in text[offset:]:
            return MarkupFault(rules.NOT_CLOSED, "the instruction <? is never closed", offset)
        wrong = "a processing instruction <?…?> is not allowed inside <root>"
        return MarkupFault(rules.INSTRUCTION, wrong, offset)
    for begin, rule, wrong, hint in _UNENDED:
        if text.startswith(begin, offset):
            end = offset + len(begin)
            if begin in _SWALLOWS:
                end = len(text)
            elif rule is rules.DOCTYPE:
                end = text.find("]>", offset) + 2
            return MarkupFault(rule, wrong, offset, hint, end)
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
            return MarkupFault(rules.TAG_NOT_ENDED, wrong, offset, hint, max(at, offset + 1))
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
    """Return the faults for which the text was refused, in the order of the file."""
    faults, tags = _of_tokens(text)
    if len(faults) >= MOST_MARKUP_FAULTS:  # the rest was not read
        return faults[:MOST_MARKUP_FAULTS]
    unclosed = _of_structure(text, tags, False)
    if unclosed:
        # how lines are indented may say better which element a tag was meant to close
        unclosed = min(_of_structure(text, tags, True), unclosed, key=len)
    elif tags and not any(kind == "perhaps" for _, _, kind in tags):
        depths = itertools.accumulate({"open": 1, "close": -1}[kind] for _, _, kind in tags)
        last = next(offset for (_, offset, _), depth in zip(tags, depths) if depth == 0)
        end, known = text.find(">", last) + 1 or len(text), [fault.offset for fault in faults]
        faults += [fault for fault in _outside(text, tags[0][1], end) if fault.offset not in known]
    faults = sorted(faults + unclosed, key=lambda fault: fault.offset)
    if faults and faults[-1].after == len(text):  # it hides what closes the others
        faults = [fault for fault in faults if fault.rule is not rules.ELEMENT_NOT_CLOSED]
    return faults[:MOST_MARKUP_FAULTS]


_Tag = Tuple[str, int, str]
"""A tag's name, its offset, and what it does: "open", "close", or "perhaps" open, as far as a
broken one can be read."""


def _of_tokens(text: str) -> Tuple[List[MarkupFault], List[_Tag]]:
    """Return the faults of single pieces of the text, and its tags without those that close
    themselves."""
    faults: List[MarkupFault] = []
    tags: List[_Tag] = []
    end, match = 0, TOKEN.search(text)
    while match is not None and len(faults) < MOST_MARKUP_FAULTS:
        kind, begin = match.lastgroup, match.start()
        faults += [MarkupFault(rules.FORBIDDEN_CHARACTER, "a character that XML does not allow",
                               wrong.start()) for wrong in _NOT_IN_XML.finditer(text, end, begin)]
        found, end = [], match.end()
        if kind in STARTS:
            if not _GOOD_TAG.fullmatch(match.group()):
                found = list(_tag_faults(match))
            if _is_open(match):
                tags.append((_tag_name(match), begin, "open"))
        elif kind == "end":
            tags.append((match.group()[2:-1].rstrip(_BLANKS), begin, "close"))
        elif kind == "blank" and _COMMENT.match(text, begin):
            found = list(filter(None, [nested_comment(match)]))
            end = max([end] + [fault.after for fault in found])
        elif kind == "other" or (kind == "instruction" and tags):
            found = [_refusal(text, begin)]
            end = max(end, found[0].after)
            tags += _broken_tag(text, begin, end)
        faults += found
        match = TOKEN.search(text, end)
    return faults, tags


def _broken_tag(text: str, begin: int, after: int) -> Iterator[_Tag]:
    """Yield the tag at ``begin``, which cannot be read beyond ``after``, unless it closes
    itself."""
    name = TAG_NAME.match(text, begin + 1)
    if text.startswith("</", begin):
        yield text[begin + 2:].split("<", 1)[0].strip(_BLANKS), begin, "close"
    elif name is not None:
        rest = text[after:].split("<", 1)[0]
        plain = _QUOTED.sub("", rest)
        before = (plain if ">" in plain else rest).partition(">")[0]
        if not (before.endswith("/") and ">" in rest):
            yield name.group(), begin, "perhaps"


def _of_structure(text: str, tags: List[_Tag], by_indent: bool) -> List[MarkupFault]:
    """Return the faults of tags that do not close each other. ``by_indent``: a tag closes an
    element of the same indentation."""
    faults: List[MarkupFault] = []
    opened: List[_Tag] = []
    doubtful = {name for name, _, kind in tags if kind == "perhaps"}
    for tag, following in zip(tags, tags[1:] + [("", 0, "")]):
        name, offset, kind = tag
        if kind != "close":
            opened.append(tag)
        elif _closes(text, tag, opened[-1:], by_indent):
            opened.pop()
        elif len(faults) < MOST_MARKUP_FAULTS:
            closed = max((index for index in range(len(opened))[-MAX_ELEMENT_DEPTH:]
                          if _closes(text, tag, opened[index:index + 1], by_indent)), default=-1)
            around, last = ["", "", *(each[0] for each in opened[-2:])][-2:]
            # what is around a misspelt tag is closed next
            if closed < 0 and last and following[::2] == (around, "close") or (
                    name != last and did_you_mean(name, [last], 0.8)):
                faults.append(_mismatch(name, offset, opened))
                opened.pop()
            elif closed >= 0:
                faults += [_mismatch(name, offset, [tag, each]) for each in opened[closed + 1:]
                           if each[2] == "open"]
                del opened[closed:]
            elif name not in doubtful:
                faults.append(_mismatch(name, offset, [("", 0, "")] + opened[-1:]))
    unclosed = [(name, offset) for name, offset, kind in opened if kind == "open"]
    return faults + [MarkupFault(rules.ELEMENT_NOT_CLOSED, f"<{name}> is never closed", offset)
                     for name, offset in unclosed[-1:]]


def _closes(text: str, tag: _Tag, opened: List[_Tag], by_indent: bool) -> bool:
    """Return whether a tag may close the one element that is ``opened``, if there is one."""
    if not opened or opened[0][0] != tag[0]:
        return False
    if not by_indent:
        return True
    indents = {_indent(text, offset) for _, offset, _ in (tag, opened[0])}
    return None in indents or len(indents) == 1


def _indent(text: str, offset: int) -> Optional[str]:
    """Return the blanks before a tag; None if it does not begin its line."""
    before = text[text.rfind("\n", 0, offset) + 1:offset]
    if before.strip():
        return None
    return before


def _tag_name(match: "re.Match[str]") -> str:
    return TAG_NAME.match(match.string, match.start() + 1).group()  # type: ignore[union-attr]


def _is_open(match: "re.Match[str]") -> bool:
    """Return whether a token begins an element that another one has to close."""
    return match.lastgroup == "open" or (match.lastgroup == "repair" and not match.group("repair"))


def _mismatch(name: str, offset: int, opened: List[_Tag]) -> MarkupFault:
    """Return the fault of a tag that does not close the last opened element."""
    last, begin, _ = opened[-1]
    if any(tag == name for tag, _, _ in opened):
        wrong = f"<{last}> is not closed before </{name}>"
        return MarkupFault(rules.ELEMENT_NOT_CLOSED, wrong, begin)
    hint = last and f"</{last}> is due"
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
        elif _NOT_IN_XML.search(value + "".join(
                itertools.starmap(_character, _CHARACTER.findall(value)))):
            wrong = f"the value of {name} holds a character that XML does not allow"
            yield MarkupFault(rules.FORBIDDEN_CHARACTER, wrong, offset)
        seen.add(name)


def _character(decimal: str, hexadecimal: str) -> str:
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return chr(code) if code <= 0x10FFFF else "\x00"
