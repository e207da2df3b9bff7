"""Work that may hang: its result, its error, its limit, and a stop that does not wait for it."""
import threading
import time

import pytest

from behavior_controller.ros import timeouts
from behavior_controller.ros.timeouts import Late, Stopped, run_apart, run_together
from behavior_controller.wakeup import WakeUp


def test_the_result_and_the_error_come_through():
    assert run_apart(lambda: 42, WakeUp(), lambda: False, 5) == 42
    assert run_apart(lambda: None, WakeUp(), lambda: False, 5) is None
    with pytest.raises(ZeroDivisionError):
        run_apart(lambda: 1 / 0, WakeUp(), lambda: False, 5)


def test_the_limit_ends_the_wait():
    began = time.monotonic()
    with pytest.raises(Late, match="^not done in 0.1 s$"):
        run_apart(threading.Event().wait, WakeUp(), lambda: False, 0.1)
    assert 0.1 <= time.monotonic() - began < 4.0


def test_the_end_of_the_work_ends_the_wait_at_once(monkeypatch):
    monkeypatch.setattr(timeouts, "NOTICE_AFTER", 60.0)
    may_end = threading.Event()
    began = time.monotonic()
    threading.Timer(0.1, may_end.set).start()
    assert run_apart(lambda: may_end.wait(60), WakeUp(), lambda: False, 10) is True
    assert time.monotonic() - began < 8.0


@pytest.mark.slow
def test_slow_work_is_told_once(monkeypatch):
    monkeypatch.setattr(timeouts, "NOTICE_AFTER", 0.3)
    wake, told = WakeUp(), []
    began = time.monotonic()
    with pytest.raises(Late):
        run_apart(threading.Event().wait, wake, lambda: wake.emit() or False, 0.8,
                  lambda: told.append(time.monotonic()))
    assert len(told) == 1 and told[0] - began >= 0.3
    run_apart(lambda: None, wake, lambda: False, 5, lambda: told.append("quick"))
    assert len(told) == 1


@pytest.mark.slow
def test_the_wait_takes_no_processor_time():
    wake, looks = WakeUp(), []
    wake.emit()  # for another reason
    with pytest.raises(Late):
        run_apart(threading.Event().wait, wake, lambda: looks.append(1) or False, 0.3)
    assert len(looks) < 10


def test_a_stop_ends_the_wait_at_once():
    wake, stopped = WakeUp(), threading.Event()

    def stop():
        stopped.set()
        wake.emit()

    began = time.monotonic()
    threading.Timer(0.1, stop).start()
    with pytest.raises(Stopped):
        run_apart(threading.Event().wait, wake, stopped.is_set, 30)
    assert time.monotonic() - began < 5.0


def test_one_that_hangs_does_not_keep_the_others_from_their_work():
    done = []
    began = time.monotonic()
    run_together([threading.Event().wait, lambda: done.append(1), lambda: done.append(2)], 0.2)
    assert sorted(done) == [1, 2]
    assert time.monotonic() - began < 4.0


def test_work_that_takes_its_time_is_waited_for():
    may_end, done = threading.Event(), []
    threading.Timer(0.1, may_end.set).start()
    run_together([lambda: may_end.wait(20) and done.append(1)], 20)
    assert done == [1]


def test_work_that_hangs_does_not_keep_the_process_from_its_end():
    with pytest.raises(Late):
        run_apart(threading.Event().wait, WakeUp(), lambda: False, 0.01)
    before = set(threading.enumerate())
    run_together([threading.Event().wait], 0.01)
    hanging = set(threading.enumerate()) - before | {
        thread for thread in before if thread.name == "apart"}
    assert len(hanging) > 1 and all(thread.daemon for thread in hanging)
