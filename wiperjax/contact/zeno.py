"""Sequences of impacts that accumulate, completed by their limit (docs/model.md, section 6)."""

from typing import NamedTuple

import jax.numpy as jnp

from ..numerics.types import Scalar
from .space import Contact

LONGEST = 100  # in units of the shortest flight: what the limit of a sequence may take the place of
NEUTRAL = 1e-9  # relative growth of a bounce that is taken for rounding (e = 1)
LITTLE = 0.995  # of a bounce: a sequence that keeps more has no limit within `LONGEST`
ENDLESS = 10  # in the same units: shorter flights of a sequence that has no limit are contact


class Completion(NamedTuple):
    """Finite limit of an accumulating sequence of impacts."""

    holds: Scalar
    duration: Scalar
    tangential: Scalar  # remaining impulses
    normal: Scalar
    slip_speed: Scalar


def complete_zeno(c: Contact, mu, leaving, approaching, slip_speed, flown, shortest, time_left):
    """Return the limit of a bounce sequence, where it is due (docs/model.md, section 6).

    ``leaving`` and ``approaching`` are the normal speeds after and before this impact: their ratio
    r is that of successive take-off speeds while b_n hardly changes. The next flight lasts
    t1 = 2 v_n / |b_n|; the rest of the sequence t1 / (1 - r), with the normal impulse that brings
    v_n to zero against b_n, and the matching change of v_t, which friction cannot carry past zero.

    A rest longer than `LONGEST` is bounces that cannot be told from contact: their mean force is
    that of contact, and it changes meanwhile, which the limit knows nothing of. Then the next
    flight is the last, and the speed that is dropped is what b_n makes in half of it. Where bounces
    lose so little that the rest is never short enough (e = 1, or a tip that sticks while it
    bounces), so are flights below `ENDLESS`: the n-th of them lasts C / n, and those from there
    down to ``shortest`` are nine tenths of all. An impact may even gain, out of slip that the
    flight before it built up, while flights become shorter: ``flown``, how long that one lasted,
    tells.
    """
    ratio = leaving / jnp.where(approaching < 0, -approaching, 1.0)
    falls = c.b_n < 0
    flight = 2 * leaving / jnp.where(falls, -c.b_n, 1.0)
    fed = (flight <= (1 + NEUTRAL) * flown) & (flight > LITTLE * flown)
    dies = (leaving > 0) & falls & ((ratio <= 1 + NEUTRAL) | fed)
    whole = flight / jnp.where(ratio < 1, 1 - ratio, jnp.inf)
    ends = (ratio < 1) & (whole <= LONGEST * shortest)
    duration = jnp.where(ends, whole, flight)
    least = jnp.where(ratio > LITTLE, ENDLESS * shortest, shortest)
    holds = dies & (flight < least) & (duration <= time_left)

    sign = jnp.sign(slip_speed)
    d = c.w_nn - sign * mu * c.w_tn
    normal = (-leaving - c.b_n * duration) / d
    change = c.b_t * duration + (c.w_tn - sign * mu * c.w_tt) * normal
    after = slip_speed + change
    stops = (sign * after <= 0) | (sign == 0)
    # where slip ends on the way, both speeds vanish: W p = -(v + b T)
    frictional = c.w_tt > 0
    det = jnp.where(frictional, c.w_tt * c.w_nn - c.w_tn * c.w_tn, 1.0)
    lack_t, lack_n = -slip_speed - c.b_t * duration, -leaving - c.b_n * duration
    stopping = (c.w_nn * lack_t - c.w_tn * lack_n) / det
    normal = jnp.where(stops & frictional, (c.w_tt * lack_n - c.w_tn * lack_t) / det, normal)
    tangential = jnp.where(stops, stopping, -sign * mu * normal)
    tangential = jnp.where(frictional, tangential, 0.0)
    return Completion(holds, duration, tangential, normal, jnp.where(stops, 0.0, after))
