"""Pictures of modes of steady sliding: where two lock in, and where one grows."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..datasets.stated import is_own
from .maps.numbers import SIGNED, suited
from .maps.planes import check_order, usual_plane
from .maps.stability import BETWEEN, NOTE, boundary_legend, stability_boundary
from .style.axes import edges, label, legend_below, long_name, page, set_axis, shown
from .style.caption import set_caption
from .style.palette import BOUNDARY, UNKNOWN

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255", "#000000")


def axes_of(ds: xr.Dataset) -> list[str]:
    """Axes of the sweep whose modes they are, those of more than one value."""
    return [str(n) for n in ds["growth_rate"].dims if ds.sizes[n] > 1]


def modes_page(ds: xr.Dataset) -> Figure:
    """Page of modes over a sweep: over one axis real part and frequency of each (lock-in); over two
    or more the largest real part over two, as a map is drawn, the others at their middle.

    Raises: `ValueError` for modes over no axis, or one whose values are in disorder.
    """
    names = axes_of(ds)
    if not names:
        raise ValueError("modes must be over an axis of two values or more to be drawn")
    one = {str(n): 0 for n in ds["growth_rate"].dims if ds.sizes[n] == 1}
    x, y = usual_plane(names)
    for name in filter(None, (x, y)):
        check_order(ds, name)
    if x is None or y is None:
        return _lock_in(ds.isel(one), names[0])
    return _plane(ds.isel(one | {n: ds.sizes[n] // 2 for n in names if n not in (x, y)}), x, y)


def _lock_in(ds: xr.Dataset, over: str) -> Figure:
    figure = page((7.0, 6.0))
    parts, across = figure.subplots(2, 1, sharex=True), shown(ds[over])[0]
    for ax, name in zip(parts, ("frequency", "real_part"), strict=True):
        values = np.asarray(ds[name].transpose("mode", over), dtype=float)
        for k, row in enumerate(values):
            style = {"marker": "o", "markersize": 4 if k == 0 else 3, "linestyle": "none"}
            ax.plot(across, row, color=COLOURS[k % len(COLOURS)], label=f"mode {k + 1}", **style)
        ax.set_ylabel(label(long_name(ds[name]), ds[name].attrs["units"]))
    parts[1].axhline(0.0, color=BOUNDARY, linewidth=1.0)
    parts[0].legend(frameon=False, ncols=4, fontsize="small")
    set_axis(parts[1], "x", ds[over])
    set_caption(figure, ds, "mode 1 grows fastest; above the line a mode grows")
    return figure


def _plane(ds: xr.Dataset, x: str, y: str) -> Figure:
    figure = page((6.8, 5.2))
    ax = figure.subplots()
    values = np.ma.masked_invalid(ds["growth_rate"].transpose(y, x).values.astype(float))
    norm, _ = suited(values, True, SIGNED)
    ax.set_facecolor(UNKNOWN)
    across, up = shown(ds[x])[0], shown(ds[y])[0]
    mesh = ax.pcolormesh(edges(across), edges(up), values, norm=norm, cmap=SIGNED, rasterized=True)
    boundary = stability_boundary(ds, ax, x, y)
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    figure.colorbar(mesh, ax=ax, pad=0.02).set_label("largest real part (1/s)")
    legend_below(figure, [boundary_legend()] if boundary else [])
    note = BETWEEN if is_own(ds) else NOTE  # maps of a system of one's own have no growth rate
    set_caption(figure, ds, "grey: no steady sliding", note if boundary else "")
    return figure
