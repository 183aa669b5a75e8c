"""Starts: the regime that a motion begins in, and what its derivatives know of that."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Block, Puck

import wiperjax
from wiperjax import Wiper, WipingBelt


@pytest.mark.slow
def test_the_release_of_what_begins_in_stick_has_its_derivatives():
    """The belt alone carries it there, at t = F / (k V): the speed that it was given has no
    part."""
    force, stiffness, speed = 0.9, 2.0, 0.3

    @jax.jit
    def release(speed, given):
        block = Block(force, 0.5, 1.0, stiffness, belt=speed)
        start = ((0.0,), (given,))
        s = wiperjax.solve(block, 2.0, initial_state=start, rtol=1e-10, max_events=4)
        return s.events.time[0]

    by_belt, by_start = jax.jacfwd(release, (0, 1))(speed, speed)
    assert float(by_belt) == pytest.approx(-force / stiffness / speed**2, rel=1e-9)
    assert float(by_start) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_what_begins_to_slip_from_rest_keeps_the_derivative_by_its_speed():
    """And on the ground none by the speed away from it."""

    @jax.jit
    @jax.jacfwd
    def place(velocity):
        start = ((0.0, 0.0), tuple(velocity))
        s = wiperjax.solve(Puck(0.3, push=5.0), 0.7, initial_state=start, max_events=4)
        return s.final_position

    np.testing.assert_allclose(place(jnp.zeros(2)), [[0.7, 0.0], [0.0, 0.0]], atol=1e-12)


@pytest.mark.slow
def test_a_wiper_on_a_belt_that_turns_round_at_the_start():
    """By the belt's phase: central differences, whichever way it then moves off first."""

    @jax.jit
    def place(phase):
        wiper = Wiper(belt=WipingBelt(0.3, 10.0, phase), attack_angle=0.1)
        return wiperjax.solve(wiper, 2e-3, rtol=1e-11, max_events=0).final_position[0]

    step = 1e-5
    change = (place(step) - place(-step)) / (2 * step)
    slope = jax.jvp(place, (0.0,), (1.0,))[1]
    assert float(slope) == pytest.approx(float(change), rel=1e-6)
