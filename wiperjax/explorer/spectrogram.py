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
    others: each of these is an image of its own.
    """
    row, last = float(found.frequency[1] - found.frequency[0]), found.time.size - 2
    low, high = (float(found.frequency[k] + s * row) for k, s in ((0, -0.5), (-1, 0.5)))  # middles
    rows = _spread(0, found.frequency.size, MOST_ROWS)
    spans = [(0, 1), (1, last), (max(last, 1), last + 1)]
    spans = [(first, stop) for first, stop in spans if first < stop]
    cells = [np.ix_(rows, _spread(*span, MOST_COLUMNS)) for span in spans]
    shares = [(found.decibels[these] - found.peak) / LEVELS + 1 for these in cells]
    return {
        "image": [np.clip(SHADES * one, 0, SHADES - 1).astype(np.uint8) for one in shares],
        "t": [float(found.time[first]) for first, _ in spans],
        "width": [float(found.time[stop] - found.time[first]) for first, stop in spans],
        "f": [low] * len(spans),
        "height": [high - low] * len(spans),
    }


def _spread(first: int, stop: int, most: int) -> np.ndarray:
    """Places from `first` up to `stop`, of these at most so many, evenly spread."""
    count = min(stop - first, most)
    return first + ((np.arange(count) + 0.5) * (stop - first) / count).astype(int)
