"""The frame of a thread, beside garbage and threads that end."""
import gc
import os
import subprocess
import sys
import threading
import traceback

import pytest

from behavior_controller.interpreter import frame_of, garbage_collection_paused

BESIDE_GARBAGE = """
import gc, threading, time, _thread, weakref
from behavior_controller.interpreter import frame_of

class Cycle:
    pass

def slow(_):
    for _ in range(100000):
        pass

def garbage():
    made = Cycle()
    made.own = made
    return weakref.ref(made, slow)

def pause():
    time.sleep(0.002)

def run():
    while True:
        pause()

def start_many():
    while True:
        _thread.start_new_thread(lambda: None, ())
        time.sleep(0.001)

for work in 60 * [run] + [start_many]:
    threading.Thread(target=work, daemon=True).start()
for _ in range(2000):
    gc.disable()
    left = garbage()  # so that it is collected in the call, not before
    gc.set_threshold(10, 1, 1)
    gc.enable()
    frame_of(threading.main_thread().ident)
    gc.set_threshold(700, 10, 10)
"""


def test_the_frame_is_the_one_that_the_thread_executes():
    here = sys._getframe()
    executed = frame_of(threading.get_ident())
    assert here in [frame for frame, _ in traceback.walk_stack(executed)]
    assert frame_of(None) is None and frame_of(1) is None


@pytest.mark.slow
def test_garbage_and_threads_that_end_do_not_stop_the_program():
    paths = dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))
    subprocess.run([sys.executable, "-c", BESIDE_GARBAGE], env=paths, check=True, timeout=30)


def test_the_collector_is_left_as_it_was():
    for switch in (gc.disable, gc.enable):
        switch()
        with garbage_collection_paused():
            assert not gc.isenabled()
        assert gc.isenabled() == (switch is gc.enable)
