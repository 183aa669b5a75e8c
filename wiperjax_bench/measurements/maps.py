"""`wiperjax bench maps`: how many cells of a map get another class, in how many steps and seconds.

Random cells of the reference sweep go through the sweep's own path (statistics, spectrum, class)
with the engine at several settings and with the scalar loop in its place. The reference is the
engine's Dopri8 at rtol 1e-9; the scalar loop at 1e-10 confirms it: cells on which these two differ
are undecided (chaotic, or on the edge of a class) and are the floor of every row.
"""

from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from wiperjax.blade.build import build_wiper
from wiperjax.maps.block import evaluate_block
from wiperjax.maps.cells import batch
from wiperjax.specs.load import parse_sweep
from wiperjax.vocabulary.codes import Result

from ..harness import measure
from ..harness.keep import Parts
from ..rivals import compiled
from ..scalar import statistics
from ..scenes import families

SWEEP = {  # sweeps/reference.toml
    "axes": {
        "attack_angle": {"start": -40, "stop": 40, "num": 41},
        "normal_load": {"start": 5, "stop": 30, "num": 11},
        "belt_speed": {"start": 0.02, "stop": 1.0, "num": 21, "spacing": "geometric"},
    },
    "run": {"transient": 0.4, "window": 0.4},
}
COMPARED = ("stick_fraction", "slip_fraction", "flight_fraction", "velocity_rms",
            "normal_force_mean", "normal_force_max", "dominant_frequency")  # fmt: skip
REFERENCE = ("engine", {"solver": "dopri8", "rtol": 1e-9})
SECOND = ("scalar", {"rtol": 1e-10})
SETTINGS = [
    *(("engine", {"rtol": r, "solver": "tsit5"}) for r in (1e-3, 1e-4, 1e-5, 1e-6, 1e-8)),
    *(
        ("engine", {"rtol": r, "solver": "tsit5", "precision": "float32"})
        for r in (1e-4, 1e-5, 1e-6)
    ),
    *(("engine", {"rtol": r, "solver": "bosh3"}) for r in (1e-3, 1e-4)),
    *(("engine", {"rtol": r, "solver": "dopri8"}) for r in (1e-3, 1e-4, 1e-5, 1e-6, 1e-8)),
    *(("scalar", {"rtol": r}) for r in (1e-4, 1e-6, 1e-8)),
]
QUICK = [SETTINGS[3], SETTINGS[-2]]
LIMIT = 60.0  # s: what takes longer is timed once
QUICK_REFERENCES = ("scalar", {"rtol": 1e-10}), ("scalar", {"rtol": 1e-9})  # compile nothing more


def scene_of(spec, index: np.ndarray) -> families.Scene:
    """Return cells of a sweep on a steady belt as a scene."""
    wiper = build_wiper(spec.cells(index), spec.belt.kind, spec.blade.friction)
    full = lambda x: np.broadcast_to(np.asarray(x, float), index.shape).copy()
    start = np.zeros((len(index), 4))
    start[:, 0] = full(wiper.lip_length) * np.sin(full(wiper.attack_angle))
    end, scales = spec.run.transient + spec.run.window, (families.LENGTH, full(wiper.belt.peak))
    return families.Scene("map", "", wiper, start, end, np.array([end]), scales)


def scalar_evaluate(spec, index: np.ndarray, finer: int = 1, room: int | None = None) -> dict:
    """Return the columns of cells as `cells.batch.evaluate` does, by the scalar loop."""
    scene, run = scene_of(spec, index), spec.run
    samples = finer * spec.samples
    r = compiled.prepared(
        scene, spec.rtol, threads=None, mark=run.transient, samples=samples, window=run.window
    )()
    result = np.array([Result.FINISHED, Result.COLLAPSED, Result.STEP_TOO_SMALL,
                       Result.STEP_BUDGET_SPENT, Result.NON_FINITE])[r.result]  # fmt: skip
    done = result == Result.FINISHED
    total = np.where(done[:, None], r.total, np.nan)
    mean = total[:, statistics.U] / run.window
    variance = total[:, statistics.UU] / run.window - mean**2
    return {
        "result": result,
        "steps": r.attempts - r.rejected,
        "rejected_steps": r.rejected,
        "stick_fraction": total[:, statistics.STICK_TIME] / run.window,
        "slip_fraction": total[:, statistics.SLIP_TIME] / run.window,
        "flight_fraction": total[:, statistics.FLIGHT_TIME] / run.window,
        "velocity_rms": np.sqrt(np.maximum(variance, 0)),
        "velocity_mean": mean,
        "belt_speed_rms": scene.scales[1],
        "normal_force_mean": total[:, statistics.FORCE] / run.window,
        "normal_force_max": total[:, statistics.FORCE_MAX],
        "signal": np.diff(r.signal) * samples / run.window,  # means between places
    }


def evaluate(code: str, changes: dict, index: np.ndarray) -> dict:
    """Return the columns with class, frequency, and trial steps (``attempts``)."""
    spec = parse_sweep(SWEEP | {"run": SWEEP["run"] | changes}, "bench maps")
    how = batch.evaluate if code == "engine" else scalar_evaluate
    columns, _ = evaluate_block(spec, index, how)
    return columns | {"attempts": columns["steps"] + columns["rejected_steps"]}


def seconds(settings: list, index: np.ndarray, repeats: int) -> list[dict[str, float]]:
    """Return wall and processor time [s] of a cell at each setting, compiled before."""
    calls = [partial(evaluate, *setting, index) for setting in settings]
    for call in calls:
        call()
    costs = measure.interleaved(calls, repeats, LIMIT)
    keys = {"wall": "wall", "wall_low": "low", "wall_high": "high", "cpu": "cpu"}
    return [{k: getattr(cost, v) / len(index) for k, v in keys.items()} for cost in costs]


def run(output: Path, *, quick: bool = False, count: int = 2048, seed: int = 5, say=print):
    """Return the dataset of wrong classes and errors of the map's variables.

    A finished setting is kept in `<output>.parts/` until all are done. Then all are timed, engine
    and naming together, in turns.
    """
    rng = np.random.default_rng(seed)
    count = 24 if quick else count
    size = parse_sweep(SWEEP, "bench maps").size
    index = np.sort(rng.choice(size, count, replace=False))
    parts = Parts(output, {"count": count, "seed": seed, "sweep": SWEEP})

    def columns(code, changes):
        """Plain numbers: the class, the variables that are compared, the result, the steps."""
        name = "-".join([code, *(f"{v:.0e}" if isinstance(v, float) else v
                                 for v in changes.values())])  # fmt: skip

        def make():
            found = evaluate(code, changes, index)
            names = ("label", "result", "attempts", *COMPARED)
            return {k: np.asarray(found[k], float).tolist() for k in names}

        return {k: np.array(v) for k, v in parts.once(name, make, say).items()}

    references = QUICK_REFERENCES if quick else (REFERENCE, SECOND)
    true, second = (columns(*reference) for reference in references)
    settled = true["label"] == second["label"]
    say(f"{count} cells; the two references agree on {np.mean(settled):.1%} of the classes")
    rows = []
    for code, changes in QUICK if quick else SETTINGS:
        found = columns(code, changes)
        row = {
            "code": code,
            "solver": changes.get("solver", "tsit5"),
            "precision": changes.get("precision", "float64"),
            "rtol": changes["rtol"],
            "steps": float(np.mean(found["attempts"])),
            "wrong": float(np.mean(found["label"] != true["label"])),
            "wrong_settled": float(np.mean((found["label"] != true["label"])[settled])),
            "failed": float(np.mean(found["result"] > 1)),
        }
        for name in COMPARED:
            off = np.abs(found[name] - true[name])[settled]
            size = np.nanpercentile(np.abs(true[name]), 90) or 1.0
            row[f"{name}_median"] = float(np.nanmedian(off) / size)
            row[f"{name}_p90"] = float(np.nanquantile(off, 0.9) / size)
        rows.append(row)
        say(
            f"  {code} {row['solver']} {row['precision']} rtol {row['rtol']:.0e}: "
            f"{row['wrong']:.2%} of classes differ, {row['steps']:.0f} steps a cell"
        )
    asked = QUICK if quick else SETTINGS
    costs = parts.once("seconds", lambda: seconds(asked, index, 1 if quick else 3), say)
    for row, cost in zip(rows, costs, strict=True):
        row |= cost
    units = {name: "s" for name in rows[0] if name.startswith(("wall", "cpu"))}
    data = {k: ("row", [r[k] for r in rows], {"units": units.get(k, "1")}) for k in rows[0]}
    dataset = xr.Dataset(
        data,
        attrs=measure.attributes("classes and map variables against a reference")
        | {
            "cells": count,
            "references": " and ".join(
                " ".join([code, *map(str, changes.values())]) for code, changes in references
            ),
            "undecided": float(np.mean(~settled)),
            "load": measure.load(),
        },
    )
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset
