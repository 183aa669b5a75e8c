"""The loop state at the start of a trajectory."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import (
    FIRST,
    SECOND,
    first_switch,
    gap_rounding,
    guard_values,
    parts,
    start_of_slip_order,
    starting_sides,
    stop_slots,
)
from ...contact.projection import project
from ...contact.regimes import ROUNDINGS, acceleration, decide, forces, pulls
from ...contact.space import Contact, contact
from ...contact.system import rates
from ...numerics.bernstein import largest
from ...numerics.elementary import larger, smaller
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import RUNNING, Regime, Result
from .problem import Problem
from .recall import nothing
from .state import EventLog, State

AHEAD = 1e-3  # of the first step: when what is about to press is seen
DRIFT = 1e-8  # last digits of a place: a gap so small is that of a contact


def _no_rest(position: tuple, velocity: tuple):
    """Nothing left out by rounding yet; not followed in float64, far below any tolerance there."""
    if position[0].dtype == jnp.float64:
        return None
    return jax.tree.map(jnp.zeros_like, (position, velocity))


def _contact(problem: Problem, system, start, position: tuple, velocity: tuple):
    """Return the velocity and the contact of a start: closed where it is open, or moves apart, by
    rounding only, and at rest where it slips by that.

    sin(pi) is 1e-16, not zero: a belt that turns round at the start would leave the tip a slip
    speed, whose sign alone, by Painleve, may throw it off the glass into bounces of 1e-22 s; and a
    gap between large numbers, such as that of a leaning rod, is hardly ever 0 where it is meant.
    Values alone are rounded: speeds that are zero here keep their derivatives.
    """
    c = contact(system, start, position, velocity)
    least = problem.least_speed
    closed = jnp.abs(c.normal_speed) <= least
    if system.unilateral:
        # a motion that ends in contact leaves a gap of 1e-33 m and less behind
        eps = float(jnp.finfo(position[0].dtype).eps)
        tiny = DRIFT * eps * largest((*map(jnp.abs, position), *system.scales(len(position))[0]))
        closed = closed & (c.gap <= larger(gap_rounding(system, start, position), tiny))
    rests = closed & (jnp.abs(c.slip_speed) <= least)
    rounding = c._replace(
        normal_speed=stop_gradient(c.normal_speed), slip_speed=stop_gradient(c.slip_speed)
    )
    _, still = project(system, rounding, position, velocity, False, closed, rests)
    c = contact(system, start, position, still)
    # to the last digit, which the projection leaves
    return still, c._replace(
        gap=jnp.where(closed, smaller(c.gap, 0.0), c.gap),
        normal_speed=jnp.where(closed, _nil(c.normal_speed), c.normal_speed),
        slip_speed=jnp.where(rests, _nil(c.slip_speed), c.slip_speed),
    )


def _nil(value):
    """Return zero, with the derivative of ``value``."""
    return value - stop_gradient(value)


class _Forces(NamedTuple):
    """The contact of a start as its forces see it."""

    idle: Scalar  # nothing presses it or pulls at it yet
    now: Contact  # exactly so, where it is so to rounding
    soon: Contact  # with a trace of what is about to


def _forces(problem: Problem, system, c: Contact, start, position, velocity) -> _Forces:
    """Return how a contact ``c`` is loaded, if it is closed.

    A load that grows from zero holds from the first instant on, and which force leads then its
    rates tell: those of the free motion, for nothing acts on it yet.
    """
    if not system.unilateral:
        return _Forces(jnp.zeros_like(c.b_n, bool), c, c)
    motion, rate = (position, velocity), (rates(system, start, position, velocity), c.free)
    ahead = AHEAD * _first_step(problem, start, motion, rate)
    moved = jax.tree.map(lambda x, y: x + ahead.astype(x.dtype) * y, motion, rate)
    then = contact(system, start + ahead, *moved)
    # forces that cancel show their size where they do not: at rest
    still = contact(system, start, position, jax.tree.map(jnp.zeros_like, velocity))
    eps = float(jnp.finfo(position[0].dtype).eps)
    drive = ROUNDINGS * eps * sum(jnp.abs(a) for a in (*c.free, *then.free, *still.free))
    idle = jnp.abs(c.b_n) <= drive
    b_t = jnp.where(idle & (jnp.abs(c.b_t) <= drive), 0.0, c.b_t)
    now = c._replace(b_t=b_t, b_n=jnp.where(idle, 0.0, c.b_n))
    soon = now._replace(
        b_t=jnp.where(idle, b_t + eps * (then.b_t - c.b_t), b_t),
        b_n=jnp.where(idle, eps * (then.b_n - c.b_n), c.b_n),
    )
    return _Forces(idle, now, soon)


class _Entry(NamedTuple):
    """The regime a trajectory begins in."""

    regime: Scalar
    order: Scalar  # of the zero with which the first guard begins
    code: Scalar  # `RUNNING`, or why it cannot begin
    flagged: Scalar  # the regime is not the only one


def _entry(system, found: _Forces, start, position) -> _Entry:
    """Return how a trajectory begins: decided at acceleration level where its contact is closed."""
    c = found.now
    if system.unilateral:
        size = largest((*position, *system.scales(len(position))[0]))
        inside = c.gap < -larger(1e-12 * size, gap_rounding(system, start, position))
        closed = (c.gap <= 0) & (c.normal_speed == 0)
    else:
        inside = jnp.zeros_like(c.b_t, bool)
        closed = ~inside
    decision = decide(system, found.soon)
    at_rest = c.slip_speed == 0
    # a jam while sliding is resolved by the impact without collision: start it as slip
    jam = closed & decision.jam
    slip = jnp.where(c.slip_speed >= 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    regime = jnp.where(closed, jnp.where(jam & ~at_rest, slip, decision.regime), int(Regime.FLIGHT))
    regime = regime.astype(jnp.int32)
    code = jnp.where(inside | (jam & at_rest), int(Result.INCONSISTENT_START), RUNNING)

    flying = regime == Regime.FLIGHT
    sliding = ~flying & (regime != Regime.STICK)
    order = jnp.where(
        flying & (c.gap <= 0) & (c.normal_speed >= 0),
        jnp.where(c.normal_speed > 0, 1, jnp.where(found.idle, 3, 2)),
        jnp.where(sliding & at_rest, start_of_slip_order(system, c, regime, False), 0),
    ).astype(jnp.int32)
    return _Entry(regime, order, code, closed & decision.indeterminate)


def _first_step(problem: Problem, start, motion, rate) -> Scalar:
    """Return a hundredth of the shortest time in which a coordinate changes by its scale."""
    leaves = (jax.tree.leaves(tree) for tree in (rate, motion, problem.atol))
    speeds = [
        jnp.abs(f) / (a / problem.rtol + jnp.abs(y) + 1e-30)
        for f, y, a in zip(*leaves, strict=True)
    ]
    speed = jnp.max(jnp.stack(speeds), axis=0)
    span = problem.end - start
    step = jnp.clip(0.01 / jnp.maximum(speed, 1e-30), 1e-9 * span, 0.1 * span)
    return jax.lax.stop_gradient(step).astype(start.dtype)


def _is_finite(problem: Problem, start, motion, rate) -> Scalar:
    """Whether a trajectory can be integrated from here, to an end that is not before it, tolerances
    included: traced, they were seen by nobody else.
    """
    finite = jnp.isfinite(start) & jnp.isfinite(problem.end) & (problem.end >= start)
    for leaf in jax.tree.leaves((motion, rate)):
        finite = finite & jnp.isfinite(leaf)
    for tolerance in (problem.rtol, *jax.tree.leaves(problem.atol)):
        finite = finite & (tolerance > 0) & (tolerance < jnp.inf)
    return finite


def _reach(system, start, position: tuple, velocity: tuple, guards: list) -> tuple[Scalar, ...]:
    """Return what rounding errors of the guards scale with: of a switch that all but vanishes with
    what it is the difference of."""
    n, first = len(position), first_switch(system)
    sizes = parts(lambda t, *y: system.switches(t, y[:n], y[n:]), start, *position, *velocity)
    own = tuple(map(jnp.abs, guards))
    return (*own[:first], *map(larger, own[first:], sizes))


def _empty_log(capacity: int, start, dtype) -> EventLog:
    shape = (capacity, *start.shape)
    return EventLog(
        time=jnp.full(shape, jnp.nan, start.dtype),
        kind=jnp.zeros(shape, jnp.int8),
        before=jnp.full(shape, -1, jnp.int8),
        after=jnp.full(shape, -1, jnp.int8),
        impulse=jnp.zeros(shape, dtype),
        count=jnp.zeros_like(start, jnp.int32),
    )


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
    found = _forces(problem, local, c, start, position, velocity)
    entry = _entry(local, found, start, position)
    # what begins in contact stays on it, and in stick at rest, whatever a parameter does to its
    # speeds: a change of their derivatives alone
    touching, sticking = entry.regime != Regime.FLIGHT, entry.regime == Regime.STICK
    _, velocity = keep(project(local, c, position, velocity, False, touching, sticking))
    sides = starting_sides(local, start, position, velocity)
    switches = first_switch(system) + len(sides) - 1

    local = local.on_sides(sides)
    c = contact(local, start, position, velocity)
    reactions = forces(local, c, entry.regime)
    rate = (rates(local, start, position, velocity), acceleration(c, reactions))
    guards = list(guard_values(local, c, start, position, velocity, entry.regime, sides))
    # a load that is rounding would end the regime that what is about to press has begun
    for slot, rests_on_it in ((FIRST, sticking), (SECOND, touching)):
        guards[slot] = jnp.where(found.idle & rests_on_it, 0.0, guards[slot])
    motion = (position, velocity)
    step = _first_step(problem, start, motion, rate)
    finite = _is_finite(problem, start, motion, rate)
    code = entry.code
    if not system.unilateral:  # rounding is nothing beside the load a step later
        h = step.astype(position[0].dtype)
        later = jax.tree.map(lambda x, f: x + h * f, motion, rate)
        pulled = pulls(system, (contact(local, start + step, *later).load, c.load))
        code = jnp.where(pulled, int(Result.NO_CONSISTENT_REGIME), code)
    for slot in stop_slots(system):
        code = jnp.where(guards[slot] < 0, int(Result.INCONSISTENT_START), code)

    dtype = position[0].dtype
    z, no = jnp.zeros_like(start, jnp.int32), jnp.zeros_like(start, bool)
    return State(
        time=start,
        position=position,
        velocity=velocity,
        rest=_no_rest(position, velocity),
        regime=entry.regime,
        piece=piece,
        sides=sides,
        orders=(entry.order, *[jnp.zeros_like(entry.order)] * switches),
        reach=_reach(local, start, position, velocity, guards),
        due=z - 1,
        rate=rate,
        guards=tuple(guards),
        reactions=reactions,
        step=step,
        memory=nothing(start, step),
        last_event=start,
        last_error=jnp.ones_like(position[0]),
        last_step=jnp.zeros_like(step),
        target=z - 1,
        trial=step,
        tries=z,
        result=jnp.where(finite, code, int(Result.NON_FINITE)).astype(jnp.int32),
        flagged=entry.flagged,
        attempts=z,
        rejected=z,
        unproved=z,
        streak=z,
        paced_time=jnp.full_like(start, -jnp.inf),
        events=z,
        log=_empty_log(problem.log_capacity, start, dtype),
        sample_index=z,
        samples=None,
        full=no,
        observed=problem.observer.init(dtype, start.shape),
    )
