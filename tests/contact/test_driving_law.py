"""A law of friction whose coefficient falls below zero: what it drives is no motion."""

import math
from typing import ClassVar

import numpy as np
import pytest
from systems import trajectory

import wiperjax
from wiperjax import AbstractBeltSystem, Regime, Result, SteadyBelt, parameter

pytestmark = pytest.mark.slow
SPEED = 5 / 3  # at which friction is none


class Sinking(wiperjax.AbstractFriction):
    """0.5 - 0.3 |v|, below zero from 5/3 m/s on."""

    static: float = parameter(0.5, low=0)

    def coefficient(self, speed):
        return self.static - 0.3 * speed


class Carried(AbstractBeltSystem):
    """A block on a spring, on a belt, pressed by its weight."""

    unilateral: ClassVar[bool] = False
    coordinates: ClassVar[tuple[str, ...]] = ("x",)
    stiffness: float = 1.0
    friction: wiperjax.AbstractFriction = Sinking()
    belt: wiperjax.AbstractBelt = SteadyBelt(1.0)

    def free_acceleration(self, t, q, v):
        return (-self.stiffness * q[0],)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0


class Thrown(Carried):
    """Likewise, but it may leave the belt: a puck that falls on it."""

    unilateral: ClassVar[bool] = True
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y")

    def free_acceleration(self, t, q, v):
        return -self.stiffness * q[0], -1.0

    def directions(self, t, q):
        return (1.0, 0.0), (0.0, 1.0)

    def gap(self, t, q):
        return q[1]


def test_a_law_ends_the_motion_that_it_drives():
    """On a fast belt it did work on the block, and the run finished."""
    for belt, fits in ((1.0, True), (0.9 * SPEED, True), (1.1 * SPEED, False), (5.0, False)):
        start = ((0.0,), (0.0,))
        run = trajectory(Carried(belt=SteadyBelt(belt)), 0.02, start)
        found = Result(int(run.result))
        assert found == (Result.FINISHED if fits else Result.NO_CONSISTENT_REGIME), belt
        assert fits == (float(run.final_time) == 0.02)
        stuck = trajectory(Carried(belt=SteadyBelt(belt)), 0.01, ((0.0,), (belt,)))
        assert int(stuck.result) == Result.FINISHED and int(stuck.final_regime) == Regime.STICK


def test_it_ends_where_slip_becomes_too_fast():
    """A stiff spring pulls the block back; with the belt against it the speed of slip grows."""
    stiff, swing = 100.0, 0.2  # up to 2 m/s
    start = ((swing,), (0.0,))
    run = trajectory(Carried(stiffness=stiff, belt=SteadyBelt(1e-3)), 0.5, start)
    assert Result(int(run.result)) == Result.NO_CONSISTENT_REGIME
    slip = abs(float(run.final_velocity[0]) - 1e-3)
    free = math.sqrt(stiff) * math.sqrt(swing**2 - float(run.final_position[0]) ** 2)
    assert SPEED < slip < 1.1 * SPEED and slip < free


@pytest.mark.long
def test_flight_over_a_fast_belt_goes_on_to_the_first_slip():
    fall = 0.5
    run = trajectory(Thrown(belt=SteadyBelt(5.0)), 2.0, ((0.0, fall), (0.0, 0.0)))
    assert Result(int(run.result)) == Result.NO_CONSISTENT_REGIME
    np.testing.assert_allclose(run.events.time[0], math.sqrt(2 * fall), rtol=1e-9)
    assert float(run.final_time) > math.sqrt(2 * fall)
    slow = trajectory(Thrown(belt=SteadyBelt(0.5)), 2.0, ((0.0, fall), (0.0, 0.0)))
    assert Result(int(slow.result)) == Result.FINISHED
