"""A prescribed motion of one's own goes on where a piece of it ends: what jumps there would carry
along what rests on it, by no force and no impact."""

import jax.numpy as jnp
import numpy as np
import own_systems
import pytest

import wiperjax
from wiperjax import Coulomb, Regime, parameter
from wiperjax.contact import fits


class Pieces(wiperjax.AbstractSystem):
    """It moves something from 1 s on: the engine sets ``piece``, as every field of that name."""

    piece: int = 0

    def break_time(self, piece):
        return jnp.where(piece == 0, 1.0, jnp.inf)

    def first_piece(self, t):
        return (t >= 1.0).astype(int)

    def since(self, t):
        return jnp.where(self.piece > 0, t - 1.0, 0.0)


class Table(own_systems.Ball, Pieces):
    """A ball on a table that is moved from 1 s on, at a speed, with an acceleration, or aside."""

    speed: float = parameter(0.0, "m/s")
    acceleration: float = parameter(0.0, "m/s^2")
    step: float = parameter(0.0, "m")

    def gap(self, t, q):
        moved = self.since(t) * (self.speed + 0.5 * self.acceleration * self.since(t))
        return q[0] - moved - jnp.where(self.piece > 0, self.step, 0.0)


class Ground(Pieces):
    """A block on ground that is drawn away under it, from 1 s on at another speed."""

    unilateral = False
    coordinates = ("x",)
    speed: float = parameter(0.0, "m/s")
    acceleration: float = parameter(0.0, "m/s^2")
    friction: wiperjax.AbstractFriction = Coulomb(0.1)

    def free_acceleration(self, t, q, v):
        return (0.0,)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - jnp.where(self.piece > 0, self.speed, 0.0) - self.acceleration * self.since(t)


REST = ((0.0,), (0.0,))


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (
            Table(speed=-1.0),
            "Table.gap must go on at the same rate .*, but at 1 s was 0 and then 1$",
        ),
        (
            Table(speed=1.0),
            "Table.gap must go on at the same rate .*, but at 1 s was 0 and then -1$",
        ),
        (
            Table(step=0.1),
            "Table.gap must go on where a piece ends, but at 1 s was 0 and then -0.1$",
        ),
        (Ground(speed=0.8), "Ground.slip_speed must go on .*, but at 1 s was 0 and then -0.8$"),
    ],
)
def test_what_jumps_where_a_piece_ends_is_refused(system, words):
    """The ball stayed on a table that dropped away at 1 m/s, and was lifted without an impact by
    one that rose; the block had the speed of the ground at once."""
    for run in (wiperjax.simulate, wiperjax.solve):
        with pytest.raises(ValueError, match=f"^{words}") as caught:
            run(system, 2.0, initial_state=REST)
        assert "\n" not in str(caught.value)


def test_a_jump_in_one_cell_of_a_system_is_seen():
    some = Table(speed=np.array([0.0, 0.0, 0.5]))
    with pytest.raises(ValueError, match=r"^Table.gap .* at 1 s was 0 and then -0.5$"):
        fits.check(some, (jnp.zeros(3),), (jnp.zeros(3),), (3,))


class Swung(Ground):
    """Ground that begins to swing where its speed is zero, but for rounding."""

    def slip_speed(self, t, q, v):
        return v[0] - jnp.where(self.piece > 0, jnp.sin(jnp.pi * t), 0.0)


def test_what_is_rounding_is_no_jump():
    fits.check(Swung(), (0.0,), (0.0,))


@pytest.mark.long
def test_what_begins_with_an_acceleration_goes_on():
    """The ball leaves a table that falls faster than it, and stays on one that does not; the block
    is carried by ground that starts softly, and left behind by other ground, by 0.05 t^2."""
    for acceleration, regime, height in ((-20.0, Regime.FLIGHT, -4.905), (-4.0, None, -2.0)):
        run = wiperjax.simulate(Table(acceleration=acceleration), 2.0, initial_state=REST)
        assert (int(run.final_regime) == Regime.FLIGHT) == (regime == Regime.FLIGHT)
        assert float(run.final_position[0]) == pytest.approx(height, abs=1e-6)
    for acceleration, way in ((0.05, 0.025), (0.5, 0.05)):
        run = wiperjax.simulate(Ground(acceleration=acceleration), 2.0, initial_state=REST)
        assert float(run.final_position[0]) == pytest.approx(way, abs=1e-6)
