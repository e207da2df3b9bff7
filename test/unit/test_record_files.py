"""The folders and files of runs: which is the newest, which go, and a run in several files."""
import contextlib
import errno
import fcntl
import itertools
import json
import operator
import os
import shutil
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from behavior_controller.errors import MissionError
from behavior_controller.run.events import (
    EntriesWritten, HealthChanged, Lost, Message, Noticed, PassFinished, PassStarted, TreeShown)
from behavior_controller.run.history import Run
from behavior_controller.run.record import files, recorder as module
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.files import make_room, runs
from behavior_controller.run.record.outset import Outset
from behavior_controller.missions.replay import replay
from behavior_controller.replay_cli import main
from behavior_controller.run.record.reader import read_record
from mission_rig import FileRecord, recorded, visitor_who

HEADER = '{"format": "behaviorController record", "version": 11, "pid": 7, "time": 1.5}\n'
EARLIER = "20260101-{:06}_1"


def run(place, name, text=HEADER):
    """Make the folder of a run with a record, and return it."""
    (place / name).mkdir(parents=True)
    (place / name / "mission.jsonl").write_text(text)
    return place / name


def below(place):
    return sorted(os.listdir(place))


# ---------------------------------------------------------------------------------- folders of runs


@pytest.mark.slow
@pytest.mark.parametrize("there, kept", [(0, 0), (999, 999), (1000, 999), (1010, 999)])
def test_the_oldest_records_make_room_for_a_new_one(tmp_path, there, kept):
    names = [EARLIER.format(number) for number in range(there)]
    for name in names:
        run(tmp_path, name)
    record = FileRecord(str(tmp_path), pytest.fail).open()
    record.close()
    new = os.path.basename(os.path.dirname(record.path))
    assert new.startswith("000001_") and below(tmp_path) == [new, *names[there - kept:there]]
    assert runs(str(tmp_path))[-1] == record.path


def test_a_clock_that_was_set_back_costs_no_newer_record(tmp_path, monkeypatch):
    dates = iter(range(30, 0, -1))
    monkeypatch.setattr(files.time, "strftime", lambda form: f"202601{next(dates):02}-000000")
    made = []
    for _ in range(25):
        record = FileRecord(str(tmp_path), pytest.fail).open()
        record.close()
        made.append(record.path)
    assert runs(str(tmp_path)) == made
    make_room(str(tmp_path), sum(map(os.path.getsize, made[-3:])))
    assert runs(str(tmp_path)) == made[-3:] and len(below(tmp_path)) == 3


def test_a_record_that_a_process_writes_stays_however_old_it_is(tmp_path):
    with contextlib.ExitStack() as held:
        for number in range(40):
            folder = run(tmp_path, EARLIER.format(number))
            if number in (0, 3):
                file = held.enter_context(open(folder / "mission.jsonl", "a"))
                fcntl.flock(file, fcntl.LOCK_EX)
        make_room(str(tmp_path), 19 * len(HEADER))
        assert below(tmp_path) == [EARLIER.format(number) for number in (0, 3, *range(21, 40))]
    make_room(str(tmp_path), 19 * len(HEADER))
    assert len(below(tmp_path)) == 19


@pytest.mark.slow
def test_the_record_of_a_living_node_is_locked_and_that_of_a_killed_one_is_not(tmp_path):
    code = ("import sys, time\n" "from behavior_controller.run.record.recorder import RecordFiles\n"
            "record = RecordFiles(sys.argv[1], print)\n" "print(record.path, flush=True)\n"
            "time.sleep(60)")
    node = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE,
                            text=True, env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)))
    path = node.stdout.readline().strip()
    assert files.is_written(path)
    node.kill()
    node.communicate()
    assert not files.is_written(path)


def test_what_a_user_keeps_among_the_records_stays_and_does_not_count(tmp_path):
    place, elsewhere = tmp_path / "records", tmp_path / "elsewhere"
    for name in ("saved", "latest", EARLIER.format(0) + " of Monday", "000000_" + "x"):
        run(place, name)
    run(place, EARLIER.format(1), "no record")
    (place / EARLIER.format(2)).write_text("a file")
    (place / EARLIER.format(3)).mkdir()
    os.mkfifo(place / EARLIER.format(3) / "mission.jsonl")
    run(elsewhere, EARLIER.format(4))
    os.symlink(elsewhere / EARLIER.format(4), place / EARLIER.format(4))
    users = below(place)
    for number in range(10, 40):
        run(place, EARLIER.format(number))
    (place / EARLIER.format(10) / "report.html").write_text("a report")
    make_room(str(place), 19 * len(HEADER))
    assert below(place) == sorted(users + [EARLIER.format(10)] +
                                  [EARLIER.format(number) for number in range(21, 40)])
    assert below(place / EARLIER.format(10)) == ["report.html"]
    assert (place / EARLIER.format(1) / "mission.jsonl").read_text() == "no record"
    assert below(elsewhere / EARLIER.format(4)) == ["mission.jsonl"]


def test_runs_at_once_have_a_folder_each(tmp_path):
    records = [FileRecord(str(tmp_path), pytest.fail).open() for _ in range(5)]
    assert [os.path.basename(path)[:7] for path in below(tmp_path)] == [
        f"00000{number}_" for number in range(1, 6)]
    for record in records:
        record.close()


def test_a_record_in_a_relative_folder_is_named_so_that_all_find_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = FileRecord("my records", pytest.fail).open()
    record.close()
    assert [record.path] == runs(str(tmp_path / "my records"))


@pytest.mark.slow
def test_the_next_run_in_the_same_folder_leaves_the_record_of_the_one_before(tmp_path):
    (tmp_path / "mission.jsonl").write_text("of an earlier version")
    first, second = (recorded(tmp_path, visitor_who(says=says)) for says in ("yes", "no"))
    assert first != second and (tmp_path / "mission.jsonl").read_text() == "of an earlier version"
    assert len(read_record(first)) > len(read_record(second)) > 50
    assert main([str(tmp_path)]) == 0 and runs(str(tmp_path))[-1] == second


def test_what_visitors_said_is_not_for_everybody(tmp_path):
    before = os.umask(0)
    try:
        record = FileRecord(str(tmp_path / "records"), pytest.fail).open()
        record.close()
        os.umask(0o077)
        private = FileRecord(str(tmp_path / "private"), pytest.fail).open()
        private.close()
    finally:
        os.umask(before)
    modes = [stat.S_IMODE(os.stat(path).st_mode) for path in (
        record.path, os.path.dirname(record.path), tmp_path / "records", private.path,
        os.path.dirname(private.path))]
    assert list(map(oct, modes)) == ["0o640", "0o750", "0o750", "0o600", "0o700"]


# --------------------------------------------------------------------------- a run in several files


@pytest.fixture(name="small")
def small_files(monkeypatch):
    """Small limits, and a function that records visits of the lab tour with them."""
    def record(folder, runs, file_bytes, run_bytes, says="yes"):
        monkeypatch.setattr(files, "FILE_BYTES", file_bytes)
        monkeypatch.setattr(files, "RUN_BYTES", run_bytes)
        return recorded(folder, visitor_who(says=says), runs=runs)
    return record


def events_of(path):
    return [line.event for line in read_record(path)]


def whole(tmp_path, runs):
    return events_of(recorded(tmp_path / "whole", visitor_who(says="yes"), runs=runs))


@pytest.mark.slow
@pytest.mark.parametrize("file_bytes", [4000, 30_000, 200_000])
def test_a_run_in_several_files_is_read_as_one(tmp_path, small, file_bytes):
    expected = whole(tmp_path, 4)
    path = small(tmp_path, 4, file_bytes, 10 ** 9)
    assert len(files.parts(path)) > 2
    assert events_of(path) == expected
    outcome = replay(read_record(path))
    assert (outcome.divergence, outcome.passes, outcome.missing) == ("", 4, ())


@pytest.mark.slow
def test_a_file_ends_between_two_visits_if_possible(tmp_path, small):
    path = small(tmp_path, 6, 200_000, 10 ** 9)
    for part in files.parts(path)[1:]:
        text = Path(part).read_text()
        repeated = text[:text.index('"PassStarted"')]
        assert '"TreeShown"' in repeated and '"RunStarted"' in repeated
        assert '"first":' not in repeated.replace('"first":null', "")
        assert len(text) < 200_000 + len(repeated)


@pytest.mark.slow
def test_the_oldest_visits_go_first_and_the_rest_is_replayed_and_shown(tmp_path, small, capsys):
    expected = whole(tmp_path, 8)
    path = small(tmp_path, 8, 150_000, 800_000)
    parts = files.parts(path)
    assert sum(map(os.path.getsize, parts)) < 800_000
    found = events_of(path)
    first = next(event.number for event in found if isinstance(event, PassStarted))
    assert 2 < first < 8
    lost, = (event for event in found if isinstance(event, Lost))
    assert lost.reason == f"visits 1 to {first - 1} are no longer kept"
    rest = found[found.index(lost) + 1:]
    assert rest == expected[len(expected) - len(rest):]
    assert lost.lines == len(expected) - len(rest)
    outcome = replay(read_record(path))
    assert (outcome.divergence, outcome.passes) == ("", 9 - first)
    assert lost.reason in str(outcome)
    assert main(["--report", str(tmp_path / "r.html"), path]) == 0
    assert lost.reason in (tmp_path / "r.html").read_text()
    assert main(["--story", os.path.dirname(path)]) == 0
    assert lost.reason in capsys.readouterr().out
    assert replay(read_record(parts[-1])).divergence == ""  # also a file alone
    with open(path) as file:  # the file with the run's name and lock stays
        assert file.read().count("\n") == 1


@pytest.mark.slow
def test_of_one_visit_that_is_larger_than_all_files_the_end_is_kept(tmp_path, small):
    expected = whole(tmp_path, 1)
    path = small(tmp_path, 1, 5000, 200_000)
    found = events_of(path)
    lost, = (event for event in found if isinstance(event, Lost))
    assert lost.reason == "visit 1 is no longer kept from its beginning"
    assert found[-5:] == expected[-5:]
    outcome = replay(read_record(path))
    assert (outcome.divergence, outcome.passes) == ("", 0)
    state = Run(read_record(path)).state
    assert state.finished is not None or state.visits[-1].outcome == "SUCCESS"
    # what it was asked for last is known, though that was long ago
    whole_state = Run(read_record(runs(str(tmp_path / "whole"))[0])).state
    for part in ("attention", "animation", "place"):
        assert getattr(state.robot, part) == getattr(whole_state.robot, part)
    assert state.entries == whole_state.entries


def test_what_a_further_file_repeats_is_what_still_holds(tmp_path):
    outset, times = Outset(), itertools.count(1.0)
    gone = HealthChanged("service", "/a", "", False, "gone", "", "gone")
    tree, nodes = TreeShown("M", []), TreeShown("N", [])
    for event in (tree, gone, nodes, Message("/t", 3, 1, 1.0), Message("/t", 2, 2, 2.0),
                  HealthChanged("service", "/b", "", False, "gone", "", "gone"),
                  EntriesWritten([("a", "1"), ("b", "2")], {"a": 1, "b": 2}),
                  EntriesWritten([("a", None)]),
                  PassStarted(7, 1.0), PassFinished(7, "SUCCESS", 1.0),
                  HealthChanged("service", "/b", "", True, "back", "", "gone")):
        outset.take(next(times), event)
    head, *lines = map(json.loads, outset.head(12, 50.0).splitlines())
    assert (head["lines"], head["visits"], head["repeated"]) == (12, 7, 4)
    assert [(line["time"], line["event"]["_type"]) for line in lines] == [
        (3.0, "TreeShown"), (2.0, "HealthChanged"), (5.0, "Message"), (50.0, "EntriesWritten")]
    assert lines[0]["event"]["id"] == "N" and lines[1]["event"]["name"] == "/a"
    assert (lines[2]["event"]["read"], lines[2]["event"]["value"]) == (1, 2)
    assert (lines[3]["event"]["entries"], lines[3]["event"]["values"]) == ([["b", "2"]], {"b": 2})


def test_a_further_file_in_the_middle_of_a_visit_has_all_of_the_visit(tmp_path):
    outset, run, compared = Outset(), Run(), 0
    parts = operator.attrgetter("visits", "steps", "exchanges", "recoveries", "robot", "course",
                                "failures", "entries", "values")
    path = recorded(tmp_path, visitor_who(says="yes"), failure_rate=0.1, seed=2)
    for number, line in enumerate(read_record(path), 1):
        outset.take(line.time, line.event)
        run.take(line)
        if number % 20 == 0 and run.state.visit is not None:
            late = Run(Decoder("-").read_all(outset.head(number, line.time)))
            assert parts(late.state) == parts(run.state) and late.results == []
            assert late.state.letters == run.state.letters
            compared += 1
    assert compared > 5


@pytest.mark.slow
def test_a_further_file_knows_where_the_visits_before_have_left_the_robot(tmp_path):
    where = operator.attrgetter("place", "last_place", "goal_name", "way", "is_lost")
    outset, run, told = Outset(), Run(), set()
    path = recorded(tmp_path, visitor_who(says="yes"), runs=6, failure_rate=0.2, seed=2)
    for number, line in enumerate(read_record(path), 1):
        outset.take(line.time, line.event)
        run.take(line)
        if number % 20 == 0 or isinstance(line.event, PassFinished):
            late = Run(Decoder("-").read_all(outset.head(number, line.time)))
            assert where(late.state.robot) == where(run.state.robot)
            told.add((late.state.robot.last_place == "home", late.state.robot.is_lost))
    assert told == {(False, False), (False, True), (True, False)}


def test_a_file_of_a_user_beside_a_record_is_no_part_of_it(tmp_path):
    path = recorded(tmp_path, visitor_who(says="no"))
    before = events_of(path)
    data = Path(path).read_bytes()
    for name in ("mission.1.jsonl", "mission.jsonl.bak", "my_mission.2.jsonl"):
        Path(os.path.join(os.path.dirname(path), name)).write_bytes(data)
    assert events_of(path) == before


@pytest.mark.slow
def test_files_of_another_run_and_what_is_no_file_are_no_part_of_a_run(tmp_path, small):
    path = small(tmp_path / "one", 2, 100_000, 10 ** 9)
    other = files.parts(small(tmp_path / "other", 4, 30_000, 10 ** 9))
    before, number = events_of(path), len(files.parts(path))
    shutil.copy(other[-1], files.part(path, number))
    os.mkdir(files.part(path, number + 1))
    os.mkfifo(files.part(path, number + 2))
    assert len(other) > number and events_of(path) == before
    assert replay(read_record(path)).missing == ()


def test_a_further_file_that_begins_before_the_mission_is_read(tmp_path):
    path = recorded(tmp_path, visitor_who(says="no"))
    before = events_of(path)
    text = Path(path).read_text()
    Path(files.part(path, 1)).write_text(text)
    os.truncate(path, text.index("\n") + 1)  # the disk was gone after the first line
    assert events_of(path) == before


@pytest.mark.slow
def test_a_file_in_the_middle_that_is_gone_is_said(tmp_path, small):
    path = small(tmp_path, 6, 100_000, 10 ** 9)
    parts = files.parts(path)
    os.remove(parts[2])
    lost, = (event for event in events_of(path) if isinstance(event, Lost))
    assert lost.lines > 10 and replay(read_record(path)).divergence == ""


# -------------------------------------------------------------------------------------- a full disk


@pytest.fixture(name="disk")
def small_disk(tmp_path, monkeypatch):
    """A disk of 256 kB, and the retries of the record at a pace for tests."""
    if os.geteuid() or subprocess.call(["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs",
                                        str(tmp_path)], stderr=subprocess.DEVNULL):
        pytest.skip("no disk can be mounted here")
    monkeypatch.setattr(module, "DISK_RETRY", 0.05)
    yield tmp_path
    subprocess.check_call(["umount", "-l", str(tmp_path)])


class Told:
    """Takes complaints; ``wait`` returns when there are that many."""

    def __init__(self):
        self.texts, self._news = [], threading.Condition()

    def __call__(self, text):
        with self._news:
            self.texts.append(text)
            self._news.notify_all()

    def wait(self, count):
        with self._news:
            assert self._news.wait_for(lambda: len(self.texts) >= count, 10.0), self.texts


def fill(disk):
    with open(disk / "filler", "wb", buffering=0) as file, contextlib.suppress(OSError):
        while file.write(bytes(512)):
            pass


def test_a_full_disk_is_tried_again_and_nothing_is_lost(disk):
    told = Told()
    record = FileRecord(str(disk), told).open()
    record(Noticed("info", "before"))
    fill(disk)
    numbers = [f"{number:04} " + 100 * "x" for number in range(60)]
    for text in numbers:
        record(Noticed("info", text))
    told.wait(1)
    os.remove(disk / "filler")
    told.wait(2)
    record(Noticed("info", "after"))
    record.close()
    assert told.texts == [
        f"no record is written to {record.path}: No space left on device; it is tried again, the "
        "mission goes on", f"the record {record.path} is written again"]
    with open(record.path) as file:
        found = [json.loads(line)["event"]["text"] for line in file.readlines()[1:]]
    assert found == ["before", *numbers, "after"]


def test_what_does_not_fit_meanwhile_is_stated_in_the_record(disk, monkeypatch):
    monkeypatch.setattr(module, "MOST_FOR_DISK", 50)
    told = Told()
    fill(disk)
    record = module.RecordFiles(str(disk), told)  # a disk that is full at the start too
    for number in range(200):
        record.put(module.encoded(1.0, Noticed("info", str(number))))
    told.wait(1)
    os.remove(disk / "filler")
    told.wait(2)
    record.put(module.encoded(1.0, Noticed("info", "after")))
    told.wait(3)
    record.close()
    with open(record.path) as file:
        found = [json.loads(line)["event"] for line in file.readlines()[1:]]
    assert [event.get("text") for event in found if "text" in event] == [
        *map(str, range(50)), "after"]
    lost = next(event for event in found if "lines" in event)
    assert (lost["lines"], lost["reason"]) == (150, "No space left on device")
    assert found.index(lost) == 50 and "lacks 150 lines: No space left" in told.texts[2]


def test_a_disk_that_stays_full_costs_the_mission_nothing(disk):
    fill(disk)
    told = Told()
    record = FileRecord(str(disk), told).open()
    began = time.monotonic()
    for number in range(1000):
        record(Noticed("info", str(number)))
    assert time.monotonic() - began < 1.0
    record.close()
    assert not record.is_kept
    assert told.texts[1:] == [
        f"the record {record.path} lacks the end of the run: No space left on device"]


@pytest.mark.slow
@pytest.mark.parametrize("kind, times, parts", [(errno.EDQUOT, 5, 1), (errno.EIO, 1, 2),
                                                (errno.ESTALE, 1, 2)])
def test_after_a_disk_was_gone_the_run_goes_on_without_a_gap(tmp_path, monkeypatch, kind, times,
                                                             parts):
    monkeypatch.setattr(module, "DISK_RETRY", 0.05)
    expected, left = whole(tmp_path, 2), [times]
    write, told, torn = os.pwrite, Told(), []

    def fail(file, data, place):
        if place and left[0] and not torn:
            torn.append(len(data) - 50)  # within a line; that much is taken
            return write(file, data[:len(data) - 50], place)
        if torn and left[0]:
            left[0] -= 1
            write(file, data[:20], place)  # it is written, though that fails
            raise OSError(kind, os.strerror(kind))
        return write(file, data, place)

    monkeypatch.setattr(files.os, "pwrite", fail)
    record = FileRecord(str(tmp_path), told).open()
    for event in expected[:300]:
        record(event)
    told.wait(2)
    for event in expected[300:]:
        record(event)
    record.close()
    assert left == [0] and len(told.texts) == 2 and os.strerror(kind) in told.texts[0]
    assert events_of(record.path) == expected
    assert len(files.parts(record.path)) == parts


@pytest.mark.slow
@pytest.mark.parametrize("file_bytes", [50_000, 10 ** 9])
@pytest.mark.parametrize("is_folder", [True, False])
def test_a_record_that_is_removed_while_it_is_written_goes_on(tmp_path, monkeypatch, file_bytes,
                                                              is_folder):
    monkeypatch.setattr(module, "DISK_RETRY", 0.05)
    expected, told = whole(tmp_path, 3), Told()
    visits = [place for place, event in enumerate(expected) if isinstance(event, PassStarted)]
    monkeypatch.setattr(files, "FILE_BYTES", file_bytes)
    record = FileRecord(str(tmp_path / "records"), told).open()
    for event in expected[:visits[1] + 100]:
        record(event)
    ends = time.monotonic() + 10.0
    while record.files._files.lines < visits[1] + 100:
        assert time.monotonic() < ends
        time.sleep(0.01)
    remove = shutil.rmtree if is_folder else lambda folder: [
        os.remove(os.path.join(folder, name)) for name in os.listdir(folder)]
    remove(os.path.dirname(record.path))
    told.wait(2)
    assert files.is_written(record.path)
    for event in expected[visits[1] + 100:]:
        record(event)
    record.close()
    assert told.texts == [
        f"no record is written to {record.path}: it was removed; it is tried again, the mission "
        "goes on", f"the record {record.path} is written again"]
    found = events_of(record.path)
    lost, = (event for event in found if isinstance(event, Lost))
    assert lost.reason == "visit 1 is no longer kept"
    rest = found[found.index(lost) + 1:]
    assert rest == expected[-len(rest):] and lost.lines == len(expected) - len(rest)
    assert runs(str(tmp_path / "records")) == [record.path]
    assert replay(read_record(record.path)).divergence == ""


@pytest.mark.slow
def test_a_further_file_that_cannot_be_made_is_tried_again(tmp_path, small, monkeypatch):
    expected, made, told = whole(tmp_path, 2), files._created, Told()
    failures = iter([True, True])

    def create(path):
        if "mission." in path and not path.endswith("mission.jsonl") and next(failures, False):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return made(path)

    monkeypatch.setattr(module, "DISK_RETRY", 0.05)
    monkeypatch.setattr(files, "FILE_BYTES", 50_000)
    monkeypatch.setattr(files, "_created", create)
    record = FileRecord(str(tmp_path), told).open()
    for event in expected:
        record(event)
    told.wait(2)
    record.close()
    assert len(told.texts) == 2 and len(files.parts(record.path)) > 2
    assert events_of(record.path) == expected


def test_a_record_of_nothing_says_so(tmp_path):
    path = run(tmp_path, EARLIER.format(1)) / "mission.jsonl"
    with pytest.raises(MissionError, match="no mission in it"):
        read_record(str(path))
