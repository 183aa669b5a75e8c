"""Reset maps: the state, regime and guards after an event (docs/model.md, sections 5 to 7)."""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp

from ...contact.guards import FIRST, first_switch, gap_rounding, guard_values
from ...contact.projection import project
from ...contact.regimes import Forces, acceleration, forces, slip_sign, slips, stick_forces
from ...contact.space import Contact, contact
from ...contact.system import rates
from ...numerics.elementary import larger, smaller
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import Event, Regime
from ..carry.problem import Problem
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
    sizes: tuple  # of the contact's guards, see `_sizes`
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
    before = _landing(problem, contact(system, time, q, v), time == state.last_event)
    motion, impact = collide(system, before, time, q, v, fired, sign)
    flown = time - state.last_event
    motion, completes = complete(problem, system, motion, impact, fired, flown, end)
    rough = contact(system, motion.time, motion.position, motion.velocity)
    if stop is not None:
        motion, fired = settle(problem, rough, stop, motion, fired)
    time, q, v, slip_speed, leaving, impulse = motion
    exact, held = rough._replace(slip_speed=slip_speed), larger(*state.reach[:2])
    found = regime_after(system, exact, fired, regime, slot, leaving, held)
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
    kind = event_kind(fired, found.slips, impact.collides, completes, leaving, sign, after)
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
        place = (time, q, v, rate)
        orders, presses = leave(system, stop, orders, state.reach, *place, fired.was_flying)
        stopped, kind = stopped & ~stop.any, jnp.where(stop.any, int(Event.BLOW), kind)
    return Outcome(
        time=time,
        position=q,
        velocity=v,
        regime=after,
        sides=sides,
        orders=tuple(orders),
        sizes=_sizes(problem, system, c, after, time, q),
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


def _landing(problem: Problem, c: Contact, at_once) -> Contact:
    """Return the contact ``c`` before an impact: one that closes ``at_once`` at no speed was never
    open. A corner just at the lift-off has taken it back.
    """
    # the speed of a bounce is as its time, and no clock tells the square of its last digit
    least = problem.least_speed**2 / problem.speed
    none = at_once & (jnp.abs(c.normal_speed) <= least)
    return c._replace(normal_speed=jnp.where(none, 0.0, c.normal_speed))


def _bounce(before: Contact, after: Contact, leaving):
    """Return how long a flight with the normal speed ``leaving`` lasts by the free acceleration at
    its top and, to first order, the dashpots: what they add to it is linear in the speed, and known
    on both sides of the impact.
    """
    slope = (after.b_n - before.b_n) / (leaving - smaller(before.normal_speed, 0.0))
    top = after.b_n - slope * leaving
    return jnp.where(top < 0, -2 * leaving / top * (1 - slope * leaving / (3 * top)), 0.0)


def _sizes(problem: Problem, system, c: Contact, regime, time, q) -> tuple[Scalar, ...]:
    """Return what rounding errors of the contact's guards scale with, as a regime begins: in stick
    the load on the cone, in slip the typical speed, in flight what the gap is the difference of. A
    pressing force that starts from zero has none but what it grows to.
    """
    zero = cone = jnp.zeros_like(c.b_t)
    if system.law is not None:
        cone = jnp.abs(system.law.static * stick_forces(c, system.unilateral).normal)
    cone = jnp.where(regime == Regime.STICK, cone, zero)
    first = jnp.where(slips(regime), problem.speed, cone)
    if system.unilateral:
        gap = gap_rounding(system, time, q) / noise_digits(c.b_t.dtype)
        first = jnp.where(regime == Regime.FLIGHT, gap, first)
    return (first, cone) + (zero,) * (first_switch(system) - 2)


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
