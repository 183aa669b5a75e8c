"""Contact forces of each regime, and the regime that holds after an event.

All at acceleration level with the set-valued law: no velocity threshold stands in for stick.
"""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp

from ..numerics.bernstein import largest, minimum
from ..numerics.elementary import larger
from ..numerics.fusion_barrier import keep
from ..numerics.known_zeros import absent, plus, times
from ..numerics.tracing import traced_once
from ..numerics.types import Scalar
from ..vocabulary.codes import Regime
from .friction import CLASSES
from .space import Contact, contact
from .system import AbstractSystem, rates

ROUNDINGS = 64  # last digits of typical speeds, accelerations, forces: a contact has none below


def as_told(system: AbstractSystem, regime):
    """What is told of ``regime``: of a held contact that would open (`AbstractSystem.lifted`, which
    needs the sides of the switches) flight, whatever the regime in which it is held.
    """
    lifted = system.lifted
    return regime if lifted is False else jnp.where(lifted, int(Regime.FLIGHT), regime)


class Forces(NamedTuple):
    tangential: Scalar
    normal: Scalar


def slips(regime):
    """Whether ``regime`` is one of slip."""
    return (regime == Regime.SLIP_POS) | (regime == Regime.SLIP_NEG)


def slip_sign(regime):
    """+1 in SLIP_POS, -1 in SLIP_NEG, 0 otherwise."""
    negative = jnp.where(regime == Regime.SLIP_NEG, -1, 0)
    return keep(jnp.where(regime == Regime.SLIP_POS, 1, negative))


def slip_forces(c: Contact, sign, mu, unilateral: bool) -> tuple[Forces, Scalar]:
    """Forces of slip of ``sign`` and D = W_nn - sign mu W_tn (docs/model.md, section 7)."""
    if not unilateral:
        return Forces(-sign * mu * c.load, c.load), jnp.ones_like(c.load)
    d = plus(c.w_nn, times(c.w_tn, -sign * mu))
    normal = -c.b_n / d
    return Forces(-sign * mu * normal, normal), d


def stick_forces(c: Contact, unilateral: bool) -> Forces:
    """Forces that hold both contact accelerations at zero: W lambda = -b."""
    if not unilateral:
        return Forces(-c.b_t / c.w_tt, c.load)
    if absent(c.w_tn):
        return Forces(-c.b_t / c.w_tt, -c.b_n / c.w_nn)
    det = c.w_tt * c.w_nn - c.w_tn * c.w_tn
    return Forces((c.w_tn * c.b_n - c.w_nn * c.b_t) / det, (c.w_tn * c.b_t - c.w_tt * c.b_n) / det)


def friction_coefficient(system: AbstractSystem, c: Contact, sign) -> Scalar:
    """mu at the slip speed of ``c``, continued smoothly through zero along ``sign``."""
    if system.law is None:
        return jnp.zeros_like(c.b_t)
    return system.law.coefficient(sign * c.slip_speed)


@traced_once
def forces(system: AbstractSystem, c: Contact, regime) -> Forces:
    """Contact forces (lambda_t, lambda_n) in ``regime``."""
    unilateral, sign = system.unilateral, slip_sign(regime)
    mu = keep(friction_coefficient(system, c, sign))  # its exponential is dear
    slip, _ = slip_forces(c, sign, mu, unilateral)
    if system.law is None and not unilateral:
        return slip
    stick = slip if system.law is None else stick_forces(c, unilateral)
    touching = regime != Regime.FLIGHT
    pick = [
        jnp.where(touching, jnp.where(regime == Regime.STICK, a, b), 0.0)
        for a, b in zip(stick, slip, strict=True)
    ]
    return Forces(*pick)


def acceleration(c: Contact, f: Forces):
    """Accelerations of the coordinates under the contact forces ``f``."""
    return tuple(
        plus(a, times(t, f.tangential), times(n, f.normal))
        for a, t, n in zip(c.free, c.along_t, c.along_n, strict=True)
    )


def pulls(system: AbstractSystem, loads):
    """Whether some of the ``loads`` that a system prescribes on its friction along a step, but for
    the first, are below zero, by more than a switch is off that is to keep them above: the law says
    nothing of that, and friction would drive what it should brake.
    """
    if system.unilateral or system.law is None:
        return jnp.zeros_like(loads[0], bool)
    return minimum(loads[1:]) < -1e-6 * largest(loads)


def drives(system: AbstractSystem, regime, found: list[Forces]):
    """Whether friction drives what slips, at one of the forces ``found`` along a step but for the
    first: the coefficient of a law of one's own is below zero there, by more than rounding.
    """
    law, sign = system.law, slip_sign(regime)
    if law is None or type(law) in CLASSES.values():  # whose numbers are >= 0
        return jnp.zeros_like(sign, bool)
    least = 1e-6 * law.static
    # by the load, which near a lift-off is of either sign
    driven = [(sign * f.tangential - least * f.normal) * f.normal > 0 for f in found[1:]]
    return (sign != 0) & reduce(jnp.logical_or, driven)


class Decision(NamedTuple):
    """Outcome of `decide`: the regime, and what is special about it."""

    regime: Scalar
    jam: Scalar  # D <= 0 under load: no finite force; an impact without collision is due
    indeterminate: Scalar  # D <= 0 with a separating free acceleration


def decide(system: AbstractSystem, c: Contact) -> Decision:
    """Regime of a closed contact (gap and normal speed zero) at this instant.

    STICK if its forces lie in the cone; else SLIP of a sign whose friction makes s a_t > 0 with
    lambda_n > 0 and D > 0; else FLIGHT, if it can open (docs/model.md, section 5).
    """
    unilateral = system.unilateral
    law = system.law
    if law is None:
        holds = (c.b_n < 0) | (not unilateral)
        no = jnp.zeros_like(holds)
        return Decision(jnp.where(holds, int(Regime.SLIP_POS), int(Regime.FLIGHT)), no, no)

    at_rest = c.slip_speed == 0
    if not unilateral:
        # Where no load presses yet, rounding is no force that drives. A load that vanishes for a
        # while, or is below zero by rounding, still touches: friction is zero then. (`pulls` ends a
        # motion under one that is less.)
        drive = sum(jnp.abs(a) for a in c.free) * ROUNDINGS * float(jnp.finfo(c.b_t.dtype).eps)
        b_t = jnp.where(jnp.abs(c.b_t) <= drive, 0.0, c.b_t)
        c = c._replace(b_t=b_t, load=larger(c.load, 0.0))
    stick = stick_forces(c, unilateral)

    def presses(normal):
        return normal > 0 if unilateral else normal >= 0

    # what is out of it by rounding would leave at an acceleration of rounding
    edge = (1 + ROUNDINGS * float(jnp.finfo(c.b_t.dtype).eps)) * law.static * stick.normal
    in_cone = presses(stick.normal) & (jnp.abs(stick.tangential) <= edge)
    sticks = at_rest & in_cone

    def start_of_slip(sign):
        f, d = slip_forces(c, sign, law.coefficient(jnp.zeros_like(c.b_t)), unilateral)
        a_t = plus(c.b_t, c.w_tt * f.tangential, times(c.w_tn, f.normal))
        return (sign * a_t >= 0) & presses(f.normal) & (d > 0), d

    pos, d_pos = start_of_slip(1.0)
    neg, d_neg = start_of_slip(-1.0)
    # of two possible slips the one that the free acceleration pushes
    pos, neg = pos & (~neg | (c.b_t >= 0)), neg & (~pos | (c.b_t < 0))

    sign = jnp.sign(c.slip_speed)
    moving, d = slip_forces(c, sign, friction_coefficient(system, c, sign), unilateral)
    slides = ~at_rest & (moving.normal > 0) & (d > 0)
    paradox = ~at_rest & (d <= 0)
    if not unilateral:
        slides, paradox = ~at_rest, jnp.zeros_like(at_rest)

    # what always touches is at the edge of its cone, within rounding, where nothing fits
    nothing = int(Regime.FLIGHT if unilateral else Regime.STICK)
    regime = jnp.where(
        sticks,
        int(Regime.STICK),
        jnp.where(
            (at_rest & pos) | (slides & (sign > 0)),
            int(Regime.SLIP_POS),
            jnp.where((at_rest & neg) | (slides & (sign < 0)), int(Regime.SLIP_NEG), nothing),
        ),
    )
    # at rest, leaving the glass needs a separating free acceleration: otherwise nothing fits
    stuck = at_rest & ~sticks & ~pos & ~neg & (c.b_n < 0) & ((d_pos <= 0) | (d_neg <= 0))
    return Decision(regime, (paradox | stuck) & (c.b_n < 0), paradox & (c.b_n >= 0))


@traced_once
def vector_field(t, y, args):
    """Right-hand side of the smooth motion in a regime; the vector field of the diffrax term."""
    system, regime = args
    position, velocity = y
    c = contact(system, t, position, velocity)
    return rates(system, t, position, velocity), acceleration(c, forces(system, c, regime))
