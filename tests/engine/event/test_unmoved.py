"""Events that a step came upon to within rounding: their times have derivatives, too."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from own_systems import DrivenBetweenWalls

import wiperjax
from wiperjax import Result

# (play, frequency) of four of 2048 whose derivatives were 0.7 to 7 % off
HIT = (
    (0.03115563709610318, 3.548665614490776),
    (0.031153312214842768, 3.517361867242546),
    (0.037393486836857205, 3.1216263215326205),
    (0.03289088833244209, 3.3620614118033982),
)


@jax.jit
@jax.vmap
def end(play, frequency):
    """State after 2 s, some fifty events, with its derivative by the frequency, and the result."""

    def motion(frequency):
        system = DrivenBetweenWalls(play=play, drive_frequency=frequency)
        s = wiperjax.solve(system, 2.0, rtol=1e-8, max_events=0)
        return jnp.concatenate([s.final_position, s.final_velocity]), s.result

    (state, result), (slope, _) = jax.jvp(motion, (frequency,), (1.0,))
    return state, slope, result


@pytest.mark.long
def test_a_blow_that_a_step_ends_at_by_chance_moves_with_the_clock():
    """The last of such a step is rounding, and none was made for it: the event had no time of its
    own, but that of the step. (Which motions it hits, their last digits decide.)"""
    draw = np.random.default_rng(1).uniform((0.02, 3.0), (0.05, 6.0), (252, 2))
    play, frequency = jnp.asarray([*HIT, *draw]).T
    _, slope, result = end(play, frequency)
    steps = [
        (end(play, frequency + h)[0] - end(play, frequency - h)[0]) / (2 * h)
        for h in (1e-6, 2.5e-7)
    ]
    size = 1 + jnp.abs(slope).max(1)
    assert (result == Result.FINISHED).all()
    told = jnp.abs(steps[0] - steps[1]).max(1) < 1e-4 * size  # no grazing between the differences
    assert told.sum() > 250
    assert (jnp.abs(slope - steps[0]).max(1) / size)[told].max() < 1e-4
