"""A system of one's own as files state it: `system = "module:Class"`, table `[parameters]`, and
`[belt]` if the class has a field `belt`.
"""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from typing import Any

from ..vocabulary.checks import is_number
from ..vocabulary.kinds import BELTS
from ..vocabulary.parameters import PARAMETERS, Parameter
from .errors import Fault, listed, show
from .family import Family, KeyOf, Values
from .imported import fingerprint, imported, named, needs
from .laws import Law, check_coulomb, check_given, law_like, law_of, own_parameters

_OF_THE_WIPER = {"blade": "its parameters stand in [parameters]", "model": "it has no rungs"}
_OF_ITS_START = ("angle", "equilibrium")


@dataclass(frozen=True)
class Declared(Family):
    """A class that declares its parameters (`vocabulary.declared`).

    Attributes:
        name: import path.
        coordinates: names of them, if the class has some.
        found: the class.
        own: its parameters, without those of belt and law.
        belt: the belt that it has by default; None if it has none.
        default_law: the law that it has by default; None if it has none.
        source: fingerprint of its source.
    """

    name: str
    coordinates: tuple[str, ...]
    found: type
    own: Mapping[str, Parameter]
    belt: Any
    default_law: Law | None
    source: str

    @property
    def has_stops(self) -> bool:
        return bool(getattr(self.found, "stops", ()))

    @property
    def per_metre(self) -> bool:
        """Whether its forces are per metre of blade."""
        return bool(getattr(self.found, "per_metre", False))

    def belt_kind(self, spec: Any) -> str | None:
        if self.belt is None:
            return None
        if "kind" in spec.belt.model_fields_set:
            return spec.belt.kind
        if kind := named(self.belt, BELTS):
            return kind
        *first, last = map(repr, BELTS)
        must = f"is missing; it must be {', '.join(first)} or {last}, for files have no name for"
        raise Fault(
            "belt.kind", f"{must} the default belt of {self.name}, {type(self.belt).__name__}"
        )

    def law(self, spec: Any) -> Law | None:
        asked = spec.given.get("friction")
        if self.default_law is None or asked is None or asked == self.default_law.name:
            return self.default_law
        if not isinstance(asked, str):
            must = "must be the name of a law in quotes"
            raise Fault("parameters.friction", f"{must}, was {show(asked)}")
        return law_of("parameters.friction", asked)

    def parameters(self, spec: Any) -> dict[str, Parameter]:
        law, kind = self.law(spec), self.belt_kind(spec)
        further = dict(law.parameters) if law is not None else {}
        if kind is not None:
            further |= {name: self._of_belt(kind, key) for key, name in BELTS[kind].items()}
        if twice := sorted(set(self.own) & set(further)):
            raise Fault("system", f"{self.name} has two parameters of the name {twice[0]!r}")
        return {**self.own, **further}

    def _of_belt(self, kind: str, key: str) -> Parameter:
        entry = PARAMETERS[BELTS[kind][key]]
        value = getattr(self.belt, key, None) if kind == named(self.belt, BELTS) else None
        if value is None or not is_number(value, arrays=False):
            return entry
        return replace(entry, reference=float(value))

    def stated(self, spec: Any) -> dict[str, tuple[str, float]]:
        found = {
            name: (f"parameters.{name}", value)
            for name, value in spec.given.items()
            if name != "friction"
        }
        kind = self.belt_kind(spec)
        for key, name in BELTS.get(kind or "", {}).items():
            if (value := getattr(spec.belt, key)) is not None:
                found[name] = (f"belt.{key}", value)
        return found

    def check(self, spec: Any, axes: Mapping[str, Any]) -> None:
        for table, why in _OF_THE_WIPER.items():
            if table in spec.model_fields_set:
                raise Fault(table, f"must be left out with system = {spec.system!r}: {why}")
        for key in _OF_ITS_START:
            if getattr(spec.start, key) is not None:
                must = f"must be left out with system = {spec.system!r}, which has no"
                what = "lip" if key == "angle" else "steady slip that is known in advance"
                raise Fault(f"start.{key}", f"{must} {what}")
        if self.belt is None and "belt" in spec.model_fields_set:
            raise Fault("belt", f"must be left out with system = {spec.system!r}: it has no belt")
        self._check_given(spec)
        self._check_start(spec.start)
        self.parameters(spec)  # two of one name
        if self.belt is None and spec.classes.quiet_velocity is None:
            must = f"is missing; {spec.system!r} has no belt that a velocity could be compared with"
            raise Fault("classes.quiet_velocity", must)

    def _check_given(self, spec: Any) -> None:
        if "friction" in spec.given and self.default_law is None:
            must = f"must be left out with system = {spec.system!r}: it has no field for it"
            raise Fault("parameters.friction", must)
        numbers = {name: value for name, value in spec.given.items() if name != "friction"}
        check_given(numbers, self.parameters(spec), self.elsewhere)

    def _check_start(self, start: Any) -> None:
        n = len(self.coordinates)
        for key in ("position", "velocity"):
            given = getattr(start, key)
            if given is not None and len(given) != n:
                must = f"must be a list of {n} numbers ({', '.join(self.coordinates)})"
                raise Fault(f"start.{key}", f"{must}, was {listed(given)}")

    def check_values(self, spec: Any, values: Values, key_of: KeyOf) -> None:
        def key(name: str) -> str:  # a number of the law that is left out, too
            return key_of(name).replace("blade.", "parameters.")

        check_coulomb(self.law(spec), values, key)  # all else it says itself when it is made

    def meaning(self, spec: Any) -> dict[str, Any]:
        found = {"system": self.name, "system_source": self.source}
        if (law := self.law(spec)) is not None:
            found |= {"friction": law.name, "friction_source": law.source}
        return found


def declared(path: str) -> Declared:
    """The family of an import path. Raises: Fault, one line, for what is no system."""
    return _read(path, imported("system", path))


@cache
def _read(path: str, found: type) -> Declared:
    needs("system", found, ("free_acceleration", "directions"), "system (wiperjax.AbstractSystem)")
    own = own_parameters("system", path, found)
    coordinates = getattr(found, "coordinates", ())
    if not coordinates or not isinstance(coordinates, tuple | list):
        raise Fault("system", f"{path} must name its coordinates: coordinates = ('x', ...)")
    held = {field.name: field.default for field in fields(found)}  # type: ignore[arg-type]
    for name, attribute in (("belt", "kind"), ("friction", "coefficient")):
        given = held.get(name, MISSING)
        if given is not MISSING and given is not None and not hasattr(given, attribute):
            kind = "a belt" if name == "belt" else "a friction law"
            raise Fault("system", f"{path}: field {name!r} must have {kind} as its default")
    belt, law = (None if (x := held.get(key)) is MISSING else x for key in ("belt", "friction"))
    return Declared(
        path,
        tuple(coordinates),
        found,
        own,
        belt,
        None if law is None else law_like("system", law),
        fingerprint("system", found),
    )
