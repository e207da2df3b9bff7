"""``rehearseMission``: plays a mission in virtual time with each visitor and each fault, and
reports what it finds."""
import argparse
import json
import os
import re
import signal
import sys
import textwrap
import time
from contextlib import suppress
from typing import (
    Any, Callable, Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple)

from msgspec.structs import asdict

from behavior_controller import exit_codes
from behavior_controller.config import settings
from behavior_controller.config.config_file import Reader, integer, number, one_of
from behavior_controller.errors import BehaviorControllerError, ConfigurationError, Fault
from behavior_controller.missions.load import find
from behavior_controller.output_files import page_of
from behavior_controller.robot.declarations import Topic
from behavior_controller.ros_arguments import CommandParser
from behavior_controller.text import clean, count, did_you_mean

from behavior_controller.simulation.rehearsal import html_report, plays
from behavior_controller.simulation.rehearsal.play import PASS_LIMIT
from behavior_controller.simulation.rehearsal.plays import Outcome, Scenario, Search, ScenarioRunner
from behavior_controller.simulation.rehearsal.summary import (
    FindingSummary, SimulatedRun, VisitorRow, Share, Survey)
from behavior_controller.simulation.behaviour import SERVERS, rehearsed_topics
from behavior_controller.simulation.faults import KINDS, PlannedFault
from behavior_controller.simulation.visitor import ALIASES, BEHAVIOURS, ENGAGES
from behavior_controller.simulation.configuration import CONTROLLER, SEEDS, load_controller, parse

NO_FAULTS, PAIRS = "none", "pairs"
FAULTS = (NO_FAULTS, "single", PAIRS)

ENDINGS = {"success": "SUCCESS", "failure": "FAILURE", "waiting": plays.NO_VISITOR, "none": ""}
"""The words for the ends of a pass -> the outcomes."""

TOGETHER = ("planned", "silent", "quick", "then")
"""The options that say how each play differs from one without faults."""

RATES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
"""The default failure rates."""

_PAGE = page_of(html_report.COMMAND)
"""The page that ``--html`` writes."""

BAR = 30
"""Letters of the progress bar."""

LINE_WIDTH = 110
"""Letters of a line."""

ASR = "asrEnabled"


class Plan:
    """The plays of a rehearsal that the ``options`` of the command ask for.

    ``calm`` are the scenes without faults, ``stage`` is that of the first one. ``topics`` have
    messages, ``silent`` are those that the mission uses and that nothing simulates. ``chosen`` are
    the arguments of the command that are the same for all scenes. ``is_complete``: each visitor
    and each fault is played, so that something can be said of a node that is not reached.
    """

    def __init__(self, options: argparse.Namespace):
        """Raises FaultsFound."""
        self.options, self.kinds = options, options.kinds or KINDS
        given = parse(options.settings, CONTROLLER, f"config/{settings.FILE_NAME}")
        is_file = os.path.exists(options.mission) or options.mission.endswith(".xml")
        path = options.mission if is_file else find(options.mission)
        controller = load_controller(given)
        self.runner = ScenarioRunner(controller.values, path, options.limit,
                                     options.faults == PAIRS)
        ways, visitors = self.runner.ways, self.runner.visitors
        if ASR in given:
            ways = (controller.asr_enabled,)
        if options.visitors or options.runs:
            visitors = tuple(options.visitors or [ENGAGES])
        self.calm = [Scenario(visitor, by_voice) for by_voice in ways for visitor in visitors]
        self.stage = self.runner.stage(ways[0])
        robot = self.stage.settings.interface
        self.topics = [topic.name for topic in rehearsed_topics(robot)]
        _check_robot(robot, options)
        self.silent = [offer.name for offer in self.stage.mission.offers
                       if isinstance(offer, Topic) and offer.name not in self.topics]
        is_restricted = options.faults == NO_FAULTS or options.runs or options.kinds \
            or options.limit < PASS_LIMIT or any(getattr(options, name) for name in TOGETHER)
        self.is_complete = set(visitors) >= set(self.runner.visitors) \
            and len(ways) == len(self.runner.ways) and not is_restricted
        others = [word for word in options.settings if not word.startswith(ASR + ":=")]
        self.chosen = [options.mission, *others]
        if options.limit != PASS_LIMIT:
            self.chosen += ["--limit", repr(options.limit)]

    def rounds(self, survey: Survey, search: Search) -> Iterator[List[Scenario]]:
        """Yield the scenes of one round after the other; the ``survey`` has the outcomes of each
        before the next one is planned."""
        options = self.options
        if options.runs:
            yield plays.random(self.calm, options.runs, options.failureRate or RATES,
                               options.seed or 1, self.kinds)
        elif any(getattr(options, name) for name in TOGETHER):
            chosen: Dict[str, Any] = {name: tuple(getattr(options, name)) for name in TOGETHER}
            yield [scene._replace(is_traced=True, **chosen) for scene in self.calm]
        else:
            yield self.calm
            if options.faults != NO_FAULTS:
                is_pairs = options.faults == PAIRS
                yield list(plays.single(survey.outcomes, self.kinds, self.topics, is_pairs))
                if is_pairs:
                    yield list(plays.pairs(survey.outcomes, self.kinds))
                yield list(plays.orders(survey.outcomes))
            if len(survey.outcomes) > 1:  # a single scene is played to be looked at
                yield from plays.successors(survey.outcomes)
            if self.is_complete and survey.has_ended:
                yield from search.rounds()


# ---------------------------------------------------------------------------------------- arguments


def _word(*words: str) -> Callable[[str], str]:
    return _allowed(one_of(*words), words)


def _allowed(read: Reader[Any], words: Sequence[str] = ()) -> Callable[[str], Any]:
    def parse_value(text: str) -> Any:
        try:
            return read(text)
        except ValueError:
            hint = did_you_mean(text, words) or f"allowed: {read.allowed}"
            raise argparse.ArgumentTypeError(f"it cannot be {text or 'empty'} ({hint})") from None
    return parse_value


def _list_of(read: Callable[[str], Any]) -> Callable[[str], List[Any]]:
    return lambda text: [read(item.strip()) for item in text.split(",")]


def _visitor(text: str) -> str:
    return ALIASES.get(text) or _word(*BEHAVIOURS)(text)


def _planned(text: str) -> PlannedFault:
    """Parse ``node:call:kind``, or ``node:call+:kind`` for a fault that lasts; whether the robot
    has the node is checked later."""
    form = re.fullmatch(r"([^:]+):0*([1-9][0-9]*)(\+?)(?::(.*))?", text)
    if form is None:
        raise argparse.ArgumentTypeError(f"{text} is not of the form node:call:kind")
    node, call, plus, kind = form.groups()
    return PlannedFault(node, int(call), _word(*KINDS)(kind or KINDS[0]), bool(plus))


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        html_report.COMMAND,
        "Play a mission without ROS, in virtual time, with the simulated robot and each kind of "
        "visitor: without faults, with each single fault, or with random ones, and print the "
        "findings.", "0 if nothing was found, 4 if something was, 2 if the mission or the call is "
        "wrong, 1 if it was stopped or something is missing")
    parser.add_argument("mission", metavar="MISSION", help="the file of a mission, or its name")
    parser.add_argument(
        "settings", nargs="*", default=[], metavar="KEY:=VALUE",
        help="a key of the controller's configuration, such as robotInterface:=release-1.0")

    def option(name: str, read: Callable[[str], Any], metavar: str, meaning: str) -> None:
        parser.add_argument("--" + name, type=read, metavar=metavar, help=meaning)

    option("faults", _word(*FAULTS), "|".join(FAULTS),
           "each single fault (every call in every way, every service for good, every topic "
           "silent; the default), also each two of them, or none")
    option("visitors", _list_of(_visitor), "NAMES",
           f"some of {', '.join(BEHAVIOURS)}, with commas between them; if not given, all that "
           f"make a difference to the mission, with --runs {ENGAGES}")
    option("kinds", _list_of(_word(*KINDS)), "NAMES",
           f"in which ways calls go wrong: some of {', '.join(KINDS)}")
    option("planned", _list_of(_planned), "NODE:CALL:KIND",
           "calls that go wrong, with commas between them, instead of --faults; with a plus "
           "after the call, each later call too")
    option("silent", _list_of(str), "TOPICS", "topics that are silent, as --planned")
    option("quick", _list_of(_word(*SERVERS)), "NODES",
           "nodes whose calls take no time, so that another step ends last, as --planned")
    option("then", _list_of(_visitor), "NAMES",
           "visitors who come after, with commas between them, as --planned")
    option("runs", _allowed(integer(1, 10 ** 6)), "N",
           "play N passes for each failure rate, with random faults, instead of --faults")
    rates = ", ".join(f"{rate:g}" for rate in RATES)
    option("failureRate", _list_of(_allowed(number(0, 1))), "P",
           f"failure rates for --runs, with commas between them; {rates} if not given")
    option("seed", _allowed(integer(1, SEEDS)), "N", "the first seed for --runs; 1 if not given")
    option("limit", _allowed(number(1, 10 ** 6)), "SECONDS",
           f"of the mission's time, after which a pass does not end; {PASS_LIMIT:g} if not given")
    option("jobs", _allowed(integer(1, 1024)), "N", "processes; one for each core if not given")
    parser.set_defaults(planned=[], silent=[], quick=[], then=[], limit=PASS_LIMIT,
                        jobs=len(os.sched_getaffinity(0)))
    option("list", _word(*ENDINGS), "END",
           f"list the simulated runs with that end ({', '.join(ENDINGS)}), each with the command "
           "that shows it")
    parser.add_argument("--json", action="store_true", help="print all as JSON")
    parser.add_argument("--html", metavar="FILE", help="write all as a web page, too: a new file, "
                        "or in place of an earlier page")
    return parser


def read(argv: Optional[Sequence[str]]) -> argparse.Namespace:
    """Return the options of the command. Exits with one line if they are wrong, or contradict each
    other."""
    parser = _parser()
    options = parser.parse_intermixed_args(argv)
    ways = [name for name in ("faults", *TOGETHER, "runs") if getattr(options, name)]
    if len(ways) > 1 and not set(ways) <= set(TOGETHER):
        parser.error(f"--{ways[0]} and --{ways[-1]} exclude each other")
    for name in ("failureRate", "seed"):
        if getattr(options, name) is not None and not options.runs:
            parser.error(f"--{name} is for --runs")
    if options.kinds and (set(ways) & set(TOGETHER) or options.faults == NO_FAULTS):
        parser.error("--kinds is for --faults and --runs")
    return options


def _check_robot(interface: Any, options: argparse.Namespace) -> None:
    """Raise ConfigurationError with every node and topic that the robot does not have."""
    faults = []
    nodes = {service.node for service in interface.services}
    for option, kind, given, known in (
            ("planned", "node", [fault.node for fault in options.planned], nodes),
            ("quick", "node", options.quick, nodes),
            ("silent", "topic", options.silent,
             {topic.name for topic in rehearsed_topics(interface)})):
        hint = f"there are: {', '.join(sorted(known))}"
        faults += [Fault(f"argument --{option}", 0, 0,
                         f"the robot {interface.name} has no {kind} {clean(name)}",
                         did_you_mean(name, known) or hint) for name in given if name not in known]
    ConfigurationError.raise_any(faults)


# --------------------------------------------------------------------------------------------- main


def main(argv: Optional[List[str]] = None) -> int:
    """Play, print the findings, and return the exit code."""
    options = read(argv)
    try:
        if options.html is not None:
            _PAGE.check(options.html)
        todo = Plan(options)
    except BehaviorControllerError as error:
        print(error)
        return exit_codes.WRONG_INPUT
    signal.signal(signal.SIGINT, signal.default_int_handler)
    result = rehearse(todo, options.jobs)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    print(json.dumps(as_json(result), indent=1) if options.json else as_text(result))
    if options.html is not None:
        _PAGE.write(options.html, html_report.to_html(heading(result), result.rows, result.shares,
                                                     result.findings, result.runs))
    if result.findings:
        return exit_codes.FINDINGS
    return exit_codes.SUCCESS if result.plays == result.planned else exit_codes.UNAVAILABLE


def rehearse(todo: Plan, jobs: int) -> "Result":
    """Play all scenes, or those until Ctrl-C, and return what they show."""
    began, planned = time.monotonic(), 0
    survey = Survey(todo.runner, todo.calm[0].by_voice, todo.chosen)
    search = Search(survey.nodes, survey.reached, survey.outcomes, todo.kinds[0])
    with suppress(KeyboardInterrupt), plays.players(todo.runner, jobs) as play_all:
        for scenes in todo.rounds(survey, search):
            planned += len(scenes)
            for outcome in with_progress(play_all(scenes), len(scenes)):
                survey.take(outcome)
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[K")  # takes the line away
    played = len(survey.outcomes)
    findings = survey.findings(search if todo.is_complete and played == planned else None)
    story = survey.story(survey.outcomes[0].scene) if planned == played == 1 else ()
    unmet = tuple(fault for fault in todo.options.planned
                  if all(fault in outcome.unmet for outcome in survey.outcomes))
    return Result(todo, survey.rows(), survey.shares(), findings, played, planned,
                  time.monotonic() - began, tuple(_story_lines(story)), unmet, survey.runs())


def with_progress(outcomes: Iterable[Outcome], of: int) -> Iterator[Outcome]:
    """Yield the outcomes of a round; a line on the terminal shows how many are done, and the time
    left."""
    began = time.monotonic()
    for done, outcome in enumerate(outcomes, 1):
        yield outcome
        if sys.stderr.isatty():
            bar = ("#" * (BAR * done // of)).ljust(BAR, ".")
            left = html_report.duration((time.monotonic() - began) / done * (of - done))
            sys.stderr.write(f"\r[{bar}] {done} of {of} simulated runs, {left} left\x1b[K")
            sys.stderr.flush()


class Result(NamedTuple):
    """The result of a rehearsal."""

    plan: Plan
    rows: List[VisitorRow]
    shares: List[Share]
    findings: List[FindingSummary]
    plays: int
    planned: int
    seconds: float
    story: Tuple[str, ...]  # of the only play
    unmet: Tuple[PlannedFault, ...] = ()  # planned, and no play makes that call
    runs: Mapping[str, Sequence[SimulatedRun]] = {}  # by their end


# --------------------------------------------------------------------------------------------- text


def heading(result: Result) -> str:
    """Return a line with the numbers of plays and their time."""
    others, stopped = result.planned - result.plays, ""
    if others:
        stopped = f", stopped before the other {others}"
    mission = clean(os.path.basename(result.plan.runner.mission))
    robot = result.plan.stage.settings.interface.name
    runs = count(result.plays, "simulated run")
    return f"{mission}, robot {robot}: {runs} in {result.seconds:.1f} s{stopped}"


def as_text(result: Result) -> str:
    """Return the result as lines of text."""
    lines = [heading(result)] + [
        f"silent: {name}, since its declaration does not say what it publishes in a rehearsal "
        "(simulated_value)" for name in result.plan.silent] + [
            f"planned in vain: {fault}, since no play makes that call" for fault in result.unmet]
    for table in html_report.tables(result.rows, result.shares).values():
        lines += ["", *_columns(table)]
    for run in result.runs.get(ENDINGS.get(result.plan.options.list, "-"), ()):
        lines += ["", f"{run.outcome or 'no end'} after {html_report.duration(run.seconds)}: "
                  f"{run.words}", "    again: " + run.command]
    if not any(finding.story for finding in result.findings) and result.story:
        lines += [""] + list(result.story)
    explained = ""  # the kind of the finding before
    for finding in result.findings:
        lines += _finding_lines(finding, finding.kind.name != explained)
        explained = finding.kind.name
    total = "nothing was found"
    if result.findings:
        kinds = count(len({finding.kind for finding in result.findings}), "kind")
        total = f"found: {count(len(result.findings), 'finding')} of {kinds}"
    return "\n".join([*lines, "", total])


def _finding_lines(finding: FindingSummary, is_first: bool) -> List[str]:
    """Return a finding in lines; the first of its kind with its meaning and its story."""
    lines = []
    if is_first:
        first, *others = textwrap.wrap(finding.kind.means, LINE_WIDTH) or [""]
        lines += ["", f"{finding.kind.name}: {first}"] + ["  " + line for line in others]
    lines.append(f"  {finding.where} ({finding.place}): {finding.what}")
    lines += [
        f"    as a consequence, {other.kind.name} at {other.where} ({other.place}): {other.what}"
        for other in finding.consequences]
    if finding.scene is None:
        return lines
    runs = count(finding.plays, "simulated run")
    lines.append(f"    in {runs}, the shortest: {finding.scene.words}")
    if is_first:
        lines += ["      " + line for line in _story_lines(finding.story)]
    return lines + ["    again: " + finding.command]


def _story_lines(story: Sequence[Any]) -> List[str]:
    return [f"{sentence.at:7.1f} s  {sentence.text}" for sentence in story]


def _columns(table: html_report.Table) -> List[str]:
    widths = [max(map(len, column)) for column in zip(*table)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
            for row in table]


def as_json(result: Result) -> Dict[str, Any]:
    """Return the result as data for JSON."""
    return {
        "mission": result.plan.runner.mission, "plays": result.plays,
        "planned_plays": result.planned, "silent_topics": result.plan.silent,
        "planned_in_vain": list(map(str, result.unmet)),
        "visitors": [dict(row._asdict(), with_faults=dict(row.with_faults)) for row in result.rows],
        "shares": [dict(share._asdict(), share=share.share, interval=list(share.interval))
                   for share in result.shares],
        "runs": [run._asdict() for runs in result.runs.values() for run in runs],
        "found": list(map(_finding_as_json, result.findings))}


def _finding_as_json(finding: FindingSummary) -> Dict[str, Any]:
    scene = finding.scene and dict(
        finding.scene._asdict(), planned=list(map(str, finding.scene.planned)))
    return dict(finding._asdict(), kind=finding.kind.name, means=finding.kind.means, scene=scene,
                story=[asdict(sentence) for sentence in finding.story],
                consequences=list(map(_finding_as_json, finding.consequences)))
