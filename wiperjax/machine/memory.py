"""This process's memory: the most that it has held, and how often garbage is sought in it."""

import atexit
import gc
import sys
from pathlib import Path


def peak_memory() -> int:
    """Return the largest resident memory of this process so far [bytes].

    From /proc where there is one: the peak that `resource` gives there begins with that of the
    process which started this one.
    """
    if sys.platform == "win32":
        import psutil

        return psutil.Process().memory_info().peak_wset
    import resource

    try:
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    except (OSError, StopIteration):
        unit = 1 if sys.platform == "darwin" else 1024  # of the system's own number
        return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def installed() -> int:
    """Return the memory of this machine [bytes]."""
    import psutil

    return psutil.virtual_memory().total


def seek_garbage_less() -> None:
    """Sets how often Python looks for garbage: seldom, as suits a process that traces programs, and
    not once more when it ends.

    Imports and tracing leave what is in use: looking for garbage there was a seventh of it, and
    with the end a seventh of a small sweep whose programs are kept.
    """
    gc.set_threshold(200_000, 50, 100)
    atexit.register(gc.freeze)
