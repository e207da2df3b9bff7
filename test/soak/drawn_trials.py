"""Trials of an adversary that are the checks of rostests, with parameters drawn from the seed."""
import itertools
import signal
import unittest
from functools import partial

import test_foreign
import test_mission
from robot import start_master
from test_foreign import TestForeign
from test_mission import TestMission
from test_start_up import TestStartUp
from trial import FACES, GAZE, SPEECH

LIMIT = 240  # s, for a trial
ROUNDS = 3


def drawn(trial, case, check, choices):
    """A check of a rostest holds with one of each of ``choices``; a tuple is several arguments."""
    trial.held.callback(end, start_master())
    drawable = list(itertools.product(*choices))
    for values in trial.draw.sample(drawable, min(ROUNDS, len(drawable))):
        arguments = [argument for value in values
                     for argument in (value if isinstance(value, tuple) else [value])]
        trial.times.append(", ".join(map(repr, arguments)))
        result = unittest.TestResult()
        test = type(case.__name__, (case, ), {
            "runTest": lambda test, arguments=arguments: getattr(test, check)(*arguments)})
        test().run(result)
        for _, problem in result.failures + result.errors:
            trial.require(False, "{}: {}".format(trial.times[-1], problem))


def end(master):
    """End a master, as a crash does."""
    master.kill()
    master.wait()


# ---------------------------------------------------------------------------------------- the table

RAISED = test_foreign.RAISED + ("GeneratorExit()", "StopIteration(1)", "OSError(28, 'x')",
                                "ValueError('\\n\\x1b[2J')")
MOMENTS = test_foreign.MOMENTS + (
    "on_start(self):\n        self.clock.post(self.late)\n        return RUNNING\n\n"
    "    def late(self):\n        raise {}", )
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT)
MODULES = test_foreign.BROKEN_MODULES + (("import sys; sys.exit()", "SystemExit"),
                                         ("\x00", "cannot be imported"),
                                         ("import odd.other", "odd.other"))
MANIFESTS = ("", "<package", "<package><name>half</name>", "\x07\x1b[2J", None)
OUR_MISTAKES = ("KeyError('spoilt')", "AssertionError()", "SystemExit(0)", "KeyboardInterrupt()")
UTTERANCES = (["yes", "hm"], ["hm", "yes", "well"], ["yes", "hm", "hm", "Error 7"],
              ["Yes, please!", "goodbye"])
WORDS = (("missionRuns:=1", "_missionRuns"), ("verboseMode:=true", "_verboseMode"),
         ("language:=English", "_language"))
LAUNCHES = ((["missionRun:=1"], 2), (["missionRuns:=0", "verbosMode:=true"], 2),
            (["missionRuns:=0"], 1))

TRIALS = [("drawn: " + name, LIMIT, partial(drawn, case=case, check=check, choices=choices))
          for name, case, check, *choices in (
    ("a leaf that raises", TestForeign, "check_raised", RAISED, MOMENTS),
    ("a leaf that blocks", TestForeign, "check_blocked", test_foreign.BLOCKED_MOMENTS,
     test_foreign.BLOCKS, STOPS),
    ("a broken export", TestForeign, "check_import", test_foreign.KINDS, MODULES),
    ("a half-written package.xml", TestStartUp, "check_manifest", MANIFESTS),
    ("a run that ends by itself", TestMission, "check_own_end", test_mission.ENDS),
    ("an internal error", TestMission, "check_own_mistake", OUR_MISTAKES),
    ("a budget that is spent", TestMission, "check_spent_budget", ("refuse", "odd", "raise"),
     (1.0, 1.5, 2.0)),
    ("an answer among utterances", TestMission, "check_answer", UTTERANCES),
    ("messages that cannot be decoded", TestMission, "check_garbled", (FACES, GAZE, SPEECH)),
    ("a log file that hangs", TestStartUp, "check_hanging_log", ("behaviorController", "tour_1")),
    ("a word that means nothing", TestStartUp, "check_word", WORDS),
    ("an argument that no launch file declares", TestStartUp, "check_launch", LAUNCHES))]
