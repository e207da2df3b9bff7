"""Long trials of an adversary: how the mission survives the worst faults around it."""
import contextlib
import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request
import xmlrpc.client
from functools import partial
from pathlib import Path

import rosgraph

from behavior_controller.run.events import Asked
from behavior_controller.folders import RECORDS
from behavior_controller.run.record.files import is_written, runs
from behavior_controller.run.record.reader import read_record
from behavior_controller.robot.requests import GoTo

import drawn_trials
from faulty_master import FaultyMaster
from link_trials import (
    DEATH_LIMIT, PATIENCE, TOLD_LIMIT, cut, cut_while_it_starts, lab_tour, when_dead)
from robot import free_ports, registrations, start_master
from tour_model import DRIVE
from trial import GONE, STOP_LIMIT, longest_gap, sleep_until, when

NODE = "/behaviorController"
DRIVE_DEADLINE = 10.0  # s
A_TOUR = 40.0  # s, in which one ends on a loaded computer; alone it takes a few
A_START = 20.0  # s
HEARTBEAT = 10.0  # s
FEW_DESCRIPTORS = 1024  # the default limit of a process
GONE_AFTER = 5.0  # s without a request after which the hooks of a client of Groot2 are removed
GROOT2 = """import json, struct, sys, time, zmq
client = zmq.Context().socket(zmq.REQ)
client.connect("tcp://127.0.0.1:" + sys.argv[1])
def ask(kind, *payload):
    client.send_multipart([struct.pack("<BBI", 2, ord(kind), 1), *payload])
    return client.recv_multipart()
hooks = [dict(enabled=True, uid=uid, mode=0, once=False, desired_status="SKIPPED", position=0)
         for uid in range(1, 4)]
if sys.argv[2:]:
    ask("I", json.dumps(hooks).encode())
while True:
    ask("S")
    time.sleep(0.03)"""
WAITING = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence><START_OF_TREE/>
<ReactiveFallback><AlwaysFailure/><Sleep msec="600000"/></ReactiveFallback></Sequence></BehaviorTree></root>"""
JUMPING_CLOCK = """import time
unset = time.time
def jumping():
    with open({!r}) as file:
        return unset() + float(file.read() or 0)
time.time = jumping
"""
BESIDE = [("rosrun", "unit_tests", "runTest"), ("rosrun", "unit_tests", "textToSpeech")
          ] + [("roslaunch", "unit_tests", launch)
               for launch in ("behaviorControllerTest.launch", "simulatedRobot.launch")]
REPOSITORY = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
USERS_PACKAGE = {
    "package.xml": """<package format="2"><name>mine</name><version>1.0.0</version><description>a package
</description><maintainer email="a@example.org">a</maintainer><license>BSD</license>
<buildtool_depend>catkin</buildtool_depend></package>""",
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.5)
project(mine)
find_package(catkin REQUIRED)
catkin_package()
install(DIRECTORY unit_tests cssr_system DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(PROGRAMS report DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})""",
    "report": "#!/bin/sh", "unit_tests/mine": "", "cssr_system/mine": ""}
WRONG_WORDS = ("_missionRuns:=many", "missionRuns:=1", "_topicMaxAge:=-1", "__name:=a/b", "--now",
               "_scenarioSpecification:=absent", "_language:=Klingon", "_missionRun:=1")


# --------------------------------------------------------------------------------------- the trials


def frozen_master(trial, seconds):
    """The master freezes while the robot drives: tours go on, deadlines are kept, and the node can
    be stopped."""
    master, robot = surroundings(trial)
    trial.package.write("data/waiting.xml", WAITING)
    trial.package.configure(verboseMode="true", robotNavigationDeadline=DRIVE_DEADLINE)
    trial.allow_several_controllers()
    tours, waits = trial.node(), trial.node("__name:=waits", "_scenarioSpecification:=waiting")
    see_tours(trial, tours, 1)
    began = hang_a_drive(trial, robot, tours, lambda: master.send_signal(signal.SIGSTOP))
    trial.within("said after", when(waits, GONE.pattern, began, PATIENCE), TOLD_LIMIT)
    see_tours(trial, tours, 3)
    sleep_until(began + seconds - 5.0)
    trial.within("between two heartbeats", longest_gap(tours, r"running\. ", began,
                                                       time.monotonic()), HEARTBEAT + 1.0)
    trial.stop(tours, robot, "while it is frozen")
    sleep_until(began + seconds)
    master.send_signal(signal.SIGCONT)
    trial.within("answers again said after",
                 when(waits, "master .* again", time.monotonic(), PATIENCE), TOLD_LIMIT)
    trial.stop(waits, robot, "at the end")


def new_master(trial):
    """A new roscore knows none of the nodes that run: tours go on, a line reports the new master,
    and all that the node had registered is registered again."""
    master, robot = surroundings(trial)
    trial.package.configure(verboseMode="true", robotNavigationDeadline=DRIVE_DEADLINE,
                            rosInterface="true")
    tours = trial.node()
    see_tours(trial, tours, 1)
    before = registrations(NODE)
    end(master)
    see_tours(trial, tours, 1)
    time.sleep(TOLD_LIMIT)  # the messages about the old one are over
    trial.process("rosmaster", "--core", "-p", os.environ["ROS_MASTER_URI"].rpartition(":")[2])
    started = time.monotonic()
    trial.within("a new master is said after", when(tours, r"master .*\bnew\b", started, PATIENCE),
                 TOLD_LIMIT)
    after = registrations(NODE)
    trial.times.append("{} registrations".format(len(after)))
    trial.require(NODE + "/stop" in before == after, "before {}, after {}".format(before, after))
    hang_a_drive(trial, robot, tours)  # the calls after it need a new connection
    see_tours(trial, tours, 3)
    trial.stop(tours, robot, "at the end")


def garbled_master(trial, seconds):
    """The master answers garbage while the robot's nodes are killed and started again: then all of
    them are found."""
    robot = surroundings(trial)[1]
    trial.package.configure(verboseMode="true")
    master = FaultyMaster(os.environ["ROS_MASTER_URI"], trial.draw)
    tours = trial.node(ROS_MASTER_URI=master.uri)
    see_tours(trial, tours, 1)
    began = time.monotonic()
    master.is_garbled = True
    trial.within("garbage said after", when(tours, "master .* as ROS does", began, PATIENCE),
                 TOLD_LIMIT)
    see_tours(trial, tours, 1)
    robot.kill()
    trial.within("death", when_dead(tours, time.monotonic()), DEATH_LIMIT)
    robot = trial.robot()
    sleep_until(began + seconds)
    master.is_garbled = False
    trial.within("answers again said after",
                 when(tours, "master .* answers again", time.monotonic(), PATIENCE), TOLD_LIMIT)
    trial.within("visit over", when(tours, r"pass \d+: ", time.monotonic(), A_TOUR), A_TOUR)
    see_tours(trial, tours, 1)
    trial.stop(tours, robot, "at the end")


def flood(trial, count):
    """Idle connections to the ports for Groot2 and browsers cost the robot nothing, and the page
    works again after them."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 4 * count)), hard))
    groot2_port, page_port = free_ports()
    robot = surroundings(trial)[1]
    trial.package.configure(verboseMode="true", groot2Port=groot2_port, monitorPort=page_port,
                            robotNavigationDeadline=DRIVE_DEADLINE)
    tours = trial.node()
    tours.lines.wait_for(lambda line: " page: " in line, A_START)
    processes = tours.process.pid, tours.viewer()
    for process in processes:
        resource.prlimit(process, resource.RLIMIT_NOFILE, (FEW_DESCRIPTORS, FEW_DESCRIPTORS))
    see_tours(trial, tours, 1)
    idle = [
        connection for port in (page_port, groot2_port) for connection in connections(port, count)]
    hang_a_drive(trial, robot, tours)  # the calls after it need a new connection
    see_tours(trial, tours, 3)
    trial.require(tours.viewer() == processes[1], "the viewer was started again")
    trial.times.append("{} connections, {} and {} descriptors".format(len(idle), *(
        len(os.listdir("/proc/{}/fd".format(process))) for process in processes)))
    for connection in idle:
        connection.close()
    asked = time.monotonic()
    with urllib.request.urlopen("http://127.0.0.1:{}/".format(page_port), timeout=PATIENCE) as page:
        page.read()
    trial.within("page after", time.monotonic() - asked, TOLD_LIMIT)
    trial.stop(tours, robot, "at the end")


def nodes_killed(trial, rounds):
    """The robot's nodes and the controller are killed during a tour and started again: the next
    visitor gets a tour."""
    draw = trial.draw
    robot = surroundings(trial)[1]
    trial.package.configure()
    tours = trial.node()
    see_tours(trial, tours, 1)
    for number in range(rounds):
        time.sleep(draw.uniform(0.0, 3.0))
        robot.kill()
        killed = time.monotonic()
        trial.within("{}. death".format(number + 1), when_dead(tours, killed), DEATH_LIMIT)
        time.sleep(draw.uniform(0.0, 6.0))
        robot = trial.robot()
        trial.within("visit over", when(tours, r"pass \d+: ", time.monotonic(), A_TOUR), A_TOUR)
        see_tours(trial, tours, 1)
    tours.process.kill()
    tours = trial.node()
    see_tours(trial, tours, 1)
    trial.stop(tours, robot, "at the end")


def second_starts(trial, rounds):
    """A start that fails leaves the running node alone; of three good starts at once exactly one
    stays, and gives tours."""
    robot = surroundings(trial)[1]
    trial.package.configure()
    tours = trial.node()
    see_tours(trial, tours, 1)
    for number in range(rounds):
        failing = trial.node(trial.draw.choice(WRONG_WORDS))
        trial.require(failing.wait(A_START) == 2, "a wrong value is not refused")
        trial.require(tours.process.poll() is None,
                      "a start that failed has ended the running node")
        nodes = [tours]
        for _ in range(3):
            nodes.append(trial.node())
            time.sleep(trial.draw.choice((0.0, 0.0, 0.1, 0.5)))
        for node in nodes:
            node.lines.wait_for(re.compile(" starts, |another node").search, A_START)
        time.sleep(STOP_LIMIT)
        staying = [node for node in nodes if node.process.poll() is None]
        trial.require(len(staying) == 1,
                      "round {}: {} of {} nodes stay".format(number + 1, len(staying), len(nodes)))
        codes = {node.process.poll() for node in nodes if node not in staying}
        trial.require(codes == {0}, "round {}: exit codes {}".format(number + 1, codes))
        if not staying:
            return
        tours = staying[0]
    see_tours(trial, tours, 1)
    trial.stop(tours, robot, "at the end")


def tests_beside(trial):
    """A test and a simulated robot that are started beside a living mission displace none of its
    nodes: tours go on."""
    robot = surroundings(trial)[1]
    trial.package.configure()
    tours = trial.node()
    for command in trial.draw.sample(BESIDE, len(BESIDE)):
        see_tours(trial, tours, 1)
        done = subprocess.run(command, timeout=A_TOUR, stdout=subprocess.PIPE,
                              universal_newlines=True)
        trial.require("node /commanded_robot: " in done.stdout,
                      "{} does not name the robot's node".format(" ".join(command)))
    see_tours(trial, tours, 1)
    trial.stop(tours, robot, "at the end")


def clock_set(trial, seconds):
    """The computer's clock is set in a drive and while the mission waits: what a person has to do
    is said all the same, and the page shows now."""
    _, page_port = free_ports()
    robot = surroundings(trial)[1]
    shift = trial.package.path("shift")
    trial.package.write("shift", "0")
    trial.package.write("src/sitecustomize.py", JUMPING_CLOCK.format(shift))
    trial.package.configure(monitorPort=page_port, robotNavigationDeadline=DRIVE_DEADLINE,
                            recordDirectory=trial.package.path("record"))
    tours = trial.node()
    see_tours(trial, tours, 1)
    for jump in (seconds, 2 * seconds, 0):
        robot.set_mode(DRIVE, "hang")
        robot.wait_for_request(DRIVE, A_TOUR, start=len(robot.lines.all))
        trial.package.write("shift", str(jump))
        set_at = time.monotonic()
        robot.kill()
        trial.within("what to do said after", when(
            tours, "robot: .*Restart .*; take the robot home$", set_at, PATIENCE), HEARTBEAT + 2.0)
        trial.within("jump said after", when(tours, "the computer's clock jumped", set_at,
                                             PATIENCE), HEARTBEAT + 2.0)
        now = page_data(page_port, "state")["alive"]["at"]
        for moment in ("now", now):
            card = page_data(page_port, "at/{}".format(moment))["now"]["card"]
            trial.require(card["kind"] in ("wait", "paused"), "the page shows {}".format(card))
            trial.require(0.0 <= now - card["since"] < 2 * A_TOUR, "since {:.0f} s".format(
                now - card["since"]))
        robot = trial.robot()
        trial.within("visit over", when(tours, r"pass \d+: ", time.monotonic(), A_TOUR), A_TOUR)
        see_tours(trial, tours, 1)
    trial.stop(tours, robot, "at the end")
    with open(runs(trial.package.path("record"))[-1]) as file:
        times = [json.loads(line)["time"] for line in file]
    trial.require(times == sorted(times), "the times of the record go back")


def clock_set_back(trial, starts):
    """Runs under other names, several at once, with a clock that goes back: the record of a running
    node, the newest one and a user's folder stay."""
    place = os.path.join(trial.logs, RECORDS)
    os.makedirs(os.path.join(place, "latest"))
    kept = os.path.join(place, "latest", "mission.jsonl")
    Path(kept).write_text("a user's")
    surroundings(trial)
    trial.package.write("data/waiting.xml", WAITING)
    trial.package.configure(recordDirectory="", missionRuns=1, scenarioSpecification="short")
    trial.package.write("data/short.xml", WAITING.replace("<Sleep msec=\"600000\"/>",
                                                          "<WelcomeSpeech/>"))
    trial.allow_several_controllers()
    living = trial.node("__name:=waits", "_scenarioSpecification:=waiting")
    living.lines.wait_for(re.compile(" record: ").search, A_START)
    first, = runs(place)
    started = 1
    for number in range(starts):
        nodes = [trial.node(f"__name:=run_{number}_{other}", TZ=f"X{number}")
                 for other in range(trial.draw.choice((1, 1, 3)))]
        for node in nodes:
            trial.require(node.wait(A_START) == 0, node.lines.text())
        started += len(nodes)
        newest = [line.split(" record of this run: ")[1] for node in nodes
                  for line in node.lines.text().split("\n") if " record of this run: " in line]
        trial.require(runs(place)[-1] in newest, f"start {number + 1}: the newest run is another")
    trial.require(os.path.exists(first) and is_written(first), "the running node has no record")
    trial.require(len(runs(place)) == started, f"{len(runs(place))} records are kept")
    with open(kept) as file:
        trial.require(file.read() == "a user's", "the user's file has changed")
    found = subprocess.run(("rosrun", "cssr_system", "replayMission", "latest"), timeout=A_TOUR,
                           env=dict(os.environ, ROS_LOG_DIR=trial.logs), stdout=subprocess.PIPE)
    trial.require(found.returncode == 0, "the latest is no record")
    trial.times.append(f"{starts} starts")


def killed_with_one_directory(trial, rounds):
    """The node is killed in a drive and started again with the same recordDirectory: the record of
    each run is there, with the drive in it, and an earlier version's record is as it was."""
    place = os.path.join(trial.logs, "records")
    os.makedirs(place)
    earlier = os.path.join(place, "mission.jsonl")
    Path(earlier).write_text("earlier")
    robot = surroundings(trial)[1]
    trial.package.configure(recordDirectory=place)
    robot.set_mode(DRIVE, "hang")
    for _ in range(rounds):
        node = trial.node()
        robot.wait_for_request(DRIVE, A_TOUR, start=len(robot.lines.all))
        time.sleep(trial.draw.uniform(0.5, 2.0))
        node.process.kill()
        node.process.wait()
    drives = [sum(isinstance(line.event, Asked) and isinstance(line.event.request, GoTo)
                  for line in read_record(path)) for path in runs(place)]
    trial.require(len(drives) == rounds and all(drives), f"drives on record: {drives}")
    with open(earlier) as file:
        trial.require(file.read() == "earlier", "the earlier version's record has changed")
    robot.kill()
    refused = trial.node()
    trial.require(refused.wait(A_START) == 1, "a start without a robot is not refused")
    trial.require("still be driving to" in refused.lines.text(), "not said that it may still drive")


def breakpoint_of_the_dead(trial, rounds):
    """A client of Groot2 sets a breakpoint in the tour and is killed, while another one polls: the
    tours go on."""
    groot2_port, _ = free_ports()
    robot = surroundings(trial)[1]
    trial.package.configure(verboseMode="true", groot2Port=groot2_port)
    tours = trial.node()
    see_tours(trial, tours, 1)
    other = trial.process(sys.executable, "-c", GROOT2, str(groot2_port))
    for number in range(rounds):
        began = time.monotonic()
        dying = trial.process(sys.executable, "-c", GROOT2, str(groot2_port), "breakpoint")
        trial.within("{}. hold".format(number + 1),
                     when(tours, "robot: .*Release the breakpoint", began, A_TOUR), A_TOUR)
        # a stopped process keeps its connection
        dying.send_signal(trial.draw.choice((signal.SIGKILL, signal.SIGSTOP)))
        trial.within("released after", when(tours, "its client is gone", time.monotonic(), A_TOUR),
                     GONE_AFTER + TOLD_LIMIT)
        see_tours(trial, tours, 1)
    trial.require(other.poll() is None, "the client that polls has ended")
    trial.stop(tours, robot, "at the end")


def web_page(trial):
    """A web page sends to each port of the node what a browser lets it send: the node refuses it,
    goes on with its tours, and obeys real nodes."""
    groot2_port, page_port = free_ports()
    robot = surroundings(trial)[1]
    trial.package.configure(groot2Port=groot2_port, monitorPort=page_port)
    tours = trial.node()
    tours.lines.wait_for(lambda line: " page: " in line, A_START)
    see_tours(trial, tours, 1)
    node = urllib.parse.urlsplit(rosgraph.Master("/test").lookupNode(NODE))
    with xmlrpc.client.ServerProxy(node.geturl()) as proxy:
        tcpros_port = proxy.requestTopic("/test", "/rosout", [["TCPROS"]])[2][2]
    call = xmlrpc.client.dumps(("/page", "gone"), "shutdown").encode()
    for port in (node.port, tcpros_port, groot2_port, groot2_port + 1, page_port):
        for kind in ("text/plain", "text/xml", ""):
            answer = sent_by_a_browser(port, kind, call)
            refused = b"405" if port == page_port else b"403" if port == node.port else b""
            trial.require(answer == refused, "port {}: answered {}".format(port, answer))
    see_tours(trial, tours, 2)
    with xmlrpc.client.ServerProxy(node.geturl()) as proxy, contextlib.suppress(ConnectionError):
        proxy.shutdown("/rosnode", "")
    trial.require(tours.wait(STOP_LIMIT) == 0, "rosnode kill does not end it")


def sent_by_a_browser(port, kind, body):
    """Return the status of the answer to a POST of a web page, empty without one."""
    head = ("POST / HTTP/1.1", "Host: 127.0.0.1:{}".format(port), "Connection: keep-alive",
            "Content-Length: {}".format(len(body)), "Content-Type: " + kind,
            "Origin: http://page.example", "Sec-Fetch-Mode: no-cors", "", "")
    with socket.create_connection(("127.0.0.1", port), TOLD_LIMIT) as connection:
        connection.sendall("\r\n".join(head).encode() + body)
        try:
            return b"".join(connection.recv(100).split()[1:2])
        except ConnectionResetError:
            return b""


def users_workspace(trial):
    """A user's package stays in a workspace, whose path has a blank, when ours are added, built and
    removed; a folder of the user's in our place is refused."""
    with tempfile.TemporaryDirectory(prefix="a workspace ") as workspace:
        for name, text in USERS_PACKAGE.items():
            write(os.path.join(workspace, "src", "mine", name), text)
        build(workspace)
        before = files(workspace)
        for words in ((), (), ("--remove", )):
            done = add_to_workspace(*words, workspace)
            trial.require(done.returncode == 0, done.stdout.strip())
            build(workspace)
        after = files(workspace)
        changed = {name for name, text in before.items()
                   if "mine" in name and after.get(name) != text}
        trial.require(not changed, "changed or gone: " + ", ".join(sorted(changed)))
        write(os.path.join(workspace, "src", "cssr_system", "calibration.yaml"), "mine")
        before = files(workspace)
        for words in ((), ("--remove", )):
            done = add_to_workspace(*words, workspace)
            trial.require(done.returncode == 1 and done.stdout.count("\n") == 1,
                          "not refused in a line: " + done.stdout.strip())
            trial.require(files(workspace) == before, "a folder of the user's was changed")


# ----------------------------------------------------------------------------- what they consist of


def page_data(port, path):
    """Return the page's answer."""
    with urllib.request.urlopen("http://127.0.0.1:{}/{}".format(port, path),
                                timeout=PATIENCE) as answer:
        return json.loads(answer.read().decode())


def write(path, text):
    """Write a file, in a new folder if need be."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    Path(path).write_text(text)


def files(folder):
    """Return the content of each file below ``folder``, by its path; of a link its target."""
    found = {}
    for place, _, names in os.walk(folder):
        for path in (os.path.join(place, name) for name in names):
            if os.path.islink(path):
                found[path] = os.readlink(path)
            else:
                found[path] = Path(path).read_bytes()
    return found


def build(workspace):
    """Build and install a workspace as in a new shell."""
    subprocess.run(["bash", "-ec", '. "$REPOSITORY/tools/environment.sh"; use_ros; cd "$0"; '
                    "catkin_make && catkin_make install", workspace], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                   env=dict(os.environ, REPOSITORY=REPOSITORY))


def add_to_workspace(*words):
    """Call the command, and return its end with what it printed."""
    return subprocess.run([os.path.join(REPOSITORY, "tools", "add_to_workspace.sh"), *words],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)


def surroundings(trial):
    """Start a master and a robot, and return both."""
    master = start_master()
    trial.held.callback(end, master)
    return master, trial.robot()


def hang_a_drive(trial, robot, node, meanwhile=lambda: None):
    """Let a drive hang until its deadline; return when it was asked for and ``meanwhile()`` was
    called."""
    robot.set_mode(DRIVE, "hang")
    robot.wait_for_request(DRIVE, A_TOUR, start=len(robot.lines.all))
    meanwhile()
    asked = time.monotonic()
    trial.within("hung drive given up after",
                 when(node, r"Navigate \(.*FAILURE.*no answer", asked, 2 * DRIVE_DEADLINE),
                 DRIVE_DEADLINE + 1.0)
    robot.set_mode(DRIVE, "done")
    return asked


def end(master):
    """End a master as a crash does."""
    master.kill()
    master.wait()


def see_tours(trial, node, count):
    """Wait until so many more tours have ended, and expect all of them to have succeeded."""
    start, since = len(node.lines.all), time.monotonic()
    for _ in range(count):
        _, line = node.lines.wait_for(re.compile(r"pass \d+: ").search, A_TOUR, start)
        start = 1 + next(
            n for n, (_, other) in enumerate(node.lines.all) if n >= start and other == line)
        trial.require("SUCCESS" in line, line)
    trial.times.append("{} tours {:.1f} s".format(count, time.monotonic() - since))


def connections(port, count):
    """Yield as many of so many connections as the port takes."""
    for _ in range(count):
        try:
            yield socket.create_connection(("127.0.0.1", port), 2.0)
        except OSError:
            return


# ---------------------------------------------------------------------------------------- the table

# seconds, and the moments at which a node is stopped
CUTS = ((10, (1, 6)), (60, (3, 20, 50)), (110, (10, 40, 100)))

TRIALS = [("lab tour at 100 ms and 5 % loss, master with the " + master, 240,
           partial(lab_tour, master=master)) for master in ("robot", "node")]
TRIALS += [("cut of {} s, master with the {}".format(seconds, master), seconds + 120,
            partial(cut, seconds=seconds, stops=stops, master=master))
           for seconds, stops in CUTS for master in ("robot", "node")]
TRIALS += [
    ("cut of 60 s from the master alone", 180, partial(cut, seconds=60, stops=(3, 30),
                                                       robot="node")),
    ("cut of 30 s on one LAN", 150, partial(cut, seconds=30, stops=(15, ), kind="tap")),
    ("cut while the node starts", 120,
     partial(cut_while_it_starts, moments=(1.0, 1.5, 2.0, 3.0, 4.0, 6.0))),
    ("master frozen for a minute", 240, partial(frozen_master, seconds=60)),
    ("new master", 300, new_master),
    ("garbage of the master", 240, partial(garbled_master, seconds=20)),
    ("1,200 idle connections to each port", 240, partial(flood, count=1200)),
    ("nodes killed and started again", 600, partial(nodes_killed, rounds=5)),
    ("second starts over a running node", 300, partial(second_starts, rounds=12)),
    ("tests started beside the mission", 240, tests_beside),
    ("clock set back by an hour", 300, partial(clock_set, seconds=-3600)),
    ("clock set forward by an hour", 300, partial(clock_set, seconds=3600)),
    ("records with a clock that goes back", 600, partial(clock_set_back, starts=22)),
    ("killed with one recordDirectory", 240, partial(killed_with_one_directory, rounds=3)),
    ("breakpoint of a client that died", 240, partial(breakpoint_of_the_dead, rounds=4)),
    ("web page", 120, web_page),
    ("a workspace with the user's own files", 240, users_workspace)]
TRIALS += drawn_trials.TRIALS

SHORT = [("cut of 8 s, master with the " + master, 60,
          partial(cut, seconds=8, stops=(3, ), master=master)) for master in ("robot", "node")]
