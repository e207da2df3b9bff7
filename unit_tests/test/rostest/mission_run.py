"""A test case that waits for the mission of its launch file and compares the requests to the
simulated nodes."""
import unittest
from typing import Dict

from behavior_controller.config import settings
from behavior_controller.simulation import configuration
from behavior_controller.simulation.world import world

from unit_tests.robot import options
from unit_tests.run import test_node
from unit_tests.judge.verdict import Verdict

from expected import animate, attend


def told(line):
    """Return a line of the journal as ``expected`` writes requests."""
    content = line.content
    if line.node == "gestureExecution":
        target = tuple(content["location_" + axis]
                       for axis in "xyz") if content["gesture_type"] == "deictic" else ()
        return (line.node, (content["gesture_type"], content["gesture_id"]) + target)
    if line.node in ("robotNavigation", "robotLocalization"):
        return (line.node, tuple(content.values()))
    if line.node == "speechEvent":
        return (line.node, *content.values())
    return (line.node, content[{
        "knowledgeBase": "parameters", "textToSpeech": "message", "tabletEvent": "message"
    }.get(line.node, "state")])


class MissionRun(unittest.TestCase):
    """Runs one mission before its cases. The launch file starts the simulated nodes and the
    controller."""

    limit = 60.0  # seconds for the mission
    behaviour, runs = "engages", 1  # as in the launch file
    code = 0  # of the controller
    chosen: Dict[str, str] = {}  # keys of the controller

    @classmethod
    def setUpClass(cls):
        test = configuration.defaults(visitorBehaviour=cls.behaviour, missionRuns=cls.runs,
                                      callTimes=configuration.NONE, testTimeout=cls.limit)
        around = world(cls.behaviour, settings.defaults(**cls.chosen))
        facts = test_node.wait_for_end(options.Options(options.of_process(), test, around))
        cls.model, cls.journal, cls.exit_code = facts[:3]
        cls.requests = [line for line in cls.journal if line.call > 0]
        cls.verdict = Verdict(facts)

    def test_the_verdict_has_no_objections(self):
        self.assertEqual((str(self.verdict)[:6], self.exit_code), ("PASSED", self.code),
                         str(self.verdict))

    def assert_requests(self, expected):
        """Expect exactly these requests in this order, those of a frozenset in any; then those of
        the safe state."""
        received = [told(line) for line in self.requests]
        at = 0
        for number, step in enumerate(expected):
            steps = step if isinstance(step, frozenset) else {step}
            self.assertEqual(set(received[at:at + len(steps)]), steps,
                             "at step {} of {}".format(number, expected))
            at += len(steps)
        # the run is over
        self.assertEqual(sorted(received[at:]), [animate("disabled"), attend("disabled")])

    def published(self, node):
        """Return the changes of what a node published."""
        lines = [line for line in self.journal if line.node == node and line.call == 0]
        return [line for before, line in zip([None] + lines, lines) if before is None
                or before.content != line.content]
