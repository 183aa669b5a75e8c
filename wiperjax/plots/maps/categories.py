"""Any categorical variable of a map: one plane, small multiples of it, and their legend."""

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from ...datasets.map_starts import hangs_on_start
from ...noise.class_counts import class_table, whole_codes
from ...vocabulary.cf import flag_names
from ...vocabulary.codes import NOT_COMPUTED
from ..curves import curve_legend, draw_curves
from ..style.axes import edges, legend_below, long_name, page, set_axis, shown, value_text
from ..style.caption import footnote, set_caption
from ..style.palette import (
    BANDS,
    CLASSES,
    HATCHES,
    MECHANISMS,
    MOTIONS,
    REGIMES,
    SPARE,
    UNKNOWN,
    readable,
)
from .borders import PREFIX, border_legend, draw_borders
from .numbers import told_names
from .planes import At, check_dim, choose_plane, cut, map_dims
from .stability import NOTE, boundary_legend, stability_boundary

COLOURS = REGIMES | MOTIONS | MECHANISMS | BANDS | CLASSES
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
    ds = told_names(ds, variable)
    if ax is not None:
        plane, where = cut(ds, (x, y), at)
        category_panel(plane, ax, x, y, variable)
        ax.set_title(where, fontsize="medium")
        return np.array([ax])
    cells, where, panel = shown_cells(ds, x, y, at, panel, panels)
    count = cells.sizes[panel] if panel else 1
    columns = count if count < 4 else -(-count // 2)
    rows = -(-count // columns)
    figure = page((3.6 * columns + 0.6, 3.0 * rows + 1.6) if count > 1 else (6.4, 5.4))
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    boundary = category_panels(cells, axes, x, y, panel, variable)
    words, computed = footnote(ds), int((np.asarray(cells["label"]) != NOT_COMPUTED).sum())
    if cells["label"].size < ds["label"].size:
        words = f"shares of the {computed:,} cells shown, of {ds['label'].size:,}; {words}"
    words += f"; {NOTE}" if boundary else ""
    legend_below(
        figure,
        category_legend(cells, variable, boundary) + curve_legend(cells, axes.ravel()),
        title=textwrap.fill(words, int(16 * figure.get_figwidth())),
        title_fontsize="x-small",
    )
    set_caption(figure, ds, where, long_name(ds[variable]))
    return axes.ravel()[:count]


def shown_cells(
    ds: xr.Dataset,
    x: str,
    y: str,
    at: At | None = None,
    panel: str | None = None,
    panels: int = 6,
) -> tuple[xr.Dataset, str, str | None]:
    """Cells that small multiples show: up to `panels` slices along `panel`, both ends included.

    Without `panel` it is the first dimension that is neither drawn nor in `at`; all others are cut.

    Returns: those cells; the text of where they are cut; `panel`, or None for a single plane.

    Raises: as `planes.cut`, and `ValueError` for a `panel` that is drawn.
    """
    if panel in (x, y):
        raise ValueError(f"{panel!r} is an axis of the picture and cannot number its panels")
    if panel is None:
        rest = [dim for dim in map_dims(ds) if dim not in (x, y, *(at or {}))]
        panel = next((dim for dim in rest if ds.sizes[dim] > 1), None)
    cells, where = cut(ds, (x, y, panel) if panel else (x, y), at)
    if panel:
        last = ds.sizes[panel] - 1
        places = np.unique(np.linspace(0, last, min(panels, last + 1)).round().astype(int))
        cells = cells.isel({panel: places})
    return cells, where, panel


def category_panels(
    cells: xr.Dataset,
    axes: np.ndarray,
    x: str,
    y: str,
    panel: str | None,
    variable: str = "label",
) -> bool:
    """Draws each slice of `shown_cells` into one of `axes`; hides axes left over.

    Returns: whether there is a stability boundary in one of them.
    """
    planes = list(_planes(cells, panel))
    boundary = False
    for number, ax in enumerate(axes.ravel()):
        if number >= len(planes):
            ax.set_visible(False)
            continue
        plane, words = planes[number]
        boundary |= category_panel(plane, ax, x, y, variable)
        ax.set_title(words, fontsize="medium")
        ax.label_outer()
    return boundary


def _planes(cells: xr.Dataset, panel: str | None) -> Iterator[tuple[xr.Dataset, str]]:
    """Each plane of small multiples, and its title."""
    for k in range(cells.sizes[panel] if panel else 1):
        plane = cells.isel({panel: k}) if panel else cells
        yield plane, value_text(cells[panel], k) if panel else ""


def category_panel(ds: xr.Dataset, ax: Axes, x: str, y: str, variable: str = "label") -> bool:
    """Draws a categorical variable of a map of the dimensions `x` and `y` into `ax`, with the
    stability boundary; returns whether there is one. Where the class hangs on the start it is
    hatched.
    """
    codes = whole_codes(ds[variable].transpose(y, x))
    across, up = edges(shown(ds[x])[0]), edges(shown(ds[y])[0])
    names = flag_names(ds[variable])
    values = sorted(names)
    if NOT_COMPUTED not in names and (codes == NOT_COMPUTED).any():
        codes = np.where(codes == NOT_COMPUTED, np.nan, codes)
    if (strange := codes[np.isfinite(codes) & ~np.isin(codes, values)]).size:
        must = f"{variable} must have codes of {values[0]} to {values[-1]} that have a name"
        raise ValueError(f"{must}, but had {strange.flat[0]:g}")  # another's colour would be drawn
    colours = ListedColormap(list(colours_of(ds[variable]).values()))
    borders = BoundaryNorm([value - 0.5 for value in values] + [values[-1] + 0.5], len(values))
    ax.pcolormesh(across, up, codes, cmap=colours, norm=borders, rasterized=True)
    for value, name in names.items():
        if name in HATCHES and (codes == value).any():
            _hatch(ax, across, up, codes == value, *HATCHES[name])
    several = hangs_on_start(ds) if variable == "label" else None
    if several is not None:
        _hatch(ax, across, up, several.transpose(y, x).values, *HATCHES["several"])
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    draw_borders(ds, ax, x, y, variable)
    if "hopf" in draw_curves(ds, ax, x, y):
        return False  # the same line
    return stability_boundary(ds, ax, x, y)


def _hatch(ax: Axes, across, up, mask: np.ndarray, hatch: str, colour: str) -> None:
    """Hatches the cells of a mask, each row's neighbours as one polygon."""
    row, start, stop = row_runs(mask)
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


def row_runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbours in the rows of a mask (rows, columns): row, first column, one after the last."""
    steps = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(steps == 1)
    return row, start, np.nonzero(steps == -1)[1]


def category_legend(
    cells: xr.Dataset, variable: str = "label", boundary: bool = False, shares: bool = True
) -> list[Any]:
    """Legend entries of `category_keys`, and of the stability `boundary` if it is drawn."""
    handles: list[Any] = [class_swatch(*key) for key in category_keys(cells, variable, shares)]
    if boundary:
        handles.append(boundary_legend())
    on = str(cells.attrs.get(PREFIX + "on", ""))
    if on == variable or "=" in on:
        handles.append(border_legend(on))
    return handles


def category_keys(
    cells: xr.Dataset, variable: str = "label", shares: bool = True
) -> list[tuple[str, str, str]]:
    """Name, text and colour of the categories that occur in `cells`, of cells that are not
    computed, and of those whose class hangs on the start. Shares are of the cells that are there:
    computed, and not taken out by `ds.where`.
    """

    def words(text: str, share: float) -> str:
        part = f"{share:.1%}" if share >= 0.001 else "<0.1%"  # one cell of many is not none
        return f"{text} ({part})" if shares else text

    colours = colours_of(cells[variable])
    keys = [
        (name, words(readable(name), share), colours.get(name, UNKNOWN))
        for name, count, share in class_table(cells, variable)
        if count
    ]
    if (np.asarray(cells["label"]) == NOT_COMPUTED).any():
        keys.append(("not_computed", "not computed", COLOURS["not_computed"]))
    several = hangs_on_start(cells) if variable == "label" else None
    if several is not None and several.any():
        share = float(several.where(cells["class_set"] >= 0).mean())
        keys.append(("several", words("depends on the start", share), "#FFFFFF"))
    return keys


def colours_of(variable: xr.DataArray) -> dict[str, str]:
    """Colour of each name of a categorical variable, in the order of its codes: its own, or a spare
    one.
    """
    spare = iter(SPARE)
    names = [name for _, name in sorted(flag_names(variable).items())]
    return {name: COLOURS.get(name) or next(spare, UNKNOWN) for name in names}


def class_swatch(name: str, text: str, colour: str) -> Patch:
    """Legend entry of a category in its colour and pattern."""
    hatch, edge = HATCHES.get(name, (None, "#444444"))
    return Patch(facecolor=colour, edgecolor=edge, linewidth=0.6, hatch=hatch, label=text)
