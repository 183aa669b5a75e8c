"""Cells of a map run from several starts: at rest, at steady slip, from random places, and where
the neighbouring cell ended.

Up and down sweeps are sequences along the last axis and batches over the others: a block holds
whole lines of that axis, so it needs nothing but its own cells and may be computed anywhere, in any
order.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..noise.class_counts import share_error
from ..specs.tables import Start
from ..vocabulary.codes import LABELS, NOT_COMPUTED, Regime, Result
from ..vocabulary.kinds import WAYS, WIPER
from ..vocabulary.schema import ENDED, ENDED_ELSEWHERE, SCHEMA

FEWEST_LINES = 512  # of a block: both ways together then fill the lanes of two cores

Columns = dict[str, np.ndarray]
Look = Callable[[Any, np.ndarray, Any], tuple[Columns, float | None]]


def ended_columns(spec: Any) -> tuple[str, ...]:
    """Columns of a motion of a sweep from which another can go on."""
    return ENDED if spec.system == WIPER else ENDED_ELSEWHERE


class Cells(NamedTuple):
    """Cells looked at from one start each."""

    spec: Any  # of their start
    index: np.ndarray
    columns: Columns
    ended: Columns | None  # motions that they go on from, if any
    room: int  # cells that were computed at once
    occupancy: float | None


def looked_at(
    spec: Any, index: np.ndarray, look: Look, neighbours: Mapping[str, Columns] | None = None
) -> list[Cells]:
    """The cells `index` of a `SweepSpec` from each of its named starts, in their order; of random
    ones all in one, every start of a cell and then the next cell.

    Arguments:

    - `look`: what computes cells, (spec, cells, `ended`) -> (columns, occupancy).
    - `neighbours`: way -> columns of the cell before each, where these are known; else `index` must
        be whole lines along the last axis (`ValueError`).
    """
    starts = spec.starts
    if starts.random is not None:
        index, begin = np.repeat(index, starts.count), drawn(starts, len(index))
        return [_look(spec, index, look, begin)]
    found = {name: _beginning(spec, name) for name in starts.names if name not in WAYS}
    cells = {name: _look(its, index, look) for name, its in found.items()}
    if neighbours is not None:
        for way, ended in neighbours.items():
            cells[way] = _look(spec, index, look, kicked(spec, index, ended))
    elif starts.ways:
        cells |= _walked(spec, index, look)
    return [cells[name] for name in starts.names]


def together(spec: Any, parts: Sequence[Columns]) -> Columns:
    """Columns (cells, starts, ...) of a map from those of `looked_at`; those that are the same for
    all starts (cells, ...). With the set of classes, and of random starts the shares.
    """
    if spec.starts.random is None:
        found = {name: np.stack([part[name] for part in parts], axis=1) for name in parts[0]}
    else:
        shape = (-1, spec.starts.count)
        found = {name: x.reshape(*shape, *x.shape[1:]) for name, x in parts[0].items()}
    found = {name: x if SCHEMA[name].each_start else x[:, 0] for name, x in found.items()}
    return found | _summary(spec.starts, found["label"])


def line_cells(spec: Any) -> int:
    """Cells that must be in one block: a whole line of the axis that is swept, else one."""
    return spec.shape[-1] if spec.starts is not None and spec.starts.ways else 1


def whole_lines(spec: Any, cells: int) -> int:
    """Cells of a block that is asked to have some number of them: enough for whole lines."""
    line = line_cells(spec)
    return -(-int(cells) // line) * line


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
    step, count = (1 if _forwards(spec, way) else -1), spec.shape[-1]
    place = index % count - step
    return np.where((place >= 0) & (place < count), index - step, -1)


def _forwards(spec: Any, way: str) -> bool:
    """Whether this way goes along the last axis as its values are listed: up, to larger ones."""
    *_, values = spec.axes_values().values()
    return (way == "up") == bool(values[-1] >= values[0])


def _beginning(spec: Any, name: str) -> Any:
    """The sweep whose cells begin at the start of this name, by themselves."""
    if name == "steady_slip":
        return spec.model_copy(update={"start": Start(equilibrium=spec.starts.kick)})
    return spec


def _look(spec: Any, index: np.ndarray, look: Look, ended: Columns | None = None) -> Cells:
    columns, occupancy = look(spec, index, ended)
    return Cells(spec, index, columns, ended, len(index), occupancy)


def drawn(starts: Any, cells: int) -> Columns:
    """The random starts of some cells, as if motions had ended there in flight: the state is taken
    as it is.
    """
    draws = starts.draws().items()
    begin = {f"final_{key}": np.concatenate([values] * cells) for key, values in draws}
    runs = cells * starts.count
    begin["result"] = np.full(runs, int(Result.FINISHED))
    return begin | {"final_regime": np.full(runs, int(Regime.FLIGHT))}


def _walked(spec: Any, index: np.ndarray, look: Look) -> dict[str, Cells]:
    """The cells of whole lines each way: position after position along the last axis, all ways at
    once, each from where the one before ended.
    """
    count, ways = spec.shape[-1], spec.starts.ways
    if len(index) % count or np.any(np.diff(index.reshape(-1, count)) != 1):
        raise ValueError("cells that go on from each other must come in whole lines")
    lines = index.reshape(-1, count)
    at_once = len(lines) * len(ways)
    # of nobody, from which nothing goes on
    many = (at_once, len(spec.family.coordinates))
    along = ("final_position", "final_velocity")
    names = ended_columns(spec)
    ended = {name: np.zeros(many if name in along else at_once) for name in names}
    ended["result"] = np.full(at_once, NOT_COMPUTED)
    forwards = {way: _forwards(spec, way) for way in ways}
    steps = []
    for step in range(count):
        place = {way: step if forwards[way] else count - 1 - step for way in ways}
        cells = np.concatenate([lines[:, place[way]] for way in ways])
        ended = kicked(spec, cells, ended)
        steps.append(_look(spec, cells, look, ended))
        ended = steps[-1].columns
    told = [step.occupancy for step in steps if step.occupancy is not None]
    occupancy = float(np.mean(told)) if told else None
    found = {}
    for number, way in enumerate(ways):
        mine = slice(number * len(lines), (number + 1) * len(lines))
        order = steps if forwards[way] else steps[::-1]
        columns = _in_order([step.columns for step in order], mine)
        begun = _in_order([step.ended or {} for step in order], mine)
        found[way] = Cells(spec, index, columns, begun, at_once, occupancy)
    return found


def _in_order(steps: Sequence[Columns], mine: slice) -> Columns:
    """Columns of cells, line after line, from those of some lines position after position."""
    stacks = {name: np.stack([step[name][mine] for step in steps], axis=1) for name in steps[0]}
    return {name: x.reshape(-1, *x.shape[2:]) for name, x in stacks.items()}


def kicked(spec: Any, index: np.ndarray, ended: Columns) -> Columns:
    """Where others ended, the tip moved by the kick of a lip of the cells `index`; what is so
    beyond the angle at which that lip collapses is nothing to go on from. Of another system with
    the kick beside it: which way there is room only the system knows (`systems.build.go_on`).
    """
    last = {name: np.asarray(ended[name]) for name in ended_columns(spec)}
    if spec.system != WIPER:
        return last | {"kick": np.full(len(index), spec.starts.kick)}
    blade = spec.cells(index)
    x = last["final_x"] + spec.starts.kick * blade["lip_length"]
    beyond = np.abs(x) >= blade["lip_length"] * np.sin(blade["collapse_angle"])
    result = np.where(beyond, int(Result.COLLAPSED), last["result"])
    return last | {"final_x": x, "result": result}


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
