"""Samples as means over intervals, without the engine around them."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.engine.observers.base import Stretch
from wiperjax.engine.sampling import means
from wiperjax.engine.sampling.means import Signal, flush, take_means
from wiperjax.vocabulary.codes import Regime

HELD = (SimpleNamespace(lifted=False),)  # where a stretch ends: a contact that counts as what it is


@pytest.mark.slow
@pytest.mark.parametrize("window", np.linspace(0.01, 0.9, 8))
def test_a_step_of_few_digits_ends_when_the_clock_says(window, monkeypatch):
    """In the digits of a float32 step its end fell short of that of the last sample: 60 of 2048
    cells of a map, in a long stick at the end of their window, had none there, and no class."""
    monkeypatch.setattr(means, "outputs", lambda stretch: [jnp.float32(0.1)] * 5)
    signal = Signal(0.0, window / 512, 512, room=1024, ring=512)
    begin, none = jnp.float64(0.0), jnp.float64(0.0)
    stretch = Stretch(None, begin, jnp.float64(window), none, jnp.int32(0), (), (), (), ())
    ring, full = take_means(signal, signal.empty(jnp.float32(0.0)), stretch, True)
    assert not full
    assert abs(float(ring.until) - window) < 1e-12 * window
    np.testing.assert_allclose(np.sum(ring.samples.output), 0.1 * window, rtol=1e-5)


def recorded(monkeypatch, signal, parts):
    """Record of one lane that steps from start to end, with these node values, in this regime."""
    none = jnp.zeros(1)
    record, ring, case = signal.record(), signal.empty(none), jnp.zeros(1, jnp.int32)
    for start, end, values, regime in parts:
        monkeypatch.setattr(means, "outputs", lambda _, v=values: [jnp.full(1, x) for x in v])
        begin, length = jnp.full(1, start), jnp.full(1, end - start)
        stretch = Stretch(None, begin, length, none, jnp.full(1, regime), (), (), (), HELD)
        moves, full = True, True
        while full:
            ring, full = take_means(signal, ring, stretch, moves)
            record, ring = flush(signal, record, ring, case)
            moves = False
    return record


@pytest.mark.long
def test_every_instant_of_a_long_step_has_its_regime(monkeypatch):
    """Where a full ring was emptied within a step, the first instant after it had none: 7 of the 50
    of a raster."""
    signal = Signal(0.0, 0.1, 11, room=15, ring=4, regimes=True)
    even = [0.1] * 5
    record = recorded(monkeypatch, signal, ((0.0, 0.83, even, 2), (0.83, 1.1, even, 1)))
    np.testing.assert_array_equal(record.regime[:11], [2] * 9 + [1] * 2)
    np.testing.assert_allclose(record.output[:11], 0.1, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.35, 1e-9])
def test_a_sequence_of_impacts_before_a_step_keeps_the_output(step, monkeypatch):
    """It took its time, and the samples in it were read off the polynomial of the step behind: of
    a short one thousands of m/s."""
    signal = Signal(0.0, 0.1, 6, room=10, ring=4, inner=True, regimes=True)
    after = 0.7 - step
    parts = ((0.0, 0.15, [1.0] * 5, 2), (after, 0.7, [3.0, 4.0, 6.0, 5.0, 3.0], 1))
    record = recorded(monkeypatch, signal, parts)
    flown = int(after / 0.1)  # whole intervals up to the end of the sequence
    np.testing.assert_allclose(record.output[:flown], [1.0, 2.0, *[3.0] * 4][:flown], rtol=1e-6)
    np.testing.assert_allclose(record.inner[:flown], [0.0, 1.0, *[0.0] * 4][:flown], atol=1e-6)
    flight = int(Regime.FLIGHT)
    starts = [2, 2, *[flight if 0.1 * k < after - 1e-6 else 1 for k in range(2, 6)]]
    np.testing.assert_array_equal(record.regime[:6], starts)


@pytest.mark.slow
def test_samples_carry_no_derivative(monkeypatch):
    """Times of events have some, and so had the record of all cells: each flush went through all of
    it, and a small map with derivatives took twenty times as long."""
    monkeypatch.setattr(means, "outputs", lambda stretch: [jnp.full(1, 0.1)] * 5)
    signal = Signal(0.0, 0.1, 11, room=15, ring=4)

    def samples(start):
        length, none = jnp.full(1, 0.3), jnp.zeros(1)
        stretch = Stretch(None, start, length, none, jnp.full(1, 1), (), (), (), ())
        ring, full = take_means(signal, signal.empty(none), stretch, True)
        return flush(signal, signal.record(), ring, jnp.zeros(1, jnp.int32)), full

    tangents = jax.jvp(samples, (jnp.full(1, 0.01),), (jnp.ones(1),))[1]
    for tangent in jax.tree.leaves(tangents):
        assert tangent.dtype == jax.dtypes.float0 or not np.any(tangent)
