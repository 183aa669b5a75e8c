"""Mistakes in a system of one's own: one line that names the class and the method."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import own_systems
import pytest

import wiperjax
from wiperjax import Coulomb, parameter, remedy
from wiperjax.blade.rungs import on_rung
from wiperjax.contact import fits
from wiperjax.cycles.find import find_cycle
from wiperjax.engine.arguments import check_state
from wiperjax.systems.oscillator import Oscillator
from wiperjax.vocabulary.kinds import MODELS

NUMBERS = "must return 1 numbers, one a coordinate, but returned"
PAIRS = "must return two tuples of 1 numbers, one a coordinate, but returned"
NUMBER = "must return a number, but returned"
IF = (
    r"must be written with jax.numpy \(jnp.sin, jnp.where, jnp.maximum\): no math, numpy, if, "
    "max, float or list index of values that are known only when it runs$"
)
METHODS = {
    "free_acceleration": [
        (lambda s, t, q, v: -q[0], f"{NUMBERS} one number"),
        (lambda s, t, q, v: None, f"{NUMBERS} None"),
        (lambda s, t, q, v: (-q[0], 0.0), f"{NUMBERS} a tuple of 2"),
        (lambda s, t, q, v: (None,), f"{NUMBERS} None for one of them"),
        (lambda s, t, q, v: (1j * q[0],), f"{NUMBERS} one complex number for one of them"),
        (lambda s, t, q, v: (jnp.stack([q[0]]),), f"{NUMBERS} an array of shape .1,. for one"),
        (lambda s, t, q, v: (1.0,) if q[0] > 0 else (0.0,), IF),
        (lambda s, t, q, v: (math.sin(q[0]),), IF),
        (lambda s, t, q, v: (np.sin(q[0]),), IF),
        (lambda s, t, q, v: ([0.0, 1.0][jnp.int32(q[0])],), IF),
        (lambda s, t, q, v: (q[3],), "fails: IndexError: tuple index out of range"),
    ],
    "directions": [
        (lambda s, t, q: (1.0,), f"{PAIRS} a tuple of 1"),
        (lambda s, t, q: (1.0, 0.0), f"{PAIRS} one number"),
        (lambda s, t, q: ((-1.0,), (0.0,)), "must have a unit tangential force .* by -1"),
    ],
    "scales": [
        (lambda s, n: (1.0,), f"{PAIRS} a tuple of 1"),
        (lambda s, n: ((1.0, 1.0), (1.0,)), f"{PAIRS} a tuple of 2"),
        (lambda s, n: ((0.0,), (1.0,)), "must be a finite number > 0, but was 0"),
        (lambda s, n: ((1.0,), (-s.mass,)), "must be a finite number > 0, but was -1"),
    ],
    "normal_force": [
        (lambda s, t, q, v: None, f"{NUMBER} None"),
        (wiperjax.AbstractSystem.normal_force, "is missing: a bilateral system must define"),
    ],
    "slip_speed": [(lambda s, t, q, v: (v[0],), f"{NUMBER} a tuple of 1")],
    "output": [(lambda s, t, q, v: None, f"{NUMBER} None")],
    "switches": [(lambda s, t, q, v: q[0], "must return a tuple of numbers, .* one number")],
    "ends": [(lambda s, t, q, v: (True,), "must return 0 answers, one a switch, .* a tuple of 1")],
}
CASES = [(name, *case) for name, cases in METHODS.items() for case in cases]


def made(**methods):
    return type("Mine", (own_systems.Oscillator,), methods)


@pytest.mark.parametrize(("name", "method", "words"), CASES)
def test_a_method_that_says_something_else_than_asked_is_one_line(name, method, words):
    with pytest.raises(ValueError, match=rf"^Mine.{name} {words}") as caught:
        check_state(made(**{name: method})(), ((0.1,), (0.0,)))
    assert "\n" not in str(caught.value)


def test_a_magnitude_is_no_slip_speed():
    """Friction drove what slipped the other way, up to many events at one instant."""
    size = made(slip_speed=lambda s, t, q, v: jnp.abs(v[0] - s.belt_velocity(t)))
    with pytest.raises(ValueError, match=r"^Mine.slip_speed must be a speed with its sign"):
        wiperjax.simulate(size(), 1.0, initial_state=((0.0,), (1.0,)))


def test_stops_and_what_is_behind_them():
    wall = {"switches": lambda s, t, q, v: (0.3 - q[0],)}
    for stops in (0, (3,)):
        with pytest.raises(ValueError, match=r"^Mine.stops must be a tuple of places of its 1 sw"):
            fits.check(made(stops=stops, **wall)(), (0.0,), (0.0,))
    short = made(stops=(0,), rebound=lambda s, stop, t, q, v, closed: -v[0], **wall)
    with pytest.raises(ValueError, match=rf"^Mine.rebound {NUMBERS} one number$"):
        fits.check(short(), (0.0,), (0.0,))


class Wrong(wiperjax.AbstractFriction):
    static: float = parameter(1.0)

    def coefficient(self, speed):
        return None


def test_a_law_of_ones_own_can_be_asked_within_jit():
    """Its coefficient at rest, known there only when it runs, was asked for: a traceback of JAX."""

    def asked(speed):
        fits.check_law(law := own_systems.Falling(0.8))
        return law.coefficient(speed)

    assert float(jax.jit(asked)(1.0)) == pytest.approx(0.8 / 4)


class Nowhere(wiperjax.AbstractFriction):
    """0 / 0 at rest."""

    static: float = 0.5

    def coefficient(self, speed):
        return 0.5 * jnp.tanh(speed) / speed


class Jerky(wiperjax.SteadyBelt):
    def velocity(self, time, piece):
        return (0.1, 0.2)


class Halting(wiperjax.SteadyBelt):
    def break_time(self, piece):
        return 1.0


class Jumping(wiperjax.SteadyBelt):
    def velocity(self, time, piece):
        return jnp.where(piece == 12, 0.3, self.speed)

    def break_time(self, piece):
        return 1.0 + piece


class Gap(Jumping):
    def velocity(self, time, piece):
        return jnp.where(piece == 2, jnp.nan, self.speed)


PARTS = {
    "belt must be a belt such as SteadyBelt": {"belt": 0.3},
    "friction must be a law such as Coulomb": {"friction": 0.5},
    "friction must be a law such as Coulomb.0.5., but was <class": {"friction": Coulomb},
    f"Wrong.coefficient {NUMBER} None": {"friction": Wrong()},
    "Rising: .* must not be larger in slip than at rest .0.5., was 0.6$": {
        "friction": own_systems.Rising()
    },
    "Driving: its coefficient at speed 0 must be >= 0, was -0.1$": {
        "friction": own_systems.Driving()
    },
    "Nowhere: its coefficient at speed 0 must be a finite number, but was nan$": {
        "friction": Nowhere()
    },
    f"Jerky.velocity {NUMBER} a tuple of 2": {"belt": Jerky(0.2)},
    "Halting.break_time must be later for each piece": {"belt": Halting(0.2)},
    "Jumping.velocity must go on .*, but at 12 s was 0.2 and then 0.3": {"belt": Jumping(0.2)},
    "Gap.velocity must go on .*, but at 2 s was 0.2 and then nan": {"belt": Gap(0.2)},
}


@pytest.mark.parametrize("words", PARTS)
def test_laws_and_belts_that_are_none(words):
    """Of a system of the package, too; where a motion begins, not inside the engine."""
    with pytest.raises(ValueError, match=f"^{words}"):
        wiperjax.simulate(Oscillator(**PARTS[words]), 1.0)
    with pytest.raises(ValueError, match=f"^{words}"):
        wiperjax.solve(Oscillator(**PARTS[words]), 1.0)
    with pytest.raises(ValueError, match=f"^{words}"):
        find_cycle(Oscillator(**PARTS[words]), settle=1.0)


BELTS = [words for words in PARTS if isinstance(PARTS[words].get("belt"), wiperjax.AbstractBelt)]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("words", BELTS)
def test_a_blade_asks_its_belt_as_every_system_does(words, model):
    """On every rung: where the speed of a belt jumped, what stuck on it was carried along."""
    blade = wiperjax.Wiper(**PARTS[words])
    with pytest.raises(ValueError, match=f"^{words}"):
        wiperjax.solve(on_rung(blade, model), 1e-3)  # a block is asked as it is made


SAID = {
    "peak must be a property, but was a method": {"peak": lambda s: s.speed},
    "rms must be a property, but was a method": {"rms": lambda s: s.speed},
    "judged_at must be a property": {"judged_at": lambda s: 0.0},
    "wiping_frequency must be a number": {"wiping_frequency": property(lambda s: None)},
    "velocity must be a finite number, but was nan": {"velocity": lambda s, t, piece: math.nan},
    "peak must be a finite number, but was nan": {"peak": property(lambda s: math.nan)},
    "rms must be a finite number, but was inf": {"rms": property(lambda s: jnp.inf)},
    f"peak {IF}": {"peak": property(lambda s: max(s.speed, 0.1))},
    f"rms {IF}": {"rms": property(lambda s: math.sqrt(s.speed**2))},
    "rms must be a number, but was an array": {"rms": property(lambda s: s.speed * jnp.ones(2))},
    "reverses must return True or False, .* None": {"reverses": lambda s, piece: None},
    "reverses must return True or False, .* one number": {"reverses": lambda s, piece: 0.5},
    "reverses fails: TypeError": {"reverses": property(lambda s: False)},
    "since_reversal must return a number": {"since_reversal": lambda s, time: None},
}


@pytest.mark.parametrize("words", SAID)
def test_all_that_a_belt_says_is_asked(words):
    """What only a blade asks, or a map, ended in a traceback there, or nowhere."""
    belt = type("Mine", (wiperjax.SteadyBelt,), SAID[words])(0.2)
    with pytest.raises(ValueError, match=f"^Mine.{words}") as caught:
        wiperjax.simulate(Oscillator(belt=belt), 1.0)
    assert "\n" not in str(caught.value)


class Breaking(wiperjax.SteadyBelt):
    """Its speed jumps at a time that may never come."""

    at: float = 1.0

    def velocity(self, time, piece):
        return jnp.where(piece >= 1, 0.3, self.speed)

    def break_time(self, piece):
        return jnp.where(piece == 0, self.at, jnp.inf)


def test_a_jump_of_one_cell_is_seen_among_cells_without():
    some = Oscillator(belt=Breaking(jnp.full(2, 0.2), at=jnp.array([1.0, jnp.inf])))
    with pytest.raises(ValueError, match="must go on .*, but at 1 s was 0.2 and then 0.3"):
        fits.check(some, (jnp.zeros(2),), (jnp.zeros(2),), (2,))
    none = Oscillator(belt=Breaking(jnp.full(2, 0.2), at=jnp.full(2, jnp.inf)))
    fits.check(none, (jnp.zeros(2),), (jnp.zeros(2),), (2,))


class Turning(wiperjax.WipingBelt):
    """A belt that turns round: at its breaks its speed is rounding, of either sign."""


def test_a_belt_whose_pieces_go_on_passes():
    for belt in (Turning(0.5, 3.0), Turning(0.5, 3.0, phase=1.0)):
        fits.check(Oscillator(belt=belt), (0.0,), (0.0,))
    several = Turning(np.array([0.0, 0.5]), np.array([3.0, 4.0]), np.zeros(2))
    fits.check(Oscillator(belt=several), (0.0,), (0.0,), (2,))


class Late(wiperjax.SteadyBelt):
    """Pieces of a millisecond, as of measured points; it turns where the 801st ends, if at all."""

    at: int = 800

    def velocity(self, time, piece):
        return self.speed * (1 - time / (1e-3 * (self.at + 1)))

    def break_time(self, piece):
        return jnp.where(piece < 1000, 1e-3 * (piece + 1), jnp.inf)

    def first_piece(self, time):
        return jnp.floor(1e3 * time).astype(int)

    def reverses(self, piece):
        return piece == self.at


def test_a_turn_behind_many_points_is_seen():
    """Only 64 pieces were looked at: such a blade had a verdict, its turn in the window."""
    blade = wiperjax.Wiper(belt=Late())
    assert fits.turns(blade) and not fits.turns(wiperjax.Wiper(belt=Late(at=5000)))
    with pytest.raises(ValueError, match="^blade must be on a belt that does not turn .* on Late$"):
        remedy.verdict(blade)


class AtOnce(Breaking):
    """It starts within a microsecond."""

    ramp: float = 1e-6

    def velocity(self, time, piece):
        share = jnp.where(piece == 1, (time - self.at) / self.ramp, jnp.where(piece > 1, 1.0, 0.0))
        return self.speed * share

    def break_time(self, piece):
        return jnp.where(piece < 2, self.at + piece * self.ramp, jnp.inf)


@pytest.mark.long
def test_a_belt_that_starts_at_once_is_a_steep_ramp():
    """What rests on it is left behind: it slips from there, by 0.15 t^2."""
    block = Oscillator(damping=0.0, stiffness=1e-6, friction=Coulomb(0.3), belt=AtOnce(0.3, at=0.5))
    run = wiperjax.simulate(block, 1.0, initial_state=((0.0,), (0.0,)))
    assert float(run.final_position[0]) == pytest.approx(0.15 * 0.5**2, abs=1e-6)


def test_a_bounce_gains_nothing():
    for bounce, was in ((1.7, "1.7"), (-0.1, "-0.1"), (np.array([0.5, 1.01]), "1.01")):
        ball = type("Mine", (own_systems.Ball,), {"bounce": property(lambda s, e=bounce: e)})
        with pytest.raises(
            ValueError, match=rf"^Mine.bounce must lie inside .0, 1., but was {was}$"
        ):
            fits.check(ball(), (1.0,), (0.0,), np.shape(bounce))
    ball = type("Mine", (own_systems.Ball,), {"bounce": property(lambda s: None)})
    with pytest.raises(ValueError, match=r"^Mine.bounce must be a number, but was None$"):
        wiperjax.simulate(ball(), 1.0, initial_state=((1.0,), (0.0,)))
    ball = type("Mine", (own_systems.Ball,), {"bounce": lambda s: 0.5})
    with pytest.raises(ValueError, match=r"^Mine.bounce must be a property, but was a method$"):
        wiperjax.simulate(ball(), 1.0, initial_state=((1.0,), (0.0,)))


def test_what_drives_a_system_comes_again_later():
    for period, was in ((0.0, "0"), (-0.1, "-0.1"), (float("nan"), "nan")):
        ball = type("Mine", (own_systems.Ball,), {"drive_period": period})
        must = "must be a finite number > 0"
        with pytest.raises(ValueError, match=rf"^Mine.drive_period {must}, but was {was}$"):
            wiperjax.simulate(ball(), 1.0, initial_state=((1.0,), (0.0,)))
    ball = type("Mine", (own_systems.Ball,), {"drive_period": lambda s: 0.5})
    with pytest.raises(
        ValueError, match=r"^Mine.drive_period must be a property, but was a method"
    ):
        wiperjax.simulate(ball(), 1.0, initial_state=((1.0,), (0.0,)))


def test_an_init_of_its_own_sets_the_fields():
    def bare(self):
        self.mass = 2.0

    for run in (wiperjax.simulate, wiperjax.solve):
        with pytest.raises(ValueError, match=r"^Mine.__init__ must set all fields, .* 'piece'$"):
            run(made(__init__=bare)(), 1.0, initial_state=((0.1,), (0.0,)))


def test_a_start_of_its_own_that_is_none_is_named():
    for run in (wiperjax.simulate, wiperjax.solve):
        with pytest.raises(ValueError, match=r"^Mine.default_state\(\) must be \(position, vel"):
            run(made(default_state=lambda s: None)(), 1.0)
    with pytest.raises(ValueError, match=r"^Mine.coordinates must be a list of names, but was 'x'"):
        made(coordinates="x")()
    with pytest.raises(ValueError, match=r"^Mine.coordinates must be names that differ, but was"):
        made(coordinates=("x", "x"))()


class Leaning(own_systems.Ball):
    """Directions of no mass matrix unless both are the same, and below 1: W_tn is W_nt then."""

    up: float = 0.2
    along: float = 0.0
    coordinates = ("x", "y")
    friction: wiperjax.AbstractFriction = Coulomb(0.3)

    def free_acceleration(self, t, q, v):
        return 0.0, -self.gravity

    def directions(self, t, q):
        return (1.0, self.up), (self.along, 1.0)

    def gap(self, t, q):
        return q[1]

    def slip_speed(self, t, q, v):
        return v[0]


def test_a_unit_force_moves_the_contact_its_own_way():
    ball = type("Mine", (own_systems.Ball,), {"directions": lambda s, t, q: ((0.0,), (-1.0,))})
    words = "must have a unit normal force accelerate the gap in its own direction"
    with pytest.raises(ValueError, match=f"^Mine.directions {words}, but it does by -1$"):
        wiperjax.simulate(ball(), 1.0, initial_state=((1.0,), (0.0,)))
    with pytest.raises(ValueError, match=r"^Leaning.directions must be those of one mass matrix"):
        wiperjax.simulate(Leaning(), 1.0, initial_state=((0.0, 1.0), (0.0, 0.0)))
    fits.check(Leaning(up=0.9, along=0.9), (0.0, 1.0), (0.0, 0.0))
    words = "must be those of a mass matrix: W_tt W_nn > W_tn.2, .*, but W was 1.0, 1.0 and"
    for both in (1.0, 1.5):
        with pytest.raises(ValueError, match=f"^Leaning.directions {words} {both}$"):
            fits.check(Leaning(up=both, along=both), (0.0, 1.0), (0.0, 0.0))
    several = Leaning(up=np.array([0.1, 2.0]), along=np.array([0.1, 2.0]))
    with pytest.raises(ValueError, match=r"^Leaning.directions .* W was 1.0, 1.0 and 2.0$"):
        fits.check(several, (jnp.zeros(2), jnp.ones(2)), (jnp.zeros(2),) * 2, (2,))


class Switched(own_systems.Oscillator):
    sides: tuple | None = None


@pytest.mark.parametrize("sides", [(1.0, -1.0), ()])
def test_the_fields_of_piece_and_sides_are_set_where_there_are_such(sides):
    found = Switched().on_piece(2).on_sides((0.0, 0.0)).on_sides(list(sides))
    assert found.piece == 2 and found.sides == sides
    ball = own_systems.Ball()
    assert ball.on_piece(2) is ball and ball.on_sides(sides) is ball


def test_a_parameter_that_the_engine_would_set_is_refused():
    class Cut(own_systems.Ball):
        piece: float = parameter(0.3, "m")

    with pytest.raises(ValueError, match="^parameter must have another name, .* sets 'piece'$"):
        Cut()
