"""The topics, with publishers in this process: which messages count, and which connections do."""
import contextlib
import dataclasses
import struct
import threading
import time
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot import release_1_0  # noqa: E402
from behavior_controller.robot.d543 import ATTENTION, FACES, SPEECH  # noqa: E402
from behavior_controller.robot.requests import AttentionStatus  # noqa: E402
from behavior_controller.ros import subscriber  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.subscriber import (  # noqa: E402
    BUFFER_BYTES, FLOOD_GAP, PAUSE, PAUSE_WHEN_AWAITED, RosTopics, TopicBuffer)
from behavior_controller.ros.timeouts import start_thread  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402
from ros_peers import Master, Publisher, until  # noqa: E402


def text(words):
    """Return a text as its bytes in a message."""
    data = words.encode()
    return struct.pack("<I", len(data)) + data


def framed(content):
    """Return a message as it travels: its length, and its bytes."""
    return struct.pack("<I", len(content)) + content


def status(state, value):
    return framed(text(state) + struct.pack("<q", value))


def said(words):
    return framed(text(words))


@pytest.fixture
def reading():
    """Return a function that makes the buffer of a topic, which reads from these publishers."""
    with contextlib.ExitStack() as ends:
        def read(topic, *publishers):
            wake = WakeUp()
            warnings = []
            buffer = TopicBuffer(topic, wake.emit, warnings.append, Clock())
            buffer.wake, buffer.warnings = wake, warnings
            buffer.set_publishers([publisher.uri for publisher in publishers])
            for publisher in publishers:
                ends.callback(publisher.close)
                until(lambda: publisher.ready)
            ends.callback(lambda: [link.end() for link in buffer._links.values()])
            until(lambda: buffer.is_searched)
            return buffer
        yield read


def values(buffer):
    return [sample.value for sample in buffer.recent()]


# -------------------------------------------------------------------------- which messages count

SEEKING, FOUND, IDLE = ("seeking", 2), ("scanning", release_1_0.FOUND), ("none", 0)
EVENTS = next(topic for topic in release_1_0.INTERFACE.topics if topic.is_event is not None)


@pytest.mark.parametrize("topic, burst, kept", [
    (ATTENTION, [IDLE, SEEKING], [SEEKING]),
    (ATTENTION, [SEEKING, IDLE], [IDLE]),
    (ATTENTION, [SEEKING, IDLE, SEEKING], [SEEKING]),
    (EVENTS, [FOUND, IDLE, IDLE], [FOUND, IDLE]),
    (EVENTS, [IDLE, FOUND, SEEKING], [FOUND, SEEKING]),
    (EVENTS, [IDLE, SEEKING, FOUND], [FOUND])])
def test_of_a_burst_the_newest_state_counts_and_no_event_is_skipped(reading, topic, burst, kept):
    publisher = Publisher(topic)
    buffer = reading(topic, publisher)
    publisher.send(b"".join(status(*each) for each in burst))
    until(lambda: buffer.rhythm.count and values(buffer)[-1] == burst[-1])
    assert values(buffer) == [AttentionStatus(*each) for each in kept]


def test_of_a_burst_no_utterance_is_skipped_not_even_the_same_again(reading):
    publisher = Publisher(SPEECH)
    buffer = reading(SPEECH, publisher)
    publisher.send(said("no") + said("yes") + said("yes") + said(""))
    until(lambda: len(buffer.recent()) == 4)
    assert values(buffer) == ["no", "yes", "yes", ""]
    times = [sample.arrived for sample in buffer.recent()]
    assert times == sorted(set(times))


def test_a_burst_that_is_read_at_once_rings_for_each_event_and_for_the_newest_state(reading):
    for topic, burst, rings in ((SPEECH, [text("yes"), text("hm")], True),
                                (ATTENTION, [status(*SEEKING)[4:], status(*IDLE)[4:]], False)):
        buffer = reading(topic)
        buffer.set_alarm("a", lambda value: value in ("yes", SEEKING))
        buffer.receive(burst)
        assert buffer.wake.is_set is rings


@pytest.mark.parametrize("size", [1, 3, 4, 6, 10])
def test_a_message_counts_when_its_last_byte_has_come(reading, size):
    publisher = Publisher(SPEECH)
    buffer = reading(SPEECH, publisher)
    data = said("a") + said("bc")
    whole = len(said("a")) <= size
    publisher.send(data[:size])
    until(lambda: len(buffer.recent()) == whole)
    time.sleep(0.05)
    assert values(buffer) == ["a"] * whole
    publisher.send(data[size:] + said("d"))
    until(lambda: len(buffer.recent()) == 3)
    assert values(buffer) == ["a", "bc", "d"]


def test_a_message_that_needs_many_reads_is_whole(reading):
    publisher, words = Publisher(SPEECH), "x" * (3 * BUFFER_BYTES) + "end"
    buffer = reading(SPEECH, publisher)
    publisher.send(said(words) + said("next"))
    until(lambda: len(buffer.recent()) == 2)
    assert values(buffer) == [words, "next"]


@pytest.mark.parametrize("topic, first, second, warned", [
    (SPEECH, said("yes"), said("no"), True), (ATTENTION, status(*SEEKING), status(*IDLE), False)],
    ids=["event", "state"])
def test_the_first_message_of_a_latching_publisher_is_no_news(reading, topic, first, second,
                                                             warned):
    publisher = Publisher(topic, latching="1")
    buffer = reading(topic, publisher)
    for sent in (first, second):
        buffer.set_alarm("a", lambda value: True)
        publisher.send(sent)
        if sent is second:
            until(lambda: buffer.recent())
            assert buffer.wake.is_set
        else:
            time.sleep(0.1)
            assert not buffer.recent() and not buffer.wake.is_set
    assert len(buffer.recent()) == 1
    assert [("'yes'" in line, "/robot publishes it latched" in line)
            for line in buffer.warnings] == [(True, True)] * warned


def test_only_the_first_message_of_each_connection_may_be_stale(reading):
    publisher = Publisher(SPEECH, latching="1")
    buffer = reading(SPEECH, publisher)
    publisher.send(said("old") + said("new"))
    until(lambda: values(buffer) == ["new"])
    publisher.peer.break_connections()
    until(lambda: len(publisher.ready) == 2)
    publisher.send(said("new") + said("newer"))
    until(lambda: values(buffer) == ["new", "newer"])


@pytest.mark.parametrize("alarm, pause", [(False, PAUSE), (True, PAUSE_WHEN_AWAITED)])
def test_only_a_flood_of_the_same_message_slows_its_reader(reading, monkeypatch, alarm, pause):
    buffer, now, slept = reading(ATTENTION), [100.0], []
    monkeypatch.setattr(subscriber, "time", types.SimpleNamespace(
        monotonic=lambda: now[0], sleep=slept.append))
    if alarm:
        buffer.set_alarm("a", lambda value: False)
    for now[0] in (100.0, 100.005, 100.010, 100.017):  # the last one comes after the gap of a flood
        assert buffer.receive([status(*IDLE)[4:]])
    assert slept == [pause, pause] and pause < FLOOD_GAP
    for now[0] in (100.018, 100.019):
        assert buffer.receive([status("seeking", int(1000 * now[0]))[4:]])
    assert len(slept) == 2


# ----------------------------------------------------------------------------- which connections


def test_several_publishers_are_heard_and_one_is_enough(reading):
    one, other = Publisher(SPEECH, "/one"), Publisher(SPEECH, "/other")
    buffer = reading(SPEECH, one, other)
    one.send(said("a"))
    until(lambda: values(buffer) == ["a"])
    other.send(said("b"))
    until(lambda: values(buffer) == ["a", "b"])
    assert buffer.connected_nodes == {"/one": one.uri, "/other": other.uri}
    one.close()
    until(lambda: list(buffer.connected_nodes) == ["/other"])
    assert buffer.is_connected
    other.close()
    until(lambda: not buffer.is_connected)
    until(lambda: one.uri in buffer.absence and other.uri in buffer.absence)


def test_a_publisher_that_is_no_longer_listed_is_left_when_its_connection_ends(reading):
    one, other = Publisher(SPEECH, "/one"), Publisher(SPEECH, "/other")
    buffer = reading(SPEECH, one, other)
    buffer.set_publishers([other.uri])
    one.send(said("a"))
    until(lambda: values(buffer) == ["a"])
    one.close()
    until(lambda: "/one" not in buffer.connected_nodes)
    buffer.set_publishers([other.uri])
    assert buffer.is_connected and list(buffer._links) == [other.uri]


@pytest.mark.slow
def test_a_publisher_of_another_type_counts_for_nothing(reading):
    wrong = Publisher(SPEECH, "/wrong", type="std_msgs/Int8", md5sum="27ffa0c9c4b8fb84")
    right = Publisher(SPEECH, "/right")
    buffer = reading(SPEECH, wrong)
    until(lambda: buffer.warnings)
    wrong.send(said("yes"))
    assert not buffer.is_connected
    assert "published by /wrong as std_msgs/Int8" in buffer.absence
    wrong.peer.break_connections()
    until(lambda: len(wrong.ready) == 2)
    buffer.set_publishers([wrong.uri, right.uri])
    until(lambda: buffer.is_connected)
    right.send(said("no"))
    until(lambda: values(buffer) == ["no"])
    line, = buffer.warnings  # told once, though it has connected again
    assert "/wrong" in line and "std_msgs/Int8" in line and "std_msgs/String" in line
    right.close()


@pytest.mark.slow
def test_a_flood_of_another_type_is_read_at_intervals(reading, monkeypatch):
    """Unread, it would block its publisher."""
    monkeypatch.setattr(subscriber, "RETRY_INTERVAL", 0.1)
    wrong, reads, real = Publisher(SPEECH, "/wrong", md5sum="other"), [], subscriber.split
    monkeypatch.setattr(subscriber, "split", lambda buffer: reads.append(1) or real(buffer))
    reading(SPEECH, wrong)
    began = time.monotonic()
    for _ in range(30):
        wrong.send(said("yes"))
        time.sleep(0.01)
    until(lambda: reads)
    assert len(reads) <= 1 + (time.monotonic() - began) / 0.1


@pytest.mark.parametrize("spoil", [
    lambda publisher: publisher.peer.break_connections(),
    lambda publisher: publisher.send(b"\xff\xff\xff"),  # a length that no message has
    lambda publisher: publisher.buffer.reconnect()])
def test_a_connection_that_breaks_is_made_again(reading, spoil):
    publisher = Publisher(SPEECH)
    publisher.buffer = buffer = reading(SPEECH, publisher)
    publisher.send(said("before") + b"\xff")  # and the beginning of another
    until(lambda: values(buffer) == ["before"])
    spoil(publisher)
    until(lambda: len(publisher.ready) == 2)
    publisher.send(said("after"))
    until(lambda: values(buffer) == ["before", "after"])


@pytest.mark.slow
def test_a_publisher_that_refuses_or_publishes_no_longer_is_tried_again(reading):
    buffer, publisher = reading(SPEECH), Publisher(SPEECH)
    publisher.requestTopic = lambda *_: (-1, "no longer", 0)
    buffer.set_publishers([publisher.uri])
    until(lambda: buffer.is_searched)
    assert not buffer.is_connected and publisher.uri in buffer.absence
    del publisher.requestTopic
    until(lambda: buffer.is_connected)
    buffer._links[publisher.uri].end()
    publisher.close()


def test_messages_that_cannot_be_decoded_count_for_nothing_until_one_can(reading):
    publisher = Publisher(ATTENTION)
    buffer = reading(ATTENTION, publisher)
    for _ in range(2):
        publisher.send(framed(b"\xff\xff"))
    until(lambda: buffer.warnings and not buffer.is_connected)
    assert "no message of /robot can be decoded" in buffer.absence and not buffer.recent()
    publisher.send(status(*SEEKING))
    until(lambda: buffer.is_connected)
    assert values(buffer) == [AttentionStatus(*SEEKING)]
    assert len(buffer.warnings) == 1


def test_a_declaration_that_fails_on_a_message_ends_no_connection(reading, monkeypatch):
    topic = dataclasses.replace(EVENTS, is_event=lambda status: 1 // status.value)
    monkeypatch.setitem(TYPES, topic, TYPES[EVENTS])
    publisher = Publisher(topic)
    buffer = reading(topic, publisher)
    publisher.send(status("none", 0))
    until(lambda: buffer.warnings)
    publisher.send(status("seeking", 2))
    until(lambda: values(buffer) == [AttentionStatus("seeking", 2)])
    assert len(publisher.ready) == 1 and "ZeroDivisionError" in buffer.warnings[0]


def test_a_publisher_is_connected_to_once_though_there_was_no_thread_for_another(
        reading, monkeypatch):
    publishers = [Publisher(SPEECH, "/one"), Publisher(SPEECH, "/other")]
    uris, buffer, threads = [each.uri for each in publishers], reading(SPEECH), [True, False]

    def start(*arguments):
        if threads and not threads.pop(0):
            raise RuntimeError("can't start new thread")
        return start_thread(*arguments)

    monkeypatch.setattr(subscriber, "start_thread", start)
    with pytest.raises(RuntimeError):
        buffer.set_publishers(uris)
    buffer.set_publishers(uris)
    until(lambda: len(buffer.connected_nodes) == 2)
    for publisher in publishers:
        publisher.close()
    until(lambda: not buffer.connected_nodes)
    assert [len(publisher.ready) for publisher in publishers] == [1, 1]


def test_a_topic_that_was_not_looked_up_is_not_missing_yet(reading):
    buffer = TopicBuffer(FACES, lambda: None, print, Clock())
    assert not buffer.is_searched and not buffer.is_connected
    buffer.set_publishers([])
    assert buffer.is_searched and buffer.absence == "no node publishes it"


# ---------------------------------------------------------------------------------------- alarms


def test_an_alarm_rings_once_for_what_is_wanted_also_if_it_came_since_the_last_look(reading):
    buffer = reading(SPEECH)
    hear = buffer.hear
    hear("yes")
    buffer.set_alarm("a", lambda value: value == "yes")
    assert buffer.wake.test_and_clear()  # it was not read yet
    buffer.recent()
    buffer.set_alarm("a", lambda value: value == "yes")
    hear("no")
    assert not buffer.wake.is_set
    hear("yes")
    assert buffer.wake.test_and_clear()
    hear("yes")
    assert not buffer.wake.is_set
    buffer.recent()
    buffer.set_alarm("a", lambda value: True)
    buffer.clear_alarm("a")
    hear("yes")
    assert not buffer.wake.is_set


def test_a_check_that_fails_wakes_the_tick_which_reports_it_and_ends_no_connection(reading):
    publisher = Publisher(SPEECH)
    buffer = reading(SPEECH, publisher)
    buffer.set_alarm("broken", lambda words: words.no_such_attribute)
    publisher.send(said("first"))
    until(lambda: buffer.wake.is_set)
    publisher.send(said("second"))
    until(lambda: values(buffer) == ["first", "second"])


def test_a_message_that_is_ignored_is_told_once_for_each_reason(reading):
    buffer = reading(SPEECH)
    for reason in ("one", "two", ""):
        buffer.ignoring = reason, lambda words: words == "yes"
        for words in ("hm", "yes", "yes"):
            buffer.receive([text(words)])
    assert buffer.warnings == ["ignoring 'yes' on /speechEvent/text: one",
                               "ignoring 'yes' on /speechEvent/text: two"]


# ---------------------------------------------------------------------------------- all of a robot


@pytest.fixture
def topics(monkeypatch):
    """The topics of a robot of which the mission uses one, and the master that knows them."""
    master, wake, ends = Master(), WakeUp(), threading.Event()
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    monkeypatch.setattr(subscriber, "DIRECTORY", Directory())
    monkeypatch.setattr(subscriber, "RETRY_INTERVAL", 0.05)
    monkeypatch.setattr(rospy, "is_shutdown", ends.is_set)
    monkeypatch.setattr(rospy.core, "get_node_uri", lambda: master.uri)
    made = RosTopics([SPEECH], wake.emit, print)
    made.master, made.wake = master, wake
    yield made
    ends.set()
    for buffer in made.buffers.values():
        buffer.set_publishers([])
        for link in buffer._links.values():
            link.end()
    master.close()


def publishes(topics, topic, *publishers):
    """Have the master list these as the topic's publishers."""
    for each in publishers:
        topics.master.nodes["/" + each.uri[-6:-1]] = each.uri
    topics.master.publishers[topic.name] = ["/" + each.uri[-6:-1] for each in publishers]


def test_the_publishers_that_the_master_lists_are_heard_and_new_topics_too(topics):
    """A topic whose publisher cannot be looked up keeps none of the others from theirs."""
    speech, faces = Publisher(SPEECH), Publisher(ATTENTION)
    topics.master.publishers[FACES.name] = ["/unknown"]
    publishes(topics, SPEECH, speech)
    began = time.monotonic()
    topics.subscribe()
    until(lambda: topics.buffers[SPEECH].is_connected)
    assert not topics.recent(ATTENTION)  # used by a leaf that has not declared it
    publishes(topics, ATTENTION, faces)
    until(lambda: topics.buffers[ATTENTION].is_connected)
    assert ("registerSubscriber", SPEECH.name, SPEECH.type) in [
        call[:3] for call in topics.master.calls]
    speech.close()
    publishes(topics, SPEECH)
    until(lambda: not topics.buffers[SPEECH]._links)
    faces.close()
    looks = [call for call in topics.master.calls if call[0] == "getSystemState"]
    assert len(looks) <= 1 + (time.monotonic() - began) / 0.05


def test_a_key_has_one_alarm_on_one_topic(topics):
    topics.wake_when("key", SPEECH, lambda value: True)
    topics.wake_when("other", SPEECH, lambda value: value == "no")
    topics.wake_when("key", ATTENTION, lambda value: True)
    topics.buffers[SPEECH].hear("yes")
    assert not topics.wake.is_set
    topics.buffers[ATTENTION].hear(AttentionStatus(*SEEKING))
    assert topics.wake.test_and_clear()
    topics.buffers[SPEECH].hear("no")
    assert topics.wake.is_set and topics.name(SPEECH) == SPEECH.name
    assert topics.buffers[SPEECH].newest == "no" and topics.buffers[ATTENTION].newest
    assert topics._buffer(FACES).newest is None


def test_only_a_topic_with_an_action_listens_by_it(topics, monkeypatch):
    asked = []
    action = types.SimpleNamespace(is_under_way=True, is_there=True,
                                   listen=lambda *how: asked.append(how))
    topics.listen(SPEECH, 5.0)
    assert not topics.is_hearing(SPEECH) and not topics.buffers[SPEECH].is_connected
    topics.buffers[SPEECH].speech_action = action
    topics.listen(SPEECH, 5.0)
    topics.listen(SPEECH, 4.0, True)
    assert asked == [(5.0, False), (4.0, True)] and topics.is_hearing(SPEECH)
    assert topics.buffers[SPEECH].is_connected
    action.is_under_way = False
    assert not topics.is_hearing(SPEECH)


def test_what_is_ignored_of_a_topic_that_is_not_used_is_nothing(topics):
    topics.ignore(FACES, "why", bool)
    assert FACES not in topics.buffers
    topics.ignore(SPEECH, "why", bool)
    assert topics.buffers[SPEECH].ignoring == ("why", bool)
