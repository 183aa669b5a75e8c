"""A state put back on the constraints of its contact."""

import jax.numpy as jnp

from ..numerics.known_zeros import absent, plus, times
from .space import Contact


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
