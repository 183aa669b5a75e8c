"""Pictures of one trajectory: time histories with bands of regime and marks of events, and the
phase portrait.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .dataset import flag_names

REGIME_COLOURS = {
    "stick": "#0072B2",
    "slip_pos": "#E69F00",
    "slip_neg": "#D55E00",
    "flight": "#56B4E9",
}
REGIME_NAMES = {"slip_pos": "slip forward", "slip_neg": "slip backward"}
MARKED_EVENTS = {"impact": ("v", "#000000"), "lift_off": ("^", "#000000"), "zeno": ("*", "#000000")}
DIRECTIONS = ("along the glass", "normal to the glass")
MOST_MARKS = 400  # more events than this in one picture are a grey carpet


def time_history(
    ds: xr.Dataset, ax: Axes | None = None, *, quantity: str = "velocity", legend: bool = True
) -> Axes:
    """One quantity of a run over time, with bands that show the regime and marks for impacts and
    lift-offs.

    Arguments:

    - `ds`: a run (`wiperjax.simulate`).
    - `legend`: whether to name the components in the axes.
    - `quantity`: `position`, `velocity` (both components, the normal one dashed), or a scalar such
        as `normal_force`.
    """
    if ax is None:
        ax = Figure(figsize=(10.0, 3.2), layout="constrained").subplots()
    time = np.asarray(ds["time"], dtype=float)
    regime_bands(ds, ax)
    values = ds[quantity]
    units = _unit(values)
    extra = [dim for dim in values.sizes if dim != "time"]
    if extra:
        for k, part in enumerate(values.transpose("time", ...).values.T):
            words = DIRECTIONS[k] if len(values[extra[0]]) == 2 else f"coordinate {k}"
            ax.plot(
                time,
                part,
                color="black",
                linewidth=1.0 if k == 0 else 0.8,
                linestyle="-" if k == 0 else "--",
                label=words,
            )
        if legend:
            ax.legend(loc="upper right", fontsize="small", framealpha=0.9)
    else:
        ax.plot(time, values, color="black", linewidth=1.0)
    ax.set_xlim(time[0], time[-1])
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{values.attrs.get('long_name', quantity.replace('_', ' '))}{units}")
    ax.margins(y=0.12)  # room for the marks
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))
    event_marks(ds, ax)
    return ax


def regime_bands(ds: xr.Dataset, ax: Axes) -> None:
    """Shades the background of `ax` by regime, from the exact event times if the run holds them."""
    for start, stop, name in regime_spans(ds):
        ax.axvspan(start, stop, color=REGIME_COLOURS.get(name, "#999999"), alpha=0.28, linewidth=0)


def regime_spans(ds: xr.Dataset) -> Iterator[tuple[float, float, str]]:
    """Start, end (s) and name of each stretch of time in one regime."""
    names = {code: name.lower() for code, name in flag_names(ds["regime"]).items()}
    time = np.asarray(ds["time"], dtype=float)
    if ds.sizes.get("event", 0) and "regime_after" in ds:
        codes = np.concatenate(
            [[int(ds["regime_before"][0])], np.asarray(ds["regime_after"], dtype=int)]
        )
        borders = np.concatenate([[time[0]], np.asarray(ds["event_time"], dtype=float), [time[-1]]])
    else:
        codes = np.asarray(ds["regime"], dtype=int)
        borders = np.concatenate([time, time[-1:]])
    begin = 0
    for k in range(1, len(codes) + 1):
        if k == len(codes) or codes[k] != codes[begin]:
            if borders[k] > borders[begin]:
                yield borders[begin], borders[k], names.get(int(codes[begin]), str(codes[begin]))
            begin = k


def event_marks(ds: xr.Dataset, ax: Axes) -> None:
    """Marks impacts and lift-offs along the upper edge of `ax`, unless there are too many to be
    told apart.
    """
    if not ds.sizes.get("event", 0):
        return
    names = {code: name.lower() for code, name in flag_names(ds["event_kind"]).items()}
    kinds = np.asarray(ds["event_kind"], dtype=int)
    for code, name in names.items():
        times = np.asarray(ds["event_time"], dtype=float)[kinds == code]
        if name in MARKED_EVENTS and 0 < times.size <= MOST_MARKS:
            marker, colour = MARKED_EVENTS[name]
            height = np.full(times.size, 0.97)
            ax.plot(
                times,
                height,
                marker,
                color=colour,
                markersize=4,
                transform=ax.get_xaxis_transform(),
                clip_on=False,
            )


def phase_portrait(ds: xr.Dataset, ax: Axes | None = None, *, component: int = 0) -> Axes:
    """Velocity over position of one coordinate (0: along the glass), coloured by regime."""
    if ax is None:
        ax = Figure(figsize=(5.0, 4.2), layout="constrained").subplots()
    position, velocity = (_component(ds[name], component) for name in ("position", "velocity"))
    names = {code: name.lower() for code, name in flag_names(ds["regime"]).items()}
    codes = np.asarray(ds["regime"], dtype=int)
    points = np.column_stack([position, velocity])
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    for code, name in names.items():
        chosen = pieces[codes[:-1] == code]
        if len(chosen):
            colour = REGIME_COLOURS.get(name, "#999999")
            ax.add_collection(
                LineCollection(
                    list(chosen), colors=colour, linewidths=1.3, rasterized=len(chosen) > 20_000
                )
            )
    ax.plot(position[:1], velocity[:1], "o", color="black", markersize=4, label="start")
    ax.plot(position[-1:], velocity[-1:], "s", color="black", markersize=4, label="end")
    ax.autoscale_view()
    where = DIRECTIONS[component] if _components(ds["position"]) == 2 else f"coordinate {component}"
    ax.ticklabel_format(style="sci", scilimits=(-2, 4))
    ax.set_xlabel(f"position {where}{_unit(ds['position'])}")
    ax.set_ylabel(f"velocity {where}{_unit(ds['velocity'])}")
    ax.legend(loc="best", fontsize="small", framealpha=0.9)
    return ax


def regime_legend(ds: xr.Dataset) -> list[Patch | Line2D]:
    """Legend entries of the regimes that occur in a run and of the marked events."""
    seen = {name for *_, name in regime_spans(ds)}
    handles: list[Patch | Line2D] = [
        Patch(color=colour, alpha=0.5, label=REGIME_NAMES.get(name, name))
        for name, colour in REGIME_COLOURS.items()
        if name in seen
    ]
    if ds.sizes.get("event", 0):
        kinds = np.asarray(ds["event_kind"], dtype=int)
        for code, name in flag_names(ds["event_kind"]).items():
            if name.lower() in MARKED_EVENTS and (kinds == code).any():
                marker, colour = MARKED_EVENTS[name.lower()]
                text = f"{name.lower().replace('_', '-')} ({(kinds == code).sum()})"
                handles.append(
                    Line2D(
                        [], [], marker=marker, color=colour, linestyle="", markersize=5, label=text
                    )
                )
    return handles


def run_figure(ds: xr.Dataset) -> Figure:
    """One page of a run: velocity, position and forces over time, and the phase portrait."""
    rows = [
        name for name in ("velocity", "position", "normal_force", "friction_force") if name in ds
    ]
    figure = Figure(figsize=(13.0, 2.0 * len(rows) + 1.2), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.75, 1.0], squeeze=False).ravel()
    axes = left.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(axes, rows, strict=True):
        time_history(ds, ax, quantity=name, legend=False)
        ax.label_outer()
    phase_portrait(ds, right.subplots()).set_box_aspect(0.9)
    handles = regime_legend(ds)
    if _components(ds["velocity"]) == 2:
        styles = zip(DIRECTIONS, ("-", "--"), strict=True)
        handles += [
            Line2D([], [], color="black", linestyle=style, label=words) for words, style in styles
        ]
    figure.legend(handles=handles, loc="outside lower center", ncols=8, frameon=False)
    if title := str(ds.attrs.get("title", "")):
        figure.suptitle(title, fontweight="bold")
    return figure


def _component(variable: xr.DataArray, component: int) -> np.ndarray:
    values = np.asarray(variable.transpose("time", ...), dtype=float)
    return values[:, component] if values.ndim > 1 else values


def _components(variable: xr.DataArray) -> int:
    return int(np.prod([size for dim, size in variable.sizes.items() if dim != "time"]))


def _unit(variable: xr.DataArray) -> str:
    unit = str(variable.attrs.get("units", "1"))
    return "" if unit == "1" else f" ({unit})"
