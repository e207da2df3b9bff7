"""``missionStatus``: prints the running mission's tree in the terminal, once or again at every change."""
import argparse
import json
import sys
import urllib.error
import urllib.request
from typing import Any, Dict, Iterator, List, Optional

from behavior_controller.text import clean

SIGNS = {"R": "▶", "S": "✔", "F": "✘", "s": "✔", "f": "✘", "r": "■", "-": "·"}
WORDS = {"R": "running", "S": "success", "F": "failure", "s": "was success", "f": "was failure", "r": "was halted",
         "-": ""}
CLEAR = "\x1b[H\x1b[2J"
LIMIT = 5.0
"""Seconds that the node may take to answer."""

SUCCESS, NOT_THERE = 0, 1


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code: 0, or 1 if no mission is running there."""
    parser = argparse.ArgumentParser(prog="missionStatus", description="Prints the tree of the running mission.")
    parser.add_argument("--watch", action="store_true", help="go on, at every change, until Ctrl-C")
    parser.add_argument("--all", action="store_true", help="also the nodes that have not been ticked")
    parser.add_argument("--address", default="127.0.0.1", help="monitorAddress of the node (default %(default)s)")
    parser.add_argument("--port", type=int, default=8080, help="monitorPort of the node (default %(default)s)")
    chosen = parser.parse_args(arguments)
    base = "http://{}:{}".format(chosen.address, chosen.port)
    state: Dict[str, Any] = {}
    try:
        for news in _news(base) if chosen.watch else [_fetch(base)]:
            state.update(news)
            text = "\n".join(clean(line, len(line)) for line in lines(state, chosen.all))
            print(CLEAR + text if chosen.watch and sys.stdout.isatty() else text, flush=True)
    except (OSError, ValueError, KeyError) as error:
        reason = getattr(error, "reason", error)
        print("missionStatus: no mission answers at {} ({}): does behaviorController run, with this monitorPort?".format(
            base, reason), file=sys.stderr)
        return NOT_THERE
    return SUCCESS


def _fetch(base: str) -> Dict[str, Any]:
    with urllib.request.urlopen(base + "/state", timeout=LIMIT) as answer:
        return json.load(answer)


def _news(base: str) -> Iterator[Dict[str, Any]]:
    """Yield the parts that have changed, as they come."""
    with urllib.request.urlopen(base + "/events", timeout=60.0) as answer:
        for line in answer:
            if line.startswith(b"data: "):
                yield json.loads(line[6:])


def lines(state: Dict[str, Any], is_all: bool) -> List[str]:
    """Return the board as text: the mission, the tree with a sign for each node, the passes, what is wrong."""
    mission, passes, letters = state["mission"], state["passes"], state["statuses"]["letters"]
    found = ["mission {}; visitors: {}{}".format(mission["file"], passes["count"], "".join(
        "; pass {}: {}".format(last["number"], last["outcome"]) for last in passes["last"][-1:]))]
    if mission["tree"] is not None:
        found += _tree(mission["tree"], letters, 0, is_all)
    found += ["{} {}: {}; {}".format(part["kind"], part["name"], part["status"], part["consequence"])
              for part in state["health"] if not part["well"]]
    return found + ["{}  {}".format(line["time"], line["text"]) for line in state["trouble"][-5:]]


def _tree(node: Dict[str, Any], letters: str, depth: int, is_all: bool) -> List[str]:
    letter = letters[node["uid"] - 1]
    if letter == "-" and not is_all and depth:
        return []
    label = " ".join(filter(None, (node["name"], node["kind"])))
    words = ": " + WORDS[letter] if WORDS[letter] else ""
    found = ["{}{} {}{}".format("  " * depth, SIGNS[letter], label, words)]
    return found + [line for child in node["children"] for line in _tree(child, letters, depth + 1, is_all)]
