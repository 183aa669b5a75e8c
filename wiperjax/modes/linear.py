"""Steady sliding of a system and the linear motion around it, by the engine's own accelerations.

Nothing is typed in by hand: the equilibrium is a root of the acceleration in slip at rest, the
linearisation its exact derivative by places and velocities. A contact that may open is held closed:
what is left are the coordinates along it.
"""

from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from ..contact.belts import AbstractBelt
from ..contact.guards import starting_sides
from ..contact.regimes import acceleration, friction_coefficient, slip_forces
from ..contact.space import contact
from ..contact.system import AbstractSystem, rates
from ..numerics.kept import Kept
from ..numerics.types import Coordinates

_FINDER = optx.LevenbergMarquardt(rtol=1e-13, atol=1e-13)
MOST_STEPS = 200
CLOSED = 1e-8  # of usual accelerations and places: what is larger is no equilibrium


class Linear(NamedTuple):
    """Steady sliding and its linearisation z' = A z, z = (positions, velocities) along the contact.

    ``exists``: one was found; else the numbers mean nothing, and there may be one elsewhere: a
    system that knows where says so (`sliding_near`).
    """

    position: jax.Array  # (n,)
    normal_force: jax.Array
    slip_speed: jax.Array
    matrix: jax.Array  # (2 m, 2 m)
    basis: jax.Array  # (n, m): the coordinates that z stands for
    exists: jax.Array


def judged_at(system: AbstractSystem) -> jax.Array:
    """Return the time [s] of steady sliding: 0, or when a belt that turns is fastest."""
    belt = getattr(system, "belt", None)
    return jnp.asarray(belt.judged_at if isinstance(belt, AbstractBelt) else 0.0, float)


def linear(system: AbstractSystem, near: Coordinates) -> Linear:
    """Return the steady sliding that is found from the place ``near``, every coordinate at rest and
    the belt as it moves at the time of `judged_at`. A pure function of the system's numbers: it
    may be mapped.
    """
    t = judged_at(system)
    system = system.on_piece(system.first_piece(t))
    n = len(near)
    scale = jnp.stack([jnp.asarray(x, float) for x in system.scales(n)[0]])
    start, rest = jnp.asarray(near, float), jnp.zeros(n)
    sign = jnp.sign(_slip_speed(system, t, start))

    def motion(z, sides=None):
        """q'' in slip, normal force, gap, D; of places and velocities z (2n,)."""
        return _slip(system, t, z[:n], z[n:], sign, sides)

    def still(place, sides=None):
        return motion(jnp.concatenate([place, rest]), sides)

    # what the forces there can make of a place of usual size: accelerations are measured by that
    size = jnp.max(jnp.abs(jax.jacfwd(lambda place: still(place)[0])(start)) @ scale)

    def residual(u, sides=None):
        accelerations, _, gap, _ = still(u * scale, sides)
        return accelerations / size, gap / scale.max()

    def sought(u, sides=None):
        return optx.least_squares(
            residual, _FINDER, u, args=sides, max_steps=MOST_STEPS, throw=False
        ).value

    def judged(u):
        """Whether there is steady sliding at a place, and its normal force and slip speed."""
        missed, gap = residual(u)
        _, force, _, d = still(u * scale)
        slip = _slip_speed(system, t, u * scale)
        exists = jnp.all(jnp.abs(missed) <= CLOSED) & (jnp.abs(gap) <= CLOSED)
        # where D <= 0 no slip lasts (docs/model.md, section 7)
        exists &= (force > 0) & (d > 0) & (jnp.sign(slip) == sign) & (sign != 0)
        return exists & _inside(system, t, u * scale), force, slip

    u = sought(start / scale)
    # It may stall beyond a corner of the forces, as where a yielding glass pushes no more: then the
    # start is the place that forces without the corner have.
    sides = starting_sides(system, *_at_rest(system, t, start))
    u = jnp.where(judged(u)[0], u, sought(sought(start / scale, sides)))
    exists, force, slip = judged(u)
    place = u * scale
    z = jnp.concatenate([place, rest])
    whole = jax.jacfwd(lambda z: jnp.concatenate([z[n:], motion(z)[0]]))(z)
    basis = _along(system, t, place)
    both = jax.scipy.linalg.block_diag(basis, basis)
    return Linear(place, force, slip, both.T @ whole @ both, basis, exists)


def _slip_speed(system: AbstractSystem, t, place):
    return jnp.asarray(system.slip_speed(*_at_rest(system, t, place)), float)


def _inside(system: AbstractSystem, t, place):
    """Whether a place is in the model: neither behind one of its ends nor behind a stop."""
    at = _at_rest(system, t, place)
    found = zip(starting_sides(system, *at), system.switches(*at), strict=True)
    return reduce(jnp.logical_and, (side * s >= 0 for side, s in found), jnp.asarray(True))


def _at_rest(system: AbstractSystem, t, place):
    """Return (t, q, v) of every coordinate at rest at a place (n,)."""
    q = tuple(place)
    return t, q, system.from_rates(t, q, tuple(jnp.zeros_like(x) for x in q))


def _slip(system: AbstractSystem, t, place, speeds, sign, sides=None):
    """Return q'' (n,), the normal force, the gap and D in slip of ``sign``; with forces continued
    from the ``sides`` of the switches, or as they are there."""
    q = tuple(place)
    v = tuple(jnp.asarray(x, float) for x in system.from_rates(t, q, tuple(speeds)))
    system = system.on_sides(starting_sides(system, t, q, v) if sides is None else sides)
    c = contact(system, t, q, v)
    force, d = slip_forces(c, sign, friction_coefficient(system, c, sign), system.unilateral)
    gap = c.gap if system.unilateral else jnp.zeros(())

    # a belt-relative velocity has its partner's acceleration in it: q'' is the rate of q'
    def rate(t, q, v):
        return tuple(rates(system, t, q, v))

    tangents = jnp.ones_like(t), rate(t, q, v), tuple(acceleration(c, force))
    _, accelerations = jax.jvp(rate, (t, q, v), tangents)
    return jnp.stack([jnp.asarray(a, float) for a in accelerations]), force.normal, gap, d


def _along(system: AbstractSystem, t, place):
    """Return an orthonormal basis (n, m) of the directions in which the contact may move closed."""
    n = len(place)
    if not system.unilateral:
        return jnp.eye(n)
    normal = jax.grad(lambda q: jnp.asarray(system.gap(t, tuple(q)), float))(place)
    full, _ = jnp.linalg.qr(jnp.concatenate([normal[:, None], jnp.eye(n)], axis=1))
    return full[:, 1:]


@Kept
def linear_at(system: AbstractSystem, near: Coordinates) -> Linear:
    """`linear`, compiled once for all systems of a class."""
    return linear(system, near)


@Kept
def linear_over(systems: AbstractSystem, near, shared) -> Linear:
    """`linear` of many systems: arrays of ``systems`` and ``near`` have the cells as their axis,
    what they share is ``shared``."""
    return jax.vmap(lambda varying, place: linear(eqx.combine(varying, shared), place))(
        systems, near
    )
