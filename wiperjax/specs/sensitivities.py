"""The table `[sensitivities]` of a sweep file: derivatives of outcomes by parameters."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from ..vocabulary.kinds import WIPER
from .errors import Fault, show, unknown
from .tables import Table

SLOPE_RTOL = 1e-9
"""Tolerance of the integrator with derivatives, at most: those that are called fine are then right
to 1e-3 (docs/gradients.md)."""

SLOPE_SOLVER = "tsit5"
"""Runge-Kutta method with derivatives, unless the file has one: at `SLOPE_RTOL` longer steps of
Dopri8 leave twice the error that the tests of derivatives allow."""


class Sensitivities(Table):
    """Derivatives of the outcomes by parameters, and when they are believed.

    Attributes:
        parameters: names of blade or belt parameters; of another system its own (left out: its
            axes).
        check: share of the cells that is checked by central differences.
        step: of those, relative to the parameter (angles: to 1 rad).
        grazing: smallest grazing margin at which derivatives still count as valid (at least 1e4
            rtol).
        settled: largest relative difference of the tip velocity's standard deviation between the
            first and the last whole periods of the settled window.
    """

    parameters: Annotated[list[str], Field(min_length=1)] = [
        "attack_angle",
        "normal_load",
        "belt_speed",
    ]
    check: float = 0.05
    step: float = 1e-5
    grazing: float = 1e-4
    settled: float = 0.05


def by_its_axes(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The content of a file; of another system than the wiper, with derivatives by its axes where
    it does not say by what."""
    asked, axes = data.get("sensitivities"), data.get("axes")
    if data.get("system", WIPER) == WIPER or not isinstance(axes, Mapping):
        return data
    if not isinstance(asked, Mapping):
        return data
    return {**data, "sensitivities": {"parameters": list(axes), **asked}}


def check_sensitivities(spec: Any, asked: Sensitivities) -> None:
    """Raises Fault for derivatives that cannot be had in a sweep."""
    if spec.starts is not None:
        raise Fault("starts", "must be left out with sensitivities")
    for name in asked.parameters:
        if name not in spec.parameter_names:
            problem = unknown(name, list(spec.parameter_names), elsewhere=spec.family.elsewhere)
            raise Fault("sensitivities.parameters", f"{show(name)}: {problem}")
    if len(set(asked.parameters)) < len(asked.parameters):
        raise Fault("sensitivities.parameters", "must not name a parameter twice")
    if spec.model != "lip":
        raise Fault("model", f"must be 'lip' with sensitivities, was {spec.model!r}")
    if spec.run.precision != "float64":
        must = "must be 'float64' with sensitivities"
        raise Fault("run.precision", f"{must}, was {spec.run.precision!r}")
    if spec.rtol > SLOPE_RTOL:
        must = f"must be left out or at most {SLOPE_RTOL:g} with sensitivities"
        raise Fault("run.rtol", f"{must}, was {spec.rtol:g}")
