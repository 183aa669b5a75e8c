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
from scipy.ndimage import uniform_filter1d

from .spectrum import strongest_lines

AVERAGE = 5e-3  # s, over which the level is taken
STEADY = 2.0  # largest over smallest level of a tone
CHUNK = 2**16  # samples at once: levels of their stretches are twenty times as many
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
    rows, width = max(1, CHUNK // vibration.shape[1]), max(1, round(AVERAGE / interval))
    finite = np.flatnonzero(np.isfinite(vibration).all(axis=1))
    start, length = np.zeros((2, len(SIDES), len(vibration)), int)
    for part in (finite[k : k + rows] for k in range(0, finite.size, rows)):
        # a running sum of squares may come out below zero by rounding
        square = uniform_filter1d(vibration[part] ** 2 + inner[part], width, axis=1)
        level = np.sqrt(np.maximum(square, 0.0))
        stretch = np.minimum(_steady(level, quiet_below[part, None]), _rest(since[part]))
        for side, sign in enumerate(SIDES.values()):
            mine = np.where(np.sign(since[part]) == sign, stretch, 0)
            start[side, part], length[side, part] = mine.argmax(axis=1), mine.max(axis=1)
    found, pitch = {}, _pitch(vibration, inner, interval, start, length)
    for side, samples, frequency in zip(SIDES, length, pitch, strict=True):
        found[f"tone_time_{side}"] = np.full(len(vibration), np.nan)
        found[f"tone_time_{side}"][finite] = samples[finite] * interval
        found[f"tone_frequency_{side}"] = frequency
    return found


def _rest(since: np.ndarray) -> np.ndarray:
    """Samples from each one to the end of its half stroke, (cells, samples)."""
    count = since.shape[1]
    place = np.arange(count)
    # it ends where the side changes, and in mid-stroke, where `since` falls back
    side = np.sign(since)
    ends = (side[:, 1:] != side[:, :-1]) | (since[:, 1:] < since[:, :-1])
    ends = np.concatenate([np.where(ends, place[1:], count), np.full((len(since), 1), count)], 1)
    return np.minimum.accumulate(ends[:, ::-1], axis=1)[:, ::-1] - place


def _steady(level: np.ndarray, quiet_below: np.ndarray) -> np.ndarray:
    """Length in samples of the longest stretch from each sample on in which `level` stays above
    `quiet_below` (cells, 1) and within `STEADY`, (cells, samples).

    Every part of such a stretch is one itself, so it is made of stretches of 2^k samples, the long
    ones first, whose smallest and largest levels are those of their halves.
    """
    count = level.shape[1]
    lowest, highest = [level], [level]
    while 2 * (half := count + 1 - lowest[-1].shape[1]) <= count:
        lowest.append(np.minimum(lowest[-1][:, :-half], lowest[-1][:, half:]))
        highest.append(np.maximum(highest[-1][:, :-half], highest[-1][:, half:]))
    start = np.arange(count)
    end = np.broadcast_to(start, level.shape)
    low, high = np.full_like(level, np.inf), np.zeros_like(level)
    for lows, highs in zip(lowest[::-1], highest[::-1], strict=True):
        size = count + 1 - lows.shape[1]
        next_ = np.minimum(end, count - size)
        lower = np.minimum(low, np.take_along_axis(lows, next_, 1))
        higher = np.maximum(high, np.take_along_axis(highs, next_, 1))
        fits = (next_ == end) & (lower > quiet_below) & (higher <= STEADY * lower)
        end = np.where(fits, end + size, end)
        low, high = np.where(fits, lower, low), np.where(fits, higher, high)
    return end - start


def _pitch(signal, inner, interval: float, start: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Frequency [Hz] of some stretches of each signal, (stretches, cells) as `start` and `length`;
    NaN where the samples do not tell.
    """
    found = np.full(length.shape, np.nan)
    for samples in np.unique(length[length >= 8]):  # stretches of one length together
        stretch, row = np.nonzero(length == samples)
        here = row[:, None], start[stretch, row][:, None] + np.arange(samples)
        line = strongest_lines(signal[here], interval, averaged=True, inner=inner[here])
        found[stretch, row] = np.where(line.told, line.frequency, np.nan)
    return found
