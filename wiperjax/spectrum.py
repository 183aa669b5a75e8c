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
"""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import scipy.fft

from . import launch

PADDING = 4  # spectrum points per bin of the unpadded transform, or a little more
NEWTON_STEPS = 3
FUNDAMENTAL_RATIO = 0.5  # height of a fundamental against its highest harmonic
CHUNK = 250_000  # numbers transformed at once by a thread: bounds the memory, and fits in caches


def dominant_frequency(
    signal: np.ndarray,
    sample_interval: float,
    *,
    minimum_cycles: float = 1.5,
    harmonics: int = 4,
) -> np.ndarray:
    """Frequency of the strongest spectral line in Hz, NaN if the signal is constant or not finite.

    Arguments:

    - `signal`: samples, shape (..., samples), uniformly spaced, any unit. Small oscillations on a
        large mean need float64 (or the mean taken off before rounding to float32).
    - `sample_interval`: time between samples in seconds.
    - `minimum_cycles`: lines with fewer cycles in the window than this are not looked for.
    - `harmonics`: lines (the strongest one and its multiples) used in the last refinement.

    Returns: array of shape (...,), in Hz.

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
    rows = max(1, CHUNK // (PADDING * samples))
    chunks = [flat[i : i + rows] for i in range(0, len(flat), rows)]
    line = partial(_strongest_line, minimum_cycles=minimum_cycles, harmonics=harmonics)
    if len(chunks) > 1:  # most of it is numpy and scipy, without GIL
        with ThreadPoolExecutor(launch.cores()) as pool:
            parts = list(pool.map(line, chunks))
    else:
        parts = [line(chunk) for chunk in chunks]
    cycles_per_sample = np.concatenate(parts) if parts else np.zeros(0)
    return (cycles_per_sample / sample_interval).reshape(signal.shape[:-1])


def _strongest_line(signal: np.ndarray, minimum_cycles: float, harmonics: int) -> np.ndarray:
    """Strongest line of each row of `signal` (rows, samples), in cycles per sample."""
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
    power = np.abs(np.asarray(scipy.fft.rfft(windowed, n=length, axis=1))) ** 2
    start = max(1, int(np.ceil(minimum_cycles * length / samples)))
    inner = power[:, start:-1]
    is_peak = (inner >= power[:, start - 1 : -2]) & (inner >= power[:, start + 1 :])
    peak = start + np.argmax(np.where(is_peak, inner, -1.0), axis=1)
    peak = _fundamental(power, np.pad(is_peak, ((0, 0), (start, 1))), peak, length / samples)
    row = np.arange(len(peak))
    left, top, right = (power[row, peak + k] for k in (-1, 0, 1))
    bend = left - 2.0 * top + right
    offset = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    frequency = _refine(windowed, (peak + offset) / length, harmonics)
    return np.where(finite & (spread > 0), frequency, np.nan)


def _fundamental(power, is_peak, peak, resolution) -> np.ndarray:
    """Lower `peak` of each row to the line it is a harmonic of, if that one is half as high.

    Only bins within half a line's width (`resolution`, bins a line) of peak / n are looked at, so
    lines that merely lie lower do not count. Beyond n = 6 nothing below half has been seen.
    """
    row = np.arange(len(peak))
    enough = FUNDAMENTAL_RATIO**2 * power[row, peak]
    reach = int(np.ceil(0.5 * resolution))
    best = peak.copy()
    for n in range(2, 7):
        for shift in range(-reach, reach + 1):
            at = np.clip(np.round(peak / n).astype(int) + shift, 0, power.shape[1] - 1)
            line = is_peak[row, at] & (power[row, at] >= enough)
            best = np.where(line & (at < best), at, best)
    return best


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
