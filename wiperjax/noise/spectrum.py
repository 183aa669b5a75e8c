"""Dominant frequency of sampled signals, many signals at once.

How it is found. The mean is removed, the signal is weighted with a Hann window and its spectrum is
taken with zero padding, so that two lines are compared at (nearly) their true heights: on the bare
bins the Hann window loses up to 1.4 dB between bins, enough to prefer the second harmonic of a
narrow pulse train to its fundamental. The STRONGEST LINE is then the highest local maximum that
lies at `minimum_cycles` cycles per window or above; slower motion cannot be told from drift. Its
place is refined by a parabola and then by Newton's method on the spectrum as a continuous function
of frequency, at the line and its next harmonics together (each weighted by its own power): that
keeps a fundamental with only five cycles in the window from being pulled by the skirts of its own
harmonics.

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

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import scipy.fft

from ..machine import jax_settings

PADDING = 4  # spectrum points per bin of the unpadded transform, or a little more
NEWTON_STEPS = 3
FUNDAMENTAL_RATIO = 0.5  # height of a fundamental against its highest harmonic
FEW_HARMONICS, HARMONICS = 6, 40  # up to which a fundamental is looked for without, and with a comb
CHUNK = 250_000  # numbers transformed at once by a thread: bounds the memory, and fits in caches
HIDDEN = 1 / (1 - np.sinc(0.5) ** 2)  # most that a hidden line has, over what means leave out of it
MARGIN = 1.2  # for motion that is not the same throughout its window


class Lines(NamedTuple):
    """Strongest line of each signal."""

    frequency: np.ndarray  # [Hz], NaN if the signal is constant or not finite
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
    inner: Any = 0.0,
    minimum_cycles: float = 1.5,
    harmonics: int = 4,
) -> Lines:
    """Strongest spectral line of each signal, and whether the samples tell it.

    Arguments:

    - `signal`: samples, shape (..., samples), uniformly spaced, any unit. Small oscillations on a
        large mean need float64 (or the mean taken off before rounding to float32).
    - `sample_interval`: time between samples in seconds.
    - `averaged`: samples are means over their intervals, not values at instants. Of values at
        instants nothing is known but the samples: they tell all that they seem to.
    - `inner`: variance inside the intervals, shape (..., samples), or its mean, (..., 1).
    - `minimum_cycles`: lines with fewer cycles in the window than this are not looked for.
    - `harmonics`: lines (the strongest one and its multiples) used in the last refinement.

    Returns: `Lines` of shape (...,).

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
    inner = np.asarray(inner, dtype=float)
    width = inner.shape[-1] if inner.ndim else 1
    hidden = np.broadcast_to(inner, (*signal.shape[:-1], width)).reshape(-1, width)
    rows = max(1, CHUNK // (PADDING * samples))
    starts = range(0, len(flat), rows)

    def line(i: int) -> Lines:
        part = slice(i, i + rows)
        return _strongest(flat[part], hidden[part], averaged, minimum_cycles, harmonics)

    if len(starts) > 1:  # most of it is numpy and scipy, without GIL
        with ThreadPoolExecutor(jax_settings.cores()) as pool:
            parts = list(pool.map(line, starts))
    else:
        parts = [line(i) for i in starts] or [Lines(np.zeros(0), np.zeros(0, bool))]
    frequency, told = (
        np.concatenate(found).reshape(signal.shape[:-1]) for found in zip(*parts, strict=True)
    )
    return Lines(frequency / sample_interval, told)


def _strongest(signal, inner, averaged: bool, minimum_cycles: float, harmonics: int) -> Lines:
    """`strongest_lines` of the rows of `signal` (rows, samples), in cycles per sample."""
    signal = signal.astype(np.float64)
    samples = signal.shape[1]
    window = np.hanning(samples + 2)[1:-1]
    finite = np.all(np.isfinite(signal), axis=1)
    signal = np.where(finite[:, None], signal, 0.0)
    # Two passes: the first leaves a mean of the size of the rounding error, which matters at 1e-9
    # of the mean. The weighted mean makes the windowed signal free of a constant part, whose skirt
    # would pull low lines.
    signal = signal - signal.mean(axis=1, keepdims=True)
    spread = np.abs(signal).max(axis=1)
    signal = signal - (signal * window).sum(axis=1, keepdims=True) / window.sum()
    scale = np.where(spread > 0, spread, 1.0)
    windowed = signal / scale[:, None] * window

    length = int(scipy.fft.next_fast_len(PADDING * samples, real=True) or 0)
    seen = np.abs(np.asarray(scipy.fft.rfft(windowed, n=length, axis=1))) ** 2
    place = np.arange(seen.shape[1]) / length  # cycles per sample
    response = np.sinc(place) ** 2 if averaged else np.ones_like(place)
    power = seen / response
    start = max(1, int(np.ceil(minimum_cycles * length / samples)))
    inside = power[:, start:-1]
    is_peak = (inside >= power[:, start - 1 : -2]) & (inside >= power[:, start + 1 :])
    highest = start + np.argmax(np.where(is_peak, inside, -1.0), axis=1)
    peak = _fundamental(power, np.pad(is_peak, ((0, 0), (start, 1))), highest, length / samples)
    row = np.arange(len(peak))
    left, top, right = (power[row, peak + k] for k in (-1, 0, 1))
    bend = left - 2.0 * top + right
    offset = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    frequency = np.where(
        finite & (spread > 0), _refine(windowed, (peak + offset) / length, harmonics), np.nan
    )
    if not averaged:
        return Lines(frequency, finite)
    weight = window**2 if inner.shape[1] > 1 else np.ones(1)
    inner = (inner * weight).sum(axis=1) / weight.sum() / scale**2
    # of the strongest line, its square mean, and what of it means leave out if it has been folded
    line = 2 * seen[row, highest] / window.sum() ** 2
    folded = line * (1 / np.sinc(1 - place[highest]) ** 2 - 1)
    # Parseval: what is left when all lines that are seen have what they have lost
    unit = 2 / (length * np.sum(window**2))
    lost = np.maximum(inner - unit * (power - seen).sum(axis=1), 0.0)
    told = (folded >= MARGIN * inner) & (MARGIN * HIDDEN * lost <= line / response[highest])
    return Lines(frequency, finite & told)


def _fundamental(power, is_peak, peak, resolution) -> np.ndarray:
    """Lower `peak` of each row to the line it is a harmonic of, if that one is half as high; from
    the seventh harmonic on, where lines that merely lie lower would be met, only if all the
    harmonics between are.

    Bins within half a line's width (`resolution`, bins a line) of peak / n are looked at.
    """
    row, order = np.arange(len(peak)), np.arange(2, HARMONICS + 1)
    enough = FUNDAMENTAL_RATIO**2 * power[row, peak]
    reach = int(np.ceil(0.5 * resolution))
    place = np.round(peak[:, None] / order).astype(int)[..., None] + np.arange(-reach, reach + 1)
    place = np.clip(place, 0, power.shape[1] - 1)  # (rows, orders, bins)
    every = row[:, None, None]
    line = is_peak[every, place] & (power[every, place] >= enough[:, None, None])
    for k, n in enumerate(order[order > FEW_HARMONICS], FEW_HARMONICS - 1):
        some = np.flatnonzero(line[:, k].any(axis=1))
        between = np.round(peak[some, None] * np.arange(2, n) / n).astype(int)
        near = [power[some[:, None], between + shift] for shift in (-1, 0, 1)]
        line[some, k] &= np.all(np.max(near, axis=0) >= enough[some, None], axis=1)[:, None]
    return np.minimum(peak, np.where(line, place, power.shape[1]).min(axis=(1, 2)))


def _refine(windowed: np.ndarray, frequency: np.ndarray, harmonics: int) -> np.ndarray:
    """Maximum near `frequency` (cycles per sample) of sum_h |X(h f)|^4, X the transform of the
    windowed rows.

    The fourth power weights each line with its own strength, so weak harmonics (noise) say little.
    A row keeps its value where the curve is not a peak there or Newton's method would leave the
    main lobe.
    """
    samples = windowed.shape[1]
    time = np.arange(samples) - 0.5 * (samples - 1)
    start = frequency.copy()
    for _ in range(NEWTON_STEPS):
        slope = np.zeros_like(frequency)
        curvature = np.zeros_like(frequency)
        rotation = _rotation(frequency, time)
        turned = windowed * rotation
        for order in range(1, harmonics + 1):
            inside = order * frequency < 0.5 - 2.0 / samples
            # Sums, not matrix products: those differ in the last bit with the number of threads and
            # rows.
            first = turned * time
            x0, x1, x2 = turned.sum(axis=1), first.sum(axis=1), (first * time).sum(axis=1)
            unit = 2.0 * np.pi * order
            d1, d2 = -1j * unit * x1, -(unit**2) * x2  # derivatives of X(h f) by f
            p0 = np.abs(x0) ** 2
            p1 = 2.0 * (x0.conj() * d1).real
            p2 = 2.0 * (np.abs(d1) ** 2 + (x0.conj() * d2).real)
            slope += np.where(inside, 2.0 * p0 * p1, 0.0)
            curvature += np.where(inside, 2.0 * (p0 * p2 + p1 * p1), 0.0)
            turned *= rotation
        step = np.where(curvature < 0, -slope / np.where(curvature < 0, curvature, 1.0), 0.0)
        frequency = frequency + np.clip(step, -0.25 / samples, 0.25 / samples)
    good = np.abs(frequency - start) < 0.5 / samples
    return np.where(good, frequency, start)


def _rotation(frequency: np.ndarray, time: np.ndarray) -> np.ndarray:
    """exp(-2 pi i f t), shape (rows, samples); as a product of a coarse and a fine part, for few
    exponentials.
    """
    fine = 64
    coarse = -(-time.size // fine)
    turn = -2j * np.pi * frequency[:, None]
    steps = np.exp(turn * (time[0] + fine * np.arange(coarse)))
    product = steps[:, :, None] * np.exp(turn * np.arange(fine))[:, None, :]
    return product.reshape(frequency.size, -1)[:, : time.size]
