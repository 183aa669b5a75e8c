"""Borders of a refined map as curves over a plane of it.

Points on the edges of a cell are joined across it: two of one pair of answers by a straight piece,
what is left, where three answers meet, at the middle. Cells that were halved are drawn by their
parts.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from ...datasets.borders import unfit
from ...vocabulary import checks
from ...vocabulary.codes import CROSSINGS
from ..style.axes import shown
from ..style.palette import BORDER, BOUNDARY

PREFIX = "border_"
NEAR = 1e-5  # cells: points so close to a plane or an edge lie on it
Points = tuple[np.ndarray, np.ndarray]  # places (points, 2) in cells, and pairs of codes as one


def with_borders(ds: xr.Dataset, borders: xr.Dataset) -> xr.Dataset:
    """A map with its borders (`wiperjax.borders`), which its pictures then show as curves.

    They are coordinates: `ds.where` and `xr.concat` would give a copy of each to every cell.

    Raises: ValueError for what is no map, or no borders.
    """
    checks.instance("borders", borders, xr.Dataset, "those of a map, such as borders(...)")
    if why := unfit(borders):  # no curve would be drawn, or a wrong one
        raise ValueError(f"borders must be those of a map, but had {why}")
    named = borders.rename({name: PREFIX + str(name) for name in borders.data_vars})
    return ds.assign_coords(named.data_vars).assign_attrs(
        {PREFIX + name: borders.attrs[name] for name in ("on", "levels")}
    )


def draw_borders(ds: xr.Dataset, ax: Axes, x: str, y: str, variable: str) -> bool:
    """Draws the borders of `variable` in a plane of a map; returns whether there are any."""
    pieces, dots = border_pieces(ds, x, y, variable)
    if not len(pieces) + len(dots):
        return False
    lines = [_values(ds, x, y, np.array(piece)) for piece in pieces]
    for colour, width in ((BOUNDARY, 2.0), (BORDER, 1.0)):  # seen on dark and on bright cells
        curves = LineCollection(lines, colors=colour, linewidths=width, capstyle="round")
        ax.add_collection(curves, autolim=False)
    dots = _values(ds, x, y, dots)
    ax.plot(dots[:, 0], dots[:, 1], ".", color=BORDER, markersize=1.5)
    return True


def border_pieces(ds: xr.Dataset, x: str, y: str, variable: str) -> tuple[list, np.ndarray]:
    """Borders of `variable` in a plane of a map, in cells from its first one along `x` and `y`:
    straight pieces, each a pair of points (2,), and the points that no curve joins, (points, 2).

    Raises: `ValueError` where nothing tells which plane it is: an axis that is not drawn is gone.
    """
    if not _has_borders(ds, variable):
        return [], np.zeros((0, 2))
    place, pair, rough = _in_plane(ds, x, y)
    last = np.array([ds.sizes[x], ds.sizes[y]]) - 2
    cells = _cells((place[~rough], pair[~rough]), last)
    return [piece for cell in cells for piece in _joined(*cell)], place[rough]


def border_places(ds: xr.Dataset, x: str, variable: str) -> np.ndarray:
    """Borders of `variable` along the one axis `x` of a map, (points,), in cells from its first."""
    if not _has_borders(ds, variable):
        return np.zeros(0)
    names = str(ds[PREFIX + "axis"].attrs["flag_meanings"]).split()
    here = ds[PREFIX + "axis"].values == names.index(x)
    place = _rank(ds, x, ds[PREFIX + x].values[here])
    return place[np.isfinite(place)]


def _has_borders(ds: xr.Dataset, variable: str) -> bool:
    """Whether a map has borders, and these are of `variable` or of a threshold."""
    on = str(ds.attrs.get(PREFIX + "on", ""))
    return PREFIX + "axis" in ds and ("=" in on or on == variable)


def border_legend(on: str) -> Line2D:
    """The entry of the curves in a legend; `on`: what they are borders of."""
    outline = withStroke(linewidth=2.0, foreground=BOUNDARY)
    label = border_words(on)
    return Line2D([], [], color=BORDER, linewidth=1.0, path_effects=[outline], label=label)


def border_words(on: str) -> str:
    """What the curves are, in a few words: of a threshold it is named."""
    return f"{on} (located)" if "=" in on else "border (located)"


def _in_plane(ds: xr.Dataset, x: str, y: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the plane: places (points, 2) in cells, pairs of codes, and which have no curve."""
    names = str(ds[PREFIX + "axis"].attrs["flag_meanings"]).split()
    axis = ds[PREFIX + "axis"].values
    inside = np.isin(axis, [names.index(name) for name in (x, y) if name in names])
    for name in names:
        if name not in (x, y, *ds.coords) and np.ptp(ds[PREFIX + name].values) > 0:
            must = f"must say which {name} it is of, for its borders to be drawn"
            raise ValueError(f"the map {must}; ds.isel({name}=0) without drop=True keeps it")
    for name in ds.coords:
        if str(name) not in (x, y) and PREFIX + str(name) in ds and not ds[name].ndim:
            value = float(ds[name])
            inside &= np.abs(ds[f"{PREFIX}{name}"].values - value) <= 1e-9 * max(1, abs(value))
    place = np.stack([_rank(ds, name, ds[PREFIX + name].values) for name in (x, y)], axis=-1)
    inside &= np.isfinite(place).all(axis=1)
    codes = np.sort([ds[PREFIX + side].values for side in ("side_low", "side_high")], axis=0)
    kind = ds[PREFIX + "kind"].values
    rough = np.isin(kind, [CROSSINGS["irregular"], CROSSINGS["unresolved"]])
    pair = codes[0].astype(int) * 256 + codes[1]
    return place[inside], pair[inside], rough[inside]


def _geometric(ds: xr.Dataset, name: str) -> bool:
    """Whether the refinement halved the cells along an axis by ratio: as its file spaces them,
    whatever its values look like.
    """
    return ds[PREFIX + name].attrs.get("spacing") == "geometric"


def _rank(ds: xr.Dataset, name: str, values: np.ndarray) -> np.ndarray:
    """Values of an axis in cells from its first one; NaN of those beyond its ends, where the map
    is a part of the one that the borders are of.
    """
    axis = np.asarray(ds[name].values, dtype=float)
    unit, own = (ds[one].attrs.get("units") for one in (PREFIX + name, name))
    if None not in (unit, own) and unit != own:
        raise ValueError(f"{name} must be in {unit}, as the borders of its map are, was in {own}")
    if _geometric(ds, name):  # may be negative throughout
        axis, values = np.log(np.abs(axis)), np.log(np.abs(values))
    order = np.argsort(axis)
    low, high = axis[order[[0, -1]]]
    room = NEAR * (high - low) / len(axis)
    rank = np.interp(values, axis[order], np.arange(float(len(axis)))[order])
    return np.where((values >= low - room) & (values <= high + room), rank, np.nan)


def _values(ds: xr.Dataset, x: str, y: str, place: np.ndarray) -> np.ndarray:
    """What pictures show at places in cells, (points, 2)."""
    found = []
    for name, rank in zip((x, y), np.moveaxis(place.reshape(-1, 2), 1, 0), strict=True):
        axis = shown(ds[name])[0]
        geometric = _geometric(ds, name)
        along = np.log(np.abs(axis)) if geometric else axis
        values = np.interp(rank, np.arange(len(axis)), along)
        found.append(np.sign(axis[0]) * np.exp(values) if geometric else values)
    return np.stack(found, axis=-1)


def _cells(points: Points, last: np.ndarray) -> Iterator[Points]:
    """Points on the edges of each cell, or of the parts of one with points inside; `last` cell."""
    place, _ = points
    corners = np.unique(np.concatenate([np.floor(place - NEAR), np.floor(place + NEAR)]), axis=0)
    corners = corners[((corners >= 0) & (corners <= last)).all(axis=1)]
    column = np.argsort(place[:, 0])
    sorted_ = place[column, 0]
    for corner in corners:
        low, high = np.searchsorted(sorted_, (corner[0] - NEAR, corner[0] + 1 + NEAR))
        some = column[low:high]
        yield from _parts((place[some], points[1][some]), corner, 1.0)


def _parts(points: Points, corner: np.ndarray, size: float) -> Iterator[Points]:
    place = (points[0] - corner) / size
    near = NEAR / size
    within = ((place >= -near) & (place <= 1 + near)).all(axis=1)
    place, pair = place[within], points[1][within]
    inside = ((place > near) & (place < 1 - near)).all(axis=1)
    if inside.any() and size > 2.0**-12:
        for i in (0, 1):
            for j in (0, 1):
                half = np.array([i, j])
                here = (points[0][within], pair)
                yield from _parts(here, corner + half * size / 2, size / 2)
    elif len(place) > 1:
        yield points[0][within], pair


def _joined(place: np.ndarray, pair: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Straight pieces between the points on the edges of one cell."""
    rest = []
    for one in np.unique(pair):
        own = place[pair == one]
        while len(own) > 1:  # the closest first
            off = np.linalg.norm(own[1:] - own[0], axis=1)
            other = 1 + int(np.argmin(off))
            yield own[0], own[other]
            own = np.delete(own, [0, other], axis=0)
        rest += list(own)
    if len(rest) > 1:
        middle = np.mean(rest, axis=0)
        yield from ((point, middle) for point in rest)
