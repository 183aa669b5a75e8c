"""Names, units, reference values and allowed ranges of every blade and belt parameter: one table.

Code works in SI units and radians, per metre of blade. At the edges (sweep files, coordinates of
maps, pictures) angles are DEGREES; every other unit is the same on both sides. Imports no jax.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Parameter:
    """One physical parameter of the blade or of the belt.

    Attributes:
        name: name in code, files and maps, without a unit.
        table: table of a sweep file that fixes it, `blade` or `belt`.
        symbol: symbol in MODEL.md.
        unit: unit in code (SI, radians), `1` if dimensionless.
        low, high: ends of the allowed range, in edge units.
        low_open, high_open: whether that end itself is forbidden.
        long_name: what it is, in words; becomes the `long_name` of a map coordinate.
        reference: value of the reference blade in SI units, None where a belt must state it.
        nonzero: whether zero inside the range is forbidden.
        never_small: whether an angle below pi/2 degrees can only be a slip for radians.
    """

    name: str
    table: str
    symbol: str
    unit: str
    low: float
    high: float
    long_name: str
    reference: float | None
    low_open: bool = False
    high_open: bool = False
    nonzero: bool = False
    never_small: bool = False

    @property
    def edge_unit(self) -> str:
        """Unit in files, maps and pictures."""
        return "degrees" if self.unit == "rad" else self.unit

    @property
    def range(self) -> str:
        """Allowed range in edge units, as an interval with its unit: `(-90, 90) degrees`."""
        left, right = "(" if self.low_open else "[", ")" if self.high_open else "]"
        unit = "" if self.unit == "1" else f" {self.edge_unit}"
        return f"{left}{self.low:g}, {self.high:g}{right}{unit}"

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
        values = np.atleast_1d(np.asarray(values, dtype=np.float64))
        above = values > self.low if self.low_open else values >= self.low
        below = values < self.high if self.high_open else values <= self.high
        outside = values[~(above & below)]  # NaN too
        if outside.size:
            return f"must lie inside {self.range}, was {outside[0]:g}"
        if self.nonzero and np.any(values == 0):
            return f"must not be 0, must lie inside {self.range}, was 0"
        largest = values[np.argmax(np.abs(values))]
        if self.never_small and 0 < abs(largest) <= math.pi / 2:
            guess = f"{largest:g} radians would be {math.degrees(largest):.4g} degrees"
            return f"must be in degrees, was {largest:g} ({guess})"
        return None


_TABLE = (
    # name, table, symbol, unit, low, high, long_name, reference
    Parameter("tip_mass", "blade", "m", "kg/m", 0, 1, "tip mass", 2.4e-3, low_open=True),
    Parameter("lip_length", "blade", "L", "m", 0, 0.1, "lip length", 6e-3, low_open=True),
    Parameter("support_stiffness", "blade", "k", "N/m/m", 0, 1e7, "support stiffness", 2000.0),
    Parameter("support_damping", "blade", "c", "N s/m/m", 0, 1e5, "support damping", 1.0),
    Parameter("neck_stiffness", "blade", "k1", "N m/rad/m", 0, 1e3, "neck stiffness", 0.05),
    Parameter(
        "shoulder_stiffness", "blade", "k2", "N m/rad/m", 0, 1e3, "neck and shoulder stiffness", 2.0
    ),
    Parameter(
        "shoulder_angle", "blade", "phi_s", "rad", 0, 180, "shoulder angle", 0.6,
        low_open=True, never_small=True,
    ),
    Parameter(
        "attack_angle", "blade", "alpha", "rad", -90, 90, "attack angle", 0.0,
        low_open=True, high_open=True,
    ),
    Parameter("normal_load", "blade", "N0", "N/m", 0, 1e4, "normal load", 15.0, low_open=True),
    Parameter("restitution", "blade", "e", "1", 0, 1, "coefficient of restitution", 0.3),
    Parameter("mu_static", "blade", "mu_s", "1", 0, 10, "static friction coefficient", 1.0),
    Parameter("mu_minimum", "blade", "mu_m", "1", 0, 10, "hydrodynamic friction minimum", 0.3),
    Parameter("stribeck_speed", "blade", "v_s", "m/s", 0, 100, "Stribeck speed", 0.1, True),
    Parameter("stribeck_shape", "blade", "delta", "1", 1, 10, "Stribeck shape exponent", 1.0),
    Parameter("viscous_slope", "blade", "beta", "s/m", 0, 10, "viscous friction slope", 0.02),
    Parameter("hinge_mass", "blade", "M_h", "kg/m", 0, 1, "hinge mass", 0.0),
    Parameter("hinge_damping", "blade", "c_phi", "N m s/rad/m", 0, 10, "hinge damping", 0.0),
    Parameter("gravity", "blade", "g", "m/s^2", -100, 100, "gravity towards the glass", 0.0),
    Parameter(
        "collapse_angle", "blade", "phi_max", "rad", 0, 90, "collapse angle", math.radians(89),
        low_open=True, high_open=True, never_small=True,
    ),
    # The belt. Zero speed is refused: tolerances and the quiet class are relative to it.
    Parameter("belt_speed", "belt", "V0", "m/s", -20, 20, "belt speed", 0.3, nonzero=True),
    Parameter("belt_frequency", "belt", "f", "Hz", 0, 1e3, "belt frequency", None, low_open=True),
    Parameter("belt_ramp", "belt", "t_ramp", "s", 0, 1e3, "belt ramp duration", None, True),
    Parameter("belt_phase", "belt", "psi", "rad", -360, 360, "belt phase", 0.0),
)  # fmt: skip

PARAMETERS: Mapping[str, Parameter] = MappingProxyType({entry.name: entry for entry in _TABLE})
"""Every parameter by name, in the order in which maps and messages list them."""

BELTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "steady": {"speed": "belt_speed"},
        "wiping": {
            "amplitude": "belt_speed",
            "frequency": "belt_frequency",
            "phase": "belt_phase",
        },
        "trapezoid": {
            "speed": "belt_speed",
            "frequency": "belt_frequency",
            "ramp": "belt_ramp",
            "phase": "belt_phase",
        },
    }
)
"""Kinds of belt: key in `[belt]`, which is also the argument of the belt's class -> parameter."""
