"""What the end of a phase of `diffrax_trajectory` changes: state, regime, guards that are zero."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from wiperjax import Event

from .diffrax_records import Cell, Motion, Solved
from .diffrax_wiper import (
    FLIGHT,
    GUARDS,
    LIMIT,
    LOWER,
    SLIP_NEG,
    SLIP_POS,
    STICK,
    UPPER,
    State,
    Strike,
    closed,
    impact,
)


class Ending(NamedTuple):
    """How a phase ends: one of these at most is true."""

    hits: Any  # the glass
    turns: Any  # the slip comes to zero
    lifts: Any
    leaves: Any  # the cone of stick
    kinks: Any
    limit: Any
    sampled: Any
    breaks: Any  # of the belt


def ending_of(found: Solved, regime, marked, kind) -> Ending:
    """Return how a phase in ``regime`` ends; ``kind``: of the mark, if it got there."""
    fired, guard = found.fired, found.guard
    sliding = (regime == SLIP_POS) | (regime == SLIP_NEG)
    return Ending(
        hits=fired & (regime == FLIGHT) & (guard == 0),
        turns=fired & sliding & (guard == 0),
        lifts=fired & sliding & (guard == 1),
        leaves=fired & (regime == STICK) & (guard <= 1),
        kinks=fired & ((guard == UPPER) | (guard == LOWER)),
        limit=fired & (guard == LIMIT),
        sampled=marked & (kind == 0),
        breaks=marked & (kind != 0),
    )


def changed(
    cell: Cell, motion: Motion, found: Solved, ending: Ending, end
) -> tuple[Motion, Strike]:
    """Return the motion behind the ending, and the impact (which holds where the tip ``hits``)."""
    zone, regime = motion.zone, motion.regime
    hits, turns, kinks = ending.hits, ending.turns, ending.kinks
    x, slip, y, vy = found.state
    piece = motion.piece + ending.breaks
    w = cell.wiper.on_piece(piece)
    strike = impact(w, zone, found.time, x, slip, vy, end)
    time, x, slip, vy = (
        jnp.where(hits, a, b) for a, b in zip(strike[:4], (found.time, x, slip, vy), strict=True)
    )
    y = jnp.where(hits, 0.0, y)
    slip = jnp.where(turns, 0.0, slip)
    side = jnp.where(found.guard == UPPER, 1, -1)
    edge = w.lip_length * jnp.sin(w.attack_angle + side * w.shoulder_angle)
    x = jnp.where(kinks, edge, x)
    zone = jnp.where(kinks, jnp.where(zone == 0, side, 0), zone)
    shut = (hits & (vy <= 0)) | turns | (ending.breaks & (regime == STICK))
    after = jnp.where(shut, closed(w, zone, time, x, slip), regime)
    after = jnp.where(ending.lifts, FLIGHT, after)
    after = jnp.where(ending.leaves, jnp.where(found.guard == 0, SLIP_NEG, SLIP_POS), after)
    vy = jnp.where(hits & (vy <= 0), 0.0, vy)
    state = State(x, slip, y, vy)
    return motion._replace(time=time, state=state, regime=after, zone=zone, piece=piece), strike


def kind_of(ending: Ending, strike: Strike, marked, before, after):
    """Return the kind of the event, 0 for none; ``marked``: that of the mark."""
    turned = jnp.where(
        after == STICK,
        int(Event.CAPTURE),
        jnp.where(after == FLIGHT, int(Event.LIFT_OFF), int(Event.REVERSAL)),
    )
    kind = marked
    for happens, name in (
        (ending.hits, strike.kind),
        (ending.turns, jnp.where(after == before, int(Event.TOUCH), turned)),
        (ending.lifts, int(Event.LIFT_OFF)),
        (ending.leaves, int(Event.RELEASE)),
        (ending.kinks, int(Event.KINK)),
        (ending.limit, int(Event.COLLAPSE)),
    ):
        kind = jnp.where(happens, name, kind)
    return kind


def orders_of(ending: Ending, guard, before, after: Motion):
    """Return the orders of the guards' zeros at the start of the phase that begins."""
    of_contact = jnp.where(
        after.regime == FLIGHT,
        jnp.where(ending.lifts, 3.0, jnp.where(after.state.vy > 0, 1.0, 2.0)),
        jnp.where(ending.leaves, 2.0, 1.0),
    )
    e = ending
    fresh = e.hits | e.turns | e.lifts | e.leaves | (e.breaks & (before == STICK))
    fresh = fresh & (after.regime != STICK)
    fresh = fresh & ((after.regime == FLIGHT) | (after.state.slip == 0))
    order = jnp.zeros(GUARDS).at[0].set(jnp.where(fresh, of_contact, 0.0))
    return order.at[jnp.where(ending.kinks, guard, GUARDS)].set(1.0, mode="drop")
