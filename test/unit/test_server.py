"""The listening sockets of the page and of Groot2."""
import logging
import socket
import time

import pytest
from tornado.tcpserver import TCPServer

from behavior_controller.viewer.server import LoopThread, opened
from free_ports import free_port
from shortages import no_files_left


class Greeting(TCPServer):
    """Says a word to each client."""

    async def handle_stream(self, stream, address):
        await stream.write(b"hello")


@pytest.mark.parametrize("address", ["127.0.0.1", "localhost"])
def test_a_client_for_which_no_file_is_left_is_served_later_without_a_traceback(caplog, address):
    port = free_port()
    sockets = opened(address, [port], "nothing", "key", pytest.fail)
    thread = LoopThread("greeting", sockets, lambda: Greeting().add_sockets(sockets[0]))
    try:
        with socket.create_connection(("127.0.0.1", port), 10.0) as client:
            assert client.recv(10) == b"hello"  # what it imports is there
        with caplog.at_level(logging.WARNING), socket.socket() as client:
            client.settimeout(10.0)
            with no_files_left():
                client.connect(("127.0.0.1", port))
                time.sleep(0.5)  # in which tornado would try a thousand times
            assert client.recv(10) == b"hello" and not caplog.records
    finally:
        thread.close()
