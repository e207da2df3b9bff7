"""The server of the page, and its listening sockets, which Groot2 has as well."""
import asyncio
import http.client
import json
import logging
import os
import socket
import threading
import time
import types
import urllib.request

import pytest
from tornado.iostream import IOStream
from tornado.netutil import bind_sockets
from tornado.tcpserver import TCPServer

from behavior_controller.run.events import RunFinished
from behavior_controller.viewer import server
from behavior_controller.viewer import web_page as page_module
from behavior_controller.viewer.server import LoopThread, opened
from behavior_controller.viewer.view import PARTS
from behavior_controller.viewer.web_page import Page
from free_ports import free_port
from mission_rig import Rig, board_of, one_leaf
from page_rig import wait_until
from shortages import no_files_left


class Greeting(TCPServer):
    """Says a word to each client."""

    async def handle_stream(self, stream, address):
        await stream.write(b"hello")


@pytest.mark.slow
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


def test_it_needs_nothing_from_elsewhere_and_takes_no_orders(show):
    shown = show(Rig())
    for path in ("", "common.js", "moment.js", "tree.js", "page.js", "style.css", "icon.svg"):
        status, body, headers = shown.fetch(path)
        assert status == 200 and "http://" not in body.replace("http://www.w3.org/2000/svg",
                                                               "") and "https://" not in body
        assert headers["Content-Security-Policy"] == "default-src 'self'; frame-ancestors 'none'"
        assert headers["X-Frame-Options"] == "DENY" and headers[
            "X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
    _, body, headers = shown.fetch("state")
    assert json.loads(body).keys() == set(
        PARTS) and headers["Content-Type"] == "application/json; charset=utf-8"
    for method in ("POST", "PUT", "DELETE"):
        assert shown.fetch("state", method)[0] == 405
    assert shown.fetch("../page.py")[0] in (403, 404) and shown.fetch("none")[0] == 404


@pytest.mark.slow
@pytest.mark.parametrize("path", ["", "page.js", "state", "events", "none"])
@pytest.mark.parametrize("host", [
    "rebound.example", "rebound.example:8080", "localhost.rebound.example", "93.184.216.34",
    "127.0.0.1.rebound.example", "localhost@rebound.example", "127.0.0.1, rebound.example", ""])
def test_a_foreign_name_is_refused(show, path, host):
    """A site whose name points at this computer could else read the page in the operator's browser.
    """
    status, body, headers = show(Rig()).fetch(path, host=host)
    assert status in (400, 403) and "mission" not in body and "<" not in body
    if status == 403:
        assert headers["Content-Security-Policy"] == "default-src 'self'; frame-ancestors 'none'"
        assert headers["Content-Type"] == "text/plain; charset=utf-8"
        assert body == ("This page answers to the address of its computer and to localhost, and to "
                        "the name that monitorAddress gives, but not to the name that was asked "
                        "for.\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.1:9", "localhost", "LocalHost:8080", "127.1.2.3", "[::1]:8080"])
def test_loopback_names_are_answered(show, host):
    assert show(Rig()).fetch("state", host=host)[0] == 200


def test_to_the_network_the_page_answers_by_address_and_host_name(show):
    own, shown = socket.gethostname(), show(Rig(), address="0.0.0.0")
    addresses = {entry[4][0] for entry in socket.getaddrinfo(own, None, socket.AF_INET)}
    for host in (own, own.upper() + ":80", own + ".local", "localhost"):
        assert shown.fetch("state", host=host)[0] == 200
    for address in addresses:
        with urllib.request.urlopen("http://{}:{}/state".format(address, shown.port),
                                    timeout=5) as answer:
            assert answer.status == 200
    for host in (own + ".rebound.example", "rebound.example", "0.0.0.0"):
        assert shown.fetch("state", host=host)[0] == 403
    assert show(Rig()).fetch("state", host=own)[0] == 403  # the loopback address is not the network


def test_to_the_network_the_page_answers_by_the_address_that_the_request_came_to(show):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing
        except OSError:
            pytest.skip("this computer has no network")
        address = probe.getsockname()[0]
    shown = show(Rig(), address="0.0.0.0")
    with urllib.request.urlopen("http://{}:{}/state".format(address, shown.port),
                                timeout=5) as answer:
        assert answer.status == 200
    assert shown.fetch("state", host=address)[0] == 403  # it came to the loopback address


def test_the_page_answers_to_the_name_that_it_is_served_at(show, monkeypatch):
    own = socket.gethostname()
    monkeypatch.setattr(socket, "gethostname", lambda: "elsewhere")
    shown = show(Rig(), address=own.upper())
    with urllib.request.urlopen("http://{}:{}/state".format(own, shown.port), timeout=5) as answer:
        assert answer.status == 200


@pytest.mark.slow
def test_idle_connections_are_capped_and_make_room(show):
    shown = show(Rig())
    before = len(os.listdir("/proc/self/fd"))
    idle = [socket.create_connection(("127.0.0.1", shown.port)) for _ in range(300)]

    def open_by_page():
        return len(os.listdir("/proc/self/fd")) - before - len(idle)

    wait_until(lambda: open_by_page() <= 64)
    wait_until(lambda: is_served(shown))  # as soon as one of them has been idle for two seconds
    assert open_by_page() <= 64
    for each in idle:
        each.close()


@pytest.mark.slow
def test_a_browser_that_is_served_keeps_its_place(show, monkeypatch):
    monkeypatch.setattr(server, "SHORTEST_IDLE", 0.3)
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        stream.readline()
        idle = [socket.create_connection(("127.0.0.1", shown.port)) for _ in range(70)]
        for _ in range(5):
            # it takes the place of the connection that is idle longest
            wait_until(lambda: is_served(shown))
        shown.rig.mission.events.emit(RunFinished("stopped; last pass: none", 0))
        wait_until(lambda: b"stopped; last pass: none" in stream.readline())
        for each in idle:
            each.close()


def test_a_newcomer_gets_the_place_of_what_was_idle_for_two_seconds(monkeypatch):
    now, ends = [100.0], []
    monkeypatch.setattr(server, "time", types.SimpleNamespace(monotonic=lambda: now[0]))

    def stream():
        ends.extend(socket.socketpair())
        return IOStream(ends[-1])

    async def visit():
        connections = server.Connections(2)
        first, second = stream(), stream()
        assert connections.admit(first)
        now[0] = 101.0
        assert connections.admit(second) and first.socket.getsockopt(socket.SOL_SOCKET,
                                                                     socket.SO_KEEPALIVE)
        now[0] = 101.9
        early = stream()
        assert not connections.admit(early) and early.closed() and not first.closed()
        now[0] = 102.0
        third, fourth, fifth = stream(), stream(), stream()
        assert connections.admit(third) and first.closed() and not second.closed()
        now[0] = 103.0
        connections.use(second)
        now[0] = 104.0
        assert connections.admit(fourth) and third.closed() and not second.closed()
        second.close()
        assert connections.admit(fifth) and not fourth.closed()
        for each in (fourth, fifth):
            each.close()

    asyncio.run(visit())
    for each in ends:
        each.close()


def test_if_one_of_several_ports_cannot_be_opened_none_is(monkeypatch):
    bound, warnings = [], []

    def bind(port, address):
        if bound:
            raise OSError("no more")
        bound.extend(bind_sockets(port, address))
        return bound

    monkeypatch.setattr(server, "bind_sockets", bind)
    assert server.opened("127.0.0.1", [0, 7], "no page", "aPort", warnings.append) == []
    assert bound and all(each.fileno() == -1 for each in bound)
    assert warnings == ["no page: 127.0.0.1:7 cannot be opened (no more); set aPort to another "
                        "port, or to 0"]


def test_a_loop_runs_what_it_is_told_on_its_own_thread_until_it_is_closed():
    told, is_running = [], threading.Event()

    async def lasts():
        try:
            await asyncio.sleep(1000.0)
        except asyncio.CancelledError:
            told.append("cancelled")

    async def finish():
        told.append("finish")

    def begin():
        told.append(threading.current_thread().name)
        told.append(asyncio.ensure_future(lasts()).get_loop())
        is_running.set()

    def end():
        told.append("end" if asyncio.get_event_loop() is told[1] else "end without its loop")

    port = socket.socket()
    loop = server.LoopThread("a loop", [[port]], begin, end)
    assert is_running.wait(5.0)
    thread, = [each for each in threading.enumerate() if each.name == "a loop"]
    assert thread.daemon
    loop.call(told.append, "called")
    loop.close(finish)
    assert not thread.is_alive()
    loop.call(told.append, "late")
    assert told[:1] + told[2:] == ["a loop", "called", "finish", "end", "cancelled"
                                   ] and told[1].is_closed() and port.fileno() == -1


def test_without_a_port_no_loop_runs():
    begun, before = [], len(os.listdir("/proc/self/fd"))
    loop = server.LoopThread("no loop", [], lambda: begun.append(1))
    assert len(os.listdir("/proc/self/fd")) <= before
    assert "no loop" not in [each.name for each in threading.enumerate()]
    loop.call(begun.append, 2)
    loop.close()
    assert begun == [] and not loop.is_serving


def test_a_connection_that_is_used_keeps_its_place(show, monkeypatch):
    monkeypatch.setattr(server, "SHORTEST_IDLE", 0.0)
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    used = http.client.HTTPConnection("127.0.0.1", shown.port, timeout=5)
    idle = []
    for _ in range(70):  # more than there are places
        used.request("GET", "/icon.svg")
        assert used.getresponse().read()
        idle.append(socket.create_connection(("127.0.0.1", shown.port)))
    used.close()
    for each in idle:
        each.close()


def answer_to(shown, request):
    with socket.create_connection(("127.0.0.1", shown.port), timeout=5) as connection:
        connection.sendall(request)
        return connection.recv(100)


@pytest.mark.parametrize("header, body, begins", [
    (0, 1024, b"HTTP/1.1 200 "), (0, 1025, b"HTTP/1.1 400 "), (16384, 0, b"HTTP/1.1 200 "),
    (16385, 0, None)])
def test_a_request_has_no_long_header_or_body(show, header, body, begins):
    head = b"GET /state HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\nX: %s\r\n\r\n"
    padding = b"x" * max(0, header - len(head % (body, b"")))
    found = answer_to(show(Rig()), head % (body, padding) + body * b"x")
    assert found.startswith(begins) if begins else found == b""


def is_served(shown):
    try:
        return shown.fetch("state")[0] == 200
    except OSError:
        return False


@pytest.mark.slow
def test_changes_are_pushed_together(show):
    rig = one_leaf("<Repeat num_cycles='-1'><Sequence><WelcomeSpeech/><FollowMeSpeech/><Sleep "
                   "msec='1'/></Sequence></Repeat>")
    shown = show(rig)
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        assert json.loads(stream.readline()[6:]).keys() == set(PARTS)
        stream.readline()
        wait_until(lambda: shown.page.streams)
        for _ in range(500):
            rig.tick()
            rig.clock.advance(0.001)
        parts = json.loads(stream.readline()[6:])
        assert "statuses" in parts and "mission" not in parts


def test_what_happens_is_taken_also_while_no_browser_looks(show):
    shown = show(one_leaf("<WelcomeSpeech/>"))
    before = shown.page.board.versions["statuses"]
    shown.rig.tick()
    wait_until(lambda: shown.page.board.versions["statuses"] != before)


def test_a_browser_is_told_at_once_what_has_happened_so_far(show, monkeypatch):
    monkeypatch.setattr(page_module, "PUSH_INTERVAL", 60.0)
    shown = show(one_leaf("<WelcomeSpeech/>"))
    assert shown.fetch("state")[0] == 200  # the server has begun
    rig = one_leaf("<Sequence name='another'><WelcomeSpeech/></Sequence>", lambda request: None)
    shown.page.board.show(rig.tree)
    assert json.loads(shown.fetch("state")[1])["mission"]["nodes"][0]["name"] == "another"
    rig.tick()
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        assert json.loads(stream.readline()[6:])["statuses"]["letters"] == "RR"


def test_a_browser_that_disconnects_frees_its_place_though_nothing_happens(show, monkeypatch):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with socket.create_connection(("127.0.0.1", shown.port)) as browser:
        browser.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        wait_until(lambda: shown.page.streams)
        monkeypatch.setattr(shown.page.board, "refresh", lambda: None)
    wait_until(lambda: not shown.page.streams)


@pytest.mark.slow
def test_there_is_a_message_every_second_though_nothing_happens(show):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        came = []
        while len(came) < 4:
            if stream.readline().startswith(b"data: "):
                came.append(time.monotonic())
    assert came[3] - came[1] < 6.0


@pytest.mark.parametrize("said", ["stopped; last pass: none", ""])
def test_the_end_reaches_a_browser_before_the_server_closes(show, monkeypatch, said):
    """A controller that ends without a word has stopped."""
    monkeypatch.setattr(page_module, "FAREWELL", 60.0)  # it is not needed
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        stream.readline()
        if said:
            shown.rig.mission.events.emit(RunFinished(said, 0))
        shown.page.close()
        messages = [json.loads(line[6:]) for line in stream if line.startswith(b"data: ")]
    ended = messages[-1]["now"]["ended"]
    assert ended == said if said else ended


@pytest.mark.slow
def test_a_browser_that_never_reads_does_not_hold_up_the_end(show):
    earlier = set(threading.enumerate())
    shown = show(Rig())
    with socket.create_connection(("127.0.0.1", shown.port)) as idle:
        idle.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        wait_until(lambda: shown.page.streams)
        for stream in list(shown.page.streams):
            stream.flush = asyncio.Future  # what it is sent is never taken
        shown.page.close()
        wait_until(lambda: "page" not in {
            thread.name for thread in set(threading.enumerate()) - earlier})


def test_a_port_that_is_taken_is_one_line(show):
    shown = show(Rig())
    warnings = []
    page = Page("127.0.0.1", shown.port, board_of(shown.rig), warnings.append)
    assert not page.is_served
    page.close()
    assert warnings == [
        "no page in the browser: 127.0.0.1:{} cannot be opened (Address already in use); "
        "set monitorPort to another port, or to 0".format(shown.port)]


@pytest.mark.slow
def test_a_browser_too_many_is_told_so_and_one_that_takes_nothing_is_disconnected(
        show, monkeypatch):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    ask = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"
    browsers = [socket.create_connection(("127.0.0.1", shown.port), timeout=5) for _ in range(20)]
    for each in browsers:
        each.sendall(ask)
    assert b"\r\nContent-Type: text/event-stream; charset=utf-8\r\n" in browsers[0].recv(2000)
    wait_until(lambda: len(shown.page.streams) == 20)
    assert answer_to(shown, ask).startswith(b"HTTP/1.1 503 ")
    monkeypatch.setattr(page_module, "LONGEST_IDLE", 0.2)
    for stream in list(shown.page.streams):
        stream.flush = asyncio.Future  # what it is sent is never taken
    wait_until(lambda: not shown.page.streams)
    for each in browsers:
        while each.recv(65536):  # times out if the connection stays open
            pass
        each.close()


@pytest.mark.slow
def test_browsers_that_vanish_or_never_read_disturb_nobody(show):
    rig = one_leaf(
        "<Repeat num_cycles='-1'><Sequence><WelcomeSpeech/><Sleep msec='1'/></Sequence></Repeat>")
    shown = show(rig)
    idle = [socket.create_connection(("127.0.0.1", shown.port)) for _ in range(70)]
    for number, each in enumerate(idle):
        each.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n" if number %
                     3 else b"\x00\xff garbage\r\n\r\n")
    wait_until(lambda: len(shown.page.streams) == 20)
    began = time.perf_counter()
    for _ in range(2000):
        rig.tick()
        rig.clock.advance(0.001)
    assert time.perf_counter() - began < 10.0
    for each in idle:
        each.close()
    assert shown.fetch("state")[0] == 200
    wait_until(lambda: not shown.page.streams, 25.0)


def test_lines_are_sent_when_some_are_new_or_the_controller_has_given_a_sign_of_life():
    texts, versions = [], {"alive": 1}
    backlog = types.SimpleNamespace(since=lambda number: (not number, texts[number:]))
    board = types.SimpleNamespace(backlog=backlog, versions=versions, stopped="")
    lines, sent = object.__new__(page_module._Lines), []
    for new, alive, is_first in (([], 1, True), ([], 1, False), ([b"a"], 1, False), ([], 1, False),
                                 ([], 2, False), ([b"b", b"c"], 3, False), ([], 3, False)):
        texts += new
        backlog.count, versions["alive"] = len(texts), alive
        batch, _, content = lines.news(board, is_first).partition(b"\n")
        sent.append(content if batch else None)
    assert sent == [b"", None, b"a", None, b"", b"bc", None]
