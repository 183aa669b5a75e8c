"""Velocities after an event: those behind an impact, and the limit of a sequence of impacts."""

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from ...contact.guards import gap_rounding
from ...contact.jam import brake_to_jam
from ...contact.projection import push
from ...contact.space import Contact, contact
from ...contact.system import rates
from ...contact.zeno import complete_zeno
from ...numerics.arrays import where
from ...numerics.elementary import larger
from ...numerics.fusion_barrier import keep
from ...numerics.known_zeros import plus, times
from ...numerics.types import Scalar
from ..carry.problem import Problem
from .event_kind import Fired


class Motion(NamedTuple):
    """A state of motion at an event, and what contact quantities round away."""

    time: Scalar
    position: tuple
    velocity: tuple
    slip_speed: Scalar  # exactly 0 where it is
    leaving: Scalar  # normal speed away from the contact, of a tip that hit it
    impulse: Scalar  # normal


class Impact(NamedTuple):
    """What an impact was, for the sequence that it may belong to."""

    collides: Scalar
    approach: Scalar  # normal speed before
    friction: Scalar  # coefficient


def collide(system, c: Contact, time, q, v, fired: Fired, sign) -> tuple[Motion, Impact]:
    """Return the motion behind the impact of a closing gap, or of a jam (Painleve's impact without
    collision); unchanged elsewhere. docs/model.md, sections 6 and 7.

    ``c`` is the contact at (time, q, v), ``sign`` that of slip before the event.
    """
    law, jams = system.law, fired.jams
    moving = c.slip_speed != 0
    mu = jnp.zeros_like(c.b_t)
    if law is not None:
        mu = jnp.where(moving, law.coefficient(jnp.abs(c.slip_speed)), jnp.asarray(law.static))
    if system.coupled:
        braked, mu = brake_to_jam(system, c, sign, mu)
        v = where(jams, push(v, c.along_t, c.along_n, *braked), v)
        slowed = plus(c.slip_speed, c.w_tt * braked[0], times(c.w_tn, braked[1]))
        c = c._replace(slip_speed=jnp.where(jams, slowed, c.slip_speed))
    approach = jnp.where(jams, 0.0, c.normal_speed)
    collides = (fired.hits & (approach < 0)) | jams
    closing = jnp.minimum(approach, 0.0)
    found = keep(system.impact(c.w_tt, c.w_tn, c.w_nn, mu, c.slip_speed, closing, jams))
    v = where(collides, push(v, c.along_t, c.along_n, found.tangential, found.normal), v)
    impulse = jnp.where(collides, found.normal, 0.0)
    still = jnp.logical_or(fired.was_sticking, fired.turns)
    slip_speed = jnp.where(collides, found.slip_speed, jnp.where(still, 0.0, c.slip_speed))
    leaving = jnp.where(collides, found.normal_speed, jnp.where(fired.hits, c.normal_speed, 0.0))
    v, slip_speed, leaving, collides = keep((v, slip_speed, leaving, collides))
    return Motion(time, q, v, slip_speed, leaving, impulse), Impact(collides, approach, mu)


def complete(problem: Problem, system, motion: Motion, impact: Impact, fired: Fired, flown, end):
    """Return (the motion with a sequence of impacts completed where it is due, where that is).

    Forces are those of the velocities behind the impact; ``flown`` is the time since the event
    before, ``end`` the next known time, which the sequence must not pass.
    """
    time, q, v, slip_speed, leaving, impulse = motion
    c = contact(system, time, q, v)._replace(slip_speed=slip_speed)
    flown, left = flown.astype(leaving.dtype), (end - time).astype(leaving.dtype)
    speeds = leaving, impact.approach, slip_speed
    shortest = _shortest(problem, system, c, time, q)
    zeno = keep(complete_zeno(c, impact.friction, *speeds, flown, shortest, left))
    completes = keep(fired.hits & impact.collides & zeno.holds)
    falling = tuple(x + a * zeno.duration for x, a in zip(v, c.free, strict=True))
    landed = push(falling, c.along_t, c.along_n, zeno.tangential, zeno.normal)
    carried = tuple(
        x + zeno.duration * plus(y, times(n, -leaving / c.w_nn))
        for x, y, n in zip(q, rates(system, time, q, v), c.along_n, strict=True)
    )
    q, v = where(completes, carried, q), where(completes, landed, v)
    time = jnp.where(completes, time + zeno.duration, time)
    impulse = impulse + jnp.where(completes, zeno.normal, 0.0)
    slip_speed = jnp.where(completes, zeno.slip_speed, slip_speed)
    q, v, time, slip_speed = keep((q, v, time, slip_speed))
    leaving = jnp.where(completes, 0.0, leaving)
    return Motion(time, q, v, slip_speed, leaving, impulse), completes


def _shortest(problem: Problem, system, c: Contact, time, q) -> Scalar:
    """Return the time of the shortest flight that is told from contact: ``zeno_time``, or that of a
    flight which is no higher than the gap's rounding.
    """
    height = gap_rounding(system, time, q)
    fall = larger(-stop_gradient(c.b_n), jnp.finfo(height.dtype).tiny)
    return larger(problem.zeno_time, jnp.sqrt(8 * height / fall))
