"""The contact made smooth: penalty normal force and regularised friction.

What most people do who have an ODE solver and no events: the glass becomes a spring with a
dashpot, and the set-valued friction a steep curve through zero. The free motion is the system's
own, so all that differs from the engine is the contact law.
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp

from wiperjax.contact.space import contact
from wiperjax.contact.system import AbstractSystem, rates

Smoothing = Literal["tanh", "root"]
LEAST_RESTITUTION = 0.002  # a dashpot reaches e = 0 only as it grows without bound


class SmoothContact(NamedTuple):
    """Parameters of the smooth contact."""

    width: jax.Array  # slip speed over which friction turns [m/s]
    stiffness: jax.Array  # of the glass [N/m per m]
    damping_ratio: jax.Array  # of the bounce: `damping_ratio`


def rebound(ratio):
    """Return the restitution e of a linear spring and dashpot of damping ratio ``ratio``.

    The force pushes only, so contact ends where spring and dashpot cancel, not where the gap
    opens: T. Schwager and T. Poeschel, Granular Matter 9 (2007) 465-469, equation 21. It does not
    depend on the speed of impact (that of a Hunt-Crossley contact does, so that one cannot stand
    for a constant e).
    """
    under = jnp.minimum(ratio, 1 - 1e-9)
    w = jnp.sqrt(1 - under**2)
    slow = jnp.exp(-under / w * (jnp.pi - jnp.arctan2(2 * under * w, 1 - 2 * under**2)))
    over = jnp.maximum(ratio, 1 + 1e-9)
    w = jnp.sqrt(over**2 - 1)
    fast = jnp.exp(-over / w * jnp.log((over + w) / (over - w)))
    return jnp.where(ratio < 1, slow, fast)


def damping_ratio(restitution):
    """Return the damping ratio whose `rebound` is ``restitution`` (held above 0.002)."""
    wanted = jnp.clip(jnp.asarray(restitution, float), LEAST_RESTITUTION, 1.0)
    low, high = jnp.zeros_like(wanted), jnp.full_like(wanted, 20.0)

    def halve(_, bounds):
        low, high = bounds
        middle = 0.5 * (low + high)
        above = rebound(middle) > wanted  # restitution falls as the ratio grows
        return jnp.where(above, middle, low), jnp.where(above, high, middle)

    low, high = jax.lax.fori_loop(0, 60, halve, (low, high))
    return jnp.where(wanted == 1, 0.0, 0.5 * (low + high))


def friction_ratio(law, speed, width, smoothing: Smoothing):
    """Return -lambda_t / lambda_n at slip speed ``speed``: a smooth curve through zero.

    ``tanh``: mu(|v|) tanh(v / width). ``root``: |v| becomes sqrt(v^2 + width^2) - width, its sign
    v / sqrt(v^2 + width^2).
    """
    if smoothing == "tanh":
        return law.coefficient(jnp.abs(speed)) * jnp.tanh(speed / width)
    size = jnp.sqrt(speed**2 + width**2)
    return law.coefficient(size - width) * speed / size


def vector_field(system: AbstractSystem, smooth: SmoothContact, smoothing: Smoothing, t, q, v):
    """Return (q', v') under the smooth contact forces. ``v`` is what the system computes with."""
    c = contact(system, t, q, v)
    damping = 2 * smooth.damping_ratio * jnp.sqrt(smooth.stiffness / c.w_nn)
    push = -smooth.stiffness * c.gap - damping * c.normal_speed
    normal = jnp.where(c.gap < 0, jnp.maximum(push, 0.0), 0.0)
    tangential = -normal * friction_ratio(system.law, c.slip_speed, smooth.width, smoothing)
    a = tuple(
        f + n * normal + s * tangential
        for f, n, s in zip(c.free, c.along_n, c.along_t, strict=True)
    )
    return rates(system, t, q, v), a
