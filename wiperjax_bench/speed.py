"""`wiperjax bench speed`: trajectories per second of the engine and its peers, and what they cost.

The workload is `scenes.workload`: 0.1 s each, events and statistics on. Accuracy of every row is
that of its states and events at 20 ms, against the reference.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import diffrax
import numpy as np
import xarray as xr

from . import errors, measure, scenes
from .rivals.compiled import Compiled
from .rivals.diffrax_phases import PerPhase
from .rivals.engine import Engine
from .rivals.scipy_phases import Phases

RTOLS = (1e-5, 1e-6, 1e-7)
ACCURACY = 0.02  # s, at which accuracy is judged
PATIENCE = 20.0  # s: the number of trajectories is cut so that one call takes no longer


class Numba(Compiled):
    """The scalar loop with statistics and without an event log, as the engine is run."""

    def prepare(self, scene, setting):
        from .rivals.compiled import prepared

        call = prepared(scene, setting, self.threads, mark=0.0)
        call.answer = super().prepare(scene, setting).answer  # type: ignore[attr-defined]
        return call


def peers(cores: int) -> list:
    """Return (method, cores it uses) of the rows of the table."""
    f64, f32 = Engine(diffrax.Tsit5), Engine(diffrax.Tsit5, "float32")
    rows = [(f64, 1), (f32, 1), (Numba("numba scalar loop", 1), 1)]
    if cores > 1:
        rows += [
            (Engine(diffrax.Tsit5, "float64", cores), cores),
            (Engine(diffrax.Tsit5, "float32", cores), cores),
            (Numba(f"numba scalar loop, {cores} cores", None), cores),
        ]
    return [*rows, (PerPhase(mapped=True), 1), (PerPhase(mapped=False), 1), (Phases("RK45"), 1)]


def run(
    output: Path,
    *,
    quick: bool = False,
    trajectories: int = 100_000,
    repeats: int = 3,
    scaling: tuple[int, ...] = (),
    say=print,
) -> xr.Dataset:
    """Return the table of speeds, written to ``output``.

    ``trajectories``: of the engine and of numba, at most; ``scaling``: batch sizes whose cost per
    trajectory is compared (say 10_000, 100_000, 1_000_000).
    """
    cores = len(os.sched_getaffinity(0))
    duration = 0.02 if quick else 0.1
    if quick:
        trajectories, repeats = 512, 2
    judged = scenes.workload(32 if quick else 512, ACCURACY)
    true = errors.truth(judged)
    rows, calls, facts = [], [], {}
    for method, used in peers(cores):
        reason = method.available()
        if reason is not None:
            say(f"{method.name}: not run, {reason}")
            continue
        if quick and ("diffrax" in method.name or "float32" in method.name):
            continue
        cells = size(method, duration, trajectories)
        scene = scenes.workload(cells, duration)
        for rtol in (1e-6,) if quick or cells < 100 else RTOLS:
            if "float32" in method.name and rtol < 1e-6:
                continue
            call = method.prepare(scene, rtol)
            started = time.perf_counter()
            first = call()
            compiled = time.perf_counter() - started
            small = judged.head(min(method.cells, judged.cells))
            made = method.prepare(small, rtol)
            answer: Any = getattr(made, "answer", made)()
            found = errors.judge(judged, true, answer)
            row = {
                "method": method.name,
                "cores": used,
                "rtol": rtol,
                "cells": cells,
                "first_call": compiled,
                "state_error": found.state,
                "state_error_p90": found.state_p90,
                "wrong_events": found.wrong,
                "stopped": found.stopped,
                "occupancy": np.nan,
            }
            if isinstance(method, Engine):
                useful, executed = np.sum([effort for _, effort in first], axis=0)
                row["occupancy"] = float(useful / executed)
                row["events"] = float(np.mean([np.mean(o.events) for o, _ in first]))
                row["steps"] = float(np.mean([np.mean(o.steps) for o, _ in first]))
                codes = np.concatenate([np.asarray(o.result) for o, _ in first])
                row["failed"] = float(np.mean(codes > 1))
            rows.append(row)
            calls.append(call)
            say(f"{method.name} rtol {rtol:g}: {cells} trajectories, {compiled:.1f} s at first")
    costs = measure.interleaved(calls, repeats, patience=2 * PATIENCE)
    for row, cost in zip(rows, costs, strict=True):
        row["wall"], row["cpu"] = cost.wall / row["cells"], cost.cpu / row["cells"]
        row["wall_low"], row["wall_high"] = cost.low / row["cells"], cost.high / row["cells"]
        row["per_second"] = 1 / row["wall"]
    for cells in scaling:
        method = Engine(diffrax.Tsit5, "float64", cores)
        call = method.prepare(scenes.workload(cells, duration), 1e-6)
        if not facts:  # one compilation a size
            say("cost per trajectory over the size of the batch")
        call()
        (cost,) = measure.interleaved([call], 1)
        facts[f"wall_{cells}"] = cost.wall / cells
        say(f"  {cells}: {cost.wall / cells * 1e6:.1f} us")
    facts |= fresh_processes(quick, say)
    dataset = table(rows)
    dataset.attrs |= {
        "title": "trajectories per second",
        "machine": measure.machine(),
        "load": measure.load(),
        "versions": json.dumps(measure.versions(), sort_keys=True),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "duration": duration,
        "repeats": repeats,
        **facts,
    }
    dataset.to_netcdf(output, engine="h5netcdf")
    return dataset


def size(method, duration: float, most: int) -> int:
    """Return how many trajectories one call of ``method`` takes in about `PATIENCE` seconds."""
    if method.cells <= 64:
        return method.cells if method.cells > 3 else 16
    pilot = 256
    call = method.prepare(scenes.workload(pilot, duration), 1e-6)
    call()
    started = time.perf_counter()
    call()
    each = (time.perf_counter() - started) / pilot
    cells = int(min(most, max(pilot, PATIENCE / each)))
    cores = getattr(method, "cores", 1)
    return cells // (64 * cores) * 64 * cores if cells >= 64 * cores else cells


def table(rows: list[dict]) -> xr.Dataset:
    """Return the rows as a dataset over ``row``."""
    names = [n for n in dict.fromkeys(k for row in rows for k in row) if n != "method"]
    columns = {n: ("row", [float(row.get(n, np.nan)) for row in rows]) for n in names}
    return xr.Dataset(columns, coords={"method": ("row", [row["method"] for row in rows])})


def fresh_processes(quick: bool, say) -> dict[str, float]:
    """Return start-up costs of a sweep and memory, each measured in a process of its own."""
    found = {}
    with tempfile.TemporaryDirectory() as cache:
        for name in ("cold", "cached"):
            found |= {f"{k}_{name}": v for k, v in _fresh("compile", cache).items()}
            say(
                f"{name}: {found[f'compile_{name}']:.1f} s until the first block of a sweep is done"
            )
    if not quick:
        found |= _fresh("memory", None)
        say(f"memory of 1e6 trajectories: {found['memory_gib']:.2f} GiB")
    return found


def _fresh(what: str, cache: str | None) -> dict[str, float]:
    environment = dict(os.environ)
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    if cache is not None:
        environment["JAX_COMPILATION_CACHE_DIR"] = cache
        environment["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    command = [sys.executable, "-m", "wiperjax_bench.fresh", what]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[1:])} failed: {done.stderr.strip()[-300:]}")
    return json.loads(done.stdout.splitlines()[-1])


def text(dataset: xr.Dataset) -> str:
    """Return the table as Markdown, with ratios at equal error against numba on as many cores."""
    from .compare import cost_at

    attrs = dataset.attrs
    lines = [
        "# Speed",
        "",
        f"{attrs['duration']} s of motion each, {attrs['machine']}, load average "
        f"{attrs['load']:.1f}, {attrs['created']}; medians of {attrs['repeats']} interleaved "
        "repeats; errors at 20 ms (median position error over the lip's length).",
        "",
        "| method | cores | rtol | trajectories/s (10-90 %) | CPU us each | error | wrong events |"
        " occupancy |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for i in range(dataset.sizes["row"]):
        r = dataset.isel(row=i)
        occupancy = "" if np.isnan(r.occupancy) else f"{float(r.occupancy):.2f}"
        lines.append(
            f"| {r.method.item()} | {int(r.cores)} | {float(r.rtol):.0e} | "
            f"{float(r.per_second):.4g} ({1 / float(r.wall_high):.4g}-{1 / float(r.wall_low):.4g})"
            f" | {float(r.cpu) * 1e6:.4g} | {float(r.state_error):.1e} | "
            f"{float(r.wrong_events):.2%} | {occupancy} |"
        )

    def curve(name):
        part = dataset.where(dataset.method == name, drop=True).sortby("state_error")
        return part.state_error.values[::-1], part.wall.values[::-1]

    names = list(dict.fromkeys(dataset.method.values))
    lines += ["", "At the error of the engine's row with rtol 1e-6, per trajectory:", ""]
    for ours in (n for n in names if n.startswith("engine")):
        mine = dataset.where((dataset.method == ours) & (dataset.rtol == 1e-6), drop=True)
        target, cores = float(mine.state_error[0]), int(mine.cores[0])
        for name in names:
            theirs = dataset.where(dataset.method == name, drop=True)
            if name.startswith("engine") or int(theirs.cores[0]) not in (1, cores):
                continue
            if "numba" in name and int(theirs.cores[0]) != cores:
                continue
            error, cost = curve(name)
            at = cost_at(error, cost, target)
            how = ""
            if np.isnan(at):  # its own finest row: it is less accurate there
                at, how = float(cost[-1]), f" (it reaches {error[-1]:.0e} only)"
            lines.append(f"- {ours} against {name}: {at / float(mine.wall[0]):.3g} x{how}")
    lines.append("")
    sizes = {k: v for k, v in attrs.items() if k.startswith("wall_")}
    if sizes:
        each = ", ".join(f"{k[5:]}: {v * 1e6:.1f} us" for k, v in sizes.items())
        lines.append(f"Cost per trajectory over the batch's size: {each}.")
    lines.append(
        f"A sweep's first block: {attrs['compile_cold']:.1f} s in a fresh process, "
        f"{attrs['compile_cached']:.1f} s in the next one with the persistent cache."
    )
    if "memory_gib" in attrs:
        lines.append(f"Memory with 1e6 trajectories in one batch: {attrs['memory_gib']:.2f} GiB.")
    return "\n".join([*lines, ""])
