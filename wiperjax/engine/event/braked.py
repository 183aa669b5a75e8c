"""The derivative of the time of a jam that slip was braked to (docs/model.md, section 7).

Steps end a rounding before D = 0, and the rest of the way takes no time (`contact.jam`). So the
event needs no motion; but derivatives at a fixed time grow in front of it without bound, as forces
do, and hold only with that of its time. They converge with the tolerance, slower than the motion.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from ...contact.guards import JAM
from ...contact.regimes import slip_sign
from ...numerics.runge_kutta import NODES
from ..carry.problem import Problem
from ..carry.state import State
from ..observers.base import Stretch, gathered
from ..trial.attempt import Node
from .event_time import time_to_event


def at_jam(problem: Problem, state: State) -> State:
    """Return ``state`` with the derivative of the time of a jam where one is due, not moved.

    One that an event has left behind, with D <= 0, is where that event is.
    """
    system = problem.system.on_piece(state.piece).on_sides(state.sides)
    t, q, v, still = state.time, state.position, state.velocity, jnp.zeros_like(state.time)
    jams = (state.due == JAM) & (slip_sign(state.regime) != 0) & (state.guards[JAM] > 0)
    shift = time_to_event(still, jams, system, t, q, v, state.regime, state.sides, state.due)
    short = shift.astype(q[0].dtype)
    node = Node(t, q, v, state.reactions)
    speeds, accelerations = state.rate
    q = tuple(x + short * s for x, s in zip(q, speeds, strict=True))
    v = tuple(x + short * a for x, a in zip(v, accelerations, strict=True))
    stretch = Stretch(
        system,
        t,
        still,
        shift,
        state.regime,
        (node,) * len(NODES),
        tuple((guard,) * len(NODES) for guard in state.guards),
        state.reach,
        (system, t + shift, q, v),
    )
    seen = gathered(problem.observer, "stretch", state.observed, stretch, jams)
    observed = jax.tree.map(_changing_like, state.observed, seen)
    return state._replace(time=t + shift, position=q, velocity=v, observed=observed)


def _changing_like(value, other):
    """Return ``value`` with the derivative of ``other``, computed only where one is taken."""
    return _with_derivative(value, other) if eqx.is_inexact_array(value) else value


@jax.custom_jvp
def _with_derivative(value, other):
    return value


@_with_derivative.defjvp
def _of_other(given, tangents):
    return given[0], tangents[1]
