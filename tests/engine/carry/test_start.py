"""Starts: the regime that a motion begins in, and what its derivatives know of that."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Block, Puck, trajectory

import wiperjax
from wiperjax import Regime, Result, Wiper, WipingBelt
from wiperjax.engine.carry.problem import Integration, make_case
from wiperjax.engine.solve import begin

MU = 0.5
AT_REST = ((0.0, 0.0), (0.0, 0.0))


class Pressed(Puck):
    """A puck pressed by ``gravity`` + ``growth`` t and drawn by ``push`` + ``draw`` t."""

    growth: float = 1.0
    draw: float = 0.0

    def free_acceleration(self, t, q, v):
        return self.push + self.draw * t, -self.gravity - self.growth * t


@pytest.mark.long
@pytest.mark.parametrize("gravity", [0.0, 1e-30, -1e-30])
@pytest.mark.parametrize(
    ("push", "draw", "regime", "place"),
    [
        (0.0, 0.0, Regime.STICK, 0.0),
        (0.0, 0.25, Regime.STICK, 0.0),
        (0.0, 0.75, Regime.SLIP_POS, 0.25 * 8 / 6),  # x'' = t / 4
        (0.0, -0.75, Regime.SLIP_NEG, -0.25 * 8 / 6),
        (2.0, 0.0, Regime.SLIP_POS, 4.0 - 0.5 * 8 / 6),  # x'' = 2 - t / 2
    ],
)
def test_a_load_that_grows_from_zero_holds_from_the_first_instant(
    gravity, push, draw, regime, place
):
    """It flew at first, and came down at once: ZENO_UNRESOLVED at 0 s."""
    s = trajectory(Pressed(MU, 0.0, gravity, push=push, draw=draw), 2.0, AT_REST)
    assert Result(int(s.result)) == Result.FINISHED
    assert Regime(int(s.final_regime)) == regime and int(s.events.count) == 0
    np.testing.assert_allclose(s.final_position, [place, 0.0], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_load_that_falls_from_zero_lets_go():
    s = trajectory(Pressed(MU, 0.0, 0.0, growth=-1.0), 2.0, AT_REST)
    assert Result(int(s.result)) == Result.FINISHED and int(s.events.count) == 0
    np.testing.assert_allclose(s.final_position, [0.0, 8 / 6], rtol=1e-9)


@jax.jit
def slide(angle, speed):
    start = ((6e-3 * jnp.sin(angle), 0.0), (speed, 0.0))
    return wiperjax.solve(Wiper(attack_angle=angle), 1e-3, initial_state=start).result


@pytest.mark.long
def test_a_tip_that_slides_where_its_dashpot_lifts_the_whole_load():
    """Zero to rounding: its sign stopped one in four at 1e-17 s. All soon fold over."""
    angles = np.linspace(0.2, 0.8, 40) * np.tile([-1.0, 1.0], 20)
    results = [int(slide(a, 15.0 / math.tan(a))) for a in angles]
    assert set(results) == {Result.COLLAPSED}


def test_a_gap_that_rounding_has_closed_too_far_is_closed():
    """At x = 0 as anywhere: it was judged by the place."""
    for x in (0.0, 1.0):
        s = trajectory(Puck(MU), 1.0, ((x, -1e-17), (0.0, 0.0)))
        assert Result(int(s.result)) == Result.FINISHED
        s = trajectory(Puck(MU), 1.0, ((x, -1e-9), (0.0, 0.0)))
        assert Result(int(s.result)) == Result.INCONSISTENT_START


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_a_gap_between_large_numbers_is_closed_as_far_as_these_tell(dtype):
    class Hung(Puck):
        def gap(self, t, q):
            return q[1] - jnp.cos(q[0])

    @jax.jit
    @jax.vmap
    def result(x, y):
        settings = Integration(rtol=1e-5)
        case = make_case(Hung(MU), 1.0, ((x, y), (0.0, 0.0)), settings, dtype=dtype)
        return begin(case).result

    x = jnp.linspace(0.1, 1.2, 100, dtype=dtype)
    assert not np.any(np.asarray(result(x, jnp.asarray(np.cos(x), dtype))) >= 0)


@pytest.mark.long
def test_the_release_of_what_begins_in_stick_has_its_derivatives():
    """The belt alone carries it there, at t = F / (k V): the speed that it was given has no
    part."""
    force, stiffness, speed = 0.9, 2.0, 0.3

    @jax.jit
    def release(speed, given):
        block = Block(force, 0.5, 1.0, stiffness, belt=speed)
        start = ((0.0,), (given,))
        s = wiperjax.solve(block, 2.0, initial_state=start, rtol=1e-10, max_events=4)
        return s.events.time[0]

    by_belt, by_start = jax.jacfwd(release, (0, 1))(speed, speed)
    assert float(by_belt) == pytest.approx(-force / stiffness / speed**2, rel=1e-9)
    assert float(by_start) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.long
def test_a_wiper_on_a_belt_that_turns_round_at_the_start():
    """By the belt's phase: central differences, whichever way it then moves off first."""

    def place(phase):
        wiper = Wiper(belt=WipingBelt(0.3, 10.0, phase), attack_angle=0.1)
        return wiperjax.solve(wiper, 2e-3, rtol=1e-11, max_events=0).final_position[0]

    moved = jax.jit(lambda phase: jax.jvp(place, (phase,), (1.0,)))  # one program for both
    step = 1e-5
    change = (moved(step)[0] - moved(-step)[0]) / (2 * step)
    slope = moved(0.0)[1]
    assert float(slope) == pytest.approx(float(change), rel=1e-6)


@pytest.mark.parametrize("gap", [7.7e-121, 1e-300, 1e-33])
def test_a_motion_goes_on_from_the_end_of_one_in_contact(gap):
    """It leaves such gaps behind. From there it flew: STEP_TOO_SMALL, or derivatives of 1e243."""
    blade = Wiper(attack_angle=0.35, normal_load=19.0, support_stiffness=8000.0)
    case = make_case(blade, 1e-3, ((0.0025, gap), (0.0, 0.0)), Integration(rtol=1e-8))
    assert begin(case).regime != Regime.FLIGHT
