"""The numbers of a mission file against the record, whatever the engine makes of them: how long a
Sleep lasts, and how often a step is tried again."""
import re
from typing import Any, Dict, Iterator, List, Sequence, Tuple

from behavior_controller.run.events import RunStarted, Tick

from unit_tests.judge import reference
from unit_tests.judge.facts import Facts

Changes = Sequence[Tuple[float, float, int, str]]
"""Changes of status: Unix time, time by the mission's clock, the node's number, its letter."""


def objections(facts: Facts, nodes: Sequence[Any]) -> Iterator[str]:
    """Object to a time, or a number of attempts, that is another than the mission file has.
    ``nodes`` are those of the last mission on record."""
    changes = _changes(facts)
    for node in nodes:
        port = reference.NUMBERED.get(node.registration_id, "")
        if re.fullmatch(r"\d+", node.attributes.get(port, "")):
            check = _of_sleep if node.registration_id == reference.SLEEP else _of_attempts
            yield from check(facts, changes, node, int(node.attributes[port]))


def _changes(facts: Facts) -> Changes:
    """Return the changes since the last mission on record was taken up: before that, a number is
    another node's."""
    changes: List[Tuple[float, float, int, str]] = []
    for line in facts.run.lines:
        if isinstance(line.event, RunStarted):
            changes.clear()
        elif isinstance(line.event, Tick):
            changes += [(line.time, line.event.at, *change) for change in line.event.changes]
    return changes


def _of_sleep(facts: Facts, changes: Changes, node: Any, milliseconds: int) -> Iterator[str]:
    began: Dict[int, float] = {}
    for time, at, uid, letter in changes:
        if uid != node.uid:
            continue
        if letter == "R":
            began[uid] = at
        elif letter == "S" and uid in began:
            longer = at - began.pop(uid) - milliseconds / 1000.0
            is_late = time > facts.latest(time - longer) and not facts.world.settings.ros_interface
            if longer < -facts.early or is_late:
                yield (f"{node.full_path} lasted {milliseconds / 1000.0 + longer:.1f} s instead of "
                       f"{milliseconds / 1000.0:.1f} s")
        else:
            began.pop(uid, None)


def _of_attempts(facts: Facts, changes: Changes, node: Any, attempts: int) -> Iterator[str]:
    child, failed = node.children[0].uid, 0
    for _, _, uid, letter in changes:
        if uid == child:
            failed += letter == "F"
        elif uid == node.uid and letter != "R":
            may_have_none = not failed and "_failureIf" in node.attributes
            if failed > attempts or letter == "F" and failed != attempts and not may_have_none:
                yield f"{node.full_path} made {failed} attempts that failed, of {attempts}"
            failed = 0
