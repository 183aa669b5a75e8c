"""One page that says most about a run."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..runs import last_periods, pitch, regime_spans, settled
from .axes import page
from .caption import set_caption
from .friction import LAW, friction_curve
from .history import regime_legend, time_history
from .palette import BELT
from .portrait import phase_portrait
from .spectra import spectrum

FORCES = ("normal_force", "friction_force")


def _rows(ds: xr.Dataset) -> list[tuple[str, int | None]]:
    """Quantities and components of the rows of a page; those normal to the glass in flight only."""
    scalar = ds["position"].ndim == 1
    along: int | None = None if scalar else 0
    rows: list[tuple[str, int | None]] = [("velocity", along), ("position", along)]
    if flies(ds):
        rows = [("velocity", None), ("position", along), ("position", 1)]
    return rows + [(name, None) for name in FORCES if name in ds]


def flies(ds: xr.Dataset) -> bool:
    """Whether a lip leaves the glass in a run."""
    two = ds["position"].ndim == 2 and ds["position"].shape[1] == 2
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
    figure.legend(handles=_handles(ds), loc="outside lower center", ncols=6, frameon=False)
    set_caption(figure, ds)
    return axes


def run_overview(ds: xr.Dataset, whole: xr.Dataset | None = None) -> Figure:
    """The whole run on top; then velocity, position and forces of its last periods, and beside them
    phase portrait, friction on the Stribeck curve and spectrum.

    Arguments:

    - `ds`: a run.
    - `whole`: the run that `ds` is a part of; if None, the last periods of `ds` are the part.
    """
    part = last_periods(ds) if whole is None else ds
    whole = ds if whole is None else whole
    figure = page((13.0, 10.4))
    rows = _rows(part)
    grid = figure.add_gridspec(
        len(rows) + 1,
        2,
        width_ratios=[1.75, 1.0],
        height_ratios=[0.8] + [4 / len(rows)] * len(rows),
    )
    envelope(whole, figure.add_subplot(grid[0, :]), part)
    axes: list[Axes] = []
    for row, (name, component) in enumerate(rows):
        ax = figure.add_subplot(grid[row + 1, 0], sharex=axes[0] if axes else None)
        _row(part, ax, name, component, marks=row == 0)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
    figure.align_ylabels(axes)
    right = grid[1:, 1].subgridspec(3, 1, height_ratios=[1.25, 1, 1])
    portrait = figure.add_subplot(right[0])
    phase_portrait(part, portrait, transient=whole, legend=False)
    wiper = all(name in ds.attrs for name in LAW) and "belt_velocity" in ds
    if wiper:
        friction_curve(part, figure.add_subplot(right[1]), legend=False)
    spectrum(settled(whole), figure.add_subplot(right[2] if wiper else right[1:]))
    figure.legend(handles=_handles(part), loc="outside lower center", ncols=6, frameon=False)
    set_caption(figure, whole, _what(whole, part))
    return figure


def _row(ds: xr.Dataset, ax: Axes, name: str, component: int | None, marks: bool) -> None:
    time_history(ds, ax, quantity=name, component=component, legend=False, marks=marks)
    if (name, component) == ("position", 1):
        ax.set_ylabel("gap (mm)")


def envelope(whole: xr.Dataset, ax: Axes, part: xr.Dataset) -> None:
    """Velocity along the glass of a whole run, with the stretch `part`
    framed.
    """
    component = 0 if whole["velocity"].ndim > 1 else None
    time_history(whole, ax, component=component, legend=False, marks=False)
    start, stop = float(part["time"][0]), float(part["time"][-1])
    if stop - start < 0.98 * float(whole["time"][-1] - whole["time"][0]):
        ax.axvspan(start, stop, facecolor="none", edgecolor="black", linewidth=1.6, zorder=5)


def _what(whole: xr.Dataset, part: xr.Dataset) -> str:
    tone = pitch(whole)
    words = [f"{tone:.4g} Hz"] if np.isfinite(tone) and "belt_velocity" in whole else []
    span = float(part["time"][-1]) - float(part["time"][0])
    if span < 0.98 * float(whole["time"][-1] - whole["time"][0]):
        words.append(f"lower rows: the {1e3 * span:.3g} ms in the frame")
    return "; ".join(words)


def _handles(ds: xr.Dataset) -> list:
    handles: list = regime_legend(ds)
    if flies(ds):
        handles += [
            Line2D([], [], color="black", linestyle="solid", label="along the glass"),
            Line2D([], [], color="black", linestyle="dashed", label="normal to it"),
        ]
    if "belt_velocity" in ds:
        handles.append(Line2D([], [], color=BELT, label="speed of the glass"))
    return handles
