"""Blocks: how many cells, and the analysis of their samples within the memory."""

import numpy as np
import pytest
from stub_sweep import evaluate, make_spec

from wiperjax.maps import block
from wiperjax.maps.block import block_size, evaluate_block
from wiperjax.specs.load import parse_sweep


def test_blocks_shrink_as_cells_grow():
    """Memory is that of a block: of few cells where each has much to keep."""
    many = {"angles": 50, "loads": 10, "speeds": 100}
    for room in (2000, 5000, 20_000):
        size = block_size(make_spec(**many, event_log=room))
        assert size * room * 19 <= 2**27 < 2 * size * room * 20
    # few enough to leave lanes idle, but no block outgrows the memory
    assert block_size(make_spec(**many, event_log=65_536)) * 65_536 * 19 <= 2**27
    assert block_size(make_spec(**many, samples=2**20)) * 4 * 2**20 <= 2**27


@pytest.mark.long
@pytest.mark.parametrize("belt", ["steady", "wiping"])
def test_samples_are_analysed_in_parts(belt, monkeypatch):
    """Filters and spectra hold many times the memory of the samples; what they find in a cell does
    not depend on which are looked at together."""
    kind = {"kind": belt} | ({"frequency": 20.0} if belt == "wiping" else {})
    spec = parse_sweep(
        {
            "axes": {
                "attack_angle": {"start": -40, "stop": 40, "num": 10},
                "normal_load": {"start": 5, "stop": 30, "num": 5},
            },
            "belt": kind,
            "run": {"transient": 0.2, "window": 0.2, "samples": 4096},
            "classes": {"reversal_window": 0.005},
        }
    )

    def reversing(spec, index, finer=1, room=None):
        count = finer * 4096
        time_ = 0.2 / count * (0.5 + np.arange(count))
        halves = 40 * time_
        columns = evaluate(spec, index, finer) | {
            "since_reversal": (halves - np.round(halves)) / 40, "wiping_frequency": 20.0,
        }  # fmt: skip
        columns["signal"] = columns["signal"] * np.sin(2 * np.pi * 20 * time_)
        return columns | {"signal_inner": 1e-3 * np.square(columns["signal"])}

    engine = evaluate if belt == "steady" else reversing
    found, sizes, analyse = [], [], block.signal_columns

    def watched(signal, *given, **named):
        sizes.append(signal.size)
        return analyse(signal, *given, **named)

    monkeypatch.setattr(block, "signal_columns", watched)
    for samples, cores in ((2**30, 1), (2**16, 1), (2**16, 3)):
        monkeypatch.setattr(block, "ANALYSED", samples)
        monkeypatch.setattr(block.jax_settings, "cores", lambda cores=cores: cores)
        found.append(evaluate_block(spec, np.arange(50), engine)[0])
    assert sizes[0] == 50 * 4096 and sizes[-1] <= 2**16
    whole_, *others = found
    for parts in others:
        assert whole_.keys() == parts.keys() and "dominant_frequency" in parts
        assert ("tone_time_after" in parts) == (belt == "wiping")
        for name, values in whole_.items():
            np.testing.assert_array_equal(parts[name], values)


def test_a_closer_look_keeps_to_the_memory_too(monkeypatch):
    looks = []

    def watched(spec, index, finer=1, room=None):
        looks.append(finer)
        return evaluate(spec, index, finer)

    monkeypatch.setattr(block, "untold", lambda columns, limits: np.ones(2, bool))
    for samples, most in ((2**10, [1, 2, 2, 16, 16]), (2**18, [1, 2, 2]), (2**20, [1])):
        looks.clear()
        evaluate_block(make_spec(samples=samples), np.arange(2), watched)
        assert looks == most


def test_a_closer_look_needs_no_more_than_samples(monkeypatch):
    """The motion is the same: what it is called rests on the columns of the first look."""
    monkeypatch.setattr(block, "untold", lambda columns, limits: np.array([False, True]))
    spec = make_spec(samples=2**10)

    def samples_only(spec, index, finer=1, room=None):
        found = evaluate(spec, index, finer)
        return found if finer == 1 else {"signal": found["signal"]}

    whole_, _ = evaluate_block(spec, np.arange(20, 22), evaluate)
    lean, _ = evaluate_block(spec, np.arange(20, 22), samples_only)
    assert whole_.keys() == lean.keys()
    for name, values in whole_.items():
        np.testing.assert_array_equal(lean[name], values)


def test_blocks_hold_some_time_of_motion_and_are_alike(monkeypatch):
    """What a kill can cost is bounded, lanes idle at the end of a block are few, and no short
    block is compiled once more."""
    monkeypatch.setattr(block, "accelerated", lambda: False)
    for angles, window, blocks in ((50, 0.2, 3), (50, 2.0, 14), (2000, 0.2, 98), (2000, 0.01, 62)):
        spec = make_spec(angles=angles, loads=10, speeds=100, window=window)
        size = block_size(spec)
        assert size * (0.2 + window) <= 2**13
        assert size <= 2**15
        assert -(-spec.size // size) == blocks
        assert blocks * size - spec.size < blocks
    assert block_size(make_spec(angles=50, loads=10, speeds=100), workers=4) == 3125
    assert block_size(make_spec(angles=50, loads=10, speeds=100), workers=100) == 1021
