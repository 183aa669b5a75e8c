"""What a refinement knows at one time: its points and its cubes, and what it tells of any place."""

import itertools

import numpy as np

from ...specs.refine import Refine
from .cubes import Cubes
from .grid import Grid
from .judge import reasons
from .known import Facts, Known
from .view import View


class State:
    """Points and cubes.

    Attributes:
        now: what follows from them (`View`).
        why: of each cube, why it is not believed (`judge.reasons`).
        box: lengths of the map's cells in the box looked in, along each axis (`Grid.cells`).
        wanted: steps of the grid that are a bracket along each axis.
    """

    def __init__(self, grid: Grid, settings: Refine, thresholds: list[float], facts: Facts):
        """`thresholds` of `Facts.number`; `facts` of the points of the map, in its order."""
        self.grid, self.settings, self._thresholds = grid, settings, thresholds
        self.known = Known(grid, grid.coarse_points(), facts)
        low, high = settings.cells_of(grid.along, grid.names, grid.width)
        self.cubes = Cubes.of_map(grid, low, high)
        self.box = [steps[a:b] for steps, a, b in zip(grid.cells, low, high, strict=True)]
        largest = np.array([steps.max() for steps in grid.cells])
        self.wanted = settings.bracket(grid.shape, largest)
        self._now: View | None = None
        self._why: np.ndarray | None = None

    @property
    def now(self) -> View:
        if self._now is None:
            given = (self.wanted, self._thresholds, self.settings.lengthen > 1)
            self._now = View(self.grid, self.known, self.cubes, *given)
        return self._now

    @property
    def why(self) -> np.ndarray:
        if self._why is None:
            self._why = reasons(self.now)
        return self._why

    def learn(self, index: np.ndarray, facts: Facts) -> None:
        """Takes in points."""
        self.known.put(index, facts)
        self._now = self._why = None

    def split(self, which: np.ndarray) -> None:
        """Halves the cubes of a mask, whose points are known."""
        self.cubes = self.cubes.split(which)
        self._now = self._why = None

    def answer(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Codes that this refinement tells of `places` (points, dim) in steps of the grid, and
        brackets to the nearest plane (infinite in cubes without one); -2 and NaN outside its box.
        """
        cube = self.cubes.locate(np.floor(places).astype(np.int64))
        code, depth = np.full(len(places), -2), np.full(len(places), np.nan)
        inside = cube >= 0
        code[inside], depth[inside] = self.now.told(cube[inside], places[inside])
        return code, depth

    def sure(self, places: np.ndarray) -> np.ndarray:
        """Whether each of `places` lies beyond the stated bracket of every border that is told: its
        cube is believed, and no other answer is told within a bracket along each axis.
        """
        code, _ = self.answer(places)
        cube = self.cubes.locate(np.floor(places).astype(np.int64))
        found = (cube >= 0) & (self.why[cube] == 0)
        for step in itertools.product((-1, 0, 1), repeat=self.grid.dim):
            beside, _ = self.answer(places + np.array(step) * self.wanted)
            found &= (beside == code) | (beside == -2)
        return found

    def codes(self, index: np.ndarray) -> np.ndarray:
        return self.known.facts.code[self.known.find(index)]
