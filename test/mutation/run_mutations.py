"""Break the code in one place at a time and see that a test notices.

``python3 test/mutation/run_mutations.py [rules] [sample] [--count N] [--seed S]``: ``rules`` breaks each named rule of
the engine, which the recorded traces or the tests of exact time must notice; ``sample`` draws mutations from all other
modules that know no ROS, of which at least 95 % must be noticed by the tests that run the broken line. Those that change
nothing are listed with the reason in ``changes_nothing.json``. Exit code 0 only if all this holds. Needs Python 3.9.
"""
import argparse
import ast
import concurrent.futures
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
from typing import Dict, List, NamedTuple, Set, Tuple

from mutate import Mutation, Stale, broken, sample
from rules import RULES

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
VECTORS = os.path.join(ROOT, "test", "conformance")
ENGINE = os.path.join("src", "behavior_controller", "bt", "engine")
COPIED = ("src", "unit_tests", "test", "data", "config", "docs", "srv", "msg", "launch", "conftest.py", "pytest.ini",
          "README.md", "setup.py", "package.xml", "CMakeLists.txt", "Makefile")
ROS = {"cssr_system", "genpy", "geometry_msgs", "rosgraph", "roslaunch", "roslib", "rospkg", "rospy", "std_msgs"}
WANTED_SHARE = 0.95
SIDE_BY_SIDE = 2
TEST_LIMIT = 900.0  # seconds
CHANGES_NOTHING = os.path.join(HERE, "changes_nothing.json")


def main(arguments: List[str]) -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(prog="run_mutations", description=__doc__.split("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="rules|sample", help="both, if none is given")
    parser.add_argument("--count", type=int, default=200, help="size of the sample (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="which sample (default %(default)s)")
    chosen = parser.parse_args(arguments)
    parts = chosen.parts or ["rules", "sample"]
    codes = []
    if "rules" in parts:
        codes.append(break_rules())
    if "sample" in parts:
        codes.append(break_sample(chosen.count, chosen.seed))
    return max(codes)


# ------------------------------------------------------------------------------------------------------------ the rules


def break_rules() -> int:
    """Break each rule in turn. Return the exit code."""
    missed = 0
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(os.path.join(ROOT, "src"), os.path.join(scratch, "src"))
        if _traces_notice(scratch):
            print("the engine differs from the traces before any mutation")
            return 1
        for rule in RULES:
            path = os.path.join(scratch, "src", "behavior_controller", "bt", rule.file)
            source = _read(path)
            try:
                _write(path, broken(source, rule))
                noticed = _traces_notice(scratch)
            except Stale as stale:
                noticed = ""
                print("STALE    {}: {}".format(rule.text, stale))
            _write(path, source)
            print("{} {}: {}".format("noticed " if noticed else "MISSED  ", rule.text, noticed), flush=True)
            missed += not noticed
    print("{} passed, {} failed".format(len(RULES) - missed, missed))
    return 1 if missed else 0


def _traces_notice(root: str) -> str:
    """Return the first difference that the traces show on the engine below ``root``, or an empty text."""
    environment = dict(os.environ, PYTHONPATH=os.path.join(root, "src"), PYTHONDONTWRITEBYTECODE="1")
    for vectors in ("hand", "random.jsonl.xz"):
        command = [sys.executable, os.path.join(VECTORS, "harness.py"), os.path.join(VECTORS, vectors),
                   "--may-differ", os.path.join(VECTORS, "may_differ.json")]
        try:
            done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  timeout=120, check=False)
        except subprocess.TimeoutExpired:
            return "no end"
        if done.returncode != 0:
            lines = done.stdout.decode(errors="replace").splitlines() or ["no output"]
            return "{} ({})".format(lines[0][:90], lines[-1])
    # the traces of real time only tell the results; what happens when is tested under a clock of the test's own
    timing = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull,
                             "-k", "time", os.path.join(ROOT, "test", "unit", "test_tree.py")], env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120, check=False)
    return timing.stdout.decode(errors="replace").splitlines()[-1] if timing.returncode != 0 else ""


# ----------------------------------------------------------------------------------------------------------- the sample


class Judged(NamedTuple):
    """A mutation, and the test that noticed it; empty: none did."""

    mutation: Mutation
    noticed: str


def break_sample(count: int, seed: int) -> int:
    """Break a sample of the other pure modules. Return the exit code."""
    excused = {tuple(entry["key"]): entry["reason"] for entry in json.loads(_read(CHANGES_NOTHING))}
    mutations = sample([(path, _read(os.path.join(ROOT, path))) for path in pure_modules()], count, seed)
    with tempfile.TemporaryDirectory() as scratch:
        places: "queue.Queue[str]" = queue.Queue()
        for number in range(SIDE_BY_SIDE):
            place = os.path.join(scratch, str(number))
            _copy(place)
            places.put(place)
        reached = Reached(os.path.join(scratch, "0"))
        with concurrent.futures.ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            judged = []
            for result in pool.map(lambda mutation: _judge(mutation, reached, places), mutations):
                judged.append(result)
                _show(result, excused)
    return _sum(judged, excused)


def _judge(mutation: Mutation, reached: "Reached", places: "queue.Queue[str]") -> Judged:
    place = places.get()
    path = os.path.join(place, mutation.file)
    source = _read(path)
    try:
        _write(path, mutation.source)
        return Judged(mutation, _tests_notice(place, reached.tests(mutation.file, mutation.line)))
    finally:
        _write(path, source)
        places.put(place)


def _show(result: Judged, excused: Dict[Tuple[str, ...], str]) -> None:
    mutation, noticed = result
    word = "noticed" if noticed else "excused" if mutation.key in excused else "MISSED "
    print("{} {}:{} {}: {}  ->  {}  {}".format(
        word, mutation.file, mutation.line, mutation.scope, " ".join(mutation.old.split())[:100],
        " ".join(mutation.new.split())[:100], noticed), flush=True)


def _sum(judged: List[Judged], excused: Dict[Tuple[str, ...], str]) -> int:
    noticed = sum(bool(result.noticed) for result in judged)
    changes = sum(bool(result.noticed) or result.mutation.key not in excused for result in judged)
    share = noticed / changes if changes else 1.0
    print("{} of {} noticed ({:.1%}; wanted: {:.0%}), {} change nothing".format(
        noticed, changes, share, WANTED_SHARE, len(judged) - changes))
    return 0 if share >= WANTED_SHARE else 1


def pure_modules() -> List[str]:
    """Return the modules of both packages that import no ROS and do not belong to the engine's rules."""
    found = []
    for start in ("src", os.path.join("unit_tests", "src")):
        for place, _, names in os.walk(os.path.join(ROOT, start)):
            paths = [os.path.relpath(os.path.join(place, name), ROOT) for name in names if name.endswith(".py")]
            found += [path for path in paths if not path.startswith(ENGINE) and not _imports(path) & ROS]
    return sorted(found)


def _imports(path: str) -> Set[str]:
    found: Set[str] = set()
    for node in ast.walk(ast.parse(_read(os.path.join(ROOT, path)))):
        if isinstance(node, ast.Import):
            found.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").split(".")[0])
    return found


def _copy(place: str) -> None:
    for name in COPIED:
        source, target = os.path.join(ROOT, name), os.path.join(place, name)
        if os.path.isdir(source):
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "*.pyc"))
        elif os.path.exists(source):
            os.makedirs(place, exist_ok=True)
            shutil.copy(source, target)


def _pytest(place: str, *arguments: str, **more: str) -> "subprocess.CompletedProcess[str]":
    environment = dict(os.environ, PYTHONDONTWRITEBYTECODE="1", MISSION_MUTANTS="30", **more)
    environment["PYTHONPATH"] = os.pathsep.join([os.path.join(place, "src"), os.path.join(place, "unit_tests", "src"),
                                                 environment.get("PYTHONPATH", "")])
    return subprocess.run([sys.executable, "-m"] + list(arguments), cwd=place, env=environment, check=False, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=TEST_LIMIT)


def _tests_notice(place: str, tests: List[str]) -> str:
    """Return the first test that fails, or an empty text."""
    if not tests:
        return ""
    try:
        done = _pytest(place, "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests)
    except subprocess.TimeoutExpired:
        return "no end"
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return "" if done.returncode == 0 else failed[0][:100] if failed else "exit code {}".format(done.returncode)


class Reached:
    """Which tests run which line, as coverage saw it once on the unbroken code."""

    def __init__(self, place: str):
        settings = os.path.join(place, "coverage.ini")
        data = os.path.join(place, "coverage.data")
        _write(settings, "[run]\ndynamic_context = test_function\ndata_file = {}\nsource =\n  src\n  unit_tests/src\n"
               .format(data))
        done = _pytest(place, "coverage", "run", "--rcfile", settings, "-m", "pytest", "-q", "-p", "no:cacheprovider")
        if done.returncode != 0:
            sys.exit("the tests fail before any mutation:\n" + done.stdout[-3000:])
        self._place = place
        self._files = {os.path.splitext(name)[0]: os.path.relpath(os.path.join(folder, name), place)
                       for folder, _, names in os.walk(place) for name in names
                       if name.startswith("test_") and name.endswith(".py")}
        self._by_line = self._load(data)

    def _load(self, data: str) -> Dict[Tuple[str, int], Set[str]]:
        from coverage import CoverageData  # the tests themselves do without it
        measured = CoverageData(data)
        measured.read()
        found: Dict[Tuple[str, int], Set[str]] = {}
        for file in measured.measured_files():
            name = os.path.relpath(file, self._place)
            for line, contexts in measured.contexts_by_lineno(file).items():
                found[name, line] = {context for context in contexts if context}
        return found

    def tests(self, file: str, line: int) -> List[str]:
        """Return the tests that run the line, those of few lines first; of the whole module, if none does."""
        contexts = self._by_line.get((file, line)) or {
            context for (name, _), tests in self._by_line.items() if name == file for context in tests}
        return sorted(filter(None, map(self._node_id, contexts)))

    def _node_id(self, context: str) -> str:
        module, _, name = context.partition(".")
        return "{}::{}".format(self._files[module], name.replace(".", "::")) if module in self._files else ""


def _read(path: str) -> str:
    with open(path, encoding="utf-8") as file:
        return file.read()


def _write(path: str, text: str) -> None:
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
