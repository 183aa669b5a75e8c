"""Two numbers of a family of systems, and the box of the plane in which curves are followed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...contact.system import AbstractSystem
from ...systems import numbers


@dataclass(frozen=True)
class Plane:
    """Two numbers of ``system`` (traceable for both) and their ranges, SI."""

    system: AbstractSystem
    names: tuple[str, str]
    low: np.ndarray  # (2,)
    high: np.ndarray  # (2,)

    @property
    def scale(self) -> np.ndarray:
        """The ranges: what the two numbers are measured in, (2,)."""
        return self.high - self.low

    def at(self, place) -> AbstractSystem:
        """Return the system at ``place`` (2,), SI."""
        system = self.system
        for name, number in zip(self.names, place, strict=True):
            system = numbers.replaced(system, name, number)
        return system

    @cached_property
    def ways(self) -> tuple[Any, Any]:
        """The directions of the two numbers, by which compiled programs know them (`placed`)."""
        one, two = (numbers.direction(self.system, name) for name in self.names)
        return one, two


def placed(system: AbstractSystem, ways: tuple[Any, Any], place) -> AbstractSystem:
    """Return ``system`` with the numbers replaced that ``ways`` tell: as `Plane.at`, traced."""
    for along, number in zip(ways, place, strict=True):
        system = numbers.moved(system, along, number)
    return system
