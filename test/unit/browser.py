"""A headless browser for the tests of what people see."""
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
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
                     "--window-size={},{}".format(width, height)):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    from selenium.webdriver.chrome.service import Service
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
