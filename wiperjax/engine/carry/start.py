"""The loop state at the start of a trajectory."""

import jax
import jax.numpy as jnp

from ...contact.guards import first_switch, guard_values, start_of_slip_order, starting_sides
from ...contact.projection import settle
from ...contact.regimes import acceleration, decide, forces
from ...contact.space import contact
from ...contact.system import rates
from ...numerics.arrays import where
from ...numerics.bernstein import largest
from ...vocabulary.codes import RUNNING, Regime, Result
from .recall import nothing
from .state import EventLog, Problem, State

ROUNDINGS = 64  # last digits of the typical speed below which a contact is at rest


def _no_rest(position: tuple, velocity: tuple):
    """Nothing left out by rounding yet; not followed in float64, far below any tolerance there."""
    if position[0].dtype == jnp.float64:
        return None
    return jax.tree.map(jnp.zeros_like, (position, velocity))


def _contact(problem: Problem, system, start, position: tuple, velocity: tuple):
    """Return the velocity and the contact of a start: at rest where it slips by rounding only.

    sin(pi) is 1e-16, not zero: a belt that turns round at the start would leave the tip a slip
    speed, whose sign alone, by Painleve, may throw it off the glass into bounces of 1e-22 s.
    """
    c = contact(system, start, position, velocity)
    eps = float(jnp.finfo(position[0].dtype).eps)
    speed = largest(tuple(a / problem.rtol for a in problem.atol[1]))
    rests = (c.normal_speed == 0) & (jnp.abs(c.slip_speed) <= ROUNDINGS * eps * speed)
    if system.unilateral:
        rests = rests & (c.gap <= 0)
    _, still = settle(system, c, position, velocity, False, rests, rests)
    still = where(rests & (c.slip_speed != 0), still, velocity)
    c = contact(system, start, position, still)
    # to the last digit, which the projection leaves
    zero = [jnp.where(rests, 0.0, x) for x in (c.normal_speed, c.slip_speed)]
    return still, c._replace(normal_speed=zero[0], slip_speed=zero[1])


def initial_state(problem: Problem, position: tuple, velocity: tuple, start) -> State:
    """Return the loop state at ``start``: regime, sides of the switches and a first step size.

    ``velocity`` is q'; the state holds what the system computes with (`AbstractSystem.rates`).
    """
    system = problem.system
    piece = jnp.zeros_like(start, jnp.int32) + jnp.asarray(system.first_piece(start), jnp.int32)
    local = system.on_piece(piece)
    velocity = tuple(
        jnp.asarray(x, p.dtype)
        for x, p in zip(local.from_rates(start, position, velocity), position, strict=True)
    )
    velocity, c = _contact(problem, local, start, position, velocity)
    z, no = jnp.zeros_like(start, jnp.int32), jnp.zeros_like(start, bool)

    if system.unilateral:
        size = jnp.max(jnp.abs(jnp.stack(position)), axis=0)
        inside = c.gap < -1e-12 * jnp.maximum(size, 1e-30)
        closed = (c.gap <= 0) & (c.normal_speed == 0)
    else:
        inside, closed = no, ~no
    decision = decide(local, c)
    at_rest = c.slip_speed == 0
    # a jam while sliding is resolved by the impact without collision: start it as slip
    jam = closed & decision.jam
    slip = jnp.where(c.slip_speed >= 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    regime = jnp.where(closed, jnp.where(jam & ~at_rest, slip, decision.regime), int(Regime.FLIGHT))
    regime = regime.astype(jnp.int32)
    inconsistent = inside | (jam & at_rest)
    start_code = jnp.where(inconsistent, int(Result.INCONSISTENT_START), RUNNING)

    flying = regime == Regime.FLIGHT
    sliding = ~flying & (regime != Regime.STICK)
    first_order = jnp.where(
        flying & (c.gap <= 0) & (c.normal_speed >= 0),
        jnp.where(c.normal_speed > 0, 1, 2),
        jnp.where(sliding & at_rest, start_of_slip_order(local, c, regime), 0),
    ).astype(jnp.int32)
    sides = starting_sides(local, start, position, velocity)
    dtype = position[0].dtype
    slots = first_switch(system) + len(sides)
    orders = (first_order, *[jnp.zeros_like(first_order)] * (slots - 1))

    local = local.on_sides(sides)
    c = contact(local, start, position, velocity)
    reactions = forces(local, c, regime)
    rate = (rates(local, start, position, velocity), acceleration(c, reactions))
    guards = guard_values(local, c, start, position, velocity, regime, sides)
    pairs = zip(
        jax.tree.leaves(rate),
        jax.tree.leaves((position, velocity)),
        jax.tree.leaves(problem.atol),
        strict=True,
    )
    speed = jnp.max(
        jnp.stack([jnp.abs(f) / (a / problem.rtol + jnp.abs(y) + 1e-30) for f, y, a in pairs]),
        axis=0,
    )
    finite = jnp.isfinite(start) & jnp.isfinite(problem.end)
    for leaf in jax.tree.leaves((position, velocity, rate)):
        finite = finite & jnp.isfinite(leaf)
    for tolerance in (problem.rtol, *jax.tree.leaves(problem.atol)):  # traced: seen by nobody else
        finite = finite & (tolerance > 0) & (tolerance < jnp.inf)
    span = problem.end - start
    step = jnp.clip(0.01 / jnp.maximum(speed, 1e-30), 1e-9 * span, 0.1 * span)
    step = jax.lax.stop_gradient(step).astype(start.dtype)

    n = problem.log_capacity
    log = EventLog(
        jnp.full((n, *start.shape), jnp.nan, start.dtype),
        jnp.zeros((n, *start.shape), jnp.int8),
        jnp.full((n, *start.shape), -1, jnp.int8),
        jnp.full((n, *start.shape), -1, jnp.int8),
        jnp.zeros((n, *start.shape), dtype),
        z,
    )
    return State(
        time=start,
        position=position,
        velocity=velocity,
        rest=_no_rest(position, velocity),
        regime=regime,
        piece=piece,
        sides=sides,
        orders=orders,
        reach=tuple(jnp.abs(g) for g in guards),
        due=z - 1,
        rate=rate,
        guards=guards,
        reactions=reactions,
        step=step,
        memory=nothing(start, step),
        last_event=start,
        last_error=jnp.ones_like(position[0]),
        last_step=jnp.zeros_like(step),
        target=z - 1,
        trial=step,
        tries=z,
        result=jnp.where(finite, start_code, int(Result.NON_FINITE)).astype(jnp.int32),
        flagged=closed & decision.indeterminate,
        attempts=z,
        rejected=z,
        unproved=z,
        streak=z,
        paced_time=jnp.full_like(start, -jnp.inf),
        events=z,
        log=log,
        sample_index=z,
        samples=None,
        full=no,
        observed=problem.observer.init(dtype, start.shape),
    )
