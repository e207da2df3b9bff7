"""The client of an action: carries one goal after the other to a server that may come, go, refuse
or hang; for requests, and to get visitors' utterances.

actionlib's client registers with the master and may wait for it, so it is only used on a separate
thread.
"""
import math
import threading
import time
from typing import Any, Callable, Optional, Union

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from behavior_controller.foreign_code import described
from behavior_controller.robot.declarations import Action, Message
from behavior_controller.robot.gateway import Cause, Failure, NO_ACTION, result_of
from behavior_controller.robot.requests import Answer, Listen, Request
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.request_thread import Job, RequestThread
from behavior_controller.ros.tcpros import CONNECT_LIMIT, ROUND, Trouble, ask_master
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.ros.types import TYPES, filled, resolved
from behavior_controller.text import clean

PATIENCE = 2.0
"""Seconds within which a server acknowledges a goal, and sends the result of one whose status says
that it was done.

Status and result come by two connections, in any order.
"""

FAILED = (GoalStatus.ABORTED, GoalStatus.REJECTED, GoalStatus.PREEMPTED, GoalStatus.RECALLED)
"""The statuses of a goal that has ended without being done."""

PARAMETERS = ("actionlib_client_pub_queue_size", "actionlib_client_sub_queue_size")
"""Parameters that actionlib reads, unchecked; of a wrong type it makes half a client."""

PARTS = (("status", "actionlib_msgs/GoalStatusArray"), ("result", "{}ActionResult"),
         ("feedback", "{}ActionFeedback"))
"""The topics of an action's server, and their types."""

ROUND_WHEN_CONNECTING = 0.02
"""Seconds between two looks for its server while a request waits for it."""

FEEDBACK_GAP = 0.5
"""Seconds between two reports of feedback: each wakes the tree, and a server may send it often."""

ROUND_WHEN_LISTENING = 0.05
"""Seconds between two looks at the action while a mission listens."""

REST = 0.25
"""Seconds between a goal without a result and the next: a server may refuse each at once."""


class ActionClient:
    """Carries one goal at a time. All of it is for one thread, but for what says otherwise."""

    def __init__(self, action: Action, reported: Optional[Callable[[Message], None]] = None):
        """``reported`` gets feedback, on rospy's threads."""
        self.name = resolved(action)
        self._action = action
        self._type = TYPES[action]
        self.news = threading.Event()
        """Set when the goal has got further, or by another thread that has something to do."""
        self._reported = reported
        self._client: Optional[actionlib.ActionClient] = None
        self._goal: Any = None  # the handle of the goal under way
        self._sent_at = -math.inf
        self._result_due = math.inf  # known once the goal's status says that it was done
        for part, kind in PARTS:
            DIRECTORY.subscribe(f"{self.name}/{part}", kind.format(action.type))

    @property
    def is_there(self) -> bool:
        """Whether the client is connected to a server, for feedback too if that is read."""
        client = self._client
        if client is None:
            return False
        topics = [client.pub_goal, client.pub_cancel, client.status_sub, client.result_sub]
        topics += [client.feedback_sub] if self._reported is not None else []
        return all(topic.get_num_connections() for topic in topics)

    @property
    def is_busy(self) -> bool:
        """Whether a goal is under way. Any thread may ask."""
        return self._goal is not None

    def connect(self) -> None:
        """Connect when there is a server. Raises ``Trouble``, and what rospy raises."""
        if self._client is None and DIRECTORY.is_published(f"{self.name}/status"):
            for name in map(rospy.resolve_name, PARAMETERS):
                value = ask_master("getParam", name)
                if value is not None and type(value) is not int:
                    raise Trouble(Cause.TYPE_MISMATCH, f"the parameter {name} is {value!r}, and "
                                  f"must be a whole number: set it, or rosparam delete {name}")
            self._client = actionlib.ActionClient(self._action.name, self._type)

    def send(self, request: Request) -> None:
        """Send a goal. Raises ``Trouble`` if it does not fit, or the client was never connected."""
        goal = filled(self._type().action_goal.goal, self._action, request)
        if self._client is None:
            raise Trouble(Cause.NOT_ADVERTISED, NO_ACTION)
        self._sent_at, self._result_due = time.monotonic(), math.inf
        self._goal = self._client.send_goal(goal, lambda goal: self.news.set(), self._report)

    def cancel(self) -> None:
        """Cancel the goal under way, and forget it."""
        self._goal.cancel()
        self._goal = None

    def result(self) -> Union[Message, Trouble, None]:
        """Return once what has become of the goal; None: it is under way, or there is none.

        That is its result, or why there is none: ``REFUSED`` by the server, ``CONNECTION_LOST``
        with it, ``NO_ANSWER`` if it does not acknowledge the goal, and ``UNUSABLE_ANSWER`` if the
        result of one that was done does not come.
        """
        result = self._outcome(self._goal) if self.is_busy else None
        if result is not None:
            self._goal = None
        return result

    def _outcome(self, goal: Any) -> Union[Message, Trouble, None]:
        state, status, now = goal.get_comm_state(), goal.get_goal_status(), time.monotonic()
        if state == CommState.DONE:
            result = goal.get_result() if status == GoalStatus.SUCCEEDED else None
            return _refusal(goal) if result is None else result
        has_ended = state == CommState.WAITING_FOR_RESULT
        if has_ended:
            self._result_due = min(self._result_due, now + PATIENCE)
        if not self.is_there:
            return Trouble(Cause.CONNECTION_LOST, "its server is gone")
        if has_ended and status in FAILED:
            return _refusal(goal)  # the status says why: no result is needed
        if now > self._result_due:
            return Trouble(Cause.UNUSABLE_ANSWER, "its result did not come")
        if state == CommState.WAITING_FOR_GOAL_ACK and now > self._sent_at + PATIENCE:
            # rospy may have sent it to a server that has ended, and counts that as a success
            goal.cancel()
            return Trouble(Cause.NO_ANSWER, f"the goal was not acknowledged in {PATIENCE:g} s")
        return None

    def wait(self, seconds: float) -> None:
        """Return when there is news, after ``seconds`` at the latest."""
        self.news.wait(seconds)
        self.news.clear()

    def _report(self, goal: Any, feedback: Message) -> None:
        if self._reported is not None and goal == self._goal:
            self._reported(feedback)


def _refusal(goal: Any) -> Trouble:
    """Return in words how a goal ended, and why if its server says so."""
    how, why = GoalStatus.to_string(goal.get_goal_status()).lower(), goal.get_goal_status_text()
    return Trouble(Cause.REFUSED, f"{how} ({why})" if why else how)


class GoalThread(RequestThread):
    """A thread that carries requests as goals of one action."""

    IDLE = ROUND

    def __init__(self, action: Action):
        self._action = action
        self._client = ActionClient(action, self._report)
        super().__init__(action)

    def cut(self) -> bool:
        """Cancel the goal under way."""
        is_reusable = super().cut()
        self._client.news.set()
        return is_reusable

    def idle(self) -> None:
        """Connect to the server before the first request."""
        self._client.connect()

    def exchange(self, job: Job) -> Union[Answer, Failure]:
        """Send a goal, and wait for its end."""
        self._job, self._reported, self._reported_at = job, "", -math.inf
        self._connect(job)
        self._client.send(job.request)
        self.is_asked = True
        while not job.cut.is_set():
            result = self._client.result()
            if isinstance(result, Trouble):
                raise result
            if result is not None:
                return result_of(self._action, result, self.name)
            self._client.wait(ROUND)
        self._client.cancel()
        raise Trouble(Cause.NO_ANSWER, "cancelled")

    def _connect(self, job: Job) -> None:
        """Return when the server is there. Raises ``Trouble``."""
        deadline = time.monotonic() + CONNECT_LIMIT
        self._client.connect()
        if not self._client.is_there:
            DIRECTORY.server(self.name, CONNECT_LIMIT)
        while not self._client.is_there:
            if job.cut.is_set() or time.monotonic() > deadline:
                raise Trouble(Cause.NOT_REACHABLE,
                              "the master lists it, but not all of its topics connect")
            self._client.wait(ROUND_WHEN_CONNECTING)
            self._client.connect()

    def _report(self, feedback: Message) -> None:
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
            self._job.feedback(text)


class SpeechActionClient(ActionClient):
    """The action in place of a topic: while a mission listens and the topic has no publisher, the
    action gets one goal after the other, and each result becomes a message of the topic.

    ``listen`` is for the tick thread and never waits; results arrive on a thread of their own.
    """

    def __init__(self, action: Action[Listen], is_published: Callable[[], bool],
                 receive: Callable[[Any], None], wake: Callable[[], None],
                 warn: Callable[[str], None]):
        """``is_published`` returns whether the topic itself has a publisher; ``receive`` gets each
        utterance, and ``wake`` is called when a goal has ended."""
        super().__init__(action)
        self._is_published = is_published
        self._receive = receive
        self._wake = wake
        self._warn = warn
        self._warned = ""  # the last warning
        self._until = -math.inf  # when the listening ends
        self._again_at = -math.inf  # when the next goal may be sent
        start_thread("hearing " + action.name, self._work)

    def listen(self, seconds: float) -> None:
        """Have goals sent for ``seconds`` from now; 0: stop, and cancel the current goal.

        A goal that is under way when the time is over has its own limit for its result.
        """
        self._until = time.monotonic() + seconds if seconds > 0 else -math.inf
        self.news.set()

    @property
    def is_under_way(self) -> bool:
        """Whether a goal was sent in time whose result may still come."""
        return self.is_busy and not self._is_late

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
            self.wait(ROUND_WHEN_LISTENING if self._is_listening else ROUND)

    def _go_on(self) -> None:
        """Do what is due: connect to the server, take a result, send a goal, or abandon one."""
        self.connect()
        result = self.result()
        if result is not None:
            self._end(result)
        is_due = self._is_listening and time.monotonic() >= self._again_at
        if self.is_busy and self._is_late:
            self.cancel()
        elif not self.is_busy and is_due and self.is_there and not self._is_published():
            self.send(Listen(max(0.0, self._until - time.monotonic())))

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
                self._receive(f"Error: {self.name} {result}")
        self._wake()

    def _warn_once(self, text: str) -> None:
        if text != self._warned:
            self._warned = text
            self._warn(f"the action {self.name} {text}")
