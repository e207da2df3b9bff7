"""Make the pictures of the documents: ``make pictures`` runs the lab tour and takes each from that
run; those of the tutorial are drawn from its steps.

docs/pictures/made_from.json keeps for each picture a digest of the files that decide what it shows;
a test names a picture that is older than they are.
"""
import base64
import glob
import hashlib
import html
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from typing import Any, Dict, Iterable, List, Tuple

from behavior_controller.config import settings
from behavior_controller.run.events import HealthChanged, Line, SignOfLife
from behavior_controller.run.record.recorder import LineQueue
from behavior_controller.simulation.configuration import REAL
from behavior_controller.simulation.faults import CRASH, PlannedFault
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission
from behavior_controller.viewer.board import Board
from behavior_controller.viewer.status_tool import fitted
from behavior_controller.viewer.web_page import Page

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, *folder) for folder in (["tools"], ["test", "rostest"],
                                                           ["test", "support"])]
import tutorial  # noqa: E402
from browser import open_browser  # noqa: E402
from free_ports import free_port  # noqa: E402
from page_rig import wait_until  # noqa: E402
from recorded_tours import record_simulated_runs  # noqa: E402

PICTURES = os.path.join(ROOT, "docs", "pictures")
MADE_FROM = os.path.join(PICTURES, "made_from.json")

MISSION = "data/lab_tour.xml"
ANIMATED = "tour.webp"
PAGE = (MISSION, "src/behavior_controller/viewer/page_files/*")
REPORT = PAGE + ("src/behavior_controller/viewer/report.py",
                 "src/behavior_controller/viewer/report_frame.py",
                 "src/behavior_controller/viewer/report_files/*")
SOURCES: Dict[str, Tuple[str, ...]] = {
    ANIMATED: PAGE, "page.webp": PAGE, "page_phone.webp": PAGE, "dead_node.webp": PAGE,
    "stale.webp": PAGE, "runs.webp": PAGE, "report.webp": REPORT, "verdict.webp": REPORT,
    "rehearsal.webp": ("src/behavior_controller/simulation/rehearsal/report_files/*",
                       "src/behavior_controller/viewer/page_files/style.css"),
    "terminal.webp": ("src/behavior_controller/viewer/status_tool.py",),
    "lab_tour.svg": (MISSION,)}
"""What decides what a picture shows: patterns of files."""

STEPS = {"tutorial_{}.svg".format(number): step for number, step in enumerate(tutorial.read(), 1)}
SOURCES.update({name: () for name in STEPS})

LOOK = (
    (r' #\d+"(?=, shape)', '"'), (r'(label="[^"]+) (\(\w+\)")', r"\1\n\2"),
    (r"shape=(ellipse|octagon), style=filled", 'shape=box, style="filled,rounded"'),
    ("=gray,", '="#ffffff",'), ("=gray20", '="#14324f"'), ("=lawngreen", '="#ffffff"'),
    ("=orange", '="#dcebf7"'), ("=cyan", '="#fff3c4"'), ("=gold", '="#ffe08a"'),
    ("=ghostwhite", '="#f2f5f8"'), ("times-roman", "DejaVu Sans"))
"""Patterns in py_trees' drawings, and what takes their place: no number, the type in a line of its
own, rounded boxes, and the page's colours for a leaf, a subtree and its name, a sequence, a
fallback, a parallel and a decorator."""

NARROW = ("-Nmargin=0.07,0.05", "-Nheight=0.3", "-Nwidth=0.3", "-Gnodesep=0.1", "-Granksep=0.3",
          "-Gpad=0.04", "-Ncolor=#56626e", "-Ecolor=#56626e", "-Earrowsize=0.6")
"""Options of dot, so that a tree can be read in a document's column of 830 px."""

Size = Tuple[int, int, float, int]
"""Width and height of the window, scale and quality of the picture."""

HIGH, WIDE, MOVING = (1000, 900, 0.83, 80), (1000, 700, 0.83, 80), (1000, 600, 0.83, 50)
LOW, PHONE = (830, 400, 1.0, 80), (380, 760, 1.0, 80)

TOUR = ("missionRuns:=1", "randomSeed:=1", "failureRate:=0", "plannedFaults:=gestureExecution:2",
        "callTimes:=real")
"""The tour of the pictures: with one failure, and calls that take their time."""

STILL_AT = 4  # the stop at which the page is taken
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
    browser = open_browser()
    try:
        with tempfile.TemporaryDirectory(prefix="tour_") as scratch:
            # the report shows where the record is
            os.environ["ROS_HOME"] = os.path.join(scratch, "ros")
            os.chdir(scratch)
            draw(scratch, "lab_tour.svg", {"mission": "lab_tour"})
            draw_steps(scratch)
            take_dead_node(browser, scratch)
            take_runs(browser, scratch)
            take_rehearsal(browser, scratch)
            take_pages(browser, scratch)
    finally:
        browser.quit()
    with open(MADE_FROM, "w", encoding="utf-8") as file:
        file.write(json.dumps({name: digest(name) for name in SOURCES}, indent=1) + "\n")


def draw(scratch: str, picture: str, shown: Dict[str, str], *looks: Tuple[str, str]) -> None:
    """Draw a mission, or a tree of it, with its subtrees folded."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        subprocess.run(["py-trees-render", "-l", "big_picture", "--kwargs", json.dumps(shown),
                        "behavior_controller.cli.create_tree"],
                       cwd=folder, stdout=subprocess.DEVNULL, check=True)
        drawn, = glob.glob(os.path.join(folder, "*.dot"))
        with open(drawn, encoding="utf-8") as file:
            drawing = file.read()
    for theirs, ours in LOOK + looks:
        drawing = re.sub(theirs, ours, drawing)
    write(picture, subprocess.run(["dot", "-Tsvg", *NARROW], input=drawing.encode(),
                                  stdout=subprocess.PIPE, check=True).stdout)


def draw_steps(scratch: str) -> None:
    """Draw the tree of each step of the tutorial; of its first node the type is shown, too."""
    for name, step in STEPS.items():
        shown = {"mission": tutorial.write_mission(step, scratch)}
        if step.tree != tutorial.MAIN:
            shown["subtree"] = step.tree
        first = re.search(rf'<BehaviorTree ID="{step.tree}">\s*<(\w+)', step.mission)
        assert first
        draw(scratch, name, shown, ("label=(?:reception|{}),".format(step.tree),
                                    rf'label="{step.tree}\\n({first[1]})",'))


# ----------------------------------------------------------------------------------------- the page


def take_pages(browser: Any, scratch: str) -> None:
    """Run the tour; write the pictures of its page, of its report and of the verdict."""
    port, log = free_port(), os.path.join(scratch, "output.log")
    command = ["rosrun", "unit_tests", "runTest", "mission:=lab_tour", *TOUR, "groot2Port:=0",
               f"monitorPort:={port}", f"recordDirectory:={os.path.join(scratch, 'record')}"]
    with open(log, "w") as output:
        test = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    try:
        rounds = list(rounds_of(browser, port))
        has_failed = test.wait(START_LIMIT)
        with open(log, encoding="utf-8", errors="replace") as output:
            told = output.read()
        if has_failed or not rounds:
            sys.exit(told + "pictures: the tour did not pass: no picture of the page was taken")
    finally:
        if test.poll() is None:
            test.terminate()
            test.wait()
    failed = next(n for n, (_, is_ill) in enumerate(rounds) if is_ill)
    shown = {round(n * (len(rounds) - 1) / (FRAMES - 1)) for n in range(FRAMES)}
    width, height, scale, _ = MOVING
    write(ANIMATED, animation([rounds[n][0] for n in sorted(shown | {failed, failed + 1})],
                              round(width * scale), round(height * scale)))
    take(browser, "verdict.webp", re.findall(r"the report as a page: (\S+)", told)[-1], WIDE)
    page = os.path.join(scratch, "report.html")
    subprocess.run(["rosrun", "cssr_system", "replayMission", "--report", page, os.path.join(
        scratch, "record")], stdout=subprocess.DEVNULL, check=True)
    take(browser, "report.webp", "file://" + page, WIDE)


def rounds_of(browser: Any, port: int) -> Iterable[Tuple[bytes, bool]]:
    """Yield a picture of the page again and again, and whether a failure is on it, from the robot's
    first words until the mission has ended; meanwhile write the other pictures of the page."""
    ends = time.monotonic() + START_LIMIT
    while not answers(port):
        if time.monotonic() > ends:
            return
        time.sleep(0.1)
    address, is_still_taken = f"http://127.0.0.1:{port}/", False
    show(browser, address, MOVING, HAS_SPOKEN)
    while True:
        picture = screenshot(browser, *MOVING)
        if not answers(port):
            return
        yield picture, browser.execute_script(TROUBLE)
        if not is_still_taken and browser.execute_script(STOPS) == STILL_AT:
            is_still_taken = True
            take(browser, "page.webp", address, HIGH, HAS_SPOKEN)
            take(browser, "page_phone.webp", address, PHONE, HAS_SPOKEN)
            show(browser, address, MOVING, HAS_SPOKEN)


HAS_SPOKEN = "return document.getElementById('transcript').textContent.includes('said')"
STOPS = "return document.getElementById('stops').childElementCount"
TROUBLE = "return document.querySelector('#transcript .warning, #transcript .error') !== null"


def answers(port: int) -> bool:
    """Whether the page is served."""
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True


def take_dead_node(browser: Any, scratch: str) -> None:
    """Play a tour in which a node dies; write the pictures of page and terminal then, and of the
    page when the controller hangs."""
    test = replace(CALM, call_times=REAL,
                   planned_faults=(PlannedFault("robotNavigation", 3, CRASH),))
    played = LoadedMission(settings.defaults()).play(test).events
    died = next(at for at, event in played if isinstance(event, HealthChanged))
    ahead = time.time() - died - 1.0
    lines, port = LineQueue(), free_port()
    for at, event in played:
        if at < died + 1.0:
            lines.put(Line(at + ahead, event))
    page = Page("127.0.0.1", port, Board(lines.take), sys.exit)
    try:
        take(browser, "dead_node.webp", f"http://127.0.0.1:{port}/", PHONE,
             "return document.getElementById('instruction').textContent")
        shown = subprocess.run(["rosrun", "cssr_system", "missionStatus", "--port", str(port)],
                               stdout=subprocess.PIPE, check=True).stdout.decode().splitlines()
        lines.put(Line(time.time(), SignOfLife({})))
        take(browser, "stale.webp", browser.current_url, LOW,
             "return document.body.classList.contains('stale')")
    finally:
        page.close()
    terminal = os.path.join(scratch, "terminal.html")
    with open(terminal, "w", encoding="utf-8") as file:
        file.write(TERMINAL.format(html.escape("\n".join(fitted(shown, *WINDOW)))))
    take(browser, "terminal.webp", "file://" + terminal, LOW)


TERMINAL = """<meta charset="utf-8"><style>body {{ margin: 0; background: #1b232c }}
pre {{ margin: 0; padding: 12px; color: #e6ebf0; font: 14px/1.35 DejaVu Sans Mono }}</style>
<pre>{}</pre>"""

WINDOW = (95, 21)
"""Columns and rows of the terminal."""


def take_runs(browser: Any, scratch: str) -> None:
    """Write the picture of the list of runs."""
    folder, port = os.path.join(scratch, "runs"), free_port()
    record_simulated_runs(folder, 30)
    page = Page("127.0.0.1", port, Board(lambda: ()), sys.exit, folder)
    try:
        take(browser, "runs.webp", f"http://127.0.0.1:{port}/runs.html", WIDE,
             "return document.getElementById('figures').textContent.endsWith(' 30 runs')")
    finally:
        page.close()


def take_rehearsal(browser: Any, scratch: str) -> None:
    """Write the picture of what a rehearsal finds in the tutorial's ninth step."""
    mission = os.path.basename(tutorial.write_mission(STEPS["tutorial_9.svg"], scratch))
    page = os.path.join(scratch, "rehearsal.html")
    subprocess.run(["rosrun", "cssr_system", "rehearseMission", mission, "--faults", "none",
                    "--html", page], stdout=subprocess.DEVNULL, check=False)
    take(browser, "rehearsal.webp", "file://" + page, WIDE)


def show(browser: Any, address: str, size: Size, is_there: str = "return true") -> None:
    """Open a page, and wait until a script says that it shows what is wanted."""
    screenshot(browser, *size)  # a page that was smaller would keep where it has scrolled to
    browser.get(address)
    wait_until(lambda: browser.execute_script(is_there), START_LIMIT)


def take(browser: Any, picture: str, address: str, size: Size,
         is_there: str = "return true") -> None:
    """Show a page, and write its picture."""
    show(browser, address, size, is_there)
    write(picture, screenshot(browser, *size))


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
