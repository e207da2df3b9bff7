"""The time of /clock, by which the mission goes where ``/use_sim_time`` is true.

The node has a connection of its own, from before it takes its name on; rospy's time follows it.
"""
import os
import time
from typing import Callable, Dict, Optional

import genpy
import rospy

from behavior_controller.bt.engine.clock import SimulatedClock
from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import NodesMissing
from behavior_controller.ros.master import DIRECTORY, USE_SIM_TIME
from behavior_controller.ros.startup_check import PROBE_LIMIT
from behavior_controller.ros.subscriber import TopicBuffer
from behavior_controller.ros.tcpros import RETRY_INTERVAL, Trouble
from behavior_controller.ros.timeouts import run_apart
from behavior_controller.ros.types import CLOCK


class SimulatedTime(TopicBuffer):
    """Sets ``mission_clock``. Its own times are those of the process: the monitor tells by them
    that the simulated time stands still."""

    suffix = f"_clock_{os.getpid()}"  # a running node of this name keeps its connection

    def __init__(self, mission_clock: SimulatedClock, warn: Callable[[str], None]):
        self._mission_clock = mission_clock
        super().__init__(CLOCK, lambda: None, warn, mission_clock.process)

    def hear(self, value: genpy.Time, data: Optional[bytes] = None) -> None:
        """Go on to that time, if it is another one: a simulator that pauses may repeat it."""
        with self._lock:
            newest = self.recent()
            if newest and newest[-1].value == value:
                return
            super().hear(value, data)
            rospy.rostime._set_rostime(value)
            self._mission_clock.set_to(value.to_sec())

    def pass_over(self, header: Dict[str, str], data: bytes) -> None:
        """Use the first message of a latching publisher too: no other may come while the time
        stands still."""
        self.receive([data])

    def await_first(self, seconds: float, tell: Callable[[str, str], None], wake: WakeUp,
                    is_stopped: Callable[[], bool]) -> None:
        """Return when the time has begun. Raises ``Stopped``, and NodesMissing if it has not after
        ``seconds``, or ``PROBE_LIMIT`` where a node publishes it."""
        began, told = time.monotonic(), False
        while self._mission_clock.simulated is None:
            run_apart(self._look, wake, is_stopped, 2 * PROBE_LIMIT)
            limit = max(seconds, PROBE_LIMIT) if self._links else seconds
            left = began + limit - time.monotonic()
            if left <= 0.0:
                raise NodesMissing(
                    f"{USE_SIM_TIME} is true, and no time comes on {self.name}: {self.absence}; "
                    "start the simulator or let it go on (rosbag play needs --clock), set "
                    f"startupTimeout to wait for it, or rosparam set {USE_SIM_TIME} false")
            if seconds and not told:
                tell("info", f"waiting up to {seconds:.0f} s for the time on {self.name}")
                told = True
            wake.wait(min(RETRY_INTERVAL, left))
            wake.test_and_clear()
        tell("info", f"the mission goes by the simulated time on {self.name}")

    @property
    def absence(self) -> str:
        """Why no time comes."""
        if self.is_connected:
            return "its publisher sends none"
        return super().absence

    def _look(self) -> None:
        try:
            DIRECTORY.refresh()
            self.set_publishers(DIRECTORY.publishers(self.name, self.connected_nodes))
        except Trouble as trouble:
            if trouble.shortage is not None:
                raise trouble.shortage
            raise NodesMissing(f"the publishers of {self.name} cannot be looked up: {trouble}")
