"""``tryRobot``: sends the robot one request, and says what it answers; refused while a mission uses
the robot."""
import contextlib
import math
import signal
import sys
import time
from typing import Any, Callable, Dict, FrozenSet, List, Optional, Sequence, Tuple, Union

import rospy

from behavior_controller import exit_codes
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.wakeup import WakeUp
from behavior_controller.config import knowledge_files, settings
from behavior_controller.errors import BehaviorControllerError, ConfigurationError, FaultsFound
from behavior_controller.leaves.attention import MODES
from behavior_controller.leaves.release_1_0 import GESTURES
from behavior_controller.robot.declarations import Service
from behavior_controller.robot.gateway import UNCERTAIN, UNSENT, Call, Cause, Failure
from behavior_controller.robot.requests import (
    MOTION, Answer, PerformGesture, Point, Request, Say, SetAttention, Words)
from behavior_controller.ros.configuration import chosen_robot, read_settings
from behavior_controller.ros.in_use import check_unused
from behavior_controller.ros.master import IN_USE, adopt, join, set_names
from behavior_controller.ros.names import words_of
from behavior_controller.ros.service_client import RosGateway
from behavior_controller.ros.timeouts import Late, run_apart
from behavior_controller.ros.types import resolved
from behavior_controller.ros_arguments import ASSIGNMENT, CommandParser
from behavior_controller.run.story import STOP_BUTTON
from behavior_controller.text import bracketed, clean, did_you_mean, joined

NAME = "tryRobot"

STEP_LIMIT = 15.0
"""Seconds that each step may take that asks the master."""

PARTING = 0.5
"""Seconds in which a goal that is given up is cancelled, before the process ends."""

EXIT_CODES = """0: the robot did it; 1: the master or the robot's node is missing or of another
type, or a mission uses the robot; 2: wrong arguments or configuration, or the robot does not offer
this; 3: the robot refused it, failed, or gave no answer in time"""

MODE_NAMES = tuple(dict.fromkeys(state for _, state, _, _ in MODES))
LOCATION = "location"
"""The mode of attention that has a target."""

CHOICES: Dict[str, Tuple[str, Sequence[str]]] = {
    "say": ("text", ()), "gesture": ("gesture", tuple(GESTURES)),
    "attention": ("mode of attention", MODE_NAMES)}
"""What to try: the word after it, and which are allowed, if not all."""

Result = Union[Answer, Failure]


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code, see ``EXIT_CODES``."""
    keys = {key.name for key in settings.KEYS}
    if arguments is None:
        arguments = sys.argv[1:]
    # a key is also understood as roslaunch gives it, without its underscore
    sys.argv[1:] = ["_" * (word.partition(ASSIGNMENT)[0] in keys) + word for word in arguments]
    given = settings.split_arguments(sys.argv)[0]
    kind, words = read_words(rospy.myargv(given)[1:])
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        ConfigurationError.raise_any(settings.unread(given[1:]))
        names = _apart(lambda: _set_names(given))
        chosen = _apart(read_settings)
        return _try(chosen, request_of(kind, words, chosen), names)
    except FaultsFound as error:
        return _tell(exit_codes.WRONG_INPUT, str(error))
    except Late:
        return _tell(exit_codes.UNAVAILABLE, f"the ROS master: no answer within {STEP_LIMIT:g} s")
    except BehaviorControllerError as error:
        return _tell(exit_codes.UNAVAILABLE, str(error))
    except KeyboardInterrupt:
        return _tell(exit_codes.UNAVAILABLE, "stopped; the robot was asked nothing")


# ------------------------------------------------------------------------------------ the arguments


def read_words(arguments: Sequence[str]) -> Tuple[str, List[str]]:
    """Return what to try, and the words for it. Ends with an error if they mean nothing."""
    parser = CommandParser(
        NAME, "Sends the robot one request, and says what it answers: say TEXT, gesture "
        f"{'|'.join(GESTURES)}, attention {'|'.join(MODE_NAMES)}. After {LOCATION}: X Y Z, metres "
        "in the map frame.", EXIT_CODES)
    parser.add_argument("kind", choices=tuple(CHOICES))
    parser.add_argument("words", nargs="+")
    chosen = parser.parse_args(arguments)
    wrong = _mistake(chosen.kind, chosen.words)
    if wrong:
        parser.error(wrong)
    return chosen.kind, chosen.words


def _mistake(kind: str, words: List[str]) -> str:
    """Return what is wrong with the words; empty: nothing."""
    word, *more = words
    what, allowed = CHOICES[kind]
    if kind == "say":
        if not "".join(words).strip():
            return "there is no text to say"
    elif kind == "attention" and word == LOCATION:
        if len(_numbers(more)) != 3:
            return f"{LOCATION} needs three numbers: X Y Z"
    elif word not in allowed:
        hint = did_you_mean(word, allowed)
        return f"no {what} {word!r}; allowed: {', '.join(allowed)}{bracketed(hint)}"
    elif more:
        return f"nothing follows {word}, not {more[0]!r}"
    return ""


def _numbers(words: List[str]) -> Tuple[float, ...]:
    """Return the words as numbers; none if one is not finite."""
    with contextlib.suppress(ValueError):
        numbers = tuple(map(float, words))
        if all(map(math.isfinite, numbers)):
            return numbers
    return ()


def request_of(kind: str, words: List[str], chosen: settings.Settings) -> Request:
    """Return the request that these words mean. Raises FaultsFound if the robot's language cannot
    be read."""
    if kind == "say":
        language, robot = chosen.language, chosen.interface
        if robot.has_knowledge_files:
            language = knowledge_files.load(chosen.scenario_specification, robot.takes_arm).language
        return Say(" ".join(words), language)
    if kind == "gesture":
        number = getattr(chosen, GESTURES[words[0]]["setting"])
        return PerformGesture("iconic", number, chosen.gesture_duration)
    if words[0] == LOCATION:
        return SetAttention(LOCATION, Point(*_numbers(words[1:])))
    return SetAttention(words[0])


# ------------------------------------------------------------------------------------------ the try


def _try(chosen: settings.Settings, request: Request, names: List[str]) -> int:
    """Ask the robot, unless another node uses it, and return the exit code."""
    robot = chosen.interface
    if type(request) in robot.never_asked or not robot.serves(type(request)):
        return _tell(exit_codes.WRONG_INPUT, f"the robot {robot.name} does not offer this")
    service = robot.service(type(request))
    services = frozenset(resolved(offer) for offer in robot.services)
    _apart(lambda: check_unused(services))
    _apart(lambda: _join(names, services))
    _tell(exit_codes.SUCCESS, f"asks the {service.kind} {resolved(service)}: {_doing(request)}; "
                              f"waits up to {chosen.deadline(service):g} s")
    clock, wake, began = Clock(), WakeUp(), time.monotonic()
    gateway = RosGateway(robot, chosen.deadline, clock, wake.emit,
                         tell=lambda text: print(f"{NAME}: {clean(text)}", flush=True))
    call = gateway.start(request)
    try:
        _await(call, clock, wake)
    except KeyboardInterrupt:
        call.finish(Failure(Cause.CONNECTION_LOST, "stopped by Ctrl-C", resolved(service)))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the robot was asked; the rest is short
    code = _report(request, service, call.result, time.monotonic() - began)
    gateway.close()
    if isinstance(call.result, Failure):
        time.sleep(PARTING)
    with contextlib.suppress(Late):
        run_apart(lambda: rospy.signal_shutdown("done"), WakeUp(), lambda: False, PARTING)
    return code


def _await(call: Call, clock: Clock, wake: WakeUp) -> None:
    while call.result is None:
        wake.wait(clock.time_left())
        wake.test_and_clear()
        clock.run_due()


def _report(request: Request, service: Service, result: Optional[Result], seconds: float) -> int:
    """Say what the robot answered, and how that leaves it; return the exit code."""
    code, outcome, is_open = exit_codes.SUCCESS, f"done, after {seconds:.1f} s", False
    if isinstance(result, Failure):
        code, outcome = exit_codes.FAILURE, f"{_cause(result)}: {result.message}"
        is_open = result.cause in UNCERTAIN
        if result.cause in UNSENT:
            code = exit_codes.UNAVAILABLE
    _tell(code, f"{resolved(service)}: {outcome}")
    if isinstance(request, SetAttention) and request.state != "disabled" and (
            code == exit_codes.SUCCESS or is_open):
        _tell(code, f"attention {'may stay' if is_open else 'stays'} on; switch it off with: "
                    f"rosrun cssr_system {NAME} attention disabled")
    elif is_open and request.effect:
        advice = f": {STOP_BUTTON}" * (request.effect == MOTION)
        _tell(code, f"the robot may still be {_doing(request)}{advice}")
    return code


def _doing(request: Request) -> str:
    words = request.words or Words("doing it")
    return joined(" ", words.doing, words.what)


def _cause(failure: Failure) -> str:
    if failure.cause in (Cause.NOT_ADVERTISED, Cause.NOT_REACHABLE):
        return "not there"
    if failure.cause is Cause.TYPE_MISMATCH:
        return "of another type"
    return failure.cause.text


# ---------------------------------------------------------------------------------------------- ROS


def _set_names(given: List[str]) -> List[str]:
    """Have rospy resolve names as for the chosen robot; return the words that make it do so."""
    adopt(NAME, given)
    words = words_of(chosen_robot(), given)
    set_names(NAME, words)
    return words


def _join(names: List[str], services: FrozenSet[str]) -> None:
    """Register this node, so that no controller starts meanwhile, unless one has."""
    IN_USE.services = services
    join(NAME, names)
    check_unused(services, is_registered=True)
    IN_USE.is_running = True


def _apart(step: Callable[[], Any]) -> Any:
    return run_apart(step, WakeUp(), lambda: False, STEP_LIMIT)


def _tell(code: int, text: str) -> int:
    """Print each line of a text, one that reports no success to standard error; return ``code``."""
    for line in text.split("\n"):
        print(f"{NAME}: {clean(line)}", file=sys.stderr if code else sys.stdout, flush=True)
    return code
