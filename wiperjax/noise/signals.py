"""What the sampled tip velocity says: frequency, vibration around reversals, whether it settled.

On a belt that reverses, a tip moves even if nothing sounds: it rides with the glass, flips over
and drifts with the friction curve. So the STROKE is looked at apart from the REVERSAL, the time
within a window of V = 0: the samples of the reversal are faded out of the stroke's signal, and
what is slower than `SLOW` times the wiping frequency is taken off it. On a steady belt all is
stroke, and nothing is taken off.

Samples are means over their intervals (`interval_means`), with the variance inside beside them, so
that levels are exact and a frequency that the samples cannot tell is known for what it is.
"""

from typing import Any

import numpy as np

from ..vocabulary.codes import SETTLED, TOLD
from ..vocabulary.thresholds import FADE, FEWEST_PERIODS, silence
from .spectrum import dominant_frequency, strongest_lines
from .tones import SIDES, tones

SLOW = 10.0  # multiples of the wiping frequency that are the stroke's own motion, not vibration


def signal_columns(
    signal: np.ndarray,
    interval: float,
    limits: Any,
    quiet_below: Any = 0.0,
    since: np.ndarray | None = None,
    wiping: Any = None,
    inner: Any = 0.0,
) -> dict[str, np.ndarray]:
    """Columns of a map that come from samples of the tip velocity.

    Arguments:

    - `signal`: mean tip velocity [m/s] over each sample interval, (cells, samples); NaN where a
        cell ended. Of float32 on a steady belt the spectra are float32.
    - `interval`: time [s] between samples.
    - `limits`: thresholds, as `vocabulary.thresholds.Thresholds`.
    - `quiet_below`: [m/s], a number or (cells,): motion that counts as none when settling is
        judged.
    - `since`: time [s] of the middle of each sample since the nearest passage of V through zero,
        (samples,) or (cells, samples); None on a steady belt.
    - `wiping`: wiping frequency [Hz], a number or (cells,); None on a steady belt.
    - `inner`: variance of the tip velocity inside each sample interval, (cells, samples), or its
        mean, (cells, 1).

    Returns: `dominant_frequency` [Hz] of the stroke, `frequency_told` (`TOLD`; where "no", the
    frequency is what the samples seem to say), `settled` (`SETTLED`); on a belt that reverses
    also `velocity_rms_stroke`, `vibration_reversal` and `vibration_stroke` [m/s],
    `reversal_count` and the results of `tones.tones`. Where the strokes are quiet and a tone around
    the turn is not, the dominant frequency is that of the longest tone. All (cells,).
    """
    signal = np.atleast_2d(np.asarray(signal))
    if since is not None or signal.dtype != np.float32:  # filters ring long: they need the digits
        signal = signal.astype(float)
    found: dict[str, np.ndarray] = {}
    finite = np.isfinite(signal).all(axis=-1)
    quiet_below = np.broadcast_to(np.asarray(quiet_below, dtype=float), signal.shape[:1])
    halves_agree = None
    if since is not None:
        since = np.broadcast_to(since, signal.shape)
        wiping = np.broadcast_to(np.asarray(wiping, dtype=float), signal.shape[:1])
        weight = stroke_weight(since, limits.reversal_window, interval)
        floor = limits.chatter_band[1]  # slower motion is the flip itself
        inner = np.broadcast_to(inner, signal.shape)
        vibration = high_pass(signal, interval, floor)
        quick = inner
        if floor * interval < 0.5:  # what is slow has a slope, and so a variance inside a sample
            quick = inner - np.gradient(signal - vibration, axis=-1) ** 2 / 12
        after = ((since >= 0) & (since <= limits.reversal_window)).astype(float)
        found["vibration_reversal"] = root_mean(after * (vibration**2 + quick), after)
        found |= tones(vibration, quick, interval, since, quiet_below)
        signal = _strokes(signal, weight, interval, wiping)
        fourth = weight**4  # of what was faded twice, the power
        inner, quick = (x * fourth for x in (inner, quick))
        found["velocity_rms_stroke"] = root_mean(signal**2 + inner, fourth)
        vibration = high_pass(signal, interval, floor, faded=True)
        found["vibration_stroke"] = root_mean(vibration**2 + quick, fourth)
        found["reversal_count"] = passages(since, interval)
        # halves of a window compare if each holds whole periods
        periods = wiping * interval * signal.shape[1] / 2
        halves_agree = (np.round(periods) >= 1) & (np.abs(periods - np.round(periods)) < 1e-6)
    faded = since is not None  # by `_strokes`, the ends of the window too
    found["dominant_frequency"], told = strongest_lines(
        signal, interval, averaged=True, inner=inner, faded=faded
    )
    found["frequency_told"] = np.where(told, TOLD["yes"], TOLD["no"])
    pitch = found["dominant_frequency"]
    found["settled"] = settled_codes(signal, interval, pitch, limits.settled_change, quiet_below)
    if halves_agree is not None:
        _name_tones(found, limits.tone_time, quiet_below)
        found["settled"] = np.where(halves_agree, found["settled"], SETTLED["unknown"])
    found["frequency_told"] = np.where(finite, found["frequency_told"], TOLD["unknown"])
    return found


def untold(columns: dict[str, np.ndarray], limits: Any) -> np.ndarray:
    """Which cells make a noise, or a tone, whose frequency the samples do not tell, (cells,) bool.

    `columns`: what `signal_columns` returns, and the statistics of the cells.
    """
    if "frequency_told" not in columns:
        return np.zeros(0, bool)
    loud = columns["velocity_rms_stroke" if "velocity_rms_stroke" in columns else "velocity_rms"]
    sounds = loud > silence(limits, columns.get("belt_speed_rms"))
    wanted = sounds & (columns["frequency_told"] == TOLD["no"])
    for side in SIDES if "tone_time_before" in columns else ():
        lasts = columns[f"tone_time_{side}"] >= limits.tone_time
        wanted = wanted | lasts & np.isnan(columns[f"tone_frequency_{side}"])
    return wanted


def _name_tones(found: dict[str, np.ndarray], least: float, quiet_below: np.ndarray) -> None:
    """Takes the frequency of the longest tone where it lasts `least` [s] and strokes are quiet."""
    before, after = found["tone_time_before"], found["tone_time_after"]
    heard = (np.fmax(before, after) >= least) & (found["velocity_rms_stroke"] <= quiet_below)
    pitch = np.where(after >= before, found["tone_frequency_after"], found["tone_frequency_before"])
    found["dominant_frequency"] = np.where(heard, pitch, found["dominant_frequency"])
    told = np.where(np.isfinite(pitch), TOLD["yes"], TOLD["no"])
    found["frequency_told"] = np.where(heard, told, found["frequency_told"])


def settled_codes(
    signal: np.ndarray, interval: float, pitch: np.ndarray, change: float, quiet_below: Any = 0.0
) -> np.ndarray:
    """Codes of `SETTLED`, (cells,): whether both halves of each signal tell the same.

    They do if both are below `quiet_below` [m/s], or if neither the standard deviation nor the
    dominant frequency changes by more than the fraction `change` from one to the other. A motion
    that is irregular for good is therefore "no" as well, and so is one of hardly two periods, or
    one whose `pitch`, the dominant frequency [Hz] of the whole (cells,), is of fewer. Signals that
    are not finite are "unknown".

    Standard deviations are weighted with a Hann window: a half holds no whole number of periods,
    and without it a slow one would be as its ends happen to lie (12 % of three and a half periods).
    """
    half = signal.shape[-1] // 2
    parts = signal[..., :half], signal[..., -half:]
    window = np.hanning(half + 2)[1:-1].astype(signal.dtype)
    window /= window.sum()
    spread = np.stack([_deviation(part, window) for part in parts])
    known = np.isfinite(spread).all(axis=0)
    silent = np.all(spread <= np.asarray(quiet_below), axis=0)
    with np.errstate(invalid="ignore"):
        steady = np.abs(spread[1] - spread[0]) <= change * spread.max(axis=0)
    open_ = np.flatnonzero(known & steady & ~silent)  # a pitch costs more than all the rest
    tones = [dominant_frequency(part[open_], interval, averaged=True) for part in parts]
    with np.errstate(invalid="ignore"):
        steady[open_] = np.abs(tones[1] - tones[0]) <= change * np.maximum(*tones)
        steady &= pitch * interval * signal.shape[-1] >= FEWEST_PERIODS
    return np.where(
        known, np.where(silent | steady, SETTLED["yes"], SETTLED["no"]), SETTLED["unknown"]
    )


def _deviation(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Standard deviation along the last axis with a `weight` whose sum is 1."""
    rest = values - (weight * values).sum(axis=-1, keepdims=True)
    return np.sqrt((weight * rest**2).sum(axis=-1))


def stroke_weight(since: np.ndarray, window: float, interval: float) -> np.ndarray:
    """Weight of each sample in the stroke: 0 within `window` [s] of V = 0, then a cosine rise to 1
    over `FADE` windows, so that the border makes no click. The ends of the signal, samples every
    `interval` [s], are faded likewise: they lie anywhere in a stroke, and a filter would ring.
    """
    count = since.shape[-1]
    place = np.arange(count)
    inside = interval * (0.5 + np.minimum(place, place[::-1]))
    rise = np.clip(np.minimum(np.abs(since) - window, inside) / (FADE * window), 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * rise)


def root_mean(squares: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Root of the mean of weighted `squares` along the last axis; NaN where all weights are 0.
    (Variances from mean squares at instants may be negative, see `interval_means`; of a tip that
    only rides along so is their sum.)
    """
    total = weight.sum(axis=-1)
    square = np.maximum(squares.sum(axis=-1), 0.0)
    return np.sqrt(np.where(total > 0, square / np.where(total > 0, total, 1.0), np.nan))


def passages(since: np.ndarray, interval: float) -> np.ndarray:
    """How often V passes through zero within a signal whose samples, of `interval` [s] each, have
    their middles a time `since` [s] behind or before it; its start counts, its end does not.
    """
    half = 0.5 * interval
    between = np.sum((since[..., :-1] < 0) & (since[..., 1:] >= 0), axis=-1)
    first, last = since[..., 0], since[..., -1]
    # V = 0 at an end itself is half a sample from a middle, but for rounding
    begins = (first >= 0) & (first <= half * (1 + 1e-6))
    return between + begins + ((last < 0) & (last > -half * (1 - 1e-6)))


def high_pass(
    signal: np.ndarray, interval: float, corner: float, faded: bool = False
) -> np.ndarray:
    """`signal` without what is slower than `corner` [Hz]: Butterworth, order 4, forward and back,
    so that nothing is shifted in time. NaN rows stay NaN. Beyond its ends the signal is taken to go
    on point-symmetrically for a period of `corner`, or to vanish where it was `faded` there.

    What can hold no hundredth of a period of `corner` has nothing slow in it but its mean; samples
    that cannot tell `corner` tell nothing that is faster.
    """
    if corner * interval * signal.shape[-1] < 0.01:  # the filter's start would be singular too
        return signal - signal.mean(axis=-1, keepdims=True)
    if corner * interval >= 0.5:
        return 0.0 * signal
    import scipy.signal  # most of a second, for belts that reverse alone

    sections = scipy.signal.butter(4, corner, "highpass", fs=1 / interval, output="sos")
    beyond = 0 if faded else min(round(1 / (corner * interval)), signal.shape[-1] - 1)
    return np.asarray(scipy.signal.sosfiltfilt(sections, signal, axis=-1, padlen=beyond))


def _strokes(signal, weight, interval, wiping) -> np.ndarray:
    """Strokes alone, each cell without its own slow motion; faded twice, for the filter rings."""
    kept = np.empty_like(signal)
    for frequency in np.unique(wiping):
        rows = wiping == frequency
        mean = (weight[rows] * signal[rows]).sum(-1) / np.maximum(weight[rows].sum(-1), 1e-300)
        faded = weight[rows] * (signal[rows] - mean[:, None])
        kept[rows] = weight[rows] * high_pass(faded, interval, SLOW * frequency, faded=True)
    return kept
