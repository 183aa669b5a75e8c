"""One explicit Runge-Kutta step of a diffrax solver, unrolled over scalars unless told otherwise.

`diffrax`'s own ``solver.step`` loops over stages in a buffer of stages; for a state of four
scalars in a batch that costs many times the arithmetic (measured: ``wiperjax bench speed``). The
stages are therefore taken from the solver object's own tableau, and the dense output from its own
interpolation, read once as weights; a test proves both equal to diffrax's to rounding.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax import lax

from ..vocabulary import kinds
from .fusion_barrier import keep

NODES = (0.0, 0.25, 0.5, 0.75, 1.0)  # where guards and statistics look at a step, in units of it


class Step(NamedTuple):
    """Result of one trial step of size h."""

    y1: Any  # state after the step
    error: Any  # embedded error estimate
    stages: list  # stage increments h f, one pytree a stage
    rate1: Any  # vector field at the end
    rest: Any  # what rounding has left out of y1, or None
    end: Any  # what else `rk_step`'s ``arrive`` found there


def weighted_sum(weights, increments, start):
    """Return start + sum w_i k_i over pytrees, skipping zero weights at trace time."""
    terms = [(float(w), k) for w, k in zip(weights, increments, strict=False) if w != 0]
    out = start
    for w, k in terms:
        if out is None:
            out = jtu.tree_map(lambda x, w=w: w * x, k)
        else:
            out = jtu.tree_map(lambda a, x, w=w: a + w * x, out, k)
    return out


def rk_step(solver, term, t, y, h, rate, args, arrive, rest=None, unroll: bool = True) -> Step:
    """One trial step of ``solver`` from (t, y); ``rate`` is the vector field there.

    ``rest``: what rounding has left out of ``y`` so far, added to the step (compensated summation,
    Kahan): a state of few digits still moves by steps that are shorter than its last one.

    ``arrive(t1, y1)`` returns (vector field at the end, anything else worth keeping): the engine
    looks at the end of a step for its guards anyway, and a first-same-as-last solver's last stage
    is evaluated there. ``unroll``: each stage is compiled by itself, which is quicker to run, and
    with many stages slower to compile, than a loop over them.
    """
    tableau = solver.tableau
    dtype = jtu.tree_leaves(y)[0].dtype
    size = jnp.asarray(h)
    size = size if size.dtype == dtype else keep(size.astype(dtype))  # time may have more digits
    first = keep(jtu.tree_map(lambda f: size * f, rate))
    inner = len(tableau.c) - 1 if tableau.fsal else len(tableau.c)
    found = _unrolled if unroll else _rolled

    def increment(c, y_stage):
        return term.vf_prod(t + c * h, y_stage, args, size)

    stages = found(increment, y, first, tableau.a_lower[:inner], tableau.c[:inner])
    last = tableau.a_lower[-1] if tableau.fsal else tableau.b_sol
    # summed before it is added: rounded once at the state's size, not at every stage
    change = weighted_sum(last, stages, None)
    if rest is not None:
        change = keep(jtu.tree_map(jnp.add, change, rest))
    y1 = keep(jtu.tree_map(jnp.add, y, change))
    if rest is not None:
        rest = jtu.tree_map(lambda old, new, d: d - (new - old), y, y1, change)
    rate1, end = arrive(t + h, y1)
    if tableau.fsal:
        stages.append(jtu.tree_map(lambda f: size * f, rate1))
    return Step(y1, weighted_sum(tableau.b_error, stages, None), stages, rate1, rest, end)


def _unrolled(increment, y, first, lower, times) -> list:
    """Return the increments of all stages, each of which is ``increment(time, state)``."""
    stages = [first]
    for a, c in zip(lower, times, strict=True):
        y_stage = keep(weighted_sum(a, stages, y))
        stages.append(keep(increment(float(c), y_stage)))
    return stages


def _rolled(increment, y, first, lower, times) -> list:
    """`_unrolled` as a loop: equal to rounding, for sums are taken in another order."""
    count = len(times) + 1
    weights = np.zeros((len(times), count))
    for row, a in zip(weights, lower, strict=True):
        row[: len(a)] = a
    weights, times = jnp.asarray(weights), jnp.asarray(np.asarray(times, float))

    def stage(i, increments):
        def moved(x, k):
            return x + jnp.tensordot(weights[i].astype(k.dtype), k, 1, precision="highest")

        new = increment(times[i], jtu.tree_map(moved, y, increments))
        put = lambda k, x: lax.dynamic_update_index_in_dim(k, x, i + 1, 0)
        return jtu.tree_map(put, increments, new)

    blank = jtu.tree_map(lambda k: jnp.zeros((count, *k.shape), k.dtype).at[0].set(k), first)
    increments = lax.fori_loop(0, count - 1, stage, blank)
    return [jtu.tree_map(lambda k, i=i: k[i], increments) for i in range(count)]


@lru_cache(maxsize=16)
def dense_weights(solver_type, thetas: tuple[float, ...]) -> np.ndarray:
    """Weights b_i(theta) of the solver's dense output, (thetas, stages):
    y(theta) = y0 + sum b_i(theta) h f_i.
    """
    tableau = solver_type.tableau

    def weight(theta, stage, end):
        step = {"t0": 0.0, "t1": 1.0, "y0": jnp.zeros(()), "y1": end, "k": stage}
        return solver_type.interpolation_cls(**step).evaluate(theta)

    # one program: call by call it would be a score of them, a fifth of a second
    every = jax.jit(jax.vmap(jax.vmap(weight, (None, 0, 0)), (0, None, None)))
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        ends = jnp.asarray(tableau.b_sol, jnp.float64)
        return np.asarray(every(jnp.asarray(thetas), jnp.eye(tableau.num_stages), ends))


def node_states(solver, y0, step: Step) -> tuple:
    """Return the states at the inner ones of `NODES`, from the dense output."""
    weights = dense_weights(type(solver), NODES[1:-1])
    return tuple(weighted_sum(row, step.stages, y0) for row in weights)


def check_solver(solver) -> None:
    """Raise ValueError unless ``solver`` is an explicit Runge-Kutta pair with dense output."""
    tableau = getattr(solver, "tableau", None)
    if (
        not isinstance(solver, diffrax.AbstractERK)
        or tableau is None
        or tableau.implicit
        or not np.any(tableau.b_error)
    ):
        raise ValueError(
            "solver must be an explicit diffrax Runge-Kutta solver with an error estimate and "
            f"dense output (Tsit5, Dopri5, Dopri8, Bosh3), but was {type(solver).__name__}"
        )


SOLVERS = {name: getattr(diffrax, name.capitalize()) for name in kinds.SOLVERS}
