"""How a file came to be: command, date, kind of machine, versions; no name of the host."""

import importlib.metadata
import os
import platform
import sys
from datetime import UTC, datetime
from functools import cache
from typing import Any

from .phases import Account

PHASES = ("engine", "compiling", "naming", "storing", "idle")
"""What the time of a sweep is told of, each as an attribute `<name>_time` [s]. All but `idle`, the
share of the cores that had nothing to do, exclude each other within a block; blocks overlap.
"""

TOLD = (*PHASES, "elapsed")

RUN_ATTRIBUTES = (
    "command",
    "date_created",
    "host",
    "wall_time",
    *(f"{name}_time" for name in TOLD),
)
"""Attributes that say how a map came to be; two runs of one sweep agree in everything else, bit for
bit.
"""

VECTORS = {"avx512f": 512, "avx2": 256, "asimd": 128, "sse2": 128}  # flag -> bits, widest first

LIBRARIES = (
    *("wiperjax", "jax", "jaxlib", "diffrax", "equinox", "optimistix"),
    *("numpy", "scipy", "xarray", "h5py", "h5netcdf"),
)


def record(command: str | None, wall_time: float, host: str | None = None) -> dict[str, Any]:
    """Values of `RUN_ATTRIBUTES` but `phase_times`; `wall_time` in seconds, of a map summed over
    blocks.
    """
    return {
        "command": command or "",
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": host or host_kind(),
        "wall_time": float(wall_time),
    }


def phase_times(spent: Account) -> dict[str, float]:
    """Attributes that say what the time went into so far, by `PHASES`, and how much has passed."""
    seconds = spent.seconds() | {"idle": spent.idle(), "elapsed": spent.elapsed()}
    return {f"{name}_time": float(seconds.get(name, 0.0)) for name in TOLD}


def maker() -> dict[str, str]:
    """Attributes of every dataset that wiperjax makes: who made it, and by which conventions."""
    return {"Conventions": "CF-1.11", "source": f"wiperjax {version('wiperjax')}"}


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries a map rests on, without importing any."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


@cache
def version(library: str) -> str:
    """Installed version of a library, else `none`; of wiperjax, also in a mere checkout."""
    if library == "wiperjax" and (own := getattr(sys.modules.get(library), "__version__", None)):
        return str(own)
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return "none"


def host_kind() -> str:
    """Kind of machine (processor, its vectors, cores, system), not its name."""
    name = _cpuinfo("model name") or platform.processor() or platform.machine()
    told = [f"{key} {_cpuinfo(key)}" for key in ("cpu family", "model") if _cpuinfo(key)]
    told += [f"vectors of {bits} bits" for bits in (vector_bits(),) if bits]
    about = f" ({', '.join(told)})" if told else ""
    return f"{name}{about}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def vector_bits() -> int:
    """Width of the vectors that this processor computes with, 0 where it is not known."""
    flags = _cpuinfo("flags").split()
    return next((bits for flag, bits in VECTORS.items() if flag in flags), 0)


def processor() -> str:
    """What decides which instructions a compiled program may have."""
    known = (platform.machine(), _cpuinfo("model name"), _cpuinfo("flags"), version("jaxlib"))
    return "; ".join(known)


def _cpuinfo(key: str) -> str:
    """A line of Linux' description of the first processor; empty where there is none."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            pairs = (line.partition(":") for line in lines)
            return next((said.strip() for name, _, said in pairs if name.strip() == key), "")
    except OSError:
        return ""
