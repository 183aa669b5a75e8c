"""Runs over time: any quantity with bands that show the regime, and marks of the events."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ...datasets.run_dataset import check_quantity, contact_axis, event_times, signal
from ...datasets.stated import is_own
from ..style.axes import axes_or_page, label, legend_below, shown
from ..style.caption import direction, partner, quantity_words, set_caption
from ..style.palette import BELT, EVENT_NAMES, EVENTS
from .bands import regime_bands, regime_legend

MARKED = ("belt_reversal", "impact", "zeno", "blow", "lift_off")
MOST_MARKS = 400  # more events than this in one picture are a grey carpet


def time_history(
    ds: xr.Dataset,
    ax: Axes | None = None,
    *,
    quantity: str = "velocity",
    component: int | None = None,
    legend: bool = True,
    marks: bool = True,
) -> Axes:
    """One quantity of a run over time, with bands that show the regime and marks for impacts and
    lift-offs.

    Arguments:

    - `ds`: a run (`wiperjax.simulate`).
    - `quantity`: `position`, `velocity` (with that of the glass, if the contact's is drawn), or a
        scalar such as `normal_force`.
    - `component`: the one to draw; all of them if None, the first one solid.
    - `legend`: whether to name the components in the axes.
    - `marks`: whether to mark impacts, lift-offs and reversals of the belt.

    Raises: `ValueError` if the run has no such quantity over time.
    """
    values = check_quantity(ds, quantity)
    ax, whole = axes_or_page(ax, (10.0, 3.6))
    time = np.asarray(ds["time"], dtype=float)
    regime_bands(ds, ax)
    numbers, unit = shown(values.transpose("time", ...))
    if quantity == "velocity" and "belt_velocity" in ds:
        contact = contact_axis(ds)
        if contact is not None and component in (None, contact):
            belt = shown(ds["belt_velocity"])[0]
            ax.plot(time, belt, color=BELT, linewidth=1.3, label=partner(ds))
    if numbers.ndim > 1:
        for k, part in enumerate(numbers.T):
            if component not in (None, k):
                continue
            first = k == (0 if component is None or not is_own(ds) else component)
            style = {"linewidth": 1.0 if first else 0.8, "linestyle": "-" if first else "--"}
            ax.plot(time, part, color="black", label=direction(ds, k), **style)
    else:
        ax.plot(time, numbers, color="black", linewidth=1.0)
    if time[-1] > time[0]:  # not of one sample
        ax.set_xlim(time[0], time[-1])
    ax.set_xlabel("time (s)")
    drawn = values if component is None else signal(ds, quantity, component)
    ax.set_ylabel(label(quantity_words(ds, drawn), unit))
    ax.margins(y=0.12)  # room for the marks
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-3, 5))
    if marks:
        event_marks(ds, ax)
    if whole:
        curves = ax.get_legend_handles_labels()[0] if legend else []
        legend_below(ax.figure, [*regime_legend(ds), *event_legend(ds), *curves])
        set_caption(ax.figure, ds)
    elif legend and ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper right", fontsize="small", framealpha=0.9)
    return ax


def shown_events(ds: xr.Dataset) -> dict[str, np.ndarray]:
    """Times (s) of the kinds of event that have a mark, in the order of `palette.EVENTS`."""
    times = event_times(ds)
    return {name: times[name] for name in EVENTS if name in times}


def event_marks(ds: xr.Dataset, ax: Axes) -> None:
    """Marks impacts, blows, lift-offs and reversals of the belt along the upper edge of `ax`,
    unless there are too many to be told apart.
    """
    for name, times in shown_events(ds).items():
        if name in MARKED and times.size <= MOST_MARKS:
            ax.plot(
                times,
                np.full(times.size, 0.97),
                EVENTS[name],
                color="black",
                markersize=4,
                transform=ax.get_xaxis_transform(),
                clip_on=False,
            )


def event_legend(ds: xr.Dataset) -> list[Line2D]:
    """Legend entries of the marked events of a run."""
    return [
        Line2D(
            [], [], marker=EVENTS[name], color="black", linestyle="", markersize=5,
            label=f"{EVENT_NAMES[name]} ({times.size})",
        )
        for name, times in shown_events(ds).items()
        if name in MARKED
    ]  # fmt: skip
