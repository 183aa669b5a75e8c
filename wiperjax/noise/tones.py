"""Tones around the turning point of a wipe: does it squeal before V = 0, or after, and how long?

A squeal may live only around the turn, where the strokes are not looked at, among motions that are
none: the tip rides with the glass, flips over, clicks, rings down. What tells a tone from a click
or from ringing is that it LASTS at one level. So the level of the vibration is looked at over time
(rms over `AVERAGE`), and its longest stretch in which it stays within `STEADY`, a factor of two or
6 dB. A free vibration of time constant T leaves 6 dB behind in 0.7 T, 4 to 8 ms of a blade, however
loud it began; a self-excited one stays. A tone that fades with the glass's speed, as it does
before V = 0, counts as long as it fades slowly.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from .spectrum import strongest_lines

AVERAGE = 5e-3  # s, over which the level is taken
STEADY = 2.0  # largest over smallest level of a tone
SIDES = {"before": -1, "after": 1}


def tones(
    vibration: np.ndarray,
    inner: np.ndarray,
    interval: float,
    since: np.ndarray,
    quiet_below: np.ndarray,
) -> dict[str, np.ndarray]:
    """Longest tone before and after V = 0, among all turns of each signal.

    Arguments:

    - `vibration`: mean tip velocity [m/s] of each sample without what is slow, (cells, samples);
        NaN where a cell ended.
    - `inner`: variance of the tip velocity inside each sample, of the same shape.
    - `interval`: time [s] between samples.
    - `since`: time [s] since the nearest V = 0, negative before it, (cells, samples).
    - `quiet_below`: level [m/s] that counts as none, (cells,).

    Returns: `tone_time_before`, `tone_time_after` [s] (0 if there is none) and
    `tone_frequency_before`, `tone_frequency_after` [Hz] (NaN if there is none, or the samples do
    not tell it), (cells,). Each side reaches to the middle of the stroke.
    """
    found = {
        f"tone_{what}_{side}": np.full(len(vibration), np.nan)
        for what in ("time", "frequency")
        for side in SIDES
    }
    width = max(1, round(AVERAGE / interval))
    for k, row in enumerate(vibration):
        if not np.isfinite(row).all():
            continue
        # a running sum of squares may come out below zero by rounding
        level = np.sqrt(np.maximum(uniform_filter1d(row**2 + inner[k], width), 0.0))
        for side, sign in SIDES.items():
            start, length = _longest(level, np.sign(since[k]) == sign, since[k], quiet_below[k])
            found[f"tone_time_{side}"][k] = length * interval
            if length >= 8:
                part = slice(start, start + length)
                line = strongest_lines(row[part], interval, averaged=True, inner=inner[k][part])
                found[f"tone_frequency_{side}"][k] = line.frequency if line.told else np.nan
    return found


def _longest(level, inside, since, quiet_below) -> tuple[int, int]:
    """Start and length, in samples, of the longest steady stretch among the half strokes."""
    best = (0, 0)
    # a half stroke ends where the side changes, and in mid-stroke, where `since` falls back
    border = np.flatnonzero((inside[1:] != inside[:-1]) | (since[1:] < since[:-1])) + 1
    starts, stops = np.r_[0, border], np.r_[border, level.size]
    for start, stop in zip(starts, stops, strict=True):
        if inside[start] and stop - start > best[1]:
            place, length = _steady(level[start:stop], quiet_below)
            best = max(best, (start + place, length), key=lambda part: part[1])
    return best


def _steady(level: np.ndarray, quiet_below: float) -> tuple[int, int]:
    """Longest stretch of `level` above `quiet_below` and within `STEADY`, by bisection."""
    place, shortest, longest = 0, 0, level.size + 1
    if not (level > quiet_below).any():
        return 0, 0
    while longest - shortest > 1:
        size = (shortest + longest) // 2
        # zeros beyond the ends: no stretch reaches there
        low = minimum_filter1d(level, size, mode="constant")
        high = maximum_filter1d(level, size, mode="constant")
        fits = (low > quiet_below) & (high <= STEADY * low)
        if fits.any():
            place, shortest = int(np.argmax(fits)) - size // 2, size
        else:
            longest = size
    return place, shortest
