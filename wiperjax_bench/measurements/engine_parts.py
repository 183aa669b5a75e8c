"""Parts of the engine's loop, each larger than the one before, to be timed by themselves.

Each takes a problem and the state of its lanes; the last two are the engine's own.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from wiperjax.contact.regimes import vector_field
from wiperjax.engine.carry.state import TERM
from wiperjax.engine.step import flow, jump
from wiperjax.engine.trial.step_control import error_norm, rounding_share, step_factor
from wiperjax.numerics.fusion_barrier import keep
from wiperjax.numerics.runge_kutta import rk_step


def _local(problem, state):
    return problem.system.on_piece(state.piece).on_sides(state.sides)


def right_hand_sides(problem, state):
    """Six evaluations of the vector field: what a step of Tsit5 needs."""
    y = (state.position, state.velocity)
    rate = state.rate
    tiny = jnp.asarray(1e-9, state.position[0].dtype)
    for _ in range(6):
        y = keep(jax.tree.map(lambda a, b: a + tiny * b.astype(a.dtype), y, rate))
        rate = keep(vector_field(state.time, y, (_local(problem, state), state.regime)))
    return rate


def stages(problem, state):
    """The Runge-Kutta step: right-hand sides and weighted sums."""
    system = _local(problem, state)
    args = (system, state.regime)
    y0 = (state.position, state.velocity)
    arrive = lambda t, y: (vector_field(t, y, args), ())
    step = rk_step(problem.solver, TERM, state.time, y0, state.step, state.rate, args, arrive)
    return step.y1, step.error, step.stages, step.rate1


def control(problem, state):
    """The step, its error and the next step size."""
    args = (_local(problem, state), state.regime)
    y0 = (state.position, state.velocity)
    arrive = lambda t, y: (vector_field(t, y, args), ())
    step = rk_step(problem.solver, TERM, state.time, y0, state.step, state.rate, args, arrive)
    share = rounding_share(problem, state, step, state.step)
    error = error_norm(problem, state, step, state.step, share)
    growth = state.step / state.last_step
    factor = step_factor(error + 1e-8, state.last_error, growth, error <= 1, 5)
    return step.y1, step.stages, step.rate1, state.step * factor


EVENTS = "events: detection, location, commit, statistics"
# name, what it contains, the part whose cost is taken off
LADDER: tuple[tuple[str, Callable, str | None], ...] = (
    ("right-hand sides (6)", right_hand_sides, None),
    ("stage sums", stages, "right-hand sides (6)"),
    ("step control", control, "stage sums"),
    (EVENTS, flow, "step control"),
    ("change of regime, a jump", jump, None),
)
