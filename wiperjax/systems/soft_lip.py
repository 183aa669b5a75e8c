"""The wiper's lip on a glass that yields: two coordinates stay free in slip, and may flutter."""

from dataclasses import fields
from typing import ClassVar

import jax.numpy as jnp

from ..blade.steady_slip import judged_slip
from ..blade.wiper import Wiper
from ..numerics.types import Scalar
from ..vocabulary.declared import SET_BY_THE_ENGINE, parameter


class SoftLip(Wiper):
    """A `Wiper` whose tip the glass pushes back by its penetration times ``contact_stiffness``.

    Its steady slip flutters where the modes along and normal to the glass lock in, though friction
    does not fall with speed: with t = tan(phi) and the rotational stiffness k_theta over
    (L cos phi)^2 if 4 k t (mu k_c - k t) > (k + k_c - k t^2 - k_theta)^2, so only for a lip that
    leans with the belt. As k_c grows it becomes the rigid lip. It has no impacts: restitution does
    not count.
    """

    unilateral: ClassVar[bool] = False
    contact_stiffness: Scalar = parameter(
        2000.0, "N/m/m", above=0, long_name="contact stiffness of the glass"
    )

    @property
    def coupled(self) -> bool:
        return False

    def normal_force(self, t, q, v):
        touching = q[1] < 0 if self.sides is None else self.sides[1] > 0
        return jnp.where(touching, -self.contact_stiffness * q[1], 0.0)

    def switches(self, t, q, v):
        return *super().switches(t, q, v), -q[1]

    def ends(self, t, q, v):
        return *super().ends(t, q, v), False

    def default_state(self):
        """phi = alpha, pressed in by the load, at rest."""
        (x, _), rest = super().default_state()
        return (x, -self.normal_load / self.contact_stiffness), rest

    def sliding_near(self):
        """The steady slip that leans farthest with the belt.

        At rest glass and support are springs in series under the load and the weights: the lip
        leans as a rigid one on both would. That one has the weight of the hinge in its load, and no
        hinge mass: the D <= 0 of a rigid contact does not bind here. A tip too heavy for its load
        leaves none, and is sought from a light one.
        """
        k, k_c, weight = (
            self.support_stiffness,
            self.contact_stiffness,
            self.tip_mass * self.gravity,
        )
        share = k_c / (k + k_c)
        load = share * (self.normal_load + weight + self.hinge_mass * self.gravity) - weight
        names = (field.name for field in fields(Wiper) if field.name not in SET_BY_THE_ENGINE)
        numbers = {name: getattr(self, name) for name in names} | {
            "support_stiffness": share * k,
            "normal_load": jnp.maximum(load, 1e-3 * self.normal_load),
            "hinge_mass": 0.0,
        }
        slip, (x, y) = judged_slip(Wiper(**numbers)), self.default_state()[0]
        known = jnp.isfinite(slip.x)
        return jnp.where(known, slip.x, x), jnp.where(known, -slip.normal_force / k_c, y)

    def scales(self, n):
        _, speeds = super().scales(n)
        # its place is told to a part of the penetration, where the force comes from
        depth = self.normal_load / self.contact_stiffness
        return (self.lip_length, jnp.minimum(depth, self.lip_length)), speeds

    def energy(self, q, v):
        return super().energy(q, v) + 0.5 * self.contact_stiffness * jnp.minimum(q[1], 0.0) ** 2
