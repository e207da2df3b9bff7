"""Measure what the viewer costs the robot: reactions without one, and beside one that is looked at,
stopped, killed or flooded, compared in one run; and the memory of both processes. All runs are
recorded. Prints JSON.

The clients run on the same computer, and take a part of its processor too.
"""
import json
import os
import shutil
import signal
import statistics
import tempfile

from bench_runtime import FACES, NO_FACE, ROUNDS, SAY, VISITOR, Bench, in_ms

TURNS = 5
WITHOUT, LOOKED_AT, STOPPED, KILLED, FLOODED = STATES = (
    "without a viewer", "looked at", "stopped", "killed", "200 clients and garbage")
SIGNALS = {STOPPED: signal.SIGSTOP, KILLED: signal.SIGKILL}


def resident(pid):
    """Return the resident memory of a process in MB."""
    with open("/proc/{}/statm".format(pid)) as file:
        return round(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6, 1)


def reactions(bench, state, memory):
    """Return the reaction times beside a viewer in that state, and note the memory."""
    bench.start(VISITOR, is_watched=state != WITHOUT, how="flood" if state == FLOODED else "look")
    if state in SIGNALS:
        os.kill(bench.node.viewer(), SIGNALS[state])
    taken = [bench.robot.reaction(SAY, FACES, *(NO_FACE if turn % 2 else ()))
             for turn in range(ROUNDS)]
    memory["controller, " + state] = resident(bench.node.process.pid)
    if state not in SIGNALS and state != WITHOUT:
        memory["viewer, " + state] = resident(bench.node.viewer())
    bench.stop()
    return taken


def compared(times, without):
    """Return median and p99 as multiples of those without a viewer."""
    median, p99 = (statistics.median, lambda values: sorted(values)[len(values) * 99 // 100])
    return {"p50": round(median(times) / median(without), 2),
            "p99": round(p99(times) / p99(without), 2)}


def main():
    """Measure everything and print it."""
    folder, taken, memory = tempfile.mkdtemp(), {state: [] for state in STATES}, {}
    bench = Bench(folder)
    bench.keys = {"recordDirectory": bench.records}
    try:
        for _ in range(TURNS):  # in turn, so that compared values come from the same conditions
            for state in STATES:
                taken[state] += reactions(bench, state, memory)
    finally:
        bench.master.terminate()
        bench.master.wait()
        shutil.rmtree(folder)
    print(json.dumps({
        "reaction beside a viewer, ms": {state: in_ms(taken[state]) for state in STATES},
        "to the reaction without one": {
            state: compared(taken[state], taken[WITHOUT]) for state in STATES[1:]},
        "resident memory, MB": memory}, indent=2))


if __name__ == "__main__":
    main()
