"""A map of several starts: one of them chosen, and where the class hangs on it."""

import json
from typing import Any

import numpy as np
import xarray as xr

from ..vocabulary.codes import LABELS
from ..vocabulary.kinds import STARTS
from ..vocabulary.wording import not_there

_FAILED = 1 << LABELS["failed"]  # its bit in class_set


def from_start(ds: xr.Dataset, start: Any = None) -> xr.Dataset:
    """The map of one start: `start` is its name, or the number of a random one. None: the first
    name; of random starts, in each cell the first of those that end in its most frequent class.

    A map of one start is returned as it is; one that was taken by `ds.sel(start=...)` says which.
    Raises: `ValueError` for a start that is not there.
    """
    if "start" not in ds.sizes:
        alone = "start" in ds.coords and not ds["start"].ndim
        only = ds["start"].item() if alone else None
        if start is not None and start != only:
            has = "but one" if only is None else f"{only} alone"
            raise ValueError(f"start must be left out: each cell of this map has {has}")
        return ds if only is None else _told(ds, only)
    ds, values = _with_own_set(ds), ds["start"].values
    drawn = ds.attrs.get("starts_random", len(values))  # of which the map may be a part
    if start is None and "class_share" in ds:
        many = f"{len(values)}" if len(values) == drawn else f"{len(values)} of {drawn}"
        words = f"{many} random ones, the most frequent class"
        return _without_start(ds.isel(start=usual_start(ds["label"]))).assign_attrs(start=words)
    chosen = values[0] if start is None else start
    places = np.flatnonzero(values == chosen)
    if not places.size and values.dtype.kind in "iuf":
        numbers = f"one of this map's starts, {values.min()} to {values.max()}"
        raise ValueError(f"start must be the number of {numbers}, was {start}")
    if not places.size:
        raise ValueError(not_there(str(chosen), "map's starts", list(map(str, values))))
    return _told(ds.isel(start=int(places[0])), values[places[0]])


def _told(ds: xr.Dataset, start: Any) -> xr.Dataset:
    """A map of the one start that it is of, which its attribute then names."""
    if isinstance(start, str):
        words = f"{start} ({STARTS.get(start, 'own')})"
    else:
        words = f"number {int(start)} of {ds.attrs.get('starts_random', 'the')} random ones"
    return _without_start(ds).assign_attrs(start=words)


def _without_start(ds: xr.Dataset) -> xr.Dataset:
    """A map without what is told of its starts one by one."""
    states = [name for name in ds.coords if str(name).startswith("start_")]
    return ds.drop_vars(["start", *states], errors="ignore")


def usual_start(label: xr.DataArray) -> xr.DataArray:
    """In each cell the place, along `start`, of the first that ends in its most frequent class."""
    codes = np.array(list(LABELS.values()))
    label = label.transpose(..., "start")
    most = codes[(label.values[..., None] == codes).sum(axis=-2).argmax(axis=-1)]
    first = (label.values == most[..., None]).argmax(axis=-1)
    return xr.DataArray(first, dims=label.dims[:-1])


def hangs_on_start(ds: xr.Dataset) -> xr.DataArray | None:
    """Whether the starts of each cell end in several classes, of which a failure of the computation
    is none; None in a map of one start.
    """
    if "class_set" not in ds:
        return None
    ds = _with_own_set(ds)
    classes = _met(ds) & ~_FAILED
    return (classes & (classes - 1)) != 0


def failed_somewhere(ds: xr.Dataset) -> xr.DataArray:
    """Whether a start of each cell failed, in a map of several."""
    return (_met(ds) & _FAILED) != 0


def _with_own_set(ds: xr.Dataset) -> xr.Dataset:
    """A map whose `class_set` is of the starts that it holds, where they are a part of those that
    were swept: else a class hangs on starts that nobody sees.
    """
    named = json.loads(str(ds.attrs.get("starts_names", "[]")))
    swept = ds.attrs.get("starts_random", len(named))
    if not {"class_set", "label"} <= {*ds} or ds["label"].sizes.get("start", swept) == swept:
        return ds
    met = xr.zeros_like(ds["class_set"], int)
    for code in range(max(LABELS.values()) + 1):
        met = met + (ds["label"] == code).any("start") * (1 << code)
    return ds.assign(class_set=met.where(met > 0, ds["class_set"]).assign_attrs(ds.class_set.attrs))


def _met(ds: xr.Dataset) -> xr.DataArray:
    """`class_set`, empty of cells that are not computed (-1), or that `ds.where` took out (NaN)."""
    met = ds["class_set"]
    return met.where(met > 0, 0).astype(np.int16)
