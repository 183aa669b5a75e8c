"""Friction laws as files name them: those of `vocabulary.kinds`, and one's own by import path."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..vocabulary.checks import is_number
from ..vocabulary.declared import parameters_of
from ..vocabulary.kinds import FRICTIONS
from ..vocabulary.parameters import PARAMETERS, Parameter
from .errors import Fault, show, unknown
from .imported import fingerprint, imported, is_path, needs, no_name


@dataclass(frozen=True)
class Law:
    """A friction law that a file asks for.

    Attributes:
        name: its kind, or import path.
        keys: argument of its class -> parameter.
        parameters: name -> parameter, with the reference values that hold for this law.
        found: its class, where it is named by import path.
        source: fingerprint of that.
    """

    name: str
    keys: Mapping[str, str]
    parameters: Mapping[str, Parameter]
    found: type | None = None
    source: str = ""

    def like(self, default: Any) -> "Law":
        """The same law with the numbers of an object of its class as reference values."""
        known = {name: getattr(default, key) for key, name in self.keys.items()}
        held = {
            name: replace(entry, reference=float(known[name]))
            for name, entry in self.parameters.items()
            if is_number(known[name], arrays=False)
        }
        return replace(self, parameters={**self.parameters, **held})


def check_given(
    given: Mapping[str, Any],
    known: Mapping[str, Parameter],
    elsewhere: Mapping[str, Parameter],
) -> None:
    """Raises Fault for an entry of `[parameters]` that is no parameter, or outside its range."""
    for name, value in given.items():
        if name not in known:
            raise Fault(f"parameters.{name}", unknown(name, list(known), elsewhere=elsewhere))
        if not is_number(value, arrays=False):
            raise Fault(f"parameters.{name}", f"must be a number, was {show(value)}")
        if problem := known[name].problem(value):
            raise Fault(f"parameters.{name}", problem)


def law_of(key: str, name: str) -> Law:
    """The law that stands under a key of a file. Raises: Fault."""
    if name in FRICTIONS:
        keys = FRICTIONS[name]
        return Law(name, keys, {parameter: PARAMETERS[parameter] for parameter in keys.values()})
    if not is_path(name):
        raise Fault(key, no_name(name, FRICTIONS))
    found = imported(key, name)
    needs(key, found, ("coefficient",), "friction law (wiperjax.AbstractFriction)")
    try:
        declared = parameters_of(found)
    except ValueError as error:
        raise Fault(key, f"{name}: {error}") from None
    return Law(name, {each: each for each in declared}, declared, found, fingerprint(key, found))
