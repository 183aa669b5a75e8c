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


def test_pieces_of_no_length_change_nothing():
    """The plateaus of a trapezoid with the longest ramps begin and end at once, to rounding. One
    that ended a digit before it began let time run backwards (4.5 ms once, with events on the way);
    in one of no length the event that the step before foresaw, a shoulder, was taken for there,
    and friction held the tip with three times what the cone allows."""

    @jax.jit
    def motion(ramp, phase, start):
        belt = wiperjax.TrapezoidBelt(0.5, 10.0, ramp, phase)
        blade = wiperjax.Wiper(belt=belt, attack_angle=0.1)
        return wiperjax.solve(blade, 0.2, start=start, max_events=300)

    for phase, start in ((np.pi / 2, 0.0), (-np.pi / 2, 0.0), (np.pi / 2, 0.7)):
        at, beside = motion(0.05, phase, start), motion(0.05 * (1 - 1e-12), phase, start)
        times = np.asarray(at.events.time)[: int(at.events.count)]
        assert np.all(np.diff(times) >= 0)
        same = ("stick_time", "slip_time", "stick_count", "slip_count", "stick_force_max")
        for name in same:
            found = (float(getattr(x.statistics, name)) for x in (at, beside))
            np.testing.assert_allclose(*found, rtol=1e-8, err_msg=f"{name}, {phase}, {start}")
        np.testing.assert_allclose(at.final_position[0], beside.final_position[0], rtol=1e-8)
