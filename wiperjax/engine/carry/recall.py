"""What the motion did before, by which it is resumed in a regime: its step, and how long it stayed.

Motion near a cycle repeats itself: where it has come into a regime as it did before, it is expected
to leave it after the same time, by the same event. A bounce is expected to end as one in a constant
acceleration does (`transition`). A trial step is then made to end there. As with an event foreseen
from a polynomial (`first_zero`) this decides the length of a step and no more.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import FIRST
from ...numerics.arrays import pick, where
from ...numerics.types import Scalar
from ...vocabulary.codes import Regime

STICK, SLIP, FLIGHT = range(3)
WAYS = 4  # into stick or slip, from stick or from elsewhere
LEAST = 1e-2  # of the controller's step: what is left of a stay may be a remnant of rounding


class Stay(NamedTuple):
    """How one kind of stay in a regime ended."""

    duration: Scalar  # after this time, 0 if there was none yet
    slot: Scalar  # by this guard


class End(NamedTuple):
    """When, and by which guard, a stay ends."""

    time: Scalar
    slot: Scalar


class Memory(NamedTuple):
    """What is kept of a trajectory's past."""

    steps: tuple  # the controller's last step in stick, slip and flight
    stays: tuple[Stay, ...]  # the last one of each of the `WAYS`
    way: Scalar  # index of the present stay, -1 if it has none
    expected: End


def nothing(time, step) -> Memory:
    """Return the memory of a trajectory that starts at ``time`` with ``step``."""
    no, never = jnp.full_like(time, -1, jnp.int32), jnp.full_like(time, -jnp.inf)
    return Memory((step,) * 3, (Stay(0.0 * step, no),) * WAYS, no, End(never, no))


def aim(state) -> tuple[Scalar, Scalar]:
    """Return the slot that the next trial step is to end on, or -1, and its length then.

    An end that was repeated before is known better than one that a polynomial foresees.
    """
    left = state.memory.expected.time - state.time
    bounces = (state.regime == Regime.FLIGHT) & (state.time == state.last_event)
    least = jnp.where(bounces, 0.0, LEAST * state.step)
    recalled = (state.tries == 0) & (left > least) & (left <= state.step)
    slot = state.memory.expected.slot
    return jnp.where(recalled, slot, state.target), jnp.where(recalled, left, state.trial)


def remember(state, regime, time, bounce, happens, fires) -> tuple[Memory, Scalar]:
    """Return the memory behind an event that leads into ``regime`` at ``time``, and the step to
    resume there.

    ``bounce``: how long a flight that begins with an impact is to last, else 0. ``happens``: there
    is an event; ``fires``: of the motion itself, not a break of the prescribed one.

    Flights are not recalled: bounces die away, and where a state has too few digits to see that, a
    flight that is taken to last as long as the one before never ends in rest.
    """
    memory: Memory = state.memory
    old, new = _kind(state.regime), _kind(regime)
    steps = tuple(
        jnp.where(happens & (old == i), state.step, s) for i, s in enumerate(memory.steps)
    )
    step = jnp.where(happens & (old != new), pick(steps, new), state.step)

    ended = Stay(state.time - state.last_event, state.due)
    stays = tuple(
        where(fires & (memory.way == i), ended, stay) for i, stay in enumerate(memory.stays)
    )
    way = jnp.where(fires & (new != FLIGHT), 2 * (old == STICK) + new, -1)
    last = pick(stays, way)
    expected = End(jnp.where(way >= 0, time + last.duration, -jnp.inf), last.slot)
    expected = where(bounce > 0, End(time + bounce, FIRST), expected)
    expected = where(happens, expected, memory.expected)
    way = jnp.where(happens, way, memory.way).astype(jnp.int32)
    return stop_gradient(Memory(steps, stays, way, expected)), stop_gradient(step)


def _kind(regime):
    """Index of a regime's step."""
    return jnp.where(
        regime == Regime.STICK, STICK, jnp.where(regime == Regime.FLIGHT, FLIGHT, SLIP)
    )
