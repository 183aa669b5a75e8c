"""The border inside a cube: a plane for each of its answers through the crossings on its edges.

The answer at a point is the one on whose side of its plane the point lies deepest. With two answers
in a cube both planes are one.
"""

import numpy as np


class Surfaces:
    """Planes of the cubes whose edges have crossings; lengths in brackets along each axis.

    A plane is n . (x - m) = 0: m is the mean of the crossings, n the direction along the crossed
    edges towards the answer, less what of it lies in the spread of the crossings.

    Attributes:
        cube: cube of each plane, sorted, (planes,).
        code: its answer.
        middle, normal: m and n (planes, dim), n of length 1.
        rest: root mean square distance of the crossings from the plane.
    """

    def __init__(
        self,
        cube: np.ndarray,
        place: np.ndarray,
        axis: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
    ):
        """Of crossings (m,) each, `place` (m, dim): codes `low` before it along `axis`, `high`
        after it.
        """
        count, dim = place.shape
        codes = np.concatenate([low, high]).astype(np.int64)
        owner = np.concatenate([cube, cube])
        spread = int(codes.max(initial=0)) + 2  # codes begin at -1
        key, group = np.unique(owner * spread + codes + 1, return_inverse=True)
        self.cube, self.code = key // spread, key % spread - 1
        planes = len(key)
        towards = np.zeros((2 * count, dim))
        towards[np.arange(count), axis] = -1.0
        towards[count + np.arange(count), axis] = 1.0
        places = np.concatenate([place, place]).astype(float)

        def mean(values):
            total = np.zeros((planes, *values.shape[1:]))
            np.add.at(total, group, values)
            return total / number.reshape(-1, *[1] * (values.ndim - 1))

        number = np.bincount(group, minlength=planes).astype(float)
        self.middle = mean(places)
        off = places - self.middle[group]
        scatter = mean(off[:, :, None] * off[:, None, :])
        guess = mean(towards)
        eye = np.eye(dim) * (1e-6 * np.trace(scatter, axis1=1, axis2=2) + 1e-9)[:, None, None]
        normal = np.linalg.solve(scatter + eye, guess[..., None])[..., 0]
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        self.normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
        squares = np.einsum("pi,pij,pj->p", self.normal, scatter, self.normal)
        self.rest = np.where(size[:, 0] > 0, np.sqrt(np.maximum(squares, 0)), np.inf)

    def answer(self, cube: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Codes of points `place` (points, dim) in cubes, and how deep within the answer each
        lies; -2 in cubes without planes.
        """
        first = np.searchsorted(self.cube, cube)
        last = np.searchsorted(self.cube, cube, side="right")
        code = np.full(len(cube), -2)
        best = np.full(len(cube), -np.inf)
        for k in range(int((last - first).max(initial=0))):
            there = np.flatnonzero(first + k < last)
            plane = first[there] + k
            depth = np.einsum("pi,pi->p", self.normal[plane], place[there] - self.middle[plane])
            better = depth > best[there]
            best[there[better]] = depth[better]
            code[there[better]] = self.code[plane[better]]
        return code, best
