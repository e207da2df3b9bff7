"""The thread that carries requests to one service, action or topic of the robot."""
import contextlib
import queue
import threading
from typing import Callable, NamedTuple, Optional, Union

import rosgraph
import rospy

from behavior_controller.command import no_resources
from behavior_controller.foreign_code import described
from behavior_controller.robot.declarations import Service, Unsendable
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, Request
from behavior_controller.ros.shortage import SHORTAGE, is_shortage
from behavior_controller.ros.tcpros import Trouble
from behavior_controller.ros.timeouts import start_thread
from behavior_controller.ros.types import resolved

Done = Callable[[Union[Answer, Failure]], None]


class Job(NamedTuple):
    """A request under way. ``done`` gets the result, ``feedback`` what is reported meanwhile, in
    words; ``cut`` is set when neither is awaited any more."""

    request: Request
    done: Done
    feedback: Callable[[str], None]
    cut: threading.Event


class RequestThread:
    """A daemon thread that carries one request at a time."""

    IDLE: Optional[float] = None
    """Seconds between two calls of ``idle`` while there is no request; None: it is not called."""

    def __init__(self, service: Service):
        self.service, self.name = service, resolved(service)
        self._jobs: "queue.SimpleQueue[Optional[Job]]" = queue.SimpleQueue()
        self._cut = threading.Event()  # of the newest request
        self.is_asked = False
        """Whether the request under way may have reached the server."""
        self.is_short = False
        """Whether the last request failed for a shortage of this computer."""

    def start(self, role: str = "") -> None:
        """Start the thread, whose name begins with its ``role``. Raises RuntimeError if no thread
        is left."""
        start_thread(f"{role}{self.service.kind} {self.name}", self._work)

    def carry(self, request: Request, done: Done, feedback: Callable[[str], None]) -> None:
        """Send ``request``; ``done`` and ``feedback`` are called on another thread."""
        self.is_asked = False
        if self._cut.is_set():  # as the request before is over, it may be used again
            self._cut = threading.Event()
        self._jobs.put(Job(request, done, feedback, self._cut))

    def cut(self) -> bool:
        """Abort the request under way; return whether this thread can carry another. Any thread may
        call it."""
        self._cut.set()
        return True

    def end(self) -> None:
        """Let the thread end after the request under way."""
        self._jobs.put(None)

    def exchange(self, job: Job) -> Union[Answer, Failure]:
        """Carry out a request, and return the result. May raise ``Trouble``."""
        raise NotImplementedError

    def idle(self) -> None:
        """Prepare for the next request. May raise."""

    def close(self) -> None:
        """Free what the thread holds, at its end."""

    def _work(self) -> None:
        while True:
            try:
                job = self._jobs.get(timeout=self.IDLE)
            except queue.Empty:
                with contextlib.suppress(Exception):  # the request that meets it reports it
                    self.idle()
                continue
            if job is None:
                self.close()
                return
            job.done(self._carried_out(job))

    def _carried_out(self, job: Job) -> Union[Answer, Failure]:
        """Return the answer, or why there is none. An optional service that no node offers counts
        as done."""
        self.is_short = False
        try:
            return self.exchange(job)
        except Trouble as trouble:
            self.is_short = trouble.shortage is not None
            may_lack = self.service.is_optional and not self.service.fails_without
            if trouble.cause is Cause.NOT_ADVERTISED and may_lack:
                return Answer()
            return Failure(trouble.cause, str(trouble), self.name)
        except Unsendable as error:
            return Failure(Cause.TYPE_MISMATCH, str(error), self.name)
        except (rospy.ROSException, rosgraph.MasterException, OSError) as error:
            self.is_short = is_shortage(error)
            return Failure(Cause.NOT_REACHABLE, f"it cannot be connected to: {error}", self.name)
        except BaseException as error:  # the declaration of another package may raise anything
            self.is_short = is_shortage(error)
            if self.is_short:
                SHORTAGE.note(error)
                return Failure(Cause.NOT_REACHABLE, no_resources(error), self.name)
            return Failure(Cause.UNUSABLE_ANSWER, f"its declaration: {described(error)}", self.name)
