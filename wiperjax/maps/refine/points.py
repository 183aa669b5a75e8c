"""Some points of a grid as a sweep of one axis, which blocks and stores take like any other."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...store.levels import is_refined
from ...store.whole import borders
from ...vocabulary.ranges import COUNT
from ..starts import Columns
from .bank import Bank
from .grid import Grid

ROOM = 4096  # points in a block; blocks of few points share the program of full ones


class Points:
    """The sweep of the points `index` of a grid; what is not said here is as in its map.

    Rasters, event logs and derivatives are the map's alone: a point has statistics and a class.
    """

    def __init__(
        self,
        spec: Any,
        grid: Grid,
        index: np.ndarray,
        factor: int = 1,
        room: int = ROOM,
        linear: bool = False,
    ):
        """`factor`: times as long a transient and window as in the map's sweep `spec`; `room`: of
        the program that computes them; `linear`: whether they have the columns of steady slip
        alone (`linear`), and so are unlike those that are simulated.
        """
        run = {"raster": None, "event_log": None, "rtol": spec.rtol}
        run["solver"] = spec.settings.solver
        run |= {"transient": factor * spec.run.transient, "window": factor * spec.run.window}
        if spec.run.samples is not None:
            run["samples"] = factor * spec.run.samples
        run["max_steps"] = min(factor * spec.run.max_steps, int(COUNT.high))
        changed = {"run": spec.run.model_copy(update=run), "sensitivities": None}
        self._spec = spec.model_copy(update=changed)
        table = spec.parameter_table
        found = grid.values(index).items()
        self._values = {name: np.asarray(table[name].to_si(x)) for name, x in found}
        self.index, self.room = index, room
        self._of = {"sweep": spec.digest(), "levels": grid.levels, "factor": factor}
        self._of |= {"linear": True} if linear else {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # of an object that is being unpickled
            raise AttributeError(name)
        return getattr(self._spec, name)

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.index),)

    @property
    def size(self) -> int:
        return len(self.index)

    def axes_values(self) -> dict[str, np.ndarray]:
        """The one axis: numbers of the points."""
        return {"point": self.index}

    def cells(self, which: np.ndarray) -> dict[str, Any]:
        """As `SweepSpec.cells`, of the points numbered from 0 in the order of `index`."""
        known: dict[str, Any] = self._spec.fixed()
        known |= {name: values[which] for name, values in self._values.items()}
        return {name: known[name] for name in self._spec.parameter_names}

    def canonical(self) -> str:
        """JSON of what determines the numbers of these points."""
        points = hashlib.sha256(np.ascontiguousarray(self.index, np.int64).tobytes()).hexdigest()
        return json.dumps(self._of | {"points": points}, sort_keys=True)

    def digest(self) -> str:
        """SHA-256 of `canonical()`, 64 hexadecimal digits."""
        return hashlib.sha256(self.canonical().encode()).hexdigest()


def sample(path: Path, spec: Any, count: int, seed: int) -> Iterator[tuple[Points, Columns]]:
    """Some of the finer points of a map of the sweep `spec`, and their stored columns: first those
    of the map's own window, then those of longer ones. Nothing of a map that is not refined.
    """
    if not is_refined(path):
        return
    said = borders(path).attrs
    grid = Grid(spec.axes, int(said["levels"]))
    bank = Bank.of_file(path, grid)
    place = np.random.default_rng(seed).permutation(len(bank.index))[:count]
    for factor in np.unique(bank.factor[place]).tolist():
        some = np.sort(place[bank.factor[place] == factor])
        yield Points(spec, grid, bank.index[some], factor), bank.take(some)
