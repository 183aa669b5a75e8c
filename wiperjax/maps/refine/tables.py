"""What a refinement found as the dataset of borders that is stored in the map."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ...specs.refine import Refine
from ...vocabulary.cf import flags
from ...vocabulary.codes import CROSSINGS
from .criterion import Criterion
from .grid import Grid
from .outcome import Outcome


def border_dataset(
    found: Outcome,
    grid: Grid,
    criterion: Criterion,
    settings: Refine,
    made: Mapping[str, Any],
    described: Mapping[str, Any],
) -> xr.Dataset:
    """Points on borders, one along `border`; in the units of the map's axes, which `described`
    has.
    """
    count = len(found.axis)
    variables: dict[str, Any] = {}
    for name, values in grid.along.items():
        where = np.full(count, values[0])
        if name in grid.names:
            where = _values(values, found.place[:, grid.names.index(name)])
        units, long_name = (described[name].attrs[key] for key in ("units", "long_name"))
        attrs = {"units": units, "long_name": f"{long_name} of the border"}
        attrs["spacing"] = grid.axes[name].spacing
        variables[name] = ("border", where, attrs)
    ends = {"bracket_low": found.low, "bracket_high": found.high}
    for name, steps in ends.items():
        value = np.zeros(count)
        for axis, along in enumerate(grid.names):
            which = found.axis == axis
            value[which] = _values(grid.along[along], steps[which])
        words = "end of the bracket along `axis`, in its units"  # no one unit is true
        variables[name] = ("border", value, {"long_name": words})
    codes = (
        ("axis", found.axis, {name: k for k, name in enumerate(grid.names)}, "axis of the bracket"),
        ("side_low", found.code_low, criterion.names, f"{settings.on} at bracket_low"),
        ("side_high", found.code_high, criterion.names, f"{settings.on} at bracket_high"),
        ("kind", found.kind, CROSSINGS, "kind of crossing"),
    )
    for name, values, names, words in codes:
        attrs = {"long_name": words} | flags(names)
        variables[name] = ("border", values.astype(np.int8), attrs)
    words = {"long_name": "level of the cube that the point lies on an edge of", "units": "1"}
    variables["level"] = ("border", found.level, words)
    about = {
        "long_name": "stated bracket, of the border inside the cubes that it is of, as a share of "
        "`axis`",
        "units": "1",
        "comment": "of a geometric axis: of its logarithm",
    }
    variables["bracket_share"] = ("border", found.stated, about)
    attrs = {"on": settings.on, "levels": grid.levels} | found.report | dict(made)
    return xr.Dataset(variables, attrs=attrs)


def _values(values: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Values of an axis at places between its steps."""
    return np.interp(place, np.arange(len(values)), values)
