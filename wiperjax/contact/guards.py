"""The guards of each regime: functions that are positive inside it and vanish where it ends.

Slots are the same for every regime, so that a batch of trajectories in different regimes runs the
same arithmetic:

| slot | STICK | SLIP_s | FLIGHT |
|---|---|---|---|
| FIRST | cone, upper side | s v_t | gap |
| SECOND | cone, lower side | -b_n (pressing) | - |
| JAM (coupled systems) | - | D | - |
| one a switch | side * switch | same | same |
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient

from ..numerics.known_zeros import plus, times
from ..numerics.tracing import traced_once
from ..numerics.types import Scalar
from ..vocabulary.codes import Regime
from .regimes import forces, friction_coefficient, slip_sign, stick_forces
from .space import Contact
from .system import AbstractSystem, like

FIRST, SECOND, JAM = 0, 1, 2
ROUNDED = 16  # last digits, of the numbers that a difference is of


def gap_rounding(system: AbstractSystem, t, q) -> Scalar:
    """Return what a gap may be off by rounding, where it is what larger numbers leave of each
    other, its parts by the time and each coordinate; without derivative. Nothing where contact is
    for good.
    """
    if not system.unilateral:
        return jnp.zeros_like(q[0])

    (size,) = parts(lambda t, *q: (system.gap(t, q),), t, *q)
    return rounding(size)


def rounding(size: Scalar) -> Scalar:
    """Return what a difference of numbers of this ``size`` may be off by."""
    return ROUNDED * float(jnp.finfo(size.dtype).eps) * size


def parts(function, *at) -> tuple[Scalar, ...]:
    """Return the size of what each number of a tuple ``function(*at)`` is made of, however little
    of it they leave of each other: its parts by each of ``at``; without derivative.
    """

    def found(*at):
        return tuple(like(x, at[-1]) for x in function(*at))

    def part(i):
        alone = tuple(x if k == i else jnp.zeros_like(x) for k, x in enumerate(at))
        return jax.jvp(found, at, alone)[1]

    alone = zip(*[part(i) for i in range(len(at))], strict=True)
    return tuple(stop_gradient(sum(map(jnp.abs, of), jnp.zeros_like(at[-1]))) for of in alone)


def first_switch(system: AbstractSystem) -> int:
    """Slot of the first switching function."""
    return 3 if system.coupled else 2


def stop_slots(system: AbstractSystem) -> tuple[int, ...]:
    """Slots of the stops."""
    return tuple(first_switch(system) + place for place in system.stops)


def starting_sides(system: AbstractSystem, t, q, v) -> tuple[Scalar, ...]:
    """Return the side (+1 or -1) of every switch on which a motion begins at (t, q, v)."""
    ends = [
        i in system.stops or isinstance(end, bool | np.bool_) and bool(end)
        for i, end in enumerate(system.ends(t, q, v))
    ]
    return tuple(
        jnp.where((s < 0) & (not one_sided), -1.0, 1.0).astype(q[0].dtype)
        for s, one_sided in zip(system.switches(t, q, v), ends, strict=True)
    )


@traced_once
def guard_values(system: AbstractSystem, c: Contact, t, q, v, regime, sides) -> tuple[Scalar, ...]:
    """Return the value of every slot; unused slots are 1.

    Lift-off is watched through the free acceleration, -b_n, not through the normal force: the
    force has a pole where D = 0, b_n is regular there (docs/model.md, section 7).
    """
    one = jnp.ones_like(c.b_t)
    sign = slip_sign(regime)
    sticking, flying = regime == Regime.STICK, regime == Regime.FLIGHT
    law, unilateral = system.law, system.unilateral

    first = one if law is None else sign * c.slip_speed
    second = -c.b_n if unilateral else one
    if law is not None:
        stick = stick_forces(c, unilateral)
        limit = law.static * stick.normal
        first = jnp.where(sticking, limit - stick.tangential, first)
        second = jnp.where(sticking, limit + stick.tangential, second)
    if unilateral:
        first = jnp.where(flying, c.gap, first)
        second = jnp.where(flying, one, second)
    slots: list[Scalar] = [first, second]
    if system.coupled:
        mu = friction_coefficient(system, c, sign)
        d = plus(c.w_nn, times(c.w_tn, -sign * mu)) / c.w_nn
        slots.append(jnp.where(sign == 0, one, d))
    slots += [side * s for side, s in zip(sides, system.switches(t, q, v), strict=True)]
    return tuple(jnp.broadcast_to(jnp.asarray(s, one.dtype), one.shape) for s in slots)


def start_of_slip_order(system: AbstractSystem, c: Contact, regime, released):
    """Multiplicity of the zero of s v_t where slip starts from rest.

    1 where the tip leaves with an acceleration (after a reversal, or where mu drops at once from
    static to dynamic), 2 where the cone was reached smoothly (docs/model.md, section 5), as far
    as the tolerance tells where the tip was ``released`` from it.
    """
    if system.law is None:  # no slip ends: its guard is constant
        return jnp.zeros_like(regime)
    f = forces(system, c, regime)
    a_t = plus(c.b_t, c.w_tt * f.tangential, times(c.w_tn, f.normal))
    size = jnp.abs(c.b_t) + jnp.abs(c.w_tt * f.tangential)
    # less is what the tolerance left of the release's own zero; elsewhere it is an acceleration,
    # and soon gone where the belt carries the tip back into the cone
    return jnp.where(slip_sign(regime) * a_t > jnp.where(released, 1e-7, 0.0) * size, 1, 2)
