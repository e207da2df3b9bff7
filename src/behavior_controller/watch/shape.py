"""What each line of a record holds, and what is wrong with a line that does not."""
import json
import math
from typing import Any, Callable, Dict, Optional

from behavior_controller.gateway import Cause
from behavior_controller.interface.document import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.watch.board import LETTERS

Check = Callable[[Any], bool]

LATEST = 1e11
"""Unix seconds that no record reaches: a date in the year 5138."""

_DIGITS = 18  # of a whole number: Python takes quadratic time for long ones


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_bool(value: Any) -> bool:
    return isinstance(value, bool)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return _is_whole(value) and value > 0


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _is_time(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= LATEST


def _is_object(value: Any) -> bool:
    return isinstance(value, dict)


def _list(each: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(each, value))


def _row(*checks: Check) -> Check:
    return lambda value: (isinstance(value, list) and len(value) == len(checks)
                          and all(check(part) for check, part in zip(checks, value)))


def _one_of(*words: str) -> Check:
    return lambda value: isinstance(value, str) and value in words


_is_outcome = _one_of("SUCCESS", "FAILURE", "IDLE", "SKIPPED")
_is_location = _row(_is_number, _is_number, _is_number)
_is_exhibit = _row(_is_text, _is_text, _is_text, _is_location, _is_location)
_is_node = _row(_is_text, _is_text, _is_text, _is_whole)


def _is_tree(value: Any) -> bool:
    """Whether the first node is the root and each other one comes after its parent."""
    return (_list(_is_node)(value) and bool(value) and value[0][3] == 0
            and all(0 < node[3] <= number for number, node in enumerate(value[1:], 1)))


_FAILURE: Dict[str, Check] = {
    "cause": _one_of(*(cause.value for cause in Cause)), "message": _is_text, "resource": _is_text}


def _is_failure(value: Any) -> bool:
    return isinstance(value, dict) and all(name in value and check(value[name]) for name, check in _FAILURE.items())


def _is_failure_or_none(value: Any) -> bool:
    return value is None or _is_failure(value)


_STEP: Dict[str, Check] = {"node": _is_text, "path": _is_text}
FIELDS: Dict[str, Dict[str, Check]] = {
    "Tree": {"id": _is_text, "nodes": _is_tree},
    "RunStarted": {"mission": _is_text, "sha256": _is_text, "settings": _is_object,
                   "leaves": _list(_row(_is_text, _is_text))},
    "Tick": {"at": _is_number, "first": _is_bool, "changes": _list(_row(_is_whole, _one_of(*LETTERS.values())))},
    "Asked": {"call": _is_count, "service": _is_text, "request": _row(_is_text, _is_object)},
    "Answered": {"call": _is_count},
    "Message": {"topic": _one_of(*(topic.name for topic in INTERFACE.topics)), "read": _is_count, "arrived": _is_number,
                "value": lambda value: True},
    "LeafFinished": dict(_STEP, uid=_is_whole, status=_is_outcome, resource=_is_text, seconds=_is_number,
                         failure=_is_failure_or_none),
    "Retried": dict(_STEP, attempt=_is_whole, failure=_is_failure),
    "Recovered": dict(_STEP, failure=_is_failure, policy=_is_text, attempts=_is_whole, success=_is_bool,
                      outcome=_is_text),
    "HealthChanged": {"kind": _is_text, "name": _is_text, "node": _is_text, "is_well": _is_bool, "status": _is_text,
                      "consequence": _is_text, "respect": _is_text},
    "PassStarted": {"number": _is_whole, "at": _is_number},
    "PassFinished": {"number": _is_whole, "outcome": _is_outcome, "seconds": _is_number},
    "Noticed": {"level": _is_text, "text": _is_text},
    "RunFinished": {"outcome": _is_text, "exit_code": _is_whole},
    "Lost": {"lines": _is_whole},
}
"""Event -> its fields but for ``event`` and ``time``."""

_VALUES: Dict[str, Check] = {
    FACES.name: _row(_list(_is_text), _list(_is_bool)),
    ATTENTION.name: _row(_is_text, _is_whole),
    SPEECH.name: _is_text,
}
"""Topic -> its message."""


class RecordShape:
    """Checks the lines of one record, in their order."""

    def __init__(self) -> None:
        self.has_mission = False
        self._shown = self._running = 0  # nodes of the newest tree, and of the running mission's

    def line(self, data: bytes) -> Dict[str, Any]:
        """Return the next line. Raises ValueError, which says what is wrong."""
        line = _parsed(data)
        if line["event"] == "Tree":
            self._shown = len(line["nodes"])
        elif line["event"] == "RunStarted":
            if not self._shown:
                raise ValueError("no tree stands before it")
            self.has_mission, self._running = True, self._shown
        elif line["event"] == "Tick" and self.has_mission:
            if not all(0 < uid <= self._running for uid, _ in line["changes"]):
                raise ValueError("the mission has no node of that number")
        return line


def _parsed(data: bytes) -> Dict[str, Any]:
    try:
        line = json.loads(data.decode("utf-8-sig"), parse_int=_whole)
    except UnicodeDecodeError as error:
        raise ValueError("it is not UTF-8 text") from error
    except json.JSONDecodeError as error:
        raise ValueError("it is not JSON: {} at column {}".format(error.msg, error.colno)) from error
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(line, dict) or not isinstance(line.get("event"), str):
        raise ValueError("it has no event")
    if line["event"] not in FIELDS:
        raise ValueError("the event {} is unknown".format(line["event"]))
    wrong = _wrong_field(line)
    if wrong:
        raise ValueError("the field {} of {} is {}".format(
            wrong, line["event"], "wrong" if wrong in line else "missing"))
    return line


def _wrong_field(line: Dict[str, Any]) -> Optional[str]:
    for name, check in dict(FIELDS[line["event"]], time=_is_time).items():
        if name not in line or not check(line[name]):
            return name
    if line["event"] == "Message" and line["value"] is not None and not _VALUES[line["topic"]](line["value"]):
        return "value"
    if line["event"] == "Answered":
        if "failure" in line:
            return None if _is_failure(line["failure"]) else "failure"
        return None if _row(_is_text, _list(_is_exhibit))(line.get("answer")) else "answer"
    return None


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise ValueError("a whole number has more than {} digits".format(_DIGITS))
    return int(text)
