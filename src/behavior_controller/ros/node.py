"""The main program: checks everything, then runs the mission until it is over or stopped.

Nothing moves before the configuration, the mission and the robot's nodes have been checked. Every fault is reported in
lines for an operator, and the exit code says which kind it was.
"""
import collections
import os
import sys
import threading
import time
from typing import Any, Callable, Deque, List, Optional, Union

import rosgraph
import rosgraph.network
import rospkg
import rospy
from rospy.impl.paramserver import get_param_server_cache

from behavior_controller import exits
from behavior_controller.apart import Late, Stopped, run_apart, run_together
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, NodesMissing
from behavior_controller.events import Events
from behavior_controller.gateway import Gateway, Topics
from behavior_controller.health import Health
from behavior_controller.keys import help_lines
from behavior_controller.leaves import registry
from behavior_controller.mission import Mission
from behavior_controller.ros.connection import Trouble, ask_master
from behavior_controller.ros.console import Console, report_internal_error
from behavior_controller.ros.monitor import Monitor
from behavior_controller.ros.plan import read_plan, tell_faults
from behavior_controller.ros.probe import StartUpCheck
from behavior_controller.ros.services import RosGateway
from behavior_controller.ros.signals import Signals, block_signals
from behavior_controller.ros.topics import RosTopics
from behavior_controller.runner import Runner, Running, not_calm
from behavior_controller.settings import KEYS, split_arguments
from behavior_controller.watch.board import Board
from behavior_controller.watch.groot2 import Groot2Publisher
from behavior_controller.watch.page import Page
from behavior_controller.watch.record import Record, new_folder

NAME = "behaviorController"

NO_TOPICS_IN_ROSOUT = "/rosout_disable_topics_generation"

NO_RECORD = "none"
"""The value of ``recordDirectory`` that turns recording off."""

USAGE = """usage: rosrun cssr_system behaviorController [_key:=value ...] [name:=other_name ...]

Runs the robot mission that config/behaviorControllerConfiguration.ini names, visitor after visitor, until it is stopped
(Ctrl-C). A key of that file given as _key:=value overrides the file. ROS names are remapped with name:=other_name.
A SIGHUP (kill -HUP) has it read configuration and mission again, for the next visitor.

exit codes: 0 the last pass was a SUCCESS, or another node was started under the same name; 3 it was a FAILURE;
            1 nodes of the robot are missing; 2 the configuration or the mission is wrong;
            4 the node could not go on: no memory, threads or files left, or an internal error"""

START_LIMIT = 15.0
"""Seconds that each step of the start may take that uses the master or a disk."""

LAST_LINES = 0.2
"""Seconds to write the remaining lines. Twice this, the safe state and ``CLOSING`` fit into STOP_LIMIT."""

CLOSING = 0.4
"""Seconds at the end to unregister from the master and to close the monitoring."""

CLOSING_UNHURRIED = 2.0
"""The same if no stop was requested."""

PARTING = "the node ends"
REQUESTED = "external shutdown request"
"""The beginning of rospy's reason when another node or the master asked this node to end."""

NAME_IS_TAKEN = "same name"
"""A part of the master's reason when it ends a node because another registers under its name."""


def main(argv: List[str]) -> int:
    """Run the node and return its exit code."""
    block_signals()
    console = Console()
    signals = Signals(console)
    signals.listen()
    arguments = rospy.myargv(argv)[1:]
    if arguments:
        code = _explain(arguments)
    else:
        node = _Node(argv, console, signals)
        code = node.run()
        node.close()
    signals.is_over = True
    console.drain(LAST_LINES)
    return code


def leave(code: int) -> None:
    """End the process now: threads that still wait for a hung peer must not hold it."""
    os._exit(code)


def _explain(arguments: List[str]) -> int:
    """Print the usage; the exit code says whether it was requested."""
    is_asked = arguments[0] in ("-h", "--help")
    if is_asked:
        print("\n".join([USAGE, "", "keys, their defaults and meanings:"] + help_lines(KEYS)))
    else:
        print("behaviorController: unknown argument {!r}\n{}".format(arguments[0], USAGE), file=sys.stderr)
    return exits.SUCCESS if is_asked else exits.WRONG_INPUT


# ----------------------------------------------------------------------------------------------------------------- ROS


def _join_ros(argv: List[str]) -> None:
    """Become a ROS node, or say in one line why that is not possible; rospy alone would wait for a master without end."""
    try:
        is_silent = ask_master("getParam", NO_TOPICS_IN_ROSOUT)
    except Trouble:
        raise NodesMissing("no ROS master at {}: start roscore or the robot, or set ROS_MASTER_URI".format(
            rosgraph.get_master_uri()))
    # rospy would ask the master at each line for /rosout. A master that hangs would hold the lines back, and that
    # question registers the node: asked by a node whose name was taken, it would shut down the one that took it.
    get_param_server_cache().set(NO_TOPICS_IN_ROSOUT, bool(is_silent))
    try:
        rospy.init_node(NAME, argv=split_arguments(argv)[0], disable_signals=True)
    except (rospy.ROSException, ValueError) as error:
        if rospy.is_shutdown():
            raise Stopped("rospy has ended meanwhile")  # and the reason was told
        raise ConfigurationError([Fault("command line", 0, 0, str(error))])


def _part_from_ros() -> None:
    """Unregister from the master. Unlike rospy's own shutdown, this does not wait for rospy's threads."""
    is_forgotten = threading.Event()
    rospy.core.add_shutdown_hook(lambda reason: is_forgotten.set())
    threading.Thread(target=rospy.signal_shutdown, args=(PARTING,), daemon=True).start()
    is_forgotten.wait()


# ------------------------------------------------------------------------------------------------------------ the node


class _Node:
    """The node from its start to its end."""

    def __init__(self, argv: List[str], console: Console, signals: Signals):
        self._argv = argv
        self._console = console
        self._signals = signals
        self._wake = WakeUp()
        self._stop_code: Optional[int] = None  # of a stop with a special exit code
        self._run: Optional[_Run] = None

    def run(self) -> int:
        """Run the node, and return the exit code. Raises nothing."""
        console = self._console
        threading.excepthook = lambda failed: report_internal_error(console, failed.exc_value or failed.exc_type())
        self._signals.wake(self._wake.emit)
        try:
            return self._carry_out()
        except Stopped:
            console.tell("info", "stopped before the mission began")
            return exits.UNAVAILABLE if self._stop_code is None else self._stop_code
        except FaultsFound as found:
            tell_faults(found, console.tell, "nothing was started")
            return exits.WRONG_INPUT
        except NodesMissing as missing:
            for line in str(missing).split("\n"):
                console.tell("error", line)
            return exits.UNAVAILABLE
        except Exception as error:  # the last resort: an operator never sees a traceback
            report_internal_error(console, error)
            return exits.BROKEN

    def _carry_out(self) -> int:
        """Do the steps of the start, each of which raises its faults; run the mission and return the exit code."""
        console, wake, clock = self._console, self._wake, Clock()
        master = "the ROS master at {}".format(rosgraph.get_master_uri())
        files = "configuration and mission (their files, or the parameters of the ROS master)"
        silent_master = NodesMissing("{} no longer answers: start it again".format(master))
        rospy.core.add_preshutdown_hook(self._ros_ends)
        self._apart(lambda: _join_ros(self._argv), master, silent_master)
        console.attach()
        plan = self._apart(lambda: read_plan(clock, wake, console.tell), files, _no_answer(files))
        console.is_verbose = plan.settings.verbose_mode
        topics = self._apart(
            lambda: RosTopics(plan.settings.interface, wake.emit, lambda text: console.tell("warning", text)), master,
            silent_master)
        check = StartUpCheck(plan, console.tell)
        if not check.run(wake, self._is_stopped):
            raise Stopped("stopped")
        self._run = _Run(plan, topics, console, self._signals)
        addresses = "groot2Address, monitorAddress or recordDirectory"
        self._apart(self._run.open_watchers, addresses, _no_answer(addresses))
        return self._run.carry_out(lambda: self._stop_code)

    def _apart(self, step: Callable[[], Any], what: str, late: Exception) -> Any:
        """Do a step of the start that may hang on ``what``; raises ``late`` if it does, and ``Stopped``."""
        try:
            return run_apart(step, self._wake, self._is_stopped, START_LIMIT, lambda: self._console.tell(
                "info", "waiting up to {:g} s for {}".format(START_LIMIT, what)))
        except Late:
            raise late

    def _is_stopped(self) -> bool:
        return self._signals.stop_requested

    def _ros_ends(self, reason: str) -> None:
        """Stop after ``rosnode kill``, a new node of the same name, or an error in rospy. On one of rospy's threads."""
        if reason == PARTING:
            return
        if NAME_IS_TAKEN in reason:
            self._stop_code = exits.SUCCESS  # a supervisor must not restart this node: it would end the other
            self._console.tell("warning", "another node was started under the name {}: that one stays, this one ends"
                               .format(rospy.get_name()))
        elif not reason.startswith(REQUESTED):
            self._stop_code = exits.BROKEN
            report_internal_error(self._console, RuntimeError(reason))
        self._signals.request_stop()

    def close(self) -> None:
        """End recording and monitoring, within a time limit."""
        self._console.drain(LAST_LINES)
        closers = self._run.closers() if self._run is not None else []
        try:
            run_together(closers + [_part_from_ros], CLOSING if self._is_stopped() else CLOSING_UNHURRIED)
        except RuntimeError:
            pass  # no threads left: the process ends anyway


def _no_answer(what: str) -> ConfigurationError:
    return ConfigurationError([Fault(what, 0, 0, "no answer within {:g} s".format(START_LIMIT))])


# ------------------------------------------------------------------------------------------------------------- the run


class _Run:
    """The running mission, and the reloaded one that follows it."""

    def __init__(self, plan: Mission, topics: RosTopics, console: Console, signals: Signals):
        self._plan = plan
        self._following: Deque[Mission] = collections.deque(maxlen=1)  # filled by the thread that reads
        self._reading: Optional[threading.Thread] = None
        self._clock, self._wake = plan.tree.clock, plan.tree.wake
        self._topics: Topics = topics
        self._console = console
        self._signals = signals
        self._events = Events()
        self._events.subscribe(console)
        self._health = Health(self._wake.emit)
        self._robot = RosGateway(
            plan.settings.interface, plan.settings.deadline, self._clock, self._wake.emit, self._health)
        self._gateway: Gateway = self._robot  # or what records it
        self._watchers: List[Union[Groot2Publisher, Page, Record]] = []
        self._record: Optional[Record] = None
        self._page = ""  # where it is to be found, if it is served
        self._monitor = Monitor(plan.settings.interface, topics, self._health, lambda: self._plan.settings.asr_enabled)

    def carry_out(self, stop_code: Callable[[], Optional[int]]) -> int:
        """Run the mission and return the exit code."""
        console = self._console
        runner = Runner(self._running(), lambda: self._signals.stop_requested, self._successor, stop_code)
        console.start_heartbeat(self._clock)
        try:
            self._monitor.start()
            self._signals.reload = self._reload
            return runner.run()
        except Exception as error:  # an internal error must not leave the robot in an arbitrary state
            report_internal_error(console, error)
            self._calm()
            return exits.BROKEN
        finally:
            if self._page:
                console.tell("info", "page of this run, closed now: {}".format(self._page))
            if self._record is not None and self._record.is_kept:
                console.tell("info", "record of this run: {}".format(self._record.path))

    def closers(self) -> List[Callable[[], None]]:
        """Return the functions that end the monitoring of the robot and of the mission; each may take long."""
        return [self._monitor.close] + [watcher.close for watcher in self._watchers]

    def open_watchers(self) -> None:
        """Open monitoring and record, once for the whole run."""
        chosen, tell = self._plan.settings, self._console.tell

        def warn(text: str) -> None:
            tell("warning", text)

        if chosen.groot2_port:
            self._watchers.append(Groot2Publisher(
                chosen.groot2_address, chosen.groot2_port, registry().all(), warn))
        if chosen.monitor_port:
            board = Board(self._events, self._health, registry(), chosen.interface)
            page = Page(chosen.monitor_address, chosen.monitor_port, board, warn)
            self._watchers.append(page)
            if page.is_served:
                self._page = _url(chosen.monitor_address, chosen.monitor_port)
                tell("info", "page: {}".format(self._page))
        if chosen.record_directory != NO_RECORD:
            folder = chosen.record_directory or new_folder(rospkg.get_log_dir())
            record = self._record = Record(folder, self._clock, warn, chosen.interface)
            tell("info", "record: {}".format(record.path))
            self._events.subscribe(record)
            self._watchers.append(record)
            self._gateway, self._topics = record.gateway(self._gateway), record.topics(self._topics)

    def _running(self) -> Running:
        """Return the plan in the runner's form, and pass it to the monitoring."""
        plan = self._plan
        for watcher in self._watchers:
            watcher.show(plan.tree)
        robot = plan.settings.interface
        self._monitor.include(plan.offers)
        # a stop requests the safe state even if the master hangs: the addresses of its services must be known before
        self._monitor.include(robot.used({type(request) for request in robot.safe_state}, ()), may_lack=True)
        context = plan.context(self._gateway, self._topics, self._events, self._health)
        return Running(plan.tree, context, plan.file, plan.settings.mission_runs)

    def _reload(self) -> None:
        """Reload the files on a separate thread: a disk or the master may hang. On the signals' thread."""
        if self._reading is not None and self._reading.is_alive():
            self._console.tell("warning", "SIGHUP ignored: the files are still being read since the one before; "
                               "if that does not end, a disk or the master hangs")
            return
        self._reading = threading.Thread(target=self._read_again, name="reload", daemon=True)
        try:
            self._reading.start()
        except RuntimeError as error:
            report_internal_error(self._console, error)

    def _read_again(self) -> None:
        """Read the files; a valid mission follows the running one after its pass."""
        try:
            following = read_plan(self._clock, self._wake, self._console.tell)
            chosen, now = following.settings.robot_interface, self._plan.settings.robot_interface
            if chosen != now:
                self._console.tell("error", "refused, the running mission stays: robotInterface {} cannot follow {} "
                                   "while the node runs; start the node again".format(chosen, now))
                return
            self._following.append(following)
            self._console.tell("info", "reloaded: this mission follows when the visitor's pass is over")
        except FaultsFound as found:
            tell_faults(found, self._console.tell, "refused, the running mission stays")
        except NodesMissing as missing:
            self._console.tell("error", "refused, the running mission stays: {}".format(missing))
        except Exception as error:  # an internal error in reading a file must not end the running mission
            report_internal_error(self._console, error)

    def _successor(self) -> Optional[Running]:
        """Return the plan that was reloaded since the last pass, or None."""
        if not self._following:
            return None
        following = self._following.pop()
        self._plan = following
        self._robot.deadline = following.settings.deadline
        self._console.is_verbose = following.settings.verbose_mode
        return self._running()

    def _calm(self) -> None:
        """Drop every call and request the safe state, for a second at most."""
        self._robot.close()
        calls = [self._robot.start(request) for request in self._plan.settings.interface.safe_state]
        ends = time.monotonic() + 1.0
        while any(call.result is None for call in calls) and time.monotonic() < ends:
            self._wake.wait(max(0.0, ends - time.monotonic()))
            self._wake.test_and_clear()
            self._clock.run_posted()
        for line in not_calm(calls, self._plan.settings.interface, self._plan.offers):
            self._console.tell("warning", line)


def _url(address: str, port: int) -> str:
    """Return the address of the page, with the host's name if it is served at all of its addresses."""
    host = rosgraph.network.get_host_name() if address in ("0.0.0.0", "::") else address
    return "http://{}:{}/".format("[{}]".format(host) if ":" in host else host, port)
