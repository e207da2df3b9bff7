#!/usr/bin/env python3
"""Clients of the viewer: ``monitoring_clients.py GROOT2_PORT MONITOR_PORT [look|flood]``.

``look``: Groot2 and a browser, as far as the viewer can tell. ``flood``: 200 connections to each
port, of which none reads, and garbage to Groot2's port.
"""
import contextlib
import os
import socket
import struct
import sys
import threading
import time
import urllib.request

import zmq

POLL = 0.03  # s between two requests of Groot2
CLIENTS = 200
FRAMES = 10


def browse(port):
    """Read all that the page is sent."""
    with contextlib.suppress(OSError), urllib.request.urlopen(
            "http://127.0.0.1:{}/events".format(port), timeout=60) as stream:
        for _ in stream:
            pass


def groot2(port):
    """Return a socket that asks as Groot2 does."""
    client = zmq.Context().socket(zmq.REQ)
    client.connect("tcp://127.0.0.1:{}".format(port))
    return client


def look(groot2_port, monitor):
    """Monitor until killed."""
    threading.Thread(target=browse, args=(monitor,), daemon=True).start()
    client = groot2(groot2_port)
    print("looking", flush=True)
    while True:
        for request in ((b"S",), (b"B", b"M")):
            client.send_multipart([struct.pack("<BBI", 2, request[0][0], 1)] + list(request[1:]))
            client.recv_multipart()
        time.sleep(POLL)


def flood(groot2_port, monitor):
    """Take all places, and send garbage, until killed."""
    held = []
    for port in (monitor, groot2_port):
        for _ in range(CLIENTS):
            held.append(socket.create_connection(("127.0.0.1", int(port))))
            with contextlib.suppress(ConnectionError):  # it has no place any more
                held[-1].sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    client = groot2(groot2_port)
    print("flooding", flush=True)
    while True:
        client.send_multipart([os.urandom(40) for _ in range(FRAMES)])
        client.recv_multipart()


if __name__ == "__main__":
    {"look": look, "flood": flood}[(sys.argv[3:] or ["look"])[0]](*sys.argv[1:3])
