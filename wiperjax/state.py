"""What a trajectory carries through the event loop, and what it is asked to do."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .observers import AbstractObserver
from .recall import Memory
from .regimes import Forces, acceleration, forces, slip_sign
from .results import RUNNING
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
