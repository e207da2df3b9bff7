"""Timers run in order, at their own time, once, and not after they were cancelled."""
import weakref

from behavior_controller.bt.engine.clock import Clock, ManualClock


def test_timers_run_in_order_of_due_time_and_see_their_own_time():
    clock = ManualClock(100.0)
    seen = []
    clock.call_after(2.0, lambda: seen.append(("second", clock.now())))
    clock.call_after(1.0, lambda: seen.append(("first", clock.now())))
    clock.advance(1.5)
    assert seen == [("first", 101.0)]
    clock.advance(1.0)
    assert seen == [("first", 101.0), ("second", 102.0)]
    assert clock.now() == 102.5


def test_equal_due_times_run_in_order_of_creation():
    clock = ManualClock()
    seen = []
    for number in range(5):
        clock.call_after(1.0, lambda number=number: seen.append(number))
    clock.advance(1.0)
    assert seen == [0, 1, 2, 3, 4]


def test_a_cancelled_timer_does_not_run_and_is_not_waited_for():
    clock = ManualClock()
    clock.call_after(1.0, lambda: 1 / 0).cancel()
    assert clock.next_due() is None
    clock.call_after(3.0, lambda: None)
    assert clock.next_due() == 3.0
    clock.advance(5.0)


def test_cancelled_timers_are_not_kept_until_they_are_due():
    clock, seen = ManualClock(), []
    for number in range(5):
        clock.call_after(5.0 - number, lambda number=number: seen.append(number))
    timers = [clock.call_after(60.0, lambda: None) for _ in range(1000)]
    kept = [weakref.ref(timer) for timer in timers]
    while timers:
        timers.pop().cancel()
        clock.call_after(60.0, lambda: None).cancel()
    assert sum(timer() is not None for timer in kept) < 100
    clock.advance(10.0)
    assert seen == [4, 3, 2, 1, 0]


def test_a_timer_may_start_and_cancel_timers():
    clock = ManualClock()
    seen = []
    doomed = clock.call_after(2.0, lambda: seen.append("doomed"))

    def first():
        doomed.cancel()
        clock.call_after(0.5, lambda: seen.append(clock.now()))

    clock.call_after(1.0, first)
    clock.advance(10.0)
    assert seen == [1.5]


def test_the_real_clock_runs_only_what_is_due():
    clock = Clock()
    seen = []
    clock.call_after(0.0, lambda: seen.append("now"))
    clock.call_after(3600.0, lambda: seen.append("later"))
    clock.run_due()
    assert seen == ["now"]


def test_what_is_posted_runs_in_order_before_the_timers_that_are_due():
    clock = ManualClock()
    seen = []
    clock.call_after(0.0, lambda: seen.append("timer"))
    clock.post(lambda: (seen.append("first"), clock.post(lambda: seen.append("third"))))
    clock.post(lambda: seen.append("second"))
    clock.run_due()
    clock.run_due()
    assert seen == ["first", "second", "third", "timer"]


def test_a_clock_that_is_set_runs_no_timer_by_itself():
    clock = ManualClock(100.0)
    seen = []
    clock.call_after(2.0, lambda: seen.append(clock.now()))
    clock.set_to(105.0)
    assert (clock.now(), seen) == (105.0, [])
    clock.run_due()
    assert seen == [105.0]
