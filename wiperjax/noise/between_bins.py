"""A spectrum between its bins, from few of them.

A transform that is padded to four times its length is smooth: over one bin its phase, told from the
middle of the window, turns by 45 degrees at most. There a polynomial of degree `DEGREE` through
`REACH` bins on either side is as good as the sum over all samples (to 3e-8 of a line's height under
a Hann window, which ends at zero, to 3e-7 without, by least squares over all that a window may
hold), and Newton's method on it costs a hundredth.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.fft

PADDING = 4  # spectrum points per bin of the unpadded transform, or a little more
REACH, DEGREE = 4, 6
NEWTON_STEPS = 3


class Bins(NamedTuple):
    """How signals of one length become spectra."""

    samples: int
    window: np.ndarray  # (samples,), of the precision of the spectra
    length: int  # of the padded transform
    response: np.ndarray | None  # power that is left of a line at each bin by averaging
    polynomial: np.ndarray  # (degree + 1, bins): coefficients of (f - middle bin)^0, ^1, ...

    @classmethod
    @lru_cache(maxsize=512)  # tones are of any length
    def of(cls, samples: int, averaged: bool, precision: str, faded: bool = False) -> "Bins":
        """Bins of signals of so many `samples`; `averaged` over their intervals, or not; under a
        Hann window, or all alike where they are `faded` already."""
        length = int(scipy.fft.next_fast_len(PADDING * samples, real=True) or 0)
        window = (np.ones(samples) if faded else np.hanning(samples + 2)[1:-1]).astype(precision)
        response = None
        if averaged:
            place = np.arange(length // 2 + 1) / length  # cycles per sample
            response = (np.sinc(place) ** 2).astype(precision)
        return cls(samples, window, length, response, _polynomial(samples, length, faded))

    @property
    def resolution(self) -> float:
        """Bins a cycle per window."""
        return self.length / self.samples


def _polynomial(samples: int, length: int, faded: bool) -> np.ndarray:
    """`Bins.polynomial`, by least squares over tones in the place of time, as loud as the window
    lets them be, at a bin or less from the middle one.
    """
    turn = np.pi * samples / length * np.linspace(-1, 1, 401)
    loud = np.ones(401) if faded else np.cos(0.5 * np.linspace(-np.pi, np.pi, 401)) ** 2
    bins = np.arange(-REACH, REACH + 1)
    wanted = np.cos(np.pi * (np.arange(32) + 0.5) / 32)

    def seen(places):
        tones = np.exp(-1j * turn[:, None] * places) * loud[:, None]
        return np.concatenate([tones.real, tones.imag])

    weights = _least_squares(seen(bins), seen(wanted))
    powers = np.vander(wanted, DEGREE + 1, increasing=True)
    polynomial = _least_squares(powers, weights.T)
    # bins have their phase from the first sample, not from the middle
    return polynomial * np.exp(1j * np.pi * (samples - 1) / length * bins)


def _least_squares(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """x with `columns` x closest to `wanted`, by Gram and Schmidt (modified: as good as QR).

    LAPACK's last bits hang on the number of threads, and with them those of every frequency.
    """
    count = columns.shape[1]
    rest = np.concatenate([columns, wanted], axis=1)
    upper = np.zeros((count, rest.shape[1]))
    for k in range(count):
        size = np.sqrt(np.sum(rest[:, k] ** 2))
        unit = rest[:, k, None] / size
        upper[k, k:] = np.sum(unit * rest[:, k:], axis=0)
        rest[:, k + 1 :] -= unit * upper[k, k + 1 :]
    x = np.zeros((count, wanted.shape[1]))
    for k in range(count - 1, -1, -1):
        known = np.sum(upper[k, k + 1 : count, None] * x[k + 1 :], axis=0)
        x[k] = (upper[k, count:] - known) / upper[k, k]
    return x


def refined(spectrum: np.ndarray, place: np.ndarray, bins: Bins, harmonics: int) -> np.ndarray:
    """Maximum near `place` (rows,), in bins, of sum_h |X(h f)|^4, X the rows of `spectrum`.

    The fourth power weights each line with its own strength, so weak harmonics (noise) say little.
    A row keeps its value where the curve is not a peak there or Newton's method would leave the
    main lobe.
    """
    order = np.arange(1, harmonics + 1)
    start = place
    middle = np.round(order * place[:, None]).astype(int)
    terms = _terms(spectrum, middle, bins)
    for _ in range(NEWTON_STEPS):
        each = order * place[:, None]
        inside = each < bins.length / 2 - 2 * bins.resolution
        # hardly any line moves farther than the polynomials about its bin reach
        away = (np.abs(each - middle) > 1).any(axis=1)
        if away.any():
            middle[away] = np.round(each[away]).astype(int)
            terms[:, away] = _terms(spectrum[away], middle[away], bins)
        x0, x1, x2 = _derivatives(terms, each - middle)
        x1, x2 = x1 * order, x2 * order**2
        p0 = x0.real**2 + x0.imag**2
        p1 = 2.0 * (x0.conj() * x1).real
        p2 = 2.0 * (x1.real**2 + x1.imag**2 + (x0.conj() * x2).real)
        slope = np.where(inside, 2.0 * p0 * p1, 0.0).sum(axis=1)
        curvature = np.where(inside, 2.0 * (p0 * p2 + p1 * p1), 0.0).sum(axis=1)
        step = np.where(curvature < 0, -slope / np.where(curvature < 0, curvature, 1.0), 0.0)
        most = 0.25 * bins.resolution
        place = place + np.clip(step, -most, most)
    return np.where(np.abs(place - start) < 0.5 * bins.resolution, place, start)


def _terms(spectrum: np.ndarray, middle: np.ndarray, bins: Bins) -> np.ndarray:
    """Coefficients (degree + 1, rows, lines) of `Bins.polynomial` about the bins ``middle``."""
    row, last = np.arange(len(spectrum))[:, None], spectrum.shape[1] - 1
    terms = np.zeros((DEGREE + 1, *middle.shape), complex)
    for shift, weights in zip(range(-REACH, REACH + 1), bins.polynomial.T, strict=True):
        at = middle + shift
        x = spectrum[row, np.minimum(np.abs(at), last)].astype(complex)
        x = np.where(at < 0, x.conj(), x)
        terms += weights[:, None, None] * x
    return terms


def _derivatives(terms: np.ndarray, at: np.ndarray) -> tuple[Any, Any, Any]:
    """Value, first and second derivative of the polynomials `terms` (coefficient, ...) there."""
    value, slope, half = terms[-1], 0.0, 0.0
    for term in terms[-2::-1]:
        value, slope, half = value * at + term, slope * at + value, half * at + slope
    return value, slope, 2.0 * half
