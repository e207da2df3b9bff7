"""What a hang-up means: to read the files again, or, once the terminal is gone, to stop."""
import fcntl
import os
import pty
import signal
import subprocess
import sys
import termios

import pytest

pytest.importorskip("rospy", reason="needs ROS")

NODE = """
import os
from behavior_controller.ros import signals

class Console:
    def tell(self, severity, text):
        print(text, flush=True)

    def drain(self, seconds):
        pass

signals.block_signals()
taken = signals.Signals(Console(), lambda: None, lambda: None)
if {reads}:
    taken.reload = lambda: print("read again", flush=True)
print("ready", flush=True)
print("stopped" if taken.stop_requested.wait(10) else "goes on", flush=True)
os._exit(0)
"""


def told(reads, has_terminal, numbers):
    """Return the lines of a node that gets these signals, and loses its terminal at last, if it has
    one."""
    operator, terminal = pty.openpty()

    def take_terminal():
        os.setsid()
        if has_terminal:
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    with subprocess.Popen([sys.executable, "-c", NODE.format(reads=reads)], stdin=terminal,
                          stdout=subprocess.PIPE, text=True, preexec_fn=take_terminal) as node:
        os.close(terminal)
        lines = [node.stdout.readline().strip()]
        for number in numbers:
            node.send_signal(number)
            lines.append(node.stdout.readline().strip())
        os.close(operator)
        return lines + node.stdout.read().splitlines()


@pytest.mark.slow
def test_a_hang_up_has_the_files_read_again_until_the_terminal_is_gone():
    hang_ups = [signal.SIGHUP, signal.SIGHUP]
    assert told(True, True, hang_ups) == ["ready", "read again", "read again", "stopped"]


@pytest.mark.slow
def test_a_node_without_a_terminal_reads_its_files_at_each_hang_up():
    numbers = [signal.SIGHUP, signal.SIGHUP, signal.SIGTERM]
    assert told(True, False, numbers) == ["ready", "read again", "read again", "stopped"]


@pytest.mark.slow
def test_a_hang_up_before_the_mission_has_begun_is_told_and_ignored():
    assert told(False, False, [signal.SIGHUP, signal.SIGINT]) == [
        "ready", "SIGHUP ignored: the mission has not begun", "stopped"]
