"""Scene files: the wiper, belt and start they state, and the run they make."""

import json
import re
from pathlib import Path

import jax
import numpy as np
import pytest
import xarray as xr

import wiperjax
from wiperjax import plots
from wiperjax.blade import build
from wiperjax.blade.steady_slip import steady_slip
from wiperjax.cli.tables import print_class
from wiperjax.datasets import run_dataset
from wiperjax.noise.run_class import GATHERED, assess, why_no_frequency, words
from wiperjax.plots.style import caption
from wiperjax.runs import scene, simulate
from wiperjax.specs.load import load_scene, parse_scene, parse_sweep
from wiperjax.specs.tables import Start
from wiperjax.store import whole
from wiperjax.vocabulary.codes import RESULTS, Event, Regime
from wiperjax.vocabulary.parameters import PARAMETERS
from wiperjax.vocabulary.thresholds import Thresholds

SCENES = Path(__file__).parents[2] / "sweeps" / "scenes"


# --- from parameters to wiper and start -----------------------------------------------------------


@pytest.mark.parametrize(
    ("belt", "made"),
    [
        ({"kind": "steady", "speed": -0.2}, wiperjax.SteadyBelt(-0.2)),
        (
            {"kind": "wiping", "amplitude": 0.8, "frequency": 0.7, "phase": 90},
            wiperjax.WipingBelt(0.8, 0.7, float(np.radians(90))),
        ),
        (
            {"kind": "trapezoid", "speed": 0.8, "frequency": 0.7, "ramp": 0.05},
            wiperjax.TrapezoidBelt(0.8, 0.7, 0.05, 0.0),
        ),
    ],
)
def test_wiper_of_a_scene(belt, made):
    blade = {"attack_angle": -30, "tip_mass": 3e-3, "hinge_mass": 1e-3}
    spec = parse_scene({"blade": blade, "belt": belt, "run": {"duration": 0.1}})
    wiper = build.build_wiper(spec.parameters(), spec.belt.kind)
    assert wiper.belt == made
    assert wiper == wiperjax.Wiper(
        belt=made, attack_angle=float(np.radians(-30)), tip_mass=3e-3, hinge_mass=1e-3
    )


def test_wipers_of_cells_keep_arrays_and_plain_zeros():
    axes = {"restitution": {"values": [0.0, 0.5]}, "belt_speed": {"values": [0.1, 0.2, 0.3]}}
    spec = parse_sweep({"axes": axes, "run": {"transient": 0.1, "window": 0.1}})
    wiper = build.build_wiper(spec.cells(np.arange(6)), "steady")
    np.testing.assert_array_equal(wiper.restitution, [0, 0, 0, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(wiper.belt.speed, [0.1, 0.2, 0.3] * 2)
    assert not wiper.coupled and wiper.hinge_mass == 0 and isinstance(wiper.hinge_mass, float)
    position, velocity = build.start_state(wiper, Start())
    assert all(part.shape == (6,) for part in (*position, *velocity))


@pytest.mark.parametrize(
    ("parameters", "kind", "text"),
    [
        (
            {"tip_mas": 1.0},
            "steady",
            "and friction 'stribeck', but had 'tip_mas'",
        ),
        (
            {"belt_ramp": 1.0},
            "wiping",
            "belt_kind 'wiping' and friction 'stribeck', but had 'belt_ramp'",
        ),
        ({}, "still", "belt_kind must be one of steady, wiping, trapezoid, but was 'still'"),
        (
            {"tip_mass": np.array([1e-3, -1e-3])},
            "steady",
            "tip_mass must be a finite number > 0 kg/m, but was -0.001",
        ),
        ({"restitution": np.array([0.5, 1.5])}, "steady", "restitution must lie inside [0, 1]"),
    ],
)
def test_impossible_wipers_are_refused(parameters, kind, text):
    with pytest.raises(ValueError) as refused:
        build.build_wiper(parameters, kind)
    assert text in str(refused.value)


BLADE = [entry for entry in PARAMETERS.values() if entry.table == "blade"]


@pytest.mark.parametrize("entry", BLADE, ids=lambda entry: entry.name)
def test_files_allow_what_the_wiper_allows(entry):
    """At both ends of each range: else a file passes its check and fails later, without a name."""
    allowed = entry.range
    assert entry.problem(allowed.low) is None or allowed.low_open or entry.never_small
    for end, refused in ((allowed.low, allowed.low_open), (allowed.high, allowed.high_open)):
        value = {entry.name: float(entry.to_si(end))}
        if refused:
            with pytest.raises(ValueError, match=f"^{entry.name} must"):
                build.build_wiper(value, "steady")
        else:
            build.build_wiper(value, "steady")


@pytest.mark.slow
def test_starts():
    wiper = wiperjax.Wiper(
        attack_angle=np.radians([-30.0, 10.0]), lip_length=np.array([6e-3, 5e-3])
    )
    length, none = wiper.lip_length, np.zeros(2)

    def start(**keys):
        return build.start_state(wiper, Start(**keys))

    at_rest = (none, none)
    slip = steady_slip(wiper).x
    expected = {
        "default": (start(), (length * np.sin(wiper.attack_angle), none), at_rest),
        "angle": (start(angle=20.0), (length * np.sin(np.radians(20)), none), at_rest),
        "equilibrium": (start(equilibrium=1e-3), (slip + 1e-3 * length, none), at_rest),
        "state": (start(position=(1e-3, 2e-4)), ([1e-3] * 2, [2e-4] * 2), at_rest),
        "moving": (
            start(position=(1e-3, 2e-4), velocity=(0.3, -0.1)),
            ([1e-3] * 2, [2e-4] * 2),
            ([0.3] * 2, [-0.1] * 2),
        ),
    }
    for (position, velocity), *expected_parts in expected.values():
        for part, values in zip((position, velocity), expected_parts, strict=True):
            np.testing.assert_allclose(np.stack(part), np.stack(values), rtol=1e-15)


@pytest.mark.slow
def test_no_steady_slip_to_start_from():
    keys = {"run": {"duration": 0.1}, "start": {"equilibrium": 1e-6}}
    spec = parse_scene({"blade": {"attack_angle": 60}} | keys)
    with pytest.raises(ValueError, match="start.equilibrium .* no steady slip exists"):
        scene.run_scene(spec)


# --- runs -----------------------------------------------------------------------------------------


def test_run_carries_the_file(squeal):
    text = (SCENES / "squeal.toml").read_text()
    attrs = squeal.attrs
    assert attrs["title"] == "Squeal at 5 degrees" and attrs["specification_text"] == text
    assert attrs["attack_angle"] == pytest.approx(5.0, rel=1e-15)
    assert attrs["collapse_angle"] == pytest.approx(89.0)
    assert attrs["parameter_units"].count("degrees") == 3 and "rad;" not in attrs["parameter_units"]
    assert (attrs["belt_kind"], attrs["belt_speed"]) == ("steady", 0.3)
    assert attrs["wall_time"] > 0 and "engine_time" not in attrs  # nobody measured it
    assert attrs["start"] == "touching at the attack angle, at rest"
    again = parse_scene(json.loads(attrs["specification"]))
    assert again.parameters() == load_scene(SCENES / "squeal.toml").parameters()
    assert (attrs["rtol"], attrs["sample_interval"], attrs["duration"]) == (1e-8, 2e-5, 0.2)


def test_squeal_file_squeals(squeal):
    kinds, times = squeal.event_kind.values, squeal.event_time.values
    releases = times[(kinds == Event.RELEASE) & (times > 0.1)]
    assert 1 / np.diff(releases).mean() == pytest.approx(780.8, abs=0.1)


def test_class_of_a_run(squeal):
    found = assess(squeal)
    said = {"label": "squeal", "mechanism": "stick_slip", "band": "squeal", "settled": "yes"}
    assert words(found) == said
    assert float(found.dominant_frequency) == pytest.approx(780.8, abs=0.2)
    assert float(found.velocity_rms) == pytest.approx(0.357, abs=0.001)  # SCENES.md 1
    kinds, times = squeal.event_kind.values, squeal.event_time.values
    release = times[(kinds == Event.RELEASE) & (times > 0.1)]
    capture = times[(kinds == Event.CAPTURE) & (times > release[0])]
    slips = capture[:50] - release[:50]  # the events say the same
    assert float(found.stick_fraction) == pytest.approx(1 - slips.mean() * 780.8, abs=5e-3)
    assert float(found.normal_force_mean) == pytest.approx(12.2, abs=0.05)
    assert words(assess(squeal, Thresholds(squeal_band=(800.0, 900.0))))["label"] == "other"


def test_a_run_that_is_carried_sticks_for_all_of_the_time(squeal):
    """However many stays its shoulder cuts it into: their lengths add up to the whole itself."""
    names = ("regime_before", "regime_after")
    run = squeal.assign({name: squeal[name] * 0 + int(Regime.STICK) for name in names})
    for transient in np.linspace(0.01, 0.15, 15):
        found = assess(run, transient=transient)
        assert float(found.stick_fraction) == 1.0
        assert words(found)["mechanism"] == "carried"


def test_a_part_without_events_is_in_the_regime_of_its_samples(squeal):
    """Not in that which the whole run ended in."""
    part = squeal.isel(event=[]).assign(
        regime=squeal.regime * 0 + int(Regime.STICK),
        final_regime=squeal.final_regime * 0 + int(Regime.SLIP_NEG),
    )
    found = assess(part)
    assert float(found.stick_fraction) == 1.0 and words(found)["mechanism"] == "carried"


@pytest.mark.slow
def test_a_run_with_impacts_has_the_numbers_of_its_map():
    """The velocity's jump at an impact is no acceleration, and its peaks are no part of its mean
    that samples may miss."""
    blade = {"attack_angle": -35, "support_stiffness": 8000, "restitution": 0.6}
    run = {"transient": 0.15, "window": 0.05}
    told = wiperjax.sweep({"axes": {"belt_speed": {"values": [0.3]}}, "blade": blade, "run": run})
    scene_of_it = {"blade": blade, "belt": {"speed": 0.3}}
    data = {**scene_of_it, "run": {"duration": 0.2, "transient": 0.15, "sample_interval": 2e-5}}
    found = assess(scene.run_scene(parse_scene(data)))
    assert int(told.impact_count[0]) > 20
    for name in ("impact_count", "stick_count", "slip_rate"):
        assert float(found[name]) == pytest.approx(float(told[name][0]), rel=1e-12), name
    for name in GATHERED[:7]:
        assert float(found[name]) == pytest.approx(float(told[name][0]), rel=1e-3), name


@pytest.mark.slow
def test_a_run_is_judged_and_drawn_from_its_transient_on(tmp_path):
    """This blade squeals for a tenth of a second and then dies out: what it is called hangs on the
    window, and everything that is told of a run has the same one."""
    blade = {
        "blade": {"attack_angle": 0.0},
        "belt": {"speed": 0.46},
        "start": {"equilibrium": 1e-3},
    }
    named = {}
    for transient in (0.01, None):
        run = {"duration": 0.21, "sample_interval": 2e-5}
        run |= {} if transient is None else {"transient": transient}
        whole.write_dataset(scene.run_scene(blade | {"run": run}), tmp_path / "run.h5", force=True)
        with whole.open_map(tmp_path / "run.h5") as stored:
            begin = float(run_dataset.settled(stored).time[0])
            assert begin == pytest.approx(0.105 if transient is None else transient, abs=2e-5)
            found = assess(stored)
            assert float(found["velocity_rms"]) == float(stored["velocity_rms"])  # the engine's
            assert np.isfinite(run_dataset.pitch(stored)) == (words(found)["label"] != "quiet")
            named[transient] = words(found)["label"]
    assert named == {0.01: "squeal", None: "quiet"}
    with pytest.raises(ValueError, match="run.transient: must be below run.duration, 0.2 s"):
        parse_scene({"run": {"duration": 0.2, "transient": 1.0}})


def test_class_of_a_run_that_cannot_be_told(squeal):
    cut = squeal.assign(result=squeal.result * 0 + RESULTS["non_finite"])
    assert words(assess(cut))["label"] == "failed"
    with pytest.raises(ValueError, match="64 samples after the transient, but had 51"):
        assess(squeal, transient=0.199)
    with pytest.raises(ValueError, match="run of a scene file"):
        assess(squeal.drop_attrs())


def test_a_thinned_run_has_the_frequency_of_the_whole(squeal):
    """Its attributes still hold the step that it was simulated with."""
    thin = squeal.isel(time=slice(None, None, 4))
    found = assess(thin)
    assert float(found.dominant_frequency) == pytest.approx(780.8, abs=0.2)
    assert words(found) == words(assess(squeal))
    assert caption.noise_text(thin) == caption.noise_text(squeal) == "squeal (stick-slip), 780.8 Hz"
    for name in (*GATHERED[:7], "stick_fraction", "slip_rate"):  # these are still exact
        assert float(found[name]) == float(assess(squeal)[name]), name


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (lambda run: run.sortby("time", ascending=False), "must rise, but falls"),
        (lambda run: run.assign_coords(time=run.time * 1e3), "in s and end at .* 0.2 s, but ends"),
        (
            lambda run: run.assign_coords(time=(1e3 * run.time).assign_attrs(units="ms")),
            "must be in s, but is in ms",
        ),
        (lambda run: run.isel(time=np.r_[:8000, 8001:10001]), "evenly spaced"),
        (lambda run: run.sel(axis="y"), "along the glass, axis x, but holds y"),
    ],
)
def test_samples_that_cannot_tell_a_class_are_refused_and_a_heading_has_none(
    squeal, made, line, capsys
):
    with pytest.raises(ValueError, match=line):
        assess(made(squeal))
    assert caption.noise_text(made(squeal)) == ""
    assert run_dataset.last_periods(made(squeal)).sizes == made(squeal).sizes  # drawn it can be
    print_class(made(squeal))
    assert re.match(f"label       not known: .*{line}", capsys.readouterr().out)


def test_a_run_that_was_interpolated_tells_no_class(squeal):
    """KeyError: 0.567, of a regime between two."""
    with pytest.raises(ValueError, match="^regime must be whole codes, but had 0.5"):
        assess(squeal.assign(regime=0 * squeal.regime + 0.5))


@pytest.mark.parametrize("part", [slice(None, 0.15), slice(0.15, None), slice(0.12, 0.17)])
def test_a_cut_run_is_counted_in_the_time_that_its_samples_are_of(squeal, part):
    """Whose motion repeats costs the same a slip in every part of it."""
    cut = squeal.sel(time=part)
    whole, found = assess(squeal), assess(cut)
    length = np.ptp(cut.sel(time=slice(0.1, None)).time.values)
    assert float(found.stick_count) == pytest.approx(780.8 * length, abs=1.01)
    assert float(found.slip_rate) == pytest.approx(780.8, abs=1.01 / length)
    for name in ("energy_per_slip", "stick_fraction"):
        assert float(found[name]) == pytest.approx(float(whole[name]), rel=0.03), name


@pytest.mark.parametrize("axes", [["y", "x"], "x"])
def test_a_blade_is_judged_by_its_motion_along_the_glass(squeal, axes):
    turned = squeal.sel(axis=axes)
    assert assess(turned).identical(assess(squeal))
    assert run_dataset.pitch(turned) == run_dataset.pitch(squeal)
    assert plots.phase_portrait(turned).get_xlabel() == "position along the glass (mm)"
    with pytest.raises(ValueError, match="axis x, but holds y"):
        run_dataset.pitch(squeal.sel(axis="y"))


@pytest.mark.slow
def test_run_is_stored_and_drawn(squeal, tmp_path):
    whole.write_dataset(squeal, tmp_path / "run.h5")
    plots.plot_file(tmp_path / "run.h5", tmp_path / "run.png", dpi=40)
    assert (tmp_path / "run.png").stat().st_size > 1000


@pytest.mark.slow
def test_start_from_steady_slip_stays_there():
    keys = {"run": {"duration": 0.02}, "start": {"equilibrium": 1e-6}}
    run = scene.run_scene(parse_scene({"blade": {"attack_angle": 40}} | keys))
    slip = jax.tree.map(float, steady_slip(wiperjax.Wiper(attack_angle=np.radians(40.0))))
    assert run.sizes["event"] == 0 and np.all(run.regime == Regime.SLIP_NEG)
    assert float(abs(run.position.sel(axis="x") - slip.x).max()) < 1.01e-6 * 6e-3
    assert float(run.normal_force[-1]) == pytest.approx(slip.normal_force, rel=1e-6)
    assert json.loads(run.attrs["start"]) == {"equilibrium": 1e-6}


@pytest.mark.long
def test_a_varied_parameter_is_computed_with_where_it_is_zero(squeal, monkeypatch):
    """Scenes that differ in it have one program (else a Python 0 is left out: another one)."""
    traces = []
    step = simulate.advance
    monkeypatch.setattr(simulate, "advance", lambda *given: traces.append(1) or step(*given))
    told = json.loads(squeal.attrs["specification"])
    told["run"]["duration"] = 0.01
    for angle in (5.0, 0.0):
        traces.clear()
        told["blade"]["attack_angle"] = angle
        run = scene.run_scene(parse_scene(told), varied=["attack_angle"])
    assert traces == []
    assert run.attrs["attack_angle"] == 0 and run.attrs["steps"] > 0
    plain = scene.run_scene(parse_scene(told))
    np.testing.assert_allclose(run["position"], plain["position"], atol=1e-9)
    with pytest.raises(ValueError, match="did you mean attack_angle"):
        scene.run_scene(parse_scene(told), varied=["atack_angle"])


@pytest.mark.long
def test_reversal_file_has_its_pulse():
    """SCENES.md 4: 15.0 N/m 13.0 ms after V = 0, ratio 4.08, no flight, no squeal between."""
    spec = load_scene(SCENES / "reversal.toml")
    run = scene.run_scene(spec)
    turns = run.event_time[run.event_kind == Event.BELT_REVERSAL].values
    np.testing.assert_allclose(turns, [0.25 / 0.7, 0.75 / 0.7], rtol=1e-12)
    assert not np.any(run.regime == Regime.FLIGHT)
    late = run.sel(time=slice(0.2, None))
    force, since = late.normal_force, late.time.values[:, None] - turns
    near = np.any(np.abs(since) <= 0.025, axis=1)
    assert float(force.max()) == pytest.approx(15.0, abs=0.05)
    peak = float(force.time[int(force.argmax("time"))])
    assert np.min(np.abs(peak - turns - 13.0e-3)) < 0.2e-3
    assert float(force.max() / force[~near].mean()) == pytest.approx(4.08, abs=0.03)
    assert float(late.velocity.sel(axis="x", time=slice(0.25, 0.33)).std()) < 1e-5
    found = assess(run)
    assert words(found)["label"] == "reversal"
    assert words(found)["mechanism"] == "reversal_pulse" and found.stick_fraction_stroke == 0
    assert float(found.normal_force_max_reversal) == pytest.approx(15.0, abs=0.05)


FLIPS = {
    "blade": {"attack_angle": 0, "mu_static": 0.6, "mu_minimum": 0.5, "support_damping": 40},
    "belt": {"kind": "wiping", "amplitude": 0.8, "frequency": 5},
    "run": {"duration": 0.825, "sample_interval": 2e-4},
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("phase", "duration", "transient", "lacking"),
    [(90, 0.1, 0.05, "turn"), (0, 0.04, 0.005, "stroke")],
)
def test_a_loud_run_that_shows_no_turn_or_no_stroke_says_so(
    phase, duration, transient, lacking, caplog
):
    """It was "failed" without a reason, "no tone"; and the mean force of no stroke infinite."""
    belt = {"kind": "trapezoid", "speed": 0.8, "frequency": 1.0, "ramp": 0.05, "phase": phase}
    run = {"duration": duration, "transient": transient, "sample_interval": 2e-5}
    found = assess(made := scene.run_scene({"belt": belt, "run": run}))
    assert "the longest stroke 0.5 s: what shows none" in caplog.text
    assert words(found)["label"] == "failed" and found.velocity_rms > 0.1
    assert why_no_frequency(found).startswith(f"no {lacking} in the settled part")
    force = "normal_force_max_reversal" if lacking == "turn" else "normal_force_mean_stroke"
    assert np.isnan(made[force]) and np.isnan(found[force])
    assert f"failed: no {lacking}" in plots.run_overview(made)._suptitle.get_text()


@pytest.mark.slow
def test_a_silent_blade_that_flips_over_is_quiet(caplog):
    """On a quick belt the window around V = 0 was cut to 20 ms, and the flip, 28 ms, was called
    chattering at the 13th multiple of the wiping frequency. A window that is too short is noted."""
    assert words(assess(scene.run_scene(FLIPS)))["label"] == "quiet" and not caplog.messages
    short = FLIPS | {"classes": {"reversal_window": 0.02}}
    assert words(assess(scene.run_scene(short)))["label"] == "chattering"
    (note,) = caplog.messages
    assert note.startswith("note: classes.reversal_window is 0.02 s, but the glass needs up to")


@pytest.mark.slow
@pytest.mark.parametrize(("interval", "frequency"), [(2e-4, None), (5e-5, 3200.7)])
def test_a_run_sampled_too_coarsely_does_not_say_what_it_seems(interval, frequency):
    """At 5 kHz the samples look like 1800 Hz."""
    data = {
        "blade": {"attack_angle": 40, "normal_load": 20},
        "belt": {"speed": 0.2091},
        "run": {"duration": 0.1, "sample_interval": interval, "rtol": 1e-6},
    }
    run = scene.run_scene(parse_scene(data))
    found = assess(run)
    said = words(found)
    if frequency is None:
        assert np.isnan(found["dominant_frequency"]) and np.isnan(run_dataset.pitch(run))
        assert (said["label"], said["band"], said["settled"]) == ("other", "none", "unknown")
    else:
        assert float(found["dominant_frequency"]) == pytest.approx(frequency, rel=2e-3)
        assert run_dataset.pitch(run) == pytest.approx(frequency, rel=2e-3)
        assert (said["label"], said["band"], said["settled"]) == ("other", "high", "yes")


def test_a_transient_leaves_what_a_run_is_judged_by():
    scene = {"run": {"duration": 0.2, "transient": 0.19, "sample_interval": 2e-4}}
    must = r"run.transient: must leave 64 samples, 0.0128 s, of run.duration, was 0.19"
    with pytest.raises(ValueError, match=must):
        wiperjax.run_scene(scene)
    last = parse_scene({"run": {"duration": 0.3, "transient": 0.2904}})  # 64, but for rounding
    assert last.transient == 0.2904


def test_what_is_cut_short_is_not_judged_by_its_last_moment():
    time = np.arange(1000) * 1e-3
    speed = ("time", np.sin(2 * np.pi * 20 * time))
    run = xr.Dataset({"velocity": speed}, coords={"time": time})
    run = run.assign_attrs(statistics_start=0.5, duration=0.999)
    assert float(run_dataset.settled(run).time[0]) == 0.5
    cut = run_dataset.between(run, 0.0, 0.51)
    assert float(run_dataset.settled(cut).time[0]) == pytest.approx(0.255, abs=2e-3)
