"""Measure the running node against a robot that answers at once, and compare it with the minimum of
rospy, in one run.

Reaction: from a message that leaves its publisher to the request that follows arriving at the
server. Step: from an answer to the next request, where all answers come at once, and where each
takes 20 ms. Both are also given as processor time of the process, which changes less on a busy
machine. Ticks while every server hangs, hung calls, floods and idling are measured too. Prints
JSON.
"""
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(os.path.dirname(HERE), "test", "rostest"))
from robot import SETTLE, Controller, Package, Robot, start_master  # noqa: E402

FACES, ATTENTION, SPEECH = "/faceDetection/data", "/overtAttention/mode", "/speechEvent/text"
SAY, MODE = "/textToSpeech/say_text", "/overtAttention/set_mode"
NO_FACE = [], [], []
TEN_FACES = ([str(n) for n in range(10)], [[0.0, 0.0, 1.0]] * 10, [False] * 10)
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">
  <Repeat num_cycles="-1"><Sequence>{}</Sequence></Repeat></BehaviorTree></root>"""
UNTIL = "<ReactiveFallback>{}<Sleep msec=\"600000\"/></ReactiveFallback>"
VISITOR = (UNTIL.format("<IsVisitorDiscovered/>") + "<WelcomeSpeech/>"
           + UNTIL.format("<Inverter><IsVisitorDiscovered/></Inverter>") + "<SayGoodByeSpeech/>")
GAZE = "<SeekOvertAttentionMode/>" + UNTIL.format("<IsMutualGazeDiscovered/>") + "<WelcomeSpeech/>"
YES = "<QueryTourSpeech/>" + UNTIL.format("<IsYesNoUttered/>") + "<MaybeAnotherTimeSpeech/>"
STEPS = "<WelcomeSpeech/><WelcomeGesture/><EnableAnimateBehavior/><SocialOvertAttentionMode/>"
STEP_SERVICES = (SAY, "/gestureExecution/perform_gesture", "/animateBehaviour/set_activation", MODE)
ROUNDS = 200


class Bench:
    """A master, and one robot and node after the other."""

    def __init__(self, folder):
        self.records = os.path.join(folder, "record")
        self.keys = {}  # of a node that is not watched
        self.master = start_master()
        self.package = Package(os.path.join(folder, "package"))
        self.robot = None
        self.node = None
        self.clients = None
        self.processor_time = 0.0
        """Seconds of processor time that the node took for each of the newest measurement."""

    @property
    def pid(self):
        """The process of the node."""
        return getattr(self.node, "process", self.node).pid

    def start(self, mission, modes=None, is_watched=False, how="look"):
        """Start a robot whose services behave by ``modes``, and the node with this mission.

        If it is watched, Groot2 and a browser monitor the run, or do what ``how`` says, and it is
        recorded.
        """
        self.robot = Robot(modes)
        self.package.write("data/m.xml", MISSION.format(mission))
        ports = {"groot2Port": "21667", "monitorPort": "28080"}
        keys = dict(ports, recordDirectory=self.records) if is_watched else self.keys
        self.package.configure(scenarioSpecification="m", **keys)
        self.node = Controller(self.package)
        self.node.lines.wait_for(lambda line: " starts, " in line, 20)
        if is_watched:
            self.node.lines.wait_for(lambda line: " page: " in line, 20)
            clients = os.path.join(HERE, "monitoring_clients.py")
            self.clients = subprocess.Popen([sys.executable, clients] + list(ports.values()) +
                                            [how], stdout=subprocess.PIPE)
            self.clients.stdout.readline()
        time.sleep(0.5)

    def floor(self, what):
        """Start a robot and the bare rospy node."""
        self.robot = Robot()
        self.node = subprocess.Popen([sys.executable, os.path.join(HERE, "floor_node.py"), what],
                                     stderr=subprocess.DEVNULL)
        self.robot.wait_for_request(SAY, 20)

    def stop(self):
        """End node, robot and monitoring clients."""
        if self.clients is not None:
            self.clients.kill()
            self.clients.communicate()
            self.clients = None
        if isinstance(self.node, Controller):
            self.node.stop()
            self.node.close()
        else:
            self.node.kill()
            self.node.wait()
        self.robot.stop()

    def next_request(self, service, topic, *values):
        """Publish, and return the seconds until the next request to ``service`` arrived."""
        return self.robot.reaction(service, topic, *values)

    # --------------------------------------------------------------------------------- measurements

    def reaction(self, mission, *messages, is_watched=False):
        """Return the reaction times to the messages, each ``(topic, values…)``, in turn."""
        self.start(mission, is_watched=is_watched)
        return self.reactions(messages)

    def reaction_floor(self):
        """Return the reaction times of the bare node."""
        self.floor("reaction")
        time.sleep(0.5)
        return self.reactions([(FACES,)])

    def reactions(self, messages):
        """Return the reaction times, and note the processor time of one."""
        before = processor_seconds(self.pid)
        taken = [self.next_request(SAY, *messages[turn % len(messages)]) for turn in range(ROUNDS)]
        self.processor_time = (processor_seconds(self.pid) - before) / ROUNDS
        self.stop()
        return taken

    def steps(self, begin):
        """Return the seconds from each answer to the next request, over two seconds, and note the
        processor time of a step."""
        begin()
        time.sleep(0.5)
        began, before = time.monotonic(), processor_seconds(self.pid)
        time.sleep(2.0)
        ended, used = time.monotonic(), processor_seconds(self.pid) - before
        self.robot.lines.wait_for(lambda line: json.loads(line).get("time", 0.0) > ended, 10)
        events = [json.loads(line) for _, line in list(self.robot.lines.all)]
        self.stop()
        events = [event for event in events if began <= event.get("time", 0.0) <= ended]
        self.processor_time = used / sum("service" in event for event in events)
        return [after["time"] - before["time"] for before, after in zip(events, events[1:])
                if "answered" in before and "service" in after]

    def paced_steps(self, is_watched=False):
        """Return the seconds from each answer to the next request where each service takes
        ``SETTLE`` to answer."""
        self.start(STEPS, dict.fromkeys(STEP_SERVICES, "hang"), is_watched)
        taken, seen, answered = [], 0, 0.0
        for turn in range(ROUNDS):
            service = STEP_SERVICES[turn % len(STEP_SERVICES)]
            request = self.robot.wait_for_request(service, 5, seen)
            if turn > len(STEP_SERVICES):  # the first round opens the connections
                taken.append(request["time"] - answered)
            seen = len(self.robot.lines.all)
            time.sleep(SETTLE)
            self.robot.set_mode(service, "done")
            _, line = self.robot.lines.wait_for(
                lambda line: '"answered": "{}"'.format(service) in line, 5, seen)
            answered = json.loads(line)["time"]
            self.robot.set_mode(service, "hang")
        self.stop()
        return taken

    def load(self, seconds, *floods):
        """Return the share of a core that the node takes that waits for a gaze, while ``floods``
        are sent.

        A flood is ``(topic, values, hertz)``.
        """
        self.start(GAZE)
        for topic, values, hertz in floods:
            self.robot.publish(topic, *values, hertz=hertz)
        time.sleep(1.5)
        before = processor_seconds(self.pid)
        time.sleep(seconds)
        share = (processor_seconds(self.pid) - before) / seconds
        self.stop()
        return share

    def reaction_in_flood(self):
        """Return the reaction times to a visitor's answer while the two other topics are flooded.
        """
        self.start(YES)
        self.robot.publish(ATTENTION, "seeking", 3, hertz=2000)
        self.robot.publish(FACES, *TEN_FACES, hertz=30)
        time.sleep(1.0)
        taken = [self.next_request(SAY, SPEECH, "yes") for _ in range(ROUNDS)]
        self.stop()
        return taken


def processor_seconds(pid):
    """Return the processor time that a process has taken."""
    with open("/proc/{}/stat".format(pid)) as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def in_ms(times):
    """Return the percentiles of times in seconds as milliseconds."""
    ordered = sorted(times)
    return {
        "p50": round(1000 * statistics.median(ordered),
                     3), "p95": round(1000 * ordered[len(ordered) * 95 // 100],
                                      3), "p99": round(1000 * ordered[len(ordered) * 99 // 100], 3),
        "max": round(1000 * ordered[-1], 3), "rounds": len(ordered)
    }


def in_us(mission, floor):
    """Return processor times in microseconds, and their ratio."""
    return {"mission": round(1e6 * mission), "rospy alone": round(1e6 * floor),
            "ratio": round(mission / floor, 2)}


# ---------------------------------------------------------------------- in this process: hung calls


def hung(bench, count, seconds):
    """Return the times of ticks while all seven servers hang, and what so many hung calls leave
    behind."""
    import rospy
    from behavior_controller.bt.engine.clock import Clock
    from behavior_controller.wakeup import WakeUp
    from behavior_controller.robot.d543 import INTERFACE
    from behavior_controller.robot.requests import Say
    from behavior_controller.ros.service_client import RosGateway
    bench.robot = Robot({service.name: "hang" for service in INTERFACE.services})
    rospy.init_node("bench", disable_signals=True)
    ticks = hung_ticks(seconds)
    clock, wake = Clock(), WakeUp()
    gateway = RosGateway(INTERFACE, lambda service: 0.004, clock, wake.emit)
    before = None
    for number in range(count + 50):
        call = gateway.start(Say("hello"))
        while call.result is None:
            wake.wait(max(0.0, (clock.next_due() or 0.0) - clock.now()))
            wake.test_and_clear()
            clock.run_due()
        if number == 50:
            before = descriptors_and_threads()
    time.sleep(0.5)
    after = descriptors_and_threads()
    bench.robot.kill()
    return ticks, {"calls": count, "descriptors and threads before": before, "after": after}


def hung_ticks(seconds):
    """Return how long each tick of a mission took whose seven leaves wait for servers that do not
    answer."""
    from behavior_controller.config import settings
    from behavior_controller.missions import load
    from behavior_controller.bt.loader.document import parse
    from behavior_controller.run.events import Events
    from behavior_controller.robot.gateway import FakeTopics
    from behavior_controller.robot.d543 import INTERFACE
    from behavior_controller.robot.requests import Location
    from behavior_controller.leaves.data import TARGET_LOCATION
    from behavior_controller.ros.service_client import RosGateway
    calls = ("<WelcomeSpeech/><WelcomeGesture/><EnableAnimateBehavior/><SocialOvertAttentionMode/>"
             "<LookUpHome/><PressYesNoDialogue/><Navigate/>")
    loaded = load.load(
        settings.defaults(), documents=[
            parse(
                MISSION.format(
                    "<Parallel>{}<Repeat num_cycles=\"-1\"><Sleep msec=\"5\"/></Repeat></Parallel>".
                    format(calls)))
        ])
    tree = loaded.tree
    tree.blackboard.set(TARGET_LOCATION.name, Location(1.0, 2.0, 3.0))
    gateway = RosGateway(INTERFACE, lambda service: 60.0, tree.clock, tree.wake.emit)
    tree.setup(mission=loaded.context(gateway, FakeTopics(tree.clock.now), Events()))
    taken, ends = [], time.monotonic() + seconds
    while time.monotonic() < ends:
        began = time.perf_counter()
        tree.tick_once()
        taken.append(time.perf_counter() - began)
        tree.sleep(0.01)
    tree.halt()
    gateway.close()
    return taken


def descriptors_and_threads():
    """Return how many of each this process has."""
    return [len(os.listdir("/proc/self/fd")), threading.active_count()]


def main():
    """Measure everything and print it."""
    folder = tempfile.mkdtemp()
    bench = Bench(folder)
    try:
        floor, processor = bench.reaction_floor(), {}
        processor["reaction", "rospy alone"] = bench.processor_time
        visitor, paced = {False: [], True: []}, {False: [], True: []}
        # in turn, so that compared values come from the same conditions
        for is_watched in 5 * (False, True):
            visitor[is_watched] += bench.reaction(VISITOR, (FACES, ), (FACES, ) + NO_FACE,
                                                  is_watched=is_watched)
            if not is_watched:
                processor["reaction", "mission"] = bench.processor_time
            paced[is_watched] += bench.paced_steps(is_watched)
        reactions = {
            "visitor": visitor[False],
            "gaze": bench.reaction(GAZE, (ATTENTION, "seeking", 1)),
            "yes": bench.reaction(YES, (SPEECH, "yes")),
            "yes, in a flood": bench.reaction_in_flood(),
            "visitor, watched and recorded": visitor[True],
        }
        step_floor = bench.steps(lambda: bench.floor("step"))
        processor["step", "rospy alone"] = bench.processor_time
        step = bench.steps(lambda: bench.start(STEPS))
        processor["step", "mission"] = bench.processor_time
        idle = bench.load(10.0)
        flood = bench.load(5.0, (ATTENTION, ("seeking", 3), 2000), (FACES, TEN_FACES, 30),
                           (SPEECH, ("hm", ), 100))
        ticks, calls = hung(bench, 10_000 if "--all" in sys.argv else 1_000, 5.0)
    finally:
        bench.master.terminate()
        bench.master.wait()
        shutil.rmtree(folder)
    print(
        json.dumps(
            {
                "python":
                    platform.python_version(),
                "reaction, ms":
                    dict({name: in_ms(times)
                          for name, times in reactions.items()}, **{"rospy alone": in_ms(floor)}),
                "reaction to rospy alone, p50":
                    round(statistics.median(visitor[False]) / statistics.median(floor), 2),
                "step, ms": {
                    "mission": in_ms(step), "rospy alone": in_ms(step_floor),
                    "a robot of 20 ms": in_ms(
                        paced[False]), "a robot of 20 ms, watched and recorded": in_ms(paced[True])
                },
                "watched and recorded to not, p50": {
                    "reaction":
                        round(
                            statistics.median(visitor[True]) / statistics.median(visitor[False]),
                            3),
                    "step":
                        round(statistics.median(paced[True]) / statistics.median(paced[False]), 3)
                },
                "processor time, µs":
                    {what: in_us(processor[what, "mission"], processor[what, "rospy alone"])
                     for what in ("reaction", "step")},
                "share of a core":
                    {"idle": round(idle, 4), "flood of 2,130 messages per second": round(flood, 4)},
                "tick while seven servers hang, ms":
                    in_ms(ticks),
                "hung calls":
                    calls,
            }, indent=2))


if __name__ == "__main__":
    main()
