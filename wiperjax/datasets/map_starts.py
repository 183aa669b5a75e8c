"""A map of several starts: one of them chosen, and where the class hangs on it."""

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

    A map of one start is returned as it is. Raises: `ValueError` for a start that is not there.
    """
    if "start" not in ds.sizes:
        if start is not None:
            raise ValueError("start must be left out: each cell of this map has but one")
        return ds
    values = ds["start"].values
    if "class_share" not in ds:
        chosen = str(values[0]) if start is None else start
        if chosen not in values:
            raise ValueError(not_there(chosen, "map's starts", list(map(str, values))))
        one = ds.isel(start=int(np.flatnonzero(values == chosen)[0]), drop=True)
        return one.assign_attrs(start=f"{chosen} ({STARTS.get(str(chosen), 'own')})")
    if start is not None:
        if start not in values:
            raise ValueError(f"start must be a whole number in [0, {len(values) - 1}], was {start}")
        one = ds.isel(start=int(start), drop=True)
        return one.assign_attrs(start=f"number {int(start)} of {len(values)} random ones")
    one = ds.isel(start=usual_start(ds["label"])).drop_vars(
        ["start", *(name for name in ds.coords if str(name).startswith("start_"))], errors="ignore"
    )
    return one.assign_attrs(start=f"{len(values)} random ones, the most frequent class")


def usual_start(label: xr.DataArray) -> xr.DataArray:
    """In each cell the number of the first start that ends in its most frequent class."""
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
    met = ds["class_set"]
    classes = met & ~_FAILED
    return (met > 0) & ((classes & (classes - 1)) != 0)


def failed_somewhere(ds: xr.Dataset) -> xr.DataArray:
    """Whether a start of each cell failed, in a map of several."""
    return (ds["class_set"] > 0) & ((ds["class_set"] & _FAILED) != 0)
