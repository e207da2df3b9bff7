"""``missionViewer``: shows a run on a page in the browser and in Groot2, now or later."""
import argparse
import collections
import contextlib
import ctypes
import errno
import os
import queue
import signal
import sys
import threading
import time
from typing import Callable, Deque, List, Optional, Tuple

from tornado.netutil import bind_sockets

from behavior_controller import exit_codes, folders, ros_arguments
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.run.events import Line, follow_simulated_time, use_clock_of
from behavior_controller.run.from_viewer import (
    FromViewer, HookChange, ViewerAlive, ViewerTold, encode)
from behavior_controller.viewer.board import Board
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.files import runs, watched
from behavior_controller.run.record.reader import LATEST, find_record
from behavior_controller.run.record.tail import follow
from behavior_controller.viewer.groot2 import Groot2Publisher
from behavior_controller.viewer.web_page import Page

ALIVE_INTERVAL = 1.0
"""Seconds between two signs of life for the controller."""

NEWER_RUN_POLL = 0.5
"""Seconds between two looks for a newer run."""

PORTS_LIMIT = 10.0
"""Seconds to wait for the ports of another viewer that ends."""

NEXT_PORTS_AFTER = 2.0
"""Seconds to wait for them where others may be taken: the viewer of a controller that was killed
has ended then."""

PARENT_ENDS = 1
"""Linux's number of the option that has a process get a signal when its parent has ended."""

END_LIMIT = 1.5
"""Seconds for the end to be shown, after that of a controller that is the parent."""

Port = Tuple[str, int]
"""An address of this computer, and the number of a port."""

_EXIT_CODES = """0: the run was shown until Ctrl-C, or, of a controller's child, until its end;
1: no port could be opened; 2: wrong arguments, or the record cannot be read"""


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code, see ``_EXIT_CODES``."""
    parser = ros_arguments.CommandParser(
        "missionViewer", "Shows a run on a page in the browser and in Groot2.", _EXIT_CODES)
    parser.add_argument("record", nargs="?", default="latest",
                        help="mission.jsonl of a run, its folder, a folder of runs (the newest), "
                             "latest (the default), or -: lines from standard input")
    parser.add_argument("--address", default="127.0.0.1", help="of the page (default %(default)s)")
    parser.add_argument("--port", type=ros_arguments.port, default=8080,
                        help="of the page; 0: no page (default %(default)s)")
    parser.add_argument("--groot2-address", default="127.0.0.1",
                        help="of Groot2's protocol (default %(default)s)")
    parser.add_argument("--groot2-port", type=ros_arguments.port, default=1667, help="of Groot2's "
                        "protocol, and the one after it; 0: none (default %(default)s)")
    parser.add_argument("--records", default="", help="folder of the runs that the page lists "
                        "(default: the one of the record)")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--attempts", type=int, default=1, help=argparse.SUPPRESS)
    chosen = ros_arguments.parse(parser, arguments)
    if not chosen.port and not chosen.groot2_port:
        parser.error("--port and --groot2-port are both 0: nothing would be served")
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # a client that goes away must not end it
    if chosen.child:
        return _show_parent(chosen)
    return _show_record(chosen)


class Viewer:
    """Page and Groot2 for one run after the other."""

    def __init__(self, chosen: argparse.Namespace, warn: Callable[[str], None],
                 send: Optional[Callable[[HookChange], None]] = None):
        """``send`` gets changes of hooks; without it they are refused."""
        self._page = Page(chosen.address, chosen.port, self._new_board(), warn, chosen.records,
                          chosen.attempts)
        self._groot2 = Groot2Publisher(chosen.groot2_address, chosen.groot2_port, warn, send,
                                       chosen.attempts)
        self.is_serving = self._page.is_served or self._groot2.is_served
        self.ports = [self._page.port, self._groot2.port]
        page, groot2 = _ports(chosen)
        self.missing = page * (not self._page.is_served) + groot2 * (not self._groot2.is_served)
        """The ports that could not be opened."""

    def _new_board(self) -> Board:
        lines: Deque[Line] = collections.deque()
        self._lines = lines
        return Board(lambda: [lines.popleft() for _ in range(len(lines))])

    def begin(self) -> None:
        """Show another run, whose lines follow."""
        self._page.show(self._new_board())

    def take(self, line: Line) -> None:
        """Show the next event."""
        follow_simulated_time(line)
        if self._page.is_served:
            self._lines.append(line)
        self._groot2.take(line)

    def note_end(self) -> None:
        """Show that the run is over."""
        self._page.note_end()

    def close(self) -> None:
        """Show the end, and stop serving."""
        self._page.close()
        self._groot2.close()


# ------------------------------------------------------------------------------------ as a child


def _show_parent(chosen: argparse.Namespace) -> int:
    """Show the run whose lines come from standard input, until that ends; what the controller has
    to know goes to standard output."""
    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # the controller blocks them in its threads
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # the end of the controller is seen by a viewer that was stopped, too
    ctypes.CDLL(None).prctl(PARENT_ENDS, signal.SIGCONT)
    lock = threading.Lock()

    def send(sent: FromViewer) -> None:
        with lock, contextlib.suppress(OSError):  # the controller has ended
            os.write(1, encode(sent))

    texts: "queue.SimpleQueue[bytes]" = queue.SimpleQueue()
    threading.Thread(target=_read, args=(texts.put,), daemon=True).start()
    ports = [0, 0]
    threading.Thread(target=_give_sign_of_life, args=(send, ports), daemon=True).start()
    # the controller may replace another one, whose viewer goes on for a moment
    ends = time.monotonic() + (NEXT_PORTS_AFTER if chosen.attempts > 1 else PORTS_LIMIT)
    while time.monotonic() < ends and _trouble(sum(_ports(chosen), [])) == errno.EADDRINUSE:
        time.sleep(NEWER_RUN_POLL)
    viewer = Viewer(chosen, lambda text: send(ViewerTold(text)), send)
    ports[:] = viewer.ports
    if viewer.missing:
        threading.Thread(target=_end_when_free, args=(viewer.missing, send), daemon=True).start()
    decoder = Decoder("the controller")
    for text in iter(texts.get, b""):
        # a line that was not finished, or with a value of another package that JSON does not have
        with contextlib.suppress(BehaviorControllerError):
            for line in decoder.read(text):
                viewer.take(line)
        if decoder.head.unix_at_zero:
            use_clock_of(decoder.head.unix_at_zero)
    viewer.close()
    os._exit(exit_codes.SUCCESS)


def _read(put: Callable[[bytes], None]) -> None:
    """Read the lines of the run to their end, after which the process ends too."""
    for text in sys.stdin.buffer:
        put(text)
    put(b"")
    time.sleep(END_LIMIT)
    os._exit(exit_codes.UNAVAILABLE)


def _give_sign_of_life(send: Callable[[FromViewer], None], ports: List[int]) -> None:
    """Tell the controller once in ``ALIVE_INTERVAL`` that this process goes on."""
    while True:
        send(ViewerAlive(*ports))
        time.sleep(ALIVE_INTERVAL)


def _ports(chosen: argparse.Namespace) -> Tuple[List[Port], List[Port]]:
    """Return the ports of the page, and those of Groot2; none of what is not wanted."""
    number = chosen.groot2_port
    return ([(chosen.address, chosen.port)] if chosen.port else [],
            [(chosen.groot2_address, port) for port in (number, number + 1) if number])


def _trouble(ports: List[Port]) -> int:
    """Return the number of the system's error if one of the ports cannot be opened, or else 0."""
    try:
        for address, port in ports:
            for sock in bind_sockets(port, address):
                sock.close()
    except OSError as error:
        return error.errno or errno.EADDRNOTAVAIL
    return 0


def _end_when_free(ports: List[Port], send: Callable[[FromViewer], None]) -> None:
    """End the process when the ports can be opened: the controller starts another one."""
    while _trouble(ports):
        time.sleep(ALIVE_INTERVAL)
    send(ViewerTold("the ports that page or Groot2 did not get are free now"))
    os._exit(exit_codes.UNAVAILABLE)


# ------------------------------------------------------------------------------------ of a record


def _show_record(chosen: argparse.Namespace) -> int:
    """Show a record, what is added to it meanwhile, and each newer run, until Ctrl-C."""
    chosen.records = chosen.records or _place_of(chosen.record)
    viewer = Viewer(chosen, _print)
    if not viewer.is_serving:
        return exit_codes.UNAVAILABLE
    if chosen.record == "-":
        return _show_input(viewer)
    is_place = chosen.record == LATEST or bool(runs(chosen.record))
    place = _place_of(chosen.record)
    shown = told = ""
    with contextlib.ExitStack() as stack:
        trouble = is_place and stack.enter_context(watched(place))
        if trouble:
            _print(f"a controller that writes to {place} does not know of this viewer: {trouble}")
        while True:
            path = ""  # there is no run yet
            try:
                path = find_record(chosen.record)
                if path != shown:
                    _show_run(viewer, path)
            except BehaviorControllerError as error:
                if str(error) != told:
                    print(error, file=sys.stderr, flush=True)
                if not is_place:
                    return exit_codes.WRONG_INPUT
                told = str(error)
            shown = path
            time.sleep(NEWER_RUN_POLL)


def _place_of(record: str) -> str:
    """Return the folder of runs that a record is in, or that it is."""
    if record in (LATEST, "-"):
        return folders.records()
    if runs(record):
        return record
    folder = record if os.path.isdir(record) else os.path.dirname(record)
    return os.path.dirname(os.path.abspath(folder))


def _show_input(viewer: Viewer) -> int:
    """Show the lines from standard input until Ctrl-C."""
    decoder = Decoder("standard input")
    try:
        for text in sys.stdin.buffer:
            for line in decoder.read(text):
                viewer.take(line)
    except BehaviorControllerError as error:
        print(error, file=sys.stderr)
        return exit_codes.WRONG_INPUT
    viewer.note_end()
    threading.Event().wait()
    return exit_codes.SUCCESS


def _show_run(viewer: Viewer, path: str) -> None:
    _print(f"the run {path}")
    viewer.begin()
    try:
        for line in filter(None, follow(path)):
            viewer.take(line)
    finally:
        viewer.note_end()


def _print(text: str) -> None:
    print("missionViewer:", text, file=sys.stderr, flush=True)


if __name__ == "__main__":  # as the controller's child
    sys.exit(main())
