"""Which numbers of a map cannot be those of any sweep: another program has changed them."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..noise.samples import LARGEST, untold
from ..vocabulary.cf import flag_names
from ..vocabulary.codes import LABELS
from ..vocabulary.columns import misnamed
from ..vocabulary.parameters import PARAMETERS
from ..vocabulary.ranges import NON_NEGATIVE, SHARE, Range
from ..vocabulary.schema import SCHEMA
from .stated import is_own

_SHARES = Range(SHARE.low, SHARE.high + 1e-9)  # rounding
_ALLOWED = {"_fraction": _SHARES, "_fraction_stroke": _SHARES}
_ALLOWED |= dict.fromkeys(("_frequency", "_rms", "_rms_stroke"), NON_NEGATIVE)
_RESTS_ON = ("stick_fraction", "flight_fraction", "velocity_rms")
_CLASSES = [code for name, code in LABELS.items() if name not in ("failed", "collapsed")]


def doubts(ds: xr.Dataset) -> Iterator[str]:
    """What of a map no sweep has, in words: axes out of range, codes without a name or with that of
    another, numbers that are infinite or no share, say. NaN is what a cell that failed has.
    """
    for name in ds.dims:
        entry = None if is_own(ds) else PARAMETERS.get(str(name))
        if entry and name in ds.coords and ds[name].dtype.kind in "iuf":
            if problem := entry.problem(ds[name].values):
                yield f"its axis {name} {problem}"
    classed = ds["label"].isin(_CLASSES)
    for name, variable in ds.data_vars.items():
        column = SCHEMA.get(str(name))
        if column is None or column.along or variable.dtype.kind not in "iuf":
            continue
        variable = variable[...]  # else all of a large map is kept in memory
        none = variable.isnull()
        values = variable.values[~none.values]
        if name in _RESTS_ON and bool((none & classed).any()):
            yield f"its {name} must be a number where a cell has a class, but had nan"
        if column.flags is not None:
            yield from _of_codes(variable, values)
        elif (wrong := untold(values)).any():
            must = f"must be finite numbers up to {LARGEST:g} in size"
            yield f"its {name} {must}, but had {values[wrong][0]:g}"
        elif column.dtype.startswith("float"):
            allowed = next((_ALLOWED[end] for end in _ALLOWED if str(name).endswith(end)), Range())
            if (outside := allowed.outside(values)) is not None:
                yield f"its {name} {allowed.must}, but had {outside:g}"


def _of_codes(variable: xr.DataArray, values: np.ndarray) -> Iterator[str]:
    try:
        names = flag_names(variable)
    except ValueError:  # said where they are counted
        return
    missing = SCHEMA[str(variable.name)].missing
    if why := misnamed(str(variable.name), names):
        yield f"its {variable.name} must have the names of its codes, but had {why}"
    if (strange := values[~np.isin(values, [*names, missing])]).size:
        known = ", ".join(f"{code} ({name})" for code, name in names.items())
        yield f"its {variable.name} must be {known}, but had {strange[0]:g}"
