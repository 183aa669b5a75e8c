"""The cubes of a refinement: boxes between points of the grid, halved where that is needed."""

import itertools
from typing import NamedTuple

import numpy as np

from .grid import Grid


class Edges(NamedTuple):
    """Edges of cubes, each once, (edges,) each; `of` the cubes (cubes, dim 2^(dim - 1))."""

    axis: np.ndarray
    start: np.ndarray  # number of the first point
    length: np.ndarray  # steps of the grid
    of: np.ndarray


class Cubes:
    """Cubes that fill a part of a grid without gaps: places of their first corners, and sizes."""

    def __init__(self, grid: Grid, origin: np.ndarray, size: np.ndarray):
        self.grid, self.origin, self.size = grid, origin, size
        number = grid.flat(origin)
        self._sorted = {}
        for one in np.unique(size)[::-1]:
            which = np.flatnonzero(size == one)
            order = which[np.argsort(number[which])]
            self._sorted[int(one)] = number[order], order
        self.edges = self._edges()

    @classmethod
    def of_map(cls, grid: Grid, low: np.ndarray, high: np.ndarray) -> "Cubes":
        """Cubes of the map from cell `low` up to cell `high` along each axis."""
        each = [np.arange(a, b) for a, b in zip(low, high, strict=True)]
        cells = np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, grid.dim)
        return cls(grid, cells * grid.width, np.full(len(cells), grid.width))

    def __len__(self) -> int:
        return len(self.size)

    @property
    def volume(self) -> np.ndarray:
        """Volume of each in the scales of the axes, in steps of mean length."""
        stretch = self.grid.lengths(self.origin).prod(axis=1)
        return self.size.astype(float) ** self.grid.dim * stretch

    def corners(self, which: np.ndarray | slice = slice(None), parts: int = 1) -> np.ndarray:
        """Numbers of the corners of cubes, (cubes, 2^dim), or of the lattice that cuts each into
        `parts` along each axis, (cubes, (parts + 1)^dim).
        """
        steps = np.array(list(itertools.product(range(parts + 1), repeat=self.grid.dim)))
        places = self.origin[which, None, :] + steps * (self.size[which, None, None] // parts)
        return self.grid.flat(places)

    def locate(self, places: np.ndarray) -> np.ndarray:
        """The cube that holds the step from each of `places` (points, dim) on, -1 if none does."""
        places = np.minimum(places, self.grid.shape - 2)
        found = np.full(len(places), -1)
        inside = (places >= 0).all(axis=1)
        for size, (numbers, order) in self._sorted.items():
            number = self.grid.flat(places // size * size)
            place = np.minimum(np.searchsorted(numbers, number), len(numbers) - 1)
            hit = inside & (numbers[place] == number)
            found[hit] = order[place[hit]]
        return found

    def touching(self, which: np.ndarray) -> np.ndarray:
        """Cubes that share a face, an edge or a corner with one of a mask, and these."""
        found = which.copy()
        for step in itertools.product((-1, 0, 1), repeat=self.grid.dim):
            beside = np.where(np.array(step) > 0, self.size[:, None], step)
            other = self.locate(self.origin + beside)  # each looks, for it may touch many smaller
            there = other >= 0
            found[there] |= which[other[there]]
            found[other[there & which]] = True
        return found

    def split(self, which: np.ndarray) -> "Cubes":
        """The cubes with those of a mask halved along each axis."""
        steps = np.array(list(itertools.product((0, 1), repeat=self.grid.dim)))
        half = self.size[which] // 2
        children = (self.origin[which, None, :] + steps * half[:, None, None]).reshape(
            -1, self.grid.dim
        )
        origin = np.concatenate([self.origin[~which], children])
        return Cubes(
            self.grid, origin, np.concatenate([self.size[~which], np.repeat(half, len(steps))])
        )

    def _edges(self) -> Edges:
        dim = self.grid.dim
        each = 2 ** (dim - 1)
        of = np.empty((len(self), dim * each), dtype=np.int64)
        found, count = [], 0
        for axis, size in itertools.product(range(dim), self._sorted):
            steps = np.array(
                [s for s in itertools.product((0, 1), repeat=dim) if s[axis] == 0], dtype=np.int64
            )
            which = self._sorted[size][1]
            start = self.grid.flat(self.origin[which, None, :] + steps * size)
            unique, inverse = np.unique(start, return_inverse=True)
            of[which, axis * each : (axis + 1) * each] = count + inverse.reshape(start.shape)
            found.append((np.full(len(unique), axis), unique, np.full(len(unique), size)))
            count += len(unique)
        axes, starts, lengths = (np.concatenate(each) for each in zip(*found, strict=True))
        return Edges(axes, starts, lengths, of)
