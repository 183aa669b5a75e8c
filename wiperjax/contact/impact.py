"""Poisson's impact law with Coulomb friction, in closed form for any contact inertia W.

docs/model.md, section 6: along the normal impulse p_n it slips with dv_t/dp_n = W_tn - s mu W_tt
and dv_n/dp_n = W_nn - s mu W_tn until v_t = 0; from there it sticks if |W_tn| <= mu W_tt, else it
slips with s = sign(W_tn). Compression ends at v_n = 0 with impulse p_c, expansion adds e p_c. The
motion is linear in p_n on each side of v_t = 0, so everything is closed form.
"""

from typing import NamedTuple

import jax.numpy as jnp

from ..numerics.fusion_barrier import keep
from ..numerics.types import Scalar


class Impulse(NamedTuple):
    """Contact impulses and the contact velocities after them."""

    tangential: Scalar
    normal: Scalar
    slip_speed: Scalar
    normal_speed: Scalar


def poisson_impact(
    w_tt, w_tn, w_nn, mu, restitution, slip_speed, normal_speed, jam=False
) -> Impulse:
    """Impulse of an impact at (v_t, v_n <= 0).

    With ``normal_speed = 0`` and D = W_nn - s mu W_tn <= 0 it is Painleve's impact without
    collision; ``jam`` says so where D is zero up to rounding, and slip does not decompress then.
    ``w_tt = 0`` is a frictionless contact. Post-impact v_t is exactly 0 where the contact sticks.
    """
    sign = jnp.sign(slip_speed)
    frictional = w_tt > 0
    mu = jnp.where(frictional, mu, 0.0)
    safe_tt = jnp.where(frictional, w_tt, 1.0)

    # first part: slip with the incoming sign, up to the impulse p_s at which v_t vanishes
    rate_t = w_tn - sign * mu * w_tt
    rate_n = w_nn - sign * mu * w_tn
    rate_n = jnp.where(jnp.asarray(jam) & (sign != 0), jnp.minimum(rate_n, 0.0), rate_n)
    brakes = sign * rate_t < 0
    p_s = jnp.where(brakes, -slip_speed / jnp.where(brakes, rate_t, 1.0), jnp.inf)
    p_s = jnp.where((sign == 0) & frictional, 0.0, p_s)

    # second part: stick, or slip in the direction that the coupling drives
    sticks = jnp.abs(w_tn) <= mu * w_tt
    ratio = jnp.where(sticks, -w_tn / safe_tt, -jnp.sign(w_tn) * mu)  # dp_t / dp_n
    rate_t2 = jnp.where(sticks, 0.0, w_tn + w_tt * ratio)
    rate_n2 = w_nn + w_tn * ratio
    # Of no slip at all that stays so the impulse holds what a trace of it would be: nothing, but
    # not its derivative. (To first order the law is that of `held`, whichever way the trace goes.)
    held = jnp.where((sign == 0) & frictional & sticks, slip_speed / safe_tt, 0.0)

    early = jnp.where(rate_n > 0, -normal_speed / jnp.where(rate_n > 0, rate_n, 1.0), jnp.inf)
    ends_early = early <= p_s
    p_s_finite = jnp.where(jnp.isfinite(p_s), p_s, 0.0)
    late = p_s_finite - (normal_speed + rate_n * p_s_finite - held * w_tn) / rate_n2
    compression = jnp.where(ends_early, early, late)
    normal = (1 + restitution) * compression

    first = jnp.minimum(normal, p_s)
    second = normal - first
    past = second > 0
    tangential = -sign * mu * first + jnp.where(past, ratio * second, 0.0) - held
    v_t = jnp.where(past | (first == p_s), rate_t2 * second, slip_speed + rate_t * first)
    v_n = normal_speed + rate_n * first + jnp.where(past, rate_n2 * second, 0.0) - held * w_tn
    # exact where the law is: rounding must not leave a closed contact with a speed of 1e-17
    v_n = jnp.where(restitution > 0, jnp.maximum(v_n, 0.0), 0.0)
    return Impulse(tangential, normal, v_t, v_n)


def phased_impact(
    w_tt, w_tn, w_nn, mu, restitution, slip_speed, normal_speed, jam=False
) -> Impulse:
    """Impulse of an impact at (v_t, v_n <= 0) by Pfeiffer and Glocker's law, with friction.

    Poisson's two phases, too, but in each of them friction opposes the slip that is left at its
    end, with the whole impulse of the phase: another answer than `poisson_impact` only where slip
    turns round on the way. Slip with D <= 0 ends in a jam, which ``jam`` says as it does there.
    (F. Pfeiffer, Ch. Glocker, "Multibody Dynamics with Unilateral Contacts", 1996, chapter 8.)
    """
    det = w_tt * w_nn - w_tn * w_tn
    held = (w_tn * slip_speed - w_tt * normal_speed) / det
    holding = (w_tn * normal_speed - w_nn * slip_speed) / det

    def slid(sign):
        """Impulse of a compression that ends in slip of ``sign``, and whether it does."""
        d = w_nn - sign * mu * w_tn
        pushes = (d > 0) & ~jnp.asarray(jam)
        normal = -normal_speed / jnp.where(pushes, d, 1.0)
        left = slip_speed + (w_tn - sign * mu * w_tt) * normal
        return normal, pushes & (sign * left > 0)

    # of the three one holds, whatever the coupling
    forward, slides = slid(1.0)
    backward, turns = slid(-1.0)
    # kept: at the border of two, each of their uses could round, and choose, on its own
    slides, turns = keep((slides, turns))
    sticks = ~slides & ~turns
    normal = jnp.where(slides, forward, jnp.where(turns, backward, held))
    friction = jnp.where(slides, -mu * forward, mu * backward)
    tangential = jnp.where(sticks, holding, friction)
    v_t = jnp.where(sticks, 0.0, slip_speed + w_tt * tangential + w_tn * normal)

    more = restitution * normal
    wanted = -(v_t + w_tn * more) / w_tt
    limit = mu * more
    friction = jnp.clip(wanted, -limit, limit)
    v_t = jnp.where(jnp.abs(wanted) <= limit, 0.0, v_t + w_tn * more + w_tt * friction)
    v_n = jnp.where(restitution > 0, jnp.maximum(w_nn * more + w_tn * friction, 0.0), 0.0)
    return Impulse(tangential + friction, normal + more, v_t, v_n)
