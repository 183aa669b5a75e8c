"""Curves over two parameters: where steady slip loses its stability, where cycles end."""

import json
from collections.abc import Iterable, Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, withStroke

from ..datasets import branch_dataset
from ..datasets.branch_dataset import curves as curves_in
from ..vocabulary import checks
from .style.axes import label, legend_below, long_name, page, shown, shown_unit
from .style.caption import set_caption
from .style.palette import CURVES, HALO

WORDS = {  # kinds of curves
    "hopf": "steady slip loses stability (Hopf)",
    "fold": "two cycles merge (fold)",
    "grazing_sliding_fold": "stick-slip ends (fold, stick begins)",
}
MARKS = {  # special points of curves: marker and words
    "bautin": ("o", "onset turns soft or hard (Bautin)"),
    "cusp": ("^", "two folds meet (cusp)"),
    "double_zero": ("s", "frequency zero"),
    "lift_off": ("v", "steady slip lifts off"),
    "smooth": ("D", "fold of another kind"),
}
CLOSE = 1e-6  # relative: numbers of a map and of its curves that are the same


def with_curves(ds: xr.Dataset, curves: xr.Dataset) -> xr.Dataset:
    """A map with curves in two of its parameters (`cycles.curves_dataset`, or a branch file that
    holds them), which its pictures then show where these are the axes.

    Raises: ValueError for what is no map, no curves, or curves of another blade.
    """
    checks.instance("curves", curves, xr.Dataset, "a dataset, such as curves_dataset(...)")
    found = curves_in(curves)
    if found is None:
        raise ValueError("curves must hold curves ('wiperjax follow ... --second'), but has none")
    names = [str(found.attrs[key]) for key in ("over", "second")]
    for name in names:
        if name not in ds.dims:
            raise ValueError(
                f"curves are over {' and '.join(names)}, and the map has no axis {name}"
            )
    for name, value in _fixed(found).items():
        if name in ds.attrs and not _same(float(ds.attrs[name]), value):
            raise ValueError(
                f"curves must be those of the map's blade, but {name} is {value:g} for them and "
                f"{float(ds.attrs[name]):g} in the map"
            )
    held = branch_dataset.with_curves(ds, found)
    return held.set_coords(held.data_vars.keys() - ds.data_vars.keys())  # of no cell, as borders


def curve_page(branch: xr.Dataset) -> Figure:
    """Draw the curves in the file of a branch over their two parameters.

    Raises ValueError if it holds none.
    """
    held = curves_in(branch)
    if held is None:
        raise ValueError("this branch has no curves: 'wiperjax follow ... --second' makes them")
    figure = page((7.0, 5.2))
    ax = figure.subplots()
    over, second = (str(held.attrs[key]) for key in ("over", "second"))
    handles = _drawn(held, ax, over, second)
    for which, name in (("x", over), ("y", second)):
        getattr(ax, f"set_{which}label")(label(long_name(held[name]), shown(held[name])[1]))
    own = branch.attrs.get(second)
    if own is not None:
        place = shown_unit(held[second])[0] * float(own)
        line = ax.axhline(place, color="#888888", linewidth=0.8, linestyle=":")
        line.set_label("the branch")
        handles.append(line)
    legend_below(figure, handles)
    moved = {name: value for name, value in branch.attrs.items() if name != second}
    set_caption(figure, branch.drop_attrs(deep=False).assign_attrs(moved))
    return figure


def draw_curves(ds: xr.Dataset, ax: Axes, x: str, y: str) -> set[str]:
    """Draw the curves that a map holds over a plane of it; returns their kinds.

    Only where the axes are the two parameters, at a cut that has the numbers of their blade.
    """
    held = curves_in(ds)
    if held is None or {x, y} != {held.attrs["over"], held.attrs["second"]}:
        return set()
    for name, value in _fixed(held).items():
        if name in ds.coords and not ds[name].ndim and not _same(float(ds[name]), value):
            return set()
    limits = ax.axis()
    _drawn(held, ax, x, y)
    ax.axis(limits)
    return {str(kind) for kind in held["kind"].values}


def curve_legend(ds: xr.Dataset, axes: Iterable[Axes]) -> list[Line2D]:
    """The entries in a legend of those curves of a map that are drawn in `axes`."""
    held = curves_in(ds)
    if held is None:
        return []
    words = {_words(str(kind)) for kind in held["kind"].values} | {one for _, one in MARKS.values()}
    found = {str(line.get_label()): line for ax in axes for line in ax.lines}
    return [line for label_, line in found.items() if label_ in words]


def check_drawn(ds: xr.Dataset, figure: Figure, name: str) -> None:
    """Raises ValueError where the picture `name` of a map shows none of the curves it holds."""
    held = curves_in(ds)
    if held is None or curve_legend(ds, figure.axes):
        return
    over, second = (held.attrs[key] for key in ("over", "second"))
    axes = [(key, value) for key, value in _fixed(held).items() if key in ds.dims]
    where = "".join(f", where {key} is {value:g}" for key, value in axes)
    there = f"over classes, regimes or mechanisms with --x {over} --y {second}{where}"
    raise ValueError(f"curves are drawn {there}; this picture {name!r} would show none")


def _drawn(curves: xr.Dataset, ax: Axes, x: str, y: str) -> list[Line2D]:
    entries: dict[str, Line2D] = {}
    effects = [withStroke(linewidth=3.6, foreground=HALO), Normal()]
    for kind, part in _each(curves):
        colour, style = CURVES.get(kind, ("#000000", "-"))
        across, up = (shown(part[name])[0] for name in (x, y))
        marker = "" if len(across) > 1 else "x"  # a point that could not be followed
        (line,) = ax.plot(
            across, up, color=colour, linestyle=style, linewidth=1.8, marker=marker,
            path_effects=effects, label=_words(kind), zorder=4,
        )  # fmt: skip
        entries.setdefault(kind, line)
    points = curves["special_point"].values
    for kind, point in zip(curves["special_kind"].values, points, strict=True):
        if kind not in MARKS:
            continue
        marker, words = MARKS[str(kind)]
        place = [float(shown(curves[name])[0][int(point)]) for name in (x, y)]
        (dot,) = ax.plot(*place, marker, color="black", markersize=6, zorder=5, label=words)
        entries.setdefault(str(kind), dot)
    return list(entries.values())


def _words(kind: str) -> str:
    return WORDS.get(kind, kind.replace("_", " "))


def _each(curves: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Kind and points of each curve."""
    stop = np.cumsum(curves["row_size"].values)
    for kind, size, end in zip(curves["kind"].values, curves["row_size"].values, stop, strict=True):
        yield str(kind), curves.isel(point=slice(int(end - size), int(end)))


def _fixed(curves: xr.Dataset) -> dict[str, float]:
    """The other numbers of the blade, if the curves say them."""
    return json.loads(str(curves.attrs.get("fixed", "{}")))


def _same(one: float, two: float) -> bool:
    return abs(one - two) <= CLOSE * max(abs(one), abs(two), CLOSE)
