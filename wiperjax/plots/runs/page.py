"""One page that says most about a run."""

import textwrap

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...datasets.run_dataset import last_periods, on_belt, regime_spans, settled, usual_axis
from ...datasets.stated import is_own
from ..style.axes import legend_below, page, time_text
from ..style.caption import partner, set_caption, with_noise
from ..style.palette import BELT
from .bands import regime_legend
from .friction import friction_curve
from .history import event_legend, time_history
from .portrait import phase_portrait
from .spectra import spectrum

FORCES = ("normal_force", "friction_force")


def _rows(ds: xr.Dataset) -> list[tuple[str, int | None]]:
    """Quantities and components of the rows of a page; what is normal to the glass in flight only,
    and of a system of one's own its gap."""
    along = None if ds["position"].ndim == 1 else usual_axis(ds)
    rows: list[tuple[str, int | None]] = [("velocity", along), ("position", along)]
    if flies(ds):
        rows = [("velocity", None), ("position", along), ("position", 1)]
    elif "gap" in ds and any(name == "flight" for *_, name in regime_spans(ds)):
        rows.append(("gap", None))
    return rows + [(name, None) for name in FORCES if name in ds]


def flies(ds: xr.Dataset) -> bool:
    """Whether a lip leaves the glass in a run."""
    two = ds["position"].ndim == 2 and ds["position"].shape[1] == 2 and not is_own(ds)
    return two and any(name == "flight" for *_, name in regime_spans(ds))


def history_page(ds: xr.Dataset, quantity: str | None = None) -> np.ndarray:
    """Velocity, position and forces over time (or one `quantity`), below each other, with bands of
    regime.

    Returns: axes, shape (rows,).
    """
    rows = [(quantity, None)] if quantity else _rows(ds)
    figure = page((10.0, 1.75 * len(rows) + 1.5))
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (name, component) in zip(axes, rows, strict=True):
        _row(ds, ax, name, component, marks=ax is axes[0])
        ax.label_outer()
    figure.align_ylabels(axes)
    legend_below(figure, _handles(ds, ds))
    set_caption(figure, ds)
    return axes


def run_overview(ds: xr.Dataset, whole: xr.Dataset | None = None) -> Figure:
    """Velocity, position and forces of the last periods of a run, above them all of it if that is
    more, and beside them phase portrait, friction over slip speed and spectrum.

    Arguments:

    - `ds`: a run.
    - `whole`: the run that `ds` is a part of; if None, the last periods of `ds` are the part.
    """
    part = last_periods(ds) if whole is None else ds
    whole = with_noise(ds if whole is None else whole)
    figure = page((13.0, 10.4))
    rows, framed = _rows(part), is_less(part, whole)
    grid = figure.add_gridspec(
        len(rows) + framed,
        2,
        width_ratios=[1.75, 1.0],
        height_ratios=[0.8] * framed + [4 / len(rows)] * len(rows),
    )
    if framed:
        envelope(whole, figure.add_subplot(grid[0, :]), part)
    axes: list[Axes] = []
    for row, (name, component) in enumerate(rows):
        ax = figure.add_subplot(grid[row + framed, 0], sharex=axes[0] if axes else None)
        _row(part, ax, name, component, marks=row == 0)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
    figure.align_ylabels(axes)
    right = grid[int(framed) :, 1].subgridspec(3, 1, height_ratios=[1.25, 1, 1])
    portrait = figure.add_subplot(right[0])
    phase_portrait(part, portrait, transient=whole if framed else None, legend=False)
    slides = {"slip_speed", *FORCES} <= part.keys()
    if slides:
        friction_curve(part, figure.add_subplot(right[1]), legend=False)
    _spectrum(settled(whole), figure.add_subplot(right[2] if slides else right[1:]))
    legend_below(figure, _handles(part, whole))
    span = time_text(float(part["time"][-1] - part["time"][0]))
    set_caption(figure, whole, f"lower rows: the {span} in the frame" if framed else "")
    return figure


def _spectrum(ds: xr.Dataset, ax: Axes) -> None:
    """The spectrum of a run, or why it has none."""
    try:
        spectrum(ds, ax)
    except ValueError as error:
        ax.set_axis_off()
        ax.text(0.5, 0.5, textwrap.fill(str(error), 40), ha="center", va="center")


def _row(ds: xr.Dataset, ax: Axes, name: str, component: int | None, marks: bool) -> None:
    time_history(ds, ax, quantity=name, component=component, legend=False, marks=marks)
    if (name, component) == ("position", 1) and flies(ds):
        ax.set_ylabel("gap (mm)")
    ax.set_ylabel(ax.get_ylabel().replace(" force", "\nforce"))  # rows are low


def envelope(whole: xr.Dataset, ax: Axes, part: xr.Dataset) -> None:
    """Velocity of the contact over a whole run, with the stretch `part` framed."""
    component = usual_axis(whole) if whole["velocity"].ndim > 1 else None
    time_history(whole, ax, component=component, legend=False, marks=False)
    start, stop = float(part["time"][0]), float(part["time"][-1])
    ax.axvspan(start, stop, facecolor="none", edgecolor="black", linewidth=1.6, zorder=5)


def is_less(part: xr.Dataset, whole: xr.Dataset) -> bool:
    """Whether a part of a run is less than (nearly) all of it."""
    spans = (float(ds["time"][-1] - ds["time"][0]) for ds in (part, whole))
    return next(spans) < 0.98 * next(spans)


def _handles(part: xr.Dataset, whole: xr.Dataset) -> list:
    """Legend entries: regimes of all that is drawn, events of the rows that mark them."""
    handles: list = [*regime_legend(whole), *event_legend(part)]
    if flies(part):
        handles += [
            Line2D([], [], color="black", linestyle="solid", label="along the glass"),
            Line2D([], [], color="black", linestyle="dashed", label="normal to it"),
        ]
    if on_belt(part):
        handles.append(Line2D([], [], color=BELT, label=f"speed of the {partner(whole)}"))
    return handles
