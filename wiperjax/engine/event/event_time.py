"""The last correction of an event's time, and its derivative: the implicit function theorem.

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
from ...numerics.arrays import pick
from ..carry.state import State

TICKS = 1e4  # last digits of the clock: a shorter step tells no bend


def drift(state: State, h, q, v, rate, d):
    """Return the state a time ``d``, far shorter than the step ``h`` from ``state`` to (q, v) with
    ``rate``, past its end: a Taylor step.

    It goes to the change of the acceleration (of the cubic through the velocities): the derivative
    of an event's state then holds as well as the state, whatever the length of the last correction.
    """
    speeds, a = rate
    h = h.astype(d.dtype)
    # of a step that the clock hardly tells, as from a known time to an event just behind it, the
    # bends are rounding, and the derivative of d over the step makes it large
    tick = TICKS * float(jnp.finfo(state.time.dtype).eps) * jnp.abs(state.time).astype(d.dtype)
    u = jnp.where(h > tick, d / jnp.where(h > 0, h, 1.0), 0.0)
    ends = zip(state.velocity, v, state.rate[1], a, strict=True)
    bends = [h * (2 * y + 4 * z) - 6 * (x1 - x0) for x0, x1, y, z in ends]
    q = tuple(x + d * (s + 0.5 * d * y) for x, s, y in zip(q, speeds, a, strict=True))
    return q, tuple(x + d * y + 0.5 * u * u * z for x, y, z in zip(v, a, bends, strict=True))


@eqx.filter_custom_jvp
def time_to_event(correction, located, system, t, q, v, regime, sides, slot):
    """Return ``correction`` [s], the time from the end of a step to the event of ``slot``.

    (t, q, v) is the state that this time leads to, moved there by a correction that carries no
    derivative. Where ``located``, the derivative of the result is that of the event time. Costs
    nothing but where derivatives are taken.
    """
    return correction


@jax.custom_jvp
def once(slope):
    """Return ``slope``, with no derivative but an error: what follows from the value of a guard at
    an event alone, as ours does, would be zero or wrong in second derivatives."""
    return slope


@once.defjvp
def _no_second(primals, tangents):
    raise NotImplementedError(
        "a motion with events must be differentiated once, but was twice: difference its first "
        "derivatives (docs/gradients.md)"
    )


@time_to_event.def_jvp
def _time_to_event_jvp(primals, tangents):
    correction, located, system, t, q, v, regime, sides, slot = primals
    _, _, *moved, _, _, _ = tangents

    def guard(system, t, q, v):
        values = guard_values(system, contact(system, t, q, v), t, q, v, regime, sides)
        return pick(values, slot)

    c = contact(system, t, q, v)
    motion = rates(system, t, q, v), acceleration(c, forces(system, c, regime))
    _, slope = jax.jvp(lambda *x: guard(system, *x), (t, q, v), (jnp.ones_like(t), *motion))
    slope = once(slope)
    _, change = eqx.filter_jvp(guard, (system, t, q, v), tuple(moved))
    if change is None:
        return correction, jnp.zeros_like(correction)
    shift = -change / jnp.where(located & (slope < 0), slope, -1.0)
    return correction, jnp.where(located, shift, 0.0).astype(correction.dtype)
