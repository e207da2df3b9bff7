#!/usr/bin/env python3
"""A robot for the tests: one node that offers the services and topics of D5.4.3, and behaves as commanded.

Arguments are ``name=mode``: how the service or topic behaves from the start. Modes of a service: ``done`` (default),
``refuse``, ``odd`` (a success value that means nothing), ``raise``, ``hang`` (until the mode changes), ``exit`` (the
process dies while it works), ``absent``, ``wrong`` (another type). Modes of a topic: ``absent``, ``wrong``. With the
argument ``interface=release-1.0`` it offers what that robot does. Modes of its action, which is absent unless it has
one: ``done`` (a goal ends with what is said, or with its time), ``abort``, ``hang``, ``exit``.

Each line on stdin is a JSON object: ``{"name": …, "mode": …}``, or ``{"topic": …, "values": [fields], "hertz": 0}``,
which publishes once, or from now on so many times per second, or ``{"say": text}``, which the action hears. Each line on stdout too: ``{"ready": true}`` once,
``{"service", "fields", "time"}`` for each request as it arrives, ``{"answered", "time"}`` before its answer, and
``{"topic", "time"}`` as a message leaves, but not in a flood; times are those of the monotonic clock.
"""
import json
import os
import sys
import threading
import time

import actionlib
import genpy
import rospy
from cssr_system.msg import (exhibitInfoMessage, faceDetectionMessage, gestureMessage, locationMessage,
                             overtAttentionMessage, recogniseSpeechAction, recogniseSpeechResult)
from cssr_system.srv import (animateBehaviorService, gestureExecutionService, knowledgeBaseService,
                             overtAttentionService, robotNavigationService, robotPoseService, sayTextService,
                             speechEnabledService, speechLanguageService, tabletPromptService, textService)
from std_msgs.msg import String

from behavior_controller.interface.document import INTERFACE
from behavior_controller.ros.types import TYPES


def _places(request):
    names = {"entrance": ["entrance"], "home": ["home"]}.get(request.parameters, ["pepper", "arm"])
    return [exhibitInfoMessage(name, name + " one", name + " two", locationMessage(1.0, 2.0, 90.0),
                               gestureMessage(1.0, 2.0, 3.0)) for name in names]


SERVICES = {  # name: type, values of the response for success, refusal and an odd answer
    "/animateBehaviour/set_activation": (animateBehaviorService, lambda r: ["1"], ["0"], ["perhaps"]),
    "/gestureExecution/perform_gesture": (gestureExecutionService, lambda r: [1], [0], [7]),
    "/knowledgeBase/query": (knowledgeBaseService, lambda r: [True, _places(r)], [False, []],
                             [True, [exhibitInfoMessage(location=locationMessage(float("nan"), 0.0, 0.0))]]),
    "/overtAttention/set_mode": (overtAttentionService, lambda r: [1], [0], [7]),
    "/robotNavigation/set_goal": (robotNavigationService, lambda r: [1], [0], [7]),
    "/tabletEvent/prompt_and_get_response": (textService, lambda r: [True, "Yes"], [False, ""], [False, ""]),
    "/textToSpeech/say_text": (textService, lambda r: [True, "said"], [False, ""], [False, ""]),
}
RELEASE_1_0 = {
    "/animateBehaviour/setActivation": SERVICES["/animateBehaviour/set_activation"],
    "/gestureExecution/perform_gesture": SERVICES["/gestureExecution/perform_gesture"],
    "/overtAttention/set_mode": SERVICES["/overtAttention/set_mode"],
    "/robotLocalization/set_pose": (robotPoseService, lambda r: [True], [False], [False]),
    "/robotNavigation/set_goal": SERVICES["/robotNavigation/set_goal"],
    "/speechEvent/set_enabled": (speechEnabledService, lambda r: [1], [0], [7]),
    "/speechEvent/set_language": (speechLanguageService, lambda r: [1], [0], [7]),
    "/tabletEvent/prompt_and_get_response": (tabletPromptService, lambda r: [True], [False], [False]),
    "/textToSpeech/say_text": (sayTextService, lambda r: [True], [False], [False]),
}
ACTION = "/speechEvent/recognise_speech_action"
TOPICS = {"/faceDetection/data": faceDetectionMessage, "/overtAttention/mode": overtAttentionMessage,
          "/speechEvent/text": String}


def _declared(service):
    """Return the row of SERVICES for a service of which these tests say nothing."""
    kind, (field, done, refused) = TYPES[service], service.success

    def response(value):
        return [value if slot == field else getattr(kind._response_class(), slot) for slot in kind._response_class.__slots__]
    return kind, lambda request: response(done), response(refused), response(refused)


for service in INTERFACE.services:
    SERVICES.setdefault(service.name, _declared(service))
for topic in INTERFACE.topics:
    TOPICS.setdefault(topic.name, TYPES[topic])


def tell(**event):
    """Write one line, at once and whole."""
    sys.stdout.write(json.dumps(event) + "\n")
    sys.stdout.flush()


class StubService:
    """One service, whose ``mode`` may change at any time."""

    def __init__(self, name, mode, kind):
        self.name, self.mode = name, mode
        self.type, self.done, self.refusal, self.odd = kind
        self._changed = threading.Condition()
        if mode == "wrong":
            rospy.Service(name, robotNavigationService if self.type is textService else textService, lambda r: None)
        elif mode != "absent":
            rospy.Service(name, self.type, self.answer)

    def set_mode(self, mode):
        """Change the behaviour; calls that hang go on."""
        with self._changed:
            self.mode = mode
            self._changed.notify_all()

    def answer(self, request):
        """Answer as the mode says."""
        tell(service=self.name, fields={slot: getattr(request, slot) for slot in request.__slots__},
             time=time.monotonic())
        if self.mode == "exit":
            os._exit(1)
        if self.mode == "raise":
            raise ValueError("the stub was told\nto raise")
        with self._changed:
            self._changed.wait_for(lambda: self.mode != "hang")
        tell(answered=self.name, time=time.monotonic())
        values = {"refuse": self.refusal, "odd": self.odd}.get(self.mode)
        return self.type._response_class(*(self.done(request) if values is None else values))


class StubAction:
    """The action of speech recognition: real goals, and what is said by order."""

    def __init__(self, mode):
        self.mode = mode
        self._said = None
        self._changed = threading.Condition()
        self._server = actionlib.SimpleActionServer(ACTION, recogniseSpeechAction, self._work, auto_start=False)
        self._server.start()

    def say(self, text):
        """Let a goal under way hear ``text``."""
        with self._changed:
            self._said = text
            self._changed.notify_all()

    def _work(self, goal):
        with self._changed:
            self._said = None
        tell(goal=goal.wait, time=time.monotonic())
        if self.mode == "exit":
            os._exit(1)
        if self.mode == "abort":
            self._server.set_aborted(text="the microphone is away")
            return
        ends = time.monotonic() + goal.wait
        with self._changed:
            while (self._said is None or self.mode == "hang") and not self._server.is_preempt_requested() and (
                    time.monotonic() < ends or self.mode == "hang"):
                self._changed.wait(0.05)
            said = self._said or ""
        if self._server.is_preempt_requested():
            tell(cancelled=True, time=time.monotonic())
            self._server.set_preempted()
        else:
            self._server.set_succeeded(recogniseSpeechResult(said))


class StubTopic:
    """One topic, published to when told, or as often as told."""

    def __init__(self, name, mode):
        self._name = name
        self.type = TOPICS[name]
        kind = self.type if mode != "wrong" else overtAttentionMessage if self.type is String else String
        self._publisher = rospy.Publisher(name, kind, queue_size=1000)
        self._message = None
        self._hertz = 0

    def publish(self, values, hertz):
        """Publish a message of these field values once, or ``hertz`` times per second from now on."""
        message = self.type()
        genpy.message.fill_message_args(message, values)
        self._message = message
        was_quiet, self._hertz = not self._hertz, hertz
        if not hertz:
            tell(topic=self._name, time=time.monotonic())
            self._publisher.publish(message)
        elif was_quiet:
            threading.Thread(target=self._flood, daemon=True).start()

    def _flood(self):
        due = time.monotonic()
        while self._hertz:
            self._publisher.publish(self._message)
            due += 1.0 / (self._hertz or 1)
            time.sleep(max(0.0, due - time.monotonic()))


def main():
    """Offer everything, then obey stdin until it ends."""
    modes = dict(argument.rsplit("=", 1) for argument in rospy.myargv()[1:])
    rospy.init_node("stub_robot", disable_signals=True)
    is_document = modes.get("interface", "D5.4.3") == "D5.4.3"
    services = {name: StubService(name, modes.get(name, "done"), kind)
                for name, kind in (SERVICES if is_document else RELEASE_1_0).items()}
    topics = {name: StubTopic(name, modes.get(name)) for name in TOPICS if modes.get(name) != "absent" and (
        is_document or name != "/faceDetection/data")}
    action = StubAction(modes[ACTION]) if ACTION in modes else None
    tell(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        if "say" in order:
            action.say(order["say"])
        elif order.get("name") == ACTION:
            action.mode = order["mode"]
        elif "topic" in order:
            topics[order["topic"]].publish(order["values"], order["hertz"])
        else:
            services[order["name"]].set_mode(order["mode"])
    rospy.signal_shutdown("stdin has ended")


if __name__ == "__main__":
    main()
