"""Ctrl-C between pieces of work."""

import signal

from wiperjax.machine.interrupt import heeded


def test_a_handler_of_somebody_elses_is_left_alone():
    """It may end the program in its own way: nothing is raised in its place."""
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    try:
        with heeded() as check:
            signal.raise_signal(signal.SIGINT)
            check()
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [1]
