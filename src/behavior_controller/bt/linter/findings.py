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

    def report(self, rule: rules.LintRule, element: Element, text: str, hint: str = "",
               attribute: Optional[str] = None, at: int = 0, as_warning: bool = False) -> None:
        """Record a finding, of an error ``as_warning`` if it does no harm here; an element with an
        error cannot be instantiated."""
        is_warning = as_warning or rule.is_warning
        if not is_warning:
            self.faulty.add(id(element))
        found = self.warnings if is_warning else self.errors
        if len(found) < MOST_FAULTS:
            found.append(element.fault(rule, text, hint, attribute, is_warning, at))
        elif not is_warning:
            self._unrecorded += 1

    def all(self, file: str) -> List[Fault]:
        """Return the findings in the order of the files; the last may say that ``file`` has more.
        """
        faults = sorted(dict.fromkeys(self.errors + self.warnings), key=by_place)
        if self._unrecorded:
            text = f"{self._unrecorded} more faults are not shown"
            faults.append(Fault(file, 0, 0, text, code=rules.TOO_LARGE.code))
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
