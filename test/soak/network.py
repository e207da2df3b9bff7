"""Two machines on one computer: network namespaces with a link between them that can be slow, lossy
or cut."""
import contextlib
import json
import os
import signal
import subprocess
import sys

from wire import DEVICE, enter

HERE = os.path.dirname(os.path.abspath(__file__))
MACHINES = {"node": "10.231.0.1", "robot": "10.231.0.2"}
"""The address of each machine; they are known inside the namespaces alone."""

MASTER_PORT = 11311


class Unavailable(Exception):
    """Network namespaces cannot be made here; the text says why."""


class Network:
    """The machines of ``MACHINES`` and the wire between them, until ``close``."""

    def __init__(self, kind="tun"):
        """``kind`` as in ``wire.py``. Raises ``Unavailable``."""
        self._wire = None
        self._here = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        try:
            for machine in MACHINES:
                _ip("netns", "add", self._name(machine))
            self._wire = self._start_wire(kind)
            for machine, address in MACHINES.items():
                with self.inside(machine):
                    _ip("link", "set", "lo", "up")
                    _ip("address", "add", address + "/24", "dev", DEVICE)
                    _ip("link", "set", DEVICE, "up")
        except BaseException:
            self.close()
            raise

    @staticmethod
    def _name(machine):
        return "cssr_{}_{}".format(os.getpid(), machine)

    def _start_wire(self, kind):
        wire = subprocess.Popen(
            [sys.executable, "-S", os.path.join(HERE, "wire.py"), kind] +
            [self._name(machine) for machine in MACHINES], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, universal_newlines=True, bufsize=1)
        error = json.loads(wire.stdout.readline() or "{}").get("error", "")
        if error:
            _end(wire)
            raise Unavailable(error)
        return wire

    def set(self, **settings):
        """Change settings of the wire: delay, jitter, loss, cut. They hold when this returns."""
        self._wire.stdin.write(json.dumps(settings) + "\n")
        self._wire.stdout.readline()

    @contextlib.contextmanager
    def inside(self, machine):
        """Have this thread open and start everything on ``machine``."""
        with open("/run/netns/" + self._name(machine)) as file:
            enter(file.fileno())
        try:
            yield
        finally:
            enter(self._here)

    @staticmethod
    def environment(machine, master):
        """Return the environment of a ROS process on ``machine`` while the master is on the machine
        ``master``."""
        return {"ROS_HOSTNAME": MACHINES[machine],
                "ROS_MASTER_URI": "http://{}:{}".format(MACHINES[master], MASTER_PORT)}

    def close(self):
        """End every process on the machines, and remove them."""
        if self._wire is not None:
            _end(self._wire)
        for machine in MACHINES:
            name = self._name(machine)
            if os.path.exists("/run/netns/" + name):
                for pid in set(_ip("netns", "pids", name).split()) - {str(os.getpid())}:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(int(pid), signal.SIGKILL)
                _ip("netns", "delete", name)
        os.close(self._here)


def _end(wire):
    with contextlib.suppress(OSError):
        wire.stdin.close()
    wire.wait(10)
    wire.stdout.close()


def _ip(*words):
    """Run ``ip`` and return what it prints; raises ``Unavailable``."""
    try:
        return subprocess.run(("ip", ) + words, check=True, universal_newlines=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE).stdout
    except OSError as error:
        raise Unavailable(str(error))
    except subprocess.CalledProcessError as failed:
        raise Unavailable("ip {}: {}".format(" ".join(words), failed.stderr.strip() or failed))
