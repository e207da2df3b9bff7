"""The main program: checks everything, then runs the mission until it is over or somebody stops it.

Nothing moves before the configuration, the mission and the robot's nodes have been found right. Whatever is wrong is
told in full, in lines for an operator, and the exit code says of which kind it was.
"""
import os
import signal
import sys
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Set

import rosgraph
import rospy

from behavior_controller import folders, leaves
from behavior_controller.bt.builtins import builtin_specs
from behavior_controller.bt.compiler import load_mission
from behavior_controller.bt.registry import Registry, did_you_mean
from behavior_controller.bt.tree import Tree
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, NodesMissing
from behavior_controller.events import Events
from behavior_controller.leaves.base import MissionContext
from behavior_controller.leaves.recovery import SAFE_STATE
from behavior_controller.phrases import Phrases
from behavior_controller.phrases import load as load_phrases
from behavior_controller.policy import Policy
from behavior_controller.policy import load as load_policy
from behavior_controller.record import Record
from behavior_controller.ros.connection import Trouble, ask_master
from behavior_controller.ros.console import Console, flush_every_line, report_internal_error
from behavior_controller.ros.probe import StartUpCheck
from behavior_controller.ros.services import RosGateway
from behavior_controller.ros.topics import RosTopics
from behavior_controller.runner import Runner
from behavior_controller.settings import Settings
from behavior_controller.settings import load as load_settings

NAME = "behaviorController"
CONFIGURATION = "behaviorControllerConfiguration.ini"
POLICY = "recoveryPolicy.ini"
SUCCESS, NODES_MISSING, BAD_FILES, FAILED = 0, 1, 2, 3

STOP_LIMIT = 1.8
"""Seconds after the first signal at which the process ends, whatever it is doing (the limit is 2 s)."""

NOT_STOPPED = "did not stop in time: ending now; make sure that the robot has stopped too"

USAGE = """usage: rosrun cssr_system behaviorController [_key:=value ...] [name:=other_name ...]

Runs the robot mission that config/behaviorControllerConfiguration.ini names, visitor after visitor, until it is stopped
(Ctrl-C). A key of that file given as _key:=value overrides the file. ROS names are remapped with name:=other_name.

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
    stop = Stop(console)
    stop.listen()
    try:
        return _run(argv, console, stop)
    except FaultsFound as found:
        _tell_faults(found, console)
        return BAD_FILES
    except NodesMissing as missing:
        console.tell("error", str(missing))
        return NODES_MISSING
    except Exception as error:  # the last resort: an operator never sees a traceback
        report_internal_error(console, error)
        return FAILED
    finally:
        _part_from_ros()
        stop.is_over = True


def _tell_faults(found: FaultsFound, console: Console) -> None:
    """Write a line for each fault, and the sum."""
    for fault in found.faults:
        console.tell("warning" if fault.is_warning else "error", str(fault))
    count = sum(not fault.is_warning for fault in found.faults)
    console.tell("error", "nothing was started: {} mistake{}, see above".format(count, "" if count == 1 else "s"))


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


# ---------------------------------------------------------------------------------------------------------------- stop


class Stop:
    """That somebody wants the node to stop: who is woken by it, and the end if waking does not help.

    The signals are blocked and taken by a thread that does nothing else. A Python signal handler would not do: it runs
    on the main thread, and not before that thread wakes if the signal comes in the moment before it falls asleep.
    """

    def __init__(self, console: Console):
        self.requested = False
        self.is_over = False
        self._console = console
        self._wakes: List[Callable[[], None]] = []
        self._lock = threading.Lock()

    def listen(self) -> None:
        """Take the signals that stop us, but no hang-up under ``nohup``. To be called before any thread is started."""
        signals = {signal.SIGINT, signal.SIGTERM}
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signals.add(signal.SIGHUP)
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        threading.Thread(target=self._take, args=(signals,), name="stop", daemon=True).start()

    def wake(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called, on another thread, when somebody wants us to stop; at once if he does already."""
        with self._lock:
            self._wakes.append(callback)
            is_late = self.requested
        if is_late:
            callback()

    @staticmethod
    def request() -> None:
        """Ask to stop, as a signal from outside does."""
        os.kill(os.getpid(), signal.SIGTERM)

    def _take(self, signals: Set[signal.Signals]) -> None:
        """Pass the first signal on, and end the process if it has not ended ``STOP_LIMIT`` seconds later."""
        signal.sigwait(signals)
        with self._lock:
            self.requested = True
            wakes = list(self._wakes)
        for wake in wakes:
            wake()
        time.sleep(STOP_LIMIT)
        if not self.is_over:
            # the terminal may be what hangs: the line is tried on a thread of its own
            threading.Thread(target=self._console.tell, args=("error", NOT_STOPPED), daemon=True).start()
            time.sleep(0.1)
            os._exit(FAILED)


# ----------------------------------------------------------------------------------------------------------------- ROS


def _join_ros(argv: List[str]) -> None:
    """Become a ROS node, or say in one line why that is not possible; rospy alone would wait for ever for a master."""
    try:
        ask_master("getPid")
    except Trouble:
        raise NodesMissing("no ROS master at {}: start roscore or the robot, or set ROS_MASTER_URI".format(
            rosgraph.get_master_uri()))
    try:
        rospy.init_node(NAME, argv=argv, disable_signals=True)
    except (rospy.ROSException, ValueError) as error:
        raise ConfigurationError([Fault("command line", 0, 0, str(error))])


def _part_from_ros() -> None:
    """Have the master forget us, unless it hangs. rospy then waits for threads of its own, which we need not do."""
    is_forgotten = threading.Event()
    rospy.core.add_shutdown_hook(lambda reason: is_forgotten.set())
    threading.Thread(target=rospy.signal_shutdown, args=("the node ends",), daemon=True).start()
    is_forgotten.wait(0.4)


def _private_parameters() -> Dict[str, Any]:
    """Return the parameters below our own name; they override the configuration file."""
    values = rospy.get_param(rospy.get_name(), {})
    return values if isinstance(values, dict) else {}


# ------------------------------------------------------------------------------------------------------------- the run


class Plan(NamedTuple):
    """All that was read from files, and found right."""

    settings: Settings
    mission: str
    phrases: Phrases
    policy: Policy
    tree: Tree


def _run(argv: List[str], console: Console, stop: Stop) -> int:
    """Do everything in order, and return the exit code. Raises FaultsFound or NodesMissing, before anything moves."""
    _join_ros(argv)
    console.attach()
    rospy.on_shutdown(stop.request)  # ``rosnode kill``, or another node took our name
    plan = _read_plan(console)
    wake = plan.tree.wake
    stop.wake(wake.emit)
    topics = RosTopics(wake.emit, lambda text: console.tell("warning", text))
    check = StartUpCheck(plan.settings.asr_enabled, plan.settings.startup_timeout, console.tell)
    if check.run(wake, lambda: stop.requested):
        return _carry_out(plan, topics, console, stop)
    console.tell("info", "stopped before the mission began")
    return NODES_MISSING


def _read_plan(console: Console) -> Plan:
    """Read configuration, phrases, recovery policy and mission; raises FaultsFound with all that is wrong."""
    overrides = _private_parameters()
    settings = load_settings(folders.config(CONFIGURATION), overrides)
    console.is_verbose = settings.verbose_mode
    if overrides.keys() & settings.values.keys():
        console.tell("info", "parameters of the node override the configuration: {}".format(", ".join(
            "{} {}".format(key, overrides[key]) for key in settings.values if key in overrides)))
    mission = _find_mission(settings.scenario_specification)
    faults: List[Fault] = []

    def attempt(load: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return load(*arguments)
        except FaultsFound as found:
            faults.extend(found.faults)
            return None

    plan = Plan(settings, mission, attempt(load_phrases, settings.language),
                attempt(load_policy, folders.config(POLICY), [spec.id for spec in leaves.SPECS]),
                attempt(load_mission, mission, Registry(builtin_specs() + list(leaves.SPECS))))
    if faults:
        raise FaultsFound(faults)
    _announce(plan, console)
    return plan


def _find_mission(name: str) -> str:
    """Return the path of the mission file; raises ConfigurationError, which names those that there are."""
    path = folders.mission(name)
    if os.path.isfile(path):
        return path
    known = sorted(file[:-4] for file in os.listdir(folders.data("")) if file.endswith(".xml"))
    raise ConfigurationError([Fault("scenarioSpecification", 0, 0, "there is no mission {}".format(path),
                                    did_you_mean(name, known) or "there are: {}".format(", ".join(known)))])


def _announce(plan: Plan, console: Console) -> None:
    """Tell what is going to run, and what is odd about it."""
    chosen = plan.settings
    console.tell("info", "mission {}: {} nodes; language {}; speech recognition {}; verbose mode {}".format(
        plan.mission, len(plan.tree.nodes), chosen.language, *("on" if switch else "off" for switch in (
            chosen.asr_enabled, chosen.verbose_mode))))
    for warning in plan.tree.warnings:
        console.tell("warning", str(warning))


def _carry_out(plan: Plan, topics: RosTopics, console: Console, stop: Stop) -> int:
    """Run the mission and return the exit code."""
    tree, events = plan.tree, Events()
    events.subscribe(console)
    if plan.settings.record_directory:
        events.subscribe(Record(plan.settings.record_directory, lambda text: console.tell("warning", text)))
    gateway = RosGateway(plan.settings.deadline, tree.clock, tree.wake.emit)
    context = MissionContext(gateway, topics, plan.settings, plan.phrases, plan.policy, tree.clock, events)
    runner = Runner(tree, context, plan.mission, plan.settings.mission_runs, lambda: stop.requested)
    console.start_heartbeat(tree.clock)
    try:
        return runner.run()
    except Exception as error:  # a mistake of ours must not leave the robot as it happens to be
        report_internal_error(console, error)
        _calm(gateway, tree)
        return FAILED


def _calm(gateway: RosGateway, tree: Tree) -> None:
    """Give up every call and ask for the safe state, for a second at the most."""
    gateway.close()
    calls = [gateway.start(request) for request in SAFE_STATE]
    ends = time.monotonic() + 1.0
    while any(call.result is None for call in calls) and time.monotonic() < ends:
        tree.wake.wait(max(0.0, ends - time.monotonic()))
        tree.wake.test_and_clear()
