"""Tries leaves without ROS, on a robot and in a time that are the test's: for tests of this package
and of others."""
import os
from typing import Callable, List, Optional, Union

from behavior_controller.bt import ManualClock, Result
from behavior_controller.bt.loader.document import parse, read, with_includes
from behavior_controller.config import settings
from behavior_controller.run.events import Event, Events
from behavior_controller.run.health import Health
from behavior_controller.missions import load as missions
from behavior_controller.robot.declarations import Plain
from behavior_controller.robot.gateway import Failure, FakeGateway, FakeTopics
from behavior_controller.robot.requests import Answer, Request

Reply = Union[Answer, Failure, None]

_AROUND = '<root BTCPP_format="4"><BehaviorTree ID="Trial">{}</BehaviorTree></root>'


class Trial:
    """A mission that is ticked by hand: an element (``<SayTime/>``), a document, a file, or the
    name of a mission.

    ``answer`` gets each request and returns an Answer, a Failure, or None for no answer; without it
    each request succeeds. ``gateway.requests`` are the requests so far, ``topics.publish(TOPIC,
    value)`` is a message, ``clock.advance(seconds)`` lets time pass, ``tree.blackboard`` has the
    entries, ``events`` are what was reported. ``keys`` are those of the configuration. Raises
    FaultsFound for a mission that cannot be run.
    """

    def __init__(self, mission: str, answer: Optional[Callable[[Request], Reply]] = None,
                 **keys: Plain):
        self.clock, self.settings = ManualClock(1000.0), settings.defaults(**keys)
        if not mission.lstrip().startswith("<"):
            document = read(mission if os.path.isfile(mission) else missions.find(mission))
        elif "<root" in mission:
            document = parse(mission)
        else:
            document = parse(_AROUND.format(mission))
        loaded = missions.load(self.settings, self.clock, documents=with_includes(document))
        self.tree = loaded.tree
        self.gateway = FakeGateway(self.tree.wake.emit, answer or (lambda request: Answer()))
        self.topics = FakeTopics(self.clock.now, self.tree.wake.emit)
        self.events: List[Event] = []
        log = Events()
        log.subscribe(self.events.append)
        self.mission = loaded.context(self.gateway, self.topics, log, Health(self.tree.wake.emit))
        self._is_set_up = False

    def tick(self) -> Result:
        """Tick the mission once, and return its status; the first tick sets it up."""
        if self.tree.nodes and not self._is_set_up:
            self.tree.setup(mission=self.mission)
            self._is_set_up = True
        return self.tree.tick_once()
