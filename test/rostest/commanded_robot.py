#!/usr/bin/env python3
"""The simulated robot of ``unit_tests`` in one ROS node, which behaves as commanded.

Arguments are ``name=mode``: how the service or topic behaves from the start. Modes of a service:
``done`` (default: what the simulated node answers), ``refuse``, ``odd`` (an answer without a
meaning), ``raise``, ``hang`` (until the mode changes), ``exit`` (the process dies while it works),
``absent``, ``wrong`` (another type). Modes of a topic: ``absent``, ``wrong``, ``garbled`` (no
message can be decoded). The argument ``interface`` is the name of the robot's interface. Modes of
its action, which is absent unless it has one: ``done`` (a goal ends with what is said, or with its
time), ``late`` (with what is said, whenever that is), ``abort``, ``hang``, ``exit``. The other
actions of an interface are there unless they are ``absent``; their modes, under ``action NAME``:
``done``, ``refuse`` (succeeded, with the result of a refusal), ``abort``, ``hang`` (reports, until
it is cancelled), ``deaf`` (never looks at a cancel).

Each line on stdin is a JSON object: ``{"name": …, "mode": …}``, or ``{"topic": …, "values":
[fields], "hertz": 0}``, which publishes once, or from now on so many times per second, without
values what the visitor causes; ``{"say": text}``, which the action hears; or ``{"again": {name:
mode}}``, with which the services begin anew, and which is reported as well. Each line on stdout
too, with its monotonic ``time``: ``ready`` once, ``service`` and ``fields`` for each request as it
arrives, ``answered`` before its answer, ``goal`` with the seconds of a goal as it arrives,
``cancelled`` as it is cancelled, and ``topic`` with its ``listeners`` as a message leaves, but not
in a flood.
"""
import json
import os
import sys
import threading
import time

import actionlib
import genpy
import rospy

from behavior_controller.robot.declarations import Action, Service
from behavior_controller.robot.requests import Say, SetAttention
from behavior_controller.robot.interfaces import DEFAULT
from behavior_controller.ros.handshakes import bound_handshakes
from behavior_controller.ros.types import TYPES
from behavior_controller.config.settings import defaults
from behavior_controller.simulation import behaviour
from unit_tests.robot import ros_messages
from behavior_controller.simulation.faults import REFUSED, WRONG
from behavior_controller.simulation.journal import JournalEntry, plain
from behavior_controller.simulation.behaviour import SERVICES, TOPICS
from behavior_controller.simulation.visitor import ENGAGES
from behavior_controller.simulation.world import world as read_world

EXHIBITS = 2
"""The first exhibits of the simulated building: a tour of them all would take long."""
FAULTS = {"refuse": REFUSED, "odd": WRONG}
CALLS_END = 5.0  # s


def visited(interface):
    """Return the world of that robot with a visitor who is always there, returns its gaze and
    answers yes."""
    world = read_world(ENGAGES, defaults(robotInterface=interface))
    for request in (SetAttention("seeking"), Say(world.visitor.manners.questions[0])):
        service = world.settings.interface.service(type(request))
        fields = plain(TYPES[service]._request_class(*service.fields(request)))
        world.visitor.notice(JournalEntry(0.0, service.node, service.name, 1, fields))
    world.visitor.gaze()  # the second attempt succeeds
    return world._replace(knowledge=world.knowledge._replace(
        exhibits=world.knowledge.exhibits[:EXHIBITS]))


def reply(service, request, fault, world):
    """Return the response of the simulated node, which has that fault or none, to a srv request."""
    fields = plain(request)
    fault = behaviour.possible(fault, service, ros_messages.response_fields(service))
    simulated = SERVICES[service.request]
    is_done = fault is None and simulated.object_to(fields) is None
    answer = simulated.answer(fields, world) if is_done else None
    return ros_messages.response(service, answer, fault)


def wrong_type(offer, offers):
    """Return the last type of ``offers`` that is not the type of ``offer``."""
    return next(TYPES[other] for other in reversed(offers) if other.type != offer.type)


def garbled(kind):
    """Return a type of messages of that kind which cannot be decoded."""
    return type("Garbled", (kind, ), {"serialize": lambda message, buff: buff.write(b"\xff")})


def report(**event):
    """Write one line, at once and whole."""
    sys.stdout.write(json.dumps(dict(event, time=time.monotonic())) + "\n")
    sys.stdout.flush()


class CommandedService:
    """One service, whose ``mode`` may change at any time."""

    def __init__(self, service, mode, world):
        self.mode = mode
        self._service, self._world = service, world
        self._changed, self._under_way = threading.Condition(), 0
        if mode == "wrong":
            rospy.Service(service.name, wrong_type(service, services_of(world.settings.interface)),
                          lambda request: None)
        elif mode != "absent":
            rospy.Service(service.name, TYPES[service], self._answer)

    def set_mode(self, mode):
        """Change the behaviour; calls that hang go on."""
        with self._changed:
            self.mode = mode
            self._changed.notify_all()

    def begin_again(self, mode):
        """Change the behaviour when all calls have ended."""
        self.set_mode("done")
        with self._changed:
            self._changed.wait_for(lambda: not self._under_way, CALLS_END)
        self.set_mode(mode)

    def _answer(self, request):
        with self._changed:
            self._under_way += 1
        try:
            return self._work(request)
        finally:
            with self._changed:
                self._under_way -= 1
                self._changed.notify_all()

    def _work(self, request):
        report(service=self._service.name, fields=plain(request))
        if self.mode == "exit":
            os._exit(1)
        if self.mode == "raise":
            raise ValueError("the robot was commanded\nto raise")
        with self._changed:
            self._changed.wait_for(lambda: self.mode != "hang")
        report(answered=self._service.name)
        return reply(self._service, request, FAULTS.get(self.mode), self._world)


def services_of(interface):
    """Return the services of a robot, without its actions."""
    return [service for service in behaviour.services(interface) if type(service) is Service]


class CommandedGoals:
    """An action that carries out requests."""

    def __init__(self, action, mode):
        self.mode, self._action = mode, action
        self._server = actionlib.SimpleActionServer(
            action.name, TYPES[action], self._carry_out, auto_start=False)
        self._server.start()

    def set_mode(self, mode):
        """Change the behaviour; a goal that hangs goes on."""
        self.mode = mode

    def _carry_out(self, goal):
        server, success = self._server, self._action.success
        report(service="action " + self._action.name, fields=plain(goal))
        while self.mode == "deaf" or self.mode == "hang" and not server.is_preempt_requested():
            feedback = TYPES[self._action]().action_feedback.feedback
            for field, kind in zip(feedback.__slots__, feedback._slot_types):
                setattr(feedback, field, "playing" if kind == "string" else 2.1)
            server.publish_feedback(feedback)
            time.sleep(0.05)
        result = server.get_default_result()
        setattr(result, success.field, success.refused if self.mode == "refuse" else success.done)
        report(answered="action " + self._action.name)
        if server.is_preempt_requested():
            report(cancelled=True)
            server.set_preempted(result)
        elif self.mode == "abort":
            server.set_aborted(result, "no pose")
        else:
            server.set_succeeded(result)


class CommandedAction:
    """The action of speech recognition: a goal under way hears what is ``said``."""

    def __init__(self, action, mode):
        self._mode, self.said = mode, None
        ros_messages.serve_action(action, self._listen)

    def _listen(self, server, seconds):
        self.said = None
        report(goal=seconds)
        if self._mode == "exit":
            os._exit(1)
        if self._mode == "abort":
            server.set_aborted(text="the microphone is away")
            return
        deadline = time.monotonic() + seconds
        while not server.is_preempt_requested() and (self._mode == "hang" or self.said is None and (
            self._mode == "late" or time.monotonic() < deadline)):
            time.sleep(0.02)
        if server.is_preempt_requested():
            report(cancelled=True)
            server.set_preempted()
        else:
            ros_messages.succeed(server, self.said or "")


class CommandedTopic:
    """One topic, published to when commanded, or as often as commanded."""

    def __init__(self, topic, mode, world):
        self._topic, self._world = topic, world
        kind = wrong_type(topic,
                          world.settings.interface.topics) if mode == "wrong" else TYPES[topic]
        self._garbage = garbled(kind)() if mode == "garbled" else None
        self._publisher = rospy.Publisher(topic.name, kind, queue_size=1000)
        self._message = None
        self._flood, self._is_over = None, threading.Event()

    def publish(self, values, hertz):
        """Publish a message of these field values once, or ``hertz`` times per second from now on;
        nothing else after it."""
        self.rest()
        self._message = self._made(values)
        if hertz:
            self._is_over.clear()
            self._flood = threading.Thread(target=self._repeat, args=(hertz, ), daemon=True)
            self._flood.start()
        else:
            report(topic=self._topic.name, listeners=self._publisher.get_num_connections())
            self._publisher.publish(self._message)

    def rest(self):
        """Publish nothing any more."""
        if self._flood is not None:
            self._is_over.set()
            self._flood.join()
            self._flood = None

    def _made(self, values):
        if self._garbage is not None:
            return self._garbage
        if not values:
            simulated = TOPICS[self._topic.name]
            return ros_messages.message(self._topic,
                                        simulated.fields(simulated.content(self._world)))
        message = TYPES[self._topic]()
        genpy.message.fill_message_args(message, values)
        return message

    def _repeat(self, hertz):
        due = time.monotonic()
        while not self._is_over.wait(max(0.0, due - time.monotonic())):
            self._publisher.publish(self._message)
            due += 1.0 / hertz


def main():
    """Offer everything, then obey stdin until it ends."""
    modes = dict(argument.rsplit("=", 1) for argument in rospy.myargv()[1:])
    rospy.init_node("commanded_robot", disable_signals=True)
    bound_handshakes()
    world = visited(modes.get("interface", DEFAULT.name))
    interface = world.settings.interface
    services = {service.name: CommandedService(service, modes.get(service.name, "done"), world)
                for service in services_of(interface)}
    for action in interface.services:
        name = "action " + action.name
        if isinstance(action, Action) and modes.get(name) != "absent":
            services[name] = CommandedGoals(action, modes.get(name, "done"))
    topics = {topic.name: CommandedTopic(topic, modes.get(topic.name), world)
              for topic in behaviour.topics(interface) if modes.get(topic.name) != "absent"}
    actions = [CommandedAction(topic.action, modes[topic.action.name]) for topic in interface.topics
               if topic.action is not None and topic.action.name in modes]
    report(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        if "say" in order:
            actions[0].said = order["say"]
        elif "again" in order:
            for topic in topics.values():
                topic.rest()
            for name, service in services.items():
                if name.startswith("/"):
                    service.begin_again(order["again"].get(name, "done"))
            report(again=True)
        elif "topic" in order:
            topics[order["topic"]].publish(order["values"], order["hertz"])
        else:
            services[order["name"]].set_mode(order["mode"])
    rospy.signal_shutdown("stdin has ended")


if __name__ == "__main__":
    main()
