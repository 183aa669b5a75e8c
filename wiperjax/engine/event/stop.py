"""The blow against a stop: velocities jump, and the contact, if it was closed, is judged anew.

Nothing of this is in the program of a system without stops.
"""

from functools import partial, reduce
from operator import or_
from typing import NamedTuple

import jax
import jax.numpy as jnp

from ...contact.guards import parts, rounding, stop_slots
from ...contact.space import Contact
from ...contact.system import AbstractSystem, cast
from ...numerics.arrays import where
from ...numerics.elementary import larger
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ..carry.problem import Problem
from ..carry.state import State
from ..trial.guard_proof import noise_digits
from .collision import Motion
from .event_kind import Fired

STANDS = 1e-9  # of the speed of a blow: what leaves a stop with less does not leave it


class Struck(NamedTuple):
    """What was struck at an event, a mask each."""

    stops: tuple[Scalar, ...]  # one a stop
    falling: tuple[Scalar, ...]  # rates of their switches before
    any: Scalar


def struck(system: AbstractSystem, state: State, fires) -> Struck | None:
    """Return which stop the event of ``state.due`` strikes; None for a system without stops."""
    if not system.stops:
        return None
    masks = tuple(fires & (state.due == slot) for slot in stop_slots(system))
    falling, _ = _rates(system, state.time, state.position, state.velocity, *state.rate)
    return Struck(masks, falling, reduce(or_, masks))


def strike(system: AbstractSystem, blow: Struck, time, q, v, fired: Fired):
    """Return the velocities behind the blow, and `Fired` with a closed contact judged anew."""
    closed = ~fired.was_flying
    for stop, mask in zip(system.stops, blow.stops, strict=True):
        v = where(mask, cast(system.rebound(stop, time, q, v, closed), v), v)
    again = fired.retest | (blow.any & closed)
    return keep(v), fired._replace(retest=again, was_sticking=fired.was_sticking & ~blow.any)


def settle(problem: Problem, c: Contact, blow: Struck, motion: Motion, fired: Fired):
    """Return (`Motion`, `Fired`) behind a blow: a closed contact whose ends part is one that
    bounced, and speeds that are rounding are none. ``c``: the contact of the velocities then.
    """
    least = problem.least_speed
    rests = blow.any & (jnp.abs(motion.slip_speed) <= least)
    opens = blow.any & ~fired.was_flying & (c.normal_speed > least)
    motion = motion._replace(
        slip_speed=jnp.where(rests, 0.0, motion.slip_speed),
        leaving=jnp.where(opens, c.normal_speed, motion.leaving),
    )
    return motion, fired._replace(hits=fired.hits | opens)


def leave(system: AbstractSystem, blow: Struck, orders: list, reach, time, q, v, rate, was_flying):
    """Return the orders of the guards' zeros behind a blow, and whether it leads nowhere: the stop
    is neither left at a speed nor with an acceleration, or for a flight no higher than the rounding
    of its switch, of which no clock would ever see the end.

    ``reach``: the sizes of the guards so far; a blow is located to within the rounding of these, at
    a stop at 0 as well, where the place itself has none. ``rate`` is that of the vector field
    behind it. Where a gap begins to open at this very instant (at an event before), it does so at
    another speed now.
    """
    rising, bends = _rates(system, time, q, v, *rate)
    heights = parts(lambda t, *qv: _of_stops(system, t, qv[: len(q)], qv[len(q) :]), time, *q, *v)
    orders, nowhere = list(orders), jnp.zeros_like(blow.any)
    slots = zip(stop_slots(system), blow.stops, blow.falling, rising, bends, heights, strict=True)
    for slot, mask, before, after, bend, height in slots:
        leaves = after > STANDS * jnp.abs(before)
        orders[slot] = jnp.where(mask, jnp.where(leaves, 1, 2), orders[slot]).astype(jnp.int32)
        low = larger(rounding(height), noise_digits(height.dtype) * reach[slot])
        unseen = after**2 < -2 * bend * low
        nowhere = nowhere | (mask & jnp.where(leaves, unseen, bend <= 0))
    begins = blow.any & was_flying & (orders[0] > 0)
    orders[0] = jnp.where(begins, 1, orders[0]).astype(jnp.int32)
    return orders, nowhere


def _rates(system: AbstractSystem, time, q, v, speeds, accelerations):
    """Rates of the stops' switches along the motion, and the rates of these."""

    def along(f):
        def rate(time, q, v):
            moves = (jnp.ones_like(time), cast(system.rates(time, q, v), v), accelerations)
            return jax.jvp(f, (time, q, v), moves)[1]

        return rate

    once = along(partial(_of_stops, system))
    return once(time, q, v), along(once)(time, q, v)


def _of_stops(system: AbstractSystem, time, q, v) -> tuple[Scalar, ...]:
    """Return the values of the stops' switches."""
    values = system.switches(time, q, v)
    return tuple(jnp.asarray(values[place], v[0].dtype) + 0.0 * v[0] for place in system.stops)
