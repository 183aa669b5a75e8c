"""Branches at corners and doublings: taken up on the other side, never walked back."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from problems import periodic_impacts
from systems import (
    STRIBECK_FOLD,
    STRIBECK_HOPF,
    Block,
    Ring,
    StopOscillator,
    StribeckOscillator,
    turn,
)

from wiperjax import Coulomb, SteadyBelt, Stribeck, WipingBelt
from wiperjax.cycles.branch import corner, walk
from wiperjax.cycles.branch.bifurcations import corner_kind, told_once
from wiperjax.cycles.branch.follow import follow
from wiperjax.cycles.branch.step import BranchStep
from wiperjax.cycles.cycle import Cycle, same_word
from wiperjax.cycles.find import find_cycle
from wiperjax.cycles.return_map import Found, Shooting
from wiperjax.systems.oscillator import Oscillator
from wiperjax.systems.soft_lip import SoftLip
from wiperjax.vocabulary.codes import CurveEnd, Regime


@pytest.fixture(scope="module")
def stick_slip():
    cycles = {}

    def at(belt):
        if belt not in cycles:
            start = ((0.0,), (belt,))
            cycles[belt] = find_cycle(
                StribeckOscillator(belt=belt), settle=1.0, initial_state=start, over="belt"
            )
        return cycles[belt]

    return at


def runs():
    """Starts, ranges and steps; four of them in every run of the tests."""
    every = [
        (belt, low, high, step)
        for belt in (0.15, 0.2, 0.25)
        for low, high in ((0.1, 0.4), (0.12, 0.35), (0.1, 0.3), (0.05, 0.5))
        for step in (0.02, 0.03)
    ]
    quick = every[:4]
    return [run if run in quick else pytest.param(*run, marks=pytest.mark.long) for run in every]


def no_gaps(branch, step):
    """Neighbours no further apart than steps are long, extremes and period in the measure."""
    return np.max(np.diff(branch.arclength)) < 2 * step


@pytest.mark.slow
@pytest.mark.parametrize(("belt", "low", "high", "step"), runs())
def test_branch_turns_at_the_fold_and_comes_to_the_hopf_point(stick_slip, belt, low, high, step):
    branch = follow(stick_slip(belt), low, high, step=step)
    assert [s.kind for s in branch.special] == ["grazing_sliding_fold", "hopf"]
    fold, hopf = branch.special
    assert fold.detail == "-capture -release"
    assert fold.parameter == pytest.approx(STRIBECK_FOLD, abs=1e-7 * (high - low) / step)
    assert hopf.parameter == pytest.approx(STRIBECK_HOPF, abs=2e-8)
    assert branch.ends == ("the end of the range", "a Hopf point")
    stable = [cycle.stable for cycle in branch.cycles]
    assert all(stable[: fold.index + 1]) and not any(stable[fold.index + 1 :])
    assert no_gaps(branch, step)


@pytest.mark.slow
def test_a_corner_met_on_the_way_down_reads_as_on_the_way_up(stick_slip):
    """A belt that runs the other way: the same cycles mirrored, the fold below the start."""
    special = {}
    for belt, low, high in ((0.2, 0.12, 0.35), (-0.2, -0.35, -0.12)):
        branch = follow(stick_slip(belt), low, high, step=0.1)
        (fold,) = [s for s in branch.special if s.kind == "grazing_sliding_fold"]
        special[belt] = fold
        here, on = branch.cycles[fold.index : fold.index + 2]
        assert (here.stick_fraction > 0, on.stick_fraction > 0) == (belt > 0, belt < 0)
    assert special[-0.2].parameter == pytest.approx(-special[0.2].parameter, abs=1e-6)
    assert [special[belt].detail for belt in (0.2, -0.2)] == [
        "-capture -release",
        "+capture +release",
    ]


SLIPS = "slip_neg stick slip_neg"


def of_words(word, regimes=SLIPS):
    return Cycle(Ring(), Found.FOUND, word=word, regimes=regimes)


def test_a_belt_that_reverses_is_no_event_of_the_contact():
    """Capture and release passed by the reversal were called bifurcations."""
    one = of_words("belt_reversal capture release belt_reversal capture release")
    other = of_words("capture release belt_reversal capture release belt_reversal")
    within = of_words("capture belt_reversal release capture belt_reversal release")
    assert same_word(one, other) and same_word(one, within)
    assert not same_word(one, of_words("belt_reversal capture release belt_reversal"))


@pytest.mark.parametrize(
    ("one", "other", "kind"),
    [
        ("belt_kink capture release", "capture belt_kink release", "shoulder"),
        ("capture release", "capture kink kink release", "shoulder"),
        ("kink capture kink release", "capture kink kink release", "shoulder"),
        ("kink capture release", "capture kink release impact", "grazing"),
        ("capture release", "capture blow release", "grazing"),
        ("kink kink", "kink capture kink release", "grazing_sliding"),
    ],
)
def test_corners_are_named_by_what_the_contact_does(one, other, kind):
    slips = SLIPS if "capture" in one else "slip_neg"
    for pair in ((of_words(one, slips), of_words(other)), (of_words(other), of_words(one, slips))):
        assert corner_kind(*pair) == kind


@pytest.mark.parametrize(
    ("lasts", "kind"),
    [
        ((0.4, 0.3, 0.2999, 0.0001), "grazing_sliding"),  # stick of a moment, in slip
        ((0.0001, 0.3, 0.2999, 0.4), "adding_sliding"),  # slip of a moment, in stick
    ],
)
def test_what_begins_at_a_corner_is_the_shortest_phase(lasts, kind):
    """Beside another stick both have the same order of regimes, and were `crossing_sliding`."""
    slip, stick = Regime.SLIP_NEG, Regime.STICK
    events = SimpleNamespace(
        count=3, time=np.cumsum(lasts)[:3], after=np.array([stick, slip, stick])
    )
    motion = SimpleNamespace(regimes=np.array([slip]), events=events, times=np.array([0.0, 1.0]))
    long = of_words("capture release capture release", "slip_neg stick slip_neg stick")
    pair = replace(long, motion=motion), of_words("capture release")
    assert corner_kind(*pair) == corner_kind(*pair[::-1]) == kind


@pytest.mark.long
def test_a_block_stops_at_its_turns_up_to_den_hartogs_frequency():
    """Below, at 0.18047292 (a solution in closed form between stops), it goes on once more on its
    way: that was called a stick which begins at a turn."""
    cycle = find_cycle(
        Block(1.0, 1.0, amplitude=2.0, frequency=0.3),
        settle=400.0,
        initial_state=((0.0,), (0.0,)),
        period=lambda system: 2 * np.pi / system.frequency,
        over="frequency",
    )
    branch = follow(cycle, 0.15, 0.65, step=0.1)
    assert [s.kind for s in branch.special] == ["adding_sliding", "crossing_sliding"]
    more, none = branch.special
    assert more.parameter == pytest.approx(0.18047292, abs=1e-7)
    w = none.parameter
    slope = np.sin(np.pi / w) / (w * (1 + np.cos(np.pi / w)))
    assert w**2 * np.sqrt(4 / (1 - w**2) ** 2 - slope**2) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("one", "other", "far", "jumps"),
    [
        ("impact", "impact impact impact", 1e-3, True),
        ("impact", "impact impact impact", 1e-4, False),  # both sides of a symmetric system graze
        ("impact", "impact impact", 1e-3, False),
        ("blow blow blow kink", "blow kink", 1e-3, True),
        ("lift_off zeno", "impact impact impact", 1e-3, False),
    ],
)
def test_a_grazing_of_many_hits_from_afar_is_told_from_one(one, other, far, jumps, monkeypatch):
    """A ball on a table came from 8 impacts to 10, over a fold and a doubling, without a word."""
    monkeypatch.setattr(corner, "place", lambda shooting, step: step.place)
    edge, step = (
        SimpleNamespace(cycle=of_words(word), place=np.array([at]))
        for word, at in ((one, 0.0), (other, far))
    )
    assert corner.jumped(None, edge, step) == jumps


@pytest.mark.long
def test_a_cycle_that_is_small_since_the_belt_is_slow_comes_to_no_hopf_point():
    """Far below the speed of Stribeck's curve friction falls in a line, and stick alone bounds the
    motion: it is as large as the belt is fast, and steady slip unstable down to rest."""
    blade = Oscillator(belt=SteadyBelt(0.01))
    cycle = find_cycle(blade, settle=300.0, over="belt_speed")
    branch = follow(cycle, 1e-5, 0.011, step=0.2)
    assert branch.special == [] and branch.ends == ("the end of the range",) * 2
    sizes = np.array([c.amplitude for c in branch.cycles]) / branch.parameters
    assert sizes[0] > 5 and np.ptp(sizes) < 0.2 * sizes[0]


class Isola(Ring):
    """Circles with a^2 + a + b r^2 + c r^4 = const: an oval of two folds, at a = -1 and 0."""

    offset: float = 1.0

    def free_acceleration(self, t, q, v):
        r2 = q[0] ** 2 + v[0] ** 2
        damping = self.offset + self.a + self.a**2 + self.b * r2 + self.c * r2**2
        return (-damping * v[0] - q[0],)


@pytest.mark.long
def test_closed_branch_is_walked_once():
    system = Isola(a=-0.5, b=-2.0, c=1.0, offset=1.0)
    cycle = find_cycle(system, settle=60.0, initial_state=((1.3,), (0.0,)), over="a")
    branch = follow(cycle, -1.5, 0.5, step=0.1)
    assert branch.ends == ("the branch is closed",) * 2
    assert [s.kind for s in branch.special] == ["fold", "fold"]
    assert [s.parameter for s in branch.special] == pytest.approx([0.0, -1.0], abs=1e-8)
    r2 = np.array([c.maximum**2 for c in branch.cycles])
    a = branch.parameters
    np.testing.assert_allclose(a**2 + a + (r2 - 1) ** 2, 0.0, atol=1e-8)
    assert no_gaps(branch, 0.1)
    assert branch.cycles[-1].maximum == pytest.approx(branch.cycles[0].maximum, abs=1e-5)


class Mathieu(Ring):
    """x'' + a x' + (1 + b cos(w t)) x = cos(w t): its multipliers are those of Mathieu."""

    def free_acceleration(self, t, q, v):
        beat = jnp.cos(self.frequency * t)
        return (beat - self.a * v[0] - (1 + self.b * beat) * q[0],)


@pytest.mark.long
def test_a_tongue_narrower_than_a_step_is_not_passed_over():
    """Multipliers pass -1 at w = 1.985 and come back at 2.015: tests of both ends were positive."""
    damping, depth = 0.02, 0.05

    def one_plus_trace(w):
        def rates(t, y):
            return [y[1], -damping * y[1] - (1 + depth * math.cos(w * t)) * y[0]]

        span, exact = (0.0, 2 * math.pi / w), {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
        ends = [scipy.integrate.solve_ivp(rates, span, y, **exact).y[:, -1] for y in np.eye(2)]
        return 1 + np.trace(ends) + np.linalg.det(ends)

    system, start = Mathieu(a=damping, b=depth), ((0.0,), (0.0,))
    cycle = find_cycle(system, settle=800.0, initial_state=start, period=turn, over="frequency")
    branch = follow(cycle, 1.5, 2.5, step=0.1)
    assert [s.kind for s in branch.special] == ["period_doubling"] * 2
    exact = [scipy.optimize.brentq(one_plus_trace, *ends) for ends in ((1.95, 2.0), (2.0, 2.05))]
    assert [s.parameter for s in branch.special] == pytest.approx(exact, abs=1e-6)


@pytest.fixture(scope="module")
def two_impacts():
    """The period-doubled cycle of the impact oscillator, beyond its doubling over the frequency."""
    cycle = find_cycle(
        StopOscillator(amplitude=1.0, frequency=2.66, restitution=0.8, side=-1.0),
        settle=1200.0,
        initial_state=((-0.5,), (0.0,)),
        period=turn,
        over="frequency",
    )
    assert cycle.word == "impact impact"
    return cycle


@pytest.mark.long
def test_doubled_branch_ends_where_its_halves_are_alike(two_impacts):
    """Beyond, the halves have changed places: the same cycles again."""
    e = 0.8
    branch = follow(two_impacts, 2.6, 2.7, step=0.1)

    def one_more_than_trace(w):
        psi, speed = periodic_impacts(w, e)
        period = 2 * math.pi / w
        bend = (1 + e) * math.cos(psi) / speed
        return 1 - 2 * e * math.cos(period) + bend * math.sin(period) + e * e

    exact = scipy.optimize.brentq(one_more_than_trace, 2.5, 2.8)
    (special,) = branch.special
    assert special.kind == "period_doubling" and special.index == 0
    assert special.parameter == pytest.approx(exact, abs=5e-8)
    assert branch.ends == ("a period doubling: half of the cycle is one", "the end of the range")
    assert np.all(np.diff(branch.parameters) > 0)


@pytest.mark.long
def test_a_doubled_branch_ends_there_too_where_its_start_moves_to_the_other_half():
    """Of a lip on soft glass: called a branch point, and walked over. Without a clock the start of
    a cycle moves on where an event comes to it."""

    def branch(degrees):
        lip = SoftLip(
            belt=SteadyBelt(0.5),
            friction=Coulomb(1.0),
            contact_stiffness=3000.0,
            attack_angle=math.radians(degrees),
            support_damping=0.1,
            neck_stiffness=0.15,
            shoulder_stiffness=0.15,
        )
        cycle = find_cycle(lip, settle=0.5, over="attack_angle")
        return follow(cycle, *map(math.radians, (6.0, 13.0)), step=0.1)

    twice, once = branch(10.0), branch(12.5)
    assert [special.kind for special in twice.special][-2:] == ["fold", "period_doubling"]
    assert twice.ends[1] == "a period doubling: half of the cycle is one"
    doubling = next(s for s in once.special if s.kind == "period_doubling")
    assert twice.special[-1].parameter == pytest.approx(doubling.parameter, abs=1e-6)
    assert math.degrees(doubling.parameter) == pytest.approx(11.68022, abs=1e-4)


@pytest.mark.parametrize(
    ("places", "kinds"),
    [
        ({"fold": 1.0e-2, "branch_point": 1.1e-2}, ["branch_point"]),  # steps of 0.01: both stood
        ({"branch_point": 0.9e-2, "fold": 1.0e-2}, ["branch_point"]),
        ({"branch_point": 0.2e-2, "fold": 1.0e-2}, ["branch_point", "fold"]),
    ],
)
def test_a_branch_that_turns_where_another_crosses_has_one_point_where_it_turns(places, kinds):
    found = told_once([(at, kind, "", kind) for kind, at in places.items()])
    assert [kind for _, kind, _, _ in found] == kinds
    assert found[-1][0] == 1.0e-2 and found[-1][3] == "fold"


@pytest.mark.parametrize(
    ("begun", "special", "end"),
    [
        (1.0, ("period_doubling", "the cycle is one of half its period, twice"), "a period d"),
        (0.0, ("fold", ""), ""),  # a cycle that is passed twice all along may have folds
    ],
)
def test_a_fold_may_be_the_doubling_at_which_a_branch_ends(begun, special, end, monkeypatch):
    """Where no branch point was told beside it the walk went on, over cycles it had passed."""
    monkeypatch.setattr(walk.Walk, "_cut", lambda self, here, ahead, length: (length, ahead))
    monkeypatch.setattr(walk.Walk, "_append", lambda self, step: self.points.append(step))
    monkeypatch.setattr(walk.Walk, "_note_vanishing", lambda self, here, ahead: None)

    def step(apart):
        states = np.array([[0.0], [2.0], [apart], [-2.0], [0.0]])
        cycle = SimpleNamespace(motion=SimpleNamespace(samples=states))
        return SimpleNamespace(cycle=cycle, begin=0, point=SimpleNamespace(parameter=1.0))

    here, fold, ahead = step(begun), step(0.02 * begun), step(-begun)
    one_way = walk.Walk(None, 0.0, 2.0, 0.1, 9, 1.0)
    one_way.points.append(here)
    one_way._take(here, ahead, [(0.05, "fold", "", fold)], 0.1)
    assert one_way.special == [(*special, 1.0, 1)] and one_way.end.startswith(end)
    assert one_way.points[-1] is (fold if end else ahead)


@pytest.mark.long
def test_a_walk_that_comes_back_on_itself_says_so(two_impacts, monkeypatch):
    """A doubling that is not noticed: the walk goes over it, to cycles that it has passed."""
    monkeypatch.setattr(walk, "doubled", lambda cycle: False)
    branch = follow(two_impacts, 2.6, 2.7, step=0.1)
    assert branch.ends[0] == "the walk came back on itself: a smaller step may go on"
    assert branch.parameters[0] < 2.655  # a few steps at most, where cycles are close together


@pytest.mark.slow
def test_cycles_of_the_same_extremes_are_not_the_same_for_that(monkeypatch):
    """Of a symmetric cycle of one coordinate the extremes are one number, and two pieces of a
    branch cross over the parameter (a block on a trapezoid belt, at 0.5446 of 0.1 to 1.5 m/s): the
    branch was said to be closed there, with multipliers of 0.787 and 0.474."""

    def at(parameter, rms):
        highest = 1.2944 + 0.59 * (parameter - 0.5446)
        motion = SimpleNamespace(samples=np.zeros((3, 2)))
        cycle = Cycle(
            Ring(), Found.FOUND, period=1.0, maximum=highest, minimum=-highest, velocity_rms=rms
        )
        point: Any = SimpleNamespace(motion=motion, parameter=parameter)
        return BranchStep(point, replace(cycle, multipliers=np.array([0.5, 0.0])), np.empty(0), 1.0)

    family = Shooting(Ring(), "a", turn, None, 1, np.array([1.3, 0.7]), 1.0)
    one = walk.Walk(family, 0.1, 1.5, 0.05, 100, 1.0)
    one.points = [at(0.5465, 0.4), at(0.5431, 0.4)]
    monkeypatch.setattr(walk, "with_parameter", lambda _, step, value: at(value, 0.4))
    assert one._met(at(0.5446, 0.4)) is not None
    assert one._met(at(0.5446, 0.5)) is None


def test_a_branch_that_meets_itself_far_from_its_start_is_not_closed(monkeypatch):
    """A block on a sine belt: the walk down from 1 m/s came to a family of cycles that stick all
    along, at 0.347 m/s, and went to and fro there: it was closed, and none above 1 m/s walked."""

    def at(parameter, highest):
        motion = SimpleNamespace(samples=np.zeros((3, 2)))
        cycle = Cycle(
            Ring(), Found.FOUND, period=1.0, maximum=highest, minimum=-1.0, velocity_rms=0.2
        )
        point: Any = SimpleNamespace(motion=motion, parameter=parameter)
        return BranchStep(point, replace(cycle, multipliers=np.array([0.5, 0.0])), np.empty(0), 1.0)

    family = Shooting(Ring(), "a", turn, None, 1, np.ones(2), 1.0)
    monkeypatch.setattr(walk, "with_parameter", lambda _, step, value: at(value, 1.0))
    monkeypatch.setattr(walk, "between", lambda *_: (0.0, at(0.5, 1.0)))
    for start, word in ((0.1, "came back on itself"), (0.5, "is closed")):
        one = walk.Walk(family, 0.0, 1.0, 0.05, 100, 1.0)
        ahead, here = at(0.52, 1.0), at(0.48, 1.1)
        one.points = [*([at(0.1, 2.0)] if start == 0.1 else []), at(0.5, 1.0), at(0.55, 1.0), here]
        one._cut(here, ahead, 0.05)
        assert word in one.end and (one.code == CurveEnd.CLOSED) == (start == 0.5)


@pytest.mark.long
def test_a_branch_ends_at_a_family():
    """Below this amplitude of the belt the block never slips, wherever it is carried to and fro:
    the walk went on over these cycles, with a special point at each turn."""
    rate = 2 * math.pi * 0.05
    held = 1 / math.hypot(1 / rate - rate, 0.3)
    law = Stribeck(1.0, 0.5, 0.3, 1.0, 0.0)
    system = Oscillator(damping=0.3, belt=WipingBelt(1.0, 0.05), friction=law)
    start = ((0.0,), (0.0,))
    cycle = find_cycle(
        system, settle=800.0, initial_state=start, period=lambda s: 1 / s.belt.frequency,
        over="belt.amplitude",
    )  # fmt: skip
    branch = follow(cycle, 0.1, 2.0, step=0.2)
    assert branch.ends[0].startswith("beyond, cycles are a family"), branch.ends
    assert [s.kind for s in branch.special] == ["adding_sliding", "fold", "fold"], branch.special
    assert branch.special[0].parameter == pytest.approx(held, abs=1e-5)


@pytest.mark.long
def test_branch_goes_on_beyond_a_grazing_impact():
    """Free vibrations reach the stop at an amplitude |1 - w^2|; with impacts the branch turns."""
    w, e = 1.3, 0.8
    graze = abs(1 - w * w)
    system = StopOscillator(load=-1.0, amplitude=0.9 * graze, frequency=w, restitution=e)
    start = ((0.1,), (0.0,))  # on the free vibration: nothing damps
    cycle = find_cycle(system, settle=5.0, initial_state=start, period=turn, over="amplitude")
    assert cycle.found == Found.FOUND and cycle.word == ""
    branch = follow(cycle, 0.5 * graze, 1.5 * graze, step=0.1)
    (special,) = branch.special
    assert (special.kind, special.detail) == ("grazing_fold", "+impact")
    assert special.parameter == pytest.approx(graze, abs=1e-6)
    words = {c.word for c in branch.cycles[special.index + 1 :]}
    assert words == {"impact"} and branch.ends[1] == "the end of the range"
    assert no_gaps(branch, 0.1)


class Damped(StopOscillator):
    """x'' + 0.1 x' + x = a cos(w t) with a wall at x = 1, told by x - 1."""

    load: float = 1.0
    side: float = -1.0
    restitution: float = 0.8
    frequency: float = 2.9

    def free_acceleration(self, t, q, v):
        return (super().free_acceleration(t, q, v)[0] - 0.1 * v[0],)


@pytest.mark.long
def test_a_branch_of_impacts_turns_where_it_grazes_once_more():
    """It was said to have no cycle beyond. Exact: equations of the flights between the impacts."""
    graze = abs(1 - 2.9**2 + 0.29j)  # of the free vibration
    cycle = find_cycle(
        Damped(amplitude=0.8 * graze),
        settle=220.0,
        initial_state=((-1.0,), (0.0,)),
        period=turn,
        over="amplitude",
    )
    assert cycle.word == "impact impact"
    branch = follow(cycle, 0.79 * graze, 1.3 * graze, step=0.2)
    _, corner, fold, doubling = branch.special
    kinds = ["period_doubling", "grazing_fold", "fold", "period_doubling"]
    assert [s.kind for s in branch.special] == kinds and corner.detail == "+impact"
    assert corner.parameter == pytest.approx(8.6209765760, abs=5e-7)
    assert fold.parameter == pytest.approx(6.8601063131, abs=1e-8)
    assert doubling.parameter == pytest.approx(7.2349318537, abs=5e-7)
    assert {c.word for c in branch.cycles[corner.index + 1 :]} == {"impact impact impact"}
    assert branch.ends == ("the end of the range",) * 2


class Slow(Damped):
    """x'' + 0.04 x' + x = cos(w t) with a wall at x = 1, slowly driven."""

    amplitude: float = 1.0
    frequency: float = 0.66

    def free_acceleration(self, t, q, v):
        return (super().free_acceleration(t, q, v)[0] + 0.06 * v[0],)


@pytest.mark.long
def test_a_branch_goes_on_beyond_a_grazing_that_its_tangent_does_not_cross(monkeypatch):
    """One of two impacts comes to graze (exact: where a flight between two of the other touches),
    and one is left. Which motions along the tangent at the edge still have both hangs on its last
    digits: of those looked at here all have, which was "no cycle beyond, though no event changes".
    """
    monkeypatch.setattr(corner, "LOOKED", corner.LOOKED[2:])
    start = ((-1.0,), (0.0,))
    cycle = find_cycle(Slow(), settle=900.0, initial_state=start, period=turn, over="frequency")
    assert cycle.word == "impact impact"
    branch = follow(cycle, 0.5, 0.67, step=0.1)
    graze, doubling = branch.special
    assert (graze.kind, doubling.kind) == ("grazing", "period_doubling")
    assert graze.parameter == pytest.approx(0.5052647294990, abs=1e-6)
    assert {c.word for c in branch.cycles[: graze.index]} == {"impact"}
    assert branch.ends == ("the end of the range",) * 2


@pytest.mark.long
def test_a_system_that_loses_nothing_has_no_tori_and_no_stable_cycles():
    """Its multipliers lie on the unit circle but for rounding, whose sign made a dozen of points
    at which a pair passes it, and cycles stable by turns.

    From stop to stop x = cos(w t) / (1 - w^2) + A cos t, with x = 0 half a period from t = 0.
    """
    w = 2.5
    free = 1 / (1 - w * w)
    lowest = free + free / math.cos(math.pi / w)  # forced and free part, alike at the stop
    cycle = find_cycle(
        StopOscillator(amplitude=1.0, frequency=w, restitution=1.0, side=-1.0),
        settle=2 * math.pi / w,
        initial_state=((lowest,), (0.0,)),
        period=turn,
        over="amplitude",
    )
    assert cycle.found == Found.FOUND and cycle.word == "impact"
    np.testing.assert_allclose(np.abs(cycle.multipliers), 1.0, rtol=1e-9)
    branch = follow(cycle, 0.3, 3.0, step=0.1)
    assert branch.special == []
    assert not any(c.stable for c in branch.cycles)


def test_a_fold_at_the_very_end_of_a_step_is_no_period_doubling(monkeypatch):
    """Whatever lay there was called one."""
    nothing: Any = None
    step: Any = SimpleNamespace(sense=1.0, cycle=None, point=SimpleNamespace(parameter=0.2))
    way = walk.Walk(nothing, 0.0, 1.0, 0.1, 10, 1.0)
    way.points.append(step)
    monkeypatch.setattr(walk, "doubled", lambda cycle: False)
    monkeypatch.setattr(way, "_cut", lambda here, ahead, length: (length, ahead))
    monkeypatch.setattr(way, "_append", way.points.append)
    way._take(step, step, [(0.1, "fold", "the branch turns back", step)], 0.1)
    assert [(special.kind, special.index) for special in way.special] == [("fold", 1)]
    assert len(way.points) == 2


def test_a_fold_of_cycles_whose_halves_are_merely_alike_ends_no_branch(monkeypatch):
    """A drive whose every second push is a little stronger: its fold was called a doubling."""
    monkeypatch.setattr(walk.Walk, "_cut", lambda self, here, ahead, length: (length, ahead))
    monkeypatch.setattr(walk.Walk, "_append", lambda self, step: self.points.append(step))
    monkeypatch.setattr(walk.Walk, "_note_vanishing", lambda self, here, ahead: None)
    nothing: Any = None

    def take(begun, here, fold, ahead):
        states = [np.array([[0.0], [2.0], [a], [-2.0], [0.0]]) for a in (begun, here, fold, ahead)]
        cycles = [SimpleNamespace(motion=SimpleNamespace(samples=s)) for s in states]
        point = SimpleNamespace(parameter=1.0)
        first, *rest = (SimpleNamespace(cycle=cycle, begin=0, point=point) for cycle in cycles)
        way = walk.Walk(nothing, 0.0, 2.0, 0.1, 9, 1.0)
        way.points.append(first)
        way._take(rest[0], rest[2], [(0.05, "fold", "", rest[1])], 0.1)
        return [special.kind for special in way.special], way.end

    assert take(0.5, 0.03, 0.02, 0.01) == (["fold"], "")
    # begun right beside its doubling: the walk went over it
    assert take(0.02, 0.5, 1e-4, -0.5)[0] == ["period_doubling"]


class Uneven(Ring):
    """x'' + x'/10 + x + x^3/10 = cos(w t) + cos(w t / 2) / 20."""

    def free_acceleration(self, t, q, v):
        push = jnp.cos(self.frequency * t) + 0.05 * jnp.cos(0.5 * self.frequency * t)
        return (push - 0.1 * v[0] - q[0] - 0.1 * q[0] ** 3,)


@pytest.mark.long
def test_a_resonance_under_uneven_pushes_goes_on_over_its_fold():
    cycle = find_cycle(
        Uneven(frequency=1.0),
        settle=300.0,
        initial_state=((0.0,), (0.0,)),
        period=lambda system: 4 * math.pi / system.frequency,
        over="frequency",
    )
    branch = follow(cycle, 0.9, 2.5, step=0.05, most=150)
    assert branch.special[0].kind == "fold"
    assert branch.special[0].parameter == pytest.approx(1.818395, abs=1e-6)
    assert not any(c.stable for c in branch.cycles[branch.special[0].index + 1 :][:5])
