"""Plays of missions in virtual time, and what a test knows of them, for the tests of the judge."""
import dataclasses
import functools

from msgspec.structs import replace

from behavior_controller.bt.loader.document import parse
from behavior_controller.config import settings
from behavior_controller.run.events import Line, PassStarted, Tick
from behavior_controller.run.history import Run
from behavior_controller.simulation.faults import parse_planned_fault
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission

from unit_tests.judge.facts import Facts

NODES = ("animateBehavior", "gestureExecution", "knowledgeBase", "overtAttention",
         "robotNavigation", "tabletEvent", "textToSpeech")

MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">
<Sequence><{}/>{}</Sequence></BehaviorTree></root>"""

RELEASE = {"robotInterface": "release-1.0"}

UNIX = 5000.0
"""Seconds from a play's clock, which the mission goes by, to the times of record and journal."""


@functools.lru_cache(maxsize=None)
def stage(**chosen):
    return LoadedMission(settings.defaults(**chosen))


def facts(faults=(), mission=(), on=None, **test):
    """Return the facts of a test: ``faults`` as plannedFaults names them, ``mission`` keys of the
    controller, or the stage is ``on``; ``test`` fields of the test's configuration.

    What is not on a stage of its own is played once: a test that breaks the product has its own.
    """
    if on is None:
        return _known(tuple(faults), tuple(dict(mission).items()), **test)
    return _played(on, faults, test)


@functools.lru_cache(maxsize=100)
def _known(faults, mission, **test):
    return _played(stage(**dict(mission)), faults, test)


def _played(on, faults, test):
    planned = tuple(parse_planned_fault(fault, NODES) for fault in faults)
    given = dict(arrival_rate=600.0, random_seed=1, planned_faults=planned, test_timeout=3000.0)
    test = dataclasses.replace(CALM, **dict(given, **test))
    played = on.play(test)
    run = Run(Line(UNIX + at, event) for at, event in played.events)
    journal = [line._replace(time=UNIX + line.time) for line in played.journal]
    return Facts(run, journal, played.exit_code, test, on.world_of(test),
                 on.mission, played.cut_off, has_timed_out=played.has_timed_out)


def of_mission(steps, faults=(), chosen=(), **test):
    """Return the facts of a mission of these steps with the chosen keys of the controller."""
    on = settings.defaults(**dict(chosen))
    start = "StartOfTree" if dict(chosen) == RELEASE else "START_OF_TREE"
    return facts(faults, on=LoadedMission(on, [parse(MISSION.format(start, steps))]), **test)


def of_test_with(of_test, **test):
    """Return facts of a test whose configuration was another."""
    return of_test._replace(test=dataclasses.replace(of_test.test, **test))


def changed(before, change):
    """Return facts whose record is made of the lines that ``change`` returns for each of its."""
    return before._replace(run=Run(after for line in before.run.lines for after in change(line)))


def from_then_on(time, seconds):
    """Return a change by which all from a time on happens so many seconds later."""
    def apply(line):
        event = line.event
        if line.time < time:
            return [line]
        if isinstance(event, (Tick, PassStarted)):
            event = replace(event, at=event.at + seconds)
        return [replace(line, time=line.time + seconds, event=event)]
    return apply


def with_event(before, event, *others):
    """Return facts whose record has these events in place of one, at its time."""
    return changed(before, lambda line: [replace(line, event=other) for other in others]
                   if line.event is event else [line])


def calls(of_test, node=""):
    """Return the requests in the journal, those to one node if it is given."""
    return [line for line in of_test.journal if line.call and node in ("", line.node)]
