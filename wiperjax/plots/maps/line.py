"""Maps along one axis: frequency, amplitude and regimes over belt speed, and regimes over time."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...datasets.stated import is_own
from ...noise.class_counts import unsettled
from ...noise.classes import class_bands, stored
from ...vocabulary.cf import flag_names
from ..style.axes import axes_or_page, edges, legend_below, page, plain_log, set_axis, shown
from ..style.caption import moving, set_caption, start_text
from ..style.palette import BOUNDARY, CLASSES, HATCHES, REGIMES, UNKNOWN, readable
from .numbers import TONE, told
from .planes import At, check_dim, check_order, class_names, cut, long_axes
from .shares import regime_shares, stacked
from .stability import between, growth_between, places


def along_axis(
    ds: xr.Dataset,
    axes: np.ndarray | None = None,
    *,
    along: str | None = None,
    at: At | None = None,
) -> np.ndarray:
    """Dominant frequency, amplitude and shares of the regimes over one axis of a map, as in a
    bifurcation diagram: marks have the colour of their noise class, and are hollow where the
    motion had not settled.

    Arguments:

    - `ds`: a map; its other axes are cut at `at`, or in the middle.
    - `axes`: three axes, below each other; a page of its own if None.
    - `along`: dimension across; belt speed if there, else the longest.
    - `at`: dimension -> value at which it is cut, in the units of the map.

    Frequencies of cells that are quiet, carried along, failed or collapsed are not drawn. Shares
    are steps, a cell each; failed and collapsed cells, which have none, are hatched. The thin line
    is the frequency of steady slip, linearised, and grey bands are where steady slip is unstable.

    Returns: axes, shape (3,).
    """
    line, where, along = _line(ds, along, at)
    whole = axes is None
    rows = np.asarray(_column() if axes is None else axes)
    across = shown(line[along])[0]
    names = class_names(line)
    handles = _frequencies(line, rows[0], across, names)
    _amplitudes(line, rows[1], across)
    shares = regime_shares(line, rows[2], across, names)
    for ax in rows:
        set_axis(ax, "x", line[along])
        ax.label_outer()
    unstable = _unstable(line, along, rows, across)
    if whole:
        figure = rows[0].figure
        if unstable:
            handles.append(
                Patch(color="#000000", alpha=0.08, label="steady slip unstable (interpolated)")
            )
        legend_below(figure, handles + shares)
        set_caption(figure, ds, where, start_text(ds))
    return rows


def _column() -> np.ndarray:
    return page((7.0, 6.6)).subplots(3, 1, sharex=True, height_ratios=[1.2, 1.0, 0.7])


def _line(ds: xr.Dataset, along: str | None, at: At | None) -> tuple[xr.Dataset, str, str]:
    """Slice of a map along one axis, the text of where it lies, and the name of the axis."""
    check_dim(ds, along)
    free = [dim for dim in long_axes(ds) if dim not in (at or {})]
    if along is None:
        along = (
            "belt_speed"
            if "belt_speed" in free
            else max(free, key=lambda dim: ds.sizes[dim], default=None)
        )
    if along is None or ds.sizes[along] < 2:
        raise ValueError("the picture needs a map with an axis of more than one number")
    check_order(ds, along)
    line, where = cut(ds, (along,), at)
    return line, where, along


def _marks(ax: Axes, across: np.ndarray, values: np.ndarray, line: xr.Dataset) -> None:
    """Points in the colours of their classes, with a white heart where a cell has not settled. Thin
    outlines (quiet is nearly white) lie below all of them: of many marks that overlap they would
    hide the colours.
    """

    def dots(chosen: np.ndarray | slice, size: float, colour: str) -> None:
        ax.scatter(across[chosen], values[chosen], s=size, color=colour, linewidth=0, zorder=3)

    names, loose = class_names(line), unsettled(line).values
    dots(slice(None), 27, "#333333")
    for name in dict.fromkeys(names):
        dots(names == name, 18, CLASSES.get(name, UNKNOWN))
    if loose.any():
        dots(loose, 9, "#333333")
        dots(loose, 5, "white")


def _frequencies(line: xr.Dataset, ax: Axes, across: np.ndarray, names: np.ndarray) -> list:
    frequency = told(line, TONE).values
    _marks(ax, across, frequency, line)
    plain_log(ax, "y")
    ax.set_ylabel("dominant\nfrequency (Hz)")
    handles = [
        Line2D(
            [], [], marker="o", linestyle="", markersize=5, label=readable(name),
            markerfacecolor=CLASSES.get(name, UNKNOWN), markeredgecolor="#333333",
            markeredgewidth=0.5,
        )
        for name in CLASSES
        if name in names and name not in HATCHES
    ]  # fmt: skip
    if unsettled(line).any():
        handles.append(
            Line2D(
                [], [], marker="o", linestyle="", markersize=5, markerfacecolor="white",
                markeredgecolor="#333333", label="not settled",
            )
        )  # fmt: skip
    linear = np.zeros(0)
    if "linear_frequency" in line:
        linear = np.asarray(line["linear_frequency"], dtype=float)
        turns = linear > 0  # what creeps away has no frequency
        if (turns[1:] & turns[:-1]).any():  # of one cell alone there is no line
            (drawn,) = ax.plot(
                across, np.where(turns, linear, np.nan), color=BOUNDARY, linewidth=0.9,
                label="steady slip, linearised",
            )  # fmt: skip
            handles.append(drawn)
    if "class_squeal_band" in line.attrs:
        for name, low, high in class_bands(stored(line.attrs)):
            ax.axhspan(max(low, 1e-3), high, color=CLASSES[name], alpha=0.10, linewidth=0)
    heard = frequency[np.isfinite(frequency)]
    seen = heard if heard.size else linear[linear > 0]
    low, high = (np.inf, 0.0) if is_own(line) and seen.size else (80.0, 1500.0)
    low = min(0.6 * np.min(seen, initial=np.inf), low)
    ax.set_ylim(low, max(1.6 * np.max(seen, initial=0.0), high))
    return handles


def _amplitudes(line: xr.Dataset, ax: Axes, across: np.ndarray) -> None:
    """Standard deviation of the tip velocity, and what it would be at the speed of the glass."""
    speed = told(line, "velocity_rms").values
    _marks(ax, across, speed, line)
    ax.set_ylabel(f"{moving(line)},\nstd (m/s)")
    ax.set_ylim(0, 1.08 * np.nanmax(speed, initial=0.0) or 1.0)


def _unstable(line: xr.Dataset, along: str, axes: np.ndarray, across: np.ndarray) -> bool:
    """Shades where the growth rate of steady slip is positive; returns whether it is anywhere."""
    growth = growth_between(line, along)
    if growth is None:  # of one sign, if there are any
        growth = np.asarray(line.get("growth_rate", np.full(across.size, np.nan)), dtype=float)
    place = between(across, places(across.size, growth.size))
    for ax in axes[:2]:
        ax.fill_between(
            place, 0, 1, where=growth > 0, alpha=0.08,
            color="#000000", linewidth=0, transform=ax.get_xaxis_transform(),
        )  # fmt: skip
    return bool((growth > 0).any())


def class_shares(
    ds: xr.Dataset, ax: Axes | None = None, *, along: str | None = None, at: At | None = None
) -> Axes:
    """Shares of the random starts that end in each class, stacked, over one axis of a map that was
    swept with `[starts] random`.

    Arguments: as those of `along_axis`.

    Raises: `ValueError` if the map holds no shares.
    """
    if "class_share" not in ds:
        raise ValueError("this map holds no shares; sweep with [starts] random = 200, say")
    line, where, along = _line(ds, along, at)
    ax, whole = axes_or_page(ax, (7.0, 4.2))
    shares = line["class_share"].transpose("class", along)
    seen = [str(name) for name in line["class"].values if (shares.sel({"class": name}) > 0).any()]
    across = shown(line[along])[0]
    bands = stacked(
        ax, across, [shares.sel({"class": name}).values for name in seen],
        [CLASSES.get(name, UNKNOWN) for name in seen], [readable(name) for name in seen],
        edgecolor="#333333", linewidth=0.5,
    )  # fmt: skip
    ax.set_ylabel("share of the starts")
    set_axis(ax, "x", line[along])
    if whole:
        legend_below(ax.figure, bands)
        error = float(line["class_share_error"].max())
        words = f"{ds.attrs.get('starts_random', '')} random starts of each cell"
        set_caption(ax.figure, ds, where, f"{words}, standard error of a share up to {error:.2g}")
    return ax


def regime_raster(
    ds: xr.Dataset, ax: Axes | None = None, *, along: str | None = None, at: At | None = None
) -> Axes:
    """Regime over time in the settled window, a row for each value of one axis of a map that was
    swept with `[run] raster`.

    Arguments: as those of `along_axis`. Grey: the cell ended before.

    Raises: `ValueError` if the map holds no raster.
    """
    if "regime_raster" not in ds:
        raise ValueError("this map holds no regime over time; sweep with [run] raster = 200, say")
    check_order(ds, "raster_time")
    line, where, along = _line(ds, along, at)
    ax, whole = axes_or_page(ax, (7.0, 5.0))
    codes = line["regime_raster"].transpose(along, "raster_time").values
    names = flag_names(line["regime_raster"])
    order = [code for code, name in names.items() if name in REGIMES]
    colours = ListedColormap([*(REGIMES[names[code]] for code in order), UNKNOWN])
    borders = BoundaryNorm(np.arange(len(order) + 2) - 0.5, len(order) + 1)
    time = 1e3 * edges(np.asarray(ds["raster_time"], dtype=float))
    values = np.select([codes == code for code in order], range(len(order)), len(order))
    values = np.ma.masked_array(values, np.isnan(codes))  # of cells that `ds.where` took out
    up = edges(shown(line[along])[0])
    begun = time.clip(min=0.0)  # nothing was seen before the window
    ax.pcolormesh(begun, up, values, cmap=colours, norm=borders, rasterized=True)
    set_axis(ax, "y", line[along])
    ax.set_xlabel("time in the settled window (ms)")
    if whole:
        seen = [code for code in order if (codes == code).any()]
        handles = [Patch(color=REGIMES[names[c]], label=readable(names[c])) for c in seen]
        ended = dict.fromkeys(class_names(line)[(values == len(order)).any(axis=1)])
        if ended:
            words = f"ended before ({', '.join(map(readable, ended))})"
            handles.append(Patch(color=UNKNOWN, label=words))
        legend_below(ax.figure, handles)
        coarse = _coarse(line, float(np.abs(np.diff(time)).mean()))
        set_caption(ax.figure, ds, where, start_text(ds), coarse)
    return ax


def _coarse(line: xr.Dataset, step: float) -> str:
    """How far apart (ms) the instants of a raster lie, and whether that is too far for the tone."""
    tone = float(np.nanmax(told(line, TONE).values, initial=0.0)) if TONE in line else 0.0
    text = f"an instant every {step:.3g} ms"
    if 2e-3 * step * tone > 1:
        text += f": too few for {tone:.4g} Hz, the pattern is beats"
    return text
