"""Gets the visitors' utterances by an action, if the robot offers one instead of the topic.

While a mission listens and the topic has no publisher, the action gets one goal after the other,
and each result becomes a message of the topic.
"""
import math
import threading
import time
from typing import Any, Callable, Union

import rospy

from behavior_controller.robot.declarations import Action, Message
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.requests import Listen
from behavior_controller.ros.action_client import ActionClient, ROUND
from behavior_controller.ros.tcpros import Trouble
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.text import clean

ROUND_WHEN_LISTENING = 0.05
"""Seconds between two looks at the action while a mission listens."""

REST = 0.25
"""Seconds between a goal without a result and the next: a server may refuse each at once."""


class SpeechActionClient:
    """The action in place of a topic: ``listen`` is for the tick thread and never waits; results
    arrive on a thread of their own."""

    def __init__(self, action: Action[Listen], is_published: Callable[[], bool],
                 receive: Callable[[Any], None], wake: Callable[[], None],
                 warn: Callable[[str], None]):
        """``is_published`` returns whether the topic itself has a publisher; ``receive`` gets each
        utterance, and ``wake`` is called when a goal has ended."""
        self._action = action
        self._is_published = is_published
        self._receive = receive
        self._wake = wake
        self._warn = warn
        self._warned = ""  # the last warning
        self._until = -math.inf  # when the listening ends
        self._again_at = -math.inf  # when the next goal may be sent
        self._changed = threading.Event()
        self._client = ActionClient(action, self._changed)
        start_thread("hearing " + action.name, self._work)

    @property
    def is_there(self) -> bool:
        """Whether the client is connected to a server of the action."""
        return self._client.is_there

    def listen(self, seconds: float) -> None:
        """Have goals sent for ``seconds`` from now; 0: stop, and cancel the current goal.

        A goal that is under way when the time is over has its own limit for its result.
        """
        self._until = time.monotonic() + seconds if seconds > 0 else -math.inf
        self._changed.set()

    @property
    def is_under_way(self) -> bool:
        """Whether a goal was sent in time whose result may still come."""
        return self._client.is_busy and not self._is_late

    @property
    def _is_listening(self) -> bool:
        return time.monotonic() < self._until

    @property
    def _is_late(self) -> bool:
        return time.monotonic() >= self._until + self._action.deadline

    def _work(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._go_on()
            except (rospy.ROSException, OSError):
                pass  # the node ends, or the master does not answer: it is tried again
            except Exception as error:  # Trouble, or whatever rospy raises on a broken answer
                self._warn_once(f"cannot be used: {clean(str(error), 500)}")
            self._changed.wait(ROUND_WHEN_LISTENING if self._is_listening else ROUND)
            self._changed.clear()

    def _go_on(self) -> None:
        """Do what is due: connect to the server, take a result, send a goal, or abandon one."""
        client = self._client
        client.connect()
        result = client.result()
        if result is not None:
            self._end(result)
        is_due = self._is_listening and time.monotonic() >= self._again_at
        if client.is_busy and self._is_late:
            client.cancel()
        elif not client.is_busy and is_due and client.is_there and not self._is_published():
            client.send(Listen(max(0.0, self._until - time.monotonic())))

    def _end(self, result: Union[Message, Trouble]) -> None:
        """Process the end of a goal.

        A failure is warned of once, and published in the form of an error on the topic, unless a
        result was lost, as the first one of a server that was started anew: the next goal brings
        another.
        """
        self._again_at = time.monotonic() + REST
        if not isinstance(result, Trouble):
            self._warned = ""
            utterance = self._action.answer(result).response
            if utterance:
                self._again_at = -math.inf
                self._receive(utterance)
        elif result.cause is not Cause.NO_ANSWER:  # then another goal is sent
            self._warn_once(f"failed: {result}")
            if result.cause is not Cause.UNUSABLE_ANSWER:
                self._receive(f"Error: {self._client.name} {result}")
        self._wake()

    def _warn_once(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self._warn(f"the action {self._client.name} {text}")
