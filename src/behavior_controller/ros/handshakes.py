"""Keeps a node of rospy reachable while a caller that has connected says nothing, and closed to web
pages: a browser sends what any page asks for to any port, also to those of the computer that it
runs on.
"""
import contextlib
import math
import socket
import struct
import threading
import time
from functools import partial
from types import SimpleNamespace
from typing import Any, Callable

import rosgraph.xmlrpc
from rospy.impl import tcpros_base

from behavior_controller.ros.shortage import SHORTAGE, is_shortage
from behavior_controller.ros.tcpros import RECONNECT_PAUSE
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.text import clean

HANDSHAKE = 3.0
"""Seconds that a caller has to say what it wants: rospy alone would wait for it for ever, and
accept no other caller."""

MOST_HANDSHAKES = 64
"""The most callers at a time that have not said it; a further one is sent away."""

LONGEST_HEADER = 1_000_000
"""The most bytes of what a caller says. In a text, as browsers send it, the length would be half a
billion at least."""

REFUSAL = "This is a port of ROS. It answers nodes, and no web page."

SENT_UNASKED = ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data")
"""The kinds of content that a browser sends for a page without asking the server before. ROS sends
text/xml. A request without a kind counts as text/plain."""

TOLD_AGAIN = 60.0
"""Seconds in which a refused request is told only once."""


def bound_handshakes() -> None:
    """Have rospy's server take each connection on a thread of its own, for a bounded time."""
    server, room = tcpros_base._tcpros_server, threading.BoundedSemaphore(MOST_HANDSHAKES)
    accept = server.tcp_ros_server.inbound_handler

    def shake(sock: socket.socket, address: Any) -> None:
        try:
            if _begins_as_ros_does(sock):
                accept(sock, address)
            else:
                sock.close()
        finally:
            room.release()

    def start(sock: socket.socket, address: Any) -> None:
        if not room.acquire(blocking=False):
            sock.close()
            return
        sock.settimeout(HANDSHAKE)
        try:
            start_thread("handshake", shake, sock, address)
        except RuntimeError:  # no thread is left
            room.release()
            sock.close()

    def go_on(handle: Callable[..., Any], sock: socket.socket, address: Any, header: Any) -> Any:
        sock.settimeout(None)
        return handle(sock, address, header)

    server.topic_connection_handler = partial(go_on, server.topic_connection_handler)
    server.service_connection_handler = partial(go_on, server.service_connection_handler)
    server.tcp_ros_server.inbound_handler = start
    listener = server.tcp_ros_server.server_sock  # a shortage would end its thread
    server.tcp_ros_server.server_sock = SimpleNamespace(
        accept=partial(_accepted, listener), close=listener.close)


def _accepted(listener: socket.socket) -> Any:
    """Accept a caller; raises what lets rospy try again if this computer gives no more files."""
    try:
        return listener.accept()
    except OSError as error:
        if not is_shortage(error):
            raise
        SHORTAGE.note(error)
        time.sleep(RECONNECT_PAUSE)
        raise socket.timeout from error


def pause_without_files() -> None:
    """Have rospy's XML-RPC server, which is made later, try again to accept a caller only after a
    pause: while no file is left, it would take all of a processor's time."""
    rosgraph.xmlrpc.ThreadingXMLRPCServer.get_request = lambda server: _accepted(server.socket)


def _begins_as_ros_does(sock: socket.socket) -> bool:
    """Return whether a caller sends the length of a header; nothing is taken from what it sends."""
    with contextlib.suppress(OSError, struct.error):  # the caller is late, or has gone
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, 4)  # to wait for so many bytes
        length, = struct.unpack("<I", sock.recv(4, socket.MSG_PEEK))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, 1)
        return length <= LONGEST_HEADER
    return False


def refuse_web_pages(warn: Callable[[str], None]) -> None:
    """Have rospy's XML-RPC server, which is made later, refuse what a web page may have a browser
    send; ``warn`` gets a line about it, on any thread."""
    told_at = -math.inf

    class Handler(rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler):
        """Carries out the requests of nodes."""

        def parse_request(self) -> bool:
            """Read the head of a request, and return whether it is carried out."""
            nonlocal told_at
            if not super().parse_request():
                return False
            page = _page_behind(self.headers)
            if not page:
                return True
            if time.monotonic() - told_at >= TOLD_AGAIN:
                told_at = time.monotonic()
                warn(f"refused a request to this node that a browser has sent for {page}")
            self._refuse()
            return False

        def _refuse(self) -> None:
            self.send_error(403, REFUSAL)
            self.wfile.flush()
            with contextlib.suppress(OSError):
                # if there were anything unread, the answer would be lost with the connection
                self.connection.settimeout(HANDSHAKE)
                self.connection.shutdown(socket.SHUT_WR)
                self.rfile.read(LONGEST_HEADER)

    rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler = Handler


def _page_behind(headers: Any) -> str:
    """Return in words for whom a browser has sent a request with these headers; empty if no browser
    sends it unasked.

    A browser states the origin also of a page whose name was made to point here (DNS rebinding).
    """
    names = {name.lower() for name in headers}
    is_of_browser = bool(names & {"origin", "referer"}) or any(
        name.startswith("sec-fetch-") for name in names)
    if not is_of_browser and headers.get_content_type() not in SENT_UNASKED:
        return ""
    source = headers.get("Origin") or headers.get("Referer")
    return f"a web page ({clean(source, 200)})" if source else "a web page"
