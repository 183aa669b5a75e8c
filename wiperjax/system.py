"""What the engine needs to know of a mechanical system: n coordinates and ONE frictional contact.

The engine knows nothing of wipers. A system states its free motion and its contact; everything
else (normal and tangential accelerations, the contact inertia W with its coupling) follows by
forward differentiation, so a bouncing ball or a block on a belt takes about twenty lines.

Positions and velocities come as tuples of n scalars and go back as tuples: small systems in a
batch are then stored one coordinate at a time, which is what vector units want.
"""

from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from .barrier import keep
from .friction import AbstractFriction
from .sparse import absent

Scalar = Any  # a float, or an array with one entry a lane
Coordinates = tuple[Scalar, ...]


class AbstractSystem(eqx.Module):
    """n coordinates q with velocities v, one contact, SI units throughout.

    Required: `free_acceleration`, `directions`, and `gap` (unilateral) or `normal_force`
    (bilateral). Frictional systems also have `slip_speed` and a `friction` law. Set
    ``unilateral = False`` for a contact that always touches under a prescribed normal force.
    """

    unilateral: ClassVar[bool] = True  # False: always touching, under a prescribed normal force

    @property
    def coupled(self) -> bool:
        """Whether W_tn can differ from zero, so that Painleve's D <= 0 has to be watched."""
        return self.unilateral and self.law is not None

    @property
    def law(self) -> AbstractFriction | None:
        """Friction law, or None for a frictionless contact (its slip is reported as SLIP_POS)."""
        return None

    @property
    def bounce(self) -> Scalar:
        """Poisson coefficient of restitution e in [0, 1]."""
        return 0.0

    @abstractmethod
    def free_acceleration(self, t: Scalar, q: Coordinates, v: Coordinates) -> Coordinates:
        """A^-1 (f - h): acceleration without contact forces, n values."""

    @abstractmethod
    def directions(self, t: Scalar, q: Coordinates) -> tuple[Coordinates, Coordinates]:
        """A^-1 J_t^T and A^-1 J_n^T: acceleration per unit tangential and normal contact force."""

    def prepared(self) -> "AbstractSystem":
        """Return the system with whatever does not change along a trajectory worked out once."""
        return self

    def gap(self, t: Scalar, q: Coordinates) -> Scalar:
        """Distance of the contact points, >= 0 (unilateral contacts)."""
        raise NotImplementedError("a unilateral system must define gap(t, q)")

    def normal_force(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Prescribed normal force > 0 (bilateral contacts)."""
        raise NotImplementedError("a bilateral system must define normal_force(t, q, v)")

    def slip_speed(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Tangential velocity of the contact point relative to its partner; friction opposes it."""
        return 0.0 * v[0]

    def rates(self, t: Scalar, q: Coordinates, v: Coordinates) -> Coordinates:
        """q' of the velocities ``v`` that the system computes with; the same unless overridden.

        A system may measure velocities relative to its moving partner: the slip speed is then a
        coordinate, without cancellation. All its functions take such ``v``; the outside sees q'.
        """
        return v

    def from_rates(self, t: Scalar, q: Coordinates, rates: Coordinates) -> Coordinates:
        """Inverse of `rates`."""
        return rates

    def switches(self, t: Scalar, q: Coordinates, v: Coordinates) -> tuple[Scalar, ...]:
        """Functions whose zeros are corners of the vector field (a spring's kink), or where the
        model ends (`ends`): smooth on either side of a zero, and of the sign that `on_sides` says.
        """
        return ()

    def ends(self, t: Scalar, q: Coordinates, v: Coordinates) -> tuple[Scalar, ...]:
        """Whether the model ends where a switch vanishes here, one answer a switch: if so, the
        trajectory is COLLAPSED there, else it has passed a corner. The Python value True: at every
        zero of the switch, which then is negative nowhere in the model.
        """
        return tuple(False for _ in self.switches(t, q, v))

    def break_time(self, piece: Scalar) -> Scalar:
        """Known time at which smooth piece ``piece`` of the prescribed motion ends."""
        return jnp.inf

    def first_piece(self, t: Scalar) -> Scalar:
        """Index of the smooth piece that begins at or holds just after ``t``."""
        return 0

    def reverses(self, piece: Scalar) -> Scalar:
        """True where the break that ends ``piece`` is a passage of the partner through rest."""
        return False

    def on_piece(self, piece: Scalar) -> "AbstractSystem":
        """Return the system with its prescribed motion continued smoothly from ``piece``."""
        return self

    def on_sides(self, sides: tuple[Scalar, ...]) -> "AbstractSystem":
        """Return the system continued smoothly across its switches, from where they have the signs
        ``sides``.

        Not needed for the values of forces, which are continuous there: but a stage at a corner,
        or a hair's breadth behind it, would have the derivative of the wrong side.
        """
        return self

    def default_state(self) -> tuple[Coordinates, Coordinates]:
        """Return (position, velocity) of the default start."""
        raise ValueError(
            "this system has no default start: pass initial_state=(position, velocity)"
        )

    def scales(self, n: int) -> tuple[Coordinates, Coordinates]:
        """Typical sizes of positions and velocities; absolute tolerances are rtol times these."""
        return (1.0,) * n, (1.0,) * n

    def output(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Velocity whose statistics and spectrum describe the motion."""
        return self.slip_speed(t, q, v)


class Contact(NamedTuple):
    """The contact at one instant, in contact space: ``(a_t, a_n) = (b_t, b_n) + W (l_t, l_n)``.

    What is zero for every state of the system is the Python number 0 (see `sparse`).
    """

    gap: Scalar
    normal_speed: Scalar
    slip_speed: Scalar
    free: Coordinates  # accelerations without contact force
    along_t: Coordinates  # A^-1 J_t^T
    along_n: Coordinates  # A^-1 J_n^T
    b_t: Scalar
    b_n: Scalar
    w_tt: Scalar
    w_tn: Scalar
    w_nn: Scalar
    load: Scalar  # prescribed normal force of a bilateral contact, else 0


def contact(system: AbstractSystem, t, q, v) -> Contact:
    """Return the contact-space quantities of ``system`` at (t, q, v).

    Speeds are linear in v, so W's columns are derivatives of the speeds along the directions;
    the bias terms are total time derivatives along (1, q', a_free).
    """
    free = keep(_cast(system.free_acceleration(t, q, v), v))
    directions = system.directions(t, q)
    along_t, along_n = (_cast(d, v) for d in directions)
    one, zero = jnp.ones_like(t), jnp.zeros_like(t)
    still = tuple(jnp.zeros_like(x) for x in q)

    def slip(t, q, v):
        return _like(system.slip_speed(t, q, v), v[0])

    def along(f, tangent_t, tangent_q, tangent_v):
        return jax.jvp(f, (t, q, v), (tangent_t, tangent_q, tangent_v))

    rates = _cast(system.rates(t, q, v), v)
    slip_speed, b_t = along(slip, one, rates, free)
    w_tt = along(slip, zero, still, along_t)[1]
    sparse_t, sparse_n = (
        tuple(x if absent(x) else y for x, y in zip(d, full, strict=True))
        for d, full in zip(directions, (along_t, along_n), strict=True)
    )

    if not system.unilateral:
        load = _like(system.normal_force(t, q, v), v[0])
        z = jnp.zeros_like(b_t)
        return Contact(z, z, slip_speed, free, sparse_t, sparse_n, b_t, z, w_tt, 0.0, z + 1, load)

    def approach(t, q, v):
        def gap(t, q):
            return _like(system.gap(t, q), q[0])

        return jax.jvp(gap, (t, q), (jnp.ones_like(t), _cast(system.rates(t, q, v), v)))

    (gap, normal_speed), (_, b_n) = along(approach, one, rates, free)
    w_nn = along(approach, zero, still, along_n)[1][1]
    w_tn = along(slip, zero, still, along_n)[1] if system.coupled else 0.0
    return Contact(
        gap, normal_speed, slip_speed, free, sparse_t, sparse_n, b_t, b_n, w_tt, w_tn, w_nn, 0.0
    )


def rates(system: AbstractSystem, t, q, v):
    """Return q' in the state's dtype."""
    return _cast(system.rates(t, q, v), v)


def _like(value, model):
    """Give a value the state's dtype and shape: a system may return a Python number, or float64."""
    return jnp.broadcast_to(jnp.asarray(value, model.dtype), model.shape)


def _cast(values, models):
    return tuple(_like(x, y) for x, y in zip(values, models, strict=True))
