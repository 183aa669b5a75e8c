"""What a motion looks like: its events and regimes, and where it crosses a section."""

import numpy as np

from ..vocabulary.codes import Event, Regime
from .shooting import Arc


def words(motion: Arc) -> tuple[str, str]:
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


def phases(motion: Arc) -> tuple[list[str], np.ndarray]:
    """Return the regimes of a periodic motion, all round, and how long each lasts [s]."""
    count = int(motion.events.count)
    codes = [int(motion.regimes[0]), *(int(r) for r in motion.events.after[:count])]
    ends = np.append(motion.events.time[:count], motion.times[-1])
    names: list[str] = []
    lasts: list[float] = []
    for code, length in zip(codes, np.diff(ends, prepend=motion.times[0]), strict=True):
        name = Regime(code).name.lower()
        if names and names[-1] == name:
            lasts[-1] += length
        else:
            names.append(name)
            lasts.append(length)
    if len(names) > 1 and names[0] == names[-1]:
        names.pop()
        lasts[0] += lasts.pop()
    return names, np.array(lasts)


def smooth_intervals(motion: Arc, kinks: bool = False) -> np.ndarray:
    """Whether each interval between samples is free of events, (samples - 1,); with ``kinks``, of
    those but the system's own corners, where speeds have no corner."""
    count = int(motion.events.count)
    times = motion.events.time[:count]
    if kinks:
        times = times[motion.events.kind[:count] != Event.KINK]
    holding = np.clip(np.searchsorted(motion.times, times) - 1, 0, len(motion.times) - 2)
    free = np.ones(len(motion.times) - 1, bool)
    free[holding] = False
    return free


def far_from_events(regimes, smooth, margin) -> int:
    """Index of the sample at which a driven cycle begins best: far from events, and where all
    states are possible.

    ``regimes``, ``smooth`` and ``margin`` belong to the intervals between samples. The middle of
    the longest run of one regime without an event, stick left aside; without any event, where the
    ``margin`` is largest: the first one to come will come elsewhere.
    """
    if np.all(smooth):
        return int(np.argmax(margin))
    best, where, begin = -1, 0, 0
    size = len(regimes)
    for k in range(1, size + 1):
        if k == size or regimes[k] != regimes[begin] or not smooth[k - 1]:
            length = (k - begin) * (0.01 if regimes[begin] == Regime.STICK else 1.0)
            if length > best:
                best, where = length, (begin + k) // 2
            begin = k
    return where


def event_margin(motion: Arc) -> np.ndarray:
    """How far each sample but the last is from an event, of what it is at most: (samples - 1,).

    The gap in flight; the pressing force and the slip speed in contact.
    """
    parts = [_share(x) for x in (motion.gap, motion.normal_force, np.abs(motion.slip_speed))]
    flies = motion.regimes == Regime.FLIGHT
    return np.where(flies, parts[0], np.minimum(parts[1], parts[2]))[:-1]


def _share(values: np.ndarray) -> np.ndarray:
    """Values as parts of the largest."""
    largest = np.max(values)
    return values / largest if largest > 0 else np.ones_like(values)


def falls(values: np.ndarray) -> np.ndarray:
    """Return the intervals between samples in which ``values`` (samples,) fall through zero."""
    return np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))


def slip_margin(motion: Arc) -> float:
    """Smallest |slip speed| at which slip slows down and speeds up again, inside a smooth piece."""
    found = _slip_minima(motion)
    return float(np.min(found[1])) if len(found[1]) else np.nan


def slip_minimum(motion: Arc) -> tuple[float, int] | None:
    """Return (share of the motion, regime) where `slip_margin` is found; None where it is not."""
    places, values = _slip_minima(motion)
    if not len(values):
        return None
    at = float(places[np.argmin(values)])
    return at / (len(motion.times) - 1), int(motion.regimes[round(at)])


def _slip_minima(motion: Arc) -> tuple[np.ndarray, np.ndarray]:
    """Places, in samples, and values of the minima of |slip speed| inside slip: of parabolas."""
    speed = np.abs(motion.slip_speed)
    inner = smooth_intervals(motion, kinks=True)
    slips = (motion.regimes == Regime.SLIP_POS) | (motion.regimes == Regime.SLIP_NEG)
    fair = inner[:-1] & inner[1:] & slips[1:-1] & slips[:-2] & slips[2:]
    left, here, right = speed[:-2], speed[1:-1], speed[2:]
    low = np.flatnonzero(fair & (here <= left) & (here <= right))
    left, here, right = left[low], here[low], right[low]
    bend = left - 2 * here + right
    bend = np.where(bend > 0, bend, np.inf)
    return low + 1 + (left - right) / (2 * bend), here - (left - right) ** 2 / (8 * bend)
