"""Two numbers of a family of systems, and the box of the plane in which curves are followed."""

from dataclasses import dataclass

import numpy as np

from ...blade import numbers
from ...contact.system import AbstractSystem


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
        return placed(self.system, self.names, place)


def placed(system: AbstractSystem, names: tuple[str, str], place) -> AbstractSystem:
    """Return ``system`` with its two numbers replaced."""
    for name, number in zip(names, place, strict=True):
        system = numbers.replaced(system, name, number)
    return system
