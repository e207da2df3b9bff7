"""The fault, which is one mistake at one place in one line, and the family of errors.

Each layer has its own kinds of error; the layer above turns them into its own, and says where:

    layer    raises                                  becomes
    text     Unreadable                              FaultsFound, with the file
    values   ValueFault                              ScriptError, PortError, or a Fault
    script   ScriptSyntaxError                       a Fault of the attribute
             ScriptError                             TickError, with the node
    engine   PortError (NoValue, TypeClash)          a Failure of the leaf, a Fault, or TickError
             ConfigureError                          a Fault of the element
             NodeError                               TickError, with the node
             TickError                               FAILURE of the pass
    loader   MarkupFault                             a Fault of the document
    files    FaultsFound (ConfigurationError,        exit code 2, each Fault in a line
             BrokenExtension, MissionError)
    robot    Unusable, Unsendable                    a Failure of the request
    ros      Trouble                                 a Failure of the request, or NodesMissing
             Late                                    ConfigurationError, with what hangs
             Stopped                                 the exit code of the signal
    start    NodesMissing                            exit code 1, each node in a line

Any other exception in a leaf is a TickError, and elsewhere an internal error (exit code 4).
"""
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple, TypeVar

from behavior_controller.text import bracketed, clean

Part = TypeVar("Part")


class Fault(NamedTuple):
    """One mistake in a file. ``line`` and ``column`` count from 1; 0 means that the place is not
    known.

    ``code`` names the kind of a mistake in a mission (``loader.rules``). ``end_line`` and
    ``end_column`` are the position after its last character.
    """

    file: str
    line: int
    column: int
    text: str
    hint: str = ""
    is_warning: bool = False
    code: str = ""
    end_line: int = 0
    end_column: int = 0

    def __str__(self) -> str:
        """Return ``file:line:column: text (hint)`` on one line, leaving out what is not known."""
        place = ":".join([clean(self.file)] +
                         [str(number) for number in (self.line, self.column) if number])
        kind = "warning: " if self.is_warning else ""
        return f"{place}: {kind}{clean(self.text)}{bracketed(clean(self.hint))}"


class BehaviorControllerError(Exception):
    """The base of all errors that this package raises; its text is one line for an operator, or one
    line per fault."""

    origin: Tuple[Any, Optional[str]] = (None, None)
    """The element of a mission that failed, and the attribute with its script, if they are known.
    """


class FaultsFound(BehaviorControllerError):
    """A file has mistakes. ``faults`` holds all of them; the file was not used."""

    def __init__(self, faults: Sequence[Fault]):
        super().__init__("\n".join(map(str, faults)))
        self.faults = tuple(faults)

    @classmethod
    def of(cls, file: str, text: str, hint: str = "") -> "FaultsFound":
        """Return the error of a single mistake whose line is not known."""
        return cls([Fault(file, 0, 0, text, hint)])

    @classmethod
    def raise_any(cls, faults: Sequence[Fault]) -> None:
        """Raise this error if there are faults that are no warnings."""
        if any(not fault.is_warning for fault in faults):
            raise cls(faults)


class ConfigurationError(FaultsFound):
    """The configuration cannot be used (exit code 2)."""


class MissionError(FaultsFound):
    """The mission cannot be used (exit code 2)."""


def attempt(part: Callable[[], Part], faults: List[Fault]) -> Optional[Part]:
    """Return what ``part`` returns; None if it has faults, which are added to ``faults``."""
    try:
        return part()
    except FaultsFound as invalid:
        faults.extend(invalid.faults)
        return None


class NodesMissing(BehaviorControllerError):
    """Robot nodes that the mission needs are missing (exit code 1)."""
