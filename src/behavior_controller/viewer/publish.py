"""Shows Groot2 a tree of a plain Python program."""
import logging

from behavior_controller.bt import Tree
from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.run.events import Line
from behavior_controller.run.record.recorder import EncodedLine, Record
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.viewer.groot2 import Groot2Publisher


class _Groot2(Groot2Publisher):
    """A publisher as an output of a record."""

    def put(self, line: EncodedLine) -> None:
        """Take the next line."""
        self.take(Line(line.time, line.event))


def publish(tree: Tree, port: int = 1667, address: str = "127.0.0.1") -> Record:
    """Let Groot2 connect to ``port`` and ``port + 1`` from now on, see ``tree`` run, and set
    breakpoints.

    Its warnings, such as that of a port that is taken, go to the log. ``close()`` of what is
    returned ends it; it ends with the program, too.
    """
    warn = logging.getLogger(__name__).warning
    specs = list({node.registration_id: node.spec for node in tree.nodes}.values())
    record = Record(describe=lambda tree, number: shown(tree, number, specs))
    breakpoints = Breakpoints(record, warn)
    record.add(_Groot2(address, port, warn, breakpoints.change))
    record.show(tree)
    breakpoints.show(tree)
    return record.open()
