"""A run that is read while it is written."""
import fcntl
import os
import queue
import threading

import pytest

from behavior_controller.errors import MissionError
from behavior_controller.run.events import KILLED, Noticed
from behavior_controller.run.history import Run
from behavior_controller.run.record import files, tail
from behavior_controller.run.record.codec import encode, header
from behavior_controller.run.record.reader import read_record
from mission_rig import FileRecord, recorded, visitor_who


def followed(path):
    """Follow a run on another thread; return a function that waits for the next event, or for what
    ended it: None, or the text of an error."""
    found = queue.Queue()

    def follow():
        try:
            for line in filter(None, tail.follow(str(path))):
                found.put(line.event)
            found.put(None)
        except MissionError as error:
            found.put(str(error))

    threading.Thread(target=follow, daemon=True).start()
    return lambda: found.get(timeout=10.0)


def test_a_run_that_has_ended_is_read_without_a_rest(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "FILE_BYTES", 50_000)
    monkeypatch.setattr(tail, "TAIL_POLL", None)  # a rest would be an error
    path = recorded(tmp_path, visitor_who(says="yes"))
    assert len(files.parts(path)) > 1 and list(tail.follow(path)) == read_record(path)


def test_a_line_is_read_when_it_is_whole_and_the_end_comes_with_that_of_the_writers_lock(tmp_path):
    path, events = tmp_path / "mission.jsonl", [Noticed("info", str(number)) for number in range(3)]
    first, second, third = (encode(1.0, event) for event in events)
    with open(path, "wb", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write(header(1, 1.0)[:20])
        following = followed(path)
        for torn, event in ((header(1, 1.0)[20:] + first + second[:10], events[0]),
                            (second[10:-1], None), (b"\n" + third[:-1], events[1])):
            file.write(torn)
            assert event is None or following() == event
    assert (following(), following()) == (KILLED, None)  # the writer was killed within a line


@pytest.mark.slow
def test_a_long_run_is_followed_from_file_to_file_also_when_the_oldest_go(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "FILE_BYTES", 1000)
    monkeypatch.setattr(files, "RUN_BYTES", 5000)
    monkeypatch.setattr(tail, "TAIL_POLL", 0.01)
    record = FileRecord(str(tmp_path)).open()
    following = followed(record.path)
    for number in range(0, 200, 5):
        events = [Noticed("info", str(number + more)) for more in range(5)]
        for event in events:
            record(event)
        assert [following() for _ in events] == events
    record.close()
    assert (following(), following()) == (KILLED, None)
    assert "mission.1.jsonl" not in os.listdir(os.path.dirname(record.path))


def test_a_run_that_cannot_be_read_is_named(tmp_path):
    record = FileRecord(str(tmp_path), lambda text: None).open()
    following = followed(record.path)
    record(Noticed("info", "-"))
    assert following() == Noticed("info", "-")
    os.remove(record.path)
    assert following() == f"{record.path}: the record cannot be read: No such file or directory"
    record.close()


@pytest.mark.slow
def test_the_newest_files_tell_what_is_so_and_miss_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "FILE_BYTES", 50_000)
    path = recorded(tmp_path, visitor_who(says="yes"))
    assert len(files.parts(path)) > 3
    whole = Run(read_record(path))
    for newest in (1, 2, 100):
        late = Run(tail.RunTail(path, newest).news())
        assert (len(late.lines) < len(whole.lines)) == (newest < 100)
        assert late.state.lost == 0 and late.state.started == whole.state.started
        for field in ("letters", "entries", "finished", "visit_count", "robot"):
            assert getattr(late.state, field) == getattr(whole.state, field), field


def test_files_that_come_later_are_read_though_only_the_newest_was_wanted(tmp_path):
    def write(number, *lines):
        with open(files.part(str(tmp_path / files.FILE_NAME), number), "wb") as file:
            file.write(b"".join(lines))

    for number in (0, 1):
        write(number, header(1, 1.0, number), encode(1.0, Noticed("info", str(number))))
    reader = tail.RunTail(str(tmp_path / files.FILE_NAME), 1)
    assert [line.event.text for line in reader.news()] == ["1"]
    for number in (2, 3):
        write(number, header(1, 1.0, number), encode(1.0, Noticed("info", str(number))))
    assert [line.event.text for line in reader.news()] == ["2", "3"]
