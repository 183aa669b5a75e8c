"""Reset maps: the state, regime and guards after an event (MODEL.md sections 5 to 7)."""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp

from ...contact.guards import (
    FIRST,
    contact_sizes,
    first_switch,
    gap_rounding,
    guard_values,
    pressing_size,
)
from ...contact.projection import project
from ...contact.regimes import Forces, acceleration, forces, slip_sign
from ...contact.space import Contact, contact
from ...contact.system import rates
from ...numerics.bernstein import largest
from ...numerics.elementary import smaller
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import Event, Regime
from ..carry.problem import Problem
from ..carry.start import ROUNDINGS
from ..carry.state import State
from ..trial.guard_proof import noise_digits
from .collision import collide, complete
from .event_kind import event_kind, what_fires
from .stop import leave, settle, strike, struck
from .succession import first_order, regime_after


class Outcome(NamedTuple):
    """State just after an event."""

    time: Scalar
    position: tuple
    velocity: tuple
    regime: Scalar
    sides: tuple
    orders: tuple
    sizes: tuple  # of the contact's guards, see `contact_sizes`
    rate: tuple
    guards: tuple
    reactions: Forces
    kind: Scalar
    impulse: Scalar
    bounce: Scalar  # how long a bounce may last, 0 where nothing bounces
    stopped: Scalar  # the end of the model was reached
    indeterminate: Scalar
    inconsistent: Scalar
    struck: Scalar | None  # a stop was; None of a system without one
    presses: Scalar | None  # and is not left


def transition(problem: Problem, state: State, fires, breaks, piece, end) -> Outcome:
    """Return the `Outcome` of the event of slot ``state.due`` (where ``fires``) or of a break.

    Where ``breaks``, a smooth piece of the prescribed motion ends here and ``piece`` begins;
    ``end`` is the next known time, which a completed Zeno sequence must not pass.
    """
    slot, regime, sign = state.due, state.regime, slip_sign(state.regime)
    flips, sides = _switches(problem, state, fires)
    system = problem.system.on_piece(piece).on_sides(sides)
    kinks = reduce(jnp.logical_or, flips, jnp.zeros_like(fires))

    time, q, v = state.time, state.position, state.velocity
    c = contact(system, time, q, v)
    fired = what_fires(system, regime, slot, fires, breaks, kinks, c.slip_speed)
    touching, still = ~fired.was_flying, fired.was_sticking | fired.turns
    q, v = keep(project(system, c, q, v, fired.hits | touching, touching, still))
    if (stop := struck(system, state, fires)) is not None:
        v, fired = strike(system, stop, time, q, v, fired)
    speed = largest(tuple(a / problem.rtol for a in problem.atol[1]))
    before = _landing(contact(system, time, q, v), time == state.last_event, speed)
    motion, blow = collide(system, before, time, q, v, fired, sign)
    motion, completes = complete(problem, system, motion, blow, fired, time - state.last_event, end)
    rough = contact(system, motion.time, motion.position, motion.velocity)
    if stop is not None:
        motion, fired = settle(problem, rough, stop, motion, fired)
    time, q, v, slip_speed, leaving, impulse = motion
    pressing = pressing_size(system, time, q, v)
    trace = noise_digits(pressing.dtype) * pressing
    exact = rough._replace(slip_speed=slip_speed)
    found = regime_after(system, exact, fired, regime, slot, leaving, trace)
    after = found.regime

    # What the impulses leave of a closed contact's speeds is rounding. It goes now: taken away by
    # the first step, through the coupling, it would be a jump of the slip speed in that step.
    in_contact = after != Regime.FLIGHT
    at_rest = in_contact & (slip_speed == 0)
    q, v = keep(project(system, rough, q, v, in_contact, in_contact, at_rest))
    c = contact(system, time, q, v)
    c = c._replace(slip_speed=jnp.where(at_rest, 0.0, c.slip_speed))

    base, orders = first_switch(problem.system), list(state.orders)
    orders[FIRST] = first_order(system, c, fired, found, regime, orders[FIRST])
    for i, flip in enumerate(flips, base):
        orders[i] = jnp.where(flip, 1, orders[i]).astype(jnp.int32)
    stopped = fires & (slot >= base) & ~kinks
    kind = event_kind(fired, found.slips, blow.collides, completes, leaving, sign, after)
    ended = jnp.where(system.reverses(piece - 1), int(Event.BELT_REVERSAL), int(Event.BELT_KINK))
    for condition, name in (
        (kinks, int(Event.KINK)),
        (stopped, int(Event.COLLAPSE)),
        (breaks, ended),
    ):
        kind = jnp.where(condition, name, kind)

    reactions = forces(system, c, after)
    rate, presses = (rates(system, time, q, v), acceleration(c, reactions)), None
    if stop is not None:
        orders, presses = leave(system, stop, orders, time, q, v, rate, fired.was_flying)
        stopped, kind = stopped & ~stop.any, jnp.where(stop.any, int(Event.BLOW), kind)
    return Outcome(
        time=time,
        position=q,
        velocity=v,
        regime=after,
        sides=sides,
        orders=tuple(orders),
        sizes=_sizes(system, c, after, time, q, speed, pressing),
        rate=rate,
        guards=guard_values(system, c, time, q, v, after, sides),
        reactions=reactions,
        kind=kind.astype(jnp.int32),
        impulse=impulse,
        bounce=jnp.where(found.bounces, _bounce(before, c, leaving), 0.0),
        stopped=stopped,
        indeterminate=found.indeterminate,
        inconsistent=found.jammed & (slip_speed == 0),
        struck=None if stop is None else stop.any,
        presses=presses,
    )


def _landing(c: Contact, at_once, speed) -> Contact:
    """Return the contact ``c`` before an impact: one that closes ``at_once`` at no speed, beside
    the typical ``speed``, was never open. A corner just at the lift-off has taken it back. (By its
    speed, the square of a time that the clock does not tell: that of a bounce is as that time.)
    """
    least = (ROUNDINGS * float(jnp.finfo(speed.dtype).eps)) ** 2 * speed
    none = at_once & (jnp.abs(c.normal_speed) <= least)
    return c._replace(normal_speed=jnp.where(none, 0.0, c.normal_speed))


def _bounce(before: Contact, after: Contact, leaving):
    """Return how long a flight with the normal speed ``leaving`` lasts by the free acceleration at
    its top and, to first order, the dashpots: what they add to it is linear in the speed, and known
    on both sides of the blow.
    """
    slope = (after.b_n - before.b_n) / (leaving - smaller(before.normal_speed, 0.0))
    top = after.b_n - slope * leaving
    return jnp.where(top < 0, -2 * leaving / top * (1 - slope * leaving / (3 * top)), 0.0)


def _sizes(system, c: Contact, regime, time, q, speed, pressing) -> tuple[Scalar, ...]:
    """Return what rounding errors of the contact's guards scale with, as a regime begins."""
    sizes = contact_sizes(system, c, regime, jnp.broadcast_to(speed, c.b_t.shape), pressing)
    if system.unilateral:
        gap = gap_rounding(system, time, q) / noise_digits(c.b_t.dtype)
        sizes[FIRST] = jnp.where(regime == Regime.FLIGHT, gap, sizes[FIRST])
    return tuple(sizes)


def _switches(problem: Problem, state: State, fires):
    """Return (which switches flip, the sides they are on then); where the system ends, and at its
    stops, none."""
    base = first_switch(problem.system)
    switched = [fires & (state.due == base + i) for i in range(len(state.sides))]
    before = problem.system.on_piece(state.piece).on_sides(state.sides)
    ends = before.ends(state.time, state.position, state.velocity)
    flips = [s & ~jnp.asarray(end) for s, end in zip(switched, ends, strict=True)]
    for place in problem.system.stops:
        flips[place] = jnp.zeros_like(flips[place])
    sides = tuple(jnp.where(f, -s, s) for f, s in zip(flips, state.sides, strict=True))
    return flips, sides
