"""What is kept and shown of a run: the files of its record, the viewer, and the ROS interface."""
import contextlib
import os
import shutil
from functools import partial
from typing import Any, Callable, Dict, Mapping, Optional

import rosgraph.network

from behavior_controller import folders
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.run.events import DOUBTFUL, READY, Checked, Events, Noticed, Starting
from behavior_controller.run.health import Health
from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.missions.load import describe
from behavior_controller.run.record.files import has_viewer
from behavior_controller.run.record.recorder import Record, RecordFiles
from behavior_controller.viewer.process import ViewerProcess

ATTEMPTS = 50
"""How many ports are tried for the page of a robot that is one of several, and for Groot2."""

NO_RECORD = "none"
"""The value of ``recordDirectory`` that turns recording off."""


def record_place(values: Mapping[str, Any]) -> str:
    """Return below which folder a run with this configuration is recorded; empty: it is not."""
    if values["recordDirectory"] == NO_RECORD:
        return ""
    return values["recordDirectory"] or folders.records()


class Outputs:
    """Takes the events of the run from its start on."""

    def __init__(self, events: Events, tell: Callable[[str, str], None]):
        """``tell`` gets a severity and a line for the operator."""
        self._tell, self._warn = tell, partial(tell, "warning")
        self.record = Record(describe=describe)
        events.subscribe(self.record)
        self._breakpoints = Breakpoints(events.emit, self._warn)
        self._files: Optional[RecordFiles] = None
        self._viewer: Optional[ViewerProcess] = None
        self._page = ""  # where it is to be found
        self._checks: Dict[str, Checked] = {}

    def open_viewer(self, values: Mapping[str, Any]) -> None:
        """Start the viewer, for this configuration."""
        page, groot2 = values["monitorPort"], values["groot2Port"]
        if not page and not groot2:
            return
        place = record_place(values)
        # of several robots it shows one
        if place and not values["robot"] and has_viewer(place):
            self._tell("info", f"a missionViewer shows the runs in {place}: no other is started")
            return
        self._viewer = ViewerProcess(
            ["--port", str(page), "--address", values["monitorAddress"],
             "--groot2-port", str(groot2), "--groot2-address", values["groot2Address"],
             "--records", place and os.path.abspath(place),
             "--attempts", str(ATTEMPTS if values["robot"] else 1)],
            self._breakpoints.change,
            lambda: self._breakpoints.remove_all(": the viewer has ended"), self._warn,
            lambda *ports: self._tell_ports(values, *ports))
        self.record.add(self._viewer)
        self.record.open()

    def _tell_ports(self, values: Mapping[str, Any], page: int, groot2: int) -> None:
        """Say in a line where the page is, and which ports are taken."""
        parts = []
        if groot2:
            self.note_check(Checked("Groot2", f"port {groot2}", READY, "and the one after it"))
        if page:
            self._page = _url(values["monitorAddress"], page)
            taken = f" (port {values['monitorPort']} is taken)" * (page != values["monitorPort"])
            parts.append(f"page: {self._page}{taken}")
        if groot2 not in (0, values["groot2Port"]):
            parts.append(f"Groot2: port {groot2} ({values['groot2Port']} is taken)")
        if parts:
            self._tell("info", "; ".join(parts))

    def note_check(self, check: Checked) -> None:
        """Show what was found of a part that the mission needs, and keep it for the record."""
        self._checks[check.name] = check
        self.record(check)

    def note(self, severity: str, text: str) -> None:
        """Tell the operator a line of the start, and show it."""
        self._tell(severity, text)
        if severity == "info":
            self.record(Starting(text))
        else:
            self.record(Noticed(severity, text))

    def open_files(self, values: Mapping[str, Any]) -> None:
        """Write the record from now on, into a folder of its own, for this configuration."""
        place = record_place(values)
        if place:
            self._files = RecordFiles(place, self._warn, values["robot"])
            self.record.add(self._files)
        self.record.open()
        self._tell_record("record")
        for check in [*self._checks.values(), self._record_check()]:  # those of the start, too
            self.note_check(check)

    def _record_check(self) -> Checked:
        if self._files is None:
            return Checked("record", NO_RECORD, DOUBTFUL, "this run is not recorded")
        path = self._files.path
        if not path:
            return Checked("record", "file", DOUBTFUL, "it is not written yet: see the terminal")
        with contextlib.suppress(OSError):
            free = shutil.disk_usage(os.path.dirname(path)).free / 1e9
            return Checked("record", path, READY, f"{free:.0f} GB are free on its disk")
        return Checked("record", path, DOUBTFUL, "its disk does not answer")

    def show(self, tree: Tree, health: Health) -> None:
        """Record ``tree`` from now on; ``health`` knows each topic's last message."""
        self.record.show(tree, health.last_arrivals, health.said)
        self._breakpoints.show(tree)

    def tell_places(self) -> None:
        """Say at the end where page and record were."""
        if self._viewer is not None and self._viewer.ports[0]:
            self._tell("info", f"page of this run, closed now: {self._page}")
        self._tell_record("record of this run")

    def _tell_record(self, words: str) -> None:
        if self._files is not None and self._files.path:
            self._tell("info", f"{words}: {self._files.path}")


def _url(address: str, port: int) -> str:
    """Return the address of the page, with the host's name if it is served at all of its addresses.
    """
    if address in ("0.0.0.0", "::"):
        address = rosgraph.network.get_host_name()
    if ":" in address:
        address = f"[{address}]"
    return f"http://{address}:{port}/"
