"""A batch that never waits: a fixed number of lanes over a pool of cases.

Every lane is a trajectory with its own time, step and regime. A lane that ends takes the next case
of the pool inside the compiled loop, so none idles for another. A round is a few flows (trial steps
of smooth motion) and one jump (regimes changed): events are rare, their arithmetic is dear, a batch
runs it for all lanes at once, and a lane with an event waits for it.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from .results import RUNNING, Result
from .sampling import Signal, flush
from .solve import final_velocity
from .state import EventLog, Problem, State, initial_state
from .step import flow, jump
from .transition import where


class Pool(NamedTuple):
    """Cases to run. Leaves of ``problem`` with one entry a case have the cases as last axis."""

    problem: Problem
    position: tuple  # n arrays (cases,)
    velocity: tuple
    start: jax.Array  # () time
    count: jax.Array  # () cases that are real; the rest only fills the arrays


class Outcome(NamedTuple):
    """What every case leaves, (cases,) each; ``signal`` has the samples as last axis."""

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


def run_pool(pool: Pool, lanes: int, flows: int = 3) -> tuple[Outcome, Any, Effort]:
    """Run every case of ``pool``; return (outcomes, samples or None, effort).

    ``lanes`` trajectories are in flight at any time. The result of a case does not depend on its
    lane, its neighbours or their order. Samples come back as (cases, samples). To be called inside
    `jax.jit`.
    """
    capacity = pool.position[0].shape[-1]
    cases = jnp.minimum(pool.count, capacity).astype(jnp.int32)
    problem = pool.problem
    varying, shared = _split(problem, capacity)

    def fill(at):
        """Problem parts and initial states of the cases ``at``."""
        parts, q, v = jax.tree.map(lambda x: x[..., at], (varying, pool.position, pool.velocity))
        start = jnp.broadcast_to(pool.start, at.shape)
        return parts, initial_state(_rebuild(problem, parts, shared), q, v, start)

    # Every lane is idle at first, and filled inside the loop like any other: the same arithmetic
    # compiled in two places rounds in two ways.
    parts, state = fill(jnp.zeros(lanes, jnp.int32))
    case = jnp.full(lanes, capacity, jnp.int32)
    state = state._replace(result=jnp.full_like(state.result, int(Result.FINISHED)))
    signal: Signal | None = problem.signal
    if signal is not None:
        state = state._replace(samples=signal.empty((lanes,)))
    record = signal and signal.record(lanes)
    local = _rebuild(problem, parts, shared)
    blank = jax.tree.map(
        lambda x: jnp.zeros((capacity, *x.shape[:-1]), x.dtype), _outcome(local, state)
    )
    samples = 0 if signal is None else signal.count
    taken = jax.tree.map(lambda r: jnp.zeros((capacity, samples), r.dtype), record)
    wait = max(1, lanes // 64)  # lanes that may idle before a refill is worth its cost

    def refill(carry):
        parts, state, case, upcoming, outcome, record, taken = carry
        ended = state.result != RUNNING
        local = _rebuild(problem, parts, shared)
        at = jnp.where(ended, case, capacity)
        outcome = jax.tree.map(
            lambda o, x: o.at[at].set(jnp.moveaxis(x, -1, 0), mode="drop"),
            outcome,
            _outcome(local, state),
        )
        taken = jax.tree.map(
            lambda o, r: o.at[at].set(r[:, : o.shape[1]], mode="drop"), taken, record
        )
        # a new case starts with an empty record: one that ends early must not show its predecessor
        record = jax.tree.map(
            lambda r, e: jnp.where(ended[:, None], e, r), record, signal and signal.record(lanes)
        )
        new = upcoming + jnp.cumsum(ended, dtype=jnp.int32) - 1
        takes = ended & (new < cases)
        fresh_parts, fresh = fill(jnp.clip(new, 0, capacity - 1))
        if signal is not None:
            fresh = fresh._replace(samples=signal.empty((lanes,)))
        merged = where(takes, fresh, state)
        parts = where(takes, fresh_parts, parts)
        case = jnp.where(takes, new, jnp.where(ended, capacity, case))
        upcoming = upcoming + jnp.sum(takes, dtype=jnp.int32)
        return parts, merged, case, upcoming, outcome, record, taken

    def round_(carry):
        state, case, upcoming = carry[1:4]
        ended = jnp.sum((state.result != RUNNING) & (case < capacity))
        due = (ended >= wait) | ((ended > 0) & (upcoming >= cases)) | (upcoming == 0)
        *inner, useful, executed = carry
        inner = lax.cond(due, refill, lambda c: c, tuple(inner))
        parts, state, case, upcoming, outcome, record, taken = inner
        local = _rebuild(problem, parts, shared)
        before = jnp.sum(state.attempts)
        state = lax.fori_loop(0, flows, lambda _, s: flow(local, s), state)
        state = jump(local, state)
        if signal is not None:
            record, ring = flush(record, state.samples, state.sample_index)
            state = state._replace(samples=ring)
        useful = useful + jnp.sum(state.attempts) - before
        executed = executed + flows * lanes
        return parts, state, case, upcoming, outcome, record, taken, useful, executed

    def busy(carry):
        state, case, upcoming = carry[1:4]
        return jnp.any((state.result == RUNNING) | (case < capacity)) | (upcoming < cases)

    zero = jnp.zeros((), jnp.int64)
    carry = (
        parts,
        state,
        case,
        jnp.int32(0),
        blank,
        record,
        taken,
        zero,
        zero,
    )
    carry = lax.while_loop(busy, round_, carry)
    return carry[4], carry[6], Effort(carry[7], carry[8])
