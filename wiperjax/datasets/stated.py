"""What a map, a run or a branch states of itself in attributes, where that cannot be: what another
program has changed is not told as if it were right.
"""

from typing import Any

import xarray as xr

from ..noise.classes import stored
from ..vocabulary import checks
from ..vocabulary.cf import units_of
from ..vocabulary.columns import SYSTEM
from ..vocabulary.parameters import PARAMETERS, Parameter
from ..vocabulary.ranges import FINITE, NON_NEGATIVE, POSITIVE, Range

BLADES = {"Wiper": "lip", "Bar": "bar", "Block": "block"}  # as runs and branches name their models
_OF_A_RUN = {"duration": POSITIVE, "statistics_start": NON_NEGATIVE}


def is_own(ds: xr.Dataset) -> bool:
    """Whether a map, run or branch is of a system that is no blade: one's own, or another one of
    the package. A run or branch knows; of a map the name of its system tells."""
    if "of_a_blade" in ds.attrs:
        return not ds.attrs["of_a_blade"]
    system = str(ds.attrs.get(SYSTEM, "Wiper"))
    return ":" in system or system not in BLADES and "lip_length" not in {*ds.attrs, *ds.variables}


def wrong_attribute(ds: xr.Dataset) -> str:
    """The first of the borders of the classes, of the parameters and of the times of a run that
    cannot be, as `NAME must be ..., but was ...`; empty if all can.
    """
    attrs, units = ds.attrs, units_of(ds.attrs)
    try:
        stored(attrs)
        for name, allowed in _OF_A_RUN.items():
            if name in attrs and name not in units:
                checks.number(name, attrs[name], allowed)
        for name, unit in units.items():
            if name in attrs:  # of an axis none is stated
                entry = None if is_own(ds) else PARAMETERS.get(name)
                _check_parameter(name, attrs[name], unit, entry, "specification" in attrs)
    except ValueError as error:
        return str(error)
    return ""


def _check_parameter(
    name: str, value: Any, unit: str, entry: Parameter | None, of_a_file: bool
) -> None:
    """Raises ValueError unless a value can be that of a parameter of a file, or of Python, where a
    blade may be of any size; one's own may be any number.
    """
    if entry is None or unit not in (entry.unit, entry.edge_unit):
        checks.number(name, value, Range(infinite=True))
    elif of_a_file and unit == entry.edge_unit:
        if problem := entry.problem(checks.number(name, value, FINITE)):
            raise ValueError(f"{name} {problem}")
    else:
        checks.parameter(name, checks.number(name, value, FINITE), entry)
