"""The wiper: a rigid lip on springs, its tip on moving glass (docs/model.md, sections 1 to 3)."""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..contact.belts import AbstractBelt, SteadyBelt
from ..contact.friction import AbstractFriction, Stribeck
from ..contact.on_belt import OnBelt
from ..numerics.elementary import angle, larger, smaller, within
from ..numerics.fusion_barrier import keep
from ..numerics.known_zeros import absent
from ..numerics.types import Scalar
from ..vocabulary import checks
from ..vocabulary.declared import set_by_the_engine
from ..vocabulary.kinds import FRICTIONS
from ..vocabulary.parameters import BLADE, PARAMETERS, REFERENCE, described

_OWN_LAW = tuple(FRICTIONS["stribeck"].values())  # numbers of the law that the wiper has by itself
_EDGE = 1 - 1e-9  # trial stages may reach past the end of the lip: sin(phi) is held inside +-1


class Lean(NamedTuple):
    """The lip's inclination phi: worked out once for all that needs it."""

    sin: Scalar
    cos: Scalar
    tan: Scalar
    secant: Scalar
    angle: Scalar  # rad


class Constants(NamedTuple):
    """What follows from a wiper's parameters alone: worked out once a trajectory."""

    rest_height: Scalar  # L cos(alpha) [m]
    edge: Scalar  # sine of the lean at which the lip collapses,
    shoulders: tuple[Scalar, Scalar]  # and of those at which it meets its shoulders, if before it


class Wiper(OnBelt):
    """Lip of a windscreen wiper, per metre of blade, in the coordinates (x, y) of its tip.

    Parameters are listed at the end (docs/model.md, section 9); angles in rad.
    Friction is Stribeck's law of its ``mu_static`` to ``viscous_slope``, or ``friction``, a law of
    its own, in place of them.

    Raises ValueError for values outside the ranges of `parameters.PARAMETERS`, those of sweep files
    (checked where they are known: not while traced).
    """

    coordinates: ClassVar[tuple[str, ...]] = ("x", "y")
    of_a_blade: ClassVar[bool] = True
    per_metre: ClassVar[bool] = True
    valid_where: ClassVar[str] = "|phi| < collapse_angle"
    known: ClassVar = PARAMETERS

    belt: AbstractBelt = SteadyBelt()
    tip_mass: Scalar = REFERENCE["tip_mass"]  # kg/m
    lip_length: Scalar = REFERENCE["lip_length"]  # m
    support_stiffness: Scalar = REFERENCE["support_stiffness"]  # N/m per m
    support_damping: Scalar = REFERENCE["support_damping"]  # N s/m per m
    neck_stiffness: Scalar = REFERENCE["neck_stiffness"]  # N m/rad per m
    shoulder_stiffness: Scalar = REFERENCE["shoulder_stiffness"]  # N m/rad per m
    shoulder_angle: Scalar = REFERENCE["shoulder_angle"]  # rad
    attack_angle: Scalar = REFERENCE["attack_angle"]  # rad
    normal_load: Scalar = REFERENCE["normal_load"]  # N/m
    restitution: Scalar = REFERENCE["restitution"]
    mu_static: Scalar = REFERENCE["mu_static"]
    mu_minimum: Scalar = REFERENCE["mu_minimum"]
    stribeck_speed: Scalar = REFERENCE["stribeck_speed"]  # m/s
    stribeck_shape: Scalar = REFERENCE["stribeck_shape"]
    viscous_slope: Scalar = REFERENCE["viscous_slope"]  # s/m
    hinge_mass: Scalar = REFERENCE["hinge_mass"]  # kg/m
    hinge_damping: Scalar = REFERENCE["hinge_damping"]  # N m s/rad per m
    gravity: Scalar = REFERENCE["gravity"]  # m/s^2
    collapse_angle: Scalar = REFERENCE["collapse_angle"]  # rad
    friction: AbstractFriction | None = None  # None: Stribeck's law of the numbers above
    piece: Scalar = set_by_the_engine(0)  # smooth piece of the belt's motion
    sides: tuple | None = set_by_the_engine()  # signs of the switches
    constants: Constants | None = set_by_the_engine()  # of `prepared`

    def __check_init__(self):
        checks.parameters({name: getattr(self, name) for name in BLADE})
        checks.instance("belt", self.belt, AbstractBelt, "a belt such as SteadyBelt(0.3)")
        if self.friction is None:
            return
        checks.instance("friction", self.friction, AbstractFriction, "a law such as Coulomb(0.5)")
        for name in self.idle:
            value = getattr(self, name)
            if not checks.is_traced(value) and np.any(np.asarray(value) != REFERENCE[name]):
                raise ValueError(
                    f"{name} must be left out with friction, whose own number counts, but was "
                    f"{checks.shown(value)}"
                )

    @property
    def idle(self) -> tuple[str, ...]:
        """Names of the numbers that have no part: those of its own law, if it is given one."""
        return () if self.friction is None else _OWN_LAW

    @property
    def _constants(self) -> Constants:
        if self.constants is not None:
            return self.constants
        low, high = self.attack_angle - self.shoulder_angle, self.attack_angle + self.shoulder_angle
        right, edge = 0.5 * np.pi, jnp.sin(self.collapse_angle)
        # a shoulder behind the collapse is out of reach
        low, high = (within(-edge, jnp.sin(within(-right, x, right)), edge) for x in (low, high))
        return Constants(self.lip_length * jnp.cos(self.attack_angle), edge, (low, high))

    def prepared(self):
        return eqx.tree_at(
            lambda w: w.constants, self, self._constants, is_leaf=lambda x: x is None
        )

    # --- geometry -----------------------------------------------------------------------------

    # Reciprocals of parameters: the compiler works them out once, before the loop.

    def _sine(self, q):
        """sin(phi), beyond +-1 where a trial stage reaches past the end of the lip."""
        return q[0] * (1 / self.lip_length)

    def lean(self, q) -> Lean:
        """Return the lean phi of a lip whose tip is at x = q[0]."""
        sin = within(-_EDGE, self._sine(q), _EDGE)
        cos = jnp.sqrt((1 - sin) * (1 + sin))
        secant = 1 / cos
        # kept: the compiler would work the angle out for each of its uses
        return Lean(sin, cos, sin * secant, secant, keep(angle(sin, cos)))

    def moment(self, theta):
        """M(theta) of the two-stage rotational spring [N m per m]; theta = phi - alpha [rad]."""
        extra = self.shoulder_stiffness - self.neck_stiffness
        above, below = theta - self.shoulder_angle, theta + self.shoulder_angle
        if self.sides is None:
            past = larger(above, 0.0) + smaller(below, 0.0)
        else:
            past = jnp.where(self.sides[0] < 0, jnp.where(theta > 0, above, below), 0.0)
        return self.neck_stiffness * theta + extra * past

    def support_force(self, q, speeds, lean: Lean):
        """Downward force F of the support spring and dashpot [N/m] at q' = ``speeds``."""
        eta = q[1] + self.lip_length * lean.cos
        eta_rate = speeds[1] - lean.tan * speeds[0]
        return (
            self.normal_load
            + self.support_stiffness * (eta - self._constants.rest_height)
            + self.support_damping * eta_rate
        )

    # --- the engine's view ----------------------------------------------------------------------

    def free_acceleration(self, t, q, v):
        lean, length = self.lean(q), self.lip_length
        speeds = self.rates(t, q, v)
        down = keep(self.support_force(q, speeds, lean))
        moment = self.moment(lean.angle - self.attack_angle)
        if not absent(self.hinge_damping):
            moment = moment + self.hinge_damping * speeds[0] * lean.secant / length
        push = moment * lean.secant * (1 / length)  # by the arm L cos(phi)
        pull = self.belt.motion(t, self.piece)[1]
        m = self.tip_mass
        if absent(self.hinge_mass):
            f_t = down * lean.tan - push
            return f_t * (1 / m) - pull, -down * (1 / m) - self.gravity
        h = self.hinge_mass
        f_t = (down + h * self.gravity) * lean.tan - push
        f_n = -down - (m + h) * self.gravity
        centripetal = h * speeds[0] * speeds[0] * lean.secant**3 / length
        (tt, tn), (_, nn) = self.directions(t, q)
        r_t, r_n = f_t - centripetal * lean.tan, f_n + centripetal
        return tt * r_t + tn * r_n - pull, tn * r_t + nn * r_n

    def directions(self, t, q):
        m, h = self.tip_mass, self.hinge_mass
        if absent(h):
            return (1 / m, 0.0), (0.0, 1 / m)
        lean = self.lean(q)
        scale = 1 / (m * (m + h * lean.secant * lean.secant))
        cross = h * lean.tan * scale
        return ((m + h) * scale, cross), (cross, (m + h * lean.tan * lean.tan) * scale)

    def gap(self, t, q):
        return q[1]

    # Velocities inside are (x' - V, y'): friction needs the slip speed to its last digit, where
    # the difference of two speeds of the glass would have lost it.

    def rates(self, t, q, v):
        return v[0] + self.belt.motion(t, self.piece)[0], v[1]

    def from_rates(self, t, q, rates):
        return rates[0] - self.belt.motion(t, self.piece)[0], rates[1]

    def slip_speed(self, t, q, v):
        return v[0]

    def switches(self, t, q, v):
        # One function for both ends of the stretch that the lip is in (between its shoulders, or
        # from one of them to the collapse): it vanishes at either. In the sine: smooth, and cheap.
        edge, (low, high) = self._constants.edge, self._constants.shoulders
        s = self._sine(q)
        if self.sides is None:  # not placed yet: positive between the shoulders
            return ((high - s) * (s - low),)
        outside, right = self.sides[0] < 0, s > 0.5 * (low + high)
        start = jnp.where(outside, jnp.where(right, high, -edge), low)
        end = jnp.where(outside, jnp.where(right, edge, low), high)
        return (self.sides[0] * (end - s) * (s - start),)

    def ends(self, t, q, v):
        edge, (low, high) = self._constants.edge, self._constants.shoulders
        s = self._sine(q)
        return (edge - abs(s) <= smaller(abs(s - low), abs(s - high)),)

    @property
    def coupled(self) -> bool:
        return not absent(self.hinge_mass)

    @property
    def law(self) -> AbstractFriction:
        return self.friction or Stribeck(*(getattr(self, name) for name in _OWN_LAW))

    @property
    def bounce(self):
        return self.restitution

    def default_state(self):
        """Touching, at rest, phi = alpha."""
        return (self.lip_length * jnp.sin(self.attack_angle), 0.0), (0.0, 0.0)

    def sliding_near(self):
        """Steady slip, where there is one: that which leans farthest with the belt."""
        from .steady_slip import judged_slip

        (x, height), _ = self.default_state()
        slip = judged_slip(self).x
        return jnp.where(jnp.isfinite(slip), slip, x), height

    def scales(self, n):
        # a belt at rest sets no scale: then a small part of the speed that the load can give
        natural = jnp.sqrt(self.normal_load * self.lip_length / self.tip_mass)
        length, speed = self.lip_length, jnp.maximum(self.belt.peak, 1e-4 * natural)
        return (length, length), (speed, speed)

    def output(self, t, q, v):
        return v[0] + self.belt.motion(t, self.piece)[0]

    # --- for tests and studies ------------------------------------------------------------------

    def energy(self, q, v):
        """Kinetic plus stored energy [J per m] of a tip at ``q`` with q' = ``v``."""
        lean = self.lean(q)
        theta = lean.angle - self.attack_angle
        past = jnp.maximum(jnp.abs(theta) - self.shoulder_angle, 0.0)
        eta = q[1] + self.lip_length * lean.cos
        sink = eta - self._constants.rest_height
        hinge = v[1] - lean.tan * v[0]
        kinetic = self.tip_mass * (v[0] ** 2 + v[1] ** 2) + self.hinge_mass * hinge**2
        rotation = self.neck_stiffness * theta**2
        rotation = rotation + (self.shoulder_stiffness - self.neck_stiffness) * past**2
        weight = self.gravity * (self.tip_mass * q[1] + self.hinge_mass * eta)
        support = self.normal_load * eta + 0.5 * self.support_stiffness * sink**2
        return 0.5 * kinetic + 0.5 * rotation + support + weight


Wiper.__doc__ = f"{Wiper.__doc__}\n    Parameters:\n{described('blade')}"
