"""A mission that the viewer shows, which is a process of its own."""
import contextlib
import json
import urllib.request

from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.run.record.recorder import LineQueue, Record
from behavior_controller.viewer.board import Board
from behavior_controller.viewer.process import ViewerProcess
from free_ports import free_port


class Viewed:
    """A mission of which a viewer shows all events, and a board in this process too."""

    def __init__(self, rig, port=0):
        self.rig, self.warnings = rig, []
        self.port, self.groot2_port = port or free_port(), free_port(2)
        lines = LineQueue()
        self.board = Board(lines.take)
        hooks = Breakpoints(rig.mission.events.emit, self.warnings.append)
        self.process = ViewerProcess(
            ["--port", str(self.port), "--groot2-port", str(self.groot2_port)], hooks.change,
            lambda: hooks.remove_all(": the viewer has ended"), self.warnings.append,
            lambda *_: None)
        self.record = Record(self.process, lines).open()
        rig.mission.events.subscribe(self.record)
        self.record.show(rig.tree)
        hooks.show(rig.tree)

    @property
    def pid(self):
        """None: none is started."""
        child = self.process._child
        return child and child.pid

    def state(self):
        """Return what the page is told; nothing while it is not served."""
        with contextlib.suppress(OSError):
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/state", timeout=2) as answer:
                return json.load(answer)
        return {}

    def shows(self, *parts):
        """Whether the page is told what the board of this process has."""
        state = self.state()
        self.board.refresh()
        return state != {} and all(state[name] == self.board.part(name) for name in parts) and (
            self.board.state.nodes != [])

    def close(self):
        self.record.close()
