"""What follows from the points and cubes known at one time; each thing is computed once."""

from functools import cached_property

import numpy as np

from .cubes import Cubes
from .grid import Grid
from .known import Known, Pairs
from .step import crossing
from .surface import Surfaces

CHANGES = 3  # along one edge, from which it has no border that would become sharper


class View:
    """Of known points and cubes, which must not change meanwhile.

    Masks are of points (`short`), pairs (`mixed`, `apart`), edges (`crowded`, `open`) or cubes
    (`pure`, `irregular`, `busy`).
    """

    def __init__(
        self, grid: Grid, known: Known, cubes: Cubes,
        wanted: np.ndarray, thresholds: list[float], patient: bool,
    ):  # fmt: skip
        """`wanted` steps of the grid are a bracket along each axis; `thresholds` of
        `Facts.number`; `patient`: whether what is not settled is looked at for longer.
        """
        self.grid, self.known, self.cubes = grid, known, cubes
        self.wanted, self._thresholds, self._patient = wanted, thresholds, patient

    @cached_property
    def pairs(self) -> Pairs:
        """Neighbouring known points on all edges of all cubes."""
        edges, found = self.cubes.edges, []
        for axis in range(self.grid.dim):
            which = np.flatnonzero(edges.axis == axis)
            pairs = self.known.pairs(axis, edges.start[which], edges.length[which])
            found.append(pairs._replace(edge=which[pairs.edge]))
        return Pairs(*(np.concatenate(each) for each in zip(*found, strict=True)))

    @cached_property
    def mixed(self) -> np.ndarray:
        """Pairs of unlike answers."""
        code = self.known.facts.code
        return code[self.pairs.low] != code[self.pairs.high]

    @cached_property
    def crowded(self) -> np.ndarray:
        """Edges with so many changes that none of them would become sharper."""
        changes = np.bincount(self.pairs.edge[self.mixed], minlength=len(self.cubes.edges.axis))
        return changes >= CHANGES

    @cached_property
    def short(self) -> np.ndarray:
        """Points beside a border whose answer is to be told by a longer window."""
        found, facts = np.zeros(len(self.known.index), dtype=bool), self.known.facts
        if self._patient:
            some = self.pairs.take(self.mixed & ~self.crowded[self.pairs.edge])
            found[some.low] = found[some.high] = True
        return found & ~facts.settled & ~facts.longer

    @cached_property
    def apart(self) -> np.ndarray:
        """Unlike pairs that are to be brought closer."""
        edge = self.pairs.edge
        close = self.pairs.gap <= self.wanted[self.cubes.edges.axis[edge]]
        return self.mixed & ~self.crowded[edge] & ~close & ~self._waiting

    @property
    def _waiting(self) -> np.ndarray:
        return self.mixed & (self.short[self.pairs.low] | self.short[self.pairs.high])

    @cached_property
    def open(self) -> np.ndarray:
        """Edges with borders that are not yet as sharp as they are to become."""
        return self._edges(self.apart | self._waiting)

    @cached_property
    def pure(self) -> np.ndarray:
        """Cubes with one answer on all their edges."""
        return ~self.with_pairs(self.mixed)

    @cached_property
    def irregular(self) -> np.ndarray:
        """Cubes with a crowded edge."""
        return self._with_edges(self.crowded)

    @cached_property
    def busy(self) -> np.ndarray:
        """Cubes with an open edge."""
        return self._with_edges(self.open)

    def with_pairs(self, pairs: np.ndarray) -> np.ndarray:
        """Cubes that have any pair of a mask on their edges."""
        return self._with_edges(self._edges(pairs))

    def _edges(self, pairs: np.ndarray) -> np.ndarray:
        found = np.zeros(len(self.cubes.edges.axis), dtype=bool)
        found[self.pairs.edge[pairs]] = True
        return found

    def _with_edges(self, edges: np.ndarray) -> np.ndarray:
        return np.asarray(edges[self.cubes.edges.of].any(axis=1))

    def share(self, pairs: Pairs) -> np.ndarray:
        """Where between two points a stored number crosses a threshold; see `step.crossing`."""
        facts = self.known.facts
        share = crossing(facts.number[pairs.low], facts.number[pairs.high], self._thresholds)
        same = facts.mechanism[pairs.low] == facts.mechanism[pairs.high]
        return np.where(same, share, np.nan)

    @cached_property
    def surfaces(self) -> Surfaces:
        """Planes of all cubes, in brackets."""
        edges, code = self.cubes.edges, self.known.facts.code
        some = self.pairs.take(self.mixed)
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

    def told(self, cube: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Codes told of `places` (points, dim), in steps of the grid, of some cubes that hold them,
        and brackets to the nearest plane (infinite in cubes without one).
        """
        code, depth = self.surfaces.answer(cube, places / self.wanted)
        plain = code == -2
        corner = self.known.find(self.cubes.corners(cube[plain])[:, 0])
        code[plain] = self.known.facts.code[corner]
        return code, np.where(plain, np.inf, depth)
