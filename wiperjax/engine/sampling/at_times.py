"""Values at chosen times, from the dense output of the steps that pass over them."""

import jax
import jax.numpy as jnp
import numpy as np

from ...contact.regimes import forces
from ...contact.space import contact
from ...numerics.arrays import put, where
from ...numerics.elementary import horner, larger
from ...numerics.runge_kutta import dense_weights
from ...vocabulary.codes import Regime
from ..carry.problem import Problem
from ..carry.state import State
from ..trial.attempt import Trial

_POINTS = 9  # the dense output of every supported solver has degree < 9


def dense_polynomial(solver_type) -> np.ndarray:
    """Coefficients (degree, stage), lowest first, of the dense output's weights b_i(theta)."""
    # Chebyshev points: an interpolation that loses no digits
    points = 0.5 - 0.5 * np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1))
    values = dense_weights(solver_type, tuple(points))
    return np.linalg.solve(np.vander(points, increasing=True), values)


def empty_samples(problem: Problem, state: State):
    """Return buffers for ``problem.record`` at every sample time: NaN, or -1 for integers."""
    if problem.sample_times is None:
        return None
    n = problem.sample_times.shape[0]

    def record(state):
        system = problem.system.on_piece(state.piece).on_sides(state.sides)
        q, v = state.position, state.velocity
        c = contact(system, state.time, q, v)
        f = forces(system, c, state.regime)
        return problem.record(system, state.time, q, v, state.regime, f)

    shapes = jax.eval_shape(record, state)
    return jax.tree.map(
        lambda s: jnp.full(
            (n, *s.shape), -1 if jnp.issubdtype(s.dtype, jnp.integer) else jnp.nan, s.dtype
        ),
        shapes,
    )


def take_samples(problem: Problem, state: State, trial: Trial, moves, length):
    """Return (index, buffers) after recording the sample times up to the end of a committed step.

    A sample at the very instant of an event shows the motion before it. Buffers have the sample
    first and lanes last.
    """
    if problem.sample_times is None:
        return state.sample_index, state.samples
    times, n = problem.sample_times, problem.sample_times.shape[0]
    system = problem.system.on_piece(state.piece).on_sides(state.sides)
    y0 = (state.position, state.velocity)
    polynomial = dense_polynomial(type(problem.solver))
    reach = jnp.where(moves, state.time + length, -jnp.inf)
    # a step that lands on a known time covers it whatever rounding says
    reach = jnp.where(moves & trial.lands, jnp.maximum(reach, trial.mark), reach)

    lanes = jnp.indices(state.time.shape, sparse=True)

    def due(index):
        return (index < n) & (times[jnp.minimum(index, n - 1)] <= reach)

    def write(carry):
        index, buffers = carry
        writes = due(index)
        t = times[jnp.minimum(index, n - 1)]
        # what lies within a completed sequence of impacts is flight, and known as its end
        inside = t < state.time
        passed = larger(0.0, t - state.time)  # at 0, as a first sample has it, with its derivative
        theta = (passed / jnp.where(trial.h > 0, trial.h, 1.0)).astype(y0[0][0].dtype)
        y = y0
        for stage, column in zip(trial.step.stages, polynomial.T, strict=True):
            weight = horner(column.tolist(), theta)
            y = jax.tree.map(lambda a, k, w=weight: a + w * k, y, stage)
        q, v = y
        f = forces(system, contact(system, t, q, v), state.regime)
        regime = jnp.where(inside, int(Regime.FLIGHT), state.regime)
        f = where(inside, jax.tree.map(jnp.zeros_like, f), f)
        values = problem.record(system, t, q, v, regime, f)
        at = (jnp.where(writes, index, n), *lanes)
        buffers = jax.tree.map(lambda b, x: put(b, at, x), buffers, values)
        return index + writes, buffers

    return jax.lax.while_loop(
        lambda carry: jnp.any(due(carry[0])), write, (state.sample_index, state.samples)
    )
