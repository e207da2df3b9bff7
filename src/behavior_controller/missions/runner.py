"""The tick loop: waits for an event (answer, message, timer, stop), ticks the tree, and counts the
visitors' passes."""
import logging
import math
import time
from typing import Callable, NamedTuple, Optional, Tuple

from behavior_controller import exit_codes
from behavior_controller.bt import FAILURE, ManualClock, Result, RUNNING, SUCCESS, Tree
from behavior_controller.bt.engine.node import place_of
from behavior_controller.bt.values.status import NAMES
from behavior_controller.errors import BehaviorControllerError, MissionError
from behavior_controller.run.events import (
    Noticed, PassFinished, PassStarted, Paused, RunFinished, RunStarted, Sources, Suspended)
from behavior_controller.leaves.base import MissionContext, MissionLeaf
from behavior_controller.robot.declarations import Service
from behavior_controller.robot.gateway import Cause
from behavior_controller.text import count

_SHORTEST_PASS = 1.0
"""Seconds: after a pass that ends sooner, the runner pauses that long; a mission that fails at once
must not busy-loop."""

ROUNDS_AT_ONCE = 100
"""The most ticks in a row at intervals of ``GIVE_WAY``."""

GIVE_WAY = 5e-5
"""How long the tick thread yields, in seconds, before a tick that the last one asked for: other
threads send the requests of the last one."""

TICK_INTERVAL = 0.01
"""Seconds between further ticks of a mission in which each tick asks for the next (BT.CPP's
default)."""

# on a terminal nothing of it is shown: its level is info
_LOG_FILE = logging.getLogger("behavior_controller")


class Running(NamedTuple):
    """The tree and its context: the runner also uses the gateway, events, health and settings of
    ``mission``."""

    tree: Tree
    mission: MissionContext
    mission_file: str
    runs: int  # passes; 0: no limit
    # called when its nodes are set up, before anything else
    begins: Callable[[], None] = lambda: None


class RetryGate:
    """Says after each pass what the next one has to wait for; the pauses grow until a pass
    succeeds."""

    def __init__(self) -> None:
        self._pauses = 0  # since the last pass that succeeded

    def reset(self) -> None:
        """Let the next pause be the first one again."""
        self._pauses = 0

    def cause(self, mission: MissionContext, failed_at: float, now: float) -> Optional[Paused]:
        """Return what still persists of a pass that failed at that time; None: nothing, or the
        pause is over."""
        failures, policy, health = mission.failures.of_pass(), mission.policy, mission.health
        for failure in failures:
            if health.is_gone(failure.resource):
                return Paused(failure, health.gone_name(failure.resource))
        # a cause whose end nothing tells: the budget is spent, or the types differ
        paused, pause = None, policy.pause(self._pauses)
        spent_for = mission.recovers_again_at() - failed_at
        mismatches = [failure for failure in failures if failure.cause is Cause.TYPE_MISMATCH]
        if failures and mission.failures.is_budget_spent and spent_for > 0.0:
            paused = Paused(failures[-1], "", policy.spent, min(pause, spent_for))
        elif mismatches:
            paused = Paused(mismatches[-1], "", "", pause)
        if paused is not None and failed_at + paused.limit <= now:
            self._pauses += 1
            return None
        return paused


class Runner:
    """Runs passes of a mission until ``is_stopped()``, or until their number is reached."""

    pace = TICK_INTERVAL

    def __init__(self, running: Running, is_stopped: Callable[[], bool],
                 successor: Callable[[], Optional[Running]] = lambda: None,
                 stop_code: Callable[[], Optional[int]] = lambda: None,
                 held: Callable[[], str] = lambda: "", resume: str = ""):
        """``successor`` returns what runs from the next pass on (with the same clock and wake-up),
        or None.

        ``stop_code`` returns the exit code of a run that was stopped; None: the last pass decides.
        While ``held`` returns what an operator holds the run for, nothing new is begun; ``resume``
        is the service that ends that.
        """
        self._use(running)
        self.clock = self.tree.clock
        self.is_stopped, self._stop_code = is_stopped, stop_code
        self._successor, self._held, self._resume = successor, held, resume
        self._suspended, self._number = Suspended(""), 0
        self._outcome: Optional[str] = None  # of the last pass
        self._warned = False
        self._rounds = 0  # ticks since the last wait
        self._reported = ""  # the newest exception of the pass
        self.is_stopping = False
        """The mission is halted, and the safe state is requested."""
        self._persistence = RetryGate()
        self._woke: Optional[float] = None  # monotonic seconds; None while the tick thread waits
        self._is_prepared = False  # the nodes of the first mission are set up

    def _use(self, running: Running) -> None:
        self.tree, self.mission, self.mission_file, self.runs, self._begins = running

    def prepare(self) -> None:
        """Set up the nodes of the first mission. Raises MissionError. Any thread may do this before
        ``run``."""
        self.tree.setup(mission=self.mission)
        self._is_prepared = True

    def run(self) -> int:
        """Run and return the exit code: ``stop_code``, or that of the last pass, or that of a
        SUCCESS if no pass ended.

        Raises MissionError if nodes of the first mission cannot be set up; a later one is then
        refused.
        """
        self._woke = time.monotonic()
        if not self._is_prepared:
            self.prepare()
        self._begin()
        while not self._is_over():
            if self._is_suspended():
                if not self._is_replaced():
                    self._doze(None)
                continue
            self._pass()
            if not self._is_replaced() and not self._is_over():
                self._await_cause()
        self._leave_safe()
        code = self._stop_code()
        if code is None:
            code = exit_codes.FAILURE
            if self._outcome in (None, "SUCCESS"):
                code = exit_codes.SUCCESS
        ended = "stopped" if self.is_stopped() else "all passes are done"
        last = "no pass is over"
        if self._outcome is not None:
            last = f"pass {self._number} was a {self._outcome}"
        self.mission.events.emit(RunFinished(f"{ended}; {last}", code))
        return code

    def _is_over(self) -> bool:
        return self.is_stopped() or 0 < self.runs <= self._number

    def _is_replaced(self) -> bool:
        """Go on with the mission that was reloaded, if there is one whose nodes can be set up;
        return whether there is."""
        # the plan that is running at a stop must be halted, so it must not be replaced
        if self.is_stopped():
            return False
        following = self._successor()
        if following is None:
            return False
        try:
            following.tree.setup(mission=following.mission)
        except MissionError as error:
            for fault in error.faults:
                self._report(error, f"refused, the running mission stays: {fault}")
            return False
        self._use(following)
        self._persistence.reset()
        self._begin()
        if 0 < self.runs <= self._number:
            done = count(self._number, "pass of this run is", "passes of this run are")
            self.mission.events.emit(Noticed(
                "warning", f"missionRuns {self.runs} is reached already: {done} over"))
        return True

    def _begin(self) -> None:
        """Announce the mission, whose nodes are set up."""
        self._begins()
        mission, knowledge = self.mission, self.mission.knowledge
        sources = Sources(self.tree.sources, mission.phrases.source, mission.policy.source,
                          mission.interface.name, knowledge.sources if knowledge else ())
        self.mission.events.emit(RunStarted(
            self.mission_file, [(node.full_path, node.registration_id) for node in self.tree.nodes
                                if isinstance(node, MissionLeaf)], mission.settings.values, sources,
            {mission.interface.name_of(offer): offer.kind for offer in mission.interface.offers},
            [offer.request.__name__ for offer in mission.offers if isinstance(offer, Service)]))

    def _pass(self) -> None:
        """Run the mission once, with the data of earlier visitors cleared."""
        began = self.clock.now()
        self.tree.failure = None  # of the pause before
        self._reported = ""
        self.clock.take_jump()  # it ends no visit
        self.mission.begin_visit(self.tree.blackboard, began)
        self.mission.events.emit(PassStarted(self._number + 1, began))
        result: Result = RUNNING
        is_due = True
        while result is RUNNING:
            is_due |= self.tree.wake.test_and_clear() or self.tree.is_tick_wanted
            if self.is_stopped():  # asked after the clearing: a later stop wakes the tree again
                return
            if self._has_jumped_back():
                result = FAILURE
            elif self._is_suspended():
                self._doze(None)
                is_due = True
            elif is_due:
                result, is_due = self._tick(), False
                self._rounds = self._rounds + 1 if self.tree.is_tick_wanted else 0
                if result is RUNNING and self._rounds:
                    self._wait(GIVE_WAY if self._rounds <= ROUNDS_AT_ONCE else self.pace)
            else:
                self.mission.health.publish(self.mission.events)
                self._wait(None)
        self._number += 1
        self._outcome = NAMES[result]
        seconds = self.clock.now() - began
        self.mission.events.emit(PassFinished(self._number, self._outcome, seconds))
        if seconds < _SHORTEST_PASS and self._number != self.runs:
            self._pause(_SHORTEST_PASS)

    def _has_jumped_back(self) -> bool:
        """End the visit if the simulated time has jumped back: what the robot and its world were
        doing is no longer so."""
        seconds = self.clock.take_jump()
        if seconds:
            self.mission.events.emit(Noticed(
                "error", f"simulated time jumped back by {round(seconds, 3):.12g} s: this visit is "
                         "over", seconds))
            self._halt()
        return bool(seconds)

    def _is_suspended(self) -> bool:
        """Return whether the operator holds the run; report a change, also when the robot has done
        what it was asked for.

        Until then nothing is ticked either: other branches would begin something new.
        """
        words = self._held()
        if words == self._suspended.words == "":  # as at almost every tick
            return False
        now = Suspended(words, bool(words) and self.mission.gateway.is_busy, words and self._resume)
        if now != self._suspended:
            self._suspended = now
            self.mission.events.emit(now)
        return bool(words)

    def _tick(self) -> Result:
        """Emit changes of the robot's health, and tick once; an exception in a tree node ends the
        pass, not the program."""
        self.mission.health.publish(self.mission.events)
        try:
            result = self.tree.tick_once()
        except BehaviorControllerError as error:
            self._report_exception(error)
            self._halt()
            return FAILURE
        if self.tree.busy_loops and not self._warned:
            self._warned = True
            text = "the mission busy-loops, it never waits: put a Sleep or a Delay into its loop"
            self.mission.events.emit(Noticed("warning", text))
        if result not in (RUNNING, SUCCESS, FAILURE):
            self._halt()  # a root that was SKIPPED may still hold running nodes
        return result

    def _report_exception(self, error: BehaviorControllerError, during: str = "") -> None:
        """Report an exception in a node, once: what a halt raises may have brought it about, and is
        raised again."""
        origin: BaseException = error
        while isinstance(origin.__cause__, BehaviorControllerError):
            origin = origin.__cause__
        if str(origin) != self._reported:
            self._reported = str(origin)
            at, place = "", place_of(error)
            # foreign code fails at no attribute
            if _foreign(error) is None and place not in str(error):
                at = f" ({place})"
            self._report(error, f"{during}{error}{at}")

    def _report(self, error: BehaviorControllerError, text: str) -> None:
        """Emit a line, and have the traceback of foreign code written to the log file, on the
        thread of that file."""
        line = " ".join(text.split())
        self.mission.events.emit(Noticed("error", line))
        cause = _foreign(error)
        if cause is not None:
            _LOG_FILE.info("%s", line, exc_info=cause)

    def wait(self, seconds: Optional[float]) -> None:
        """Wait for the wake-up or the next timer, ``seconds`` of the process at the longest, and
        run posted callbacks and due timers."""
        # for a wake-up that is already cleared; a due timer must end the wait
        self.clock.run_posted()
        limits = [max(0.0, limit) for limit in (seconds, self.clock.time_left())
                  if limit is not None]
        self._woke = None
        self.tree.wake.wait(min(limits, default=None))
        self._woke = time.monotonic()
        self.clock.run_due()

    def moment(self) -> Optional[Tuple[float, Optional[float]]]:
        """Return what changes with each wait and each traversal; None while the tick thread waits.
        For any thread."""
        woke = self._woke
        if woke is None:
            return None
        return woke, self.clock.held_at

    def _wait(self, seconds: Optional[float]) -> None:
        """Wait; report a callback that fails, which ends the pass as a node that fails in a tick
        does."""
        try:
            self.wait(seconds)
        except BehaviorControllerError as error:
            self.tree.failure = error
            self.tree.wake.emit()
            self._report_exception(error)

    def _pause(self, seconds: float) -> None:
        deadline = self.clock.now() + seconds
        while self.clock.now() < deadline and not self.is_stopped():
            self._doze_until(deadline)

    def _doze_until(self, deadline: float) -> None:
        """Wait for an event, until that time of the mission's clock at the longest."""
        timer = self.clock.call_after(deadline - self.clock.now(), self.tree.wake.emit,
                                      is_foreign=True)
        self._doze(None)
        timer.cancel()

    def _doze(self, seconds: Optional[float]) -> None:
        """Wait for an event, ``seconds`` of the process at the longest; nothing is ticked."""
        self.mission.health.publish(self.mission.events)
        self._wait(seconds)
        # before what woke it is looked at: what comes later ends the next wait
        self.tree.wake.test_and_clear()

    def _await_cause(self) -> None:
        """After a pass that failed for a cause that persists, wait: the next visitor must not meet
        it too."""
        if self._outcome == NAMES[SUCCESS]:
            self._persistence.reset()
        failed_at, reported = self.clock.now(), None
        while self._outcome == NAMES[FAILURE] and not (self.is_stopped() or self._is_replaced()):
            self.mission.health.publish(self.mission.events)
            self._is_suspended()
            cause = self._persistence.cause(self.mission, failed_at, self.clock.now())
            if cause is None:
                return
            if cause != reported:
                self.mission.events.emit(cause)
                reported = cause
            if cause.awaited:
                self._doze(None)
            else:
                self._doze_until(failed_at + cause.limit)

    def _halt(self) -> None:
        for error in self.tree.stop():
            self._report_exception(error, "while halting: ")

    def _leave_safe(self) -> None:
        """Halt what is under way and leave the robot in the safe state, however the run ends."""
        if not self.tree.is_idle:
            self._halt()
        self.is_stopping = True
        # the report says what failed: that a service is failing is no news then
        self.mission.health.stop_counting()
        self.mission.events.emit(self.mission.ask_for_safe_state().wait(self._doze))


class TimeIsUp(Exception):
    """A run in virtual time ends here; the text says why."""


class VirtualTimeRunner(Runner):
    """Runs a mission in virtual time: it moves the clock to the next event instead of waiting for
    it."""

    pace = 0.25  # such a mission would take long

    def __init__(self, running: Running, deadline: float, too_late: str):
        """Unless the last pass is over, ``TimeIsUp`` is raised with ``too_late`` after that time of
        the tree's clock, which must be a ManualClock."""
        super().__init__(running, lambda: False)
        self._deadline, self._too_late = deadline, too_late

    def wait(self, seconds: Optional[float]) -> None:
        """Advance time until the tree is woken, by ``seconds`` at most."""
        clock = self.clock
        assert isinstance(clock, ManualClock)
        limit = math.inf
        if seconds is not None:
            limit = clock.now() + seconds
        while not self.tree.wake.is_set:
            due = clock.next_due()
            moment = limit if due is None else min(limit, due)
            if moment > self._deadline and not self._is_over():
                raise TimeIsUp(self._too_late)
            clock.set_to(max(clock.now(), moment))
            clock.run_due()
            if moment == limit:
                return


def _foreign(error: BehaviorControllerError) -> Optional[BaseException]:
    """Return what code other than ours raised and led to ``error``, or None."""
    cause = error.__cause__
    if isinstance(cause, BehaviorControllerError):
        return None
    return cause
