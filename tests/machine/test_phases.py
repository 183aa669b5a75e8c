"""Where the time goes: phases exclude each other, and none is booked where no account is open."""

import threading
import time

import pytest

from wiperjax.machine.phases import account, add, during


def test_an_inner_phase_does_not_count_for_the_outer_one():
    started = time.perf_counter()
    with account() as spent:
        with during("outer"):
            time.sleep(0.02)
            with during("inner"):
                time.sleep(0.04)
            time.sleep(0.02)
        time.sleep(0.02)
        found = spent.seconds()
    passed = time.perf_counter() - started
    assert found["inner"] >= 0.04 and found["outer"] >= 0.04
    assert sum(found.values()) <= passed - 0.02
    assert 0 <= spent.idle() <= time.perf_counter() - started


def test_a_phase_that_goes_on_and_one_that_fails_are_booked():
    with account() as spent, during("outer"):
        time.sleep(0.01)
        assert spent.seconds()["outer"] >= 0.01
        with pytest.raises(KeyError), during("inner"):
            time.sleep(0.01)
            raise KeyError
        before = spent.seconds()
        time.sleep(0.01)
        assert spent.seconds()["outer"] >= before["outer"] + 0.01
        assert spent.seconds()["inner"] == before["inner"] >= 0.01


def test_what_others_took_is_added_to_the_account_of_this_thread():
    add("engine", 3.0)  # of no account: no error
    with account() as outer:
        with account() as spent:
            add("engine", 3.0)
            add("engine", -1.0)
            thread = threading.Thread(target=add, args=("engine", 5.0))
            thread.start()
            thread.join()
        assert spent.seconds() == {"engine": 2.0} and outer.seconds() == {}


def test_time_of_waiting_is_of_no_phase_and_what_others_did_leaves_the_rest_idle():
    with account() as spent, during("storing"):
        with during(None):
            time.sleep(0.05)
        spent.take({"engine": 0.02, "naming": 0.01}, elsewhere=True)
        found, idle = spent.seconds(), spent.idle()
    assert found.pop("storing") < 0.04
    assert found == {"engine": 0.02, "naming": 0.01}
    assert 0.02 <= idle < 0.2  # of 0.05 s, and not what this process did not do
