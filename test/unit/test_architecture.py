"""The shape of the code, read from the files with ``ast``: which layer imports which, what a module
owes its reader."""
import ast
import functools
import importlib
import importlib.util
import itertools
import os
import pkgutil
import re
import shutil
import subprocess
from pathlib import Path

import folder_uses
import pytest

from behavior_controller import leaves
from behavior_controller.bt import builtin_specs
from behavior_controller.config import phrases

pytestmark = pytest.mark.slow

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PRODUCT = "behavior_controller"

# From the top: a module imports from its own layer and from those below. The longest name that fits
# decides.
LAYERS = [
    ["behaviorController", "exportNodeModel", "missionStatus", "missionViewer", "py-trees-render",
     "rehearseMission", "replayMission", "tryRobot", "validateMission"],
    ["ros", "cli", "command", "replay_cli"],
    ["simulation"],
    ["missions.blocked_tick", "viewer"],
    ["missions.runner", "missions.validation", "extend"],
    ["missions"],
    ["leaves"],
    ["bt.registry", "bt.status"],
    ["bt"],
    ["run.record"],
    ["bt.linter"],
    ["bt.loader"],
    ["bt.engine"],
    ["bt.script"],
    ["run.statistics"],
    ["run.moment", "run.diagnostics", "run.digest", "run.readiness"],
    ["run.safe_state", "run.story", "run.history"],
    ["run.fold", "run.observed_gateway"],
    ["run.state"],
    ["bt.engine.registry", "robot.gateway", "run.events", "run.from_viewer",
     "run.health", "config", "ros.sinks"],
    ["bt.values", "bt.engine.possible_results"],
    ["robot", "extensions"],
    ["output_files"],
    ["errors", "exit_codes", "ros_arguments"],
    ["ros_packages"],
    ["text", "foreign_code", "folders", "thread_check", "wakeup", "interpreter"]]
ROS = {"actionlib", "actionlib_msgs", "cssr_system", "genpy", "geometry_msgs", "rosgraph",
       "roslaunch", "roslib", "rosnode", "rospy", "rosservice", "rostopic", "std_msgs"}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
LONGEST_FUNCTION = 60  # lines
LONGEST_LINE = 100
MACHINE_PATH = re.compile(r"(?<![\w.>-])/(?:work|root|Users|home/\w+|opt/(?:wheels|pypi))/")


def is_python(path):
    if path.endswith(".py"):
        return True
    with open(path, "rb") as file:
        return file.readline().startswith(b"#!/usr/bin/env python3")


def python_files(*folders):
    """Return the paths, relative to the root, of all modules and executables below ``folders``."""
    found = []
    for folder in folders:
        for place, below, names in os.walk(os.path.join(ROOT, folder)):
            below[:] = [name for name in below if name != "__pycache__"]  # its files come and go
            paths = [os.path.join(place, name) for name in names]
            found += [os.path.relpath(path, ROOT) for path in paths if is_python(path)]
    return sorted(found)


@functools.lru_cache(maxsize=None)
def read(path):
    return Path(os.path.join(ROOT, path)).read_text("utf-8")


@functools.lru_cache(maxsize=None)
def nodes(path):
    """Return the syntax tree of a file and all that is in it."""
    return list(ast.walk(ast.parse(read(path), path, feature_version=(3, 8))))


def parse(path):
    return nodes(path)[0]


def module_name(path):
    """Return ``package.module`` of a path such as ``src/package/module.py``."""
    name = os.path.splitext(path.split("src/", 1)[1])[0].replace("/", ".")
    return name[:-len(".__init__")] if name.endswith(".__init__") else name


MODULES = {module_name(path): path for path in python_files("src", "unit_tests/src")}
OURS = [name for name in MODULES if name.startswith(PRODUCT + ".")]


@functools.lru_cache(maxsize=None)
def imports(name):
    """Return the names that a module imports: of ours the module, not what is taken from it."""
    found = set()
    for node in nodes(MODULES[name]):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "{} imports relatively".format(name)
            for alias in node.names:
                inner = "{}.{}".format(node.module, alias.name)
                found.add(inner if inner in MODULES else node.module)
    return found


def layer(name):
    """Return the index of a module's layer in LAYERS; the package's own docstring lies below all of
    them."""
    inner = name.split(".", 1)[1] if "." in name else ""
    fits = [(len(head), index) for index, heads in enumerate(LAYERS) for head in heads
            if (inner + ".").startswith(head + ".")]
    assert fits or not inner, "{} has no layer: add it to LAYERS".format(name)
    return max(fits)[1] if fits else len(LAYERS)


def outer(name):
    return name.split(".")[0]


def test_imports_point_down():
    assert [(name, other) for name in OURS for other in imports(name)
            if outer(other) == PRODUCT and layer(other) < layer(name)] == []


def test_no_module_imports_itself_through_others():
    graph = {name: imports(name) & set(MODULES) - {name} for name in MODULES}
    while True:  # take away whatever depends on nothing that is left; a circle stays
        free = {name for name, others in graph.items() if not others}
        if not free:
            break
        graph = {name: others - free for name, others in graph.items() if name not in free}
    assert graph == {}


# folders that use each other, until one of them is moved; no further ones may come
CYCLES = set()


def cycles(uses):
    """Return the pairs of folders that use each other, also through others."""
    return {(folder, other) for folder in uses for other in folder_uses.reached(uses, folder)
            if folder < other and folder in folder_uses.reached(uses, other)}


@pytest.mark.parametrize("depth", range(1, 5))
def test_no_two_folders_use_each_other_at_any_depth(depth):
    uses = folder_uses.used(depth)
    assert len(uses) > (20 if depth > 1 else 10)
    assert cycles(uses) == {pair for pair in CYCLES if set(pair) <= set(uses)}


def test_the_table_of_errors_has_each_kind_and_no_other():
    """An error that a new layer raises has to say what becomes of it."""
    bases = {node.name: {getattr(base, "id", getattr(base, "attr", "")) for base in node.bases}
             for name in OURS for node in parse(MODULES[name]).body
             if isinstance(node, ast.ClassDef)}
    kinds = {"BehaviorControllerError"}
    while True:
        more = {name for name, of in bases.items() if of & kinds} - kinds
        if not more:
            break
        kinds |= more
    table = ast.get_docstring(parse(MODULES[PRODUCT + ".errors"])).split("\n\n")[2]
    named = set(re.findall(r"\b[A-Z][a-z]+[A-Za-z]*\b", table))
    assert kinds - {"BehaviorControllerError"} - named == set()
    assert named - set(bases) == set()


# a dotted name, perhaps with arguments; "mission.1.jsonl" is none
REFERENCE = re.compile(r"``([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)(?:\([^`]*\))?``")


def names_in(definition):
    """Return the names that a module or a class defines, with those that methods set."""
    found = set()
    for node in ast.walk(definition):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found.add(node.name)
        elif isinstance(node, (ast.Name, ast.Attribute)) and isinstance(node.ctx, ast.Store):
            found.add(getattr(node, "id", getattr(node, "attr", "")))
    return found


@functools.lru_cache(maxsize=None)
def defined():
    """Return the names that each module, by its dotted name, and each class defines."""
    found = {name: names_in(parse(path)) for name, path in MODULES.items()}
    for path in MODULES.values():
        for node in parse(path).body:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, set()).update(names_in(node))
    return found


def is_stale(reference, module):
    """Return whether a dotted name in ``module`` is neither a module nor defined by what is before
    its last dot: a module or a class, an object of ``module``, or another library."""
    owner, _, name = reference.rpartition(".")
    if any(("." + known).endswith("." + reference) for known in MODULES):
        return False
    owners = [names for known, names in defined().items() if ("." + known).endswith("." + owner)]
    if not owners and owner in defined()[module]:
        owners = [set().union(*defined().values())]
    library = owner.split(".")[0]
    if not owners and importlib.util.find_spec(library) is not None:
        return not hasattr(importlib.import_module(owner), name)
    if library in ROS | {"rospkg"}:  # which not every Python has
        return False
    return not any(name in names for names in owners)


def test_a_name_in_double_backquotes_is_that_of_something():
    assert [(name, reference) for name, path in MODULES.items()
            for reference in set(REFERENCE.findall(read(path))) if is_stale(reference, name)] == []


@pytest.mark.parametrize("reference, stale", [
    ("ros.services", True), ("records.Words", True), ("bt.rules", True), ("Call.dropped", True),
    ("os.pathh", True), ("bt.loader.rules", False), ("requests.Words", False), ("Call.drop", False),
    ("os.path", False), ("gateway.requests", False), ("gateway.nowhere", True)])
def test_a_reference_to_what_is_gone_is_stale(reference, stale):
    assert is_stale(reference, PRODUCT + ".missions.trial") == stale


def test_one_module_reads_what_a_person_configures_line_by_line():
    readers = {}
    for name in OURS:
        if name.startswith(PRODUCT + ".config."):
            readers[name] = re.findall(r"read_text\(|split\(\"\\n\"|splitlines\(",
                                       read(MODULES[name]))
    assert {name for name, calls in readers.items() if calls} == {PRODUCT + ".config.config_file"}


def test_no_two_public_classes_have_one_name():
    """The judge's reference has the same notions as the program, written down independently."""
    owners = {}
    for name in set(MODULES) - {"unit_tests.judge.reference"}:
        for node in parse(MODULES[name]).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                owners.setdefault(node.name, []).append(name)
    assert len(owners) > 200
    assert {name: modules for name, modules in owners.items() if len(modules) > 1} == {}


def test_a_simulated_node_starts_without_the_engine():
    """A launch starts ten of them."""
    uses = {name: imports(name) for name in MODULES}
    reached = folder_uses.reached(uses, "unit_tests.robot.ros_nodes")
    assert PRODUCT + ".wakeup" in reached
    assert [name for name in reached if name.startswith(PRODUCT + ".bt")] == []


def test_the_engine_knows_neither_ros_nor_this_robot():
    below = tuple(PRODUCT + inner for inner in (
        ".bt", ".errors", ".foreign_code", ".interpreter", ".ros_packages", ".text",
        ".thread_check", ".wakeup"))
    assert [(name, other) for name in OURS if name.startswith(PRODUCT + ".bt.")
            for other in imports(name)
            if outer(other) == PRODUCT and not other.startswith(below)] == []


def test_only_the_ros_folder_imports_ros():
    assert [(name, other) for name in OURS if not name.startswith(PRODUCT + ".ros.")
            for other in imports(name) if outer(other) in ROS] == []


def test_only_the_document_imports_lxml():
    assert [name for name in MODULES
            if "lxml" in map(outer, imports(name))] == [PRODUCT + ".bt.loader.document"]


def strings(tree):
    """Return each string constant of a module that is not a docstring, with its line."""
    docstrings = {id(node.body[0].value) for node in ast.walk(tree) if isinstance(node, DOCUMENTED)
                  and node.body and isinstance(node.body[0], ast.Expr)}
    return [(node.lineno, node.value) for node in ast.walk(tree) if isinstance(node, ast.Constant)
            and isinstance(node.value, str) and id(node) not in docstrings]


@functools.lru_cache(maxsize=None)
def own_modules():
    """Return the module of each mission leaf."""
    names = [found.name for found in pkgutil.iter_modules(leaves.__path__, leaves.__name__ + ".")]
    modules = [module for module in map(importlib.import_module, names)
               if getattr(module, "SPECS", leaves.SPECS) is not leaves.SPECS]
    own = {spec.id: module.__name__ for module in modules for spec in module.SPECS}
    own.update((speech.node, PRODUCT + ".config.phrases") for speech in phrases.SPEECHES)
    return own


def named_leaves(tree, own):
    """Return where strings of a module name leaves and nothing else: XML is an example, prose is
    for people."""
    found = [(line, re.findall(r"\w+", text)) for line, text in strings(tree) if "<" not in text]
    return [(line, leaf) for line, words in found if set(words) <= set(own) for leaf in words]


def test_each_mission_leaf_is_listed():
    own = own_modules()
    assert {spec.id for spec in leaves.SPECS} - set(own) == set()
    assert set(own) - {spec.id for spec in leaves.registry().values()
                       } == set(), "not listed in leaves/__init__.py"


def test_a_mission_leaf_is_named_in_its_own_module_alone():
    own = own_modules()
    named = [(name, line, leaf) for name in MODULES
             for line, leaf in named_leaves(parse(MODULES[name]), own) if own[leaf] != name]
    # the other name of a fixed speech stands beside the speeches; the judge of a test has the
    # document's table on its own
    also = (PRODUCT + ".leaves.speech", "unit_tests.judge.reference")
    assert [found for found in named if found[0] not in also] == []


def made_by(spec):
    """Return the class of a node type."""
    made = spec.factory
    if isinstance(made, functools.partial):  # of the class, or of what chooses its constants
        made = made.func if isinstance(made.func, type) else made.args[0]
    return made


def named_classes(tree, classes):
    """Return where a module imports one of ``classes``, or takes it from a module."""
    imported, found = {}, []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if (node.module + "." + alias.name).startswith(WITH_NODES):  # others may need ROS
                    value = getattr(importlib.import_module(node.module), alias.name, None)
                    imported[alias.asname or alias.name] = value
                    found += [(node.lineno, alias.name)] if value in classes else []

    def value_of(node):
        if isinstance(node, ast.Attribute):
            return getattr(value_of(node.value), node.attr, None)
        return imported.get(node.id) if isinstance(node, ast.Name) else None

    return found + [(node.lineno, node.attr) for node in ast.walk(tree)
                    if isinstance(node, ast.Attribute) and value_of(node) in classes]


WITH_NODES = (PRODUCT + ".bt", PRODUCT + ".leaves")
MISSION_LEAVES = [made_by(spec) for spec in leaves.SPECS]
BUILT_IN = {spec.id: made_by(spec) for spec in builtin_specs()}


def test_a_node_type_is_known_by_its_spec_alone():
    """The modules that declare mission leaves share classes; <SubTree> is an element of files."""
    found = []
    for name in set(MODULES) - {"unit_tests.judge.reference"}:
        tree = parse(MODULES[name])
        if name not in own_modules().values():
            found += [(name, named) for named in named_classes(tree, MISSION_LEAVES)]
        if not name.startswith(PRODUCT + ".bt."):
            found += [(name, named) for named in named_classes(tree, list(BUILT_IN.values()))
                      + named_leaves(tree, set(BUILT_IN) - {"SubTree"})]
    assert found == []


@pytest.mark.parametrize("source, found", [
    ("from behavior_controller.leaves.release_1_0 import SayText", [(1, "SayText")]),
    ("from behavior_controller.leaves.release_1_0 import SayText as Says", [(1, "SayText")]),
    ("from behavior_controller.leaves import dialogue\ndialogue.IsYesNoUttered",
     [(2, "IsYesNoUttered")]),
    ("from behavior_controller import leaves\nleaves.dialogue.IsYesNoUttered",
     [(2, "IsYesNoUttered")]),
    ("from behavior_controller.leaves.base import MissionLeaf\nMissionLeaf.spec", [])])
def test_a_class_is_found_wherever_it_comes_from(source, found):
    assert named_classes(ast.parse(source), MISSION_LEAVES) == found


@pytest.mark.parametrize("source", [
    "node == 'Navigate'", "f'{path}/Navigate'", "path.endswith('/Navigate::')", "{'Navigate': 1}",
    "'Navigate SelectExhibit'.split()"])
def test_a_name_is_found_wherever_it_stands(source):
    assert (1, "Navigate") in named_leaves(ast.parse(source), own_modules())


def test_no_file_of_page_or_report_names_a_mission_leaf():
    words = re.compile(r"\b(?:{})\b".format("|".join(own_modules())))
    found = []
    for folder in ("page_files", "report_files"):
        place = os.path.join(ROOT, "src", PRODUCT, "viewer", folder)
        for name in os.listdir(place):
            with open(os.path.join(place, name), encoding="utf-8") as file:
                found += [(name, word) for word in words.findall(file.read())]
    assert found == []


def test_nothing_that_runs_on_the_robot_imports_the_test_package():
    assert [name for name in OURS if "unit_tests" in map(outer, imports(name))] == []


FILES = python_files("src", "unit_tests", "test", "tools")


def test_every_module_says_what_it_is_for():
    assert [path for path in FILES if parse(path).body and not ast.get_docstring(parse(path))] == []


def test_no_function_is_long():
    assert [(path, node.name) for path in FILES for node in nodes(path)
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
            and node.end_lineno - node.lineno >= LONGEST_FUNCTION] == []


def long_lines(path):
    """Return the numbers of lines that are too long. Lines of a text over several lines are data:
    an XML file, a page, an output."""
    long = {number for number, line in enumerate(read(path).split("\n"), 1)
            if len(line) > LONGEST_LINE}
    texts = [node for node in nodes(path) if isinstance(node, ast.Constant)
             and isinstance(node.value, (str, bytes)) and len(node.value.splitlines()) > 1]
    return long.difference(*(range(node.lineno, node.end_lineno + 1) for node in texts))


def test_no_line_is_longer_than_100_characters():
    found = {path: long_lines(path) for path in FILES + python_files("bench")}
    assert {path: numbers for path, numbers in found.items() if numbers} == {}


@pytest.mark.parametrize("package, folder", [("cssr_system", "."), ("unit_tests", "unit_tests")])
def test_every_python_package_is_installed(package, folder):
    text = ast.dump(parse(os.path.join(folder, "setup.py")))
    start = os.path.join(ROOT, folder, "src")
    packages = {os.path.relpath(place, start).replace(os.sep, ".")
                for place, _, names in os.walk(start) if "__init__.py" in names}
    assert packages
    assert {name for name in packages if "'{}'".format(name) not in text} == set()


def test_no_test_imports_another():
    """What they share is in test/support, and fixtures are in conftest.py."""
    found = [path for path in FILES if re.search(r"(?m)^ *(import|from) test_", read(path))]
    assert found == ["test/soak/drawn_trials.py"]  # whose trials are the checks of ROS tests


def test_each_executable_has_a_name_of_its_own():
    """rosrun looks below the whole package, which a clone in a workspace is, and would ask which
    one to run."""
    names = [os.path.basename(path) for path in python_files("src", "unit_tests")
             if not path.endswith(".py")]
    assert len(names) > 15 and len(set(names)) == len(names)


def test_no_file_names_a_place_on_somebodys_machine():
    if not os.path.isdir(os.path.join(ROOT, ".git")) or shutil.which("git") is None:
        pytest.skip("not a git checkout")
    found = []
    listed = subprocess.check_output(["git", "-c", "safe.directory=*", "ls-files"], cwd=ROOT,
                                     text=True)
    for path in listed.splitlines():
        if os.path.isfile(os.path.join(ROOT, path)) and not path.endswith(
            ("test_architecture.py", ".xz")):
            with open(os.path.join(ROOT, path), encoding="utf-8", errors="replace") as file:
                found += ["{}: {}".format(path, match.group())
                          for match in MACHINE_PATH.finditer(file.read())]
    assert found == []


def test_the_architecture_document_names_what_is_there():
    with open(os.path.join(ROOT, "docs", "architecture.md"), encoding="utf-8") as file:
        named = set(re.findall(r"`([\w/]+(?:\.py|/))`", file.read()))
    places = ("src/" + PRODUCT, "unit_tests/src/unit_tests", "unit_tests/src", "unit_tests", ".",
              "test/unit", "unit_tests/test/unit")
    assert len(named) > 20
    assert {name for name in named if not any(
        os.path.exists(os.path.join(ROOT, place, name)) for place in places)} == set()


def members():
    """Return the names in each class of ours, by its name, and in each module, by the last part of
    its name."""
    found = {}
    for name in OURS:
        tree = parse(MODULES[name])
        for head, body in [(name.split(".")[-1], tree.body)] + [
            (node.name, node.body) for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]:
            targets = [target for node in body for target in getattr(node, "targets", [
                getattr(node, "target", node)])]
            found.setdefault(head, set()).update(
                getattr(target, "name", getattr(target, "id", "")) for target in targets)
    return found


def test_the_architecture_document_has_the_order_of_the_folders():
    """A folder uses those to its left; those with a comma between them do not use each other."""
    with open(os.path.join(ROOT, "docs", "architecture.md"), encoding="utf-8") as file:
        line, = re.findall(r"(?m)^`bt/`.*$", file.read())
    groups = [set(re.findall(r"`(\w+)/`", group)) for group in line.split(" < ")]
    uses = folder_uses.used()
    named = set().union(*groups)
    assert named == {folder for folder in uses if os.path.isdir(os.path.join(
        ROOT, "src", PRODUCT, folder))}
    for left, group in zip(itertools.accumulate([set(), *groups], set.union), groups):
        for folder in group:
            assert uses[folder] & named <= left, folder


def test_the_architecture_document_names_what_classes_and_modules_have():
    text = Path(os.path.join(ROOT, "docs", "architecture.md")).read_text("utf-8")
    have = dict(members(),
                ros={name.split(".")[-1] for name in OURS if name.startswith(PRODUCT + ".ros.")})
    named = {(head, name) for head, name in re.findall(r"`(\w+)\.(\w+)(?:\(\))?`", text)
             if name not in ("js", "json", "py")}
    drawn = re.search(r"ros/: ([\w, ]+\w)", text).group(1).split(", ")
    assert len(named) > 8 and len(drawn) > 5
    assert {(head, name) for head, name in named | {("ros", name) for name in drawn}
            if name not in have.get(head, ())} == set()
