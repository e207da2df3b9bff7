"""A headless browser for the tests of what people see, and axe-core, which judges whether all can.
"""
import importlib.util
import os
import shutil

import pytest

try:
    from selenium import webdriver
except ImportError:
    webdriver = None


def needs_browser():
    """Skip the test where there is no Chromium, and say so."""
    if webdriver is None or not shutil.which("chromium") or not shutil.which("chromedriver"):
        pytest.skip("no Chromium with python3-selenium here")


def open_browser(width=1280, height=800):
    """Return a headless Chromium."""
    needs_browser()
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                     "--hide-scrollbars", "--window-size={},{}".format(width, height)):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    from selenium.webdriver.chrome.service import Service
    for is_last in (False, True):  # on a busy computer it may end while it starts
        try:
            service = Service(shutil.which("chromedriver"))
            opened = webdriver.Chrome(service=service, options=options)
            opened.set_script_timeout(120)  # axe-core takes its time
            return opened
        except Exception:
            if is_last:
                raise


def set_screen(browser, width, height, mode="light"):
    """Give the page a screen of that size, narrower than a window can be made, of a phone below 500
    px; ``mode``: dark."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia",
                            {"features": [{"name": "prefers-color-scheme", "value": mode}]})


SCREENS = [(400, 800), (800, 1180), (1280, 800), (1920, 1080)]
MODES = ["light", "dark"]

IS_WHOLE = """
const range = document.createRange();
return arguments[0].every(id => {
  const one = document.getElementById(id);
  range.selectNodeContents(one);
  return [...range.getClientRects()].every((_, place) => {
    const line = () => range.getClientRects()[place], middle = () => (line().top + line().bottom) / 2;
    scrollBy(0, middle() - innerHeight / 2);
    return line().left >= 0 && line().right <= innerWidth &&
      [line().left + 2, line().right - 2].every(
        x => document.elementFromPoint(x, middle()) === one);
  });
})"""
"""Whether each line of the elements with these ids can be seen: not cut, and nothing lies over it.
"""


def reset_screen(browser):
    """Take back what ``set_screen`` did."""
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def axe():
    """Return the source of axe-core; skip the test where it is not installed, and say so."""
    found = importlib.util.find_spec("axe_core_python")
    if found is None:
        pytest.skip("no axe-core here: pip install axe-core-python")
    with open(os.path.join(os.path.dirname(found.origin), "axe.min.js"), encoding="utf-8") as file:
        return file.read()


RUN_AXE = """
axe.run(document, {rules: {"label-content-name-mismatch": {enabled: true}}})
  .then(found => arguments[0]({violations: found.violations, passes: found.passes.map(each => each.id)}))"""
SMALL_TARGETS = """
return [...document.querySelectorAll("a, button, select, input")].filter(one => one.offsetParent
    && getComputedStyle(one).display !== "inline" && Math.min(one.offsetWidth, one.offsetHeight) < 24)
  .map(one => one.id || one.className || one.outerHTML)"""


def findings(browser, source):
    """Return what axe-core finds on the page, rule and places, and what is too small to be hit (a
    rule that this axe-core does not have: WCAG 2.5.8, which leaves out links in a text)."""
    browser.execute_script("if (!window.axe) (0, eval)(arguments[0])", source)
    result = browser.execute_async_script(RUN_AXE)
    assert "color-contrast" in result["passes"]  # it has looked
    small = browser.execute_script(SMALL_TARGETS)
    return [(found["id"], [(node["target"], node["failureSummary"]) for node in found["nodes"]][:3])
            for found in result["violations"]] + [("target-size", each) for each in small[:3]]
