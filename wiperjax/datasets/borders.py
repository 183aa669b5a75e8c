"""What makes a dataset the borders of a refined map, and which numbers of theirs cannot be: what
another program has changed is neither drawn nor told.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ..vocabulary.cf import flag_names
from ..vocabulary.codes import CROSSINGS
from ..vocabulary.columns import misnamed
from ..vocabulary.ranges import FINITE, POSITIVE, SHARE, Range
from ..vocabulary.wording import digits, shown

CODES = ("axis", "kind", "side_low", "side_high")
_KINDS = tuple(f"{kind}_points" for kind in CROSSINGS)
_TOLD = ("levels", "simulations", "map_cells", "full_grid_cells", *_KINDS, "budget_spent")
_NUMBER = Range(0, whole=True)
_PART = Range(0, 1 + 1e-9, low_open=True)  # rounding


def unfit(borders: xr.Dataset) -> str:
    """What a dataset has or lacks that is none of points on borders, or of a part of them, as the
    end of `they have ...`; empty if there is nothing.
    """
    return next(_of_points(borders), "")


def unfit_report(borders: xr.Dataset) -> str:
    """The same of their attributes, in which a search says what it took and what it promises of all
    its points.
    """
    return next(_of_report(borders.attrs, borders.sizes["border"]), "")


def _of_points(borders: xr.Dataset) -> Iterator[str]:
    if "border" not in borders.dims:
        yield "no points on borders"
    if "on" not in borders.attrs:
        yield "no attribute 'on'"
    yield from (f"no {name}" for name in CODES if name not in borders)
    for name, variable in borders.data_vars.items():
        if variable.dims != ("border",):
            yield f"{name} along {' and '.join(map(str, variable.dims)) or 'nothing'}"
        allowed = _PART if name == "bracket_share" else FINITE
        yield from _outside(str(name), variable.values, allowed)
    for name in CODES:
        try:
            names = flag_names(borders[name])
        except ValueError as error:
            yield f"codes without names: {error}"
            return
        if name.startswith("side_") and (why := misnamed(str(borders.attrs["on"]), names)):
            yield f"{name} of {borders.attrs['on']} with {why}"
        for code in set(borders[name].values.tolist()) - set(names):
            yield f"{name} {code:g}, which is none of {', '.join(names.values())}"
    for code, name in flag_names(borders["axis"]).items():
        if name not in borders:
            yield f"no {name}, along which some lie"
        elif {"bracket_low", "bracket_high"} <= {*borders}:
            yield from _beside(borders.isel(border=borders["axis"].values == code), name)


def _beside(borders: xr.Dataset, axis: str) -> Iterator[str]:
    """Points enclosed along an axis that lie beside their brackets."""
    place, *ends = (borders[name].values for name in (axis, "bracket_low", "bracket_high"))
    low, high = np.sort(ends, axis=0)
    room = 1e-9 * (high - low)  # of rounding
    for k in np.flatnonzero((place < low - room) | (place > high + room)):
        bracket = f"{digits(low[k])} to {digits(high[k])}"
        yield f"a point at {axis} {digits(place[k])}, beside its bracket of {bracket}"


def _of_report(said: Mapping[str, Any], points: int) -> Iterator[str]:
    yield from (f"no attribute {name!r}" for name in _TOLD if name not in said)
    for name, value in said.items():
        if (allowed := _allowed(name)) is not None:
            yield from _outside(name, value, allowed)
            if np.ndim(value):
                yield f"{name} {shown(value)}, which is not one number"
    if (known := sum(int(said[name]) for name in _KINDS)) != points:
        yield f"{points} points, but {known} by their kinds"
    most = {"wide_cubes": "cubes", "cubes_with_border": "cubes", "sure_probes": "border_probes"}
    most |= {name: name.removesuffix("_wrong") for name in said if name.endswith("_wrong")}
    for name, of in most.items():
        if said.get(name, 0) > said.get(of, np.inf):
            yield f"{name} {said[name]:g}, of {said[of]:g} {of}"


def _allowed(name: str) -> Range | None:
    """What an attribute must be; None if it is no number of the search."""
    if "bracket_share_" in name:
        return _PART
    if "_share" in name:
        return SHARE
    if name in ("map_cells", "full_grid_cells"):
        return POSITIVE
    counts = ("levels", "simulations", "budget_spent", "cubes", "points", "probes", "_wrong")
    return _NUMBER if name.endswith(counts) or name.startswith(("wide_cubes_", "cubes_")) else None


def _outside(name: str, value: Any, allowed: Range) -> Iterator[str]:
    """A number of `value` that is not `allowed`, or what is no number."""
    if np.asarray(value).dtype.kind not in "iuf":
        yield f"{name}, which {allowed.must}, but was {shown(value)}"
    elif (wrong := allowed.outside(value)) is not None:
        yield f"{name}, which {allowed.must}, but was {digits(wrong)}"
