"""The record of a run: every event as one JSON object a line, for the test report and for whoever asks later."""
import hashlib
import json
import os
import time
from typing import Any, Callable, Dict, Optional

from behavior_controller.events import Event, RunStarted
from behavior_controller.gateway import Failure

FILE_NAME = "mission.jsonl"


class Record:
    """A sink that appends to ``<directory>/mission.jsonl``. A write error is told once; the run goes on."""

    def __init__(self, directory: str, complain: Callable[[str], None]):
        self.path = os.path.join(directory, FILE_NAME)
        self._complain = complain
        self._file: Optional[Any] = None
        try:
            os.makedirs(directory, exist_ok=True)
            self._file = open(self.path, "w", encoding="utf-8")
        except OSError as error:
            self._give_up(error)

    def __call__(self, event: Event) -> None:
        """Write one event."""
        if self._file is None:
            return
        line: Dict[str, Any] = {"event": type(event).__name__, "time": time.time()}
        line.update((name, _plain(value)) for name, value in zip(event._fields, event))
        if isinstance(event, RunStarted):
            line.update(pid=os.getpid(), sha256=_sha256(event.mission))
        try:
            self._file.write(json.dumps(line, ensure_ascii=False, default=str) + "\n")
            self._file.flush()
        except (OSError, ValueError) as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        self._file = None
        self._complain("no record is written to {}: {}; the mission goes on".format(
            self.path, getattr(error, "strerror", None) or error))


def _plain(value: Any) -> Any:
    if isinstance(value, Failure):
        return {"cause": value.cause.value, "message": value.message, "resource": value.resource}
    return value


def _sha256(path: str) -> str:
    try:
        with open(path, "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()
    except OSError:
        return ""
