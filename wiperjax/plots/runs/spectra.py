"""Runs over frequency: the spectrum with the bands of the classes, and the spectrogram with the
events below it.
"""

import numpy as np
import scipy.signal
import scipy.signal.windows as windows
import xarray as xr
from matplotlib.axes import Axes

from ...datasets.run_dataset import is_steady, pitch, sample_interval, signal
from ...noise.classes import stored
from ...noise.spectrum import dominant_frequency
from ..style.axes import label, long_name, page, plain_log, shown_unit
from ..style.caption import set_caption
from ..style.palette import CLASSES, EVENT_NAMES
from .history import shown_events

HIGHEST = 20_000.0  # Hz: what is heard
DECADES = 5  # of amplitude that are shown
TURNING = 0.02  # s, of the spectrogram's window: what happens around V = 0 lasts some tens of ms
LEVELS = 70.0  # dB that the spectrogram shows


def spectrum(
    ds: xr.Dataset, ax: Axes | None = None, *, quantity: str = "velocity", component: int = 0
) -> Axes:
    """Amplitude spectrum (rms of each line, Hann window) of one quantity of a run.

    Arguments:

    - `ds`: a run, or its settled part (`runs.settled`).
    - `quantity`, `component`: `velocity` along the glass (component 0) by default.

    The bands of squeal and chattering (those stored with the run) have the colours of these
    classes; the strongest line is named, unless the run is quiet or its belt not steady: there it
    is the stroke. Amplitudes are in the unit of the quantity: rms of a sine, so 1 m/s peak shows as
    0.707. The scale never ends below what counts as quiet (`quiet_level`; dotted on a steady belt):
    rounding noise is not blown up to look like a line.
    """
    values = signal(ds, quantity, component)
    factor, unit = shown_unit(values)
    step = sample_interval(ds)
    numbers = factor * np.asarray(values, dtype=float)
    frequency, power = scipy.signal.periodogram(
        numbers, 1 / step, window="hann", detrend="constant", scaling="spectrum"
    )
    amplitude = np.sqrt(power)
    whole = ax is None
    if ax is None:
        ax = page((8.0, 4.4)).subplots()
    top = min(HIGHEST, frequency[-1])
    heard = np.isfinite(pitch(ds))  # rounding noise has a strongest line too
    line = float(dominant_frequency(numbers, step)) if heard else float("nan")
    low = max(frequency[2], min(20.0, 0.5 * line if line > 0 else 20.0))
    bands = stored(ds.attrs)
    for name, (left, right) in {
        "squeal": bands.squeal_band, "chattering": bands.chatter_band
    }.items():  # fmt: skip
        left, right = max(left, low), min(right, top)
        if left < right:
            ax.axvspan(left, right, color=CLASSES[name], alpha=0.15, linewidth=0)
            ax.text(
                np.sqrt(left * right), 0.985, name, transform=ax.get_xaxis_transform(),
                ha="center", va="top", fontsize="small", color="#444444",
            )  # fmt: skip
    inside = (frequency >= low) & (frequency <= top)
    ax.plot(frequency[inside], amplitude[inside], color="black", linewidth=0.8)
    plain_log(ax, "x")
    ax.set_xlim(low, top)
    quiet = factor * quiet_level(ds, values)
    highest = float(amplitude[inside].max(initial=0.0))
    peak = max(highest, quiet)
    if peak > 0:
        ax.set_ylim(peak * 10.0**-DECADES, peak * 20)
        ax.set_yscale("log")
        if highest < peak * 10.0**-DECADES:
            words = f"all lines below {peak * 10.0**-DECADES:.0e} {unit}".strip()
            ax.text(0.5, 0.03, words, transform=ax.transAxes, ha="center", color="#444444")
        if quantity == "velocity" and is_steady(ds):
            ax.axhline(quiet, color="#666666", linewidth=0.9, linestyle=":")
            ax.text(
                0.99, quiet, "quiet below", transform=ax.get_yaxis_transform(), ha="right",
                va="bottom", fontsize="small", color="#666666",
            )  # fmt: skip
        if low <= line <= top:
            height = float(amplitude[np.argmin(np.abs(frequency - line))])
            ax.annotate(
                f"{line:.4g} Hz", (line, height), xytext=(8, 2), textcoords="offset points",
                fontweight="bold",
            )  # fmt: skip
            ax.plot(line, height, "o", color="black", markersize=4)
    ax.set_xlabel("frequency (Hz)")
    words = long_name(values).removesuffix(" of the tip")
    ax.set_ylabel(label(f"{words}, rms of line", unit))
    if whole:
        span = f"{float(ds['time'][0]):.4g} ... {float(ds['time'][-1]):.4g} s"
        set_caption(ax.figure, ds, f"{span}, resolution {1.5 * frequency[1]:.2g} Hz (Hann)")
    return ax


def quiet_level(ds: xr.Dataset, values: xr.DataArray) -> float:
    """What counts as no vibration of `values` of a run, rms, in their stored unit.

    Of a velocity it is the border of the class quiet: the stored share of the speed of the glass,
    or the stored speed. Of other quantities it is that share of their own rms, mean included.
    """
    limits, scale = stored(ds.attrs), values
    if str(values.name) == "velocity" and limits.quiet_velocity is not None:
        return limits.quiet_velocity
    if str(values.name) == "velocity" and "belt_velocity" in ds:
        scale = ds["belt_velocity"]
    rms = float(np.sqrt(np.mean(np.square(np.asarray(scale, dtype=float)))))
    return limits.quiet_velocity_ratio * rms


def spectrogram(
    ds: xr.Dataset,
    axes: np.ndarray | None = None,
    *,
    quantity: str = "velocity",
    component: int = 0,
    window: float | None = None,
    highest: float | None = None,
) -> np.ndarray:
    """Level over time and frequency of one quantity of a run, with ticks of its events below.

    Arguments:

    - `ds`: a run.
    - `axes`: two axes, below each other; a page of its own if None.
    - `quantity`, `component`: `velocity` along the glass (component 0) by default.
    - `window`: length of the Hann window (s); 1/25 of the run by default, but at least four
        periods of a tone above the band of chattering, and at most `TURNING` on a belt that turns.
    - `highest`: frequency (Hz) at the top; eight times the dominant one by default, 2000 at least.

    Levels are in dB relative to one unit of the quantity (1 m/s rms), not a sound pressure. Within
    half a window of the ends they are those of the first and the last whole window. The scale
    reaches up to what counts as quiet (`quiet_level`) at least.

    Returns: axes, shape (2,).
    """
    values = signal(ds, quantity, component)
    _, unit = shown_unit(values)
    step = sample_interval(ds)
    numbers = np.asarray(values, dtype=float)
    tone = pitch(ds)
    span = step * numbers.size
    if window is None:
        fast = np.isfinite(tone) and tone >= stored(ds.attrs).chatter_band[1]
        window = min(max(span / 25, 4 / tone if fast else 0.0), span / 4)
        window = window if is_steady(ds) else min(window, TURNING)
    samples = int(np.clip(round(window / step), 8, numbers.size))
    top = highest or max(2000.0, 8 * tone if np.isfinite(tone) else 0.0)
    top = min(top, 0.5 / step)
    # One column for each two pixels at most: a long run is no reason for a large image.
    hop = max(1, min(samples // 8, numbers.size // 100), numbers.size // 1000)
    weights = windows.hann(samples, sym=False)
    transform = scipy.signal.ShortTimeFFT(
        weights, hop, 1 / step, mfft=max(256, 2 * samples), scale_to="magnitude"
    )
    # Only windows that lie inside: the ends of a signal are clicks.
    first, last = transform.lower_border_end[1], transform.upper_border_begin(numbers.size)[1]
    last = max(last, first + 1)
    level = np.abs(transform.stft_detrend(numbers, "constant", p0=first, p1=last))
    shown_rows = transform.f <= top
    power = np.sqrt(2.0) * level[shown_rows]  # two-sided magnitude to the rms of a line
    decibels = 20 * np.log10(np.maximum(power, 1e-300))
    rows = transform.f[shown_rows]
    borders = transform.delta_t * (np.arange(first, last + 1) - 0.5)
    # the ends belong to the windows that hold them: nothing is drawn as silence that is not known
    borders[[0, -1]] = 0.0, float(ds["time"][-1] - ds["time"][0])

    whole = axes is None
    if axes is None:
        axes = np.asarray(page((9.0, 5.6)).subplots(2, 1, sharex=True, height_ratios=[4.0, 1.2]))
    upper, lower = axes
    peak = max(float(decibels.max()), 20 * np.log10(max(quiet_level(ds, values), 1e-300)))
    mesh = upper.pcolormesh(
        float(ds["time"][0]) + borders, np.append(rows, rows[-1] + rows[1]) - 0.5 * rows[1],
        decibels, cmap="magma", vmin=peak - LEVELS, vmax=peak, rasterized=True,
    )  # fmt: skip
    upper.set_ylim(0, rows[-1] + 0.5 * rows[1])
    upper.set_ylabel("frequency (Hz)")
    bar = upper.figure.colorbar(mesh, ax=axes.tolist() if whole else upper, pad=0.01, aspect=35)
    bar.set_label(f"level (dB re 1 {unit} rms)" if unit else "level (dB)")
    event_rows(ds, lower)
    lower.set_xlim(float(ds["time"][0]), float(ds["time"][-1]))
    lower.set_xlabel("time (s)")
    if whole:
        words = long_name(values).removesuffix(" of the tip")
        note = f"{words}, window {1e3 * samples * step:.3g} ms, lines {1.5 / window:.3g} Hz wide"
        set_caption(upper.figure, ds, note)
    return axes


def event_rows(ds: xr.Dataset, ax: Axes) -> None:
    """A row of ticks for each kind of event in a run, with their number."""
    rows = shown_events(ds)
    for height, times in enumerate(reversed(rows.values())):
        ax.vlines(
            times, height - 0.38, height + 0.38, color="black",
            linewidth=0.9 if times.size < 200 else 0.4, rasterized=times.size > 5000,
        )  # fmt: skip
    words = [f"{EVENT_NAMES[name]} ({times.size})" for name, times in rows.items()][::-1]
    ax.set_yticks(range(len(rows)), words, fontsize="small")
    ax.set_ylim(-0.6, max(len(rows), 1) - 0.4)
    ax.tick_params(axis="y", length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
