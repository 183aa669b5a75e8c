"""The regime that follows an event, and the zeros of its guards (docs/model.md, section 5)."""

from typing import NamedTuple

import jax.numpy as jnp

from ...contact.guards import FIRST, start_of_slip_order
from ...contact.regimes import decide, slip_forces
from ...contact.space import Contact
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import Regime
from ..trial.guard_proof import noise_digits
from .event_kind import Fired

TRACE = 16  # of a guard's rounding: a normal force below that is none


class Succession(NamedTuple):
    """The regime after an event, and how it was found."""

    regime: Scalar
    undecided: Scalar  # the forces had to be asked
    bounces: Scalar
    slips: Scalar  # friction lets a tip slip that left the cone
    jammed: Scalar  # slip without finite forces
    indeterminate: Scalar


def regime_after(system, c: Contact, fired: Fired, regime, slot, leaving, held) -> Succession:
    """Return what follows ``regime`` at acceleration level; ``c`` is the contact after the event.

    ``slot`` is the guard that fired, ``leaving`` the normal speed of a tip that hit the contact,
    ``held`` the largest force of the cone in the stick before.
    """
    hit = fired.hits | fired.jams
    bounces = hit & (leaving > 0)
    closes = hit & ~bounces
    decision = keep(decide(system, c))
    undecided = closes | fired.turns | fired.retest
    escape = jnp.where(slot == FIRST, -1, 1)  # friction at its upper limit pushes the tip to +x
    zero = jnp.zeros_like(c.b_t)
    mu_static = zero if system.law is None else system.law.coefficient(zero)
    released, d = slip_forces(c, escape, mu_static, system.unilateral)
    trace = TRACE * noise_digits(held.dtype) * held  # at the cone's apex what presses is rounding
    slips = (released.normal > trace) & (d > 0)
    if not system.unilateral:  # it cannot fly, whatever its load
        slips = jnp.ones_like(slips)
    slips, undecided, bounces = keep((slips, undecided, bounces))
    after = jnp.where(undecided, decision.regime, regime)
    after = jnp.where(bounces | fired.lifts, int(Regime.FLIGHT), after)
    slip_regime = jnp.where(escape > 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    after = jnp.where(fired.leaves_cone, jnp.where(slips, slip_regime, int(Regime.FLIGHT)), after)
    # D <= 0 under load while sliding: kept as slip, whose JAM guard then fires at once
    jammed = undecided & decision.jam
    sliding_on = jnp.where(c.slip_speed > 0, int(Regime.SLIP_POS), int(Regime.SLIP_NEG))
    after = jnp.where(jammed & (c.slip_speed != 0), sliding_on, after).astype(jnp.int32)
    # at the edge of the cone b_n = -D lambda_n: where D <= 0 the tip might slip as well as fly
    ambiguous = undecided & decision.indeterminate | fired.leaves_cone & (d <= 0)
    return Succession(keep(after), undecided, bounces, slips, jammed, ambiguous)


def first_order(system, c: Contact, fired: Fired, found: Succession, regime, order) -> Scalar:
    """Return the order of the zero with which the first guard begins after an event, (int32).

    Of flight the gap: 3 at a lift-off, 1 at a bounce, 2 where it closed with a pull; of slip from
    rest the slip speed. ``order`` is that of before, kept where the ``regime`` goes on.
    """
    after = found.regime
    leaves = jnp.logical_or(fired.lifts, fired.leaves_cone)
    changes = fired.hits | fired.jams | fired.turns | fired.retest | leaves
    into_flight = (after == Regime.FLIGHT) & changes
    in_slip = (after == Regime.SLIP_POS) | (after == Regime.SLIP_NEG)
    into_slip = in_slip & (c.slip_speed == 0) & (found.undecided | fired.leaves_cone)
    of_flight = jnp.where(leaves, 3, jnp.where(found.bounces, 1, 2))
    of_slip = start_of_slip_order(system, c, after, fired.leaves_cone)
    kept = jnp.where(after == regime, order, 0)
    chosen = jnp.where(into_flight, of_flight, jnp.where(into_slip, of_slip, kept))
    return chosen.astype(jnp.int32)
