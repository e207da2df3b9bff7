"""The tick loop: waits for an event (answer, message, timer, stop), ticks the tree, and counts the visitors' passes."""
from typing import Callable, Container, Iterable, Iterator, NamedTuple, Optional, Union

from behavior_controller import exits
from behavior_controller.bt.engine.node import Result, place_of
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.status import FAILURE, NAMES, RUNNING, SUCCESS
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.events import Noticed, PassFinished, PassStarted, RunFinished, RunStarted, Sources
from behavior_controller.gateway import Call, Cause, Failure
from behavior_controller.interface import Interface, Service, Topic
from behavior_controller.leaves.base import MissionContext

SHORTEST_PASS = 1.0
"""Seconds: after a pass that ends sooner, the runner pauses that long; a mission that fails at once must not busy-loop."""

ROUNDS_AT_ONCE = 100
"""The most ticks in a row at intervals of ``GIVE_WAY``."""

GIVE_WAY = 5e-5
"""Seconds in which other threads go on before a tick that no event asks for: they send the requests of the last one."""

PACE = 0.01
"""Seconds between further ticks of a mission that changes something at every tick (BT.CPP's default)."""

SAFE_STATE_LIMIT = 1.0
"""Seconds that the requests of the safe state may take when the node stops."""


class Running(NamedTuple):
    """The tree and its context: the runner also uses the gateway, events, health and settings of ``mission``."""

    tree: Tree
    mission: MissionContext
    mission_file: str
    runs: int  # passes; 0: no limit


class Runner:
    """Runs passes of a mission until ``is_stopped()``, or until their number is reached."""

    def __init__(self, running: Running, is_stopped: Callable[[], bool],
                 successor: Callable[[], Optional[Running]] = lambda: None,
                 stop_code: Callable[[], Optional[int]] = lambda: None):
        """``successor`` returns what runs from the next pass on (with the same clock and wake-up), or None.

        ``stop_code`` returns the exit code of a run that was stopped; None: the last pass decides.
        """
        self.tree, self.mission, self.mission_file, self.runs = running
        self.clock = self.tree.clock
        self.is_stopped = is_stopped
        self._successor = successor
        self._stop_code = stop_code
        self._number = 0
        self._outcome: Optional[str] = None  # of the last pass
        self._warned = False
        self._rounds = 0  # ticks since the last wait

    def run(self) -> int:
        """Run and return the exit code: ``stop_code``, or that of the last pass, or that of a SUCCESS if no pass ended."""
        self._begin()
        while not self.is_stopped() and (self.runs == 0 or self._number < self.runs):
            self._pass()
            # the plan that is running at a stop must be halted, so it must not be replaced
            following = None if self.is_stopped() else self._successor()
            if following is not None:
                self.tree, self.mission, self.mission_file, self.runs = following
                self._begin()
        if self.is_stopped():
            self._stop()
        code = self._stop_code()
        if code is None:
            code = exits.SUCCESS if self._outcome in (None, "SUCCESS") else exits.FAILURE
        ended = "stopped" if self.is_stopped() else "all passes are done"
        self.mission.events.emit(RunFinished("{}; last pass: {}".format(ended, self._outcome or "none"), code))
        return code

    def _begin(self) -> None:
        """Set up the tree and announce the mission."""
        self.tree.setup(mission=self.mission)
        self.mission.events.emit(RunStarted(
            self.mission_file, self.mission.leaves_of(self.tree), dict(self.mission.settings.values),
            Sources(self.tree.sources, self.mission.phrases.source, self.mission.policy.source,
                    self.mission.interface.name,
                    self.mission.knowledge.sources if self.mission.knowledge is not None else ())))

    def _pass(self) -> None:
        """Run the mission once, with the data of earlier visitors cleared."""
        began = self.clock.now()
        self.mission.begin_visit(self.tree.blackboard, began)
        self.mission.events.emit(PassStarted(self._number + 1, began))
        result: Result = RUNNING
        while result is RUNNING and not self.is_stopped():
            self.tree.wake.test_and_clear()
            changes = self.tree.changes
            result = self._tick()
            if result is RUNNING:
                self._rest(self.tree.changes != changes)
        if result is RUNNING:
            return
        self._number += 1
        self._outcome = NAMES[result]
        seconds = self.clock.now() - began
        self.mission.events.emit(PassFinished(self._number, self._outcome, seconds))
        if seconds < SHORTEST_PASS and self._number != self.runs:
            self._pause(SHORTEST_PASS)

    def _tick(self) -> Result:
        """Emit changes of the robot's health, and tick once; an exception in a tree node ends the pass, not the program."""
        self.mission.health.publish(self.mission.events)
        try:
            result = self.tree.tick_once()
        except BehaviorControllerError as error:
            place = place_of(error)
            text = " ".join(str(error).split())
            self.mission.events.emit(Noticed("error", "{} ({})".format(text, place) if place else text))
            self._halt()
            return FAILURE
        if self.tree.busy_loops and not self._warned:
            self._warned = True
            self.mission.events.emit(Noticed(
                "warning", "the mission busy-loops, it never waits: put a Sleep or a Delay into its loop"))
        if result not in (RUNNING, SUCCESS, FAILURE):
            self._halt()  # a root that was SKIPPED may still hold running nodes
        return result

    def _rest(self, has_changed: bool) -> None:
        """Wait for an event, unless the tick itself changed something that another tick may act on.

        BehaviorTree.CPP ticks every 10 ms anyway; a KeepRunningUntilFailure, for example, is RUNNING after each round
        without a wake-up. A mission that changes something at every tick is ticked at that pace.
        """
        if not has_changed:
            self._rounds = 0
            self.wait(None)
        elif self._rounds < ROUNDS_AT_ONCE:
            self._rounds += 1
            self.wait(GIVE_WAY)
        else:
            self.wait(PACE)

    def wait(self, seconds: Optional[float]) -> None:
        """Wait for the wake-up or the next timer, ``seconds`` at the longest, and run posted callbacks and due timers."""
        self.clock.run_posted()  # for a wake-up that is already cleared; a due timer must end the wait
        due = self.clock.next_due()
        limits = [limit for limit in (seconds, None if due is None else due - self.clock.now()) if limit is not None]
        self.tree.wake.wait(max(0.0, min(limits)) if limits else None)
        self.clock.run_due()

    def _pause(self, seconds: float) -> None:
        end = self.clock.now() + seconds
        while self.clock.now() < end and not self.is_stopped():
            self.tree.wake.test_and_clear()
            self.mission.health.publish(self.mission.events)
            self.wait(end - self.clock.now())

    def _halt(self) -> None:
        """Halt the tree; a script that fails meanwhile must not leave a node running."""
        try:
            self.tree.halt()
        except BehaviorControllerError as error:
            self.mission.events.emit(Noticed("error", "while halting: {}".format(" ".join(str(error).split()))))
            for node in reversed(self.tree.nodes):  # children first: then no control has a child left to halt by script
                node.interrupt()

    def _stop(self) -> None:
        """Halt the tree and leave the robot in the safe state."""
        self._halt()
        calls = [self.mission.gateway.start(request) for request in self.mission.interface.safe_state]
        end = self.clock.now() + SAFE_STATE_LIMIT
        while any(call.result is None for call in calls) and self.clock.now() < end:
            self.tree.wake.test_and_clear()
            self.wait(end - self.clock.now())
        for line in not_calm(calls, self.mission.interface, self.mission.offers):
            self.mission.events.emit(Noticed("warning", line))


def not_calm(calls: Iterable[Call], interface: Interface, used: Container[Union[Service, Topic]]) -> Iterator[str]:
    """Drop unanswered calls of the safe state, and yield a line for each part of it that was not reached.

    A service that no node offers and that the mission does not use (``used``) is ignored.
    """
    for call in calls:
        service = interface.service(type(call.request))
        if call.result is None:
            call.drop()
            yield "{} did not answer while stopping".format(service.name)
        elif isinstance(call.result, Failure) and (service in used or call.result.cause is not Cause.NOT_ADVERTISED):
            yield "{} failed while stopping: {}: {}".format(service.name, call.result.cause.text, call.result.message)
