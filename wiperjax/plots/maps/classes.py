"""Maps of what is discrete: the noise class of each cell, or the regimes its motion consists of."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...noise.class_counts import cell_by_cell, class_table, whole_codes
from ...noise.classes import stored
from ...vocabulary.cf import flags
from ...vocabulary.codes import LABELS, NOT_COMPUTED
from ...vocabulary.thresholds import silence
from ..style.caption import wrapped
from ..style.palette import CLASSES, HATCHES, MOTIONS, UNKNOWN, readable
from .categories import category_map
from .planes import PANEL


def motion(ds: xr.Dataset) -> xr.DataArray:
    """Regimes that the settled motion of each cell of a map consists of, int8 with CF flags.

    Steady slip is slip throughout with a velocity that does not oscillate (the map's own threshold
    of `quiet`); all other names say which regimes occur in the settled window. Failed and collapsed
    cells stay that.

    Raises: `KeyError` if the map lacks a column that this needs.
    """
    ds = cell_by_cell(ds)
    stick, flight = np.asarray(ds["stick_fraction"]) > 0, np.asarray(ds["flight_fraction"]) > 0
    only = np.asarray(ds["stick_fraction"]) >= 1
    belt = np.asarray(ds["belt_speed_rms"]) if "belt_speed_rms" in ds else None
    still = np.asarray(ds["velocity_rms"]) <= silence(stored(ds.attrs), belt)
    ended = whole_codes(ds["label"])
    names = {name: code for code, name in enumerate(MOTIONS)} | {"not_computed": NOT_COMPUTED}
    codes = np.select(
        [
            ended == NOT_COMPUTED,
            ended == LABELS["failed"],
            ended == LABELS["collapsed"],
            only,
            stick & flight,
            flight,
            stick,
            still,
        ],
        [
            names[name]
            for name in (
                *("not_computed", "failed", "collapsed", "stick_only", "stick_slip_and_flight"),
                *("slip_and_flight", "stick_and_slip", "steady_slip"),
            )
        ],
        default=names["slip_only"],
    ).astype(np.int8)
    attrs = {"long_name": "regimes in the settled window"} | flags(names)
    label = ds["label"]
    found = xr.DataArray(codes, coords=label.coords, dims=label.dims, attrs=attrs)
    return found if label.dtype.kind == "i" else found.where(label.notnull())  # as `ds.where` left


def class_map(ds: xr.Dataset, ax: Axes | None = None, **options: Any) -> np.ndarray:
    """Noise classes over two axes, as small multiples over a third; see `category_map`."""
    return category_map(ds, "label", ax, **options)


def regime_map(ds: xr.Dataset, ax: Axes | None = None, **options: Any) -> np.ndarray:
    """Regimes that the settled motion consists of (`motion`) over two axes; see `category_map`."""
    return category_map(ds.assign(motion=motion(ds)), "motion", ax, **options)


def mechanism_map(ds: xr.Dataset, ax: Axes | None = None, **options: Any) -> np.ndarray:
    """What keeps the motion going (the column `mechanism`) over two axes; see `category_map`."""
    return category_map(ds, "mechanism", ax, **options)


def class_bars(ds: xr.Dataset, where: str, ax: Axes) -> Axes:
    """Share of each class among the cells of `ds`, in words and numbers; `where` they are cut."""
    table = [row for row in class_table(ds) if row[1] > 0][::-1]
    names = [readable(name) for name, _, _ in table]
    bars = ax.barh(
        names,
        [share for *_, share in table],
        color=[CLASSES.get(n, UNKNOWN) for n, *_ in table],
    )
    for bar, (name, count, share) in zip(bars, table, strict=True):
        hatch, colour = HATCHES.get(name, (None, "#444444"))
        bar.set(edgecolor=colour, hatch=hatch, linewidth=0.6)
        ax.text(
            bar.get_width() + 0.01,
            bar.get_y() + bar.get_height() / 2,
            f"{share:.1%}  ({count:,})",
            va="center",
        )
    ax.set_xlim(0, 1.35 * max((share for *_, share in table), default=1.0))
    ax.set_xticks([])
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    title = f"share of {sum(count for _, count, _ in table):,} cells"
    ax.set_title(f"{title}\n{wrapped(where, PANEL)}".strip(), fontsize="medium")
    return ax
