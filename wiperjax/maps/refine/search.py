"""What a refinement looks at next, and why: a generator of requests that is sent the answers.

    edges      neighbouring points of unlike answer are brought closer, until the bracket is reached
    stretches  the longest stretch without a change on such an edge is looked at once more in its
               middle: a border that is no single crossing shows there
    surfaces   two points on either side of the border inside each cube; where the plane through the
               crossings is wrong, or no plane fits them, the cube is halved
    neighbours a point in each cell of the map beside a cube with a border, and
    probes     random points in cubes without one; a cube with an unlike answer in it is halved

A request depends on the answers to those before alone, so a search that is repeated with stored
answers arrives where it was.
"""

import itertools
from typing import Any, NamedTuple

import numpy as np

from ...specs.refine import Refine
from .grid import Grid
from .known import Facts
from .outcome import Outcome, share_of
from .state import State
from .step import next_step
from .surface import Surfaces

OFF = 1.5  # brackets from the plane at which a surface is tested
UNCLEAR = 1.0  # brackets: root mean square distance of crossings that no plane fits
CLEAR = 0.75  # brackets: a test closer to the plane would say nothing


class Request(NamedTuple):
    """Points to look at, by their number in the grid, sorted; with the longer window or not."""

    index: np.ndarray
    longer: bool


class _Spent(Exception):
    """The budget is spent."""


class Search(State):
    """A refinement: `requests` does it, `outcome` says what was found."""

    def __init__(self, grid: Grid, settings: Refine, thresholds: Any, facts: Facts):
        """`thresholds` of `Facts.number`; `facts` of the points of the map, in its order."""
        super().__init__(grid, settings, thresholds, facts)
        self.used = 0
        self.spent = False
        self.left = 0  # cubes that a test found wrong and that are not halved any more
        self.farthest = 0.0  # brackets from the plane, of border probes that were wrong
        self.shares: dict[str, tuple[int, int, float]] = {}
        self._probed: set[int] = set()
        self._random = np.random.default_rng(settings.seed)

    def requests(self) -> Any:
        """Generator of `Request`; it is sent the `Facts` of their points."""
        try:
            drawn = False
            while True:
                yield from self._sharpen()
                if (yield from self._halve()):
                    continue
                looks = [self._stretches(), self._tests()[0], self._neighbours()]
                if not drawn:
                    probes, codes = self._in_cubes(self.pure())
                    looks.append(probes)
                found = yield from self._look(np.concatenate(looks))
                if not drawn:
                    drawn = True
                    self.shares["probe"] = share_of(self.codes(probes) != codes)
                elif not found:
                    break
            mixed, codes = self._in_cubes(~self.pure())
            _, depth = self.answer(self.grid.places(mixed))
            yield from self._look(mixed)
            wrong = self.codes(mixed) != codes
            self.shares["border_probe"] = share_of(wrong)
            self.farthest = float(depth[wrong].max(initial=0.0))
        except _Spent:
            self.spent = True
        self._halves()  # counts what is left

    def outcome(self) -> Outcome:
        """What was found."""
        pairs, edges = self.pairs(), self.cubes.edges
        mixed, irregular = self.mixed(pairs)
        return Outcome.of(self, pairs.take(mixed), irregular[pairs.edge[mixed]], edges)

    # -- looking --

    def _look(self, index: np.ndarray) -> Any:
        """Looks at those of `index` that are not known; returns how many those were."""
        index = self.known.lacking(index)
        yield from self._ask(index, False)
        if self.settings.lengthen > 1:
            unsettled = index[~self.known.facts.settled[self.known.find(index)]]
            yield from self._ask(unsettled, True)
        return len(index)

    def _ask(self, index: np.ndarray, longer: bool) -> Any:
        room = max(0, self.settings.max_cells - self.used)
        over = len(index) > room
        if over:  # spread over all that was asked for
            index = index[np.linspace(0, len(index) - 1, room).astype(int)] if room else index[:0]
        if len(index):
            self.used += len(index)
            facts = yield Request(index, longer)
            self.known.put(index, facts._replace(longer=np.full(len(index), longer)))
        if over:
            raise _Spent

    # -- edges --

    def _sharpen(self) -> Any:
        """Brings unlike neighbours as close as is wanted."""
        while True:
            pairs = self.pairs()
            mixed, irregular = self.mixed(pairs)
            edges = self.cubes.edges
            mixed &= ~irregular[pairs.edge]
            if self.settings.lengthen > 1:
                ends = np.unique(np.concatenate([pairs.low[mixed], pairs.high[mixed]]))
                facts = self.known.facts
                short = ends[~facts.settled[ends] & ~facts.longer[ends]]
                if len(short):
                    yield from self._ask(self.known.index[short], True)
                    continue
            axis = edges.axis[pairs.edge]
            wide = mixed & (pairs.gap > self.wanted[axis])
            if not wide.any():
                return
            looks = np.bincount(pairs.edge, minlength=len(edges.axis)) - 1
            some, edge = pairs.take(wide), pairs.edge[wide]
            step = next_step(
                some.gap, self.share(some), self.wanted[axis[wide]], edges.length[edge],
                looks[edge],
            )  # fmt: skip
            yield from self._look(self.known.index[some.low] + step * self.grid.strides[axis[wide]])

    def _stretches(self) -> np.ndarray:
        """Middles of stretches without a change, of at least half an edge that has one."""
        pairs, edges = self.pairs(), self.cubes.edges
        mixed, irregular = self.mixed(pairs)
        changes = np.bincount(pairs.edge[mixed], minlength=len(edges.axis)) > 0
        axis, length = edges.axis[pairs.edge], edges.length[pairs.edge]
        long = ~mixed & changes[pairs.edge] & ~irregular[pairs.edge] & (2 * pairs.gap >= length)
        long &= pairs.gap > 2 * self.wanted[axis]
        low, gap = self.known.index[pairs.low[long]], pairs.gap[long]
        return low + gap // 2 * self.grid.strides[axis[long]]

    # -- cubes --

    def _tests(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, Surfaces]:
        """Points on either side of the planes, their cubes, the answers expected there."""
        surfaces = self.surfaces()
        cube = np.repeat(surfaces.cube, 2)
        off = OFF * surfaces.normal[:, None, :] * np.array([-1.0, 1.0])[:, None]
        place = (surfaces.middle[:, None, :] + off).reshape(-1, self.grid.dim) * self.wanted
        low = self.cubes.origin[cube]
        place = np.clip(np.rint(place), low, low + self.cubes.size[cube, None]).astype(np.int64)
        code, depth = surfaces.answer(cube, place / self.wanted)
        good = (depth >= CLEAR) & np.repeat(surfaces.rest <= UNCLEAR, 2) & ~self.irregular()[cube]
        return self.grid.flat(place[good]), cube[good], code[good], surfaces

    def _halves(self) -> np.ndarray:
        """Which cubes are to be halved; counts those that are not any more, though wrong."""
        wrong = np.zeros(len(self.cubes), dtype=bool)
        index, cube, code, surfaces = self._tests()
        place = self.known.find(index)
        wrong[cube[(place >= 0) & (self.known.facts.code[place] != code)]] = True
        wrong[surfaces.cube[surfaces.rest > UNCLEAR]] = True
        wrong |= self._surprised()
        least = self.grid.width >> min(self.settings.splits, self.grid.levels)
        allowed = wrong & (self.cubes.size > least) & ~self.irregular()
        self.left = int((wrong & ~allowed).sum())
        return allowed

    def _surprised(self) -> np.ndarray:
        """Which cubes of one answer on their edges hold a point of another."""
        places = self.grid.places(self.known.index)
        pure, code = self.pure(), self.codes(self.cubes.corners()[:, 0])
        found = np.zeros(len(self.cubes), dtype=bool)
        for back in itertools.product((0, 1), repeat=self.grid.dim):
            cube = self.cubes.locate(places - np.array(back))
            unlike = (cube >= 0) & pure[cube] & (code[cube] != self.known.facts.code)
            found[cube[unlike]] = True
        return found

    def _halve(self) -> Any:
        """Halves cubes; returns whether there were any."""
        which = self._halves()
        if not which.any():
            return False
        yield from self._look(self.cubes.corners(which, 2).ravel())
        self.cubes = self.cubes.split(which)
        return True

    def _neighbours(self) -> np.ndarray:
        """A point in each cell of one answer, not halved, beside a cube with a border, once."""
        pure = self.pure()
        origin, size = self.cubes.origin[~pure], self.cubes.size[~pure, None]
        found = []
        for axis, side in itertools.product(range(self.grid.dim), (0, 1)):
            place = origin + size // 2
            place[:, axis] = origin[:, axis] + size[:, 0] if side else origin[:, axis] - 1
            inside = place[:, axis] < self.grid.shape[axis] - 1
            cube = self.cubes.locate(place[inside])
            found.append(cube[(cube >= 0) & pure[cube]])
        cube = np.unique(np.concatenate(found))
        cube = cube[self.cubes.size[cube] == self.grid.width]
        number = self.grid.flat(self.cubes.origin[cube])
        fresh = np.array([n not in self._probed for n in number.tolist()], dtype=bool)
        self._probed.update(number.tolist())
        return self.grid.flat(self._inside(cube[fresh & (self.grid.width > 1)]))

    def _inside(self, cube: np.ndarray) -> np.ndarray:
        """A random place inside each of some cubes, (cubes, dim)."""
        size = self.cubes.size[cube, None]
        return self.cubes.origin[cube] + self._random.integers(1, size, (len(cube), self.grid.dim))

    def _in_cubes(self, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Random points, evenly in the volume of cubes of a mask, and the answers expected."""
        cubes = np.flatnonzero(which & (self.cubes.size > 1))
        if not len(cubes) or not self.settings.probes:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        volume = self.cubes.size[cubes].astype(float) ** self.grid.dim
        drawn = self._random.choice(cubes, self.settings.probes, p=volume / volume.sum())
        places = np.unique(self._inside(drawn), axis=0)
        code, _ = self.answer(places)
        return self.grid.flat(places), code
