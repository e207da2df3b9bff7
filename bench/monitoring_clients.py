#!/usr/bin/env python3
"""A Groot2 client and a browser, as far as the node can tell: ``monitoring_clients.py GROOT2_PORT
MONITOR_PORT``."""
import struct
import sys
import threading
import time
import urllib.request

import zmq

POLL = 0.03  # s between two requests of Groot2


def browse(port):
    """Read all that the page is sent."""
    with urllib.request.urlopen("http://127.0.0.1:{}/events".format(port), timeout=60) as stream:
        for _ in stream:
            pass


def main(groot2, monitor):
    """Monitor until killed."""
    threading.Thread(target=browse, args=(monitor,), daemon=True).start()
    client = zmq.Context().socket(zmq.REQ)
    client.connect("tcp://127.0.0.1:{}".format(groot2))
    print("looking", flush=True)
    while True:
        for request in ((b"S",), (b"B", b"M")):
            client.send_multipart([struct.pack("<BBI", 2, request[0][0], 1)] + list(request[1:]))
            client.recv_multipart()
        time.sleep(POLL)


if __name__ == "__main__":
    main(*sys.argv[1:])
