"""Limit cycles, their multipliers and branches, against closed forms."""

import copy
import math
from dataclasses import replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
import xarray as xr
from problems import IMPACT_CASES, periodic_impacts
from systems import Block, Ring, StopOscillator, turn

import wiperjax
from wiperjax import AbstractSystem, Coulomb
from wiperjax.blade.steady_slip import steady_slip
from wiperjax.cycles import branch, chart, shooting
from wiperjax.cycles.branch.dataset import COLUMNS, branch_dataset, column_attributes
from wiperjax.cycles.branch.follow import follow
from wiperjax.cycles.branch.repeats import comes_back, repeat_time
from wiperjax.cycles.branch.up_and_down import up_and_down
from wiperjax.cycles.clock import check_clock, refuse_a_clock
from wiperjax.cycles.find import find_cycle
from wiperjax.cycles.first_guess import moving
from wiperjax.cycles.return_map import Found
from wiperjax.cycles.shooting import shoot
from wiperjax.datasets.kinds import kind_of
from wiperjax.remedy.gradient import sensitivities
from wiperjax.systems import numbers
from wiperjax.systems.oscillator import Oscillator


@pytest.fixture(scope="module")
def ring():
    cycle = find_cycle(Ring(), settle=60.0, initial_state=((1.2,), (0.0,)), over="a")
    return cycle, follow(cycle, -0.1, 0.3, step=0.1)


@pytest.mark.long
def test_circle_from_a_simulation(ring):
    cycle, _ = ring
    r2 = 0.5 + math.sqrt(0.25 - 0.1)
    assert cycle.found == Found.FOUND and cycle.stable and cycle.residual < 1e-9
    assert cycle.period == pytest.approx(2 * math.pi, rel=1e-9)
    assert cycle.maximum == pytest.approx(math.sqrt(r2), rel=1e-9)
    assert cycle.minimum == pytest.approx(-math.sqrt(r2), rel=1e-7)
    assert cycle.velocity_rms == pytest.approx(math.sqrt(r2 / 2), rel=1e-9)
    assert cycle.multipliers == pytest.approx(
        [math.exp(-2 * math.pi * r2 * (2 * r2 - 1))], rel=1e-7
    )
    assert cycle.trivial_error < 1e-8
    assert cycle.word == ""


@pytest.mark.long
@pytest.mark.parametrize("place", [0.0, 0.3, 0.8])
def test_a_section_finds_the_cycle_that_the_motion_settles_on(ring, place):
    """A state moved straight onto it came to the unstable circle inside, or to rest."""
    cycle = find_cycle(
        Ring(), settle=60.0, initial_state=((1.2,), (0.0,)), over="a",
        section=lambda t, q, v: q[0] - place,
    )  # fmt: skip
    assert cycle.state[0] == pytest.approx(place, abs=1e-9) and cycle.state[1] < 0
    assert cycle.maximum == pytest.approx(ring[0].maximum, rel=1e-9) and cycle.stable


@pytest.mark.slow
@pytest.mark.parametrize(
    ("section", "message"),
    [
        (lambda t, q, v: q[0] - 5.0, "somewhere on the settled motion, but there was -5.9.* to -4"),
        (lambda t, q, v: 1.0, "section must fall through 0 .* but there was 1 to 1"),
        (lambda t, q, v: 0.0 * q[0], "section must fall through 0 .* but there was "),
        (lambda t, q, v: (v[0],), r"section must give one number, but gave \("),
    ],
)
def test_a_section_that_the_motion_does_not_cross_is_refused(ring, section, message):
    start = ((1.2,), (0.0,))
    with pytest.raises(ValueError, match=message):
        find_cycle(Ring(), settle=60.0, initial_state=start, over="a", section=section)


def test_a_range_that_lacks_the_cycle_is_refused(ring):
    """The answer was one point outside the range."""
    for low, high in ((0.15, 0.3), (-0.5, 0.05)):
        with pytest.raises(ValueError, match="must hold the cycle's own value 0.1 of a, but was"):
            follow(ring[0], low, high)


def test_branch_of_circles_with_fold_and_hopf(ring):
    _, branch = ring
    assert branch.ends == ("the end of the range", "a Hopf point")
    assert [s.kind for s in branch.special] == ["fold", "hopf"]
    fold, hopf = branch.special
    assert fold.parameter == pytest.approx(0.25, abs=1e-8)
    assert branch.cycles[fold.index].maximum == pytest.approx(math.sqrt(0.5), abs=1e-4)
    assert hopf.parameter == pytest.approx(0.0, abs=1e-6)
    for a, cycle in zip(branch.parameters, branch.cycles, strict=True):
        r2 = cycle.maximum**2
        assert a == pytest.approx(r2 - r2**2, abs=1e-9)
        exact = math.exp(-2 * math.pi * r2 * (2 * r2 - 1))
        assert cycle.multipliers[0].real == pytest.approx(exact, rel=1e-6)
    unstable = [not cycle.stable for cycle in branch.cycles]
    assert unstable[-1] and not unstable[0]


def test_cycles_and_branches_are_shown_in_short_and_compared_as_things(ring):
    """Arrays of samples filled the screen; of a copy, == and hash were tracebacks of numpy."""
    for one in ring:
        assert len(repr(one)) < 1000
        assert one != copy.copy(one) and one in {one}


def test_branch_as_a_dataset_survives_a_file(ring, tmp_path):
    ds = branch_dataset(ring[1])
    assert kind_of(ds) == "branch"
    ds.to_netcdf(tmp_path / "branch.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "branch.nc", engine="h5netcdf") as back:
        xr.testing.assert_equal(back.load(), ds)
    assert list(ds.special_kind.values) == ["fold", "hopf"]
    parts = [str(ds[f"multiplier_{key}"].attrs["long_name"]) for key in ("real", "imag")]
    assert [words.split(" of ")[0] for words in parts] == ["real part", "imaginary part"]


@pytest.mark.parametrize(
    ("system", "length", "force"), [(Ring(), None, "N"), (wiperjax.Wiper(), "m", "N/m")]
)
def test_a_branch_has_the_units_that_maps_and_runs_have(system, length, force):
    """Of a system of one's own only the coordinates have units that nothing declares: its branches
    had none for speeds and forces either, nor had derivatives of them."""
    units = {name: column_attributes(system, name).get("units") for name in COLUMNS}
    assert {units[name] for name in ("maximum", "minimum", "amplitude")} == {length}
    assert units["velocity_rms"] == units["slip_margin"] == "m/s"
    assert units["normal_force_max"] == force


@pytest.mark.slow
def test_pictures_of_a_branch_file(ring, tmp_path):
    from wiperjax import plots
    from wiperjax.datasets.branch_dataset import rest, simulations, with_rest, with_simulations
    from wiperjax.store.whole import open_map, write_dataset

    values = np.array([0.0, 0.1, 0.2])
    brute = xr.Dataset(
        {
            "maximum": (("way", "a", "peak"), np.full((2, 3, 2), 0.9)),
            "velocity_rms": (("way", "a"), np.full((2, 3), 0.6)),
        },
        coords={"way": ["up", "down"], "a": values},
        attrs={"over": "a", "settle": 600.0, "window": 20.0},
    )
    ds = with_simulations(branch_dataset(ring[1]), brute)
    ds = with_rest(ds, values, np.zeros((3, 1)), values[:, None] > 0)
    write_dataset(ds, tmp_path / "branch.h5")
    with open_map(tmp_path / "branch.h5") as back:
        xr.testing.assert_equal(simulations(back.load()), brute)
        assert list(rest(back)[2]) == [False, True, True]
    made = plots.plot_all(tmp_path / "branch.h5", tmp_path / "p.png", dpi=40)
    names = [n for n in plots.PICTURES["branch"] if n != "curves"]  # there are none in it
    assert [path.name for path in made] == [f"p-{n}.png" for n in names]
    cycles = {"picture": "cycles", "force": True}
    plots.plot_file(tmp_path / "branch.h5", made[1], quantity="velocity_rms", **cycles)
    with pytest.raises(ValueError, match="'loudness' is not in this branch; it holds a, period"):
        plots.plot_file(tmp_path / "branch.h5", made[1], quantity="loudness", **cycles)


@pytest.mark.long
def test_up_and_down_shows_what_coexists():
    values = np.linspace(-0.38, 0.32, 8)
    ds = up_and_down(
        Ring(), "a", values, settle=600.0, window=20.0, initial_state=((0.0,), (0.0,)), samples=4096
    )
    assert ds.attrs["source"].startswith("wiperjax")
    high = ds.maximum.max("peak")
    circle = np.sqrt(0.5 + np.sqrt(np.maximum(0.25 - values, 0)))
    circle[values > 0.25] = 0.0
    np.testing.assert_allclose(high.sel(way="up"), circle, atol=3e-6)
    circle[values > 0] = 0.0
    np.testing.assert_allclose(high.sel(way="down"), circle, atol=3e-6)


@pytest.mark.long
def test_another_number_to_vary_compiles_nothing(monkeypatch):
    """Which one was in the program: 15 s for the same cycle of the wiper over its load."""
    block = Oscillator(belt=wiperjax.SteadyBelt(0.5))
    times = {"settle": 100.0, "window": 50.0}
    cycle = find_cycle(block, settle=100.0, over="belt_speed")
    swept = up_and_down(block, "belt_speed", [0.5, 0.55], **times)
    for module in (shooting, branch.up_and_down):
        monkeypatch.delattr(module, "Reach")  # what is traced needs it
    other = find_cycle(block, settle=100.0, over="stiffness")
    assert other.period == cycle.period and other.found == Found.FOUND
    system, step = cycle.system, 1e-4
    stiffer = find_cycle(replace(system, stiffness=system.stiffness + step), settle=100.0)
    by = sensitivities(other, {"stiffness": (0.5, 2.0)}, "period").derivative.item()
    assert by == pytest.approx((stiffer.period - cycle.period) / step, rel=1e-3)
    again = up_and_down(block, "stiffness", [1.0, 1.1], **times)
    highs = (ds.maximum.sel(way="up").values[0, 0] for ds in (swept, again))
    assert next(highs) == pytest.approx(next(highs), rel=1e-12)


def test_values_at_which_a_belt_is_none_are_refused():
    """A ramp longer than half a period was simulated, to a code 2."""
    belt = wiperjax.TrapezoidBelt(1.0, 0.05, 6.0)
    times = {"settle": 200.0, "window": 100.0, "period": lambda system: 1 / system.belt.frequency}
    said = (
        r"^values must stay within what TrapezoidBelt may be, but at belt_ramp = 16: ramp must be"
    )
    with pytest.raises(ValueError, match=said):
        up_and_down(Oscillator(belt=belt), "belt_ramp", [6.0, 9.0, 16.0], **times)


@pytest.mark.long
def test_simulated_means_are_those_of_whole_periods():
    """A window of 6.3 periods at one value, 5.7 at another: the shares are the exact ones.

    On the way down: on the way up the block is left in slip, where it swings for ever.
    """
    m, k, fs, fd = 1.0, 100.0, 0.4, 0.25
    speeds = np.array([0.05, 0.07, 0.1])
    ds = up_and_down(
        Block(fs, fd, m, k, belt=0.05), "belt", speeds,
        settle=5.0, window=4.0, initial_state=((0.0,), (0.1,)),
    ).sel(way="down")  # fmt: skip
    a, w = (fs - fd) / k, math.sqrt(k / m)
    period = (2 / w) * (math.pi - np.arctan(w * a / speeds)) + 2 * a / speeds
    assert np.all(np.abs(4.0 / period - np.round(4.0 / period)) > 0.05)
    np.testing.assert_allclose(ds.stick_fraction, 2 * a / speeds / period, rtol=2e-4)
    # the mean velocity is zero over a period, and the kinetic energy has a closed form
    reach = np.sqrt(a**2 + (speeds / w) ** 2)
    half = np.pi - np.arctan(w * a / speeds)  # of the arc that slip is, in angle
    slip = reach**2 * w * (half + 0.5 * np.sin(2 * half))
    square = (speeds**2 * 2 * a / speeds + slip) / period
    np.testing.assert_allclose(ds.velocity_rms, np.sqrt(square), rtol=2e-4)


@pytest.mark.slow
def test_time_of_a_motion_that_comes_back_and_of_one_that_does_not():
    t = np.linspace(0, 7.3, 1000)[:, None]
    wave = np.hstack([np.sin(2 * np.pi * t + 0.4), 0 * t, np.cos(2 * np.pi * t + 0.4), 1e-18 * t])
    sizes, both = jnp.ones(4), jnp.ones(2, bool)

    def time(states, counted=both):
        return float(repeat_time(jnp.asarray(states), 7.3, sizes, counted))

    assert time(wave) == pytest.approx(7.0, abs=1e-4)
    assert time(wave * (1 + 0.1 * np.cos(np.pi * t + 0.2))) == pytest.approx(6.0, abs=1e-3)
    assert math.isnan(time(wave * np.exp(-t)))  # it dies out
    assert time(0 * wave) == time(1e-7 * wave * np.exp(-t)) == 7.3  # at rest
    falls = np.hstack([-0.2 * t, wave[:, :1], 0 * t - 0.2, wave[:, 2:3]])
    assert math.isnan(time(falls))
    assert time(falls, jnp.array([False, True])) == pytest.approx(7.0, abs=1e-4)
    whole = jnp.asarray(wave[t[:, 0] <= 6.0])
    assert comes_back(whole, sizes, both) and not comes_back(jnp.asarray(wave), sizes, both)


@pytest.mark.long
@pytest.mark.parametrize("samples", [512, 1024, 8192])
@pytest.mark.parametrize("way", [1, -1])
def test_turns_of_one_burst_are_no_period_apart(samples, way):
    """Of a motion with four small turns in a row 6.2 and 6.3 periods were told as whole ones."""

    def place(t):
        part = t % 1.0
        leap = np.where(part > 0.4, np.sin(np.pi * (part - 0.4) / 0.6) ** 2, 0.0)
        return way * (0.06 * part * (1 - part) + 0.004 * np.sin(20 * np.pi * part) - leap)

    t = np.linspace(0.05, 6.39, samples)
    states = np.stack([place(t), (place(t + 1e-6) - place(t - 1e-6)) / 2e-6], axis=1)
    found = float(repeat_time(jnp.asarray(states), t[-1] - t[0], jnp.ones(2), jnp.ones(1, bool)))
    assert found > 4.9 and found == pytest.approx(round(found), abs=1e-3)


@pytest.mark.long
def test_neimark_sacker_of_a_driven_oscillator():
    # multipliers of x'' + a x' + x = cos(w t) are exp(-a T/2 +- i ...): on the circle at a = 0
    system = Ring(a=0.2, b=0.0, c=0.0, drive=1.0)
    cycle = find_cycle(system, settle=60.0, initial_state=((0.1,), (0.0,)), period=turn, over="a")
    assert cycle.found == Found.FOUND
    period = 2 * math.pi / 1.7
    np.testing.assert_allclose(np.abs(cycle.multipliers), math.exp(-0.1 * period), rtol=1e-8)
    # as a cycle of a hundred periods it swings between its samples, as high all the same
    start = ((0.1,), (0.0,))
    long = find_cycle(system, settle=60.0, initial_state=start, period=100 * period, over="a")
    exact = 1 / math.hypot(1 - 1.7**2, 1.7 * 0.2)
    assert (long.maximum, long.minimum) == pytest.approx((exact, -exact), rel=1e-7)
    # it starts anywhere, not where it is highest
    slope = sensitivities(cycle, ["a"], "maximum").derivative
    assert float(slope[0]) == pytest.approx(-0.2 * 1.7**2 * exact**3, rel=1e-7)
    branch = follow(cycle, -0.1, 0.3, step=0.1)
    (special,) = branch.special
    assert special.kind == "neimark_sacker"
    assert special.parameter == pytest.approx(0.0, abs=1e-8)
    response = 1 / np.hypot(1 - 1.7**2, 1.7 * branch.parameters)
    np.testing.assert_allclose([c.maximum for c in branch.cycles], response, rtol=1e-6)


@pytest.mark.long
def test_v5_stick_slip_over_the_belt_speed():
    m, k, fs, fd, v = 1.0, 100.0, 0.4, 0.25, 0.05
    start = ((0.0,), (v,))
    cycle = find_cycle(Block(fs, fd, m, k, belt=v), settle=5.0, initial_state=start, over="belt")
    assert cycle.word == "capture release"
    assert cycle.stable and np.all(np.abs(cycle.multipliers) < 1e-9)  # stick forgets
    assert cycle.maximum == pytest.approx(0.00772015325445528, rel=1e-9)
    assert cycle.stick_fraction == pytest.approx(0.06 / 0.630027171822385, rel=1e-8)
    branch = follow(cycle, 0.02, 0.3, step=0.2)
    assert branch.special == [] and branch.parameters[[0, -1]] == pytest.approx([0.02, 0.3])
    a, w, speed = (fs - fd) / k, math.sqrt(k / m), branch.parameters
    period = (2 / w) * (math.pi - np.arctan(w * a / speed)) + 2 * a / speed
    np.testing.assert_allclose([c.period for c in branch.cycles], period, rtol=1e-8)
    highest = fd / k + np.sqrt(a**2 + (speed / w) ** 2)
    np.testing.assert_allclose([c.maximum for c in branch.cycles], highest, rtol=1e-8)


@pytest.mark.long
def test_v8_multipliers_and_period_doubling_over_the_frequency():
    e = 0.8
    system = StopOscillator(amplitude=1.0, frequency=2.5, restitution=e, side=-1.0)
    cycle = find_cycle(
        system, settle=300.0, initial_state=((-0.5,), (0.0,)), period=turn,
        over="frequency",
    )  # fmt: skip
    assert cycle.word == "impact" and cycle.minimum == pytest.approx(-0.800586609, abs=1e-8)
    (pair,) = IMPACT_CASES[0][-1]
    assert np.min(np.abs(cycle.multipliers - pair)) < 1e-7
    branch = follow(cycle, 2.45, 2.8, step=0.1)
    assert branch.ends == ("the end of the range",) * 2
    last = branch.cycles[-1]
    assert branch.parameters[-1] == pytest.approx(2.8)
    for exact in IMPACT_CASES[1][-1]:
        assert np.min(np.abs(last.multipliers - exact)) < 1e-6
    for c in branch.cycles:
        assert np.prod(c.multipliers).real == pytest.approx(e * e, rel=1e-7)

    def trace(w):
        """Of rotation times saltation: [[-e, 0], [(1 + e) a / v, -e]], a at the impact."""
        psi, speed = periodic_impacts(w, e)
        period = 2 * math.pi / w
        bend = (1 + e) * math.cos(psi) / speed
        return -2 * e * math.cos(period) + bend * math.sin(period)

    assert trace(2.5) == pytest.approx(2 * pair.real, rel=1e-7)
    exact = scipy.optimize.brentq(lambda w: 1 + trace(w) + e * e, 2.5, 2.8)
    (special,) = branch.special
    assert special.kind == "period_doubling"
    assert special.parameter == pytest.approx(exact, abs=1e-7)


@pytest.mark.long
def test_squeal_and_the_unstable_cycle_that_bounds_it():
    """Subcritical Hopf at the known speed; squeal ends where stick does, on the same branch."""
    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(1.35))
    upright = ((0.0, 0.0), (0.0, 0.0))
    given = {"initial_state": upright, "over": "belt_speed"}
    squeal = find_cycle(blade, settle=0.05, **given)
    assert squeal.found == Found.FOUND and squeal.stable
    assert "capture" in squeal.word and "release" in squeal.word
    branch = follow(squeal, 1.3, 1.6, step=0.1)
    (end,) = [s for s in branch.special if s.kind == "grazing_sliding_fold"]
    assert "-capture -release" in end.detail
    # at its end the unstable cycle touches v_t = 0, and its stick-slip partner has lost its stick
    at, beyond = branch.cycles[end.index], branch.cycles[end.index + 1]
    assert at.stick_fraction < 1e-3
    assert beyond.stick_fraction == 0 and 0 < beyond.slip_margin < 1e-3 and not beyond.stable
    # a simulation on either side of it
    for factor, squeals in ((0.99, True), (1.01, False)):
        belt = wiperjax.SteadyBelt(factor * end.parameter)
        start = (tuple(at.state[:2]), tuple(at.state[2:]))
        lifted = ((start[0][0] * (1 + 1e-4), 0.0), start[1])
        run = wiperjax.simulate(wiperjax.Wiper(belt=belt), 0.15, initial_state=lifted)
        late = run.velocity.sel(axis="x").isel(time=slice(-200, None))
        assert (float(late.std()) > 0.5) == squeals


@pytest.mark.long
def test_cycles_grow_out_of_the_hopf_point_of_v11():
    from wiperjax.cycles import cycle as cycles
    from wiperjax.cycles import return_map

    speed = 0.4511
    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(speed * 1.05))
    rest = steady_slip(blade)
    system = numbers.traceable(blade)
    scale = np.array([1e-4, 1e-4, 0.5, 0.5])
    section = chart.Turning(0)
    family = return_map.Shooting(system, "belt_speed", None, section, 1, scale, 1.0, 1.0)
    state = np.array([float(rest.x) + 4e-5, 0.0, 0.0, 0.0])
    small = cycles.close(family, state, wiperjax.Regime.SLIP_NEG, 1 / float(rest.frequency))
    assert small.found == Found.FOUND and not small.stable and small.word == ""
    assert small.trivial_error < 1e-8
    branch = follow(small, 0.4, 0.5, step=0.1)
    (hopf,) = [s for s in branch.special if s.kind == "hopf"]
    assert hopf.parameter == pytest.approx(speed, abs=1e-4)


def test_motions_without_a_cycle_say_so():
    start = ((1.0,), (0.0,))
    quiet = find_cycle(Ring(a=0.3), settle=200.0, initial_state=start, over="a")
    assert quiet.found == Found.AT_REST and math.isnan(quiet.period)
    with pytest.raises(ValueError, match="parameter must be a number of Ring .*but was 'mass'"):
        find_cycle(Ring(), settle=1.0, initial_state=((1.0,), (0.0,)), over="mass")
    with pytest.raises(ValueError, match="cycle must be a found one, but was at_rest"):
        follow(quiet, 0.0, 1.0)
    with pytest.raises(ValueError, match="settle must be a finite number > 0, but was -1"):
        find_cycle(Ring(), settle=-1)


def test_a_system_with_a_clock_needs_its_period():
    """Without it the clock began anew in each motion, and what closed was no motion of the
    system."""
    forced = Ring(a=0.3, drive=0.3, frequency=1.3)
    with pytest.raises(ValueError, match="period must be given: .* of Ring change with time"):
        find_cycle(forced, settle=200.0, initial_state=((1.0,), (0.0,)))
    with pytest.raises(ValueError, match="period must be given: .* of Wiper change with time"):
        find_cycle(wiperjax.Wiper(belt=wiperjax.WipingBelt(0.3, 1.0)), settle=0.1)


class ShakenStop(Ring):
    """A stop that is shaken: what moves is no force."""

    stops: ClassVar[tuple[int, ...]] = (0,)

    def switches(self, t, q, v):
        return (q[0] + 3.0 - jnp.cos(self.frequency * t),)

    def rebound(self, stop, t, q, v, closed):
        return (-v[0],)


class ShakenWall(Ring):
    """A soft wall that is shaken, reached by large motions only."""

    def free_acceleration(self, t, q, v):
        (free,) = super().free_acceleration(t, q, v)
        return (free + 30.0 * jnp.maximum(0.0, 0.1 * jnp.cos(self.frequency * t) - 0.8 - q[0]),)


def test_shaken_stops_and_walls_need_a_period_too():
    with pytest.raises(ValueError, match="period must be given: .* or stops of ShakenStop change"):
        find_cycle(ShakenStop(), settle=20.0, initial_state=((0.5,), (0.0,)))
    near, far = np.array([[0.5, 0.0]]), np.array([[0.5, 0.0], [-0.9, 0.0]])
    refuse_a_clock(ShakenWall(), near, 20.0)
    with pytest.raises(ValueError, match="period must be given"):
        refuse_a_clock(ShakenWall(), far, 20.0)


@pytest.mark.parametrize(
    ("over", "period", "message"),
    [
        ("a", 1.1, "one after which forces, .* of Ring come again .*, but was 1.1 s$"),
        ("frequency", 2 * math.pi / 1.7, "but was 3.69599 s at frequency = 1.7017"),
        ("a", lambda s: -1.0, "period must be a finite number > 0, but was -1"),
        ("a", lambda s: math.nan, "period must be a finite number > 0, but was nan"),
        ("a", lambda s: 0.0, "period must be a finite number > 0, but was 0"),
        ("a", lambda s: None, "period must be a finite number > 0, but was None"),
        ("a", lambda s: (1.0, 2.0), r"period must be a finite number > 0, but was \(1.0, 2.0\)"),
    ],
)
def test_a_period_that_is_not_that_of_the_clock_is_refused(over, period, message):
    """A number followed over the frequency gave cycles of another system."""
    forced, start = Ring(a=0.2, b=0.0, c=0.0, drive=1.0), ((0.1,), (0.0,))
    with pytest.raises(ValueError, match=message):
        find_cycle(forced, settle=60.0, initial_state=start, period=period, over=over)


def test_belts_come_again_after_a_stroke_and_back():
    for belt in (wiperjax.WipingBelt(0.3, 2.0), wiperjax.TrapezoidBelt(0.3, 2.0, 0.1)):
        system = Oscillator(belt=belt)
        for name, clock in (("belt_frequency", lambda s: 1 / s.belt.frequency), ("load", _half)):
            varied = numbers.traceable(system, name)
            check_clock(varied, clock, (name,), np.array([[0.1, 0.2]]))


def _half(system):
    return 0.5


class Second(AbstractSystem):
    """The first coordinate dies out, the second comes to a circle of radius 1."""

    unilateral: ClassVar[bool] = False
    a: float = 0.3

    def free_acceleration(self, t, q, v):
        return (-q[0] - 0.5 * v[0], self.a * (1 - q[1] ** 2 - v[1] ** 2) * v[1] - q[1])

    def directions(self, t, q):
        return (0.0, 0.0), (0.0, 0.0)

    def normal_force(self, t, q, v):
        return 1.0


@pytest.mark.long
def test_what_vibrates_in_another_coordinate_is_not_at_rest():
    start = ((0.1, 1.0), (0.0, 0.0))
    cycle = find_cycle(Second(), settle=100.0, initial_state=start, over="a")
    assert cycle.found == Found.FOUND and cycle.period == pytest.approx(2 * math.pi, rel=1e-9)
    assert np.ptp(cycle.motion.samples[:, 1]) == pytest.approx(2.0, rel=1e-7)
    branch = follow(cycle, 0.2, 0.4, step=0.3)
    assert branch.ends == ("the end of the range",) * 2 and len(branch.cycles) < 15


def test_a_coordinate_moves_by_its_own_size():
    samples = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 2e-9, 0.0, 0.0]])
    assert list(moving(samples, np.array([1.0, 1e-3, 1.0, 1.0]))) == [False, True]
    assert list(moving(samples, np.array([1.0, 1e-2, 1.0, 1.0]))) == [False, False]


@pytest.mark.long
def test_smallest_change_that_makes_steady_slip_stable():
    from wiperjax import remedy

    blade = wiperjax.Wiper(attack_angle=math.radians(5.0))
    bounds = {"support_damping": (0.5, 12.0), "mu_static": (0.35, 1.0)}
    found = remedy.stabilise(blade, bounds, margin=50.0, starts=4)
    best = found.parameters.isel(start=0)
    growth = float(steady_slip(found.blade).growth_rate)
    assert growth == pytest.approx(-50, rel=1e-5)  # the border of the demand, not beyond it
    assert float(best.growth_rate) == pytest.approx(growth, rel=1e-6)
    np.testing.assert_allclose(found.parameters.cost, best.cost, rtol=1e-4)  # from every start
    for name, (low, high) in bounds.items():
        assert low <= float(best[name]) <= high
    # no cheaper one on a grid
    low, high = np.array(list(bounds.values())).T
    share = np.linspace(0.0, 1.0, 64)  # as many points as the search looks at at once
    c, mu = np.meshgrid(low[0] + share * (high - low)[0], low[1] + share * (high - low)[1])
    every = wiperjax.Wiper(attack_angle=math.radians(5.0), support_damping=c, mu_static=mu)
    stable = np.asarray(steady_slip(every).growth_rate) < -50
    given = (np.array([1.0, 1.0]) - low) / (high - low)
    cost = (share[None, :] - given[0]) ** 2 + (share[:, None] - given[1]) ** 2
    assert float(best.cost) < np.min(cost[stable])

    none = remedy.stabilise(
        blade, {"support_damping": (0.5, 1.5), "mu_static": (0.9, 1.0)}, starts=2
    )
    assert found.parameters.meets.all() and not none.parameters.meets.any()
    assert float(none.parameters.growth_rate[0]) > -50


@pytest.mark.long
def test_smallest_change_beyond_an_edge_where_branches_are_born():
    """The rate of the branch that leans farthest jumps from 7 to -130 1/s there: searches by its
    slope ended on the near side, and none met what can be met."""
    from wiperjax import remedy

    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=math.radians(-30.0))
    bounds = {"normal_load": (1.0, 40.0), "support_stiffness": (200.0, 9000.0)}
    found = remedy.stabilise(blade, bounds, starts=2).parameters
    assert found.meets.any() and not np.any(np.diff(found.meets.values.astype(int)) > 0)
    low, high = np.array(list(bounds.values())).T
    share = np.linspace(0.0, 1.0, 128)  # in parts of as many points as the search looks at at once
    load, stiffness = np.meshgrid(*(low[:, None] + share * (high - low)[:, None]))
    parts = (p.reshape(4, 4096) for p in (load, stiffness))
    every = (
        replace(blade, normal_load=p, support_stiffness=k) for p, k in zip(*parts, strict=True)
    )
    stable = np.concatenate([np.asarray(steady_slip(each).growth_rate) < -50 for each in every])
    stable = stable.reshape(load.shape)
    cost = ((load - 15.0) / 39.0) ** 2 + ((stiffness - 2000.0) / 8800.0) ** 2
    assert float(found.cost[0]) < np.min(cost[stable]) < 1.2 * float(found.cost[0])


def test_a_measure_of_zero_has_no_way_down(ring):
    """A share of 0 is relative to nothing: the descent divided by it, and ended in IndexError."""
    from wiperjax import remedy

    cycle, bounds = ring[0], {"a": (0.0, 0.2)}
    found = remedy.sensitivities(cycle, bounds, "stick_fraction")
    assert float(found.derivative[0]) == 0 and np.isnan(found.buys) and np.isnan(found.elasticity)
    path = remedy.descend(cycle, bounds, measure="stick_fraction")
    assert path.end == "stick_fraction is 0" and path.steps.sizes["step"] == 1


@pytest.mark.long
def test_least_noise_from_several_starts():
    """Each search ends lower than where it began, and what it reports is what a run shows."""
    from wiperjax import remedy

    blade = wiperjax.Wiper(attack_angle=math.radians(5.0))
    bounds = {"support_damping": (0.5, 12.0), "mu_static": (0.35, 1.0)}
    times = {"duration": 0.04, "window": 0.02}
    found = remedy.quieten(blade, bounds, starts=3, most=12, **times)
    before = found.parameters.attrs["velocity_rms_before"]
    late = wiperjax.simulate(blade, 0.04, sample_interval=1e-5, rtol=1e-7).isel(
        time=slice(-2000, None)
    )
    assert before == pytest.approx(float(late["velocity"].sel(axis="x").std()), rel=1e-2)
    for name, (low, high) in bounds.items():
        values = found.parameters[name].values
        assert np.all((values >= low) & (values <= high))
    assert np.all(found.parameters["velocity_rms"] < before)
    assert np.all(found.parameters["velocity_rms"][:2] < 1e-3 * before)  # one valley has a bound
    assert remedy.verdict(blade)["label"] == "squeal"
    assert remedy.verdict(found.blade)["label"] == "quiet"
    steep = wiperjax.Wiper(attack_angle=math.radians(80.0), normal_load=200.0)
    assert int(wiperjax.simulate(steep, 0.04).result) == wiperjax.Result.COLLAPSED
    with pytest.raises(ValueError, match="blade must be one whose simulation finishes"):
        remedy.quieten(steep, bounds, starts=3, most=12, **times)
    with pytest.raises(ValueError, match=r"bounds of mu_static must be \(low, high\), but were"):
        remedy.quieten(blade, {"mu_static": (1.0, 0.5)})
    with pytest.raises(ValueError, match=r"window must lie inside \(0, 0.1\] s, but was 1"):
        remedy.quieten(blade, bounds, duration=0.1, window=1.0)


@pytest.mark.long
def test_what_has_come_to_rest_is_reported_at_rest():
    """The floor under the search's root, 1e-6 of the belt's speed, was reported as its noise."""
    from wiperjax import remedy

    blade = wiperjax.Wiper(attack_angle=math.radians(5.0), support_damping=11.0)
    found = remedy.quieten(
        blade,
        {"support_damping": (9.0, 12.0), "mu_static": (0.35, 1.0)},
        window=0.02,
        starts=1,
        most=1,
    ).parameters
    levels = float(found.velocity_rms[0]), found.attrs["velocity_rms_before"]
    assert max(levels) < 5e-7 * blade.belt.speed  # the steps of a loose tolerance


@pytest.mark.long
def test_derivatives_hold_where_a_recalled_stay_ends_on_its_other_side():
    """On a belt that turns one stick lasts as long as the one before, but ends at the other edge of
    the cone. The step that was made to end at the first ended at the second, was taken whole, and
    the release behind it had no derivative of its time: a multiplier of 0.0068."""
    system = Oscillator(
        belt=wiperjax.WipingBelt(1.0, 0.06), friction=Coulomb(0.5, 0.4), damping=0.3, load=0.39271
    )
    cycle = find_cycle(system, settle=200.0, period=1 / 0.06, over="load")
    along, state = cycle.shooting.along, np.asarray(cycle.state)

    def end(state):
        moved = shoot(cycle.system, along, state, cycle.period, phase=cycle.phase,
                      regime=cycle.regime)  # fmt: skip
        return moved.state

    steps = 1e-6 * np.eye(2)
    slopes = np.stack([(end(state + d) - end(state - d)) / 2e-6 for d in steps], axis=1)
    np.testing.assert_allclose(cycle.motion.by_state, slopes, atol=1e-6)
    assert abs(cycle.multipliers[0]) == pytest.approx(0.0664606, abs=1e-6)


class Knocked(Block):
    """A block on still ground, pushed for an instant once a minute, that sticks in between."""

    def free_acceleration(self, t, q, v):
        after = t - 60.0 * jnp.round(t / 60.0 - 0.5) - 30.0
        push = 4.0 * jnp.exp(-((after / 0.4) ** 2))
        return ((push - self.stiffness * q[0]) / self.mass,)


@pytest.mark.long
def test_a_push_within_a_long_stick_is_seen_by_steps_that_are_short_enough():
    block, begin = Knocked(1.0, 1.0), ((0.0,), (0.0,))
    given = {"settle": 120.0, "initial_state": begin, "period": 60.0}
    # stepped over: docs/limits.md; a longest step that bounds none, for the program of the others
    assert find_cycle(block, **given, max_step=1e3).found == Found.AT_REST
    cycle = find_cycle(block, **given, max_step=0.2)
    assert cycle.found == Found.FOUND and cycle.regimes.count("slip") >= 2
    assert np.sort(np.abs(cycle.multipliers))[0] == 0.0  # the stick
    assert abs(cycle.multipliers[0]) < 0.3  # ten periods later a start is forgotten, to 2e-6
    long = wiperjax.solve(
        block, 660.0, initial_state=begin, rtol=1e-10, max_step=0.2,
        sample_times=np.linspace(600, 660, 20_001),
    )  # fmt: skip
    highest = float(long.samples.position[0].max())
    assert cycle.maximum == pytest.approx(highest, rel=1e-5)
    found = up_and_down(
        block, "stiffness", [1.0, 1.1], settle=600.0, window=60.0, initial_state=begin,
        period=lambda system: 60.0, max_step=0.2,
    )  # fmt: skip
    assert float(found.maximum[0, 0, 0]) == pytest.approx(cycle.maximum, rel=1e-5)
