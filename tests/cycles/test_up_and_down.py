"""Brute force up and down a range, of what a clock drives."""

from functools import partial
from importlib import import_module
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import own_systems
import pytest

import wiperjax
from wiperjax import AbstractSystem
from wiperjax.cycles import find_cycle, up_and_down
from wiperjax.cycles.branch.peaks import maxima
from wiperjax.cycles.return_map import Found
from wiperjax.systems import numbers
from wiperjax.systems.oscillator import Oscillator
from wiperjax.vocabulary.kinds import SYSTEMS


class Pushed(AbstractSystem):
    """A swing that a shaken elastic wall pushes, once it comes as near."""

    unilateral: ClassVar[bool] = False
    a: float = 0.5

    def free_acceleration(self, t, q, v):
        depth = q[0] - 1.0 - 0.3 * jnp.sin(t)
        return (self.a - q[0] - 0.1 * v[0] - 50 * jnp.maximum(depth, 0.0),)

    def directions(self, t, q):
        return (0.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - 100.0


def test_what_is_driven_is_not_swept_without_its_period():
    """Each value, and each second look, began at a time 0 that the state knew nothing of: numbers
    some per cent wrong, without a word; so with a period that is not the belt's."""
    driven = Oscillator(belt=wiperjax.WipingBelt(0.3, 0.5))
    call = partial(up_and_down, driven, "load", [1.0, 1.1], settle=1.0, window=1.0)
    with pytest.raises(
        ValueError, match="^period must be given: .* of Oscillator change with time"
    ):
        call()
    with pytest.raises(ValueError, match="^period must be one after which .* but was 1.3 s$"):
        call(period=lambda system: 1.3)


@pytest.mark.long
def test_a_drive_that_is_felt_on_the_way_only_is_not_swept_without_its_period():
    rest = (0.0,), (0.0,)
    with pytest.raises(ValueError, match="^period must be given"):
        up_and_down(Pushed(), "a", [0.9, 1.3], settle=100.0, window=20.0, initial_state=rest)


class Late(Pushed):
    """Its wall is not felt in the states in which a window of whole periods begins."""

    def free_acceleration(self, t, q, v):
        return super().free_acceleration(t + 1.5 * np.pi, q, v)


@pytest.mark.long
def test_states_in_step_with_a_window_of_whole_periods_hide_no_drive():
    """Eight of a window of eight periods were looked at, all in one phase."""
    turn = 2 * np.pi
    with pytest.raises(ValueError, match="^period must be given"):
        up_and_down(
            Late(),
            "a",
            [0.8, 0.85],
            settle=16 * turn,
            window=8 * turn,
            initial_state=((0.0,), (0.0,)),
        )


def test_a_law_that_rises_at_rest_is_refused_at_the_systems_own_start():
    block = own_systems.Oscillator(friction=own_systems.Rising())
    with pytest.raises(ValueError, match="^Rising: .* must not be larger in slip than at rest"):
        up_and_down(block, "mass", [1.0, 2.0], settle=1.0, window=1.0)


class Falling(AbstractSystem):
    """What falls through a resistance of 1 at a speed of 1/2, and shakes on its way; nothing
    depends on its height. The shaking is a circle of radius 1, or dies out where a < 0."""

    unilateral: ClassVar[bool] = False
    coordinates: ClassVar[tuple[str, ...]] = ("height", "shaking")
    a: float = 0.3

    def free_acceleration(self, t, q, v):
        shakes = self.a * jnp.where(self.a > 0, 1 - q[1] ** 2 - v[1] ** 2, 1.0) * v[1] - q[1]
        return -0.5 - v[0] + 0.3 * v[1], shakes

    def directions(self, t, q):
        return (0.0, 0.0), (0.0, 0.0)

    def normal_force(self, t, q, v):
        return 1.0

    def output(self, t, q, v):
        return v[1]


@pytest.mark.long
def test_a_kick_does_not_lead_into_the_belt():
    """Where the first coordinate leads there, all was an inconsistent start."""
    found = up_and_down(own_systems.Hung(), "belt.speed", [0.1, 0.2], settle=2.0, window=2.0)
    assert (found.result == 0).all() and (found.flight_fraction < 1e-3).all()
    np.testing.assert_allclose(found.maximum[..., 0], 0.1)


@pytest.mark.long
def test_what_falls_repeats_but_for_its_height():
    """Its maxima hung on how long it had fallen, and its means were over parts of periods: 3 % off
    here, without a word."""
    falling = Falling()
    found = up_and_down(
        falling, "a", [-0.05, 0.2, 0.3], settle=100.0, window=20.0,
        initial_state=((0.0, 1.0), (0.0, 0.0)),
    )  # fmt: skip
    up = found.sel(way="up")
    assert np.isnan(found.maximum).all() and (found.result == 0).all()
    np.testing.assert_allclose(up.velocity_rms[1:], np.sqrt(0.5), rtol=1e-4)
    periods = up.repeat_time[1:] / (2 * np.pi)
    assert np.all(periods > 1.5)
    np.testing.assert_allclose(periods, np.round(periods), rtol=1e-4)
    assert np.isnan(up.repeat_time[0])  # it dies out
    cycle = find_cycle(falling, settle=100.0, initial_state=((0.0, 1.0), (0.0, 0.0)))
    assert cycle.found == Found.NOT_PERIODIC
    assert "nothing depends on height" in cycle.why and "shaking" not in cycle.why


def wave(phases, times):
    """Positions and velocities of sums of a sine of each (size, frequency in 2 pi, phase)."""
    angles = [(a, 2 * np.pi * f, 2 * np.pi * f * times + p) for a, f, p in phases]
    return sum(a * np.sin(x) for a, _, x in angles), sum(a * w * np.cos(x) for a, w, x in angles)


def test_a_cycle_has_as_many_maxima_as_it_turns():
    """The larger of two samples lay below each maximum, at a height of its own."""
    times = np.linspace(0.0, 9.05, 1024)
    step = times[1]
    x, v = wave([(1.0, 1.0, 0.3)], times)
    assert maxima(x, v, step, 1.0, 1e-9).tolist() == [1.0]
    x, v = wave([(1.0, 1.0, 0.3), (0.6, 2.0, 1.0)], times)
    fine, _ = wave([(1.0, 1.0, 0.3), (0.6, 2.0, 1.0)], np.linspace(0.0, 1.0, 10**6, endpoint=False))
    exact = np.sort(fine[(fine > np.roll(fine, 1)) & (fine >= np.roll(fine, -1))])[::-1]
    assert len(exact) == 2
    np.testing.assert_allclose(maxima(x, v, step, exact[0], 1e-9), exact, atol=1e-6)


def test_a_turn_right_after_a_release_is_one_maximum():
    """Carried along at a rate of 0.1, let go at 1: it turns 0.01 later, within a sample."""
    times = np.linspace(0.0, 9.05, 906)
    late = times % 1.0 - 0.7
    x = np.where(late < 0, 0.1 * late, 0.1 * late - 5 * late**2 + 16 * late**3)
    v = np.where(late < 0, 0.1, 0.1 - 10 * late + 48 * late**2)
    assert maxima(x, v, times[1], 5.1e-4, 1e-9).tolist() == [5.1e-4]


class Halved(own_systems.Oscillator):
    """Its frequency hangs on a field that is worked out of its stiffness as it is made."""

    half: float = 0.0

    def __post_init__(self):
        self.half = self.stiffness / 2

    def free_acceleration(self, t, q, v):
        return (-2 * self.half * q[0] / self.mass,)


def test_a_number_of_which_other_fields_are_made_is_not_varied():
    """`half` would stay what it was, and the motion with it, at every stiffness."""
    with pytest.raises(ValueError, match="^values must not be of stiffness: Halved makes other"):
        up_and_down(Halved(), "stiffness", np.array([1.0, 2.0]), settle=1.0, window=1.0)
    numbers.check_corners("values", Halved(), {"mass": (1.0, 2.0), "belt_speed": (0.1, 0.2)})


class ByInit(own_systems.Oscillator):
    """The same by an `__init__` of its own, which does not take what it works out."""

    half: float = 0.0

    def __init__(self, stiffness=1.0, mass=1.0):
        super().__init__(stiffness=stiffness, mass=mass)
        self.half = stiffness / 2


class Tabulated(own_systems.Oscillator):
    """What it makes of no number is another object each time, or no number."""

    table: tuple = (1.0, float("nan"))
    curve: object = None

    def __post_init__(self):
        self.curve = lambda x: x


def test_fields_made_of_no_number_do_not_hinder_and_those_of_an_init_are_seen():
    ends = {"stiffness": (1.0, 2.0)}
    with pytest.raises(ValueError, match="^values must not be of stiffness: ByInit makes other"):
        numbers.check_corners("values", ByInit(), ends)
    numbers.check_corners("values", ByInit(), {"mass": (1.0, 2.0)})
    numbers.check_corners("values", Tabulated(), ends)


@pytest.mark.parametrize("kind", sorted(SYSTEMS))
def test_shipped_systems_make_no_fields_of_their_numbers(kind):
    module, _, name = SYSTEMS[kind].partition(":")
    system = getattr(import_module(module), name)()
    for name in numbers.routes(system):
        own = numbers.value(system, name)
        numbers.check_followed("values", system, name, (own, own + 1e-6))
