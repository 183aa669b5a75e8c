"""The curve of smooth folds: two cycles of the same events merge, a multiplier is 1.

Where the derivative J of the closing equations by all but the parameters is singular, the bordered
system [[J, b], [c, 0]] (v, g) = (0, 1) has g = 0; b and c are the null vectors of the last place
(Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, chapter 4). The
derivative of g is that of J along v: one difference of the exact J, on either side. A place before
its own does not serve: where stick is short J changes with the root of how far its end is away.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...vocabulary.codes import CurveEnd
from .equations import Spot, Test
from .of_cycles import OfCycles

APART = 1e-5  # of the amplitude: the step of the difference, which is not to reach other events
TOUCHING = 0.02  # of the largest slip speed: the next step would bring stick


@dataclass(frozen=True)
class Fold(OfCycles):
    """Folds around a cycle; ``left`` and ``right`` border J."""

    kind: ClassVar[str] = "fold"
    tests: ClassVar[tuple[Test, ...]] = ()
    left: np.ndarray  # (m,)
    right: np.ndarray  # (m,)

    def values(self, u):
        residual, jacobian, motion = self.returned(u)
        along, merging = self._merging(jacobian)
        row = -self._merging(jacobian, transposed=True)[0] @ self._bent(u, along)
        values, slopes = np.append(residual, merging), np.vstack([jacobian, row])
        return values, slopes, (residual, jacobian, motion)

    def facts(self, u, more):
        return self.known(self.cycle(u, *more), {})

    def centred(self, facts, place):
        return self.moved(facts, place).bordered()

    def bordered(self) -> "Fold":
        """Return these equations with the borders that suit their start."""
        jacobian = self.returned(self.start)[1]
        left, _, right = np.linalg.svd(jacobian[:, : len(jacobian)])
        return replace(self, left=left[:, -1], right=right[-1])

    def _bent(self, u, along) -> np.ndarray:
        """Return the derivative of J and its last columns along ``along`` (m,) at ``u``."""
        step = APART * np.append(along, [0.0, 0.0])
        ahead, back = (self.returned(u + sign * step)[1] for sign in (1, -1))
        return (ahead - back) / (2 * APART)

    def _merging(self, jacobian, transposed: bool = False) -> tuple[np.ndarray, float]:
        """Return (v, g) of the bordered system; of the transposed one on request."""
        m = len(jacobian)
        square = np.zeros((m + 1, m + 1))
        square[:m, :m], square[:m, m], square[m, :m] = jacobian[:, :m], self.left, self.right
        answer = np.linalg.solve(square.T if transposed else square, np.eye(m + 1)[-1])
        return answer[:m], float(answer[m])

    def vanishes(self, here, ahead):
        """There the parting of the two cycles vanishes as the cube of the amplitude does; it grows
        where only the scale of the motion becomes small with a parameter."""
        one, two = here.facts.amplitude, ahead.facts.amplitude
        return self._parting(ahead) * one < self._parting(here) * two

    def _parting(self, spot: Spot) -> float:
        """Return the second derivative of the closing equations along their null vector."""
        m = len(spot.jacobian) - 1
        along = self._merging(spot.jacobian[:-1])[0]
        return abs(float(spot.jacobian[-1, :m] @ along)) / float(np.linalg.norm(along))

    def beside(self, here):
        """A curve of folds ends tangent to that of other events: these lie across it, where the
        two cycles part."""
        parting = np.append(self._merging(here.jacobian[:-1])[0], [0.0, 0.0])
        return [*super().beside(here), parting, -parting]

    def stuck(self, here: Spot):
        cycle = here.facts.cycle
        if cycle.slip_margin < TOUCHING * np.max(np.abs(cycle.motion.slip_speed)):
            return CurveEnd.OTHER_FOLD, "stick begins: from here on the fold is at a corner"
        return super().stuck(here)
