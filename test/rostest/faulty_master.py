"""A ROS master whose answers a test spoils: it stands between the node and the real master."""
import http.client
import http.server
import itertools
import random
import socketserver
import threading
import time
import urllib.parse
import xmlrpc.client

GARBAGE = [
    0, -7, 2.5, True, "", "no address", "http://", "rosrpc://h", b"\x00\xff", [], [[]], [1], ["a"],
    [[], []], [[], [], []], [["/a"], [], []], [[["/a", "/n"]], [], []], [[["/a", [1]]], [], []],
    [[[1, []]], [], []], [{}, {}, {}], [[], [], [], []], {"a": 1}, {}, ["TCPROS"], ["TCPROS", "h"],
    ["TCPROS", 1, 1], ["TCPROS", "h", "1"], ["TCPROS", "h", 1, 2], [["/a", 1]], [["/a"]],
    [["/a", "t", "x"]], "x" * 1000000, [["x" * 10] * 3] * 20000]
"""Values of many shapes. None fits a method with more than one level, but for empty lists."""


def http_answer(body, status="200 OK", more=""):
    """Return an answer of HTTP with this body."""
    return "HTTP/1.1 {}\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n{}\r\n".format(
        status, len(body), more).encode() + body


_SANE = xmlrpc.client.dumps(([1, "ok", [[], [], []]],), methodresponse=True).encode()
RAW = {
    "nothing": b"", "no HTTP": b"\x00\x01\x02\xff" * 50,
    "no XML": http_answer(b"<html>busy</html>"), "empty": http_answer(b""),
    "HTTP 404": http_answer(b"", "404 Not Found"), "HTTP 500": http_answer(_SANE, "500 Oops"),
    "HTTP 302": http_answer(b"", "302 Found", "Location: http://127.0.0.1:1/\r\n"),
    "HTTP abc": http_answer(_SANE, "abc OK"), "truncated": http_answer(_SANE)[:-60],
    "half of XML": http_answer(_SANE[:-40]),
    "fault": http_answer(
        xmlrpc.client.dumps(xmlrpc.client.Fault(1, "no"), methodresponse=True).encode()),
    "fault of odd kind": http_answer(
        b"<methodResponse><fault><value><int>7</int></value></fault></methodResponse>"),
    "no value": http_answer(b"<methodResponse><params></params></methodResponse>"),
    "no number": http_answer(b"<methodResponse><params><param><value><int>x</int></value></param>"
                             b"</params></methodResponse>"),
    "no decimal": http_answer(
        b"<methodResponse><params><param><value><bigdecimal>x</bigdecimal></value></param></params>"
        b"</methodResponse>"),
    "unknown element": http_answer(b"<methodResponse><params><param><value><z>1</z></value></param>"
                                   b"</params></methodResponse>"),
    "stray ends": http_answer(b"<methodResponse><array></array><struct></struct></methodResponse>"),
    "key of no text": http_answer(b"<methodResponse><params><param><value><struct><member><name>"
                                  b"a</name></member></struct></value>"
                                  b"</param></params></methodResponse>"),
    "unknown encoding": http_answer(b"<?xml version='1.0' encoding='x'?><methodResponse/>"),
    "no base64": http_answer(b"<methodResponse><params><param><value><base64>!</base64></value>"
                             b"</param></params></methodResponse>"),
    "nested": http_answer(
        b"<methodResponse><params><param>" + b"<value><array><data>" * 20000
        + b"</data></array></value>" * 20000 + b"</param></params></methodResponse>"),
    "gzip": http_answer(b"\x1f\x8b broken", more="Content-Encoding: gzip\r\n"),
    "chunks": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    "long header": b"HTTP/1.1 200 OK\r\nA: " + b"a" * 70000}
"""Answers that are none of XML-RPC, by name."""


class FaultyMaster:
    """A proxy of the master at ``uri``, on a port of its own. It serves until the process ends."""

    def __init__(self, uri, draw=random.Random(1)):
        self.delay = 0.0
        """Seconds before each answer."""
        self.gap = 0.0
        """Seconds between two bytes of an answer."""
        self.is_garbled = False
        """Whether all answers are drawn from ``GARBAGE`` and ``RAW``."""
        self._draw = draw
        self._real = urllib.parse.urlsplit(uri)
        self._bad = itertools.cycle(sorted(RAW))
        server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), _handler(self))
        server.daemon_threads = True
        self.uri = "http://127.0.0.1:{}/".format(server.server_address[1])
        threading.Thread(target=server.serve_forever, daemon=True).start()

    def answer(self, request):
        """Return the bytes that answer the body of a call."""
        if self.is_garbled:
            if self._draw.random() < 0.3:
                return RAW[next(self._bad)]
            value = self._draw.choice(GARBAGE)
            return http_answer(xmlrpc.client.dumps((self._draw.choice([[1, "ok", value], value]),),
                                                   methodresponse=True).encode())
        real = http.client.HTTPConnection(self._real.hostname, self._real.port)
        real.request("POST", "/RPC2", request, {"Content-Type": "text/xml"})
        body = real.getresponse().read()
        real.close()
        return http_answer(body)


def _handler(master):
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            data = master.answer(self.rfile.read(int(self.headers["Content-Length"])))
            self.close_connection = True
            time.sleep(master.delay)
            try:
                for start in range(0, len(data), 1 if master.gap else len(data) or 1):
                    self.wfile.write(data[start:start + 1] if master.gap else data)
                    time.sleep(master.gap)
            except OSError:
                pass  # the node has given up

        def log_message(self, *_):
            pass
    return Handler
