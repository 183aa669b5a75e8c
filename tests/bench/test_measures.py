"""The benchmark measures what it says: its rivals are right, its errors see faults, it restarts."""

import dataclasses
import importlib.util
import json
import math
from functools import partial

import numpy as np
import pytest
import xarray as xr
from reference.blade import REFERENCE, Steady, Trapezoid, simulate

import wiperjax
from wiperjax import Event, TrapezoidBelt, cli
from wiperjax.maps import accuracy
from wiperjax_bench.harness import compare, measure
from wiperjax_bench.harness.alone import Alone
from wiperjax_bench.harness.interface import NotForThisScene
from wiperjax_bench.harness.keep import Parts
from wiperjax_bench.measurements import chart, confirm, errors, maps
from wiperjax_bench.measurements import speed as bench_speed
from wiperjax_bench.reports import chart_plot, chart_text, rule, speed_text
from wiperjax_bench.rivals import compiled, every, scipy_phases
from wiperjax_bench.scenes import exact, families

LOOP = compiled.Compiled("numba scalar loop", 1)
NAMES = {
    "release": Event.RELEASE,
    "capture": Event.CAPTURE,
    "reversal": Event.REVERSAL,
    "lift_off": Event.LIFT_OFF,
    "impact": Event.IMPACT,
    "kink": Event.KINK,
    "collapse": Event.COLLAPSE,
    "touch": Event.TOUCH,
}


def own_reference(scene, cell):
    """(samples, event times, event kinds) of one cell by the tests' own reference."""
    p = {k: float(v[cell]) for k, v in scene.parameters().items()}
    blade = {k: v for k, v in p.items() if k in REFERENCE}
    belt = Steady(p["belt_speed"])
    if isinstance(scene.wiper.belt, TrapezoidBelt):
        belt = Trapezoid(p["belt_speed"], p["belt_frequency"], p["belt_phase"], p["belt_ramp"])
    run = simulate(
        blade, belt, scene.duration, tuple(scene.start[cell]), sample_times=scene.sample_times
    )
    times, kinds = [], []
    for event in run.events:
        if event.kind == "zeno":  # an impact and its completion are one event
            times[-1], kinds[-1] = event.time, int(Event.ZENO)
            continue
        times.append(event.time)
        kind = NAMES.get(event.kind)
        if kind is None:
            v = belt.piece(event.time + 1e-9)[0](event.time)
            kind = Event.BELT_REVERSAL if abs(v) < 1e-9 else Event.BELT_KINK
        kinds.append(int(kind))
    return run.samples, np.array(times), np.array(kinds)


@pytest.mark.long
@pytest.mark.parametrize("name", ["squeal", "chatter", "reversal", "zeno", "grazing", "batch"])
def test_the_scalar_loop_agrees_with_the_tests_reference(name):
    scene = getattr(families, name)(8).head(2)
    answer = LOOP.prepare(scene, 1e-11).answer()
    for cell in range(2):
        samples, times, kinds = own_reference(scene, cell)
        np.testing.assert_array_equal(answer.event_kinds[cell], kinds)
        np.testing.assert_allclose(answer.event_times[cell], times, rtol=0, atol=2e-10)
        n = len(samples["x"])
        size = np.asarray(scene.scales[0]).max()
        np.testing.assert_allclose(answer.position[cell, :n, 0], samples["x"], atol=1e-8 * size)
        np.testing.assert_allclose(answer.position[cell, :n, 1], samples["y"], atol=1e-8 * size)


@pytest.mark.long
def test_the_scalar_loop_converges_to_the_exact_block():
    scene = families.block(6)
    speeds = scene.parameters()["belt_speed"]
    off = []
    for rtol in (1e-5, 1e-7, 1e-9):
        answer = LOOP.prepare(scene, rtol).answer()
        worst = 0.0
        for i, speed in enumerate(speeds):
            x, v, times, kinds = exact.block(families.BLOCK_START, speed, 0.5, scene.sample_times)
            np.testing.assert_array_equal(answer.event_kinds[i], kinds)
            worst = max(worst, np.max(np.abs(answer.position[i, :, 0] - x)))
            np.testing.assert_allclose(answer.event_times[i], times, atol=1e3 * rtol)
        off.append(worst)
    assert off[0] < 1e-3 and off[2] < 1e-7
    assert off[1] < 0.05 * off[0] and off[2] < 0.05 * off[1]


@pytest.mark.long
def test_the_batch_of_one_thread_equals_that_of_all():
    scene = families.batch(200)
    one, all_ = (compiled.prepared(scene, 1e-6, n, mark=0.0)() for n in (1, None))
    # two compilations of one source: equal but for the rounding that fast arithmetic may move, and
    # which, in a cell or two, decides whether a step just passes: those differ by the tolerance
    np.testing.assert_array_equal(one.events, all_.events)
    off = np.max(np.abs(one.final - all_.final), axis=1)
    assert np.mean(off > 1e-9) < 0.02 and np.max(off) < 1e-4
    same = off <= 1e-9
    np.testing.assert_allclose(one.total[same], all_.total[same], rtol=1e-6, atol=1e-9)
    # times in the regimes add up
    np.testing.assert_allclose(one.total[:, :3].sum(axis=1), scene.duration, rtol=1e-9)
    assert np.all(one.result == 0)


@pytest.mark.slow
def test_scipy_finds_the_same_events():
    scene = families.zeno(4).head(1)
    true = LOOP.prepare(scene, 1e-11).answer()
    answer = scipy_phases.Phases("RK45").prepare(scene, 1e-6)()
    np.testing.assert_array_equal(answer.event_kinds[0], true.event_kinds[0])
    assert not answer.stopped.any()
    np.testing.assert_allclose(answer.position, true.position, rtol=0, atol=1e-5 * 6e-3)


@pytest.mark.slow
def test_diffrax_per_phase_finds_the_same_events():
    from wiperjax_bench.rivals.diffrax_phases import PerPhase

    scene = families.batch(64)
    true = LOOP.prepare(scene, 1e-11).answer()
    answer = PerPhase(mapped=True).prepare(scene, 1e-6)()
    same = [np.array_equal(a, b) for a, b in zip(answer.event_kinds, true.event_kinds, strict=True)]
    assert all(same)
    assert not answer.stopped.any()


@pytest.mark.slow
def test_grazing_cells_touch_on_one_side_only():
    scene = families.grazing(16)
    answer = LOOP.prepare(scene, 1e-12).answer()
    touched = [bool({5, 6, 12} & set(kinds.tolist())) for kinds in answer.event_kinds]
    assert touched == [False, True] * 8


@pytest.fixture(scope="module")
def judged():
    scene = families.squeal(8)
    return scene, errors.truth(scene), LOOP.prepare(scene, 1e-8).answer()


@pytest.mark.slow
def test_errors_see_faults(judged):
    scene, true, answer = judged
    good = errors.judge(scene, true, answer)
    assert good.state < 1e-6 and good.wrong == 0 and good.stopped == 0
    assert 0 < good.event_time < 1e-7
    moved = answer._replace(position=answer.position + 1e-3 * 6e-3)
    assert errors.judge(scene, true, moved).state == pytest.approx(1e-3, rel=1e-3)
    late = answer._replace(event_times=[t + 1e-5 for t in answer.event_times])
    assert errors.judge(scene, true, late).event_time == pytest.approx(1e-5, rel=1e-2)
    missed = [np.delete(k, 4) if i < 2 else k for i, k in enumerate(answer.event_kinds)]
    times = [np.delete(t, 4) if i < 2 else t for i, t in enumerate(answer.event_times)]
    lost = errors.judge(scene, true, answer._replace(event_kinds=missed, event_times=times))
    assert lost.wrong == 2 / 8
    gone = answer.position.copy()
    gone[:, -3:] = np.nan
    ended = answer._replace(position=gone, stopped=np.ones(8, bool))
    assert errors.judge(scene, true, ended).state == np.inf
    assert errors.judge(scene, true, ended).stopped == 1
    silent = answer._replace(event_times=None, event_kinds=None)
    assert math.isnan(errors.judge(scene, true, silent).wrong)


def test_cost_at_equal_error_is_exact_on_power_laws():
    error = np.logspace(-2, -8, 7)
    cost = error**-0.2
    assert compare.cost_at(error, cost, 3e-5) == pytest.approx(3e-5**-0.2, rel=1e-12)
    assert math.isnan(compare.cost_at(error, cost, 1e-9))
    assert compare.cost_at(error, cost, 0.5) == cost[0]


CONFIRMED = {"confirmed": 1e-9, "confirmed_time": 1e-12, "confirmed_wrong": 0.0}


def toy(faster: float) -> xr.Dataset:
    """A chart in which another method costs 1/faster of ours at every error."""
    error = np.logspace(-2, -8, 4)
    cost = error**-0.2 * 1e-4
    rows = []
    for name, factor in (("engine Tsit5", 1.0), ("numba scalar loop", 1 / faster)):
        for index in range(4):
            row = dict.fromkeys(("setting", *chart.VALUES), 0.0)
            row |= {"method": name, "index": index, "setting": 10.0 ** (-3 - index)}
            row |= {"wall": cost[index] * factor, "state_error": error[index]}
            row |= {"state_error_p90": 2 * error[index], "wall_low": cost[index] * factor}
            row |= {"event_time_error": 1e-3 * error[index], "steps": 100.0 * (index + 1)}
            rows.append(row | {"wall_high": cost[index] * factor * 1.1})
    tables = [{"scene": "squeal", "about": "-", "horizon": 1.0, "load": 0.0, **CONFIRMED}]
    methods = [r for r in every() if r.name in ("engine Tsit5", "numba scalar loop")]
    dataset = chart.assemble([tables[0] | {"rows": rows}], methods)
    dataset.attrs |= {"machine": "-", "versions": "{}", "created": "-", "repeats": 1}
    dataset.attrs |= {"reference": "-", "second": "-"}
    return dataset


@pytest.mark.slow
def test_what_is_against_us_is_written_under_the_chart(tmp_path):
    against = compare.against_us(toy(4.0))
    assert len(against) == 1 and "numba scalar loop leads 4.0 x" in against[0]
    assert compare.against_us(toy(0.5)) == []
    assert "(at 1e-03 ours takes 141 steps of 2815 ns, it 141 steps of 704 ns)" in against[0]
    assert "leads 4.0 x" in chart_text.chart_text(toy(4.0), "x.png")
    for file in chart_plot.save(toy(4.0), tmp_path / "picture"):
        assert file.stat().st_size > 5000


def test_a_chart_names_what_it_shows_and_nothing_else():
    def entries(figure):
        legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
        drawn = {
            line.get_color() for ax in figure.axes for line in ax.lines if len(line.get_xdata())
        }
        every = [line for legend in legends for line in legend.legend_handles]
        assert all(line.get_color() in drawn for line in every)
        return {text.get_text() for legend in legends for text in legend.get_texts()}

    right, wrong = toy(4.0), toy(4.0)
    wrong.wrong_events.loc[{"solver": "numba scalar loop"}] = 1.0
    for draw in (chart_plot.short, chart_plot.work_precision):
        assert entries(draw(right)) == {"engine Tsit5", "numba scalar loop"}
        assert entries(draw(wrong)) == entries(draw(right)) | {chart_plot.CROSSES}


def test_a_sentence_says_who_leads_at_which_error_and_by_which_factor():
    ahead, behind = compare.statements(toy(0.5)), compare.statements(toy(4.0))
    assert len(ahead) == len(compare.TARGETS)
    assert ahead[1] == "numba scalar loop, at error 1e-03: the engine leads by 2 x on squeal."
    assert behind[3] == "numba scalar loop, at error 1e-07: the engine trails by 4 x on squeal."
    coarse = toy(4.0)
    coarse.state_error.loc[{"solver": "engine Tsit5"}] *= 1e6  # it never gets there
    assert "only the rival reaches it on squeal" in compare.statements(coarse)[3]
    coarse.state_error.loc[{"solver": "numba scalar loop"}] *= 1e6
    assert "does not reach it on any scene" in compare.statements(coarse)[3]


def test_a_library_that_is_missing_has_the_version_none(monkeypatch):
    monkeypatch.setattr(measure, "LIBRARIES", ("wiperjax", "wiperjax-without-this"))
    found = measure.versions()
    assert found["wiperjax"] == wiperjax.__version__ and found["wiperjax-without-this"] == "none"


def test_interleaved_repeats_take_turns():
    order = []
    costs = measure.interleaved([lambda: order.append(0), lambda: order.append(1)], 3)
    assert order == [0, 1] * 3
    assert all(c.repeats == 3 and c.low <= c.wall <= c.high for c in costs)


def test_a_chart_that_was_stopped_goes_on(tmp_path, monkeypatch):
    measured, broken = [], [True]

    def scene(name, chosen, *_):
        if name == "block" and broken:
            broken.clear()
            raise OSError("disk full")
        measured.append(name)
        rows = [{"method": m.name, "note": "-"} for m in chosen]
        return {"scene": name, "about": "", "horizon": 1, "load": 0, "rows": rows, **CONFIRMED}

    monkeypatch.setattr(chart, "measure_scene", scene)
    file = tmp_path / "chart.h5"
    with pytest.raises(OSError):
        chart.run(file, quick=True, say=lambda _: None)
    assert not file.exists()
    chart.run(file, quick=True, say=lambda _: None)
    assert measured == ["squeal", "block"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["chart.h5"]


def test_a_rival_says_what_it_is_not_for():
    scene = families.squeal(2)
    heavy = dataclasses.replace(scene, wiper=dataclasses.replace(scene.wiper, hinge_mass=1e-3))
    with pytest.raises(NotForThisScene, match="hinge_mass"):
        LOOP.prepare(heavy, 1e-6)


class Rough:
    """A method with a fault of its own at its middle setting, and slow at the next."""

    name, setting_name, settings, cells = "rough", "step", (1e-1, 1e-2, 1e-3, 1e-4), 4

    def available(self):
        return None

    def prepare(self, scene, setting):
        if setting == 1e-2:
            raise FloatingPointError("lost")
        if setting == 1e-3:
            return lambda: busy(LOOP.prepare(scene, 1e-6).answer())
        return LOOP.prepare(scene, 1e-6).answer


def busy(answer):
    import time

    started = time.process_time()
    while time.process_time() - started < 0.05:
        pass
    return answer


@pytest.mark.slow
def test_a_rival_that_breaks_or_dawdles_is_a_note_and_not_the_end(judged, monkeypatch):
    scene, true, _ = judged
    monkeypatch.setattr(chart, "PATIENCE", 0.05)
    rows, calls, note = chart.try_method(Rough(), scene, scene.head(2), true, False)
    assert [r["setting"] for r in rows] == [1e-1, 1e-3] and len(calls) == 2
    assert rows[0]["state_error"] < 1e-4 and "finer settings left out" in note


@pytest.mark.slow
def test_the_exact_block_confirms_the_reference():
    scene = families.block(4)
    found = confirm.errors_of_second(scene, errors.truth(scene), quick=False)
    assert found.state_p90 < 1e-9 and found.wrong == 0 and found.event_time < 1e-7


def test_the_map_of_the_bench_is_the_reference_sweep():
    import tomllib
    from pathlib import Path

    file = Path(__file__).parents[2] / "sweeps" / "reference.toml"
    asked = tomllib.loads(file.read_text())
    assert maps.SWEEP["axes"] == asked["axes"]
    assert maps.SWEEP["run"].items() <= asked["run"].items()


def test_parts_are_kept_for_the_same_run_only(tmp_path):
    made = []

    def make():
        made.append(1)
        return {"x": len(made)}

    first = Parts(tmp_path / "a.h5", {"quick": True})
    assert first.once("rows", make) == {"x": 1}
    assert Parts(tmp_path / "a.h5", {"quick": True}).once("rows", make) == {"x": 1}
    assert Parts(tmp_path / "a.h5", {"quick": False}).once("rows", make) == {"x": 2}
    first.clear()
    assert list(tmp_path.iterdir()) == []


def test_the_text_of_the_speeds_says_what_is_met():
    def row(method, cores, rtol, error, wall, **more):
        walls = {"wall": wall, "wall_low": wall, "wall_high": wall, "cpu": wall}
        found = {"state_error": error, "event_time_error": 1e-9, "wrong_events": 0.0}
        sizes = {"cells": 10, "per_second": 1 / wall, "occupancy": np.nan}
        return {"method": method, "cores": cores, "rtol": rtol} | walls | found | sizes | more

    dataset = bench_speed.table(
        [
            row("engine Tsit5", 1, 1e-6, 1e-6, 1e-4, occupancy=0.95),
            row("engine Tsit5, 2 cores", 2, 1e-6, 1e-6, 6e-5, occupancy=0.85),
            *(row("numba scalar loop", 1, e, e, 2e-4 * (e / 1e-6) ** -0.1) for e in (1e-5, 1e-7)),
            row("scipy solve_ivp RK45", 1, 1e-6, 1e-5, 0.5),
        ]
    )
    dataset.attrs |= {"duration": 0.1, "machine": "-", "load": 0.0, "created": "-", "repeats": 3}
    dataset.attrs |= {"compile_cold": 25.0, "compile_cached": 2.0, "duration_sizes": 0.02}
    dataset.attrs |= {"wall_1000": 1e-5, "wall_10000": 1.05e-5}
    text = speed_text.text(dataset)
    assert "| numba scalar loop, engine Tsit5, one core | 2 | 3 (goal 5) | **no** |" in text
    assert "| our one core, on 2, engine Tsit5 | 1.67 | 1.8 (goal 1.95) | **no** |" in text
    scipy = "| scipy solve_ivp RK45, engine Tsit5 | 5e+03 | 1000 | yes | "
    assert scipy + "it reaches an error of 1e-05 only" in text
    assert "10 trajectories | 0.95 | 0.9 (goal 0.97) | yes" in text
    assert "| 5 | 10 | yes | 1000: 10.0 us, 10000: 10.5 us; 0.02 s of motion each" in text
    assert "| cold: a sweep's first block [s] | 25 | 20 | **no** |" in text


# --- the command ----------------------------------------------------------------------------------


@pytest.mark.long
def test_quick_chart(tmp_path, capsys):
    """What CI runs: two scenes, three methods; every curve falls."""
    file = tmp_path / "chart.h5"
    assert cli.main(["bench", "chart", "--quick", "-o", str(file)]) == 0
    with xr.open_dataset(file, engine="h5netcdf") as ds:
        assert list(ds.scene.values) == ["squeal", "block"]
        assert set(ds.solver.values) >= {"engine Tsit5", "numba scalar loop"}
        error = ds.state_error.values
        assert np.all(ds.wrong_events.fillna(0) == 0)
        assert np.nanmax(error) < 1e-2 and np.nanmin(error) < 1e-7
        first, last = error[..., 1], error[..., 5]
        assert np.all((last < 0.1 * first) | np.isnan(first))
        assert "jax" in json.loads(ds.attrs["versions"])
    assert {p.name for p in tmp_path.iterdir()} == {
        *(f"chart.{end}" for end in ("h5", "png", "svg", "md")),
        *("chart_events.png", "chart_short.png", "chart_short.svg"),
    }
    assert "against us" in (tmp_path / "chart.md").read_text()


def test_without_numba_one_line_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert cli.main(["bench", "chart", "-o", str(tmp_path / "x.h5")]) == 1
    assert "pip install numba" in capsys.readouterr().err


def test_the_library_knows_no_bench():
    """No file of the package names it, and an install without it lacks the command, no more."""
    import subprocess
    import sys
    from pathlib import Path

    files = list(Path(wiperjax.__file__).parent.rglob("*.py"))
    assert files and not [f for f in files if "wiperjax_bench" in f.read_text()]
    code = """if True:
        import importlib.metadata, sys
        importlib.metadata.entry_points = lambda **_: ()
        from wiperjax import cli
        assert not [m for m in sys.modules if "bench" in m]
        assert cli.main(["--version"]) == 0
        sys.exit(cli.main(["bench"]))"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2 and "No such command 'bench'" in done.stderr


# --- the rule -------------------------------------------------------------------------------------


def test_the_rule_takes_the_cheapest_that_is_good_enough():
    rows = accuracy.table()
    for target in (1e-2, 1e-4, 1e-6):
        found = accuracy.choose(target)
        assert found.error <= target
        assert all(r.cost >= found.cost for r in rows if r.error <= target)
    with pytest.raises(ValueError, match="target_error must be at least"):
        accuracy.choose(1e-20)
    assert [r["rtol"] for r in rule.rows(toy(4.0))] == [1e-3, 1e-4, 1e-5, 1e-6]


def test_the_rule_leaves_out_what_a_sweep_cannot_ask_for_or_did_not_finish(tmp_path):
    names = {"engine Tsit5": "engine Tsit5, fixed steps", "numba scalar loop": "engine Dopri8"}
    dataset = toy(4.0)
    dataset = dataset.assign_coords(solver=[names[s] for s in dataset.solver.values])
    dataset.state_error_p90.loc[{"solver": "engine Dopri8", "step": 3}] = np.inf
    dataset.wrong_events.loc[{"solver": "engine Dopri8", "step": 0}] = 0.5
    found = rule.rows(dataset)
    assert {(r["solver"], r["precision"]) for r in found} == {("dopri8", "float64")}
    assert [r["rtol"] for r in found] == [1e-4, 1e-5]
    rule.write(dataset, tmp_path / "table.json")
    kept = json.loads((tmp_path / "table.json").read_text())
    assert [accuracy.Choice(**row).rtol for row in kept["rows"]] == [1e-4, 1e-5]
    with pytest.raises(ValueError, match="full chart, but this one lacks chatter"):
        rule.check(dataset)
    with pytest.raises(ValueError, match="not a chart"):
        rule.rows(xr.Dataset())


@pytest.mark.long
@pytest.mark.parametrize("target", [1e-3, 1e-5])
def test_the_error_asked_for_is_met_on_blades_never_seen(target):
    from wiperjax.numerics.runge_kutta import SOLVERS
    from wiperjax_bench.rivals.engine import Engine

    found = accuracy.choose(target)
    scene = families.workload(48, 0.02, seed=7)
    method = Engine(SOLVERS[found.solver], found.precision)
    answer = method.prepare(scene, found.rtol).answer()
    assert errors.judge(scene, errors.truth(scene), answer).state_p90 <= target


def test_a_sweep_with_a_target_error(tmp_path, capsys):
    file = tmp_path / "s.toml"
    file.write_text(
        "[axes]\nattack_angle = {start = 0, stop = 10, num = 2}\n"
        "[run]\ntransient = 1e-3\nwindow = 1e-3\nrtol = 1e-6\n"
    )
    words = ["sweep", str(file), "-o", str(tmp_path / "m.h5"), "--target-error"]
    assert cli.main([*words, "1e-3"]) == 1
    assert "run.rtol must be left out with --target-error" in capsys.readouterr().err
    file.write_text(file.read_text().replace("rtol = 1e-6\n", ""))
    assert cli.main([*words, "2"]) == 1
    assert "target_error must be at least" in capsys.readouterr().err
    spec = wiperjax.load_sweep(file)
    for target, precision in ((1e-4, "float32"), (1e-7, "float64")):
        chosen = cli.compute.at_error(spec, target, file)
        assert chosen.run.rtol == accuracy.choose(target).rtol
        assert chosen.run.precision == precision and chosen.digest() != spec.digest()
        noted = "note: in float32 a few cells have other classes" in capsys.readouterr().err
        assert noted == (precision == "float32")


def test_a_call_in_a_process_of_its_own():
    call = Alone(partial(partial, sum, [1, 2]), float)
    assert call() == 3.0
    assert call.elsewhere >= 0
    broken = Alone(partial(partial, sum, ["a"]), float)
    with pytest.raises(RuntimeError, match="has ended"):
        broken()
