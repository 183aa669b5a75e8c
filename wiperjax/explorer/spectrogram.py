"""The level of a motion over time and frequency as images for a browser."""

from typing import Any

import numpy as np

from ..plots.runs.levels import Levels

LEVELS = 60.0  # dB that are shown
SHADES = 250  # steps of their colours
MOST_ROWS, MOST_COLUMNS = 256, 400  # about as many as a screen has


def level_images(found: Levels) -> dict[str, Any]:
    """Shades of levels with their places, columns of a source.

    An image draws its columns equally wide, and those at both ends of a run are wider than the
    others: each of these is an image of its own. Where there are more rows or columns than a screen
    has, one shows the highest level of those it stands for: a tone is one row wide.
    """
    row, last = float(found.frequency[1] - found.frequency[0]), found.time.size - 2
    low, high = (float(found.frequency[k] + s * row) for k, s in ((0, -0.5), (-1, 0.5)))  # middles
    spans = [(0, 1), (1, last), (max(last, 1), last + 1)]
    spans = [(first, stop) for first, stop in spans if first < stop]
    rows = _highest(found.decibels, 0, MOST_ROWS)
    levels = [_highest(rows[:, slice(*span)], 1, MOST_COLUMNS) for span in spans]
    shares = [(one - found.peak) / LEVELS + 1 for one in levels]
    return {
        "image": [np.clip(SHADES * one, 0, SHADES - 1).astype(np.uint8) for one in shares],
        "t": [float(found.time[first]) for first, _ in spans],
        "width": [float(found.time[stop] - found.time[first]) for first, stop in spans],
        "f": [low] * len(spans),
        "height": [high - low] * len(spans),
    }


def _highest(levels: np.ndarray, axis: int, most: int) -> np.ndarray:
    """The highest of levels beside each other, so that at most so many are left along an axis."""
    size = levels.shape[axis]
    count = min(size, most)
    return np.maximum.reduceat(levels, np.arange(count) * size // count, axis=axis)
