"""Driver of a refinement: a finished map in, the same map with its borders out.

    `Search` asks for points -> blocks of them, stored one by one beside the map -> `Search` is told
    -> ... -> the map with groups takes the place of the one without

The stores of finished requests lie in `MAP.h5.refine`, named by what was asked. A search that is
killed asks the same again, and finds them.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ...machine import provenance
from ...machine.files import StoreError, check_move, check_output, log, naming, write_bytes
from ...machine.interrupt import heeded
from ...machine.lock import acquire, release, remove
from ...machine.phases import account, during
from ...specs.refine import parse_refine
from ...store import checksums
from ...store.blocks import BlockStore
from ...store.folder import LOCK, clear, remove_temporary
from ...store.levels import is_refined, write_levels
from ...store.partial import Reader
from ...store.swept import check_made_from, sweep_of
from ...store.whole import borders, open_finished
from ...vocabulary import checks
from ...vocabulary.wording import not_there
from ..block import Evaluate, block_size
from ..computing import computing
from ..driver import SweepInterrupted, Task, fill
from ..starts import Columns
from .answers import Answers
from .bank import Bank
from .criterion import Criterion
from .grid import Grid
from .known import Facts
from .linear import linear_blocks
from .points import ROOM, Points
from .search import Search
from .tables import border_dataset

if TYPE_CHECKING:
    from ..cluster import Workers

SETTINGS = "settings.json"  # in the folder: of the refinement that it is of


def refine(
    path: str | Path,
    *,
    evaluate: Evaluate | None = None,
    workers: "Workers | None" = None,
    identity: Mapping[str, str] | None = None,
    progress: bool = True,
    command: str | None = None,
    **settings: Any,
) -> xr.Dataset:
    """Locates the borders of a finished map, and stores them in it. One that was stopped goes on
    where it was; one that is done is read.

    Arguments:

    - `path`: the map.
    - `settings`: keys of the table `[refine]` of a sweep file, such as `levels=3`,
        `resolution=0.001`, `on="mechanism"`, `box={"attack_angle": (-5, 5)}`, `max_cells=10_000`.
    - `evaluate`, `workers`, `identity`, `progress`, `command`: as in `sweep`.

    Returns: what `borders` reads.

    Raises: `SpecError` for settings that cannot be meant, `StoreError` for a map that cannot be
    read or replaced, is damaged, or was made by other versions; `SweepInterrupted` on Ctrl-C.
    """
    checks.path("path", path)
    checks.flag("progress", progress)
    path = Path(path)
    spec, ds, mark = _opened(path)
    with ds:
        found = parse_refine(settings, spec)
        stated = json.dumps(found.model_dump(mode="json"), sort_keys=True)
        if is_refined(path) and borders(path).attrs.get("refine_settings") == stated:
            _clear_up(path, stated)
            return borders(path)
        check_output(path, force=True)  # it is replaced, as by a sweep: no link, nothing read-only
        blocks, known = computing(spec, evaluate, workers)
        known |= dict(identity or {})
        check_made_from(spec, ds, path, known)
        grid = Grid(spec.axes, found.depth(spec.axes))
        criterion = Criterion(found, spec.classes)
        facts, axes = _of_map(path, ds, criterion), {name: ds[name] for name in spec.axes}
    if criterion.linear:
        blocks = linear_blocks
    search = Search(grid, found, criterion.thresholds, facts)
    kept = Bank.of_file(path, grid)
    bank = Bank() if criterion.linear else kept
    with account() as spent, _folder(path, stated) as folder:
        about = {"known": known, "progress": progress, "command": None, "spent": spent}
        task = partial(Task, blocks=blocks, workers=workers, **about)
        points = partial(Points, spec, grid, linear=criterion.linear)
        compute = _Computing(folder, points, task)
        answers = Answers(bank, criterion, found.lengthen, compute, found.max_cells)
        compute.through(partial(search.run, answers))
        made = {"identity": json.dumps(known, sort_keys=True), "refine_settings": stated}
        made |= {"fresh_simulations": answers.computed}
        if criterion.linear:  # of steady slip alone: what was looked at took no simulation
            made |= {"simulations": 0, "fresh_simulations": 0, "linear_points": search.used}
        host = workers.host if workers is not None else None
        made |= provenance.record(command, compute.wall_time, host)
        made |= provenance.phase_times(spent)
        found_borders = border_dataset(search.outcome(), grid, criterion, found, made, axes)
        with during("storing"):
            times = partial(provenance.phase_times, spent)
            levels, temporary = kept.levels(grid), folder / ".map.tmp"
            write_levels(path, mark, levels, found_borders, temporary, times)
    return borders(path)


def _opened(path: Path) -> tuple[Any, xr.Dataset, bytes]:
    """Sweep, dataset and mark of a finished, undamaged map."""
    with naming(path, "read"):  # first: whatever is read later is of this file or of a newer one
        mark = checksums.mark(path) if path.is_file() else b""
    ds = open_finished(path, check=True)
    try:
        return sweep_of(ds, path), ds, mark
    except BaseException:
        ds.close()
        raise


def _of_map(path: Path, ds: xr.Dataset, criterion: Criterion) -> Facts:
    """Facts of the cells of the map."""
    if missing := [name for name in criterion.needs if name not in ds]:
        raise StoreError(f"{path}: {not_there(missing[0], 'map', map(str, ds.data_vars))}")
    return criterion.facts({name: ds[name].values.ravel() for name in criterion.needs})


def _folder_of(path: Path) -> Path:
    return Path(f"{path}.refine")


def _clear_up(path: Path, stated: str) -> None:
    """Removes the folder of the refinement `stated`, which is done, where its process was killed
    before it did. What one of other settings keeps there is not touched.
    """
    folder = _folder_of(path)
    said = folder / SETTINGS
    try:
        with naming(said, "read"):
            left = folder.is_dir() and (not said.exists() or said.read_bytes() == stated.encode())
        if left:
            with _folder(path, stated):
                pass
    except StoreError as error:  # as in a folder that is read-only
        log.warning("%s (the borders are complete)", error)


@contextmanager
def _folder(path: Path, stated: str):
    """The folder of the refinement with the settings `stated`, locked; if all goes well and all in
    it is ours it is removed.
    """
    folder = _folder_of(path)
    with naming(folder):
        folder.mkdir(exist_ok=True)
    check_move(folder, path)
    lock = acquire(folder / LOCK)
    try:
        write_bytes(folder / SETTINGS, stated.encode())
        yield folder
        try:
            _remove(folder, lock)
        except StoreError as error:
            log.warning("%s (the borders are complete)", error)
    finally:
        release(lock)


def _remove(folder: Path, lock) -> None:
    """Deletes the folder of a refinement. Raises: `StoreError` if anything in it is not ours."""
    with naming(folder, "removed"):
        remove_temporary(folder)
        for parts in folder.glob("points-*.parts"):
            clear(parts)
            (parts / LOCK).unlink(missing_ok=True)
            parts.rmdir()
        (folder / SETTINGS).unlink()
        remove(lock)
        folder.rmdir()


class _Computing:
    """Columns of points, from their store in the folder of a refinement or into it.

    Attributes:
        wall_time: seconds that all the blocks took, summed.
    """

    def __init__(self, folder: Path, points: Callable[..., Points], task: Callable[..., Task]):
        """`points` of numbers and a factor; `task` of points and cells in a block."""
        self._folder, self._points, self._task = folder, points, task
        self.wall_time = 0.0
        self._check: Callable[[], None] = lambda: None
        kept = f"points are kept in {folder}; go on with the same command (sweep: --resume)"
        self._hint = f"interrupted: {kept}"

    def through(self, search: Callable[[], None]) -> None:
        """Runs a search that asks for points. Raises: `SweepInterrupted` on Ctrl-C."""
        with heeded() as self._check:
            try:
                search()
            except SweepInterrupted:
                raise
            except KeyboardInterrupt:
                raise SweepInterrupted(self._hint) from None

    def __call__(self, index: np.ndarray, factor: int) -> Columns:
        self._check()
        points, folder = self._points(index, factor), self._folder
        block = min(ROOM, block_size(self._points(np.resize(index, ROOM), factor)))
        task = self._task(points, block=block)
        with (
            during("storing"),
            BlockStore.open(
                folder / f"points-{points.digest()[:24]}",
                points,
                block=block,
                identity=task.known,
                resume=True,
                anew=f"delete {folder} and give the same command again",
            ) as store,
        ):
            fill(task, store, lambda: self._hint)
            reader = Reader(store)
            columns = reader.read(0, points.size, reader.names)
        self.wall_time += reader.wall_time
        return columns
