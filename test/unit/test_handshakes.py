"""The ports of a rospy node: they answer real nodes, and no web page, as a real browser sends it.
"""
import http.server
import socket
import struct
import threading
import time
import xmlrpc.client

import pytest
import rosgraph.network
import rosgraph.xmlrpc
from rospy.impl import tcpros_base

from behavior_controller.ros import handshakes
from behavior_controller.ros.shortage import Shortage
from behavior_controller.ros.tcpros import ask
from shortages import no_files_left

CALL = xmlrpc.client.dumps(("/page", "gone"), "shutdown").encode()
TEXT = "Content-Type: text/xml"


class Node(rosgraph.xmlrpc.XmlRpcHandler):
    """What a node's XML-RPC server calls."""

    def __init__(self):
        self.calls = []

    def shutdown(self, caller, reason):
        self.calls.append(caller)
        return 1, "", 0

    def getPid(self, caller):
        self.calls.append(caller)
        return 1, "", 77


@pytest.fixture
def node(monkeypatch):
    """A real server of a node, with ``port``, ``calls`` and ``warnings``."""
    monkeypatch.setattr(rosgraph.xmlrpc, "SilenceableXMLRPCRequestHandler",
                        rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler)
    monkeypatch.setattr(rosgraph.xmlrpc.ThreadingXMLRPCServer, "get_request",
                        rosgraph.xmlrpc.ThreadingXMLRPCServer.get_request)
    handler = Node()
    handler.warnings = []
    handshakes.refuse_web_pages(handler.warnings.append)
    handshakes.pause_without_files()
    served = rosgraph.xmlrpc.XmlRpcNode(0, handler)
    served.start()
    ends = time.monotonic() + 10.0
    while not served.uri and time.monotonic() < ends:
        time.sleep(0.01)
    handler.port = served.port
    yield handler
    server = served.server
    served.shutdown("over")
    # rospy only closes its socket, which the server would poll until the process ends
    threading.Thread(target=server.shutdown, daemon=True).start()


def post(port, *headers, body=CALL, path="/RPC2", method="POST"):
    """Send a request; return the status of the answer and all that comes until the connection ends,
    or a second passes."""
    head = "\r\n".join(["{} {} HTTP/1.1".format(method, path), "Host: 127.0.0.1:{}".format(port),
                        *headers, "Content-Length: {}".format(len(body)), "", ""])
    with socket.create_connection(("127.0.0.1", port), timeout=1.0) as sock:
        sock.sendall(head.encode() + body)
        received, is_closed = b"", False
        try:
            while not is_closed:
                data = sock.recv(65536)
                received, is_closed = received + data, not data
        except socket.timeout:
            pass
        return int(received.split()[1]), is_closed


@pytest.mark.slow
@pytest.mark.parametrize("headers", [
    [TEXT],  # rospy's, with User-Agent: Python-xmlrpc
    ["User-Agent: XMLRPC++ 0.7", TEXT],  # roscpp's
    ["content-type: text/xml; charset=utf-8", "Connection: close"],
    ["Content-Type: application/xml"]])
def test_a_node_is_answered(node, headers):
    assert post(node.port, *headers)[0] == 200
    assert (node.calls, node.warnings) == (["/page"], [])


def test_python_clients_are_answered(node):
    uri = "http://127.0.0.1:{}/".format(node.port)
    with xmlrpc.client.ServerProxy(uri) as proxy:
        assert proxy.getPid("/rosnode") == [1, "", 77]
        assert proxy.shutdown("/rosnode", "kill")[0] == 1  # on the same connection
    assert ask(uri, "getPid") == 77
    assert len(node.calls) == 3


UNASKED = ["Content-Type: text/plain;charset=UTF-8", "Content-Type: TEXT/PLAIN",
           "Content-Type: application/x-www-form-urlencoded", "Content-Type:",
           "Content-Type: multipart/form-data; boundary=x", "Accept: */*"]


@pytest.mark.slow
@pytest.mark.parametrize("headers", [
    *[[kind] for kind in UNASKED], [TEXT, "Origin: http://page.example"], [TEXT, "origin: null"],
    [TEXT, "Origin:"], [TEXT, "Referer: http://page.example/"], [TEXT, "Sec-Fetch-Mode: no-cors"]])
@pytest.mark.parametrize("more", [
    {}, {"path": "/other"}, {"method": "GET"}, {"method": "OPTIONS"}, {"body": bytes(300_000)},
    # a second request in the body of the first
    {"path": "/x", "body": b"POST / HTTP/1.1\r\nContent-Type: text/xml\r\nContent-Length: "
                           + str(len(CALL)).encode() + b"\r\n\r\n" + CALL}])
def test_what_a_browser_sends_is_refused_and_its_connection_closed(node, headers, more):
    assert post(node.port, *headers, **more) == (403, True)
    assert node.calls == []
    line, = node.warnings
    assert line.startswith("refused a request to this node that a browser has sent for a web page")


def test_of_a_thousand_refused_requests_one_is_told_in_a_minute(node, monkeypatch):
    for _ in range(50):
        post(node.port, "Origin: http://page.example\x1b[31m")
    line, = node.warnings
    assert "(http://page.example" in line and line.isprintable()
    monkeypatch.setattr(handshakes, "TOLD_AGAIN", 0.0)
    post(node.port, UNASKED[0])
    assert len(node.warnings) == 2


ATTACK = """
const [call, port, done] = arguments, url = `http://127.0.0.1:${port}/`;
const kinds = ["text/plain", "application/x-www-form-urlencoded", "text/xml", ""];
const sent = kinds.map(kind => fetch(url, {method: "POST", mode: "no-cors",
                                           body: new Blob([call], {type: kind})}));
sent.push(fetch(url, {method: "POST", body: call, headers: {"Content-Type": "text/xml"}}));
sent.push(fetch(url, {method: "POST", mode: "no-cors", body: call, referrerPolicy: "no-referrer"}));
navigator.sendBeacon(url, call);
const frame = document.body.appendChild(document.createElement("iframe"));
frame.srcdoc = `<form method=post enctype=text/plain action="${url}"><input name='${
  call.replace(/=.*/s, "")}' value='${call.replace(/^[^=]*=/, "")}'></form>
  <script>document.forms[0].submit()</scr` + `ipt>`;
frame.onload = () => 0;
Promise.allSettled(sent).then(() => setTimeout(done, 1000));
"""


class _Site(http.server.BaseHTTPRequestHandler):
    """A web page of another origin."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<html><body></body></html>")

    def log_message(self, *_):
        pass


@pytest.fixture
def page(browser):
    """A browser with a web page that is no friend of ours."""
    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Site)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    browser.get("http://127.0.0.1:{}/".format(site.server_port))
    yield browser
    site.shutdown()
    site.server_close()


@pytest.mark.slow
def test_a_page_in_a_browser_reaches_nothing(node, page):
    page.execute_async_script(ATTACK, CALL.decode(), node.port)
    assert node.calls == []
    line, = node.warnings
    assert "http://127.0.0.1:" in line


# ------------------------------------------------------------------------------------------- TCPROS


@pytest.fixture
def tcpros(monkeypatch, caplog):
    """The port of rospy's other server; its handler takes each topic."""
    server = tcpros_base.TCPROSServer()
    server.topic_connection_handler = lambda sock, address, header: sock.sendall(b"taken")
    monkeypatch.setattr(tcpros_base, "_tcpros_server", server)
    server.start_server()
    handshakes.bound_handshakes()
    yield server.tcp_ros_server.port
    server.shutdown()
    assert caplog.records == []


def ended(sock):
    """Whether the other side has closed a connection."""
    try:
        return sock.recv(10) == b""
    except ConnectionResetError:
        return True


HEADER = rosgraph.network.encode_ros_handshake_header({"topic": "/a"})


@pytest.mark.parametrize("parts", [[HEADER], [HEADER[:2], HEADER[2:]]])
def test_a_subscriber_is_taken(tcpros, parts):
    with socket.create_connection(("127.0.0.1", tcpros), timeout=10) as sock:
        for part in parts:
            sock.sendall(part)
            time.sleep(0.05)
        assert sock.recv(10) == b"taken"


@pytest.mark.parametrize("sent", [
    b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: null\r\nContent-Length: 300000\r\n\r\n"
    + bytes(300_000), b"GET / HTTP/1.1\r\n\r\n", struct.pack("<I", 2**31 - 1) + b"x" * 100])
def test_what_is_no_handshake_is_closed_without_a_word(tcpros, sent):
    with socket.create_connection(("127.0.0.1", tcpros), timeout=10) as sock:
        try:
            sock.sendall(sent)
        except ConnectionError:
            return
        assert ended(sock)


@pytest.mark.slow
def test_a_silent_caller_is_sent_away_and_holds_nobody_up(tcpros, monkeypatch):
    monkeypatch.setattr(handshakes, "HANDSHAKE", 1.0)
    with socket.create_connection(("127.0.0.1", tcpros), timeout=10) as silent, \
            socket.create_connection(("127.0.0.1", tcpros), timeout=10) as half:
        half.sendall(b"\x01\x00")
        test_a_subscriber_is_taken(tcpros, [HEADER])
        assert ended(silent) and ended(half)


def test_a_server_that_got_no_file_takes_the_caller_later(tcpros, monkeypatch):
    monkeypatch.setattr(handshakes, "SHORTAGE", Shortage())
    with socket.socket() as first, socket.socket() as caller:
        caller.settimeout(10.0)
        with no_files_left():
            first.connect(("127.0.0.1", tcpros))  # the wait for it has its file already
            caller.connect(("127.0.0.1", tcpros))
            ends = time.monotonic() + 10.0
            while not handshakes.SHORTAGE.now:
                assert time.monotonic() < ends
                time.sleep(0.01)
        caller.sendall(HEADER)
        assert caller.recv(10) == b"taken"


@pytest.mark.slow
def test_a_server_of_requests_that_gets_no_file_rests_and_answers_later(node, monkeypatch):
    noted = []
    monkeypatch.setattr(handshakes.SHORTAGE, "note", noted.append)
    with socket.socket() as caller:
        caller.settimeout(10.0)
        with no_files_left():
            caller.connect(("127.0.0.1", node.port))
            time.sleep(0.5)
        assert 1 <= len(noted) <= 0.5 / handshakes.RECONNECT_PAUSE + 1
        caller.sendall(b"GET / HTTP/1.0\r\n\r\n")
        assert b"403" in caller.recv(100)


def test_a_server_that_got_no_thread_takes_the_next_caller(tcpros, monkeypatch):
    def start_thread(*_):
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(handshakes, "start_thread", start_thread)
        with socket.create_connection(("127.0.0.1", tcpros), timeout=10) as caller:
            assert ended(caller)
    test_a_subscriber_is_taken(tcpros, [HEADER])
