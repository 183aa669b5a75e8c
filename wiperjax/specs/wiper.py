"""The wiper as files state it: tables `[blade]` and `[belt]`, key `model`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..vocabulary.kinds import AUTO, BELTS, LAW_PARAMETERS, WIPER
from ..vocabulary.parameters import BLADE, PARAMETERS, Parameter
from ..vocabulary.ranges import TIP
from ..vocabulary.wording import digits
from .errors import Fault, listed
from .family import Family, KeyOf, Values
from .laws import Law, check_coulomb, check_given, law_of


class Wiper(Family):
    """The lip and its poorer models."""

    name = WIPER
    coordinates = ("x", "y")
    elsewhere = PARAMETERS

    def belt_kind(self, spec: Any) -> str:
        return spec.belt.kind

    def law(self, spec: Any) -> Law:
        return law_of("blade.friction", spec.blade.friction)

    def parameters(self, spec: Any) -> dict[str, Parameter]:
        law = self.law(spec).parameters
        own = {name: PARAMETERS[name] for name in BLADE if name in law or not _of_a_law(name)}
        if strange := sorted(set(law) & {name for name in PARAMETERS if not _of_a_law(name)}):
            must = f"must not have a number that the wiper has too, had {strange[0]!r}"
            raise Fault("blade.friction", must)
        belt = {name: PARAMETERS[name] for name in BELTS[spec.belt.kind].values()}
        return {**own, **law, **belt}

    def sweepable(self, spec: Any) -> dict[str, Parameter]:
        return {**PARAMETERS, **self.law(spec).parameters}

    def stated(self, spec: Any) -> dict[str, tuple[str, float]]:
        keys = BELTS[spec.belt.kind]
        tables = [("blade", name, name) for name in BLADE]
        tables += [("belt", key, name) for key, name in keys.items()]
        stated = {
            name: (f"{table}.{key}", getattr(getattr(spec, table), key))
            for table, key, name in tables
        }
        stated |= {name: (f"parameters.{name}", value) for name, value in spec.given.items()}
        return {name: entry for name, entry in stated.items() if entry[1] is not None}

    def check(self, spec: Any, axes: Mapping[str, Any]) -> None:
        law, stated, own = spec.blade.friction, self.stated(spec), self.law(spec)
        if spec.given and own.found is None:
            raise Fault("parameters", "must be left out without system; the wiper has [blade]")
        check_given(spec.given, own.parameters, self.elsewhere)
        for name in LAW_PARAMETERS - set(self.parameters(spec)):
            if name in axes or name in stated:
                key = f"axes.{name}" if name in axes else f"blade.{name}"
                raise Fault(key, f"must be left out with blade.friction = {law!r}")

    def check_values(self, spec: Any, values: Values, key_of: KeyOf) -> None:
        collapse = values("collapse_angle").min()
        attack = values("attack_angle")
        attack = attack[np.argmax(np.abs(attack))]
        inside = f"must lie inside the collapse angle, (-{collapse:g}, {collapse:g}) degrees"
        if abs(attack) >= collapse:
            raise Fault(key_of("attack_angle"), f"{inside}, was {attack:g}")
        if spec.start.angle is not None and abs(spec.start.angle) >= collapse:
            raise Fault("start.angle", f"{inside}, was {spec.start.angle:g}")
        _check_position(spec.start, values("lip_length").min())
        check_coulomb(self.law(spec), values, key_of)
        if spec.model not in ("lip", AUTO):
            _check_rung(spec, values, key_of)

    def meaning(self, spec: Any) -> dict[str, Any]:
        found: dict[str, Any] = {"model": spec.model}
        law = self.law(spec)
        if law.name != "stribeck":
            found["friction"] = law.name
        if law.source:
            found["friction_source"] = law.source
        return found


def _of_a_law(name: str) -> bool:
    return name in LAW_PARAMETERS


def _check_position(start: Any, reach: float) -> None:
    """Raises Fault for a tip that is not in the plane, in the glass, or beyond the lip's reach."""
    for key in ("position", "velocity"):
        pair = getattr(start, key)
        if pair is None:
            continue
        if len(pair) != 2:
            raise Fault(f"start.{key}", f"must be a list of two numbers, was {listed(pair)}")
        if (wrong := TIP[key].outside(np.asarray(pair))) is not None:
            raise Fault(f"start.{key}", f"{TIP[key].must}, was {digits(wrong)}")
    if start.position is None:
        return
    x, y = start.position
    if y < 0:
        raise Fault("start.position", f"y must not be negative (the glass is y = 0), was {y:g}")
    if abs(x) >= reach:
        raise Fault("start.position", f"x must be shorter than the lip ({reach:g} m), was {x:g}")


def _check_rung(spec: Any, values: Values, key_of: KeyOf) -> None:
    """Raises Fault for what a model of one coordinate (`blade.rungs`) cannot have."""
    must = f"must be left out or 0 with model = {spec.model!r}, which has no hinge mass"
    if (largest := values("hinge_mass").max()) > 0:
        raise Fault(key_of("hinge_mass"), f"{must}, was {largest:g}")
    for key, unit in (("position", "m"), ("velocity", "m/s")):
        pair = getattr(spec.start, key)
        if pair is not None and pair[1] != 0:
            must = f"must be on the glass (y = 0) with model = {spec.model!r}"
            raise Fault(f"start.{key}", f"{must}, was {pair[1]:g} {unit}")
