"""`wiperjax bench sweep`: what the command costs as users run it, beside the motion alone.

One sweep of cells of 0.1 s, at several sizes. The command runs in a process of its own, without a
compilation cache, and tells itself where its time goes (the attributes `..._time` of its map); what
it does not tell is its start: imports, files, the end. Beside it, in this process and compiled
before: the bare engine on the same cells (no samples, no statistics, no columns), and the scalar
loop given the sweep's own naming code.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import xarray as xr

from wiperjax.machine.provenance import PHASES
from wiperjax.maps.block import evaluate_block
from wiperjax.specs.load import parse_sweep

from ..harness import measure
from ..harness.keep import Parts
from ..rivals.engine import RTOL, Engine
from .maps import scalar_evaluate, scene_of
from .speed import PLAINEST

GRIDS = {  # cells -> attack angles, loads, speeds
    1_000: (10, 10, 10),
    10_000: (25, 20, 20),
    100_000: (50, 40, 50),
    1_000_000: (100, 100, 100),
}
RUN = {"transient": 0.05, "window": 0.05}  # s
SCALAR = 4096  # cells of the scalar loop: its cost does not hang on their number


def given(cells: int) -> dict:
    """Return the sweep of ``cells`` cells as its file says it."""
    angles, loads, speeds = GRIDS[cells]
    return {
        "axes": {
            "attack_angle": {"start": -40, "stop": 40, "num": angles},
            "normal_load": {"start": 5, "stop": 30, "num": loads},
            "belt_speed": {"start": 0.02, "stop": 1.0, "num": speeds, "spacing": "geometric"},
        },
        "run": RUN,
    }


def file_of(asked: dict) -> str:
    """Return a sweep as TOML: tables of numbers, texts, and tables of these."""

    def value(x):
        if isinstance(x, dict):
            return "{ " + ", ".join(f"{k} = {value(v)}" for k, v in x.items()) + " }"
        return json.dumps(x)

    lines = []
    for table, entries in asked.items():
        lines += [f"[{table}]", *(f"{k} = {value(v)}" for k, v in entries.items())]
    return "\n".join(lines) + "\n"


def command(cells: int) -> dict[str, float]:
    """Return what the command costs: wall and processor time [s], its own phases, its memory."""
    # nor the user's own, which the command would take and fill: later turns compiled nothing
    environment = os.environ | {"JAX_ENABLE_COMPILATION_CACHE": "false"}
    environment.pop("XLA_FLAGS", None)  # those of this process; the command sets its own
    with tempfile.TemporaryDirectory() as folder:
        file, output = Path(folder, "sweep.toml"), Path(folder, "map.h5")
        file.write_text(file_of(given(cells)), encoding="utf-8")
        words = [sys.executable, "-m", "wiperjax", "sweep", str(file), "-o", str(output)]
        before, started = measure.time_of_children(), time.perf_counter()
        done = subprocess.run(
            [*words, "--no-picture"], capture_output=True, text=True, env=environment, check=False
        )
        wall, after = time.perf_counter() - started, measure.time_of_children()
        if done.returncode:
            raise RuntimeError(f"wiperjax sweep failed: {done.stderr.strip()[-300:]}")
        with xr.open_dataset(output, engine="h5netcdf") as found:
            phases = {name: float(found.attrs[f"{name}_time"]) for name in PHASES}
            elapsed = float(found.attrs["elapsed_time"])
        size = output.stat().st_size
    told = sum(seconds for name, seconds in phases.items() if name != "idle")
    start = wall - min(told, elapsed)  # blocks overlap: their phases may be more than has passed
    return phases | {"wall": wall, "cpu": after - before, "start": start, "bytes": size}


def spent(call) -> tuple[float, float]:
    """Return wall and processor time [s] of one call."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def bare(cells: int, cores: int) -> dict[str, float]:
    """Return what the motion of the same cells costs alone."""
    spec = parse_sweep(given(cells), "bench sweep")
    call = Engine(*PLAINEST, cores=cores).prepare(scene_of(spec, np.arange(cells)), RTOL[PLAINEST])
    call.warm()
    wall, cpu = spent(call)
    return {"bare_wall": wall, "bare_cpu": cpu}


def scalar(cells: int) -> dict[str, float]:
    """Return what as many cells cost with the scalar loop and the same naming code."""
    spec = parse_sweep(given(cells), "bench sweep")
    some = np.random.default_rng(0).choice(cells, min(cells, SCALAR), replace=False)
    evaluate_block(spec, some[:64], scalar_evaluate)
    share = cells / len(some)
    wall, cpu = spent(lambda: evaluate_block(spec, np.sort(some), scalar_evaluate))
    return {"scalar_wall": wall * share, "scalar_cpu": cpu * share}


def run(output: Path, *, sizes: tuple[int, ...], repeats: int = 3, say=print) -> xr.Dataset:
    """Return the dataset over ``cells`` and ``repeat``; the three run one after the other, so that
    a slow machine, or a neighbour, falls on all alike. Finished turns are kept.
    """
    from wiperjax.machine import jax_settings

    cores = jax_settings.cores()
    parts = Parts(output, {"sizes": sizes, "run": RUN, "cores": cores})
    turns = {}
    for repeat in range(repeats):
        for cells in sizes:

            def measured(cells=cells) -> dict[str, float]:
                return command(cells) | bare(cells, cores) | scalar(cells)

            turns[repeat, cells] = found = parts.once(f"{cells}-{repeat}", measured, say)
            say(
                f"{cells} cells: {cells / found['wall']:.0f} a second with the command, "
                f"{cells / found['bare_wall']:.0f} with the bare engine, "
                f"{cells / found['scalar_wall']:.0f} with the scalar loop"
            )
    columns = {
        name: (
            ("cells", "repeat"),
            [[turns[repeat, cells][name] for repeat in range(repeats)] for cells in sizes],
            {"units": "byte" if name == "bytes" else "s"},
        )
        for name in turns[0, sizes[0]]
    }
    dataset = xr.Dataset(
        columns,
        coords={"cells": list(sizes), "repeat": range(repeats)},
        attrs=measure.attributes(
            "a sweep from the command line, the bare engine, and the scalar loop"
        )
        | {
            "motion": RUN["transient"] + RUN["window"],
            "cores": cores,
            "load": measure.load(),
        },
    )
    dataset.to_netcdf(output, engine="h5netcdf")
    parts.clear()
    return dataset
