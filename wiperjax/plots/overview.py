"""One page that says most about a map."""

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from .axes import page
from .caption import footnote, set_caption
from .categories import category_legend, category_panels, panel_dim
from .classes import class_bars
from .planes import At, choose_plane, cut, fraction_map, frequency_map, value_map


def map_overview(
    ds: xr.Dataset,
    *,
    x: str | None = None,
    y: str | None = None,
    at: At | None = None,
    panels: int = 6,
) -> Figure:
    """The classes as small multiples, then frequency, stick and level at `at` or the middle, and
    the shares of the classes.

    Arguments: as those of `category_map`.
    """
    x, y = choose_plane(ds, x, y)
    panel = panel_dim(ds, x, y, at)
    count = min(panels, ds.sizes[panel]) if panel else 1
    columns = 3 if count > 3 else count
    rows = -(-count // columns)
    figure = page((13.0, 3.0 * rows + 5.3))
    upper, lower = figure.subfigures(
        2, 1, height_ratios=[3.0 * rows + 1.0, 3.5], squeeze=False
    ).ravel()
    axes = upper.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    category_panels(ds, axes, x, y, panel, count, at)
    upper.legend(handles=category_legend(ds), loc="outside lower center", ncols=8, frameon=False)
    set_caption(figure, ds)
    axes = lower.subplots(1, 4, width_ratios=[1, 1, 1, 0.85])
    frequency_map(ds, axes[0], x=x, y=y, at=at)
    fraction_map(ds, "stick", axes[1], x=x, y=y, at=at)
    speed = np.asarray(cut(ds, (x, y), at)[0]["velocity_rms"], dtype=float)
    speed = speed[np.isfinite(speed) & (speed > 0)]
    top = float(speed.max()) if speed.size else 1.0
    value_map(
        ds,
        "velocity_rms",
        axes[2],
        x=x,
        y=y,
        at=at,
        norm=LogNorm(1e-3 * top, top),
        cmap="magma",
        title="tip velocity (std)",
    )
    for ax in axes[1:3]:
        ax.set_ylabel("")
    class_bars(ds, axes[3])
    lower.supxlabel(footnote(ds), fontsize="small", color="#555555")
    return figure
