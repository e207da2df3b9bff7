"""However a mission is mutated, it loads, or it has faults with a place, within a second.

``MISSION_MUTANTS`` sets how many mutants are tried; conftest.py says how others are drawn.
"""
import os
import re
import time

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from behavior_controller import folders
from behavior_controller.bt.loader.structure import CONDITIONS
from behavior_controller.bt.linter.walker import lint
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.loader import document
from behavior_controller.errors import MissionError
from behavior_controller.leaves import registry

pytestmark = pytest.mark.slow

MUTANTS = int(os.environ.get("MISSION_MUTANTS", "300"))
LONGEST = 1.0  # seconds of processor time
REGISTRY = registry()

SMALL = [
    b"""<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence name="s">
      <Script code="count := 3; who := 'you'"/>
      <SubTree ID="Sub" name="sub" guest="{who}" limit="7" _autoremap="true"/>
      <Parallel success_count="1" failure_count="2"><AlwaysSuccess/><Sleep msec="10"/></Parallel>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Sub">
    <Fallback>
      <RetryUntilSuccessful num_attempts="{limit}"><ScriptCondition code="limit &lt; 3 && true"/></RetryUntilSuccessful>
      <LoopString queue="a;b" value="{x}">
        <Switch2 variable="{x}" case_1="a" case_2="b"><AlwaysSuccess/><AlwaysFailure/><Navigate/></Switch2>
      </LoopString>
    </Fallback>
  </BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="Sub"><input_port name="guest"/><input_port name="limit" default="2"/></SubTree>
  </TreeNodesModel>
</root>
""",
    """<?xml version="1.0" encoding="UTF-8"?>
<!-- café --><root BTCPP_format='4'><BehaviorTree ID='Hôtel'><Action ID="Navigate"
   name="tab	and
newline" _skipIf="1 > 2" _onHalted=" a := 'x' .. 'y' "/></BehaviorTree></root>""".encode(),
    b'<root><include path="nowhere.xml"/><BehaviorTree ID="A"><SubTree ID="A"/></BehaviorTree></'
    b'root>']
WORDS = [
    b"Sequence", b"SubTree", b"BehaviorTree", b"root", b"include", b"TreeNodesModel", b"Action",
    b"ReactiveSequence", b"AlwaysSuccess", b"Repeat", b"Navigate", b"Switch3", b"TryCatch",
    b"Script", b"SetBlackboard", b"SequenceStar", b"ID", b"name", b"msec", b"num_cycles", b"code",
    b"path", b"_autoremap", b"xmlns", b"x:y"] + [name.encode() for name in CONDITIONS]
VALUES = [b"", b" ", b"-1", b"0", b"1e999", b"9" * 400, b"true", b"{x}", b"{=}", b"=", b"{@x}",
          b"{@@}", b"{", b"Main", b"A", b"LabTour", b"&lt;", b"&#0;", b"&#x1F600;", b"&amp",
          b"&undefined;", b"a.b c", "ü😀".encode(), b"\t\n", b"]]>", b"json:[1", b"a;b", b"1;;2",
          b"root", b"../../etc/passwd", b"nan"]
SCRIPTS = [b"", b";", b"a := 1", b"a = ", b"1 < 2 && 3 > 2", b"((((", b"'x", b"a ? b : c ? d : e",
           b"x := y := z", b"~!-1", b"@a := 1", b"0x", b"1e", b"a..b", b"'\xc3\xa9' == 'e'",
           b"1" + b"+1" * 200, b"!" * 500 + b"1", b"(" * 90 + b"1" + b")" * 90]
MARKUP = [b"<", b">", b"/>", b"</", b"<!--", b"-->", b"<![CDATA[", b"]]>", b"<?", b"?>",
          b"<!DOCTYPE r [", b"&", b'"', b"'", b"=", b"\x00", b"\xff", b"\xef\xbb\xbf", b"\r", b"<a",
          b"<a b", b'<a b="', b"</Sequence>", b"<Sequence>", b"<AlwaysSuccess/>"]
ATTRIBUTE = re.compile(rb"""([\w:]+)=("[^"]*"|'[^']*')""")
TAG = re.compile(rb"</?(\w+)")
ELEMENT = re.compile(rb"<[^<>]*>")


def sources():
    """Return the files that are mutated, small ones first, as a failure is shown with the first that
    has it; the lab tour is tried as often as all the small ones."""
    with open(folders.mission("lab_tour"), "rb") as file:
        return SMALL + [file.read()] * len(SMALL)


def cut(data, dice):
    """Return where two cuts through ``data`` go."""
    return sorted((dice.randrange(len(data) + 1), dice.randrange(len(data) + 1)))


def flip(data, dice):
    place = dice.randrange(len(data))
    return data[:place] + bytes([dice.randrange(256)]) + data[place + 1:]


def insert(data, dice):
    place = dice.randrange(len(data) + 1)
    return data[:place] + dice.choice(MARKUP + VALUES) + data[place:]


def remove(data, dice):
    begin, end = cut(data, dice)
    return data[:begin] + data[min(end, begin + dice.choice([1, 3, 30, 300])):]


def truncate(data, dice):
    return data[:dice.randrange(len(data) + 1)]


def duplicate(data, dice):
    begin, end = cut(data, dice)
    return data[:end] + data[begin:end][:2000] + data[end:]


def swap(data, dice):
    found = list(ELEMENT.finditer(data))
    if len(found) < 2:
        return data
    one, other = sorted(dice.sample(found, 2), key=lambda match: match.start())
    return data[:one.start()] + other.group() + data[one.end():other.start()] + one.group(
    ) + data[other.end():]


def replace(pattern, group, choose):
    """Return a mutation that gives one match of ``pattern`` a new part."""
    def mutation(data, dice):
        found = list(pattern.finditer(data))
        if not found:
            return data
        match = dice.choice(found)
        return data[:match.start(group)] + choose(dice) + data[match.end(group):]
    return mutation


def add_attribute(data, dice):
    found = list(TAG.finditer(data))
    if not found:
        return data
    place = dice.choice(found).end()
    name = dice.choice(WORDS)
    value = dice.choice(SCRIPTS if name.startswith(b"_") or name == b"code" else VALUES)
    return data[:place] + b" " + name + b'="' + value + b'"' + data[place:]


MUTATIONS = [flip, insert, remove, truncate, duplicate, swap, add_attribute, add_attribute,
             replace(ATTRIBUTE, 1, lambda dice: dice.choice(WORDS)),
             replace(ATTRIBUTE, 2, lambda dice: b'"' + dice.choice(VALUES + SCRIPTS) + b'"'),
             replace(TAG, 1, lambda dice: dice.choice(WORDS))]


def mutant(dice):
    data = dice.choice(sources())
    for _ in range(dice.choice([1, 1, 1, 2, 3, 8])):
        data = dice.choice(MUTATIONS)(data, dice) or b"<"
    return data


def judged(data):
    """Return the faults of a mission, those of the linter included."""
    try:
        documents = document.with_includes(document.parse(data, "mutant.xml"))
        tree = build(documents, REGISTRY, lint=lint)
    except MissionError as error:
        assert any(not fault.is_warning for fault in error.faults)
        return error.faults
    assert tree.nodes
    return tree.warnings


@settings(max_examples=MUTANTS)
@given(st.randoms(use_true_random=False))
def test_a_mutant_loads_or_has_faults_with_a_place(dice):
    data = mutant(dice)
    note(repr(data[:3000]))
    # not the time of day: other programs and threads may have the processor meanwhile
    began = time.thread_time()
    faults = judged(data)
    assert time.thread_time() - began < LONGEST
    lines = len(re.split(b"\r\n?|\n", data))
    for fault in faults:
        assert 1 <= fault.line <= lines and fault.column >= 1, fault
        assert fault.text and "\n" not in str(fault)
