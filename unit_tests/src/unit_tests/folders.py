"""Where the package's own files are, in the source tree and when installed; and the notes in the
folder of a run, by which the processes of a test tell each other how they ended."""
import os
from pathlib import Path

from behavior_controller import folders


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
