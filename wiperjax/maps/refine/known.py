"""The points that are known, found by their number, or along a line of the grid."""

from typing import NamedTuple

import numpy as np

from .grid import Grid, merged, positions


class Facts(NamedTuple):
    """What a search knows of points, (points,) each."""

    code: np.ndarray  # of the answer: points of one code lie on one side of a border
    number: np.ndarray  # a threshold of which may be the border; NaN where there is none
    mechanism: np.ndarray  # where it differs, no number is interpolated
    settled: np.ndarray  # bool
    longer: np.ndarray  # bool: looked at with the longer window

    def take(self, which: np.ndarray) -> "Facts":
        return Facts(*(values[which] for values in self))


class Pairs(NamedTuple):
    """Neighbouring known points along edges, (pairs,) each."""

    edge: np.ndarray
    low: np.ndarray  # positions in `Known.index`
    high: np.ndarray
    gap: np.ndarray  # steps of the grid between them

    def take(self, which: np.ndarray) -> "Pairs":
        return Pairs(*(values[which] for values in self))


class Known:
    """Points and their facts, sorted by number."""

    def __init__(self, grid: Grid, index: np.ndarray, facts: Facts):
        self.grid = grid
        order = np.argsort(index)
        self.index, self.facts = np.asarray(index)[order], facts.take(order)
        self._orders: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def put(self, index: np.ndarray, facts: Facts) -> None:
        """Adds points; those that are known are replaced."""
        self.index, join = merged(self.index, index)
        self.facts = Facts(*map(join, self.facts, facts))
        self._orders.clear()

    def find(self, index: np.ndarray) -> np.ndarray:
        """Positions of the points `index`, -1 for those that are not known."""
        return positions(self.index, index)

    def lacking(self, index: np.ndarray) -> np.ndarray:
        """Those of `index` that are not known, each once, sorted."""
        index = np.unique(index)
        return index[self.find(index) < 0]

    def pairs(self, axis: int, start: np.ndarray, length: np.ndarray) -> Pairs:
        """Neighbouring known points on edges along an axis, given by first point and length.

        `Pairs.edge` is the position of the edge in `start`.
        """
        keys, order = self._sorted(axis)
        first = self._key(start, axis)
        low = np.searchsorted(keys, first)
        count = np.maximum(np.searchsorted(keys, first + length, side="right") - low - 1, 0)
        edge = np.repeat(np.arange(len(start)), count)
        within = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        here = low[edge] + within
        return Pairs(edge, order[here], order[here + 1], keys[here + 1] - keys[here])

    def _sorted(self, axis: int) -> tuple[np.ndarray, np.ndarray]:
        if axis not in self._orders:
            keys = self._key(self.index, axis)
            order = np.argsort(keys)
            self._orders[axis] = keys[order], order
        return self._orders[axis]

    def _key(self, flat: np.ndarray, axis: int) -> np.ndarray:
        """Numbers as they would be if `axis` varied fastest: a line along it is a run of them."""
        stride, count = self.grid.strides[axis], self.grid.shape[axis]
        outer, inner = np.divmod(flat, stride)
        return (outer // count * stride + inner) * count + outer % count
