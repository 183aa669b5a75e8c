"""Planes of a map: which axes are drawn, where the others are cut, and one quantity over them."""

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from ...noise.class_counts import whole_codes
from ...vocabulary.cf import flag_names
from ...vocabulary.columns import derivative
from ...vocabulary.wording import not_there
from ..style.axes import (
    axes_or_page,
    edges,
    is_numeric,
    is_ordered,
    label,
    log_marks,
    long_name,
    set_axis,
    shown,
    value_text,
)
from ..style.caption import set_caption, start_text, wrapped
from ..style.palette import UNKNOWN
from .numbers import TONE, on_scale, suited, told, tones, why_untold
from .stability import stability_boundary

PANEL = 36  # letters across a picture among others
At = Mapping[str, float]  # where a dimension that is not drawn is cut, in the units of the map


def map_dims(ds: xr.Dataset) -> list[str]:
    """Dimensions of the cells of a map (not that of the raster's instants)."""
    return [str(dim) for dim in ds["label"].dims]


def choose_plane(ds: xr.Dataset, x: str | None, y: str | None) -> tuple[str, str]:
    """Dimensions across and up: attack angle across and belt speed up if they are there.

    Raises: `ValueError` for a dimension that the map does not have or whose values are in disorder,
        or a map without two.
    """
    for name in (x, y):
        check_dim(ds, name)
    if x == y and x is not None:
        raise ValueError(f"x and y must be two axes, but both were {x!r}")
    long = long_axes(ds)
    x, y = usual_plane(long, x, y)
    if x is None or y is None:
        also = "; the picture 'line' (plots.along_axis) draws one axis" if long else ""
        raise ValueError(
            f"a map needs at least two axes of more than one number to be drawn as a plane{also}"
        )
    for name in (x, y):
        check_order(ds, name)
    return x, y


def long_axes(ds: xr.Dataset) -> list[str]:
    """Axes of more than one value, all of them numbers, along which a map can be drawn.

    Raises: `ValueError` for a map without any cell.
    """
    for dim in map_dims(ds):
        if not ds.sizes[dim]:
            must = f"{dim} must have values, but none was selected"
            raise ValueError(f"{must}; of an axis that falls ds.sel takes slice(high, low)")
    return [dim for dim in map_dims(ds) if ds.sizes[dim] > 1 and is_numeric(ds[dim])]


def usual_plane(
    long: list[str], x: str | None = None, y: str | None = None
) -> tuple[str | None, str | None]:
    """Which of the dimensions `long` are drawn across and up, where `x` or `y` does not say it."""
    if x is None:
        x = next((dim for dim in ("attack_angle", *long) if dim in long and dim != y), None)
    if y is None:
        y = next((dim for dim in ("belt_speed", *long[::-1]) if dim in long and dim != x), None)
    return x, y


def check_dim(ds: xr.Dataset, name: str | None) -> None:
    """Raises `ValueError` unless `name` is None or an axis of the map."""
    if name is not None and name not in map_dims(ds):
        raise ValueError(not_there(name, "map's axes", map_dims(ds)))


def check_order(ds: xr.Dataset, name: str) -> None:
    """Raises `ValueError` for an axis whose values neither rise nor fall, or are no numbers."""
    check_numbers(ds, name)
    if not is_ordered(ds[name].values):
        must = f"{name} must have values that rise, or fall, throughout"
        raise ValueError(f"{must}, to be an axis of a picture; ds.sortby({name!r}) sorts them")


def check_numbers(ds: xr.Dataset, name: str) -> None:
    """Raises `ValueError` for an axis whose values are texts, say."""
    if not is_numeric(ds[name]):
        must = f"{name} must have numbers, for a picture along it or a cut at one"
        raise ValueError(f"{must}, but has {ds[name].values[0]!s}; ds.isel({name}=0) takes it")


def check_cellwise(ds: xr.Dataset, name: str) -> None:
    """Raises `ValueError`, listing what there is, unless the map holds one `name` a cell."""
    held = [str(n) for n in ds.data_vars if set(ds[n].dims) == set(map_dims(ds))]
    further = [str(dim) for dim in ds[name].dims if dim not in map_dims(ds)] if name in ds else []
    if further:
        raise ValueError(f"{name!r} is not one number a cell: it has one for each {further[0]}")
    if name not in held:
        raise ValueError(not_there(name, "map", held))


def cut(ds: xr.Dataset, keep: tuple[str, ...], at: At | None = None) -> tuple[xr.Dataset, str]:
    """Slice at the cell nearest to `at`, else at the middle value, of every dimension of the map
    but `keep`; and the text that says so.

    Raises: `ValueError` for a name in `at` that is no axis or is drawn, or a value outside it.
    """
    at = dict(at or {})
    chosen: dict[str, int] = {}
    for dim in map_dims(ds):
        if dim in keep:
            continue
        chosen[dim] = ds.sizes[dim] // 2
        if dim in at:
            check_numbers(ds, dim)
            values = np.asarray(ds[dim], dtype=float)
            wanted, border = at.pop(dim), edges(values)
            if not min(border) <= wanted <= max(border):
                raise ValueError(
                    f"{dim} must lie inside {values.min():g} ... {values.max():g}, was {wanted:g}"
                )
            chosen[dim] = int(np.argmin(np.abs(values - wanted)))
    for name in at:
        check_dim(ds, name)
        raise ValueError(f"{name!r} is an axis of the picture and cannot be cut at one value")
    return ds.isel(chosen), ", ".join(value_text(ds[dim], i) for dim, i in chosen.items())


def value_map(
    ds: xr.Dataset,
    name: str,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    at: At | None = None,
    norm: Normalize | None = None,
    cmap: str = "viridis",
    title: str | None = None,
) -> Axes:
    """One stored quantity over two axes, at `at` (default: the middle) of the others, with a
    colour bar.

    Cells without a number (`told`) stay grey, and the picture says why. `title` is its long name
    if None. Colours and scale suit the numbers (`suited`) unless `norm` says otherwise.

    Raises: `ValueError` if the map does not hold `name` as one number a cell, or holds codes.
    """
    check_cellwise(ds, name)
    if {"flag_values", "flag_masks"} & ds[name].attrs.keys():
        draws = f"PICTURES['map']['value'].draw(ds, quantity={name!r}) draws them"
        raise ValueError(f"name must be that of numbers, but {name} has names; {draws}")
    x, y = choose_plane(ds, x, y)
    ax, whole = axes_or_page(ax, (6.4, 5.0))
    plane, where = cut(ds, (x, y), at)
    numbers, unit = shown(told(plane, name).transpose(y, x))
    values = np.ma.masked_invalid(numbers)
    if norm is None:
        norm, cmap = suited(values, derivative(name) is not None, cmap)
    values = on_scale(values, norm)
    ax.set_facecolor(UNKNOWN)
    mesh = ax.pcolormesh(
        edges(shown(ds[x])[0]), edges(shown(ds[y])[0]), values, norm=norm, cmap=cmap,
        rasterized=True,
    )  # fmt: skip
    set_axis(ax, "x", ds[x])
    set_axis(ax, "y", ds[y])
    stability_boundary(plane, ax, x, y)
    words, why = title or long_name(ds[name]), why_untold(plane, name)
    below = bool((values < mesh.get_clim()[0]).any())
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02, extend="min" if below else "neither")
    bar.set_label(textwrap.fill(label(words, unit), 45) if whole else unit)
    if isinstance(norm, LogNorm):
        log_marks(bar.ax.yaxis)
    if whole:
        set_caption(ax.figure, ds, where, start_text(ds), f"grey: {why}" if why else "")
    else:
        lines = [textwrap.fill(words, PANEL), f"(grey: {why})" if why else ""]
        lines.append(wrapped(where, PANEL))
        if len(f"{words} {lines[1]}") <= PANEL:
            lines[:2] = [f"{words} {lines[1]}".strip()]
        ax.set_title("\n".join(filter(None, lines)), fontsize="medium")
    return ax


def fraction_map(
    ds: xr.Dataset, regime: str = "stick", ax: Axes | None = None, **options: Any
) -> Axes:
    """Share of the settled window spent in `stick`, `slip` or `flight`; see `value_map`."""
    options.setdefault("title", f"share of time in {regime}")
    norm = Normalize(0.0, 1.0)
    return value_map(ds, f"{regime}_fraction", ax, norm=norm, cmap="cividis", **options)


def frequency_map(
    ds: xr.Dataset,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    at: At | None = None,
) -> Axes:
    """Dominant frequency of the cells that are not quiet, on a logarithmic scale, with the borders
    of the classes in its colour bar; see `value_map`.
    """
    x, y = choose_plane(ds, x, y)
    norm = tones(np.ma.masked_invalid(told(cut(ds, (x, y), at)[0], TONE)))
    ax = value_map(ds, TONE, ax, x=x, y=y, at=at, norm=norm, title="dominant frequency")
    bar = ax.collections[0].colorbar
    assert bar is not None  # value_map drew it
    bands = [
        ds.attrs[name] for name in ("class_squeal_band", "class_chatter_band") if name in ds.attrs
    ]
    for limit in np.unique(np.concatenate([np.atleast_1d(band) for band in bands] or [[]])):
        if norm.vmin < limit < norm.vmax:
            bar.ax.axhline(limit, color="white", linewidth=2.4)
            bar.ax.axhline(limit, color="black", linewidth=1.0)
    return ax


def class_names(ds: xr.Dataset) -> np.ndarray:
    """Name of the class of each cell of a (small) map; empty of those that `ds.where` took out."""
    names = flag_names(ds["label"])
    codes = whole_codes(ds["label"])
    found = np.vectorize(lambda code: names.get(code, "not_computed"), otypes=[object])(codes)
    return np.where(np.isnan(codes), "", found)
