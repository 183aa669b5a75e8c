"""One page that says most about a map."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...noise.class_counts import class_table, unsettled_count
from ...vocabulary.codes import LABELS
from ..curves import curve_legend
from ..style.axes import legend_below, page
from ..style.caption import footnote, moving, set_caption
from .categories import category_legend, category_panels, shown_cells
from .classes import class_bars
from .numbers import told, tones
from .planes import At, choose_plane, cut, fraction_map, frequency_map, map_dims, value_map
from .stability import NOTE


def map_overview(
    ds: xr.Dataset,
    *,
    x: str | None = None,
    y: str | None = None,
    at: At | None = None,
    panels: int = 6,
) -> Figure:
    """The classes as small multiples, then frequency, stick and level at `at` or the middle, and
    the shares of the classes: of all cells of the map, or of those at `at`.

    Arguments: as those of `category_map`.
    """
    x, y = choose_plane(ds, x, y)
    cells, where, panel = shown_cells(ds, x, y, at, panels=panels)
    count = cells.sizes[panel] if panel else 1
    columns = 3 if count > 4 else count
    rows = -(-count // columns)
    figure = page((13.0, 3.0 * rows + 5.3))
    upper, lower = figure.subfigures(
        2, 1, height_ratios=[3.0 * rows + 1.0, 3.5], squeeze=False
    ).ravel()
    axes = upper.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    boundary = category_panels(cells, axes, x, y, panel)
    handles = category_legend(cells, boundary=boundary, shares=False)
    legend_below(upper, handles + curve_legend(cells, axes.ravel()))
    set_caption(figure, ds, where)
    axes = lower.subplots(1, 4, width_ratios=[1, 1, 1, 0.85])
    frequency_map(ds, axes[0], x=x, y=y, at=at)
    fraction_map(ds, "stick", axes[1], x=x, y=y, at=at)
    plane = cut(ds, (x, y), at)[0]
    loud = told(plane, "velocity_rms").where(plane["label"] != LABELS["quiet"])
    heard = np.ma.masked_invalid(loud)
    value_map(
        ds,
        "velocity_rms",
        axes[2],
        x=x,
        y=y,
        at=at,
        norm=tones(heard) if heard.count() else None,  # of quiet cells alone: as they are
        cmap="magma",
        title=f"{moving(ds)} (std)",
    )
    for ax in axes[1:3]:
        ax.set_ylabel("")
    free = tuple(dim for dim in map_dims(ds) if dim not in (at or {}))
    class_bars(*cut(ds, free, at), axes[3])
    words = f"{footnote(ds)}\n{NOTE}" if boundary else footnote(ds)
    if loose := unsettled_count(ds):
        known = sum(count for _, count, _ in class_table(ds))  # without those not computed yet
        words += f"\n{loose:,} of {known:,} cells have not settled in their window"
    lower.supxlabel(words, fontsize="small", color="#555555")
    return figure
