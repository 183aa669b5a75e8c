"""The single-degree oscillators of the source paper's company: squeal on a belt, and reversal.

A block on a spring and a dashpot, pressed on a belt. With Stribeck's law steady sliding is
unstable where friction falls faster with speed than damping holds: load mu'(V) + damping < 0, at
all belt speeds below one (1.498 m/s as it comes); of a law of `shape` above 1, which falls from
rest slowly, between two. On a belt that turns round it is the oscillator of the reversal,
which the jump of friction at V = 0 strikes.
"""

import jax.numpy as jnp

from ..contact.belts import AbstractBelt, SteadyBelt
from ..contact.friction import AbstractFriction, Stribeck
from ..contact.on_belt import AbstractBeltSystem
from ..vocabulary.declared import parameter


class Oscillator(AbstractBeltSystem):
    """A block on a spring and a dashpot, pressed on a belt by a constant force."""

    unilateral = False
    coordinates = ("x",)
    mass: float = parameter(1.0, "kg", above=0)
    stiffness: float = parameter(1.0, "N/m", above=0)
    damping: float = parameter(0.05, "N s/m", low=0)
    load: float = parameter(1.0, "N", above=0, long_name="normal load")
    friction: AbstractFriction = Stribeck(1.0, 0.5, 0.5)
    belt: AbstractBelt = SteadyBelt(1.25)

    def free_acceleration(self, t, q, v):
        return ((-self.stiffness * q[0] - self.damping * v[0]) / self.mass,)

    def directions(self, t, q):
        return (1 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return self.load

    def default_state(self):
        return (0.0,), (0.0,)

    def scales(self, n):
        stroke = self.load / self.stiffness
        return (stroke,), (stroke * jnp.sqrt(self.stiffness / self.mass),)
