"""Hears what visitors say by an action, where the robot offers one in place of the topic of utterances.

While a mission listens and the topic has no publisher, the action gets one goal after the other, and what a result
brings is taken for a message of the topic. actionlib's client registers with the master and may wait for it, so all of
it is used on a thread of its own.
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
"""Seconds between two looks for the action's server."""

ROUND_WHEN_LISTENING = 0.05
"""The same while a mission listens."""

REST = 0.25
"""Seconds between a goal that brought nothing and the next: a server may refuse each at once."""

PATIENCE = 2.0
"""Seconds in which a server acknowledges a goal, and sends the result of one that has ended."""


class Hearing:
    """The action of ``topic``: ``listen`` is for the tick thread and never waits; results come on rospy's threads."""

    def __init__(self, topic: Topic, action: Action, is_published: Callable[[], bool],
                 take: Callable[[Any], None], warn: Callable[[str], None]):
        """``is_published`` tells whether the topic itself has a publisher; ``take`` gets what was heard."""
        self.name = rospy.resolve_name(action.name)
        self._action = action
        self._type = TYPES[action]
        self._is_published = is_published
        self._take = take
        self._warn = warn
        self._told = ""  # the last failure that was warned of
        self._until = -math.inf  # when the mission listens no longer
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
        """Have goals sent for so long, from now; 0: no longer, and the one under way is cancelled."""
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
                pass  # the node ends, or the master is away: it is tried again
            self._changed.wait(ROUND_WHEN_LISTENING if self._is_listening else ROUND)
            self._changed.clear()

    def _go_on(self) -> None:
        """Do what is due: meet the server, send a goal, or give one up."""
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
        """Give up a goal that the server cannot end any more, and send one again that it has not taken."""
        state = goal.get_comm_state()
        if state != CommState.WAITING_FOR_RESULT:
            self._result_due = time.monotonic() + PATIENCE
        if not self.is_there:
            self._fail(goal, "its server is gone")
        elif time.monotonic() > self._result_due:
            self._fail(goal, "its result did not come")
        elif state == CommState.WAITING_FOR_GOAL_ACK and time.monotonic() > self._sent_at + PATIENCE:
            self._cancel(goal)  # rospy may have sent it to a server that is no more, and takes that for a success

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
        """Take the result of a goal that is done; on a thread of rospy's."""
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
        """Have the mission hear that the action failed, as a topic says an error of its node, and warn once."""
        text = "Error: {} {}".format(self.name, reason)
        if text != self._told:
            self._told = text
            self._warn("the action {} failed: {}".format(self.name, reason))
        self._take(text)


def _in_brackets(text: str) -> str:
    return " ({})".format(text) if text else ""
