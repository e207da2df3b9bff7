"""Keeps a node of rospy reachable while a caller that has connected says nothing."""
import socket
import threading
from functools import partial
from typing import Any, Callable

from rospy.impl import tcpros_base

from behavior_controller.ros.timeouts import start_thread

HANDSHAKE = 3.0
"""Seconds that a caller has to say what it wants: rospy alone would wait for it for ever, and
accept no other caller."""

MOST_HANDSHAKES = 64
"""The most callers at a time that have not said it; a further one is sent away."""


def bound_handshakes() -> None:
    """Have rospy's server take each connection on a thread of its own, for a bounded time."""
    server, room = tcpros_base._tcpros_server, threading.BoundedSemaphore(MOST_HANDSHAKES)
    accept = server.tcp_ros_server.inbound_handler

    def shake(sock: socket.socket, address: Any) -> None:
        try:
            accept(sock, address)
        finally:
            room.release()

    def start(sock: socket.socket, address: Any) -> None:
        if not room.acquire(blocking=False):
            sock.close()
            return
        sock.settimeout(HANDSHAKE)
        start_thread("handshake", shake, sock, address)

    def go_on(handle: Callable[..., Any], sock: socket.socket, address: Any, header: Any) -> Any:
        sock.settimeout(None)
        return handle(sock, address, header)

    server.topic_connection_handler = partial(go_on, server.topic_connection_handler)
    server.service_connection_handler = partial(go_on, server.service_connection_handler)
    server.tcp_ros_server.inbound_handler = start
