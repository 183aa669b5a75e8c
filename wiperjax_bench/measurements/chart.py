"""`wiperjax bench chart`: every method on every scene, error against cost.

Scene by scene: reference, every method at every setting (compiled, judged), then all of them timed
in interleaved repeats. A finished scene is kept at once in `<output>.parts/`, so a run that was
stopped goes on where it was.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .. import rivals
from ..harness import measure
from ..harness.interface import NotForThisScene, Rival
from ..harness.keep import Parts
from ..scenes import families
from ..scenes.scene import Scene
from . import confirm, errors

JUDGED = 128  # cells whose motion is compared
BATCH = 4096  # cells of the random batch
PATIENCE = 1.0  # s of processor time: after a call that takes longer finer settings are left out
VALUES = {  # name: (unit, meaning)
    "wall": ("s", "wall time per trajectory, median of interleaved repeats"),
    "wall_low": ("s", "10th percentile of the repeats"),
    "wall_high": ("s", "90th percentile of the repeats"),
    "cpu": ("s", "processor time per trajectory, median"),
    "repeats": ("1", "repeats"),
    "cells": ("1", "trajectories per call"),
    "steps": ("1", "steps, evaluations for scipy, mean of the judged cells"),
    "compile": ("s", "wall time of the first call with this method, less that of the second"),
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
        keep = ("engine Tsit5", "numba scalar loop", "scipy solve_ivp RK45")  # few compilations
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
    names = list(only_scenes or (("squeal", "block") if quick else families.ALL))
    for name in names:
        if name not in families.ALL:
            raise ValueError(f"scene must be one of {', '.join(families.ALL)}, but was {name!r}")
    chosen = select(methods, quick)
    if not chosen:
        raise ValueError(f"no method has {methods} in its name")
    repeats = repeats or 3
    parts = Parts(output, {"quick": quick, "repeats": repeats,
                           "methods": [(r.name, r.settings) for r in chosen]})  # fmt: skip
    tables = [
        parts.once(name, partial(measure_scene, name, chosen, quick, repeats, say), say)
        for name in names
    ]
    dataset = assemble(tables, chosen)
    title = "speed against accuracy of stick, slip and flight trajectories"
    dataset.attrs |= measure.attributes(title) | {
        "quick": int(quick),
        "repeats": repeats,
        "cores": 1,
        "reference": "the numba scalar loop at rtol 1e-12",
        "second": f"{confirm.SECOND[quick]} (block: the exact answer)",
    }
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset


def measure_scene(name: str, chosen: list[Rival], quick: bool, repeats: int, say) -> dict[str, Any]:
    """Return the measurements of one scene as plain numbers."""
    cells = 1024 if quick else BATCH if name == "batch" else families.CELLS
    judged = 16 if quick else JUDGED
    scene: Scene = getattr(families, name)(cells)
    part = scene.head(judged)
    true = errors.truth(part)
    compiled = compile_ahead(chosen, scene, part)
    second = confirm.errors_of_second(part, true, quick)
    say(
        f"{name}: {cells} cells, horizon {np.median(true.horizon):g} of {scene.duration:g} s, "
        f"reference confirmed to {second.state_p90:.1e}, other events in {second.wrong:.0%}"
    )
    rows, calls = [], []
    for method in chosen:
        started = time.process_time()
        found, timed, note = try_method(method, scene, part, true, quick)
        if found and method.name in compiled:
            found[0]["compile"] = compiled[method.name]
        rows += found
        calls += list(zip(found, timed, strict=True))
        if note:
            rows.append({"method": method.name, "note": note})
        say(f"  {method.name}: {time.process_time() - started:.1f} s of processor time {note}")
    once = [(row.pop("once"), row.pop("spent")) for row, _ in calls]
    costs = measure.interleaved([c for _, c in calls], repeats, PATIENCE, once)
    for (row, _), cost in zip(calls, costs, strict=True):
        row["wall"], row["cpu"] = cost.wall / row["cells"], cost.cpu / row["cells"]
        row["wall_low"], row["wall_high"] = cost.low / row["cells"], cost.high / row["cells"]
        row["repeats"] = cost.repeats
    return {
        "scene": name,
        "about": scene.about,
        "confirmed": second.state_p90,
        "confirmed_time": second.event_time,
        "confirmed_wrong": second.wrong,
        "horizon": float(np.median(true.horizon)),
        "load": measure.load(),
        "rows": rows,
    }


def compile_ahead(chosen: list[Rival], scene: Scene, part: Scene) -> dict[str, float]:
    """Compile what can be compiled without being run, two at a time; return method -> seconds.

    It is most of the time a chart takes. Seconds are of the program that is timed.
    """
    ready = [r for r in chosen if hasattr(r, "compile")]

    def one(method: Any) -> float:
        spent = method.compile(scene.head(min(method.cells, scene.cells)))
        judged = part.head(min(method.cells, part.cells))
        method.prepare(judged, method.settings[0]).answer()  # what answers is compiled, too
        return spent

    with ThreadPoolExecutor(2) as pool:
        spent = list(pool.map(one, ready))
    return {r.name: t for r, t in zip(ready, spent, strict=True)}


def try_method(method: Rival, scene: Scene, part: Scene, true: errors.Truth, quick: bool):
    """Return (rows, calls to be timed, note) of a method at its settings, coarse to fine.

    ``part``: the cells that are judged. A setting that takes longer than `PATIENCE` is the last.
    """
    rows, calls = [], []
    reason = method.available()
    if reason is not None:
        return rows, calls, f"not run: {reason}"
    note = ""
    settings = method.settings[1:6:2] if quick else method.settings
    for index, setting in enumerate(method.settings):
        if setting not in settings:
            continue
        try:
            timed = scene.head(min(method.cells, scene.cells))
            started = time.perf_counter()
            call = method.prepare(timed, setting)
            if not hasattr(method, "compile"):  # else it is compiled already
                call()
            first = time.perf_counter() - started
            small = method.prepare(part.head(min(method.cells, part.cells)), setting)
            answer = getattr(small, "answer", small)()
            wall, cpu = time.perf_counter(), time.process_time()
            call()
            once, spent = time.perf_counter() - wall, time.process_time() - cpu
        except NotForThisScene as why:
            return rows, calls, f"not for this scene: {why}"
        except Exception as error:  # a rival that breaks is a result, not the end of the run
            text = (str(error).splitlines() or [""])[0][:120]
            note = f"stopped with {type(error).__name__} at {setting:.0e}: {text}"
            continue
        found = errors.judge(part, true, answer)
        rows.append(
            {
                "method": method.name,
                "index": index,
                "setting": setting,
                "cells": timed.cells,
                "steps": float(np.mean(answer.steps)),
                "once": once,
                "spent": spent,
                "compile": np.nan if rows else max(first - once, 0.0),
                "state_error": found.state,
                "state_error_p90": found.state_p90,
                "velocity_error": found.velocity,
                "event_time_error": found.event_time,
                "wrong_events": found.wrong,
                "stopped": found.stopped,
            }
        )
        calls.append(call)
        if spent > PATIENCE and setting != settings[-1]:
            note = f"finer settings left out: {setting:.0e} took {spent:.0f} s"
            break
    return rows, calls, note


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
            "confirmed_time": ("scene", [t["confirmed_time"] for t in tables],
                {"units": "s", "long_name": "event time error of the second reference method"}),
            "confirmed_wrong": ("scene", [t["confirmed_wrong"] for t in tables],
                {"long_name": "cells in which the two references have other events"}),
            "horizon": ("scene", [t["horizon"] for t in tables],
                        {"units": "s", "long_name": "median time up to which cells are judged"}),
            "load_average": ("scene", [t["load"] for t in tables],
                     {"long_name": "load average of the machine when the scene was timed"}),
            "setting_name": ("solver", [r.setting_name for r in chosen]),
            "about": ("scene", [t["about"] for t in tables]),
        },
        coords={"scene": [t["scene"] for t in tables], "solver": [r.name for r in chosen]},
    )  # fmt: skip
