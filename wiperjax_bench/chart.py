"""`wiperjax bench chart`: every method on every scene, error against cost.

Scene by scene: reference, every method at every setting (compiled, judged), then all of them timed
in interleaved repeats. A finished scene is kept at once in `<output>.parts/`, so a run that was
stopped goes on where it was.
"""

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from . import errors, measure, rivals, scenes
from .interface import NotForThisScene, Rival
from .scenes import Scene

FORMAT = 1
JUDGED = 128  # cells whose motion is compared
BATCH = 4096  # cells of the random batch
VALUES = {  # name: (unit, meaning)
    "wall": ("s", "wall time per trajectory, median of interleaved repeats"),
    "wall_low": ("s", "10th percentile of the repeats"),
    "wall_high": ("s", "90th percentile of the repeats"),
    "cpu": ("s", "processor time per trajectory, median"),
    "repeats": ("1", "repeats"),
    "cells": ("1", "trajectories per call"),
    "steps": ("1", "steps, evaluations for scipy, mean of the judged cells"),
    "compile": ("s", "wall time of the first preparation with this method, compilation included"),
    "state_error": ("1", "median over cells of the largest position error over the length scale"),
    "state_error_p90": ("1", "the same, 90th percentile"),
    "velocity_error": ("1", "median over cells of the largest velocity error over the speed scale"),
    "event_time_error": ("s", "median over cells of the largest error of an event's time"),
    "wrong_events": ("1", "share of cells whose sequence of events is not the reference's"),
    "stopped": ("1", "share of cells in which the method reported a failure"),
}


def select(names: list[str] | None, quick: bool) -> list[Rival]:
    """Return the methods to run; the quick run leaves out what needs long compilations."""
    chosen = [r for r in rivals.every() if names is None or any(n in r.name for n in names)]
    if quick and names is None:
        keep = ("engine Tsit5", "numba scalar loop", "scipy solve_ivp RK45")
        chosen = [r for r in chosen if r.name in keep]
    return chosen


def run(
    output: Path,
    *,
    quick: bool = False,
    only_scenes: list[str] | None = None,
    methods: list[str] | None = None,
    repeats: int | None = None,
    say: Callable[[str], None] = print,
) -> xr.Dataset:
    """Return the dataset of the chart, written to ``output``.

    ``quick``: two scenes, few settings, few cells (under two minutes). ``only_scenes``, ``methods``
    (parts of names): a part of it. Raises ValueError for names that do not exist.
    """
    names = list(only_scenes or (("squeal", "block") if quick else scenes.ALL))
    for name in names:
        if name not in scenes.ALL:
            raise ValueError(f"scene must be one of {', '.join(scenes.ALL)}, but was {name!r}")
    chosen = select(methods, quick)
    if not chosen:
        raise ValueError(f"no method has {methods} in its name")
    repeats = repeats or 3
    versions = measure.versions()
    key = {"format": FORMAT, "quick": quick, "repeats": repeats, "versions": versions,
           "machine": measure.machine(), "methods": [r.name for r in chosen]}  # fmt: skip
    digest = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:12]
    parts = output.with_name(output.name + ".parts")
    parts.mkdir(parents=True, exist_ok=True)
    tables = []
    for name in names:
        kept = parts / f"{name}-{digest}.json"
        if kept.exists():
            say(f"{name}: kept from a run that was stopped")
        else:
            table = measure_scene(name, chosen, quick, repeats, say)
            text = json.dumps(table)
            temporary = kept.with_suffix(".tmp")
            temporary.write_text(text)
            temporary.replace(kept)
        tables.append(json.loads(kept.read_text()))
    dataset = assemble(tables, chosen)
    dataset.attrs |= {
        "title": "speed against accuracy of stick, slip and flight trajectories",
        "machine": measure.machine(),
        "versions": json.dumps(versions, sort_keys=True),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "quick": int(quick),
        "repeats": repeats,
        "cores": 1,
        "reference": "numba scalar loop at rtol 1e-12, confirmed by engine Dopri8 at 1e-10",
    }
    dataset.to_netcdf(output, engine="h5netcdf")
    for file in parts.iterdir():
        file.unlink()
    parts.rmdir()
    return dataset


def measure_scene(name: str, chosen: list[Rival], quick: bool, repeats: int, say) -> dict[str, Any]:
    """Return the measurements of one scene as plain numbers."""
    cells = 1024 if quick else BATCH if name == "batch" else scenes.CELLS
    judged = 16 if quick else JUDGED
    scene: Scene = getattr(scenes, name)(cells)
    part = scene.head(judged)
    true = errors.truth(part)
    second = confirm(part, true) if not quick else np.nan
    say(
        f"{name}: {cells} cells, horizon {np.median(true.horizon):g} of {scene.duration:g} s, "
        f"reference confirmed to {second:.1e}"
    )
    rows, calls = [], []
    for method in chosen:
        reason = method.available()
        if reason is not None:
            rows.append({"method": method.name, "note": f"not run: {reason}"})
            continue
        started, first = time.perf_counter(), True
        settings = method.settings[1:6:2] if quick else method.settings
        note = ""
        for index, setting in enumerate(method.settings):
            if setting not in settings:
                continue
            try:
                timed = scene.head(min(method.cells, cells))
                call = method.prepare(timed, setting)
                call()  # compiles
                small = part.head(min(method.cells, judged))
                if hasattr(call, "answer"):
                    answer = method.prepare(small, setting).answer()  # type: ignore[attr-defined]
                else:
                    answer = method.prepare(small, setting)()
            except NotForThisScene as why:
                note = f"not for this scene: {why}"
                break
            except Exception as error:  # a rival that breaks is a result, not the end of the run
                note = f"stopped with {type(error).__name__}: {str(error).splitlines()[0][:120]}"
                continue
            found = errors.judge(part, true, answer)
            rows.append(
                {
                    "method": method.name,
                    "index": index,
                    "setting": setting,
                    "cells": timed.cells,
                    "steps": float(np.mean(answer.steps)),
                    "compile": time.perf_counter() - started if first else np.nan,
                    "state_error": found.state,
                    "state_error_p90": found.state_p90,
                    "velocity_error": found.velocity,
                    "event_time_error": found.event_time,
                    "wrong_events": found.wrong,
                    "stopped": found.stopped,
                }
            )
            calls.append((rows[-1], call))
            first = False
        if note:
            rows.append({"method": method.name, "note": note})
        say(f"  {method.name}: prepared in {time.perf_counter() - started:.1f} s {note}")
    costs = measure.interleaved([c for _, c in calls], repeats, patience=2.0)
    for (row, _), cost in zip(calls, costs, strict=True):
        row["wall"], row["cpu"] = cost.wall / row["cells"], cost.cpu / row["cells"]
        row["wall_low"], row["wall_high"] = cost.low / row["cells"], cost.high / row["cells"]
        row["repeats"] = cost.repeats
    return {
        "scene": name,
        "about": scene.about,
        "confirmed": second,
        "horizon": float(np.median(true.horizon)),
        "load": measure.load(),
        "rows": rows,
    }


def confirm(scene: Scene, true: errors.Truth) -> float:
    """Return the state error of a second method at high accuracy: what the reference is worth."""
    import diffrax

    from .rivals.engine import Engine

    few = scene.head(32)
    answer = Engine(diffrax.Dopri8).prepare(few, 1e-10).answer()  # type: ignore[attr-defined]
    found = errors.judge(scene, true, answer)
    return found.state_p90


def assemble(tables: list[dict], chosen: list[Rival]) -> xr.Dataset:
    """Return the measurements as a dataset over (scene, method, step of the method's setting)."""
    most = max(len(r.settings) for r in chosen)
    shape = (len(tables), len(chosen), most)
    place = {r.name: i for i, r in enumerate(chosen)}
    values = {name: np.full(shape, np.nan) for name in ("setting", *VALUES)}
    notes = np.full(shape[:2], "", dtype=object)
    for i, table in enumerate(tables):
        for row in table["rows"]:
            j = place[row["method"]]
            if "note" in row:
                notes[i, j] = row["note"]
                continue
            for name, array in values.items():
                value = row[name]
                array[i, j, row["index"]] = np.nan if value is None else value
    dims = ("scene", "solver", "step")
    about = {"setting": ("", "the method's own tolerance, step or width")} | VALUES
    data = {
        name: (dims, array, {"units": about[name][0], "long_name": about[name][1]})
        for name, array in values.items()
    }
    return xr.Dataset(
        {
            **data,
            "note": (dims[:2], notes.astype(str), {"long_name": "why something was not run"}),
            "confirmed": ("scene", [t["confirmed"] for t in tables],
                          {"long_name": "state error of the second reference method, p90"}),
            "horizon": ("scene", [t["horizon"] for t in tables],
                        {"units": "s", "long_name": "median time up to which cells are judged"}),
            "load_average": ("scene", [t["load"] for t in tables],
                     {"long_name": "load average of the machine when the scene was timed"}),
            "setting_name": ("solver", [r.setting_name for r in chosen]),
            "about": ("scene", [t["about"] for t in tables]),
        },
        coords={"scene": [t["scene"] for t in tables], "solver": [r.name for r in chosen]},
    )  # fmt: skip
