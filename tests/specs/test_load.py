"""Sweep and scene files: what they mean, and the one line that is said when they are wrong."""

import json
import math
import pickle
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError, model_validator

from wiperjax.specs.errors import sentence
from wiperjax.specs.load import SpecError, load_scene, load_sweep, parse_scene, parse_sweep
from wiperjax.specs.windows import flip_time
from wiperjax.vocabulary.parameters import PARAMETERS

SWEEPS = Path(__file__).parents[2] / "sweeps"

GOOD = """
title = "small"
[axes]
attack_angle = { start = -40, stop = 40, num = 5 }
normal_load = { values = [5, 15] }
belt_speed = { start = 0.02, stop = 1.0, num = 3, spacing = "geometric" }
[blade]
restitution = 0.5
shoulder_angle = 30
[belt]
kind = "steady"
[run]
transient = 0.2
window = 0.1
"""
RUN = "[run]\ntransient = 0\nwindow = 1\n"
ONE_AXIS = "[axes]\nmu_static = { values = [0.5, 1] }\n" + RUN


def sweep(text):
    return parse_sweep(tomllib.loads(text), "x.toml")


# --- meaning --------------------------------------------------------------------------------------


def test_axes_keep_the_order_of_the_file_and_are_in_edge_units():
    spec = sweep(GOOD)
    values = spec.axes_values()
    assert list(values) == ["attack_angle", "normal_load", "belt_speed"]
    assert spec.shape == (5, 2, 3) and spec.size == 30
    np.testing.assert_array_equal(values["attack_angle"], [-40, -20, 0, 20, 40])
    np.testing.assert_array_equal(values["normal_load"], [5, 15])
    assert values["belt_speed"][0] == 0.02 and values["belt_speed"][-1] == 1.0
    ratios = values["belt_speed"][1:] / values["belt_speed"][:-1]
    np.testing.assert_allclose(ratios, math.sqrt(50), rtol=1e-14)
    assert all(array.dtype == np.float64 for array in values.values())


def test_cells_hold_every_parameter_in_si_units_in_c_order():
    spec = sweep(GOOD)
    cells = spec.cells(np.arange(spec.size))
    assert set(cells) == {name for name, entry in PARAMETERS.items() if entry.table == "blade"} | {
        "belt_speed"
    }
    grid = np.meshgrid(*spec.axes_values().values(), indexing="ij")
    np.testing.assert_array_equal(cells["attack_angle"], np.radians(grid[0].ravel()))
    np.testing.assert_array_equal(cells["normal_load"], grid[1].ravel())
    np.testing.assert_array_equal(cells["belt_speed"], grid[2].ravel())
    assert cells["restitution"] == 0.5 and isinstance(cells["restitution"], float)
    assert cells["shoulder_angle"] == pytest.approx(math.pi / 6, rel=1e-15)
    assert cells["tip_mass"] == 2.4e-3
    assert cells["collapse_angle"] == math.radians(89)


def test_cells_in_any_order_and_shape():
    spec = sweep(GOOD)
    everything = spec.cells(np.arange(spec.size))["attack_angle"]
    some = np.array([[29, 0], [7, 7]])
    np.testing.assert_array_equal(spec.cells(some)["attack_angle"], everything[some])
    assert spec.cells(np.array([], dtype=int))["attack_angle"].shape == (0,)
    for wrong in ([-1], [30]):
        with pytest.raises(IndexError, match=r"\[0, 30\)"):
            spec.cells(np.array(wrong))


def test_reference_values_are_those_of_the_model_to_the_last_bit():
    fixed = sweep(ONE_AXIS).fixed()
    expected = {
        "tip_mass": 2.4e-3,
        "lip_length": 6e-3,
        "support_stiffness": 2000.0,
        "support_damping": 1.0,
        "neck_stiffness": 0.05,
        "shoulder_stiffness": 2.0,
        "shoulder_angle": 0.6,
        "attack_angle": 0.0,
        "normal_load": 15.0,
        "restitution": 0.3,
        "mu_minimum": 0.3,
        "stribeck_speed": 0.1,
        "stribeck_shape": 1.0,
        "viscous_slope": 0.02,
        "hinge_mass": 0.0,
        "hinge_damping": 0.0,
        "gravity": 0.0,
        "collapse_angle": math.radians(89),
        "belt_speed": 0.3,
    }
    assert fixed == expected
    assert all(type(value) is float for value in fixed.values())


def test_every_reference_value_lies_in_its_own_range():
    for entry in PARAMETERS.values():
        if entry.reference is not None:
            assert entry.problem(entry.to_edge(entry.reference)) is None, entry.name


def test_solver_that_is_left_out_goes_by_the_precision_and_is_part_of_the_digest():
    run = ONE_AXIS.splitlines().index("[run]")

    def with_(*lines):
        text = ONE_AXIS.splitlines()
        return sweep("\n".join([*text[: run + 1], *lines, *text[run + 1 :]]))

    single = 'precision = "float32"'
    assert with_(single).settings.solver == "tsit5"
    assert with_(single).digest() == with_(single, 'solver = "tsit5"').digest()
    assert with_().digest() == with_('solver = "dopri8"').digest()
    assert with_().digest() != with_('solver = "tsit5"').digest()


def test_defaults_of_run_start_and_classes():
    spec = sweep(ONE_AXIS)
    assert (spec.rtol, spec.run.precision, spec.settings.solver) == (1e-6, "float64", "dopri8")
    assert (spec.run.max_steps, spec.run.zeno_time, spec.run.samples) == (200_000, 1e-8, None)
    assert spec.run.atol is None and spec.run.event_log is None
    assert spec.start.kind == "default"
    assert spec.classes.squeal_band == (500.0, 1000.0)
    assert spec.classes.chatter_band == (0.0, 100.0)
    assert spec.classes.quiet_velocity_ratio == 0.01
    assert (spec.classes.reversal_window, spec.classes.reversal_ratio) == (0.025, 2.0)


@pytest.mark.parametrize(
    "belt, expected",
    [
        ('kind = "steady"\nspeed = -0.5', {"belt_speed": -0.5}),
        (
            'kind = "wiping"\namplitude = 0.8\nfrequency = 0.7',
            {"belt_speed": 0.8, "belt_frequency": 0.7, "belt_phase": 0.0},
        ),
        (
            'kind = "trapezoid"\nspeed = 0.8\nfrequency = 0.7\nramp = 0.05\nphase = 90',
            {
                "belt_speed": 0.8,
                "belt_frequency": 0.7,
                "belt_ramp": 0.05,
                "belt_phase": math.pi / 2,
            },
        ),
    ],
)
def test_belts(belt, expected):
    fixed = sweep(f"[belt]\n{belt}\n{ONE_AXIS}").fixed()
    assert {name: value for name, value in fixed.items() if name.startswith("belt_")} == expected


def test_belt_parameters_can_be_axes():
    text = """
    belt = { kind = "trapezoid", frequency = 0.7 }
    [axes]
    belt_ramp = { values = [0.1, 0.2] }
    belt_speed = { values = [0.4, 0.8] }
    """
    cells = sweep(text + RUN).cells(np.arange(4))
    np.testing.assert_array_equal(cells["belt_ramp"], [0.1, 0.1, 0.2, 0.2])
    np.testing.assert_array_equal(cells["belt_speed"], [0.4, 0.8, 0.4, 0.8])
    assert cells["belt_frequency"] == 0.7


ALLOWED_ON_AN_AXIS = {
    "lip_length": [0.01, 0.02],
    "shoulder_angle": [20, 30],
    "stribeck_shape": [1, 2],
    "collapse_angle": [60, 80],
}


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_can_be_an_axis(name):
    belt = {"kind": "trapezoid", "frequency": 0.5, "ramp": 0.1}
    if PARAMETERS[name].table == "belt":
        belt.pop(name.removeprefix("belt_"), None)
    values = ALLOWED_ON_AN_AXIS.get(name, [0.4, 0.5])
    spec = parse_sweep(
        {"axes": {name: {"values": values}}, "belt": belt, "run": {"transient": 0, "window": 1}}
    )
    np.testing.assert_array_equal(spec.cells(np.arange(2))[name], PARAMETERS[name].to_si(values))


@pytest.mark.parametrize(
    "start, kind",
    [
        ("angle = 20", "angle"),
        ("equilibrium = 1e-3", "equilibrium"),
        ("position = [1e-3, 0]", "state"),
        ("position = [1e-3, 1e-4]\nvelocity = [0, -0.1]", "state"),
    ],
)
def test_starts(start, kind):
    spec = sweep(f"[start]\n{start}\n{ONE_AXIS}")
    assert spec.start.kind == kind
    if kind == "state":
        assert spec.start.position in [(1e-3, 0), (1e-3, 1e-4)]


def test_digest_is_of_the_meaning_not_of_the_spelling():
    spec = sweep(GOOD)
    same = GOOD.replace('title = "small"', "# a comment").replace("transient = 0.2\n", "")
    same = same.replace("window = 0.1", "window = 0.1\nrtol = 1e-6\ntransient = 2e-1")
    assert sweep(same).digest() == spec.digest()
    assert len(spec.digest()) == 64
    json.loads(spec.canonical())
    for old, new in [
        ("num = 5", "num = 6"),
        ("restitution = 0.5", "restitution = 0.51"),
        ("window = 0.1", "window = 0.1\nrtol = 1e-7"),
        ("window = 0.1", "window = 0.1\n[classes]\nreversal_ratio = 3"),
        ("window = 0.1", "window = 0.1\n[start]\nangle = 1"),
    ]:
        assert sweep(GOOD.replace(old, new)).digest() != spec.digest(), new


def test_order_of_axes_is_part_of_the_meaning():
    data = tomllib.loads(GOOD)
    turned = data | {"axes": dict(reversed(data["axes"].items()))}
    assert parse_sweep(turned).digest() != parse_sweep(data).digest()


def test_document_and_pickle_give_the_same_sweep():
    spec = sweep(GOOD)
    assert parse_sweep(json.loads(json.dumps(spec.document()))).canonical() == spec.canonical()
    assert pickle.loads(pickle.dumps(spec)) == spec


def test_small_angles_on_an_axis_are_noted():
    text = "[axes]\nattack_angle = { start = -0.7, stop = 0.7, num = 3 }\n" + RUN
    assert sweep(text).notes() == [
        "axes.attack_angle reaches 0.7 degrees only; it is not in radians"
    ]
    assert sweep(GOOD).notes() == []


@pytest.mark.parametrize(
    "path",
    [*sorted(SWEEPS.glob("*.toml")), *sorted(SWEEPS.glob("systems/*.toml"))],
    ids=lambda path: path.name,
)
def test_shipped_sweeps_load_and_say_what_they_show(path):
    assert load_sweep(path).size > 1
    assert path.read_text().startswith("# ")


@pytest.mark.parametrize("path", sorted(SWEEPS.glob("scenes/*.toml")), ids=lambda path: path.name)
def test_shipped_scenes_load_and_say_what_they_show(path):
    spec = load_scene(path)
    assert spec.text.startswith("# ") and spec.run.duration > 0
    assert spec.parameters()["tip_mass"] == 2.4e-3


def test_reference_sweep_is_the_one_asked_for():
    spec = load_sweep(SWEEPS / "reference.toml")
    assert spec.shape == (41, 11, 21)
    assert spec.run.transient >= 0.2 and spec.rtol == 1e-6
    assert spec.text == (SWEEPS / "reference.toml").read_text()


def test_reading_files_needs_no_jax():
    code = """if True:
        import sys, types
        package = types.ModuleType("wiperjax")  # in place of __init__, which may import anything
        package.__path__ = [sys.argv[1]]
        sys.modules["wiperjax"] = package
        import wiperjax.specs.load
        sys.exit("jax" in sys.modules)
    """
    subprocess.run([sys.executable, "-c", code, str(SWEEPS.parent / "wiperjax")], check=True)


# --- faults ---------------------------------------------------------------------------------------


FAULTS = {
    # unknown keys
    "[blade]\nmu_statik = 1\n"
    + ONE_AXIS: "blade.mu_statik: unknown key; did you mean 'mu_static'?",
    "[blade]\nwindow = 1\n" + ONE_AXIS: "blade.window: unknown key here; it belongs in [run]",
    "gravity = 1\n" + ONE_AXIS: "gravity: unknown key here; it belongs in [blade] or [axes]",
    "[blade]\nbelt_speed = 1\n"
    + ONE_AXIS: "blade.belt_speed: unknown key here; it belongs in [belt] as 'speed' or [axes]",
    "blad = 1\n" + ONE_AXIS: "blad: unknown key; did you mean 'blade'?",
    "[belt]\nbelt_speed = 1\n" + ONE_AXIS: "belt.belt_speed: unknown key; did you mean 'speed'?",
    ONE_AXIS + "windw = 1": "run.windw: unknown key; did you mean 'window'?",
    "[run]\ntransient = 0\nwindw = 1\n[axes]\nmu_static = { values = [1] }": (
        "run.windw: unknown key; did you mean 'window'?"
    ),
    "[axes]\nattack = { values = [1] }\n" + RUN: (
        "axes.attack: unknown key; did you mean 'attack_angle'?"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, nun = 3 }\n" + RUN: (
        "axes.mu_static.nun: unknown key; did you mean 'num'?"
    ),
    "[axes]\nmu_static = { start = 1, stop = 2, step = 0.1 }\n" + RUN: (
        "axes.mu_static.step: unknown key; an axis says how many values it has: "
        "{ start = ..., stop = ..., num = ... } or { values = [...] }"
    ),
    "[starts]\nnames = []\n" + ONE_AXIS: "starts.names: must be a list that is not empty, was []",
    "[classes]\nzzz = 1\n" + ONE_AXIS: (
        "classes.zzz: unknown key; must be one of quiet_velocity_ratio, quiet_velocity, "
        "squeal_band, chatter_band, reversal_window, reversal_ratio, "
        "vibration_ratio, tone_time, stick_share, settled_change"
    ),
    # values as they stand in a file
    "[blade]\nnormal_load = 2020-01-01\n"
    + ONE_AXIS: "blade.normal_load: must be a number, was 2020-01-01",
    # ranges
    "[axes]\nattack_angle = { start = -95, stop = 95, num = 3 }\n" + RUN: (
        "axes.attack_angle: must lie inside (-90, 90) degrees, was -95"
    ),
    "[blade]\nattack_angle = 90\n" + ONE_AXIS: (
        "blade.attack_angle: must lie inside (-90, 90) degrees, was 90"
    ),
    "[blade]\ntip_mass = -1e-3\n" + ONE_AXIS: (
        "blade.tip_mass: must lie inside [1e-06, 1] kg/m, was -0.001"
    ),
    "[blade]\ntip_mass = 2.4\n"
    + ONE_AXIS: "blade.tip_mass: must lie inside [1e-06, 1] kg/m, was 2.4",
    "[blade]\nlip_length = 6\n"
    + ONE_AXIS: "blade.lip_length: must lie inside [1e-05, 0.1] m, was 6",
    "[axes]\nmu_static = { values = [-0.1, 1] }\n" + RUN: (
        "axes.mu_static: must lie inside [0, 10], was -0.1"
    ),
    "[blade]\nrestitution = 1.3\n" + ONE_AXIS: "blade.restitution: must lie inside [0, 1], was 1.3",
    "[belt]\nspeed = 0\n" + ONE_AXIS: (
        "belt.speed: must lie inside [-20, 20] m/s and be 1e-06 or more in size, was 0"
    ),
    "[belt]\nspeed = 300\n" + ONE_AXIS: "belt.speed: must lie inside [-20, 20] m/s, was 300",
    "[axes]\nbelt_speed = { start = -1, stop = 1, num = 3 }\n" + RUN: (
        "axes.belt_speed: must lie inside [-20, 20] m/s and be 1e-06 or more in size, was 0"
    ),
    # units
    "[blade]\nshoulder_angle = 0.6\n" + ONE_AXIS: (
        "blade.shoulder_angle: must be in degrees, was 0.6 (0.6 radians would be 34.38 degrees)"
    ),
    "[blade]\ncollapse_angle = 1.5533\n" + ONE_AXIS: (
        "blade.collapse_angle: must be in degrees, was 1.5533 (1.5533 radians would be 89 degrees)"
    ),
    # types and shapes
    '[blade]\ntip_mass = "2.4e-3"\n' + ONE_AXIS: "blade.tip_mass: must be a number, was '2.4e-3'",
    "[blade]\ntip_mass = true\n" + ONE_AXIS: "blade.tip_mass: must be a number, was true",
    "[blade]\ntip_mass = [1, 2]\n" + ONE_AXIS: "blade.tip_mass: must be a number, was [1, 2]",
    "[blade]\ntip_mass = nan\n" + ONE_AXIS: "blade.tip_mass: must be a finite number, was nan",
    "[blade]\ntip_mass = inf\n" + ONE_AXIS: "blade.tip_mass: must be a finite number, was inf",
    "blade = 3\n" + ONE_AXIS: "blade: must be a table, was 3",
    "axes = 3\n" + RUN: "axes: must be a table, was 3",
    "title = 3\n" + ONE_AXIS: "title: must be a text in quotes, was 3",
    "[axes]\nmu_static = 3\n" + RUN: (
        "axes.mu_static: must be { start = ..., stop = ..., num = ... } or { values = [...] }, "
        "was 3"
    ),
    "[axes]\nmu_static = [1, 2]\n" + RUN: (
        "axes.mu_static: must be { start = ..., stop = ..., num = ... } or { values = [...] }, "
        "was [1, 2]"
    ),
    "[axes]\nmu_static = { values = [1, 'a'] }\n" + RUN: (
        "axes.mu_static.values.1: must be a number, was 'a'"
    ),
    "[axes]\nmu_static = { values = [[1, 2]] }\n" + RUN: (
        "axes.mu_static.values.0: must be a number, was [1, 2]"
    ),
    "[axes]\nmu_static = { values = [nan] }\n" + RUN: (
        "axes.mu_static.values.0: must be a finite number, was nan"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, num = 2.5 }\n" + RUN: (
        "axes.mu_static.num: must be a whole number, was 2.5"
    ),
    '[axes]\nmu_static = { start = 0, stop = 1, num = 2, spacing = "log" }\n' + RUN: (
        "axes.mu_static.spacing: must be 'linear' or 'geometric', was 'log'"
    ),
    '[belt]\nkind = "stedy"\n' + ONE_AXIS: (
        "belt.kind: must be 'steady', 'wiping' or 'trapezoid', was 'stedy'"
    ),
    "[start]\nposition = [1]\n" + ONE_AXIS: (
        "start.position: must be a list of two numbers, was [1]"
    ),
    "[classes]\nsqueal_band = [1000, 500]\n" + ONE_AXIS: (
        "classes.squeal_band: must be [low, high] in Hz with 0 <= low < high, was [1000, 500]"
    ),
    # axes
    "[axes]\n" + RUN: "axes: must name at least one blade or belt parameter, was empty",
    RUN: "axes: is missing; the table must be there",
    "[axes]\nmu_static = { values = [1] }": "run: is missing; the table must be there",
    "[run]\ntransient = 0\n[axes]\nmu_static = { values = [1] }": "run.window: is missing",
    "[axes]\nmu_static = { values = [] }\n" + RUN: (
        "axes.mu_static: must have at least one value and at most 1000000, had none"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, num = 0 }\n" + RUN: (
        "axes.mu_static.num: must be a whole number in [1, 1000000], was 0"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, num = 1 }\n" + RUN: (
        "axes.mu_static: start and stop must be equal if num = 1 and differ otherwise, "
        "were start = 0, stop = 1, num = 1"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1 }\n" + RUN: (
        "axes.mu_static: must be { start = ..., stop = ..., num = ... } or { values = [...] }, "
        "but num is missing"
    ),
    "[axes]\nmu_static = { start = 0, values = [1] }\n" + RUN: (
        "axes.mu_static: must be { start = ..., stop = ..., num = ... } or { values = [...] }, "
        "not a mixture of both"
    ),
    "[axes]\nmu_static = { values = [1, 1] }\n" + RUN: (
        "axes.mu_static: values must increase or decrease, were [1.0, 1.0]"
    ),
    '[axes]\nmu_static = { start = 0, stop = 1, num = 3, spacing = "geometric" }\n' + RUN: (
        "axes.mu_static: a geometric axis must not reach or cross zero, was start = 0, stop = 1"
    ),
    "[axes]\nmu_static = { start = 0, stop = 1, num = 100000 }\n"
    "mu_minimum = { start = 0, stop = 1, num = 100000 }\n" + RUN: (
        "axes: must make at most 1000000000 cells, made 1e+10"
    ),
    # keys that do not go together
    "[blade]\nmu_static = 1\n" + ONE_AXIS: (
        "blade.mu_static: must be left out, for axes.mu_static sets it; was 1"
    ),
    "[belt]\nspeed = 1\n[axes]\nbelt_speed = { values = [1] }\n" + RUN: (
        "belt.speed: must be left out, for axes.belt_speed sets it; was 1"
    ),
    "[belt]\nfrequency = 1\n" + ONE_AXIS: (
        "belt.frequency: must be left out with kind = 'steady'; it is for 'wiping' and 'trapezoid'"
    ),
    '[belt]\nkind = "wiping"\nspeed = 1\nfrequency = 1\n' + ONE_AXIS: (
        "belt.speed: must be left out with kind = 'wiping'; it is for 'steady' and 'trapezoid'"
    ),
    "[axes]\nbelt_ramp = { values = [1] }\n" + RUN: (
        "axes.belt_ramp: must be left out with belt.kind = 'steady'"
    ),
    '[belt]\nkind = "wiping"\n' + ONE_AXIS: (
        "belt.frequency: is missing; with kind = 'wiping' it must lie inside [0.0001, 1000] Hz"
    ),
    '[belt]\nkind = "trapezoid"\nfrequency = 1\nramp = 0.6\n' + ONE_AXIS: (
        "belt.ramp: must be at most half a period (0.5 s), was 0.6"
    ),
    "[blade]\nattack_angle = -60\ncollapse_angle = 50\n" + ONE_AXIS: (
        "blade.attack_angle: must lie inside the collapse angle, (-50, 50) degrees, was -60"
    ),
    "[start]\nangle = 5\nposition = [0, 0]\n" + ONE_AXIS: (
        "start: must have one of angle, equilibrium, position; had angle and position"
    ),
    "[start]\nangle = 89.5\n" + ONE_AXIS: (
        "start.angle: must lie inside the collapse angle, (-89, 89) degrees, was 89.5"
    ),
    "[start]\nvelocity = [0, 0]\n" + ONE_AXIS: "start.velocity: must have position beside it",
    "[start]\nposition = [0, -1e-3]\n" + ONE_AXIS: (
        "start.position: y must not be negative (the glass is y = 0), was -0.001"
    ),
    "[start]\nposition = [6e-3, 0]\n" + ONE_AXIS: (
        "start.position: x must be shorter than the lip (0.006 m), was 0.006"
    ),
    # run
    ONE_AXIS + "rtol = 0": "run.rtol: must lie inside [1e-13, 0.01], was 0",
    ONE_AXIS + "rtol = 1": "run.rtol: must lie inside [1e-13, 0.01], was 1",
    ONE_AXIS + 'rtol = 1e-8\nprecision = "float32"': (
        "run.rtol: must be at least 1e-06 with precision = 'float32', was 1e-08"
    ),
    ONE_AXIS + 'solver = "euler"': (
        "run.solver: must be 'tsit5', 'dopri5', 'dopri8' or 'bosh3', was 'euler'"
    ),
    ONE_AXIS.replace(
        "window = 1", "window = 0"
    ): "run.window: must lie inside [1e-06, 100000] s, was 0",
    ONE_AXIS.replace("transient = 0", "transient = -1"): (
        "run.transient: must lie inside [0, 100000] s, was -1"
    ),
}


@pytest.mark.parametrize("text", FAULTS, ids=lambda text: FAULTS[text].split()[0] + text[:24])
def test_a_fault_is_one_line_that_names_the_key(text):
    with pytest.raises(SpecError) as caught:
        sweep(text)
    assert str(caught.value) == f"x.toml: {FAULTS[text]}"


def test_faults_of_files(tmp_path):
    missing = tmp_path / "missing.toml"
    broken = tmp_path / "broken.toml"
    broken.write_text("title = 'a'\n[run\n")
    twice = tmp_path / "twice.toml"
    twice.write_text("a = 1\na = 2\n")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path, words in [
        (missing, "cannot be read: No such file or directory"),
        (tmp_path, "cannot be read: it is a folder, and no regular file"),
        (broken, "is not valid TOML: .*line 2"),
        (twice, "is not valid TOML: .*line 2"),
        (binary, "is not a text file"),
    ]:
        with pytest.raises(SpecError, match=words) as caught:
            load_sweep(path)
        assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path):
    """Editors on Windows put it there: 'Invalid statement (at line 1, column 1)'."""
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + b'title = "marked"\n[run]\nduration = 1\n')
    assert load_scene(path).title == "marked"
    assert load_scene(path).text.startswith("title")


def test_friction_that_rises_from_rest_is_noted():
    run = {"run": {"transient": 0, "window": 0.1}}
    scene = parse_scene({"blade": {"mu_static": 0.2}, "run": {"duration": 1}})
    line = "mu_static is 0.2, less than mu_minimum (0.3): friction rises with speed"
    assert scene.notes() == [line]
    axes = {"mu_static": {"values": [1.0, 0.5, 0.2]}}
    line = "mu_static is as low as 0.2, mu_minimum as high as 0.3: friction rises with speed"
    assert parse_sweep({"axes": axes} | run).notes() == [line]
    axes = {"mu_static": {"values": [1.0, 0.3]}}
    assert parse_sweep({"axes": axes} | run).notes() == []


def test_faults_of_scenes():
    with pytest.raises(
        SpecError, match=r"^s: run.duration: must lie inside \[1e-09, 100000\] s, was 0$"
    ):
        parse_scene({"run": {"duration": 0}}, "s")
    said = r"^s: run.sample_interval: must be at most run.duration, 0.02 s, was 0.1$"
    with pytest.raises(SpecError, match=said):
        parse_scene({"run": {"duration": 0.02, "sample_interval": 0.1}}, "s")
    with pytest.raises(SpecError, match=r"^s: run: is missing; the table must be there$"):
        parse_scene({}, "s")
    with pytest.raises(
        SpecError, match=r"^s: axes: unknown key; must be one of title, system, model, blade"
    ):
        parse_scene({"axes": {}, "run": {"duration": 1}}, "s")
    with pytest.raises(SpecError, match=r"^s: belt.frequency: is missing"):
        parse_scene({"belt": {"kind": "trapezoid"}, "run": {"duration": 1}}, "s")


def test_a_scene_with_a_table_of_sweeps_is_told_so(tmp_path):
    """[starts] was taken for a slip of the pen, and another start was set instead."""
    path = tmp_path / "scene.toml"
    path.write_text('[run]\nduration = 0.1\n[starts]\nnames = ["at_rest"]\n')
    with pytest.raises(SpecError, match=r": has \[starts\], so it is a sweep; what is needed"):
        load_scene(path)


def test_a_fault_of_no_key_is_one_line():
    """A check of ours that fails itself, as one of a whole table: it was an IndexError."""

    class Failing(BaseModel):
        @model_validator(mode="after")
        def _fails(self):
            raise ValueError("no such kind")

    with pytest.raises(ValidationError) as caught:
        Failing()
    assert sentence(Failing, caught.value) == "no such kind"


def test_notes_on_windows():
    """What is allowed but makes classes that nobody means."""
    axes = {"attack_angle": {"values": [-30.0, 0.0]}}
    belt = {"kind": "wiping", "amplitude": 0.8, "frequency": 0.7}
    run = {"transient": 0.1, "window": 2.0, "samples": 4096}
    (note,) = parse_sweep({"axes": axes, "belt": belt, "run": run}).notes()
    assert "reversal_window is 0.025 s, but the glass needs up to 0.072 s after V = 0" in note
    wide = {"axes": axes, "belt": belt, "run": run, "classes": {"reversal_window": 0.1}}
    assert parse_sweep(wide).notes() == []
    short = belt | {"amplitude": 0.01}  # strokes of 5 mm
    (note,) = parse_sweep({"axes": axes, "belt": short, "run": run}).notes()
    assert "the glass turns back before it can carry the lip over (1.5 lip lengths)" in note


def test_samples_too_coarse_for_the_turns_are_noted():
    """A cell that finished was called failed, without a word why."""
    spec = {
        "system": "oscillator",
        "belt": {"kind": "wiping", "amplitude": 0.4, "frequency": 0.01},
        "axes": {"damping": {"values": [0.02, 0.1]}},
        "run": {"transient": 100, "window": 200},
    }
    bands = {"squeal_band": [0.1, 1.0], "chatter_band": [0.02, 0.1]}
    (note,) = parse_sweep(spec | {"classes": bands}).notes()
    assert "reversal_window is 0.025 s, less than a sample (0.195 s)" in note
    assert parse_sweep(spec | {"classes": bands | {"reversal_window": 2.0}}).notes() == []


@pytest.mark.parametrize(
    ("phase", "start", "window", "failed"),
    [
        (90, 0.05, 0.05, True),  # turns at 0.25 s
        (90, 0.2, 0.045, True),  # ends before it
        (90, 0.2, 0.06, False),
        (90, 0.27, 0.03, False),  # begins behind it, ends on the stroke
        (90, 0.27, 0.015, True),
        (0, 0.005, 0.025, True),
        (0, 0.02, 0.02, False),
        (0, 0.05, 0.6, False),
    ],
)
def test_a_window_without_a_turn_or_a_stroke_is_noted(phase, start, window, failed):
    """What finished, and was loud, was called failed without a word why."""
    belt = {"kind": "trapezoid", "speed": 0.8, "frequency": 1.0, "ramp": 0.05, "phase": phase}
    given = {"belt": belt, "classes": {"reversal_window": 0.0375}}
    scene = parse_scene(given | {"run": {"duration": start + window, "transient": start}})
    axes = {"attack_angle": {"values": [0.0, 5.0]}}
    sweep = parse_sweep(given | {"axes": axes, "run": {"transient": start, "window": window}})
    says = (
        f"is {window:g} s, the longest stroke 0.5 s: what shows none of the 0.0375 s after a turn, "
        "or nothing between turns, is called failed"
    )
    named = (scene, "run.duration less run.transient"), (sweep, "run.window")
    for spec, name in named:
        assert spec.notes()[: failed + 1] == [f"{name} {says}"] * failed


def test_a_window_without_a_turn_in_some_cells_is_noted_of_any_system():
    belt = {"kind": "wiping", "amplitude": 0.4}
    axes = {
        "belt_phase": {"start": 0.0, "stop": 90.0, "num": 3},
        "belt_frequency": {"values": [0.01, 0.02]},
    }
    slow = {"squeal_band": [0.1, 1.0], "chatter_band": [0.02, 0.1], "reversal_window": 2.0}
    spec = {"system": "oscillator", "belt": belt, "axes": axes, "classes": slow}
    (note,) = parse_sweep(spec | {"run": {"transient": 100, "window": 30}}).notes()
    assert note.startswith("run.window is 30 s, the longest stroke 50 s: what shows none of")
    # at 45 degrees it turns 37.5 s later
    assert parse_sweep(spec | {"run": {"transient": 100, "window": 38}}).notes() == []


@pytest.mark.parametrize("band", [(500.0, 1000.0), (50.0, 100.0)])
def test_a_window_of_no_two_periods_of_squeal_is_noted(band):
    """Of a microsecond: what squeals was quiet, settled, its frequency told."""
    axes, least = {"attack_angle": {"values": [0.0, 5.0]}}, 2 / band[0]
    given = {"classes": {"squeal_band": list(band), "chatter_band": [0, 50]}}
    for window, notes in ((0.9 * least, 1), (least, 0)):
        scene = parse_scene(given | {"run": {"duration": 2 * window}})
        sweep = parse_sweep(given | {"axes": axes, "run": {"transient": 1, "window": window}})
        lines = [note for spec in (scene, sweep) for note in spec.notes()]
        assert len(lines) == 2 * notes
        said = f"is {window:g} s, shorter than 2 periods of the lowest squeal ({least:g} s): what"
        assert all(said in line for line in lines)


@pytest.mark.parametrize("path", sorted(SWEEPS.rglob("*.toml")), ids=lambda path: path.stem)
def test_shipped_files_need_no_note(path):
    load = load_sweep if "[axes]" in path.read_text() else load_scene
    assert load(path).notes() == []


@pytest.mark.parametrize(
    ("window", "top", "samples"),
    [(0.4, 1000, 2048), (2.0, 1000, 10048), (0.03, 1000, 192), (1e-3, 1000, 64), (0.4, 2500, 5056)],
)
def test_samples_follow_the_window_and_the_highest_squeal(window, top, samples):
    """Five a period: what is slower is told at the first look, a longer window folds nothing."""
    data = {
        "axes": {"attack_angle": {"values": [0.0]}},
        "run": {"transient": 0.1, "window": window},
        "classes": {"squeal_band": [500, top]},
    }
    spec = parse_sweep(data)
    assert spec.samples == samples >= 5 * top * window
    # spelling it out is the same sweep
    assert parse_sweep(data | {"run": data["run"] | {"samples": samples}}).digest() == spec.digest()
    assert parse_sweep(data | {"run": data["run"] | {"samples": 99}}).samples == 99


def test_time_of_a_flip():
    # V = 2 V0 t/ramp: V0 t^2/ramp on the ramp, V0 ramp/4 until its end
    assert flip_time("trapezoid", 0.8, 0.7, 0.05, 5e-3) == pytest.approx(math.sqrt(7.5e-3 / 16))
    assert flip_time("trapezoid", 0.8, 0.7, 0.01, 5e-3) == pytest.approx(2.5e-3 + 7.5e-3 / 0.8)
    time = flip_time("wiping", 1.6, 0.7, 0.0, 6e-3)
    turn = 2 * math.pi * 0.7
    assert 1.6 / turn * (1 - math.cos(turn * time)) == pytest.approx(9e-3)
    assert flip_time("wiping", 0.01, 10.0, 0.0, 6e-3) == math.inf  # the lip never flips
    assert flip_time("trapezoid", 0.01, 10.0, 0.01, 6e-3) == math.inf


def test_thresholds_of_a_scene():
    """Stated ones hold; else the reversal window is twice the time of the flip."""
    scene = {"run": {"duration": 1.0}}
    assert parse_scene(scene).thresholds() == parse_scene(scene).classes
    belt = {"kind": "wiping", "amplitude": 1.6, "frequency": 0.7}
    turning = parse_scene(scene | {"belt": belt})
    time = flip_time("wiping", 1.6, 0.7, 0.0, 6e-3)
    assert turning.thresholds().reversal_window == pytest.approx(2 * time)
    stated = parse_scene(scene | {"belt": belt, "classes": {"reversal_window": 0.03}})
    assert stated.thresholds().reversal_window == 0.03
    must = r"classes.reversal_window: must be at most a fifth of the belt's period \(0.285714 s\)"
    with pytest.raises(SpecError, match=f"{must}, was 0.4$"):
        parse_scene(scene | {"belt": belt, "classes": {"reversal_window": 0.4}})
    slow = parse_scene(scene | {"belt": belt | {"amplitude": 0.01}})  # the lip never flips
    assert slow.thresholds().reversal_window == pytest.approx(0.2 / 0.7)  # the longest allowed


def test_a_scene_notes_a_lip_that_cannot_flip_within_the_longest_window():
    belt = {"kind": "wiping", "amplitude": 0.8, "frequency": 5}
    scene = {"run": {"duration": 0.8}, "belt": belt}
    assert parse_scene(scene).thresholds().reversal_window == pytest.approx(0.04)
    assert parse_scene(scene).notes() == []  # 28 ms to flip
    assert parse_scene({"run": {"duration": 0.8}}).notes() == []
    (note,) = parse_scene(scene | {"belt": belt | {"amplitude": 0.3}}).notes()
    assert note.startswith("classes.reversal_window is 0.04 s, but the glass needs up to 0.048 s")
    (note,) = parse_scene(scene | {"classes": {"reversal_window": 0.02}}).notes()
    assert "is 0.02 s, but the glass needs up to 0.028 s after V = 0 to carry the lip over" in note


def test_bands_that_overlap_are_noted():
    sweep = {"axes": {"belt_speed": {"values": [0.3]}}, "run": {"transient": 0.1, "window": 0.1}}
    for parse, spec in ((parse_scene, {"run": {"duration": 0.3}}), (parse_sweep, sweep)):
        (note,) = parse(spec | {"classes": {"squeal_band": [60, 500]}}).notes()
        assert note.startswith(
            "classes.squeal_band and classes.chatter_band both hold 60 to 100 Hz"
        )
        assert parse(spec | {"classes": {"squeal_band": [100, 500]}}).notes() == []
