"""The newest message of the robot's three topics, as plain data with its time of arrival, at next to no cost.

The real overtAttention publishes the same status thousands of times per second. So messages are taken undecoded and
decoded only when their bytes differ from those before, and in such a flood the receiving thread pauses a moment after
each message: what piles up meanwhile is read in one go, and all of it but the newest is skipped unread.
"""
import threading
import time
from typing import Any, Callable, Dict, NamedTuple, Optional

import genpy
import rospy
from cssr_system.msg import faceDetectionMessage, overtAttentionMessage
from std_msgs.msg import String

from behavior_controller.gateway import AttentionStatus, Faces, Sample, Topic, Topics

BUFFER_BYTES = 65536
"""What is read in one go; far more than a pause lets pile up."""

FLOOD_GAP = 0.006
"""Seconds: the same message again within so short a time is a flood."""

PAUSE = 0.004
"""Seconds that a flood is left alone after a message that nobody waits for."""

PAUSE_WHEN_AWAITED = 0.001
"""The same while an alarm is set: the longest delay of the message that rings it."""


class Feed(NamedTuple):
    """What travels on a topic, and how it reads as plain data."""

    type: Any
    read: Callable[[Any], Any]


FEEDS: Dict[Topic, Feed] = {
    Topic.FACES: Feed(faceDetectionMessage, lambda m: Faces(tuple(m.face_label_id), tuple(m.mutualGaze))),
    Topic.ATTENTION: Feed(overtAttentionMessage, lambda m: AttentionStatus(m.state, m.value)),
    Topic.SPEECH: Feed(String, lambda m: m.data),
}


def undecoded(message_type: Any) -> type:
    """Return a message class that keeps the bytes of a ``message_type``.

    Its md5 is the one that any publisher accepts, so that ``Latch`` sees who publishes another type and can say so:
    rospy would only write it to its log file, over and over.
    """
    return type("Undecoded", (rospy.AnyMsg,),
                {"__slots__": (), "_type": message_type._type, "_full_text": message_type._full_text})


class Latch:
    """The newest message of one topic, and the alarms that wait for one. Messages come on rospy's threads."""

    def __init__(self, topic: Topic, wake: Callable[[], None], warn: Callable[[str], None]):
        """Subscribe. ``wake`` is called when an alarm rings; ``warn`` once for each publisher of unusable messages."""
        self._feed = FEEDS[topic]
        self._wake = wake
        self._warn = warn
        self._warned = set()
        self._trusted: Any = None  # the connection header whose type was last found right
        self.count = 0  # messages of any type since the subscription
        self.last_arrival = self._since = time.monotonic()  # of the last of them, and of the first
        self._lock = threading.Lock()
        self._bytes: Optional[bytes] = None
        self._alarms: Dict[Any, Callable[[Any], bool]] = {}
        self._is_alarm_new = False
        self._sample: Optional[Sample] = None
        self._seen: Optional[Sample] = None
        self.name = rospy.resolve_name(topic.value)
        self._subscriber = self._subscribe()

    def _subscribe(self) -> rospy.Subscriber:
        return rospy.Subscriber(self.name, undecoded(self._feed.type), self._receive, queue_size=1,
                                buff_size=BUFFER_BYTES, tcp_nodelay=True)

    def subscribe_anew(self) -> None:
        """Drop the subscription and subscribe again: what the master knows of publishers is then asked anew."""
        self._subscriber.unregister()
        self._subscriber = self._subscribe()

    @property
    def is_connected(self) -> bool:
        """Whether any node publishes the topic to us."""
        return self._subscriber.get_num_connections() > 0

    @property
    def usual_gap(self) -> float:
        """Mean seconds between two messages so far."""
        return (self.last_arrival - self._since) / max(1, self.count - 1)

    def _receive(self, message: Any) -> None:
        """Take in one message, and slow down if it is one of a flood."""
        arrived = time.monotonic()
        if not self.count:
            self._since = arrived
        self.count += 1
        gap, self.last_arrival = arrived - self.last_arrival, arrived
        is_news = self._is_right_type(message._connection_header) and self._store(message._buff, arrived)
        if gap < FLOOD_GAP and not is_news:
            time.sleep(PAUSE_WHEN_AWAITED if self._alarms else PAUSE)

    def _store(self, data: bytes, arrived: float) -> bool:
        """Keep the newest message and ring its alarms; return whether it says something new."""
        with self._lock:
            is_news = data != self._bytes
            if is_news:
                value = self._decode(data)
                if value is None:
                    return False
                self._bytes = data
            else:
                value = self._sample.value
            self._sample = Sample(value, arrived)
            if self._alarms and (is_news or self._is_alarm_new):
                self._ring(value)
        return is_news

    def _decode(self, data: bytes) -> Any:
        """Return the plain data of a message, or None if the bytes are not one of its type."""
        try:
            return self._feed.read(self._feed.type().deserialize(data))
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

    def _is_right_type(self, header: Dict[str, str]) -> bool:
        """Whether the publisher behind ``header`` sends the type that is expected here."""
        if header is self._trusted or header.get("md5sum") == self._feed.type._md5sum:
            self._trusted = header
            return True
        sender = header.get("callerid", "an unknown node")
        wanted = self._feed.type
        self._warn_once(sender, "ignoring what {} publishes on {}: it is {} (md5 {}), expected is {} (md5 {})".format(
            sender, self.name, header.get("type"), header.get("md5sum"), wanted._type, wanted._md5sum))
        return False

    def _warn_once(self, subject: str, text: str) -> None:
        if subject not in self._warned:
            self._warned.add(subject)
            self._warn(text)

    def newest(self) -> Optional[Sample]:
        """Return the newest message, or None; whoever sets an alarm next has seen it."""
        self._seen = self._sample
        return self._seen

    def set_alarm(self, key: Any, wanted: Callable[[Any], bool]) -> None:
        """Wake the tree at the next message that is ``wanted``; it may have come since ``newest`` was called last."""
        with self._lock:
            self._alarms[key] = wanted
            self._is_alarm_new = True
            if self._sample is not self._seen:
                self._ring(self._sample.value)

    def clear_alarm(self, key: Any) -> None:
        """Forget the alarm ``key``, if there is one."""
        with self._lock:
            self._alarms.pop(key, None)


class RosTopics(Topics):
    """Subscribes to the robot's topics when it is made."""

    def __init__(self, wake: Callable[[], None], warn: Callable[[str], None]):
        """See ``Latch``."""
        self.latches = {topic: Latch(topic, wake, warn) for topic in Topic}

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the newest message, or None before the first."""
        return self.latches[topic].newest()

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Set the alarm ``key``. ``wanted`` must depend on the value alone: the same one is not asked about again."""
        for latch in self.latches.values():
            latch.clear_alarm(key)
        self.latches[topic].set_alarm(key, wanted)
