"""Any categorical variable of a map: one plane, small multiples of it, and their legend."""

import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..labels import class_table
from ..schema import NOT_COMPUTED, flag_names
from .axes import edges, page, set_axis, shown
from .caption import footnote, set_caption
from .palette import BOUNDARY, CLASSES, HATCHES, MECHANISMS, MOTIONS, UNKNOWN, readable
from .planes import At, check_dim, choose_plane, cut, map_dims, stability_boundary

COLOURS = MOTIONS | MECHANISMS | CLASSES
MOST_HATCHED = 20_000  # pieces; beyond, cells are finer than the pattern, and colour must do


def category_map(
    ds: xr.Dataset,
    variable: str,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    at: At | None = None,
    panel: str | None = None,
    panels: int = 6,
) -> np.ndarray:
    """A categorical variable over two axes, as small multiples over a third.

    Arguments:

    - `ds`: a map.
    - `ax`: draw one plane here, at `at` or the middle of all other axes.
    - `x`, `y`: dimensions across and up; attack angle and belt speed if there.
    - `at`: dimension -> value at which it is cut, in the units of the map.
    - `panel`: dimension of the small multiples; the first of those not in `at`. What is left is cut
        at its middle value.
    - `panels`: most small multiples; they are spread over the values, both ends included.

    Returns: axes, shape (panels,).

    Raises: `ValueError` for names that are no axes of the map, and values outside them.
    """
    x, y = choose_plane(ds, x, y)
    check_dim(ds, panel)
    if ax is not None:
        plane, where = cut(ds, (x, y), at)
        category_panel(plane, ax, x, y, variable)
        ax.set_title(where, fontsize="medium")
        return np.array([ax])
    panel = panel or panel_dim(ds, x, y, at)
    count = min(panels, ds.sizes[panel]) if panel else 1
    columns = count if count < 4 else -(-count // 2)
    rows = -(-count // columns)
    figure = page((3.6 * columns + 0.6, 3.0 * rows + 1.6) if count > 1 else (6.4, 5.4))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    category_panels(ds, axes, x, y, panel, count, at, variable)
    handles = category_legend(ds, variable)
    width = figure.get_figwidth()
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(len(handles), int(width / 2.0)),
        frameon=False,
        title=textwrap.fill(footnote(ds), int(16 * width)),
        title_fontsize="x-small",
    )
    set_caption(figure, ds)
    return axes.ravel()[:count]


def panel_dim(ds: xr.Dataset, x: str, y: str, at: At | None = None) -> str | None:
    """Dimension of the small multiples: the first that is neither drawn nor cut."""
    rest = [dim for dim in map_dims(ds) if dim not in (x, y, *(at or {}))]
    return next((dim for dim in rest if ds.sizes[dim] > 1), None)


def category_panels(
    ds: xr.Dataset,
    axes: np.ndarray,
    x: str,
    y: str,
    panel: str | None,
    count: int,
    at: At | None = None,
    variable: str = "label",
) -> None:
    """Draws `count` slices along `panel` (one plane if None) into `axes`; hides axes left over."""
    places = (
        np.unique(np.linspace(0, ds.sizes[panel] - 1, count).round().astype(int)) if panel else [0]
    )
    for number, ax in enumerate(axes.ravel()):
        if number >= len(places):
            ax.set_visible(False)
            continue
        part = ds.isel({panel: [places[number]]}) if panel else ds
        plane, where = cut(part, (x, y), at)
        category_panel(plane, ax, x, y, variable)
        ax.set_title(where, fontsize="medium")
        ax.label_outer()


def category_panel(ds: xr.Dataset, ax: Axes, x: str, y: str, variable: str = "label") -> None:
    """Draws a categorical variable of a map of the dimensions `x` and `y` into `ax`, with the
    stability boundary.
    """
    codes = ds[variable].transpose(y, x).values
    across, up = edges(shown(ds[x])[0]), edges(shown(ds[y])[0])
    names = flag_names(ds[variable])
    values = sorted(names)
    colours = ListedColormap([COLOURS.get(names[value], UNKNOWN) for value in values])
    borders = BoundaryNorm([value - 0.5 for value in values] + [values[-1] + 0.5], len(values))
    ax.pcolormesh(across, up, codes, cmap=colours, norm=borders, rasterized=True)
    for value, name in names.items():
        if name in HATCHES and (codes == value).any():
            _hatch(ax, across, up, codes == value, *HATCHES[name])
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    stability_boundary(ds, ax, x, y)


def _hatch(ax: Axes, across, up, mask: np.ndarray, hatch: str, colour: str) -> None:
    """Hatches the cells of a mask, each row's neighbours as one polygon."""
    steps = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(steps == 1)
    stop = np.nonzero(steps == -1)[1]
    if len(row) > MOST_HATCHED:
        return
    x0, x1, y0, y1 = across[start], across[stop], up[row], up[row + 1]
    corners = [np.stack(pair, -1) for pair in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    # Hatches take the colour of the edge, whose own width 0 leaves no grid.
    ax.add_collection(
        PolyCollection(
            list(np.stack(corners, axis=1)),
            facecolor="none",
            edgecolor=colour,
            hatch=hatch,
            linewidth=0.0,
        ),
        autolim=False,
    )


def category_legend(
    ds: xr.Dataset, variable: str = "label", boundary: bool = True, shares: bool = True
) -> list[Any]:
    """Legend entries of the categories that occur in a map, with their shares, and of the stability
    boundary.
    """
    handles: list[Any] = []
    for name, count, share in class_table(ds, variable):
        if count:
            part = f"{share:.1%}" if share >= 0.001 else "<0.1%"  # one cell of many is not none
            text = f"{readable(name)} ({part})" if shares else readable(name)
            handles.append(_swatch(name, text))
    if (np.asarray(ds["label"]) == NOT_COMPUTED).any() and variable != "motion":
        handles.append(_swatch("not_computed", "not computed"))
    rate = np.asarray(ds["growth_rate"]) if boundary and "growth_rate" in ds else np.zeros(1)
    if (rate > 0).any() and (rate < 0).any():  # else there is no such line
        handles.append(
            Line2D(
                [], [], color=BOUNDARY, linewidth=1.4, label="steady slip loses stability (linear)"
            )
        )
    return handles


def _swatch(name: str, text: str) -> Patch:
    hatch, colour = HATCHES.get(name, (None, "#444444"))
    return Patch(
        facecolor=COLOURS.get(name, UNKNOWN),
        edgecolor=colour,
        linewidth=0.6,
        hatch=hatch,
        label=text,
    )
