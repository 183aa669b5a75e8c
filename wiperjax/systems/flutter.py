"""Flutter by mode coupling, the minimal model: two modes of a mass lock in under friction.

N. Hoffmann, M. Fischer, R. Allgaier, L. Gaul, "A minimal model for studying properties of the
mode-coupling type instability in friction induced oscillations", Mechanics Research Communications
29 (2002) 197. The contact is compliant: the belt is pressed in, and pushes back with its stiffness;
where the mass leaves it, there is no force. Friction does not fall with speed.
"""

import math

import jax.numpy as jnp

from ..contact.belts import AbstractBelt, SteadyBelt
from ..contact.friction import AbstractFriction, Coulomb
from ..contact.on_belt import AbstractBeltSystem
from ..vocabulary.declared import parameter, set_by_the_engine

_SOFT, _HARD = 2 / 3 * (2 - 3**0.5), 2 / 3 * (2 + 3**0.5)


class ModeCoupling(AbstractBeltSystem):
    """A mass on two inclined springs, pressed into a belt: x along it, y into it.

    With the default numbers the frequencies squared are 2 -+ sqrt(1 - 4 mu/3) [1/s^2]: the modes
    lock in at mu = 3/4, and beyond it one of them grows.
    """

    unilateral = False
    coordinates = ("x", "y")
    mass: float = parameter(1.0, "kg", above=0)
    stiffness_1: float = parameter(_SOFT, "N/m", low=0, long_name="stiffness of the first spring")
    stiffness_2: float = parameter(_HARD, "N/m", low=0, long_name="stiffness of the second spring")
    angle_1: float = parameter(math.radians(150), "rad", low=-360, high=360)
    angle_2: float = parameter(math.radians(30), "rad", low=-360, high=360)
    damping: float = parameter(0.0, "N s/m", low=0, long_name="damping of both coordinates")
    contact_stiffness: float = parameter(4 / 3, "N/m", above=0)
    load: float = parameter(1.0, "N", above=0, long_name="force into the belt")
    friction: AbstractFriction = Coulomb(1.0)
    belt: AbstractBelt = SteadyBelt(10.0)
    sides: tuple | None = set_by_the_engine()  # sign of the switch

    def free_acceleration(self, t, q, v):
        x, y = q
        force_x, force_y = -self.damping * v[0], self.load - self.damping * v[1]
        springs = (self.stiffness_1, self.angle_1), (self.stiffness_2, self.angle_2)
        for stiffness, angle in springs:
            c, s = jnp.cos(angle), jnp.sin(angle)
            pull = stiffness * (c * x + s * y)
            force_x, force_y = force_x - c * pull, force_y - s * pull
        return force_x / self.mass, force_y / self.mass

    def directions(self, t, q):
        return (1 / self.mass, 0.0), (0.0, -1 / self.mass)

    def _push(self, q):
        return self.load + self.contact_stiffness * q[1]

    def normal_force(self, t, q, v):
        push = self._push(q)
        if self.sides is None:
            return jnp.maximum(push, 0.0)
        return jnp.where(self.sides[0] < 0, 0.0, push)

    def switches(self, t, q, v):
        return (self._push(q),)

    def default_state(self):
        return (0.0, 0.0), (0.0, 0.0)

    def scales(self, n):
        length = self.load / self.contact_stiffness
        return (length,) * n, (length * jnp.sqrt(self.contact_stiffness / self.mass),) * n
