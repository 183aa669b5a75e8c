"""Derivatives of a sweep: right where they are declared valid, and nothing where they are not."""

import os
import signal
import time
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import stub_sweep
import xarray as xr
from own_systems import Ball
from processes import fork

from wiperjax.blade.wiper import Wiper
from wiperjax.contact.belts import TrapezoidBelt
from wiperjax.contact.friction import Coulomb
from wiperjax.datasets import map_dataset
from wiperjax.engine.observers import margins
from wiperjax.engine.observers.base import Stretch, higher, highest
from wiperjax.engine.observers.totals import RegimeTotals
from wiperjax.maps import block, driver, estimate
from wiperjax.maps.cells import batch
from wiperjax.maps.cells import evaluate as cells
from wiperjax.maps.cells.sensitivity import differences, evaluate, tangents, validity
from wiperjax.maps.cluster import Workers
from wiperjax.specs.load import SpecError, parse_sweep
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map
from wiperjax.vocabulary import codes
from wiperjax.vocabulary import columns as columns_by_name
from wiperjax.vocabulary.parameters import PARAMETERS

CELLS, BLOCK = 224, 112
STILL = 1e-3  # Hz: a belt that keeps its speed


def blades(**extra):
    """Random blades on a belt that keeps its speed, and on one that reverses.

    Half of the angles are those at which a stiff support chatters with flight.
    """
    rng = np.random.default_rng(7)
    angles = [*rng.uniform(-40, 40, 7), *rng.uniform(-37, -29, 7)]
    return parse_sweep(
        {
            "axes": {
                "belt_frequency": {"values": [STILL, 20.0]},
                "attack_angle": {"values": sorted(angles)},
                "belt_speed": {"values": sorted(rng.uniform(0.15, 0.6, 8).tolist())},
            },
            "belt": {"kind": "wiping", "phase": 90.0},
            "blade": {"support_stiffness": 8000.0},
            "run": {"transient": 0.001, "window": 0.019, "rtol": 1e-11, "samples": 128},
            "classes": {"reversal_window": 0.005},
            "sensitivities": {"check": 1.0, "step": 6e-6} | extra,
        },
        "test.toml",
    )


@pytest.fixture(scope="module")
def found():
    """Columns of each block, and the differences behind their agreement."""
    gaps = []
    check = validity.check

    def spy(*arguments):
        other, found = check(*arguments)
        gaps.append(found)
        return other, found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluate, "check", spy)
        blocks = [
            evaluate.evaluate(blades(), np.arange(start, start + BLOCK))
            for start in range(0, CELLS, BLOCK)
        ]
    return blocks, {name: np.concatenate([gap[name] for gap in gaps]) for name in gaps[0]}


@pytest.fixture(scope="module")
def columns(found):
    blocks = found[0]
    per_cell = [name for name, x in blocks[0].items() if np.shape(x)[:1] == (BLOCK,)]
    return {name: np.concatenate([b[name] for b in blocks]) for name in per_cell}


@pytest.mark.long
def test_derivatives_agree_with_central_differences(found, columns):
    """Issue 7, item 6: over stick-slip, chatter with flight and reversal."""
    fine = columns["sensitivity_code"] == codes.VALIDITY["fine"]
    reverses = np.arange(CELLS) >= CELLS // 2
    worst = np.max(list(found[1].values()), axis=0)
    kinds = {
        "all": (fine, 200),
        "stick-slip": (fine & (columns["stick_count"] > 0), 60),
        "flight": (fine & (columns["flight_fraction"] > 0.001), 50),
        "reversal": (fine & reverses, 90),
    }
    for name, (those, fewest) in kinds.items():
        median, largest = np.median(worst[those]), worst[those].max()
        print(f"{name}: {those.sum()} cells, {median:.1e} in the median, {largest:.1e} at worst")
        assert those.sum() >= fewest, name
        assert median < 1e-6, name
        assert largest < 1e-4, name


@pytest.mark.long
def test_a_closer_look_is_at_the_same_motion_by_the_same_program(columns, monkeypatch):
    """Two samples of half the length make up one."""
    monkeypatch.setattr(batch, "compute", None)  # the plain program: seconds to compile
    several = np.arange(0, BLOCK, 9)
    closer = cells.evaluate(blades(), several, 2, BLOCK)
    pairs = closer["signal"].reshape(len(several), -1, 2)
    np.testing.assert_allclose(pairs.mean(axis=2), columns["signal"][several], atol=2e-7)
    assert closer["sample_interval"] == 0.019 / 256 and "since_reversal" in closer


def test_what_was_not_compared_does_not_agree():
    """At an end of its range a parameter is not moved: its derivative was said to agree to 0.0."""
    at, name = np.zeros(1), "restitution"
    spec = SimpleNamespace(parameter_table=PARAMETERS, sensitivities=SimpleNamespace(step=1e-5))
    scale = {name: differences.scale_of(PARAMETERS[name], at)}
    inside = {name: differences._is_inside(PARAMETERS[name], at, 1e-5 * scale[name])}
    place, words = {"final_x": np.zeros((1, 4, 1))}, np.zeros((1, 4, 1), int)
    moved = differences.Moved(np.array([0]), scale, inside, place, words)
    columns = {"result": at, "belt_speed_rms": at + 1, "final_x": at}
    slopes = {"final_x": np.array([[123.0]])}
    other, gaps = validity.check(spec, moved, None, columns, slopes, np.zeros(1, int))
    assert not other[0] and np.isnan(gaps["final_x", name])


def test_how_well_a_cell_agrees_hangs_on_no_other_cell():
    """It was a product of matrices: its last digits were others in a block of another size."""
    rng = np.random.default_rng(0)
    n, name = 61, "normal_load"
    spec = SimpleNamespace(parameter_table=PARAMETERS, sensitivities=SimpleNamespace(step=1e-5))
    places = 1.0 + 1e-5 * rng.random((1, 4, n))
    columns = {key: np.ones(n) for key in ("result", "belt_speed_rms", "final_x")}

    def gaps(cells):
        scale, inside = {name: np.full(len(cells), 15.0)}, {name: np.ones(len(cells), bool)}
        words = np.zeros((1, 4, len(cells)), int)
        found = {"final_x": np.ascontiguousarray(places[:, :, cells])}
        moved = differences.Moved(cells, scale, inside, found, words)
        slopes = {"final_x": np.full((n, 1), 0.01)}
        return validity.check(spec, moved, None, columns, slopes, np.zeros(n, int))[1]

    several = gaps(np.arange(n))["final_x", name]
    alone = [gaps(np.array([k]))["final_x", name][0] for k in range(n)]
    np.testing.assert_array_equal(several, alone)
    mixed = rng.permutation(n)
    np.testing.assert_array_equal(gaps(mixed)["final_x", name], several[mixed])


@pytest.mark.long
def test_what_does_not_hold_is_masked(columns):
    bad = columns["sensitivity_code"] != codes.VALIDITY["fine"]
    names = [name for name in columns if name.startswith("d_")]
    outcomes = columns_by_name.differentiable(True, "wiping")
    assert len(names) == 3 * len(outcomes)
    for name in names:
        assert np.all(np.isnan(columns[name][bad])), name
    assert np.all(np.isnan(columns["sensitivity_agreement"][bad]))
    assert np.all((columns["grazing_margin"] >= 0) & (columns["grazing_margin"] <= 1))


@pytest.mark.long
def test_units_are_those_of_files(columns):
    """Degrees: against the closed form of the belt's speed, and the map's own attributes."""
    foretold = {column.name for column in estimate.columns(blades())}
    assert {n for n in foretold if n.startswith("d_")} == {n for n in columns if n.startswith("d_")}
    fine = columns["sensitivity_code"] == codes.VALIDITY["fine"]
    np.testing.assert_allclose(columns["d_belt_speed_rms_d_belt_speed"][fine], 0.5**0.5)
    units = columns_by_name.attributes_of("d_velocity_rms_d_attack_angle", {})["units"]
    assert units == "(m/s)/(degrees)"


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # of dask
def test_a_killed_sweep_goes_on_to_the_same_derivatives_on_a_cluster(tmp_path, found):
    """The first block is kept by a process that is killed in the second, which a worker of dask
    then computes: in this process and on one core, for which the engine is compiled already."""
    from distributed import Client, LocalCluster

    blocks, spec, path = found[0], blades(), tmp_path / "map.h5"
    options = {"block": BLOCK, "progress": False}

    def dies(spec, index):
        if index[0]:
            while not open_map(parts_of(path)).done.any():  # it is stored beside this
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGKILL)
        return blocks[0]

    identity = block.engine()[1]
    child = fork(lambda: driver.sweep(spec, path, evaluate=dies, identity=identity, **options))
    assert os.WIFSIGNALED(os.waitpid(child, 0)[1])
    with open_map(parts_of(path)) as part:
        assert part.done.values.sum() == BLOCK
        assert np.isnan(part.d_stick_fraction_d_normal_load.values.ravel()[BLOCK:]).all()
    seen = iter(blocks)
    in_memory = driver.sweep(
        spec, None, evaluate=lambda *_: next(seen), identity=identity, **options
    )
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as client,
        driver.sweep(spec, path, resume=True, workers=Workers(client), **options) as ds,
    ):
        xr.testing.assert_identical(stub_sweep.data_of(ds), stub_sweep.data_of(in_memory))


@pytest.mark.slow
@pytest.mark.parametrize("correction", [-1e-4, 0.0, 1e-4])
def test_a_peak_is_that_of_a_quartic_and_so_is_its_derivative(correction):
    """Against a fine grid: peaks inside, at the start, and at the end, which an event may shift."""
    powers = np.arange(5)
    rng = np.random.default_rng(3)
    # single humps, and slopes either way
    hump = np.stack([rng.uniform(-1, 1, 200), *rng.normal(0, 0.2, (4, 200))])
    hump[2] -= rng.uniform(0, 2, 200)
    hump[1] += rng.uniform(-1, 3, 200)

    def peak(shape, correction):
        nodes = tuple((0.25 * k) ** powers @ shape for k in range(5))
        step = jnp.ones(())
        stretch = Stretch(None, 0.0, step, jnp.asarray(correction), 0, (), (), (), ())
        return stretch.peak(nodes)

    grid = np.linspace(0, 1 + correction, 20001)[:, None] ** powers
    value, slope = jax.vmap(jax.value_and_grad(peak), (1, None))(hump, correction)
    heights = grid @ hump
    place = np.argmax(heights, axis=0)
    np.testing.assert_allclose(value, heights.max(axis=0), atol=1e-7)
    np.testing.assert_allclose(slope, grid[place], atol=1e-3)
    assert 20 < np.sum(place == 0) and 20 < np.sum(place == 20000)
    assert 80 < np.sum((place > 0) & (place < 20000))


def test_a_largest_value_about_to_be_overtaken_is_masked():
    """The runner-up 1e-5 below catches up within two steps of 1e-5 where its slope is another: by
    that parameter, not by those which raise both peaks alike."""
    spec = blades(step=1e-5)
    count, seconds = 4, list(tangents.SECOND.values())
    below = np.array([1e-5, 1e-5, 1e-2, 1e-5])
    columns = {
        "result": np.zeros(count),
        "belt_speed_rms": np.full(count, 0.3),
        "normal_force_max": np.full(count, 20.0),
        seconds[0]: 20.0 - below,
    }
    slopes = {"normal_force_max": np.ones((count, 2)), seconds[0]: np.ones((count, 2))}
    slopes[seconds[0]][:, 0] = [1.2, 1.0, 1.2, 1.01]  # per N/m of load: times 15 per unit of it
    for name, second in zip(("gap_max", "impact_impulse_max"), seconds[1:], strict=True):
        columns |= {name: np.zeros(count), second: np.zeros(count)}
        slopes |= {name: np.zeros((count, 2)), second: np.zeros((count, 2))}
    theta = {"normal_load": np.full(count, 15.0), "tip_mass": np.full(count, 2.4e-3)}
    validity.mask_contested(slopes, columns, theta, Wiper(), spec)
    assert np.isnan(slopes["normal_force_max"][:, 0]).tolist() == [True, False, False, False]
    assert np.all(slopes["normal_force_max"][:, 1] == 1) and np.all(slopes["gap_max"] == 0)


def test_of_equal_peaks_the_first_counts_and_the_second_is_the_runner_up():
    """A ball with e = 1 comes back to its height for ever: peaks e^2, e^4, e^6. The mean slope of
    two, 5, was stored for the largest, and for the runner-up, too, so that nothing differed."""
    zero = jnp.zeros(())
    begun = RegimeTotals().init(jnp.float64), margins.Peaks(zero, zero, zero)

    def largest(e):
        totals, seconds = begun
        for peak in (e**2, e**4, e**6, 0.5 * e):
            seconds = margins._beaten(seconds, totals, "gap_max", peak, True)
            totals = totals._replace(gap_max=higher(totals.gap_max, peak))
        return totals.gap_max, seconds.gap_max

    assert jax.jvp(largest, (1.0,), (1.0,)) == ((1.0, 1.0), (2.0, 4.0))
    assert np.isnan(higher(1.0, np.nan)) and np.isnan(higher(np.nan, 1.0))


def test_a_largest_force_beside_a_sharp_bend_of_friction_has_no_derivative():
    """With a hinge mass it came out 17, 3.5 and -10 at rtol 1e-10 to 1e-12, for -2.9."""
    shape = jnp.array([1.0, 1.2, 1.99, 2.0, 3.0])
    for mass, bent in ((0.0, [False] * 5), (1e-3, [False, True, True, False, False])):
        slopes = {name: np.ones((5, 2)) for name in ("normal_force_max", "gap_max")}
        validity.mask_bent_peaks(slopes, Wiper(hinge_mass=mass, stribeck_shape=shape))
        assert np.isnan(slopes["normal_force_max"]).any(axis=1).tolist() == bent
        assert np.all(slopes["gap_max"] == 1)
    slopes = {"normal_force_max": np.ones((5, 2))}
    validity.mask_bent_peaks(slopes, Wiper(hinge_mass=1e-3, friction=Coulomb(0.5)))
    assert np.all(slopes["normal_force_max"] == 1)


@pytest.mark.parametrize("name, part", [("hinge_mass", "tip_mass"), ("hinge_damping", None)])
def test_what_a_blade_has_none_of_is_measured_by_what_it_has(name, part):
    """A step of 1e-5 relative to 1 was 0.4 % of the tip mass, and 18 % of a damping that counts:
    peaks seemed to overtake each other all over a map."""
    size = float(differences.scale_of(PARAMETERS[name], np.zeros(1))[0])
    blade = Wiper()
    time = (blade.tip_mass / blade.support_stiffness) ** 0.5
    assert size == getattr(blade, part) if part else size < blade.neck_stiffness * 2 * time


@pytest.mark.slow
@pytest.mark.parametrize("heights", [(1.0, 0.8), (0.8, 1.0), (1.0, 1.0), (1.0, 0.3, 0.9)])
@pytest.mark.parametrize("steps", [7, 8, 23])
def test_the_runner_up_is_another_peak(heights, steps):
    """Of a row of bumps, in steps that cut them anywhere: the steps beside the highest vertex were
    taken for its runners-up."""
    edges = np.linspace(0, len(heights), steps * len(heights) + 1)

    def value(t):
        bump = np.minimum(t.astype(int), len(heights) - 1)
        return 0.1 + np.array(heights)[bump] * np.sin(np.pi * (t - bump)) ** 2

    hump = margins.Hump(jnp.zeros(()), jnp.array(False), jnp.array(False))
    totals = RegimeTotals().init(jnp.float64)
    seconds = margins.Peaks(*(jnp.zeros(()),) * 3)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = value(np.linspace(low, high, 101))
        peak, best = jnp.asarray(inside.max()), totals.normal_force_max
        hump, same = margins._passed(hump, (inside[0], inside[-1]), peak, best, True)
        seconds = margins._beaten(seconds, totals, "normal_force_max", peak, ~same)
        totals = totals._replace(normal_force_max=jnp.maximum(best, peak))
    first, second = sorted(heights, reverse=True)[:2]
    assert float(totals.normal_force_max) == pytest.approx(0.1 + first, rel=1e-2)
    assert float(seconds.normal_force_max) == pytest.approx(0.1 + second, rel=1e-2)


def test_the_first_trace_of_a_bounce_has_no_derivative():
    """At restitution 0 derivatives by it were those of a landing: 570 times too large, or too small
    by the time of the bounces."""
    theta = {"restitution": jnp.array([0.0, 0.3]), "attack_angle": jnp.zeros(2)}
    ways = {name: (name,) for name in theta}
    bounces = tangents.starts_to_bounce(Wiper(), ways, theta)
    slopes = {"final_x": np.ones((2, 2)), "stick_fraction": np.zeros((2, 2))}
    validity.mask_first_bounces(slopes, bounces)
    for slope in slopes.values():
        assert np.isnan(slope).tolist() == [[True, False], [False, False]]


def test_settled_is_judged_by_the_first_and_the_last_periods():
    spec = parse_sweep(
        {
            "axes": {"attack_angle": {"start": 0, "stop": 10, "num": 4}},
            "run": {"transient": 0.0, "window": 0.02, "samples": 512},
            "sensitivities": {"settled": 0.05},
        },
        "test.toml",
    )
    time = np.arange(512) / 512 * 0.02
    wave = np.sin(2 * np.pi * 770 * time)
    slow = np.sin(2 * np.pi * 30 * time)
    growing = wave * np.exp(20 * time)
    signals = np.stack([wave, growing, 1e-4 * growing, slow])
    columns = {
        "result": np.zeros(4),
        "signal": 0.3 * signals,
        "velocity_rms": 0.3 * np.std(signals, axis=1),
        "belt_speed_rms": np.full(4, 0.3),
    }
    settled = validity.is_settled(columns, spec)
    assert settled.tolist() == [True, False, True, False]  # slow: not two periods


def test_faults_are_one_line():
    with pytest.raises(SpecError, match="sensitivities.parameters: 'atack_angle': .*attack_angle"):
        blades(parameters=["atack_angle"])
    with pytest.raises(SpecError, match="sensitivities.parameters: must not name .* twice"):
        blades(parameters=["neck_stiffness", "neck_stiffness"])


def test_a_sweep_without_them_keeps_its_digest():
    spec = parse_sweep(
        {
            "axes": {"attack_angle": {"start": 0, "stop": 10, "num": 2}},
            "run": {"transient": 0.01, "window": 0.02},
        },
        "test.toml",
    )
    assert "sensitivities" not in spec.canonical()
    assert spec.with_sensitivities().digest() != spec.digest()
    again = parse_sweep(spec.with_sensitivities().document(), "again")
    assert again.sensitivities == spec.with_sensitivities().sensitivities


@pytest.mark.parametrize("name", ["tip_mass", "lip_length", "normal_load"])
def test_sizes_of_outcomes_are_those_of_the_cells(name):
    """The wiper of a block has more cells than the block: a tip mass on an axis ended in a
    TypeError, after the work."""
    wiper = Wiper(**{name: np.linspace(1e-3, 2e-3, 64)})
    columns = {key: np.array([0.3, 0.5, 0.7]) for key in columns_by_name.DIFFERENTIABLE}
    columns["result"] = np.zeros(3)
    for key in columns_by_name.DIFFERENTIABLE:
        assert validity._outcome_scale(key, columns, wiper).shape == (3,)
    scale = validity._outcome_scale("impact_impulse_max", columns, wiper)
    np.testing.assert_allclose(scale, np.broadcast_to(wiper.tip_mass, 64)[:3] * [0.3, 0.5, 0.7])


def test_without_a_belt_a_mean_speed_is_measured_by_the_motion():
    """It was by itself: rounding over whole periods, whose derivatives were said to disagree."""
    columns = {"result": np.zeros(1), "velocity_rms": np.array([0.4]), "velocity_mean": [-3e-7]}
    assert validity._outcome_scale("velocity_mean", columns, Ball()) == pytest.approx(0.4)


def tolerances(**run):
    """A sweep whose file says so much of its tolerance."""
    return parse_sweep(
        {
            "axes": {"attack_angle": {"start": 0, "stop": 10, "num": 2}},
            "run": {"transient": 0.01, "window": 0.02} | run,
        },
        "test.toml",
    )


def test_a_sweep_with_them_has_a_tolerance_of_its_own_and_records_it():
    """At that of a map 18 of 600 cells were called fine and were not."""
    plain = tolerances()
    asked = plain.with_sensitivities()
    assert (plain.rtol, asked.rtol) == (1e-6, 1e-9)
    assert batch.Run.of(asked).rtol == 1e-9
    # the text by which maps are compared knows no difference between stated and left out, and
    # that of a map without derivatives is what it was
    assert '"rtol":1e-06,' in plain.canonical()
    assert plain.canonical() == tolerances(rtol=1e-6).canonical()
    assert asked.canonical() == tolerances(rtol=1e-9).with_sensitivities().canonical()
    assert map_dataset.describe(asked)["attrs"]["run_rtol"] == 1e-9
    assert parse_sweep(asked.document(), "again").digest() == asked.digest()
    assert tolerances(rtol=1e-10).with_sensitivities().rtol == 1e-10
    with pytest.raises(SpecError, match="^run.rtol: must be left out or .* 1e-09 .*1e-06$"):
        tolerances(rtol=1e-6).with_sensitivities()


def test_what_a_quiet_cell_keeps_of_its_start_has_no_derivative():
    """Its steps are as long as they are stable: there the rest of a start does not decay as the
    equations have it. What it moves about with is right."""
    spec = blades()
    slopes = {n: np.ones((3, 1)) for n in ("final_vx", "final_vy", "velocity_rms", "final_x")}
    columns = {
        "velocity_rms": 0.3 * np.array([0.5, 1e-3, 1e-6]),
        "belt_speed_rms": np.full(3, 0.3),
    }
    validity.mask_rounding(slopes, columns, spec)
    known = {name: np.isfinite(x[:, 0]).tolist() for name, x in slopes.items()}
    assert known["final_vx"] == known["final_vy"] == [True, False, False]
    assert known["velocity_rms"] == [True, True, False]
    assert known["final_x"] == [True, True, True]


@pytest.mark.long
def test_a_mirrored_blade_has_mirrored_derivatives():
    """(alpha, V, x) -> -(alpha, V, x), also by a parameter at an end of its range: of steady slip,
    which no motion, and so no program of one, is needed for."""
    parities = {"attack_angle": -1, "belt_speed": -1, "normal_load": 1, "stribeck_shape": 1}
    found = {}
    for sign in (1, -1):
        spec = parse_sweep(
            {
                "axes": {"attack_angle": {"values": [sign * 5.0]}},
                "belt": {"kind": "steady", "speed": sign * 1.5},
                "run": {"transient": 0.001, "window": 0.002},
                "start": {"equilibrium": 0.0},
                "sensitivities": {"parameters": list(parities), "check": 1.0},
            },
            "test.toml",
        )
        found[sign] = evaluate._lot(spec, np.arange(1), None).dknown
    for outcome in ("growth_rate", "linear_frequency"):
        here, there = (np.asarray(found[sign][outcome])[:, 0] for sign in (1, -1))
        np.testing.assert_allclose(here, np.array(list(parities.values())) * there, rtol=1e-9)
        assert np.all(here != 0)


@pytest.mark.long
def test_the_vertex_of_a_largest_force_is_found_and_its_derivative_with_it(monkeypatch):
    """A lip that sticks to a belt which slows down, in closed form, from many places. Through the
    ramp in one step the vertex is missed where the quartic is not hollow (2e-4 of 18 N/m) and the
    derivative is anything; in steps as short as those of a sweep with derivatives both are right.
    """
    ramp, speed, size = 0.002, 0.247, 0.15  # N/m: a hundredth of the load
    blade = Wiper(
        attack_angle=np.radians(22.0),
        support_stiffness=8000.0,
        belt=TrapezoidBelt(speed, 25.0, 2 * ramp),
    )
    starts = jnp.linspace(-2.46e-4, -7e-5, 120)

    def force(start, speed, t):
        sine = (start + (speed - 0.247) * 0.016 + speed * (t - t * t / (2 * ramp))) / 6e-3
        cosine = jnp.sqrt(1 - sine * sine)
        lift = 6e-3 * (cosine - np.cos(np.radians(22.0)))
        return 15.0 + 8000.0 * lift - speed * (1 - t / ramp) * sine / cosine

    def found(step):
        def largest(start, speed):
            begin = jnp.arange(0, ramp * (1 - 1e-9), step)
            nodes = [force(start, speed, begin + step * k / 4) for k in range(5)]
            return jnp.max(highest(nodes, nodes[-1]))

        return jax.jit(jax.vmap(jax.value_and_grad(largest, 1), (0, None)))(starts, speed)

    rising = jax.vmap(jax.grad(force, 2), (0, None, 0))
    dense = jax.vmap(force, (0, None, None))(starts, speed, jnp.linspace(0, ramp, 2001))
    low, high = (ramp / 2000 * (jnp.argmax(dense, axis=1) + k) for k in (-1, 1))
    for _ in range(40):
        place = 0.5 * (low + high)
        up = rising(starts, speed, place) > 0
        low, high = jnp.where(up, place, low), jnp.where(up, high, place)
    best = jax.vmap(force, (0, None, 0))(starts, speed, place)
    slope = jax.vmap(jax.grad(force, 1), (0, None, 0))(starts, speed, place)
    longest = []

    def caught(system, duration, state, integration, recording, dtype):
        longest.append(float(integration.longest))
        raise StopIteration

    monkeypatch.setattr(batch, "make_case", caught)
    settings, run, zero = (
        batch.Settings.of(blades(), 64),
        batch.Run.of(blades()),
        (jnp.zeros(1),) * 2,
    )
    with pytest.raises(StopIteration):
        batch.outcomes(blade, zero, zero, 1, run, settings, watched=True)
    short = ramp / np.ceil(ramp / longest[0])
    for step, off, wrong in ((ramp, 3e-4, 1.0), (short, 1e-8, 2e-4)):
        value, by_speed = found(step)
        np.testing.assert_allclose(value, best, rtol=0, atol=off)
        np.testing.assert_allclose(speed * by_speed, speed * slope, rtol=0, atol=wrong * size)
