"""The walk along a curve in two parameters in one direction: its special points, and its ends."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...vocabulary.codes import CurveEnd
from ..roots import root_between
from ..shooting import Lost
from ..walk import GENTLE, AbstractWalk
from .equations import CLOSED, Equations, Spot, Test, solve

SHORT = 2e-3  # of the longest step: where this one fails, the curve is given up
LOCATED = 1e-8  # of a step's unit: how closely a special point is closed in
FLAT = 1e-6  # of a unit tangent: a parameter that stays the same
STILL = 1e-4  # of a unit tangent: neither parameter changes


class Mark(NamedTuple):
    """A special point of a curve."""

    kind: str
    detail: str
    index: int  # of the curve's point there


class Walk(AbstractWalk[Spot]):
    """One direction of a curve."""

    vanished = 0.02

    def __init__(self, longest: float, most: int):
        super().__init__(longest, most)
        self.gone = 0.0  # way so far

    def _amplitude(self, point):
        return point.facts.amplitude

    def _centred(self, point):
        found = centred(point)
        if found is None:
            raise Lost("the solution was lost in its own coordinates")
        return found

    def _room(self, here):
        return here.facts.size

    def _shortest(self, here):
        return SHORT * min(self.longest, here.facts.size)

    def _turn(self, here, ahead):
        return turn(here, ahead)

    def _ahead(self, here, length):
        ahead = ahead_of(here, length)
        if ahead is None:
            return None
        found = [*self._specials(here, ahead, length), *self._borders(here, ahead, length)]
        if self.gone + length > 3 * self.longest and (passed := self._closing(here, ahead, length)):
            found.append(passed)
        return ahead, sorted(found, key=lambda item: item[0])

    def _take(self, here, ahead, found, length):
        self.gone += length
        for _, test, spot in found:
            if test.end not in (CurveEnd.RANGE, CurveEnd.CLOSED):
                self.special.append(Mark(test.name, test.detail, len(self.points)))
            self._append(spot)
            if test.end is not None:
                onward = spot.equations.beyond(spot, test)
                if onward is None:
                    self._stop(test.detail, test.end)
                else:
                    self._append(onward)
                return
        self._append(ahead)
        self._note_vanishing(here, ahead)

    def _stuck(self, here, length):
        end, detail = here.equations.stuck(here)
        self._stop(detail, end)
        return length

    def _note_vanishing(self, here: Spot, ahead: Spot) -> None:
        """Note where the cycles of a fold shrink onto steady slip.

        Cycles may be small, too, because a belt is slow or a scale is small: that is no such end.
        """
        far = self._vanishing(here, ahead)
        if far is None or not here.equations.vanishes(here, ahead):
            return
        gone = ahead.unknowns + far * (ahead.unknowns - here.unknowns)
        end = replace(ahead, unknowns=gone, facts=ahead.facts._replace(amplitude=0.0))
        detail = "the cycles of the fold shrink onto steady slip"
        self.special.append(Mark("bautin", detail, len(self.points)))
        self._append(end)
        self._stop(detail, CurveEnd.BAUTIN)

    def _specials(self, here: Spot, ahead: Spot, length: float):
        names = here.equations.plane.names
        turns = [Test(f"turn_{name}", f"{name} turns back") for name in names]
        cusp = False
        for test in (*here.equations.tests, *turns):
            if test in turns and max(abs(value(spot, test)) for spot in (here, ahead)) < FLAT:
                continue  # the curve does not depend on the other one: signs of rounding
            found = between(here, ahead, length, lambda spot, test=test: value(spot, test))
            if found is None:
                continue
            if test in turns and np.linalg.norm(found[1].tangent[-2:]) < STILL:
                if cusp:
                    continue
                test, cusp = (
                    Test("cusp", "two curves of folds meet: both parameters turn back"),
                    True,
                )
            yield found[0], test, found[1]

    def _borders(self, here: Spot, ahead: Spot, length: float):
        plane = here.equations.plane
        for k, name in enumerate(plane.names):
            low, high = plane.low[k], plane.high[k]
            if low <= ahead.meant.place[k] <= high:
                continue
            border = low if ahead.meant.place[k] < low else high

            def outside(spot: Spot, k=k, border=border) -> float:
                return float(spot.meant.place[k] - border) / plane.scale[k]

            test = Test("", f"the end of the range of {name}", CurveEnd.RANGE)
            found = between(here, ahead, length, outside)
            yield (0.0, test, here) if found is None else (found[0], test, found[1])

    def _closing(self, here: Spot, ahead: Spot, length: float):
        """The first spot, if the way to ``ahead`` passes it."""
        first = self.points[0]
        a, b, c = (place_of(spot) for spot in (first, here, ahead))
        chord = c - b
        part = float((a - b) @ chord / (chord @ chord))
        aside = np.linalg.norm(a - b - part * chord)
        if not 0 <= part <= 1 or aside > 0.1 * np.linalg.norm(chord):
            return None
        return part * length, Test("", "the curve is closed", CurveEnd.CLOSED), first


def value(spot: Spot, test: Test) -> float:
    """The number whose zero is the special point ``test``."""
    if test.name.startswith("turn_"):
        return float(spot.meant.tangent[spot.equations.plane.names.index(test.name[5:]) - 2])
    return spot.facts.test[test.name]


def place_of(spot: Spot) -> np.ndarray:
    """Parameters, amplitude and period in scaled numbers: where a spot is, in any coordinates."""
    plane, facts = spot.equations.plane, spot.facts
    size, time = spot.equations.sizes
    return np.array([*(spot.place / plane.scale), facts.amplitude / size, facts.period / time])


def centred(spot: Spot) -> Spot | None:
    """Return ``spot`` in coordinates around itself, or None."""
    try:
        equations = spot.equations.centred(spot.facts, spot.place)
        residual, jacobian, more = equations.values(equations.start)
    except Lost:
        return None
    tangent = np.linalg.svd(jacobian)[2][-1]
    if _alike(equations, tangent, spot) < 0:
        tangent = -tangent
    if np.max(np.abs(residual)) > CLOSED:  # what it is measured by is another around it
        return solve(equations, equations.start, tangent)
    facts = equations.facts(equations.start, more)
    return Spot(equations, equations.start, jacobian, tangent, facts)


def _alike(equations: Equations, tangent: np.ndarray, spot: Spot) -> float:
    """Above 0 if ``tangent`` goes the way that ``spot`` does: in the parameters, for cycles that
    begin at another phase move otherwise there, unless these stay (at a cusp)."""
    one, two = tangent[-2:], spot.tangent[-2:]
    if min(np.linalg.norm(one), np.linalg.norm(two)) > STILL:
        return float(one @ two)
    return float(equations.spread(tangent) @ spot.equations.spread(spot.tangent))


def turn(here: Spot, ahead: Spot) -> float:
    """Cosine of the angle between the tangents of two spots in the same coordinates."""
    return float(here.tangent @ ahead.tangent)


def ahead_of(here: Spot, length: float) -> Spot | None:
    """Return the curve at a distance along the tangent, or None if it is not smoothly there."""
    guess = here.unknowns + length * here.tangent
    spot = solve(here.equations, guess, here.tangent)
    if spot is None or np.linalg.norm(spot.unknowns - guess) > 0.5 * length:
        return None
    return spot if turn(here, spot) > GENTLE and here.equations.same(here, spot) else None


def between(here: Spot, ahead: Spot, length: float, test: Callable[[Spot], float]):
    """Return (distance, spot) at which ``test`` vanishes between two spots ``length`` apart."""
    ends = {0.0: here, length: ahead}
    return root_between(lambda far: ahead_of(here, far), ends, test, LOCATED)
