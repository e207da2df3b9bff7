"""The findings about one mission: each rule adds to them, and all share one budget."""
from typing import Collection, List, Optional, Set, Tuple

from behavior_controller.bt.linter import rules
from behavior_controller.bt.loader.document import Element
from behavior_controller.errors import Fault
from behavior_controller.text import did_you_mean, first_names

MOST_FAULTS = 1_000  # errors that are reported, and as many warnings
_COMPARISONS = 40_000  # names compared for suggestions: each takes some 10 microseconds


class Findings:
    """Collects findings, and makes suggestions, both at a bounded cost."""

    def __init__(self) -> None:
        self.errors: List[Fault] = []
        self.warnings: List[Fault] = []
        self.faulty: Set[int] = set()  # id() of elements that cannot be instantiated
        self._unrecorded = 0
        self._comparisons = _COMPARISONS

    def fault(self, rule: rules.LintRule, element: Element, text: str, hint: str = "",
              attribute: Optional[str] = None, at: int = 0) -> None:
        """Record a fault; the element cannot be instantiated."""
        self.faulty.add(id(element))
        if len(self.errors) < MOST_FAULTS:
            self.errors.append(element.fault(rule, text, hint, attribute, is_warning=False, at=at))
        else:
            self._unrecorded += 1

    def warn(self, rule: rules.LintRule, element: Element, text: str, hint: str = "",
             attribute: Optional[str] = None, at: int = 0) -> None:
        """Record a warning."""
        if len(self.warnings) < MOST_FAULTS:
            self.warnings.append(element.fault(rule, text, hint, attribute, is_warning=True, at=at))

    def all(self, file: str) -> List[Fault]:
        """Return the findings in the order of the files; the last may say that ``file`` has more.
        """
        faults = sorted(dict.fromkeys(self.errors + self.warnings), key=by_place)
        if self._unrecorded:
            faults.append(Fault(file, 0, 0, f"{self._unrecorded} more faults are not shown",
                                code=rules.TOO_LARGE.code))
        return faults

    def may_compare(self, number: int) -> bool:
        """Return whether a name may be compared with so many others."""
        self._comparisons -= number
        return self._comparisons > 0

    def nearest(self, word: str, known: Collection[str], otherwise: str = "") -> str:
        """Return ``did you mean …?``, or ``otherwise`` and the known names."""
        may_compare = len(word) < 60 and self.may_compare(len(known))
        near = did_you_mean(word, sorted(known)) if may_compare else ""
        if near or not otherwise:
            return near
        return f"{otherwise}: {first_names(known) or 'none'}"


def by_place(fault: Fault) -> Tuple[str, int, int, str, str]:
    """Return the key by which findings are ordered."""
    return fault.file, fault.line, fault.column, fault.code, fault.text
