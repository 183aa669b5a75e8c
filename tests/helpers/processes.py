"""Processes beside that of the tests."""

import os
import signal
import warnings
import weakref
from pathlib import Path

import wiperjax

FOLDERS = [str(Path(wiperjax.__file__).parents[1]), str(Path(__file__).parent)]


def environment():
    """Environment in which another interpreter finds this wiperjax, installed or not, and helpers
    of the tests."""
    found = os.environ.get("PYTHONPATH")
    return os.environ | {"PYTHONPATH": os.pathsep.join([*FOLDERS, *([found] if found else [])])}


def fork(work):
    """Process id of a child that does `work` and ends."""
    with warnings.catch_warnings():
        # Python 3.12: fork with threads; the child only sweeps
        warnings.simplefilter("ignore", DeprecationWarning)
        # the same from jax, which the child does not use
        warnings.simplefilter("ignore", RuntimeWarning)
        child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    return child


def drop_ctrl_c():
    """Presses Ctrl-C where Python ignores it: what the callback of a weak reference raises."""
    dropped = weakref.WeakSet()  # any object
    ended = weakref.ref(dropped, lambda _: signal.raise_signal(signal.SIGINT))
    del dropped
    assert ended() is None
