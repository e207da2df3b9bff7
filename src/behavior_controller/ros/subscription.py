"""The connection to one publisher of a topic, with every step bounded, made again whenever it breaks.

``rospy.Subscriber`` cannot do this: it keeps a connection whose other end is gone until TCP's timeout, retries
with pauses of up to half a minute, and contacts the master without a limit.
"""
import struct
import threading
import time
from typing import Any, Callable, Dict, List, Optional

import rospy

from behavior_controller.gateway import Cause
from behavior_controller.ros.connection import MOST_BYTES, Connection, Trouble, ask

STEP_LIMIT = 2.0
"""Seconds that a publisher has for each step: to answer with its address, to accept the connection, to shake hands."""

RETRY = 0.5
"""Seconds between an attempt to connect and the next one."""

AGAIN = 0.05
"""Seconds between a broken connection and the next attempt: a publisher may end each at once."""

BUFFER_BYTES = 65536
"""The most bytes of one read; far more than arrive during a pause."""


def open_publisher(connection: Connection, uri: str, topic: str, header: Dict[str, str]) -> Dict[str, str]:
    """Connect to the node at ``uri`` as a subscriber of ``topic`` (resolved), of any type; return its handshake.

    ``header`` completes our half of the handshake. Raises ``Trouble``.
    """
    offer = ask(uri, "requestTopic", topic, [["TCPROS"]], seconds=STEP_LIMIT)
    try:
        _, host, port = offer
        host, port = str(host), int(port)
    except (TypeError, ValueError):
        raise Trouble(Cause.NOT_ADVERTISED, "{} no longer publishes it".format(uri))
    return connection.open(host, port, dict(header, topic=topic, md5sum="*"), STEP_LIMIT)


def split(buffer: bytearray) -> List[bytes]:
    """Remove the complete messages from ``buffer`` and return them without their lengths."""
    found, start = [], 0
    while len(buffer) - start >= 4:
        length, = struct.unpack_from("<I", buffer, start)
        if length > MOST_BYTES:
            raise Trouble(Cause.CONNECTION_LOST, "{} bytes announced".format(length))
        if len(buffer) - start - 4 < length:
            break
        found.append(bytes(buffer[start + 4:start + 4 + length]))
        start += 4 + length
    del buffer[:start]
    return found


class Link:
    """A daemon thread with the connection to one publisher, until ``end``."""

    def __init__(self, uri: str, topic: str, message_type: Any, met: Callable[[Dict[str, str]], bool],
                 take: Callable[[bytes], None]):
        """``uri`` is the publisher's node. ``met`` checks each handshake: only if it returns true, messages are read.

        ``take`` gets the newest of the messages that arrived together; it is called on the link's thread.
        """
        self._uri = uri
        self._topic = topic
        self._type = message_type
        self._met = met
        self._take = take
        self._connection = Connection()
        self._ended = threading.Event()
        self.header: Optional[Dict[str, str]] = None
        """The publisher's handshake, while connected."""
        self.is_right = False
        """Whether there is a connection whose messages are used."""
        threading.Thread(target=self._work, daemon=True, name="topic " + topic).start()

    def end(self) -> None:
        """Close the connection and end the thread."""
        self._ended.set()
        self._connection.close()

    def reconnect(self) -> None:
        """End the current connection, and make a new one."""
        if self.header is not None:
            self._connection.close()

    def _work(self) -> None:
        while not self._ended.is_set():
            self._connection = Connection()
            has_stood = False
            try:
                self._open()
                has_stood = True
                self._listen()
            except Trouble:
                pass  # the monitor reports it if it lasts
            finally:
                self.is_right, self.header = False, None
                self._connection.hang_up()
            self._ended.wait(AGAIN if has_stood else RETRY)

    def _open(self) -> None:
        """Connect and shake hands."""
        header = open_publisher(self._connection, self._uri, self._topic, {
            "type": self._type._type, "message_definition": self._type._full_text, "tcp_nodelay": "1",
            "callerid": rospy.get_name()})
        if "error" in header:
            raise Trouble(Cause.NOT_REACHABLE, header["error"])
        self._connection.notice_a_dead_host()
        self._connection.wait_without_limit()
        self.header = header
        self.is_right = self._met(header)

    def _listen(self) -> None:
        """Read messages until the connection ends.

        The first message of a latching publisher may be as old as the publisher: it is not used as evidence.
        """
        is_old = self.header is not None and self.header.get("latching") == "1"
        buffer = bytearray()
        while not self._ended.is_set():
            buffer += self._connection.receive_some(BUFFER_BYTES)
            messages = split(buffer)
            if not self.is_right:
                time.sleep(RETRY)  # read all the same: a publisher that is not read from would block
                continue
            if messages and is_old:
                is_old = False
                del messages[0]
            if messages:
                self._take(messages[-1])
