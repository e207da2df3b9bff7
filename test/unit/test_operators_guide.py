"""The reference says of each mission node what the delivered recovery policy does."""
import ast
import glob
import os
import re
import subprocess
import sys

import pytest

from behavior_controller import extensions, folders, leaves, text
from behavior_controller.bt import Kind
from behavior_controller.bt.engine import leaf
from behavior_controller.bt.loader import document, xml_repair
from behavior_controller.config import recovery_policy, settings
from behavior_controller.leaves.recovery import RETURN_LIMIT
from behavior_controller.robot import rhythm
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.interfaces import DEFAULT
from behavior_controller.ros import action_client, console, handshakes, ros_interface, sinks
from behavior_controller.run import events, health, history, safe_state
from behavior_controller.run.record import files, recorder, tail
from behavior_controller.simulation.rehearsal import cli
from behavior_controller.viewer import groot2, process, web_page, zmtp
from table_4 import TABLE_4

SOURCES = os.path.dirname(leaves.__path__[0])
IN_WORDS = {2: "two", 3: "three", 5: "five", 7: "seven", 10: "ten"}
DOCUMENTS = os.path.join(os.path.dirname(folders.config("")), os.pardir, "docs")
SPEC = {spec.id: spec for spec in leaves.SPECS}
NODES = list(SPEC)
POLICY = recovery_policy.load(folders.config("recoveryPolicy.ini"), leaves.mission_specs())
COLUMNS = (Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
           Cause.TYPE_MISMATCH)


def text_of(document):
    with open(os.path.join(DOCUMENTS, document), encoding="utf-8") as file:
        return file.read()


def section():
    text = text_of("reference.md").partition("\n## Recovery of each node\n")[2]
    return text.partition("\n## ")[0]


def rows():
    table = [[cell.strip() for cell in line.strip("| ").split("|")]
             for line in section().splitlines() if line.startswith("|")]
    return {node: row[1:] for row in table for node in row[0].split(", ") if node in NODES}


def in_words(rule):
    then = rule.substitute.id if rule.substitute else {
        recovery_policy.SKIP: "skip", recovery_policy.GIVE_UP: "give up"}[rule.then]
    return ("{}×, ".format(rule.retries) if rule.retries else "") + then


@pytest.mark.parametrize("node", sorted(rows()))
def test_the_reference_says_what_the_policy_does(node):
    assert rows()[node] == [in_words(POLICY.rule(SPEC[node], cause)) for cause in COLUMNS]


def test_no_node_of_the_document_is_forgotten():
    # those ask nothing of the robot
    assert set(TABLE_4) - set(rows()) == {"START_OF_TREE", "HandleFallBack"} | {
        node for node in TABLE_4 if node.startswith("Is")}


def test_the_policy_for_conditions_is_that_of_the_reference():
    skipped = [spec.id for spec in SPEC.values() if spec.kind is Kind.CONDITION
               and in_words(POLICY.rule(spec, Cause.CONDITION_FALSE)) != "give up"]
    assert ["The exception is {}:".format(node) in section() for node in skipped] == [True]


@pytest.mark.parametrize("words", [
    f"Up to {console.MOST_UNFORMATTED:,} events wait",
    f"up to {sinks.MOST_UNWRITTEN:,} lines wait",
    f"after {rhythm.SILENCE} s, or {rhythm.GAPS} times the usual gap",
    f"at most {1 / ros_interface.CALL_INTERVAL:.0f} a second",
    f"Up to {recorder.MOST_FOR_DISK:,} events wait",
    f"{files.PLACE_BYTES / 1e9:.0f} GB and {files.MOST_RUNS:,} at most",
    f"the last {files.RUN_BYTES / 1e6:.0f} MB are kept",
    f"room for {web_page.MOST_CONNECTIONS} connections",
    f"each of Groot2's two for {zmtp.MOST_CLIENTS}",
    f"silent for {events.HANGS:.0f} s",
    f"wait {RETURN_LIMIT:.0f} s at most",
    f"most {text.MOST_BYTES / 1e6:.0f} MB, a mission {document.LARGEST / 1e6:.0f} MB, a file of a "
    f"record {tail.LARGEST_FILE / 1e6:.0f} MB",
    f"at {files.FILE_BYTES / 2e6:.0f} MB, or at {files.FILE_BYTES / 1e6:.0f} MB",
    f"`running. …` every {console.HEARTBEAT_INTERVAL:.0f} s",
    f"{health.FAILURES_IN_A_ROW} calls in a row",
    f"no sign of life for {process.NO_SIGN_LIMIT:.0f} s",
    f"not acknowledged within {action_client.ACK_LIMIT:.0f} s",
    f"at most {'twice' * (action_client.FEEDBACK_GAP == 0.5)} a second",
    f"not returned after {extensions.CODE_LIMIT:.0f} s",
    f"at most {IN_WORDS[1 / ros_interface.PUBLISH_INTERVAL]} times a second",
    f"sent away after {IN_WORDS[handshakes.HANDSHAKE]} seconds",
    f"end {IN_WORDS[groot2.CLIENT_SILENCE]} seconds after its last request",
    f"tried again every {IN_WORDS[recorder.DISK_RETRY]} seconds"])
def test_the_reference_has_the_figures_of_the_code(words):
    assert words in " ".join(text_of("reference.md").split())


def test_the_guides_have_the_figures_of_the_code():
    guide = " ".join(text_of("operators_guide.md").split())
    assert safe_state.SAFE_STATE_LIMIT == 1 and "is made again, for one second" in guide
    assert f"Every {IN_WORDS[console.HEARTBEAT_INTERVAL]} seconds" in guide
    chosen = settings.defaults()
    assert f"http://127.0.0.1:{chosen.monitor_port}" in guide
    assert f"127.0.0.1:{chosen.groot2_port}" in guide
    assert f"every {leaf.POLLING} ms" in text_of("engine.md")
    assert f"each {history.STRETCH_EVENTS}th state" in text_of("architecture.md")
    assert f"about {xml_repair.MAX_ELEMENT_DEPTH // 1000},000 levels" in text_of("authors_guide.md")
    services, topics = IN_WORDS[len(DEFAULT.services)], IN_WORDS[len(DEFAULT.topics)]
    assert f"calls {services} services and reads {topics}\ntopics" in text_of("../README.md")


@pytest.mark.slow
def test_the_quoted_run_is_that_of_a_rehearsal(capsys):
    quoted = text_of("operators_guide.md").partition("## Messages on the terminal")[2]
    lines = re.search(r"(?s)```\n(.*?)```", quoted)[1].replace("\n    ", " ").splitlines()
    sentences = [re.sub(r"^.*\]: ", "", line) for line in lines if line != "…"]
    cli.main(["lab_tour", "--visitors", "engages", "--planned", "robotNavigation:2:refused",
              "asrEnabled:=true", "--jobs", "1"])
    told = re.sub(r"(?m)^ +[\d.]+ s  ", "", capsys.readouterr().out)
    missing = [sentence for sentence in sentences if re.sub(r" after \S+ s", "", sentence)
               not in re.sub(r" after \S+ s", "", told).splitlines()]
    assert len(sentences) > 10 and missing == []


@pytest.mark.slow
def test_each_message_of_the_reference_is_one_of_the_code():
    constants = set()
    for path in glob.glob(os.path.join(SOURCES, "**", "*.py"), recursive=True):
        with open(path, encoding="utf-8") as file:
            constants.update(node.value for node in ast.walk(ast.parse(file.read()))
                             if isinstance(node, ast.Constant) and isinstance(node.value, str))
    table = text_of("reference.md").partition("\n## Messages on the terminal\n")[2]
    table = table.partition("\n## ")[0]
    quoted = [words for line in table.splitlines() if line.startswith("| `")
              for words in re.findall("`(.*?)`", line.split(" | ")[0])]
    parts = [max((part.strip(" ;,.()") for part in re.split(r"…|:|[\d.]+|/\w[\w/]*|\b[A-Z]\w+",
                                                             words)), key=len) for words in quoted]
    assert len(parts) > 25
    assert [part for part in parts if not any(part in text for text in constants)] == []


def test_the_viewer_keeps_a_million_events():
    assert "the last million events" in " ".join(text_of("reference.md").split())
    assert history.MOST_STRETCHES * history.STRETCH_EVENTS == 1_000_000


def test_the_budget_and_the_pauses_are_those_of_the_policy():
    with open(folders.config("recoveryPolicy.ini"), encoding="utf-8") as file:
        given = {line.split()[0]: line.split()[1:3] for line in file
                 if line.startswith(("budget", "pause"))}
    text = " ".join(text_of("reference.md").split())
    assert "{} recoveries in {} s".format(*given["budget"]) in text
    first, longest = given["pause"]
    assert "takes {} s.".format(first) in text
    assert "up to {} s".format(longest) in text


def exit_codes():
    """Return command -> exit codes of the reference."""
    table = text_of("reference.md").partition("\n## Exit codes\n")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")]
            for line in table.splitlines() if line.startswith("| `")]
    return {row[0].strip("`"): [str(code) for code, cell in enumerate(row[1:]) if cell]
            for row in rows}


@pytest.mark.slow
@pytest.mark.parametrize("command", exit_codes())
def test_the_help_of_a_command_has_the_exit_codes_of_the_reference(command):
    folder = "../unit_tests/nodes" if command == "runTest" else "../src/behavior_controller"
    text = subprocess.check_output([sys.executable, os.path.join(DOCUMENTS, folder, command),
                                    "--help"], universal_newlines=True)
    said = " ".join(text.split()).rpartition("exit code")[2][:450]
    assert [code for code in exit_codes()[command] if not re.search(rf"\b{code}\b", said)] == []


@pytest.mark.parametrize("document, claim", [
    ("operators_guide.md", "no drive under way"), ("operators_guide.md", "ten thousand events"),
    ("reference.md", "ten thousand events"), ("../README.md", "leaves the robot safe"),
    ("tutorial.md", "both commands warn"), ("release_1_0.md", "unreached"),
    ("architecture.md", "version 8"), ("authors_guide.md", "32 kinds")])
def test_no_wrong_claim_is_back(document, claim):
    assert claim not in " ".join(text_of(document).split())
