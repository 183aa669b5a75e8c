"""What a motion over one period looks like: its events and regimes, turning points and extremes."""

import numpy as np

from .results import Event, Regime
from .shooting import Stretch


def words(motion: Stretch) -> tuple[str, str]:
    """Return the events of a motion and its regimes, in order, as words.

    Bounces that end in a completed sequence count as one: their number is that of the resolution.
    """
    count = int(motion.events.count)
    if bool(motion.overflow):
        return f"more than {len(motion.events.time)} events", ""
    kinds = [Event(int(k)) for k in motion.events.kind[:count]]
    kept: list[str] = []
    for kind in kinds:
        if kind == Event.ZENO:
            while kept and kept[-1] == "impact":
                kept.pop()
        kept.append(kind.name.lower())
    codes = [int(motion.regimes[0]), *(int(r) for r in motion.events.after[:count])]
    names = [Regime(r).name.lower() for r in codes]
    changed = [b for a, b in zip([None, *names], names, strict=False) if a != b]
    return " ".join(kept), " ".join(changed)


def smooth_intervals(motion: Stretch) -> np.ndarray:
    """Whether each interval between samples is free of events, (samples - 1,)."""
    times = motion.events.time[: int(motion.events.count)]
    holding = np.clip(np.searchsorted(motion.times, times) - 1, 0, len(motion.times) - 2)
    free = np.ones(len(motion.times) - 1, bool)
    free[holding] = False
    return free


def middle_of_longest(regimes, smooth) -> int:
    """Index in the middle of the longest run of one regime without an event, stick left aside.

    The start of a driven cycle lies there: far from events, and where all states are possible.
    """
    best, where, begin = -1, 0, 0
    size = len(regimes)
    for k in range(1, size + 1):
        if k == size or regimes[k] != regimes[begin] or not smooth[k - 1]:
            length = (k - begin) * (0.01 if regimes[begin] == Regime.STICK else 1.0)
            if length > best:
                best, where = length, (begin + k) // 2
            begin = k
    return where


def turns(motion: Stretch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (times, values, is a maximum) of the turning points of the first coordinate."""
    n = motion.samples.shape[1] // 2
    x, v, h = motion.samples[:, 0], motion.samples[:, n], np.diff(motion.times)
    at = np.flatnonzero((np.sign(v[:-1]) != np.sign(v[1:])) & (v[:-1] != 0))
    part = v[at] / (v[at] - v[at + 1])
    a, b, k = x[at], x[at + 1], h[at]
    # Hermite's cubic: fourth order from states at both ends
    value = (
        a * (1 + 2 * part) * (1 - part) ** 2
        + b * part**2 * (3 - 2 * part)
        + k * part * (1 - part) * (v[at] * (1 - part) - v[at + 1] * part)
    )
    return motion.times[at] + part * k, value, v[at] > 0


def extremes(motion: Stretch, n: int) -> tuple[float, float]:
    """Largest and smallest first coordinate: at turning points, or where an impact turns it."""
    x, v = motion.samples[:, 0], motion.samples[:, n]
    values = [x, turns(motion)[1]]
    events = motion.events
    count = min(int(events.count), len(events.time))
    hits = events.time[:count][events.impulse[:count] != 0]
    at = np.clip(np.searchsorted(motion.times, hits) - 1, 1, len(x) - 2)
    bend = (v[at] - v[at - 1]) / (motion.times[at] - motion.times[at - 1])
    ahead = hits - motion.times[at]
    values.append(x[at] + ahead * (v[at] + 0.5 * ahead * bend))
    every = np.concatenate(values)
    return float(every.max()), float(every.min())


def slip_margin(motion: Stretch) -> float:
    """Smallest |slip speed| at which slip slows down and speeds up again, inside a smooth piece."""
    speed = np.abs(motion.slip_speed)
    inner = smooth_intervals(motion)
    slips = (motion.regimes == Regime.SLIP_POS) | (motion.regimes == Regime.SLIP_NEG)
    fair = inner[:-1] & inner[1:] & slips[1:-1] & slips[:-2] & slips[2:]
    left, here, right = speed[:-2], speed[1:-1], speed[2:]
    low = fair & (here <= left) & (here <= right)
    if not low.any():
        return np.nan
    bend = left - 2 * here + right
    vertex = here - (left - right) ** 2 / (8 * np.where(bend > 0, bend, np.inf))
    return float(np.min(vertex[low]))
