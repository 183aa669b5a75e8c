"""A batch that never waits: a fixed number of lanes over a pool of cases.

Every lane is a trajectory with its own time, step and regime. A lane that ends takes the next case
of the pool inside the compiled loop, so none idles for another. A turn is one or two flows (trial
steps of smooth motion) and a jump (regimes changed): events are rare, their arithmetic is dear, a
batch runs it for all lanes at once, and a lane with an event waits for it. After a round of turns
samples are put away and lanes are refilled.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from ..numerics.arrays import where
from ..vocabulary.codes import Result
from .carry.start import initial_state
from .carry.state import TERM, EventLog, Problem, State, final_velocity
from .sampling.means import Signal, flush
from .step import flow, jump

ROUND = 2  # flows of a round, or more where a jump is shared by more


class Pool(NamedTuple):
    """Cases to run. Leaves of ``problem`` with one entry a case have the cases as last axis."""

    problem: Problem
    position: tuple  # n arrays (cases,)
    velocity: tuple
    start: jax.Array  # () time
    count: jax.Array  # () cases that are real; the rest only fills the arrays


class Outcome(NamedTuple):
    """What every case leaves, (cases,) each."""

    result: jax.Array
    final_time: jax.Array
    position: tuple
    velocity: tuple
    regime: jax.Array
    steps: jax.Array
    rejected: jax.Array
    unproved: jax.Array
    events: jax.Array
    observed: Any
    log: EventLog | None  # (cases, capacity); None with a capacity of 0


class Effort(NamedTuple):
    """Work of the batch: lane-turns that advanced a case, and all that were executed."""

    useful: jax.Array
    executed: jax.Array


def _per_case(problem: Problem):
    """The parts of a problem that may differ between cases."""
    return (problem.system, problem.atol, problem.observer)


def _split(problem: Problem, cases: int):
    """Return (values with one entry a case, everything else) of the parts that may differ.

    What is the same for all cases stays out of the loop carry: the Python number 0 that switches
    a term off must not become an array.
    """
    return eqx.partition(
        _per_case(problem),
        lambda x: eqx.is_array(x) and x.ndim > 0 and x.shape[-1] == cases,
    )


def _rebuild(problem: Problem, varying, shared) -> Problem:
    parts = eqx.combine(varying, shared)
    return eqx.tree_at(_per_case, problem, parts, is_leaf=lambda x: x is None)


def _outcome(problem: Problem, state: State) -> Outcome:
    return Outcome(
        state.result,
        state.time,
        state.position,
        final_velocity(problem, state),
        state.regime,
        state.attempts,
        state.rejected,
        state.unproved,
        state.events,
        state.observed,
        state.log if problem.log_capacity else None,
    )


def flows_per_jump(solver) -> int:
    """Return how many flows share a jump: 1 where few lead to the next event, as with a scheme of
    high order, else 2.
    """
    return 1 if solver.order(TERM) >= 6 else 2


def run_pool(pool: Pool, lanes: int, flows: int | None = None) -> tuple[Outcome, Any, Effort]:
    """Run every case of ``pool``; return (outcomes, samples or None, effort).

    ``lanes`` trajectories are in flight at any time; ``flows`` is `flows_per_jump` unless given.
    The result of a case does not depend on its lane, its neighbours or their order. Samples come
    back as `averaging.Samples`, case after case in rows of ``problem.signal.length``. To be called
    inside `jax.jit`.
    """
    capacity = pool.position[0].shape[-1]
    cases = jnp.minimum(pool.count, capacity).astype(jnp.int32)
    problem = pool.problem
    if flows is None:
        flows = flows_per_jump(problem.solver)
    turns = max(1, ROUND // flows)
    varying, shared = _split(problem, capacity)
    signal: Signal | None = problem.signal

    def fill(at):
        """Problem parts and initial states of the cases ``at``."""
        parts, q, v = jax.tree.map(lambda x: x[..., at], (varying, pool.position, pool.velocity))
        start = jnp.broadcast_to(pool.start, at.shape)
        state = initial_state(_rebuild(problem, parts, shared), q, v, start)
        if signal is not None:
            state = state._replace(samples=signal.empty(q[0]))
        return parts, state

    # Every lane is idle at first, and filled inside the loop like any other: the same arithmetic
    # compiled in two places rounds in two ways.
    parts, state = fill(jnp.zeros(lanes, jnp.int32))
    case = jnp.full(lanes, capacity, jnp.int32)
    state = state._replace(result=jnp.full_like(state.result, int(Result.FINISHED)))
    blank = jax.tree.map(
        lambda x: jnp.zeros((capacity, *x.shape[:-1]), x.dtype),
        _outcome(_rebuild(problem, parts, shared), state),
    )
    wait = max(1, lanes // 32)  # lanes that may idle before a refill is worth its cost

    def refill(parts, state, case, upcoming, outcome):
        """Keep what has ended, and give its lanes the next cases."""
        ended = state.ended
        at = jnp.where(ended, case, capacity)
        outcome = jax.tree.map(
            lambda o, x: o.at[at].set(jnp.moveaxis(x, -1, 0), mode="drop"),
            outcome,
            _outcome(_rebuild(problem, parts, shared), state),
        )
        new = upcoming + jnp.cumsum(ended, dtype=jnp.int32) - 1
        takes = ended & (new < cases)
        fresh_parts, fresh = fill(jnp.clip(new, 0, capacity - 1))
        state, parts = where(takes, fresh, state), where(takes, fresh_parts, parts)
        case = jnp.where(takes, new, jnp.where(ended, capacity, case))
        return parts, state, case, upcoming + jnp.sum(takes, dtype=jnp.int32), outcome

    def stretch(carry):
        """A refill, and rounds until the next one is worth it."""
        *inner, samples, useful, executed = carry
        parts, state, case, upcoming, outcome = refill(*inner)
        local = _rebuild(problem, parts, shared)
        room = jnp.where(upcoming < cases, wait, lanes)

        def turn(_, state):
            state = lax.fori_loop(0, flows, lambda _, s: flow(local, s), state)
            # once, if any: a loop of its own becomes one compiled function (`launch.COMPILER`)
            return lax.while_loop(lambda s: jnp.any(s.due >= 0), lambda s: jump(local, s), state)

        def goes_on(carry):
            return jnp.sum(carry[0].ended) < room

        def round_(carry):
            state, samples, rounds = carry
            state = lax.fori_loop(0, turns, turn, state)
            if signal is not None:
                samples, ring = flush(signal, samples, state.samples, case)
                state = state._replace(samples=ring)
            return state, samples, rounds + 1

        before = jnp.sum(state.attempts)
        state, samples, rounds = lax.while_loop(goes_on, round_, (state, samples, jnp.int64(0)))
        useful = useful + jnp.sum(state.attempts) - before
        executed = executed + rounds * (turns * flows * lanes)
        return parts, state, case, upcoming, outcome, samples, useful, executed

    def busy(carry):
        case, upcoming = carry[2:4]
        return jnp.any(case < capacity) | (upcoming < cases)

    zero = jnp.zeros((), jnp.int64)
    samples = None if signal is None else signal.record()
    carry = (parts, state, case, jnp.int32(0), blank, samples, zero, zero)
    *_, outcome, samples, useful, executed = lax.while_loop(busy, stretch, carry)
    return outcome, samples, Effort(useful, executed)
