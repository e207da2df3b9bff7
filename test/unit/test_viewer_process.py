"""Does the controller start its viewer again, and not too often?"""
import os
import threading
import time

from behavior_controller.viewer import process

PAUSE = 0.2


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
