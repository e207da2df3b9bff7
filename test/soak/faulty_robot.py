"""Conducts a robot whose services fail exactly as a script says, each in its own process, and a
visitor who plays along.

One thread takes what happens (requests, the controller's lines) in order and decides; so each fault
meets the call that it is meant for. What a call meets is decided before it is made: a server that
is to be out of reach goes away together with its answer to the call before.
"""
import io
import json
import os
import queue
import re
import struct
import subprocess
import sys
import threading
from collections import Counter

import rosgraph
import rospy

from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.ros.types import TYPES
from behavior_controller.simulation.faults import REFUSED

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "rostest")]
from commanded_robot import reply, visited, wrong_type  # noqa: E402
from robot import Robot  # noqa: E402
from tour_model import BEFORE_SENDING, FAULTS  # noqa: E402

SERVICES = {service.name: service for service in INTERFACE.services}

TOLD = re.compile(r"behaviorController: (\w+) \(.*\): (?:FAILURE, (/\S+), [\d.]+ s|(?:attempt \d+|"
                  r"its substitute) failed, (/\S+)), ([a-z ]+): ")
PASS = re.compile(r"behaviorController: pass \d+: (\w+) after")
VISITOR_HERTZ = 50


class Process:
    """One server process."""

    def __init__(self, service, kind, happened):
        self.service = service
        self.process = subprocess.Popen([
            sys.executable, "-S",
            os.path.join(HERE, "faulty_server.py"), kind._type, kind._md5sum
        ], stdin=subprocess.PIPE, stdout=subprocess.PIPE, universal_newlines=True, bufsize=1)
        self.port = None
        self.ready = threading.Event()
        threading.Thread(target=self._read, args=(happened,), daemon=True).start()

    def _read(self, happened):
        for line in self.process.stdout:
            event = json.loads(line)
            if "port" in event:
                self.port = event["port"]
                self.ready.set()
            else:
                happened(("server", self, event))

    def order(self, **order):
        """Send one line."""
        try:
            self.process.stdin.write(json.dumps(order) + "\n")
            self.process.stdin.flush()
        except OSError:
            pass  # it has died, as it was told to

    def kill(self):
        """End it as a crash does."""
        self.process.kill()
        self.process.wait()


class FaultyRobot:
    """Plays the script: for each service the attempts of ``tour_model``, in order."""

    def __init__(self):
        """Needs ``rospy.init_node``."""
        self.events = queue.Queue()
        self._world = visited(INTERFACE.name)
        self.current, self.standby, self.impostor, self.retired = {}, {}, {}, []
        for name, service in SERVICES.items():
            self.standby[name] = self._spawn(name)
            self.impostor[name] = Process(name, wrong_type(service, INTERFACE.services),
                                          self.events.put)
        for service in SERVICES:
            self._replace(service)
        self._visitor = Robot(dict.fromkeys(SERVICES, "absent"))
        for topic in INTERFACE.topics:
            self._visitor.publish(topic.name, hertz=VISITOR_HERTZ)

    def close(self):
        """End every process."""
        self._visitor.stop()
        for process in list(self.current.values()) + list(self.standby.values()) + list(
                self.impostor.values()) + self.retired:
            process.kill()
            process.process.stdin.close()
            process.process.stdout.close()

    def _spawn(self, service):
        return Process(service, TYPES[SERVICES[service]], self.events.put)

    # -------------------------------------------------------------------------------- registrations

    def _register(self, process):
        assert process.ready.wait(20), "a server did not start"
        rosgraph.Master(rospy.get_name()).registerService(
            process.service, "rosrpc://127.0.0.1:{}".format(process.port), rospy.get_node_uri())

    def _replace(self, service):
        """Start a new process; the old one may still hold a connection that must hang."""
        if service in self.current:
            self.retired.append(self.current[service])
        self.current[service] = self.standby[service]
        self._register(self.current[service])
        self.standby[service] = self._spawn(service)

    def _clear_away(self, service):
        for process in [process for process in self.retired if process.service == service]:
            process.kill()
            process.process.stdin.close()
            process.process.stdout.close()
            self.retired.remove(process)

    # ----------------------------------------------------------------------------------- the script

    def play(self, attempts, controller_lines, is_over, stop_at=None, on_stop=None):
        """Serve until ``is_over()``; return the problems found. ``attempts`` are in order of the
        mission.

        ``controller_lines`` is a ``robot.Lines``. At the attempt with index ``stop_at``
        ``on_stop()`` is called instead of an answer, and everything after it is answered at once.
        """
        self.problems, self.outcomes = [], []
        self.untold = Counter(
            (a.node, a.service, FAULTS[a.fault][1]) for a in attempts if a.fault and a.is_told)
        self.attempts = attempts
        self.index = {id(attempt): number for number, attempt in enumerate(attempts)}
        self.script = {
            service: [a for a in attempts if a.service == service] for service in SERVICES}
        self.position = dict.fromkeys(SERVICES, 0)
        self.unmet = [n for n, attempt in enumerate(attempts) if attempt.fault in BEFORE_SENDING]
        self.held, self.extra, self.stop_at, self.on_stop = [], [], stop_at, on_stop
        for service in SERVICES:  # what the previous run has left
            self._replace(service)
            self._clear_away(service)
        while not self.events.empty():
            self.events.get()
        feeder = threading.Thread(target=self._feed, args=(controller_lines,), daemon=True)
        feeder.start()
        while not self.problems:
            try:
                event = self.events.get(timeout=0.2)
            except queue.Empty:
                if is_over() and not feeder.is_alive():
                    break
                continue
            self._take(*event)
        return self.problems + ([] if self.problems else self._left_over())

    def _feed(self, lines):
        """Pass on each line of the controller."""
        seen = 0
        while True:
            fresh, ended = lines.wait_for_more(seen, 600)
            seen += len(fresh)
            for _, line in fresh:
                self.events.put(("line", line, None))
            if ended and len(lines.all) == seen:
                return

    def _take(self, kind, source, event):
        if kind == "line":
            self._take_line(source)
        elif "request" in event:
            self._take_request(source, event["id"], bytes.fromhex(event["request"]))
        elif "mismatch" in event:
            self._met(source.service, "")
            source.order(then="")

    def _take_line(self, line):
        if "Traceback" in line or "internal error" in line:
            self.problems.append(line)
        over = PASS.search(line)
        if over:
            self.outcomes.append(over.group(1))
        told = TOLD.search(line)
        if not told or told.group(1) == "HandleFallBack":
            return
        node, service, cause = told.group(1), told.group(2) or told.group(3), told.group(4)
        if service not in SERVICES:
            return  # a condition, answered by a topic
        self.untold[node, service, cause] -= 1
        if self.untold[node, service, cause] < 0:
            self.problems.append("told but not injected: " + line)
        attempt = self._next(service)
        if attempt is not None and attempt.fault in BEFORE_SENDING[:2] and cause == FAULTS[
                attempt.fault][1]:
            self._met(service, "dead")

    def _met(self, service, how):
        """Note that a request failed to arrive, as planned: by the log, or by a failed handshake.
        """
        self.unmet.remove(self.index[id(self._next(service))])
        self.position[service] += 1
        self._prepare(service, how)
        self._release()

    def _next(self, service):
        place = self.position[service]
        return self.script[service][place] if place < len(self.script[service]) else None

    def _take_request(self, process, number, request):
        attempt = self._next(process.service)
        if attempt is None or attempt.fault in BEFORE_SENDING:
            self.extra.append(process.service)
            if self.stop_at is None:
                self.problems.append("an unexpected request to {}; before it: {}".format(
                    process.service,
                    [(a.node, a.fault)
                     for a in self.script[process.service][max(0, self.position[process.service] -
                                                               3):self.position[process.service] +
                                                           1]]))
            process.order(id=number, send=self._response(process.service, "", request).hex(),
                          then="")
            return
        self.position[process.service] += 1
        if self.index[id(attempt)] == self.stop_at:
            self.script = dict.fromkeys(SERVICES, ())
            self.on_stop()
        elif self._is_early(attempt):
            self.held.append((process, number, request, attempt))
        else:
            self._answer(process, number, request, attempt)

    def _is_early(self, attempt):
        """Whether a fault that comes before ``attempt``, and not in parallel, is not in the log
        yet."""
        return any(number < self.index[id(attempt)] and
                   not (attempt.abreast and self.attempts[number].abreast == attempt.abreast)
                   for number in self.unmet)

    def _release(self):
        """Answer requests that waited until an earlier fault had happened."""
        ready = [held for held in self.held if not self._is_early(held[3])]
        self.held = [held for held in self.held if held not in ready]
        for held in ready:
            self._answer(*held)

    def _answer(self, process, number, request, attempt):
        """Give ``attempt`` the fault that the script has for it, and get ready for the next one to
        this service."""
        service = process.service
        if attempt.fault == "killed":
            self._replace(service)
            process.kill()
            self._prepare(service, "fresh")
        elif attempt.fault == "hang":
            self._prepare(service, "hung")
        else:
            process.order(id=number, send=self._response(service, attempt.fault, request).hex(),
                          then=self._prepare(service, "answer"))
            if process is not self.current[service] and process not in self.retired:
                self._clear_away(service)

    def _prepare(self, service, how):
        """Prepare the fault of the next attempt; return what the process does with its answer.

        ``how`` tells of the process that is registered: it is about to ``answer``, it is ``hung``,
        ``dead``, ``fresh``, or it is the impostor ("").
        """
        following = self._next(service)
        fault = following.fault if following is not None else ""
        if fault not in BEFORE_SENDING:
            if how in ("", "dead"):
                self._replace(service)
            return ""
        if how in ("", "hung"):
            self._replace(service)
        if how == "dead" and fault != "wrong md5":
            return ""  # it is what it should be
        order = {"zombie": "exit", "refused connection": "deafen", "wrong md5": "close"}[fault]
        if fault == "wrong md5":
            self._register(self.impostor[service])
        if how == "answer":
            return order
        if how != "dead":
            self.current[service].order(then=order)
        return ""

    def _response(self, service, fault, request):
        """Return the bytes of the answer to ``request`` (bytes)."""
        if fault == "exception":
            text = b"the server was told to fail"
            return b"\x00" + struct.pack("<I", len(text)) + text
        if fault == "malformed":
            return b"\x01" + struct.pack("<I", 3) + b"\x07\x07\x07"
        declared = SERVICES[service]
        asked = TYPES[declared]._request_class().deserialize(request)
        body = io.BytesIO()
        reply(declared, asked, REFUSED if fault == "refused" else None, self._world).serialize(body)
        return b"\x01" + struct.pack("<I", body.tell()) + body.getvalue()

    # ---------------------------------------------------------------------------------- the verdict

    def _left_over(self):
        """Return the expected requests that did not come."""
        problems = [
            "{} call(s) to {} did not come".format(len(script) - self.position[service], service)
            for service, script in self.script.items() if self.position[service] < len(script)]
        return problems + ["not told: {}".format(what) for what in self.untold.elements()]
