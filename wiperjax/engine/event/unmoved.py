"""The derivative of the time of an event that no step is made for: it is where the motion is.

Of the end of a step that came within rounding of a guard's zero, too near for another step. And of
the jam that slip was braked to (docs/model.md, section 7): steps end a rounding before D = 0, and
the rest of the way takes no time (`contact.jam`). Derivatives at a fixed time grow in front of it
without bound, as forces do, and hold only with that of its time; they converge with the tolerance,
slower than the motion.
"""

import equinox as eqx
import jax.numpy as jnp

from ...contact.guards import JAM
from ...contact.regimes import slips
from ...numerics.runge_kutta import NODES
from ..carry.problem import Problem
from ..carry.state import State
from ..observers.base import Stretch, gathered
from ..trial.attempt import Node
from .event_time import time_to_event


def unmoved(problem: Problem, state: State) -> State:
    """Return ``state`` with the derivative of the time of such an event where one is due.

    One at the instant of another is where that is: it moves with it, whatever its own guard does.
    So does one at the very start of a motion. Costs nothing but where derivatives are taken.
    """
    time, q, v, observed = _as_they_are(problem, state)
    return state._replace(time=time, position=q, velocity=v, observed=observed)


@eqx.filter_custom_jvp
def _as_they_are(problem: Problem, state: State):
    return state.time, state.position, state.velocity, state.observed


@_as_they_are.def_jvp
def _as_they_move(primals, tangents):
    _, changes = eqx.filter_jvp(_moved, primals, tangents)
    return _as_they_are(*primals), changes


def _moved(problem: Problem, state: State):
    """Time, position, velocity and record of a ``state`` at the event that is due."""
    system = problem.system.on_piece(state.piece).on_sides(state.sides)
    t, q, v, still = state.time, state.position, state.velocity, jnp.zeros_like(state.time)
    due = (state.due >= 0) & (state.streak == 1) & (state.time > state.last_event)
    if system.coupled:  # that of a jam with D <= 0 is where an event has left it behind
        jams = (state.due == JAM) & slips(state.regime)
        due = jnp.where(jams, state.guards[JAM] > 0, due)
    shift = time_to_event(still, due, system, t, q, v, state.regime, state.sides, state.due)
    short = shift.astype(q[0].dtype)
    node = Node(t, q, v, state.reactions)
    speeds, accelerations = state.rate
    moved = (
        t + shift,
        tuple(x + short * s for x, s in zip(q, speeds, strict=True)),
        tuple(x + short * a for x, a in zip(v, accelerations, strict=True)),
    )
    stretch = Stretch(
        system,
        t,
        still,
        shift,
        state.regime,
        (node,) * len(NODES),
        tuple((guard,) * len(NODES) for guard in state.guards),
        state.reach,
        (system, *moved),
    )
    # where statistics begin with it, the stretch behind it counts what is in front of that
    counts = due & (t != problem.mark)
    return *moved, gathered(problem.observer, "stretch", state.observed, stretch, counts)
