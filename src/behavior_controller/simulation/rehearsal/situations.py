"""The situation of a play at one moment, as a digest: it tells which faults bring nothing new."""
import enum
import hashlib
from collections import deque
from typing import Any, Collection, Dict, Iterator, List, Tuple

from behavior_controller.bt import Node, Tree
from behavior_controller.bt.values.status import NAMES
from behavior_controller.run.events import LETTERS
from behavior_controller import leaves
from behavior_controller.leaves import data

from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.virtual_robot import VirtualRobot

_OF_ALL_NODES = vars(Node).keys() | vars(Node("")) | {
    "element", "mission", "decorated", "interception", "started_at", "summary",
    "_last_failure"}
"""What a node has, apart from its status, that does not say what it does next."""

_PLAIN = (bool, int, str, float, tuple, list, deque, enum.Enum)
_OF_ONE_ROUND = {"feedback_message", "over"}
_OF_ONE_VISIT = {datum.name for datum in data.ALL}
_OF_ALL_VISITORS = {"manners", "now", "_last_request", "_listens_until", "_expected"}
"""What a visitor has that is alike in all plays of a scene, or a moment."""


def _is_of_mission(node: Node) -> bool:
    """Return whether a node is one of our vocabulary: what those keep is of one round."""
    return type(node).__module__.startswith(leaves.__name__)


def _digest(*state: object) -> bytes:
    return hashlib.blake2b(repr(state).encode(), digest_size=8).digest()


class Situations:
    """What a call meets: a digest of all that decides how a play goes on. Two plays with the same
    one go on alike.

    It is made of the statuses of the nodes and what else they keep, the entries, the time that is
    left to nodes that wait, the visitor, and the nodes of the robot that are away. Left out are
    moments, and the numbers of failures that a recovery has handled.
    """

    def __init__(self, tree: Tree, robot: VirtualRobot, of_calls: bool, is_wanted: bool):
        """``of_calls``: what calls meet is noted; ``is_wanted``: from the first call on, and not
        from the first fault on."""
        self._tree, self._robot, self._is_wanted = tree, robot, is_wanted
        self.met: Dict[Tuple[str, int], bytes] = {}  # what each call met, by node and number
        if of_calls:
            robot.called = self._note
        self._nodes = [node for node in tree.nodes if not node.spec.is_recovery]
        self._names: List[Tuple[int, List[str]]] = [(0, [])] * len(self._nodes)

    def _note(self, entry: JournalEntry) -> None:
        if self._is_wanted:
            self.met[entry.node, entry.call] = self._situation()
        self._is_wanted = self._is_wanted or entry.fault is not None

    def left_behind(self) -> bytes:
        """Return a digest of what the next visitor may notice of a pass that has ended."""
        tree, visitor = self._tree, self._robot.world.visitor
        kept = [(uid, name, value) for uid, name, value in self._kept()
                if value and name not in _OF_ONE_ROUND and not _is_of_mission(tree.nodes[uid - 1])]
        return _digest(
            kept, self._entries(_OF_ONE_VISIT), visitor.attention, visitor.is_listened_to)

    def _entries(self, left_out: Collection[str]) -> List[Tuple[str, str, str]]:
        return [(path, name, str(entry.value)) for path, board in self._tree.blackboards.items()
                for name, entry in board.local.items() if name not in left_out]

    def _situation(self) -> bytes:
        tree, now = self._tree, self._robot.clock.now()
        waiting = sorted((timer.owner.uid, round(timer.due - now, 1))
                         for timer in tree.clock.timers() if timer.owner is not None)
        known = vars(self._robot.world.visitor)
        visitor = [known[name] for name in sorted(known.keys() - _OF_ALL_VISITORS)]
        visitor.append(round(max(known["_listens_until"] - now, 0.0), 1))
        letters = "".join(LETTERS[NAMES[node.status]] for node in tree.nodes)
        return _digest(letters, list(self._kept()), self._entries(data.TIMES), waiting, visitor,
                       self._robot.away())

    def _kept(self) -> Iterator[Tuple[int, str, Any]]:
        for place, node in enumerate(self._nodes):
            own = vars(node)
            number, names = self._names[place]
            if number != len(own):
                names = sorted(own.keys() - _OF_ALL_NODES)
                self._names[place] = len(own), names
            for name in names:
                if isinstance(own[name], _PLAIN):
                    yield node.uid, name, own[name]
