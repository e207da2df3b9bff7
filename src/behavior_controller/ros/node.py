"""The main program: checks everything, then runs the mission until it is over or somebody stops it.

Nothing moves before the configuration, the mission and the robot's nodes have been found right. Whatever is wrong is
told in full, in lines for an operator, and the exit code says of which kind it was.
"""
import os
import sys
import threading
import time
import xmlrpc.client
from typing import Any, Dict, List, Optional, Union

import rosgraph
import rospkg
import rospy

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, NodesMissing
from behavior_controller.events import Events
from behavior_controller.gateway import SAFE_STATE, Gateway, Topics
from behavior_controller.health import Health
from behavior_controller.leaves.base import MissionContext
from behavior_controller.leaves.vocabulary import registry
from behavior_controller.ros.connection import Trouble, ask_master
from behavior_controller.ros.console import Console, flush_every_line, report_internal_error
from behavior_controller.ros.monitor import Monitor
from behavior_controller.ros.plan import Plan, read_plan, tell_faults
from behavior_controller.ros.probe import StartUpCheck
from behavior_controller.ros.services import RosGateway
from behavior_controller.ros.signals import Signals
from behavior_controller.ros.topics import RosTopics
from behavior_controller.runner import Runner, Running
from behavior_controller.watch.board import Board
from behavior_controller.watch.groot2 import Groot2Publisher
from behavior_controller.watch.page import Page
from behavior_controller.watch.record import Record, new_folder

NAME = "behaviorController"
SUCCESS, NODES_MISSING, BAD_FILES, FAILED = 0, 1, 2, 3

NO_RECORD = "none"
"""The value of ``recordDirectory`` that has nothing recorded."""

USAGE = """usage: rosrun cssr_system behaviorController [_key:=value ...] [name:=other_name ...]

Runs the robot mission that config/behaviorControllerConfiguration.ini names, visitor after visitor, until it is stopped
(Ctrl-C). A key of that file given as _key:=value overrides the file. ROS names are remapped with name:=other_name.
A SIGHUP (kill -HUP) has it read configuration and mission again, for the next visitor.

exit codes: 0 the last pass was a SUCCESS; 3 it was a FAILURE; 1 nodes of the robot are missing;
            2 the configuration or the mission is wrong"""


def main(argv: List[str]) -> int:
    """Run the node and return its exit code. Raises nothing."""
    flush_every_line()
    arguments = rospy.myargv(argv)[1:]
    if arguments:
        return _explain(arguments)
    console = Console()
    threading.excepthook = lambda failed: report_internal_error(console, failed.exc_value)
    signals = Signals(console)
    signals.listen()
    try:
        return _run(argv, console, signals)
    except FaultsFound as found:
        tell_faults(found, console.tell, "nothing was started")
        return BAD_FILES
    except NodesMissing as missing:
        for line in str(missing).split("\n"):
            console.tell("error", line)
        return NODES_MISSING
    except Exception as error:  # the last resort: an operator never sees a traceback
        report_internal_error(console, error)
        return FAILED
    finally:
        _part_from_ros()
        signals.is_over = True


def leave(code: int) -> None:
    """End the process now: threads that still wait for a hung peer must not hold it."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _explain(arguments: List[str]) -> int:
    """Print what can be said on the command line; the exit code tells whether that was asked for."""
    is_asked = arguments[0] in ("-h", "--help")
    print(USAGE if is_asked else "behaviorController: unknown argument {!r}\n{}".format(arguments[0], USAGE),
          file=sys.stdout if is_asked else sys.stderr)
    return SUCCESS if is_asked else BAD_FILES


# ----------------------------------------------------------------------------------------------------------------- ROS


def _join_ros(argv: List[str]) -> None:
    """Become a ROS node, or say in one line why that is not possible; rospy alone would wait for ever for a master."""
    try:
        ask_master("getPid")
    except Trouble:
        raise NodesMissing("no ROS master at {}: start roscore or the robot, or set ROS_MASTER_URI".format(
            rosgraph.get_master_uri()))
    try:
        _check_parameters(rospy.client.load_command_line_node_params(argv))
        rospy.init_node(NAME, argv=argv, disable_signals=True)
    except (rospy.ROSException, ValueError) as error:
        raise ConfigurationError([Fault("command line", 0, 0, str(error))])


def _check_parameters(given: Dict[str, Any]) -> None:
    """Refuse parameters of the command line that ROS cannot carry, such as a date or null."""
    faults = []
    for name, value in given.items():
        try:
            xmlrpc.client.dumps((value,))
        except (TypeError, OverflowError):
            faults.append(Fault("parameter ~{}".format(name), 0, 0, "{} cannot be {}".format(name, value),
                                "allowed: a value that ROS can carry"))
    if faults:
        raise ConfigurationError(faults)


def _part_from_ros() -> None:
    """Have the master forget us, unless it hangs. rospy then waits for threads of its own, which we need not do."""
    is_forgotten = threading.Event()
    rospy.core.add_shutdown_hook(lambda reason: is_forgotten.set())
    threading.Thread(target=rospy.signal_shutdown, args=("the node ends",), daemon=True).start()
    is_forgotten.wait(0.4)


# ------------------------------------------------------------------------------------------------------------- the run


def _run(argv: List[str], console: Console, signals: Signals) -> int:
    """Do everything in order, and return the exit code. Raises FaultsFound or NodesMissing, before anything moves."""
    _join_ros(argv)
    console.attach()
    rospy.on_shutdown(signals.request_stop)  # ``rosnode kill``, or another node took our name
    clock, wake = Clock(), WakeUp()
    plan = read_plan(clock, wake, console.tell)
    console.is_verbose = plan.settings.verbose_mode
    signals.wake(wake.emit)
    topics = RosTopics(wake.emit, lambda text: console.tell("warning", text))
    check = StartUpCheck(plan.settings.asr_enabled, plan.settings.startup_timeout, console.tell)
    if check.run(wake, lambda: signals.stop_requested):
        return _Run(plan, topics, console, signals).carry_out()
    console.tell("info", "stopped before the mission began")
    return NODES_MISSING


class _Run:
    """A mission under way, and the one that was read anew to follow it."""

    def __init__(self, plan: Plan, topics: RosTopics, console: Console, signals: Signals):
        self._plan = plan
        self._following: Optional[Plan] = None
        self._clock, self._wake = plan.tree.clock, plan.tree.wake
        self._topics: Topics = topics
        self._console = console
        self._signals = signals
        self._events = Events()
        self._events.subscribe(console)
        self._health = Health(self._wake.emit)
        self._robot = RosGateway(plan.settings.deadline, self._clock, self._wake.emit, self._health)
        self._gateway: Gateway = self._robot  # or what records it
        self._watchers: List[Union[Groot2Publisher, Page, Record]] = []
        self._monitor = Monitor(topics, self._health, lambda: self._plan.settings.asr_enabled)

    def carry_out(self) -> int:
        """Run the mission and return the exit code."""
        console = self._console
        self._open_watchers()
        runner = Runner(self._running(), lambda: self._signals.stop_requested, self._successor)
        console.start_heartbeat(self._clock)
        self._monitor.start()
        self._signals.reload = self._reload
        try:
            return runner.run()
        except Exception as error:  # a mistake of ours must not leave the robot as it happens to be
            report_internal_error(console, error)
            self._calm()
            return FAILED
        finally:
            self._monitor.close()
            for watcher in self._watchers:
                watcher.close()

    def _open_watchers(self) -> None:
        """Let those look on who may; what they need is opened at the start only."""
        chosen = self._plan.settings

        def warn(text: str) -> None:
            self._console.tell("warning", text)

        if chosen.groot2_port:
            self._watchers.append(Groot2Publisher(
                chosen.groot2_address, chosen.groot2_port, registry().all(), warn))
        if chosen.monitor_port:
            board = Board(self._events, self._health, registry())
            self._watchers.append(Page(chosen.monitor_address, chosen.monitor_port, board, warn))
        if chosen.record_directory != NO_RECORD:
            folder = chosen.record_directory or new_folder(rospkg.get_log_dir())
            record = Record(folder, self._clock, warn)
            self._events.subscribe(record)
            self._watchers.append(record)
            self._gateway, self._topics = record.gateway(self._gateway), record.topics(self._topics)

    def _running(self) -> Running:
        """Return the plan as the runner wants it, and show it to who looks on."""
        plan = self._plan
        for watcher in self._watchers:
            watcher.show(plan.tree)
        context = MissionContext(self._gateway, self._topics, plan.settings, plan.phrases, plan.policy, self._clock,
                                 self._events, self._health)
        return Running(plan.tree, context, plan.mission, plan.settings.mission_runs)

    def _reload(self) -> None:
        """Read the files again; what is right follows the running mission after its pass. On the signals' thread."""
        try:
            self._following = read_plan(self._clock, self._wake, self._console.tell)
            self._console.tell("info", "read again: this follows when the visitor's pass is over")
        except FaultsFound as found:
            tell_faults(found, self._console.tell, "refused, the running mission stays")
        except Exception as error:  # a mistake of ours in reading a file is no reason to lose the running mission
            report_internal_error(self._console, error)

    def _successor(self) -> Optional[Running]:
        """Return what was read anew since the last pass."""
        following, self._following = self._following, None
        if following is None:
            return None
        self._plan = following
        self._robot.deadline = following.settings.deadline
        self._console.is_verbose = following.settings.verbose_mode
        return self._running()

    def _calm(self) -> None:
        """Give up every call and ask for the safe state, for a second at the most."""
        self._robot.close()
        calls = [self._robot.start(request) for request in SAFE_STATE]
        ends = time.monotonic() + 1.0
        while any(call.result is None for call in calls) and time.monotonic() < ends:
            self._wake.wait(max(0.0, ends - time.monotonic()))
            self._wake.test_and_clear()
