"""Runs over frequency: the spectrum with the bands of the classes, and the spectrogram with the
events below it.
"""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...datasets.run_dataset import is_steady, signal
from ...noise.classes import class_bands, stored
from ..style.axes import axes_or_page, label, page, plain_log, shown_unit, time_text
from ..style.caption import quantity_words, set_caption
from ..style.palette import CLASSES, EVENT_NAMES
from .history import shown_events
from .levels import VELOCITIES, levels, lines

DECADES = 5  # of amplitude that are shown
LEVELS = 70.0  # dB that the spectrogram shows


def spectrum(
    ds: xr.Dataset,
    ax: Axes | None = None,
    *,
    quantity: str | None = None,
    component: int | None = None,
) -> Axes:
    """Amplitude spectrum (rms of each line) of one quantity of a run: with Hann's window, on a belt
    that turns of all strokes alike.

    Arguments:

    - `ds`: a run, or its settled part (`run_dataset.settled`).
    - `quantity`, `component`: by default the velocity that the motion is judged by, that of
        the tip along the glass or the output of a system of one's own (`signal`).

    The bands of squeal and chattering (those stored with the run) have the colours of these
    classes; the strongest line is named, unless the run is quiet or its belt not steady: there it
    is the stroke. Amplitudes are in the unit of the quantity: rms of a sine, so 1 m/s peak shows as
    0.707. The scale never ends below what counts as quiet (`quiet_level`; dotted on a steady belt):
    rounding noise is not blown up to look like a line.
    """
    values = signal(ds, quantity, component)
    factor, unit = shown_unit(values)
    found = lines(ds, quantity, component)
    frequency, amplitude, line = found.frequency, factor * found.amplitude, found.strongest
    low, top = frequency[[0, -1]]
    ax, whole = axes_or_page(ax, (8.0, 4.4))
    ax.plot(frequency, amplitude, color="black", linewidth=0.8)
    plain_log(ax, "x")
    ax.set_xlim(low, top)
    _bands(ds, ax)
    quiet = factor * found.quiet
    highest = float(amplitude.max(initial=0.0))
    peak = max(highest, quiet)
    if peak > 0:
        ax.set_ylim(peak * 10.0**-DECADES, peak * 20)
        ax.set_yscale("log")
        if highest < peak * 10.0**-DECADES:
            words = f"all lines below {peak * 10.0**-DECADES:.0e} {unit}".strip()
            ax.text(0.5, 0.03, words, transform=ax.transAxes, ha="center", color="#444444")
        if values.name in VELOCITIES and is_steady(ds):
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
    words = quantity_words(ds, values)
    ax.set_ylabel(label(f"{words}, rms of line", unit))
    if whole:
        span = f"{float(ds['time'][0]):.4g} ... {float(ds['time'][-1]):.4g} s"
        set_caption(ax.figure, ds, f"{span}, resolution {found.resolution:.2g} Hz ({found.weight})")
    return ax


def _bands(ds: xr.Dataset, ax: Axes) -> None:
    """The bands of squeal and chattering behind a spectrum, named where the frame has the room, and
    no other name stands."""
    (low, top), names = ax.get_xlim(), []
    for name, left, right in class_bands(stored(ds.attrs)):
        left, right = max(left, low), min(right, top)
        if left >= right:
            continue
        ax.axvspan(left, right, color=CLASSES[name], alpha=0.15, linewidth=0)
        word = ax.text(
            np.sqrt(left * right), 0.985, name, transform=ax.get_xaxis_transform(),
            ha="center", va="top", fontsize="small", color="#444444",
        )  # fmt: skip
        box, frame = word.get_window_extent(), ax.get_window_extent()
        beyond = max(frame.x0 - box.x0, box.x1 - frame.x1)
        # less is gone with the layout, which widens the axes
        if beyond > 0.1 * box.width or any(map(box.overlaps, names)):
            word.remove()
        else:
            names.append(box)


def spectrogram(
    ds: xr.Dataset,
    axes: np.ndarray | None = None,
    *,
    quantity: str | None = None,
    component: int | None = None,
    window: float | None = None,
    highest: float | None = None,
) -> np.ndarray:
    """Level over time and frequency of one quantity of a run, with ticks of its events below.

    Arguments:

    - `ds`: a run.
    - `axes`: two axes, below each other; a page of its own if None.
    - `quantity`, `component`: by default the velocity that the motion is judged by, that of
        the tip along the glass or the output of a system of one's own (`signal`).
    - `window`: length of the Hann window (s); 1/25 of the run by default, but at least four
        periods of a tone above the band of chattering, and at most `TURNING` on a belt that turns.
    - `highest`: frequency (Hz) at the top; eight times the dominant one by default, 2000 and what
        four periods fill a window of at least.

    Levels are in dB relative to one unit of the quantity (1 m/s rms), not a sound pressure. Within
    half a window of the ends they are those of the first and the last whole window. The scale
    reaches up to what counts as quiet (`quiet_level`) at least.

    Returns: axes, shape (2,).
    """
    values = signal(ds, quantity, component)
    _, unit = shown_unit(values)
    found = levels(ds, quantity, component, window, highest)
    rows = found.frequency
    whole = axes is None
    if axes is None:
        axes = np.asarray(page((9.0, 5.6)).subplots(2, 1, sharex=True, height_ratios=[4.0, 1.2]))
    upper, lower = axes
    mesh = upper.pcolormesh(
        found.time, np.append(rows, rows[-1] + rows[1]) - 0.5 * rows[1], found.decibels,
        cmap="magma", vmin=found.peak - LEVELS, vmax=found.peak, rasterized=True,
    )  # fmt: skip
    upper.set_ylim(0, rows[-1] + 0.5 * rows[1])
    upper.set_ylabel("frequency (Hz)")
    bar = upper.figure.colorbar(mesh, ax=axes.tolist() if whole else upper, pad=0.01, aspect=35)
    bar.set_label(f"level (dB re 1 {unit} rms)" if unit else "level (dB)")
    event_rows(ds, lower)
    lower.set_xlim(float(ds["time"][0]), float(ds["time"][-1]))
    lower.set_xlabel("time (s)")
    if whole:
        words = quantity_words(ds, values)
        wide = 1.5 / found.window
        note = f"{words}, window {time_text(found.window)}, lines {wide:.3g} Hz wide"
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
