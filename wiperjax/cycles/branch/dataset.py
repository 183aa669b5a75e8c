"""A branch of cycles as a labelled dataset, which plain xarray and netCDF understand."""

import numpy as np
import xarray as xr

from ...contact.system import AbstractSystem, system_attributes
from ...datasets.branch_dataset import check_over
from ...machine import provenance
from ...systems import numbers
from ...vocabulary import checks
from .follow import Branch

COLUMNS = {  # name: (unit, meaning)
    "period": ("s", "period"),
    "maximum": ("m", "largest {position}"),
    "minimum": ("m", "smallest {position}"),
    "amplitude": ("m", "half the range of the {position}"),
    "velocity_rms": ("m/s", "rms of the {velocity} about its mean"),
    "stick_fraction": ("1", "share of the period in stick"),
    "flight_fraction": ("1", "share of the period in flight"),
    "normal_force_max": ("N", "largest normal force"),
    "slip_margin": ("m/s", "smallest slip speed inside slip"),
    "residual": ("1", "of the return map, relative to the size of the motion"),
    "trivial_error": ("1", "by how much the trivial multiplier misses 1"),
}


def column_attributes(system: AbstractSystem, name: str) -> dict[str, str]:
    """Return the attributes of one of `COLUMNS`; coordinates of another system than a blade have
    units of its own, which nothing declares."""
    unit, text = COLUMNS[name]
    attrs = {"long_name": text.format(**numbers.words(system))}
    if unit == "m" and not system.of_a_blade:
        return attrs
    return attrs | {"units": "N/m" if unit == "N" and system.per_metre else unit}


def branch_dataset(branch: Branch) -> xr.Dataset:
    """Return ``branch`` as a dataset with the dimensions ``point``, ``multiplier``, ``special``.

    The parameter has the name and the unit of files (angles in degrees). ``special_point`` is the
    index of the point that a special point is, or of the last one before it (corners).

    Raises ValueError for what is no branch, or one over a parameter named as a variable of these.
    """
    checks.instance("branch", branch, Branch, "a branch of follow(...)")
    first = branch.cycles[0]
    name, attrs, to_file = numbers.stored(first.system, branch.over)
    check_over(name)

    variables = {
        name: ("point", to_file(branch.parameters), attrs),
        **{
            key: (
                "point",
                np.array([getattr(c, key) for c in branch.cycles]),
                column_attributes(first.system, key),
            )
            for key in COLUMNS
        },
    }
    values = np.stack([_known(c.multipliers) for c in branch.cycles])
    plane = ("point", "multiplier")
    for key, word, part in (("real", "real", np.real), ("imag", "imaginary", np.imag)):
        attributes = {"long_name": f"{word} part of the multipliers, largest first", "units": "1"}
        variables[f"multiplier_{key}"] = (plane, part(values), attributes)
    stable = np.array([c.stable for c in branch.cycles], np.int8)
    variables["stable"] = ("point", stable, {"long_name": "all multipliers inside the circle"})
    variables["state"] = (
        ("point", "coordinate"),
        np.stack([_known(c.state) for c in branch.cycles]),
        {"long_name": "positions and velocities at the start of the cycle"},
    )
    start = {"long_name": "start of the cycle, in periods of the clock", "units": "1"}
    variables["phase"] = ("point", np.array([c.phase for c in branch.cycles]), start)
    for key, text in (("word", "events of a period"), ("regimes", "regimes of a period")):
        texts = np.array([getattr(c, key) for c in branch.cycles], object)
        variables[key] = ("point", texts, {"long_name": text})
    special = branch.special
    variables |= {
        "special_kind": ("special", np.array([s.kind for s in special], object)),
        "special_detail": ("special", np.array([s.detail for s in special], object)),
        "special_parameter": ("special", to_file(np.array([s.parameter for s in special])), attrs),
        "special_point": ("special", np.array([s.index for s in special], np.int32)),
    }
    return xr.Dataset(
        variables,
        coords={"arclength": ("point", branch.arclength, {"long_name": "way along the branch"})},
        attrs={
            **provenance.maker(),
            "over": name,
            **system_attributes(first.system),
            "ends": "; ".join(branch.ends),
        },
    )


def _known(values) -> np.ndarray:
    assert values is not None
    return np.asarray(values)
