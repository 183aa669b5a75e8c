"""Moreau-Jean time-stepping (theta = 1/2) of one contact with friction, vmapped.

One step of fixed length h takes smooth forces by the theta rule, and the contact as an impulse
over the step, with Newton's impact law and Coulomb's friction at the speeds AFTER the step:

    v+ = v + h (a(q, v) + a(q+, v+)) / 2 + A^-1 J^T p       q+ = q + h (q' + q'+) / 2
    0 <= u_n+ + e u_n  perpendicular  p_n >= 0              p_t in -mu p_n Sgn(u_t+)

where the gap forecast half a step ahead is closed; else p = 0. (M. Jean, Comput. Methods Appl.
Mech. Engrg. 177 (1999) 235-257; V. Acary and B. Brogliato, Numerical Methods for Nonsmooth
Dynamical Systems, Springer 2008, chapter 10.) There are no events: accumulating bounces, sticking
and lift-off pass inside a step, at first order in h. mu is that of the speed before the step.

Newton's law here against Poisson's of the engine: with W_tn = 0 (no hinge mass), and whenever slip
keeps its sign through the impact, both give u_n+ = -e u_n and the same impulses. They differ where
slip stops or turns during an impact of a coupled contact.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from wiperjax.contact.system import AbstractSystem

from ..harness.batching import absent, arrays, at_samples, over_cells
from ..harness.interface import Answer
from ..scenes.scene import Scene

ITERATIONS = 3  # of Newton's method on the smooth forces: the shoulder has a corner


class ContactImpulse(NamedTuple):
    tangential: jax.Array
    normal: jax.Array
    solved: jax.Array  # False where no impulse satisfies the laws (Painleve)


def newton_impact(w, mu, u_t, u_n) -> ContactImpulse:
    """Return p with u+ = u + W p, 0 <= u_n+ perp p_n >= 0, p_t in -mu p_n Sgn(u_t+), enumerated.

    ``w`` = ((W_tt, W_tn), (W_nt, W_nn)) need not be symmetric (implicit forces are in it). ``u_n``
    has the restitution term e u_n^- added. Open contact first, then stick, then slip either way.
    """
    (tt, tn), (nt, nn) = w
    det = tt * nn - tn * nt
    p_t, p_n = (tn * u_n - nn * u_t) / det, (nt * u_t - tt * u_n) / det
    sticks = (p_n >= 0) & (jnp.abs(p_t) <= mu * p_n)

    def slip(sign):
        d = nn - sign * mu * nt
        normal = -u_n / d
        fits = (d > 0) & (sign * (u_t + (tn - sign * mu * tt) * normal) >= 0)
        return -sign * mu * normal, normal, fits

    (pos_t, pos_n, pos), (neg_t, neg_n, neg) = slip(1.0), slip(-1.0)
    # of two possible slips the one that the free motion pushes
    forward = pos & (~neg | (u_t >= 0))
    opens = u_n >= 0
    touching_t = jnp.where(sticks, p_t, jnp.where(forward, pos_t, neg_t))
    touching_n = jnp.where(sticks, p_n, jnp.where(forward, pos_n, neg_n))
    return ContactImpulse(
        jnp.where(opens, 0.0, touching_t),
        jnp.where(opens, 0.0, touching_n),
        opens | sticks | pos | neg,
    )


def _inverse(m):
    """Inverse of a 2 by 2 matrix, without a factorisation per lane."""
    (a, b), (c, d) = m
    return jnp.array([[d, -b], [-c, a]]) / (a * d - b * c)


def step(system: AbstractSystem, t, q, v, h, theta=0.5):
    """Return (q, v, solved) one step later, for arrays ``q`` and ``v`` of two coordinates."""
    # the whole step belongs to the smooth piece of the belt that holds in its middle
    system = system.on_piece(jnp.asarray(system.first_piece(t + 0.5 * h)))
    end = t + h

    def stack(values):
        return jnp.stack([jnp.broadcast_to(jnp.asarray(x, q.dtype), ()) for x in values])

    free = lambda t, q, v: stack(system.free_acceleration(t, tuple(q), tuple(v)))
    rate = lambda t, q, v: stack(system.rates(t, tuple(q), tuple(v)))
    rate_now, free_now = rate(t, q, v), free(t, q, v)
    middle = q + 0.5 * h * rate_now
    closed = system.gap(t, tuple(middle)) <= 0
    along = jnp.stack([stack(column) for column in system.directions(t, tuple(middle))])

    def after(v_end):
        return q + h * ((1 - theta) * rate_now + theta * rate(end, q, v_end))

    def residual(v_end):
        pull = (1 - theta) * free_now + theta * free(end, after(v_end), v_end)
        return v_end - v - h * pull

    def speeds(v):
        """Slip and normal speed of the contact: linear in the velocities."""
        gap = lambda t, q: jnp.asarray(system.gap(t, tuple(q)), q.dtype)
        there = (jnp.ones_like(end), rate(end, middle, v))
        slip = jnp.asarray(system.slip_speed(end, tuple(middle), tuple(v)), q.dtype)
        return jnp.stack([slip, jax.jvp(gap, (end, middle), there)[1]])

    jacobian = jax.jacfwd(speeds)(v)
    slip_now, normal_now = speeds(v)
    scale = jnp.max(jnp.abs(v)) + h * jnp.max(jnp.abs(free_now))
    at_rest = jnp.abs(slip_now) <= 1e-9 * scale
    law = system.law
    assert law is not None
    mu = jnp.where(at_rest, law.static, law.coefficient(jnp.abs(slip_now)))

    v_end, solved = v, jnp.asarray(True)
    for _ in range(ITERATIONS):
        inverse = _inverse(jax.jacfwd(residual)(v_end))
        v_free = v_end - inverse @ residual(v_end)
        u_t, u_n = speeds(v_free)
        p = newton_impact(jacobian @ inverse @ along.T, mu, u_t, u_n + system.bounce * normal_now)
        impulse = jnp.where(closed, p.tangential * along[0] + p.normal * along[1], 0.0)
        v_end, solved = v_free + inverse @ impulse, p.solved | ~closed
    return after(v_end), v_end, solved


def trajectory(system, start, duration, steps: int, blocks: int, theta=0.5):
    """Return positions, velocities q' (blocks + 1, 2) at block ends, and whether all was solved.

    ``blocks`` blocks of ``steps`` steps each; ``start`` = (x, y, x', y').
    """
    h = duration / (steps * blocks)
    system = system.prepared()
    q, v = start[:2], start[2:]
    first = system.on_piece(jnp.asarray(system.first_piece(0.0 * h)))
    v = jnp.stack([jnp.asarray(x, q.dtype) for x in first.from_rates(0.0 * h, tuple(q), tuple(v))])

    def one(i, carry):
        q, v, solved = carry
        q, v, fine = step(system, i * h, q, v, h, theta)
        return q, v, solved & fine

    def block(carry, k):
        carry = jax.lax.fori_loop(k * steps, (k + 1) * steps, one, carry)
        return carry, carry[:2]

    carry = (q, v, jnp.asarray(True))
    (_, _, solved), (position, velocity) = jax.lax.scan(block, carry, jnp.arange(blocks))
    position = jnp.concatenate([q[None], position])
    velocity = jnp.concatenate([v[None], velocity])
    times = h * steps * jnp.arange(blocks + 1)

    def outside(t, q, v):
        local = system.on_piece(jnp.asarray(system.first_piece(t)))
        return jnp.stack([jnp.asarray(x) for x in local.rates(t, tuple(q), tuple(v))])

    return position, jax.vmap(outside)(times, position, velocity), solved


@partial(jax.jit, static_argnames=("zeros", "blocks"))
def run(wiper, start, duration, steps, zeros, blocks):
    """`trajectory` of all cells; compiled once, whatever the scene's numbers and the step."""
    one = lambda wiper, start: trajectory(wiper, start, duration, steps, blocks)
    return over_cells(one, wiper, zeros, start)


class MoreauJean:
    """Ours, in JAX; the setting is the step as a fraction of the duration."""

    name = "Moreau-Jean"
    setting_name = "step / duration"
    settings = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
    cells = 32

    def available(self):
        return None

    def prepare(self, scene: Scene, setting: float):
        blocks = min(len(scene.sample_times), round(1 / setting))
        steps = round(1 / setting / blocks)
        fixed = (arrays(scene.wiper), jnp.asarray(scene.start), scene.duration)
        names = dict(zeros=absent(scene), blocks=blocks)
        jax.block_until_ready(run(*fixed, 0, **names))  # compiles
        ends = scene.duration * np.arange(blocks + 1) / blocks

        def answer() -> Answer:
            position, velocity, solved = map(np.asarray, run(*fixed, steps, **names))
            q, v = (at_samples(ends, x, scene.sample_times) for x in (position, velocity))
            stopped = ~solved | ~np.isfinite(q).all(axis=(1, 2))
            count = np.full(scene.cells, steps * blocks)
            return Answer(scene.sample_times, q, v, None, None, stopped, count)

        return answer


RIVALS = (MoreauJean(),)
