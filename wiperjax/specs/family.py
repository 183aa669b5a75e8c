"""What a sweep or scene file says of its system: the wiper, or one that is named by import path.

A family knows the parameters of a system and what a file may say of it; `blade.build` and
`systems.build` make the system itself of it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ..vocabulary.parameters import Parameter
from .laws import Law

Values = Callable[[str], np.ndarray]
"""All values of a parameter in a file, edge units."""

KeyOf = Callable[[str], str]
"""Where a parameter stands in a file."""


class Family(ABC):
    """One kind of system, as the specifications `spec` see it."""

    name: str
    coordinates: tuple[str, ...]
    """Names of its coordinates; empty where only its start tells how many there are."""
    has_stops: bool = False
    """Whether its motion strikes stops."""
    elsewhere: Mapping[str, Parameter] = MappingProxyType({})
    """Parameters that a file may state in tables of their own, by which a wrong key is answered."""

    @abstractmethod
    def belt_kind(self, spec: Any) -> str | None:
        """Kind of the belt that a specification asks for; None if the system has none."""

    @abstractmethod
    def law(self, spec: Any) -> Law | None:
        """Friction law that a specification asks for; None if the system has none by name."""

    @abstractmethod
    def parameters(self, spec: Any) -> Mapping[str, Parameter]:
        """Every parameter of the system with this belt and law, in the order of maps."""

    def sweepable(self, spec: Any) -> Mapping[str, Parameter]:
        """Every parameter that a name of an axis can mean, also those of other belts."""
        return self.parameters(spec)

    @abstractmethod
    def stated(self, spec: Any) -> dict[str, tuple[str, float]]:
        """Parameter -> (key in the file, value in edge units), of those the file fixes."""

    @abstractmethod
    def check(self, spec: Any, axes: Mapping[str, Any]) -> None:
        """Raises Fault for keys of a file that do not go with this system, before its values."""

    @abstractmethod
    def check_values(self, spec: Any, values: Values, key_of: KeyOf) -> None:
        """Raises Fault for values that are fine alone but not together."""

    @abstractmethod
    def meaning(self, spec: Any) -> dict[str, Any]:
        """What of the system determines the numbers of a map, beside its parameters; for JSON."""
