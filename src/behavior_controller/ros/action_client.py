"""The client of an action: carries one goal after the other to a server that may come, go, refuse
or hang; for requests, and to get visitors' utterances.

actionlib's client registers with the master and may wait for it, so it is only used on a separate
thread.
"""
import math
import threading
import time
from functools import partial
from typing import Any, Callable, Optional, Union

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from behavior_controller.foreign_code import described
from behavior_controller.robot.declarations import Action, Message
from behavior_controller.robot.gateway import Cause, Failure, result_of
from behavior_controller.robot.requests import Answer, Listen, Request
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.request_thread import Job, RequestThread
from behavior_controller.ros.tcpros import (
    CONNECT_LIMIT, RETRY_INTERVAL, Trouble, ask_master, is_silent)
from behavior_controller.ros.types import TYPES, filled
from behavior_controller.text import clean

ACK_LIMIT = 2.0
"""Seconds within which a server acknowledges a goal, and sends the result of one whose status says
that it was done.

Status and result come by two connections, in any order.
"""

_FAILED = (GoalStatus.ABORTED, GoalStatus.REJECTED, GoalStatus.PREEMPTED, GoalStatus.RECALLED)
"""The statuses of a goal that has ended without being done."""

PARAMETERS = ("actionlib_client_pub_queue_size", "actionlib_client_sub_queue_size")
"""Parameters that actionlib reads, unchecked; of a wrong type it makes half a client."""

ROUND_WHEN_CONNECTING = 0.02
"""Seconds between two looks for its server while a request waits for it."""

FEEDBACK_GAP = 0.5
"""Seconds between two reports of feedback: each wakes the tree, and a server may send it often."""

ROUND_WHEN_LISTENING = 0.05
"""Seconds between two looks at the action while a mission listens."""

REGISTER_AGAIN = 1.0
"""Seconds without a connection to a server that the master lists before the client's topics are
registered once more; each further time it is twice as long, as a dead server stays listed."""

GOAL_PAUSE = 0.25
"""Seconds between a goal without a result and the next: a server may refuse each at once."""


class GoalThread(RequestThread):
    """A thread that carries requests as goals of one action, one at a time."""

    IDLE = RETRY_INTERVAL
    READS_FEEDBACK = True

    def __init__(self, action: Action):
        self._action = action
        self._client: Any = None
        self.news = threading.Event()
        """Set when a goal has got further, or by another thread that has something to do."""
        self._reported, self._reported_at = "", -math.inf
        self._begin_connecting()
        super().__init__(action)
        DIRECTORY.subscribe(f"{self.name}/status", "actionlib_msgs/GoalStatusArray")
        DIRECTORY.subscribe(f"{self.name}/result", f"{action.type}ActionResult")
        DIRECTORY.subscribe(f"{self.name}/feedback", f"{action.type}ActionFeedback")

    @property
    def is_there(self) -> bool:
        """Whether the client is connected to a server, for feedback too if that is read."""
        client = self._client
        if client is None:
            return False
        sent, heard = [client.pub_goal, client.pub_cancel], [client.status_sub, client.result_sub]
        heard += [client.feedback_sub] if self.READS_FEEDBACK else []
        return all(map(has_subscriber, sent)) and all(map(has_publisher, heard))

    @property
    def _is_offered(self) -> bool:
        return DIRECTORY.is_published(f"{self.name}/status")

    def cut(self) -> bool:
        """Cancel the goal under way."""
        is_reusable = super().cut()
        self.news.set()
        return is_reusable

    def idle(self) -> None:
        """Connect when there is a server. Raises ``Trouble``, and what rospy raises."""
        if self.is_there:
            self._begin_connecting()
        elif self._is_offered:
            self._connect()

    def _connect(self) -> None:
        """Make the client of a server that the master lists, or its connections once more."""
        if self._client is not None:
            self._register_again()
        else:
            for name in map(rospy.resolve_name, PARAMETERS):
                value = ask_master("getParam", name)
                if value is not None and type(value) is not int:
                    raise Trouble(Cause.TYPE_MISMATCH, f"the parameter {name} is {value!r}, and "
                                  f"must be a whole number: set it, or rosparam delete {name}")
            self._client = actionlib.ActionClient(self._action.name, TYPES[self._action])
            self._begin_connecting()

    def _begin_connecting(self) -> None:
        self._patience = REGISTER_AGAIN
        self._register_again_at = time.monotonic() + self._patience

    def _register_again(self) -> None:
        """Have the master tell both sides of each other once more.

        rospy connects by the list of nodes that reaches it last, which may be an older one: then it
        would never connect.
        """
        client, now = self._client, time.monotonic()
        if now >= self._register_again_at:
            self._patience *= 2
            self._register_again_at = now + self._patience
            DIRECTORY.register(client.pub_goal, client.pub_cancel, client.status_sub,
                               client.result_sub, client.feedback_sub)

    def exchange(self, job: Job) -> Union[Answer, Failure]:
        """Send a goal once the server is there, and wait for its end."""
        self._reported, self._reported_at = "", -math.inf
        deadline = time.monotonic() + CONNECT_LIMIT
        if not self.is_there:
            self._begin_connecting()
            DIRECTORY.server(self.name, CONNECT_LIMIT)
        while job.cut.is_set() or not self.is_there:
            if job.cut.is_set() or time.monotonic() > deadline:
                raise Trouble(Cause.NOT_REACHABLE,
                              "the master lists it, but not all of its topics connect")
            self._connect()
            self.wait(ROUND_WHEN_CONNECTING)
        result = self.achieve(job.request, job.cut.is_set, partial(self._report, job))
        return result_of(self._action, result, self.name)

    def achieve(self, request: Request, is_dropped: Callable[[], bool],
                reported: Optional[Callable[[Any, Message], None]] = None) -> Message:
        """Send a goal to the server that is there, and return its result; ``reported`` gets its
        feedback, on rospy's threads.

        Raises ``Trouble``: ``REFUSED`` by the server, ``CONNECTION_LOST`` with it, ``NO_ANSWER`` if
        it does not acknowledge the goal or ``is_dropped()``, and ``UNUSABLE_ANSWER`` if the result
        of one that was done does not come. ``TYPE_MISMATCH``: it does not fit, and is not sent.
        """
        message = filled(TYPES[self._action]().action_goal.goal, self._action, request)
        sent_at, result_due = time.monotonic(), math.inf
        goal = self._client.send_goal(message, lambda _: self.news.set(), reported)
        self.is_asked = True
        while not is_dropped():
            state, status, now = goal.get_comm_state(), goal.get_goal_status(), time.monotonic()
            has_ended = state == CommState.WAITING_FOR_RESULT
            if state == CommState.DONE:
                result = goal.get_result()
                if status == GoalStatus.SUCCEEDED and result is not None:
                    return result
                raise _refusal(goal)
            if has_ended:
                result_due = min(result_due, now + ACK_LIMIT)
            if not self.is_there:
                raise Trouble(Cause.CONNECTION_LOST, "its server is gone")
            if has_ended and status in _FAILED:
                raise _refusal(goal)  # the status says why: no result is needed
            if now > result_due:
                raise Trouble(Cause.UNUSABLE_ANSWER, "its result did not come")
            if state == CommState.WAITING_FOR_GOAL_ACK and now > sent_at + ACK_LIMIT:
                # rospy may have sent it to a server that has ended, and counts that as a success
                goal.cancel()
                raise Trouble(Cause.NO_ANSWER, f"the goal was not acknowledged in {ACK_LIMIT:g} s")
            self.wait(RETRY_INTERVAL)
        goal.cancel()
        raise Trouble(Cause.NO_ANSWER, "cancelled")

    def wait(self, seconds: float) -> None:
        """Return when there is news, after ``seconds`` at the latest."""
        self.news.wait(seconds)
        self.news.clear()

    def _report(self, job: Job, goal: Any, feedback: Message) -> None:
        """Pass on what the server reports, if it is new; on one of rospy's threads."""
        now = time.monotonic()
        if now < self._reported_at + FEEDBACK_GAP:
            return
        try:
            text = self._action.feedback(feedback)
        except BaseException as error:  # another package may raise anything
            text = clean(described(error))
        if text and text != self._reported:
            self._reported, self._reported_at = text, now
            job.feedback(text)


def has_subscriber(topic: rospy.Publisher) -> bool:
    """Return whether a node is there to get messages; rospy notices an end only when it sends."""
    sockets = [connection.socket for connection in topic.impl.connections]
    return any(sock is not None and is_silent(sock) for sock in sockets)


def has_publisher(topic: rospy.Subscriber) -> bool:
    """Return whether messages of a node come in; rospy counts a connection before its handshake,
    until which messages are lost."""
    return any(connection.socket and connection.md5sum for connection in topic.impl.connections)


def _refusal(goal: Any) -> Trouble:
    """Return in words how a goal ended, and why if its server says so. One that its server does not
    know any more, as after a restart, may have been carried out."""
    if goal.get_goal_status() == GoalStatus.LOST:
        return Trouble(Cause.CONNECTION_LOST, "its server does not know the goal any more")
    how, why = GoalStatus.to_string(goal.get_goal_status()).lower(), goal.get_goal_status_text()
    return Trouble(Cause.REFUSED, f"{how} ({why})" if why else how)


class SpeechActionClient(GoalThread):
    """The action in place of a topic: while a mission listens and the topic has no publisher, or
    the mission prefers the action, the action gets one goal after the other, and each result
    becomes a message of the topic.

    ``listen`` is for the tick thread and never waits; results arrive on this thread.
    """

    READS_FEEDBACK = False

    def __init__(self, action: Action[Listen], is_published: Callable[[], bool],
                 receive: Callable[[Any], None], wake: Callable[[], None],
                 warn: Callable[[str], None], now: Callable[[], float] = time.monotonic):
        """``is_published`` returns whether the topic itself has a publisher; ``receive`` gets each
        utterance, and ``wake`` is called when a goal has ended. ``now``: of the mission's clock."""
        self._is_published, self._receive, self._now = is_published, receive, now
        self._wake, self._warn = wake, warn
        self._warned = ""  # the last warning
        self._until = -math.inf  # when the listening ends
        self._is_preferred = False  # a publisher of the topic makes no difference
        self._is_busy = False  # a goal is under way
        super().__init__(action)
        self.start()

    def listen(self, seconds: float, is_preferred: bool = False) -> None:
        """Have goals sent for ``seconds`` from now, even if the topic is published and the action
        ``is_preferred``; 0: stop, and cancel the current goal.

        A goal that is under way when the time is over has its own limit for its result.
        """
        self._is_preferred = is_preferred
        self._until = self._now() + seconds if seconds > 0 else -math.inf
        self.carry(Listen(seconds), lambda result: None, lambda text: None)
        self.news.set()

    @property
    def is_under_way(self) -> bool:
        """Whether a goal was sent in time whose result may still come."""
        return self._is_busy and not self._is_late()

    def _is_late(self) -> bool:
        return self._now() >= self._until + self._action.deadline

    def idle(self) -> None:
        """Connect when there is a server, or warn of what is in the way."""
        try:
            super().idle()
        except (rospy.ROSException, OSError):
            pass  # the node ends, or the master does not answer: it is tried again
        except Exception as error:  # Trouble, or whatever rospy raises on a broken answer
            self._warn_once(f"cannot be used: {clean(str(error), 500)}")

    def exchange(self, job: Job) -> Answer:
        """Send one goal after the other while the mission listens."""
        while self._now() < self._until:
            self.idle()
            if self._is_preferred and self._is_published() and not self._is_offered:
                self._warn_once("is not there: the topic is used in its place")
            if not self.is_there or self._is_published() and not self._is_preferred:
                self.wait(ROUND_WHEN_LISTENING)
                continue
            has_heard = self._has_heard()
            self._wake()
            if not has_heard:
                time.sleep(GOAL_PAUSE)
        return Answer()

    def _has_heard(self) -> bool:
        """Send a goal, and return whether it has brought words.

        A failure is warned of once, and published in the form of an error on the topic, unless a
        result was lost, as the first one of a server that was started anew: the next goal brings
        another.
        """
        self._is_busy, due = True, self._until + self._action.deadline
        try:
            wish = Listen(round(max(0.0, self._until - self._now()), 1))
            utterance = self._action.answer(self.achieve(wish, self._is_late)).response
            self._warned = ""
            if utterance:
                self._receive(utterance)
            return bool(utterance)
        except Trouble as trouble:
            if self._now() >= due:
                self._warn_once("has given no result in time")
            elif not self._is_late():  # otherwise the mission listens no longer
                self._warn_once(f"failed: {trouble}")
                # after a lost goal or result another goal is sent
                if trouble.cause not in (Cause.NO_ANSWER, Cause.UNUSABLE_ANSWER):
                    self._receive(f"Error: {self.name} {trouble}")
            return False
        finally:
            self._is_busy = False

    def _warn_once(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self._warn(f"the action {self.name} {text}")
