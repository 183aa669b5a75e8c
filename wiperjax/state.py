"""What a trajectory carries through the event loop, and what it is asked to do."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .guards import first_switch, guard_values, starting_sides
from .observers import AbstractObserver
from .recall import Memory, nothing
from .regimes import Forces, acceleration, decide, forces, slip_sign
from .results import RUNNING, Regime, Result
from .sparse import plus, times
from .system import AbstractSystem, Contact, Scalar, contact, rates

BREAK = 1000  # in place of a slot: a smooth piece of the prescribed motion ends


class Problem(eqx.Module):
    """One trajectory to compute: the system, the tolerances, and what to keep."""

    system: AbstractSystem
    end: Scalar
    rtol: Scalar
    atol: tuple  # (positions, velocities), one value a coordinate
    max_step: Scalar  # from `mark` on
    zeno_time: Scalar
    max_steps: Scalar
    mark: Scalar  # a time to be stepped onto exactly (start of observation)
    observer: AbstractObserver
    sample_times: jax.Array | None  # increasing
    signal: Any  # an `averaging.Signal`, or None
    solver: diffrax.AbstractERK = eqx.field(static=True)
    record: Callable = eqx.field(static=True)  # (system, t, q, v, regime, forces) -> pytree
    log_capacity: int = eqx.field(static=True, default=0)
    pause_when_full: bool = eqx.field(static=True, default=False)
    log_start: float = eqx.field(static=True, default=-math.inf)  # time of the first event logged


class EventLog(NamedTuple):
    """The first ``capacity`` events, (capacity, lanes), and how many there were: ``count`` goes on
    past the capacity, so nothing is lost unnoticed.
    """

    time: jax.Array
    kind: jax.Array
    before: jax.Array
    after: jax.Array
    impulse: jax.Array
    count: Scalar


class State(NamedTuple):
    """The loop carry of one trajectory, or of a batch (lanes last)."""

    # evolving
    time: Scalar
    position: tuple
    velocity: tuple
    rest: Any  # what rounding has left out of both, as (positions, velocities); None in float64
    regime: Scalar
    piece: Scalar  # smooth piece of the prescribed motion
    sides: tuple  # sign of each switching function
    orders: tuple  # multiplicity of each guard's known zero at `time`, one a slot
    reach: tuple  # largest size of each guard so far: what its rounding errors scale with
    due: Scalar  # slot of the event that happens now, BREAK, or -1
    # at `time`, for the next step
    rate: Any  # vector field (its first stage)
    guards: tuple  # values of the guards
    reactions: Forces
    # step control
    step: Scalar  # the controller's next step
    memory: Memory  # of steps and stays, see `recall`
    last_event: Scalar  # time
    last_error: Scalar  # of the last accepted step, relative to the tolerance,
    last_step: Scalar  # and its length; 1 and 0 after an event
    target: Scalar  # slot of an event being located or foreseen, or -1
    trial: Scalar  # step that should end on it
    tries: Scalar  # steps that did not; 0 where it is only foreseen
    # outcome
    result: Scalar
    flagged: Scalar  # an indeterminate Painleve state was passed
    # counters
    attempts: Scalar
    rejected: Scalar
    unproved: Scalar  # committed steps whose guards could not be proved free of zeros
    streak: Scalar  # events in a row without time passing
    paced_time: Scalar  # when the pace was last looked at (`step.PACE_TURNS`)
    events: Scalar
    # output buffers
    log: EventLog
    sample_index: Scalar
    samples: Any
    full: Scalar  # no room for the samples of another step
    observed: Any

    @property
    def active(self) -> Scalar:
        """True where a trial step counts: the trajectory runs, no event waits to be done and no
        samples to be put away.
        """
        return (self.result == RUNNING) & (self.due < 0) & ~self.full

    @property
    def ended(self) -> Scalar:
        """True where nothing is left to be done."""
        return (self.result != RUNNING) & ~self.full


def vector_field(t, y, args):
    """Right-hand side of the smooth motion in a regime; the vector field of the diffrax term."""
    system, regime = args
    position, velocity = y
    c = contact(system, t, position, velocity)
    return rates(system, t, position, velocity), acceleration(c, forces(system, c, regime))


TERM = diffrax.ODETerm(vector_field)


def start_of_slip_order(system: AbstractSystem, c: Contact, regime):
    """Multiplicity of the zero of s v_t where slip starts from rest.

    1 where the tip leaves with an acceleration (after a reversal, or where mu drops at once from
    static to dynamic), 2 where the cone was reached smoothly (MODEL.md section 5).
    """
    f = forces(system, c, regime)
    a_t = plus(c.b_t, c.w_tt * f.tangential, times(c.w_tn, f.normal))
    size = jnp.abs(c.b_t) + jnp.abs(c.w_tt * f.tangential)
    # an acceleration the wrong way is what the tolerance left of the release's own zero
    return jnp.where(slip_sign(regime) * a_t > 1e-7 * size, 1, 2)


def _no_rest(position: tuple, velocity: tuple):
    """Nothing left out by rounding yet; not followed in float64, far below any tolerance there."""
    if position[0].dtype == jnp.float64:
        return None
    return jax.tree.map(jnp.zeros_like, (position, velocity))


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
    c = contact(local, start, position, velocity)
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
    for tolerance in (problem.rtol, *jax.tree.leaves(problem.atol)):  # traced: seen by nobody else
        finite = finite & (tolerance > 0) & (tolerance < jnp.inf)
    for leaf in jax.tree.leaves((position, velocity, rate)):
        finite = finite & jnp.isfinite(leaf)
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
