"""The main program: checks everything, then runs the mission until it is over or stopped.

Nothing moves before the configuration, the mission and the robot's nodes have been checked. Every
fault is reported in lines for an operator, and the exit code says which kind it was.
"""
import collections
import contextlib
import logging
import os
import reprlib
import sys
import threading
from typing import Any, Callable, Deque, Dict, FrozenSet, Iterable, List, NoReturn, Optional, Tuple

import rosgraph
import rospy

from behavior_controller import exit_codes, extensions, folders
from behavior_controller.ros.timeouts import Late, Stopped, run_apart, run_together, start_thread
from behavior_controller.bt.engine.clock import Clock, SimulatedClock
from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import (
    BehaviorControllerError, ConfigurationError, Fault, FaultsFound, NodesMissing)
from behavior_controller.run.events import Events, Noticed, RunFinished, use_simulated_time
from behavior_controller.foreign_code import described
from behavior_controller.run.health import Health
from behavior_controller.missions.checks import checks
from behavior_controller.missions.load import Mission
from behavior_controller.robot.declarations import Offer
from behavior_controller.ros import ros_interface
from behavior_controller.ros_arguments import version
from behavior_controller.ros.in_use import asked_services, check_unused
from behavior_controller.ros.console import FILE_ONLY, Console, log_path, open_log
from behavior_controller.ros.handshakes import (
    bound_handshakes, pause_without_files, refuse_web_pages)
from behavior_controller.ros.master import (
    IN_USE, NAME_IS_TAKEN, USE_SIM_TIME, adopt, join, set_names)
from behavior_controller.ros.names import words_of
from behavior_controller.ros.watchdog import Monitor
from behavior_controller.ros.configuration import (
    chosen_robot, read_plan, report_faults, valid_values)
from behavior_controller.ros.outputs import Outputs, record_place
from behavior_controller.ros.shortage import is_shortage
from behavior_controller.ros.startup_check import StartUpCheck
from behavior_controller.ros.service_client import RosGateway
from behavior_controller.ros.signals import Signals, block_signals
from behavior_controller.ros.simulated_time import SimulatedTime
from behavior_controller.ros.subscriber import RosTopics
from behavior_controller.ros.types import CLOCK
from behavior_controller.missions.runner import Runner, Running
from behavior_controller.run.safe_state import SAFE_STATE_LIMIT, SafeState
from behavior_controller.config.settings import FILE_NAME, KEYS, OPERATOR, split_arguments, unread
from behavior_controller.missions.blocked_tick import BlockedTickMonitor
from behavior_controller.run.record.unended import may_be_live

NAME = "behaviorController"

_USAGE = """usage: rosrun cssr_system behaviorController [_key:=value ...] [/name:=/other_name ...]

Runs the robot mission that config/behaviorControllerConfiguration.ini names, visitor after
visitor, until it is stopped (Ctrl-C). A key of that file given as _key:=value overrides the file.
ROS names are remapped with /name:=/other_name. A SIGHUP (kill -HUP) has it read configuration and
mission again, for the next visitor.

exit codes: 0 the last pass was a SUCCESS, or another node was started under the same name;
            1 nodes of the robot are missing, or another controller uses them;
            2 the configuration or the mission is wrong;
            3 the last pass was a FAILURE;
            4 the node could not go on: no memory, threads or files left, or an internal error"""

ALLOWED_ARGUMENTS = "allowed: _key:=value, /name:=/other_name, --help, --version"

START_STEP_LIMIT = 15.0
"""Seconds that each step of the start may take that uses the master or a disk."""

FORMER_LIMIT = 5.0
"""Seconds to find out how the run before has ended, when a start is refused."""

LOG_LIMIT = 5.0
"""Seconds to open the log file, without which the node runs too."""

_LAST_LINES = 0.2
"""Seconds to write the remaining lines, before the closing and after it."""

BLOCKED = 0.2
"""Seconds for which the tick thread must stay where it is before a stop goes on without it."""

SAFE_STATE_BESIDE = 0.6
"""Seconds for the safe state then. With ``REACTION_LIMIT`` and ``BLOCKED`` before it and the end
after it, they fit into STOP_LIMIT."""

CLOSE_LIMIT = 2.0
"""Seconds at the end to unregister from the master and to close the record; after a stop, what is
left of its time."""

END_RESERVE = 0.1
"""Seconds after a stop by which the process ends before STOP_LIMIT."""

WAITING, PAUSED = "waiting for the operator's start", "paused by the operator"
"""What an operator may hold the run for."""

MISSION_FILES = "configuration and mission (their files, or the parameters of the ROS master)"

NOTHING = "nothing was started"

_LOG_FILE = logging.getLogger(FILE_ONLY)

OWN_END = "the node ends"
REQUESTED = "external shutdown request"
"""The beginning of rospy's reason when another node or the master asked this node to end."""


def run() -> NoReturn:
    """Run the node, and end the process with its exit code."""
    block_signals()
    node = _Node(Console())
    node.end(node.run())


def _explain(wish: str) -> int:
    """Print the version, or the usage and all keys."""
    usage = [_USAGE, "", "keys, their defaults and meanings:"]
    usage += [f"  {key.name:<26} {key.default_text:<12} {key.plain_meaning}" for key in KEYS]
    print(f"{NAME} {version()}" if wish == "--version" else "\n".join(usage))
    return exit_codes.SUCCESS


# ---------------------------------------------------------------------------------------------- ROS


def _unregister() -> None:
    """Unregister from the master. Unlike rospy's own shutdown, this does not wait for rospy's
    threads."""
    is_forgotten = threading.Event()
    rospy.core.add_shutdown_hook(lambda reason: is_forgotten.set())
    start_thread("parting", rospy.signal_shutdown, OWN_END)
    is_forgotten.wait()


def _former_may_be_live() -> str:
    """See ``may_be_live``."""
    values = valid_values()
    return may_be_live(record_place(values), values["robot"])


# ----------------------------------------------------------------------------------------- the node


class _Node:
    """The node from its start to its end."""

    def __init__(self, console: Console):
        self._console, self._wake = console, WakeUp()
        self._run: Optional[_Run] = None
        self._simulated: Optional[SimulatedTime] = None
        self._events = Events()
        self._events.subscribe(console)
        self._outputs = Outputs(self._events, console.tell)
        self._signals = Signals(console, self._wake.emit, self._stop_beside)
        self._is_stopped = self._signals.stop_requested.is_set

    def run(self) -> int:
        """Run the node, and return the exit code. Raises nothing."""
        console = self._console
        threading.excepthook = lambda failed: _report_thread(
            console, failed.exc_value or failed.exc_type())
        try:
            return self._carry_out()
        except Stopped:
            console.tell("info", "stopped before the mission began")
            code = self._signals.stop_code
            return exit_codes.UNAVAILABLE if code is None else code
        except FaultsFound as error:
            report_faults(error, self._outputs.note, NOTHING)
            return self._refused(exit_codes.WRONG_INPUT)
        except NodesMissing as missing:
            for line in str(missing).split("\n"):
                self._outputs.note("error", line)
            return self._refused(exit_codes.UNAVAILABLE)
        except BaseException as error:  # the last resort: an operator never sees a traceback
            console.report_internal_error(error)
            return exit_codes.BROKEN

    def _refused(self, code: int) -> int:
        """Show that the start has failed, and return ``code``.

        If the run before was killed, say what the robot may still do: this one does not take over.
        What cannot be found out is not said.
        """
        self._outputs.record(RunFinished(NOTHING, code))
        with contextlib.suppress(Exception):
            said = run_apart(_former_may_be_live, self._wake, self._is_stopped, FORMER_LIMIT)
            if said:
                self._console.warn(said)
        return code

    def _stop_beside(self) -> None:
        """End the node without the tick thread if a leaf blocks it."""
        if self._run is not None and self._run.stop_without_tree():
            self.end(exit_codes.BROKEN)

    def _carry_out(self) -> int:
        """Do the steps of the start, each of which raises its faults; run the mission and return
        the exit code.

        Until all is known to be good, the node is not registered: a start that fails must not end a
        running node.
        """
        arguments = rospy.myargv(sys.argv)[1:]
        if arguments and arguments[0] in ("-h", "--help", "--version"):
            return _explain(arguments[0])
        console, given = self._console, split_arguments(sys.argv)[0]
        faults = unread(given[1:]) + [
            Fault("command line", 0, 0, f"unknown argument {argument!r}", ALLOWED_ARGUMENTS)
            for argument in arguments]
        if faults:
            raise ConfigurationError(faults)
        master = f"the ROS master at {rosgraph.get_master_uri()}"
        silent_master = NodesMissing(f"{master} no longer answers: start it again")
        rospy.core.add_preshutdown_hook(self._ros_ends)
        clock = self._clock(self._apart(lambda: adopt(NAME, given), master, silent_master))
        words = words_of(self._apart(chosen_robot, MISSION_FILES), given)
        set_names(NAME, words)
        self._open_log()
        with contextlib.suppress(FaultsFound):  # which are reported when all is read
            self._apart(lambda: self._outputs.open_viewer(valid_values()), MISSION_FILES)
        plan = self._prepare(clock)
        if self._simulated is not None:
            self._simulated.await_first(plan.settings.startup_timeout, self._outputs.note,
                                        self._wake, self._is_stopped)
        check = StartUpCheck(plan, self._outputs.note, self._wake, self._is_stopped,
                             self._outputs.note_check)
        check.run()
        services = asked_services(plan)
        self._apart(lambda: check_unused(services), master, silent_master)
        topics = RosTopics(plan.offers, self._wake.emit, console.warn, clock)
        if self._simulated is not None:
            topics.buffers[CLOCK] = self._simulated
        self._run = run = _Run(plan, topics, self._outputs, console, self._events,
                               self._signals, check.substituted)
        self._apart(run.runner.prepare, "the set-up of the mission's leaves")
        refuse_web_pages(console.warn)
        pause_without_files()
        self._apart(lambda: self._join(words, services), master, silent_master)
        self._apart(topics.subscribe, master, silent_master)
        self._apart(run.open_outputs, "recordDirectory")
        return run.carry_out()

    def _join(self, words: List[str], services: FrozenSet[str]) -> None:
        """Register the node, which asks these services. Raises as ``join`` and ``check_unused``."""
        IN_USE.services = services
        former = join(NAME, words)
        bound_handshakes()
        self._console.attach()
        if former:
            self._console.warn(f"the former node of the name {rospy.get_name()} (at {former}) does "
                               "not end: end its process, or two nodes control the robot")
        check_unused(services, is_registered=True)
        IN_USE.is_running = True

    def _clock(self, is_simulated: object) -> Clock:
        """Return the clock by which the mission goes; one that /clock sets if time is simulated."""
        if is_simulated not in (None, False, True):
            self._console.warn(f"the parameter {USE_SIM_TIME} is {reprlib.repr(is_simulated)}, and "
                               "must be true or false: the mission goes by the computer's time")
        if is_simulated not in (True,):
            return Clock()
        clock = SimulatedClock(self._wake.emit)
        use_simulated_time(clock.source, lambda: clock.simulated)
        self._simulated = SimulatedTime(clock, self._console.warn)
        return clock

    def _prepare(self, clock: Clock) -> Mission:
        """Return the mission."""
        plan = self._apart(lambda: read_plan(clock, self._wake, self._console.tell), MISSION_FILES)
        if plan.settings.ros_interface:
            ros_interface.types()
        for doubt in extensions.doubts:
            self._console.warn(str(doubt))
        for check in checks(plan, folders.config(FILE_NAME)):
            self._outputs.note_check(check)
        self._console.is_verbose = plan.settings.verbose_mode
        return plan

    def _open_log(self) -> None:
        """Write to rospy's log file from now on, or report why not."""
        path, reason = log_path(), ""
        try:
            run_apart(lambda: open_log(path), self._wake, self._is_stopped, LOG_LIMIT)
        except Stopped:
            raise
        except (Late, OSError) as error:
            reason = getattr(error, "strerror", None) or str(error)
        except Exception as error:  # rospkg parses every package.xml, and one may be half-written
            reason = f"ROS cannot set up its logging: {described(error)}"
        # rospy would open it a second time, or hang
        rospy.core.configure_logging = lambda *_: None
        self._console.attach()
        if reason:
            self._console.warn(f"no log file is written to {path}: {reason}; the node goes on")

    def _apart(self, step: Callable[[], Any], what: str, late: Optional[Exception] = None) -> Any:
        """Do a step of the start that may hang on ``what``, or on another package's code, and
        return its result.

        Raises an error that names that code, or else ``late`` or ``what``, if it hangs, and
        ``Stopped``.
        """
        try:
            notice = f"waiting up to {START_STEP_LIMIT:g} s for {what}"
            return run_apart(step, self._wake, self._is_stopped, START_STEP_LIMIT,
                             lambda: self._console.tell("info", notice))
        except Late as error:
            silence = ConfigurationError.of(what, f"no answer within {START_STEP_LIMIT:g} s")
            raise extensions.late(START_STEP_LIMIT, error.frame) or late or silence

    def _ros_ends(self, reason: str) -> None:
        """Stop after ``rosnode kill``, a new node of the same name, or an error in rospy. On one of
        rospy's threads."""
        if reason == OWN_END:
            return
        if NAME_IS_TAKEN in reason:
            # a supervisor must not restart this node: it would end the other
            self._signals.stop_code = exit_codes.SUCCESS
            self._console.warn("another node was started under the name "
                               f"{rospy.get_name()}: that one stays, this one ends")
        elif not reason.startswith(REQUESTED):
            self._signals.stop_code = exit_codes.BROKEN
            self._console.report_internal_error(RuntimeError(reason))
        self._signals.request_stop()

    def end(self, code: int) -> NoReturn:
        """End the recording, within a time limit, and the process at once: threads that still wait
        for a hung peer must not hold it."""
        self._console.drain(_LAST_LINES)
        limit = min(CLOSE_LIMIT, self._signals.time_left - _LAST_LINES - END_RESERVE)
        with contextlib.suppress(RuntimeError):  # no threads left: the process ends anyway
            run_together(self._outputs.record.closers() + [_unregister], limit)
        self._signals.is_over = True
        self._console.drain(_LAST_LINES)
        os._exit(code)


def _report_thread(console: Console, error: BaseException) -> None:
    """Report what has ended a thread, which may be one of another package."""
    if isinstance(error, SystemExit):
        return  # Python's way to end a thread
    failure = extensions.thread_failure(error)
    if failure is None or is_shortage(error):
        console.report_internal_error(error)
    else:
        console.tell("error", str(failure))
        _LOG_FILE.info("a thread of another package", exc_info=error)


# ------------------------------------------------------------------------------------------ the run


class _Run:
    """The running mission, and the reloaded one that follows it."""

    def __init__(self, plan: Mission, topics: RosTopics, outputs: Outputs, console: Console,
                 events: Events, signals: Signals, substituted: Iterable[Offer]):
        """``substituted`` are the parts of the robot that others stand in for at the start."""
        self._plan = plan
        # filled by the thread that reads
        self._following: Deque[Mission] = collections.deque(maxlen=1)
        self._reading: Optional[threading.Thread] = None
        self._clock, self._wake = plan.tree.clock, plan.tree.wake
        self._topics = outputs.record.topics(topics)
        self._console, self._outputs = console, outputs
        self._signals, self._events = signals, events
        self._health = Health(self._wake.emit)
        self._robot = RosGateway(plan.settings.interface, plan.settings.deadline, self._clock,
                                 self._wake.emit, self._health,
                                 lambda text: events.emit(Noticed("warning", text)),
                                 substituted)
        # what the operator holds the run for; empty: nothing
        self._held = WAITING if plan.settings.start_by == OPERATOR else ""
        self._monitor = Monitor(plan.settings.interface, topics, self._health,
                                lambda: self._plan.settings.asr_enabled,
                                lambda: self._plan.settings.gaze_value)
        self.runner = Runner(self._running(plan), signals.stop_requested.is_set, self._successor,
                             lambda: signals.stop_code, lambda: self._held,
                             rospy.resolve_name("~start"))
        self._blocked_tick = BlockedTickMonitor(
            self.runner, lambda level, text: events.emit(Noticed(level, text)))

    def carry_out(self) -> int:
        """Run the mission, whose leaves are set up, and return the exit code."""
        self._console.start_heartbeat(self._clock.process, self._events.emit, self._outputs.record)
        try:
            self._monitor.start()
            self._blocked_tick.start()
            self._signals.reload = self._reload_by_signal
            return self.runner.run()
        # an internal error must not leave the robot in an arbitrary state
        except BaseException as error:
            self.runner.is_stopping = True
            self._console.report_internal_error(error)
            self._robot.close()
            self.leave_safe()
            return exit_codes.BROKEN
        finally:
            self._outputs.tell_places()

    def open_outputs(self) -> None:
        """Open the outputs of the run, once."""
        self._outputs.open_files(self._plan.settings.values)
        if self._plan.settings.ros_interface:
            self._outputs.record.add(
                ros_interface.RosInterface(self._plan.settings.interface,
                                           lambda: self._plan.offers, self._commands()))

    def _commands(self) -> Dict[str, ros_interface.Command]:
        """Return what the operator's services do, each on a thread of rospy."""
        def hold(words: str, answer: str) -> Tuple[bool, str]:
            self._held = words
            self._wake.emit()
            return True, answer

        def stop() -> Tuple[bool, str]:
            self._signals.request_stop()
            return True, "the robot is asked for the safe state, and the node ends"

        def reload() -> Tuple[bool, str]:
            if not self._reload():
                return False, "the files are still being read since the call before"
            return True, ("the files are read; a mission without mistakes follows when the pass is "
                          "over, and the log names every mistake")

        return {
            "start": lambda: hold("", "the mission goes on" if self._held else "the mission runs"),
            "pause": lambda: hold(self._held or PAUSED,
                                  "nothing new is begun once the robot has done what it does now"),
            "stop": stop, "reload": reload}

    def _running(self, plan: Mission) -> Running:
        """Return a plan in the runner's form."""
        context = plan.context(self._robot, self._topics, self._events, self._health)
        return Running(plan.tree, context, plan.file, plan.settings.mission_runs,
                       lambda: self._begin(plan))

    def _begin(self, plan: Mission) -> None:
        """Pass the plan that the runner runs from now on to the monitoring."""
        self._plan = plan
        IN_USE.services = asked_services(plan)
        self._robot.deadline = plan.settings.deadline
        self._console.is_verbose = plan.settings.verbose_mode
        self._outputs.show(plan.tree, self._health)
        robot = plan.settings.interface
        self._monitor.include(plan.offers)
        if self._clock.process is not self._clock:
            self._monitor.include([CLOCK])
        self._robot.prepare(plan.offers)
        # a stop requests the safe state even if the master hangs: the addresses of its services
        # must be known before
        self._monitor.include(robot.used({type(request) for request in robot.safe_state}, ()),
                              may_lack=True)

    def _reload_by_signal(self) -> None:
        if not self._reload():
            self._console.warn("SIGHUP ignored: the files are still being read since the one "
                               "before; if that does not end, a disk or the master hangs")

    def _reload(self) -> bool:
        """Reload the files on a separate thread: a disk or the master may hang. Return False if it
        still does so since the call before."""
        if self._reading is not None and self._reading.is_alive():
            return False
        try:
            self._reading = start_thread("reload", self._read_again)
        except RuntimeError as error:
            self._console.report_internal_error(error)
        return True

    def _read_again(self) -> None:
        """Read the files; a valid mission follows the running one after its pass."""
        tell, refused = self._console.tell, "refused, the running mission stays"
        try:
            following = read_plan(self._clock, self._wake, tell)
            for key in ("robotInterface", "robot"):
                chosen, now = (each.settings.values[key] for each in (following, self._plan))
                if chosen != now:
                    raise BehaviorControllerError(
                        f"{key} {chosen or 'empty'} cannot follow {now or 'empty'} while the node "
                        "runs; start the node again")
            services = asked_services(following)
            check_unused(services)
            IN_USE.services |= services
            self._following.append(following)
            self._wake.emit()  # if the node waits for the end of a persistent cause
            tell("info", "reloaded: this mission follows when the visitor's pass is over")
        except FaultsFound as error:
            report_faults(error, tell, refused)
        except BehaviorControllerError as error:
            tell("error", f"{refused}: {error}")
        # an internal error in reading a file must not end the running mission
        except BaseException as error:
            self._console.report_internal_error(error)

    def _successor(self) -> Optional[Running]:
        """Return the plan that was reloaded since the last pass, or None."""
        return self._running(self._following.pop()) if self._following else None

    def leave_safe(self, seconds: float = SAFE_STATE_LIMIT) -> None:
        """Ask the robot for the safe state, for ``seconds`` at most, and report what was reached.

        Nothing of the tick thread is used, which may have failed or be stuck: any thread may call
        it.
        """
        clock, wake, robot = Clock(), WakeUp(), self._plan.settings.interface
        gateway = RosGateway(robot, self._plan.settings.deadline, clock, wake.emit,
                             standby=self._robot.standby)

        def wait(seconds: float) -> None:
            wake.wait(seconds)
            wake.test_and_clear()
            clock.run_posted()

        self._events.emit(
            SafeState(gateway, robot, self._plan.offers, clock.now).wait(wait, seconds))

    def stop_without_tree(self) -> bool:
        """Request the safe state if the tick thread does not react to a stop, and report; return
        whether it does not.

        It is stuck in the code of a leaf then. On another thread.
        """
        if not self._blocked_tick.is_blocked(BLOCKED) or self.runner.is_stopping:
            return False
        leaf = self._blocked_tick.blocking()
        self._events.emit(Noticed("error", f"stopping without the tree: {leaf}"))
        self._robot.cut()  # no goal stays under way
        self.leave_safe(SAFE_STATE_BESIDE)
        return True
