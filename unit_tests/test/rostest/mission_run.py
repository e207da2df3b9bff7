"""A test case that waits for the mission of its launch file and compares the requests to the simulated nodes."""
import unittest

from behavior_controller.interface.robots import DEFAULT

from unit_tests import parameters, reporter
from unit_tests.facts import Facts
from unit_tests.journal import Journal
from unit_tests.verdict import judge

from expected import KNOWLEDGE


def told(line):
    """Return a line of the journal as ``expected`` writes requests."""
    content = line.content
    if line.node == "gestureExecution":
        target = tuple(content["location_" + axis] for axis in "xyz") if content["gesture_type"] == "deictic" else ()
        return (line.node, (content["gesture_type"], content["gesture_id"]) + target)
    if line.node in ("robotNavigation", "robotLocalization"):
        return (line.node, tuple(content.values()))
    if line.node == "speechEvent":
        return (line.node, *content.values())
    return (line.node, content[{"knowledgeBase": "parameters", "textToSpeech": "message", "tabletEvent": "message"}.get(
        line.node, "state")])


class MissionRun(unittest.TestCase):
    """Runs one mission before its cases. The launch file starts the simulated nodes and the controller."""

    limit = 60.0  # seconds for the mission
    behaviour, runs = "engages", 1  # as in the launch file
    interface, knowledge = DEFAULT, KNOWLEDGE

    @classmethod
    def setUpClass(cls):
        folder = parameters.folder()
        cls.events, cls.exit_code, cut_off = reporter.wait_for_end(folder, cls.limit)
        cls.journal = Journal(folder).news()
        cls.requests = [line for line in cls.journal if line.call > 0]
        cls.verdict = judge(Facts(cls.events, cls.journal, cls.exit_code, cls.behaviour, cls.runs, cls.knowledge,
                                  cut_off, interface=cls.interface))

    def assert_ended_with_success(self):
        """Expect exit code 0 and a verdict without objections."""
        self.assertEqual((str(self.verdict)[:6], self.exit_code), ("PASSED", 0), str(self.verdict))

    def assert_requests(self, expected):
        """Expect exactly these requests in this order; those of a frozenset in any."""
        received = [told(line) for line in self.requests]
        at = 0
        for number, step in enumerate(expected):
            steps = step if isinstance(step, frozenset) else {step}
            self.assertEqual(set(received[at:at + len(steps)]), steps, "at step {} of {}".format(number, expected))
            at += len(steps)
        self.assertEqual(received[at:], [])

    def published(self, node):
        """Return the changes of what a node published."""
        lines = [line for line in self.journal if line.node == node and line.call == 0]
        return [line for before, line in zip([None] + lines, lines) if before is None or before.content != line.content]
