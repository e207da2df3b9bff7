"""Break one rule of the engine at a time and see that the recorded traces, or the tests of exact time, notice.

``python3 test/mutation/run_mutations.py`` works on a copy of the sources; exit code 0 only if every mutation is noticed.
"""
import os
import shutil
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
VECTORS = os.path.join(ROOT, "test", "conformance")

# the rule that is broken, file below bt/, a text of it, what the text becomes
MUTATIONS = (
    ("Sequence and Fallback reset their children when they end early",
     "engine/controls.py",
     "        self.halt_children()\n"
     "        self.index = 0\n"
     "        return self.ends_at",
     "        self.index = 0\n"
     "        return self.ends_at"),
    ("Sequence and Fallback start anew after they ended early",
     "engine/controls.py",
     "        self.halt_children()\n"
     "        self.index = 0\n"
     "        return self.ends_at",
     "        self.halt_children()\n"
     "        return self.ends_at"),
    ("Sequence starts anew after its last child",
     "engine/controls.py",
     "        self.index = self.skipped = 0\n"
     "        return SKIPPED if all_skipped else self.goes_on_at",
     "        return SKIPPED if all_skipped else self.goes_on_at"),
    ("a Sequence of skipped children is SKIPPED",
     "engine/controls.py",
     "return SKIPPED if all_skipped else self.goes_on_at",
     "return self.goes_on_at"),
    ("the count of skipped children lasts over ticks",
     "engine/controls.py",
     "            if self.status is IDLE:\n"
     "                self.skipped = 0\n"
     "            self.store(RUNNING)",
     "            self.skipped = 0\n"
     "            self.store(RUNNING)\n"
     "        self.skipped = 0"),
    ("a halted Sequence starts anew",
     "engine/controls.py",
     "        self.index = self.skipped = 0\n"
     "        super().halt()",
     "        super().halt()"),
    ("AsyncSequence gives way only after a child that was idle",
     "engine/controls.py",
     "if was_idle and self.index < count and self.yields():",
     "if self.index < count and self.yields():"),
    ("giving way signals a wake-up",
     "engine/controls.py",
     "        self.wake()\n"
     "        return True",
     "        return True"),
    ("SequenceWithMemory gives way",
     "engine/controls.py",
     "class SequenceWithMemory(AsyncSequence):",
     "class SequenceWithMemory(Sequence):"),
    ("SequenceWithMemory keeps the status of earlier children on failure",
     "engine/controls.py",
     "        for child in self.children[self.index:]:",
     "        for child in self.children:"),
    ("SequenceWithMemory keeps its place when halted",
     "engine/controls.py",
     "    def halt(self) -> None:\n"
     "        \"\"\"Halt the children; keep the place.\"\"\"\n"
     "        Control.halt(self)",
     "    pass"),
    ("Fallback ends at SUCCESS",
     "engine/controls.py",
     "class Fallback(_InOrder, composites.Selector):\n"
     "    \"\"\"Children in order until one succeeds.\"\"\"\n"
     "\n"
     "    ends_at = SUCCESS",
     "class Fallback(_InOrder, composites.Selector):\n"
     "    \"\"\"Children.\"\"\"\n"
     "\n"
     "    ends_at = RUNNING"),
    ("a reactive node halts its other children while one is RUNNING",
     "engine/controls.py",
     "                self.others_halted(index)\n"
     "                return RUNNING",
     "                return RUNNING"),
    ("a reactive node resets a skipped child",
     "engine/controls.py",
     "                skipped += 1\n"
     "                halt_child(child)",
     "                skipped += 1"),
    ("a reactive node resets its children at the end",
     "engine/controls.py",
     "            if result is self.ends_at:\n"
     "                self.halt_children()\n"
     "                return result",
     "            if result is self.ends_at:\n"
     "                return result"),
    ("Parallel fails when it can no longer succeed",
     "engine/controls.py",
     "if count - self.failures < needed or self.failures == allowed:",
     "if self.failures == allowed:"),
    ("Parallel fails at failure_count",
     "engine/controls.py",
     "self.failures == allowed:",
     "self.failures > allowed:"),
    ("skipped children count as successes if success_count is negative",
     "engine/controls.py",
     "(skips_count and self.successes + skipped >= needed)",
     "False"),
    ("Parallel does not tick a completed child again",
     "engine/controls.py",
     "            if index not in self.completed and self.execute_child(index) is SKIPPED:",
     "            if self.execute_child(index) is SKIPPED:"),
    ("ParallelAll fails at max_failures",
     "engine/controls.py",
     "FAILURE if self.failures >= allowed else SUCCESS",
     "FAILURE if self.failures > allowed else SUCCESS"),
    ("Parallel resets its children at the end",
     "engine/controls.py",
     "        self.clear()\n"
     "        self.halt_children()\n"
     "        return result",
     "        self.clear()\n"
     "        return result"),
    ("IfThenElse takes the second child on SUCCESS",
     "engine/controls.py",
     "            self.branch = 1 if result is SUCCESS else 2",
     "            self.branch = 2 if result is SUCCESS else 1"),
    ("IfThenElse asks its condition again after a branch",
     "engine/controls.py",
     "        self.branch = 0\n"
     "        return self.finished(result)",
     "        return self.finished(result)"),
    ("WhileDoElse halts the other branch",
     "engine/controls.py",
     "            halt_child(self.children[2 if condition is SUCCESS else 1])",
     "            pass"),
    ("Switch halts a child that is no longer chosen",
     "engine/controls.py",
     "        if self.running is not None and self.running != chosen:\n"
     "            halt_child(self.children[self.running])",
     "        pass"),
    ("TryCatch stays in its catch child",
     "engine/controls.py",
     "                self.catching = True\n"
     "                return self._catch()",
     "                return self._catch()"),
    ("TryCatch fails after its catch child",
     "engine/controls.py",
     "        self._end()\n"
     "        return FAILURE",
     "        self._end()\n"
     "        return SUCCESS"),
    ("TryCatch catches a halt only in its try block",
     "engine/controls.py",
     "not self.catching and self._catches_on_halt()",
     "self._catches_on_halt()"),
    ("Inverter turns FAILURE round",
     "engine/decorators.py",
     "        return SUCCESS if result is FAILURE else result",
     "        return result"),
    ("ForceFailure fails",
     "engine/decorators.py",
     "    forced = FAILURE",
     "    forced = SUCCESS"),
    ("KeepRunningUntilFailure is RUNNING after a success",
     "engine/decorators.py",
     "return FAILURE if self.tick_child() is FAILURE else RUNNING",
     "return self.tick_child()"),
    ("Repeat gives way after a round done at once",
     "engine/decorators.py",
     "                if was_idle and go:\n"
     "                    self.wake()\n"
     "                    return RUNNING",
     "                if False:\n"
     "                    return RUNNING"),
    ("Repeat counts from the start after a failure",
     "engine/decorators.py",
     "                self.count = 0\n"
     "                halt_child(self.decorated)\n"
     "                return result",
     "                halt_child(self.decorated)\n"
     "                return result"),
    ("Retry reads its port again after a failure",
     "engine/decorators.py",
     "        return self._limit()",
     "        return limit"),
    ("RunOnce remembers completions only",
     "engine/decorators.py",
     "        if result is SUCCESS or result is FAILURE:\n"
     "            self.result = result",
     "        self.result = result"),
    ("Precondition does not ask again while its child runs",
     "engine/decorators.py",
     "        if not self.latched:\n"
     "            self.latched = to_bool",
     "        if True:\n"
     "            self.latched = to_bool"),
    ("Precondition asks again after its child completed",
     "engine/decorators.py",
     "            self.latched = False",
     "            pass"),
    ("Timeout fails at expiry",
     "engine/decorators.py",
     "        if self.expired:\n"
     "            self.active = False\n"
     "            return FAILURE",
     "        pass"),
    ("Timeout halts its child at expiry",
     "engine/decorators.py",
     "            halt_child(self.decorated)\n"
     "            self.wake()",
     "            self.wake()"),
    ("Delay waits",
     "engine/decorators.py",
     "        if not self.over:\n"
     "            return RUNNING",
     "        pass"),
    ("a Loop is RUNNING after each item",
     "engine/decorators.py",
     "return FAILURE if result is FAILURE else RUNNING",
     "return result"),
    ("SkipUnlessUpdated remembers what it has seen",
     "engine/decorators.py",
     "            self.seen = sequence",
     "            pass"),
    ("a decorator resets its completed child before it changes itself",
     "engine/decorators.py",
     "            self.decorated.reset()\n"
     "        return result",
     "            pass\n"
     "        return result"),
    ("WasEntryUpdated remembers",
     "engine/builtins.py",
     "        self.seen = entry.sequence\n"
     "        self.services.changes += 1\n"
     "        return SUCCESS",
     "        return SUCCESS"),
    ("_while halts a running node",
     "engine/node.py",
     "                    self.halt_node()\n"
     "                    return SKIPPED",
     "                    return SKIPPED"),
    ("_onHalted runs on a halt",
     "engine/node.py",
     "        self.halt()\n"
     "        self._run_after(\"_onHalted\")",
     "        self.halt()"),
    ("_post runs after SUCCESS",
     "engine/node.py",
     "            self._run_after(\"_onSuccess\", \"_post\")",
     "            self._run_after(\"_onSuccess\")"),
    ("pre-conditions are asked of an IDLE node only",
     "engine/node.py",
     "        if status is IDLE:\n"
     "            for attribute, script in self.before:",
     "        if status is not RUNNING:\n"
     "            for attribute, script in self.before:"),
    ("a completed action that was not reset returns its result again",
     "engine/leaf.py",
     "        else:\n"
     "            return status",
     "        else:\n"
     "            result, callback = self.on_start(), \"onStart\""),
    ("haltTree runs every _onHalted",
     "engine/tree.py",
     "        for node in self.nodes:\n"
     "            node.halt_node()",
     "        pass"),
    ("a completed root is reset",
     "engine/tree.py",
     "            self.root.reset()\n"
     "        return result",
     "            pass\n"
     "        return result"),
)


def notices(root):
    """Return the first difference that the traces show on the engine below ``root``, or an empty text."""
    environment = dict(os.environ, PYTHONPATH=os.path.join(root, "src"), PYTHONDONTWRITEBYTECODE="1")
    for vectors in ("hand", "random.jsonl.xz"):
        try:
            done = subprocess.run(
                [sys.executable, os.path.join(VECTORS, "harness.py"), os.path.join(VECTORS, vectors),
                 "--may-differ", os.path.join(VECTORS, "may_differ.json")],
                env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120, check=False)
        except subprocess.TimeoutExpired:
            return "no end"
        if done.returncode != 0:
            lines = done.stdout.decode(errors="replace").splitlines() or ["no output"]
            return "{} ({})".format(lines[0][:90], lines[-1])
    # the traces of real time only tell the results; what happens when is tested under a clock of the test's own
    timing = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, "-k", "time",
                             os.path.join(ROOT, "test", "unit", "test_tree.py")],
                            env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120, check=False)
    return timing.stdout.decode(errors="replace").splitlines()[-1] if timing.returncode != 0 else ""


def main():
    """Apply each mutation in turn. Return the exit code."""
    missed = 0
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(os.path.join(ROOT, "src"), os.path.join(scratch, "src"))
        if notices(scratch):
            print("the engine differs from the traces before any mutation")
            return 1
        for rule, name, old, new in MUTATIONS:
            path = os.path.join(scratch, "src", "behavior_controller", "bt", name)
            with open(path, encoding="utf-8") as file:
                text = file.read()
            if old not in text:
                print("STALE    {}: the text of this mutation is not in {}".format(rule, name))
                missed += 1
                continue
            with open(path, "w", encoding="utf-8") as file:
                file.write(text.replace(old, new, 1))
            noticed = notices(scratch)
            print("{} {}: {}".format("noticed " if noticed else "MISSED  ", rule, noticed), flush=True)
            missed += not noticed
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
    print("{} passed, {} failed".format(len(MUTATIONS) - missed, missed))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
