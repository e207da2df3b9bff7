#!/usr/bin/env python3
"""A server of one ROS service as a bare process: it shakes hands, passes each request on, and does
what it is ordered to.

Arguments: the type's name and md5. It speaks TCPROS itself, so that it starts in no time, can break
off in any state, and dies as a process does. Lines of JSON on stdout: ``{"port"}`` once;
``{"request", "id"}`` for each request (hex); ``{"mismatch": true}`` when a client wants another
type, which gets that answer after the next line on stdin. On stdin: ``{"id", "send": hex, "then":
""|"close"|"deafen"|"exit"}`` answers a request, then goes on, closes all connections, also stops
listening, or ends; ``{"then"}`` alone does only that.
"""
import json
import os
import socket
import struct
import sys
import threading


def read(connection, length):
    """Return so many bytes; raises OSError at the end of the stream."""
    data = b""
    while len(data) < length:
        chunk = connection.recv(length - len(data))
        if not chunk:
            raise OSError("ended")
        data += chunk
    return data


def header(**fields):
    """Return a handshake as TCPROS writes it."""
    lines = ["{}={}".format(key, value).encode() for key, value in fields.items()]
    body = b"".join(struct.pack("<I", len(line)) + line for line in lines)
    return struct.pack("<I", len(body)) + body


def fields_of(body):
    """Return the fields of a handshake."""
    fields = {}
    while body:
        length, = struct.unpack_from("<I", body)
        key, _, value = body[4:4 + length].decode().partition("=")
        fields[key], body = value, body[4 + length:]
    return fields


class Server:
    """The listening socket, the connections, and the requests that wait for their answers."""

    def __init__(self, type_name, md5):
        self.type_name, self.md5 = type_name, md5
        self.listener = socket.socket()
        self.listener.bind(("127.0.0.1", 0))
        self.listener.listen(16)
        self.connections = set()
        self.waiting = {}
        self.count = 0
        self.lock = threading.Lock()
        self.go_on = threading.Event()

    def report(self, **event):
        """Write one line."""
        with self.lock:
            sys.stdout.write(json.dumps(event) + "\n")
            sys.stdout.flush()

    def serve(self):
        """Take connections until ordered to stop listening."""
        self.report(port=self.listener.getsockname()[1])
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.connections.add(connection)
            threading.Thread(target=self.talk, args=(connection,), daemon=True).start()

    def talk(self, connection):
        """Shake hands, then pass on request after request."""
        try:
            wanted = fields_of(read(connection, struct.unpack("<I", read(connection, 4))[0]))
            if wanted["md5sum"] not in ("*", self.md5):
                self.go_on.clear()
                self.report(mismatch=True)
                self.go_on.wait(5)
                connection.sendall(
                    header(error="request from [{}]: md5sums do not match: [{}] vs. [{}]".format(
                        wanted["callerid"], wanted["md5sum"], self.md5)))
                connection.close()
                return
            connection.sendall(header(callerid="/faulty", md5sum=self.md5, type=self.type_name,
                                      request_type=self.type_name + "Request",
                                      response_type=self.type_name + "Response"))
            while True:
                body = read(connection, struct.unpack("<I", read(connection, 4))[0])
                with self.lock:
                    self.count += 1
                    number = self.count
                    self.waiting[number] = connection
                self.report(request=body.hex(), id=number)
        except OSError:
            self.connections.discard(connection)

    def obey(self, order):
        """Do what one line says; a connection that is to be closed is closed together with its
        answer, in one packet."""
        self.go_on.set()
        if order["then"] in ("deafen", "exit"):
            self.listener.shutdown(socket.SHUT_RDWR)
            self.listener.close()
        answered = self.waiting.pop(order.get("id"), None)
        if order["then"]:
            self.connections.discard(answered)
            for connection in list(self.connections):
                shut_down(connection)
        if answered is not None:
            try:
                answered.setsockopt(socket.IPPROTO_TCP, socket.TCP_CORK, bool(order["then"]))
                answered.sendall(bytes.fromhex(order["send"]))
            except OSError:
                pass  # the client has given up
            if order["then"]:
                shut_down(answered)
        if order["then"] == "exit":
            os._exit(0)


def shut_down(connection):
    """Send what is left, and the end of the stream."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass


def main():
    """Serve until stdin ends."""
    server = Server(*sys.argv[1:])
    threading.Thread(target=server.serve, daemon=True).start()
    for line in sys.stdin:
        server.obey(json.loads(line))


if __name__ == "__main__":
    main()
