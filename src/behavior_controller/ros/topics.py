"""The newest message of the robot's topics, as plain data with its time of arrival, at very low cost.

The real overtAttention publishes the same status thousands of times per second. So messages are
decoded only when their bytes differ from the last ones. In such a flood the receiving thread pauses a moment after each
message: the messages that arrive meanwhile are read at once, and all but the newest are skipped.
"""
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Set

import genpy
import rospy

from behavior_controller.gateway import Sample, Topics
from behavior_controller.interface import Interface, Topic
from behavior_controller.ros.connection import Trouble
from behavior_controller.ros.directory import DIRECTORY
from behavior_controller.ros.hearing import Hearing
from behavior_controller.ros.subscription import Link
from behavior_controller.ros.types import TYPES

ROUND = 0.5
"""Seconds between two reads of the master's state."""

FLOOD_GAP = 0.006
"""Seconds: the same message repeated within this time is a flood."""

PAUSE = 0.004
"""Seconds of pause in a flood after a message without an alarm."""

PAUSE_WHEN_AWAITED = 0.001
"""The same while an alarm is set: the longest delay of the message that triggers it."""


class Latch:
    """The newest message of one topic, and the alarms that wait for one. Messages arrive on the threads of its links."""

    def __init__(self, topic: Topic, wake: Callable[[], None], warn: Callable[[str], None]):
        """``wake`` is called when an alarm is triggered; ``warn`` once for each publisher of unusable messages."""
        self._topic = topic
        self._type = TYPES[topic]
        self._wake = wake
        self._warn = warn
        self._warned: Set[str] = set()
        self.name = rospy.resolve_name(topic.name)
        self._links: Dict[str, Link] = {}  # by the publisher's address; replaced as a whole
        self.count = 0  # messages since there is a connection
        self.last_arrival = self._since = time.monotonic()  # of the last of them, and of the first
        self._lock = threading.Lock()
        self._bytes: Optional[bytes] = None
        self._alarms: Dict[Any, Callable[[Any], bool]] = {}
        self._is_alarm_new = False
        self._sample: Optional[Sample] = None
        self._seen: Optional[Sample] = None
        self._hearing = Hearing(topic, topic.action, lambda: self._is_published, self.hear, warn) if (
            topic.action is not None) else None

    # ------------------------------------------------------------------------------------------------------ publishers

    @property
    def is_continuous(self) -> bool:
        """Whether silence means something: see ``Topic``."""
        return self._topic.is_continuous

    @property
    def type_name(self) -> str:
        """The ROS type that is expected here."""
        return self._topic.type

    @property
    def is_connected(self) -> bool:
        """Whether any node publishes the expected type to us, or offers the action that replaces the topic."""
        return self._is_published or self._hearing is not None and self._hearing.is_there

    @property
    def _is_published(self) -> bool:
        return any(link.is_right for link in self._links.values())

    @property
    def wrong_publishers(self) -> List[str]:
        """The nodes that are connected and publish another type, each with that type."""
        headers = [link.header for link in self._links.values() if not link.is_right]
        return ["{} as {}".format(_sender(header), header.get("type")) for header in headers if header]

    @property
    def no_action(self) -> str:
        """What is missing in addition to a publisher."""
        return "" if self._hearing is None else ", and none offers the action {}".format(self._hearing.name)

    @property
    def unreachable(self) -> List[str]:
        """The addresses of the known publishers that are not connected."""
        return [uri for uri, link in self._links.items() if link.header is None]

    @property
    def connected_nodes(self) -> Dict[str, str]:
        """The addresses of the nodes that are connected, by their names."""
        headers = [(uri, link.header) for uri, link in self._links.items()]
        return {_sender(header): uri for uri, header in headers if header}

    def meet(self, uris: Sequence[str]) -> None:
        """Connect to the publishers at ``uris``, and stop trying to reach others. Only one thread calls this."""
        links = {uri: link for uri, link in self._links.items() if uri in uris or link.header is not None}
        for uri in set(self._links).difference(links):
            self._links[uri].end()
        for uri in set(uris).difference(links):
            links[uri] = Link(uri, self.name, self._type, self._has_met, self._receive)
        self._links = links

    def reconnect(self) -> None:
        """Replace the connections: the other side may have dropped one that looks alive."""
        for link in self._links.values():
            link.reconnect()

    def _has_met(self, header: Dict[str, str]) -> bool:
        """Return whether the publisher behind ``header`` sends the expected type."""
        wanted = self._type
        if header.get("md5sum") == wanted._md5sum:
            if not self._is_published:
                self.count = 0  # the rate of the topic is measured again, without the silence before
            return True
        sender = _sender(header)
        self._warn_once(sender, "ignoring what {} publishes on {}: it is {} (md5 {}), expected is {} (md5 {})".format(
            sender, self.name, header.get("type"), header.get("md5sum"), wanted._type, wanted._md5sum))
        return False

    def _warn_once(self, subject: str, text: str) -> None:
        if subject not in self._warned:
            self._warned.add(subject)
            self._warn(text)

    # -------------------------------------------------------------------------------------------------------- messages

    @property
    def usual_gap(self) -> float:
        """Mean seconds between two messages since there is a connection."""
        return (self.last_arrival - self._since) / max(1, self.count - 1)

    def _receive(self, data: bytes) -> None:
        """Process one message, and slow down if it is one of a flood."""
        arrived = time.monotonic()
        if not self.count:
            self._since = arrived
        self.count += 1
        gap, self.last_arrival = arrived - self.last_arrival, arrived
        is_news = self._store(data, arrived)
        if gap < FLOOD_GAP and not is_news:
            time.sleep(PAUSE_WHEN_AWAITED if self._alarms else PAUSE)

    def _store(self, data: bytes, arrived: float) -> bool:
        """Keep the newest message and trigger its alarms; return whether its content is new."""
        with self._lock:
            newest = self._sample
            is_news = data != self._bytes
            if newest is None or is_news:
                value = self._decode(data)
                if value is None:
                    return False
                self._bytes = data
            else:
                value = newest.value
            self._sample = Sample(value, arrived)
            if self._alarms and (is_news or self._is_alarm_new):
                self._ring(value)
        return is_news

    def hear(self, value: Any) -> None:
        """Use the action's result as the newest message. Any thread may call this."""
        with self._lock:
            self._bytes = None
            self._sample = Sample(value, time.monotonic())
            self._ring(value)

    def listen(self, seconds: float) -> None:
        """Have the action listen for ``seconds``, if there is one."""
        if self._hearing is not None:
            self._hearing.listen(seconds)

    def _decode(self, data: bytes) -> Any:
        """Return the plain data of a message, or None if the bytes are not one of its type."""
        try:
            return self._topic.read(self._type().deserialize(data))
        except (genpy.DeserializationError, UnicodeError) as error:
            self._warn_once("broken", "ignoring a message on {} that cannot be decoded: {}".format(self.name, error))
            return None

    def _ring(self, value: Any) -> None:
        """Wake the tree for each alarm that waited for ``value``."""
        self._is_alarm_new = False
        for key, wanted in list(self._alarms.items()):
            if wanted(value):
                del self._alarms[key]
                self._wake()

    def newest(self) -> Optional[Sample]:
        """Return the newest message, or None; the next alarm counts it as seen."""
        self._seen = self._sample
        return self._seen

    def set_alarm(self, key: Any, wanted: Callable[[Any], bool]) -> None:
        """Wake the tree at the next message that is ``wanted``; it may have come since ``newest`` was called last."""
        with self._lock:
            self._alarms[key] = wanted
            self._is_alarm_new = True
            if self._sample is not None and self._sample is not self._seen:
                self._ring(self._sample.value)

    def clear_alarm(self, key: Any) -> None:
        """Forget the alarm ``key``, if there is one."""
        with self._lock:
            self._alarms.pop(key, None)


def _sender(header: Dict[str, str]) -> str:
    return header.get("callerid", "an unknown node")


class RosTopics(Topics):
    """Subscribes to the robot's topics when it is made, and keeps them subscribed on a separate thread."""

    def __init__(self, interface: Interface, wake: Callable[[], None], warn: Callable[[str], None]):
        """See ``Latch``."""
        self.latches = {topic: Latch(topic, wake, warn) for topic in interface.topics}
        for latch in self.latches.values():
            DIRECTORY.subscribe(latch.name, latch.type_name)
        rospy.on_shutdown(DIRECTORY.sign_off)
        threading.Thread(target=self._keep_up, daemon=True, name="publishers of topics").start()

    def _keep_up(self) -> None:
        """Follow the master's list of publishers; without a master, the links reconnect by themselves."""
        while not rospy.is_shutdown():
            try:
                DIRECTORY.look()
                for latch in self.latches.values():
                    latch.meet(DIRECTORY.publishers(latch.name, latch.connected_nodes))
            except (Trouble, RuntimeError):
                pass  # the directory has noted it; or a link got no thread, and may get one next time
            time.sleep(ROUND)

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the newest message, or None before the first."""
        return self.latches[topic].newest()

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Set the alarm ``key``. ``wanted`` must depend on the value alone: it is not called again for the same value."""
        for latch in self.latches.values():
            latch.clear_alarm(key)
        self.latches[topic].set_alarm(key, wanted)

    def listen(self, topic: Topic, seconds: float) -> None:
        """See ``Topics``."""
        self.latches[topic].listen(seconds)
