"""Maxima of motions of which samples are known, and rates there."""

import numpy as np

PEAKS = 16  # maxima kept of each motion, spread over their heights if there are more
SAME = 1e-5  # of the range: how near a maximum of a settled motion comes back


def peaks(first, highest, step, flat: float) -> np.ndarray:
    """Return `maxima` of every motion, (ways, values, PEAKS), NaN-padded.

    ``first`` (ways, values, samples, 2) is the first coordinate with its rate.
    """
    found = np.full((*highest.shape, PEAKS), np.nan)
    for at in np.ndindex(highest.shape):
        place, rate = first[at].T
        highs = maxima(place, rate, float(step[at]), float(highest[at]), flat)
        if len(highs) > PEAKS:
            highs = highs[np.linspace(0, len(highs) - 1, PEAKS).round().astype(int)]
        found[at][: len(highs)] = highs
    return found


def maxima(position, velocity, step: float, highest: float, flat: float) -> np.ndarray:
    """Return the maxima of a coordinate sampled every ``step`` [s], the largest first: ``highest``.

    The others are those of the cubics between samples. One that lies below a larger one by no more
    than `SAME`, or than it may be off where an event bends the motion, is the same again. Where the
    range is below ``flat``, return the mean.
    """
    if not np.all(np.isfinite(position)):
        return np.zeros(0)
    size = np.ptp(position)
    if size < flat:
        return np.array([position.mean()])
    at = np.flatnonzero((velocity[:-1] > 0) & (velocity[1:] <= 0))
    a, b, up, down = position[at], position[at + 1], velocity[at], velocity[at + 1]
    up, down, rise = step * up, step * down, b - a
    # rate of the cubic at the share s: up + 2 bend s + 3 twist s^2
    bend, twist = 3 * rise - 2 * up - down, up + down - 2 * rise
    root = np.sqrt(np.maximum(bend**2 - 3 * twist * up, 0.0))
    # of the two ways to write it that which does not cancel
    share = np.where(bend > 0, bend + root, up) / np.where(bend > 0, -3 * twist, root - bend)
    tops = a + share * (up + share * (bend + share * twist))
    bent = np.pad(np.diff(velocity, 3), (1, 1), mode="edge")
    off = np.maximum(SAME * size, step / 16 * np.abs(bent[at]))
    kept = [highest]
    for k in np.argsort(-tops)[1:]:
        if kept[-1] - tops[k] > off[k]:
            kept.append(float(tops[k]))
    return np.array(kept)
