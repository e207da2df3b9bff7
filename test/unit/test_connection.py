"""Whatever a master or node answers: it has the documented shape, or is one kind of error, within
the limit."""
import contextlib
import errno
import socket
import threading
import time
import xmlrpc.client

import pytest

from behavior_controller.robot.gateway import Cause
from behavior_controller.ros import master
from behavior_controller.ros.shortage import SHORTAGE, is_shortage
from behavior_controller.ros.tcpros import ANSWERS, Connection, MOST_XML, Trouble, ask
from faulty_master import GARBAGE, RAW, http_answer
from ros_peers import TcprosPeer, hang
from shortages import no_files_left

NODES = [["/a", ["/n", "/m"]], ["/b", []]]
SANE = {"getSystemState": [NODES, [], NODES], "lookupService": "rosrpc://h:1",
        "lookupNode": "http://h:1/", "getParam": {"a": [1, "b"]}, "registerService": 1,
        "publisherUpdate": 0, "registerPublisher": ["http://h:1/"], "registerSubscriber": [],
        "unregisterSubscriber": 1, "deleteParam": 0, "getPid": 77,
        "requestTopic": ["TCPROS", "h", 1], "setParam": 0, "servicesInUse": [True, ["/a/x"]]}


@contextlib.contextmanager
def peer(data, gap=0.0):
    """Answer each call that comes to the address with these bytes, ``gap`` seconds between two of
    them."""
    def talk(connection):
        with connection:
            if b"POST" in connection.recv(5, socket.MSG_PEEK):
                read_call(connection)
            for byte in data if gap else ():
                connection.sendall(bytes([byte]))
                time.sleep(gap)
            connection.sendall(b"" if gap else data)

    served = TcprosPeer(talk)
    yield "http://127.0.0.1:{}/".format(served.port)
    served.close()


def read_call(connection):
    data = b""
    while b"</methodCall>" not in data:
        data += connection.recv(65536)


def answered(value):
    return http_answer(xmlrpc.client.dumps((value,), methodresponse=True, allow_none=True).encode())


def of_texts(value):
    return isinstance(value, list) and all(isinstance(part, str) for part in value)


FITS = {"getParam": lambda value: True,
        **dict.fromkeys(("unregisterSubscriber", "deleteParam", "setParam", "getPid",
                         "registerService", "publisherUpdate"), lambda value: type(value) is int),
        "lookupNode": lambda value: isinstance(value, str),
        "lookupService": lambda value: isinstance(value, str), "registerPublisher": of_texts,
        "registerSubscriber": of_texts, "getSystemState": lambda value: value == ([], [], []),
        "requestTopic": lambda value: False}
"""Whether a value of ``GARBAGE`` happens to be one that the method may return."""


def plain(value):
    """Return the value with lists for tuples, as it travels."""
    return [plain(part) for part in value] if isinstance(value, (list, tuple)) else value


def test_each_method_that_is_asked_for_has_a_sane_answer_here():
    assert set(SANE) == set(ANSWERS)


@pytest.mark.parametrize("method", SANE)
def test_a_sane_answer_is_returned(method):
    with peer(answered([1, "ok", SANE[method]])) as uri:
        assert plain(ask(uri, method, seconds=5.0)) == SANE[method]


@pytest.mark.parametrize("method, fails", [
    ("lookupService", False), ("lookupNode", False), ("getParam", False), ("requestTopic", False),
    ("getSystemState", True), ("registerSubscriber", True), ("registerService", True)])
def test_a_reported_failure_is_none_where_that_means_something(method, fails):
    with peer(answered([-1, "no", 0])) as uri:
        if fails:
            with pytest.raises(Trouble):
                ask(uri, method, seconds=5.0)
        else:
            assert ask(uri, method, seconds=5.0) is None


@pytest.mark.slow
@pytest.mark.parametrize("method", SANE)
def test_a_value_of_another_shape_is_trouble(method):
    for value in GARBAGE:
        with peer(answered([1, "ok", value])) as uri:
            try:
                found = ask(uri, method, seconds=5.0)
            except Trouble as trouble:
                assert trouble.cause is Cause.NOT_REACHABLE and len(str(trouble)) < 500
            else:
                assert FITS[method](found), value


@pytest.mark.parametrize("answer", [
    None, 1, "text", [], [1], [1, "ok"], [1, "ok", "x", "y"], {"a": 1}, [[1], "ok", "x"],
    ["1", "ok", "x"], [None, None, None], [True, "ok", "http://h:1/"]], ids=repr)
def test_an_answer_that_is_no_triple_is_trouble(answer):
    with peer(answered(answer)) as uri, pytest.raises(Trouble):
        ask(uri, "lookupNode", "/n", seconds=5.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", RAW)
def test_what_is_no_answer_at_all_is_trouble(name):
    with peer(RAW[name]) as uri, pytest.raises(Trouble):
        ask(uri, "getSystemState", seconds=5.0)


def test_an_answer_without_an_end_is_trouble():
    body = b"<methodResponse>" + b" " * MOST_XML
    with peer(http_answer(body)) as uri, pytest.raises(Trouble) as raised:
        ask(uri, "getSystemState", seconds=20.0)
    assert str(MOST_XML) in str(raised.value)


@pytest.mark.parametrize("uri", [
    "", "x", "http://", "http:///", "ftp://h:1", "http://h:99999/", "http://h:x/", "http://[::1/",
    "http://a b:1/", "http://\0:1/", "http://" + "a" * 70 + ":1/", "http://127.0.0.1:1/"])
def test_an_address_at_which_nothing_can_answer_is_trouble(uri):
    with pytest.raises(Trouble):
        ask(uri, "lookupNode", "/n", seconds=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("data, gap, fault", [
    (answered([1, "ok", SANE["getSystemState"]]), 0.05, "answers slowly"),
    (b"", 0.05, "does not answer")])
def test_the_whole_exchange_ends_in_time(data, gap, fault):
    with peer(data, gap) as uri:
        began = time.monotonic()
        with pytest.raises(Trouble) as raised:
            ask(uri if data else silent(), "getSystemState", seconds=0.6)
        assert 0.5 < time.monotonic() - began < 2.0
    assert raised.value.fault == fault


def silent():
    """Return the address of a port that takes connections and says nothing."""
    return "http://127.0.0.1:{}/".format(TcprosPeer(hang).port)


@pytest.mark.slow
def test_a_handshake_that_comes_byte_by_byte_ends_in_time():
    header = b"\x20\x00\x00\x00\x1c\x00\x00\x00callerid=/a_node_with_a_long_name"
    with peer(header, gap=0.1) as uri:
        began = time.monotonic()
        with pytest.raises(Trouble) as raised:
            Connection().open("127.0.0.1", int(uri.rstrip("/").rpartition(":")[2]),
                              {"callerid": "/a"}, 0.6)
        assert 0.5 < time.monotonic() - began < 2.0
    assert raised.value.cause is Cause.NO_ANSWER


@pytest.mark.parametrize("host, port", [("127.0.0.1", -1), ("127.0.0.1", 70000),
                                        ("127.0.0.1", 10**30), ("\0", 1), ("a" * 80, 1), ("", 1),
                                        ("a b", 1)])
def test_a_place_that_cannot_exist_is_trouble(host, port):
    with pytest.raises(Trouble):
        Connection().open(host, port, {"callerid": "/a"}, 1.0)


@pytest.mark.slow
def test_a_name_server_that_hangs_is_waited_for_within_the_limit_and_asked_once(monkeypatch):
    asked, answer = [], threading.Event()
    real = socket.getaddrinfo

    def hangs(host, *arguments, **options):
        if options.get("flags") != socket.AI_NUMERICHOST:
            asked.append(host)
            answer.wait(20)
            return real("127.0.0.1", *arguments, **options)
        return real(host, *arguments, **options)

    monkeypatch.setattr(socket, "getaddrinfo", hangs)
    with peer(
            http_answer(xmlrpc.client.dumps(([1, "", 77],), methodresponse=True).encode())) as uri:
        named = uri.replace("127.0.0.1", "slow.example")
        for _ in range(2):
            began = time.monotonic()
            with pytest.raises(Trouble, match="name server"):
                ask(named, "getPid", seconds=0.2)
            assert time.monotonic() - began < 2.0
        assert asked == ["slow.example"]
        answer.set()
        assert ask(named, "getPid") == 77


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "robot.example"])
def test_a_peer_is_not_blamed_for_a_shortage_of_this_computer(host):
    with no_files_left(), pytest.raises(Trouble) as caught:
        ask("http://{}:1/".format(host), "getPid", seconds=5.0)
    assert caught.value.shortage.errno == errno.EMFILE
    assert str(caught.value).endswith(
        " cannot be asked: no connection (this computer gives no more: Too many open files)")
    assert SHORTAGE.now == "[Errno 24] Too many open files"
    with pytest.raises(Trouble) as refused:
        ask("http://127.0.0.1:1/", "getPid", seconds=5.0)
    assert refused.value.shortage is None


def test_a_start_without_files_says_so_and_nothing_about_the_master():
    with no_files_left(), pytest.raises(OSError) as caught:
        master.ask_at_start("lookupNode", "/a")
    assert caught.value.errno == errno.EMFILE


def test_a_round_in_which_this_computer_could_not_ask_says_nothing_about_the_master():
    directory = master.Directory()
    for unanswered in (0, 3):
        directory.unanswered = unanswered
        with no_files_left(), contextlib.suppress(Trouble), directory.round():
            directory.refresh()
        assert (directory.unanswered, directory.fault) == (unanswered, "")


@pytest.mark.parametrize("error, expected", [
    (MemoryError(), True), (OSError(errno.EMFILE, "files"), True),
    (OSError(errno.ENOENT, "file"), False), (RuntimeError("can't start new thread"), True),
    (RuntimeError("other"), False), (ValueError("can't start new thread"), False)])
def test_what_a_shortage_is(error, expected):
    assert is_shortage(error) is expected


def test_an_address_without_a_port_has_that_of_http(monkeypatch):
    ports = []

    def connect(self, host, port, seconds):
        ports.append(port)
        raise OSError("so")

    monkeypatch.setattr(Connection, "connect", connect)
    for port in ("", ":11311"):
        with pytest.raises(Trouble):
            ask("http://h{}/".format(port), "getPid")
    assert ports == [80, 11311]
