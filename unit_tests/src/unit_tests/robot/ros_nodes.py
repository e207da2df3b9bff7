"""The simulated nodes as ROS nodes, each with services, a topic, or both; and that of /clock."""
import math
import os
import signal
import sys
import threading
import time
from functools import partial
from typing import Any, Dict, List, NoReturn, Optional

import actionlib
import rospy

from behavior_controller import exit_codes
from behavior_controller.errors import BehaviorControllerError, NodesMissing
from behavior_controller.robot.declarations import Action, Service, Topic
from behavior_controller.ros.handshakes import bound_handshakes
from behavior_controller.ros.names import enter
from behavior_controller.ros.sinks import use_line_handler
from behavior_controller.ros.types import TYPES
from behavior_controller.ros_arguments import explain_node, is_roslaunch, parent_command
from behavior_controller.simulation import behaviour
from behavior_controller.simulation.arrivals import Arrivals
from behavior_controller.simulation.behaviour import Fields, SERVICES
from behavior_controller.simulation.configuration import IDLE_ACTION
from behavior_controller.simulation.faults import CRASH, EXCEPTION, UNANSWERED, WRONG
from behavior_controller.simulation.journal import Journal, JournalEntry, plain
from behavior_controller.simulation.simulated_node import Reply, SimulatedNode

from unit_tests.robot import claims, options
from unit_tests.robot.ros_messages import (
    feedback, is_cancelled, message, offer_idle, response, response_fields,
    serve_action, serve_goals, succeed)
from unit_tests.robot.options import Arguments, CLOCK_NODE, Options
from unit_tests.robot.ros_time import ComputerTime, RosTime, publish_clock

CRASHED = 9
"""Exit code of a node that dies on purpose; the launch file starts it again."""

_SHORTEST_GAP = 0.001
"""The shortest time between two messages of a topic, in seconds: an infinite arrival rate means
this."""

SHORTEST_GOAL = 0.1
"""The shortest time of a goal, in seconds: to a server that has just come up the client connects
while the first goal arrives."""

LONGEST_STEP = 0.1
"""Seconds until a cancelled goal is noticed."""

ENDING = {signal.SIGINT, signal.SIGTERM}
"""The signals that end a node."""

CHECK_INTERVAL = 0.2
"""Seconds until it is noticed that ROS has shut down without a signal, or that roslaunch was
killed."""


def main(name: str) -> int:
    """Run one simulated node until ROS shuts down, and return its exit code."""
    explain_node(name, f"The simulated {name}. It reads the keys of the test's configuration as "
                 "_key:=value (docs/testers_guide.md).",
                 "0 ROS was shut down, 1 no master answers, 2 the configuration is wrong, or a "
                 "living node has its name")
    arguments = options.of_process()
    try:
        options.check_words(arguments)
        own = options.read(arguments)
        claims.check(name, own)
        if name == CLOCK_NODE and not own.has_clock:
            _end_or_wait(f"{name}: at speed 1 the computer's time is used: choose another _speed")
        if name not in (CLOCK_NODE, *behaviour.nodes(own.world.settings.interface)):
            _end_or_wait(name + ": this robot has no such node: choose another robotInterface")
        is_simulated = claims.is_time_simulated(own)
        if name == CLOCK_NODE:
            claims.simulate_time()
    except NodesMissing as error:
        sys.exit("{}: {}".format(name, error))  # and roslaunch tries again
    except BehaviorControllerError as error:
        _refuse(name, arguments, error)
    # before any thread is started: threads inherit it
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    enter(own.words)
    # rospy's own time is the computer's: its timers, as those of actions, end at a jump back
    rospy.init_node(name, argv=own.words, disable_signals=True, disable_rostime=True)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    use_line_handler()
    bound_handshakes()
    rospy.core.add_preshutdown_hook(partial(claims.note_replacement, name, own))
    # no daemon: the process ends after its shutdown of ROS
    threading.Thread(target=_shut_down_at_a_signal).start()
    try:
        if name == CLOCK_NODE:
            publish_clock(own.speed)
            claims.end_simulated_time()
        elif is_simulated:
            RosNode(name, own, RosTime()).run()
        else:
            RosNode(name, own, ComputerTime()).run()
    finally:
        rospy.signal_shutdown("the node ends")
    return exit_codes.SUCCESS


def _shut_down_at_a_signal() -> None:
    """Shut ROS down when a signal comes. rospy's own handler, on the main thread, waits for locks
    which that may hold."""
    while not rospy.is_shutdown():
        if signal.sigtimedwait(ENDING, CHECK_INTERVAL):
            rospy.signal_shutdown("signal")


def _refuse(name: str, arguments: Arguments, error: BehaviorControllerError) -> NoReturn:
    """Do not start. Of a launch that is refused as a whole the last node says why and ends it,
    unless a report does."""
    is_whole = arguments.is_in_launch and not isinstance(error, claims.OneTaken)
    if is_roslaunch(parent_command()) and not arguments.is_launched:
        # roslaunch starts it last: a roslaunch that is ended before that may leave some behind
        is_last = name == [CLOCK_NODE, *arguments.simulated][-1]
        if not is_whole or is_last:
            print(error, flush=True)
        if is_whole and is_last:
            os.kill(os.getppid(), signal.SIGINT)
    _end_or_wait(str(error))


def _end_or_wait(text: str) -> NoReturn:
    """End with that line; in a launch, wait for its end without a ROS node: roslaunch would restart
    a process that ends."""
    launch = os.getppid()
    if not is_roslaunch(parent_command()):
        print(text, flush=True)
        sys.exit(exit_codes.WRONG_INPUT)
    while os.getppid() == launch:
        time.sleep(CHECK_INTERVAL)
    sys.exit(exit_codes.WRONG_INPUT)


class RosNode:
    """Carries one simulated node to the wire."""

    def __init__(self, name: str, own: Options, now: ComputerTime):
        self._test, self._time = own.test, now
        # the entries of an earlier run are skipped; in a launch they are of the time before a crash
        is_alone = not (own.arguments.is_launched or own.arguments.is_in_launch)
        self._journal = Journal(own.arguments.folder, skips=is_alone)
        # for the journal and the visitor: each service connection is a thread
        self._lock = threading.Lock()
        self._node = SimulatedNode(name, own.test, own.world, now.now, self._write)
        self._published: Fields = {}
        self._goals: Dict[Action, Any] = {}  # the newest one of each
        for entry in self._read_journal()[-1:]:
            now.jumped += entry.jumped  # before a crash
        if not own.arguments.is_launched:  # else the report shows it
            rospy.loginfo("%s: randomSeed %d", name, own.test.random_seed)

    def run(self) -> None:
        """Serve and publish until ROS shuts down."""
        rospy.on_shutdown(self._time.end)
        if self._time.await_first():
            return
        node, offers = self._node, self._node.offers
        for service in offers.services:
            if isinstance(service, Action):
                serve_goals(service, partial(self._achieve, service))
            else:
                rospy.Service(service.name, TYPES[service], partial(self._handle, service))
        if offers.action is not None and self._test.recognise_by == IDLE_ACTION:
            offer_idle(offers.action)
        elif offers.action is not None:
            serve_action(offers.action, partial(self._listen, node.arrivals()))
        elif offers.topic is not None:
            self._publish(offers.topic)
        self._time.wait(math.inf)

    def _write(self, entry: JournalEntry) -> None:
        """Put an entry into the journal and pass all its new entries to the visitor."""
        self._journal.write(entry._replace(jumped=self._time.jumped))
        self._read_journal()

    def _read_journal(self) -> List[JournalEntry]:
        news = self._journal.news()
        for entry in news:
            self._node.world.visitor.notice(entry)
            self._node.catch_up(entry)
        return news

    def _log(self, *words: Any) -> None:
        if self._test.verbose_mode:
            rospy.loginfo("%s: %s", self._node.name, " ".join(map(str, words)))

    def _reply(self, service: Service, request: Any) -> Reply:
        """Return what to do with a request; it is in the journal before its answer is sent."""
        fields = plain(request)
        with self._lock:
            self._read_journal()  # the answer is that of the visitor as of now
            reply = self._node.reply(service, rospy.resolve_name(service.name), fields,
                                     response_fields(service), response)
        outcome = reply.entry.fault or reply.entry.objection or reply.answer or "no"
        self._log("call", reply.entry.call, fields, "->", outcome)
        if reply.entry.fault == CRASH:
            os._exit(CRASHED)
        return reply

    def _handle(self, service: Service, request: Any) -> Any:
        """Answer one request."""
        reply = self._reply(service, request)
        fault = reply.entry.fault
        if fault == EXCEPTION:
            raise rospy.ServiceException(reply.exception)
        self._time.wait(math.inf if fault == UNANSWERED else reply.entry.seconds)
        return reply.response

    def _achieve(self, action: Action, goal: Any) -> None:
        """Carry out one goal, which a cancel or a newer one may stop."""
        reply, began = self._reply(action, goal.get_goal()), self._time.now()
        self._goals[action] = goal
        fault, simulated = reply.entry.fault, SERVICES[action.request]
        seconds = math.inf if fault == UNANSWERED else max(reply.entry.seconds, SHORTEST_GOAL)
        while self._time.now() < began + seconds:
            share = (self._time.now() - began) / seconds
            is_unwanted = is_cancelled(goal) or self._goals[action] is not goal
            if is_unwanted and (share < simulated.stops_until or fault == UNANSWERED):
                return goal.set_canceled()
            news = simulated.feedback(reply.entry.content, share)
            if news:
                goal.publish_feedback(feedback(action, news))
            if self._time.wait(min(LONGEST_STEP, max(seconds * (1.0 - share), _SHORTEST_GAP))):
                return None
        result = reply.response or response(action, None, fault)
        if reply.answer is None and fault != WRONG:
            return goal.set_aborted(result, reply.exception if fault == EXCEPTION else "")
        return goal.set_succeeded(result)

    def _publish(self, topic: Topic) -> None:
        """Publish at Poisson times until ROS shuts down."""
        publisher = rospy.Publisher(topic.name, TYPES[topic], queue_size=10, tcp_nodelay=True)
        for due in self._node.arrivals().times(self._time.now()):
            if self._time.wait(max(due - self._time.now(), _SHORTEST_GAP)):
                return
            fields = self._next_fields()
            if fields is not None:
                publisher.publish(message(topic, fields))

    def _listen(self, arrivals: Arrivals, server: actionlib.SimpleActionServer,
                seconds: float) -> None:
        """Carry out a goal: return the topic's next message, or an empty result when the goal's
        time is over."""
        deadline = self._time.now() + seconds
        for due in arrivals.times(self._time.now()):
            while self._time.now() < min(due, deadline):
                left = min(due, deadline) - self._time.now()
                if self._time.wait(min(LONGEST_STEP, max(left, _SHORTEST_GAP))):
                    return
                if server.is_preempt_requested():
                    server.set_preempted()
                    return
            fields: Optional[Fields] = {"data": ""}
            if due < deadline:
                fields = self._next_fields()
            if fields is not None:
                succeed(server, fields["data"])
                return

    def _next_fields(self) -> Optional[Fields]:
        """Return the fields of the next message, which is in the journal; None without one."""
        with self._lock:
            self._read_journal()
            fields = self._node.message(rospy.resolve_name(self._node.offers.publisher))
        if fields is not None and fields != self._published:
            self._published = fields
            self._log("says", fields)
        return fields
