"""What sweep and scene files have in common: the blade, its belt, the model."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import PrivateAttr

from ..vocabulary.kinds import BELTS, FRICTIONS, LAW_PARAMETERS
from ..vocabulary.parameters import PARAMETERS, longest_ramp
from .axis import Axis
from .errors import Fault
from .tables import Belt, Blade, ModelName, Start, Table, Title

_BLADE = tuple(name for name, entry in PARAMETERS.items() if entry.table == "blade")


class System(Table):
    """What sweeps and scenes share: the blade, the belt, the start."""

    title: Title = ""
    model: ModelName = "lip"  # which rung of `blade.rungs` stands for the blade
    blade: Blade = Blade()
    belt: Belt = Belt()
    start: Start = Start()

    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """Text of the file this was read from; empty if it was not read from a file."""
        return self._text

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all parameters of the blade and of this kind of belt."""
        law = set(FRICTIONS[self.blade.friction].values())
        blade = tuple(name for name in _BLADE if name in law or name not in LAW_PARAMETERS)
        return blade + tuple(BELTS[self.belt.kind].values())

    def document(self) -> dict[str, Any]:
        """Plain dict that `parse_sweep` or `parse_scene` turns into an equal specification."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    def _stated(self) -> dict[str, tuple[str, float]]:
        """Parameter -> (key in the file, value in edge units), of those the file fixes."""
        keys = BELTS[self.belt.kind]
        tables = [("blade", name, name) for name in _BLADE]
        tables += [("belt", key, name) for key, name in keys.items()]
        stated = {
            name: (f"{table}.{key}", getattr(getattr(self, table), key))
            for table, key, name in tables
        }
        return {name: entry for name, entry in stated.items() if entry[1] is not None}

    def _fixed_si(self, axes: Mapping[str, Axis]) -> dict[str, float]:
        """Parameter -> SI value, stated or reference, of every parameter that is no axis."""
        stated = self._stated()
        fixed = {}
        for name in self.parameter_names:
            if name not in axes:
                entry = PARAMETERS[name]
                value = entry.to_si(stated[name][1]) if name in stated else entry.reference
                if value is not None:  # else it is asked for in _check_system
                    fixed[name] = float(value)
        return fixed

    def _check_system(self, axes: Mapping[str, Axis]) -> None:
        """Raises Fault for keys that are fine alone but not together."""
        kind, stated = self.belt.kind, self._stated()
        for key in sorted(self.belt.model_fields_set - {"kind"} - set(BELTS[kind])):
            owners = " and ".join(repr(other) for other, keys in BELTS.items() if key in keys)
            raise Fault(f"belt.{key}", f"must be left out with kind = {kind!r}; it is for {owners}")
        law = self.blade.friction
        for name in LAW_PARAMETERS - set(self.parameter_names):
            if name in axes or name in stated:
                key = f"axes.{name}" if name in axes else f"blade.{name}"
                raise Fault(key, f"must be left out with blade.friction = {law!r}")
        for name in axes:
            if name not in self.parameter_names:
                raise Fault(f"axes.{name}", f"must be left out with belt.kind = {kind!r}")
            if name in stated:
                key, value = stated[name]
                raise Fault(key, f"must be left out, for axes.{name} sets it; was {value:g}")
        for key, name in BELTS[kind].items():
            if name not in axes and name not in stated and PARAMETERS[name].reference is None:
                must = PARAMETERS[name].must
                raise Fault(f"belt.{key}", f"is missing; with kind = {kind!r} it {must}")

        fixed = self._fixed_si(axes)

        def values(name: str) -> np.ndarray:
            """All values of parameter `name` in this file, edge units."""
            if name in axes:
                return axes[name].values()
            return np.atleast_1d(PARAMETERS[name].to_edge(fixed[name]))

        def key_of(name: str) -> str:
            return f"axes.{name}" if name in axes else stated.get(name, (f"blade.{name}",))[0]

        collapse = values("collapse_angle").min()
        attack = values("attack_angle")
        attack = attack[np.argmax(np.abs(attack))]
        inside = f"must lie inside the collapse angle, (-{collapse:g}, {collapse:g}) degrees"
        if abs(attack) >= collapse:
            raise Fault(key_of("attack_angle"), f"{inside}, was {attack:g}")
        if self.start.angle is not None and abs(self.start.angle) >= collapse:
            raise Fault("start.angle", f"{inside}, was {self.start.angle:g}")
        if self.start.position is not None:
            x, reach = self.start.position[0], values("lip_length").min()
            if abs(x) >= reach:
                must = f"x must be shorter than the lip ({reach:g} m)"
                raise Fault("start.position", f"{must}, was {x:g}")
        if law == "coulomb" and (most := values("mu_minimum").max()) > values("mu_static").min():
            must = f"must be at most mu_static ({values('mu_static').min():g}) with this friction"
            raise Fault(key_of("mu_minimum"), f"{must}, was {most:g}")
        if self.model != "lip":
            self._check_rung(values, key_of)
        if "belt_ramp" in BELTS[kind].values():
            ramp, longest = values("belt_ramp").max(), longest_ramp(values("belt_frequency").max())
            if ramp > longest:
                must = f"must be at most half a period ({longest:g} s)"
                raise Fault(key_of("belt_ramp"), f"{must}, was {ramp:g}")

    def _check_rung(self, values, key_of) -> None:
        """Raises Fault for what a model of one coordinate (`blade.rungs`) cannot have."""
        must = f"must be left out or 0 with model = {self.model!r}, which has no hinge mass"
        if (largest := values("hinge_mass").max()) > 0:
            raise Fault(key_of("hinge_mass"), f"{must}, was {largest:g}")
        for key, unit in (("position", "m"), ("velocity", "m/s")):
            pair = getattr(self.start, key)
            if pair is not None and pair[1] != 0:
                must = f"must be on the glass (y = 0) with model = {self.model!r}"
                raise Fault(f"start.{key}", f"{must}, was {pair[1]:g} {unit}")
