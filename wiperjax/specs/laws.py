"""Friction laws as files name them: those of `vocabulary.kinds`, and one's own by import path."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..vocabulary.checks import is_number
from ..vocabulary.declared import parameters_of
from ..vocabulary.kinds import FRICTIONS
from ..vocabulary.parameters import PARAMETERS, Parameter
from .errors import Fault, show, unknown
from .imported import fingerprint, imported, is_path, named, needs, no_name
from .taken import check_names


@dataclass(frozen=True)
class Law:
    """A friction law that a file asks for.

    Attributes:
        name: its kind, or import path.
        keys: argument of its class -> parameter.
        parameters: name -> parameter, with the reference values that hold for this law.
        found: its class, where it is named by import path.
        source: fingerprint of that.
        default: an object of its class that has what is no number.
    """

    name: str
    keys: Mapping[str, str]
    parameters: Mapping[str, Parameter]
    found: type | None = None
    source: str = ""
    default: Any = None

    def like(self, default: Any) -> "Law":
        """The same law with the numbers of an object of its class as reference values, and with
        what that has beside them."""
        known = {name: getattr(default, key) for key, name in self.keys.items()}
        held = {
            name: replace(entry, reference=float(known[name]))
            for name, entry in self.parameters.items()
            if is_number(known[name], arrays=False)
        }
        return replace(self, parameters={**self.parameters, **held}, default=default)


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
    base = FRICTIONS.get(getattr(found, "kind", ""), {})  # of the package's law that it is made of
    own = own_parameters(key, name, found, base)
    inherited = {argument: name for argument, name in base.items() if argument not in own}
    known = {**{name: PARAMETERS[name] for name in inherited.values()}, **own}
    keys = {**inherited, **{each: each for each in own}}
    return Law(name, keys, known, found, fingerprint(key, found))


def law_notes(law: Law | None, known: Mapping[str, Any]) -> list[str]:
    """A line where friction rises from rest on instead of falling, for some of the numbers `known`:
    rarely meant, and seldom seen where one of the two is left to its default.
    """
    if law is None or law.name != "stribeck":
        return []
    least, most = np.min(known["mu_static"]), np.max(known["mu_minimum"])
    if least >= most:
        return []
    values = "is {:g}, less than mu_minimum ({:g})"
    if max(np.size(known[name]) for name in ("mu_static", "mu_minimum")) > 1:
        values = "is as low as {:g}, mu_minimum as high as {:g}"
    return [f"mu_static {values.format(least, most)}: friction rises with speed"]


def check_coulomb(
    law: Law | None, values: Callable[[str], np.ndarray], key_of: Callable[[str], str]
) -> None:
    """Raises Fault where Coulomb's friction would be larger in slip than at rest, for some of the
    `values` of a file: before anything is stored of a sweep.
    """
    if law is None or law.name != "coulomb":
        return
    most, least = values("mu_minimum").max(), values("mu_static").min()
    if most > least:
        must = f"must be at most mu_static ({least:g}) with this friction"
        raise Fault(key_of("mu_minimum"), f"{must}, was {most:g}")


def law_like(key: str, default: Any) -> Law:
    """The law that an object is of, with all that the object has. Raises: Fault."""
    cls = type(default)
    name = named(default, FRICTIONS) or f"{cls.__module__}:{cls.__qualname__}"
    return law_of(key, name).like(default)


def own_parameters(
    key: str, path: str, found: type, besides: Collection[str] = ()
) -> Mapping[str, Parameter]:
    """Parameters that a class declares (`parameters_of`). Raises: Fault, of the key, where it does
    not, or by a name that maps use."""
    try:
        own = parameters_of(found, besides)
    except ValueError as error:
        raise Fault(key, f"{path}: {error}") from None
    check_names(key, path, own)
    return own
