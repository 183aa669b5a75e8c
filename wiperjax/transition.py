"""Reset maps: the state, regime and guards after an event (MODEL.md sections 5 to 7)."""

from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp

from .barrier import keep
from .guards import FIRST, JAM, SECOND, contact_sizes, first_switch, guard_values
from .impact import poisson_impact
from .polynomials import largest
from .regimes import Forces, acceleration, decide, forces, slip_forces, slip_sign
from .results import Event, Regime
from .sparse import absent, plus, times
from .state import Problem, State, start_of_slip_order
from .system import Contact, Scalar, contact, rates


def where(condition, a, b):
    """`jnp.where` over pytrees."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


def push(vector, along_t, along_n, p_t, p_n):
    """Add contact impulses (or their position-level equal) to a tuple of coordinates."""
    parts = zip(vector, along_t, along_n, strict=True)
    return tuple(plus(x, times(t, p_t), times(n, p_n)) for x, t, n in parts)


def settle(system, c: Contact, q, v, closed, touching, sticking):
    """Project a state back onto its constraints, against drift by rounding.

    The gap is zero where ``closed``, the normal speed where ``touching``, the slip speed where
    ``sticking``; the steps are along A^-1 J^T, so that no other direction is disturbed.
    """
    if system.unilateral:
        q = push(q, c.along_t, c.along_n, 0.0, jnp.where(closed, -c.gap / c.w_nn, 0.0))
        v_n = jnp.where(touching, c.normal_speed, 0.0)
    else:
        v_n = jnp.zeros_like(c.b_t)
    if system.law is None:
        return q, push(v, c.along_t, c.along_n, 0.0, -v_n / c.w_nn)
    v_t = jnp.where(sticking, c.slip_speed, 0.0)
    if absent(c.w_tn):
        return q, push(v, c.along_t, c.along_n, -v_t / c.w_tt, -v_n / c.w_nn)
    det = c.w_tt * c.w_nn - c.w_tn * c.w_tn
    # outside stick only the normal impulse is free
    p_t = jnp.where(sticking, (c.w_tn * v_n - c.w_nn * v_t) / det, 0.0)
    p_n = jnp.where(sticking, (c.w_tn * v_t - c.w_tt * v_n) / det, -v_n / c.w_nn)
    return q, push(v, c.along_t, c.along_n, p_t, p_n)


LONGEST = 100  # in units of the shortest flight: what the limit of a sequence may take the place of
NEUTRAL = 1e-9  # relative growth of a bounce that is taken for rounding (e = 1)


class Completion(NamedTuple):
    """Finite limit of an accumulating sequence of impacts."""

    holds: Scalar
    duration: Scalar
    tangential: Scalar  # remaining impulses
    normal: Scalar
    slip_speed: Scalar


def complete_zeno(c: Contact, mu, leaving, approaching, slip_speed, zeno_time, time_left):
    """Return the limit of a bounce sequence, where it is due (MODEL.md section 6).

    ``leaving`` and ``approaching`` are the normal speeds after and before this impact: their ratio
    r is that of successive take-off speeds while b_n hardly changes. The next flight lasts
    t1 = 2 v_n / |b_n|; the rest of the sequence t1 / (1 - r), with the normal impulse that brings
    v_n to zero against b_n, and the matching change of v_t, which friction cannot carry past zero.

    A rest longer than `LONGEST`, or without end (r = 1), is bounces that cannot be told from
    contact: their mean force is that of contact, and it changes meanwhile, which the limit knows
    nothing of. Then the next flight is the last, and the speed that is dropped is what b_n makes
    in half of ``zeno_time``.
    """
    ratio = leaving / jnp.where(approaching < 0, -approaching, 1.0)
    falls = c.b_n < 0
    flight = 2 * leaving / jnp.where(falls, -c.b_n, 1.0)
    dies = (leaving > 0) & falls & (ratio <= 1 + NEUTRAL)
    whole = flight / jnp.where(ratio < 1, 1 - ratio, jnp.inf)
    ends = (ratio < 1) & (whole <= LONGEST * zeno_time)
    duration = jnp.where(ends, whole, flight)
    holds = dies & (flight < zeno_time) & (duration <= time_left)

    sign = jnp.sign(slip_speed)
    d = c.w_nn - sign * mu * c.w_tn
    normal = (-leaving - c.b_n * duration) / d
    change = c.b_t * duration + (c.w_tn - sign * mu * c.w_tt) * normal
    after = slip_speed + change
    stops = (sign * after <= 0) | (sign == 0)
    # where slip ends on the way, both speeds vanish: W p = -(v + b T)
    frictional = c.w_tt > 0
    det = jnp.where(frictional, c.w_tt * c.w_nn - c.w_tn * c.w_tn, 1.0)
    lack_t, lack_n = -slip_speed - c.b_t * duration, -leaving - c.b_n * duration
    stopping = (c.w_nn * lack_t - c.w_tn * lack_n) / det
    normal = jnp.where(stops & frictional, (c.w_tt * lack_n - c.w_tn * lack_t) / det, normal)
    tangential = jnp.where(stops, stopping, -sign * mu * normal)
    tangential = jnp.where(frictional, tangential, 0.0)
    return Completion(holds, duration, tangential, normal, jnp.where(stops, 0.0, after))


def brake_to_jam(system, c: Contact, sign, mu):
    """Return the impulses (tangential, normal) that carry slip the last bit to D = 0, and mu there.

    Steps end just before D = 0, at D > 0 (see `trial`); the rest takes no time: v_t falls at a
    fixed position until D(v_t) vanishes. Nothing where D <= 0 already.
    """
    speed = jnp.abs(c.slip_speed)
    target = speed
    for _ in range(3):
        value, slope = jax.jvp(system.law.coefficient, (target,), (jnp.ones_like(target),))
        d, rate = c.w_nn - sign * value * c.w_tn, -sign * slope * c.w_tn
        down = (d > 0) & (rate > 0)
        target = jnp.clip(target - jnp.where(down, d / jnp.where(down, rate, 1.0), 0.0), 0.0, speed)
    slowing = c.w_tt * mu - sign * c.w_tn  # loss of speed per normal impulse
    normal = (speed - target) / jnp.where(slowing > 0, slowing, jnp.inf)
    at_jam = jnp.where(normal > 0, system.law.coefficient(target), mu)
    return (-sign * mu * normal, normal), at_jam


class Outcome(NamedTuple):
    """State just after an event."""

    time: Scalar
    position: tuple
    velocity: tuple
    regime: Scalar
    sides: tuple
    orders: tuple
    sizes: tuple  # of the guards, see `contact_sizes`
    rate: tuple
    guards: tuple
    reactions: Forces
    kind: Scalar
    impulse: Scalar
    stopped: Scalar  # the end of the model was reached
    indeterminate: Scalar
    inconsistent: Scalar


def transition(problem: Problem, state: State, fires, breaks, piece, end) -> Outcome:
    """Return the `Outcome` of the event of slot ``state.due`` (where ``fires``) or of a break.

    Where ``breaks``, a smooth piece of the prescribed motion ends here and ``piece`` begins;
    ``end`` is the next known time, which a completed Zeno sequence must not pass.
    """
    time, q, v, slot = state.time, state.position, state.velocity, state.due
    base = first_switch(problem.system)
    switched = [fires & (slot == base + i) for i in range(len(state.sides))]
    before = problem.system.on_piece(state.piece).on_sides(state.sides)
    ends = before.ends(time, q, v)
    flips = [s & ~jnp.asarray(end) for s, end in zip(switched, ends, strict=True)]
    sides = tuple(jnp.where(f, -s, s) for f, s in zip(flips, state.sides, strict=True))
    system = problem.system.on_piece(piece).on_sides(sides)
    law, unilateral = system.law, system.unilateral
    regime, sign = state.regime, slip_sign(state.regime)
    flying, sticking = regime == Regime.FLIGHT, regime == Regime.STICK
    sliding = ~flying & ~sticking

    hits = fires & flying & (slot == FIRST)
    turns = fires & sliding & (slot == FIRST)
    leaves_cone = fires & sticking & (slot <= SECOND)
    lifts = fires & sliding & (slot == SECOND)
    jams = fires & sliding & (slot == JAM) & system.coupled
    retest = breaks & sticking
    hits, turns, leaves_cone, lifts, jams, retest = keep(
        (hits, turns, leaves_cone, lifts, jams, retest),
    )

    c = contact(system, time, q, v)
    q, v = keep(settle(system, c, q, v, hits | ~flying, ~flying, sticking | turns))
    c = contact(system, time, q, v)

    # impact: the closing gap, or a jam (Painleve's impact without collision)
    moving = c.slip_speed != 0
    mu = jnp.zeros_like(c.b_t)
    if law is not None:
        mu = jnp.where(moving, law.coefficient(jnp.abs(c.slip_speed)), jnp.asarray(law.static))
    if system.coupled:
        braked, mu = brake_to_jam(system, c, sign, mu)
        v = where(jams, push(v, c.along_t, c.along_n, *braked), v)
        c = c._replace(
            slip_speed=jnp.where(
                jams,
                plus(c.slip_speed, c.w_tt * braked[0], times(c.w_tn, braked[1])),
                c.slip_speed,
            )
        )
    approach = jnp.where(jams, 0.0, c.normal_speed)
    collides = (hits & (approach < 0)) | jams
    blow = poisson_impact(
        c.w_tt,
        c.w_tn,
        c.w_nn,
        mu,
        system.bounce,
        c.slip_speed,
        jnp.minimum(approach, 0.0),
        jams,
    )
    blow = keep(blow)
    v = where(collides, push(v, c.along_t, c.along_n, blow.tangential, blow.normal), v)
    impulse = jnp.where(collides, blow.normal, 0.0)
    slip_speed = jnp.where(
        collides, blow.slip_speed, jnp.where(sticking | turns, 0.0, c.slip_speed)
    )
    leaving = jnp.where(collides, blow.normal_speed, jnp.where(hits, c.normal_speed, 0.0))
    v, slip_speed, leaving, collides = keep((v, slip_speed, leaving, collides))

    # forces after the impact are those of the post-impact velocities
    c = contact(system, time, q, v)._replace(slip_speed=slip_speed)
    zeno = complete_zeno(
        c, mu, leaving, approach, slip_speed, problem.zeno_time, (end - time).astype(leaving.dtype)
    )
    zeno = keep(zeno)
    completes = keep(hits & collides & zeno.holds)
    rest_of_flight = tuple(x + a * zeno.duration for x, a in zip(v, c.free, strict=True))
    landed = push(rest_of_flight, c.along_t, c.along_n, zeno.tangential, zeno.normal)
    carried = tuple(
        x + zeno.duration * plus(y, times(n, -leaving / c.w_nn))
        for x, y, n in zip(q, rates(system, time, q, v), c.along_n, strict=True)
    )
    q, v = where(completes, carried, q), where(completes, landed, v)
    time = jnp.where(completes, time + zeno.duration, time)
    impulse = impulse + jnp.where(completes, zeno.normal, 0.0)
    slip_speed = jnp.where(completes, zeno.slip_speed, slip_speed)
    q, v, time, slip_speed = keep((q, v, time, slip_speed))
    rough = contact(system, time, q, v)
    c = rough._replace(slip_speed=slip_speed)

    # the regime, at acceleration level
    leaving = jnp.where(completes, 0.0, leaving)
    bounces = (hits | jams) & (leaving > 0)
    closes = (hits | jams) & ~bounces
    decision = keep(decide(system, c))
    undecided = closes | turns | retest
    escape = jnp.where(slot == FIRST, -1, 1)  # friction at its upper limit pushes the tip to +x
    mu_static = jnp.zeros_like(c.b_t) if law is None else law.coefficient(jnp.zeros_like(c.b_t))
    released, d = slip_forces(c, escape, mu_static, unilateral)
    slips = (released.normal > 0) & (d > 0)
    slips, undecided, bounces, leaving = keep((slips, undecided, bounces, leaving))
    after = jnp.where(undecided, decision.regime, regime)
    after = jnp.where(bounces | lifts, int(Regime.FLIGHT), after)
    slip_regime = jnp.where(escape > 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    after = jnp.where(leaves_cone, jnp.where(slips, slip_regime, int(Regime.FLIGHT)), after)
    # D <= 0 under load while sliding: kept as slip, whose JAM guard then fires at once
    jammed = undecided & decision.jam
    sliding_on = jnp.where(slip_speed > 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    after = jnp.where(jammed & (slip_speed != 0), sliding_on, after).astype(jnp.int32)
    after = keep(after)

    # What the impulses leave of a closed contact's speeds is rounding. It goes now: taken away by
    # the first step, through the coupling, it would be a jump of the slip speed in that step.
    in_contact = after != Regime.FLIGHT
    at_rest = in_contact & (slip_speed == 0)
    q, v = keep(settle(system, rough, q, v, in_contact, in_contact, at_rest))
    c = contact(system, time, q, v)
    c = c._replace(slip_speed=jnp.where(at_rest, 0.0, c.slip_speed))

    # guards that start at zero by construction
    into_flight = (after == Regime.FLIGHT) & (hits | jams | turns | leaves_cone | lifts | retest)
    flight_order = jnp.where(lifts | leaves_cone, 3, jnp.where(bounces, 1, 2))
    in_slip = (after == Regime.SLIP_POS) | (after == Regime.SLIP_NEG)
    into_slip = in_slip & (slip_speed == 0) & (undecided | leaves_cone)
    orders = list(state.orders)
    orders[FIRST] = jnp.where(
        into_flight,
        flight_order,
        jnp.where(
            into_slip,
            start_of_slip_order(system, c, after),
            jnp.where(after == regime, orders[FIRST], 0),
        ),
    ).astype(jnp.int32)
    for i, flip in enumerate(flips):
        orders[base + i] = jnp.where(flip, 1, orders[base + i]).astype(jnp.int32)
    kinks = reduce(jnp.logical_or, flips, jnp.zeros_like(fires))
    stopped = fires & (slot >= base) & ~kinks

    speed = largest(tuple(a / problem.rtol for a in problem.atol[1]))
    speed = jnp.broadcast_to(speed, c.b_t.shape)
    sizes = contact_sizes(system, c, after, speed)
    sizes += [jnp.zeros_like(c.b_t)] * (len(orders) - len(sizes))
    reactions = forces(system, c, after)
    rate = (rates(system, time, q, v), acceleration(c, reactions))
    guards = guard_values(system, c, time, q, v, after, sides)
    touch = jnp.where(leaving > 0, int(Event.IMPACT), int(Event.TOUCH))
    turn_kind = jnp.where(
        after == Regime.STICK,
        int(Event.CAPTURE),
        jnp.where(
            after == Regime.FLIGHT,
            int(Event.LIFT_OFF),
            jnp.where(slip_sign(after) == -sign, int(Event.REVERSAL), int(Event.TOUCH)),
        ),
    )
    hit_kind = jnp.where(collides, int(Event.IMPACT), touch)
    hit_kind = jnp.where(completes, int(Event.ZENO), hit_kind)
    kind = jnp.zeros_like(state.regime)
    table = (
        (hits, hit_kind),
        (turns, turn_kind),
        (leaves_cone, jnp.where(slips, int(Event.RELEASE), int(Event.LIFT_OFF))),
        (lifts, int(Event.LIFT_OFF)),
        (jams, int(Event.JAM)),
        (kinks, int(Event.KINK)),
        (stopped, int(Event.COLLAPSE)),
        (
            breaks,
            jnp.where(system.reverses(piece - 1), int(Event.BELT_REVERSAL), int(Event.BELT_KINK)),
        ),
    )
    for condition, name in table:
        kind = jnp.where(condition, name, kind)
    return Outcome(
        time=time,
        position=q,
        velocity=v,
        regime=after,
        sides=sides,
        orders=tuple(orders),
        sizes=tuple(sizes),
        rate=rate,
        guards=guards,
        reactions=reactions,
        kind=kind.astype(jnp.int32),
        impulse=impulse,
        stopped=stopped,
        indeterminate=undecided & decision.indeterminate,
        inconsistent=jammed & (slip_speed == 0),
    )
