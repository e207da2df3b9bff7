#!/usr/bin/env python3
"""Run the lab tour on the real node against a robot that fails as planned, and compare every run
with an independent model.

``soak.py sweep|pairs|rates|stops|adversary|broken|sound [--short] [--seed N] [--only WORD]``.
sweep: each call of the tour meets each kind of fault. pairs: 200 tours with two random faults.
rates: 20 tours for each failure rate, by voice and by tablet. stops: a signal during each call.
adversary: the trials of ``adversary.py``. broken, sound: the judge of a test is tried with broken
controllers, and with 10,000 settings of the sound one, in virtual time, see ``judge_trials.py``.
Exit code 0 if every tour ended as predicted, with the calls and the failures in the log as
predicted, and every trial as it should.
"""
import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import threading
import time

import rospy

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "rostest")]
import adversary  # noqa: E402
import judge_trials  # noqa: E402
import trial  # noqa: E402
from faulty_robot import FaultyRobot  # noqa: E402
from robot import Controller, Package, start_master  # noqa: E402
from tour_model import (  # noqa: E402
    ANIMATION, ATTENTION, FAULTS, SAY, SERVICES, TABLET, Attempt, tour_with)

# s, of every service: only a call that is to hang may take longer, also on a busy machine
DEADLINE = 4.0
RATES = (0.0, 0.1, 0.3, 0.6, 1.0)
STOP_LIMIT = 2.0
SAFE_STATE = [Attempt("safe state", service, "", False, None) for service in (ATTENTION, ANIMATION)]
"""What the node asks for when its last pass is over."""


class Soak:
    """The robot, and one controller after another."""

    def __init__(self, folder):
        self.robot = FaultyRobot()
        self.package = Package(os.path.join(folder, "package"))
        policy = self.package.path("config/recoveryPolicy.ini")
        with open(policy) as file:
            text = file.read()
        self.package.write(
            "config/recoveryPolicy.ini",
            text.replace("budget 30 600", "budget 99 1").replace("pause 10 300", "pause 1 1"))

    def controller(self, runs, by_voice):
        """Start the node."""
        deadlines = {service.split("/")[1].replace("Behaviour", "Behavior")
                     + "Deadline": str(DEADLINE) for service in SERVICES}
        self.package.configure(verboseMode="true", asrEnabled=str(by_voice).lower(),
                               missionRuns=str(runs), **deadlines)
        return Controller(self.package)

    def run(self, tours, by_voice=True):
        """Run ``tours`` as passes of one node, after a clean one, and return the problems."""
        tours = [tour_with({}, by_voice)] + tours
        attempts = [attempt for tour in tours for attempt in tour.attempts] + SAFE_STATE
        controller = self.controller(len(tours), by_voice)
        try:
            problems = self.robot.play(attempts, controller.lines,
                                       lambda: controller.process.poll() is not None)
            outcomes = [tour.outcome for tour in tours]
            if not problems and self.robot.outcomes != outcomes:
                problems = ["outcomes {}, expected {}".format(self.robot.outcomes, outcomes)]
            if not problems and controller.wait(10) != (0 if outcomes[-1] == "SUCCESS" else 3):
                problems = ["exit code {}".format(controller.process.returncode)]
            return ["{}\n{}".format(problem, "\n".join(controller.lines.text().splitlines()[-12:]))
                    for problem in problems]
        finally:
            controller.close()

    def stop_at(self, number, sign):
        """Send a signal during call ``number`` of a tour; return the problems and the seconds that
        the end took."""
        tour = tour_with({})
        controller = self.controller(1, True)
        sent, ended = [], []

        def stop():
            sent.append(time.monotonic())
            controller.process.send_signal(sign)
            threading.Thread(target=lambda: ended.append((controller.process.wait(10),
                                                          time.monotonic()))).start()

        try:
            problems = self.robot.play(tour.attempts, controller.lines,
                                       lambda: controller.process.poll() is not None, number, stop)
            code = controller.wait(10)
            seconds = ended[0][1] - sent[0] if ended else STOP_LIMIT + 1.0
        finally:
            controller.close()
        if seconds > STOP_LIMIT or code != 0 or "Traceback" in controller.lines.text():
            problems.append("call {}: {:.2f} s, exit code {}".format(number, seconds, code))
        # the partner of a call that is made beside another may be under way too
        safe = [service for service in self.robot.extra if service in (ATTENTION, ANIMATION)]
        partner = {0: [ATTENTION], 1: [ANIMATION]}.get(number, [])
        if sorted(safe) not in (sorted([ATTENTION,
                                        ANIMATION]), sorted([ATTENTION, ANIMATION] + partner)):
            problems.append("call {}: the safe state was asked for as {}".format(number, safe))
        return problems, seconds


# ---------------------------------------------------------------------------------------- the plans


def single_faults(by_voice=True):
    """Return every single fault as ``{(service, number of the call): kind}``."""
    counts = dict.fromkeys(SERVICES, 0)
    calls = []
    for attempt in tour_with({}, by_voice).attempts:
        calls.append((attempt.service, counts[attempt.service]))
        counts[attempt.service] += 1
    return [{call: kind} for call in calls for kind in FAULTS]


def only_by_tablet(faults):
    """Return those faults of a tour by tablet that a tour by voice does not have."""
    press = next(n for n, attempt in enumerate(
        a for a in tour_with({}, False).attempts if a.service == SAY)
                 if attempt.node == "PressYesNoSpeech")
    return [fault for fault in faults if set(fault) & {(TABLET, 0), (SAY, press)}]


def sweep(soak, short, _):
    """Each call with each kind of fault; in short each call with one kind."""
    faults, pressed = single_faults(), only_by_tablet(single_faults(False))
    if short:
        faults, pressed = faults[::len(FAULTS) + 1], pressed[::5]
    yield "single faults, by voice", len(faults), soak.run([tour_with(fault) for fault in faults])
    yield "single faults, by tablet", len(pressed), soak.run(
        [tour_with(fault, False) for fault in pressed], False)


def pairs(soak, short, seed):
    """Tours with two random faults each."""
    draw = random.Random(seed)
    faults = single_faults()
    plans = []
    for _ in range(8 if short else 200):
        plan = dict(draw.choice(faults))
        plan.update(draw.choice(faults))
        plans.append(plan)
    yield "pairs of faults, seed {}".format(seed), len(plans), soak.run(
        [tour_with(plan) for plan in plans])


def rates(soak, short, seed):
    """Tours in which each call fails with a probability; the kind of its fault is random too."""
    draw = random.Random(seed)
    for by_voice in (True, False):
        for rate in RATES[1::2] if short else RATES:
            class Draws(dict):
                """A fault for every call that is looked up."""

                def get(self, key, default=None):
                    return draw.choice(sorted(FAULTS)) if draw.random() < rate else default

            tours = [
                tour_with(Draws(), by_voice, is_careful=True) for _ in range(1 if short else 20)]
            yield "failure rate {:g}, {}".format(
                rate, "voice" if by_voice else "tablet"), len(tours), soak.run(tours, by_voice)


def stops(soak, short, _):
    """A signal during each call, SIGINT and SIGTERM in turn; in short during a few."""
    count = len(tour_with({}).attempts)
    numbers = range(3, count, 14) if short else range(count)
    problems, slowest = [], 0.0
    for number in numbers:
        found, seconds = soak.stop_at(number, (signal.SIGINT, signal.SIGTERM)[number % 2])
        problems += found
        slowest = max(slowest, seconds)
    yield "stops, the slowest after {:.2f} s".format(slowest), len(numbers), problems


PLANS = {"sweep": sweep, "pairs": pairs, "rates": rates, "stops": stops}
OTHERS = ["adversary", "broken", "sound"]


def run(names, short, seed):
    """Run the plans, print a line for each part, and return the problems."""
    folder = tempfile.mkdtemp()
    soak = Soak(folder)
    problems = []
    try:
        for name in names:
            began = time.monotonic()
            for title, count, found in PLANS[name](soak, short, seed):
                print("{}: {} tours, {} in {:.0f} s".format(
                          title, count, "as predicted" if not found else "NOT as predicted",
                          time.monotonic() - began), flush=True)
                print("".join("  {}\n".format(problem) for problem in found), end="", flush=True)
                problems += found
    finally:
        soak.robot.close()
        shutil.rmtree(folder)
    return problems


def run_tours(names, short, seed):
    """Run the plans under their own master, and return the problems."""
    master = start_master()
    try:
        rospy.init_node("faulty_robot", disable_signals=True)
        return run(names, short, seed)
    finally:
        master.terminate()
        master.wait()


def main():
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "plans", nargs="*", choices=[[]] + list(PLANS) + OTHERS, help="default: all")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="WORD",
                        help="the trials of adversary or broken with this word in their name")
    chosen = parser.parse_args()
    names = chosen.plans or list(PLANS) + OTHERS
    if chosen.only and not {"adversary", "broken"} & set(names):
        parser.error("--only chooses among the trials of the plans adversary and broken")
    problems = []
    if "adversary" in names:  # before rospy has its own master
        problems += trial.run(adversary.SHORT if chosen.short else adversary.TRIALS, chosen.only,
                              chosen.seed)
    if "broken" in names:
        problems += judge_trials.run_broken(chosen.seed, 300 if chosen.short else None, chosen.only)
    if "sound" in names:
        problems += judge_trials.run_sound(chosen.seed, 200 if chosen.short else 10000)
    tours = [name for name in names if name in PLANS]
    if tours:
        problems += run_tours(tours, chosen.short, chosen.seed)
    return 1 if problems else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted")
