"""A state put back on the constraints of its contact, or moved where these leave room."""

import jax
import jax.numpy as jnp

from ..numerics.known_zeros import absent, plus, times
from .space import Contact, contact
from .system import like

SMALL = 1e-12  # of the typical size: what is rounding


def push(vector, along_t, along_n, p_t, p_n):
    """Add contact impulses (or their position-level equal) to a tuple of coordinates."""
    parts = zip(vector, along_t, along_n, strict=True)
    return tuple(plus(x, times(t, p_t), times(n, p_n)) for x, t, n in parts)


def project(system, c: Contact, q, v, closed, touching, sticking):
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


def put_back(system, t, q, v, closed, sticking):
    """Return positions and velocities exactly on the contact where it is ``closed``, and at rest on
    its partner where it is ``sticking``; differentiable.

    A state that was stored, moved or corrected misses that, and would begin with a bounce.
    """
    for _ in range(2):  # the second time for contacts on a curve
        q, v = project(system, contact(system, t, q, v), q, v, closed, closed, sticking)

    def snapped(values, typical):
        small = [closed & (jnp.abs(x) < SMALL * s) for x, s in zip(values, typical, strict=True)]
        pairs = zip(values, small, strict=True)
        return tuple(x - jax.lax.stop_gradient(jnp.where(z, x, 0.0)) for x, z in pairs)

    sizes = system.scales(len(q))
    return snapped(q, sizes[0]), snapped(v, sizes[1])


def kicked(system, t, q, rates, step):
    """Return positions with the first one moved by ``step``; the other way where that leads into
    the partner of the contact, or a stop. ``rates``: q'.
    """
    moved = (q[0] + step, *q[1:])
    switches = system.switches(t, moved, system.from_rates(t, moved, rates))
    room = [switches[place] for place in system.stops]
    if system.unilateral:
        room.append(system.gap(t, moved))
    least = -SMALL * system.scales(len(q))[0][0]
    inside = jnp.zeros(jnp.shape(q[0]), bool)
    for x in room:
        inside |= like(x, q[0]) < least
    return (q[0] + jnp.where(inside, -step, step), *q[1:])
