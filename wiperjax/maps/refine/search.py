"""What a refinement looks at next, and why: requests, each after the answers to those before.

    edges      neighbouring points of unlike answer are brought closer, until the bracket is reached
    stretches  the longest stretch without a change on such an edge is looked at once more in its
               middle: a border that is no single crossing shows there
    tests      two points on either side of the border inside each cube; where the plane through the
               crossings is wrong, or no plane fits them, the cube is halved (`judge`)
    neighbours a point in each cell of the map beside a cube with a border, and
    probes     random points in cubes without one; a cube with an unlike answer in it is halved

A round asks for all that is known to be needed, wherever: a request of few points costs almost what
one of many does. It depends on the answers to those before alone, so a search that is repeated with
stored answers arrives where it was.
"""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...specs.refine import Refine
from .grid import Grid
from .judge import bent, meeting, tests
from .known import Facts
from .outcome import Outcome, share_of
from .state import State
from .step import next_step


class Request(NamedTuple):
    """Points to look at, by their number in the grid, sorted; with the longer window or not."""

    index: np.ndarray
    longer: bool


Answer = tuple[np.ndarray, Facts]
"""The points of a request, sorted, or fewer of them where the budget is spent, and their facts."""


class _Spent(Exception):
    """The budget is spent."""


class Search(State):
    """A refinement: `run` does it, `outcome` says what was found."""

    def __init__(self, grid: Grid, settings: Refine, thresholds: Any, facts: Facts):
        """`thresholds` of `Facts.number`; `facts` of the points of the map, in its order."""
        super().__init__(grid, settings, thresholds, facts)
        self.used = 0
        self.spent = False
        self.shares: dict[str, tuple[int, int, float]] = {}
        self._probed: set[int] = set()
        self._random = np.random.default_rng(settings.seed)

    def run(self, answer: Callable[[Request], Answer]) -> None:
        """Does it until nothing is left to look at, or `answer` tells of fewer points than that."""
        asked, told = self._requests(), None
        while True:
            try:
                request = asked.send(told)
            except StopIteration:
                return
            told = answer(request)

    def _requests(self) -> Any:
        """Generator of `Request`; it is sent each `Answer`."""
        try:
            yield from self._rounds()
            probes, codes = self._in_cubes(self.now.pure)
            yield from self._look(probes)
            self.shares["probe"] = share_of(self.codes(probes) != codes)
            yield from self._rounds()
            probes, codes = self._in_cubes(~self.now.pure)
            sure = self.sure(self.grid.places(probes))
            yield from self._look(probes)
            wrong = self.codes(probes) != codes
            self.shares["border_probe"] = share_of(wrong)
            self.shares["sure_probe"] = share_of(wrong[sure])
            yield from self._rounds()
        except _Spent:
            self.spent = True

    def outcome(self) -> Outcome:
        """What was found."""
        return Outcome.of(self)

    def _rounds(self) -> Any:
        """Looks wherever there is a reason to, until there is none."""
        while True:
            which = self._halves()
            corners = self.cubes.corners(which, 2).ravel()
            looks = [self._closer(), self._stretches(), tests(self.now)[0], self._neighbours()]
            short = self.known.index[self.now.short]
            found = yield from self._look(np.concatenate([*looks, corners]), short)
            if which.any():
                self.split(which)
            elif not found:
                return

    # -- looking --

    def _look(self, index: np.ndarray, short: np.ndarray | None = None) -> Any:
        """Looks at those of `index` that are not known, and with the longer window at those of them
        that are not settled and at `short`; returns whether there were any.
        """
        index = self.known.lacking(index)
        yield from self._ask(index, False)
        again = np.zeros(0, dtype=np.int64) if short is None else short
        if self.settings.lengthen > 1:
            again = np.union1d(again, index[~self.known.facts.settled[self.known.find(index)]])
        yield from self._ask(again, True)
        return len(index) + len(again) > 0

    def _ask(self, index: np.ndarray, longer: bool) -> Any:
        if not len(index):
            return
        told, facts = yield Request(index, longer)
        self.used += len(told)
        self.learn(told, facts._replace(longer=np.full(len(told), longer)))
        if len(told) < len(index):
            raise _Spent

    # -- edges --

    def _closer(self) -> np.ndarray:
        """Points between unlike neighbours that are to be brought closer."""
        now, edges = self.now, self.cubes.edges
        looks = np.bincount(now.pairs.edge, minlength=len(edges.axis)) - 1
        some = now.pairs.take(now.apart)
        axis, length = edges.axis[some.edge], edges.length[some.edge]
        wanted, looks = self.wanted[axis], looks[some.edge]
        step = next_step(some.gap, now.share(some), wanted, length, looks)
        return self.known.index[some.low] + step * self.grid.strides[axis]

    def _stretches(self) -> np.ndarray:
        """Middles of stretches without a change, of at least half an edge that has one."""
        now, edges, pairs = self.now, self.cubes.edges, self.now.pairs
        changes = np.bincount(pairs.edge[now.mixed], minlength=len(edges.axis)) > 0
        done = changes & ~now.crowded & ~now.open
        axis, length = edges.axis[pairs.edge], edges.length[pairs.edge]
        long = ~now.mixed & done[pairs.edge] & (2 * pairs.gap >= length)
        long &= pairs.gap > 2 * self.wanted[axis]
        low, gap = self.known.index[pairs.low[long]], pairs.gap[long]
        return low + gap // 2 * self.grid.strides[axis[long]]

    # -- cubes --

    def _halves(self) -> np.ndarray:
        """Which cubes are to be halved."""
        least = self.grid.width >> min(self.settings.splits, self.grid.levels)
        ready = (self.cubes.size > least) & ~self.now.irregular & ~self.now.busy
        return ready & (bent(self.now) | meeting(self.now))

    def _neighbours(self) -> np.ndarray:
        """A point in each cell of one answer, not halved, beside a cube with a border, once."""
        pure = self.now.pure
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
        volume = self.cubes.volume[cubes]
        drawn = self._random.choice(cubes, self.settings.probes, p=volume / volume.sum())
        places = np.unique(self._inside(drawn), axis=0)
        code, _ = self.answer(places)
        return self.grid.flat(places), code
