"""The messages of the robot's topics that count, as plain data with their arrival, at very low
cost.

The real overtAttention publishes the same status thousands of times per second. So messages are
decoded only when their bytes differ from the last ones. In such a flood the receiving thread pauses
a moment after each message: the messages that arrive meanwhile are read at once, and of a state
only the newest is used.
"""
import contextlib
import math
import struct
import threading
import time
from itertools import groupby
from typing import Any, Callable, Dict, Iterable, List, Optional, Sequence, Set, Tuple

import rospy

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.foreign_code import described
from behavior_controller.robot.gateway import Cause, Sample, Topics, since
from behavior_controller.robot.declarations import Offer, Topic
from behavior_controller.robot.rhythm import Rhythm
from behavior_controller.ros.tcpros import (
    RECONNECT_PAUSE, Connection, LONGEST_ANSWER, RETRY_INTERVAL, Trouble, open_publisher)
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.action_client import SpeechActionClient
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.ros.types import TYPES, not_published, resolved, type_mismatch
from behavior_controller.text import clean

BUFFER_BYTES = 65536
"""The most bytes of one read; far more than arrive during a pause."""

FLOOD_GAP = 0.006
"""Seconds: the same message repeated within this time is a flood."""

PAUSE = 0.004
"""Seconds of pause in a flood after a message without an alarm."""

PAUSE_WHEN_AWAITED = 0.001
"""The same while an alarm is set: the longest delay of the message that triggers it."""


def split(buffer: bytearray) -> List[bytes]:
    """Remove the complete messages from ``buffer`` and return them without their lengths."""
    messages, start = [], 0
    while len(buffer) - start >= 4:
        length, = struct.unpack_from("<I", buffer, start)
        if length > LONGEST_ANSWER:
            raise Trouble(Cause.CONNECTION_LOST, f"{length} bytes announced")
        if len(buffer) - start - 4 < length:
            break
        messages.append(bytes(buffer[start + 4:start + 4 + length]))
        start += 4 + length
    del buffer[:start]
    return messages


class Link:
    """A daemon thread with the connection to one publisher, made again whenever it breaks, until
    ``end``.

    ``rospy.Subscriber`` cannot do this: it keeps a connection whose other end is gone until TCP's
    timeout, retries with pauses of up to half a minute, and contacts the master without a limit.
    """

    def __init__(self, uri: str, topic: "TopicBuffer"):
        """``uri`` is the publisher's node. ``topic`` is called on the link's thread."""
        self._uri, self._topic = uri, topic
        self._connection = Connection()
        self._ended = threading.Event()
        self.header: Dict[str, str] = {}
        """The publisher's handshake; empty while not connected."""
        self.fault: Optional[str] = None
        """Why its messages are not used; empty: they are; None: it was not tried yet."""
        start_thread("topic " + topic.name, self._work)

    def end(self) -> None:
        """Close the connection and end the thread."""
        self._ended.set()
        self._connection.close()

    def reconnect(self) -> None:
        """End the current connection, and make a new one."""
        if self.header:
            self._connection.close()

    def _work(self) -> None:
        while not self._ended.is_set():
            self._connection = Connection()
            fault: Optional[str] = f"its publisher at {self._uri} cannot be reached"
            try:
                self._open()
                self._listen()
            except Trouble as trouble:  # the monitor reports it if it lasts
                if trouble.shortage is not None:
                    fault = None  # this computer could not try
            finally:
                pause = RECONNECT_PAUSE if self.header else RETRY_INTERVAL
                self.fault = fault
                self.header = {}
                self._connection.hang_up()
            self._ended.wait(pause)

    def _open(self) -> None:
        """Connect and shake hands."""
        message_type = self._topic.message_type
        self.header = open_publisher(self._connection, self._uri, self._topic.name,
                                     self._topic.suffix, type=message_type._type, tcp_nodelay="1",
                                     message_definition=message_type._full_text)
        self._connection.notice_a_dead_host()
        self._connection.wait_without_limit()
        self.fault = self._topic.fault_of(self.header)

    def _listen(self) -> None:
        """Read messages until the connection ends.

        The first message of a latching publisher may be as old as the publisher: it is not used as
        evidence.
        """
        is_wrong = bool(self.fault)
        is_old = self.header.get("latching") == "1"
        buffer = bytearray()
        while not self._ended.is_set():
            buffer += self._connection.receive_some(BUFFER_BYTES)
            messages = split(buffer)
            if is_wrong:
                # read all the same: a publisher that is not read from would block
                time.sleep(RETRY_INTERVAL)
                continue
            if messages and is_old:
                is_old = False
                self._topic.pass_over(self.header, messages.pop(0))
            if messages and self._topic.receive(messages):
                self.fault = ""
            elif messages:
                self.fault = (f"no message of {_sender(self.header)} can be decoded: build both "
                              "from the same msg files")


class TopicBuffer:
    """The messages of one topic that count, and the alarms that wait for one.

    Messages arrive on the threads of its links.
    """

    suffix = ""
    """See ``open_publisher``."""

    def __init__(self, topic: Topic, wake: Callable[[], None], warn: Callable[[str], None],
                 clock: Clock):
        """``wake`` is called when an alarm is triggered; ``warn`` once for each publisher of
        unusable messages. ``clock`` has the times of messages."""
        self._topic, self.name, self.message_type = topic, resolved(topic), TYPES[topic]
        self._wake, self._warn, self.clock = wake, warn, clock
        self._warned: Set[str] = set()
        self._links: Dict[str, Link] = {}  # by the publisher's address; replaced as a whole
        self._is_met = False
        self.rhythm = Rhythm(clock.source())
        self._received = 0.0  # when bytes came last, of whatever content
        self.heard_at = 0.0
        """When the last message came, by the time of the process."""
        self._lock = threading.RLock()
        self._bytes: Optional[bytes] = None
        self._alarms: Dict[Any, Callable[[Any], bool]] = {}
        self._recent: Tuple[Sample, ...] = ()
        self._seen_at = -math.inf  # arrival of the newest message that was read
        self.ignoring: Tuple[str, Callable[[Any], bool]] = ("", bool)
        """Why messages are ignored, and which; each reason is reported once."""
        self.speech_action: Optional[SpeechActionClient] = None
        if topic.action is not None:
            self.speech_action = SpeechActionClient(
                topic.action, lambda: self._is_published, self.hear, wake, warn, clock.source)

    # ----------------------------------------------------------------------------------- publishers

    @property
    def is_connected(self) -> bool:
        """Whether any node publishes the expected type to us, or offers the action that replaces
        the topic."""
        return self._is_published or self.speech_action is not None and self.speech_action.is_there

    @property
    def is_searched(self) -> bool:
        """Whether the topic's publishers were looked up, and each was tried."""
        return self._is_met and all(link.fault is not None for link in self._links.values())

    @property
    def _is_published(self) -> bool:
        return any(link.fault == "" for link in self._links.values())

    @property
    def absence(self) -> str:
        """Why the topic is not connected, as far as that is known."""
        faults = [link.fault for link in self._links.values() if link.fault]
        return "; ".join(faults) or not_published(self._topic)

    @property
    def connected_nodes(self) -> Dict[str, str]:
        """The addresses of the nodes that are connected, by their names."""
        return {_sender(link.header): uri for uri, link in self._links.items() if link.header}

    def set_publishers(self, uris: Sequence[str]) -> None:
        """Connect to the publishers at ``uris``, and stop trying to reach others. Only one thread
        calls this."""
        links = {uri: link for uri, link in self._links.items() if uri in uris or link.header}
        for uri in set(self._links).difference(links):
            self._links[uri].end()
        self._links = links
        for uri in set(uris).difference(links):
            self._links = {**self._links, uri: Link(uri, self)}  # the next may get no thread
        self._is_met = True

    def reconnect(self) -> None:
        """Replace the connections: the other side may have dropped one that looks alive."""
        for link in self._links.values():
            link.reconnect()

    def fault_of(self, header: Dict[str, str]) -> str:
        """Return why the messages of the publisher behind a handshake are not used; empty: they
        are, as they have the expected type."""
        wanted = self.message_type
        if header.get("md5sum") == wanted._md5sum:
            if not self._is_published:
                self.rhythm.restart()
            return ""
        sender = _sender(header)
        self._warn_once(sender, f"ignoring what {sender} publishes on {self.name}: it is "
                                f"{type_mismatch(header, wanted)}")
        return f"published by {sender} as {header.get('type')}; expected is {self._topic.type}"

    def _warn_once(self, subject: str, text: str) -> None:
        if subject not in self._warned:
            self._warned.add(subject)
            self._warn(text)

    # ------------------------------------------------------------------------------------- messages

    def receive(self, messages: List[bytes]) -> bool:
        """Process messages that came together; return whether the newest could be decoded.

        In a flood, slow down.
        """
        arrived = time.monotonic()
        gap, self._received = arrived - self._received, arrived
        if self._topic.is_continuous and self._topic.is_event is None:
            messages = messages[-1:]
        elif self._topic.is_continuous:
            messages = [data for data, _ in groupby(messages)]
        news = [self._store(data) for data in messages]
        if gap < FLOOD_GAP and not any(news):
            time.sleep(PAUSE_WHEN_AWAITED if self._alarms else PAUSE)
        return news[-1] is not None

    def _store(self, data: bytes) -> Optional[bool]:
        """Keep a message and trigger its alarms; return whether it is new, None: it cannot be
        decoded."""
        with self._lock:
            is_news = data != self._bytes
            value = self._decode(data) if is_news else self._recent[-1].value
            if value is None:
                return None
            self.hear(value, data)
        reason, is_missed = self.ignoring
        if reason and is_missed(value):
            self._warn_once(reason, f"ignoring {value!r} on {self.name}: {reason}")
        return is_news

    def hear(self, value: Any, data: Optional[bytes] = None) -> None:
        """Use ``value`` as the newest message, whose bytes were ``data``: none, if an action
        brought it. Any thread may call this."""
        with self._lock:
            self._bytes, self.heard_at = data, time.monotonic()
            sample = Sample(value, self.clock.arrival())
            self._recent = self._topic.kept(self._recent, sample)
            self.rhythm.hear(sample.arrived)
            self._ring(value)

    def pass_over(self, header: Dict[str, str], data: bytes) -> None:
        """Report that the first message of a latching publisher is not used; a state is sent again.
        """
        if self._topic.is_continuous:
            return
        value = self._decode(data)
        if value:
            self._warn_once("latching", (
                f"ignoring {value!r} on {self.name}: {_sender(header)} publishes it latched, so it "
                f"may be old; publish it without latching: rostopic pub -r 1 {self.name} …"))

    def _decode(self, data: bytes) -> Any:
        """Return the plain data of a message, or None if the bytes are not one of its type."""
        try:
            value = self._topic.read(self.message_type().deserialize(data))
            if self._topic.is_event is not None:
                self._topic.is_event(value)  # what fails now cannot fail later
            return value
        except BaseException as error:  # of genpy, or of another package's declaration
            self._warn_once("broken", f"ignoring a message on {self.name} that cannot be decoded: "
                                      f"{clean(described(error), 200)}")
            return None

    def _ring(self, value: Any) -> None:
        """Wake the tree for each alarm that waited for ``value``."""
        for key, wanted in list(self._alarms.items()):
            try:
                is_wanted = wanted(value)
            except BaseException:  # SystemExit would end the thread; the tick reports whose it is
                is_wanted = True
            if is_wanted:
                del self._alarms[key]
                self._wake()

    @property
    def newest(self) -> Any:
        """The value of the newest message; None: none has come."""
        return self._recent[-1].value if self._recent else None

    def recent(self) -> Tuple[Sample, ...]:
        """Return the messages that count; the next alarm counts them as seen."""
        recent = self._recent
        if recent:
            self._seen_at = recent[-1].arrived
        return recent

    def set_alarm(self, key: Any, wanted: Callable[[Any], bool]) -> None:
        """Wake the tree at the next ``wanted`` message; it may have come since the last ``recent``.
        """
        with self._lock:
            self._alarms[key] = wanted
            for sample in since(self._recent, self._seen_at):
                self._ring(sample.value)

    def clear_alarm(self, key: Any) -> None:
        """Forget the alarm ``key``, if there is one."""
        with self._lock:
            self._alarms.pop(key, None)


def _sender(header: Dict[str, str]) -> str:
    return header.get("callerid", "an unknown node")


class RosTopics(Topics):
    """The robot's topics that are used. From ``subscribe`` on they are subscribed, on a separate
    thread."""

    def __init__(self, offers: Iterable[Offer], wake: Callable[[], None],
                 warn: Callable[[str], None], clock: Optional[Clock] = None):
        """``offers``: see ``include``; for the others see ``TopicBuffer``."""
        self._new_buffer = lambda topic: TopicBuffer(topic, wake, warn, clock or Clock())
        self.buffers: Dict[Topic, TopicBuffer] = {}
        """Those of all topics that were used; replaced as a whole."""
        self.include(offers)

    def include(self, offers: Iterable[Offer]) -> None:
        """Use the topics among these services and topics too. Only one thread calls this."""
        self.buffers = {**self.buffers, **{
            offer: self._new_buffer(offer) for offer in offers
            if isinstance(offer, Topic) and offer not in self.buffers}}

    def _buffer(self, topic: Topic) -> TopicBuffer:
        """Return the buffer of a topic, which a leaf may use without having declared that."""
        if topic not in self.buffers:
            self.include([topic])
        return self.buffers[topic]

    def subscribe(self) -> None:
        """Subscribe to the topics; this registers the node at the master."""
        DIRECTORY.is_keeping_up = True
        rospy.on_shutdown(DIRECTORY.sign_off)
        start_thread("publishers of topics", self._keep_up)

    def _keep_up(self) -> None:
        """Follow the master's list of publishers; without a master, the links reconnect by
        themselves."""
        while not rospy.is_shutdown():
            buffers = self.buffers
            for topic, buffer in buffers.items():
                DIRECTORY.subscribe(buffer.name, topic.type)
            # the directory has noted it; or a link got no thread, and may get one next time
            with contextlib.suppress(Trouble, RuntimeError), DIRECTORY.round():
                DIRECTORY.refresh()
                for buffer in buffers.values():
                    with contextlib.suppress(Trouble):  # the others are met all the same
                        buffer.set_publishers(
                            DIRECTORY.publishers(buffer.name, buffer.connected_nodes))
            time.sleep(RETRY_INTERVAL)

    def name(self, topic: Topic) -> str:
        """See ``Topics``."""
        return self._buffer(topic).name

    def recent(self, topic: Topic) -> Tuple[Sample, ...]:
        """See ``Topics``."""
        return self._buffer(topic).recent()

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Set the alarm ``key``."""
        for buffer in self.buffers.values():
            buffer.clear_alarm(key)
        self._buffer(topic).set_alarm(key, wanted)

    def listen(self, topic: Topic, seconds: float, prefers_action: bool = False) -> None:
        """See ``Topics``."""
        speech_action = self._buffer(topic).speech_action
        if speech_action is not None:
            speech_action.listen(seconds, prefers_action)

    def is_hearing(self, topic: Topic) -> bool:
        """See ``Topics``."""
        speech_action = self._buffer(topic).speech_action
        return speech_action is not None and speech_action.is_under_way

    def ignore(self, topic: Topic, reason: str, missed: Callable[[Any], bool]) -> None:
        """See ``Topics``."""
        if topic in self.buffers:
            self.buffers[topic].ignoring = reason, missed
