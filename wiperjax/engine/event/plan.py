"""What a trial step is worth: accept it, shorten it onto an event, or refuse it.

An event is located by a step that ends on it, so that the state there is a full Runge-Kutta result
and its guard is the true one. How long that step must be is foreseen, from the guard's polynomial
over the step before it (`first_zero`) or from the last stay of the same kind (`recall`: near a
cycle that is nearly every event), or found in a step that ran over the event and is taken back.
Newton on its length (a re-step each time) goes on until the rest, in units of the step, is below
sqrt(rtol) and 1e3 rtol: its square is what a linear estimate of it is off, if its slope is known
well enough (`approach`).
That last correction is a Taylor step (`event_time.drift`) and carries the derivative of the time
(implicit function theorem), since step sizes themselves carry none.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import JAM
from ...numerics.elementary import larger, within
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ..carry.problem import Problem
from ..carry.state import State
from ..trial.attempt import Trial
from .arrival import approach, stands_still
from .first_zero import first_obstacle

MAX_TRIES = 12  # steps of one location


class Plan(NamedTuple):
    """Decision about a trial step. At most one of accept, arrive and fire holds."""

    accept: Scalar  # commit the whole step
    arrive: Scalar  # commit it, and the event of `slot` at its end
    fire: Scalar  # no motion: the guard of `slot` is violated already
    slot: Scalar
    correction: Scalar  # time from the end of the step to the event (without derivative)
    unproved: Scalar  # accepted although some guard could not be proved free of zeros
    rejected: Scalar  # nothing committed because of the error estimate
    step: Scalar  # controller's step for the next trial
    target: Scalar
    trial: Scalar
    tries: Scalar


def locate(problem: Problem, state: State, trial: Trial) -> Plan:
    """Return what to do with ``trial``."""
    aim = approach(problem, state, trial)
    first = first_obstacle(trial, aim.pending, aim.near | aim.zero)
    obstructed = jnp.asarray(first.blocks)
    h = stop_gradient(trial.h)

    free = aim.pending & trial.ok & ~obstructed
    # of a guard that is zero in its digits no other step will tell more
    blind = (state.tries > 0) & (aim.falling | stands_still(problem, state, trial))
    located = free & (aim.near | (aim.zero & blind))
    chase = free & jnp.logical_not(located)
    # it is not there, or a known time comes first
    elsewhere = ~aim.falling | (jnp.abs(aim.shift) > 0.05) | trial.cut
    # Of an event that was seen this close ahead no shorter step would tell more, by nodes which the
    # clock rounds: it is here.
    brief = aim.brief & (state.target >= 0) & ~trial.cut
    miss = chase & aim.above & aim.proved & elsewhere & ~brief
    # two guards that vanish close together may send the step to and fro between them
    wearied = state.tries >= MAX_TRIES
    retarget = trial.ok & first.found & ~wearied
    lost = (chase & ~miss & (~aim.falling | wearied)) | (trial.ok & first.found & wearied)
    newton = chase & ~miss & ~lost
    blocked = trial.ok & (first.murky | first.undecided)
    ends = (blocked | lost) & brief
    located = located | ends
    located, miss, lost, newton, retarget, ends = keep(
        (located, miss, lost, newton, retarget, ends)
    )

    accept = trial.ok & ~obstructed & (~aim.pending | miss)
    foreseen = accept & first.ahead
    inaccurate = ~trial.ok & state.active
    fire = trial.ok & first.violated

    dtype = h.dtype
    target = jnp.where(retarget | foreseen, first.slot, jnp.where(newton, trial.target, -1))
    theta = first.theta.astype(dtype)
    stretch = within(0.5, 1 + stop_gradient(aim.shift), 1.5).astype(dtype)
    length = jnp.where(retarget, theta, jnp.where(foreseen, theta - 1, stretch))
    # a shortened step must not teach the controller: it keeps its own step until one is accepted
    short = trial.lands | (trial.target >= 0)
    grown = jnp.where(short, larger(state.step, trial.next_step), trial.next_step)
    step = jnp.where(accept, grown, state.step)
    step = jnp.where(inaccurate, trial.next_step, step)
    step = jnp.where(trial.ok & first.murky, 0.25 * h, step)
    # well inside what is proved: just at its end the next trial would be as undecided
    step = jnp.where(trial.ok & first.undecided, h * larger(0.9 * theta, 0.1), step)
    step = jnp.where(lost, 0.5 * h, step)
    step = jnp.where(ends, state.step, step)
    refused = inaccurate | ((blocked | lost) & ~ends)
    tiny = 64 * jnp.finfo(dtype).eps * larger(jnp.abs(state.time), 1e-6 * jnp.abs(problem.end))
    jams = trial.braking & refused & (step < tiny)

    correction = jnp.where(located & aim.near, aim.shift.astype(dtype) * h, 0.0)
    return keep(
        Plan(
            accept=accept,
            arrive=located,
            fire=fire | jams,
            slot=jnp.where(jams, JAM, jnp.where(fire, first.slot, aim.slot)).astype(jnp.int32),
            correction=stop_gradient(correction),
            unproved=(accept | located) & first.doubtful,
            rejected=refused & ~jams,
            step=step,
            target=target.astype(jnp.int32),
            trial=h * length,
            tries=jnp.where(newton | retarget, state.tries + 1, 0).astype(jnp.int32),
        )
    )
