"""Answers that are there already: of the map, of an earlier refinement, of this one."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...datasets.map_dataset import select
from ...machine.files import StoreError
from ...store.levels import Level, read_levels
from ...vocabulary.columns import column_of
from ..starts import Columns
from .grid import Grid, merged, positions


class Bank:
    """Columns of points by their number in a grid, and how long a window each had."""

    def __init__(self) -> None:
        self.index = np.zeros(0, dtype=np.int64)
        self.factor = np.zeros(0, dtype=np.int16)
        self.columns: Columns = {}

    def put(self, index: np.ndarray, columns: Mapping[str, Any], factor: Any) -> None:
        """Adds points, in place of those that are there; of each, its numbers alone."""
        columns = select(columns, len(index))
        columns = {name: x for name, x in columns.items() if not column_of(name).along}
        factor = np.broadcast_to(np.asarray(factor, dtype=np.int16), len(index))
        self.index, join = merged(self.index, index)
        self.factor = join(self.factor, factor)
        self.columns = {
            name: join(self.columns.get(name, columns[name][:0]), columns[name])
            for name in self.columns or columns
        }

    def find(self, index: np.ndarray) -> np.ndarray:
        """Positions of the points `index`, -1 for those that are not there."""
        return positions(self.index, index)

    def take(self, place: np.ndarray) -> Columns:
        """Columns of the points at positions."""
        return {name: values[place] for name, values in self.columns.items()}

    @classmethod
    def of_file(cls, path: Any, grid: Grid) -> "Bank":
        """Points of an earlier refinement of the map at `path`.

        Raises: `StoreError` if it went to a finer level than the grid has.
        """
        bank, levels = cls(), read_levels(path)
        deepest = max((level.number for level in levels if len(level.index)), default=0)
        if deepest > grid.levels:
            raise StoreError(
                f"{path}: is refined to level {deepest}: levels must be that at least, or "
                f"resolution need as many, but {grid.levels} were asked for"
            )
        for level in levels:
            if len(level.index):
                bank.put(grid.from_level(level.index, level.number), level.columns, level.factor)
        return bank

    def levels(self, grid: Grid) -> list[Level]:
        """All points, each on the first level that has it; the finest level always, also where no
        border asked for a point: of a refined map every level can be read.
        """
        of, found = grid.level_of(self.index), []
        for number in range(grid.levels + 1):
            which = of == number
            if which.any() or number == grid.levels:
                axes = grid.along_level(number)
                index = grid.renumbered(self.index[which], number)
                columns = {name: values[which] for name, values in self.columns.items()}
                found.append(Level(number, axes, index, self.factor[which], columns))
        return found
