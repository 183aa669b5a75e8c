"""What a run holds over frequency, as numbers: its lines, and its level over time and frequency."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ...datasets.run_dataset import is_steady, pitch, signal
from ...noise.classes import stored
from ...noise.samples import finite, sample_interval
from ...noise.spectrum import HEARD, dominant_frequency

FEWEST_LINES = 4  # of a spectrum: the first two are skirts of the mean
BETWEEN = 8  # places between two bins where a line is looked for
VELOCITIES = ("velocity", "output", "slip_speed")
ENDS = 0.05  # of a run that are faded where Hann's window would hear the stroke in the middle alone
TURNING = 0.02  # s, of the spectrogram's window: what happens around V = 0 lasts some tens of ms


class Lines(NamedTuple):
    """Amplitude spectrum of a quantity, in its stored unit.

    Attributes:
        frequency: Hz, those that are shown.
        amplitude: rms of the highest line within half a bin, 0.06 dB too low at most.
        strongest: frequency of the strongest line; NaN of a quiet run.
        quiet: what counts as no vibration (`quiet_level`).
        resolution: Hz.
        weight: what the samples are weighted with, in words.
    """

    frequency: np.ndarray
    amplitude: np.ndarray
    strongest: float
    quiet: float
    resolution: float
    weight: str


class Levels(NamedTuple):
    """Level of a quantity over time and frequency.

    Attributes:
        time: borders of the columns (s).
        frequency: middles of the rows (Hz), evenly spaced.
        decibels: re one unit of the quantity, (rows, columns); between rows a line is up to 0.09 dB
            too low.
        peak: of the scale: reaches up to what counts as quiet at least.
        window: length of the Hann window (s).
    """

    time: np.ndarray
    frequency: np.ndarray
    decibels: np.ndarray
    peak: float
    window: float


def lines(ds: xr.Dataset, quantity: str | None = None, component: int | None = None) -> Lines:
    """Amplitude spectrum of one quantity of a run, from 20 Hz (or half of a lower tone, or of the
    strongest line where none is told) up to what is heard, or to eight times a higher tone.

    Raises: `ValueError` for a quantity that is not there, samples that are not even, and a run that
    is too short for two lines.
    """
    import scipy.signal  # most of a second, which pictures of maps do not need
    from scipy.ndimage import maximum_filter1d

    values = signal(ds, quantity, component)
    step = sample_interval(ds)
    numbers = finite(values)
    tone = pitch(ds)
    heard = np.isfinite(tone)  # rounding noise has a strongest line too
    lowest, highest = HEARD
    if heard:
        highest = max(highest, 8 * tone)
    if (span := step * numbers.size) * highest < FEWEST_LINES:
        shortest = FEWEST_LINES / highest
        must = f"must be of {shortest:g} s or more, was of {span:.2g} s"
        raise ValueError(f"a spectrum up to {highest:g} Hz {must}")
    steady = is_steady(ds)
    shape = "hann" if steady else ("tukey", 2 * ENDS)
    weights: Any = scipy.signal.get_window(shape, numbers.size)
    frequency, power = scipy.signal.periodogram(
        numbers, 1 / step, window=weights, detrend="constant", scaling="spectrum",
        nfft=BETWEEN * numbers.size,
    )  # fmt: skip
    # a bin has the highest level within half a bin of it: bare it shows a line beside it too low
    frequency, power = frequency[::BETWEEN], maximum_filter1d(power, BETWEEN + 1)[::BETWEEN]
    top = min(highest, frequency[-1])
    line = float(dominant_frequency(numbers, step)) if heard else float("nan")
    slowest = line
    if not heard and steady:  # a slow system's motion is not to look like silence
        slowest = float(frequency[2:][np.argmax(power[2:])])
    low = max(frequency[2], min(lowest, 0.5 * slowest if slowest > 0 else lowest))
    inside = (frequency >= low) & (frequency <= top)
    amplitude = np.sqrt(power[inside])
    bins = numbers.size * (weights**2).sum() / weights.sum() ** 2
    word = "Hann" if steady else f"flat, {ENDS:.0%} faded at each end"
    quiet = quiet_level(ds, values)
    return Lines(frequency[inside], amplitude, line, quiet, float(bins * frequency[1]), word)


def quiet_level(ds: xr.Dataset, values: xr.DataArray) -> float:
    """What counts as no vibration of `values` of a run, rms, in their stored unit.

    Of a velocity it is the border of the class quiet: the stored share of the speed of the glass,
    or the stored speed. Of other quantities it is that share of their own rms, mean included.
    """
    limits, scale = stored(ds.attrs), values
    if values.name in VELOCITIES and limits.quiet_velocity is not None:
        return limits.quiet_velocity
    if values.name in VELOCITIES and "belt_velocity" in ds:
        scale = ds["belt_velocity"]
    rms = float(np.sqrt(np.mean(np.square(finite(scale)))))
    return limits.quiet_velocity_ratio * rms


def levels(
    ds: xr.Dataset,
    quantity: str | None = None,
    component: int | None = None,
    window: float | None = None,
    highest: float | None = None,
) -> Levels:
    """Level over time and frequency of one quantity of a run; the arguments are those of
    `spectra.spectrogram`.
    """
    values = signal(ds, quantity, component)
    step = sample_interval(ds)
    numbers = finite(values)
    tone = pitch(ds)
    span = step * numbers.size
    if window is None:
        fast = np.isfinite(tone) and tone >= stored(ds.attrs).chatter_band[1]
        window = min(max(span / 25, 4 / tone if fast else 0.0), span / 4)
        window = window if is_steady(ds) else min(window, TURNING)
    samples = int(np.clip(round(window / step), 8, numbers.size))
    if highest is None:  # a short window tells no low frequencies apart
        highest = max(2000.0, 8 * tone if np.isfinite(tone) else 0.0, 4 / (samples * step))
    top = min(highest, 0.5 / step)
    # One column for each two pixels at most: a long run is no reason for a large image.
    hop = max(1, min(samples // 8, numbers.size // 100), numbers.size // 1000)
    from scipy.signal import ShortTimeFFT, windows  # as in `lines`

    weights = windows.hann(samples, sym=False)
    transform = ShortTimeFFT(
        weights, hop, 1 / step, mfft=max(256, 4 * samples), scale_to="magnitude"
    )
    if transform.f[1] > top:
        least = f"must be {transform.f[1]:.3g} Hz or more where a window is {samples * step:.2g} s"
        raise ValueError(f"highest {least}, was {highest:g} Hz")
    # Only windows that lie inside: the ends of a signal are clicks.
    first, last = transform.lower_border_end[1], transform.upper_border_begin(numbers.size)[1]
    last = max(last, first + 1)
    level = np.abs(transform.stft_detrend(numbers, "constant", p0=first, p1=last))
    shown_rows = transform.f <= top
    power = np.sqrt(2.0) * level[shown_rows]  # two-sided magnitude to the rms of a line
    decibels = 20 * np.log10(np.maximum(power, 1e-300))
    borders = transform.delta_t * (np.arange(first, last + 1) - 0.5)
    # the ends belong to the windows that hold them: nothing is drawn as silence that is not known
    borders[[0, -1]] = 0.0, float(ds["time"][-1] - ds["time"][0])
    peak = max(float(decibels.max()), 20 * np.log10(max(quiet_level(ds, values), 1e-300)))
    rows = transform.f[shown_rows]
    return Levels(float(ds["time"][0]) + borders, rows, decibels, peak, samples * step)
