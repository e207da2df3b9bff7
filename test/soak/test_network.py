"""The node and the robot on two machines: does the wire do as it is told, and does the mission
outlast a short cut?"""
import contextlib
import math
import os
import socket
import sys
import time

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import adversary  # noqa: E402
import trial  # noqa: E402
from network import MACHINES, Network, Unavailable  # noqa: E402

pytestmark = pytest.mark.long
PORT = 5000


@pytest.fixture(autouse=True)
def needs_namespaces():
    """Skip each test by name where there can be none."""
    try:
        Network().close()
    except Unavailable as reason:
        pytest.skip("network namespaces cannot be made here: {}".format(reason))


def arrivals(receiver):
    """Yield the time (monotonic) of each packet, until none has come for a second."""
    receiver.settimeout(1.0)
    try:
        while receiver.recv(10):
            yield time.monotonic()
    except socket.timeout:
        pass


def test_the_wire_delays_loses_and_cuts_as_it_is_told():
    with contextlib.closing(Network()) as network:
        with network.inside("robot"):
            receiver = socket.socket(type=socket.SOCK_DGRAM)
        with network.inside("node"):
            sender = socket.socket(type=socket.SOCK_DGRAM)
        receiver.bind((MACHINES["robot"], PORT))
        sender.connect((MACHINES["robot"], PORT))
        for settings, least, most, delay in (
            ({}, 100, 100, 0.0), ({"delay": 0.3, "loss": 0.5}, 25, 75, 0.3),
            ({"cut": True}, 0, 0, math.inf), ({"cut": False, "loss": 0.0}, 100, 100, 0.3)):
            network.set(**settings)
            sent = time.monotonic()
            for _ in range(100):
                sender.send(b"x")
            arrived = list(arrivals(receiver))
            assert least <= len(arrived) <= most, settings
            assert min(arrived, default=math.inf) - sent >= delay, settings
        receiver.close()
        sender.close()


@pytest.mark.parametrize("row", adversary.SHORT, ids=lambda row: row[0])
def test_a_cut(row):
    assert trial.run([row]) == []
