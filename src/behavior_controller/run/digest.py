"""A run in the size of some rows of a list: its visits with their results, what was not well, and
when no visitor could be served."""
from typing import Dict, List, Optional, Tuple

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.folders import mission_name
from behavior_controller.run import story
from behavior_controller.run.events import Line
from behavior_controller.run.fold import fold
from behavior_controller.run.health import GONE, NEW, SLOW
from behavior_controller.run.state import BROKEN_OFF, LeafFailure, State, Visit
from behavior_controller.robot.gateway import Failure
from behavior_controller.text import clean

Period = Tuple[float, float]
"""When something began and ended: Unix seconds."""


class EndedVisit(Struct, frozen=True, gc=False, array_like=True):
    """A visit that is over. ``words`` say how it ended, ``faults`` which faults of the robot it
    met, whatever became of them, and ``decisive`` which one ended it."""

    number: int
    began: float
    seconds: float
    result: str
    words: str
    faults: Tuple[str, ...] = ()
    decisive: str = ""


class Outage(Struct, frozen=True, array_like=True):
    """A time in which a service, a topic or the master was not well; without ``ended`` it lasted
    to the end of the run. ``node`` is the node that offers it, or else its own name."""

    node: str
    name: str
    began: float
    ended: Optional[float] = None


class Digest(Struct, frozen=True):
    """A run. ``settings`` are its configuration, ``unserved`` the times in which no visitor could
    be served; ``ending`` is empty while it goes on."""

    mission: str = ""
    settings: Dict[str, str] = {}
    began: float = 0.0
    ended: float = 0.0
    ending: str = ""
    visits: Tuple[EndedVisit, ...] = ()
    outages: Tuple[Outage, ...] = ()
    unserved: Tuple[Period, ...] = ()

    @property
    def robot(self) -> str:
        """The robot, if it is one of several."""
        return self.settings.get("robot", "")


class Digester:
    """Folds the lines of a run; ``digest`` returns what is known up to the last one."""

    def __init__(self) -> None:
        self._state = State()
        self._began: Optional[float] = None
        self._visits: List[EndedVisit] = []
        self._faults: List[str] = []  # of the visit under way
        self._outages: List[Outage] = []  # that are over
        self._open: Dict[str, Outage] = {}  # by name
        self._unserved: List[Period] = []
        self._unserved_since: Optional[float] = None

    def take(self, line: Line) -> None:
        """Process the next line."""
        before, self._state = self._state, fold(self._state, line.time, line.event)
        if self._began is None:
            self._began = self._unserved_since = line.time
        self._faults += [fault(failed.node, failed.failure) for failed
                         in self._state.concluded(LeafFailure) if not failed.is_false_condition]
        for visit in self._state.concluded(Visit):
            self._end_visit(visit)
        if before.robot.troubles is not self._state.robot.troubles:
            self._note_health()
        self._note_service()

    def _end_visit(self, visit: Visit) -> None:
        reason, decisive = visit.why, ""
        if reason is not None and visit.result == BROKEN_OFF:
            failure = reason.failure
            decisive = fault(reason.node, failure) if failure is not None else story.why(reason)
        if not visit.is_empty:
            self._visits.append(EndedVisit(
                visit.number, visit.arrived or visit.began, round(visit.seconds, 1), visit.result,
                story.how_it_ended(visit), tuple(dict.fromkeys(self._faults)), decisive))
        self._faults.clear()

    def _note_health(self) -> None:
        """Note the outages that began or ended."""
        after = self._state
        ill = {change.name: change for change in after.robot.ill if change.respect != SLOW}
        for name in set(self._open) - set(ill):
            self._outages.append(replace(self._open.pop(name), ended=after.at))
        for name in set(ill) - set(self._open):
            self._open[name] = Outage(ill[name].owner, name, after.at)

    def _note_service(self) -> None:
        state, since = self._state, self._unserved_since
        if serves(state) and since is not None:
            self._unserved.append((since, state.at))
            self._unserved_since = None
        elif not serves(state) and since is None:
            self._unserved_since = state.at

    def digest(self) -> Digest:
        """Return the run up to now."""
        state, unserved = self._state, list(self._unserved)
        if self._unserved_since is not None:
            unserved.append((self._unserved_since, state.at))
        settings = {name: str(value) for name, value in state.start.settings.items()}
        return Digest(mission_name(state.start.mission), settings, self._began or 0.0, state.at,
                      story.run_end(state), tuple(self._visits),
                      (*self._outages, *self._open.values()), tuple(unserved))


def serves(state: State) -> bool:
    """Return whether a visitor can be served: the mission runs, nobody holds it, it does not wait
    for a repair, and no node that it uses is gone."""
    if state.started is None or state.finished is not None or state.held or state.suspended[0]:
        return False
    return state.pause is None and not any(
        change.respect in (GONE, NEW) for change in state.robot.ill)


def fault(node: str, failure: Failure) -> str:
    """Return a fault of the robot as it is counted: of a service or topic, or else of a node of the
    mission."""
    return clean(f"{failure.resource or node}: {failure.cause.text}")

