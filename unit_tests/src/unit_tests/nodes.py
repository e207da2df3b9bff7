"""The simulated nodes as ROS nodes, each with services, a topic, or both."""
import os
import signal
import sys
import threading
import time
from functools import partial
from typing import Any, Optional

import actionlib
import rosgraph
import roslib.message
import rospy
from geometry_msgs.msg import Point

from behavior_controller import exits
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.interface import Action, Service, Topic
from behavior_controller.interface.records import Answer, Exhibit

from unit_tests import arguments, parameters, robot
from unit_tests.arrivals import Arrivals
from unit_tests.configuration import ACTION
from unit_tests.faults import CRASH, EXCEPTION, UNANSWERED, WRONG, Faults
from unit_tests.journal import Journal, Line, Told, now
from unit_tests.robot import SERVICES, TOPICS, Fields

try:
    from cssr_system.msg import exhibitInfoMessage, gestureMessage, locationMessage
    from behavior_controller.ros.types import TYPES
except ImportError as error:  # each node would show a traceback
    sys.exit("{}: {}".format(os.path.basename(sys.argv[0]), error))

CRASHED = 9
"""Exit code of a node that dies on purpose; the launch file starts it again."""

SHORTEST_GAP = 0.001
"""The shortest time between two messages of a topic, in seconds: an infinite arrival rate means this."""

LONGEST_STEP = 0.1
"""Seconds until a cancelled goal is noticed."""

ENDING = {signal.SIGINT, signal.SIGTERM}
"""The signals that end a node."""

LOOK_INTERVAL = 0.2
"""Seconds until it is noticed that ROS has shut down without a signal."""

FACE_CENTRE = Point(320.0, 240.0, 1.5)
"""The position of the visitor's face: pixels, and metres from the camera."""


def main(name: str) -> None:
    """Run one simulated node until ROS shuts down. Exit code 1: there is no master; 2: the configuration is wrong."""
    _end_or_sleep_if_absent(name)
    if not rosgraph.is_master_online():
        sys.exit("{}: no ROS master at {}: start roscore, or use the launch file".format(
            name, rosgraph.get_master_uri()))
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)  # before any thread is started: threads inherit it
    rospy.init_node(name, argv=parameters.for_rospy(), disable_signals=True)
    threading.Thread(target=_shut_down_at_a_signal).start()  # no daemon: the process ends after its shutdown of ROS
    try:
        Node(name).run()
    except BehaviorControllerError as error:
        if not parameters.is_launched():
            print(error)
            sys.exit(exits.WRONG_INPUT)
        rospy.spin()  # the report names the fault once for all nodes, and ends the launch
    finally:
        rospy.signal_shutdown("the node ends")


def _shut_down_at_a_signal() -> None:
    """Shut ROS down when a signal comes. rospy's own handler, on the main thread, waits for locks which that may hold."""
    while not rospy.is_shutdown():
        if signal.sigtimedwait(ENDING, LOOK_INTERVAL):
            rospy.signal_shutdown("signal")


def _end_or_sleep_if_absent(name: str) -> None:
    """Wait without a ROS node if the robot has no node of this name: roslaunch would restart a process that ends."""
    if name in parameters.present_nodes():
        return
    if not arguments.is_roslaunch(arguments.parent_command()):
        print("{}: this robot has no such node: choose another robotInterface".format(name))
        sys.exit(exits.WRONG_INPUT)
    for number in ENDING:
        signal.signal(number, signal.SIG_DFL)
    while True:
        signal.pause()


def _exhibit_message(exhibit: Exhibit) -> exhibitInfoMessage:
    return exhibitInfoMessage(exhibit.name, exhibit.description1, exhibit.description2,
                              locationMessage(*exhibit.location), gestureMessage(*exhibit.gesture))


def _message(topic: Topic, content: Fields) -> Any:
    """Return the message that ``topic`` publishes: the content, and for each face its position."""
    faces = {"centroids": [FACE_CENTRE] * len(content["face_label_id"])} if "face_label_id" in content else {}
    return TYPES[topic](**content, **faces)


class Node:
    """One simulated node."""

    def __init__(self, name: str):
        self._name = name
        self._test = parameters.read_configuration()
        self._world = parameters.read_world(self._test)
        interface = self._world.settings.interface
        self._services = [service for service in robot.services(interface)
                          if service.node == name and service.name not in self._test.absent_services]
        self._topic = next((topic for topic in robot.topics(interface) if topic.node == name), None)
        self._journal = Journal(parameters.folder())
        if not parameters.is_launched():
            self._journal.skip()  # of an earlier run; in a launch, of the time before a crash
        self._lock = threading.Lock()  # for the journal and the visitor: each service connection is a thread
        self._stopped = threading.Event()
        planned = [fault for fault in self._test.planned_faults if fault.node == name]
        self._faults = Faults(self._test.failure_rate, self._seed("faults"), self._test.fault_kinds, planned)
        self._published: Fields = {}
        self._told = Told()
        self._look_around()
        if not parameters.is_launched():  # else the report shows it
            rospy.loginfo("%s: randomSeed %d", name, self._test.random_seed)

    def run(self) -> None:
        """Serve and publish until ROS shuts down."""
        rospy.on_shutdown(self._stopped.set)
        for service in self._services:
            rospy.Service(service.name, TYPES[service], partial(self._handle, service))
        if self._topic is not None and self._topic.action is not None and self._test.recognise_by == ACTION:
            self._serve_action(self._topic, self._topic.action)
        elif self._topic is not None:
            self._publish(self._topic)
        self._stopped.wait()

    def _seed(self, purpose: str) -> str:
        return parameters.seed(self._test, self._name, purpose)

    def _write(self, line: Line) -> None:
        """Put a line into the journal and pass all its new lines to the visitor."""
        self._journal.write(line)
        self._look_around()

    def _look_around(self) -> None:
        for line in self._journal.news():
            self._world.visitor.notice(line)
            while line.node == self._name and self._faults.calls < line.call:
                self._faults.next()  # decided before the crash

    def _tell(self, *words: Any) -> None:
        if self._test.verbose_mode:
            rospy.loginfo("%s: %s", self._name, " ".join(map(str, words)))

    # ------------------------------------------------------------------------------------------------------- service

    def _handle(self, service: Service, request: Any) -> Any:
        """Answer one request; it is in the journal before its answer is sent."""
        fields = {slot: getattr(request, slot) for slot in request.__slots__}
        with self._lock:
            fault = robot.possible(self._faults.next(), service, TYPES[service]._response_class.__slots__)
            line = Line(now(), self._name, rospy.resolve_name(service.name), self._faults.calls, fields, fault,
                        SERVICES[service.request].object_to(fields))
            self._write(line)
            answer = SERVICES[service.request].answer(fields, self._world) if line.done else None
        self._tell("call", line.call, fields, "->", fault or line.objection or answer or "no")
        if fault == EXCEPTION:
            raise rospy.ServiceException("call {} of {} fails on purpose".format(line.call, self._name))
        if fault == CRASH:
            os._exit(CRASHED)
        if fault == UNANSWERED:
            self._stopped.wait()
        return _nonsense(service) if fault == WRONG else _response(service, answer)

    # --------------------------------------------------------------------------------------------------------- topic

    def _publish(self, topic: Topic) -> None:
        """Publish at Poisson times until ROS shuts down."""
        publisher = rospy.Publisher(topic.name, TYPES[topic], queue_size=10, tcp_nodelay=True)
        for due in Arrivals(self._test.arrival_rate, self._seed("arrivals")).times(time.monotonic()):
            if self._stopped.wait(max(due - time.monotonic(), SHORTEST_GAP)):
                return
            content = self._content(topic, topic.name)
            if content is not None:
                publisher.publish(_message(topic, content))

    def _serve_action(self, topic: Topic, action: Action) -> None:
        """Offer the action that a robot may have instead of a topic."""
        kind = roslib.message.get_message_class(action.type + "Action")
        arrivals = Arrivals(self._test.arrival_rate, self._seed("arrivals"))
        server = actionlib.SimpleActionServer(
            action.name, kind, lambda goal: self._listen(topic, action, server, arrivals, goal.wait), auto_start=False)
        server.start()

    def _listen(self, topic: Topic, action: Action, server: actionlib.SimpleActionServer, arrivals: Arrivals,
                seconds: float) -> None:
        """Carry out a goal: return the topic's next message, or an empty result when the goal's time is over."""
        result = server.get_default_result()
        ends = time.monotonic() + seconds
        for due in arrivals.times(time.monotonic()):
            while time.monotonic() < min(due, ends):
                if self._stopped.wait(min(LONGEST_STEP, max(min(due, ends) - time.monotonic(), SHORTEST_GAP))):
                    return
                if server.is_preempt_requested():
                    server.set_preempted()
                    return
            content = self._content(topic, action.name) if due < ends else {"data": ""}
            if content is not None:
                result.transcription = content["data"]
                server.set_succeeded(result)
                return

    def _content(self, topic: Topic, name: str) -> Optional[Fields]:
        """Return the content of the next message, and write it to the journal under that name."""
        with self._lock:
            self._look_around()
            value = TOPICS[topic.name].content(self._world)
            content = None if value is None else TOPICS[topic.name].fields(value)
            if content is not None and self._told.is_due(content, time.monotonic()):
                self._write(Line(now(), self._name, rospy.resolve_name(name), 0, content))
            if content not in (None, self._published):
                self._published = content
                self._tell("says", content)
        return content


# ----------------------------------------------------------------------------------------------------------- responses


def _response(service: Service, answer: Optional[Answer], outcome: Any = None) -> Any:
    """Return the response that carries ``answer``; without it, a refusal."""
    response = TYPES[service]._response_class()
    for slot in response.__slots__:
        if slot == service.success.field:
            value = service.success.refused if answer is None else service.success.done
            setattr(response, slot, value if outcome is None else outcome)
        elif slot == "exhibits":
            response.exhibits = [_exhibit_message(exhibit) for exhibit in (answer or Answer()).exhibits]
        else:
            setattr(response, slot, getattr(answer or Answer(), slot))
    return response


def _nonsense(service: Service) -> Any:
    return _response(service, SERVICES[service.request].nonsense or Answer(), robot.nonsense(service.success))
