"""``missionStatus``: prints the running mission's tree in the terminal, once or again at every change."""
import argparse
import http.client
import json
import os
import queue
import sys
import textwrap
import threading
import time
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

from behavior_controller import exits
from behavior_controller.text import clean
from behavior_controller.watch.plain import Wrong, form, inside

SIGNS = {"R": "▶", "S": "✔", "F": "✘", "s": "✔", "f": "✘", "r": "■", "-": "·"}
WORDS = {"R": "running", "S": "success", "F": "failure", "s": "was success", "f": "was failure", "r": "was halted",
         "-": ""}
TOP, END_OF_LINE, BELOW = "\x1b[H", "\x1b[K", "\x1b[J"
"""Control sequences: move to the first line, clear the rest of a line, clear the rest of the window."""

LATE = 2.0
"""Seconds without a message after which the display may be outdated; the node sends one every second."""

LIMIT = 5.0
"""Seconds within which the first answer must be complete."""

GIVEN_UP = 30.0
"""Seconds without a message after which ``--watch`` ends."""

MOST_BYTES = 10_000_000
"""Bytes of a message; 2,000 nodes are about 300,000."""

MOST_WAITING = 100
"""The most messages that wait for a blocked terminal."""

_Node = NamedTuple("_Node", [("parent", int), ("name", str), ("kind", str)])
_Offer = NamedTuple("_Offer", [("kind", str), ("name", str), ("well", bool), ("status", str), ("consequence", str)])
PARTS: Dict[str, Any] = {
    "mission": NamedTuple("_Mission", [("file", str), ("nodes", List[_Node])]),
    "statuses": NamedTuple("_Statuses", [("letters", str)]),
    "passes": NamedTuple("_Passes", [("text", str), ("ended", str)]),
    "trouble": List[NamedTuple("_Trouble", [("time", str), ("text", str)])],  # type: ignore[misc]
    "health": List[_Offer],
    "alive": NamedTuple("_Alive", [("age", Optional[float]), ("hangs", bool)]),
}
"""The parts of the board that are printed."""

EXIT_CODES = """exit code: 0: the mission was shown (with --watch: until it ended); 1: no mission answers there, what
answers is not a mission, the connection is lost, or nothing can be printed; 2: wrong arguments"""

State = Dict[str, Any]


class NoMission(Exception):
    """No mission can be shown, or no longer; the text says why."""


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code, see ``EXIT_CODES``."""
    chosen = _read_arguments(arguments)
    place = "http://{}:{}".format(chosen.address, chosen.port)
    messages = _Messages(chosen.address, chosen.port, "/events" if chosen.watch else "/state")
    shown: List[str] = []
    try:
        for state in _states(messages, chosen.watch):
            window = _window() if chosen.watch else None
            found = lines(state, chosen.all) if window is None else in_window(state, chosen.all, *window)
            if found != shown:
                shown = found
                _print(found, window is not None)
            if chosen.watch and state["passes"]["ended"]:
                print("missionStatus: the mission has ended: " + clean(state["passes"]["ended"]))
                return exits.SUCCESS
    except NoMission as reason:
        what = "missionStatus: the connection to {} is lost ({})" if shown else (
            "missionStatus: no mission answers at {} ({}): does behaviorController run, with this monitorPort?")
        print(what.format(place, clean(str(reason))), file=sys.stderr)
        return exits.UNAVAILABLE
    except OSError as error:
        print("missionStatus: cannot print: {}".format(error.strerror), file=sys.stderr)
        return exits.UNAVAILABLE
    return exits.SUCCESS


def _read_arguments(arguments: Optional[List[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="missionStatus", description="Prints the tree of the running mission.",
                                     epilog=EXIT_CODES)
    parser.add_argument("--watch", action="store_true", help="go on, at every change, until the mission ends or Ctrl-C")
    parser.add_argument("--all", action="store_true", help="also the nodes that have not been ticked in this pass")
    parser.add_argument("--address", default="127.0.0.1", help="monitorAddress of the node (default %(default)s)")
    parser.add_argument("--port", type=_port, default=8080,
                        help="monitorPort of the node (default %(default)s)")
    return parser.parse_args(arguments)


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError("{!r} is not a port: 1 to 65535".format(text))
    return int(text)


def _window() -> Optional[Tuple[int, int]]:
    """Return columns and lines of the terminal; None if they are unknown, or the output is not a terminal."""
    try:
        size = os.get_terminal_size(sys.stdout.fileno()) if sys.stdout.isatty() else None
    except (OSError, ValueError):
        return None
    return None if size is None or min(size) < 1 else (size.columns, size.lines)


def _print(found: List[str], is_window: bool) -> None:
    """Print; in a window, replace the text that was printed before."""
    end = END_OF_LINE + "\n"
    print(TOP + end.join(found) + end + BELOW if is_window else "\n".join(found) + "\n", end="", flush=True)


# ------------------------------------------------------------------------------------------------------------ the node


class _Messages:
    """The node's messages, read on a separate thread: a server may hang or send slowly at any moment."""

    def __init__(self, address: str, port: int, path: str):
        self._found: "queue.Queue[Union[State, NoMission]]" = queue.Queue(MOST_WAITING)
        self._path = path
        threading.Thread(target=self._read, args=(address, port), name="messages", daemon=True).start()

    def get(self, seconds: float) -> Optional[State]:
        """Return the next message, or None after ``seconds``. Raises NoMission if no further message comes."""
        try:
            found = self._found.get(timeout=seconds)
        except queue.Empty:
            return None
        if isinstance(found, NoMission):
            raise found
        return found

    def _read(self, address: str, port: int) -> None:
        reason = "the connection was closed"
        try:
            connection = http.client.HTTPConnection(address, port)
            connection.request("GET", self._path)
            answer = connection.getresponse()
            if answer.status != http.client.OK:
                raise ValueError("the answer is HTTP {} {}".format(answer.status, answer.reason))
            for message in self._texts(answer):
                self._found.put(_parsed(message))
        except (OSError, ValueError, http.client.HTTPException) as error:
            reason = str(getattr(error, "strerror", None) or error) or type(error).__name__
        self._found.put(NoMission(reason))

    def _texts(self, answer: http.client.HTTPResponse) -> Iterator[bytes]:
        """Yield each message as JSON text."""
        if self._path == "/state":
            yield _bounded(answer.read(MOST_BYTES + 1))
            return
        for line in iter(lambda: _bounded(answer.readline(MOST_BYTES + 1)), b""):
            if line.startswith(b"data: "):
                yield line[6:]


def _bounded(data: bytes) -> bytes:
    if len(data) > MOST_BYTES:
        raise ValueError("the answer has more than {} bytes".format(MOST_BYTES))
    return data


def _parsed(text: bytes) -> State:
    """Return the parts of a message. Raises ValueError that says what is wrong with it."""
    try:
        found = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        raise ValueError("the answer is not JSON")
    try:
        for name, value in form(Dict[str, Any]).read(found).items():
            if name in PARTS:
                inside(name, form(PARTS[name]).read, value)
    except Wrong as wrong:
        raise ValueError("the answer is not a mission's: {}".format(wrong))
    return found


def _states(messages: _Messages, is_watching: bool) -> Iterator[State]:
    """Yield the whole board after each message and, while none comes, again, with ``silent``: seconds since the last one."""
    state = messages.get(LIMIT)
    if state is None:
        raise NoMission("no complete answer within {:g} s".format(LIMIT))
    missing = set(PARTS) - set(state)
    if missing:
        raise NoMission("the answer is not a mission's: {} is missing".format(min(missing)))
    heard = time.monotonic()
    while True:
        silent = time.monotonic() - heard
        if silent >= GIVEN_UP:
            raise NoMission("no message for {:.0f} s".format(silent))
        yield dict(state, silent=silent)
        if not is_watching:
            return
        news = messages.get(LATE if silent < LATE else 1.0)
        if news is not None:
            state.update(news)
            heard = time.monotonic()


# ------------------------------------------------------------------------------------------------------------ the text


def lines(state: State, is_all: bool) -> List[str]:
    """Return the board as text: the mission, the tree with a symbol for each node, what is wrong."""
    mission = state["mission"]
    found = ["mission {}; {}".format(mission["file"], state["passes"]["text"])] + list(_why_outdated(state))
    tree = [row.text(row.depth) for row in _tree(mission["nodes"], state["statuses"]["letters"], is_all)]
    return [clean(line) for line in found] + tree + _troubles(state)


def in_window(state: State, is_all: bool, width: int, height: int) -> List[str]:
    """Return the same in at most ``height`` - 1 lines of ``width`` characters: of the tree, the part around what runs."""
    mission = state["mission"]
    found = ["{}  mission {}".format(time.strftime("%H:%M:%S"), os.path.basename(mission["file"])),
             state["passes"]["text"] or "between two visits"] + list(_why_outdated(state))
    found = [part for line in found for part in textwrap.wrap(clean(line), width)][:max(1, height - 2)]
    troubles = _troubles(state)
    troubles = troubles[:1] + troubles[1:][-max(1, height // 4):]
    rows = _tree(mission["nodes"], state["statuses"]["letters"], is_all, is_brief=not is_all)
    deepest = max((row.depth for row in rows), default=0)
    tree = [row.text(row.depth if 4 * deepest <= width else min(row.depth, width // 4) / 2)
            for row in _about(rows, height - 1 - len(found) - len(troubles))]
    return [_cut(clean(line), width) for line in (found + tree + troubles)[:max(1, height - 1)]]


def _cut(line: str, width: int) -> str:
    return line if len(line) <= width else line[:width - 1] + "…"


def _troubles(state: State) -> List[str]:
    """Return what is wrong with the robot, and what went wrong last."""
    found = ["{} {}: {}; {}".format(part["kind"], part["name"], part["status"], part["consequence"])
             for part in state["health"] if not part["well"]]
    found += ["{}  {}".format(line["time"], line["text"]) for line in state["trouble"][-5:]]
    return [clean(line) for line in found]


def _why_outdated(state: State) -> Iterator[str]:
    """Yield the reasons why the display may be outdated."""
    silent = state.get("silent", 0.0)
    if silent >= LATE:
        yield "no message for {:.0f} s: what is shown may be old".format(silent)
    elif state["alive"]["hangs"]:
        yield "the controller hangs: no sign of its tick thread for {} s".format(state["alive"]["age"])


class _Row(NamedTuple):
    """One line of the tree; ``number`` is its node's, 0: nodes are left out here."""

    number: int
    depth: int
    label: str
    letter: str = "-"
    ancestors: Tuple[int, ...] = ()

    def text(self, depth: float) -> str:
        """Return the line, indented as for ``depth``."""
        return " " * int(2 * depth) + self.label


def _about(rows: List[_Row], room: int) -> List[_Row]:
    """Return at most ``room`` of the rows: the path to the running nodes, and the rows nearest to them."""
    here = max((at for at, row in enumerate(rows) if row.letter == "R"), default=0)
    way = [at for at, row in enumerate(rows) if row.number in rows[here].ancestors]
    others = sorted(set(range(len(rows))) - set(way) - {here}, key=lambda at: abs(at - here))
    chosen = rows[here:here + 1]
    for count in range(1, len(rows) + 1):
        more = _with_gaps(rows, sorted(([here] + way[::-1] + others)[:count]))
        if len(more) > room:
            break
        chosen = more
    return chosen


def _with_gaps(rows: List[_Row], kept: List[int]) -> List[_Row]:
    """Return those rows, with a row for each gap."""
    found: List[_Row] = []
    for at, before in zip(kept, [-1] + kept):
        if at != before + 1:
            found.append(_Row(0, rows[before + 1].depth, "…"))
        found.append(rows[at])
    return found + ([_Row(0, rows[kept[-1] + 1].depth, "…")] if kept[-1] + 1 < len(rows) else [])


def _tree(nodes: List[Dict[str, Any]], letters: str, is_all: bool, is_brief: bool = False) -> List[_Row]:
    """Return the rows of the tree; if ``is_brief``, without nodes that only group others and do not run by themselves."""
    found: List[_Row] = []
    ways: List[Tuple[int, ...]] = [()]  # the nodes above each node that have a row
    tip = letters.rfind("R") + 1
    hidden = {number for number, node in enumerate(nodes, 1) if is_brief and node.get("bare") and number != tip}
    for number, node in enumerate(nodes, 1):
        parent = node["parent"] if 0 < node["parent"] < number else 0
        ways.append(ways[parent] + ((parent,) if parent and parent not in hidden else ()))
        letter = letters[number - 1:number] or "-"
        if number not in hidden and (letter != "-" or is_all or number == 1):
            label = clean(" ".join(filter(None, (node["name"], node["kind"]))))
            words = ": " + WORDS[letter] if WORDS.get(letter) else ""
            found.append(_Row(number, len(ways[-1]), "{} {}{}".format(SIGNS.get(letter, "?"), label, words), letter, ways[-1]))
    return found
