"""What defines a curve in two parameters: m + 1 equations for m + 2 unknowns, around one place.

The last two unknowns are the parameters in units of their ranges; what the others are is the
matter of each kind (`hopf`, `fold`, `touch`).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...vocabulary.codes import CurveEnd
from ..roots import pinned_root
from ..shooting import Lost
from .plane import Plane

CLOSED = 1e-9  # of the equations, in scaled numbers: larger is no solution
MOST = 14  # evaluations of one correction


class Facts(NamedTuple):
    """What is known at a place of a curve; tests for special points are taken of it."""

    state: np.ndarray  # (2n,) of the equilibrium, or at the start of the cycle
    amplitude: float  # of the first coordinate; 0 for an equilibrium
    period: float  # of the cycle, or of the linear oscillation [s]
    test: dict[str, float]  # numbers whose zeros are special points
    cycle: Any = None
    size: float = 1.0  # of a step, at most, in the unknowns


class Test(NamedTuple):
    """A special point: where a number of `Facts.test` vanishes."""

    name: str
    detail: str
    end: CurveEnd | None = None  # why the curve ends there; None: it goes on


@dataclass(frozen=True)
class Equations(ABC):
    """The defining equations of a curve in coordinates around ``start`` (unknowns)."""

    kind: ClassVar[str]
    tests: ClassVar[tuple[Test, ...]]
    enough: ClassVar[float]  # in scaled numbers: solved as far as the equations can be told
    plane: Plane
    start: np.ndarray

    @abstractmethod
    def values(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, Any]:
        """Return values (m + 1,), derivatives (m + 1, m + 2), and what `facts` needs, at ``u``.

        Raises `Lost`.
        """

    @abstractmethod
    def facts(self, u: np.ndarray, more: Any) -> Facts:
        """Return what is known at a solution."""

    @abstractmethod
    def centred(self, facts: Facts, place: np.ndarray) -> "Equations":
        """Return the same curve's equations around a solution at ``place`` (2,), SI."""

    @abstractmethod
    def spread(self, tangent: np.ndarray) -> np.ndarray:
        """Return a tangent in numbers that do not hang on the coordinates."""

    def limit(self, spot: "Spot") -> "Spot":
        """Return the place on the curve that a solution of these equations stands for."""
        return spot

    @property
    @abstractmethod
    def sizes(self) -> tuple[float, float]:
        """Return what amplitudes and periods are measured in."""

    def same(self, one: "Spot", two: "Spot") -> bool:
        """Return whether nothing that the equations suppose has changed between two spots."""
        return True

    def beyond(self, spot: "Spot", test: Test) -> "Spot | None":
        """Return where the curve goes on behind a test that would end it at ``spot``, or None.

        So far behind that the sign of the test is beyond doubt: at its zero it would be met again.
        """
        return None

    def vanishes(self, here: "Spot", ahead: "Spot") -> bool:
        """Return whether cycles that become small from ``here`` on shrink onto steady slip."""
        return False

    def stuck(self, here: "Spot") -> tuple[CurveEnd, str]:
        """Return why no step leads on from ``here``."""
        return CurveEnd.FAILED, "no solution was found at the smallest step"

    def place(self, u: np.ndarray) -> np.ndarray:
        """Return the two parameters, SI."""
        return u[-2:] * self.plane.scale


@dataclass(frozen=True)
class Spot:
    """A solution in the coordinates of ``equations``, and the curve's unit tangent there."""

    equations: Equations
    unknowns: np.ndarray
    jacobian: np.ndarray
    tangent: np.ndarray
    facts: Facts

    @property
    def place(self) -> np.ndarray:
        """The two parameters, SI."""
        return self.equations.place(self.unknowns)

    @cached_property
    def meant(self) -> "Spot":
        """The place on the curve that this one stands for (`Equations.limit`)."""
        return self.equations.limit(self)


def solve(
    equations: Equations, guess: np.ndarray, pinned: np.ndarray, target: float | None = None
) -> Spot | None:
    """Return the solution near ``guess`` with ``pinned @ unknowns = target`` (that of the guess).

    None where it does not come to one. The tangent goes with ``pinned``.
    """
    settings = {"enough": equations.enough, "tolerance": 1e-13, "most": MOST}
    try:
        found = pinned_root(equations.values, guess, pinned, target, **settings)
    except Lost:
        return None
    if not (np.max(np.abs(found.values)) < CLOSED and found.off < CLOSED):
        return None
    u, jacobian = found.unknowns, found.jacobian
    return Spot(equations, u, jacobian, null(jacobian, pinned), equations.facts(u, found.more))


def null(jacobian: np.ndarray, onward: np.ndarray) -> np.ndarray:
    """Return the unit vector that ``jacobian`` takes to zero, on the side of ``onward``."""
    tangent = np.linalg.svd(jacobian)[2][-1]
    return -tangent if tangent @ onward < 0 else tangent
