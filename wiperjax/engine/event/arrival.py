"""How near a trial step ends to the event that it was made to end on."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...numerics.arrays import pick
from ...numerics.elementary import larger, smaller, within
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ..carry.problem import Problem
from ..carry.state import State
from ..trial.attempt import Trial

SLOPE_ERROR = 4  # of a guard's polynomial at the end of the step, over the polynomial's own
SWINGS = 4  # steps of one location from which on it is by rounding alone


class Approach(NamedTuple):
    """The guard that a trial step aims at, at the end of the step."""

    slot: Scalar
    pending: Scalar  # the step aims at its zero, and it has no other one in the step
    near: Scalar  # the zero is so near that its tangent tells where it is
    zero: Scalar  # it vanishes as far as its digits tell
    brief: Scalar  # the step is as short as the clock can tell
    above: Scalar  # it is positive,
    falling: Scalar  # it goes down,
    proved: Scalar  # and it has no zero in the step
    shift: Scalar  # by its tangent: time to its zero over the step (differentiable)


def approach(problem: Problem, state: State, trial: Trial) -> Approach:
    """Return how the step ends to the event of ``trial.target``, if it has one."""
    slot = larger(trial.target, 0)
    value, slope, start, proved, lone, error, noise = keep(
        pick(
            [(g.value, g.slope, g.start, g.proved, g.lone, g.error, g.noise) for g in trial.guards],
            slot,
        )
    )
    # what was foreseen, not found, may vanish twice in this step: it is then as any other
    foreseen = state.tries == 0
    pending = (trial.target >= 0) & (lone | ~foreseen)

    # the slope comes from a polynomial and may be a per cent off, in stick most of all
    eps = float(jnp.finfo(start.dtype).eps)
    root = jnp.sqrt(problem.rtol)
    fine = within(2000 * eps, 0.01 * root, 1e-3)
    # derivatives feel the rest itself, times what is not known of the acceleration's change
    wide = within(2000 * eps, smaller(root, 1e3 * problem.rtol), 1e-2)
    # a step that was cut to the zero ends far nearer to it than that, a guess anywhere
    wide = jnp.where(foreseen, smaller(wide, 1e-3), wide)
    falling = slope < 0
    shift = keep(-value / jnp.where(falling, slope, -1.0))
    miss = jnp.abs(stop_gradient(shift))
    # towards a double root the slope dies and Newton's error grows: go on for longer there
    size = larger(stop_gradient(jnp.abs(start)), 1e-30)
    flat = smaller(stop_gradient(jnp.abs(slope)), size)
    # the estimate's own error, by its curvature and by its slope's; the last digits need neither
    zero = jnp.abs(stop_gradient(value)) <= noise
    sharp = miss * SLOPE_ERROR * error <= problem.rtol * jnp.abs(slope)
    close = (miss * size <= fine * flat) | ((sharp | zero) & (miss * size <= wide * flat))
    # what lies past the end of the step is not proved: nothing else may vanish there first, and no
    # known time be passed
    past = larger(stop_gradient(shift), 0.0)
    close = close & ((state.time + trial.h * (1 + past) <= trial.mark) | (past == 0))
    for i, g in enumerate(trial.guards):
        close = close & ((g.value + 2 * past * g.slope > 0) | (slot == i) | (past == 0))
    # as near as the clock can tell, by whose last digit Newton else swings to and fro
    digit = jnp.finfo(trial.h.dtype).eps * jnp.abs(state.time)
    brief = trial.h <= 32 * digit
    swings = (state.tries >= SWINGS) & (miss * trial.h <= digit)
    # (a step of no length, of a piece that has none, is as near to any zero)
    small = (brief & (trial.h > 0) & (miss * trial.h <= 32 * digit)) | swings
    return Approach(
        slot=slot,
        pending=pending,
        near=falling & (close | small),
        zero=zero,
        brief=brief,
        above=value > 0,
        falling=falling,
        proved=proved,
        shift=shift,
    )


def stands_still(problem: Problem, state: State, trial: Trial):
    """True where a trial step moves the state by no more than its rounding errors.

    An event whose guard is zero in its digits cannot be located better then: the time may have more
    digits than the state, and would go on without it.
    """
    leaves = zip(
        (*state.position, *state.velocity),
        jax.tree.leaves(trial.step.y1),
        jax.tree.leaves(problem.atol),
        strict=True,
    )
    still = trial.ok
    for before, after, atol in leaves:
        eps = jnp.finfo(before.dtype).eps
        move = jnp.abs(stop_gradient(after - before))
        still = still & (problem.rtol * move <= eps * (problem.rtol * jnp.abs(before) + atol))
    return still
