"""The rung `block`: a block on a spring in the direction of the belt."""

from typing import ClassVar

import jax.numpy as jnp

from ..contact import fits
from ..contact.belts import AbstractBelt
from ..contact.friction import AbstractFriction
from ..contact.on_belt import OnBelt
from ..numerics.types import Scalar
from ..vocabulary.parameters import PARAMETERS
from .steady_slip import judged_slip
from .wiper import Wiper

LEAST_LOAD = 1e-6  # of N0: what presses a bar that would lift off


class Block(OnBelt):
    """Block on a belt: m x'' + damping x' + stiffness (x - centre) = lambda_t, pressed by ``load``.

    Per metre of blade. With the Stribeck law it is the squeal oscillator, with mu_minimum <
    mu_static and a tiny stribeck_speed the classic stick-slip block.
    """

    unilateral: ClassVar[bool] = False
    coordinates: ClassVar[tuple[str, ...]] = ("x",)
    of_a_blade: ClassVar[bool] = True
    per_metre: ClassVar[bool] = True
    known: ClassVar = PARAMETERS
    belt: AbstractBelt
    friction: AbstractFriction
    mass: Scalar  # kg/m
    damping: Scalar  # N s/m per m; may be negative (leading side)
    stiffness: Scalar  # N/m per m; may be negative (leading side)
    centre: Scalar  # m, where the spring is relaxed
    load: Scalar  # N/m
    reach: Scalar  # m, |x| at which the lip that it stands for lies flat: COLLAPSED
    piece: Scalar = 0

    def free_acceleration(self, t, q, v):
        speed = self.rates(t, q, v)[0]
        force = -self.damping * speed - self.stiffness * (q[0] - self.centre)
        return (force / self.mass - self.belt.motion(t, self.piece)[1],)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return self.load

    def slip_speed(self, t, q, v):
        return v[0]

    # as in the wiper, the velocity inside is x' - V
    def rates(self, t, q, v):
        return (v[0] + self.belt.motion(t, self.piece)[0],)

    def from_rates(self, t, q, rates):
        return (rates[0] - self.belt.motion(t, self.piece)[0],)

    def switches(self, t, q, v):
        return ((1 - q[0] / self.reach) * (1 + q[0] / self.reach),)

    def ends(self, t, q, v):
        return (True,)

    def default_state(self):
        """At rest where the spring is relaxed."""
        return (self.centre,), (0.0 * self.centre,)

    def scales(self, n):
        speed = jnp.maximum(self.belt.peak, 1e-4 * jnp.sqrt(self.load * self.reach / self.mass))
        return (self.reach,), (speed,)

    def output(self, t, q, v):
        return self.rates(t, q, v)[0]


def block_of(wiper: Wiper) -> Block:
    """Return the block that equals ``wiper`` to first order about its steady slip.

    With phi the angle of steady slip at V (the belt's `judged_speed`; the branch that leans
    farthest along its motion), tau = tan(phi), s = sign(V), N the normal force there and
    mu = mu(|V|), docs/model.md, section 10, gives the tip
    m xi'' + (c_b + mu'(V) N) xi' + k_b xi = 0 with

        c_b = c tau (tau + s mu) + c_phi/(L cos phi)^2
        k_b = M'(theta)/(L cos phi)^2 + k tau (tau + s mu) + N (s mu tau - 1)/(L cos phi)

    so m, c_b, k_b, the load N, the wiper's own friction law and the centre x - s mu N/k_b make a
    block with that steady slip and that linearisation. NaN where there is no steady slip. The load
    is that of one branch: on a belt that reverses, the block stays on the branch of V > 0. Raises
    ValueError for a belt or a law that is none.
    """
    fits.check_partner(wiper, jnp.zeros(()))  # a belt of one's own is asked for its speed below
    speed, slip = wiper.belt.judged_speed, judged_slip(wiper)
    law, sign = wiper.law, jnp.sign(speed)
    mu, tau = law.coefficient(jnp.abs(speed)), jnp.tan(slip.phi)
    arm = wiper.lip_length * jnp.cos(slip.phi)
    return Block(
        belt=wiper.belt,
        friction=law,
        mass=wiper.tip_mass,
        damping=wiper.support_damping * tau * (tau + sign * mu) + wiper.hinge_damping / arm**2,
        stiffness=slip.k_eff,
        centre=slip.x - sign * mu * slip.normal_force / slip.k_eff,
        load=slip.normal_force,
        reach=wiper.lip_length * jnp.sin(wiper.collapse_angle),
    )
