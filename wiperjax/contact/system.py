"""What the engine needs to know of a mechanical system: n coordinates and ONE frictional contact.

The engine knows nothing of wipers. A system states its free motion and its contact; everything
else (normal and tangential accelerations, the contact inertia W with its coupling) follows by
forward differentiation, so a bouncing ball or a block on a belt takes about twenty lines.

Positions and velocities come as tuples of n scalars and go back as tuples: small systems in a
batch are then stored one coordinate at a time, which is what vector units want.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..numerics.types import Coordinates, Scalar
from ..vocabulary import checks, declared
from ..vocabulary.parameters import Parameter
from .card import card
from .friction import AbstractFriction
from .impact import Impulse, poisson_impact


class AbstractSystem(eqx.Module):
    """n coordinates q with velocities v, one contact, SI units throughout.

    Required: `free_acceleration`, `directions`, and `gap` (unilateral) or `normal_force`
    (bilateral). Frictional systems also have `slip_speed` and a field ``friction``. Set
    ``unilateral = False`` for a contact that always touches under a prescribed normal force.
    """

    unilateral: ClassVar[bool] = True  # False: always touching, under a prescribed normal force
    coordinates: ClassVar[tuple[str, ...]] = ()  # their names in maps and runs; else q0, q1, ..
    of_a_blade: ClassVar[bool] = False  # coordinates are those of a tip [m]
    per_metre: ClassVar[bool] = False  # forces are those on a metre of a blade [N/m], not [N]
    valid_where: ClassVar[str] = ""  # the model holds: words for a start from where it does not
    stops: ClassVar[tuple[int, ...]] = ()  # places among `switches` of those that are stops

    known: ClassVar[Mapping[str, Parameter]] = {}  # of parameters that it does not declare itself

    def __check_init__(self):
        name = f"{type(self).__name__}.coordinates"
        checks.names(name, self.coordinates)
        if len(set(self.coordinates)) < len(self.coordinates):  # nothing could be told by its name
            raise ValueError(f"{name} must be names that differ, but was {self.coordinates}")
        declared.check(self)

    def _repr_html_(self) -> str:
        """Its parameters with their units, as a notebook shows them."""
        return card(self, self.known)

    @property
    def idle(self) -> tuple[str, ...]:
        """Names of the numbers that have no part, because another field stands for them."""
        return ()

    @property
    def coupled(self) -> bool:
        """Whether W_tn can differ from zero, so that Painleve's D <= 0 has to be watched."""
        return self.unilateral and self.law is not None

    @property
    def lifted(self) -> Scalar:
        """Whether a bilateral contact is on the side of its switches (`on_sides`) where it would
        open if it were not held: statistics count that as flight."""
        return False

    @property
    def law(self) -> AbstractFriction | None:
        """Friction law, or None for a frictionless contact (its slip is reported as SLIP_POS);
        that of the field ``friction``, unless overridden."""
        return getattr(self, "friction", None)

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

    def impact(self, w_tt, w_tn, w_nn, mu, slip_speed, normal_speed, jam) -> Impulse:
        """Impulse of an impact at these speeds, and the speeds behind it: Poisson's law with
        Coulomb's friction along the impulse (`contact.impact`) unless overridden. ``w_..`` is the
        contact inertia, ``jam`` Painleve's impact without collision.
        """
        return poisson_impact(w_tt, w_tn, w_nn, mu, self.bounce, slip_speed, normal_speed, jam)

    def prepared(self) -> "AbstractSystem":
        """Return the system with whatever does not change along a trajectory worked out once."""
        return self

    def gap(self, t: Scalar, q: Coordinates) -> Scalar:
        """Distance of the contact points, >= 0 (unilateral contacts). It and its rate are
        continuous along a motion: a corner, in time or in space, has to be rounded.
        """
        raise NotImplementedError("a unilateral system must define gap(t, q)")

    def normal_force(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Prescribed normal force (bilateral contacts); a motion with friction ends where it is
        below zero, with `NO_CONSISTENT_REGIME`."""
        raise NotImplementedError("a bilateral system must define normal_force(t, q, v)")

    def slip_speed(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Tangential velocity of the contact point relative to its partner, with its sign and
        linear in v; friction opposes it. It is continuous, also where a piece of the motion ends.
        """
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
        """Functions whose zeros are corners of the vector field (a spring's kink), where the model
        ends (`ends`), or stops (`rebound`): smooth on either side of a zero, and of the sign that
        `on_sides` says.
        """
        return ()

    def ends(self, t: Scalar, q: Coordinates, v: Coordinates) -> tuple[Scalar, ...]:
        """Whether the model ends where a switch vanishes here, one answer a switch: if so, the
        trajectory is COLLAPSED there, else it has passed a corner. The Python value True: at every
        zero of the switch, which then is negative nowhere in the model.
        """
        return tuple(False for _ in self.switches(t, q, v))

    def rebound(
        self, stop: int, t: Scalar, q: Coordinates, v: Coordinates, closed: Scalar
    ) -> Coordinates:
        """Velocities behind a blow: where the switch of place ``stop``, one of ``stops``, vanishes.

        A stop is touched for an instant; its switch is positive everywhere in the model, and not
        on its way down behind the blow. ``closed``: whether the contact is. If so, the blow is an
        impact of both: it may open the contact, and may not drive it in.
        """
        raise NotImplementedError("a system with stops must define rebound(stop, t, q, v, closed)")

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
        """Return the system with its prescribed motion continued smoothly from ``piece``: in the
        field of that name, if it has one."""
        return self._with("piece", piece)

    def on_sides(self, sides: tuple[Scalar, ...]) -> "AbstractSystem":
        """Return the system continued smoothly across its switches, from where they have the signs
        ``sides``: in the field of that name, if it has one.

        Not needed for the values of forces, which are continuous there: but a stage at a corner,
        or a hair's breadth behind it, would have the derivative of the wrong side. Where no sides
        are given, as of a state alone, a system answers by its position.
        """
        return self._with("sides", tuple(sides))

    def _with(self, name, value):
        """Return the system with the field ``name``, if it has one, set to ``value``."""
        if name not in vars(self):
            return self
        return eqx.tree_at(lambda s: getattr(s, name), self, value, is_leaf=lambda x: x is None)

    def default_state(self) -> tuple[Coordinates, Coordinates]:
        """Return (position, velocity) of the default start."""
        raise ValueError(
            "this system has no default start: pass initial_state=(position, velocity)"
        )

    def sliding_near(self) -> Coordinates:
        """Return a place near which steady sliding is sought: that of the default start."""
        return self.default_state()[0]

    def scales(self, n: int) -> tuple[Coordinates, Coordinates]:
        """Typical sizes of positions and velocities; absolute tolerances are rtol times these. What
        is far smaller than 1 m and 1 m/s has to say so.
        """
        return (1.0,) * n, (1.0,) * n

    @property
    def drive_period(self) -> Scalar | None:
        """Time [s] after which what drives it comes again: a step is no longer than a quarter of
        it, and what follows the cycles of a scene takes it. None: nothing drives it, or its belt
        alone.
        """
        return None

    def output(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Velocity whose statistics and spectrum describe the motion."""
        return self.slip_speed(t, q, v)


def rates(system: AbstractSystem, t, q, v):
    """Return q' in the state's dtype."""
    return cast(system.rates(t, q, v), v)


def like(value, model):
    """Give a value the state's dtype and shape: a system may return a Python number, or float64."""
    return jnp.broadcast_to(jnp.asarray(value, model.dtype), model.shape)


def cast(values, models):
    return tuple(like(x, y) for x, y in zip(values, models, strict=True))


def system_attributes(system: AbstractSystem) -> dict[str, str | int]:
    """Attributes that tell in a file whose a run, branch or curve is: its class, and whether that
    is a blade.
    """
    return {"system": type(system).__name__, "of_a_blade": int(system.of_a_blade)}
