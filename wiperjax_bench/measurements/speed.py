"""`wiperjax bench speed`: trajectories per second of the engine and its peers, and what they cost.

The workload is `families.workload`: 0.1 s each, events and statistics on. Accuracy of every row is
that of its states and events at 20 ms, against the reference. Three parts: all methods in
interleaved repeats, cost over the size of the batch, and what only fresh processes can tell. A
finished part is kept in `<output>.parts/`, so a run that was stopped goes on where it was.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import diffrax
import numpy as np
import xarray as xr

from wiperjax.machine.cores import available

from ..harness import measure
from ..harness.alone import Alone
from ..harness.keep import Parts
from ..rivals.compiled import Compiled, prepared
from ..rivals.diffrax_phases import PerPhase
from ..rivals.engine import RTOL, Engine
from ..rivals.heyoka_phases import Taylor
from ..rivals.scipy_phases import Phases
from ..scenes import families
from . import errors, fresh

RTOLS = (1e-5, 1e-6, 1e-7, 1e-8)  # of the peers: their cost is read off at the engine's error
ACCURACY = 0.02  # s, at which accuracy is judged
PATIENCE = 2.0  # s: the trajectories of a peer are cut so that one call takes no longer
FEWEST = 32  # trajectories of a peer, however slow it is
PLAINEST = (diffrax.Tsit5, "float64")
SIZES = (10_000, 100_000, 1_000_000)


class Numba(Compiled):
    """The scalar loop with statistics and without an event log, as the engine is run."""

    def prepare(self, scene, setting):
        call = prepared(scene, setting, self.threads, mark=0.0)
        call.answer = super().prepare(scene, setting).answer  # type: ignore[attr-defined]
        return call


def peers(cores: int) -> list:
    """Return (method, cores it uses) of the rows of the table."""
    rows: list = [(Engine(*variant), 1) for variant in RTOL]
    rows += [(Numba("numba scalar loop", 1), 1)]
    if cores > 1:
        rows += [(Engine(*variant, cores=cores), cores) for variant in RTOL]
        rows += [(Numba(f"numba scalar loop, {cores} cores", None), cores)]
    rivals: list = [PerPhase(True, solver, cells=256) for solver in (diffrax.Tsit5, diffrax.Dopri8)]
    rivals += [PerPhase(mapped=False), Phases("RK45"), Taylor()]
    return [*rows, *((rival, 1) for rival in rivals)]


def run(
    output: Path,
    *,
    quick: bool = False,
    trajectories: int = 50_000,
    repeats: int = 3,
    sizes: tuple[int, ...] = SIZES,
    say=print,
) -> xr.Dataset:
    """Return the table of speeds, written to ``output``.

    ``trajectories``: of the engine; the peers get as many as `PATIENCE` allows. ``sizes``: batches
    whose cost per trajectory is compared.
    """
    cores = available()
    duration = ACCURACY if quick else 0.1
    if quick:
        trajectories, repeats, sizes = 1024, 2, (1024 * cores,)  # one program serves all
    parts = Parts(output, {"quick": quick, "trajectories": trajectories, "repeats": repeats,
                           "sizes": sizes, "cores": cores})  # fmt: skip
    rows = parts.once("rows", lambda: compare(cores, duration, trajectories, repeats, quick, say))
    facts = parts.once("sizes", lambda: scaling(cores, ACCURACY, sizes, min(repeats, 2), say))
    facts |= parts.once("fresh", lambda: fresh_processes(quick, say))
    dataset = table(rows)
    dataset.attrs |= measure.attributes("trajectories per second") | {
        "load": measure.load(),
        "duration": duration,
        "duration_sizes": ACCURACY,
        "repeats": repeats,
        **facts,
    }
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset


def compare(cores: int, duration: float, trajectories: int, repeats: int, quick: bool, say):
    """Return the rows of the table: every method, timed in turns, with its errors."""
    judged = families.workload(16 if quick else 512, ACCURACY)
    true = errors.truth(judged)
    rows, calls = [], []
    for method, used in peers(cores):
        reason = method.available()
        if reason is not None:
            say(f"{method.name}: not run, {reason}")
            continue
        ours = isinstance(method, Engine)
        if quick and ("diffrax" in method.name or (ours and method.variant != PLAINEST)):
            continue
        enough = max(method.cells, FEWEST)
        cells = min(trajectories, enough)
        if not ours and method.cells > 64:
            cells = affordable(method, duration, trajectories)
        scene = families.workload(cells * (used if quick and ours else 1), duration)
        for rtol in (RTOL[method.variant],) if ours else RTOLS[1:2] if quick else RTOLS:
            try:
                if ours and used == 1 < cores:
                    make = partial(engine_call, method.variant, scene.cells, duration, rtol)
                    call: Any = Alone(make, effort)
                else:
                    call = method.prepare(scene, rtol)
                started = time.perf_counter()
                getattr(call, "warm", call)()
                compiled = time.perf_counter() - started
                small = method.prepare(judged.head(min(enough, judged.cells)), rtol)
                answer: Any = getattr(small, "answer", small)()
            except Exception as error:  # a rival that breaks is a result, not the end of the run
                if ours:
                    raise
                say(f"{method.name} rtol {rtol:g}: stopped with {type(error).__name__}")
                continue
            found = errors.judge(judged, true, answer)
            rows.append(
                {
                    "method": method.name,
                    "cores": used,
                    "rtol": rtol,
                    "cells": scene.cells,
                    "first_call": compiled,
                    "state_error": found.state,
                    "state_error_p90": found.state_p90,
                    "event_time_error": found.event_time,
                    "wrong_events": found.wrong,
                    "stopped": found.stopped,
                    "occupancy": np.nan,
                }
            )
            calls.append(Remembering(call))
            say(f"{method.name} rtol {rtol:g}: {cells} trajectories, ready in {compiled:.1f} s")
    say(f"timing, {repeats} turns")
    costs = measure.interleaved(calls, repeats)
    for row, call, cost in zip(rows, calls, costs, strict=True):
        row |= per_trajectory(cost, row["cells"])
        if row["method"].startswith("engine"):
            row |= call.result if isinstance(call.result, dict) else effort(call.result)
        say(f"  {row['method']} rtol {row['rtol']:g}: {row['per_second']:.4g} trajectories/s")
    return rows


class Remembering:
    """A call that keeps its last result."""

    def __init__(self, call: Callable):
        self.call, self.result = call, None

    def __call__(self):
        self.result = self.call()

    @property
    def elsewhere(self) -> float:
        return getattr(self.call, "elsewhere", 0.0)


def engine_call(variant: tuple, cells: int, duration: float, rtol: float):
    """Return the engine's call on one core."""
    return Engine(*variant).prepare(families.workload(cells, duration), rtol)


def per_trajectory(cost: measure.Cost, cells: int) -> dict[str, float]:
    """Return the columns of a cost."""
    return {
        "wall": cost.wall / cells,
        "wall_low": cost.low / cells,
        "wall_high": cost.high / cells,
        "cpu": cost.cpu / cells,
        "per_second": cells / cost.wall,
    }


def effort(found) -> dict[str, float]:
    """Return occupancy, steps, events and failures of what `Engine` computed."""
    useful, executed = np.sum([effort for _, effort in found], axis=0)
    codes = np.concatenate([np.asarray(o.result) for o, _ in found])
    return {
        "occupancy": float(useful / max(executed, 1)),
        "events": float(np.mean([np.mean(o.events) for o, _ in found])),
        "steps": float(np.mean([np.mean(o.steps) for o, _ in found])),
        "failed": float(np.mean(codes > 1)),
    }


def affordable(method, duration: float, most: int) -> int:
    """Return how many trajectories one call of ``method`` takes in about `PATIENCE` seconds."""
    pilot = min(256, most)
    call = method.prepare(families.workload(pilot, duration), 1e-6)
    call()
    started = time.perf_counter()
    call()
    each = (time.perf_counter() - started) / pilot
    return int(min(most, max(pilot, PATIENCE / each)))


def scaling(cores: int, duration: float, sizes: tuple[int, ...], repeats: int, say) -> dict:
    """Return wall time per trajectory and occupancy of the engine over the size of its batch."""
    if not sizes:
        return {}
    method = Engine(*PLAINEST, cores=cores)
    calls = [
        Remembering(method.prepare(families.workload(cells, duration), RTOL[PLAINEST]))
        for cells in sizes
    ]
    for call in calls:
        call.call.warm()
    facts = {}
    say("cost per trajectory over the size of the batch")
    costs = measure.interleaved(calls, repeats, patience=30)  # the million is timed once
    for cells, call, cost in zip(sizes, calls, costs, strict=True):
        facts[f"wall_{cells}"] = cost.wall / cells
        facts[f"wall_low_{cells}"], facts[f"wall_high_{cells}"] = (
            cost.low / cells,
            cost.high / cells,
        )
        facts[f"occupancy_{cells}"] = effort(call.result)["occupancy"]
        say(f"  {cells}: {cost.wall / cells * 1e6:.1f} us")
    return facts


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
    command = [sys.executable, "-m", fresh.__name__, what]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[1:])} failed: {done.stderr.strip()[-300:]}")
    return json.loads(done.stdout.splitlines()[-1])
