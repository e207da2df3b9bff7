"""Make the pictures of the documents: ``make pictures`` runs the lab tour and takes each from that run.

docs/pictures/made_from.json keeps for each picture a digest of the files that decide what it shows; a test names a picture
that is older than they are.
"""
import base64
import glob
import hashlib
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any, Dict, Iterable, List, Tuple

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PICTURES = os.path.join(ROOT, "docs", "pictures")
MADE_FROM = os.path.join(PICTURES, "made_from.json")

MISSION = "data/lab_tour.xml"
ANIMATED = "tour.webp"
PAGE = (MISSION, "src/behavior_controller/watch/page_files/*")
REPORT = (MISSION, "src/behavior_controller/watch/report*", "src/behavior_controller/watch/report*/*",
          "src/behavior_controller/watch/page_files/colours.css", "src/behavior_controller/watch/page_files/common.js")
SOURCES: Dict[str, Tuple[str, ...]] = {
    ANIMATED: PAGE, "page_1280.webp": PAGE, "page_800.webp": PAGE, "page_400.webp": PAGE,
    "report.webp": REPORT, "lab_tour.svg": (MISSION,), "lab_tour_unfolded.svg": (MISSION,)}
"""What decides what a picture shows: patterns of files."""

SIZES = {"page_1280.webp": (1280, 800), "page_800.webp": (800, 1180), "page_400.webp": (400, 800), ANIMATED: (800, 480)}
STILL_AT = 0.6  # of the tour
FRAMES = 10  # at most
FRAME, LAST_FRAME = 1800, 4000  # ms
START_LIMIT = 60.0  # seconds
QUALITY = 80


def digest(picture: str) -> str:
    """Return a digest of the files that decide what a picture shows."""
    content = hashlib.sha256()
    for path in sorted(path for pattern in SOURCES[picture] for path in glob.glob(os.path.join(ROOT, pattern))):
        if os.path.isfile(path):
            with open(path, "rb") as file:
                content.update(file.read())
    return content.hexdigest()


def outdated() -> List[str]:
    """Return the pictures that are missing, or older than what they show."""
    with open(MADE_FROM, encoding="utf-8") as file:
        made_from = json.load(file)
    return [name for name in SOURCES
            if made_from.get(name) != digest(name) or not os.path.isfile(os.path.join(PICTURES, name))]


def main() -> None:
    """Make every picture."""
    sys.path.insert(0, os.path.join(ROOT, "test", "unit"))
    from browser import open_browser
    os.makedirs(PICTURES, exist_ok=True)
    browser = open_browser()
    try:
        with tempfile.TemporaryDirectory(prefix="tour_") as scratch:
            os.environ["ROS_HOME"] = os.path.join(scratch, "ros")  # the report shows where the record is
            draw(scratch, "lab_tour.svg", "-l", "big_picture")
            draw(scratch, "lab_tour_unfolded.svg")
            take_pages(browser, scratch)
            take_report(browser, scratch)
    finally:
        browser.quit()
    with open(MADE_FROM, "w", encoding="utf-8") as file:
        file.write(json.dumps({name: digest(name) for name in SOURCES}, indent=1) + "\n")


def draw(scratch: str, picture: str, *options: str) -> None:
    """Draw the mission."""
    subprocess.run(["py-trees-render", *options, "--kwargs", '{"mission": "lab_tour"}', "behavior_controller.cli.create_tree"],
                   cwd=scratch, stdout=subprocess.DEVNULL, check=True)
    shutil.copy(os.path.join(scratch, "lab_tour.svg"), os.path.join(PICTURES, picture))


# ------------------------------------------------------------------------------------------------------------- the page


def take_pages(browser: Any, scratch: str) -> None:
    """Run the tour; write the pictures of its page, and the record to the folder ``scratch``."""
    port, log = free_port(), os.path.join(scratch, "output.log")
    command = ["rosrun", "unit_tests", "runTest", "mission:=lab_tour", "missionRuns:=1", "randomSeed:=1", "groot2Port:=0",
               "monitorPort:={}".format(port), "recordDirectory:={}".format(os.path.join(scratch, "record"))]
    with open(log, "w") as output:
        test = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    try:
        rounds = list(rounds_of(browser, port))
        if test.wait(START_LIMIT) or not rounds:
            with open(log, encoding="utf-8", errors="replace") as output:
                sys.exit(output.read() + "pictures: the tour did not pass: no picture of the page was taken")
    finally:
        if test.poll() is None:
            test.terminate()
            test.wait()
    for name, picture in rounds[int(len(rounds) * STILL_AT)].items():
        if name != ANIMATED:
            write(name, picture)
    shown = sorted({round(n * (len(rounds) - 1) / (FRAMES - 1)) for n in range(FRAMES)})
    write(ANIMATED, animation([rounds[n][ANIMATED] for n in shown], *SIZES[ANIMATED]))


def rounds_of(browser: Any, port: int) -> Iterable[Dict[str, bytes]]:
    """Yield a picture of each size, again and again until the mission has ended."""
    ends = time.monotonic() + START_LIMIT
    while not answers(port):
        if time.monotonic() > ends:
            return
        time.sleep(0.1)
    browser.get("http://127.0.0.1:{}/".format(port))
    while True:
        pictures = {name: screenshot(browser, *size) for name, size in SIZES.items()}
        if not answers(port):
            return
        yield pictures


def answers(port: int) -> bool:
    """Whether the page is served."""
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True


def take_report(browser: Any, scratch: str) -> None:
    """Write the picture of the report of the run whose record is in ``scratch``."""
    page = os.path.join(scratch, "report.html")
    subprocess.run(["rosrun", "cssr_system", "replayMission", "--report", page, os.path.join(scratch, "record")],
                   stdout=subprocess.DEVNULL, check=True)
    browser.get("file://" + page)
    write("report.webp", screenshot(browser, 1280, 800))


def screenshot(browser: Any, width: int, height: int) -> bytes:
    """Return a picture of what the browser shows in a window of that size, as WebP."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})
    # drawn for this size: two frames have passed
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    taken = browser.execute_cdp_cmd("Page.captureScreenshot", {"format": "webp", "quality": QUALITY})
    return base64.b64decode(taken["data"])


def write(picture: str, content: bytes) -> None:
    """Write a picture."""
    with open(os.path.join(PICTURES, picture), "wb") as file:
        file.write(content)
    print("written: docs/pictures/{}, {:.0f} KB".format(picture, len(content) / 1000))


def free_port() -> int:
    """Return a port that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


# ------------------------------------------------------------------------------------------ WebP's container (RFC 9649)


def animation(pictures: List[bytes], width: int, height: int) -> bytes:
    """Return an endless animation of WebP pictures of one size; what is the same twice in a row is one frame."""
    frames = [picture for n, picture in enumerate(pictures) if n == 0 or picture != pictures[n - 1]]
    size = _three(width - 1) + _three(height - 1)
    content = _chunk(b"VP8X", b"\x02\0\0\0" + size) + _chunk(b"ANIM", b"\xff\xff\xff\xff\0\0")
    for n, picture in enumerate(frames):
        milliseconds = LAST_FRAME if n == len(frames) - 1 else FRAME
        content += _chunk(b"ANMF", b"\0" * 6 + size + _three(milliseconds) + b"\x02" + _image(picture))
    return _chunk(b"RIFF", b"WEBP" + content)


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)


def _three(number: int) -> bytes:
    return struct.pack("<I", number)[:3]


def _image(picture: bytes) -> bytes:
    """Return the chunk of a still picture that holds the image."""
    at = 12
    while picture[at:at + 4] not in (b"VP8 ", b"VP8L"):
        length, = struct.unpack_from("<I", picture, at + 4)
        at += 8 + length + length % 2
    length, = struct.unpack_from("<I", picture, at + 4)
    return _chunk(picture[at:at + 4], picture[at + 8:at + 8 + length])


if __name__ == "__main__":
    main()
