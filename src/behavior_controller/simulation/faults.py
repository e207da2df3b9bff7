"""Which service calls of a simulated node go wrong, and how."""
import random
from typing import NamedTuple, Optional, Sequence

REFUSED = "refused"  # the answer says failure
EXCEPTION = "exception"  # the server's handler raises
UNANSWERED = "unanswered"  # no answer before any deadline
CRASH = "crash"  # the node's process dies in the call and is started again
WRONG = "wrong"  # an answer without a meaning
KINDS = (REFUSED, EXCEPTION, UNANSWERED, CRASH, WRONG)


class PlannedFault(NamedTuple):
    """A fault of one particular call: ``textToSpeech:3`` or ``textToSpeech:3:unanswered``; calls
    count from 1. ``is_lasting``: of each later call too, as ``textToSpeech:3+``."""

    node: str
    call: int
    kind: str
    is_lasting: bool = False

    def __str__(self) -> str:
        """Return it as a configuration has it."""
        return f"{self.node}:{self.call}{'+' * self.is_lasting}:{self.kind}"


def parse_planned_fault(text: str, nodes: Sequence[str]) -> PlannedFault:
    """Parse ``node:call[:kind]``. Raises ValueError."""
    node, _, rest = text.partition(":")
    call, _, kind = rest.partition(":")
    kind = kind or REFUSED
    if node not in nodes or not call.isdecimal() or int(call) < 1 or kind not in KINDS:
        raise ValueError(text)
    return PlannedFault(node, int(call), kind)


class Faults:
    """Decides for each call of one node in turn. The same seed gives the same decisions."""

    def __init__(self, rate: float, seed: str, kinds: Sequence[str] = (REFUSED,),
                 planned: Sequence[PlannedFault] = ()):
        """``rate``: share of calls that go wrong, 0 to 1; ``planned``: faults of this node that
        happen in any case."""
        self._rate, self._kinds, self._planned = rate, kinds, planned
        self._random, self.calls = random.Random(seed), 0

    def next(self) -> Optional[str]:
        """Return how the next call goes wrong, or None if it does not."""
        self.calls += 1
        # both are drawn for every call, so that one decision does not shift the later ones
        fails, kind = self._random.random() < self._rate, self._random.choice(self._kinds)
        kinds = [fault.kind for fault in self._planned if fault.call == self.calls
                 or fault.is_lasting and fault.call < self.calls]
        if fails:
            kinds.insert(0, kind)
        return kinds[-1] if kinds else None
