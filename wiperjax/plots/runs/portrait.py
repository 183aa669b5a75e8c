"""Phase portrait of a run."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from ...datasets.run_dataset import contact_axis, event_times, is_steady, signal, usual_axis
from ...vocabulary.cf import flag_names
from ..style.axes import axes_or_page, label, legend_below, shown, shown_unit
from ..style.caption import direction, partner, set_caption
from ..style.palette import BELT, REGIMES, UNKNOWN, readable


def regime_masks(ds: xr.Dataset) -> Iterator[tuple[str, np.ndarray]]:
    """Name of each regime that occurs, and a mask of its samples."""
    codes = np.asarray(ds["regime"], dtype=int)
    for code, name in flag_names(ds["regime"]).items():
        if (codes == code).any():
            yield name, codes == code


def phase_portrait(
    ds: xr.Dataset,
    ax: Axes | None = None,
    *,
    component: int | None = None,
    transient: xr.Dataset | None = None,
    legend: bool = True,
) -> Axes:
    """Velocity over position of one coordinate, coloured by regime; at impacts and blows it jumps.

    Arguments:

    - `ds`: a run, or the part of it that is coloured.
    - `component`: coordinate; of a lip 0 along the glass, 1 normal to it. None: that of the
        contact, or the first where it is none's.
    - `transient`: the whole run, drawn thin and grey behind the part as far as it lies near it.
    - `legend`: whether to name regimes, start and end in the axes.

    The dashed line is the speed of the glass, at which the contact sticks (steady belts, and the
    contact's own coordinate). The upper axis of a lip is the angle of the lip from the glass
    normal.
    """
    ax, whole = axes_or_page(ax, (6.0, 5.4))
    component = usual_axis(ds) if component is None else component
    if transient is not None:
        way = _with_jumps(transient, component)[:2]
        ax.plot(*way, color="#AAAAAA", linewidth=0.5, zorder=1)
    x, v, sample = _with_jumps(ds, component)
    points = np.column_stack([x, v])
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    for name, mask in regime_masks(ds):
        lines = LineCollection(
            list(pieces[mask[sample[:-1]]]),
            colors=REGIMES.get(name, UNKNOWN),
            linewidths=1.5,
            label=readable(name),
            rasterized=len(pieces) > 20_000,
            zorder=3,
        )
        ax.add_collection(lines)
    if transient is None:
        ax.plot(x[0], v[0], "o", color="black", markersize=4, label="start", zorder=4)
        ax.plot(x[-1], v[-1], "s", color="black", markersize=4, label="end", zorder=4)
    if component == contact_axis(ds) and "belt_velocity" in ds and is_steady(ds):
        speed, words = float(ds["belt_velocity"][0]), f"speed of the {partner(ds)}"
        ax.axhline(speed, color=BELT, linestyle="--", linewidth=1.0, label=words)
    for axis, values in (("x", x), ("y", v)):
        known = values[np.isfinite(values)]  # of others there is no point
        low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
        room = 0.08 * (high - low) or 0.5 * abs(high) or 1.0
        getattr(ax, f"set_{axis}lim")(low - room, high + room)
    if component == 0 and "lip_length" in ds.attrs:
        _angle_axis(ax, shown_unit(ds["position"])[0] * float(ds.attrs["lip_length"]))
    where = direction(ds, component)
    ax.set_xlabel(label(f"position {where}", shown(ds["position"])[1]))
    ax.set_ylabel(label(f"velocity {where}", shown(ds["velocity"])[1]))
    if whole:
        handles = ax.get_legend_handles_labels()[0] if legend else []
        legend_below(ax.figure, handles)
        set_caption(ax.figure, ds)
    elif legend:
        ax.legend(loc="best", fontsize="small", framealpha=0.9)
    return ax


def orbit(ds: xr.Dataset, component: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of one coordinate in the units of pictures."""
    x, v = (shown(signal(ds, name, component))[0] for name in ("position", "velocity"))
    return x, v


def _with_jumps(ds: xr.Dataset, component: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The `orbit` with two more points for the first impact, or blow against a stop, between two
    samples, so that velocity jumps where it is then; and which sample each point goes on from.
    """
    place, speed = (
        np.asarray(signal(ds, name, component), dtype=float) for name in ("position", "velocity")
    )
    # an infinite number is no point either, and would be reckoned with
    place, speed = (np.where(np.isfinite(values), values, np.nan) for values in (place, speed))
    sample, time = np.arange(place.size), np.asarray(ds["time"], dtype=float)
    events = event_times(ds)
    moments = np.sort(np.concatenate([events.get(name, []) for name in ("impact", "blow")]))
    before = np.searchsorted(time, moments, side="right") - 1
    before, first = np.unique(before[before < time.size - 1], return_index=True)
    moment, after = moments[first], before + 1
    speeds = _at_jumps(time, speed, before, moment, np.concatenate(list(events.values()) or [[]]))
    there = place[before] + (speed[before] + speeds[0]) / 2 * (moment - time[before])
    place = np.insert(place, np.repeat(after, 2), np.repeat(there, 2))
    speed = np.insert(speed, np.repeat(after, 2), speeds.T.ravel())
    sample = np.insert(sample, np.repeat(after, 2), np.repeat(before, 2))
    x, v = (
        shown_unit(ds[name])[0] * values
        for name, values in (("position", place), ("velocity", speed))
    )
    return x, v, sample


def _at_jumps(time, speed, before, moment, events) -> np.ndarray:
    """Velocity just before and just after the impact of each `moment`, (2, moments), from the two
    samples on its either side, of which `before` is the last one before it. Where another of the
    `events` lies between these, the next sample's.
    """
    steps = np.diff(speed) / np.diff(time)
    count = np.histogram(np.unique(events), time)[0]  # between each sample and the next
    smooth = np.pad(np.where(count == 0, steps, 0.0), 1)
    slopes = smooth[before], np.where(count[before] == 1, smooth[before + 2], 0.0)
    ends = before, before + 1
    return np.stack(
        [speed[k] + slope * (moment - time[k]) for k, slope in zip(ends, slopes, strict=True)]
    )


def _angle_axis(ax: Axes, length: float) -> None:
    """Upper axis: angle of the lip (deg), from x = L sin(phi) with both in one unit."""
    low, high = ax.get_xlim()
    ax.set_xlim(max(low, -length), min(high, length))
    upper = ax.secondary_xaxis(
        "top",
        functions=(
            lambda x: np.degrees(np.arcsin(np.clip(np.asarray(x) / length, -1, 1))),
            lambda phi: length * np.sin(np.radians(np.clip(phi, -90, 90))),
        ),
    )
    left, right = np.degrees(np.arcsin(np.clip(np.array(ax.get_xlim()) / length, -1, 1)))
    kept: list[float] = []  # near +-90 deg marks would run into each other
    for angle in sorted(
        MaxNLocator(8, steps=[1, 1.5, 2, 3, 5, 10]).tick_values(left, right), key=abs
    ):
        place = length * np.sin(np.radians(angle))
        if left <= angle <= right and all(
            abs(place - length * np.sin(np.radians(other))) > 0.09 * np.ptp(ax.get_xlim())
            for other in kept
        ):
            kept.append(float(angle))
    upper.set_xticks(kept, [f"{angle:g}" for angle in kept])
    upper.set_xlabel("angle of the lip (deg)")
