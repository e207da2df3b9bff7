"""What tests share: missions on pages, a browser, and the record of a tour that was killed."""
import os

import hypothesis
import pytest
from hypothesis.configuration import set_hypothesis_home_dir

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

set_hypothesis_home_dir(os.path.join(ROOT, "build", "hypothesis"))
ALWAYS = dict(deadline=None, database=None, suppress_health_check=list(hypothesis.HealthCheck))
hypothesis.settings.register_profile("the same", derandomize=True, **ALWAYS)
hypothesis.settings.register_profile("others", **ALWAYS)  # --hypothesis-profile others
hypothesis.settings.load_profile("the same")


@pytest.fixture
def show():
    """Return what puts a mission on a page."""
    from page_rig import Show  # not where there is no server of pages
    shows = []

    def make(rig, **more):
        shows.append(Show(rig, **more))
        return shows[-1]

    yield make
    for each in shows:
        each.page.close()


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium."""
    from browser import open_browser
    opened = open_browser()
    yield opened
    opened.quit()


@pytest.fixture
def screen(browser):
    """Return what gives the page a screen: width, height, light or dark."""
    from browser import reset_screen, set_screen
    yield lambda *wanted: set_screen(browser, *wanted)
    reset_screen(browser)


@pytest.fixture
def console(monkeypatch):
    """A console that leaves the streams and the logging of the tests as they are."""
    from behavior_controller.ros import console  # not where there is no ROS
    from behavior_controller.ros.sinks import Sink
    monkeypatch.setattr(console, "take_over_streams", lambda: Sink("test", lambda item: None, str))
    monkeypatch.setattr(console.Console, "attach", lambda self: None)
    return console.Console()


@pytest.fixture
def killed_run(tmp_path):
    """The record of a tour that was killed while the robot drove."""
    from mission_rig import recorded, visitor_who
    path = recorded(tmp_path, visitor_who(says="yes"))
    with open(path, "rb+") as file:
        data = file.read()
        at = data.index(b"\n", data.index(b'"_type":"GoTo"')) + 1
        file.truncate(at + 20)  # the next line is torn
    return path
