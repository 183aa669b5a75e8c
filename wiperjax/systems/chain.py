"""Blocks in a row on springs, one of them on a belt: stick-slip with several modes."""

from typing import ClassVar

from ..contact.belts import AbstractBelt, SteadyBelt
from ..contact.friction import AbstractFriction, Stribeck
from ..contact.on_belt import AbstractBeltSystem
from ..vocabulary.declared import parameter


class Chain(AbstractBeltSystem):
    """Equal blocks between equal springs and dashpots; the first one lies on the belt.

    The first and the last spring end at a wall. A longer chain is a class of its own:
    ``class Chain20(Chain): blocks = 20``, whose ``coordinates`` are x1 to x20 unless it names them.
    """

    unilateral: ClassVar[bool] = False
    blocks: ClassVar[int] = 1
    coordinates: ClassVar[tuple[str, ...]] = ("x1",)
    mass: float = parameter(1.0, "kg", above=0, long_name="mass of each block")
    stiffness: float = parameter(1.0, "N/m", above=0, long_name="stiffness of each spring")
    damping: float = parameter(0.0, "N s/m", low=0, long_name="damping along each spring")
    load: float = parameter(1.0, "N", above=0, long_name="normal load of the first block")
    friction: AbstractFriction = Stribeck(1.0, 0.4, 0.3)
    belt: AbstractBelt = SteadyBelt(0.2)

    def __init_subclass__(cls, **others):
        super().__init_subclass__(**others)
        if "coordinates" not in cls.__dict__ and len(cls.coordinates) != cls.blocks:
            cls.coordinates = tuple(f"x{k + 1}" for k in range(cls.blocks))

    def free_acceleration(self, t, q, v):
        wall = 0.0 * q[0]
        places, speeds = (wall, *q, wall), (wall, *v, wall)
        pull = [
            self.stiffness * (places[k + 1] - places[k])
            + self.damping * (speeds[k + 1] - speeds[k])
            for k in range(len(q) + 1)
        ]
        return tuple((pull[k + 1] - pull[k]) / self.mass for k in range(len(q)))

    def directions(self, t, q):
        rest = (0.0,) * (len(q) - 1)
        return (1 / self.mass, *rest), (0.0, *rest)

    def normal_force(self, t, q, v):
        return self.load

    def default_state(self):
        rest = (0.0,) * self.blocks
        return rest, rest


class Chain2(Chain):
    """Two blocks."""

    blocks = 2


class Chain3(Chain):
    """Three blocks."""

    blocks = 3


class Chain8(Chain):
    """Eight blocks."""

    blocks = 8
