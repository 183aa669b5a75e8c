"""Cells of a map run from several starts: at rest, at steady slip, from random places, and where
the neighbouring cell ended.

Up and down sweeps are sequences along the last axis and batches over the others: a block holds whole
lines of that axis, so it needs nothing but its own cells and may be computed anywhere, in any order.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..specs.tables import Start
from ..vocabulary.codes import LABELS, Regime
from ..vocabulary.kinds import WAYS
from ..vocabulary.schema import ENDED, SCHEMA

FEWEST_LINES = 512  # of a block: both ways together then fill the lanes of two cores

Columns = dict[str, np.ndarray]
Run = Callable[..., tuple[Columns, float | None]]  # (spec, cells, where others ended or None)


def run_starts(
    spec: Any, index: np.ndarray, run: Run, neighbours: Mapping[str, Columns] | None = None
) -> tuple[Columns, float | None]:
    """Columns of the cells `index` from each start of a `SweepSpec`, (cells, starts, ...), those
    that are the same for all starts (cells, ...); and the engine's occupancy.

    Arguments:

    - `run`: computes cells, all from one kind of start.
    - `neighbours`: way -> columns of the cell before each, where these are known; else `index` must
        be whole lines along the last axis (`ValueError`).
    """
    starts = spec.starts
    if starts.random is not None:
        found, occupancy = _from_random(spec, index, run)
    else:
        parts = {}
        for name in starts.names:
            if name not in WAYS:
                parts[name] = run(_beginning(spec, name), index, None)
        if neighbours is not None:
            for way in starts.ways:
                parts[way] = run(spec, index, _kicked(spec, index, neighbours[way]))
        elif starts.ways:
            parts |= _walked(spec, index, run)
        told = [part[1] for part in parts.values() if part[1] is not None]
        occupancy = float(np.mean(told)) if told else None
        several = [parts[name][0] for name in starts.names]
        found = {name: np.stack([part[name] for part in several], axis=1) for name in several[0]}
    found = {name: x if SCHEMA[name].each_start else x[:, 0] for name, x in found.items()}
    return found | _summary(starts, found["label"]), occupancy


def line_cells(spec: Any) -> int:
    """Cells that must be in one block: a whole line of the axis that is swept, else one."""
    starts = getattr(spec, "starts", None)
    return spec.shape[-1] if starts is not None and starts.ways else 1


def block_cells(spec: Any, runs: int, most: int, workers: int) -> int:
    """Cells in a block of a map of several starts, where a block should have some number of `runs`;
    `most` at a time, for the memory. Of whole lines, and enough of them to fill the lanes.
    """
    cells, line = max(1, runs // spec.starts.count), line_cells(spec)
    if line == 1:
        return cells
    at_a_time = max(1, most // len(spec.starts.ways))
    return line * min(max(cells // line, FEWEST_LINES // workers, 1), at_a_time)


def before(spec: Any, index: np.ndarray, way: str) -> np.ndarray:
    """The cell from which each of the cells `index` goes on, -1 where it is the first of its
    line.
    """
    step, count = (1 if way == "up" else -1), spec.shape[-1]
    place = index % count - step
    return np.where((place >= 0) & (place < count), index - step, -1)


def _beginning(spec: Any, name: str) -> Any:
    """The sweep whose cells begin at the start of this name, by themselves."""
    if name == "steady_slip":
        return spec.model_copy(update={"start": Start(equilibrium=spec.starts.kick)})
    return spec


def _from_random(spec: Any, index: np.ndarray, run: Run) -> tuple[Columns, float | None]:
    draws, count = spec.starts.draws(), spec.starts.count
    begin = {f"final_{key}": np.tile(values, len(index)) for key, values in draws.items()}
    runs = count * len(index)
    # as if it flew: the state is taken as it is
    begin |= {"result": np.zeros(runs), "final_regime": np.full(runs, int(Regime.FLIGHT))}
    found, occupancy = run(spec, np.repeat(index, count), begin)
    shape = (len(index), count)
    return {name: x.reshape(*shape, *x.shape[1:]) for name, x in found.items()}, occupancy


def _walked(spec: Any, index: np.ndarray, run: Run) -> dict[str, tuple[Columns, float | None]]:
    """Way -> what `run` gives of all cells: position after position along the last axis, all ways
    at once, each from where the one before ended.
    """
    count, ways = spec.shape[-1], spec.starts.ways
    if len(index) % count or np.any(np.diff(index.reshape(-1, count)) != 1):
        raise ValueError("cells that go on from each other must come in whole lines")
    lines = index.reshape(-1, count)
    ended, steps, told = None, [], []
    for step in range(count):
        place = {"up": step, "down": count - 1 - step}
        cells = np.concatenate([lines[:, place[way]] for way in ways])
        if ended is not None:
            ended = _kicked(spec, cells, ended)
        ended, occupancy = run(spec, cells, ended)
        steps.append(ended)
        told += [] if occupancy is None else [occupancy]
    found = {}
    for number, way in enumerate(ways):
        mine = slice(number * len(lines), (number + 1) * len(lines))
        order = steps if way == "up" else steps[::-1]
        columns = {
            name: np.stack([part[name][mine] for part in order], axis=1).reshape(
                len(index), *steps[0][name].shape[1:]
            )
            for name in steps[0]
        }
        found[way] = columns, float(np.mean(told)) if told else None
    return found


def _kicked(spec: Any, index: np.ndarray, ended: Columns) -> Columns:
    """Where others ended, the tip moved by the kick of a lip of the cells `index`."""
    length = spec.cells(index)["lip_length"]
    last = {name: ended[name] for name in ENDED}
    return last | {"final_x": last["final_x"] + spec.starts.kick * length}


def _summary(starts: Any, label: np.ndarray) -> Columns:
    """Which classes the starts of each cell end in; of random ones, in what shares."""
    codes = np.array(list(LABELS.values()))
    met = label[:, :, None] == codes
    found = {"class_set": met.any(axis=1) @ (1 << codes)}
    if starts.random is not None:
        count = met.sum(axis=1)
        found["class_share"] = count / starts.count
        found["class_share_error"] = share_error(count, starts.count)
    return found


def share_error(count: Any, of: int) -> np.ndarray:
    """Standard error of a share, `count` seen among `of` independent ones.

    Of (count + 2)/(of + 4), the middle of Wilson's interval at two standard errors (A. Agresti and
    B. A. Coull, The American Statistician 52 (1998) 119): what was never seen is not known to be
    impossible.
    """
    share = (np.asarray(count) + 2) / (of + 4)
    return np.sqrt(share * (1 - share) / (of + 4))
