"""Where the package's own files are, in the source tree and when installed; which files a test
writes; and the notes in the folder of a run, by which the processes of a test tell each other how
they ended."""
import os
from pathlib import Path

from behavior_controller import folders
from behavior_controller.output_files import OutputKind, page_of

COMMAND = "runTest"

REPORT = OutputKind("a report of a test", r"# \d{4}-\d\d-\d\dT[\d:]{8}: mission ")
PAGE = page_of(COMMAND)
JUNIT = OutputKind("a verdict of a test", '<testsuite name="behaviorControllerTest" ')
"""The kinds of files that a test writes: the report, the same as a page, and for build servers."""


def page_beside(report: str) -> str:
    """Return the path of the page of a report."""
    return (report[:-4] if report.endswith(".dat") else report) + ".html"


def share() -> str:
    """Return the folder that holds ``config``, ``data`` and ``launch``."""
    return folders.share(os.path.dirname(__file__), "unit_tests")


def note(folder: str, name: str, text: str) -> None:
    """Write a note."""
    Path(folder, name).write_text(text, encoding="utf-8")


def noted(folder: str, name: str) -> str:
    """Return the text of a note; empty if there is none."""
    try:
        return Path(folder, name).read_text(encoding="utf-8")
    except OSError:
        return ""
