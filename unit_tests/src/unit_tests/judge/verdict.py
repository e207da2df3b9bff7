"""The verdict of a test: does the run match the mission?

Three things are asked of a run. ``execution`` does the mission again, with the reference's nodes
and the answers and messages on record, and says where the record first differs from the mission.
``journal_check`` asks the journal of the simulated nodes whether each request reached its node,
each answer and message was given, and no sign was missed. Start, end and exit code are the third.
Nothing is excused otherwise: a pass that ended in FAILURE did so because the mission, done again,
ends in FAILURE.
"""
from typing import Callable, Iterable, Iterator, Optional, Tuple

from behavior_controller import exit_codes
from behavior_controller.config.settings import Settings
from behavior_controller.run.events import Lost, Recovered, RunStarted
from behavior_controller.run.story import how_it_ended, may_be_under_way, why
from behavior_controller.text import clean, count
from behavior_controller.simulation.visitor import LONG_WAIT
from behavior_controller.viewer.report import CUT_OFF, FAILED, PASSED

from unit_tests.judge import files, numbers
from unit_tests.judge.execution import Execution
from unit_tests.judge.facts import Facts, of
from unit_tests.judge.journal_check import JournalCheck
from unit_tests.judge.outcome import DOES

class Verdict:
    """The verdict on a test: PASSED without objections, or CUT OFF if only its time was too short.
    ``answers``: each question and its
    objections. ``execution`` is the mission done again, ``overdue`` what was due long before the
    end of a test that was cut off; empty: nothing."""

    def __init__(self, facts: Facts):
        self.facts = facts
        self.execution = Execution(facts)
        self.journal_check = JournalCheck(facts, self.execution)
        self.unlike_journal = tuple(self.journal_check.objections())
        self.outcomes = self.execution.outcomes()
        self.overdue = facts.cut_off and self.execution.overdue(self.journal_check.end)
        self.answers = [(question, tuple(dict.fromkeys(map(clean, answer(self)))))
                        for question, answer in QUESTIONS]
        self.objections = tuple(text for _, objections in self.answers for text in objections)
        # the mission went as it should until the time was over
        self.is_cut_off = facts.has_timed_out and not self.objections and not self.is_out_of_time
        self.passed = not self.objections and not self.is_cut_off
        self.praise = "; ".join(_praise(self))

    def __str__(self) -> str:
        """Return the verdict as lines of text."""
        return f"{self.word}: " + "\n        ".join(self.sentences)

    @property
    def word(self) -> str:
        """The verdict in a word."""
        if self.is_cut_off:
            return CUT_OFF
        return PASSED if self.passed else FAILED

    @property
    def sentences(self) -> Tuple[str, ...]:
        """The reasons of the verdict."""
        if self.passed:
            return (self.praise,)
        if not self.is_cut_off:
            return self.objections
        waiting = [search.node.registration_id for search in self.execution.signs.waiting.values()]
        under_way = " or ".join(waiting) or self.execution.under_way()
        return (f"{self.facts.cut_off}, and {under_way} goes on; until then all went as it should: "
                f"{self.praise}; set testTimeout higher",)

    @property
    def waiting_for(self) -> str:
        """The node that has waited for a sign for so long that a visitor would have come in any
        case; empty: none."""
        offset = self.execution.offset
        if offset is None or self.overdue:
            return ""
        waits = ((self.journal_check.end - offset - search.at, search.node.registration_id)
                 for search in self.execution.signs.waiting.values())
        seconds, node = max(waits, default=(0.0, ""))
        return node if seconds > LONG_WAIT else ""

    @property
    def is_out_of_time(self) -> bool:
        """Whether the test was cut off while the mission had to wait."""
        is_paused = self.execution.is_paused and not self.overdue
        return self.facts.has_timed_out and (is_paused or bool(self.waiting_for))


# ------------------------------------------------------------------------------------ the questions


def _start(verdict: Verdict) -> Iterator[str]:
    """Object to a test that was disturbed, and to a controller that did not start or raised an
    exception."""
    facts = verdict.facts
    if facts.is_disturbed:
        yield facts.cut_off
    if facts.run.state.started is None and not facts.cut_off:
        yield "the controller {}{} before it started its mission{}".format(
            _ending(facts.exit_code), WHY.get(facts.exit_code or 0, ""), ":" * bool(facts.errors))
    if facts.run.state.started is None:
        yield from facts.errors
    yield from _not_as_given(facts)
    for event in facts.run.errors:
        if not event.jumped_back:
            yield f"the controller reports an error: {event.text}"


def _not_as_given(facts: Facts) -> Iterator[str]:
    """Object to settings and files that are not those which the controller was given."""
    begun, mission = of(facts.run.lines, RunStarted), facts.mission
    if mission is None or not begun:
        return
    yield from _not_on_file(begun[0][1], mission.settings)
    has, files = begun[0][1].settings, begun[0][1].sources
    for name, value in mission.settings.values.items():
        if name not in SET_BY_THE_TEST and has.get(name) != value:
            yield f"the controller has {name} {has.get(name)}; it was given {value}"
    known = mission.knowledge.sources if mission.knowledge is not None else ()
    for what, its, given in (
            ("mission", files.documents, mission.tree.sources),
            ("phrases", [files.phrases], [mission.phrases.source]),
            ("recovery policy", [files.policy], [mission.policy.source]),
            ("knowledge", files.knowledge, known)):
        if [source.text for source in its] != [source.text for source in given]:
            names = ", ".join(source.file for source in its)
            yield f"the controller has another {what} than it was given: {names}"


def _not_on_file(started: RunStarted, given: Settings) -> Iterator[str]:
    """Object to phrases and knowledge that are not those of the files for mission and language."""
    language, its = given.language, started.sources
    has_files = bool(its.knowledge)
    if has_files:
        language = files.knowledge(its.knowledge[0].text, its.knowledge[1].text).language
    due = files.on_file(given.scenario_specification, language, has_files)
    for source, text in zip((its.phrases, *its.knowledge), due):
        if not source.text.startswith(text):  # packages add to the phrases
            yield f"the controller has another text than the file of {source.file}"


SET_BY_THE_TEST = {"missionRuns", "recordDirectory", "startupTimeout", "verboseMode"}
"""Keys of the controller that the test decides by itself."""


def _end(verdict: Verdict) -> Iterator[str]:
    """Object to a controller that did not end as it should."""
    facts = verdict.facts
    finished, ending = facts.run.state.finished, "the controller " + _ending(facts.exit_code)
    outcomes = [visit.outcome for visit in facts.run.visits if visit.outcome]
    if facts.has_timed_out and not verdict.execution.difference and (
            verdict.overdue or facts.run.state.started is None):
        yield facts.cut_off
    elif facts.cut_off or facts.run.state.started is None:
        return
    elif finished is None:
        yield f"{ending} in the middle of its mission, in pass {len(outcomes) + 1}"
    elif facts.exit_code != finished.exit_code:
        yield f"{ending}, but announced exit code {finished.exit_code}"
    elif len(outcomes) != facts.test.mission_runs:
        passes = count(len(outcomes), "pass", "passes")
        yield f"the controller made {passes} instead of {facts.test.mission_runs}"
    elif facts.exit_code != (exit_codes.SUCCESS if outcomes[-1] == "SUCCESS"
                             else exit_codes.FAILURE):
        yield f"the last pass ended with {outcomes[-1]}, and {ending}"


WHY = {exit_codes.WRONG_INPUT: " (a fault of its files or arguments)",
       exit_codes.UNAVAILABLE: " (a service or topic is missing)"}
"""The reason that an exit code gives for a start that failed; errors on the terminal say more."""


def _ending(exit_code: Optional[int]) -> str:
    if exit_code is not None and exit_code < 0:
        return f"was ended by signal {-exit_code}"
    return f"ended with exit code {exit_code}"


def _mission(verdict: Verdict) -> Iterator[str]:
    """Object to the first thing that is not as the mission, done again, has it."""
    execution = verdict.execution
    yield from filter(None, [execution.difference, *execution.late_retries])
    if execution.tree is not None and not execution.difference:  # from which it may follow
        yield from filter(None, [verdict.overdue])
        yield from numbers.objections(verdict.facts, execution.tree.nodes)
    lost = sum(event.lines for _, event in of(verdict.facts.run.lines, Lost))
    if lost:
        lines = count(lost, "line")
        yield f"the record lacks {lines}, so the mission cannot be done again"


def _outcome(verdict: Verdict) -> Iterator[str]:
    """Object to visits that people would object to, whatever mission and engine brought them about,
    unless that may follow from what is known to be wrong."""
    if verdict.execution.difference or verdict.unlike_journal:
        return
    for outcome in verdict.outcomes:
        for text in outcome.objections():
            yield f"pass {outcome.visit.number}: {text}"


ENDS = "the controller ran the mission to its end"
"""The question that a test leaves open which is cut off."""

QUESTIONS: Tuple[Tuple[str, Callable[[Verdict], Iterable[str]]], ...] = (
    ("the controller started, without an exception", _start),
    ("the mission went as its tree, its visitor and the recovery policy have it", _mission),
    ("each visitor was shown what a visitor of that kind expects", _outcome),
    ("each request, answer and message on record is in the journal, and no sign was missed",
     lambda verdict: verdict.unlike_journal),
    (ENDS, _end),
)
"""All that decides."""


# --------------------------------------------------------------------------------------- the praise


def _praise(verdict: Verdict) -> Iterator[str]:
    """Yield the results of a test that passed."""
    facts = verdict.facts
    calls = [line for line in facts.journal if line.call]
    ended = [visit for visit in facts.run.visits if visit.outcome]
    whole = [visit for visit in ended if visit.outcome == "SUCCESS"]
    right = [each for each in verdict.outcomes if each.visit in whole and each.is_right]
    others = len(whole) - len(right)
    if right:
        passes = count(len(right), "pass ended", "passes ended")
        yield f"{passes} as a visitor who {DOES[facts.test.visitor_behaviour]} should"
    if others:
        passes = count(others, "pass ended", "passes ended")
        yield f"{passes} in SUCCESS, with a visitor who {DOES[facts.test.visitor_behaviour]}"
    elif not ended:
        yield "no pass ended"
    for visit in whole:
        if visit.skipped:
            yield f"pass {visit.number}: {how_it_ended(visit)}"
    for visit in ended:
        if visit not in whole:
            yield f"pass {visit.number} ended early, as it had to: {why(visit.why)}"
    failed = sum(line.fault is not None for line in calls)
    yield f"{failed} of {len(calls)} calls were made to fail, and all of these are on record"
    if any("budget" in event.reason for _, event in of(facts.run.lines, Recovered)):
        yield "the budget of recoveries was spent, which calls that take no time do in seconds"
    under_way = may_be_under_way(facts.run.state)
    if under_way:
        yield f"at the end the robot {under_way}"
    if verdict.is_out_of_time:
        reason = "it waited for the end of a cause that persists"
        if verdict.waiting_for:
            reason = verdict.waiting_for + " waited for a sign of the visitor that never came"
        yield f"at last {reason}: {facts.cut_off}"
    if verdict.journal_check.only_recorded:
        yield "not simulated, so that the record is the only witness: " + ", ".join(
            verdict.journal_check.only_recorded)

