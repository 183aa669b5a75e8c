"""CF conventions: flags of whole numbers, units in words, attributes that a file can hold."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr


def plain_attributes(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as types that netCDF can hold: text, numbers, arrays; None is left out."""
    plain: dict[str, Any] = {}
    for name, value in attrs.items():
        if value is None:
            continue
        if isinstance(value, bool | np.bool_):
            plain[name] = np.int8(value)
        elif isinstance(value, str):  # names of files may be anything
            plain[name] = value.encode(errors="backslashreplace").decode()
        elif isinstance(value, int | float | np.number | np.ndarray):
            plain[name] = value
        elif (
            isinstance(value, list | tuple)
            and value
            and all(isinstance(item, int | float) for item in value)
        ):
            plain[name] = np.array(value, dtype=np.float64)
        else:
            plain[name] = json.dumps(value, sort_keys=True)
    return plain


def quotient(unit: str, by: str) -> str:
    """Unit of a derivative of what has one `unit` by what has another."""
    return f"({unit})" + (f"/({by})" if by != "1" else "")


def units_text(units: Mapping[str, str]) -> str:
    """Units of parameters in one attribute: ``name: unit; name: unit``."""
    return "; ".join(f"{name}: {unit}" for name, unit in units.items())


def units_of(attrs: Mapping[str, Any]) -> dict[str, str]:
    """Parameter -> unit, of those that `units_text` has put into ``parameter_units``."""
    pairs = (each.rpartition(": ") for each in str(attrs.get("parameter_units", "")).split("; "))
    return {name: unit for name, _, unit in pairs if name}


def flags(codes: Mapping[str, int], dtype: Any = np.int8) -> dict[str, Any]:
    """CF attributes of a categorical variable (`flag_values`, `flag_meanings`): name -> code."""
    return {
        "flag_values": np.array(list(codes.values()), dtype=dtype),
        "flag_meanings": " ".join(codes),
    }


def masks(codes: Mapping[str, int], dtype: Any) -> dict[str, Any]:
    """CF attributes of a set of categories (`flag_masks`, `flag_meanings`): bit 2^code of each."""
    return {
        "flag_masks": np.array([1 << code for code in codes.values()], dtype=dtype),
        "flag_meanings": " ".join(codes),
    }


def flag_names(variable: xr.DataArray) -> dict[int, str]:
    """Code -> meaning of a categorical variable, from its CF attributes. Raises ValueError where it
    has none.
    """
    must = f"{variable.name} must have names of its codes"
    if missing := {"flag_values", "flag_meanings"} - variable.attrs.keys():
        of = f"{variable.name}.attrs of the map, or the run, that it is from has them"
        lost = "" if variable.attrs else f"; pandas, say, keeps no attributes: {of}"
        raise ValueError(f"{must}, but has no {min(missing)}{lost}")
    values = np.atleast_1d(variable.attrs["flag_values"])
    names = str(variable.attrs["flag_meanings"]).split()
    if values.dtype.kind not in "iuf" or len(values) != len(names):
        raise ValueError(f"{must}, but has {len(names)} names of the codes {values.tolist()}")
    return dict(zip((int(v) for v in values), names, strict=True))
