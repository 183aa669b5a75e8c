"""Steady slip of the wiper over whole maps: where the lip leans, and whether it stays there.

Nothing is typed in by hand: the equilibrium is a root of the engine's own slip acceleration, and
the linearisation is its derivative by forward differentiation. docs/model.md, section 10, holds the
closed forms this is tested against.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from ..contact.belts import SteadyBelt
from ..contact.own_numbers import in_full
from ..contact.regimes import acceleration, friction_coefficient, slip_forces, slip_sign
from ..contact.space import contact
from ..numerics.kept import Kept
from ..numerics.sign_changes import SignChanges, sign_changes
from ..numerics.types import Scalar
from ..vocabulary import checks
from ..vocabulary.codes import Regime
from ..vocabulary.ranges import FINITE
from .wiper import Wiper

STRETCHES = 64  # of `sign_changes`: 2.8 degrees each
MOST_BRANCHES = 5  # three occur (one on each shoulder, a saddle on the neck)
_LANES = 16  # cells at a time: with more, most wait for the one whose angles take longest
# Cells are filled up to so many: few compilations. Two turns of the loop at least: of one XLA makes
# no loop, and rounds otherwise, so that a cell's last digit would tell the size of its block.
_FEWEST, _STEP = 2 * _LANES, 2048
_FINDER = optx.Bisection(rtol=1e-15, atol=1e-15, flip=False)
HALVINGS = 20  # of a grid's interval of 0.006 rad, to 6e-9


class SteadySlip(NamedTuple):
    """Steady slip and its linearisation ``m x'' + c_eff x' + k_eff x = 0`` in the tip coordinate.

    Each field has the shape of the map. Where no steady slip exists, ``exists`` is False and
    every other field is NaN.
    """

    x: Scalar  # of the tip [m]
    phi: Scalar  # [rad]
    normal_force: Scalar  # [N/m]
    growth_rate: Scalar  # largest real part of the eigenvalues [1/s]
    frequency: Scalar  # of the linear oscillation [Hz]; 0 where both eigenvalues are real
    c_eff: Scalar  # [N s/m per m]; below 0: oscillations grow
    k_eff: Scalar  # [N/m per m]; below 0: divergence
    mass: Scalar  # m, with hinge_mass the inertia that friction and kinematics leave [kg/m]
    exists: Scalar


def steady_slip(wiper: Wiper, belt_speed=None) -> SteadySlip:
    """Return steady slip on the branch that leans farthest along the belt's motion.

    For V > 0 that is the equilibrium of largest phi (docs/model.md, section 10), for V < 0 its
    mirror image.

    **Arguments:** ``wiper``, any of whose parameters may be arrays; ``belt_speed`` [m/s], constant,
    a number or an array of any shape (default: that of the wiper's belt at t = 0). Shapes are
    broadcast together.

    **Returns** a `SteadySlip` of that shape. A belt at rest has no steady slip. Where there is none
    fields are NaN and their derivatives 0: ask ``exists`` first.

    Raises ValueError for anything else.
    """
    checks.instance("wiper", wiper, Wiper, "a Wiper")
    if belt_speed is not None:
        checks.numbers("belt_speed", belt_speed, FINITE)
    return jax.tree.map(lambda x: x[..., 0], _over_map(wiper, belt_speed, 1))


def judged_slip(wiper: Wiper) -> SteadySlip:
    """Return steady slip at the time at which motions on the wiper's belt are linearised: of a belt
    that turns, at its peak (`AbstractBelt.judged_at`)."""
    return steady_slip(wiper, wiper.belt.judged_speed)


def steady_slip_branches(wiper: Wiper, belt_speed=None) -> SteadySlip:
    """Return all branches of steady slip; see `steady_slip`.

    The fields have one more axis, last, of length `MOST_BRANCHES`: the branches from the farthest
    along the belt's motion on, then NaN.
    """
    return _over_map(wiper, belt_speed, MOST_BRANCHES)


def check_rigid(name: str, wiper: Wiper) -> None:
    """Raises ValueError for a lip on glass that yields: its steady slip is another, and so are the
    poorer models that are made of it."""
    if not wiper.unilateral:
        must = f"{name} must be on glass that does not yield (of others see `modes`)"
        raise ValueError(f"{must}, but was a {type(wiper).__name__}")


def map_shape(*trees) -> tuple[int, ...]:
    """Common shape of all numbers in some pytrees. Raises ValueError if there is none."""
    shapes = [np.shape(leaf) for leaf in jax.tree.leaves(trees)]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:  # NumPy counts the numbers of a wiper, and says "arg 21"
        had = " and ".join(map(str, sorted({shape for shape in shapes if shape})))
        raise ValueError(f"numbers must have shapes that fit together, but had {had}") from None


def _over_map(wiper: Wiper, belt_speed, branches: int) -> SteadySlip:
    check_rigid("wiper", wiper)
    wiper = in_full(wiper)
    if belt_speed is None:
        belt_speed = wiper.belt.velocity(0.0, wiper.belt.first_piece(jnp.asarray(0.0)))
    # the belt's own parameters do not matter any more, nor do their shapes
    wiper = replace(wiper, belt=SteadyBelt(1.0))
    shape = map_shape(wiper, belt_speed)
    size = int(np.prod(shape))
    padded = _FEWEST if size <= _FEWEST else -(-size // _STEP) * _STEP

    def flat(value):
        # 0 and 1 become Python numbers (numpy's are traced): their terms are then not computed
        if isinstance(value, int):
            return value
        if isinstance(value, float) and value in (0, 1):
            return float(value)
        if np.ndim(value) == 0:  # what all cells share is computed once
            return jnp.asarray(value, float)
        return whole(value)

    def whole(value):
        every = jnp.broadcast_to(jnp.asarray(value, float), shape).ravel()
        return jnp.concatenate([every, jnp.ones(padded - size)])

    found = _map(jax.tree.map(flat, wiper), whole(belt_speed), branches)
    return jax.tree.map(lambda x: x[:size].reshape(*shape, branches), found)


@Kept
def _map(wiper, belt_speed, branches):
    varying, fixed = eqx.partition((wiper, belt_speed), lambda x: np.ndim(x) > 0)  # of all cells

    def one(varying):
        wiper, speed = eqx.combine(varying, fixed)
        return equilibria(replace(wiper, belt=SteadyBelt(speed)), branches)

    on_host = jax.default_backend() == "cpu"  # an accelerator takes as long for few as for many
    lanes = _LANES if on_host else len(belt_speed) // 2
    return jax.lax.map(one, varying, batch_size=lanes)


class _Motion(NamedTuple):
    """Slip along the glass at one angle and tip velocity."""

    acceleration: Scalar  # x'' [m/s^2]
    normal_force: Scalar
    mass: Scalar  # D / det W: what a force along the glass has to move
    holds: Scalar  # pressing, and D > 0: this slip can be


@eqx.filter_jit  # traced once for all that asks for it
def _slip(wiper: Wiper, x, velocity) -> _Motion:
    """Return the engine's slip with the tip at (x, 0) moving along the glass, slower than it."""
    t = jnp.zeros_like(x)
    q = (x, jnp.zeros_like(x))
    v = wiper.from_rates(t, q, (velocity, jnp.zeros_like(x)))
    c, sign = contact(wiper, t, q, v), slip_sign(jnp.asarray(int(Regime.SLIP_NEG)))
    force, d = slip_forces(c, sign, friction_coefficient(wiper, c, sign), wiper.unilateral)
    mass = d / (c.w_tt * c.w_nn - c.w_tn * c.w_tn)
    return _Motion(acceleration(c, force)[0], force.normal, mass, (force.normal > 0) & (d > 0))


def _root(force, change: SignChanges) -> Scalar:
    """Return where ``force`` vanishes within a change of its sign."""
    turned = jnp.where(change.falls, 1.0, -1.0)  # bisection wants a negative lower value

    def found(force, start):
        place = optx.root_find(
            lambda place, _: turned * force(place),
            _FINDER,
            start,
            options={"lower": change.after, "upper": change.before},
            max_steps=HALVINGS,
            throw=False,
        ).value
        # one step of Newton's squares what is left; at a fold, of slope 0, it stays within that
        value, slope = jax.jvp(force, (place,), (jnp.ones_like(place),))
        left = (change.before - change.after) / 2**HALVINGS
        return place - jnp.clip(value / jnp.where(slope == 0, 1, slope), -left, left)

    return jax.lax.custom_root(
        force,
        0.5 * (change.before + change.after),
        found,
        # one number: a solver of equations would stop all cells for one at a fold, where the
        # slope is 0; what is no root has none
        tangent_solve=lambda slope, y: y / jnp.where(change.exists, slope(jnp.ones_like(y)), 1),
    )


def equilibria(wiper: Wiper, branches: int) -> SteadySlip:
    """Return the first ``branches`` equilibria of one wiper on a `SteadyBelt`, (branches,) each.

    A pure function of the wiper's numbers: it may be mapped and differentiated.
    """
    speed: Scalar = jnp.asarray(wiper.belt.velocity(0.0, 0), float)
    along = jnp.where(speed < 0, -1.0, 1.0)
    # a belt that moves back is a mirrored blade: angles of the grid are the same for all cells
    wiper = replace(wiper, belt=SteadyBelt(along * speed), attack_angle=along * wiper.attack_angle)

    def position(lean):
        return wiper.lip_length * jnp.sin(lean)

    def push(wiper, lean):
        """Force along the glass, towards the belt's motion, over the load, finite at 90 degrees;
        whether D > 0; and the normal force over the load."""
        x = position(lean)
        motion = _slip(wiper, x, jnp.zeros_like(x))
        force = wiper.tip_mass / wiper.normal_load * motion.acceleration
        return jnp.cos(lean) * force, motion.mass > 0, motion.normal_force / wiper.normal_load

    # downwards from the collapse angle, so that the first change is the first branch
    still_wiper = jax.lax.stop_gradient(wiper)
    edge = jnp.asarray(still_wiper.collapse_angle, float) * (1 - 1e-9)
    changes = sign_changes(partial(push, still_wiper), edge, -edge, STRETCHES, branches)

    def branch(change):
        lean = _root(lambda lean: push(wiper, lean)[0], change)
        x = position(lean)
        still, one = jnp.zeros_like(x), jnp.ones_like(x)

        def motion(x, v):
            return _slip(wiper, x, v)

        rest, by_x = jax.jvp(motion, (x, still), (one, still))
        by_v = jax.jvp(motion, (x, still), (still, one))[1]
        stiff, damp = by_x.acceleration, by_v.acceleration
        spread = damp * damp + 4 * stiff
        # the root of a positive number in either case: that of zero has no derivative
        root = 0.5 * jnp.sqrt(jnp.where(spread == 0, 1.0, jnp.abs(spread)))
        growth = 0.5 * damp + jnp.where(spread > 0, root, 0.0)
        turn = jnp.where(spread < 0, root, 0.0)
        exists = change.exists & rest.holds & (speed != 0)

        def known(value):
            return jnp.where(exists, value, jnp.nan)

        return SteadySlip(
            x=known(along * x),
            phi=known(along * lean),
            normal_force=known(rest.normal_force),
            growth_rate=known(growth),
            frequency=known(turn / (2 * np.pi)),
            c_eff=known(-rest.mass * damp),
            k_eff=known(-rest.mass * stiff),
            mass=known(rest.mass),
            exists=exists,
        )

    return jax.vmap(branch)(changes)
