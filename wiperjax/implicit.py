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
def time_to_event(correction, located, guard, system, t, q, v, regime, sides, slot):
    """Return ``correction`` [s], the time from (t, q, v) to the event of ``slot``.

    Its derivative is that of the event time, where ``located``; ``guard`` is the value of the slot
    at (t, q, v). Costs nothing but where derivatives are taken.
    """
    return correction


@time_to_event.def_jvp
def _time_to_event_jvp(primals, tangents):
    correction, located, _, system, t, q, v, regime, sides, slot = primals
    change = tangents[2]
    if change is None:
        return correction, jnp.zeros_like(correction)

    def along(t, q, v):
        return guard_values(system, contact(system, t, q, v), t, q, v, regime, sides)

    c = contact(system, t, q, v)
    motion = rates(system, t, q, v), acceleration(c, forces(system, c, regime))
    slopes = jax.jvp(along, (t, q, v), (jnp.ones_like(t), *motion))[1]
    slope = slopes[0]
    for i, other in enumerate(slopes[1:], 1):
        slope = jnp.where(slot == i, other, slope)
    shift = -change / jnp.where(located & (slope < 0), slope, -1.0)
    return correction, jnp.where(located, shift, 0.0).astype(correction.dtype)
