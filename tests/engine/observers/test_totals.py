"""What a trajectory gathers: shares of time, mean and largest force."""

import jax
import numpy as np
import pytest
from systems import Block, times, trajectory

import wiperjax
from wiperjax import Regime, SteadyBelt, Wiper


@pytest.mark.slow
def test_what_a_stick_gathers_is_as_good_as_the_tolerance():
    """A lip that sticks is carried by the belt: x = x0 + V t, and its normal force follows. In its
    motion there is no error that could limit the steps; mean and largest force were off by 2e-7 and
    6e-7 here, whatever the tolerance."""
    length, speed, duration, angle = 6e-3, 0.3, 0.03, 0.0
    start = -0.75 * length
    blade = Wiper(
        attack_angle=angle,
        lip_length=length,
        belt=SteadyBelt(speed),
        normal_load=100.0,
        support_damping=10.0,
        mu_static=10.0,
        mu_minimum=10.0,
    )
    found = jax.jit(
        lambda: wiperjax.solve(
            blade,
            duration,
            initial_state=((start, 0.0), (speed, 0.0)),
            rtol=1e-10,
            max_events=0,
        )
    )().statistics
    node, weight = np.polynomial.legendre.leggauss(60)
    part = np.append(0.5 * (1 + node), np.linspace(0, 1, 10**5))
    sine = (start + speed * duration * part) / length
    lift = length * (np.sqrt(1 - sine**2) - np.cos(angle))
    force = 100.0 + 2000.0 * lift - 10.0 * speed * sine / np.sqrt(1 - sine**2)
    assert found.stick_time == pytest.approx(duration)
    mean = 0.5 * weight @ force[:60]
    np.testing.assert_allclose(found.normal_force_integral / duration, mean, rtol=2e-8)
    np.testing.assert_allclose(found.normal_force_max, force[60:].max(), rtol=2e-8)


def test_statistics_agree_with_the_log():
    s = trajectory(Block(0.4, 0.25, 1.0, 100.0, belt=0.05), 3.0, ((0.0,), (0.05,)))
    stick = 0.0
    before = 0.0
    now = Regime.STICK
    for t, after in zip(times(s), np.asarray(s.events.after), strict=False):
        stick += (t - before) * (now == Regime.STICK)
        before, now = t, Regime(int(after))
    stick += (3.0 - before) * (now == Regime.STICK)
    assert float(s.statistics.stick_time) == pytest.approx(stick, rel=1e-12)
    total = s.statistics.stick_time + s.statistics.slip_time + s.statistics.flight_time
    assert float(total) == pytest.approx(3.0, rel=1e-12)
