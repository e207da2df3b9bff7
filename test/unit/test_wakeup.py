"""The wake-up flag wakes the waiting thread, is kept until it is cleared, and may be set by a
signal handler."""
import os
import signal
import threading
import time

from behavior_controller.wakeup import WakeUp


def test_a_signal_before_the_wait_is_not_lost():
    wake = WakeUp()
    wake.emit()
    started = time.monotonic()
    wake.wait(30.0)
    assert time.monotonic() - started < 10.0
    assert wake.test_and_clear()
    assert not wake.test_and_clear()


def test_without_a_signal_the_wait_ends_in_time():
    wake = WakeUp()
    started = time.monotonic()
    wake.wait(0.05)
    assert time.monotonic() - started >= 0.05
    assert not wake.test_and_clear()


def test_another_thread_ends_an_endless_wait():
    wake = WakeUp()
    threading.Timer(0.05, wake.emit).start()
    wake.wait(None)
    assert wake.test_and_clear()


def test_a_signal_handler_ends_an_endless_wait():
    wake = WakeUp()
    before = signal.signal(signal.SIGUSR1, lambda *_: wake.emit())
    try:
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGUSR1)).start()
        wake.wait(None)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert wake.test_and_clear()


def test_no_signal_of_many_threads_is_lost():
    wake = WakeUp()
    answers = []

    def producer(number):
        answers.append(number)
        wake.emit()

    threads = [threading.Thread(target=producer, args=(number,)) for number in range(200)]
    for thread in threads:
        thread.start()
    seen = 0
    deadline = time.monotonic() + 30.0
    while seen < 200 and time.monotonic() < deadline:
        wake.wait(deadline - time.monotonic())
        wake.test_and_clear()
        seen = len(answers)
    for thread in threads:
        thread.join()
    assert seen == 200


def test_a_wait_of_no_time_ends_after_each_signal():
    """In Python 3.8 one of some thousands did not, with a SimpleQueue."""
    wake = WakeUp()
    waits = threading.Thread(target=lambda: [
        wake.emit() or wake.test_and_clear() and wake.wait(0.0) for _ in range(200_000)],
        daemon=True)
    waits.start()
    waits.join(30.0)
    assert not waits.is_alive()
