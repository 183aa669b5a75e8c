"""The event loop in reverse mode, with memory like the square root of the number of turns.

N turns are cut into stretches of sqrt(N). The state before each stretch is kept; on the way back
the states inside one stretch at a time are computed again, and the cotangents pulled back through
its turns (Griewank and Walther, Evaluating Derivatives, 2008, chapter 12).

Here that is delicate. The number of turns a motion takes hangs on roundings: where the last digits
differ, an event may be located one trial step later. A stretch computed again with other roundings
would have its event in another turn than the stretch that follows, and derivatives would go to the
wrong side of it: by up to 1e-2 in every second cell, where the recomputed state is taken out of the
differentiated step, which is compiled differently. So a turn is one function that the compiler may
not inline, compiled in the same way wherever it is called, in loops that it leaves as they are
(`_next`), and every stretch must end where it did: else the gradient is NaN.
"""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata

from .carry.problem import Problem
from .carry.state import State
from .step import advance


@eqx.filter_custom_vjp
def run_reversible(problem_state: tuple[Problem, State], active: Callable, most_turns: int) -> Any:
    """Return the state where ``active(problem, state)`` ends, after ``most_turns`` at most.

    Differentiable in reverse mode, and not forwards, by the problem and the state. Memory grows
    like 2 sqrt(``most_turns``) states.
    """
    return _forwards(problem_state, active, most_turns)[0]


@run_reversible.def_fwd
def _run_fwd(perturbed, problem_state, active, most_turns):
    return _forwards(_as_arrays(problem_state, perturbed), active, most_turns)


@run_reversible.def_bwd
def _run_bwd(kept_stretches, cotangent, perturbed, problem_state, active, most_turns):
    problem, state = _as_arrays(problem_state, perturbed)
    smooth = eqx.filter(state, eqx.is_inexact_array)
    filled = jax.tree.map(
        lambda x, c: jnp.zeros_like(x) if c is None else c,
        smooth,
        eqx.filter(cotangent, eqx.is_inexact_array),
    )
    arrays, rest = eqx.partition(problem, eqx.is_array)

    def back(filled, motion):
        arrays, kept_stretches = motion
        return _back(eqx.combine(arrays, rest), kept_stretches, filled, active, most_turns)

    return _one_by_one(back)(filled, (arrays, kept_stretches))


def _one_by_one(back: Callable) -> Callable:
    """Return ``back(cotangent, motion)`` that takes a batch of cotangents of one motion, such as
    those of `jax.jacrev`, one after the other: batched, the turns that are computed again would be
    another program than the first ones, of other roundings. Many motions go side by side.
    """
    single = jax.custom_batching.custom_vmap(back)

    @single.def_vmap
    def batch(size, batched, cotangents, motion):
        if any(jax.tree.leaves(batched[1])):
            axes = jax.tree.map(lambda one: 0 if one else None, batched)
            found = _one_by_one(jax.vmap(back, axes, axis_size=size))(cotangents, motion)
        else:
            rows = jax.tree.map(
                lambda x, one: x if one else jnp.broadcast_to(x, (size, *jnp.shape(x))),
                cotangents,
                batched[0],
            )
            found = jax.lax.map(lambda row: single(row, motion), rows)
        return found, jax.tree.map(lambda _: True, found)

    return single


def _back(problem, kept_stretches, filled, active: Callable, most_turns: int):
    """Return cotangents of ``problem`` and its first state, from ``filled``, those of its last."""
    kept, stretches = kept_stretches
    length = _length(most_turns)
    moving, fixed = eqx.partition(problem, eqx.is_inexact_array)

    def stretch_back(carry):
        index, following, cotangents = carry
        begin = _at(kept, index)
        turns, end, inside = _stretch(problem, begin, active, length, _rows(begin, length))

        def turn_back(carry):
            row, (by_problem, by_state) = carry
            smooth, rest = eqx.partition(_at(inside, row), eqx.is_inexact_array)

            def turn(moving, smooth):
                after = advance(eqx.combine(moving, fixed), eqx.combine(smooth, rest))
                return eqx.filter(after, eqx.is_inexact_array)

            more, by_state = jax.vjp(turn, moving, smooth)[1](by_state)
            return row - 1, (jax.tree.map(jnp.add, by_problem, more), by_state)

        cotangents = jax.lax.while_loop(lambda c: c[0] >= 0, turn_back, (turns - 1, cotangents))[1]
        same = (end.time == following[0]) & (end.attempts == following[1])
        cotangents = jax.tree.map(lambda x: jnp.where(same, x, jnp.nan), cotangents)
        return index - 1, (begin.time, begin.attempts), cotangents

    start = (stretches - 1, _ends(kept, stretches), (jax.tree.map(jnp.zeros_like, moving), filled))
    return jax.lax.while_loop(lambda c: c[0] >= 0, stretch_back, start)[2]


def _as_arrays(tree, perturbed):
    """Return ``tree`` with arrays for what is differentiated: outside of `jax.jit` a Python number
    comes here as one, in whose place no derivative would be gathered."""
    return jax.tree.map(lambda x, p: jnp.asarray(x) if p else x, tree, perturbed)


def _length(most_turns: int) -> int:
    """Turns of a stretch."""
    return math.isqrt(max(most_turns, 1) - 1) + 1


def _forwards(problem_state, active, most_turns):
    """Return (last state, (states before the stretches, and after the last, their number))."""
    problem, state = problem_state
    length = _length(most_turns)

    def one(carry):
        index, state, kept = carry
        kept = _put(kept, index, state)
        return index + 1, _stretch(problem, state, active, length, None)[1], kept

    rows = -(-max(most_turns, 1) // length)
    start = (jnp.asarray(0), state, _rows(state, rows + 1))
    index, state, kept = jax.lax.while_loop(lambda c: active(problem, c[1]), one, start)
    return state, (_put(kept, index, state), index)


def _stretch(problem, state, active, length: int, inside):
    """Return (turns taken, state after at most ``length`` turns, the states before each)."""
    arrays, rest = eqx.partition(problem, eqx.is_array)

    @jax.jit
    def turn(arrays, state):
        with set_xla_metadata(inlineable=None):  # whatever is traced in the other one gets its tag
            return advance(eqx.combine(arrays, rest), state)

    def goes_on(carry):
        return (carry[0] < length) & active(problem, carry[1])

    def one(carry):
        row, state, inside = carry
        inside = None if inside is None else _put(inside, row, state)
        with set_xla_metadata(inlineable="false"):
            state = turn(arrays, state)
        return _next(row), state, inside

    return jax.lax.while_loop(goes_on, one, (jnp.asarray(0), state, inside))


def _next(row):
    """Return ``row`` + 1, by a call out of the compiled program.

    `wiperjax.configure` has whole loops made one function, in which a turn takes the roundings of
    what stands around it. A loop that calls out is left alone.
    """
    root = jax.lax.linalg.cholesky(jnp.reshape(row + 1.0, (1, 1)))
    return row + jnp.where(root[0, 0] > 0, 1, 0)


def _rows(state, rows: int):
    """Room for ``rows`` states."""
    return jax.tree.map(lambda x: jnp.zeros((rows, *x.shape), x.dtype), state)


def _put(rows, index, state):
    return jax.tree.map(lambda r, x: r.at[index].set(x), rows, state)


def _at(rows, index):
    return jax.tree.map(lambda r: r[index], rows)


def _ends(kept, index):
    end = _at(kept, index)
    return end.time, end.attempts
