"""Where the package's own files are, in the source tree and when installed; and the notes in the
folder of a run, by which the processes of a test tell each other how they ended."""
import os

from behavior_controller import folders


def share() -> str:
    """Return the folder that holds ``config``, ``data`` and ``launch``."""
    return folders.share(os.path.dirname(__file__), "unit_tests")


def note(folder: str, name: str, text: str) -> None:
    """Write a note."""
    with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
        file.write(text)


def noted(folder: str, name: str) -> str:
    """Return the text of a note; empty if there is none."""
    try:
        with open(os.path.join(folder, name), encoding="utf-8") as file:
            return file.read()
    except OSError:
        return ""
