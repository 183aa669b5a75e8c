"""Compiling is booked apart, once, whatever threads it happens in."""

import threading
import time

import jax
import pytest

from wiperjax.machine.phases import account, during
from wiperjax.maps.cells import compiling

EVENT = f"{compiling.EVENT}test"


def test_what_began_before_counts_from_then_on():
    """A program that another thread began to compile during an earlier phase, and ends in this."""
    with account() as spent:
        with compiling.apart("engine"), during("engine"):
            time.sleep(0.05)
        with compiling.apart("naming"), during("naming"):
            time.sleep(0.02)
            jax.monitoring.record_event_duration_secs(EVENT, 10.0)
            time.sleep(0.02)
    seconds = spent.seconds()
    assert 0.02 <= seconds["compiling"] < 5
    assert seconds["naming"] >= 0.02 and seconds["engine"] >= 0.05
    assert sum(seconds.values()) < 5


def test_a_thread_without_an_account_takes_nothing_off_those_that_have_one():
    with account() as spent, compiling.apart("engine"), during("engine"):
        time.sleep(0.05)
        jax.monitoring.record_event_duration_secs(EVENT, 0.04)
        other = threading.Thread(target=_apart)
        other.start()
        other.join()
    assert spent.seconds()["compiling"] == pytest.approx(0.04, rel=0.1)


def _apart():
    with compiling.apart("engine"), during("engine"):
        pass
