"""The contact space: what the forces at the contact see of a system at one instant."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from ..numerics.fusion_barrier import keep
from ..numerics.known_zeros import absent, plus, times
from ..numerics.tracing import traced_once
from ..numerics.types import Coordinates, Scalar
from .system import AbstractSystem, cast, like


class Contact(NamedTuple):
    """The contact at one instant, in contact space: ``(a_t, a_n) = (b_t, b_n) + W (l_t, l_n)``.

    The prescribed load of a bilateral contact is in ``b_t`` already: there W_tn and ``along_n`` are
    zero. What is zero for every state of the system is the Python number 0 (`known_zeros`).
    """

    gap: Scalar
    normal_speed: Scalar
    slip_speed: Scalar
    free: Coordinates  # accelerations without contact force, but with a prescribed one
    along_t: Coordinates  # A^-1 J_t^T
    along_n: Coordinates  # A^-1 J_n^T
    b_t: Scalar
    b_n: Scalar
    w_tt: Scalar
    w_tn: Scalar
    w_nn: Scalar
    load: Scalar  # prescribed normal force of a bilateral contact (part of `free`), else 0


@traced_once
def contact(system: AbstractSystem, t, q, v) -> Contact:
    """Return the contact-space quantities of ``system`` at (t, q, v).

    Speeds are linear in v, so W's columns are derivatives of the speeds along the directions;
    the bias terms are total time derivatives along (1, q', a_free).
    """
    free = keep(cast(system.free_acceleration(t, q, v), v))
    directions = system.directions(t, q)
    along_t, along_n = (cast(d, v) for d in directions)
    one, zero = jnp.ones_like(t), jnp.zeros_like(t)
    still = tuple(jnp.zeros_like(x) for x in q)

    def slip(t, q, v):
        return like(system.slip_speed(t, q, v), v[0])

    def along(f, tangent_t, tangent_q, tangent_v):
        return jax.jvp(f, (t, q, v), (tangent_t, tangent_q, tangent_v))

    sparse_t, sparse_n = (
        tuple(x if absent(x) else y for x, y in zip(d, full, strict=True))
        for d, full in zip(directions, (along_t, along_n), strict=True)
    )
    load: Scalar = 0.0
    if not system.unilateral:
        # It answers to nothing, and is a force of the free motion: it may drive slip, and stick
        # holds against it.
        load = like(system.normal_force(t, q, v), v[0])
        free = tuple(plus(x, times(n, load)) for x, n in zip(free, sparse_n, strict=True))
        sparse_n = (0.0,) * len(free)
    rates = cast(system.rates(t, q, v), v)
    slip_speed, b_t = along(slip, one, rates, free)
    w_tt = along(slip, zero, still, along_t)[1]

    if not system.unilateral:
        z = jnp.zeros_like(b_t)
        return Contact(z, z, slip_speed, free, sparse_t, sparse_n, b_t, z, w_tt, 0.0, z + 1, load)

    def approach(t, q, v):
        def gap(t, q):
            return like(system.gap(t, q), q[0])

        return jax.jvp(gap, (t, q), (jnp.ones_like(t), cast(system.rates(t, q, v), v)))

    (gap, normal_speed), (_, b_n) = along(approach, one, rates, free)
    w_nn = along(approach, zero, still, along_n)[1][1]
    w_tn = along(slip, zero, still, along_n)[1] if system.coupled else 0.0
    return Contact(
        gap, normal_speed, slip_speed, free, sparse_t, sparse_n, b_t, b_n, w_tt, w_tn, w_nn, load
    )
