"""What a refinement knows at one time: its points, its cubes, and the borders between."""

import numpy as np

from ...specs.refine import Refine
from .cubes import Cubes
from .grid import Grid
from .known import Facts, Known, Pairs
from .step import crossing
from .surface import Surfaces

CHANGES = 3  # along one edge, from which it has no border that would become sharper


class State:
    """Points, cubes, and what follows from them."""

    def __init__(self, grid: Grid, settings: Refine, thresholds: list[float], facts: Facts):
        """`thresholds` of `Facts.number`; `facts` of the points of the map, in its order."""
        self.grid, self.settings, self.thresholds = grid, settings, thresholds
        self.known = Known(grid, grid.coarse_points(), facts)
        low, high = settings.cells_of(grid.along, grid.names, grid.width)
        self.cubes = Cubes.of_map(grid, low, high)
        self.wanted = settings.bracket(grid.shape)

    def answer(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Codes that this refinement tells of `places` (points, dim) in steps of the grid, and
        brackets to the nearest plane (infinite in cubes without one); -2 outside its box.
        """
        cube = self.cubes.locate(np.floor(places).astype(np.int64))
        code, depth = self.surfaces().answer(cube, places / self.wanted)
        plain = (code == -2) & (cube >= 0)
        code[plain] = self.codes(self.cubes.corners(cube[plain])[:, 0])
        return code, np.where(code == -2, np.nan, np.where(plain, np.inf, depth))

    def codes(self, index: np.ndarray) -> np.ndarray:
        return self.known.facts.code[self.known.find(index)]

    def pairs(self) -> Pairs:
        """Neighbouring known points on all edges of all cubes."""
        edges, found = self.cubes.edges, []
        for axis in range(self.grid.dim):
            which = np.flatnonzero(edges.axis == axis)
            pairs = self.known.pairs(axis, edges.start[which], edges.length[which])
            found.append(pairs._replace(edge=which[pairs.edge]))
        return Pairs(*(np.concatenate(each) for each in zip(*found, strict=True)))

    def mixed(self, pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
        """Which pairs have unlike answers, and which edges have too many of them."""
        code = self.known.facts.code
        mixed = code[pairs.low] != code[pairs.high]
        count = np.bincount(pairs.edge[mixed], minlength=len(self.cubes.edges.axis))
        return mixed, count >= CHANGES

    def share(self, pairs: Pairs) -> np.ndarray:
        """Where between two points a stored number crosses a threshold; see `step.crossing`."""
        facts = self.known.facts
        share = crossing(facts.number[pairs.low], facts.number[pairs.high], self.thresholds)
        same = facts.mechanism[pairs.low] == facts.mechanism[pairs.high]
        return np.where(same, share, np.nan)

    def _per_cube(self, edges: np.ndarray) -> np.ndarray:
        """Whether any edge of each cube is in a mask of edges."""
        return np.asarray(edges[self.cubes.edges.of].any(axis=1))

    def pure(self) -> np.ndarray:
        """Which cubes have one answer on all their edges."""
        pairs = self.pairs()
        mixed = np.zeros(len(self.cubes.edges.axis), dtype=bool)
        mixed[pairs.edge[self.mixed(pairs)[0]]] = True
        return ~self._per_cube(mixed)

    def irregular(self) -> np.ndarray:
        return self._per_cube(self.mixed(self.pairs())[1])

    def surfaces(self) -> Surfaces:
        """Planes of all cubes, in brackets."""
        pairs, edges, code = self.pairs(), self.cubes.edges, self.known.facts.code
        some = pairs.take(self.mixed(pairs)[0])
        share = self.share(some)
        along = np.where(np.isfinite(share), share, 0.5) * some.gap
        axis = edges.axis[some.edge]
        place = self.grid.places(self.known.index[some.low]).astype(float)
        place[np.arange(len(axis)), axis] += along
        order = np.argsort(some.edge, kind="stable")
        first = np.searchsorted(some.edge[order], edges.of)
        count = np.searchsorted(some.edge[order], edges.of, side="right") - first
        cube = np.repeat(np.arange(len(edges.of)), count.sum(axis=1))
        each = count.ravel()
        within = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        of = order[np.repeat(first.ravel(), each) + within]
        low, high = code[some.low][of], code[some.high][of]
        return Surfaces(cube, place[of] / self.wanted, axis[of], low, high)
