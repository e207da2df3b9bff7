"""Break the code in one place at a time and see that a test notices.

``python3 test/mutation/run_mutations.py [rules] [sample] [--count N] [--seed S …] [--below PATH]``:
``rules`` breaks each named rule of the engine, which the recorded traces or the tests of the engine
must notice; ``sample`` draws mutations from all modules, of which at least 97 % must be noticed by
the tests that run the broken line, within three minutes; those that need a ROS master do not run.
The others are read one by one: a mutation may change nothing. Exit code 0 only if all this holds.
Needs Python 3.9.
"""
import argparse
import concurrent.futures
import configparser
import glob
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import List, NamedTuple, Optional, Set, Tuple

from mutate import Mutation, Stale, broken, sample
from reached import SETTINGS, Reached
from rules import RULES

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
VECTORS = os.path.join(ROOT, "test", "conformance")
NOT_COPIED = (".git", "build", "__pycache__", ".pytest_cache")
WANTED_SHARE = 0.97
PROOFS = (
    # traces of real time only show the results; the order of events is tested under a test clock
    ("test/unit/test_tree.py", "test/unit/test_ports.py", "test/unit/test_py_trees.py"),
    ("test/conformance/test_conformance.py", "-k", "counts_as_true"))
"""What shows the rules that the traces do not, as arguments of pytest."""

RUN_LIMIT = 1800.0  # seconds
JUDGE_LIMIT = 180.0
# tests that are run by themselves first: most mutations fall to one of them, and pytest collects
# them soon
FIRST = 12


def main(arguments: List[str]) -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(prog="run_mutations", description=__doc__.split("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="rules|sample", help="both, if none is given")
    parser.add_argument("--count", type=int, default=200,
                        help="size of the sample (default %(default)s)")
    parser.add_argument("--seed", type=int, nargs="+", default=[1],
                        help="which samples (default 1)")
    parser.add_argument("--below", default="", metavar="PATH",
                        help="sample only the modules whose path begins so (src/…/ros)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="how many are judged side by side "
        "(default: as many as there are processors)")
    chosen = parser.parse_args(arguments)
    if sys.version_info < (3, 9):
        print("mutations need Python 3.9, which writes a syntax tree as code; this is {}.{}".format(
            *sys.version_info))
        return 2
    known = ["rules", "sample"]
    parts = chosen.parts or known
    unknown = set(parts).difference(known)
    if unknown:
        parser.error("no such part: {}; there are rules and sample".format(", ".join(unknown)))
    files = [path for path in modules() if path.startswith(chosen.below)]
    if not files:
        parser.error("no module's path begins with {}".format(chosen.below))
    codes = []
    if "rules" in parts:
        codes.append(break_rules())
    if "sample" in parts:
        codes.append(break_samples(files, chosen.count, chosen.seed, chosen.jobs))
    return max(codes)


# ---------------------------------------------------------------------------------------- the rules


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
            print("{} {}: {}".format("noticed " if noticed else "MISSED  ", rule.text, noticed),
                  flush=True)
            missed += not noticed
    print("{} passed, {} failed".format(len(RULES) - missed, missed))
    return 1 if missed else 0


def _traces_notice(root: str) -> str:
    """Return the first difference that the traces show on the engine below ``root``, or an empty
    text."""
    environment = dict(os.environ, PYTHONPATH=os.path.join(root, "src"),
                       PYTHONDONTWRITEBYTECODE="1")
    for vectors in ("hand", "random.jsonl.xz"):
        command = [sys.executable, os.path.join(VECTORS, "harness.py"),
                   os.path.join(VECTORS, vectors), "--may-differ",
                   os.path.join(VECTORS, "may_differ.json")]
        try:
            done = subprocess.run(command, env=environment, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, timeout=120, check=False)
        except subprocess.TimeoutExpired:
            return "no end"
        if done.returncode != 0:
            lines = done.stdout.decode(errors="replace").splitlines() or ["no output"]
            return "{} ({})".format(lines[0][:90], lines[-1])
    for words in PROOFS:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull,
             "--noconftest", *words], cwd=ROOT, env=environment, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, timeout=120, check=False)
        text = done.stdout.decode(errors="replace").strip()
        if done.returncode not in (0, 1):
            sys.exit("the tests of the rules cannot be run (exit code {}):\n{}".format(
                done.returncode, text[-3000:]))
        if done.returncode:
            return text.splitlines()[-1]
    return ""


# --------------------------------------------------------------------------------------- the sample


class Judged(NamedTuple):
    """A mutation, and the test that noticed it; empty: none did."""

    mutation: Mutation
    noticed: str


def break_samples(files: List[str], count: int, seeds: List[int], jobs: int) -> int:
    """Break a sample of these modules for each seed, each job in a copy of its own. Return the exit
    code."""
    sources = [(path, _read(os.path.join(ROOT, path))) for path in files]
    # before the notes are read: with those in memory it takes minutes
    samples, codes = [(seed, sample(sources, count, seed)) for seed in seeds], []
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(
            jobs) as pool:
        places = [os.path.join(scratch, str(number)) for number in range(jobs)]
        free: "queue.SimpleQueue[str]" = queue.SimpleQueue()
        for place in places:
            shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(*NOT_COPIED))
            free.put(place)
        parts = list(pool.map(measure, places, dealt(jobs)))
        measured, failing = Reached(places), set().union(*parts)
        for seed, mutations in samples:
            judged = []
            for result in pool.map(lambda mutation: judge(free, mutation, measured, failing),
                                   mutations):
                judged.append(result)
                _show(result)
            print("seed {}: ".format(seed), end="")
            codes.append(_sum(judged))
    return max(codes)


def dealt(jobs: int) -> List[List[str]]:
    """Return the files with tests, dealt to so many jobs by their size."""
    settings = configparser.ConfigParser()
    settings.read(os.path.join(ROOT, "pytest.ini"))
    files = [path for folder in settings["pytest"]["testpaths"].split()
             for path in glob.glob(os.path.join(ROOT, folder, "**", "test_*.py"), recursive=True)]
    # ROS nodes
    files = [path for path in files if os.path.basename(os.path.dirname(path)) != "rostest"]
    files.sort(key=os.path.getsize)
    return [[os.path.relpath(path, ROOT) for path in files[job::jobs]] for job in range(jobs)]


def measure(place: str, files: List[str]) -> Set[str]:
    """Run the tests in ``files`` below ``place``, and note there what they run. Return those that
    fail unbroken."""
    settings = os.path.join(place, "coverage.ini")
    os.mkdir(os.path.join(place, "notes"))
    _write(settings, SETTINGS.format(place=place))
    code, output = _pytest(place, files, COVERAGE_PROCESS_START=settings)
    if code not in (0, 1):
        sys.exit("the tests cannot be run (exit code {}):\n{}".format(code, output[-3000:]))
    failing = set(_failures(output))
    if failing:  # those with a limit of time may pass as soon as nothing is measured
        failing = set(_failures(_pytest(place, sorted(failing))[1]))
    for test in sorted(failing):
        print("left out, since it fails before any mutation: {}".format(test), flush=True)
    return failing


def judge(free: "queue.SimpleQueue[str]", mutation: Mutation, measured: Reached,
          failing: Set[str]) -> Judged:
    """Run the tests of a broken line in a free place."""
    tests = [test for test in measured.tests(mutation.file, mutation.line) if test not in failing]
    place = free.get()
    try:
        return Judged(mutation, _notices(place, mutation, tests) if tests else "")
    finally:
        free.put(place)


def _notices(place: str, mutation: Mutation, tests: List[str]) -> str:
    """Return the test that notices the mutation, or an empty text."""
    path = os.path.join(place, mutation.file)
    source = _read(path)
    _write(path, mutation.source)
    ends = time.monotonic() + JUDGE_LIMIT
    try:
        code, output = _pytest(place, ["-x"] + tests[:FIRST], JUDGE_LIMIT)
        if code is None:  # so few tests do not take that long
            return "no end"
        if code == 0 and tests[FIRST:]:
            code, output = _pytest(place, ["-x"] + tests[FIRST:], ends - time.monotonic())
    finally:
        _write(path, source)
    if code is None or code == 0:
        return ""
    failures = _failures(output)
    if code == 1 and not failures:
        sys.exit("the tests cannot be run (exit code {}):\n{}".format(code, output[-3000:]))
    return "no end" if code == -signal.SIGALRM else (failures + ["exit code {}".format(code)])[0]


def _show(result: Judged) -> None:
    mutation, noticed = result
    print("{} {}:{} {}: {}  {}".format("noticed" if noticed else "MISSED ", mutation.file,
                                       mutation.line, mutation.scope, mutation.difference(),
                                       noticed), flush=True)


def _sum(judged: List[Judged]) -> int:
    noticed = sum(bool(result.noticed) for result in judged)
    share = noticed / len(judged)
    print("{} of {} noticed ({:.1%}; wanted: {:.0%})".format(noticed, len(judged), share,
                                                             WANTED_SHARE))
    return 0 if share >= WANTED_SHARE else 1


def modules() -> List[str]:
    """Return the modules of both packages."""
    found = [os.path.relpath(path, ROOT) for start in ("src", os.path.join("unit_tests", "src"))
             for path in glob.glob(os.path.join(ROOT, start, "**", "*.py"), recursive=True)]
    return sorted(found)


def _pytest(place: str, arguments: List[str], limit: float = RUN_LIMIT,
            **more: str) -> Tuple[Optional[int], str]:
    """Run tests below ``place``. Return the exit code, None after ``limit`` seconds, and what was
    printed."""
    environment = dict(os.environ, PYTHONDONTWRITEBYTECODE="1", MISSION_MUTANTS="30", **more)
    environment["PYTHONPATH"] = os.pathsep.join([
        os.path.join(place, "src"), os.path.join(place, "unit_tests", "src"), HERE,
        environment.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:cacheprovider", "-p",
               "reached"] + arguments
    with tempfile.TemporaryFile("w+", errors="replace") as output:
        tests = subprocess.Popen(command, cwd=place, env=environment, stdout=output,
                                 stderr=subprocess.STDOUT, start_new_session=True)
        try:
            code = tests.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _end(tests)
        output.seek(0)
        return code, output.read()


def _end(tests: "subprocess.Popen[bytes]") -> None:
    """End the tests and what they started."""
    try:
        os.killpg(tests.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass  # nothing is left
    tests.wait()


def _failures(output: str) -> List[str]:
    """Return the tests that failed, without their parameters; a line that a test logs is not among
    them."""
    return re.findall(r"^(?:FAILED|ERROR) ([^\s\[]+\.py[^\s\[]*)", output, re.MULTILINE)


def _read(path: str) -> str:
    return Path(path).read_text("utf-8")


def _write(path: str, text: str) -> None:
    Path(path).write_text(text, "utf-8")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
