"""Where the package's own files are, in the source tree and when installed."""
import os

from behavior_controller import folders


def share() -> str:
    """Return the folder that holds ``config``, ``data`` and ``launch``."""
    return folders.share(os.path.dirname(__file__), "unit_tests")
