"""What ROS tools see and steer of a run (``rosInterface``): /diagnostics, ~state, and the services.

Both topics are made from the model of the run, on a thread of their own. A service only notes what
the operator wants, at a bounded rate; the tick thread obeys.
"""
import threading
import time
from functools import partial
from typing import Any, Callable, Dict, Iterable, Mapping, Optional, Tuple

import msgspec
import roslib.message
import rospy
from std_msgs.msg import String

from behavior_controller.errors import ConfigurationError
from behavior_controller.viewer.view import CONTROLLER_STOPPED, View
from behavior_controller.run.events import is_simulated
from behavior_controller.run.record.recorder import LineQueue
from behavior_controller.run.diagnostics import Status, statuses
from behavior_controller.robot.declarations import Interface, Offer
from behavior_controller.ros.timeouts import start_thread

PUBLISH_INTERVAL = 0.1
"""Seconds between two looks for events: ``~state`` is published no more often."""

DIAGNOSTICS_EVERY = 1.0
"""Seconds between two messages of /diagnostics, as REP 107 has it."""

CALL_INTERVAL = 0.02
"""Seconds that a call of a service takes at least, one after the other, however many callers there
are: a flood of them must not take the processor from the robot."""

LAST_STATE_LIMIT = 0.3
"""Seconds to publish how the run ended."""

Command = Callable[[], Tuple[bool, str]]
"""What a service does; returns whether it is done, and a line for the caller. Must not wait."""


def types() -> Tuple[Any, ...]:
    """Return the generated classes of ``std_srvs/Trigger`` and of the diagnostics. Raises
    ConfigurationError if they are not installed."""
    trigger = roslib.message.get_service_class("std_srvs/Trigger")
    messages = [roslib.message.get_message_class("diagnostic_msgs/" + name)
                for name in ("DiagnosticArray", "DiagnosticStatus", "KeyValue")]
    if None in (trigger, *messages):
        raise ConfigurationError.of(
            "rosInterface", "it needs the ROS packages std_srvs and diagnostic_msgs",
            "install them, or set rosInterface false")
    return (trigger, *messages)


class RosInterface(LineQueue):
    """Publishes the run, whose lines it is given, and serves until ``close``."""

    def __init__(self, robot: Interface, offers: Callable[[], Iterable[Offer]],
                 commands: Mapping[str, Command]):
        """Registers at the master, which may hang. ``offers`` returns what the mission uses."""
        super().__init__()
        self._trigger, self._array, self._status, self._value = types()
        self._robot, self._offers = robot, offers
        self._view = View()
        self._shown: Optional[bytes] = None  # as published last
        self._diagnosed: Tuple[float, Any] = (0.0, None)
        self._rest, self._closed = threading.Lock(), threading.Event()
        self._topic = rospy.Publisher("~state", String, queue_size=10, latch=True)
        self._diagnostics = rospy.Publisher("/diagnostics", self._array, queue_size=10)
        for name, command in commands.items():
            rospy.Service("~" + name, self._trigger, partial(self._carry_out, command))
        # the state shows last: then the services can be called
        self._thread = start_thread("ROS interface", self._work)

    def close(self) -> None:
        """Publish how the run ended; the topics and services end with the node."""
        self._closed.set()
        self._thread.join(LAST_STATE_LIMIT)

    def _carry_out(self, command: Command, request: Any) -> Any:
        with self._rest:
            time.sleep(CALL_INTERVAL)
            outcome = (False, "the node ends") if self._closed.is_set() else command()
            return self._trigger._response_class(*outcome)

    def _work(self) -> None:
        try:
            while not self._closed.wait(PUBLISH_INTERVAL):
                self._publish()
            self._view.stopped = CONTROLLER_STOPPED
            sent = self._sent()
            self._publish()
            self._wait_for_more_than(sent)
        except rospy.ROSException:
            pass  # ROS has shut down

    def _sent(self) -> Dict[int, int]:
        """Return how many messages of ``~state`` each subscriber was sent, by its connection."""
        return {connection: number for connection, _, number, _ in self._topic.impl.get_stats()[2]}

    def _wait_for_more_than(self, sent: Dict[int, int]) -> None:
        """Return when each subscriber was sent one more. rospy sends on threads that end with the
        process, and tells nobody when they have sent."""
        ends = time.monotonic() + LAST_STATE_LIMIT
        while time.monotonic() < ends and sent.items() & self._sent().items():
            time.sleep(0.005)

    def _publish(self) -> None:
        """Publish the state if it has changed, and the diagnostics if they have, or are due."""
        self._view.extend(self.take())
        shown = msgspec.json.encode(self._view.now())
        if shown != self._shown:
            self._shown = shown
            self._topic.publish(String(shown.decode()))
        now = time.monotonic()
        diagnosis = statuses(self._view.state, self._robot, self._offers(), is_simulated())
        if diagnosis != self._diagnosed[1] or now >= self._diagnosed[0] + DIAGNOSTICS_EVERY:
            self._diagnosed = now, diagnosis
            array = self._array(status=list(map(self._message, diagnosis)))
            array.header.stamp = rospy.get_rostime()
            self._diagnostics.publish(array)

    def _message(self, status: Status) -> Any:
        values = [self._value(key, text) for key, text in status.values.items() if text]
        name = f"{rospy.get_name()[1:]}: {status.name}"
        return self._status(level=status.level, name=name, message=status.message,
                            hardware_id="none", values=values)
