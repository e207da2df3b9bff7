"""What tests of the page share: missions on pages, and a browser."""
import pytest


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


@pytest.fixture(scope="module")
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
