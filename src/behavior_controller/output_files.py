"""Writes the files that a user names: a new file, or one in place of an earlier output of the same
kind; nothing else is overwritten."""
import contextlib
import errno
import os
import re
import signal
import stat
import sys
import tempfile
from typing import Iterator, NamedTuple

from behavior_controller.errors import FaultsFound

_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LONGEST_BEGIN = 1000  # bytes


class OutputKind(NamedTuple):
    """A kind of file that a command writes, known by the ``begin`` of its text (a regular
    expression)."""

    name: str
    begin: str

    def check(self, path: str) -> None:
        """Raise FaultsFound if ``path`` is anything but a new file, a file of this kind, or
        standard output. Raises OSError if nothing can be written there."""
        if is_standard_output(path):
            return
        reason = ""
        if not os.path.basename(path):
            reason = "this names no file"
        with _errors_of(path), contextlib.suppress(FileNotFoundError):
            mode = os.stat(path).st_mode
            if not stat.S_ISREG(mode):
                reason = f"it is {'a folder' if stat.S_ISDIR(mode) else 'no regular file'}"
            elif not self._is_begun(path):
                reason = f"it is not {self.name}, and would be lost"
            elif not os.access(path, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if reason:
            raise FaultsFound.of(path, reason, "name another file")
        with _errors_of(path), tempfile.TemporaryFile(dir=_folder(path)):
            pass  # the folder takes a file

    def write(self, path: str, text: str) -> None:
        """Write the file, or the text to standard output; an earlier file stays until the new one
        is complete. Raises as ``check`` does."""
        self.check(path)
        data = text.encode("utf-8", "replace")
        if is_standard_output(path):
            sys.stdout.flush()
            sys.stdout.buffer.write(data)
            return
        with _errors_of(path), _stops_held():
            replace_file(os.path.realpath(path), data, _mode(path))

    def _is_begun(self, path: str) -> bool:
        with open(path, "rb") as file:
            begin = file.read(_LONGEST_BEGIN).decode("utf-8", "replace")
        return re.match(self.begin, begin) is not None


def page_of(command: str) -> OutputKind:
    """Return the kind of the HTML reports of a command (``report_files/frame.html``)."""
    return OutputKind(f"a report of {command}", r'<!DOCTYPE html>\s<html lang="en">\s<head>\s'
                      rf'<meta charset="utf-8">\s<meta name="generator" content="{command}">')


def is_standard_output(path: str) -> bool:
    """Return whether ``path`` is the file, terminal or pipe that this process prints to."""
    with contextlib.suppress(OSError):
        return os.path.samestat(os.stat(path), os.fstat(1))
    return False


def _folder(path: str) -> str:
    return os.path.dirname(os.path.realpath(path))  # a link stays a link


def replace_file(path: str, data: bytes, mode: int = 0o600) -> None:
    """Write a file with these permissions; an earlier one stays until the new one is complete."""
    with tempfile.NamedTemporaryFile(dir=os.path.dirname(path), prefix=".", delete=False) as file:
        try:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            os.fchmod(file.fileno(), mode)
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def _mode(path: str) -> int:
    """Return the permissions of a file; those of a new one if it is missing."""
    with contextlib.suppress(FileNotFoundError):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0o077)
    os.umask(mask)
    return 0o666 & ~mask


@contextlib.contextmanager
def _errors_of(path: str) -> Iterator[None]:
    """Name ``path`` in an OSError, whatever file it came from."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, path) from error


@contextlib.contextmanager
def _stops_held() -> Iterator[None]:
    """Let Ctrl-C wait until the file is complete: no half of it is left."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
