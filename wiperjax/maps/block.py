"""One block of a sweep, whoever computes it: cells in, stored columns out.

    cell numbers -> engine (`cells.evaluate`) -> dominant frequency -> class -> block

jax comes in only with `cells`, and only when no other `evaluate` is given.
"""

import platform
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..datasets import map_dataset
from ..machine import provenance
from ..noise import classes
from ..noise.signals import signal_columns, untold
from ..vocabulary import codes, schema
from ..vocabulary.codes import RESULTS
from ..vocabulary.ranges import MOST_SAMPLES

MOST_CELLS = 2**15  # in a block: enough to keep every lane of many cores busy
BLOCK_TIME = 2**13  # s of motion in a block: half a minute on two cores, so that little can be lost
FEWEST_CELLS = 256
SHARES = 4  # blocks for each of several workers, at least: they end at about the same time,
SHARED_CELLS = 1024  # unless blocks would have fewer cells than this
BLOCK_BYTES = 2**27  # of samples and event logs
FINER = (2, 16)  # times as many samples, for cells whose frequency the first do not tell
ANALYSED = 2**22  # samples at once

Evaluate = Callable[..., Mapping[str, Any]]  # (spec, cells) and, of samples, (finer, room)

DECISIVE = ("wiperjax", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")
"""Libraries whose version has a part in the numbers; it must not change within a map."""


class Block(NamedTuple):
    """A computed block: its number, stored columns, the engine's occupancy, seconds it took."""

    number: int
    columns: dict[str, np.ndarray]
    occupancy: float | None
    seconds: float


def block_size(spec: Any, workers: int = 1) -> int:
    """Cells in a block: many, for the lanes idle at its end, but fewer where each takes long, has
    long samples or event logs (the memory of a sweep is bounded whatever is asked of its cells), or
    where `workers` of a cluster share the sweep.
    """
    run = spec.run
    most = min(int(BLOCK_TIME / (run.transient + run.window)), MOST_CELLS)
    event = sum(np.dtype(c.dtype).itemsize for c in schema.SCHEMA.values() if c.along == "event")
    of_a_cell = spec.samples * (5 if run.raster else 4) + event * (run.event_log or 0)
    if workers > 1:
        most = min(most, max(spec.size // (SHARES * workers), SHARED_CELLS))
    # few cells keep few lanes busy, but no block may outgrow the memory
    most = max(min(BLOCK_BYTES // of_a_cell, max(most, FEWEST_CELLS)), 1)
    # all alike: one compilation, and no small one at the end
    blocks = -(-spec.size // most)
    return -(-spec.size // blocks)


def made_by(spec: Any) -> dict[str, str]:
    """What must agree between blocks of one map, beside the specification."""
    made = {name: provenance.version(name) for name in DECISIVE}
    return made | {"precision": str(spec.run.precision), "machine": platform.machine()}


def engine() -> tuple[Evaluate, dict[str, str]]:
    """What computes cells, and what of it must not change in a map; the only way to jax."""
    from .cells.evaluate import evaluate, identity  # seconds, where nothing is computed

    return evaluate, identity()


def evaluate_block(
    spec: Any, index: np.ndarray, evaluate: Evaluate
) -> tuple[dict[str, np.ndarray], float | None]:
    """Stored columns of the cells `index`, each of shape (len(index),), and the engine's occupancy
    if it tells.

    Needs nothing but its arguments, so that blocks can be computed anywhere. `evaluate` may return,
    beside columns of the schema, what `naming` takes, and nothing else (ValueError). Cells whose
    frequency its samples do not tell are looked at again with `FINER` ones, `MOST_SAMPLES` at
    most, by `evaluate(spec, cells, finer, room)`. A `spec.room`, if there is one, is the room of
    all blocks, also of those with few cells.
    """
    room = getattr(spec, "room", len(index))
    columns = dict(evaluate(spec, index) if room == len(index) else evaluate(spec, index, 1, room))
    occupancy = columns.pop("occupancy", None)
    found = naming(spec, columns)
    for finer in (n for n in FINER if n * spec.samples <= MOST_SAMPLES):
        again = np.flatnonzero(untold(found | columns, spec.classes))
        most = max(1, room // finer)  # the room of a block holds so many
        for part in (again[k : k + most] for k in range(0, again.size, most)):
            closer = naming(spec, dict(evaluate(spec, index[part], finer, room)))
            for name, values in closer.items():
                found[name][part] = values
    if found:
        told = found["frequency_told"] != codes.TOLD["no"]
        found["dominant_frequency"] = np.where(told, found["dominant_frequency"], np.nan)
    columns |= found
    columns |= classes.classify(columns, spec.classes)
    return map_dataset.select(columns, len(index)), None if occupancy is None else float(
        np.mean(occupancy)
    )


def naming(spec: Any, columns: dict[str, Any]) -> dict[str, np.ndarray]:
    """Columns that come from samples (`signals.signal_columns`), which are taken out of `columns`:
    `signal` (cells, samples), the mean tip velocity over intervals of `window / samples`,
    `sample_interval` in seconds if that is not so, and for a belt that reverses `signal_inner`,
    `since_reversal` [s] of the middle of each sample and `wiping_frequency` [Hz]. None where there
    are no samples.
    """
    signal = columns.pop("signal", None)
    interval = columns.pop("sample_interval", None)
    since = columns.pop("since_reversal", None)
    wiping = columns.pop("wiping_frequency", None)
    inner = columns.pop("signal_inner", None)
    if signal is None:
        return {}
    if interval is None:
        interval = spec.run.window / signal.shape[-1]
    # what a cell that stopped early left in its samples is no settled motion
    finished = np.asarray(columns["result"]) == RESULTS["finished"]
    whole = np.where(finished[:, None], signal, np.nan)
    quiet = spec.classes.quiet_velocity_ratio * np.asarray(columns["belt_speed_rms"])
    if inner is None:  # on a steady belt: what the means lack to the exact variance
        lack = np.square(columns["velocity_rms"]) - np.var(whole, axis=-1, dtype=float)
        inner = np.maximum(lack, 0.0)[:, None]
    return _analysed(whole, float(np.mean(interval)), spec.classes, quiet, since, wiping, inner)


def _analysed(signal, interval, limits, quiet, since, wiping, inner) -> dict[str, np.ndarray]:
    """`signal_columns` of some cells after the other: filters and spectra hold twenty times the
    memory of the samples, and a block of long ones would not fit.
    """
    cells, samples = signal.shape
    given = {"quiet_below": np.broadcast_to(quiet, cells), "inner": inner}
    if since is not None:
        given["since"] = np.broadcast_to(since, signal.shape)
        given["wiping"] = np.broadcast_to(wiping, cells)
    rows = max(1, ANALYSED // samples)
    parts = [
        signal_columns(
            signal[part], interval, limits, **{name: x[part] for name, x in given.items()}
        )
        for part in (slice(start, start + rows) for start in range(0, cells, rows))
    ]
    return {name: np.concatenate([found[name] for found in parts]) for name in parts[0]}
