"""Ports for servers of a test that start only later."""
import contextlib
import random
import socket


def free_port(count=1):
    """Return the first of ``count`` adjacent ports that are free.

    They are below those that Linux gives to connections and to ROS nodes. From there, another node
    could have the port before the server starts, and callers that come back after its end would
    hold that node: rospy waits without limit for what a caller wants.
    """
    while True:
        port = random.randrange(10000, 32000)
        with contextlib.suppress(OSError), contextlib.ExitStack() as held:
            for number in range(count):
                held.enter_context(socket.socket()).bind(("127.0.0.1", port + number))
            return port
