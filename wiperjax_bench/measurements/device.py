"""`wiperjax bench speed --device gpu`: the engine alone, on one device of jax's.

The workload of `bench speed` (`families.workload`, 0.1 s each) in batches that grow, for an
accelerator is busy only with many lanes. Whether its events are right is judged as there: at 20 ms,
against the scalar loop at rtol 1e-12 on this machine's processor.
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr

from wiperjax.maps.cells.devices import lane_count

from ..harness import measure
from ..rivals.engine import RTOL, Engine
from ..scenes import families
from . import errors
from .speed import ACCURACY, PLAINEST, Remembering, effort, per_trajectory

KINDS = ("cpu", "gpu")
SIZES = (2**17, 2**20)


def found(kind: str) -> str:
    """Return the name of the device of a ``kind`` of `KINDS` that jax computes on.

    Raises ValueError if it computes on another.
    """
    if kind not in KINDS:
        raise ValueError(f"device must be {' or '.join(KINDS)}, but was {kind!r}")
    backend = jax.default_backend()
    if backend != kind:
        ask = "install jax with its plugin for one" if kind == "gpu" else "set JAX_PLATFORMS=cpu"
        raise ValueError(f"device must be one that jax has: it computes on {backend}; {ask}")
    return jax.devices()[0].device_kind


def run(output: Path, kind: str, *, quick: bool = False, repeats: int = 3, say=print) -> xr.Dataset:
    """Return rates over the size of the batch, in every variant of `RTOL`, written to ``output``.

    Raises ValueError as `found` does.
    """
    name = found(kind)
    duration, sizes = (ACCURACY, (1024,)) if quick else (0.1, SIZES)
    judged = families.workload(16 if quick else 512, ACCURACY)
    true = errors.truth(judged)
    variants: list[tuple[type, str]] = [PLAINEST] if quick else list(RTOL)
    methods = {variant: Engine(*variant) for variant in variants}
    cases = [(variant, cells) for variant in variants for cells in sizes]

    def made(case):
        """Return (call, seconds) of a batch whose program is compiled, beside the others."""
        variant, cells = case
        call = methods[variant].prepare(families.workload(cells, duration), RTOL[variant])
        started = time.perf_counter()
        call.warm()
        say(f"{methods[variant].name}, {cells} trajectories: ready")
        return call, time.perf_counter() - started

    def judge(variant):
        return errors.judge(judged, true, methods[variant].prepare(judged, RTOL[variant]).answer())

    with ThreadPoolExecutor(os.cpu_count()) as pool:  # first calls, all at once
        judgements = pool.map(judge, variants)
        ready = list(pool.map(made, cases))
        right = dict(zip(variants, judgements, strict=True))
    calls: list[Any] = [Remembering(call) for call, _ in ready]
    rows: list[dict[str, Any]] = [
        {
            "method": methods[variant].name,
            "rtol": RTOL[variant],
            "cells": cells,
            "lanes": lane_count(variant[1], cells),
            "first_call": seconds,
            "state_error": right[variant].state,
            "event_time_error": right[variant].event_time,
            "wrong_events": right[variant].wrong,
        }
        for (variant, cells), (_, seconds) in zip(cases, ready, strict=True)
    ]
    costs = measure.interleaved(calls, repeats)
    for row, call, cost in zip(rows, calls, costs, strict=True):
        row |= per_trajectory(cost, row["cells"]) | effort(call.result)
        turns = sum(float(work.executed) for _, work in call.result) / row["lanes"]
        row["turn"] = cost.wall / turns  # s
    memory = jax.devices()[0].memory_stats() or {}  # none of the host's processor
    dataset = xr.Dataset(
        {key: ("row", [row[key] for row in rows]) for key in rows[0] if key != "method"},
        coords={"method": ("row", [row["method"] for row in rows])},
        attrs=measure.attributes("trajectories per second on one device")
        | {
            "device": name,
            "duration": duration,
            "repeats": repeats,
            "peak_bytes": float(memory.get("peak_bytes_in_use", np.nan)),
        },
    )
    dataset.to_netcdf(output, engine="h5netcdf")
    return dataset
