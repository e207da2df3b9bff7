"""The nine simulated nodes as ROS nodes: a service, a topic, or both, behind each name."""
import os
import sys
import threading
import time
from typing import Any

import rosgraph
import rospy
from cssr_system.msg import exhibitInfoMessage, gestureMessage, locationMessage
from geometry_msgs.msg import Point

from behavior_controller import exits
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.interface.records import Exhibit
from behavior_controller.ros.types import TYPES

from unit_tests import parameters
from unit_tests.arrivals import Arrivals
from unit_tests.faults import CRASH, EXCEPTION, REFUSED, UNANSWERED, WRONG, Faults
from unit_tests.journal import Journal, Line, now
from unit_tests.robot import SERVICES, TOPICS, Fields, Topic

CRASHED = 9
"""Exit code of a node that dies on purpose; the launch file starts it again."""

SHORTEST_GAP = 0.001
"""Seconds between two messages of a topic at the least: what an infinite arrival rate comes to."""

FACE_CENTRE = Point(320.0, 240.0, 1.5)
"""Where the visitor's face is seen: pixels, and metres from the camera."""


def main(name: str) -> None:
    """Run one simulated node until ROS shuts down. Exit code 1: there is no master; 2: the configuration is wrong."""
    if not rosgraph.is_master_online():
        sys.exit("{}: no ROS master at {}: start roscore, or use the launch file".format(
            name, rosgraph.get_master_uri()))
    rospy.init_node(name, argv=parameters.for_rospy())
    try:
        Node(name).run()
    except BehaviorControllerError as error:
        if not parameters.is_launched():
            print(error)
            sys.exit(exits.WRONG_INPUT)
        rospy.spin()  # the report tells of it, once for all nodes, and ends the launch


def _exhibit_message(exhibit: Exhibit) -> exhibitInfoMessage:
    return exhibitInfoMessage(exhibit.name, exhibit.description1, exhibit.description2,
                              locationMessage(*exhibit.location), gestureMessage(*exhibit.gesture))


def _message(topic: Topic, content: Fields) -> Any:
    """Return what ``topic`` publishes: the content, and for each face where it is seen."""
    faces = {"centroids": [FACE_CENTRE] * len(content["face_label_id"])} if "face_label_id" in content else {}
    return TYPES[topic.offer](**content, **faces)


class Node:
    """One simulated node."""

    def __init__(self, name: str):
        self._name = name
        self._test = parameters.read_configuration()
        self._world = parameters.read_world(self._test)
        self._journal = Journal(parameters.folder())
        if not parameters.is_launched():
            self._journal.skip()  # of an earlier day; in a launch it is what was before a crash
        self._lock = threading.Lock()  # for the journal and the visitor: each service connection is a thread
        self._stopped = threading.Event()
        planned = [fault for fault in self._test.planned_faults if fault.node == name]
        self._faults = Faults(self._test.failure_rate, self._seed("faults"), self._test.fault_kinds, planned)
        self._published: Fields = {}
        self._look_around()
        if not parameters.is_launched():  # else the report says it
            rospy.loginfo("%s: randomSeed %d", name, self._test.random_seed)

    def run(self) -> None:
        """Serve and publish until ROS shuts down."""
        rospy.on_shutdown(self._stopped.set)
        if self._name in SERVICES:
            rospy.Service(SERVICES[self._name].name, TYPES[SERVICES[self._name].offer], self._handle)
        if self._name in TOPICS:
            self._publish()
        self._stopped.wait()

    def _seed(self, purpose: str) -> str:
        return "{}/{}/{}".format(self._test.random_seed, self._name, purpose)

    def _write(self, line: Line) -> None:
        """Put a line into the journal and tell the visitor everything that is new there."""
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

    def _handle(self, request: Any) -> Any:
        """Answer one request; it stands in the journal before its answer is sent."""
        service = SERVICES[self._name]
        fields = {slot: getattr(request, slot) for slot in request.__slots__}
        with self._lock:
            fault = self._faults.next()
            if fault == WRONG and service.wrong is None:
                fault = REFUSED
            line = Line(now(), self._name, rospy.resolve_name(service.name), self._faults.calls, fields, fault,
                        service.object_to(fields))
            self._write(line)
            answer = service.answer(fields, self._world) if line.done else (
                service.wrong if fault == WRONG else service.refusal)
        self._tell("call", line.call, fields, "->", fault or line.objection or answer)
        if fault == EXCEPTION:
            raise rospy.ServiceException("call {} of {} fails on purpose".format(line.call, self._name))
        if fault == CRASH:
            os._exit(CRASHED)
        if fault == UNANSWERED:
            self._stopped.wait()
        return self._response(answer)

    def _response(self, answer: Fields) -> Any:
        exhibits = {key: [_exhibit_message(exhibit) for exhibit in value]
                    for key, value in answer.items() if key == "exhibits"}
        return TYPES[SERVICES[self._name].offer]._response_class(**dict(answer, **exhibits))

    # --------------------------------------------------------------------------------------------------------- topic

    def _publish(self) -> None:
        """Publish at Poisson times until ROS shuts down."""
        topic = TOPICS[self._name]
        publisher = rospy.Publisher(topic.name, TYPES[topic.offer], queue_size=10, tcp_nodelay=True)
        for due in Arrivals(self._test.arrival_rate, self._seed("arrivals")).times(time.monotonic()):
            if self._stopped.wait(max(due - time.monotonic(), SHORTEST_GAP)):
                return
            publisher.publish(_message(topic, self._content()))

    def _content(self) -> Fields:
        """Return what the next message says; the journal gets what differs from the last."""
        topic = TOPICS[self._name]
        with self._lock:
            self._look_around()
            content = topic.content(self._world)
            if content != self._published:
                self._published = content
                self._write(Line(now(), self._name, rospy.resolve_name(topic.name), 0, content))
                self._tell("says", content)
        return content
