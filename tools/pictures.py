"""Make the pictures of the documents: ``make pictures`` runs the lab tour and takes each from that
run; those of the tutorial are drawn from its steps.

docs/pictures/made_from.json keeps for each picture a digest of the files that decide what it shows;
a test names a picture that is older than they are.
"""
import base64
import glob
import hashlib
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any, Dict, Iterable, List, Tuple

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, "tools"), os.path.join(ROOT, "test", "rostest")]
import tutorial  # noqa: E402
from free_ports import free_port  # noqa: E402

PICTURES = os.path.join(ROOT, "docs", "pictures")
MADE_FROM = os.path.join(PICTURES, "made_from.json")

MISSION = "data/lab_tour.xml"
ANIMATED = "tour.webp"
PAGE = (MISSION, "src/behavior_controller/viewer/page_files/*")
REPORT = PAGE + ("src/behavior_controller/viewer/report.py",
                 "src/behavior_controller/viewer/report_frame.py",
                 "src/behavior_controller/viewer/report_files/*")
SOURCES: Dict[str, Tuple[str, ...]] = {
    ANIMATED: PAGE, "page_1280.webp": PAGE, "page_800.webp": PAGE, "page_400.webp": PAGE,
    "report.webp": REPORT, "lab_tour.svg": (MISSION,), "lab_tour_unfolded.svg": (MISSION,)}
"""What decides what a picture shows: patterns of files."""

STEPS = {"tutorial_{}.svg".format(number): step for number, step in enumerate(tutorial.read(), 1)}
SOURCES.update({name: () for name in STEPS})

COLOURS = {
    'fill="gray"': 'fill="#ffffff"', 'fill="#333333"': 'fill="#14324f"',
    'fill="lawngreen"': 'fill="#ffffff"', 'fill="orange"': 'fill="#dcebf7"',
    'fill="cyan"': 'fill="#fff3c4"', 'fill="ghostwhite"': 'fill="#f2f5f8"',
    'fill="gold"': 'fill="#ffe08a"', 'stroke="black"': 'stroke="#56626e"',
    "Times,serif": "system-ui, DejaVu Sans, sans-serif"
}
"""Of py_trees' drawings: a leaf, a subtree and its name, a sequence, a fallback, a decorator, a
parallel, lines and letters; and the page's."""

SIZES = {"page_1280.webp": (1280, 800, 1.0, 80), "page_800.webp": (800, 1180, 1.0, 80),
         "page_400.webp": (400, 800, 1.0, 80), ANIMATED: (1600, 1000, 0.6, 40)}
"""Width and height of the window, scale and quality of the picture."""

TOUR = ("missionRuns:=1", "randomSeed:=1", "failureRate:=0", "plannedFaults:=gestureExecution:2",
        "callTimes:=real")
"""The tour of the pictures: with one failure, and calls that take their time."""

STILL_AT = 0.6  # of the tour
FRAMES = 7
FRAME, LAST_FRAME = 1800, 4000  # ms
START_LIMIT = 60.0  # seconds


def digest(picture: str) -> str:
    """Return a digest of the files that decide what a picture shows."""
    content = hashlib.sha256(STEPS[picture].mission.encode() if picture in STEPS else b"")
    for path in sorted(path for pattern in SOURCES[picture]
                       for path in glob.glob(os.path.join(ROOT, pattern))):
        if os.path.isfile(path):
            with open(path, "rb") as file:
                content.update(file.read())
    return content.hexdigest()


def outdated() -> List[str]:
    """Return the pictures that are missing, or older than what they show."""
    with open(MADE_FROM, encoding="utf-8") as file:
        made_from = json.load(file)
    return [name for name in SOURCES if made_from.get(name) != digest(name) or not os.path.isfile(
        os.path.join(PICTURES, name))]


def main() -> None:
    """Make every picture."""
    sys.path.insert(0, os.path.join(ROOT, "test", "support"))
    from browser import open_browser
    os.makedirs(PICTURES, exist_ok=True)
    browser = open_browser()
    try:
        with tempfile.TemporaryDirectory(prefix="tour_") as scratch:
            # the report shows where the record is
            os.environ["ROS_HOME"] = os.path.join(scratch, "ros")
            draw(scratch, "lab_tour.svg", {"mission": "lab_tour"}, "-l", "big_picture")
            draw(scratch, "lab_tour_unfolded.svg", {"mission": "lab_tour"})
            draw_steps(scratch)
            take_pages(browser, scratch)
            take_report(browser, scratch)
    finally:
        browser.quit()
    with open(MADE_FROM, "w", encoding="utf-8") as file:
        file.write(json.dumps({name: digest(name) for name in SOURCES}, indent=1) + "\n")


def draw(scratch: str, picture: str, shown: Dict[str, str], *options: str) -> None:
    """Draw a mission, or a tree of it."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        subprocess.run(["py-trees-render", *options, "--kwargs", json.dumps(shown),
                        "behavior_controller.cli.create_tree"],
                       cwd=folder, stdout=subprocess.DEVNULL, check=True)
        drawn, = glob.glob(os.path.join(folder, "*.svg"))
        with open(drawn, encoding="utf-8") as file:
            drawing = file.read()
    for theirs, ours in COLOURS.items():
        drawing = drawing.replace(theirs, ours)
    write(picture, drawing.encode("utf-8"))


def draw_steps(scratch: str) -> None:
    """Draw the tree of each step of the tutorial."""
    for name, step in STEPS.items():
        shown = {"mission": tutorial.write_mission(step, scratch)}
        if step.tree != tutorial.MAIN:
            shown["subtree"] = step.tree
        draw(scratch, name, shown, "-l", "big_picture")


# ----------------------------------------------------------------------------------------- the page


def take_pages(browser: Any, scratch: str) -> None:
    """Run the tour; write the pictures of its page, and the record to the folder ``scratch``."""
    port, log = free_port(), os.path.join(scratch, "output.log")
    command = ["rosrun", "unit_tests", "runTest", "mission:=lab_tour", *TOUR, "groot2Port:=0",
               f"monitorPort:={port}", f"recordDirectory:={os.path.join(scratch, 'record')}"]
    with open(log, "w") as output:
        test = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    try:
        rounds = list(rounds_of(browser, port))
        if test.wait(START_LIMIT) or not rounds:
            with open(log, encoding="utf-8", errors="replace") as output:
                sys.exit(output.read() +
                         "pictures: the tour did not pass: no picture of the page was taken")
    finally:
        if test.poll() is None:
            test.terminate()
            test.wait()
    pictures = [each for each, _ in rounds]
    for name, picture in pictures[int(len(rounds) * STILL_AT)].items():
        if name != ANIMATED:
            write(name, picture)
    failed = next(n for n, (_, is_ill) in enumerate(rounds) if is_ill)
    shown = {round(n * (len(rounds) - 1) / (FRAMES - 1)) for n in range(FRAMES)}
    width, height, scale, _ = SIZES[ANIMATED]
    write(ANIMATED, animation(
        [pictures[n][ANIMATED] for n in sorted(shown | {failed, failed + 1})],
        round(width * scale), round(height * scale)))


def rounds_of(browser: Any, port: int) -> Iterable[Tuple[Dict[str, bytes], bool]]:
    """Yield a picture of each size, and whether a failure is on it, until the mission has ended.
    """
    ends = time.monotonic() + START_LIMIT
    while not answers(port):
        if time.monotonic() > ends:
            return
        time.sleep(0.1)
    browser.get(f"http://127.0.0.1:{port}/")
    while True:
        pictures = {name: screenshot(browser, *size) for name, size in SIZES.items()}
        if not answers(port):
            return
        yield pictures, browser.execute_script(TROUBLE)


TROUBLE = "return document.querySelector('#transcript .warning, #transcript .error') !== null"


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
    subprocess.run(["rosrun", "cssr_system", "replayMission", "--report", page, os.path.join(
        scratch, "record")], stdout=subprocess.DEVNULL, check=True)
    browser.get("file://" + page)
    write("report.webp", screenshot(browser, 1280, 800, 1.0, 80))


def screenshot(browser: Any, width: int, height: int, scale: float, quality: int) -> bytes:
    """Return a picture of what the browser shows in a window of that size, as WebP."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": scale, "mobile": False})
    # drawn for this size: two frames have passed
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    taken = browser.execute_cdp_cmd("Page.captureScreenshot",
                                    {"format": "webp", "quality": quality})
    return base64.b64decode(taken["data"])


def write(picture: str, content: bytes) -> None:
    """Write a picture."""
    with open(os.path.join(PICTURES, picture), "wb") as file:
        file.write(content)
    print(f"written: docs/pictures/{picture}, {len(content) / 1000:.0f} KB")


# ---------------------------------------------------------------------- WebP's container (RFC 9649)


def animation(pictures: List[bytes], width: int, height: int) -> bytes:
    """Return an endless animation of WebP pictures of one size; what is the same twice in a row is
    one frame."""
    frames = [picture for n, picture in enumerate(pictures) if n == 0 or picture != pictures[n - 1]]
    size = _three(width - 1) + _three(height - 1)
    content = _chunk(b"VP8X", b"\x02\0\0\0" + size) + _chunk(b"ANIM", b"\xff\xff\xff\xff\0\0")
    for n, picture in enumerate(frames):
        milliseconds = LAST_FRAME if n == len(frames) - 1 else FRAME
        content += _chunk(b"ANMF",
                          b"\0" * 6 + size + _three(milliseconds) + b"\x02" + _image(picture))
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
