"""What a sweep will take, before its first cell: bytes that are certain, and time that is a guess.

Bytes follow from the columns that a cell has. Time depends on what the lip does there, which is
what the sweep is to find out: the guess is that of the reference map, and says so.
"""

import errno
import itertools
import os
import shutil
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from ..machine.files import StoreError
from ..machine.memory import installed
from ..vocabulary.codes import LABELS
from ..vocabulary.columns import OF_A_WIPER, column_of, differentiable, sensitivity_name
from ..vocabulary.kinds import STEADY_KINDS, WIPER
from ..vocabulary.schema import OF_DERIVATIVES, SCHEMA, SEVERAL_STARTS, Column

RATE = 150.0  # s of motion a second and core: the reference map at rtol 1e-6 (AMD EPYC, avx512)
COMPILATION, COMPILATION_OF_DERIVATIVES = 15.0, 45.0  # s, without derivatives and with them
HEADER = 5000  # bytes of a column in a map beside its numbers: its meaning, the list of its chunks
REVERSING = ("reversal", "stroke", "tone_")  # in the names of what only a belt that reverses has
OF_A_SYSTEM = ("final_position", "final_velocity")  # of one's own


def columns(spec: Any) -> Iterator[Column]:
    """Columns of the schema that the cells of a sweep have."""
    absent: set[str] = set(OF_A_SYSTEM if spec.system == WIPER else OF_A_WIPER)
    if spec.belt_kind is None:
        absent.add("belt_speed_rms")
    if not spec.family.has_stops:
        absent.add("blow_count")
    turns = spec.belt_kind not in STEADY_KINDS
    if turns:
        absent.add("noise_period")
    for name, entry in SCHEMA.items():
        if name in absent:
            has = False
        elif entry.along == "raster_time":
            has = spec.run.raster is not None
        elif name in SEVERAL_STARTS:
            has = spec.starts is not None and (spec.starts.random or not entry.along)
        elif name.startswith("event_") or entry.along == "event":
            has = spec.run.event_log is not None
        elif name in OF_DERIVATIVES:
            has = spec.sensitivities is not None
        else:
            has = turns or not any(word in name for word in REVERSING)
        if has:
            yield entry
    if spec.sensitivities is not None:
        outcomes = differentiable(spec.system == WIPER, spec.belt_kind)
        for outcome, parameter in itertools.product(outcomes, spec.sensitivities.parameters):
            yield column_of(sensitivity_name(outcome, parameter))


def bytes_of_a_cell(spec: Any) -> tuple[int, int]:
    """Bytes of the numbers of one cell: those kept as they are, and those of its raster and event
    log, which are packed.
    """
    lengths = {"": 1, "raster_time": spec.run.raster or 0, "event": spec.run.event_log or 0}
    lengths |= {"class": len(LABELS), "coordinate": len(spec.family.coordinates)}
    starts = spec.starts.count if spec.starts else 1
    plain = packed = 0
    for entry in columns(spec):
        size = lengths[entry.along] * np.dtype(entry.dtype).itemsize
        size *= starts if entry.each_start else 1
        plain, packed = (plain, packed + size) if entry.along else (plain + size, packed)
    return plain, packed


def seconds(spec: Any, cores: int) -> float:
    """Time [s] of a sweep on some cores, if its cells are like those of the reference map."""
    motion = spec.motion * (spec.starts.count if spec.starts else 1)
    if spec.sensitivities is None:
        return COMPILATION + motion / (RATE * cores)
    tangents = 1 + len(spec.sensitivities.parameters)
    return COMPILATION_OF_DERIVATIVES + motion * tangents / (RATE * cores)


def words(spec: Any, cores: int) -> str:
    """Cells, time and bytes of a sweep in one line."""
    time = spec.run.transient + spec.run.window
    plain, packed = bytes_of_a_cell(spec)
    headers = HEADER * sum(1 for _ in columns(spec))
    size = _bytes(headers + spec.size * plain)
    if packed:
        size += f" to {_bytes(headers + spec.size * (plain + packed))}"
    starts = f" from {spec.starts.count} starts" if spec.starts else ""
    where = f"{cores} core{'s' if cores > 1 else ''}"
    if spec.system != WIPER:
        return f"{spec.size} of {time:g} s{starts}, {size}, on {where}"
    guess = f"about {_duration(seconds(spec, cores))} on {where}"
    return (
        f"{spec.size} of {time:g} s{starts}, {size}, {guess} "
        "(a guess from the reference map: a third to ten times that)"
    )


def check_room(spec: Any, output: Path, done: int = 0) -> None:
    """Raises `StoreError` if the disk that `output` is for cannot hold the blocks of a sweep.

    Arguments:
        done: cells that are there already.
    """
    least = (spec.size - done) * bytes_of_a_cell(spec)[0]
    free = shutil.disk_usage(output.parent).free
    if least > free:
        raise StoreError(
            f"{output}: cannot be written: {os.strerror(errno.ENOSPC)}: {_bytes(least)} are needed "
            f"at least until it is finished, but {_bytes(free)} are free"
        )


def check_memory(spec: Any) -> None:
    """Raises `StoreError` if this machine's memory cannot hold a map that is kept in it."""
    least = spec.size * sum(bytes_of_a_cell(spec))
    there = installed()
    if least > there:
        raise StoreError(
            f"output must name a file, but was None: the {_bytes(least)} of this sweep do not fit "
            f"into the {_bytes(there)} of memory here"
        )


def _bytes(count: float) -> str:
    """Bytes in words."""
    for unit in ("kB", "MB", "GB"):
        count /= 1000
        if count < 1000:
            return f"{count:.3g} {unit}"
    return f"{count / 1000:,.3g} TB"


def _duration(time: float) -> str:
    """Seconds in words."""
    if time < 90:
        return f"{time:.0f} s"
    if time < 5400:
        return f"{time / 60:.0f} minutes"
    if time < 48 * 3600:
        return f"{time / 3600:.1f} hours"
    return f"{timedelta(seconds=time).days:,} days"
