"""A compliant contact that opens: what rides on a belt and hops, with nothing to drive it along."""

import math

import jax
import numpy as np
import pytest

import wiperjax
from wiperjax import Coulomb, Result, SteadyBelt
from wiperjax.systems.flutter import ModeCoupling
from wiperjax.vocabulary.codes import Regime

LENGTH = 40.0


def hopper(speed, mu=1.0):
    """y'' = 1 - y in the air, below y = -3/4; in the belt its spring is there, too. No force on x
    but friction: what turns y by 90 degrees leaves it 6e-17 of rounding."""
    upright = {"stiffness_1": 0.0, "stiffness_2": 1.0, "angle_1": 0.0, "angle_2": math.pi / 2}
    return ModeCoupling(**upright, belt=SteadyBelt(speed), friction=Coulomb(mu))


def energy(y, vy):
    """Of the height: both springs and the load; the same at all times."""
    touching = np.maximum(1.0 + 4 / 3 * y, 0.0)
    return vy**2 / 2 + y**2 / 2 - y + 3 / 8 * touching**2


@jax.jit
@jax.vmap
def ridden(speed, height, rtol):
    """Hops of what rides on the belt, at its speed, from a height in the air or in the belt."""
    begin = (0.0, height), (speed, 0.0)
    return wiperjax.solve(hopper(speed), LENGTH, initial_state=begin, rtol=rtol, max_events=64)


@pytest.mark.long
def test_what_rides_on_a_belt_and_hops_rides_on():
    """A third of them ended with steps too small, all that began in the air at their start: where
    the slip speed is zero and stays so, no polynomial of it is above its rounding."""
    rng = np.random.default_rng(0)
    speed, rtol = rng.uniform(0.1, 2.0, 48), 10 ** rng.uniform(-10, -6, 48)
    height = np.where(np.arange(48) % 2, -rng.uniform(0.8, 3.0, 48), rng.uniform(1.6, 3.0, 48))
    found = ridden(speed, height, rtol)
    assert np.all(found.result == Result.FINISHED)
    x, y = found.final_position.T
    vx, vy = found.final_velocity.T
    np.testing.assert_allclose(x, speed * LENGTH, rtol=1e-12)
    np.testing.assert_allclose(vx, speed, rtol=1e-12)
    np.testing.assert_allclose(energy(y, vy), energy(height, 0.0), rtol=1e-4)
    # it never flies, which a contact of this kind cannot, and sticks whenever it is in the belt
    regimes = np.asarray(found.events.after)
    assert not np.any(regimes == Regime.FLIGHT)
    touching = np.asarray(1.0 + 4 / 3 * y) > 1e-6
    np.testing.assert_array_equal(np.asarray(found.final_regime) == Regime.STICK, touching)


@pytest.mark.long
def test_what_is_dropped_on_a_belt_takes_its_speed():
    """Friction gives it the belt's momentum while it hops, and is then no more."""
    speed, mu = 1.7, 0.3
    found = wiperjax.solve(
        hopper(speed, mu), LENGTH, initial_state=((0.0, -2.0), (0.0, 0.0)), rtol=1e-9,
        sample_times=np.linspace(0.0, LENGTH, 4001), max_events=0,
    )  # fmt: skip
    assert found.result == Result.FINISHED
    assert abs(float(found.final_velocity[0]) - speed) < 1e-9
    vx, normal = np.asarray(found.samples.velocity[0]), np.asarray(found.samples.normal_force)
    slides = vx < speed - 1e-6
    gained = mu * np.concatenate([[0.0], np.cumsum(0.5 * (normal[1:] + normal[:-1]) * 0.01)])
    np.testing.assert_allclose(vx[slides], gained[slides], atol=2e-4)
    assert np.all(np.abs(vx[~slides] - speed) < 2e-6)
