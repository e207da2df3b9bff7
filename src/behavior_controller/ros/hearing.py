"""Gets the visitors' utterances by an action, if the robot offers one instead of the topic.

While a mission listens and the topic has no publisher, the action gets one goal after the other, and each result
becomes a message of the topic. actionlib's client registers with the master and may wait for it, so it is only used on
a separate thread.
"""
import math
import threading
import time
from typing import Any, Callable, Optional

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from behavior_controller.interface import Action, Topic
from behavior_controller.ros.directory import DIRECTORY
from behavior_controller.ros.types import TYPES

ROUND = 0.5
"""Seconds between two searches for the action's server."""

ROUND_WHEN_LISTENING = 0.05
"""The same while a mission listens."""

REST = 0.25
"""Seconds between a goal without a result and the next: a server may refuse each at once."""

PATIENCE = 2.0
"""Seconds within which a server acknowledges a goal, and sends the result of an ended one."""


class Hearing:
    """The action of ``topic``: ``listen`` is for the tick thread and never waits; results arrive on rospy's threads."""

    def __init__(self, topic: Topic, action: Action, is_published: Callable[[], bool],
                 take: Callable[[Any], None], warn: Callable[[str], None]):
        """``is_published`` returns whether the topic itself has a publisher; ``take`` gets each utterance."""
        self.name = rospy.resolve_name(action.name)
        self._action = action
        self._type = TYPES[action]
        self._is_published = is_published
        self._take = take
        self._warn = warn
        self._told = ""  # the last failure with a warning
        self._until = -math.inf  # when the listening ends
        self._again_at = -math.inf  # when the next goal may be sent
        self._client: Optional[actionlib.ActionClient] = None
        self._goal: Any = None  # the handle of the goal under way
        self._sent_at = self._result_due = -math.inf
        self._lock = threading.Lock()  # of ``_goal``
        self._changed = threading.Event()
        for part, kind in (("status", "actionlib_msgs/GoalStatusArray"), ("result", action.type + "ActionResult"),
                           ("feedback", action.type + "ActionFeedback")):
            DIRECTORY.subscribe("{}/{}".format(self.name, part), kind)
        threading.Thread(target=self._work, daemon=True, name="hearing " + self.name).start()

    @property
    def is_there(self) -> bool:
        """Whether the client is connected to a server of the action."""
        client = self._client
        return client is not None and all(end.get_num_connections() for end in (
            client.pub_goal, client.pub_cancel, client.status_sub, client.result_sub))

    def listen(self, seconds: float) -> None:
        """Have goals sent for ``seconds`` from now; 0: stop, and cancel the current goal."""
        self._until = time.monotonic() + seconds if seconds > 0 else -math.inf
        self._changed.set()

    @property
    def _is_listening(self) -> bool:
        return time.monotonic() < self._until

    def _work(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._go_on()
            except (rospy.ROSException, OSError):
                pass  # the node ends, or the master does not answer: it is tried again
            self._changed.wait(ROUND_WHEN_LISTENING if self._is_listening else ROUND)
            self._changed.clear()

    def _go_on(self) -> None:
        """Do what is due: connect to the server, send a goal, or abandon one."""
        if self._client is None:
            if DIRECTORY.is_published("{}/status".format(self.name)):
                self._client = actionlib.ActionClient(self._action.name, self._type)
        elif self._goal is not None:
            if not self._is_listening:
                self._cancel(self._goal)
            else:
                self._look_after(self._goal)
        elif self._is_listening and time.monotonic() >= self._again_at and self.is_there and not self._is_published():
            self._send(self._client)

    def _send(self, client: actionlib.ActionClient) -> None:
        goal = type(self._type().action_goal.goal)(*self._action.goal(max(0.0, self._until - time.monotonic())))
        self._sent_at = time.monotonic()
        with self._lock:  # a result may come before ``_goal`` is set
            self._goal = client.send_goal(goal, self._moved)

    def _look_after(self, goal: Any) -> None:
        """Abandon a goal that the server can no longer end, and resend one that it has not accepted."""
        state = goal.get_comm_state()
        if state != CommState.WAITING_FOR_RESULT:
            self._result_due = time.monotonic() + PATIENCE
        if not self.is_there:
            self._fail(goal, "its server is gone")
        elif time.monotonic() > self._result_due:
            self._fail(goal, "its result did not come")
        elif state == CommState.WAITING_FOR_GOAL_ACK and time.monotonic() > self._sent_at + PATIENCE:
            self._cancel(goal)  # rospy may have sent it to a server that has ended, and counts that as a success

    def _cancel(self, goal: Any) -> None:
        if self._end_goal(goal) is not None:
            goal.cancel()

    def _end_goal(self, goal: Any) -> Any:
        """Forget ``goal``, if it is the one under way; return it, or None."""
        with self._lock:
            if goal is None or goal != self._goal:
                return None
            self._goal = None
            return goal

    def _moved(self, goal: Any) -> None:
        """Process the result of a goal; on one of rospy's threads."""
        if goal.get_comm_state() != CommState.DONE or self._end_goal(goal) is None:
            return
        self._again_at = time.monotonic() + REST
        status, result = goal.get_goal_status(), goal.get_result()
        if status == GoalStatus.SUCCEEDED and result is not None:
            self._told = ""
            heard = self._action.read(result)
            if heard is not None:
                self._again_at = -math.inf
                self._take(heard)
        else:
            self._tell("{}{}".format(GoalStatus.to_string(status).lower(), _in_brackets(goal.get_goal_status_text())))
        self._changed.set()

    def _fail(self, goal: Any, reason: str) -> None:
        if self._end_goal(goal) is not None:
            self._again_at = time.monotonic() + REST
            self._tell(reason)

    def _tell(self, reason: str) -> None:
        """Publish that the action failed, in the form of an error on the topic, and warn once."""
        text = "Error: {} {}".format(self.name, reason)
        if text != self._told:
            self._told = text
            self._warn("the action {} failed: {}".format(self.name, reason))
        self._take(text)


def _in_brackets(text: str) -> str:
    return " ({})".format(text) if text else ""
