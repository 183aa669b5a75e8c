"""Where between two known points of an edge it is looked at next.

A jump is bisected. Where a stored number crosses a threshold and the mechanism is the same on both
sides, the step is that of a root finder for whole steps of a grid, told round by round: a secant
that lands beyond the root, so that the next one encloses it (the truncation of ITP: Oliveira and
Takahashi, ACM Transactions on Mathematical Software 47 (2021) 5), bisection where secants fail.
Root finders of libraries call the function themselves; here thousands of edges wait for one round.
"""

from collections.abc import Sequence

import numpy as np

SPARE = 2  # looks at an edge that may be more than bisection takes


def crossing(low: np.ndarray, high: np.ndarray, thresholds: Sequence[float]) -> np.ndarray:
    """Where between the ends of edges a number crosses a threshold, as a share of the edge by
    linear interpolation; NaN where it crosses none, or more than one.
    """
    share, count = np.full(low.shape, np.nan), np.zeros(low.shape, dtype=int)
    with np.errstate(invalid="ignore", divide="ignore"):
        for threshold in thresholds:
            hit = (low - threshold) * (high - threshold) <= 0
            hit &= np.isfinite(low) & np.isfinite(high) & (low != high)
            share = np.where(hit, (threshold - low) / (high - low), share)
            count += hit
    return np.where(count == 1, share, np.nan)


def next_step(
    gap: np.ndarray, share: np.ndarray, wanted: np.ndarray, length: np.ndarray, looks: np.ndarray
) -> np.ndarray:
    """Steps of the grid from the lower known point to the one to look at, in [1, gap - 1].

    Arguments:
        gap: steps between the known points, at least 2.
        share: of `crossing`; NaN where the edge is bisected.
        wanted: the gap that is good enough.
        length: of the whole edge.
        looks: points inside the edge that are known.
    """
    root = share * gap
    room = (wanted - 1) / 2
    beyond = np.where(2 * root < gap, np.ceil(root + room), np.floor(root - room))
    slow = gap * 2.0 ** (looks - SPARE) > length
    step = np.where(np.isfinite(share) & ~slow, np.nan_to_num(beyond), gap // 2)
    return np.clip(step, 1, gap - 1).astype(np.int64)
