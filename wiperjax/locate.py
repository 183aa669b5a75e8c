"""What a trial step is worth: accept it, shorten it onto an event, or refuse it.

An event is located in two strokes. The guard's polynomial gives the first zero; the next trial
step is shortened to end there, so that the state at the event is a full Runge-Kutta result and
its guard is the true one. Newton on the length of that step (a re-step each time) finishes; the
last correction, far below the tolerance, is a Taylor step and carries the derivative of the event
time (implicit function theorem), since step sizes themselves carry none.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from .barrier import keep
from .guards import JAM
from .implicit import time_to_event
from .polynomials import first_root
from .results import RUNNING
from .state import Problem, State
from .system import Scalar
from .trial import Trial, pick

MAX_TRIES = 12


class Plan(NamedTuple):
    """Decision about a trial step. At most one of accept, arrive and fire holds."""

    accept: Scalar  # commit the whole step
    arrive: Scalar  # commit it, and the event of `slot` at its end
    fire: Scalar  # no motion: the guard of `slot` is violated already
    slot: Scalar
    correction: Scalar  # time from the end of the step to the event
    unproved: Scalar  # accepted although some guard could not be proved free of zeros
    rejected: Scalar  # nothing committed because of the error estimate
    step: Scalar  # controller's step for the next trial
    target: Scalar
    trial: Scalar
    tries: Scalar


def light(trial: Trial, state: State):
    """True where the step needs no more thought: accurate, free of events, away from any mark."""
    calm = trial.ok & ~trial.lands & (state.target < 0)
    return calm & jnp.all(trial.proved, axis=0)


def locate(problem: Problem, state: State, trial: Trial) -> Plan:
    """Return what to do with ``trial``."""
    pending = state.target >= 0
    slots = jnp.arange(trial.proved.shape[0]).reshape((-1,) + (1,) * state.time.ndim)
    clear = trial.proved | (pending & (state.target == slots))
    violated = ~clear & trial.falls
    # an error estimate near the value itself makes roots out of nothing: shorten the step first
    murky = ~clear & ~violated & (trial.starts <= 8 * trial.blurs)
    unit = state.unit
    clear, violated, murky = keep((clear, violated, murky), unit)
    # the earliest of all guards, whatever their order in the list. Roots are sought for the two
    # whose lower bounds come first; a third one shows up again when the step has been shortened.
    bound = jnp.where(violated, -1.0, jnp.where(murky, -0.5, trial.cuts))
    bound = keep(jnp.where(clear, 2.0, bound), unit)
    one = keep(jnp.argmin(bound, axis=0).astype(jnp.int32), unit)
    others = jnp.where(slots == one, 2.0, bound)
    two = keep(jnp.argmin(others, axis=0).astype(jnp.int32), unit)
    third = jnp.min(jnp.where(slots == two, 2.0, others), axis=0)
    pair = tuple(jnp.stack([pick(b, one), pick(b, two)]) for b in trial.controls)
    roots = keep(first_root(keep(pair, unit)), unit)
    asked = keep(jnp.stack([pick(bound, one), pick(bound, two)]), unit)
    tied = pending & roots.found & (roots.theta > 1 - 1e-6)
    quiet = (asked == 2.0) | (~(asked < 0) & (roots.free | tied))
    ahead = jnp.where(quiet, 2.0, jnp.where(asked < 0, asked, roots.theta))
    errors = jnp.stack([pick(trial.errors, one), pick(trial.errors, two)])
    doubtful = (asked < 2.0) & quiet & ~tied & (roots.low <= errors)
    second = ahead[1] < ahead[0]
    first = jnp.where(second, two, one)
    ahead = jnp.minimum(ahead[0], ahead[1])
    unknown = (ahead == 2.0) & (third < 2.0)
    ahead = jnp.where(unknown, jnp.maximum(third, 0.0), ahead)
    violated, murky = ahead == -1.0, ahead == -0.5
    blocked = (ahead >= 0) & (ahead < 2.0)
    found = blocked & ~unknown & jnp.where(second, roots.found[1], roots.found[0])
    undecided = blocked & ~found
    obstructed = violated | murky | blocked
    first, ahead, violated, murky, found, undecided, obstructed = keep(
        (first, ahead, violated, murky, found, undecided, obstructed), unit
    )

    # the event being located: Newton on the length of the step
    # (the slope comes from a polynomial and may be a per cent off, in stick most of all)
    eps = float(jnp.finfo(trial.starts.dtype).eps)
    tolerance = jnp.clip(0.01 * jnp.sqrt(problem.rtol), 2000 * eps, 1e-3)
    slot = jnp.maximum(state.target, 0)
    value, slope = pick(trial.end_values, slot), pick(trial.end_slopes, slot)
    falling = slope < 0
    # towards a double root the slope dies and Newton's error grows: go on for longer there
    flat = jnp.abs(slope) / jnp.maximum(jnp.abs(pick(trial.starts, slot)), 1e-30)
    tolerance = stop_gradient(tolerance * jnp.minimum(flat, 1.0))
    shift = keep(-value / jnp.where(falling, slope, -1.0), unit)
    close = falling & (jnp.abs(stop_gradient(shift)) <= tolerance)
    # as near as the clock can tell
    tick = 32 * jnp.finfo(trial.h.dtype).eps * jnp.abs(state.time)
    small = (trial.h <= tick) & (jnp.abs(stop_gradient(shift) * trial.h) <= tick)
    located = pending & trial.ok & ~obstructed & ((falling & close) | (small & falling))
    chase = pending & trial.ok & ~obstructed & ~located
    miss = chase & (value > 0) & pick(trial.proved, slot) & (~falling | (jnp.abs(shift) > 0.05))
    lost = chase & ~miss & (~falling | (state.tries >= MAX_TRIES))
    newton = chase & ~miss & ~lost
    located, miss, lost, newton = keep((located, miss, lost, newton), unit)

    accept = trial.ok & ~obstructed & (~pending | miss)
    fire = (trial.ok & violated) | trial.jams
    rejected = ~trial.ok & ~trial.jams & (state.result == RUNNING)

    h = stop_gradient(trial.h)
    dtype = h.dtype
    retarget = trial.ok & found
    target = jnp.where(retarget, first, jnp.where(newton, state.target, -1)).astype(jnp.int32)
    stretch = jnp.clip(1 + stop_gradient(shift), 0.5, 1.5).astype(dtype)
    new_trial = jnp.where(retarget, h * ahead.astype(dtype), h * stretch)
    # a shortened step must not teach the controller: it keeps its own step until one is accepted
    grown = jnp.where(
        trial.lands | pending, jnp.maximum(state.step, trial.next_step), trial.next_step
    )
    step = jnp.where(accept, grown, state.step)
    step = jnp.where(rejected, trial.next_step, step)
    step = jnp.where(trial.ok & murky, 0.25 * h, step)
    step = jnp.where(trial.ok & undecided, h * jnp.maximum(ahead, 0.1).astype(dtype), step)
    step = jnp.where(lost, 0.5 * h, step)

    correction = time_to_event(
        jnp.where(located, shift.astype(dtype) * h, 0.0),
        located,
        trial.end_values,
        problem.system.on_piece(state.piece),
        state.time + trial.h,
        *trial.step.y1,
        state.regime,
        state.sides,
        slot,
    )
    return Plan(
        accept=accept,
        arrive=located,
        fire=fire,
        slot=jnp.where(trial.jams, JAM, jnp.where(fire, first, slot)).astype(jnp.int32),
        correction=correction,
        unproved=(accept | located) & jnp.any(doubtful, axis=0),
        rejected=rejected | lost | (trial.ok & (murky | undecided)),
        step=step,
        target=target,
        trial=new_trial,
        tries=jnp.where(newton, state.tries + 1, 0).astype(jnp.int32),
    )
