"""What sweep and scene files have in common: the system, its belt, its start."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr

from ..vocabulary.kinds import BELTS, SYSTEMS, WIPER
from ..vocabulary.parameters import Parameter, longest_ramp
from . import declared, wiper
from .axis import Axis
from .errors import Fault
from .family import Family
from .imported import is_path, no_name, path_of
from .tables import Belt, Blade, ModelName, Start, Table, Title

_WIPER = wiper.Wiper()


class System(Table):
    """What sweeps and scenes share: the system with its parameters, the belt, the start."""

    title: Title = ""
    system: Annotated[str, BeforeValidator(path_of)] = WIPER  # or `module:Class`
    model: ModelName = "lip"  # which rung of `blade.rungs` stands for the blade
    blade: Blade = Blade()
    given: dict[str, float | str] = Field(default={}, alias="parameters")
    belt: Belt = Belt()
    start: Start = Start()

    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """Text of the file this was read from; empty if it was not read from a file."""
        return self._text

    @property
    def family(self) -> Family:
        """What is known of the kind of system. Raises: Fault for a name of none."""
        if self.system == WIPER:
            return _WIPER
        path = SYSTEMS.get(self.system, self.system)
        if not is_path(path):
            raise Fault("system", no_name(self.system, [WIPER, *SYSTEMS]))
        return declared.declared(path)

    @property
    def belt_kind(self) -> str | None:
        """Kind of the belt; None where the system has none."""
        return self.family.belt_kind(self)

    @property
    def parameter_table(self) -> Mapping[str, Parameter]:
        """Name -> all that is known of it, of each parameter of the system, its law and its belt;
        in the order of maps."""
        return self.family.parameters(self)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all parameters of the system, of its law and of this kind of belt."""
        return tuple(self.parameter_table)

    def document(self) -> dict[str, Any]:
        """Plain dict that `parse_sweep` or `parse_scene` turns into an equal specification."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    def _fixed_si(self, axes: Mapping[str, Axis]) -> dict[str, float]:
        """Parameter -> SI value, stated or reference, of every parameter that is no axis."""
        stated = self.family.stated(self)
        fixed = {}
        for name, entry in self.parameter_table.items():
            if name not in axes:
                value = entry.to_si(stated[name][1]) if name in stated else entry.reference
                if value is not None:  # else it is asked for in _check_system
                    fixed[name] = float(value)
        return fixed

    def _check_system(self, axes: Mapping[str, Axis]) -> None:
        """Raises Fault for keys that are fine alone but not together."""
        family, kind = self.family, self.belt_kind
        family.check(self, axes)
        stated, known = family.stated(self), self.parameter_table
        keys = BELTS.get(kind or "", {})
        for key in sorted(self.belt.model_fields_set - {"kind"} - set(keys)):
            owners = " and ".join(repr(other) for other, its in BELTS.items() if key in its)
            raise Fault(f"belt.{key}", f"must be left out with kind = {kind!r}; it is for {owners}")
        for name in axes:
            if name not in known:
                raise Fault(f"axes.{name}", f"must be left out with belt.kind = {kind!r}")
            if name in stated:
                key, value = stated[name]
                raise Fault(key, f"must be left out, for axes.{name} sets it; was {value:g}")
        for key, name in keys.items():
            if name not in axes and name not in stated and known[name].reference is None:
                must = known[name].must
                raise Fault(f"belt.{key}", f"is missing; with kind = {kind!r} it {must}")
        for name, entry in known.items():
            if entry.reference is None and name not in stated and name not in axes:
                raise Fault(f"{entry.table}.{name}", f"is missing; it {entry.must}")

        fixed = self._fixed_si(axes)

        def values(name: str) -> np.ndarray:
            """All values of parameter `name` in this file, edge units."""
            if name in axes:
                return axes[name].values()
            return np.atleast_1d(known[name].to_edge(fixed[name]))

        def key_of(name: str) -> str:
            if name in axes:
                return f"axes.{name}"
            return stated.get(name, (f"{known[name].table}.{name}",))[0]

        family.check_values(self, values, key_of)
        if "belt_ramp" in keys.values():
            ramp, longest = values("belt_ramp").max(), longest_ramp(values("belt_frequency").max())
            if ramp > longest:
                must = f"must be at most half a period ({longest:g} s)"
                raise Fault(key_of("belt_ramp"), f"{must}, was {ramp:g}")
