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

from ..numerics.arrays import put, where
from ..numerics.fusion_barrier import apart
from ..numerics.rows import Packing, Rows
from ..numerics.wide_masks import narrowed, widened, width_for, with_wide_masks
from ..vocabulary.codes import Result
from .carry.problem import Case, Problem
from .carry.start import initial_state
from .carry.state import TERM, EventLog, State, final_velocity
from .sampling.means import Signal, flush
from .step import flow, jump

ROUND = 4  # flows of a round, or more where a jump is shared by more


class Pool(NamedTuple):
    """Cases to run. Leaves of the problem with one entry a case have the cases as last axis."""

    case: Case  # position and velocity (cases,) each, one start
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
    return (problem.system, problem.atol, problem.longest, problem.max_step, problem.observer)


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


class _Carry(NamedTuple):
    """The loop carry of a batch, lanes last."""

    parts: Any  # of the problems in flight
    state: State
    case: jax.Array  # number of each lane's case; ``capacity`` where it has none
    upcoming: jax.Array  # the next case to be taken
    outcomes: list  # `Packing` of what the cases leave
    samples: Any
    useful: jax.Array
    executed: jax.Array


class _Batch:
    """A pool on its lanes: what stays the same while it runs, and the pieces of the loop."""

    def __init__(self, pool: Pool, lanes: int, flows: int):
        problem, self.position, self.velocity, self.start = pool.case
        self.capacity = self.position[0].shape[-1]
        self.cases = jnp.minimum(pool.count, self.capacity).astype(jnp.int32)
        self.problem, self.lanes, self.flows = problem, lanes, flows
        self.turns = max(1, ROUND // flows)
        # flows and jump as two compiled functions, not one (the same bits): compiled in a quarter
        # less time, for a fifth more when they run
        self.counted = apart if problem.brief else lambda number: number
        self.varying, self.shared = _split(problem, self.capacity)
        self.signal: Signal | None = problem.signal
        self.wait = max(1, lanes // 32)  # lanes that may idle before a refill is worth its cost

    def problem_of(self, parts) -> Problem:
        """The problem of the cases whose varying ``parts`` these are."""
        return _rebuild(self.problem, parts, self.shared)

    def fill(self, at):
        """Problem parts and initial states of the cases ``at``."""
        take = lambda x: x[..., at]
        parts, q, v = jax.tree.map(take, (self.varying, self.position, self.velocity))
        start = jnp.broadcast_to(self.start, at.shape)
        state = initial_state(self.problem_of(parts), q, v, start)
        if self.signal is not None:
            state = state._replace(samples=self.signal.empty(q[0]))
        return parts, state

    def begin(self) -> _Carry:
        """Every lane is idle at first, and filled inside the loop like any other: the same
        arithmetic compiled in two places rounds in two ways. So states need their shapes alone.
        """

        def shapes(at):
            parts, state = self.fill(at)
            return parts, state, _outcome(self.problem_of(parts), state)

        nobody = jnp.full(self.lanes, self.capacity, jnp.int32)
        parts, state, outcome = jax.eval_shape(shapes, nobody)
        parts, state = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), (parts, state))
        state = state._replace(result=state.result + int(Result.FINISHED), due=state.due - 1)
        self.packing = Packing.of(outcome)
        blank = self.packing.empty(self.capacity)
        zero = jnp.zeros((), jnp.int64)
        samples = None if self.signal is None else self.signal.record()
        return _Carry(parts, state, nobody, jnp.int32(0), blank, samples, zero, zero)

    def is_busy(self, carry: _Carry):
        return jnp.any(carry.case < self.capacity) | (carry.upcoming < self.cases)

    def refill(self, carry: _Carry) -> _Carry:
        """Keep what has ended, and give its lanes the next cases."""
        state, ended, case, upcoming = carry.state, carry.state.ended, carry.case, carry.upcoming
        at = jnp.where(ended, case, self.capacity)
        rows = self.packing.pack(_outcome(self.problem_of(carry.parts), state))
        outcomes = [put(old, at, row) for old, row in zip(carry.outcomes, rows, strict=True)]
        new = upcoming + jnp.cumsum(ended, dtype=jnp.int32) - 1
        takes = ended & (new < self.cases)

        def take(waiting):
            parts, state, takes = waiting
            fresh = self.fill(jnp.clip(new, 0, self.capacity - 1))
            return *where(takes, fresh, (parts, state)), jnp.zeros_like(takes)

        # once, if any, and compiled apart: see `advance`
        waiting = (carry.parts, state, takes)
        parts, state, _ = lax.while_loop(lambda x: jnp.any(x[-1]), take, waiting)
        return carry._replace(
            parts=parts,
            state=state,
            case=jnp.where(takes, new, jnp.where(ended, self.capacity, case)),
            upcoming=apart(upcoming + jnp.sum(takes, dtype=jnp.int32)),
            outcomes=outcomes,
        )

    def advance(self, carry: _Carry) -> _Carry:
        """A refill, and rounds until the next one is worth it."""
        carry = self.refill(carry)
        problem, state = self.problem_of(carry.parts), carry.state
        room = jnp.where(carry.upcoming < self.cases, self.wait, self.lanes)

        # not in a brief program, which is compiled sooner than it has run: writing it anew takes as
        # long as tracing it
        width = None if problem.brief else width_for(state.position[0])
        flows, jumps = (with_wide_masks(half, state, width) for half in (flow, jump))

        def turn(inner):
            state, turns = inner
            state = lax.fori_loop(0, self.flows, lambda _, s: flows(problem, s), state)
            # once, if any: a loop of its own becomes one compiled function
            # (`jax_settings.COMPILER`)
            happens = lambda s: jnp.any(s.due >= 0)
            state = lax.while_loop(happens, lambda s: jumps(problem, s), state)
            return state, self.counted(turns + 1)

        def goes_on(inner):
            return jnp.sum(inner[0].ended) < room

        def round_(inner):
            state, samples, rounds = inner
            start = widened(state, width), jnp.int32(0)
            done, _ = lax.while_loop(lambda x: x[1] < self.turns, turn, start)
            state = narrowed(done, state)
            if self.signal is not None:
                samples, ring = flush(self.signal, samples, state.samples, carry.case)
                state = state._replace(samples=ring)
            return state, samples, self.counted(rounds + 1)

        before = jnp.sum(state.attempts)
        state, samples, rounds = lax.while_loop(
            goes_on, round_, (state, carry.samples, jnp.int64(0))
        )
        return carry._replace(
            state=state,
            samples=samples,
            useful=carry.useful + jnp.sum(state.attempts) - before,
            executed=carry.executed + rounds * (self.turns * self.flows * self.lanes),
        )


def run_pool(pool: Pool, lanes: int, flows: int | None = None) -> tuple[Rows, Any, Effort]:
    """Run every case of ``pool``; return (rows of `Outcome`, samples or None, effort).

    ``lanes`` trajectories are in flight at any time; ``flows`` is `flows_per_jump` unless given.
    The result of a case does not depend on its lane, its neighbours or their order. Samples come
    back as `sampling.means.Samples`, case after case in rows of ``signal.length``. To be called
    inside `jax.jit`.
    """
    batch = _Batch(pool, lanes, flows or flows_per_jump(pool.case.problem.solver))
    # samples have lanes last, and what each lane has one of spreads over them
    with jax.numpy_rank_promotion("allow"):
        done = lax.while_loop(batch.is_busy, batch.advance, batch.begin())
    return Rows(done.outcomes, batch.packing), done.samples, Effort(done.useful, done.executed)
