"""The folders of recorded runs and the files of a run: named, written, found, and removed when
there are too many.

Each run has a folder of its own below the folder of all runs. Its name begins with a running
number: the newest run has the highest one, whatever the clock says. A long run has several files.
"""
import contextlib
import errno
import fcntl
import os
import re
import stat
import time
from typing import Dict, Iterator, List

from behavior_controller.run.record.codec import FORMAT

FILE_NAME = "mission.jsonl"
"""The first file of a run; the further ones are ``mission.1.jsonl``, ``mission.2.jsonl`` …"""

MOST_RUNS = 1000
"""The most runs that are kept in a folder."""

FILE_BYTES = 10_000_000
"""The most bytes of a file of a run, besides what it repeats from the files before."""

RUN_BYTES = 50_000_000
"""The most bytes of all files of a run; the oldest file goes first."""

PLACE_BYTES = 20 * RUN_BYTES
"""The most bytes of all runs in a folder, when a new one begins and has its ``RUN_BYTES``."""

_RUN = re.compile(r"(?:(\d{6,})_)?\d{8}-\d{6}_\d+(?:_([A-Za-z][\w.]*))?")
"""A run's folder: its number, when it began, the process, and the robot if it is one of several.
Without a number it is of an earlier version, and older than all others."""

_FURTHER = re.compile(r"mission\.(\d+)\.jsonl")


def runs(place: str) -> List[str]:
    """Return the first file of each run below a folder, the oldest run first.

    What a user keeps there is left out: folders of other names, and those without a record.
    """
    try:
        found = [match for match in map(_RUN.fullmatch, os.listdir(place)) if match]
    except OSError:
        return []
    found.sort(key=lambda match: (int(match[1] or 0), match[0]))
    paths = [os.path.join(place, match[0], FILE_NAME) for match in found]
    return [path for path in paths
            if not os.path.islink(os.path.dirname(path)) and _is_record(path)]


def _is_record(path: str) -> bool:
    # O_NONBLOCK: else open() would wait on a FIFO of that name
    with contextlib.suppress(OSError), open(
            os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW), "rb") as file:
        return stat.S_ISREG(os.fstat(file.fileno()).st_mode) and FORMAT.encode() in file.read(200)
    return False


def is_written(path: str) -> bool:
    """Return whether a process writes the run with this first file; also if the file system has no
    locks, which would tell."""
    with open(path, "rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


VIEWER = "viewer.lock"
"""The file in a folder of runs that a viewer locks which shows all of them."""


@contextlib.contextmanager
def watched(place: str) -> Iterator[str]:
    """Have ``has_viewer`` be true of a folder of runs meanwhile; yield why it is not, if so."""
    with contextlib.ExitStack() as stack:
        trouble = ""
        try:
            os.makedirs(place, 0o750, exist_ok=True)
            file = stack.enter_context(open(os.path.join(place, VIEWER), "ab"))
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            trouble = "another missionViewer shows them too"
        except OSError as error:  # such as a disk that is read-only
            trouble = f"{error.filename or place}: {error.strerror}"
        yield trouble


def has_viewer(place: str) -> bool:
    """Return whether a viewer shows all runs of a folder; not if the file system has no locks."""
    try:
        with open(os.path.join(place, VIEWER), "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return isinstance(error, BlockingIOError)
    return False


def parts(path: str) -> List[str]:
    """Return the files of the run with this first file, in order; of any other file itself."""
    folder, name = os.path.split(path)
    numbers: List[int] = []
    if name == FILE_NAME:
        with contextlib.suppress(OSError):
            numbers = [int(match[1]) for match in map(_FURTHER.fullmatch, os.listdir(folder or "."))
                       if match and os.path.isfile(os.path.join(folder, match[0]))]
    return [path] + [part(path, number) for number in sorted(numbers)]


def part(path: str, number: int) -> str:
    """Return the file with this number of the run with this first file, whose number is 0."""
    if not number:
        return path
    return os.path.join(os.path.dirname(path), f"mission.{number}.jsonl")


def is_further(path: str) -> bool:
    """Return whether this is one of the further files of a run."""
    return _FURTHER.fullmatch(os.path.basename(path)) is not None


def robot_of(path: str) -> str:
    """Return the robot of the run with this first file; empty: it is not one of several."""
    match = _RUN.fullmatch(os.path.basename(os.path.dirname(path)))
    return (match and match[2] or "").replace(".", "/")


def new_folder(place: str, robot: str = "") -> str:
    """Make the folder of a new run below a folder, and return its absolute path. Raises OSError."""
    place = os.path.abspath(place)  # a node of roslaunch does not run where its user is
    os.makedirs(place, 0o750, exist_ok=True)
    numbers = [int(match[1] or 0) for match in map(_RUN.fullmatch, os.listdir(place)) if match]
    name = f"{max(numbers, default=0) + 1:06}_{time.strftime('%Y%m%d-%H%M%S')}_{os.getpid()}"
    name += robot and "_" + robot.replace("/", ".")
    folder = os.path.join(place, name)
    os.mkdir(folder, 0o750)
    return folder


def make_room(place: str, most_bytes: int = PLACE_BYTES - RUN_BYTES) -> None:
    """Remove the oldest records below a folder until at most ``MOST_RUNS - 1`` are left, of
    ``most_bytes`` together, and none that is being written. What else is in a run's folder stays.
    """
    kept, total = 0, 0
    for path in reversed(runs(place)):
        kept, total = kept + 1, total + size(path)
        if kept >= MOST_RUNS or total > most_bytes:
            with contextlib.suppress(OSError):
                if not is_written(path):
                    for file in reversed(parts(path)):
                        os.unlink(file)
                    os.rmdir(os.path.dirname(path))


def size(path: str) -> int:
    """Return the bytes of all files of the run with this first file."""
    total = 0
    for file in parts(path):
        with contextlib.suppress(OSError):
            total += os.stat(file).st_size
    return total


class RunFiles:
    """The files of a new run. Lines are appended to the newest.

    A write that fails loses nothing: the next one goes on at the line where it failed.
    """

    def __init__(self, place: str, head: bytes, robot: str = ""):
        """Make a folder below ``place`` for a run of ``robot``, whose files begin with their
        ``head``. Raises OSError."""
        folder = new_folder(place, robot)
        self.path = os.path.join(folder, FILE_NAME)
        self.lines = 0
        """Number of lines written, without those of heads."""
        self.size = 0
        """Bytes of the newest file with what was added, without its head."""
        self.is_lost = False
        """The newest file cannot be written any more: it was removed, or its disk is gone."""
        self._head = head
        self._pending = bytearray()  # whole lines that are not written
        self._sizes: Dict[int, int] = {0: 0}  # bytes of each file, by number
        try:
            self._file = self._first = _created(self.path)
        except OSError:
            os.rmdir(folder)
            raise
        _lock(self._first)

    def add(self, line: bytes) -> None:
        """Have a line written by the next ``flush``."""
        self._pending += line
        self.size += len(line)

    def flush(self) -> None:
        """Write what was added. Raises OSError if a part of it is left to the next call."""
        if _is_removed(self._first) or _is_removed(self._file):
            self.is_lost = True
            raise FileNotFoundError(errno.ENOENT, "it was removed")
        number = max(self._sizes)
        head = b"" if self._sizes[number] else self._head
        data, done = head + bytes(self._pending), 0
        try:
            while done < len(data):
                done += os.pwrite(self._file, data[done:], self._sizes[number] + done)
        except OSError as error:
            self.is_lost = error.errno in (errno.EIO, errno.ESTALE)
            raise
        finally:  # the next call writes again what is torn
            whole = data.rfind(b"\n", 0, done) + 1
            if whole >= len(head):
                self._sizes[number] += whole
                self.lines += data.count(b"\n", len(head), whole)
                del self._pending[:whole - len(head)]

    def begin_next(self, head: bytes) -> None:
        """Write to a further file from now on, which begins with its ``head``. Raises OSError."""
        number = max(self._sizes)
        number += self._sizes[number] > 0  # else the file has nothing in it, and is made anew
        if _is_removed(self._first):  # rosclean removes all of a run
            os.makedirs(os.path.dirname(self.path), 0o750, exist_ok=True)
            number = 0
        file = _created(part(self.path, number))
        for old in {self._file, self._first} - ({self._first} if number else set()):
            os.close(old)
        if not number:
            self._first, self._sizes = file, {}
            _lock(file)
        self._file, self._head, self.is_lost = file, head, False
        self._sizes[number], self.size = 0, len(self._pending)
        most = len(head) + FILE_BYTES
        while len(self._sizes) > 1 and sum(self._sizes.values()) + most > RUN_BYTES:
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        oldest = min(self._sizes)
        del self._sizes[oldest]
        with contextlib.suppress(OSError):
            if oldest:
                os.unlink(part(self.path, oldest))
            else:  # it stays, with its first line: it has the run's name and lock
                with open(self.path, "rb") as file:
                    os.truncate(self.path, len(file.readline()))

    def close(self) -> None:
        """Close the files."""
        for file in {self._file, self._first}:
            os.close(file)


def _lock(file: int) -> None:
    with contextlib.suppress(OSError):  # not every file system has locks
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_removed(file: int) -> bool:
    with contextlib.suppress(OSError):  # of a disk that is gone, which writing meets too
        return not os.fstat(file).st_nlink
    return False


def _created(path: str) -> int:
    # O_NOFOLLOW: nothing of another place is overwritten; what visitors say is not for everybody
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o640)
