"""One block of a sweep, whoever computes it: cells in, stored columns out.

    cell numbers -> engine (`cells.evaluate`) -> dominant frequency -> class -> block

jax comes in only with `cells`, and only when no other `evaluate` is given.
"""

import platform
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..datasets import map_dataset
from ..machine import jax_settings, provenance
from ..machine.phases import during
from ..noise import classes
from ..noise.signals import signal_columns, untold
from ..vocabulary import codes, schema
from ..vocabulary.codes import RESULTS
from ..vocabulary.ranges import MOST_SAMPLES
from ..vocabulary.thresholds import silence
from .starts import Cells, block_cells, line_cells, looked_at, together

MOST_CELLS = 2**15  # in a block: enough to keep every lane of many cores busy
BLOCK_TIME = 2**13  # s of motion in a block: half a minute on two cores, so that little can be lost
FEWEST_CELLS = 256
SHARES = 4  # blocks for each of several workers, at least: they end at about the same time,
SHARED_CELLS = 1024  # unless blocks would have fewer cells than this
BLOCK_BYTES = 2**27  # of samples and event logs
# On an accelerator times as many cells, and times as much of the other two: a million cells of
# 0.05 s in four blocks take 25 s, in one 29 (an H200): one is named as another moves
ACCELERATED, AS_MUCH = 2**3, 2**5
FINER = (2, 16)  # times as many samples, for cells whose frequency the first do not tell
OF_THE_MOTION = ("result", "velocity_rms", "belt_speed_rms")  # whatever the samples
ANALYSED = 2**20  # samples at once, of each thread
# Threads that look at samples, at most: between two calls of numpy's each waits for Python's lock.
# Of 262,144 cells one takes 4.0 to 4.6 s, four take 2.1 to 2.3, and sixteen 3.4 to 3.6 (16 cores).
LOOKING = 4

Evaluate = Callable[..., Mapping[str, Any]]
"""(spec, cells) and, of samples, (finer, room); in a map of several starts also, by its name,
`ended`, columns of the motions that the cells go on from."""

DECISIVE = ("wiperjax", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")
"""Libraries whose version has a part in the numbers; it must not change within a map."""


class Block(NamedTuple):
    """A computed block: its number, stored columns, the engine's occupancy, seconds it took, and
    those of its phases.
    """

    number: int
    columns: dict[str, np.ndarray]
    occupancy: float | None
    seconds: float
    phases: Mapping[str, float] = MappingProxyType({})


def block_size(spec: Any, workers: int = 1) -> int:
    """Cells in a block: many, for the lanes idle at its end, but fewer where each takes long, has
    long samples or event logs (the memory of a sweep is bounded whatever is asked of its cells), or
    where `workers` of a cluster share the sweep.
    """
    run, (more, much) = spec.run, (ACCELERATED, AS_MUCH) if accelerated() else (1, 1)
    most = min(int(much * BLOCK_TIME / (run.transient + run.window)), more * MOST_CELLS)
    room = much * BLOCK_BYTES
    event = sum(np.dtype(c.dtype).itemsize for c in schema.SCHEMA.values() if c.along == "event")
    of_a_cell = spec.samples * (5 if run.raster else 4) + event * (run.event_log or 0)
    if workers > 1:
        most = min(most, max(spec.size // (SHARES * workers), SHARED_CELLS))
    # few cells keep few lanes busy, but no block may outgrow the memory
    most = max(min(room // of_a_cell, max(most, FEWEST_CELLS)), 1)
    if spec.starts is not None:
        most = block_cells(spec, most, room // of_a_cell, workers)
    # all alike: one compilation, and no small one at the end
    line = line_cells(spec)
    lines, most = spec.size // line, max(1, most // line)
    blocks = -(-lines // most)
    return line * -(-lines // blocks)


def accelerated() -> bool:
    """Whether this process computes cells on an accelerator. jax is asked, and so loaded, only
    where a plugin of it for one is installed.
    """
    if not jax_settings.accelerators():
        return False
    from .cells.devices import on_accelerator

    return on_accelerator()


def made_by(spec: Any) -> dict[str, str]:
    """What must agree between blocks of one map, beside the specification."""
    made = {name: provenance.version(name) for name in DECISIVE}
    return made | {"precision": str(spec.run.precision), "machine": platform.machine()}


def engine() -> tuple[Evaluate, dict[str, str]]:
    """What computes cells, and what of it must not change in a map; the only way to jax."""
    from .cells.evaluate import evaluate, identity  # seconds, where nothing is computed

    return evaluate, identity()


def evaluate_block(
    spec: Any,
    index: np.ndarray,
    evaluate: Evaluate,
    neighbours: Mapping[str, dict[str, np.ndarray]] | None = None,
) -> tuple[dict[str, np.ndarray], float | None]:
    """Stored columns of the cells `index`, each of shape (len(index),), and the engine's occupancy
    if it tells; of several starts, and of `neighbours`, as `starts.looked_at` has them.

    Needs nothing but its arguments, so that blocks can be computed anywhere. `evaluate` may return,
    beside columns of the schema, what `naming` takes, and nothing else (ValueError). Cells whose
    frequency its samples do not tell are looked at again with `FINER` ones, `MOST_SAMPLES` at
    most, by `evaluate(spec, cells, finer, room)`, which need return no more than samples. A
    `spec.room`, if there is one, is the room of all blocks, also of those with few cells.
    """
    with during("naming"):  # all but the engine, which has a phase of its own
        return _evaluate_block(spec, index, evaluate, neighbours)


def _evaluate_block(spec, index, evaluate, neighbours):
    def look(spec, index, ended):
        return _first_look(spec, index, ended, evaluate)

    if spec.starts is None:
        columns, occupancy = look(spec, index, None)
        room = getattr(spec, "room", len(index))
        found = Cells(spec, index, columns, None, room, occupancy)
        return _classified(found, evaluate), occupancy
    parts = looked_at(spec, index, look, neighbours)
    columns = together(spec, [_classified(part, evaluate) for part in parts])
    told = [part.occupancy for part in parts if part.occupancy is not None]
    columns = map_dataset.select(columns, len(index), spec.starts.count)
    return columns, float(np.mean(told)) if told else None


def _first_look(
    spec: Any, index: np.ndarray, ended: Mapping[str, Any] | None, evaluate: Evaluate
) -> tuple[dict[str, np.ndarray], float | None]:
    """Columns of cells with one start each, their own or where others `ended`; without classes."""
    room = getattr(spec, "room", len(index))
    given = () if room == len(index) else (1, room)
    columns = dict(evaluate(spec, index, *given, **({} if ended is None else {"ended": ended})))
    occupancy = columns.pop("occupancy", None)
    found = naming(spec, columns)
    return columns | found, None if occupancy is None else float(np.mean(occupancy))


def _classified(cells: Cells, evaluate: Evaluate) -> dict[str, np.ndarray]:
    """Stored columns of cells after a first look: where it does not tell the frequency, another is
    taken at once for all that want one, for small batches leave lanes empty.
    """
    spec, index, columns, ended, room, _ = cells
    for finer in (n for n in FINER if n * spec.samples <= MOST_SAMPLES):
        again = np.flatnonzero(untold(columns, spec.classes))
        most = max(1, room // finer)  # the room of a block holds so many
        for part in (again[k : k + most] for k in range(0, again.size, most)):
            on = {} if ended is None else {"ended": {key: x[part] for key, x in ended.items()}}
            known = [name for name in OF_THE_MOTION if name in columns]
            shared = {name: np.asarray(columns[name])[part] for name in known}
            closer = evaluate(spec, index[part], finer, room, **on)
            for name, values in naming(spec, shared | dict(closer)).items():
                columns[name][part] = values
    if "frequency_told" in columns:
        told = columns["frequency_told"] != codes.TOLD["no"]
        columns["dominant_frequency"] = np.where(told, columns["dominant_frequency"], np.nan)
    columns |= classes.classify(columns, spec.classes)
    return map_dataset.select(columns, len(index))


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
    cells, samples = signal.shape
    if interval is None:
        interval = spec.run.window / samples
    # what a cell that stopped early left in its samples is no settled motion
    given = {
        "signal": signal,
        "finished": np.asarray(columns["result"]) == RESULTS["finished"],
        "quiet": np.broadcast_to(silence(spec.classes, columns.get("belt_speed_rms")), cells),
        "rms": np.asarray(columns["velocity_rms"]),
        "inner": inner,
    }
    if since is not None:
        given["since"] = np.broadcast_to(since, signal.shape)
        given["wiping"] = np.broadcast_to(wiping, cells)
    rows = max(1, ANALYSED // samples)
    named = partial(_named, limits=spec.classes, interval=float(np.mean(interval)))
    parts = [
        {name: None if x is None else x[start : start + rows] for name, x in given.items()}
        for start in range(0, cells, rows)
    ]
    if len(parts) == 1:
        return named(parts[0])
    with ThreadPoolExecutor(min(jax_settings.cores(), LOOKING)) as pool:
        found = list(pool.map(named, parts))
    return {name: np.concatenate([part[name] for part in found]) for name in found[0]}


def _named(of: dict[str, Any], limits: Any, interval: float) -> dict[str, np.ndarray]:
    """`naming` of some cells: filters and spectra hold many times the memory of the samples, so a
    block is looked at in parts, which are also what the cores share.
    """
    signal = of["signal"]
    if not of["finished"].all():
        signal = np.where(of["finished"][:, None], signal, np.nan).astype(signal.dtype)
    if (
        inner := of["inner"]
    ) is None:  # on a steady belt: what the means lack to the exact variance
        lack = np.square(of["rms"]) - np.var(signal, axis=-1, dtype=float)
        inner = np.maximum(lack, 0.0)[:, None]
    given = (of["quiet"], of.get("since"), of.get("wiping"), inner)
    return signal_columns(signal, interval, limits, *given)
