"""Do missions find what other packages add, and is each way of exporting it wrong told in one line?
"""
import importlib
import inspect
import itertools
import os
import re
import shutil
import subprocess
import sys
import textwrap
from xml.etree import ElementTree

import pytest

from behavior_controller import extend, extensions, leaves
from behavior_controller.bt import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from behavior_controller.bt.engine.registry import Kind
from behavior_controller.leaves.data import Datum
from behavior_controller.robot import d543, interfaces

pytestmark = pytest.mark.slow

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = os.path.join(ROOT, "examples")
PACKAGES = [os.path.join(EXAMPLES, name) for name in ("courier", "greeter", "receptionist")]
SOURCES = [os.path.join(folder, "src") for folder in PACKAGES]
MANIFEST = """<package format="2"><name>{0}</name><version>1.0.0</version><description>d</description>
<maintainer email="a@example.org">a</maintainer><license>BSD</license><export><cssr_system {1}/></export></package>"""
LEAF = """from behavior_controller.extend import Kind, NodeSpec, Port
from behavior_controller.extend import Request, Say
from behavior_controller.extend import ServiceLeaf, leaf_spec
"""

STATUSES = (IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED)

LEAVES, INTERFACE, PHRASES = 'leaves="a.leaves"', 'interface="a.leaves"', 'phrases="a.leaves"'
RING = LEAF + """
class FixtureRing(ServiceLeaf):
    asks = Say
    def request(self):
        return Say("ding", "en")
"""
BELL = """from behavior_controller.extend import Service, Success, Topic
from behavior_controller.extend import Request, Say
class Bell(Request, frozen=True):
    text: str = "ding"
def bell(name="/bell", **changed):
    return Service(**dict(dict(request=Bell, name=name, node="bell", deadline=5.0,
        type="cssr_system/textService", fields=lambda bell: (bell.text,),
        success=Success("success", True, False), impact_if_missing="no bell rings"), **changed))
"""
RINGS = "SPECS = (leaf_spec('FixtureRing', FixtureRing, ''),)"
RINGING = "<root BTCPP_format='4'><BehaviorTree ID='M'><FixtureRing/></BehaviorTree></root>"
SPEECH = "from behavior_controller.extend import Speech\n"


def with_port(fields):
    """Return lines that declare the leaf of RING with a port of these fields."""
    return "FixtureRing.PORTS = (Port({}),)\n".format(fields) + RINGS


def environment(packages, paths):
    """Return the environment of a shell in which these folders hold packages."""
    return dict(os.environ, ROS_PACKAGE_PATH=str(packages), ROS_ROOT="",
                PYTHONPATH=os.pathsep.join([os.path.join(ROOT, "src")] + list(map(str, paths))))


def run(tool, *arguments, packages, paths=()):
    """Return the exit code of a tool and all that it prints, where these folders hold packages."""
    command = [tool] if tool == "-c" else [os.path.join(ROOT, "src", "behavior_controller", tool)]
    done = subprocess.run([sys.executable, *command, *arguments], env=environment(packages, paths),
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    return done.returncode, done.stdout


def package(folder, export, module, name="a"):
    """Write a package with one export and the module that it names; ``module`` None: there is no
    such module."""
    source = folder / name / "src" / name
    source.mkdir(parents=True)
    (folder / name / "package.xml").write_text(MANIFEST.format(name, export))
    (source / "__init__.py").write_text("")
    if module is not None:
        (source / "leaves.py").write_text(module)


def test_an_example_adds_its_leaves_its_decorator_and_its_phrase():
    there = {"packages": EXAMPLES, "paths": SOURCES}
    code, text = run("validateMission", os.path.join(EXAMPLES, "greeter", "data", "greet.xml"),
                     **there)
    assert (code, text.splitlines()[1:]) == (0, [
        os.path.join(EXAMPLES, "greeter", "data", "greet.xml") +
        ": can be run, 25 nodes, 0 warnings"])
    palette = run("exportNodeModel", **there)[1]
    assert all('ID="{}"'.format(node) in palette for node in (
        "SayTime", "Lights", "EveryOther", "CuriousSpeech", "DriveTo", "Display"))
    assert '<Decorator ID="EveryOther">' in palette


def test_the_courier_is_rehearsed_with_every_fault():
    code, text = run("rehearseMission", "deliver", packages=EXAMPLES, paths=SOURCES)
    assert code == 0 and "nothing was found" in text, text


def run_tests(folder, packages, paths):
    """Run the tests of a package."""
    return subprocess.run([sys.executable, "-m", "unittest", "discover", "-s", "test"],
                          env=environment(packages, paths), cwd=str(folder), encoding="utf-8",
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def test_the_examples_test_their_leaves_as_the_guide_says():
    for folder, number in zip(PACKAGES, (6, 7, 20)):
        done = run_tests(folder, EXAMPLES, SOURCES)
        assert done.returncode == 0 and f"Ran {number} tests" in done.stdout, done.stdout


HEARING = """from behavior_controller import leaves
from behavior_controller.extend import SUCCESS, Sense, Trial
from greeter.hearing import SPECS
registry = leaves.registry()
registry.extend(SPECS)
leaves.registry = lambda: registry
trial = Trial("<IsColourSaid/>")
trial.topics.publish(trial.mission.interface.evidence(Sense.UTTERANCE).topic, "well blue please")
assert trial.tick() is SUCCESS and trial.tree.blackboard.get("colour") == "blue"
assert trial.events[-1].summary.text == "heard “well blue please”: blue"
assert [port.name for port in SPECS[0].ports] == ["colour", "questionAskedAt"]
"""
"""Tries the leaf of the guide that hears a colour."""


def test_the_code_of_the_guide_is_a_package_with_its_test(tmp_path):
    package(tmp_path, 'interface="greeter.interface" leaves="greeter.leaves"', None, "greeter")
    with open(os.path.join(ROOT, "docs", "extending.md"), encoding="utf-8") as file:
        blocks = re.findall(r"(?ms)^ *```python\n( *# (\S+)\n.*?)^ *```$", file.read())
    for text, path in blocks:
        (tmp_path / "greeter" / path).parent.mkdir(exist_ok=True)
        (tmp_path / "greeter" / path).write_text(textwrap.dedent(text))
    sources = [tmp_path / "greeter" / "src"]
    code, text = run("exportNodeModel", packages=tmp_path, paths=sources)
    assert code == 0 and '<Condition ID="DoorbellRang"' in text
    (tmp_path / "greeter" / "data").mkdir()
    (tmp_path / "greeter" / "data" / "colours.ini").write_text("Blue\nred\n")
    subprocess.check_call([sys.executable, "-c", "from greeter.moving import SERVICES\n" + HEARING],
                          env=environment(tmp_path, sources))
    done = run_tests(tmp_path / "greeter", tmp_path, sources)
    assert done.returncode == 0 and "Ran 4 tests" in done.stdout, done.stdout


def test_without_the_package_its_nodes_are_those_of_another_robot(tmp_path):
    code, text = run("validateMission", os.path.join(EXAMPLES, "greeter", "data", "greet.xml"),
                     packages=tmp_path)
    assert code == 0 and "not a mission of this robot, which lacks 7 node types" in text


@pytest.mark.parametrize("export, module, words", [
    (LEAVES, "import sys; sys.exit(0)", "SystemExit: 0 (a/leaves.py:1)"),
    (LEAVES, "class Odd(BaseException): pass\nraise Odd('\\x1b[2J\\x07\\nnext')",
     "Odd: \\x1b[2J\\x07 next"),
    (INTERFACE, RING + "SERVICES = ()", "must not import leaves")])
def test_what_is_wrong_with_a_package_is_one_line_of_a_command(tmp_path, export, module, words):
    package(tmp_path, export, module)
    code, text = run("exportNodeModel", packages=tmp_path, paths=[tmp_path / "a" / "src"])
    assert code == 2 and len(text.splitlines()) == 1, text
    assert text.startswith("exportNodeModel: package a: ") and words in text


@pytest.mark.parametrize("export, module, words", [
    ('leaves="a.leafs"', "", ["No module named 'a.leafs'"]),
    (LEAVES, "SPECS = (", ["cannot be imported", "SyntaxError", "(a/leaves.py:1)"]),
    (LEAVES, LEAF + "SPECS = NodeSpec('FixtureLamp', Kind.ACTION, None)",
     ["SPECS is not a tuple"]),
    (LEAVES, LEAF + "SPECS = (NodeSpec('FixtureLamp', Kind.ACTION, None, 7),)", ["a.leaves"]),
    (LEAVES, LEAF + "SPECS = (NodeSpec(7, 'Action', None),)", ["a.leaves"]),
    (LEAVES, LEAF + "SPECS = (NodeSpec('Navigate', Kind.ACTION, None),)",
     ["the node Navigate is declared by cssr_system already"]),
    (LEAVES, LEAF + "SPECS = (NodeSpec('Sequence', Kind.ACTION, None),)",
     ["the node Sequence is declared by BehaviorTree.CPP already"]),
    (LEAVES, LEAF + "class FixtureWave(Request):\n  pass\nclass FixtureWaves(ServiceLeaf):\n"
     "  asks = FixtureWave\nSPECS = (leaf_spec('FixtureWaves', FixtureWaves, 'waves'),)",
     ["no service is declared for the request FixtureWave of FixtureWaves"]),
    (LEAVES, RING + with_port("'n', 'std::string'"),
     ["the port n of FixtureRing has the unknown type std::string", "did you mean string?"]),
    (LEAVES, LEAF + "class FixtureLamp(ServiceLeaf):\n  pass\n"
     "SPECS = (leaf_spec('FixtureLamp', FixtureLamp, 'lamp'),)",
     ["cannot be imported",
      "a.leaves.FixtureLamp, the leaf of FixtureLamp, does not say what it asks for"]),
    (LEAVES, "from behavior_controller.leaves.bse import X", ["leaves.bse", "(a/leaves.py:1)"]),
    (LEAVES, "from behavior_controller.extend import X", ["'X'", "(a/leaves.py:1)"]),
    (LEAVES, RING + "SPEC = ()", ["has no SPECS, but SPEC", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('FixtureRing', FixtureRing, 'Rings.'))",
     ["comma", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (FixtureRing,)", ["not a NodeSpec", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('FixtureRing', FixtureRing(), ''),)",
     ["'name'", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('FixtureRing', FixtureRing),)",
     ["'description'", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('FixtureRing', int, ''),)",
     ["not a class of mission leaves", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (NodeSpec('FixtureRing', Kind.ACTION, int),)",
     ["makes no nodes", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('FixtureRing it', FixtureRing, ''),)",
     ["cannot be the name of a node", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (leaf_spec('Action', FixtureRing, ''),)",
     ["'Action' cannot be the name of a node", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = (NodeSpec('FixtureRing', Kind.ACTION, None),)",
     ["None makes no nodes", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = ((leaf_spec('FixtureRing', FixtureRing, ''),),)",
     ["is not a NodeSpec", "(a/leaves.py:9)"]),
    (LEAVES, RING + "SPECS = 2 * (leaf_spec('FixtureRing', FixtureRing, ''),)",
     ["FixtureRing is declared by a already", "(a/leaves.py:"]),
    (LEAVES, LEAF +
     "class FixtureRing(ServiceLeaf):\n  asks = Say\nSPECS = (leaf_spec('FixtureRing', "
     "FixtureRing, ''),)",
     ["has no request()", "(a/leaves.py:4)"]),
    (LEAVES, LEAF +
     "class FixtureRing(ServiceLeaf):\n  asks = 'Say'\nSPECS = (leaf_spec('FixtureRing', "
     "FixtureRing, ''),)",
     ["does not say what it asks for", "(a/leaves.py:6)"]),
    (LEAVES, RING +
     "FixtureRing.PORTS = (Port('colour'))\nSPECS = (leaf_spec('FixtureRing', FixtureRing, ''),)",
     ["not a tuple of Port", "(a/leaves.py:10)"]),
    (LEAVES, RING + "FixtureRing.own_evidence = Say\n" + RINGS,
     ["own_evidence", "no Evidence", "(a/leaves.py:10)"]),
    (LEAVES, RING + "from behavior_controller.extend import Evidence\n"
     "FixtureRing.own_evidence = Evidence('/bell')\n" + RINGS,
     ["own_evidence", "no Evidence", "(a/leaves.py:11)"]),
    (LEAVES, RING + with_port("'n', 'float'"), ["type float (there are: ", " double ",
                                                  "(a/leaves.py:"]),
    (LEAVES, RING + with_port("'n', int"), ["type of the port n", "(a/leaves.py:10)"]),
    (LEAVES, RING + with_port("'n', 'int', default=5"), ["default of the port n", "(a/leaves.py:"]),
    (LEAVES, RING + with_port("'n', 'int', default='five'"), ["default is not of the type int",
                                                              "[five]", "(a/leaves.py:9)"]),
    (LEAVES, RING + with_port("'n', direction='out'"), ["direction of the port n", "Direction"]),
    (LEAVES, RING + with_port("'name'"), ["'name'", "name of a port", "(a/leaves.py:9)"]),
    (LEAVES, RING + with_port("'my colour'"), ["'my colour'", "name of a port"]),
    (LEAVES, RING + with_port("'n'), Port('n'"), ["two ports", "same name", "(a/leaves.py:10)"]),
    (INTERFACE, BELL + "SERVICE = (bell(),)",
     ["has no SERVICES", "but SERVICE ", "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "SERVICES = (bell())", ["comma", "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "SERVICES = (bell('bell'),)", ["begin with /", "(a/leaves.py:"]),
    (INTERFACE, BELL + "SERVICES = (bell('/a bell'),)", ["begin with /", "(a/leaves.py:"]),
    (INTERFACE, BELL + "SERVICES = (bell(7),)", ["name of a Service is 7", "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "SERVICES = (bell(type='textService'),)",
     ["'textService' is not package/Type", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(deadline='5'),)", ["no deadline", "(a/leaves.py:6)"]),
    (INTERFACE, BELL + "SERVICES = (bell(deadline=-5.0),)", ["-5.0 s", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(deadline=float('nan')),)", ["nan s", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(success='yes'),)", ["no success", "(a/leaves.py:6)"]),
    (INTERFACE, BELL + "SERVICES = (bell(impact_if_missing=''),)",
     ["impact_if_missing", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(request=Say),)",
     ["are both declared for Say", "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "class Say(Request):\n  text: str\nSERVICES = (bell(request=Say),)",
     ["a request Say already", "rename that of /bell", "(a/leaves.py:11)"]),
    (INTERFACE, BELL + "class B(Request):\n  x: 'Place'\nSERVICES = (bell(request=B),)",
     ["cannot hold the fields of B", "'Place'", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(simulated_answer='yes'),)",
     ["'yes'", "(simulated_answer)", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "from behavior_controller.extend import Publication\n"
     "SERVICES = (Publication(**vars(bell())),)", ["success is None", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "class B(Request):\n  x = 'y'\nSERVICES = (bell(request=B),)",
     ["B.x has no annotation", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "class B(Request):\n  effect = 'odd'\nSERVICES = (bell(request=B),)",
     ["B.effect is 'odd'", "NO_EFFECT", "(a/leaves.py:5)"]),
    (INTERFACE, BELL + "SERVICES = (bell(node='/bell'),)", ["'/bell' is not the name of a node"]),
    (INTERFACE, BELL + "class B(Request):\n  x: str\n"
     "SERVICES = (bell(), bell('/b', request=B, deadline=7.0))", ["/b of the node bell share one",
                                                                 "deadline", "(a/leaves.py:11)"]),
    (INTERFACE, BELL + "TOPICS = (Topic('/b', 'b', 'std_msgs/String', 'str', str, 'x', False),)",
     ["values is 'str', and not a type", "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "TOPICS = (bell(),)", ["'/bell' in TOPICS is not a Topic",
                                              "(a/leaves.py:9)"]),
    (INTERFACE, BELL + "TOPICS = (Topic('/bell', 'bell'),)", ["'is_continuous'", "(a/leaves.py:9)"
                                                              ]),
    (INTERFACE, BELL + "TOPICS = (Topic('/b', 'b', 'std_msgs/String', str, 'read', 'x', False),)",
     ["'read' cannot read", "(a/leaves.py:9)"]),
    (LEAVES, RING + "    def update(self):\n        return None\n" + RINGS,
     ["FixtureRing.update (a/leaves.py:9) bypasses the rule of the class ServiceLeaf: write "
      "request", "(a/leaves.py:5)"]),
    (LEAVES, RING + "SPECS = (NodeSpec('FixtureRing', Kind.CONDITION, FixtureRing),)",
     ["makes nodes of Kind.ACTION, and its NodeSpec says Kind.CONDITION", "(a/leaves.py:5)"]),
    (LEAVES, RING.replace("= Say", "= (Say, 7)").replace("ServiceLeaf", "WorkingLeaf") + RINGS,
     ["does not say what it asks for"]),
    (PHRASES, SPEECH + "SPEECHES = (Speech('Hi', False, 'Hi.', variables=('who')),)",
     ["the variables of a Speech is 'who', and not of the type tuple", "(a/leaves.py:2)"]),
    (PHRASES, SPEECH + "SPEECHES = (Speech('Hi', False, 'Hi.', variables=('who is',)),)",
     ["the port 'who is' of Hi", "cannot be the name of a port"]),
    (PHRASES, "SPEECHES = ('Hi', 'Ho')", ["'Hi' in SPEECHES is not a Speech"]),
    (PHRASES, SPEECH + "SPEECHES = (Speech(None, 0, None),)", ["a.leaves"]),
    (PHRASES, SPEECH + "SPEECHES = (Speech('Hi', 'False', 'Hi.'),)",
     ["asks of a Speech is 'False'", "(a/leaves.py:2)"]),
    (PHRASES, SPEECH + "SPEECHES = (Speech('Hi all', False, 'Hi.'),)",
     ["cannot be the name of a node", "(a/leaves.py:2)"])])
def test_a_mistake_of_another_package_is_told_with_its_place(exports, export, module, words):
    kind = export.partition("=")[0]
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports(kind, export, module)
        if kind == "interface":
            interfaces._extended(d543.INTERFACE)
        else:
            leaves.specs()
    text = str(raised.value)
    assert [word for word in ["package a: "] + words if word not in text] == [], text


@pytest.fixture(name="exports")
def exports_of_a(tmp_path, monkeypatch):
    """Return the function that writes a package a and returns the modules of a kind that are
    exported."""
    caches = (extensions.exported, extensions._exports, leaves.specs)

    def exports(kind, export, module=None, manifest=MANIFEST):
        package(tmp_path, "", module)
        (tmp_path / "a" / "package.xml").write_text(manifest.format("a", export))
        return extensions.exported(kind)

    def forget():
        for cache in caches:
            cache.cache_clear()
        for name in ("a", "a.leaves"):
            sys.modules.pop(name, None)

    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path / "a" / "src"))
    forget()
    yield exports
    forget()
    extensions._packages.pop("a", None)
    extensions.doubts.clear()


HALF = "import sys\nsys.modules['a.leaves'].SPECS\n"
NO_HINT = "(most likely due to a circular import) (a/leaves.py:2)"


@pytest.mark.parametrize("kind, module, text", [
    ("leaves", None, "cannot be imported: ModuleNotFoundError: No module named 'a.leaves'"),
    ("leaves", "x = 1\nx / 0", "cannot be imported: ZeroDivisionError: .* (a/leaves.py:2)"),
    ("leaves", "raise KeyboardInterrupt",
     "cannot be imported: KeyboardInterrupt (a/leaves.py:1)"),
    ("interface", "1 / 0", "cannot be imported: ZeroDivisionError: .* (a/leaves.py:1)"),
    ("leaves", HALF, "cannot be imported: AttributeError: partially initialized .* " + NO_HINT),
    ("interface", HALF, "cannot be imported: AttributeError: partially initialized .* " + NO_HINT +
     "; this module must not import leaves or phrases")])
def test_why_an_exported_module_cannot_be_imported(exports, kind, module, text):
    export = '{}="a.leaves"'.format(kind)
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports(kind, export, module)
    pattern = re.escape("package a: {} {}".format(export, text)).replace(r"\.\*", ".*")
    assert re.fullmatch(pattern, str(raised.value))


COMMA = "{0} is not a tuple; with one item it needs a comma: {0} = (…,)"


@pytest.mark.parametrize("kind, module, text", [
    ("leaves", "\nSPECS = 7", COMMA.format("SPECS") + " (a/leaves.py:2)"),
    ("leaves", "\n\nSPECS = 'text'", COMMA.format("SPECS") + " (a/leaves.py:3)"),
    ("interface", "SERVICES = ()\nTOPICS = {}", COMMA.format("TOPICS") + " (a/leaves.py:2)"),
    ("phrases", SPEECH + "SPEECHES = (Speech('Hi', False, 'Hi.'))",
     COMMA.format("SPEECHES") + " (a/leaves.py:2)"),
    ("leaves", "", "it has no SPECS"),
    ("leaves", "COLOURS = ()\nspecs = ()", "it has no SPECS, but specs (a/leaves.py:2)"),
    ("interface", "TOPICS = ()\nservices = []", "it has no SERVICES, but services (a/leaves.py:2)"),
    ("interface", "Service = service = int\nSPECS = ()", "it has no SERVICES and no TOPICS"),
    ("leaves", "COLOURS = ()\nSPEC = ()\nSPECES = ()",
     "it has no SPECS, but SPEC (a/leaves.py:2)"),
    ("interface", "SPECS = ()", "it has no SERVICES and no TOPICS"),
    ("interface", "\nTOPIC = ()", "it has no SERVICES and no TOPICS, but TOPIC (a/leaves.py:2)")])
def test_an_exported_module_has_its_tuples(exports, kind, module, text):
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports(kind, '{}="a.leaves"'.format(kind), module)
    assert str(raised.value) == "package a: a.leaves: " + text


class Record:
    """What a module declares."""

    text: str
    is_loud: bool
    number: int
    seconds: float
    other: Kind

    def __init__(self, text="a", is_loud=False, number=1, seconds=2.0, other=None):
        self.text, self.is_loud, self.number = text, is_loud, number
        self.seconds, self.other = seconds, other


@pytest.mark.parametrize("fields, wrong", [
    ({}, None), ({"seconds": 3}, None), ({"other": "anything"}, None),
    ({"text": 7}, "the text of a Record is 7, and not of the type str"),
    ({"is_loud": "no"}, "the is_loud of a Record is 'no', and not of the type bool"),
    ({"number": 1.5}, "the number of a Record is 1.5, and not of the type int"),
    ({"seconds": "2"}, "the seconds of a Record is '2', and not of the type float")])
def test_the_plain_fields_of_what_is_declared_have_their_types(exports, fields, wrong):
    extension, = exports("leaves", LEAVES, "\nSPECS = []")
    assert extension.declared("SPECS", Record) == extension.declared("TOPICS", Record) == ()
    records = [Record(), Record(**fields)]
    extension.module.SPECS = records
    if wrong is None:
        assert extension.declared("SPECS", Record) == tuple(records)
        return
    with pytest.raises(extensions.BrokenExtension) as raised:
        extension.declared("SPECS", Record)
    assert str(raised.value) == "package a: a.leaves: {} (a/leaves.py:2)".format(wrong)


def test_what_is_declared_is_of_one_kind(exports):
    extension, = exports("leaves", LEAVES, "SPECS = (7,)")
    with pytest.raises(extensions.BrokenExtension, match=r"7 in SPECS is not a Record \(a/leaves"):
        extension.declared("SPECS", Record)


@pytest.mark.parametrize("manifest, text", [
    ("\n" + MANIFEST.replace("<cssr_system", "\n<cssr_sytem"),
     "{}:4: the export element cssr_sytem is unknown, did you mean cssr_system?"),
    (MANIFEST.replace("export>", "odd>"), "{}: <cssr_system> must stand in <export>"),
    (MANIFEST.replace("</name>", ""), "{} is not XML: mismatched tag: line 2, column .*"),
    (MANIFEST.replace("leaves", "leafs").replace("{1}", 'leafs="a.leaves"'),
     "{}: cssr_system has no attribute leafs; allowed: leaves, interface, phrases"),
    (MANIFEST.replace("{1}", 'leaves=""'), 'leaves="" names no module')])
def test_an_export_that_cannot_be_used_is_refused_with_its_place(tmp_path, exports, manifest, text):
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports("leaves", LEAVES, "SPECS = ()", manifest)
    expected = "package a: " + text.format(tmp_path / "a" / "package.xml")
    assert re.fullmatch(re.escape(expected).replace(r"\.\*", ".*"), str(raised.value))


@pytest.mark.parametrize("manifest, doubt", [
    (MANIFEST.replace("<cssr_system {1}/>", ""), ""),
    (MANIFEST.replace("cssr_system", "rqt_gui"), ""),
    (MANIFEST.replace("cssr_system", "cssr_system_viewer"), ""),
    (MANIFEST.replace("<cssr_system {1}/>", "<!--\n<cssr_system {1}/> -->"), ""),
    (MANIFEST.replace("<cssr_system {1}/>", "<!-- <cssr_sytem {1}/> -->"), ""),
    (MANIFEST.replace(">d<", "><![CDATA[<cssr_system leaves='a.b'/>]]><").replace(
        "<cssr_system {1}/>", ""), ""),
    ("<package><name>a</name><odd></package>", ""),  # it exports nothing
    ("<package><name>a</name><export></odd></export>", ""),
    ("<package><name>a</name>", "is not XML: no element found: line 1, column 23")])
def test_a_package_that_does_not_export_to_us_is_no_error(tmp_path, exports, manifest, doubt):
    assert exports("leaves", LEAVES, "SPECS = ()", manifest) == ()
    path = tmp_path / "a" / "package.xml"
    assert list(map(str, extensions.doubts)) == (
        ["package a: warning: {} {}; what it exports is left out".format(path, doubt)]
        if doubt else [])


def test_a_doubt_is_told_once_and_the_other_packages_export(tmp_path, exports):
    (tmp_path / "0").mkdir()
    os.mkfifo(str(tmp_path / "0" / "package.xml"))
    extension, = exports("leaves", LEAVES, "SPECS = ()")
    extensions._exports.cache_clear()
    assert extensions._exports() == (("a", str(tmp_path / "a"), "leaves", "a.leaves"),)
    assert (extension.package, extension.folder) == ("a", str(tmp_path / "a"))
    assert list(map(str, extensions.doubts)) == [
        "package 0: warning: {}/0/package.xml cannot be read: it is not a regular file; "
        "what it exports is left out".format(tmp_path)]


@pytest.mark.parametrize("text, words", [
    (None, ["file of phrases of the package a", "No such file"]),
    ("FixtureHi Hello\nFixtureHi Ho\n", ["phrases_English.ini:2:1", "FixtureHi"]),
    ("", ["FixtureHi is missing"])])
def test_phrases_of_a_package_are_checked_as_at_the_start(tmp_path, text, words):
    package(tmp_path, PHRASES, SPEECH + "SPEECHES = (Speech('FixtureHi', False, 'Hi.'),)")
    (tmp_path / "a" / "data").mkdir()
    if text is not None:
        (tmp_path / "a" / "data" / "phrases_English.ini").write_text(text)
    shutil.copy(os.path.join(ROOT, "data", "lab_tour.xml"), str(tmp_path / "a" / "data" / "m.xml"))
    code, said = run("validateMission", "m", packages=tmp_path, paths=[tmp_path / "a/src"])
    lines = [line for line in said.splitlines() if line.startswith(str(tmp_path))]
    assert said.endswith("m.xml: can be run, 222 nodes, 0 warnings\n")
    assert code == 2 and all(word in lines[0] for word in words) and "1 error" in lines[1], said


def test_two_packages_with_a_node_of_the_same_name(tmp_path):
    for name in ("a", "b"):
        package(tmp_path, 'leaves="{}.leaves"'.format(name),
                LEAF + "SPECS = (NodeSpec('FixtureTwice', Kind.ACTION, str.title),)", name)
    code, text = run("exportNodeModel", packages=tmp_path,
                     paths=[tmp_path / "a" / "src", tmp_path / "b" / "src"])
    assert (code, len(text.splitlines())) == (2, 1)
    assert "package b" in text and "the node FixtureTwice is declared by a already" in text


TOUR = os.path.join(ROOT, "data", "lab_tour.xml")
TOOLS = [("validateMission", [TOUR]), ("exportNodeModel", []), ("rehearseMission", ["lab_tour"]),
         ("../../unit_tests/nodes/runTest", [])]
BLOCKED = "import threading; threading.Event().wait()"


def run_briefly(tool, *arguments, packages, paths):
    """As ``run``, with a limit of a second for code of packages."""
    return run("-c", "import runpy, sys; from behavior_controller import extensions; "
               "extensions.CODE_LIMIT = 1.0; sys.argv = sys.argv[1:]; "
               "runpy.run_path(sys.argv[0], run_name='__main__')",
               os.path.join(ROOT, "src", "behavior_controller", tool), *arguments,
               packages=packages, paths=[*paths, os.path.join(ROOT, "unit_tests", "src")])


@pytest.mark.parametrize("tool, arguments", TOOLS[:1] + TOOLS[2:])
def test_an_import_that_does_not_end_is_one_line_within_its_limit(tmp_path, tool, arguments):
    package(tmp_path, 'interface="a.leaves"', "\n" + BLOCKED)
    code, text = run_briefly(tool, *arguments, packages=tmp_path, paths=[tmp_path / "a" / "src"])
    assert (code, text) == (
        2, '{}: package a: interface="a.leaves": its import has not ended within 1 s '
        '(a/leaves.py:2)\n'.format(os.path.basename(tool)))


@pytest.mark.parametrize("tool, method", [
    ("validateMission", "__init__(self, name)"), ("rehearseMission", "configure(self)")])
def test_a_leaf_that_is_not_made_in_time_is_one_line_with_its_place(tmp_path, tool, method):
    package(tmp_path, LEAVES, RING + "    def {}: {}\n".format(method, BLOCKED) + RINGS)
    (tmp_path / "m.xml").write_text(RINGING)
    code, text = run_briefly(tool, str(tmp_path / "m.xml"), packages=tmp_path,
                             paths=[tmp_path / "a" / "src"])
    line = (RING + "x").count("\n") + 1
    assert code == 2 and text.splitlines()[-1] == (
        "{}: package a: a/leaves.py:{} has not returned within 1 s".format(tool, line))


def test_code_that_returns_in_time_again_and_again_is_not_given_up(monkeypatch):
    def looks():
        yield from [sys._getframe(), None] * 10
        raise EOFError

    frames, watched = looks(), object()
    # the thread that other tests have watched is another one
    monkeypatch.setattr(extensions, "frame_of",
                        lambda thread: next(frames) if thread is watched else None)
    monkeypatch.setattr(extensions, "frames_of_packages", lambda frame: [frame] if frame else [])
    monkeypatch.setattr(extensions, "WATCH_INTERVAL", 0.001)
    monkeypatch.setattr(extensions, "CODE_LIMIT", 0.001)
    monkeypatch.setattr(extensions.os, "_exit", sys.exit)
    with pytest.raises(EOFError):  # and not SystemExit
        extensions._watch(watched)


def test_what_holds_the_work_up_is_named_with_its_package(tmp_path, monkeypatch):
    (tmp_path / "slow_leaves.py").write_text(
        "import sys\nfrom behavior_controller import extensions\nDURING = extensions.late(2.5)\n"
        "def stuck(): return extensions.late(2.5, sys._getframe())\n"
        "def broken(): 1 / 0\nSPECS = ()")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = extensions._loaded("a", str(tmp_path), "leaves", "slow_leaves").module
    assert str(module.DURING).startswith('package a: leaves="slow_leaves": ')
    stuck = str(module.stuck())
    assert stuck.startswith("package a: ") and "slow_leaves.py:4" in stuck
    with pytest.raises(ZeroDivisionError) as raised:
        module.broken()
    assert str(extensions.thread_failure(raised.value)).startswith("package a: a thread of ")
    assert extensions.thread_failure(ValueError()) is extensions.late(2.5, sys._getframe()) is None


@pytest.mark.parametrize("tool, arguments", TOOLS[:2])
@pytest.mark.parametrize("manifest, code, words", [
    (MANIFEST.format("a", 'leaves="a.leaves"')[:-30], 2, ["package a: ", "package.xml is not XML"]),
    (None, 0,
     ["package a: warning: ", "package.xml cannot be read: it is not a regular file", "left out"]),
])
def test_a_package_xml_that_cannot_be_read_stops_nothing_unless_it_exports_to_us(
        tmp_path, tool, arguments, manifest, code, words):
    package(tmp_path, "", "")
    path = tmp_path / "a" / "package.xml"
    if manifest is None:
        path.unlink()
        os.mkfifo(str(path))
    else:
        path.write_text(manifest)
    found, text = run(tool, *arguments, packages=tmp_path, paths=[tmp_path / "a" / "src"])
    about = [line for line in text.splitlines() if line.startswith(tool + ": package")]
    assert (found, len(about)) == (code, 1), text
    assert all(word in about[0] for word in words)


def test_the_palette_is_xml_whatever_the_text_of_other_packages(tmp_path):
    package(tmp_path, 'leaves="a.leaves"',
            LEAF + "SPECS = (NodeSpec('FixtureLamp', Kind.ACTION, str.title, (Port('colour', "
            "'string', description='a \\x1b[31m \\ud800'),), description='odd\\x00\\x1b'),)")
    there = {"packages": tmp_path, "paths": [tmp_path / "a" / "src"]}
    project = str(tmp_path / "p.btproj")
    assert run("exportNodeModel", "--project", project, **there)[0] == 0
    with open(project, encoding="utf-8") as file:
        for text in (file.read(), run("exportNodeModel", **there)[1]):
            assert ElementTree.fromstring(
                text.encode("utf-8")).find(".//Action[@ID='FixtureLamp']") is not None


@pytest.mark.parametrize("tool", [
    "validateMission", "exportNodeModel", "replayMission", "missionStatus", "missionViewer"])
def test_a_wrong_call_shows_no_control_characters(tmp_path, tool):
    code, text = run(tool, "--\x1b[31m\x07", "\x1b]0;title\x07", packages=tmp_path)
    assert code == 2 and not set("\x1b\x07") & set(text)


def test_the_first_package_of_a_name_counts(tmp_path):
    package(tmp_path / "overlay", "", None)
    package(tmp_path / "underlay", 'leaves="a.leaves"', "1 / 0")
    assert run("exportNodeModel", packages="{0}/overlay:{0}/underlay".format(tmp_path))[0] == 0


def test_a_package_is_found_through_a_link_once(tmp_path):
    package(tmp_path / "else", 'leaves="a.leaves"',
            LEAF + "SPECS = (NodeSpec('FixtureLamp', Kind.ACTION, str.title),)")
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "a").symlink_to(tmp_path / "else" / "a")
    (tmp_path / "src" / "loop").symlink_to(tmp_path / "src")
    code, text = run("exportNodeModel", packages=tmp_path / "src",
                     paths=[tmp_path / "else" / "a" / "src"])
    assert code == 0 and 'ID="FixtureLamp"' in text


# ------------------------------------------------------------------------------- the public names

KINDS = {
    "class": lambda thing: isinstance(thing, type) and not issubclass(thing, Exception),
    "entry": lambda thing: isinstance(thing, Datum),
    "exception": lambda thing: isinstance(thing, type) and issubclass(thing, Exception),
    "function": inspect.isfunction,
    "status": lambda thing: thing in STATUSES,
    "text": lambda thing: isinstance(thing, str),
    "type": lambda thing: not isinstance(thing, type) and hasattr(thing, "__args__")}
"""Whether a public name is of a kind that the reference gives it."""


def guide():
    with open(os.path.join(ROOT, "docs", "extending.md"), encoding="utf-8") as file:
        return file.read()


def public_names():
    """Return name -> kind of each name in the reference's table."""
    with open(os.path.join(ROOT, "docs", "reference.md"), encoding="utf-8") as file:
        table = file.read().split("\n### The names\n")[1].split("\n## ")[0]
    rows = re.findall(r"(?m)^\|[^|]*\| (\w+) \| (`.*) \|$", table)
    assert {kind for kind, _ in rows} == set(KINDS)
    return {name: kind for kind, names in rows
            for name in re.findall(r"`(\w+)`", re.sub(r"\(.*?\)", "", names))}


@pytest.mark.parametrize("name, kind", public_names().items())
def test_a_name_of_the_reference_is_there_and_of_its_kind(name, kind):
    assert KINDS[kind](getattr(extend, name))


def test_the_reference_names_each_public_name():
    assert set(extend.__all__) == set(dir(extend)) == set(public_names())


def test_the_guide_and_the_examples_import_nothing_else_of_this_package():
    codes = re.findall(r"(?ms)^ *```python\n(.*?)^ *```$", guide())
    for place, _, names in itertools.chain.from_iterable(map(os.walk, PACKAGES)):
        for name in names:
            with open(os.path.join(place, name), encoding="utf-8", errors="replace") as file:
                codes += [file.read()]  # of a compiled file too
    imported = re.findall(r"(?m)^ *(?:from|import) +(behavior_controller\S*)", "\n".join(codes))
    assert len(imported) > 8 and set(imported) == {"behavior_controller.extend"}


def test_a_public_name_that_is_mistyped_is_told_with_the_one_that_was_meant():
    with pytest.raises(AttributeError, match=r"has no ServiceLaef \(did you mean ServiceLeaf\?\)"):
        getattr(extend, "ServiceLaef")
    with pytest.raises(AttributeError, match=r"has no Xyz \(docs/reference.md lists the names\)"):
        getattr(extend, "Xyz")


def test_declarations_are_read_without_the_leaves_and_without_py_trees():
    loaded = subprocess.check_output(
        [sys.executable, "-c", "import sys\nfrom behavior_controller.extend import Service, Request"
         "\nprint(*sys.modules)"], env=environment(ROOT, []), universal_newlines=True).split()
    assert "behavior_controller.robot.declarations" in loaded
    assert not {"py_trees", "behavior_controller.leaves", "rospy"} & set(loaded)


FORMER = """
bt: RUNNING SUCCESS FAILURE Decorator
bt.registry: Direction Kind NodeSpec Port
leaves.base: InstantAction ServiceLeaf leaf_spec
leaves.conditions: TopicCondition
robot.declarations: Action Evidence Publication Service Success Topic
robot.requests: Answer NO_EFFECT Request Say Words
robot.gateway: Cause Failure
config.phrases: Speech
missions.trial: Trial"""
"""Where the guide had these names before there was ``extend``: they stay there for a release."""


@pytest.mark.parametrize("line", FORMER.split("\n")[1:])
def test_the_former_places_of_the_names_still_have_them(line):
    module, names = line.split(": ")
    former = importlib.import_module("behavior_controller." + module)
    assert all(getattr(former, name) is getattr(extend, name) for name in names.split())


THREAD = LEAF.replace("Kind,", "InstantAction, Kind,") + """import threading
class FixtureRing(InstantAction):
    def act(self):
        thread = threading.Thread(target=self.ring)
        thread.start()
        thread.join()
    def ring(self):
        1 / 0
"""


def test_a_thread_of_a_leaf_that_fails_is_a_finding_of_the_rehearsal(tmp_path):
    package(tmp_path, LEAVES, THREAD + RINGS)
    (tmp_path / "m.xml").write_text(RINGING)
    code, text = run("rehearseMission", str(tmp_path / "m.xml"), "--faults", "none",
                     packages=tmp_path, paths=[tmp_path / "a" / "src"])
    assert code == 4 and "Traceback" not in text
    assert "m.xml:1:45): package a: a thread of its code has failed: ZeroDivisionError: division " \
        "by zero (a/leaves.py:11)" in text, text


def test_a_thread_that_fails_while_a_leaf_is_made_is_one_line(tmp_path):
    package(tmp_path, LEAVES, THREAD.replace("act(self)", "configure(self)") + """
    def act(self):
        pass
""" + RINGS)
    (tmp_path / "m.xml").write_text(RINGING)
    text = run("validateMission", str(tmp_path / "m.xml"),
               packages=tmp_path, paths=[tmp_path / "a" / "src"])[1]
    assert [line for line in text.splitlines() if " thread " in line] == [
        "validateMission: package a: a thread of its code has failed: ZeroDivisionError: division "
        "by zero (a/leaves.py:11)"] and "Traceback" not in text, text


@pytest.mark.parametrize("declared, words", [
    ("Evidence(BELL, lambda value: value)",
     "is_given of the Evidence of /bell (a/leaves.py:5) does not take 2 arguments"),
    ("Evidence(BELL, is_given_up=lambda value, gaze: value)",
     "is_given_up of the Evidence of /bell (a/leaves.py:5) does not take 1 argument"),
    ("Topic('/bell', 'bell', 'std_msgs/Bool', bool, lambda: True, 'none', False)",
     "read of the Topic of /bell (a/leaves.py:5) does not take 1 argument"),
    ("Service(Say, '/b', 'b', 'a/b', lambda: (), Success('done', True, False), 5.0, '')",
     "fields of the Service of /b (a/leaves.py:5) does not take 1 argument"),
    ("Action(Say, '/b', 'b', 'a/b', str, None, 5.0, '', feedback=lambda: '')",
     "feedback of the Action of /b (a/leaves.py:5) does not take 1 argument")])
def test_a_function_of_wrong_arity_is_told_at_the_import_with_its_place(
        tmp_path, exports, declared, words):
    module = ("from behavior_controller.extend import (\n"
              "    Action, Evidence, Say, Service, Success, Topic)\n"
              "BELL = Topic('/bell', 'bell', 'std_msgs/Bool', bool, bool, 'none', False)\n\n")
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports("interface", INTERFACE, module + declared)
    assert words in str(raised.value)


def test_a_syntax_error_is_named_with_the_folder_of_its_file(exports):
    with pytest.raises(extensions.BrokenExtension) as raised:
        exports("leaves", LEAVES, "\nclass :")
    assert str(raised.value).endswith("SyntaxError: invalid syntax (a/leaves.py:2)")


@pytest.mark.parametrize("does, what", [
    ("1 / 0", "ZeroDivisionError: division by zero"),
    (BLOCKED, "TimeoutError: it has not returned for 1 s")])
def test_a_declaration_that_fails_in_a_rehearsal_is_a_finding_with_its_place(tmp_path, does, what):
    package(tmp_path, 'interface="a.bell" leaves="a.leaves"', """from a.bell import BELL
from behavior_controller.extend import Evidence, TopicCondition, leaf_spec
class FixtureRang(TopicCondition):
    own_evidence = Evidence(BELL)
SPECS = (leaf_spec("FixtureRang", FixtureRang, "Has it rung?"),)
""")
    (tmp_path / "a" / "src" / "a" / "bell.py").write_text("""
from behavior_controller.extend import Topic
def value(seconds):
    %s
BELL = Topic("/bell", "bell", "std_msgs/Bool", bool, bool, "none", False, simulated_value=value)
TOPICS = (BELL,)
""" % does)
    (tmp_path / "m.xml").write_text(
        "<root BTCPP_format='4'><BehaviorTree ID='M'><ReactiveFallback><FixtureRang/>"
        "<Sleep msec='3000'/></ReactiveFallback></BehaviorTree></root>")
    code, text = run("rehearseMission", str(tmp_path / "m.xml"), "--faults", "none", "--visitors",
                     "engages", packages=tmp_path, paths=[tmp_path / "a" / "src"])
    assert code == 4 and "Traceback" not in text, text
    assert what in text and "(a/bell.py:4)" in text, text
