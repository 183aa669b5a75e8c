"""Driver of a sweep: blocks of cells through the engine into a store, then one map.

    cell numbers -> engine (`cells.evaluate`) -> dominant frequency -> class -> block -> map

Memory is bounded by one block, whatever the number of cells. jax comes in only with
`wiperjax.cells`, and only when no other `evaluate` is given.
"""

import importlib
import json
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from . import dataset, labels
from .blocks import BlockStore
from .mapfile import finalize
from .progress import Report
from .results import RESULTS
from .signals import signal_columns
from .spec import load_sweep, parse_sweep
from .storage import StoreError, check_output, open_map, parts_of

if TYPE_CHECKING:
    from .cluster import Workers

Evaluate = Callable[[Any, np.ndarray], Mapping[str, Any]]

DECISIVE = ("wiperjax", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")
"""Libraries whose version has a part in the numbers; it must not change within a map."""


class Block(NamedTuple):
    """A computed block: its number, stored columns, the engine's occupancy, seconds it took."""

    number: int
    columns: dict[str, np.ndarray]
    occupancy: float | None
    seconds: float


Spans = Mapping[int, tuple[int, int]]  # number of a block -> first cell, the one after the last
Blocks = Callable[[Any, Spans], Iterator[Block]]


class SweepInterrupted(KeyboardInterrupt):
    """Ctrl-C during a sweep; its text says what is kept and how to go on."""


def run(
    spec: Any,
    output: str | Path | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    block: int = 8192,
    evaluate: Evaluate | None = None,
    workers: "Workers | None" = None,
    identity: Mapping[str, str] | None = None,
    progress: bool = True,
    command: str | None = None,
) -> xr.Dataset:
    """Map of the sweep `spec`, read from `output` as it is used.

    Main arguments:

    - `spec`: the sweep: a `wiperjax.spec.SweepSpec`, a mapping shaped like a sweep file, or the
        path of one.
    - `output`: HDF5 file to make; finished blocks are kept in `<output>.parts` until it is
        complete. None keeps everything in memory.
    - `resume`: go on with a sweep that was cut short; the result is bit-identical to one that was
        not.
    - `force`: replace `output`, and without `resume` an unfinished store, if they exist.

    Other arguments:

    - `block`: cells computed, and lost at worst, together. A sweep that is resumed keeps its own.
    - `evaluate`: what computes cells, `wiperjax.cells.evaluate` if None.
    - `workers`: who computes, as `wiperjax.cluster.connect` gives them; this process if None.
    - `identity`: what else must agree between parts of one map (such as the kind of device), text
        -> text.
    - `progress`: show it, if standard error is a terminal.
    - `command`: what was typed, for the file and for the hint after Ctrl-C.

    Raises: `StoreError` (one line) for everything about files; `SpecError` (one line) for a wrong
    sweep; `SweepInterrupted` on Ctrl-C.
    """
    if isinstance(spec, str | Path):
        spec = load_sweep(spec)
    elif isinstance(spec, Mapping):
        spec = parse_sweep(spec)
    known = made_by(spec) | dict(identity or {})
    if workers is not None:
        known |= workers.made_by(spec, evaluate)
        blocks: Blocks = partial(workers.blocks, evaluate=evaluate)
    else:
        if evaluate is None:
            evaluate, described = engine()
            known |= described
        blocks = partial(_one_by_one, evaluate=evaluate)
    if output is None:
        return _in_memory(spec, blocks, block, known, progress, command)
    output = Path(output)
    if resume and output.exists() and _is_finished(output, spec, known):
        # killed after the map was complete, before its parts were gone
        if parts_of(output).is_dir():
            with BlockStore.open(output, spec, block=block, identity=known, resume=True) as store:
                store.remove()
        return open_map(output)
    check_output(output, force or (resume and BlockStore.may_replace(output)))
    with BlockStore.open(
        output, spec, block=block, identity=known, resume=resume, force=force
    ) as store:
        with Report(store.cells, title=spec.title, show=progress) as report:
            try:
                _compute(spec, store, blocks, report)
            except KeyboardInterrupt:
                raise SweepInterrupted(_how_to_resume(store, output, command)) from None
        host = workers.host if workers is not None else None
        finalize(store, output, _made(known) | dataset.provenance(command, 0.0, host))
    return open_map(output)


def engine() -> tuple[Evaluate, dict[str, str]]:
    """What computes cells, and what of it must not change in a map; the only way to jax."""
    cells = importlib.import_module("wiperjax.cells")
    return cells.evaluate, dict(getattr(cells, "identity", dict)())


def evaluate_block(
    spec: Any, index: np.ndarray, evaluate: Evaluate
) -> tuple[dict[str, np.ndarray], float | None]:
    """Stored columns of the cells `index`, each of shape (len(index),), and the engine's occupancy
    if it tells.

    Needs nothing but its arguments, so that blocks can be computed anywhere. `evaluate` may return,
    beside columns of the schema, `signal` (cells, samples), the tip velocity at `window / samples`
    apart, `sample_interval` in seconds if that is not so, `occupancy`, and for a belt that reverses
    `since_reversal` [s] of each sample and `wiping_frequency` [Hz]; whatever else it returns is not
    stored.
    """
    columns = dict(evaluate(spec, index))
    signal = columns.pop("signal", None)
    interval = columns.pop("sample_interval", None)
    occupancy = columns.pop("occupancy", None)
    since = columns.pop("since_reversal", None)
    wiping = columns.pop("wiping_frequency", None)
    if signal is not None:
        if interval is None:
            interval = spec.run.window / signal.shape[-1]
        # what a cell that stopped early left in its samples is no settled motion
        finished = np.asarray(columns["result"]) == RESULTS["finished"]
        whole = np.where(finished[:, None], signal, np.nan)
        quiet = spec.classes.quiet_velocity_ratio * np.asarray(columns["belt_speed_rms"])
        found = signal_columns(whole, float(np.mean(interval)), spec.classes, quiet, since, wiping)
        columns |= found
    columns |= labels.classify(columns, spec.classes)
    return dataset.select(columns, len(index)), None if occupancy is None else float(
        np.mean(occupancy)
    )


def _one_by_one(spec: Any, spans: Spans, evaluate: Evaluate) -> Iterator[Block]:
    for number, (start, stop) in spans.items():
        begun = time.perf_counter()
        columns, occupancy = evaluate_block(spec, np.arange(start, stop), evaluate)
        yield Block(number, columns, occupancy, time.perf_counter() - begun)


def _compute(spec: Any, store: BlockStore, blocks: Blocks, report: Report) -> None:
    """Computes and stores every block that is not done."""
    done = store.done()
    for number in np.flatnonzero(done):
        found = store.read(int(number), ("label", "result"))
        if found is None:
            done[number] = False
            continue
        start, stop = store.span(int(number))
        report.done += stop - start
        report.count(found[0])
    spans = {int(number): store.span(int(number)) for number in np.flatnonzero(~done)}
    for number, columns, occupancy, seconds in blocks(spec, spans):
        store.write(number, columns, seconds)
        start, stop = spans[number]
        report.update(columns, stop - start, occupancy)


def _in_memory(
    spec: Any,
    blocks: Blocks,
    block: int,
    known: dict[str, str],
    progress: bool,
    command: str | None,
) -> xr.Dataset:
    begun = time.perf_counter()
    starts = range(0, spec.size, block)
    spans = {k: (start, min(spec.size, start + block)) for k, start in enumerate(starts)}
    pieces: dict[int, dict[str, np.ndarray]] = {}
    with Report(spec.size, title=spec.title, show=progress) as report:
        for number, columns, occupancy, _ in blocks(spec, spans):
            pieces[number] = columns
            start, stop = spans[number]
            report.update(columns, stop - start, occupancy)
    whole = {name: np.concatenate([pieces[k][name] for k in spans]) for name in pieces[0]}
    made = _made(known) | dataset.provenance(command, time.perf_counter() - begun)
    return dataset.assemble(spec, whole, attributes=made)


def made_by(spec: Any) -> dict[str, str]:
    """What must agree between blocks of one map, beside the specification."""
    made = {name: dataset.version(name) for name in DECISIVE}
    return made | {"precision": str(spec.run.precision), "machine": platform.machine()}


def _made(known: Mapping[str, str]) -> dict[str, str]:
    """Attributes that say what made a map."""
    return {
        "identity": json.dumps(dict(known), sort_keys=True),
        "versions": json.dumps(dataset.versions(), sort_keys=True),
    }


def _is_finished(output: Path, spec: Any, known: Mapping[str, str]) -> bool:
    """Whether `output` is the complete map that this sweep would make."""
    try:
        with open_map(output) as ds:
            same = ds.attrs.get("specification_digest") == spec.digest()
            return same and ds.attrs.get("identity") == _made(known)["identity"]
    except StoreError:
        return False


def _how_to_resume(store: BlockStore, output: Path, command: str | None) -> str:
    spans = [store.span(int(number)) for number in np.flatnonzero(store.done())]
    done = sum(stop - start for start, stop in spans)
    if command:
        words = [word for word in command.split() if word not in ("--force", "--resume")]
        hint = " ".join([*words, "--resume"])
    else:
        hint = f"wiperjax.sweep(spec, {str(output)!r}, resume=True)"
    kept = f"{done} of {store.cells} cells are kept in {store.parts}"
    return f"interrupted: {kept}; go on with\n  {hint}"


# --- checking a finished map ----------------------------------------------------------------------


@dataclass(frozen=True)
class VerifyReport:
    """How a random sample of recomputed cells agrees with a map.

    Attributes:
        cells: number of cells recomputed.
        columns: number of columns compared.
        largest: column -> largest relative difference, of the columns that are not bit-identical.
        differing: numbers of the cells in which anything differs by more than the tolerance.
        tolerance: relative difference allowed; codes and counts must be equal.
        same_versions: whether the map was made with the library versions of now.
    """

    cells: int
    columns: int
    tolerance: float
    same_versions: bool
    largest: dict[str, float] = field(default_factory=dict)
    differing: tuple[int, ...] = ()

    @property
    def identical(self) -> bool:
        """Whether every number agrees to the last bit."""
        return not self.largest

    @property
    def passed(self) -> bool:
        """Whether every number agrees within the tolerance."""
        return not self.differing


def verify(
    path: str | Path,
    cells: int = 64,
    seed: int = 0,
    *,
    tolerance: float = 1e-9,
    spec: Any = None,
    evaluate: Evaluate | None = None,
) -> VerifyReport:
    """Recomputes a random sample of the cells of a map and compares all their columns.

    Arguments:

    - `path`: the map.
    - `cells`, `seed`: size of the sample, drawn without repetition.
    - `tolerance`: largest relative difference that passes.
    - `spec`: the sweep; read from the map if None.
    - `evaluate`: as in `run`.

    Raises: `StoreError` if `path` is no map, or `spec` is not what it was made from.
    """
    with open_map(path) as ds:
        if "specification_digest" not in ds.attrs:
            raise StoreError(f"{path}: is not a map (it holds no specification)")
        if spec is None:
            spec = parse_sweep(json.loads(ds.attrs["specification"]), str(path))
        if spec.digest() != ds.attrs["specification_digest"]:
            raise StoreError(
                f"{path}: was not made from this specification by this version of wiperjax"
            )
        same = json.loads(ds.attrs.get("versions", "{}")) == dataset.versions()
        index = np.sort(
            np.random.default_rng(seed).choice(spec.size, size=min(cells, spec.size), replace=False)
        )
        stored: dict[str, list[Any]] = {str(name): [] for name in ds.data_vars}
        for place in zip(*np.unravel_index(index, spec.shape), strict=True):
            cell = ds.isel(dict(zip(spec.axes_values(), map(int, place), strict=True))).load()
            for name, values in stored.items():
                values.append(cell[name].values)
    fresh, _ = evaluate_block(spec, index, evaluate or engine()[0])
    largest: dict[str, float] = {}
    wrong = np.zeros(len(index), dtype=bool)
    for name in fresh.keys() & stored.keys():
        now, was = fresh[name], np.asarray(stored[name], dtype=fresh[name].dtype)
        equal = (now == was) | ((now != now) & (was != was))
        if equal.all():
            continue
        with np.errstate(all="ignore"):
            gap = np.abs(now.astype(float) - was) / np.maximum(
                np.abs(now.astype(float)), np.abs(was)
            )
        gap = np.where(equal, 0.0, np.nan_to_num(gap, nan=np.inf))
        largest[name] = float(gap.max())
        too_far = gap > (tolerance if now.dtype.kind == "f" else 0.0)
        wrong |= too_far.reshape(len(index), -1).any(axis=1)
    return VerifyReport(
        cells=len(index),
        columns=len(fresh.keys() & stored.keys()),
        tolerance=tolerance,
        same_versions=same,
        largest=dict(sorted(largest.items())),
        differing=tuple(int(cell) for cell in index[wrong]),
    )
