"""Blocks of this process: one moves while the one before it is named."""

import gc
import os
import signal
import sys
import threading
import time
import weakref
from contextvars import ContextVar

import numpy as np
import pytest
from stub_sweep import evaluate, make_spec

from wiperjax.machine import interrupt
from wiperjax.machine.phases import account, during
from wiperjax.maps import block, driver
from wiperjax.maps.computing import computing
from wiperjax.store.blocks import BlockStore

SPANS = {number: (50 * number, 50 * number + 50) for number in range(6)}


def test_blocks_come_in_order_and_move_one_at_a_time_beside_what_is_named(monkeypatch):
    moving, together, named = threading.Lock(), [], threading.Event()

    def one(spec, index, *look):
        assert moving.acquire(blocking=False)
        if index[0] == 50:  # the second does not end before the first is being named
            together.append(named.wait(20))
        moving.release()
        return evaluate(spec, index, *look)

    plain = block.naming

    def naming(spec, columns):
        named.set()
        return plain(spec, columns)

    monkeypatch.setattr(block, "naming", naming)
    blocks, _ = computing(make_spec(), one, None)
    found = list(blocks(make_spec(), SPANS))
    assert together == [True]
    assert [part.number for part in found] == list(SPANS)
    for part in found:
        alone, _ = block.evaluate_block(make_spec(), np.arange(*SPANS[part.number]), evaluate)
        assert part.columns.keys() == alone.keys()
        for name, values in alone.items():
            np.testing.assert_array_equal(part.columns[name], values, err_msg=name)


def test_a_block_brings_its_phases_without_the_waiting_for_its_turn():
    def slow_at_first(spec, index, *look):
        with during("engine"):
            time.sleep(1.0 if index[0] == 0 else 0.0)
        return evaluate(spec, index)

    with account() as spent:
        blocks, _ = computing(make_spec(), slow_at_first, None)
        found = list(blocks(make_spec(), SPANS))
        assert spent.seconds() == {}  # nobody's time twice
    assert found[0].phases["engine"] >= 1.0
    assert all(part.seconds == sum(part.phases.values()) for part in found)
    assert found[1].seconds < 1.0  # it has waited for as long, if it did not come first


def test_what_computes_cells_sees_the_context_of_its_caller():
    named = ContextVar("named", default="none")
    seen = []

    def looks(spec, index, *look):
        seen.append(named.get())
        return evaluate(spec, index, *look)

    named.set("mine")
    blocks, _ = computing(make_spec(), looks, None)
    list(blocks(make_spec(), SPANS))
    assert {*seen} == {"mine"}


def test_nothing_begins_behind_a_block_that_fails():
    begun = []

    def fails(spec, index, *look):
        begun.append(index[0])
        if index[0] == 50:
            raise MemoryError("no room")
        return evaluate(spec, index)

    blocks, _ = computing(make_spec(), fails, None)
    coming = blocks(make_spec(), SPANS)
    assert next(coming).number == 0
    time.sleep(0.3)  # the first is stored, while the second fails
    with pytest.raises(MemoryError, match="no room"):
        next(coming)
    assert begun == [0, 50] and threading.active_count() < 50
    time.sleep(0.1)
    assert begun == [0, 50]


def test_a_block_before_one_that_fails_is_finished():
    failed = threading.Event()

    def fails(spec, index, finer=1, room=None):
        if index[0] == 100:
            failed.set()
            raise MemoryError("no room")
        if index[0] >= 50 and finer > 1:
            assert failed.wait(20)
        return evaluate(spec, index, finer)

    spec = make_spec(samples=64)  # which do not tell the frequency
    blocks, _ = computing(spec, fails, None)
    coming = blocks(spec, SPANS)
    assert [next(coming).number, next(coming).number] == [0, 1]
    with pytest.raises(MemoryError, match="no room"):
        next(coming)


def test_nothing_of_a_block_that_fails_is_kept():
    class Samples:
        """Of a block: much."""

    left = []

    def fails(spec, index, *look):
        samples = Samples()
        left.append(weakref.ref(samples))
        raise MemoryError("no room")

    blocks, _ = computing(make_spec(), fails, None)
    gc.disable()  # which may be long in coming
    try:
        with pytest.raises(MemoryError):
            next(blocks(make_spec(), SPANS))
        assert left and [held() for held in left] == [None] * len(left)
    finally:
        gc.enable()


@pytest.mark.parametrize("file", [True, False])
def test_a_second_ctrl_c_while_blocks_end_is_not_dropped_with_a_traceback(
    monkeypatch, tmp_path, file
):
    moving, pressed, ended = (threading.Event() for _ in range(3))
    dropped = []
    where, name = (BlockStore, "write") if file else (driver.Report, "update")
    plain = getattr(where, name)

    def press(self, *given):  # outside of what computes blocks
        plain(self, *given)
        assert moving.wait(20)
        pressed.set()
        signal.raise_signal(signal.SIGINT)

    def again(spec, index, *look):
        if index[0] == 50:
            moving.set()
            pressed.wait(20)
            time.sleep(0.2)
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)
            ended.set()
        return evaluate(spec, index, *look)

    monkeypatch.setattr(where, name, press)
    monkeypatch.setattr(sys, "unraisablehook", dropped.append)
    monkeypatch.setattr(interrupt._Heeding, "dropped", lambda _, told: dropped.append(told))
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            output = tmp_path / "map.h5" if file else None
            driver.sweep(make_spec(), output, evaluate=again, block=50, progress=False)
        assert ended.wait(20)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert dropped == []


def test_few_cells_on_an_accelerator_are_told_of(monkeypatch, caplog):
    class Told(Exception):
        """Instead of a sweep."""

    def stop(*_):
        raise Told

    monkeypatch.setattr(driver, "accelerated", lambda: True)
    monkeypatch.setattr(driver, "account", stop)
    with pytest.raises(Told):
        driver.sweep(make_spec(), progress=False)
    assert caplog.messages == [
        "385 cells leave most of an accelerator idle: with JAX_PLATFORMS=cpu the processor's cores "
        "may be faster"
    ]
