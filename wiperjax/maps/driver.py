"""Driver of a sweep: blocks of cells (`block`) into a store (`blocks`), then one map (`map_file`).

Memory is bounded by that of a few blocks, whatever the number of cells.
"""

import json
import os
import shlex
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from ..datasets import map_dataset
from ..machine import provenance
from ..machine.files import StoreError, check_move, check_output, log
from ..machine.interrupt import heeded
from ..machine.phases import Account, account, during
from ..specs.load import spec_of
from ..specs.sweep import SweepSpec
from ..store.blocks import BlockStore
from ..store.manifest import parts_of
from ..store.map_file import finalize
from ..store.mending import finished, kept_levels, not_gone_on_with, salvage
from ..store.whole import listed, open_map
from ..vocabulary import checks
from ..vocabulary.ranges import MOST_CELLS, Range
from .auto_model import as_chosen_for, on_chosen_model
from .block import Block, Evaluate, accelerated, block_size
from .computing import Blocks, Spans, computing
from .estimate import check_memory, check_room
from .progress import Report
from .starts import whole_lines

if TYPE_CHECKING:
    from .cluster import Workers


class SweepInterrupted(KeyboardInterrupt):
    """Ctrl-C during a sweep; its text says what is kept and how to go on."""


def sweep(
    spec: Any,
    output: str | Path | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    block: int | None = None,
    evaluate: Evaluate | None = None,
    workers: "Workers | None" = None,
    identity: Mapping[str, str] | None = None,
    progress: bool = True,
    command: str | None = None,
) -> xr.Dataset:
    """Map of the sweep `spec`, read from `output` as it is used.

    Main arguments:

    - `spec`: the sweep: a `SweepSpec`, a mapping shaped like a sweep file, or the
        path of one; the notes of these two are logged as warnings.
    - `output`: HDF5 file to make; finished blocks are kept in `<output>.parts` until it is
        complete. None keeps everything in memory.
    - `resume`: go on with a sweep that was cut short, or mend its finished map that was damaged
        since; the result is bit-identical to one that was not.
    - `force`: replace `output`, and without `resume` an unfinished store, if they exist.

    Other arguments:

    - `block`: cells computed together, of which three blocks are lost at worst; `block_size` if
        None. A sweep that is resumed keeps its own. Whole lines, where cells go on from each other.
    - `evaluate`: what computes cells, `wiperjax.maps.cells.evaluate.evaluate` if None.
    - `workers`: who computes, as `maps.cluster.connect` gives them; this process if None.
    - `identity`: what else must agree between parts of one map (such as the kind of device), text
        -> text.
    - `progress`: show it, if standard error is a terminal.
    - `command`: what was typed, for the file and for the hint after Ctrl-C.

    Raises: `StoreError` (one line) for everything about files; `SpecError` (one line) for a wrong
    sweep; `SweepInterrupted` on Ctrl-C.
    """
    _check(resume, force, progress, block, evaluate, output)
    source = Path(spec) if isinstance(spec, str | os.PathLike) else None
    spec = spec_of(SweepSpec, spec)
    if not hasattr(spec, "axes_values"):
        must = "spec must be a sweep, a mapping shaped like a sweep file, or the path of one"
        raise ValueError(f"{must}, but was {checks.shown(spec)}")
    if output is not None and resume:
        spec = as_chosen_for(Path(output), spec)
    spec = on_chosen_model(spec, evaluate=evaluate, workers=workers)
    blocks, known = computing(spec, evaluate, workers)
    block = whole_lines(spec, block or block_size(spec, 1 if workers is None else workers.count))
    known |= dict(identity or {})
    if workers is None and evaluate is None and accelerated():
        from .cells.devices import WIDE  # jax is there

        if spec.size < WIDE:
            few = f"{spec.size} cells leave most of an accelerator idle"
            log.warning("%s: with JAX_PLATFORMS=cpu the processor's cores may be faster", few)
    with account() as spent:
        task = Task(spec, blocks, int(block), known, progress, command, spent, workers)
        if output is None:
            check_memory(spec)
            return _in_memory(task)
        with during("storing"):  # all but the computing of blocks, which has phases of its own
            return _onto_disk(task, Path(output), resume, force, source)


class Task(NamedTuple):
    """A sweep, who computes its blocks, and what is said of it."""

    spec: Any
    blocks: Blocks
    block: int
    known: dict[str, str]  # what must not change within the map
    progress: bool
    command: str | None
    spent: Account
    workers: "Workers | None"


def _onto_disk(
    task: Task, output: Path, resume: bool, force: bool, source: Path | None
) -> xr.Dataset:
    """`sweep` into a file, block by block."""
    spec, block, known = task.spec, task.block, task.known
    found = finished(output, spec, known) if resume and output.is_file() else None
    if found and not found.damaged:
        # killed after the map was complete, before its parts were gone
        if parts_of(output).is_dir():
            with BlockStore.open(output, spec, block=block, identity=known, resume=True) as store:
                store.remove()
        return open_map(output)
    if found:
        log.warning("%s: is damaged: %s; it is mended", output, listed(found.damaged))
        block = found.block or block
    replace = force or found is not None or (resume and BlockStore.may_replace(output))
    if resume and not replace and output.is_file():
        raise not_gone_on_with(output, spec, known)
    check_output(output, replace, source)
    if parts_of(output).is_dir():
        check_move(parts_of(output), output)
    check_room(spec, output, _cells_done(output) if resume else 0)
    with BlockStore.open(
        output, spec, block=block, identity=known, resume=resume, force=force
    ) as store:
        levels = None
        if found:
            salvage(output, found.damaged, store)
            levels = kept_levels(output, found.damaged)
        fill(task, store, lambda: _how_to_resume(store, output, task.command))
        if output.exists() and not replace:
            raise StoreError(
                f"{output}: was made by another program meanwhile; move it away and go on with "
                "--resume"
            )
        host = task.workers.host if task.workers is not None else None
        made = _made(known) | provenance.record(task.command, 0.0, host)
        times = partial(provenance.phase_times, task.spent)
        finalize(store, output, made | times(), times, levels)
    return open_map(output)


def _check(resume, force, progress, block, evaluate, output) -> None:
    """Raises `ValueError` for arguments of `sweep` that cannot be meant."""
    for name, value in (("resume", resume), ("force", force), ("progress", progress)):
        checks.flag(name, value)
    if block is not None:
        checks.whole("block", block, Range(1, MOST_CELLS, whole=True))
    if evaluate is not None and not callable(evaluate):
        raise ValueError(f"evaluate must be a function, but was {checks.shown(evaluate)}")
    if output is not None:
        checks.path("output", output)


def fill(task: Task, store: BlockStore, hint: Callable[[], str]) -> None:
    """Computes what a store lacks. Raises: `SweepInterrupted` on Ctrl-C, with the `hint`."""
    with Report(store.cells, title=task.spec.title, show=task.progress) as report:
        try:
            with heeded() as check:
                _compute(task, store, report, check)
        except KeyboardInterrupt:
            raise SweepInterrupted(hint()) from None


def _compute(task: Task, store: BlockStore, report: Report, check: Callable[[], None]) -> None:
    """Computes and stores every block that is not done; `check` is called before and
    after each."""
    check()
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
    with closing(_computed(task, spans, report)) as computed:
        for block in computed:
            store.write(block.number, block.columns, block.seconds)
            check()


def _computed(task: Task, spans: Spans, report: Report) -> Generator[Block, None, None]:
    """Blocks, each counted by the account and by the report. To be closed: it then waits for what
    moves, and of a Ctrl-C while Python does so by itself there would be but a traceback.
    """
    with closing(task.blocks(task.spec, spans)) as blocks:
        for block in blocks:
            task.spent.take(block.phases, elsewhere=task.workers is not None)
            start, stop = spans[block.number]
            report.update(block.columns, stop - start, block.occupancy)
            yield block


def _in_memory(task: Task) -> xr.Dataset:
    begun, spec = time.perf_counter(), task.spec
    starts = range(0, spec.size, task.block)
    spans = {k: (start, min(spec.size, start + task.block)) for k, start in enumerate(starts)}
    pieces: dict[int, dict[str, np.ndarray]] = {}
    with (
        Report(spec.size, title=spec.title, show=task.progress) as report,
        heeded() as check,
        closing(_computed(task, spans, report)) as computed,
    ):
        for block in computed:
            pieces[block.number] = block.columns
            check()
    whole = {name: np.concatenate([pieces[k][name] for k in spans]) for name in pieces[0]}
    made = _made(task.known) | provenance.record(task.command, time.perf_counter() - begun)
    return map_dataset.assemble(spec, whole, attributes=made | provenance.phase_times(task.spent))


def _made(known: Mapping[str, str]) -> dict[str, str]:
    """Attributes that say what made a map."""
    return {
        "identity": json.dumps(dict(known), sort_keys=True),
        "versions": json.dumps(provenance.versions(), sort_keys=True),
    }


def _cells_done(output: Path) -> int:
    """Cells in the finished blocks beside `output`; 0 if there is no store that can be read."""
    try:
        return BlockStore.peek(parts_of(output)).cells_done()
    except StoreError:  # opening it will say what is wrong, if anything is
        return 0


def _how_to_resume(store: BlockStore, output: Path, command: str | None) -> str:
    done = store.cells_done()
    if command:
        words = [word for word in shlex.split(command) if word not in ("--force", "--resume")]
        hint = shlex.join([*words, "--resume"])
    else:
        hint = f"wiperjax.sweep(spec, {str(output)!r}, resume=True)"
    kept = f"{done} of {store.cells} cells are kept in {store.parts}"
    return f"interrupted: {kept}; go on with\n  {hint}"
