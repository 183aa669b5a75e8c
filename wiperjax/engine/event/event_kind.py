"""Which event it is: told before the state changes, and named after it."""

from typing import NamedTuple

import jax.numpy as jnp

from ...contact.guards import FIRST, JAM, SECOND
from ...contact.regimes import slip_sign
from ...numerics.fusion_barrier import keep
from ...numerics.types import Scalar
from ...vocabulary.codes import Event, Regime


class Fired(NamedTuple):
    """What happens at an event, a mask each; of the first six at most one holds in a lane."""

    hits: Scalar  # the gap closes
    turns: Scalar  # the slip speed vanishes
    leaves_cone: Scalar  # stick forces reach the cone of friction
    lifts: Scalar  # the normal force vanishes
    jams: Scalar  # D vanishes under load
    retest: Scalar  # a corner while the tip sticks, or what begins to press on a tip at rest
    was_sticking: Scalar
    was_flying: Scalar


def what_fires(system, regime, slot, fires, breaks, kinks, slip_speed) -> Fired:
    """Return what the guard of ``slot`` means in a regime (where ``fires``), or a break; ``kinks``:
    a switch has changed its side."""
    flying, sticking = regime == Regime.FLIGHT, regime == Regime.STICK
    sliding = ~flying & ~sticking
    again = breaks & sticking
    if not system.unilateral:  # its load may have begun: what rode along by chance is held now
        again = again | (kinks & sliding & (slip_speed == 0))
    hits, turns, leaves_cone, lifts, jams, retest = keep(
        (
            fires & flying & (slot == FIRST),
            fires & sliding & (slot == FIRST),
            fires & sticking & (slot <= SECOND),
            fires & sliding & (slot == SECOND),
            fires & sliding & (slot == JAM) & system.coupled,
            again,
        )
    )
    return Fired(hits, turns, leaves_cone, lifts, jams, retest, sticking, flying)


def event_kind(fired: Fired, slips, collides, completes, leaving, sign, after) -> Scalar:
    """Return the `Event` of what fired, 0 where nothing did; switches and breaks are named by who
    knows of them.

    ``slips``: the tip that left the cone slips; ``collides`` and ``completes``: an impact, and one
    that ended a sequence; ``leaving``: normal speed after it; ``sign``: of slip before, and
    ``after`` the regime.
    """
    turn = jnp.where(
        after == Regime.STICK,
        int(Event.CAPTURE),
        jnp.where(
            after == Regime.FLIGHT,
            int(Event.LIFT_OFF),
            jnp.where(slip_sign(after) == -sign, int(Event.REVERSAL), int(Event.TOUCH)),
        ),
    )
    hit = jnp.where(leaving > 0, int(Event.IMPACT), int(Event.TOUCH))
    hit = jnp.where(collides, int(Event.IMPACT), hit)
    hit = jnp.where(completes, int(Event.ZENO), hit)
    kind = jnp.zeros_like(after)
    for condition, name in (
        (fired.hits, hit),
        (fired.turns, turn),
        (fired.leaves_cone, jnp.where(slips, int(Event.RELEASE), int(Event.LIFT_OFF))),
        (fired.lifts, int(Event.LIFT_OFF)),
        (fired.jams, int(Event.JAM)),
    ):
        kind = jnp.where(condition, name, kind)
    return kind
