"""Derivative of an event's time: the implicit function theorem.

Steps carry no derivative, so the last correction of the time has to carry all of it: dt = -dg / g',
with dg the change of the guard at the event's time and g' its slope along the motion. The value of
the correction may come from a polynomial that is a per cent off, for it is below the tolerance; its
derivative may not.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from ...contact.guards import guard_values
from ...contact.regimes import acceleration, forces
from ...contact.space import contact
from ...contact.system import rates


@eqx.filter_custom_jvp
def time_to_event(correction, located, system, t, q, v, regime, sides, slot):
    """Return ``correction`` [s], the time from the end of a step to the event of ``slot``.

    (t, q, v) is the state that this time leads to, moved there by a correction that carries no
    derivative. Where ``located``, the derivative of the result is that of the event time. Costs
    nothing but where derivatives are taken.
    """
    return correction


@time_to_event.def_jvp
def _time_to_event_jvp(primals, tangents):
    correction, located, system, t, q, v, regime, sides, slot = primals
    _, _, *moved, _, _, _ = tangents

    def guard(system, t, q, v):
        values = guard_values(system, contact(system, t, q, v), t, q, v, regime, sides)
        value = values[0]
        for i, other in enumerate(values[1:], 1):
            value = jnp.where(slot == i, other, value)
        return value

    c = contact(system, t, q, v)
    motion = rates(system, t, q, v), acceleration(c, forces(system, c, regime))
    _, slope = jax.jvp(lambda *x: guard(system, *x), (t, q, v), (jnp.ones_like(t), *motion))
    _, change = eqx.filter_jvp(guard, (system, t, q, v), tuple(moved))
    if change is None:
        return correction, jnp.zeros_like(correction)
    shift = -change / jnp.where(located & (slope < 0), slope, -1.0)
    return correction, jnp.where(located, shift, 0.0).astype(correction.dtype)
