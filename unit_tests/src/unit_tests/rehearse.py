"""``rehearseMission``: plays a mission in virtual time with each visitor and each fault, and reports what it finds."""
import argparse
import json
import os
import signal
import sys
import textwrap
import time
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, NoReturn, Optional, Sequence, Tuple

from behavior_controller import exits
from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import BehaviorControllerError, ConfigurationError, Fault
from behavior_controller.mission import find
from behavior_controller.text import clean

from unit_tests import arguments, rehearse_page, scenes
from unit_tests.configuration import ALIASES
from unit_tests.facts import count
from unit_tests.faults import KINDS, PlannedFault
from unit_tests.robot import topics
from unit_tests.scenes import Scene, Theatre
from unit_tests.survey import Found, Row, Share, Survey
from unit_tests.visitor import BEHAVIOURS, ENGAGES

NONE, SINGLE, PAIRS = "none", "single", "pairs"
FAULTS = (NONE, SINGLE, PAIRS)

RATES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
"""The default failure rates."""

LIMIT = 3600.0
"""Seconds of the mission's time after which a pass counts as one that does not end."""

BAR = 30
"""Letters of the progress bar."""

WIDTH = 110
"""Letters of a line."""

ASR = "asrEnabled"


class Plan(NamedTuple):
    """The plays of a rehearsal. ``is_complete``: each visitor and each fault, so that a node not reached is unreachable."""

    arguments: Tuple[Any, ...]  # of a Theatre
    theatre: Theatre
    scenes: List[Scene]
    is_complete: bool
    chosen: List[str]  # the arguments of the command that are the same for all scenes


# ----------------------------------------------------------------------------------------------------------- arguments


class _Parser(argparse.ArgumentParser):
    """A parser that suggests the nearest option for an unknown one."""

    def error(self, message: str) -> NoReturn:
        unknown = message.partition("unrecognized arguments: ")[2].split(" ")[0]
        options = [option for action in self._actions for option in action.option_strings]
        hint = did_you_mean(unknown.partition("=")[0], options) if unknown else ""
        super().error(message + (" ({})".format(hint) if hint else ""))


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise argparse.ArgumentTypeError("there is no {} ({})".format(
                text or "empty word", did_you_mean(text, words) or "allowed: {}".format(", ".join(words))))
        return text
    return read


def _list_of(read: Callable[[str], Any]) -> Callable[[str], List[Any]]:
    return lambda text: [read(item.strip()) for item in text.split(",")]


def _visitor(text: str) -> str:
    return ALIASES.get(text) or _one_of(*BEHAVIOURS)(text)


def _number(least: float, most: float, kind: Callable[[str], Any] = float) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            number = kind(text)
        except ValueError:
            number = None
        if number is None or not least <= number <= most:
            raise argparse.ArgumentTypeError("it cannot be {} (allowed: {:g} to {:g})".format(text, least, most))
        return number
    return read


def _planned(text: str) -> PlannedFault:
    """Parse ``node:call:kind``; whether the robot has the node is checked later."""
    node, _, rest = text.partition(":")
    call, _, kind = rest.partition(":")
    if not node or not call.isdigit() or int(call) < 1:
        raise argparse.ArgumentTypeError("{} is not of the form node:call:kind".format(text))
    return PlannedFault(node, int(call), _one_of(*KINDS)(kind or KINDS[0]))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="rehearseMission", allow_abbrev=False,
        description="Play a mission without ROS, in virtual time, with the simulated robot and each kind of visitor: without "
                    "faults, with each single fault, or with random ones, and print the mistakes that this shows.",
        epilog="exit code: 0 if nothing was found, 4 if something was, 2 if the mission or the call is wrong, 1 if it was "
               "stopped or something is missing")
    parser.add_argument("mission", metavar="MISSION", help="the file of a mission, or its name")
    parser.add_argument("settings", nargs="*", metavar="KEY:=VALUE",
                        help="a key of the controller's configuration, such as robotInterface:=release-1.0")
    parser.add_argument("--faults", type=_one_of(*FAULTS), metavar="|".join(FAULTS),
                        help="each single fault (every call in every way, every topic silent; the default), each two "
                             "faults of one kind, or none")
    parser.add_argument("--visitors", type=_list_of(_visitor), metavar="NAMES",
                        help="some of {}, with commas between them; all if not given, with --runs {}".format(
                            ", ".join(BEHAVIOURS), ENGAGES))
    parser.add_argument("--kinds", type=_list_of(_one_of(*KINDS)), metavar="NAMES",
                        help="in which ways calls go wrong: some of {}".format(", ".join(KINDS)))
    parser.add_argument("--planned", type=_list_of(_planned), metavar="NODE:CALL:KIND",
                        help="calls that go wrong, with commas between them, instead of --faults")
    parser.add_argument("--silent", type=_list_of(str), metavar="TOPICS", help="topics that are silent, as --planned")
    parser.add_argument("--runs", type=_number(1, 1e6, int), metavar="N",
                        help="play N passes for each failure rate, with random faults, instead of --faults")
    parser.add_argument("--failureRate", type=_list_of(_number(0, 1)), metavar="P",
                        help="failure rates for --runs, with commas between them; {} if not given".format(
                            ", ".join(map("{:g}".format, RATES))))
    parser.add_argument("--seed", type=_number(1, 1e9, int), metavar="N", help="the first seed for --runs; 1 if not given")
    parser.add_argument("--limit", type=_number(1, 1e6), default=LIMIT, metavar="SECONDS",
                        help="of the mission's time, after which a pass does not end; {:g} if not given".format(LIMIT))
    parser.add_argument("--jobs", type=_number(1, 1024, int), default=len(os.sched_getaffinity(0)), metavar="N",
                        help="processes; one for each core if not given")
    parser.add_argument("--json", action="store_true", help="print all as JSON")
    parser.add_argument("--html", metavar="FILE", help="write all as a web page, too")
    return parser


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Exit with one line if options contradict each other."""
    ways = [name for name in ("faults", "planned", "silent", "runs") if getattr(options, name)]
    if len(ways) > 1 and ways != ["planned", "silent"]:
        parser.error("--{} and --{} exclude each other".format(ways[0], ways[-1]))
    for name in ("failureRate", "seed"):
        if getattr(options, name) is not None and not options.runs:
            parser.error("--{} is for --runs".format(name))
    if options.kinds and (options.planned or options.silent or options.faults == NONE):
        parser.error("--kinds is for --faults and --runs")


def read(argv: Optional[Sequence[str]]) -> argparse.Namespace:
    """Return the options of the command. Exits with one line if they are wrong."""
    parser = _parser()
    options = parser.parse_intermixed_args(argv)
    _check(parser, options)
    return options


def plan(options: argparse.Namespace) -> Plan:
    """Return the plays that the options ask for. Raises FaultsFound."""
    given = _settings(options.settings)
    path = options.mission if os.path.exists(options.mission) or options.mission.endswith(".xml") \
        else find(options.mission)
    controller = arguments.load_controller(given)
    made = dict(controller.values), path, options.limit
    theatre = Theatre(*made)
    ways = [controller.asr_enabled] if ASR in given else [True, False]
    visitors = options.visitors or ([ENGAGES] if options.runs else list(BEHAVIOURS))
    calm = scenes.calm(visitors, ways)
    _check_robot(theatre.stage(ways[0]).settings.interface, options)
    kinds = options.kinds or KINDS
    is_complete = set(visitors) == set(BEHAVIOURS) and len(ways) == 2 and options.limit >= LIMIT \
        and options.faults in (None, SINGLE, PAIRS) \
        and not (options.runs or options.planned or options.silent or options.kinds)
    chosen = [options.mission] + [word for word in options.settings if not word.startswith(ASR + ":=")]
    return Plan(made, theatre, list(_scenes(options, theatre, calm, kinds)), is_complete, chosen)


def _scenes(options: argparse.Namespace, theatre: Theatre, calm: List[Scene], kinds: Sequence[str]) -> Iterator[Scene]:
    if options.runs:
        yield from scenes.random(calm, options.runs, options.failureRate or RATES, options.seed or 1, kinds)
    elif options.planned or options.silent:
        for scene in calm:
            yield scene._replace(planned=tuple(options.planned or ()), silent=tuple(options.silent or ()))
    else:
        yield from calm
        if options.faults != NONE:
            yield from scenes.single(theatre, calm, kinds)
        if options.faults == PAIRS:
            yield from scenes.pairs(theatre, calm, kinds)


def _settings(words: Sequence[str]) -> Dict[str, str]:
    """Return key -> value. Raises ConfigurationError with every key that the controller does not have."""
    given, faults = {}, []
    for word in words:
        name, is_assignment, value = word.partition(":=")
        if is_assignment and name in arguments.CONTROLLER:
            given[name] = value
        else:
            faults.append(Fault("argument " + clean(word), 0, 0, "this is not a key of the controller's configuration",
                                did_you_mean(name, arguments.CONTROLLER) or "the form is key:=value"))
    if faults:
        raise ConfigurationError(faults)
    return given


def _check_robot(interface: Any, options: argparse.Namespace) -> None:
    """Raise ConfigurationError with every node and topic that the robot does not have."""
    nodes = {service.node for service in interface.services}
    heard = {topic.name for topic in topics(interface)}
    faults = [Fault("argument --planned", 0, 0, "the robot {} has no node {}".format(interface.name, clean(fault.node)),
                    did_you_mean(fault.node, nodes) or "there are: {}".format(", ".join(sorted(nodes))))
              for fault in options.planned or () if fault.node not in nodes]
    faults += [Fault("argument --silent", 0, 0, "the robot {} has no topic {}".format(interface.name, clean(name)),
                     did_you_mean(name, heard) or "there are: {}".format(", ".join(sorted(heard))))
               for name in options.silent or () if name not in heard]
    if faults:
        raise ConfigurationError(faults)


# ---------------------------------------------------------------------------------------------------------------- main


def main(argv: Optional[List[str]] = None) -> int:
    """Play, print the findings, and return the exit code."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    options = read(argv)
    page = open(options.html, "w", encoding="utf-8") if options.html else None
    try:
        todo = plan(options)
    except BehaviorControllerError as error:
        print(error)
        return exits.WRONG_INPUT
    except KeyboardInterrupt:
        return exits.UNAVAILABLE
    began = time.monotonic()
    survey = Survey(todo.theatre, todo.chosen)
    _play(todo, options.jobs, survey)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    is_over = survey.plays == len(todo.scenes)
    result = Result(todo, survey.rows(), survey.shares(), survey.found(todo.is_complete and is_over) if survey.plays else [],
                    survey.plays, time.monotonic() - began, _only_story(survey, todo))
    print(json.dumps(as_json(result), indent=1) if options.json else as_text(result))
    if page is not None:
        with page:
            page.write(rehearse_page.to_html(heading(result), result.rows, result.shares, result.found))
    return exits.FOUND if result.found else exits.SUCCESS if is_over else exits.UNAVAILABLE


def _play(todo: Plan, jobs: int, survey: Survey) -> None:
    """Play all scenes, or those until Ctrl-C."""
    try:
        for outcome in scenes.play_all(todo.theatre, todo.arguments, todo.scenes, jobs):
            survey.take(outcome)
            _show_progress(survey.plays, len(todo.scenes))
    except KeyboardInterrupt:
        pass
    finally:
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K")  # takes the line away


def _show_progress(done: int, of: int) -> None:
    if sys.stderr.isatty():
        filled = BAR * done // of
        sys.stderr.write("\r[{}{}] {} of {} plays".format("#" * filled, "." * (BAR - filled), done, of))
        sys.stderr.flush()


def _only_story(survey: Survey, todo: Plan) -> Tuple[str, ...]:
    """Return the lines of the play, if there is only one."""
    return tuple(_story_lines(survey.story(todo.scenes[0]))) if len(todo.scenes) == 1 and survey.plays else ()


class Result(NamedTuple):
    """The result of a rehearsal."""

    plan: Plan
    rows: List[Row]
    shares: List[Share]
    found: List[Found]
    plays: int
    seconds: float
    story: Tuple[str, ...]  # of the only play


# ---------------------------------------------------------------------------------------------------------------- text


def heading(result: Result) -> str:
    """Return a line with the numbers of plays and their time."""
    total = len(result.plan.scenes)
    robot = result.plan.theatre.stage(result.plan.scenes[0].by_voice).settings.interface.name
    stopped = "" if result.plays == total else ", stopped before the other {}".format(total - result.plays)
    return "{}, robot {}: {} in {:.1f} s{}".format(clean(os.path.basename(result.plan.arguments[1])), robot,
                                                   count(result.plays, "play", "plays"), result.seconds, stopped)


def as_text(result: Result) -> str:
    """Return the result as lines of text."""
    lines = [heading(result)]
    if result.rows:
        lines += [""] + _columns(rehearse_page.ROW_HEAD, [rehearse_page.row_cells(row) for row in result.rows])
    if result.shares:
        lines += [""] + _columns(rehearse_page.SHARE_HEAD, [rehearse_page.share_cells(share) for share in result.shares])
    if result.story and not result.found:
        lines += [""] + list(result.story)
    told = ""
    for found in result.found:
        lines += _found_lines(found, found.kind.name != told)
        told = found.kind.name
    kinds = len({found.kind.name for found in result.found})
    return "\n".join(lines + ["", "nothing was found" if not result.found else "found: {} at {}".format(
        count(kinds, "kind of mistake", "kinds of mistakes"), count(len(result.found), "place", "places"))])


def _found_lines(found: Found, is_first: bool) -> List[str]:
    """Return a finding in lines; the first of its kind with its meaning and its story."""
    lines = [""] + ["{}: {}".format(found.kind.name, line) if number == 0 else "  " + line for number, line in enumerate(
        textwrap.wrap(found.kind.means, WIDTH))] if is_first else []
    lines.append("  {}{}: {}".format(found.where or "the mission", " ({})".format(found.place) if found.place else "",
                                     found.what))
    if found.scene is None:
        return lines
    lines.append("    in {}, the shortest: {}".format(count(found.plays, "play", "plays"), words(found.scene)))
    if is_first:
        lines += ["      " + line for line in _story_lines(found.story)]
    return lines + ["    again: " + found.command]


def _story_lines(story: Sequence[Any]) -> List[str]:
    return ["{:7.1f} s  {}".format(sentence.at, sentence.text) for sentence in story]


def words(scene: Scene) -> str:
    """Return how a scene differs from the others, in one line."""
    wrong = [str(fault) for fault in scene.planned] + ["{} silent".format(name) for name in scene.silent]
    wrong += ["failure rate {:g}, seed {}".format(scene.rate, scene.seed)] if scene.seed else []
    return "visitor {}, by {}, {}".format(
        scene.visitor, "voice" if scene.by_voice else "tablet", ", ".join(wrong) or "no fault")


def _columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> List[str]:
    widths = [max(len(row[column]) for row in [head, *rows]) for column in range(len(head))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in [head, *rows]]


def as_json(result: Result) -> Dict[str, Any]:
    """Return the result as data for JSON."""
    return {
        "mission": result.plan.arguments[1], "plays": result.plays, "planned_plays": len(result.plan.scenes),
        "visitors": [dict(row._asdict(), with_faults=dict(row.with_faults)) for row in result.rows],
        "shares": [dict(share._asdict(), share=share.share, interval=list(share.interval)) for share in result.shares],
        "found": [dict(
            found._asdict(), kind=found.kind.name, means=found.kind.means,
            scene=None if found.scene is None else dict(
                found.scene._asdict(), planned=list(map(str, found.scene.planned))),
            story=[sentence._asdict() for sentence in found.story]) for found in result.found]}
