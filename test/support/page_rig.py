"""A mission on the live page, and a browser that looks at it."""
import http.client
import time

import pytest

from behavior_controller.missions.load import describe
from behavior_controller.robot.requests import Say
from behavior_controller.run import events
from behavior_controller.run.events import Line
from behavior_controller.run.history import Run
from behavior_controller.run.moment import card, robot_line
from behavior_controller.run.record.feed import Entries, traversed, written
from behavior_controller.viewer import view
from behavior_controller.viewer.web_page import Page
from free_ports import free_port
from mission_rig import board_of, visitor_who


class Stop(Exception):
    """The mission has come to the moment in question."""


class Show:
    """A mission on a page."""

    def __init__(self, rig, address="127.0.0.1"):
        self.rig, self.warnings = rig, []
        self.port = free_port()
        self.page = Page(address, self.port, board_of(rig), self.warnings.append)
        self.url = "http://127.0.0.1:{}/".format(self.port)

    def fetch(self, path="", method="GET", host=None):
        """Return status, body and headers; ``host`` is the name that the page is asked for by,
        empty for none."""
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
        with pytest.raises(Stop):
            self.rig.run(until(lambda: any(map(wanted, self.rig.requests))))


def until(is_so):
    """Return a visitor who answers with yes, and stops the mission."""
    def act(rig):
        visitor_who(says="yes")(rig)
        if is_so():
            raise Stop
    return act


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
    browser.get("about:blank")
    browser.get_log("browser")  # the page of the test before may miss its server
    browser.get(shown.url)
    wait_until(lambda: browser.execute_script("return items.length") == len(shown.rig.tree.nodes))


def text(browser, selector):
    return browser.execute_script("return document.querySelector(arguments[0]).innerText", selector)


def is_second_text(request):
    return isinstance(request, Say) and request.text == "second text 1"


def use_time_of(rig, monkeypatch):
    """Have the board take the times of events from the clock of a rig."""
    monkeypatch.setattr(view, "unix_now", rig.clock.now)
    monkeypatch.setattr(events, "unix_now", rig.clock.now)


class Situation:
    """A mission that is played to a moment: ``run`` is the model of all that happened."""

    def __init__(self, rig):
        self.rig = rig
        self.run = Run([Line(rig.clock.now(), describe(rig.tree, 1))])
        rig.mission.events.subscribe(self._take)
        self.entries = Entries(rig.tree)
        rig.tree.follow(self._follow)

    def _follow(self, is_first, changes):
        self._take(written(*self.entries.news()))
        if changes:
            self._take(traversed(0.0, is_first, changes))

    def _take(self, event):
        self.run.take(Line(self.rig.clock.now(), event))

    def play(self, visitor, is_there, runs=1, **options):
        """Run until ``is_there()``; the mission is then as it was."""
        def act(rig):
            if is_there():
                raise Stop
            visitor(rig)

        with pytest.raises(Stop):
            self.rig.run(act, runs=runs, **options)

    def report(self, respect, change):
        self.rig.report(respect, change)

    @property
    def asked(self):
        return self.rig.requests[-1] if self.rig.requests else None

    @property
    def card(self):
        return card(self.run.at(self.run.lines[-1].time))

    @property
    def robot(self):
        return robot_line(self.run.at(self.run.lines[-1].time))
