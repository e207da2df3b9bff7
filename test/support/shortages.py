"""Help for the tests: what the computer gives no more."""
import contextlib
import gc
import os
import resource

import pytest


@contextlib.contextmanager
def no_files_left():
    """Take all files that this process may have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = []
    gc.collect()  # or it gives some back meanwhile
    resource.setrlimit(resource.RLIMIT_NOFILE, (
        max(map(int, os.listdir("/proc/self/fd"))) + 10, hard))
    try:
        with pytest.raises(OSError):
            while True:
                taken.append(os.dup(0))
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for each in taken:
            os.close(each)
