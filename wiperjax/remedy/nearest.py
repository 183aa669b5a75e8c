"""Points of a box that meet a demand, near to a given one, where what is demanded may jump.

A search by derivatives stops at a jump, on whichever side of it it began. So points are spread over
the whole box first, and the nearest of those that meet the demand are drawn in, by points scattered
about them ever more closely.
"""

from collections.abc import Callable

import numpy as np
from scipy.stats import qmc

AT_ONCE = 4096  # points; a power of two, as Sobol's sequence wants it
ROUNDS = 20  # of points scattered about the nearest ones
WIDTH = 0.1  # of the first of them, in shares of the ranges
SHRINKS = 0.7  # each is so much narrower than the last: slow enough to go along an edge
APART = 0.1  # shares between two points that are drawn in

Excess = Callable[[np.ndarray], np.ndarray]  # shares (points, n) -> (points,): met where <= 0


def distance(shares, given) -> np.ndarray:
    """Squared distance of ``shares`` (..., n) from those ``given``, (...,)."""
    return np.sum((shares - given) ** 2, axis=-1)


def best_first(excess, cost) -> np.ndarray:
    """Order of points: those that meet the demand by their cost, then the others by their excess;
    along the last axis."""
    return np.lexsort((cost, np.where(excess <= 0, -np.inf, excess)), axis=-1)


def nearest(excess: Excess, given: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Return ``count`` points, (count, n), that meet the demand near ``given`` (n,), or, where too
    few are found that do, come nearest to meeting it."""
    inside = np.clip(given, 0, 1)
    # the nearer to the given point, the denser
    draws = qmc.Sobol(len(given) + 1, rng=seed).random(AT_ONCE)
    shares = inside + draws[:, :1] * (draws[:, 1:] - inside)
    shares[0] = inside
    rank = best_first(excess(shares), distance(shares, given))
    points = _apart(shares[rank], count)
    random, width = np.random.default_rng(seed), WIDTH
    for _ in range(ROUNDS):
        around = width * random.uniform(-1, 1, (count, -(-AT_ONCE // count), len(given)))
        around[:, 0] = 0
        tried = np.clip(points[:, None] + around, 0, 1)
        over = excess(tried.reshape(-1, len(given))).reshape(tried.shape[:2])
        first = best_first(over, distance(tried, given))[:, 0]
        points, width = tried[np.arange(count), first], SHRINKS * width
    return points


def _apart(shares: np.ndarray, count: int) -> np.ndarray:
    """Return the first ``count`` of ``shares`` that lie apart; if they are fewer, the next ones."""
    chosen: list[int] = []
    for i, share in enumerate(shares):
        if len(chosen) < count and np.all(distance(shares[chosen], share) > APART**2):
            chosen.append(i)
    others = (i for i in range(len(shares)) if i not in chosen)
    chosen += [i for i, _ in zip(others, range(count - len(chosen)), strict=False)]
    return shares[np.resize(chosen, count)]
