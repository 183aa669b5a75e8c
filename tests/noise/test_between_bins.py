"""A spectrum between its bins: beside the sum over all samples."""

import numpy as np
import pytest
import scipy.fft

from wiperjax.noise.between_bins import DEGREE, REACH, Bins, refined


def transform(windowed, frequency):
    """X at one frequency (cycles per sample), time from the middle of the window."""
    time = np.arange(windowed.shape[-1]) - 0.5 * (windowed.shape[-1] - 1)
    return (windowed * np.exp(-2j * np.pi * frequency * time)).sum(-1)


@pytest.mark.parametrize("samples", [16, 67, 192, 1000])
def test_nine_bins_tell_the_transform_between_them(samples):
    bins = Bins.of(samples, True, "float64")
    signal = np.random.default_rng(samples).standard_normal(samples) * bins.window
    spectrum = scipy.fft.rfft(signal, n=bins.length)
    worst = 0.0
    for middle in range(REACH, len(spectrum) - REACH, max(1, samples // 8)):
        terms = bins.polynomial @ spectrum[middle - REACH : middle + REACH + 1]
        for off in (-0.7, -0.2, 0.0, 0.33, 0.5):
            exact = transform(signal, (middle + off) / bins.length)
            found = np.sum(terms * off ** np.arange(DEGREE + 1))
            # bins have a phase of their own, the same for all of one polynomial
            turn = np.exp(1j * np.pi * (samples - 1) * middle / bins.length)
            worst = max(worst, abs(found * turn - exact))
    assert worst < 1e-6 * np.linalg.norm(signal)


def test_a_line_is_refined_as_by_all_samples():
    """The highest place of sum_h |X(h f)|^4, by search in the sums over all samples."""
    samples, harmonics = 192, 4
    bins = Bins.of(samples, False, "float64")
    phase = 2 * np.pi * np.arange(samples) / samples
    for cycles in (5.3, 9.81, 17.02):
        wave = np.sin(cycles * phase) + 0.4 * np.sin(2 * cycles * phase + 1)
        windowed = (wave - (wave * bins.window).sum() / bins.window.sum()) * bins.window

        def height(f, windowed=windowed):
            return sum(abs(transform(windowed, h * f)) ** 4 for h in range(1, harmonics + 1))

        grid = (cycles + np.linspace(-0.01, 0.01, 2001)) / samples
        best = grid[np.argmax([height(f) for f in grid])]
        spectrum = scipy.fft.rfft(windowed[None], n=bins.length)
        near = np.array([bins.length * (cycles + 0.03) / samples])
        found = refined(spectrum, near, bins, harmonics)[0] / bins.length
        assert found == pytest.approx(best, abs=1e-5 / samples)


def test_a_place_that_is_no_peak_is_kept():
    bins = Bins.of(64, False, "float64")
    windowed = np.sin(2 * np.pi * 10 * np.arange(64) / 64)[None] * bins.window
    spectrum = scipy.fft.rfft(windowed, n=bins.length)
    valley = np.array([bins.length * 20.0 / 64])  # a Hann window has a zero there
    assert refined(spectrum, valley, bins, 1) == valley
