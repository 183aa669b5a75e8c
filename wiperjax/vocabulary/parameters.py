"""Names, units, reference values and allowed ranges of every blade and belt parameter: one table.

Code works in SI units and radians, per metre of blade. At the edges (sweep files, coordinates of
maps, pictures) angles are DEGREES; every other unit is the same on both sides. Imports no jax.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from .ranges import Range
from .wording import digits


@dataclass(frozen=True)
class Parameter:
    """One physical parameter of the blade or of the belt.

    Attributes:
        name: name in code, files and maps, without a unit.
        table: table of a sweep file that fixes it, `blade` or `belt`.
        symbol: symbol in docs/model.md.
        unit: unit in code (SI, radians), `1` if dimensionless.
        range: values of files, in edge units: what lies outside is no blade.
        long_name: what it is, in words; becomes the `long_name` of a map coordinate.
        reference: value of the reference blade in SI units, None where a belt must state it.
        smallest: least size that a file may ask for, of a parameter of either sign.
        never_small: whether an angle below pi/2 degrees can only be a slip for radians.
        exact: whether `range` is that of the mechanics, which holds in Python too.
        absent_at: value at which compiled programs leave its terms out; None: they never do.
    """

    name: str
    table: str
    symbol: str
    unit: str
    range: Range
    long_name: str
    reference: float | None
    smallest: float = 0.0
    never_small: bool = False
    exact: bool = False
    absent_at: float | None = None

    @property
    def edge_unit(self) -> str:
        """Unit in files, maps and pictures."""
        return "degrees" if self.unit == "rad" else self.unit

    @property
    def must(self) -> str:
        """What a value must be, in edge units: `must lie inside (-90, 90) degrees`."""
        return replace(self.range, unit="" if self.unit == "1" else self.edge_unit).must

    def to_si(self, value: Any) -> Any:
        """Value in code units (float or array) from one in edge units."""
        return np.radians(value) if self.unit == "rad" else value

    def to_edge(self, value: Any) -> Any:
        """Value in edge units (float or array) from one in code units."""
        return np.degrees(value) if self.unit == "rad" else value

    def problem(self, values: Any) -> str | None:
        """What is wrong with `values` (edge units, number or array), as the end of an error line.

        Returns: text such as `must lie inside (-90, 90) degrees, was 95`; None if all is well.
        """
        if (wrong := self.range.outside(values)) is not None:
            return f"{self.must}, was {digits(wrong)}"
        sizes = np.abs(np.atleast_1d(np.asarray(values, dtype=np.float64)))
        if sizes.min() < self.smallest:
            small = np.atleast_1d(values)[np.argmin(sizes)]
            return f"{self.must} and be {self.smallest:g} or more in size, was {digits(small)}"
        largest = sizes.max()
        if self.never_small and largest <= math.pi / 2:
            guess = f"{largest:g} radians would be {math.degrees(largest):.4g} degrees"
            return f"must be in degrees, was {largest:g} ({guess})"
        return None

    def argument_problem(self, values: Any) -> str | None:
        """The same of an argument in code units, where angles are radians. Only what mechanics
        forbids is refused: in Python a wiper may be of any size, as a limit or another system.

        Returns: text such as `must lie inside (-1.5708, 1.5708) rad, but was 5; were degrees
        meant? 5 degrees are 0.08727 rad`; None if all is well.
        """
        unit = "" if self.unit == "1" else self.unit
        if self.exact:
            low, high = (float(self.to_si(end)) for end in (self.range.low, self.range.high))
            allowed = replace(self.range, low=low, high=high, unit=unit)
        elif self.range.low < 0:
            allowed = Range(unit=unit)
        else:
            allowed = Range(0, low_open=self.range.low > 0, unit=unit)
        wrong = allowed.outside(values)
        if wrong is None:
            return None
        guess = ""
        if self.unit == "rad" and self.range.outside(wrong) is None:
            degrees, radians = digits(wrong), f"{math.radians(wrong):.4g}"
            guess = f"; were degrees meant? {degrees} degrees are {radians} rad"
        return f"{allowed.must}, but was {digits(wrong)}{guess}"


_TABLE = (
    # name, table, symbol, unit, range, long_name, reference
    Parameter("tip_mass", "blade", "m", "kg/m", Range(1e-6, 1), "tip mass", 2.4e-3),
    Parameter("lip_length", "blade", "L", "m", Range(1e-5, 0.1), "lip length", 6e-3),
    Parameter(
        "support_stiffness", "blade", "k", "N/m/m", Range(0, 1e7),
        "support stiffness", 2000.0,
    ),
    Parameter("support_damping", "blade", "c", "N s/m/m", Range(0, 1e5), "support damping", 1.0),
    Parameter("neck_stiffness", "blade", "k1", "N m/rad/m", Range(0, 1e3), "neck stiffness", 0.05),
    Parameter(
        "shoulder_stiffness", "blade", "k2", "N m/rad/m", Range(0, 1e3),
        "neck and shoulder stiffness", 2.0,
    ),
    Parameter(
        "shoulder_angle", "blade", "phi_s", "rad", Range(0.1, 180), "shoulder angle", 0.6,
        never_small=True, exact=True,
    ),
    Parameter(
        "attack_angle", "blade", "alpha", "rad", Range(-90, 90, low_open=True, high_open=True),
        "attack angle", 0.0, exact=True,
    ),
    Parameter("normal_load", "blade", "N0", "N/m", Range(1e-3, 1e4), "normal load", 15.0),
    Parameter(
        "restitution", "blade", "e", "1", Range(0, 1), "coefficient of restitution", 0.3,
        exact=True,
    ),
    Parameter("mu_static", "blade", "mu_s", "1", Range(0, 10), "static friction coefficient", 1.0),
    Parameter(
        "mu_minimum", "blade", "mu_m", "1", Range(0, 10),
        "hydrodynamic friction minimum", 0.3,
    ),
    Parameter("stribeck_speed", "blade", "v_s", "m/s", Range(1e-6, 100), "Stribeck speed", 0.1),
    Parameter(
        "stribeck_shape", "blade", "delta", "1", Range(1, 10),
        "Stribeck shape exponent", 1.0, exact=True, absent_at=1.0,
    ),
    Parameter(
        "viscous_slope", "blade", "beta", "s/m", Range(0, 10),
        "viscous friction slope", 0.02,
    ),
    Parameter(
        "hinge_mass", "blade", "M_h", "kg/m", Range(0, 1), "hinge mass", 0.0, absent_at=0.0
    ),
    Parameter(
        "hinge_damping", "blade", "c_phi", "N m s/rad/m", Range(0, 10), "hinge damping", 0.0,
        absent_at=0.0,
    ),
    Parameter(
        "gravity", "blade", "g", "m/s^2", Range(-100, 100), "gravity towards the glass", 0.0,
        absent_at=0.0,
    ),
    Parameter(
        "collapse_angle", "blade", "phi_max", "rad", Range(0.1, 90, high_open=True),
        "collapse angle", math.radians(89), never_small=True, exact=True,
    ),
    # The belt. Files cannot ask for rest: tolerances and the quiet class are relative to its speed.
    Parameter(
        "belt_speed", "belt", "V0", "m/s", Range(-20, 20), "belt speed", 0.3, smallest=1e-6
    ),
    Parameter("belt_frequency", "belt", "f", "Hz", Range(1e-4, 1e3), "belt frequency", None),
    Parameter("belt_ramp", "belt", "t_ramp", "s", Range(1e-6, 1e3), "belt ramp duration", None),
    Parameter("belt_phase", "belt", "psi", "rad", Range(-360, 360), "belt phase", 0.0, exact=True),
)  # fmt: skip

PARAMETERS: Mapping[str, Parameter] = MappingProxyType({entry.name: entry for entry in _TABLE})
"""Every parameter by name, in the order in which maps and messages list them."""

BLADE = tuple(entry.name for entry in _TABLE if entry.table == "blade")
"""Parameters of the blade."""

REFERENCE: Mapping[str, float] = MappingProxyType(
    {entry.name: entry.reference for entry in _TABLE if entry.reference is not None}
)
"""Parameter -> its reference value in SI units, of those that have one."""


def longest_ramp(frequency: Any) -> Any:
    """Longest ramp [s] of a trapezoid of some frequency [Hz]: half a period, but for the rounding
    of a ramp that is written as 1/(2 f).
    """
    return 0.5 / frequency * (1 + 1e-12)


def described(table: str) -> str:
    """Lines of a docstring: each parameter of a table, what it is, its unit in code, its reference
    value.
    """
    lines = []
    for name, entry in PARAMETERS.items():
        if entry.table == table:
            unit = "" if entry.unit == "1" else f" [{entry.unit}]"
            reference = "" if entry.reference is None else f", {entry.reference:.6g}"
            lines.append(f"        {name}: {entry.long_name}{unit}{reference}")
    return "\n".join(lines) + "\n"
