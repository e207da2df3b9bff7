"""``missionStatus``: prints the running mission's tree in the terminal, once or again at every
change.

It reads the lines of the run: from its record if that is written on this computer, or else from the
viewer's address.
"""
import argparse
import contextlib
import http.client
import itertools
import math
import os
import queue
import sys
import textwrap
import threading
import time
from functools import partial
from typing import Callable, Dict, Iterator, List, Optional, Set, Tuple, Union

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from behavior_controller import exit_codes, folders, ros_arguments
from behavior_controller.errors import MissionError
from behavior_controller.folders import mission_name
from behavior_controller.run.events import (
    AWAITED, DOUBTFUL, HANGS, MISSING, READY, follow_simulated_time, unix_now, use_clock_of)
from behavior_controller.run.readiness import UNTRIED
from behavior_controller.run.moment import card_line
from behavior_controller.run.record import files
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.tail import follow
from behavior_controller.run.state import State
from behavior_controller.viewer import parts
from behavior_controller.viewer.addresses import is_loopback
from behavior_controller.viewer.backlog import Batch
from behavior_controller.viewer.view import CONTROLLER_STOPPED, View
from behavior_controller.text import clean, joined

DONE_AGAIN = "again"
"""Instead of the letter of a failed node that a recovery does again."""

MARKS = {"R": "▶", "S": "✔", "F": "✘", "s": "✔", "f": "✘", "r": "■", "-": "·", DONE_AGAIN: "↻"}
MEANINGS = {"R": "running", "S": "success", "F": "failure", "s": "was success",
            "f": "was failure", "r": "was halted", "-": "",
            DONE_AGAIN: "done again after a failure"}
READY_MARKS = {READY: "✔", UNTRIED: "○", AWAITED: "…", DOUBTFUL: "!", MISSING: "✘"}
TOP, END_OF_LINE, BELOW = "\x1b[H", "\x1b[K", "\x1b[J"
"""Control sequences: move to the first line, clear the rest of a line, clear the rest of the
window."""

LATE = 2.0
"""Seconds without a message after which the display may be outdated; the node sends one every
second."""

FIRST_ANSWER_LIMIT = 5.0
"""Seconds within which the first answer must be complete."""

NO_MESSAGE_LIMIT = 30.0
"""Seconds without a message after which ``--watch`` ends."""

LONGEST_LINE_READ = 10_000_000
"""Bytes of a line from the viewer."""

ENOUGH_BYTES = 1_000_000
"""The size from which the newest file of a record, which begins with what was so before, is read
alone; else the one before it is read too: the viewer has at least 5000 lines for a late reader."""

MAX_INDENT = 30
"""Levels of the tree that are indented."""

MOST_ENTRIES = 5
"""The most entries about what went wrong: the newest."""

MOST_STATES_WAITING = 100
"""The most messages that wait for a blocked terminal."""


class ShownState(Struct, frozen=True):
    """The parts of the board that are printed; ``silent``: seconds since the last message, ``lag``:
    those since the last line of a record that is old."""

    mission: parts.MissionPart
    statuses: parts.Statuses
    now: parts.Now
    story: parts.StoryPart
    health: Dict[str, parts.Offer]
    alive: parts.Alive
    ready: parts.Ready
    silent: float = 0.0
    lag: float = 0.0


EXIT_CODES = """0: the mission was shown (with --watch: until it ended), and with --ready all is
ready; 1: with --ready something has to be waited for or repaired; no mission answers there, what
answers is not a mission, the connection is lost, or nothing can be printed; 2: wrong arguments"""


class NoMission(Exception):
    """No mission can be shown, or no longer; the text says why."""


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code, see ``EXIT_CODES``."""
    chosen = _read_arguments(arguments)
    place = f"http://{chosen.address}:{chosen.port}"
    is_terminal = sys.stdout.isatty()
    is_window = chosen.watch and is_terminal
    shown: List[str] = []
    code = exit_codes.UNAVAILABLE
    wanted = chosen.robot and f" of {chosen.robot}"
    problem = (f"no mission{wanted} answers at {place} ({{}}): does behaviorController run, with "
               "this monitorPort?")
    try:
        for state in _states(chosen, chosen.watch):
            text = lines(state, chosen.all, is_terminal and not is_window)
            code = exit_codes.SUCCESS
            if chosen.ready:
                text = ready_lines(state.ready)
                if not state.ready.is_ready:
                    code = exit_codes.UNAVAILABLE
            if is_window:
                size = os.get_terminal_size(sys.stdout.fileno())
                text = fitted(text, size.columns or 80, size.lines or 24)
            if text != shown:
                _print(text, is_window)
            shown, problem = text, f"the connection to {place} is lost ({{}})"
            if chosen.watch and state.now.ended:
                print("missionStatus: the mission has ended: " + clean(state.now.ended))
                break
        return code
    except NoMission as reason:
        problem = problem.format(clean(str(reason)))
    except OSError as error:
        problem = f"cannot print: {error.strerror}"
    print("missionStatus:", problem, file=sys.stderr)
    return exit_codes.UNAVAILABLE


def _read_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    parser = ros_arguments.CommandParser(
        "missionStatus", "Prints the tree of the running mission.", EXIT_CODES)
    parser.add_argument("--watch", action="store_true",
                        help="go on, at every change, until the mission ends or Ctrl-C")
    parser.add_argument("--all", action="store_true",
                        help="also the nodes that have not been ticked in this pass")
    parser.add_argument("--ready", action="store_true",
                        help="whether all is ready for a demonstration, instead of the tree")
    parser.add_argument("--address", default="127.0.0.1",
                        help="monitorAddress of the node (default %(default)s)")
    parser.add_argument("--robot", default="", type=lambda text: text.lstrip("/"), help="robot of "
                        "the node, if it is one of several; else the one with that address and "
                        "port")
    parser.add_argument("--port", type=partial(ros_arguments.port, least=1), default=8080,
                        help="monitorPort of the node (default %(default)s)")
    return ros_arguments.parse(parser, arguments)


def _print(text: List[str], is_window: bool) -> None:
    """Print; in a window, replace the text that was printed before."""
    if is_window:
        print(TOP + (END_OF_LINE + "\n").join([*text, BELOW]), end="", flush=True)
    else:
        print("\n".join(text), flush=True)


# ----------------------------------------------------------------------------------------- the node


def _states(chosen: argparse.Namespace, is_watching: bool) -> Iterator[ShownState]:
    """Yield the whole board after each message and, while none comes, again, with ``silent``:
    seconds since the last one. Raises NoMission if no further message comes.

    A separate thread reads: a disk or a server may hang or be slow at any moment.
    """
    messages: "queue.Queue[Union[ShownState, NoMission]]" = queue.Queue(MOST_STATES_WAITING)
    threading.Thread(target=_read, args=(chosen, messages.put), name="messages",
                     daemon=True).start()
    state: Union[ShownState, NoMission] = NoMission(
        f"no complete answer within {FIRST_ANSWER_LIMIT:g} s")
    came, wait = time.monotonic(), FIRST_ANSWER_LIMIT
    while True:
        with contextlib.suppress(queue.Empty):
            state, came = messages.get(timeout=wait), time.monotonic()
        if isinstance(state, NoMission):
            raise state
        silent = time.monotonic() - came
        if silent >= NO_MESSAGE_LIMIT:
            raise NoMission(f"no message for {silent:.0f} s")
        yield replace(state, silent=silent)
        if not is_watching:
            return
        wait = LATE if silent < LATE else 1.0


def _read(chosen: argparse.Namespace, put: Callable[[Union[ShownState, NoMission]], None]) -> None:
    """Read the run from its record, or else from its viewer, or from a record that lags."""
    reason = "the answer is not a mission's"
    address, port, robot = chosen.address, chosen.port, chosen.robot
    try:
        for view in itertools.chain(_of_record(address, port, robot, HANGS),
                                    _of_viewer(address, port)):
            mission = view.mission()
            if mission.file and robot not in ("", mission.robot):
                raise MissionError.of("robot " + robot, "no mission of it runs on this computer, "
                                      f"and this one is of {mission.robot or 'another'}")
            put(_shown(view))
            reason = "the connection was closed"
    except msgspec.ValidationError as error:
        reason = f"the answer is not a mission's: {error}"
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        reason = "the answer is not JSON"
    except (OSError, ValueError, http.client.HTTPException, MissionError) as error:
        reason = str(getattr(error, "strerror", None) or error) or type(error).__name__
    for view in _of_record(address, port, robot, math.inf):
        put(_shown(view, _age(view.state)))
    put(NoMission(reason))


def _shown(view: View, lag: float = 0.0) -> ShownState:
    return ShownState(view.mission(), view.statuses(), view.now(), view.story(), view.health(),
                      view.alive(), view.ready(), lag=lag)


def _age(state: State) -> float:
    """Return how many seconds ago the last event was."""
    return max(0.0, unix_now() - state.at)


def _of_record(address: str, port: int, robot: str, oldest: float) -> Iterator[View]:
    """Yield the view of a run of that robot that is written on this computer and whose page has
    that port, or else of one without a page, again and again until the run ends, its record cannot
    be read, or lags by ``oldest`` seconds, as on a disk that is full. If a robot is named, its page
    may have any port."""
    if not is_loopback(address):
        return
    for page, path in itertools.product((port, 0), reversed(files.runs(folders.records()))):
        with contextlib.suppress(OSError, MissionError):
            view, is_shown = View(), False
            if not files.is_written(path):
                continue
            newest = 1 if os.path.getsize(files.parts(path)[-1]) >= ENOUGH_BYTES else 2
            for line in follow(path, newest):
                if line is not None:
                    follow_simulated_time(line)
                    view.take(line.time, line.event)
                    continue
                is_shown = _age(view.state) < oldest and _is_wanted(view.state, page, robot)
                if not is_shown:
                    break
                yield view
            if is_shown:
                view.stopped = CONTROLLER_STOPPED
                yield view
                return


def _is_wanted(state: State, port: int, robot: str) -> bool:
    known = state.start.settings
    return known.get("robot", "") == robot and (robot != "" or known.get("monitorPort") == port)


def _of_viewer(address: str, port: int) -> Iterator[View]:
    """Yield the view after each batch of lines that the viewer there sends."""
    connection = http.client.HTTPConnection(address, port)
    connection.request("GET", "/lines")
    answer = connection.getresponse()
    if answer.status != http.client.OK:
        raise ValueError(f"the answer is HTTP {answer.status} {answer.reason}")
    view, decoder, is_simulated = View(), Decoder(f"{address}:{port}"), False
    for text in iter(lambda: _line(answer), b""):
        batch = msgspec.json.decode(text, type=Batch)
        if batch.is_first:
            view, decoder = View(), Decoder(f"{address}:{port}")
        for _ in range(batch.lines):
            new = list(decoder.read(_line(answer)))
            is_simulated = is_simulated or any(line.computer is not None for line in new)
            view.extend(new)
        use_clock_of(batch.at - time.monotonic(), is_simulated)
        view.stopped = batch.stopped
        yield view


def _line(answer: http.client.HTTPResponse) -> bytes:
    """Return the next line, empty at the end. Raises ValueError for one that is too long."""
    line = answer.readline(LONGEST_LINE_READ + 1)
    if len(line) > LONGEST_LINE_READ:
        raise ValueError(f"the answer has more than {LONGEST_LINE_READ} bytes")
    return line


# ----------------------------------------------------------------------------------------- the text


def lines(state: ShownState, is_all: bool, is_card_last: bool = False) -> List[str]:
    """Return the board as text: the card, what a person has to do, the robot, what is wrong, the
    tree with a symbol for each node. In a terminal that scrolls the card is last: a long tree would
    hide it.
    """
    head, troubles = list(map(clean, _head(state))), list(map(clean, _troubles(state)))
    tree = _tree(state.mission.nodes, state.statuses, is_all)
    if is_card_last:
        return [*tree, *troubles, *reversed(head)]
    return [*head, *troubles, *tree]


def _head(state: ShownState) -> List[str]:
    now, mission = state.now, state.mission
    doing = card_line(now.card, state.alive.at + state.silent)
    if now.ended and now.card.kind != "ended":  # the record does not say how
        doing = f"{now.ended}; last: {now.card.what}"
    of_robot = f" of {mission.robot}" * bool(mission.robot)
    name = f"mission {mission_name(mission.file)}".rstrip()  # it is not known before the start
    head = [f"{name}{of_robot}: {doing}"]
    if now.robot.instruction:
        head.append("to do: " + now.robot.instruction)
    head.append("robot: " + replace(now.robot, instruction="").text)
    heard = [f"{row.name}: {row.text}" for row in state.ready.rows
             if row.kind == "topic" and row.state == READY]
    if heard and not now.ended:
        head.append("hears: " + " · ".join(heard))
    if state.silent + state.lag >= LATE:
        head.append(f"no message for {state.silent + state.lag:.0f} s: what is shown may be old")
    elif state.alive.hangs:
        head.append(f"the controller hangs: no sign of its tick thread for {state.alive.age} s")
    return head


def ready_lines(ready: parts.Ready) -> List[str]:
    """Return the list of what is ready, with a headline."""
    head = "ready" if ready.is_ready else "not ready"
    return [head, *(clean(f"{READY_MARKS[row.state]} {row.kind} {row.name}: {row.text}")
                    for row in ready.rows)]


def fitted(text: List[str], width: int, height: int) -> List[str]:
    """Return the lines of a window: all are wrapped, and of the tree those around the running leaf
    are shown.
    """
    wrapper = textwrap.TextWrapper(width, subsequent_indent="    ", break_on_hyphens=False)
    wrapped = [part for line in text for part in wrapper.wrap(line)]
    running = (MARKS["R"], MARKS[DONE_AGAIN])
    head = next((at for at, row in enumerate(wrapped) if row[0] in MARKS.values()), len(wrapped))
    here = max((at for at, row in enumerate(wrapped) if row.lstrip()[0] in running), default=0)
    room = max(0, height - 1 - head)
    first = max(head, min(here - room // 2, len(wrapped) - room))
    return [*wrapped[:head], *wrapped[first:first + room]][:max(1, height - 1)]


def _troubles(state: ShownState) -> Iterator[str]:
    """Yield what is wrong with the robot, and what went wrong last."""
    for part in state.health.values():
        if not part.well:
            yield f"{part.kind} {part.name}: {part.status}; {part.consequence}"
    for first, *rest in list(_entries(state.story.sentences))[-MOST_ENTRIES:]:
        yield f"{first.time}  {joined('; ', first.text, *(row.text for row in rest[-1:]))}"


def _entries(rows: List[parts.SentenceRow]) -> Iterator[List[parts.SentenceRow]]:
    """Yield in the order of time what went wrong, and what came of it: the sentences of an incident
    together as far as none of another one came between them."""
    incidents: Set[Tuple[int, float]] = set()
    shown: List[parts.SentenceRow] = []
    for row in rows:
        if row.kind == "health" and row.severity != "info":  # it has a line of its own
            continue
        if row.severity != "info":
            incidents.add(_incident(row))
        if _incident(row) in incidents:
            shown.append(row)
    for _, entry in itertools.groupby(shown, _incident):
        yield list(entry)


def _incident(row: parts.SentenceRow) -> Tuple[int, float]:
    return row.visit, row.incident or -row.number


def _tree(nodes: List[parts.NodeRow], statuses: parts.Statuses, is_all: bool) -> Iterator[str]:
    """Yield the rows of the nodes that were ticked, indented; without ``is_all`` not those that
    only group others.
    """
    depths = [0]
    for number, node in enumerate(nodes, 1):
        parent = node.parent if 0 < node.parent < number else 0
        letter = statuses.letters[number - 1:number] or "-"
        is_tip = number == statuses.tip
        is_shown = is_all or letter != "-" and (not node.bare or is_tip) or number == 1
        if is_tip and letter != "R":
            letter = DONE_AGAIN
        depths.append(depths[parent] + (is_shown and number > 1))
        if is_shown:
            words = joined(": ", clean(joined(" ", node.name, node.kind)), MEANINGS.get(letter, ""))
            yield f"{'  ' * min(depths[number], MAX_INDENT)}{MARKS.get(letter, '·')} {words}"
