#!/usr/bin/env python3
"""A wire between two network namespaces, in user space: it delays, loses and cuts what passes, as
it is told.

``wire.py tun|tap NAMESPACE NAMESPACE`` makes a device "wire" in each. tun carries packets: a cut is
silence. tap carries frames: a cut also ends ARP, so that the system itself says "no route to host"
after a while, as on a robot's Wi-Fi. Each line on stdin is a JSON object of settings: ``delay`` and
``jitter`` (seconds, each way), ``loss`` (share, each way), ``cut`` (true or false). Lines on
stdout: ``{"ready": true}`` at the start and when settings hold, or ``{"error": …}``. The wire ends
with its stdin.
"""
import collections
import ctypes
import fcntl
import json
import os
import random
import select
import struct
import sys
import time

DEVICE = "wire"
TUN, TAP, WITHOUT_PREFIX, SET_DEVICE = 0x0001, 0x0002, 0x1000, 0x400454CA  # linux/if_tun.h
NETWORK_NAMESPACE = 0x40000000  # linux/sched.h
LONGEST_PACKET = 65536


def enter(namespace_file):
    """Move the calling thread into a network namespace: what it opens and starts from now on is
    there."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.setns(namespace_file, NETWORK_NAMESPACE):
        raise OSError(ctypes.get_errno(), "cannot enter the network namespace")


def make_device(namespace, flag):
    """Return the file of a new device in ``namespace`` (name); it stays of use from any other."""
    with open("/run/netns/" + namespace) as file:
        enter(file.fileno())
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, SET_DEVICE, struct.pack("16sH22x", DEVICE.encode(), flag | WITHOUT_PREFIX))
    return device


class Direction:
    """What is under way from one end to the other. It arrives in the order in which it was sent."""

    def __init__(self, source, target):
        self.source, self.target = source, target
        self.under_way = collections.deque()  # (when due, packet)
        self._last_due = 0.0

    def take(self, settings):
        """Take what the system sends, and lose some of it."""
        now = time.monotonic()
        try:
            while True:
                packet = os.read(self.source, LONGEST_PACKET)
                if settings["cut"] or random.random() < settings["loss"]:
                    continue
                due = now + settings["delay"] + random.uniform(-1.0, 1.0) * settings["jitter"]
                self._last_due = max(self._last_due, due)
                self.under_way.append((self._last_due, packet))
        except OSError:
            pass  # no more for now, or the device is not up yet

    def deliver(self):
        """Hand over what is due."""
        while self.under_way and self.under_way[0][0] <= time.monotonic():
            try:
                os.write(self.target, self.under_way.popleft()[1])
            except OSError:
                pass  # the device is not up yet, or its queue is full: lost, as packets may be


def carry(ends):
    """Pass packets between the two devices until stdin ends."""
    settings = {"delay": 0.0, "jitter": 0.0, "loss": 0.0, "cut": False}
    directions = [Direction(*ends), Direction(*reversed(ends))]
    while True:
        dues = [direction.under_way[0][0] for direction in directions if direction.under_way]
        limit = max(0.0, min(dues) - time.monotonic()) if dues else None
        readable, _, _ = select.select(ends + [0], [], [], limit)
        for direction in directions:
            direction.take(settings)
            direction.deliver()
        if 0 in readable:
            order = sys.stdin.readline()  # the next one is written only after our answer
            if not order:
                return
            settings.update(json.loads(order))
            if settings["cut"]:
                for direction in directions:
                    direction.under_way.clear()
            tell(ready=True)


def tell(**event):
    """Write one line, at once."""
    print(json.dumps(event), flush=True)


def main():
    """Make the devices, say so, and carry."""
    try:
        ends = [make_device(namespace, TAP if sys.argv[1] == "tap" else TUN)
                for namespace in sys.argv[2:]]
    except OSError as error:
        tell(error=str(error))
        return 1
    tell(ready=True)
    try:
        carry(ends)
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
