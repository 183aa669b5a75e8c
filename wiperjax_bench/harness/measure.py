"""Timing: interleaved repeats, medians with their spread, wall and processor time."""

import contextlib
import json
import os
import platform
import re
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil

import wiperjax
from wiperjax.machine import provenance

LIBRARIES = (
    "wiperjax",
    "jax",
    "jaxlib",
    "diffrax",
    "equinox",
    "optimistix",
    "numba",
    "scipy",
    "numpy",
)


class Cost(NamedTuple):
    """Seconds of one call: median, 10th and 90th percentile of the wall time, median CPU time."""

    wall: float
    low: float
    high: float
    cpu: float
    repeats: int


def interleaved(
    calls: Sequence[Callable],
    repeats: int,
    patience: float = np.inf,
    before: Sequence[tuple[float, float]] | None = None,
) -> list[Cost]:
    """Return the cost of each call: every one once, then every one again, ``repeats`` times.

    A slow machine, or a neighbour, then falls on all alike. Processor time that a call spends in
    another process is its ``elsewhere`` [s]. Calls that took longer than ``patience`` [s] are not
    repeated. ``before``: wall and processor time of each call's first turn, if that is over.
    """
    wall = [[w] for w, _ in before] if before else [[] for _ in calls]
    cpu = [[c] for _, c in before] if before else [[] for _ in calls]
    for turn in range(1 if before else 0, repeats):
        for i, call in enumerate(calls):
            if turn and wall[i][0] > patience:
                continue
            cpu_start, start = time.process_time(), time.perf_counter()
            call()
            wall[i].append(time.perf_counter() - start)
            spent = time.process_time() - cpu_start
            cpu[i].append(spent + getattr(call, "elsewhere", 0.0))
    return [
        Cost(
            float(np.median(w)),
            float(np.quantile(w, 0.1)),
            float(np.quantile(w, 0.9)),
            float(np.median(c)),
            len(w),
        )
        for w, c in zip(wall, cpu, strict=True)
    ]


def attributes(title: str) -> dict[str, str]:
    """Return the attributes that every dataset has: what it is, where, when and with what made."""
    return {
        "title": title,
        "machine": machine(),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": json.dumps(versions(), sort_keys=True),
    }


def versions() -> dict[str, str]:
    """Return the versions of everything that has a part in the numbers, and the commit if known."""
    found = {"python": platform.python_version()}
    found |= {name: provenance.version(name) for name in LIBRARIES}
    here = Path(wiperjax.__file__).parent
    ask = ["git", "-C", str(here), "describe", "--always", "--dirty", "--exclude", "*"]
    with contextlib.suppress(OSError, subprocess.CalledProcessError):  # no git, or no checkout
        done = subprocess.run(ask, capture_output=True, text=True, check=True)
        found["commit"] = done.stdout.strip()
    return found


def machine() -> str:
    """Return the kind of processor, its vectors and cores; no name of the host."""
    limit = re.search(r"xla_cpu_max_isa=(\w+)", os.environ.get("XLA_FLAGS", ""))
    return provenance.host_kind() + (f", code limited to {limit[1]}" if limit else "")


def load() -> float:
    """Return the load average of the last minute: how far the timings may be trusted."""
    return psutil.getloadavg()[0]


def time_of_children() -> float:
    """Return the processor time of all child processes that have ended [s]; 0 on Windows, which
    does not tell it.
    """
    spent = os.times()
    return spent.children_user + spent.children_system
