"""Every public function refuses what cannot be meant: one line that names the argument.

And before it computes: no test here compiles a program, but where it says so.
"""

import inspect

import diffrax
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import own_systems
import pytest
import xarray as xr

import wiperjax
from wiperjax import cycles, plots, remedy, sound
from wiperjax.cycles import cycle
from wiperjax.cycles.branch import dataset as branch_dataset
from wiperjax.cycles.branch import follow, up_and_down
from wiperjax.engine.arguments import check_beginning
from wiperjax.vocabulary.codes import Result
from wiperjax.vocabulary.kinds import BELTS
from wiperjax.vocabulary.parameters import PARAMETERS

BLADE = wiperjax.Wiper()
SPEC = {"axes": {"attack_angle": {"values": [0.0, 5.0]}}, "run": {"transient": 0.1, "window": 0.1}}
BOUNDS = {"attack_angle": (0.0, 0.2)}
NAN, INF = float("nan"), float("inf")


class Odd:
    """What nobody expects; it cannot even say what it is."""

    def __repr__(self):
        raise RuntimeError


STRANGE = ["a", [], {}, Odd(), 1j, b"x"]  # no number, whatever is asked for
NO_NUMBER = [*STRANGE, True, NAN, INF, [1.0, 2.0]]
NO_COUNT = [*NO_NUMBER, 1.5, -1, 10**400]
NO_FLAG = ["no", 0, 1.0, None, [], Odd()]
NO_PATH = [3, 1.5, None, [], Odd()]
NO_NAME = [3, [], {}, Odd(), "no such"]


@pytest.fixture(scope="module")
def samples():
    """A run and a map that were never computed, of the right shape."""
    time_ = np.linspace(0.0, 1.0, 64)
    codes = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "stick slip_pos"}
    run = xr.Dataset(
        {
            **{name: (("time", "axis"), np.zeros((64, 2))) for name in ("position", "velocity")},
            **{
                name: ("time", np.ones(64))
                for name in ("belt_velocity", "slip_speed", "normal_force", "friction_force")
            },
            "regime": ("time", np.zeros(64, np.int8), codes),
        },
        coords={"time": time_, "axis": ["x", "y"]},
    )
    shape = {"attack_angle": [0.0, 1.0], "belt_speed": [0.1, 0.2]}
    numbers = ("stick_fraction", "slip_fraction", "flight_fraction", "velocity_rms")
    numbers += ("belt_speed_rms", "dominant_frequency")
    names = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "quiet squeal"}
    found = xr.Dataset(
        {
            **{name: (tuple(shape), np.ones((2, 2))) for name in numbers},
            "label": (tuple(shape), np.zeros((2, 2), np.int8), names),
            "mechanism": (tuple(shape), np.zeros((2, 2), np.int8), names),
        },
        coords=shape,
    )
    return {"run": run, "map": found}


SEVERAL = np.array([1e-9, 1e-9])  # of what a motion has one
RTOL = [*NO_NUMBER, -1, 0, 1e3, SEVERAL]
LENGTH = [*NO_NUMBER, -1, 0, SEVERAL]  # of time
MOTION = {
    "system": ["wiper", None, wiperjax.Wiper, wiperjax.SteadyBelt(0.3)],
    "duration": LENGTH,
    "rtol": RTOL,
    "atol": [*STRANGE, -1, 0, NAN, (1e-9,), (1e-9, 1e-9, 1e-9), (1e-9, (1e-6,) * 3), (1e-9, "a")],
    "zeno_time": [*STRANGE, -1, NAN, INF, None],
    "solver": ["tsit5", diffrax.Euler(), diffrax.Tsit5, 3],
    "initial_state": [
        3.0, "ab", (0.0, 0.0), ((0.0, 0.0),), ((), ()), ((0.0, 0.0), (0.0,)), ((NAN, 0.0), (0, 0)),
        (("a", 0.0), (0.0, 0.0)),
    ],
    "max_steps": [*NO_COUNT, 0],
}  # fmt: skip
SEARCH = {"starts": [*NO_COUNT, 0], "seed": NO_COUNT}
NO_BOUNDS = [3, {}, "ab", [("attack_angle", 0, 1)], {"attack_angle": 1}]
NO_BOUNDS += [{"attack_angle": pair} for pair in ((1, 0), (0, NAN), ("a", 1), (0, 1, 2), (0, 30))]
NO_BOUNDS += [{"support_damping": (-5, -1)}]

CASES = {
    "solve": (
        wiperjax.solve,
        {"system": BLADE, "duration": 0.01},
        MOTION
        | {
            "atol": [*MOTION["atol"], SEVERAL, (SEVERAL, SEVERAL)],
            "max_steps": [*MOTION["max_steps"], None, SEVERAL],
            "sample_times": [
                "a",
                3.0,
                [],
                [0.0, NAN],
                [0.1, 0.1],
                [0.2, 0.1],
                [[0.1]],
                Odd(),
                [-1e-9, 0.1],
            ],
            "max_events": NO_COUNT,
            "max_step": [*STRANGE, True, NAN, -1, 0, SEVERAL],
            "observer": ["totals", wiperjax.RegimeTotals, 3],
            "statistics_start": [*NO_NUMBER[:-1], SEVERAL],
            "start": [*NO_NUMBER[:-1], SEVERAL],
            "reverse": [*NO_FLAG, SEVERAL],
        },  # fmt: skip
    ),
    "simulate": (
        wiperjax.simulate,
        {"system": BLADE, "duration": 0.01},
        MOTION
        | {
            "system": [*MOTION["system"], wiperjax.Wiper(attack_angle=SEVERAL)],
            "zeno_time": LENGTH,
            "sample_interval": [*LENGTH, 0.02, 1e-12],
            "observer": [3, "a", Odd(), wiperjax.RegimeTotals(0.02), wiperjax.RegimeTotals(-1.0)],
        },
    ),
    "basins": (
        wiperjax.basins,
        {"system": BLADE, "starts": (([0.0], 0.0), (0.0, 0.0)), "settle": 0.1, "window": 0.1},
        {key: MOTION[key] for key in ("system", "rtol", "atol", "solver", "max_steps")}
        | {
            "starts": [*MOTION["initial_state"], (([0.0],), ([0.0],)), (([[0.0]], 0), (0, 0))],
            "settle": [*NO_NUMBER, -1],
            "window": LENGTH,
            "zeno_time": LENGTH,
        },
    ),
    "preview": (wiperjax.preview, {}, {"ds": [3, None, "map.h5", [], Odd()]}),
    "explore": (wiperjax.explore, {}, {"ds": [3, None, "map.h5", [], Odd()]}),
    "export": (
        wiperjax.export,
        {"path": "run.csv"},
        {"run": [3, None, "run.h5", [], Odd()]},
    ),
    "modes": (
        wiperjax.modes,
        {"system": BLADE},
        {"system": MOTION["system"], "near": [3, "a", (0.0,), (0.0, 0.0, 0.0), (NAN, 0.0), Odd()]},
    ),
    "modes_over": (
        wiperjax.modes_over,
        {"spec": SPEC},
        {"spec": [3, None, [], Odd(), wiperjax.Wiper()]},
    ),
    "parameter": (
        wiperjax.parameter,
        {"default": 1.0},
        {
            "default": ["a", NAN, True, Odd()],
            "unit": [3, None],
            "low": ["a", NAN, True, 10**400],
            "high": ["a", NAN, True, -(10**400)],
            "above": ["a", NAN, True, Odd()],
            "below": ["a", NAN, True, Odd()],
            "long_name": [3],
        },
    ),
    "parameters_of": (
        wiperjax.parameters_of,
        {"system": BLADE},
        {"system": [3, "a", None, Odd()]},
    ),
    "share_error": (
        wiperjax.share_error,
        {"count": 3, "of": 10},
        {"count": [*STRANGE, True, NAN, [1.0, NAN], -1, 11], "of": [*NO_NUMBER, 0, 1.5]},
    ),
    "sweep": (
        wiperjax.sweep,
        {"spec": SPEC},
        {
            "spec": [3, None, [], Odd(), wiperjax.Wiper()],
            "output": [3, [], Odd()],
            "resume": NO_FLAG,
            "force": NO_FLAG,
            "progress": NO_FLAG,
            "block": [*NO_COUNT, 0],
            "evaluate": ["cells", 3],
        },
    ),
    "verify": (
        wiperjax.verify,
        {"path": "no.h5"},
        {
            "path": NO_PATH,
            "cells": [*NO_COUNT, 0],
            "seed": NO_COUNT,
            "tolerance": [*NO_NUMBER, -1],
            "spec": [3, {}, "map.toml", Odd()],
        },
    ),
    "open_map": (
        wiperjax.open_map,
        {"path": "no.h5"},
        {"path": NO_PATH, "variables": ["label", 3, [3]], "check": NO_FLAG},
    ),
    "borders": (wiperjax.borders, {"path": "no.h5"}, {"path": NO_PATH}),
    "refine": (
        wiperjax.refine,
        {"path": "no.h5", "levels": 1},
        {"path": NO_PATH, "progress": NO_FLAG},
    ),
    "with_borders": (
        plots.with_borders,
        {"ds": xr.Dataset({"label": ("attack_angle", [0, 1])}), "borders": xr.Dataset()},
        {"ds": [3, None, Odd()], "borders": [3, Odd(), xr.Dataset()]},
    ),
    "load_sweep": (wiperjax.load_sweep, {"path": "no.toml"}, {"path": NO_PATH}),
    "load_scene": (wiperjax.load_scene, {"path": "no.toml"}, {"path": NO_PATH}),
    "steady_slip": (
        wiperjax.steady_slip,
        {"wiper": BLADE},
        {"wiper": ["w", 3, None, Odd()], "belt_speed": NO_NUMBER[:-1]},
    ),
    "run_scene": (
        wiperjax.run_scene,
        {"spec": "no.toml"},
        {"spec": [3, None, [], Odd(), BLADE], "varied": ["attack_angle", 3, None, [3]]},
    ),
    "class_table": (
        wiperjax.class_table,
        {"ds": xr.Dataset({"label": ((), 0, {"flag_meanings": "a"}), "gap_max": ((), 0.0)})},
        {"ds": [3, None, {}, Odd()], "variable": ["labl", 3, None, "gap_max", Odd()]},
    ),
    "assess": (
        wiperjax.assess,
        {"run": xr.Dataset({"event_time": 0.0, "final_time": 1.0}, attrs={"belt_kind": "steady"})},
        {
            "run": [3, None, {}, Odd(), xr.Dataset()],
            "thresholds": [3, {}, Odd()],
            "transient": [*NO_NUMBER, -1, 1.0],
        },
    ),
    "configure": (wiperjax.configure, {}, {"cores": [*NO_COUNT, 0], "keep": [1, "no"]}),
    "RegimeTotals": (wiperjax.RegimeTotals, {}, {"start": NO_NUMBER[:-1], "blows": NO_FLAG}),
    "find_cycle": (
        cycles.find_cycle,
        {"system": BLADE, "settle": 0.1},
        {
            "system": MOTION["system"],
            "settle": LENGTH,
            "initial_state": MOTION["initial_state"],
            "period": LENGTH,
            "section": ["x", 3],
            "over": NO_NAME,
            "rtol": RTOL,
        },
    ),
    "follow": (
        follow.follow,
        {"cycle": cycle.Cycle(BLADE, cycle.Found.AT_REST), "low": 0.0, "high": 1.0},
        {
            "cycle": ["cycle", None, cycle.Cycle(BLADE, cycle.Found.AT_REST)],
            "low": NO_NUMBER,
            "high": NO_NUMBER,
            "step": [*LENGTH, 2.0],
            "most": [*NO_COUNT, 0],
        },
    ),
    "branch_dataset": (branch_dataset.branch_dataset, {"branch": None}, {"branch": ["b", 3, None]}),
    "up_and_down": (
        up_and_down.up_and_down,
        {"system": BLADE, "over": "belt_speed", "values": [0.1, 0.2], "settle": 1, "window": 1},
        {
            "system": MOTION["system"],
            "over": NO_NAME,
            "values": [3.0, [0.1], [0.2, 0.1], [0.1, NAN], "ab", [[0.1, 0.2]]],
            "settle": LENGTH,
            "window": LENGTH,
            "initial_state": MOTION["initial_state"],
            "period": [1.0, "a"],
            "kick": [*NO_NUMBER, -1],
            "samples": [*NO_COUNT, 0, 2**30],
            "rtol": RTOL,
        },
    ),
    "stabilise": (
        remedy.stabilise,
        {"blade": BLADE, "bounds": BOUNDS},
        SEARCH | {"blade": ["b", None], "bounds": NO_BOUNDS, "margin": NO_NUMBER},
    ),
    "quieten": (
        remedy.quieten,
        {"blade": BLADE, "bounds": BOUNDS},
        SEARCH
        | {
            "blade": ["b", None],
            "bounds": NO_BOUNDS,
            "duration": LENGTH,
            "window": [*LENGTH, 0.3],
            "effort": [*NO_NUMBER, -1],
            "most": [*NO_COUNT, 0],
            "rtol": RTOL,
        },
    ),
    "descend": (
        remedy.descend,
        {"cycle": cycle.Cycle(BLADE, cycle.Found.AT_REST), "bounds": BOUNDS},
        {
            "cycle": ["cycle", None, cycle.Cycle(BLADE, cycle.Found.AT_REST)],
            "bounds": NO_BOUNDS,
            "measure": NO_NAME,
            "step": [*LENGTH, 2.0],
            "most": [*NO_COUNT, 0],
            "settle": LENGTH,
        },
    ),
    "sensitivities": (
        remedy.sensitivities,
        {"cycle": cycle.Cycle(BLADE, cycle.Found.AT_REST), "names": ["attack_angle"]},
        {"cycle": ["cycle", None], "names": [3, [], [3], "attack_angle", *NO_BOUNDS[4:]]},
    ),
    "verdict": (
        remedy.verdict,
        {"blade": BLADE},
        {"blade": ["b", None], "settle": [*NO_NUMBER, -1], "window": LENGTH, "rtol": RTOL},
    ),
    "plot_file": (
        plots.plot_file,
        {"path": "no.h5", "output": "no.png"},
        {
            "path": NO_PATH,
            "output": NO_PATH,
            "picture": [3, []],
            "force": NO_FLAG,
            "dpi": [*NO_COUNT, 0],
            "at": [3, [("x", 1)], {"belt_speed": "a"}, {"belt_speed": NAN}],
            "seconds": [*LENGTH, 1e6],
            "component": NO_COUNT,
        },
    ),
    "plot_all": (
        plots.plot_all,
        {"path": "no.h5", "output": "no.png"},
        {"path": NO_PATH, "output": NO_PATH, "force": NO_FLAG, "dpi": [*NO_COUNT, 0]},
    ),
}
WRONG = [
    pytest.param(name, argument, value, id=f"{name}-{argument}-{k}")
    for name, (_, _, arguments) in CASES.items()
    for argument, values in arguments.items()
    for k, value in enumerate(values)
]


def refusal(call, *args, **kwargs) -> str:
    """The one line with which a call is refused."""
    with pytest.raises(ValueError) as refused:
        call(*args, **kwargs)
    line = str(refused.value)
    assert "\n" not in line and len(line) < 300, line
    return line


@pytest.mark.parametrize(("name", "argument", "value"), WRONG)
def test_wrong_arguments_are_refused_by_name(name, argument, value):
    call, good, _ = CASES[name]
    if argument == "over":  # numbers of the system: all are named
        with pytest.raises(ValueError, match=r"^parameter must be .*, but was"):
            call(**good | {argument: value})
        return
    line = refusal(call, **good | {argument: value})
    assert line.startswith(f"{argument} "), line
    assert " must " in line and ", but " in line, line


@pytest.mark.parametrize("name", PARAMETERS)
def test_blades_and_belts_hold_to_the_ranges_of_files(name):
    """In SI units and radians: the table of files is the only one."""
    entry = PARAMETERS[name]
    kinds = {"steady": wiperjax.SteadyBelt, "wiping": wiperjax.WipingBelt}
    kinds["trapezoid"] = wiperjax.TrapezoidBelt
    made = {"speed": 0.3, "amplitude": 0.3, "frequency": 1e-4, "ramp": 1e-6}
    if entry.table == "blade":
        builders = [(name, lambda value: wiperjax.Wiper(**{name: value}))]
    else:
        builders = [
            (key, lambda value, kind=kind, key=key: kinds[kind](**_fitting(kind, made, key, value)))
            for kind, keys in BELTS.items()
            for key, parameter in keys.items()
            if parameter == name
        ]
    for key, build in builders:
        for value in STRANGE + [True, None, NAN, INF, -INF, 10**400, np.array([NAN]), "0.3"]:
            assert refusal(build, value).startswith(f"{key} must ")
        low, high = (float(entry.to_si(end)) for end in (entry.range.low, entry.range.high))
        beyond = 1e-6 * max(abs(low), abs(high))
        for outside in (low - beyond, high + beyond, np.array([0.5 * (low + high), high + beyond])):
            if entry.exact:
                assert refusal(build, outside).startswith(f"{key} must lie inside ")
        if low >= 0:  # of any size, but not of the other sign
            assert f"{key} must " in refusal(build, -beyond)
        for inside in (0.5 * (low + high), np.linspace(low, high, 5)[1:-1]):
            if name != "belt_ramp":  # longer than half a period
                build(inside)


def _fitting(kind, made, key, value):
    return {name: made[name] for name in BELTS[kind] if name in made} | {key: value}


def test_a_remedy_must_see_the_turns_of_a_belt():
    """It called a blade quiet whose belt had not turned yet, where the same scene is a reversal."""
    turning = wiperjax.Wiper(belt=wiperjax.TrapezoidBelt(0.8, 0.7, 0.05, phase=1.6))
    must = "must be on a belt that does not turn (whole periods of one are judged by run_scene)"
    assert refusal(remedy.verdict, turning) == f"blade {must}, but was on TrapezoidBelt"
    must = "must hold the longest period in bounds of the belt"
    assert refusal(remedy.quieten, turning, BOUNDS) == f"window {must} (1.429 s), but was 0.1"
    fast = wiperjax.Wiper(belt=wiperjax.WipingBelt(0.3, 20.0))
    slower = {"belt_frequency": (1.0, 20.0)}  # at 1 Hz it had not turned yet, and seemed quieter
    assert refusal(remedy.quieten, fast, slower) == f"window {must} (1 s), but was 0.1"


def test_a_belt_of_ones_own_turns_where_its_pieces_say_so():
    """`verdict` took it for one that does not, and gave a blade a class across its turns."""
    turning = wiperjax.Wiper(belt=own_systems.Unsaid(0.3, 5.0, 0.04))
    assert refusal(remedy.verdict, turning).endswith("), but was on Unsaid")
    must = "must say how often a second a belt that turns does so (1 / its period)"
    found = refusal(remedy.quieten, turning, BOUNDS)
    assert found == f"Unsaid.wiping_frequency {must}, but was 0"


def test_statistics_begin_before_the_end():
    """All of them were zeros, of a motion that had finished."""
    motion = {"system": BLADE, "duration": 0.25, "start": 0.25}
    late = "must be below the end of the motion (0.5), but was 0.5"
    assert refusal(wiperjax.solve, **motion, statistics_start=0.5) == f"statistics_start {late}"
    begun = refusal(wiperjax.solve, **motion, observer=wiperjax.RegimeTotals(0.5))
    assert begun == f"observer.begin {late}"
    jax.eval_shape(lambda time: check_beginning(None, time, 0.5), 0.5)  # traced: not looked at


def test_degrees_are_asked_for():
    line = refusal(wiperjax.Wiper, attack_angle=5.0)
    assert line == (
        "attack_angle must lie inside (-1.5708, 1.5708) rad, but was 5; "
        "were degrees meant? 5 degrees are 0.08727 rad"
    )
    assert "degrees meant" not in refusal(wiperjax.Wiper, attack_angle=500.0)
    assert "degrees meant" in refusal(wiperjax.Wiper, shoulder_angle=np.array([0.6, 30.0]))


def test_impossible_friction_laws():
    coulomb = refusal(wiperjax.Coulomb, 0.3, 0.4)
    assert coulomb == "dynamic must be at most static (0.3), but was 0.4"
    assert refusal(wiperjax.Coulomb, -1.0, 0.0).startswith("static must be a finite number >= 0")
    good = {"static": 1.0, "minimum": 0.3, "stribeck_speed": 0.1}
    for key, value in (
        ("static", NAN), ("minimum", -0.1), ("stribeck_speed", 0.0), ("shape", 0.5),
        ("viscous_slope", "a"),
    ):  # fmt: skip
        assert refusal(wiperjax.Stribeck, **good | {key: value}).startswith(f"{key} must ")


def test_a_ramp_longer_than_half_a_period():
    line = refusal(wiperjax.TrapezoidBelt, 0.3, 1.0, np.array([0.1, 0.6]))
    assert line == "ramp must be at most half a period (0.5), but was 0.6"
    wiperjax.TrapezoidBelt(0.3, 0.7, 1 / 1.4)


def test_a_belt_may_rest_in_python():
    """`bench limits` measures stiffness on a belt at rest; a map cannot have one."""
    assert wiperjax.SteadyBelt(0.0).speed == 0
    assert PARAMETERS["belt_speed"].problem(0.0)


# --- what must go on working ----------------------------------------------------------------------


def test_traced_values_pass():
    """Under jit, vmap and jvp nothing is known of them, and nothing is asked."""

    def build(angle, speed, frequency, friction):
        belt = wiperjax.TrapezoidBelt(speed, frequency, 0.1 / frequency)
        wiperjax.Coulomb(friction, 2 * friction)
        wiperjax.Stribeck(friction, friction, speed)
        wiperjax.RegimeTotals(speed)
        return wiperjax.Wiper(belt=belt, attack_angle=angle, mu_static=friction).attack_angle

    wrong = (5.0, -300.0, -1.0, -1.0)  # refused, were they known
    assert jax.jit(build)(*wrong) == 5.0
    assert jax.vmap(build)(*jnp.tile(jnp.array(wrong)[:, None], 3)).shape == (3,)
    assert jax.jvp(build, wrong, (1.0, 0.0, 0.0, 0.0))[1] == 1.0
    refusal(build, *wrong)


def test_arrays_pass():
    angles = np.array([-0.1, 0.1])
    for array in (angles, jnp.asarray(angles), angles.astype(np.float32)):
        assert wiperjax.Wiper(attack_angle=array).attack_angle is array
    wiperjax.Wiper(tip_mass=np.float64(1e-3), gravity=np.int64(9), hinge_mass=0)


@pytest.mark.long
def test_tolerances_that_only_jax_knows_end_as_a_result():
    """Inside `jax.jit` no message can be given: such a trajectory ends at once, with a code, and
    alone. A duration below 0 was gone backwards, and `finished`. This test compiles one program.
    """

    @jax.jit
    @jax.vmap
    def results(rtol, atol, duration):
        run = wiperjax.solve(BLADE, duration, rtol=rtol, atol=atol, max_events=0)
        return run.result, run.steps, run.final_time

    rtol = jnp.array([1e-6, -1.0, 0.0, NAN, INF, 1e-6, 1e-6, 1e-6])
    atol = jnp.array([1e-9, 1e-9, 1e-9, 1e-9, 1e-9, 0.0, NAN, 1e-9])
    result, steps, final_time = results(rtol, atol, jnp.array([1e-4] * 7 + [-1e-4]))
    assert list(result) == [Result.FINISHED] + [Result.NON_FINITE] * 7
    assert steps[0] > 0 and not steps[1:].any()
    assert final_time[0] == 1e-4 and not final_time[1:].any()


# --- pictures and sounds --------------------------------------------------------------------------


def test_every_public_name_is_tested_here():
    """A new public function needs its cases."""
    functions = {
        name
        for name in dir(wiperjax)
        if not name.startswith("_") and inspect.isfunction(getattr(wiperjax, name))
    }
    files = {"parse_scene", "parse_sweep"}  # of a file's words `specs` has its own tests
    hooks = {"load_ipython_extension", "unload_ipython_extension"}  # a notebook calls them
    assert functions <= CASES.keys() | files | hooks
    doors = {name for name in dir(remedy) if inspect.isfunction(getattr(remedy, name))}
    assert doors <= CASES.keys()


PICTURES = {
    name: draw
    for name, draw in vars(plots).items()
    if callable(draw)
    and not name.startswith("_")
    and name not in ("of", "plot_file", "plot_all", "with_borders", "with_curves")
}


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_another_kind_are_refused(name, samples):
    assert len(PICTURES) > 20
    draw = PICTURES[name]
    more = ("velocity_rms",) if name == "value_map" else ()
    for wrong in (*NO_PATH[:2], "map.h5", xr.Dataset(), *_others(name, samples)):
        line = refusal(draw, wrong, *more)
        assert " must be " in line and ", but " in line


def _others(name, samples):
    """Datasets that this picture cannot be drawn of."""
    of_runs = ("history", "portrait", "friction_", "spectr", "run_", "animate")
    if any(part in name for part in of_runs):
        return [samples["map"]]
    return [samples["run"]]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("class_map", {"ax": 3}),
        ("class_map", {"at": 3}),
        ("class_map", {"at": {"belt_speed": NAN}}),
        ("class_map", {"x": 3}),
        ("class_map", {"panels": 0}),
        ("class_map", {"panels": "a"}),
        ("map_overview", {"y": []}),
        ("value_map", {"name": 3}),
        ("fraction_map", {"regime": 3}),
        ("fraction_map", {"title": 3}),
        ("along_axis", {"along": 3}),
        ("along_axis", {"axes": 3}),
        ("time_history", {"quantity": 3}),
        ("time_history", {"component": -1}),
        ("time_history", {"legend": "no"}),
        ("phase_portrait", {"component": 1.5}),
        ("phase_portrait", {"transient": "run"}),
        ("run_overview", {"whole": 3}),
        ("friction_curve", {"normalised": 1}),
        ("spectrogram", {"window": -1}),
        ("spectrogram", {"highest": NAN}),
        ("animate", {"seconds": 0}),
        ("animate", {"seconds": INF}),
    ],
)
def test_options_of_pictures(name, options, samples):
    of_map = name.endswith("_map") or name in ("map_overview", "along_axis")
    dataset = samples["map" if of_map else "run"]
    before = plt.get_fignums()
    line = refusal(PICTURES[name], dataset, **options)
    assert line.startswith(
        (
            f"{next(iter(options))} must be",
            f"{next(iter(options))} of",
            *[f"{key} must" for key in options],
        )
    ), line
    assert plt.get_fignums() == before


@pytest.mark.parametrize(
    ("argument", "values"),
    {
        "run": ["run.h5", None, 3, xr.Dataset()],
        "quantity": [3, [], "no such"],
        "reference": LENGTH,
        "start": NO_NUMBER,
        "stop": NO_NUMBER,
        "seconds": [*LENGTH, 1e9],
    }.items(),
)
def test_sound(argument, values, samples):
    for value in values:
        line = refusal(sound.sound, **{"run": samples["run"], argument: value})
        assert line.startswith(f"{argument} must be") or line.startswith(f"{argument} must lie")
    heard = sound.Sound(np.zeros(4), "velocity", 1.0, "m/s")
    for wrong in NO_PATH:
        assert refusal(heard.write, wrong).startswith("path must be")
    assert refusal(heard.write, "a.wav", force="no").startswith("force must be")
