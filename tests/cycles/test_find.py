"""The cycle that a simulation comes to: on a section that it passes, and passed once."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import own_systems
import pytest
from systems import Block, Ring

import wiperjax
from wiperjax import AbstractSystem, Coulomb
from wiperjax.cycles.branch.bifurcations import change
from wiperjax.cycles.branch.follow import follow
from wiperjax.cycles.chart import Turning, chart
from wiperjax.cycles.clock import scattered
from wiperjax.cycles.cycle import Cycle, close
from wiperjax.cycles.find import _closed, _dies, _near, find_cycle, once
from wiperjax.cycles.first_guess import Guess, Missing, _middle, runs_on
from wiperjax.cycles.orbit import falls
from wiperjax.cycles.return_map import Found, Shooting
from wiperjax.cycles.shooting import GROWING, Lost
from wiperjax.systems import numbers
from wiperjax.systems.oscillator import Oscillator


@pytest.fixture(scope="module")
def ring():
    start = ((1.2,), (0.0,))
    return find_cycle(Ring(), settle=60.0, initial_state=start, over="a")


@pytest.mark.slow
@pytest.mark.parametrize("angle", [-30.0, -27.0, -22.0])
def test_chatter_whose_lip_turns_just_after_its_release(angle):
    """Stick, release and turning lay between two samples: the start was a mixture of both regimes,
    and chatter at 185 Hz was called quiet."""
    belt = wiperjax.SteadyBelt(0.3)
    blade = wiperjax.Wiper(belt=belt, attack_angle=math.radians(angle))
    cycle = find_cycle(blade, settle=0.3)
    run = wiperjax.simulate(blade, 0.6)
    releases = run.event_time.values[run.event_kind.values == wiperjax.Event.RELEASE]
    assert cycle.found == Found.FOUND and cycle.stable
    assert cycle.period == pytest.approx(releases[-1] - releases[-2], rel=1e-6)


class Shaft(Oscillator):
    """Froude's pendulum on a shaft that carries it round."""

    coordinates = ("angle",)

    def free_acceleration(self, t, q, v):
        return (-jnp.sin(q[0]) - self.damping * v[0],)


@pytest.mark.long
def test_an_angle_that_runs_on_is_named():
    """A longer time was advised, however long it was."""
    shaft = Shaft(load=1.5, belt=wiperjax.SteadyBelt(2.0), friction=wiperjax.Coulomb(1.0))
    cycle = find_cycle(shaft, settle=60.0)
    assert cycle.found == Found.NOT_PERIODIC
    assert "angle runs on, and what turns round for good is no cycle" in cycle.why


def test_what_comes_to_rest_or_swings_does_not_run_on():
    t = np.linspace(0.0, 20.0, 801)
    ways = np.stack([2 * t + np.sin(9 * t), -t, np.exp(-t), np.sin(t), 0 * t], axis=1)
    found = runs_on(np.concatenate([ways, 0 * ways], axis=1))
    assert found.tolist() == [True, True, False, False, False]


@pytest.mark.slow
def test_chatter_in_bursts_of_impacts_is_passed_once():
    """Its turnings differ from burst to burst, by rounding: it was not periodic, or of two bursts.
    Chatter of one burst repeats every 35.5096 ms."""
    belt, angle = wiperjax.SteadyBelt(0.3), math.radians(-35.0)
    blade = wiperjax.Wiper(belt=belt, attack_angle=angle, support_stiffness=8000.0)
    for section in (None, lambda t, q, v: q[0] + 0.001):
        cycle = find_cycle(blade, settle=0.5, section=section)
        assert cycle.found == Found.FOUND
        assert cycle.period == pytest.approx(0.0355096, rel=1e-5)
        assert cycle.word.count("lift_off") == 1


@pytest.mark.slow
def test_bursts_that_turn_the_lip_in_some_periods_only_are_passed_once():
    """Four periods, of which one turned the lip between two samples of a burst: five returns."""
    belt, angle = wiperjax.SteadyBelt(0.56327315), math.radians(-33.909779)
    blade = wiperjax.Wiper(
        belt=belt, attack_angle=angle, normal_load=6.7165158, support_stiffness=6997.2405
    )
    cycle = find_cycle(blade, settle=0.5)
    assert cycle.found == Found.FOUND and cycle.word.count("lift_off") == 1
    assert cycle.period == pytest.approx(0.013550882, rel=1e-6)


class Struck(AbstractSystem):
    """A block of mass 1 on a spring of stiffness 1 and on a belt, which carries it into a stop."""

    unilateral: ClassVar[bool] = False
    stops: ClassVar[tuple[int, ...]] = (0,)
    belt: float = 0.2

    def free_acceleration(self, t, q, v):
        return (-q[0],)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - self.belt

    def switches(self, t, q, v):
        return (0.9 - q[0],)

    def rebound(self, stop, t, q, v, closed):
        return (-0.8 * v[0],)

    @property
    def law(self):
        return Coulomb(1.0, 0.6)


@pytest.mark.long
def test_a_cycle_whose_velocity_falls_through_zero_at_a_blow_only():
    """The jump was taken for a turning, in stick: no section of that state."""
    cycle = find_cycle(Struck(), settle=100.0, initial_state=((0.0,), (0.0,)), over="belt")
    reach = math.hypot(0.3, 0.16)  # of the arc about 0.6 from the stop, at -0.16
    turned = math.pi + math.asin(0.2 / reach)
    period = turned - math.atan2(0.16, 0.3) + (0.3 - reach * math.cos(turned)) / 0.2
    assert cycle.found == Found.FOUND and cycle.stable
    assert cycle.period == pytest.approx(period, rel=1e-9)
    branch = follow(cycle, 0.15, 0.25, step=0.2)
    assert branch.ends == ("the end of the range",) * 2


@pytest.mark.parametrize("rise", [0.4, 3.0])
def test_the_middle_is_passed_the_way_that_is_faster(rise):
    """It rises at the speed ``rise``, and falls at 1."""
    way = np.linspace(0, 4, 100) % 2
    place = np.where(way < 1, way, 2 - way)
    samples = np.stack([place, np.where(way < 1, rise, -1.0)], axis=1)
    section = _middle(SimpleNamespace(samples=samples), 0)
    assert section.level == pytest.approx(0.5, abs=0.02)
    assert section.sense == (1 if rise > 1 else -1)


def test_a_section_that_a_regime_cannot_cross_is_refused():
    """In stick nothing turns: the distance to such a section was divided by zero."""
    block = Block(0.4, 0.25, belt=0.05)
    with pytest.raises(Lost, match="in stick no motion crosses the section"):
        chart(block, [0.1, 0.05], 0.0, wiperjax.Regime.STICK, [1.0, 1.0], Turning(0))


@pytest.mark.slow
def test_a_motion_that_dies_out_is_quiet_before_it_has_died():
    start = ((1.0,), (0.0,))
    cycle = find_cycle(Ring(a=0.3), settle=60.0, initial_state=start, over="a")
    assert cycle.found == Found.AT_REST


@pytest.mark.slow
def test_a_cycle_passed_several_times_is_passed_once(ring):
    """Its period was a multiple, its multipliers were powers."""
    for times in (2, 3):
        several = replace(ring.shooting, repeats=times)
        longer = close(several, ring.state, ring.regime, times * ring.period)
        assert longer.period == pytest.approx(times * ring.period, rel=1e-9)
        assert longer.multipliers == pytest.approx(ring.multipliers**times, abs=1e-9)
        short = once(longer)
        assert short.period == pytest.approx(ring.period, rel=1e-9)
        assert short.multipliers == pytest.approx(ring.multipliers, rel=1e-6)
    assert once(ring) is ring


class Bouncing(AbstractSystem):
    """A ball on a table that goes up and down once a second; gravity 1.

    At restitution 1/2 one impact a period is stable from ``FOLD`` to ``DOUBLING`` (closed forms).
    """

    table: float = 0.03
    restitution: float = 0.5

    def free_acceleration(self, t, q, v):
        return (-1.0 + 0.0 * q[0],)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return q[0] - self.table * jnp.sin(2 * math.pi * t)

    def output(self, t, q, v):
        return v[0]

    @property
    def bounce(self):
        return self.restitution


FOLD = math.pi / 3 / (2 * math.pi) ** 2
DOUBLING = math.hypot(math.pi / 3, 10 / 9) / (2 * math.pi) ** 2


def bounce(table: float, aside: float):
    """Return the state at a whole second of the ball that bounces once a second, moved aside."""
    phase = math.acos(FOLD / table)
    left = 1 - phase / (2 * math.pi)
    height = table * math.sin(phase) + 0.5 * left - 0.5 * left**2
    return (height + aside,), (0.5 - left,)


@pytest.mark.long
@pytest.mark.parametrize(
    ("share", "settle", "aside", "word"),
    [(0.97, 10.0, 0.1, "impact"), (1.00002, 40_000.0, 1e-3, "impact impact")],
)
def test_on_either_side_of_a_doubling_the_cycle_is_that_settled_on(share, settle, aside, word):
    """Below, a slow alternating approach closed over two periods: the cycle of one, passed twice.
    Above, both impacts lie within what is alike: the answer was the unstable cycle between them."""
    table = share * DOUBLING
    cycle = find_cycle(
        Bouncing(table),
        settle=settle,
        initial_state=bounce(table, aside),
        period=1.0,
        over="table",
    )
    assert (cycle.found, cycle.word, cycle.stable) == (Found.FOUND, word, True)
    assert cycle.period == pytest.approx(len(word.split()))
    if word == "impact":  # e^2 is the multipliers' product; their sum is that of one bounce
        lift = 2.25 * table * (2 * math.pi) ** 2 * math.sqrt(1 - (FOLD / table) ** 2)
        pair = np.sort(np.roots([1.0, lift - 1.25, 0.25]))
        np.testing.assert_allclose(np.sort(np.real(cycle.multipliers)), pair, rtol=1e-7)


@pytest.mark.long
def test_a_ball_that_lies_on_the_table_leaves_no_coordinate_free():
    """Newton's method had nothing to solve for: a traceback. It lies until the table falls faster
    than it, from table (2 pi)^2 = 1 on."""
    cycle = find_cycle(
        Bouncing(0.02, 0.3),
        settle=30.0,
        initial_state=((0.1,), (0.0,)),
        period=1.0,
        over="table",
    )
    assert (cycle.found, cycle.word, cycle.stable) == (Found.FOUND, "", True)
    assert np.all(cycle.multipliers == 0) and cycle.maximum == pytest.approx(0.02, rel=1e-9)
    branch = follow(cycle, 0.015, 0.03, step=0.3)
    assert branch.ends == ("the end of the range",) * 2
    assert [(s.kind, s.detail) for s in branch.special] == [("grazing", "+lift_off +zeno")]
    assert branch.special[0].parameter == pytest.approx((2 * math.pi) ** -2, rel=1e-6)


@pytest.mark.long
def test_a_motion_that_ends_in_the_air_closes_no_cycle_on_the_table():
    """With no coordinate free its end was not looked at."""
    system = numbers.traceable(Bouncing(0.055), "table")
    shooting = Shooting(system, "table", lambda s: 1.0, None, 1, np.array([0.055, 0.35]), 1.0)
    pressed = np.array([-0.055, 0.0])
    cycle = close(shooting, pressed, int(wiperjax.Regime.SLIP_POS), 1.0, 0.75)
    assert cycle.found == Found.NOT_CONVERGED


@pytest.mark.long
def test_a_motion_that_passes_near_an_unstable_cycle_is_not_on_it():
    """Two states a second apart were alike, of a motion that repeats every seven seconds: the
    answer was a cycle with a multiplier 4.4."""
    ball = Bouncing(0.045)
    start = ((0.03,), (0.0,))
    cycle = find_cycle(ball, settle=40.0, initial_state=start, period=1.0, over="table")
    assert (cycle.found, cycle.stable) == (Found.FOUND, True)
    assert cycle.period == pytest.approx(7.0)


@pytest.mark.slow
def test_an_unstable_cycle_is_none_that_a_motion_settles_on(ring):
    """It begins on the unstable circle, and has not left it yet."""
    radius = math.sqrt(0.5 - math.sqrt(0.25 - ring.system.a))
    guess = Guess(ring.shooting, np.array([radius, 0.0]), ring.regime, ring.period)
    assert close(*guess).multipliers[0].real > 1
    cycle = _near(guess, 1.0)
    assert cycle.found == Found.NOT_PERIODIC and "unstable" in cycle.why


class Beside(AbstractSystem):
    """A driven first coordinate; beside it y'' + 0.4 y' + a y + y^3 = 0, which is not driven."""

    unilateral: ClassVar[bool] = False
    a: float = -0.5

    def free_acceleration(self, t, q, v):
        y = -0.4 * v[1] - self.a * q[1] - q[1] ** 3
        return jnp.cos(1.7 * t) - 0.3 * v[0] - q[0], y

    def directions(self, t, q):
        return (0.0, 0.0), (0.0, 0.0)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - 100.0


@pytest.mark.long
def test_a_pitchfork_that_the_first_coordinate_does_not_feel():
    """Its mirror image had the same extremes of the first coordinate: it counted as met before."""
    start = ((0.1, 0.7), (0.0, 0.0))
    cycle = find_cycle(
        Beside(), settle=200.0, initial_state=start, period=2 * math.pi / 1.7, over="a"
    )
    branch = follow(cycle, -0.55, 0.55, step=0.1)
    assert [s.kind for s in branch.special] == ["branch_point"]
    assert branch.special[0].parameter == pytest.approx(0.0, abs=1e-4)
    assert "the parameter turns back" in branch.special[0].detail
    assert branch.ends == ("the end of the range",) * 2
    y = np.array([c.state[1] for c in branch.cycles])
    assert y[0] * y[-1] < 0
    np.testing.assert_allclose(y**2, -branch.parameters, atol=1e-4)


@pytest.mark.long
def test_a_creep_towards_stick_is_no_cycle():
    """It closes to 5e-10, but a multiplier is 2e-4 from 1: the cycles that it creeps to, of stick,
    are a family and lie elsewhere."""
    law, belt = wiperjax.Stribeck(0.8, 0.5, 0.3), wiperjax.WipingBelt(0.8, 0.11)
    creeping = Oscillator(damping=0.0, friction=law, belt=belt)
    start = ((0.1,), (0.0,))
    cycle = find_cycle(creeping, settle=400.0, initial_state=start, period=1 / 0.11, over="load")
    assert cycle.found in (Found.NOT_ISOLATED, Found.NOT_CONVERGED) and cycle.why


class Measured(wiperjax.AbstractFriction):
    """A law measured at eight speeds, straight between them."""

    static: float = 0.9

    def coefficient(self, speed):
        speeds = jnp.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5])
        return jnp.interp(speed, speeds, jnp.array([0.9, 0.85, 0.7, 0.55, 0.42, 0.36, 0.35, 0.38]))


@pytest.mark.long
def test_squeal_by_a_law_with_corners_is_found_and_followed():
    """Steps over its corners are as rough as the tolerance allows: Newton's method came to 4e-9 of
    the motion and no nearer, and the answer was that it may be chaotic."""
    blade = wiperjax.Wiper(
        belt=wiperjax.SteadyBelt(0.3), attack_angle=math.radians(5.0), friction=Measured()
    )
    cycle = find_cycle(blade, settle=0.2, over="belt_speed")
    assert cycle.found == Found.FOUND and cycle.stable and cycle.word
    assert 1e-7 < cycle.trivial_error < 1e-3 and "known to" in cycle.why
    run = wiperjax.simulate(blade, 0.25, rtol=1e-10)
    releases = run.event_time.values[run.event_kind.values == wiperjax.Event.RELEASE]
    assert cycle.period == pytest.approx(releases[-1] - releases[-2], rel=1e-7)
    branch = follow(cycle, 0.28, 0.32)
    assert branch.ends == ("the end of the range",) * 2


class Shaken(own_systems.OnePiece):
    """A steady belt, shaken a little."""

    speed: float = 0.3
    frequency: float = 672.0

    def velocity(self, t, piece):
        return self.speed * (1 + 0.02 * jnp.sin(2 * math.pi * self.frequency * t))

    @property
    def peak(self):
        return 1.02 * self.speed

    @property
    def rms(self):
        return self.speed


@pytest.mark.long
def test_squeal_that_creeps_to_the_beat_of_a_belt_is_told_to_settle():
    """Just beside where it locks in: the answer said nothing."""
    blade = wiperjax.Wiper(belt=Shaken())
    cycle = find_cycle(blade, settle=0.1, period=1 / 672.0)
    assert cycle.found == Found.NOT_CONVERGED and 1e-6 < cycle.residual < 1e-2
    assert "it creeps, and must settle for longer, or is quasi-periodic or chaotic" in cycle.why


def test_events_that_change_are_counted_by_name():
    """Of a burst of chatter they filled six hundred characters."""
    cycle = Cycle(Ring(), Found.FOUND, word="capture release")
    burst = "capture " + "kink reversal " * 20 + "release"
    assert change(cycle, burst) == "+kink x20 +reversal x20"
    assert change(cycle, "capture") == "-release"


@pytest.mark.slow
def test_a_walk_that_has_spent_its_points_says_what_helps(ring):
    branch = follow(ring, 0.09, 0.2, step=0.01, most=3)
    assert branch.ends[1] == "3 points: a longer step reaches farther"


def test_a_second_section_on_which_the_motion_is_lost_hides_no_first_answer():
    def guesses(*first):
        yield from first
        raise Lost("the motion ended early: collapsed")

    assert _closed(Ring(), guesses(Missing(Found.NOT_PERIODIC)), 1.0).found == Found.NOT_PERIODIC
    alone = _closed(Ring(), guesses(), 1.0)
    assert alone.found == Found.TRAJECTORY_FAILED and "collapsed" in alone.why


def test_a_motion_that_ends_before_it_dies_out_is_lost():
    """What ended early was taken for one that goes on."""
    end = SimpleNamespace(result=wiperjax.Result.COLLAPSED, samples=np.ones((8, 2)))
    shooting = SimpleNamespace(motion=lambda *_, **__: end, system=None, scale=np.ones(2))
    with pytest.raises(Lost, match="collapsed"):
        _dies(Guess(shooting, np.ones(2), 0, 1.0, 0.0), 1.0)


@pytest.mark.parametrize("up", [0.5, 0.2])  # share of a period
def test_no_number_of_periods_is_in_step_with_the_samples_of_a_look(up):
    """At even distances 255.9 periods were a tenth of one, so that up to sixteen times as long
    motions were looked at; 51.25 of which a tenth is up were none."""
    for periods in np.arange(16, 1100, 0.5):
        swings = np.where(periods * GROWING % 1 < up, 1.0, -1.0)
        assert len(falls(swings)) > 14


@pytest.mark.long
@pytest.mark.parametrize("periods", [248, 256, 264])
def test_samples_in_step_with_the_periods_tell_no_other_cycle(periods):
    """The quarter of ``settle`` that is looked at held about as many periods as samples: a cycle
    of 31 or 33 times the period was found, word and all; of as many none, but rest."""
    once = find_cycle(Oscillator(), settle=100.0)
    late = find_cycle(Oscillator(), settle=4 * periods * once.period)
    assert late.found == Found.FOUND
    assert late.word == once.word
    assert late.period == pytest.approx(once.period, rel=1e-9)


class Leaning(Ring):
    """A swing that leans on a shaken elastic wall, and leaves it for a part of each period."""

    frequency: float = 1.0
    phase: float = 0.0

    def free_acceleration(self, t, q, v):
        depth = q[0] - 1.0 - 0.3 * jnp.sin(self.frequency * t + self.phase)
        return (0.8 - q[0] - 0.1 * v[0] - 50 * jnp.maximum(depth, 0.0),)


@pytest.mark.long
@pytest.mark.parametrize("phase", [0.0, 1.5 * np.pi, 1.75 * np.pi])
def test_a_wall_that_is_felt_at_some_phase_only_is_seen(phase):
    """All states that were asked had the phase 0 of the clock. Where the wall is not felt there, a
    period that stays the same over the frequency was taken, and ``follow`` told cycles of it."""
    with pytest.raises(ValueError, match="^period must be one after which .* at frequency = "):
        find_cycle(
            Leaning(phase=phase),
            settle=200.0,
            initial_state=((0.0,), (0.0,)),
            period=2 * np.pi,
            over="frequency",
        )


@pytest.mark.parametrize("periods", [1, 8, 16, 64, 128, 256])
def test_states_that_are_asked_are_not_in_step_with_the_periods(periods):
    for count in (16, 257, 1024, 2056):
        at = scattered(count)
        assert (np.diff(at) > 0).all() and 0 <= at[0] and at[-1] < count
        if count >= 4 * periods:
            phases = np.sort(periods * at / count % 1)
            assert np.diff(np.append(phases, phases[0] + 1)).max() < 0.6


class Grazing(AbstractSystem):
    """A damped mass on a spring, driven against a wall that it would just miss."""

    zeta: float = 0.8
    wall: float = 0.1

    @property
    def bounce(self):
        return 0.6

    def free_acceleration(self, t, q, v):
        return (jnp.cos(2.5 * t) - q[0] - 2 * self.zeta * v[0],)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return q[0] + self.wall

    def output(self, t, q, v):
        return v[0]


@pytest.mark.long
@pytest.mark.parametrize(("zeta", "aside", "periods"), [(0.8, 1e-3, 2), (1.5, 4e-3, 4)])
def test_a_cycle_of_several_periods_that_are_nearly_alike(zeta, aside, periods):
    """Behind a grazing one period in several has an impact, and hardly differs from the others by
    that: one alone was taken for a cycle, and none was found. Counted by a simulation in closed
    form between impacts."""
    reach = 1 / math.hypot(1 - 2.5**2, 2 * zeta * 2.5)
    system = Grazing(zeta=zeta, wall=(1 - aside) * reach)
    one = 2 * math.pi / 2.5
    cycle = find_cycle(system, settle=200 * one, initial_state=((0.0,), (0.0,)), period=one)
    assert cycle.found == Found.FOUND and cycle.word == "impact"
    assert cycle.period == pytest.approx(periods * one, rel=1e-12)
    assert cycle.stable


@pytest.mark.long
@pytest.mark.parametrize(("speed", "periods"), [(0.005, 7.3), (1e-4, 10)])
def test_slip_that_lies_between_two_samples_is_of_every_period(speed, periods):
    """Between sticks of 1/V s a block slips for some pi s: where samples saw that in some periods
    only, eight of them were called one; where in none, it did not return."""
    belt = wiperjax.SteadyBelt(speed)
    block = Oscillator(damping=0.0, friction=Coulomb(1.0, 0.5), belt=belt)
    period = 2 * (math.pi - math.atan(0.5 / speed)) + 1 / speed
    cycle = find_cycle(block, settle=periods * period + 1 / speed)
    assert cycle.found == Found.FOUND and len(cycle.word.split()) == 2
    assert cycle.period == pytest.approx(period, rel=1e-8)
