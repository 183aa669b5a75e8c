"""The virtual grid of a refinement: all points that can be looked at, numbered.

Level k has 2^k (n - 1) + 1 values along an axis of n. The finest level numbers every point of any
level, so that a set of points is a sorted array of whole numbers.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...specs.errors import SpecError


class Grid:
    """The finest grid of a map of some axes after `levels` halvings of its spacing.

    Only axes of two values or more count; of the others there is one value.

    Attributes:
        names: of the axes that count.
        width: spacing of the map in steps of the grid.
        shape: values along each of `names`.
        cells: lengths of the map's cells along each of `names`, over the mean one (`Axis.steps`).
    """

    def __init__(self, axes: Mapping[str, Any], levels: int):
        """Raises: `SpecError` where floating point has no room for so many values. `levels` are no
        more than `Refine.depth` allows: the numbers of points have 64 bits.
        """
        self.axes = dict(axes)
        self.levels = levels
        self.width = 2**levels
        self.names = tuple(name for name, axis in axes.items() if axis.count > 1)
        self.coarse = np.array([axes[name].count for name in self.names], dtype=np.int64)
        self.shape = (self.coarse - 1) * self.width + 1
        self.cells = [axes[name].steps() for name in self.names]
        self.along = {name: values(axis, levels) for name, axis in axes.items()}
        for name, found in self.along.items():
            if not np.all(np.diff(found) * np.sign(found[-1] - found[0]) > 0):
                raise SpecError(
                    f"refine.levels must leave values of axes.{name} that floating point tells "
                    f"apart, but was {levels}"
                )
        self.strides = _strides(self.shape)

    @property
    def dim(self) -> int:
        """Number of axes that count."""
        return len(self.names)

    def flat(self, places: np.ndarray) -> np.ndarray:
        """Numbers (...) of points at `places` (..., dim), steps from the first along each axis."""
        return places @ self.strides

    def places(self, flat: np.ndarray) -> np.ndarray:
        """Places (..., dim) of the points of some numbers (...)."""
        return np.asarray(flat)[..., None] // self.strides % self.shape

    def values(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Values of each axis of the map, edge units, at some points."""
        places = dict(zip(self.names, np.moveaxis(self.places(flat), -1, 0), strict=True))
        zero = np.zeros(np.shape(flat), dtype=np.int64)
        return {name: found[places.get(name, zero)] for name, found in self.along.items()}

    def along_level(self, level: int) -> dict[str, np.ndarray]:
        """Values of each axis at a coarser `level`, edge units."""
        step = 2 ** (self.levels - level)
        return {n: v[:: step if len(v) > 1 else 1] for n, v in self.along.items()}

    def lengths(self, places: np.ndarray) -> np.ndarray:
        """Steps along each axis of the cells of the map that hold the steps from `places`
        (points, dim) on, over the mean ones: a share of an axis is (steps of the grid) times this
        over `shape` - 1.
        """
        cell = np.minimum(places // self.width, self.coarse - 2)
        each = [steps[cell[:, k]] for k, steps in enumerate(self.cells)]
        return np.stack(each, axis=-1)

    def coarse_points(self) -> np.ndarray:
        """Numbers of the points of the map itself, in the order of its cells."""
        each = [np.arange(n) * self.width for n in self.coarse]
        return self.flat(np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, self.dim))

    def level_of(self, flat: np.ndarray) -> np.ndarray:
        """The first level that has each point, 0 for those of the map."""
        places = self.places(flat) | self.width  # no finer than the map itself
        lowest = (places & -places).min(axis=-1)  # the last bit that is set
        return self.levels - np.log2(lowest).astype(np.int64)

    def renumbered(self, flat: np.ndarray, level: int) -> np.ndarray:
        """Numbers of points of this grid in the grid of a `level`, which must have them."""
        strides = _strides((self.coarse - 1) * 2**level + 1)
        return (self.places(flat) >> (self.levels - level)) @ strides

    def from_level(self, index: np.ndarray, level: int) -> np.ndarray:
        """Numbers in this grid of the points `index` of the grid of a coarser `level`."""
        shape = (self.coarse - 1) * 2**level + 1
        places = np.asarray(index)[..., None] // _strides(shape) % shape
        return self.flat(places << (self.levels - level))


def _strides(shape: np.ndarray) -> np.ndarray:
    """Steps between the numbers of neighbours along each axis of a grid, in C order."""
    return np.append(np.cumprod(shape[:0:-1])[::-1], 1).astype(np.int64)


def positions(known: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Positions of the points `index` in the sorted ones `known`, -1 for those not there."""
    place = np.searchsorted(known, index)
    return np.where(np.append(known, -1)[place] == index, place, -1)


def merged(known: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, Callable]:
    """The points of both, sorted, and what joins values of the one, (known,), and of the other,
    (index,), in that order. Of what is in both, those of `index` count.
    """
    keep = ~np.isin(known, index, assume_unique=True)
    every = np.concatenate([known[keep], index])
    order = np.argsort(every)
    return every[order], lambda old, new: np.concatenate([old[keep], new])[order]


def values(axis: Any, level: int) -> np.ndarray:
    """Values of an axis at a level, edge units: between two of the map evenly or geometrically
    spaced, as the axis is; those of the map exactly.
    """
    known = axis.values()
    if len(known) == 1:
        return known
    geometric = axis.spacing == "geometric"
    ends = np.log(np.abs(known)) if geometric else known
    share = np.arange(2**level) / 2**level
    between = (ends[:-1, None] + np.diff(ends)[:, None] * share).ravel()
    found = np.append(np.sign(known[0]) * np.exp(between) if geometric else between, known[-1])
    found[:: 2**level] = known
    return found
