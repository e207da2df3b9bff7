"""A mission file as elements: what is read although it is not XML, where things stand, and what is
refused in time."""
import os
import time

import pytest

from behavior_controller import folders, ros_packages
from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader import document
from behavior_controller.bt.loader.document import parse, read, with_includes
from behavior_controller.bt.loader.xml_repair import repaired
from behavior_controller.errors import MissionError
from behavior_controller.ros_packages import package_folder
from fault_words import unsaid

LEAF = "<AlwaysSuccess/>"


def mission(body=LEAF):
    return '<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree></root>'.format(body)


def faults_of(data, file="m.xml"):
    with pytest.raises(MissionError) as caught:
        parse(data, file)
    return caught.value.faults


def node(text):
    """Return the first node of the first tree."""
    return parse(text).root.children[0].children[0]


# ---------------------------------------------------------------------------- what is not quite XML


@pytest.mark.parametrize("written, read_as", [
    ("1 < 2 && 3 > 2", "1 < 2 && 3 > 2"),
    ("1 &lt; 2 &amp;&amp; 3 &gt; 2", "1 < 2 && 3 > 2"),
    ("2 &lt; 1 && 3 > 2", "2 < 1 && 3 > 2"),
    ("a & b", "a & b"),
    ("&unknown; &lol9;", "&unknown; &lol9;"),
    ("&#65;&#x42;", "AB"),
    ("&#X41; &#; &#x;", "&#X41; &#; &#x;"),
    ("'x' .. \n\t'y'", "'x' .. \n\t'y'"),
    ("a\r\nb\rc", "a\nb\nc"),
    ("<!-- not a comment -->", "<!-- not a comment -->"),
    ("a := 'ü😀'", "a := 'ü😀'"),
    ("]]>", "]]>"),
    ("x:='1'", "x:='1'"),
    ("", "")])
def test_values_are_read_as_behaviortree_cpp_reads_them(written, read_as):
    assert node(mission('<Script code="{}"/>'.format(written))).attributes == {"code": read_as}


def test_what_has_no_meaning_is_passed_over():
    text = ('\ufeff <?xml version="1.0" encoding="latin-1"?><!DOCTYPE root SYSTEM '
            '"http://example.invalid/x.dtd">\n<!-- a -- b <c> & --><root BTCPP_format="4" '
            'xmlns="urn:x" xmlns:y="urn:y"> text & more ]]> <![CDATA[ <a> ]]><BehaviorTree '
            'ID="Main"><!-- <Nope/> -->é<AlwaysSuccess y:z="1"/></BehaviorTree></root><!-- end -->'
            '\n')
    for data in (text, text.encode("utf-8")):
        root = parse(data).root
        assert (root.tag, root.attributes) == ("root", {"BTCPP_format": "4"})
        leaf = root.children[0].children[0]
        assert (leaf.tag, leaf.attributes, leaf.children) == ("AlwaysSuccess", {}, [])


def test_single_quotes_and_blanks_around_the_equals_sign():
    assert node(mission("<Script code = 'a := \"b\"' name\n=\n'x'/>")).attributes == {
        "code": 'a := "b"', "name": "x"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_encodings_with_their_marks(encoding):
    assert node(mission('<Script code="é"/>').encode(encoding)).attributes == {"code": "é"}


def test_compact_and_explicit_form():
    tree = parse(
        mission('<Sequence><Action ID="Navigate" name="go"/><Navigate/><Action/></Sequence>')
    ).root.children[0]
    assert [element.type_id
            for element in tree.children[0].children] == ["Navigate", "Navigate", ""]


# ------------------------------------------------------------------------------------------- places


def test_every_place_in_the_lab_tour_is_the_real_one():
    path = folders.mission("lab_tour")
    with open(path, encoding="utf-8") as file:
        lines = file.read().split("\n")
    waiting, seen = [read(path).root], 0
    while waiting:
        element = waiting.pop()
        line, column = element.place()
        assert lines[line - 1][column - 1:].startswith("<" + element.tag)
        for name, value in element.attributes.items():
            line, column = element.place(name)
            assert lines[line - 1][column - 1:].startswith('{}="{}"'.format(name, value))
            seen += 1
        waiting.extend(element.children)
    assert seen > 100


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_places_after_comments_and_in_tags_of_several_lines(line_end):
    lines = ['<?xml version="1.0"?>', "<!-- é", "<Nope/> -->", '<root><BehaviorTree ID="M">',
             '\t<!-- x --> <Script name="a',
             'b"', '   code="1 && 2"', "     _skipIf = 'x'/>", "<B/></BehaviorTree></root>"]
    tree = parse(line_end.join(lines)).root.children[0]
    script, other = tree.children
    assert script.place() == (5, 13)
    assert script.place("name") == (5, 21)
    assert script.place("code") == (7, 4)
    assert script.place("_skipIf") == (8, 6)
    assert script.place("absent") == script.place()
    assert other.place() == (9, 1)


def test_an_attribute_begins_with_its_name_whatever_its_value_begins_with():
    leaf = node(mission('\n<Script code="\na := 1"/>'))
    assert leaf.place("code") == (2, 9)
    assert leaf.fault(rules.NO_TREE, "x", attribute="code").line == 2


def test_an_attribute_is_not_found_inside_the_value_of_another():
    assert node(mission('\n<Script code="name=\'x\' 1" name="y"/>')).place("name") == (2, 27)


@pytest.mark.parametrize("at, place", [
    (0, (2, 9)), (1, (2, 9)), (2, (2, 9)), (3, (3, 1)), (5, (3, 6)), (6, (3, 7)), (7, (4, 1)),
    (8, (4, 2)), (99, (4, 3))])
def test_a_fault_stands_at_the_line_of_its_character_in_a_value_of_several_lines(at, place):
    fault = node(mission('\n<Script code="a;\n&lt; b\r\n c"/>')).fault(
        rules.NO_TREE, "x", attribute="code", at=at)
    assert (fault.line, fault.column, fault.end_line, fault.end_column) == place + (4, 4)


def test_a_fault_is_one_line_whatever_it_quotes():
    fault = parse(mission(), "m.xml").root.fault(rules.NO_TREE, "x\n\x1b[31m" + "y" * 1000)
    assert "\n" not in str(fault) and "\x1b" not in str(fault)
    assert len(parse(mission()).root.fault(rules.NO_TREE, "y" * 301).text) == 300


def test_texts_are_told_beside_tags_with_raw_ampersands_too():
    text = ('<root a="&"><BehaviorTree ID="Main"><Script code="1 && 2"/>first</BehaviorTree>'
            '<TreeNodesModel a="&"> a description </TreeNodesModel>second</root>')
    found = parse(text).remarks(9)
    assert [(fault.code, fault.text.split()[-1]) for fault in found] == [("stray-text", "first"),
                                                                         ("stray-text", "second")]


@pytest.mark.parametrize("rule, said, is_warning", [
    (rules.NO_TREE, None, False), (rules.STRAY_TEXT, None, True), (rules.NO_TREE, True, True),
    (rules.STRAY_TEXT, False, False)])
def test_a_fault_is_a_warning_if_its_rule_is_unless_it_is_said(rule, said, is_warning):
    assert parse(mission()).root.fault(rule, "x", is_warning=said).is_warning is is_warning


# --------------------------------------------------------------------------------- malformed markup


@pytest.mark.parametrize("text, place, code, words", [
    ("", (1, 1), "empty-file", "empty"),
    (" \n\t ", (1, 1), "empty-file", "empty"),
    ("just text", (1, 1), "no-element", "no element"),
    ("<!-- only -->", (1, 1), "no-element", "no element"),
    ("<root>\n  <a>\n  </b>\n</root>", (3, 3), "closes-nothing", "</b> closes nothing"),
    ("<root>\n  <a>\n</root>", (2, 3), "element-not-closed", "<a> is not closed before </root>"),
    ("<root>\n  <a>\n", (2, 3), "element-not-closed", "<a> is never closed"),
    ("<root>\n  <a", (2, 3), "tag-not-ended", "<a> is not ended with >"),
    ("<root>\n  <a\n  <b/></root>", (2, 3), "tag-not-ended", "<a> is not ended with >"),
    ("<root>\n  <a x=1/></root>", (2, 6), "attribute-quotes", "x must stand in quotes"),
    ("<root>\n  <a x/></root>", (2, 6), "attribute-value", "x has no value"),
    ('<root>\n  <a x="1 < 2" y/></root>', (2, 16), "attribute-value", "y has no value"),
    ('<root>\n  <a x="1\n2" y/></root>', (3, 4), "attribute-value", "y has no value"),
    ('<root>\n  <a x="1"y="2"/></root>', (2, 11), "attribute-blank", "blank is missing before y"),
    ('<root>\n  <a x="1"\n     x="2"/></root>', (3, 6), "attribute-twice", "x is given twice"),
    ('<root>\n  <a x="1/></root>', (2, 6), "quote-not-closed", "x has no closing quote"),
    ('<root>\n  <a x="1>\n  <b y="2"/></root>', (2, 6), "quote-not-closed",
     "x has no closing quote"),
    ("<root>\n  <!-- a </root>", (2, 3), "not-closed", "comment is never closed"),
    ("<root>\n  <![CDATA[ a </root>", (2, 3), "not-closed", "CDATA section is never closed"),
    ("<root>\n  <?php x ?></root>", (2, 3), "instruction", "processing instruction"),
    ("<?xml <root/>", (1, 1), "not-closed", "never closed"),
    ("<root>\n  1 < 2</root>", (2, 5), "stray-bracket", "begins no tag"),
    ("<root>\n  <1a/></root>", (2, 3), "element-name", "1a cannot be the name"),
    ('<root>\n  <a 1x="2"/></root>', (2, 6), "attribute-name", "1x cannot be the name"),
    ("<root>\n  <x:a/></root>", (2, 3), "element-name", "colon"),
    ('<root>\n  <a n="&#7;"/></root>', (2, 6), "forbidden-character", "XML does not allow"),
    ('<root>\n  <a n="&#x110000;"/></root>', (2, 6), "forbidden-character", "XML does not allow"),
    ("<root>\n  a\x01</root>", (2, 4), "forbidden-character", "XML does not allow"),
    ("<root/>\n<root/>", (2, 1), "outside-root", "an element after the end"),
    ("<root/>\n  text", (2, 3), "outside-root", "text after the end"),
    ("text <root/>", (1, 1), "outside-root", "text before"),
    ("\n\ufeff<root/>", (2, 1), "outside-root", "text before"),
    ("<root>\n</root></root>", (2, 8), "closes-nothing", "</root> closes nothing"),
    ("<root>\n <\x00/></root>", (2, 3), "not-text", "NUL"),
    ("\ufeff x<root/>", (1, 3), "outside-root", "text before the first element"),
    ("\ufeff<root/>x", (1, 9), "outside-root", "text after the end of the first element"),
    ("<root><!-- a --><A/></root>\nx", (2, 1), "outside-root",
     "text after the end of the first element"),
    ("<root a=\"&\" b=\"\"><A></A><B/></root>\n<root/>", (2, 1), "outside-root",
     "an element after the end of the first element"),
    ('<!DOCTYPE r [\n<!ENTITY a "b">]><root/>', (1, 1), "doctype", "declarations inside DOCTYPE"),
    ('<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><root/>', (1, 1), "doctype",
     "declarations inside DOCTYPE")])
def test_markup_faults_have_a_place(text, place, code, words):
    fault = faults_of(text)[0]
    assert unsaid([words], [fault]) == []
    assert (fault.file, fault.line, fault.column, fault.code) == ("m.xml",) + place + (code,)
    assert (fault.end_line, fault.end_column) == (place[0], place[1] + 1)
    assert not fault.is_warning


IN_ONE_PASS = [  # every fault of a text, in order
    ('<a x=1/>\n<b y/>\n<c z="1"q="2"/>\n', [
        (2, 4, "attribute-quotes"), (3, 4, "attribute-value"), (4, 9, "attribute-blank")]),
    ('<a code="1 < 2" bad/>\n<b y="1" y="2"/>\n', [
        (2, 17, "attribute-value"), (3, 10, "attribute-twice")]),
    ('<a x="1/>\n<b y="2"/>\n<c z/>\n', [
        (2, 4, "quote-not-closed"), (4, 4, "attribute-value")]),
    ('<S\n<a/>\n</S>\n<b y/>\n', [(2, 1, "tag-not-ended"), (5, 4, "attribute-value")]),
    ('<S>\n<a/\n</S>\n</T>\n', [(3, 1, "tag-not-ended"), (5, 1, "closes-nothing")]),
    ("<a/ >\n<?x ?>\n1 < 2\n<!x>\n<1a/>\n", [
        (2, 3, "stray-character"), (3, 1, "instruction"), (4, 3, "stray-bracket"),
        (5, 1, "stray-bracket"), (6, 1, "element-name")]),
    # a tag that is missing, misspelt or too much
    ("<S>\n<F>\n<a/>\n</S>\n<S>\n</Z>\n", [
        (3, 1, "element-not-closed"), (7, 1, "closes-nothing")]),
    ("<S>\n<S>\n<F>\n</S>\n</S>\n<b y/>\n", [
        (4, 1, "element-not-closed"), (7, 4, "attribute-value")]),
    ("<S>\n <S>\n  <a/>\n</S>\n<S>\n <S>\n  <a/>\n</S>\n", [
        (3, 2, "element-not-closed"), (7, 2, "element-not-closed")]),
    ("<F>\n <S>\n  <F>\n  </F>\n  </F>\n </S>\n</F>\n<b y/>\n", [
        (6, 3, "closes-nothing"), (9, 4, "attribute-value")]),
    ("<Fallback>\n<Sequenc>\n</Sequence>\n</Fallback>\n<b y/>\n", [
        (4, 1, "closes-nothing"), (6, 4, "attribute-value")]),
    # what has no end hides what follows
    ("<b y/>\n<!-- a <c z/>\n</S>\n", [(2, 4, "attribute-value"), (3, 1, "not-closed")]),
    # a comment in a comment, and what is after the first end of both
    ("<!-- <S>\n<!-- a -->\n</S>\n-->\n<b y/>\n", [
        (3, 1, "comment-in-comment"), (6, 4, "attribute-value")])]


@pytest.mark.parametrize("inside, expected", IN_ONE_PASS)
def test_every_fault_of_the_markup_is_told_in_one_pass(inside, expected):
    faults = faults_of("<root>\n{}</root>".format(inside))
    found = [(fault.line, fault.column, fault.code) for fault in faults if not fault.is_warning]
    assert found == expected


def test_faults_inside_and_outside_of_the_first_element_are_told_together():
    assert [(fault.line, fault.code) for fault in faults_of("x\n<root><b y/>\n</root>\ny")] == [
        (1, "outside-root"), (2, "attribute-value"), (4, "outside-root")]


@pytest.mark.slow
@pytest.mark.parametrize("text", [
    "<root>" + "<a b=\"'" * 300_000, "<root>" + ("<a b " + "c" * 3_000) * 100,
    "<root>" + "<a>" * 1_500 + "</b>" * 300_000 + "</root>"])
def test_many_faults_of_the_markup_are_told_soon(text):
    began = time.thread_time()
    assert len(faults_of(text)) == 100
    assert time.thread_time() - began < 3.0


@pytest.mark.parametrize("text, due", [("<root><a></b></a></root>", "</a> is due"),
                                       ("<root></root></root>", "")])
def test_what_a_tag_that_closes_nothing_is_instead_of(text, due):
    fault = faults_of(text)[0]
    assert fault.code == "closes-nothing" and fault.hint[:11] == due


def test_all_markup_faults_of_a_file_are_told():
    faults = faults_of('<root>\n <a x="1" x="2"/>\n <1b/>\n <c y="&#0;"/>\n</rot>')
    assert [(fault.line, fault.column) for fault in faults] == [(2, 11), (3, 2), (4, 5), (5, 1)]


@pytest.mark.parametrize("data, place, code, words", [
    ("<root>\n <a é".encode("latin-1"), (2, 5), "not-text", "byte 0xe9 is not UTF-8"),
    ("<root n='éé\n".encode("utf-8") + b"  \xff'/>", (2, 3), "not-text", "byte 0xff is not UTF-8"),
    ("<root/>".encode("utf-16-le"), (1, 2), "not-text", "NUL"),
    ("<root/>".encode("utf-16") + b"\x00", (1, 8), "not-text", "is not UTF-16"),
    (b"<root>\xed\xa0\x80</root>", (1, 7), "not-text", "is not UTF-8")])
def test_wrong_encodings(data, place, code, words):
    fault = faults_of(data)[0]
    assert unsaid([words], [fault]) == []
    assert (fault.line, fault.column, fault.code) == place + (code,)
    assert "UTF-8" in fault.hint


def test_a_lone_surrogate_in_a_text():
    assert faults_of("<root>\ud800</root>")[0].code == "forbidden-character"


# ------------------------------------------------------------------------------------------- limits


@pytest.mark.slow
@pytest.mark.parametrize("name, text, code", [
    ("nested 10,000 deep", mission("<Inverter>" * 10_000 + LEAF + "</Inverter>" * 10_000),
     "too-large"),
    ("nested and never closed", "<root>" + "<a>" * 300_000, "too-large"),
    ("many tags", "<root>" + "<a/>" * 2_000_000 + "</root>", "too-large"),
    ("many attributes", mission("<A " + " ".join('a{}=""'.format(i)
                                                 for i in range(300_000)) + "/>"), "too-large"),
    ("a long value", mission('<Script code="' + "&" * 5_000_000 + '"/>'), "too-large"),
    ("a huge number", mission('<Sleep msec="' + "9" * 1_000_000 + '"/>'), "too-large"),
    ("a long name", mission("<" + "a" * 5_000_000 + "/>"), "too-large"),
    ("a name without end", "<" + "a" * 9_000_000, "too-large"),
    ("blanks without end", mission("<Script " + " " * 3_000_000 + "<"), "tag-not-ended"),
    ("comments without end", "<root>" + "<!--" * 300_000, "not-closed"),
    ("quotes", "<root>" + "<a b=\"'" * 300_000, "stray-character"),
    ("smaller-than signs", "<" * 300_000, "stray-bracket"),
    ("nested entities", "<!DOCTYPE z [<!ENTITY a 'a'>" +
     "".join("<!ENTITY a{} '{}'>".format(i, "&a{};".format(i - 1 if i else "") * 10)
             for i in range(12)) + "]><root>&a11;</root>", "doctype"),
    ("a quadratic entity", "<!DOCTYPE z [<!ENTITY a '" + "a" * 100_000 + "'>]><root>" +
     "&a;" * 100_000 + "</root>", "doctype")])
def test_what_is_too_large_is_refused_soon(name, text, code):
    began = time.thread_time()
    fault = faults_of(text)[0]
    assert time.thread_time() - began < 3.0
    assert (fault.code, fault.line) == (code, 1)


def test_a_tree_of_2000_levels_is_read():
    element = parse(mission("<Inverter>" * 2_000 + LEAF + "</Inverter>" * 2_000)).root
    levels = 0
    while element.children:
        element = element.children[0]
        levels += 1
    assert levels == 2_002


@pytest.mark.parametrize("most, make, words", [
    (2_040, lambda number: "<root>" + "<a>" * (number - 1) + "</a>" * (number - 1) + "</root>",
     "deeper than 2040 levels"),
    (500, lambda number: "<root {}/>".format(
        " ".join('a{}="1"'.format(each) for each in range(number))),
     "<root> has more than 500 attributes"),
    (300, lambda number: "<{}/>".format("r" * number),
     "the name of the element is longer than 300"),
    (300, lambda number: "<root {}='1'/>".format("a" * number), "names may have 300 characters"),
    (100_000, lambda number: "<root a='{}'/>".format("1" * number), "values 100000"),
], ids=["levels", "attributes", "name of an element", "name of an attribute", "value"])
def test_the_limits_of_the_markup(most, make, words):
    parse(make(most))
    fault, = faults_of(make(most + 1))
    assert fault.code == "too-large" and unsaid([words], [fault]) == []


def test_what_is_as_long_as_allowed_is_not_what_is_wrong():
    fault = faults_of('<{} {}="{}" x/>'.format("t" * 300, "n" * 300, "1" * 100_000))[0]
    assert fault.code == "attribute-value"


@pytest.mark.slow
def test_the_number_of_tags_has_an_end():
    tags = "<root>{}</root>".format("<a/>" * 399_998)
    assert repaired(tags) == tags
    fault, = faults_of(tags + "<a/>")
    assert (fault.line, fault.column, fault.code) == (1, 1, "too-large") and "400000" in fault.text


def test_of_many_markup_faults_the_first_hundred_are_told():
    twice = '<a x="1" x="2"/>'
    for number, told in ((99, 99), (100, 100), (101, 100)):
        with pytest.raises(MissionError) as caught:
            parse("<root>{}</root>".format(twice * number))
        assert len(caught.value.faults) == told


def test_the_last_character_of_all_is_no_fault():
    with pytest.raises(MissionError) as caught:
        parse('<root><a x="&#x10FFFF;&#1114111;"/><a x="&#x110000;"/></root>')
    (fault,) = caught.value.faults
    assert (fault.column, fault.code) == (39, "forbidden-character")


# -------------------------------------------------------------------------------------------- files


def write(folder, **files):
    """Write ``name.xml`` for each of ``files`` and return the path of ``main.xml``."""
    for name, text in files.items():
        path = folder / (name.replace("__", os.sep) + ".xml")
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return str(folder / "main.xml")


def library(name, *includes):
    return '<root BTCPP_format="4">{}<BehaviorTree ID="{}">{}</BehaviorTree></root>'.format(
        "".join('\n<include path="{}.xml"/>'.format(path) for path in includes), name, LEAF)


def unreadable(path):
    """Return the fault of a file that cannot be read."""
    with pytest.raises(MissionError) as caught:
        read(str(path))
    fault, = caught.value.faults
    assert (fault.line, fault.column, fault.code) == (0, 0, "unreadable-file")
    return fault


@pytest.mark.parametrize("name", ["missing.xml", ".", os.devnull, "nul\x00.xml"])
def test_unreadable_files(tmp_path, name):
    assert "\n" not in str(unreadable(os.path.join(str(tmp_path), name)))


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(str(tmp_path / "pipe.xml"))
    unreadable(tmp_path / "pipe.xml")


def test_a_file_of_100_mb_is_not_read(tmp_path):
    path = tmp_path / "large.xml"
    with open(str(path), "wb") as file:
        file.truncate(100_000_000)
    assert "100000000" in unreadable(path).text


@pytest.mark.slow
def test_the_size_of_a_file_has_an_end(tmp_path):
    path = tmp_path / "large.xml"
    path.write_text("<root>{}</root>".format(" " * (10_000_000 - len("<root></root>"))))
    assert read(str(path)).root.tag == "root"
    path.write_text(path.read_text() + "\n")
    fault = unreadable(path)
    assert fault.file == str(path) and "10000001" in fault.text


def test_included_files_come_first_each_once_relative_to_who_includes_them(tmp_path):
    path = write(tmp_path, main=library("Main", "sub/a", "b"), sub__a=library("A", "../b", "c"),
                 b=library("B"), sub__c=library("C"))
    documents = with_includes(read(path))
    assert [found.root.children[-1].attributes["ID"]
            for found in documents] == ["B", "C", "A", "Main"]
    assert [found.faults for found in documents] == [[], [], [], []]


def included_faults(path):
    return [fault for found in with_includes(read(path)) for fault in found.faults]


def test_an_include_loop(tmp_path):
    path = write(tmp_path, main=library("Main", "a"), a=library("A", "b"),
                 b=library("B", "main", "a"))
    faults = included_faults(path)
    assert [(os.path.basename(fault.file), fault.line, fault.column)
            for fault in faults] == [("b.xml", 2, 10), ("b.xml", 3, 10)]
    assert {fault.code for fault in faults} == {"include-circle"}


def test_what_is_wrong_in_an_included_file_has_its_place_there(tmp_path):
    path = write(tmp_path, main=library("Main", "broken", "missing"),
                 broken="<root>\n <a x=1/></root>")
    broken, missing = included_faults(path)
    assert (os.path.basename(broken.file), broken.line, broken.column) == ("broken.xml", 2, 5)
    assert (os.path.basename(missing.file), missing.line, missing.column) == ("main.xml", 3, 10)
    assert missing.code == "include-unreadable"


def test_includes_without_a_path_or_with_ros_pkg(tmp_path):
    path = write(
        tmp_path,
        main='<root>\n<include/>\n<include path=""/>\n<include path="a.xml"\n ros_pkg="p"/></root>')
    faults = included_faults(path)
    assert [(fault.line, fault.column) for fault in faults] == [(2, 1), (3, 10), (5, 2)]
    assert faults[2].code == "include-package"


@pytest.mark.parametrize("included, meant", [
    ("lib/greting.xml", "did you mean greeting.xml?"), ("man.xml", "did you mean main.xml?"),
    ("lib/other.xml", ""), ("nowhere/greting.xml", "")])
def test_of_a_file_that_is_missing_the_one_beside_it_is_told(tmp_path, monkeypatch, included,
                                                             meant):
    (tmp_path / "lib").mkdir()
    write(tmp_path / "lib", greeting=mission())
    path = write(tmp_path, main='<root><include path="{}"/></root>'.format(included))
    monkeypatch.chdir(tmp_path)
    for file in (path, os.path.basename(path)):
        fault, = included_faults(file)
        assert fault.hint == meant


def packages_below(folder, *names):
    """Make the package.xml of each of ``names``, which are ``path=name``."""
    for path, name in (text.split("=") for text in names):
        (folder / path).mkdir(parents=True)
        (folder / path / "package.xml").write_text(
            "<package><name>{}</name></package>".format(name))


@pytest.mark.parametrize("name, found", [
    ("direct", "one/direct"), ("below", "one/a/b"), ("twice", "one/b/first"), ("second", "two/c"),
    ("in_a_package", None), ("ignored", None), ("hidden", None), ("nameless", None),
    ("misnamed", None), ("", None)])
def test_where_a_ros_package_is(tmp_path, monkeypatch, name, found):
    packages_below(tmp_path, "one/direct=direct", "one/a/b=below", "one/b/second=twice",
                   "one/b/first=twice", "one/a/b/c=in_a_package", "one/d/e=ignored",
                   "one/.f/g=hidden", "one/misnamed=another", "two/c=second")
    (tmp_path / "one" / "d" / "CATKIN_IGNORE").write_text("")
    (tmp_path / "one" / "nameless").mkdir()
    (tmp_path / "one" / "nameless" / "package.xml").write_text("<package/>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([
        "", str(tmp_path / "one"), str(tmp_path / "two")]))
    assert package_folder(name) == (found and str(tmp_path / found))


def test_packages_behind_links_are_found_once_and_a_circle_ends(tmp_path, monkeypatch):
    packages_below(tmp_path, "root/z=z", "else/c=c", "else/d/e=e")
    for name in ("a", "b"):
        (tmp_path / "root" / name).symlink_to(tmp_path / "else")
    (tmp_path / "else" / "circle").symlink_to(tmp_path / "root")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "root"))
    found = [os.path.relpath(folder, str(tmp_path / "root"))
             for folder in ros_packages.package_folders()]
    assert {"a/c", "a/d/e", "z"} <= set(found)
    assert not any(folder.startswith("b") for folder in found)


@pytest.mark.parametrize("most, found", [(3, None), (4, "b")])
def test_the_number_of_folders_where_packages_are_looked_for_has_an_end(
        tmp_path, monkeypatch, most, found):
    packages_below(tmp_path / "one", "a=other")
    packages_below(tmp_path / "two", "b=wanted")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([
        str(tmp_path / "one"), str(tmp_path / "two")]))
    monkeypatch.setattr(ros_packages, "MOST_FOLDERS", most)
    assert package_folder("wanted") == (found and str(tmp_path / "two" / found))


@pytest.mark.parametrize("length, faults", [(50, 0), (51, 1), (100, 1)])
def test_a_chain_of_includes_has_an_end(tmp_path, length, faults):
    files = {
        "f{}".format(i): library("T{}".format(i), "f{}".format(i + 1)) for i in range(length - 1)}
    files["f{}".format(length - 1)] = library("Last")
    found = included_faults(write(tmp_path, main=library("Main", "f0"), **files))
    assert [fault.code for fault in found] == ["too-large"] * faults


@pytest.mark.slow
@pytest.mark.parametrize("number, faults", [(500, 0), (501, 1), (503, 3)])
def test_the_number_of_included_files_has_an_end(tmp_path, number, faults):
    names = ["f{}".format(i) for i in range(number)]
    path = write(tmp_path, main=library("Main", *names), **{name: library(name) for name in names})
    found = included_faults(path)
    assert [(fault.code, "500" in fault.text) for fault in found] == [("too-large", True)] * faults
