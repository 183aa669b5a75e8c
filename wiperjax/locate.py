"""What a trial step is worth: accept it, shorten it onto an event, or refuse it.

An event is located in two strokes. The guard's polynomial gives the first zero; the next trial
step is shortened to end there, so that the state at the event is a full Runge-Kutta result and
its guard is the true one. Newton on the length of that step (a re-step each time) goes on until the
rest, in units of the step, is below sqrt(rtol) and 1e3 rtol: its square is what a linear estimate
of it is off, if its slope is known well enough.
That last correction is a Taylor step (`step.drift`) and carries the derivative of the event time
(implicit function theorem), since step sizes themselves carry none.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from .barrier import keep
from .examine import pick
from .fastmath import larger, smaller, within
from .guards import JAM
from .polynomials import first_root
from .state import Problem, State
from .system import Scalar
from .trial import Trial

SLOPE_ERROR = 4  # of a guard's polynomial at the end of the step, over the polynomial's own
MAX_TRIES = 12  # steps of one location
CLEAR, VIOLATED, MURKY = 2.0, -1.0, -0.5  # bounds of a first zero in [0, 1] that are none


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


class Obstacle(NamedTuple):
    """The first thing in the way of a trial step."""

    slot: Scalar
    violated: Scalar  # the guard of ``slot`` is negative from the start
    murky: Scalar  # its error estimate is as large as itself: nothing can be said of this step
    found: Scalar  # it vanishes at ``theta``
    undecided: Scalar  # nothing is known beyond ``theta``
    theta: Scalar
    doubtful: Scalar  # a guard taken for free of zeros with less certainty than its error asks


def first_obstacle(state: State, trial: Trial) -> Obstacle:
    """Return the earliest of what all guards put in the way, whatever their order in the list.

    A root is sought for the guard whose lower bound comes first. Another one that vanishes earlier
    after all shows up when the step has been shortened; where the first turns out to have no root
    and another might, the step is shortened to what is proved free.
    """
    pending = state.target >= 0
    earliest = second = jnp.full_like(trial.guards[0].cut, CLEAR)
    slot = jnp.zeros_like(state.target)
    for i, g in enumerate(trial.guards):
        clear = jnp.logical_or(g.proved, pending & (state.target == i))
        # an error estimate near the value itself makes roots out of nothing: shorten the step first
        murky = g.start <= 8 * g.blur
        bound = jnp.where(g.falls, VIOLATED, jnp.where(murky, MURKY, g.cut))
        bound = keep(jnp.where(clear, CLEAR, bound))
        first = bound < earliest
        second = jnp.where(first, earliest, smaller(second, bound))
        earliest = jnp.where(first, bound, earliest)
        slot = jnp.where(first, i, slot)
        earliest, second, slot = keep((earliest, second, slot))

    control, error = keep(pick([(g.control, g.error) for g in trial.guards], slot))
    root = keep(first_root(control))
    violated, murky = earliest == VIOLATED, earliest == MURKY
    asked = (earliest >= 0) & (earliest < CLEAR)
    tied = asked & pending & root.found & (root.theta > 1 - 1e-6)
    quiet = asked & (root.free | tied)
    # a second one that is violated or murky would have come first
    unknown = quiet & (second < CLEAR)
    found = asked & root.found & ~quiet
    undecided = (asked & ~root.found & ~quiet) | unknown
    theta = jnp.where(quiet, second, root.theta)
    doubtful = quiet & ~tied & (root.low <= error)
    return keep(Obstacle(slot, violated, murky, found, undecided, theta, doubtful))


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


def locate(problem: Problem, state: State, trial: Trial) -> Plan:
    """Return what to do with ``trial``."""
    pending = state.target >= 0
    first = first_obstacle(state, trial)
    obstructed = jnp.asarray(first.violated | first.murky | first.found | first.undecided)

    # the event being located: Newton on the length of the step
    # (the slope comes from a polynomial and may be a per cent off, in stick most of all)
    eps = float(jnp.finfo(trial.guards[0].start.dtype).eps)
    root = jnp.sqrt(problem.rtol)
    fine = within(2000 * eps, 0.01 * root, 1e-3)
    # derivatives feel the rest itself, times what is not known of the acceleration's change
    wide = within(2000 * eps, smaller(root, 1e3 * problem.rtol), 1e-2)
    slot = larger(state.target, 0)
    value, slope, start, proved, error, noise = keep(
        pick([(g.value, g.slope, g.start, g.proved, g.error, g.noise) for g in trial.guards], slot)
    )
    falling = slope < 0
    # towards a double root the slope dies and Newton's error grows: go on for longer there
    flat = jnp.abs(slope) / larger(jnp.abs(start), 1e-30)
    flat = stop_gradient(smaller(flat, 1.0))
    shift = keep(-value / jnp.where(falling, slope, -1.0))
    miss_by = jnp.abs(stop_gradient(shift))
    # the estimate's own error, by its curvature and by its slope's; the last digits need neither
    sharp = miss_by * SLOPE_ERROR * error <= problem.rtol * jnp.abs(slope)
    close = (miss_by <= fine * flat) | (sharp & (miss_by <= wide * flat))
    # what lies past the end of the step is not proved: nothing else may vanish there first
    ahead = 2 * larger(stop_gradient(shift), 0.0)
    for i, g in enumerate(trial.guards):
        close = close & ((g.value + ahead * g.slope > 0) | (slot == i) | (ahead == 0))
    # as near as the clock can tell
    tick = 32 * jnp.finfo(trial.h.dtype).eps * jnp.abs(state.time)
    small = (trial.h <= tick) & (jnp.abs(stop_gradient(shift) * trial.h) <= tick)
    free = pending & trial.ok & ~obstructed
    near = falling & (close | small)
    zero = jnp.abs(stop_gradient(value)) <= noise  # as far as its digits tell
    located = free & (near | (zero & stands_still(problem, state, trial)))
    chase = free & jnp.logical_not(located)
    miss = chase & (value > 0) & proved & (~falling | (jnp.abs(shift) > 0.05))
    # two guards that vanish close together may send the step to and fro between them
    wearied = state.tries >= MAX_TRIES
    retarget = trial.ok & first.found & ~wearied
    lost = (chase & ~miss & (~falling | wearied)) | (trial.ok & first.found & wearied)
    newton = chase & ~miss & ~lost
    located, miss, lost, newton, retarget = keep((located, miss, lost, newton, retarget))

    accept = trial.ok & ~obstructed & (~pending | miss)
    inaccurate = ~trial.ok & state.active
    blocked = trial.ok & (first.murky | first.undecided)
    fire = trial.ok & first.violated

    h = stop_gradient(trial.h)
    dtype = h.dtype
    target = jnp.where(retarget, first.slot, jnp.where(newton, state.target, -1)).astype(jnp.int32)
    theta = first.theta.astype(dtype)
    stretch = within(0.5, 1 + stop_gradient(shift), 1.5).astype(dtype)
    new_trial = jnp.where(retarget, h * theta, h * stretch)
    # a shortened step must not teach the controller: it keeps its own step until one is accepted
    grown = jnp.where(trial.lands | pending, larger(state.step, trial.next_step), trial.next_step)
    step = jnp.where(accept, grown, state.step)
    step = jnp.where(inaccurate, trial.next_step, step)
    step = jnp.where(trial.ok & first.murky, 0.25 * h, step)
    # well inside what is proved: just at its end the next trial would be as undecided
    step = jnp.where(trial.ok & first.undecided, h * larger(0.9 * theta, 0.1), step)
    step = jnp.where(lost, 0.5 * h, step)
    refused = inaccurate | blocked | lost
    tiny = 64 * jnp.finfo(dtype).eps * larger(jnp.abs(state.time), 1e-6 * jnp.abs(problem.end))
    jams = trial.braking & refused & (step < tiny)

    return keep(
        Plan(
            accept=accept,
            arrive=located,
            fire=fire | jams,
            slot=jnp.where(jams, JAM, jnp.where(fire, first.slot, slot)).astype(jnp.int32),
            correction=stop_gradient(jnp.where(located & near, shift.astype(dtype) * h, 0.0)),
            unproved=(accept | located) & first.doubtful,
            rejected=refused & ~jams,
            step=step,
            target=target,
            trial=new_trial,
            tries=jnp.where(newton | retarget, state.tries + 1, 0).astype(jnp.int32),
        )
    )
