"""Onto which instant a step ends, and with what it moves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax.systems.oscillator import Oscillator


@pytest.mark.slow
def test_an_end_that_falls_on_a_break_moves_with_the_end():
    """After whole periods of a belt: it moved with the belt's frequency, and not with the end."""

    def end(frequency, duration):
        system = Oscillator(belt=wiperjax.WipingBelt(0.3, frequency))
        s = wiperjax.solve(system, duration, rtol=1e-10, max_events=0)
        return jnp.stack([s.final_time, *s.final_position, s.statistics.normal_force_integral])

    slopes, beside = jax.jit(jax.jacfwd(end, (0, 1))), 1e-6
    at, before = slopes(0.2, 5.0), slopes(0.2, 5.0 - beside)
    np.testing.assert_allclose(at, before, rtol=1e-4, atol=1e-5)
    assert [float(x[0]) for x in at] == [0.0, 1.0]
