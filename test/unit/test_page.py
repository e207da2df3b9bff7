"""The live page in a real browser, and what a server must put up with."""
import asyncio
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest

from behavior_controller.events import HealthChanged, RunFinished
from behavior_controller.health import GONE
from behavior_controller.interface.records import Answer, PerformGesture, Say
from behavior_controller.leaves import registry
from behavior_controller.watch import server
from behavior_controller.watch.board import PARTS, Board
from behavior_controller.watch.page import Page
from browser import open_browser
from mission_rig import Rig, one_leaf, refusal, visitor_who

SOURCE = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "src")


class Stop(Exception):
    """The mission has come to the moment in question."""


class Show:
    """A mission on a page."""

    def __init__(self, rig, address="127.0.0.1"):
        self.rig, self.warnings = rig, []
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.page = Page(address, self.port, Board(rig.mission.events, rig.mission.health, registry()),
                         self.warnings.append)
        self.page.show(rig.tree)
        self.url = "http://127.0.0.1:{}/".format(self.port)

    def fetch(self, path="", method="GET", host=None):
        """Return status, body and headers; ``host`` is the name that the page is asked for by, empty for none."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
        connection.putrequest(method, "/" + path, skip_host=host is not None)
        if host:
            connection.putheader("Host", host)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers

    def run_until(self, wanted):
        """Run the lab tour until a request is ``wanted``, which stays unanswered."""
        answer = self.rig.answer
        self.rig.answer = lambda request: None if wanted(request) else answer(request)

        def visitor(rig):
            visitor_who(says="yes")(rig)
            if any(wanted(request) for request in rig.requests):
                raise Stop

        with pytest.raises(Stop):
            self.rig.run(visitor)


@pytest.fixture
def show():
    shows = []

    def make(rig, **more):
        shows.append(Show(rig, **more))
        return shows[-1]

    yield make
    for each in shows:
        each.page.close()


@pytest.fixture(scope="module")
def browser():
    opened = open_browser()
    yield opened
    opened.quit()


def wait_until(is_so, seconds=8.0):
    """The browser does not tell what it has drawn: look until it has."""
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        if is_so():
            return
        time.sleep(0.05)
    raise AssertionError("not in {} s".format(seconds))


def open_page(browser, shown, width=1280, height=800):
    browser.set_window_size(width, height)
    browser.get(shown.url)
    wait_until(lambda: browser.execute_script("return items.length") == len(shown.rig.tree.nodes))


def text(browser, selector):
    return browser.execute_script("return document.querySelector(arguments[0]).innerText", selector)


IN_VIEW = """
const row = document.querySelector(".tip > .row").getBoundingClientRect(), box = byId("tree").getBoundingClientRect();
return row.height > 0 && row.top >= box.top && row.bottom <= box.bottom && row.left >= 0 && row.right <= innerWidth;"""


@pytest.mark.parametrize("width, height", [(1280, 800), (800, 1180)])
def test_a_tour_is_followed_without_a_reload(show, browser, width, height):
    rig = Rig(answer=lambda request: refusal(request) if isinstance(request, PerformGesture) else NotImplemented)
    shown = show(rig)
    open_page(browser, shown, width, height)
    assert text(browser, "#now") == "nothing runs"
    browser.execute_script("window.is_same_page = true")
    shown.run_until(lambda request: isinstance(request, Say) and request.text == "second text 1")
    wait_until(lambda: "VisitExhibit › 2 (DescribeExhibitSpeech) #128" in text(browser, "#now"))
    assert browser.execute_script("return is_same_page")
    wait_until(lambda: browser.execute_script(IN_VIEW))
    drawn = browser.execute_script("return items.map(one => [...one.classList].find(name => name.length == 1) || '-').join('')")
    assert drawn == shown.page.board.part("statuses")["letters"]
    assert "recovery: skipped" in text(browser, "#trouble")
    assert "exhibit 1" in text(browser, "#blackboard")
    assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_every_status_has_a_sign_and_a_word_of_its_own(show, browser):
    rig = one_leaf("<Parallel success_count='3' failure_count='4'><WelcomeSpeech/><ForceFailure><FollowMeSpeech/></ForceFailure>"
                   "<SayGoodByeSpeech/><EndTourSpeech/></Parallel>",
                   lambda request: None if "oodbye" in request.text.lower() else Answer())
    shown = show(rig)
    open_page(browser, shown)
    rig.tick()
    wait_until(lambda: "R" in browser.execute_script("return letters"))
    seen = dict(browser.execute_script("return items.map((one, n) => [letters[n], [one.firstChild.children[1].innerText, "
                                       "one.getAttribute('aria-label').split(': ')[1]]])"))
    assert seen["R"] == ["▶", "running"] and seen["S"] == ["✔", "success"] and seen["F"] == ["✘", "failure"]


def press(browser, *keys):
    for key in keys:
        browser.switch_to.active_element.send_keys(key)


def test_the_keyboard_folds_and_walks(show, browser):
    from selenium.webdriver.common.keys import Keys
    shown = show(Rig())
    open_page(browser, shown)
    browser.execute_script("byId('fold').click(); items[0].focus()")

    def focused():
        return browser.execute_script("return document.activeElement.querySelector('.name').innerText")

    press(browser, Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    assert focused() == "DetectVisitor"
    press(browser, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert focused() == "Sequence"
    press(browser, Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert focused() == "DetectVisitor"
    assert browser.execute_script("return document.activeElement.getAttribute('aria-expanded')") == "true"
    press(browser, Keys.ENTER)
    assert browser.execute_script("return document.activeElement.getAttribute('aria-expanded')") == "false"
    press(browser, Keys.END)
    last = focused()
    press(browser, Keys.ARROW_DOWN)
    assert focused() == last
    press(browser, Keys.HOME)
    assert focused() == "Sequence" and browser.execute_script("return follow") is False


def test_another_mission_takes_the_place_of_the_first(show, browser):
    shown = show(Rig())
    open_page(browser, shown)
    other = one_leaf("<Sequence><WelcomeSpeech name='&lt;img src=x onerror=alert(1)&gt;'/></Sequence>")
    shown.page.show(other.tree)
    wait_until(lambda: browser.execute_script("return items.length") == 2)
    # a name is a text, whatever it looks like
    assert text(browser, "#tree .row:last-child .name, [aria-level='2'] .name") == "<img src=x onerror=alert(1)>"


PHONE = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}  # a window cannot be made so narrow
NAME_IN_VIEW = """
const name = document.querySelector(".tip > .row > .name").getBoundingClientRect();
const row = document.querySelector(".tip > .row").getBoundingClientRect(), box = byId("tree").getBoundingClientRect();
return name.left >= box.left && name.right <= box.right && row.top >= box.top && row.bottom <= box.bottom
  && row.bottom <= innerHeight && row.right >= name.right;"""


@pytest.fixture
def phone(browser):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_phone_shows_the_running_leaf_and_what_is_wrong(show, phone):
    rig = Rig()
    shown = show(rig)
    rig.mission.health.report(GONE, HealthChanged("service", "/tabletEvent/x", "", False, "gone", "no choice is shown"))
    open_page(phone, shown)
    assert phone.execute_script("return innerWidth") == 400
    shown.run_until(lambda request: isinstance(request, Say) and request.text == "second text 1")
    wait_until(lambda: "2 (DescribeExhibitSpeech) #128" in text(phone, "#now"))
    wait_until(lambda: phone.execute_script(NAME_IN_VIEW))
    assert phone.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    assert text(phone, "#alarms") == "✘ /tabletEvent/x: gone; no choice is shown"
    phone.execute_script("scrollTo(0, document.body.scrollHeight)")  # the alarm stays in view
    bottom = phone.execute_script("return byId('alarms').getBoundingClientRect().bottom")
    assert 0 < bottom < 400


def test_a_tree_of_many_levels_is_shown(show, browser):
    shown = show(one_leaf("<Inverter>" * 1900 + "<WelcomeSpeech/>" + "</Inverter>" * 1900, lambda request: None))
    open_page(browser, shown)
    shown.rig.tick()
    wait_until(lambda: "WelcomeSpeech #1901" in text(browser, "#now"))
    wait_until(lambda: browser.execute_script(NAME_IN_VIEW))


# ------------------------------------------------------------------------------------------------------ is it still so?


def doubt(browser):
    return text(browser, "#doubt").strip()


def is_stale(browser):
    return browser.execute_script("return document.body.classList.contains('stale')")


SERVED = """
import sys, threading, time
from mission_rig import one_leaf
from test_page import Show
from behavior_controller.interface.document import FACES
rig = one_leaf("<Sleep msec='900000'/>")
shown = Show(rig)
print(shown.port, flush=True)
while True:
    rig.tick()
    rig.mission.health.heard[FACES.name] = time.monotonic()
    time.sleep(0.1)
    rig.clock.advance(0.1)
"""


def test_a_controller_that_is_frozen_does_not_look_live(browser):
    here = os.path.dirname(os.path.abspath(__file__))
    with subprocess.Popen([sys.executable, "-c", SERVED], stdout=subprocess.PIPE, universal_newlines=True,
                          env=dict(os.environ, PYTHONPATH=os.pathsep.join([SOURCE, here]))) as served:
        try:
            browser.get("http://127.0.0.1:{}/".format(served.stdout.readline().strip()))
            wait_until(lambda: "last message 0." in text(browser, "#health"))
            assert doubt(browser) == "" and not is_stale(browser)
            os.kill(served.pid, signal.SIGSTOP)
            wait_until(lambda: is_stale(browser), 5.0)
            assert doubt(browser).startswith("No message from the mission. What is shown may be old. Since ")
            wait_until(lambda: "Since 4 s" in doubt(browser))
            # the age that the server told last goes on growing
            assert float(re.search(r"last message ([\d.]+) s ago", text(browser, "#health"))[1]) >= 3.0
            os.kill(served.pid, signal.SIGCONT)
            wait_until(lambda: doubt(browser) == "" and not is_stale(browser))
        finally:
            served.kill()
    wait_until(lambda: doubt(browser).startswith("No connection to the mission; trying again."))
    assert is_stale(browser)


def test_a_tick_thread_that_hangs_does_not_look_live_though_the_page_is_served(show, browser):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    open_page(browser, shown)
    wait_until(lambda: is_stale(browser))
    assert doubt(browser).startswith("The controller hangs: its tick thread gives no sign of life. Since ")
    shown.rig.clock.advance(1.0)  # it runs its timers again
    wait_until(lambda: doubt(browser) == "" and not is_stale(browser))


def test_the_end_of_the_mission_is_told_and_the_next_one_is_shown(show, browser):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    open_page(browser, shown)
    shown.rig.mission.events.emit(RunFinished("all passes are done; last pass: SUCCESS", 0))
    shown.page.close()  # at once, as the node does
    wait_until(lambda: browser.execute_script("return !hasConnection"))
    assert doubt(browser) == "The mission has ended: all passes are done; last pass: SUCCESS."
    rig = one_leaf("<Sequence><Sleep msec='9000'/><WelcomeSpeech/></Sequence>")
    following = Page("127.0.0.1", shown.port, Board(rig.mission.events, rig.mission.health, registry()), pytest.fail)
    try:
        following.show(rig.tree)
        wait_until(lambda: browser.execute_script("return items.length") == 3 and "ended" not in doubt(browser), 15.0)
    finally:
        following.close()


def test_health_is_told_when_it_changes(show, browser):
    rig = one_leaf("<Sleep msec='9000'/>")
    shown = show(rig)
    open_page(browser, shown)
    for is_well in (False, True):
        rig.mission.health.report(GONE, HealthChanged("service", "/robotNavigation/set_goal", "", is_well, "gone", "no drive"))
        rig.mission.health.publish(rig.mission.events)
        wait_until(lambda: ("gone; no drive" in text(browser, "#health")) is not is_well)


# ------------------------------------------------------------------------------------------------------ without a browser


def test_it_needs_nothing_from_elsewhere_and_takes_no_orders(show):
    shown = show(Rig())
    for path in ("", "page.js", "page.css", "icon.svg"):
        status, body, headers = shown.fetch(path)
        assert status == 200 and "http://" not in body.replace("http://www.w3.org/2000/svg", "") and "https://" not in body
        assert headers["Content-Security-Policy"] == "default-src 'self'; frame-ancestors 'none'"
        assert headers["X-Frame-Options"] == "DENY"
    assert json.loads(shown.fetch("state")[1]).keys() == set(PARTS)
    for method in ("POST", "PUT", "DELETE"):
        assert shown.fetch("state", method)[0] == 405
    assert shown.fetch("../page.py")[0] in (403, 404) and shown.fetch("none")[0] == 404


@pytest.mark.parametrize("path", ["", "page.js", "state", "events", "none"])
@pytest.mark.parametrize("host", ["rebound.example", "rebound.example:8080", "localhost.rebound.example", "93.184.216.34",
                                  "127.0.0.1.rebound.example", "localhost@rebound.example", "127.0.0.1, rebound.example", ""])
def test_a_foreign_name_is_refused(show, path, host):
    """A site whose name points at this computer could else read the page in the operator's browser."""
    status, body, headers = show(Rig()).fetch(path, host=host)
    assert status in (400, 403) and "mission" not in body and "<" not in body
    assert headers["Content-Security-Policy"] == "default-src 'self'; frame-ancestors 'none'" or status == 400


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:9", "localhost", "LocalHost:8080", "127.1.2.3", "[::1]:8080"])
def test_loopback_names_are_answered(show, host):
    assert show(Rig()).fetch("state", host=host)[0] == 200


def test_to_the_network_the_page_answers_by_address_and_host_name(show):
    own, shown = socket.gethostname(), show(Rig(), address="0.0.0.0")
    addresses = {entry[4][0] for entry in socket.getaddrinfo(own, None, socket.AF_INET)}
    for host in (own, own.upper() + ":80", own + ".local", "localhost"):
        assert shown.fetch("state", host=host)[0] == 200
    for address in addresses:
        with urllib.request.urlopen("http://{}:{}/state".format(address, shown.port), timeout=5) as answer:
            assert answer.status == 200
    for host in (own + ".rebound.example", "rebound.example", "0.0.0.0"):
        assert shown.fetch("state", host=host)[0] == 403


def test_a_foreign_page_cannot_frame_it(show, browser, tmp_path):
    shown = show(Rig())
    (tmp_path / "foreign.html").write_text("<title>foreign</title><iframe src='{}'></iframe>".format(shown.url))
    browser.get("file://{}/foreign.html".format(tmp_path))
    wait_until(lambda: any("frame-ancestors" in entry["message"] for entry in browser.get_log("browser")))


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


def test_a_browser_that_is_served_keeps_its_place(show, monkeypatch):
    monkeypatch.setattr(server, "SHORTEST_IDLE", 0.3)
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        stream.readline()
        idle = [socket.create_connection(("127.0.0.1", shown.port)) for _ in range(70)]
        for _ in range(5):
            wait_until(lambda: is_served(shown))  # it takes the place of the connection that is idle longest
        shown.rig.mission.events.emit(RunFinished("stopped; last pass: none", 0))
        wait_until(lambda: b"stopped; last pass: none" in stream.readline())
        for each in idle:
            each.close()


def answer_to(shown, request):
    with socket.create_connection(("127.0.0.1", shown.port), timeout=5) as connection:
        connection.sendall(request)
        return connection.recv(100)


@pytest.mark.parametrize("length, is_taken", [(1024, True), (1025, False)])
def test_a_request_has_no_long_body(show, length, is_taken):
    head = "GET /state HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n".format(length)
    found = answer_to(show(Rig()), head.encode() + length * b"x")
    assert found.startswith(b"HTTP/1.1 200 " if is_taken else b"HTTP/1.1 400 ")


@pytest.mark.parametrize("length, is_taken", [(16384, True), (16385, False)])
def test_a_request_has_no_long_header(show, length, is_taken):
    head = b"GET /state HTTP/1.1\r\nHost: localhost\r\nX: %s\r\n\r\n"
    found = answer_to(show(Rig()), head % ((length - len(head % b"")) * b"x"))
    assert found.startswith(b"HTTP/1.1 200 ") if is_taken else found == b""


def is_served(shown):
    try:
        return shown.fetch("state")[0] == 200
    except OSError:
        return False


def test_changes_are_pushed_together(show):
    rig = one_leaf("<Repeat num_cycles='-1'><Sequence><WelcomeSpeech/><FollowMeSpeech/><Sleep msec='1'/></Sequence></Repeat>")
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


def test_there_is_a_message_every_second_though_nothing_happens(show):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        came = []
        while len(came) < 4:
            if stream.readline().startswith(b"data: "):
                came.append(time.monotonic())
    assert came[3] - came[1] < 4.0


def test_the_end_reaches_a_browser_before_the_server_closes(show):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        stream.readline()
        shown.rig.mission.events.emit(RunFinished("stopped; last pass: none", 0))
        shown.page.close()
        messages = [json.loads(line[6:]) for line in stream if line.startswith(b"data: ")]
    assert messages[-1]["passes"]["ended"] == "stopped; last pass: none"


def test_a_controller_that_ends_without_a_word_has_stopped(show):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    with urllib.request.urlopen(shown.url + "events", timeout=5) as stream:
        stream.readline()
        shown.page.close()
        messages = [json.loads(line[6:]) for line in stream if line.startswith(b"data: ")]
    assert messages[-1]["passes"]["ended"] == "the controller has stopped"


def test_a_browser_that_never_reads_does_not_hold_up_the_end(show):
    shown = show(Rig())
    with socket.create_connection(("127.0.0.1", shown.port)) as idle:
        idle.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        wait_until(lambda: shown.page.streams)
        for stream in list(shown.page.streams):
            stream.flush = asyncio.Future  # what it is sent is never taken
        began = time.monotonic()
        shown.page.close()
        assert time.monotonic() - began < 1.0


def test_a_port_that_is_taken_is_one_line(show):
    shown = show(Rig())
    warnings = []
    page = Page("127.0.0.1", shown.port, Board(shown.rig.mission.events, shown.rig.mission.health, registry()), warnings.append)
    page.show(shown.rig.tree)
    page.close()
    assert len(warnings) == 1 and str(shown.port) in warnings[0] and "monitorPort" in warnings[0]


def test_browsers_that_vanish_or_never_read_disturb_nobody(show):
    rig = one_leaf("<Repeat num_cycles='-1'><Sequence><WelcomeSpeech/><Sleep msec='1'/></Sequence></Repeat>")
    shown = show(rig)
    idle = [socket.create_connection(("127.0.0.1", shown.port)) for _ in range(70)]
    for number, each in enumerate(idle):
        each.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n" if number % 3 else b"\x00\xff garbage\r\n\r\n")
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


def test_the_terminal_shows_the_same(show):
    shown = show(Rig())
    shown.run_until(lambda request: isinstance(request, Say) and request.text == "first text 1")
    printed = subprocess.run([sys.executable, os.path.join(SOURCE, "behavior_controller", "missionStatus"), "--port",
                              str(shown.port)], env=dict(os.environ, PYTHONPATH=SOURCE), stdout=subprocess.PIPE,
                             universal_newlines=True, check=True).stdout
    assert "▶ 1 (DescribeExhibitSpeech) #119: running" in printed
