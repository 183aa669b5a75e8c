"""Derivative of an event's time: the implicit function theorem.

Steps carry no derivative, so the last correction of the time, -g / g', has to carry all of it:
dt = -dg / g', with dg the change of the guard at a fixed time. Its value may come from a polynomial
that is a per cent off, for it is far below the tolerance; its derivative may not.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from .guards import guard_values
from .regimes import acceleration, forces
from .system import contact, rates


@eqx.filter_custom_jvp
def time_to_event(correction, located, guards, system, t, q, v, regime, sides, slot):
    """Return ``correction`` [s], the time from (t, q, v) to the event of ``slot``.

    Its derivative is that of the event time, where ``located``; ``guards`` are the guard values
    at (t, q, v), slots first.
    """
    return correction


@time_to_event.def_jvp
def _time_to_event_jvp(primals, tangents):
    correction, located, guards, system, t, q, v, regime, sides, slot = primals
    change = tangents[2]
    if change is None:
        return correction, jnp.zeros_like(correction)

    def along(t, q, v):
        return guard_values(system, contact(system, t, q, v), t, q, v, regime, sides)

    speeds = rates(system, t, q, v)
    c = contact(system, t, q, v)
    a = acceleration(c, forces(system, c, regime))
    slopes = jax.jvp(along, (t, q, v), (jnp.ones_like(t), speeds, a))[1]
    slots = jnp.arange(guards.shape[0]).reshape((-1,) + (1,) * jnp.ndim(slot))
    mine = slots == slot
    slope = jnp.sum(jnp.where(mine, slopes, 0.0), axis=0)
    fall = jnp.sum(jnp.where(mine, change, 0.0), axis=0)
    shift = -fall / jnp.where(located & (slope < 0), slope, -1.0)
    return correction, jnp.where(located, shift, 0.0).astype(correction.dtype)
