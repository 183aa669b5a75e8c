"""Columns of a map by their names: those of `schema.SCHEMA`, and derivatives of some of them, which
have the names of parameters in theirs: d_velocity_rms_d_attack_angle."""

from collections.abc import Iterable, Mapping
from typing import Any

from .cf import quotient, units_of
from .kinds import STEADY_KINDS
from .parameters import PARAMETERS
from .schema import SCHEMA, Column

SYSTEM = "system"
"""Attribute of a map of a system of one's own: its import path."""

FORCES = "forces"
"""Attribute of a map of such a system, if its forces are per metre of blade as the wiper's are."""

OF_STEADY_SLIP = ("growth_rate", "linear_frequency")
"""Columns of steady slip, linearised: no simulation tells them."""

OF_A_WIPER = ("final_x", "final_y", "final_vx", "final_vy", *OF_STEADY_SLIP)
"""Columns of a lip's tip and of its steady slip: another system has none of them."""

DIFFERENTIABLE = (
    *("stick_fraction", "slip_fraction", "flight_fraction", "noise_period"),
    *("velocity_rms", "velocity_mean"),
    *("belt_speed_rms", "normal_force_mean", "normal_force_max", "gap_max", "impact_impulse_max"),
    *(*OF_STEADY_SLIP, "final_x", "final_y", "final_vx", "final_vy"),
)
"""Outcomes that have derivatives by parameters. Labels, codes, counts and the dominant frequency (a
choice among lines, all of which go by the period) have none by nature; statistics of the reversal
have none because the edges of their window cut steps."""


def differentiable(of_a_wiper: bool, belt_kind: str | None) -> tuple[str, ...]:
    """Those of `DIFFERENTIABLE` that a map of such a system has, on such a belt or on none."""
    absent: tuple[str, ...] = () if of_a_wiper else OF_A_WIPER
    absent += () if belt_kind else ("belt_speed_rms",)
    absent += () if belt_kind in STEADY_KINDS else ("noise_period",)
    return tuple(name for name in DIFFERENTIABLE if name not in absent)


def sensitivity_name(outcome: str, parameter: str) -> str:
    """Name of the variable that holds d(outcome)/d(parameter)."""
    return f"d_{outcome}_d_{parameter}"


def derivative(name: str) -> tuple[str, str] | None:
    """(outcome, parameter) of a name that `sensitivity_name` made; None of another."""
    for outcome in DIFFERENTIABLE:
        start = sensitivity_name(outcome, "")
        if name.startswith(start) and name != start:
            return outcome, name.removeprefix(start)
    return None


def column_of(name: str) -> Column:
    """The column of a name: of `SCHEMA`, or of a derivative. Raises: KeyError if it is neither."""
    if derivative(name) is not None:
        return Column(name, "float64", "", name.replace("_", " "))
    return SCHEMA[name]


def misnamed(column: str, names: Mapping[int, str]) -> str:
    """How ``names`` of codes of a column say another thing than ours, `1 (quiet) for 0 (quiet)`;
    empty if they do not. What has no name or no code here, another version may have.
    """
    known = column in SCHEMA and SCHEMA[column].flags or {}
    for code, name in names.items():
        for other, own in known.items():
            if (code == own) != (name == other):
                return f"{code} ({name}) for {own} ({other})"
    return ""


def ordered(names: Iterable[str]) -> list[str]:
    """Those of `names` that are columns, in the order of maps: as in `SCHEMA`, then derivatives by
    outcome and, in it, by parameter as `PARAMETERS` has them and then as they are given."""
    given = list(names)
    apart = [(name, parts) for name in given if (parts := derivative(name)) is not None]
    known = list(PARAMETERS)

    def place(entry: tuple[str, tuple[str, str]]) -> tuple[int, int]:
        _, (outcome, parameter) = entry
        last = known.index(parameter) if parameter in known else len(known)
        return DIFFERENTIABLE.index(outcome), last

    apart.sort(key=place)
    return [*(name for name in SCHEMA if name in given), *(name for name, _ in apart)]


def attributes_of(name: str, of: Mapping[str, Any]) -> dict[str, Any]:
    """CF attributes of a column in a map with the attributes `of`: forces are per metre of blade,
    and what moves is its tip; of a system of one's own neither, unless it says so.
    """
    if (parts := derivative(name)) is not None:
        return _of_derivative(*parts, of)
    found = column_of(name).attributes()
    found["long_name"] = _said(found["long_name"], of, _WORDS)
    if "units" in found:
        found["units"] = _said(found["units"], of, _UNITS)
    return found


_UNITS = (("N/m", "N"), ("N s/m", "N s"), ("J/m", "J"))
_WORDS = (
    ("gap between tip and glass", "gap"),
    ("tip velocity", "output velocity"),
    ("tip acceleration", "output acceleration"),
)


def _said(text: str, of: Mapping[str, Any], of_others: Iterable[tuple[str, str]]) -> str:
    """What is said of a blade, as it is said of what is none."""
    if SYSTEM in of and FORCES not in of:
        for blade, other in of_others:
            text = text.replace(blade, other)
    return text


def _of_derivative(outcome: str, parameter: str, of: Mapping[str, Any]) -> dict[str, Any]:
    known = PARAMETERS.get(parameter)
    unit = units_of(of).get(parameter, known.edge_unit if known else "1")
    words = known.long_name if known and SYSTEM not in of else parameter.replace("_", " ")
    what = SCHEMA[outcome]
    return {
        "long_name": f"derivative of {_said(what.long_name, of, _WORDS)} by {words}",
        "units": quotient(_said(what.units, of, _UNITS), unit),
    }
