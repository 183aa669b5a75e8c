"""A blade's head and the tip of its lip, two coordinates each: chatter as flutter of the blade.

The paper that this project starts from names models of four degrees of freedom in which a blade
chatters by flutter over attack angle and normal force though friction does not fall with speed.
This is the least of them: two masses, the lip between them a bar that yields along its axis and
bends, and a contact of rubber that hardens under load, by which the load has a part in it.
"""

import jax.numpy as jnp

from ..contact.belts import AbstractBelt, SteadyBelt
from ..contact.friction import AbstractFriction, Coulomb
from ..contact.on_belt import AbstractBeltSystem
from ..numerics.types import Scalar
from ..vocabulary.declared import parameter, set_by_the_engine


class HeadAndTip(AbstractBeltSystem):
    """A head on its support, a lip that leans by ``attack_angle``, its tip pressed on the glass.

    Per metre of blade. Coordinates are displacements from where the load holds head and tip without
    friction: along the glass, as the belt moves, and away from it. The lip has the stiffness
    ``axial_stiffness`` along (sin alpha, -cos alpha) and ``bending_stiffness`` across; the glass
    pushes back with contact_stiffness p (1 + hardening p) at a penetration p, never pulls. With a
    clamped massless head and a stiff axis it is the `SoftLip` at small leans.
    """

    unilateral = False
    per_metre = True
    coordinates = ("head_x", "head_y", "tip_x", "tip_y")
    head_mass: float = parameter(0.05, "kg/m", above=0)
    tip_mass: float = parameter(0.01, "kg/m", above=0)
    support_along: float = parameter(3000.0, "N/m/m", low=0, long_name="support along the glass")
    support_across: float = parameter(1000.0, "N/m/m", low=0, long_name="support towards the glass")
    support_damping: float = parameter(1.0, "N s/m/m", low=0)
    axial_stiffness: float = parameter(3000.0, "N/m/m", low=0, long_name="of the lip's axis")
    bending_stiffness: float = parameter(600.0, "N/m/m", low=0, long_name="of the lip across")
    lip_damping: float = parameter(0.1, "N s/m/m", low=0, long_name="damping of the lip")
    attack_angle: float = parameter(0.0, "rad", low=-80, high=80)
    load: float = parameter(15.0, "N/m", above=0, long_name="normal load")
    contact_stiffness: float = parameter(
        400.0, "N/m/m", above=0, long_name="of the glass, unloaded"
    )
    hardening: float = parameter(2000.0, "1/m", low=0, long_name="of the contact, by penetration")
    friction: AbstractFriction = Coulomb(0.8)
    belt: AbstractBelt = SteadyBelt(0.3)
    sides: tuple | None = set_by_the_engine()  # sign of the switch

    def contact_velocity(self, t, q, v):
        return v[2]

    def pressed(self) -> Scalar:
        """Penetration [m] under the load alone."""
        ratio = self.load / self.contact_stiffness
        return 2 * ratio / (1 + jnp.sqrt(1 + 4 * self.hardening * ratio))

    def free_acceleration(self, t, q, v):
        s, c = jnp.sin(self.attack_angle), jnp.cos(self.attack_angle)

        def lip(difference, along, across):
            """Force of the lip on the head by a difference of places or velocities."""
            x, y = difference
            axial, bent = along * (s * x - c * y), across * (c * x + s * y)
            return axial * s + bent * c, bent * s - axial * c

        pull = lip((q[2] - q[0], q[3] - q[1]), self.axial_stiffness, self.bending_stiffness)
        damp = lip((v[2] - v[0], v[3] - v[1]), self.lip_damping, self.lip_damping)
        x, y = pull[0] + damp[0], pull[1] + damp[1]
        return (
            (x - self.support_along * q[0] - self.support_damping * v[0]) / self.head_mass,
            (y - self.support_across * q[1] - self.support_damping * v[1]) / self.head_mass,
            -x / self.tip_mass,
            -(y + self.load) / self.tip_mass,
        )

    def directions(self, t, q):
        return (0.0, 0.0, 1 / self.tip_mass, 0.0), (0.0, 0.0, 0.0, 1 / self.tip_mass)

    def normal_force(self, t, q, v):
        depth = self.pressed() - q[3]
        touching = depth > 0 if self.sides is None else self.sides[0] > 0
        push = self.contact_stiffness * depth * (1 + self.hardening * depth)
        return jnp.where(touching, push, 0.0)

    def switches(self, t, q, v):
        return (self.pressed() - q[3],)

    def default_state(self):
        return (0.0,) * 4, (0.0,) * 4

    def scales(self, n):
        length = self.pressed()
        return (length,) * n, (length * jnp.sqrt(self.contact_stiffness / self.tip_mass),) * n
