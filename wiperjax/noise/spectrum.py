"""Dominant frequency of sampled signals, many signals at once.

How it is found. The mean is removed, the signal is weighted with a Hann window and its spectrum is
taken with zero padding, so that two lines are compared at (nearly) their true heights: on the bare
bins the Hann window loses up to 1.4 dB between bins, enough to prefer the second harmonic of a
narrow pulse train to its fundamental. (Strokes have faded ends already, and all weigh alike: on a
belt that turns twice in the window Hann's would hear the middle one alone, and of one motion tell
another tone wherever the window begins.) The STRONGEST LINE is then the highest local maximum that
lies at `minimum_cycles` cycles per window or above; slower motion cannot be told from drift. Where
that is so much larger that the line may be one of its side lobes in the window, or an overtone, the
line has to stand out of what lies beside it. Its place is refined by a parabola and then by
Newton's method on the spectrum as a continuous function of frequency (`between_bins`), at the line
and its next harmonics together (each weighted by its own power): that keeps a fundamental with only
five cycles in the window from being pulled by the skirts of its own harmonics.

If the strongest line is a harmonic of a lower line at least half as high, the lower one is the
answer: the slip pulses of slow stick-slip fill a few per cent of the period, their comb of lines is
flat, and which harmonic is highest by a few per cent is chance, while the motion repeats at the
fundamental. In a period-doubled motion the strongest line wins as long as its subharmonic is less
than half as high.

Samples may be means over their intervals (`averaged`): a line at f then comes down by
sinc(f interval), which is undone, and one above half the sampling rate does not vanish but is
folded down, weakened by more. What the means leave out is the variance inside the intervals. So a
line is known not to be a folded one if that would have left out more than there is; and no hidden
line is as strong if what the lines that are seen do not account for is too little for it. Both
together: the frequency is `told`.
"""

from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy.ndimage import maximum_filter1d

from .between_bins import Bins, refined

HEARD = (20.0, 20_000.0)  # Hz: tones from and up to which people hear
FUNDAMENTAL_RATIO = 0.5  # height of a fundamental against its highest harmonic
FEW_HARMONICS, HARMONICS = 6, 40  # up to which a fundamental is looked for without, and with a comb
CHUNK = 2**20  # numbers transformed at once: fewer pay for the interpreter, more for memory
LOBE = 0.2  # twice the highest side lobe of slow motion: half as high it would be a fundamental
BESIDE = 3.0  # cycles from a line, whose own width ends at two, to what it has to stand out of,
STANDS_OUT, FAINTEST = 4.0, 1e-3  # by that factor, and above that share of the slow motion
HIDDEN = 1 / (1 - np.sinc(0.5) ** 2)  # most that a hidden line has, over what means leave out of it
REFINED = 4  # lines that place a fundamental: the strongest one and its next multiples
MARGIN = 1.2  # for motion that is not the same throughout its window


class Lines(NamedTuple):
    """Strongest line of each signal."""

    frequency: np.ndarray  # [Hz]; NaN if the signal is constant, not finite, or has no line
    told: np.ndarray  # whether no line that the samples cannot show may be as strong


def interval_means(position, velocity, interval: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean of a velocity over each interval between samples, and its variance inside it, each of
    shape (samples - 1,): what `strongest_lines` needs to tell a line from a folded one.

    Means are differences of positions, so nothing is folded at full height; the mean squares at
    instants hold what is too fast for the samples as well (single variances may come out negative).

    Arguments: `position` and `velocity` at the samples, (samples,); `interval` between them (s).
    """
    mean = np.diff(position) / interval
    return mean, 0.5 * (velocity[:-1] ** 2 + velocity[1:] ** 2) - mean**2


def dominant_frequency(signal: np.ndarray, sample_interval: float, **options: Any) -> np.ndarray:
    """Frequency of the strongest spectral line in Hz; see `strongest_lines`."""
    return strongest_lines(signal, sample_interval, **options).frequency


def strongest_lines(
    signal: np.ndarray,
    sample_interval: float,
    *,
    averaged: bool = False,
    inner: Any = None,
    faded: bool = False,
    minimum_cycles: float = 1.5,
) -> Lines:
    """Strongest spectral line of each signal, and whether the samples tell it.

    Arguments:

    - `signal`: samples, shape (..., samples), uniformly spaced, any unit. Of float32 the spectrum
        is float32, of all else float64. Small oscillations on a large mean need float64 (or the
        mean taken off before rounding to float32).
    - `sample_interval`: time between samples in seconds.
    - `averaged`: samples are means over their intervals, not values at instants. Of values at
        instants nothing is known but the samples: they tell all that they seem to.
    - `inner`: variance inside the intervals, shape (..., samples), or its mean, (..., 1); None
        where there is none.
    - `faded`: the signal vanishes at its ends, and wherever it is cut, and needs no weight.
    - `minimum_cycles`: lines with fewer cycles in the window than this are not looked for.

    Returns: `Lines` of shape (...,). Those of a signal do not depend on its neighbours, to the bit.

    Raises: `ValueError` if there are fewer than 8 samples or `sample_interval` is not positive.
    """
    signal = np.asarray(signal)
    samples = signal.shape[-1] if signal.ndim else 0
    if samples < 8:
        raise ValueError(
            f"argument signal must have at least 8 samples along its last axis, but has {samples}"
        )
    if not sample_interval > 0:
        raise ValueError(f"argument sample_interval must be > 0, but is {sample_interval}")
    flat = signal.reshape(-1, samples)
    if flat.dtype != np.float32:
        flat = flat.astype(np.float64)
    hidden = None
    if averaged and inner is not None:
        inner = np.asarray(inner, dtype=float)
        width = inner.shape[-1] if inner.ndim else 1
        hidden = np.broadcast_to(inner, (*signal.shape[:-1], width)).reshape(-1, width)
    bins = Bins.of(samples, averaged, flat.dtype.name, faded)
    rows = max(1, CHUNK // bins.length)
    found = [
        _strongest(flat[part], None if hidden is None else hidden[part], bins, minimum_cycles)
        for part in (slice(start, start + rows) for start in range(0, len(flat), rows))
    ] or [Lines(np.zeros(0), np.zeros(0, bool))]
    frequency, told = (
        np.concatenate(parts).reshape(signal.shape[:-1]) for parts in zip(*found, strict=True)
    )
    return Lines(frequency / sample_interval, told)


def _strongest(signal, inner, bins: Bins, minimum_cycles: float) -> Lines:
    """`strongest_lines` of the rows of `signal` (rows, samples), in cycles per sample."""
    window = bins.window
    finite = np.isfinite(signal).all(axis=1)
    if not finite.all():
        signal = np.where(finite[:, None], signal, 0)
    # Two passes: the first leaves a mean of the size of the rounding error, which matters at 1e-9
    # of the mean. The weighted mean makes the windowed signal free of a constant part, whose skirt
    # would pull low lines.
    signal = signal - signal.mean(axis=1, keepdims=True)
    spread = np.abs(signal).max(axis=1)
    scale = np.where(spread > 0, spread, 1)
    signal *= window
    signal -= signal.sum(axis=1, keepdims=True) / window.sum() * window
    signal /= scale[:, None]

    spectrum: Any = scipy.fft.rfft(signal, n=bins.length, axis=1)
    seen = spectrum.real**2 + spectrum.imag**2
    power = seen if bins.response is None else seen / bins.response
    start = max(1, int(np.ceil(minimum_cycles * bins.resolution)))
    lines, highest = _lines(power, start, bins.resolution)
    peak = _fundamental(lines, highest, start, bins.resolution)
    row = np.arange(len(peak))
    left, top, right = (power[row, peak + k].astype(float) for k in (-1, 0, 1))
    found = finite & (spread > 0) & (lines[row, peak] > 0)
    found &= (top >= left) & (top >= right)  # else all is skirt: no line
    bend = left - 2.0 * top + right
    offset = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    place = refined(spectrum, peak + offset, bins, REFINED)
    frequency = np.where(found, place / bins.length, np.nan)
    if inner is None or bins.response is None:
        return Lines(frequency, finite)
    return Lines(frequency, finite & _told(seen, power, highest, inner, scale, bins))


def _lines(power, start: int, resolution: float) -> tuple[Any, np.ndarray]:
    """`power`, and the highest line of each row from bin `start` on, (rows,). Where that may be a
    side lobe of slower motion, or its overtone, of `power` only the lines that stand out are left.
    """
    highest, slow = _highest(power, start), power[:, :start].max(axis=1)
    doubtful = np.flatnonzero(power[np.arange(len(power)), highest] <= LOBE**2 * slow)
    if not doubtful.size:
        return power, highest
    some, lines, below = power[doubtful], power.copy(), slow[doubtful, None]
    half, away = round(0.75 * resolution), round(BESIDE * resolution)
    crest, place = maximum_filter1d(some, 2 * half + 1, axis=1), np.arange(some.shape[1])
    left, right = crest[:, np.abs(place - away)], crest[:, np.minimum(place + away, place[-1])]
    stands = (some > STANDS_OUT**2 * np.maximum(left, right)) & (some > FAINTEST**2 * below)
    lines[doubtful] = np.where(stands, some, 0)
    highest[doubtful] = _highest(lines[doubtful], start)
    return lines, highest


def _highest(power, start: int) -> np.ndarray:
    """Highest local maximum of each row from bin `start` on, (rows,)."""
    inside = power[:, start:-1]
    row = np.arange(len(power))
    highest = start + np.argmax(inside, axis=1)
    # at the first bin or the last but one it may be the skirt of what is outside
    top = power[row, highest]
    skirt = (top < power[row, highest - 1]) | (top < power[row, highest + 1])
    if skirt.any():
        some = power[skirt]
        inside = some[:, start:-1]
        is_peak = (inside >= some[:, start - 1 : -2]) & (inside >= some[:, start + 1 :])
        highest[skirt] = start + np.argmax(np.where(is_peak, inside, -1.0), axis=1)
    return highest


def _fundamental(power, peak, start: int, resolution: float) -> np.ndarray:
    """Lower `peak` of each row to the line it is a harmonic of, if that one is half as high; from
    the seventh harmonic on, where lines that merely lie lower would be met, only if all the
    harmonics between are.

    Bins within half a line's width (`resolution`, bins a line) of peak / n are looked at.
    """
    enough = (FUNDAMENTAL_RATIO**2 * power[np.arange(len(peak)), peak]).astype(power.dtype)
    reach = int(np.ceil(0.5 * resolution))
    stop = int(peak.max(initial=0)) // 2 + reach + 2
    # few bins are so high: the rest is about those alone, (bins,)
    row, place = np.nonzero(power[:, start:stop] >= enough[:, None])
    place += start
    here = power[row, place]
    kept = (place <= peak[row] / 2 + reach + 1) & (place < power.shape[1] - 1)
    kept &= (here >= power[row, place - 1]) & (here >= power[row, place + 1])
    row, place = row[kept], place[kept]
    order = np.arange(2, HARMONICS + 1)
    near = np.abs(np.round(peak[row, None] / order) - place[:, None]) <= reach  # (bins, orders)
    line, k = np.nonzero(near)
    order = order[k]
    holds = order <= FEW_HARMONICS
    far = np.flatnonzero(~holds)
    holds[far] = _comb(power, row[line[far]], peak, order[far], enough)
    lowest = peak.copy()
    np.minimum.at(lowest, row[line[holds]], place[line[holds]])
    return lowest


def _comb(power, row, peak, order, enough) -> np.ndarray:
    """Whether all lines of a comb are high: those of a `row` at peak m / order, 1 < m < order."""
    found, where = np.unique(row * (HARMONICS + 1) + order, return_inverse=True)
    row, order = np.divmod(found, HARMONICS + 1)
    m = np.arange(2, HARMONICS)
    between = np.round(peak[row, None] * np.minimum(m, order[:, None]) / order[:, None]).astype(int)
    high = power[row[:, None], between]
    for shift in (-1, 1):
        high = np.maximum(high, power[row[:, None], between + shift])
    return np.all(high >= enough[row, None], axis=1)[where]


def _told(seen, power, highest, inner, scale, bins: Bins) -> np.ndarray:
    """Whether the line at the bin `highest` of each row is none that is folded down, and no hidden
    one may be as strong. `inner`: variance inside the samples, or its mean, (rows, samples or 1).
    """
    row, window = np.arange(len(highest)), bins.window.astype(float)
    weight = window**2 if inner.shape[1] > 1 else np.ones(1)
    inner = (inner * weight).sum(axis=1) / weight.sum() / scale.astype(float) ** 2
    # of the strongest line, its square mean, and what of it means leave out if it has been folded
    line = 2 * seen[row, highest] / window.sum() ** 2
    folded = line * (1 / np.sinc(1 - highest / bins.length) ** 2 - 1)
    # Parseval: what is left when all lines that are seen have what they have lost
    unit = 2 / (bins.length * np.sum(window**2))
    lost = np.maximum(inner - unit * (power - seen).sum(axis=1), 0.0)
    whole = 2 * power[row, highest] / window.sum() ** 2
    return (folded >= MARGIN * inner) & (MARGIN * HIDDEN * lost <= whole)
