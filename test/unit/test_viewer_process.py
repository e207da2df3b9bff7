"""Does the controller start its viewer again, and not too often, and does the viewer stay?"""
import os
import threading
import time
import urllib.request

import zmq

from behavior_controller.viewer import process

from free_ports import free_port

PAUSE = 0.2
PUSHES = 5
REQUESTS = 2000  # more than ZeroMQ and the sockets keep


def test_a_viewer_that_cannot_be_started_is_reported_once_for_each_attempt(monkeypatch):
    monkeypatch.setattr(process, "COMMAND", [os.path.join(os.path.dirname(__file__), "absent")])
    monkeypatch.setattr(process, "PAUSES", (PAUSE, 60.0))
    warnings, times, is_second = [], [], threading.Event()

    def warn(text):
        warnings.append(text)
        times.append(time.monotonic())
        if len(times) == 2:
            is_second.set()

    viewer = process.ViewerProcess([], print, lambda: None, warn, lambda: None)
    assert is_second.wait(10.0)
    viewer.close()
    assert times[1] - times[0] >= 0.9 * PAUSE
    assert all("cannot be started" in text and "absent" in text for text in warnings)


def test_clients_that_go_away_before_their_answers_do_not_end_the_viewer():
    port = free_port(3)
    warnings, is_served = [], threading.Event()
    viewer = process.ViewerProcess(["--port", str(port), "--groot2-port", str(port + 1)], print,
                                   lambda: None, warnings.append, is_served.set)
    try:
        assert is_served.wait(30.0), warnings
        with zmq.Context() as context, context.socket(zmq.DEALER) as leaving:
            leaving.setsockopt(zmq.LINGER, 0)
            leaving.connect(f"tcp://127.0.0.1:{port + 1}")
            for _ in range(REQUESTS):
                leaving.send_multipart([b"", *10 * [b"20 bytes of nonsense"]])
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/events", timeout=10.0) as staying:
            pushed = [line for line, _ in zip(staying, range(2 * PUSHES))]
        assert len(pushed) == 2 * PUSHES  # each is followed by an empty line
        assert warnings == []
    finally:
        viewer.close()
