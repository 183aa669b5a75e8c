"""The rung `bar`: a lip without mass of its own."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..contact.belts import AbstractBelt
from ..contact.friction import AbstractFriction
from ..contact.on_belt import OnBelt
from ..vocabulary.declared import set_by_the_engine
from ..vocabulary.parameters import PARAMETERS
from .block import LEAST_LOAD
from .steady_slip import check_rigid
from .wiper import Wiper


class Bar(OnBelt):
    """The lip held on the glass, y = 0: docs/model.md, section 3, with lambda_n = F + m g.

    m x'' = f_t + lambda_t with the moment, support force and friction of ``lip``. As long as the
    normal force stays positive this is the lip's own motion, not an approximation to it. Where the
    lip would lift off the bar is pressed by `LEAST_LOAD` of N0, that is, slides freely, and
    statistics call it flight (`lifted`).
    """

    unilateral: ClassVar[bool] = False
    coordinates: ClassVar[tuple[str, ...]] = ("x",)
    of_a_blade: ClassVar[bool] = True
    per_metre: ClassVar[bool] = True
    known: ClassVar = PARAMETERS
    lip: Wiper
    sides: tuple | None = set_by_the_engine()  # signs of the switches

    def __check_init__(self):
        check_rigid("lip", self.lip)

    @property
    def belt(self) -> AbstractBelt:
        return self.lip.belt

    @property
    def law(self) -> AbstractFriction:
        return self.lip.law

    @property
    def lifted(self):
        return False if self.sides is None else self.sides[-1] <= 0

    def _free(self, t, q, v):
        """Accelerations of the lip's tip (x, y) on the glass without contact force."""
        return self.lip.free_acceleration(t, (q[0], 0.0 * q[0]), (v[0], 0.0 * v[0]))

    def free_acceleration(self, t, q, v):
        return (self._free(t, q, v)[0],)

    def directions(self, t, q):
        return (1 / self.lip.tip_mass,), (0.0,)

    def constraint_force(self, t, q, v):
        """Force [N/m] that keeps the tip on the glass; below 0 where the lip would lift off."""
        return -self.lip.tip_mass * self._free(t, q, v)[1]

    def normal_force(self, t, q, v):
        force, least = self.constraint_force(t, q, v), LEAST_LOAD * self.lip.normal_load
        pressed = force > least if self.sides is None else self.sides[-1] > 0
        return jnp.where(pressed, force, least)

    def slip_speed(self, t, q, v):
        return v[0]

    def rates(self, t, q, v):
        return self.lip.rates(t, q, (v[0], 0.0))[:1]

    def from_rates(self, t, q, rates):
        return self.lip.from_rates(t, q, (rates[0], 0.0))[:1]

    def switches(self, t, q, v):
        # the force's own corner is stepped onto like the shoulder
        pressing = self.constraint_force(t, q, v) / self.lip.normal_load - LEAST_LOAD
        return (*self.lip.switches(t, q, v), pressing)

    def ends(self, t, q, v):
        return (*self.lip.ends(t, (q[0], 0.0), (v[0], 0.0)), False)

    def on_piece(self, piece):
        return eqx.tree_at(lambda bar: bar.lip, self, self.lip.on_piece(piece))

    def on_sides(self, sides):
        # the last side is that of the pressing force, which is not the lip's
        lip = self.lip.on_sides(sides[:-1])
        return eqx.tree_at(lambda bar: bar.lip, super().on_sides(sides), lip)

    def prepared(self):
        return eqx.tree_at(lambda bar: bar.lip, self, self.lip.prepared())

    def default_state(self):
        (x, _), (u, _) = self.lip.default_state()
        return (x,), (u,)

    def sliding_near(self):
        """The steady slip of the lip, which is its own."""
        return self.lip.sliding_near()[:1]

    def scales(self, n):
        (length, _), (speed, _) = self.lip.scales(2)
        return (length,), (speed,)

    def output(self, t, q, v):
        return self.rates(t, q, v)[0]
