"""What the curves of cycles have in common: the return map, and derivatives by two parameters."""

from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np

from ...vocabulary.codes import CurveEnd
from ..beginning import start_of
from ..branch.bifurcations import change, corner_kind
from ..branch.corner import LOOKED
from ..branch.step import swing
from ..chart import Chart
from ..cycle import Cycle, cycle_at, same_word
from ..orbit import words
from ..return_map import Point, Shooting
from ..shooting import Arc, Lost
from ..walk import ROOM
from .equations import Equations, Facts, Spot


@dataclass(frozen=True)
class OfCycles(Equations):
    """Unknowns: coordinates of a start in ``where``, the period if it is free, two parameters."""

    enough: ClassVar[float] = 1e-10
    shooting: Shooting
    where: Chart
    phase: float

    def pair(self, place) -> tuple[Shooting, Shooting]:
        """Return the family of systems through ``place``, varied over either parameter."""
        names, scale, system = self.plane.names, self.plane.scale, self.plane.at(place)
        return tuple(  # type: ignore[return-value]
            replace(
                self.shooting,
                system=system,
                over=names[k],
                parameter_scale=scale[k],
            )
            for k in (0, 1)
        )

    def period(self, u: np.ndarray) -> float:
        """Return the period among the unknowns; NaN where a clock sets it."""
        return self.shooting.period_of(self.where, u)

    def returned(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, Arc]:
        """Return (residual (m,), its derivatives (m, m + 2), motion). Raises `Lost`."""
        place, d, period = self.place(u), self.where.basis.shape[1], self.period(u)
        one, two = self.pair(place)
        residual, by_one, motion = one.returned(self.where, self.phase, u[:d], period, place[0])
        _, by_two, _ = two.returned(self.where, self.phase, u[:d], period, place[1])
        return residual, np.hstack([by_one, by_two[:, -1:]]), motion

    def cycle(self, u: np.ndarray, residual, jacobian, motion: Arc) -> Cycle:
        """Return the cycle of a solution."""
        place, size = self.place(u), float(np.max(np.abs(residual), initial=0.0))
        period = float(motion.times[-1] - motion.times[0])
        point = Point(
            self.where, self.phase, u[:-1], jacobian[:, :-1], size, motion, period, place[0]
        )
        return cycle_at(self.pair(place)[0], point)

    def known(self, cycle: Cycle, test: dict[str, float]) -> Facts:
        """Return the facts of a cycle."""
        assert cycle.state is not None
        size = 1.0
        if self.shooting.clock is None:  # no longer than a part of the amplitude, which may vanish
            size = ROOM * swing(self.shooting, cycle)
        return Facts(cycle.state, cycle.amplitude, cycle.period, test, cycle, size)

    def moved(self, facts: Facts, place: np.ndarray):
        """Return these equations around the cycle of ``facts``, away from its events."""
        cycle, shooting = facts.cycle, self.shooting
        begin = start_of(shooting, self.where, self.phase, cycle.motion)
        where = begin.chart(shooting, self.plane.at(place), cycle.period)
        start = shooting.unknowns(where, cycle.period, *(place / self.plane.scale))
        return replace(self, where=where, phase=begin.phase, start=start)

    @property
    def sizes(self):
        return float(self.shooting.scale[0]), self.shooting.period_scale

    def spread(self, tangent):
        d = self.where.basis.shape[1]
        state = self.where.basis @ tangent[:d] / self.where.scale
        return np.concatenate([state, tangent[d:]])

    def same(self, one: Spot, two: Spot) -> bool:
        a, b = one.facts.cycle, two.facts.cycle
        return same_word(a, b) or corner_kind(a, b) == "shoulder"

    def beside(self, here: Spot) -> list[np.ndarray]:
        """Return the ways, in the unknowns, on which other events may lie close to ``here``."""
        return [here.tangent]

    def stuck(self, here: Spot) -> tuple[CurveEnd, str]:
        cycle, why = here.facts.cycle, ""
        for length, way in product(LOOKED, self.beside(here)):
            try:
                motion = self.values(here.unknowns + length * way)[2][2]
            except Lost as lost:
                why = why or str(lost)  # another way may tell more
                continue
            word, regimes = words(motion)
            if not same_word(cycle, replace(cycle, word=word, regimes=regimes)):
                return CurveEnd.EVENTS, f"the events change: {change(cycle, word)}"
        return (CurveEnd.EVENTS, why) if why else super().stuck(here)
