"""The way into a jam: slip braked until no finite force exists (docs/model.md, section 7)."""

import jax
import jax.numpy as jnp

from .space import Contact


def brake_to_jam(system, c: Contact, sign, mu):
    """Return the impulses (tangential, normal) that carry slip the last bit to D = 0, and mu there.

    Steps end just before D = 0, at D > 0 (`trial`); the rest takes no time: v_t falls at a fixed
    position until D(v_t) vanishes. Nothing where D <= 0 already.
    """
    speed = jnp.abs(c.slip_speed)
    target = speed
    for _ in range(3):
        value, slope = jax.jvp(system.law.coefficient, (target,), (jnp.ones_like(target),))
        d, rate = c.w_nn - sign * value * c.w_tn, -sign * slope * c.w_tn
        down = (d > 0) & (rate > 0)
        target = jnp.clip(target - jnp.where(down, d / jnp.where(down, rate, 1.0), 0.0), 0.0, speed)
    slowing = c.w_tt * mu - sign * c.w_tn  # loss of speed per normal impulse
    normal = (speed - target) / jnp.where(slowing > 0, slowing, jnp.inf)
    at_jam = jnp.where(normal > 0, system.law.coefficient(target), mu)
    return (-sign * mu * normal, normal), at_jam
