"""A system whose contact partner is a belt: what every such system would say in the same words."""

import equinox as eqx

from ..numerics.types import Coordinates, Scalar
from .belts import AbstractBelt, SteadyBelt
from .system import AbstractSystem


class OnBelt(AbstractSystem):
    """A system whose prescribed motion is that of its ``belt``."""

    belt: eqx.AbstractVar[AbstractBelt]

    def break_time(self, piece):
        return self.belt.break_time(piece)

    def first_piece(self, t):
        return self.belt.first_piece(t)

    def reverses(self, piece):
        return self.belt.reverses(piece)


class AbstractBeltSystem(OnBelt):
    """n coordinates and a contact with a belt of any kind, in the field ``belt``.

    Friction opposes `contact_velocity` less that of the belt; the first coordinate's unless
    overridden. Statistics and spectrum are those of `contact_velocity`.
    """

    belt: AbstractBelt = SteadyBelt()
    piece: Scalar = 0  # smooth piece of the belt's motion (set by the engine)

    def contact_velocity(self, t: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Tangential velocity [m/s] of the contact point, in the frame in which the belt moves."""
        return v[0]

    def belt_velocity(self, t: Scalar) -> Scalar:
        """V [m/s] of the belt."""
        return self.belt.motion(t, self.piece)[0]

    def slip_speed(self, t, q, v):
        return self.contact_velocity(t, q, v) - self.belt_velocity(t)

    def output(self, t, q, v):
        return self.contact_velocity(t, q, v)
