"""The walk along a curve in two parameters in one direction: steps, special points, why it ended.

Pseudo-arclength: predict along the tangent, correct at that distance, shorter where that fails.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...vocabulary.codes import CurveEnd
from ..roots import root_between
from ..shooting import Lost
from .equations import CLOSED, Spot, Test, solve

GENTLE = 0.8  # cosine of the largest turn within a step
STRAIGHT = 0.98  # of a turn after which steps grow
SHORT = 1e-3  # of the longest step: where this one fails, the curve is given up
LOCATED = 1e-8  # of a step's unit: how closely a special point is closed in
VANISHED = 0.02  # of the largest amplitude: a fold shrinks onto steady slip
FLAT = 1e-6  # of a unit tangent: a parameter that stays the same
STILL = 1e-4  # of a unit tangent: neither parameter changes


class Mark(NamedTuple):
    """A special point of a curve."""

    kind: str
    detail: str
    index: int  # of the curve's point there


class Walk:
    """One direction of a curve: its spots (the first one too), special points, why it ended."""

    def __init__(self, longest: float, most: int):
        self.longest, self.most = longest, most
        self.spots: list[Spot] = []
        self.marks: list[Mark] = []
        self.end: CurveEnd | None = None
        self.detail = ""
        self.largest = 0.0  # amplitude on the way

    def run(self, first: Spot) -> None:
        """Walk from ``first`` along its tangent."""
        self.spots, self.largest = [first], first.facts.amplitude
        length, gone = 0.3 * self.longest, 0.0
        while self.end is None:
            here = centred(self.spots[-1])
            if here is None:
                self._stop(CurveEnd.FAILED, "the solution was lost in its own coordinates")
                return
            length = min(length, self.longest, here.facts.size)
            ahead = ahead_of(here, length)
            if ahead is None:
                length *= 0.5
                if length < SHORT * min(self.longest, here.facts.size):
                    self._stop(*here.equations.stuck(here))
                continue
            gone += length
            self._take(here, ahead, length, gone > 3 * self.longest)
            straight = turn(here, ahead) > STRAIGHT
            length *= 1.4 if straight else 1.0
            if len(self.spots) > self.most and self.end is None:
                self._stop(CurveEnd.POINTS, f"{self.most} points: a longer step reaches farther")

    def _stop(self, end: CurveEnd, detail: str) -> None:
        self.end, self.detail = end, detail

    def _take(self, here: Spot, ahead: Spot, length: float, far: bool) -> None:
        """Append the way to ``ahead``, up to where it ends, with the special points on it."""
        found = [*self._specials(here, ahead, length), *self._borders(here, ahead, length)]
        if far and (passed := self._closing(here, ahead, length)):
            found.append(passed)
        for _, test, spot in sorted(found, key=lambda item: item[0]):
            if test.end not in (CurveEnd.RANGE, CurveEnd.CLOSED):
                self.marks.append(Mark(test.name, test.detail, len(self.spots)))
            self.spots.append(spot)
            if test.end is not None:
                onward = spot.equations.beyond(spot, test)
                if onward is None:
                    self._stop(test.end, test.detail)
                else:
                    self.spots.append(onward)
                return
        self.spots.append(ahead)
        self._note_vanishing(here, ahead)

    def _note_vanishing(self, here: Spot, ahead: Spot) -> None:
        """Note where the cycles of a fold shrink onto steady slip (amplitude^2 -> 0).

        Cycles may be small, too, because a belt is slow or a scale is small: that is no such end.
        """
        one, two = here.facts.amplitude, ahead.facts.amplitude
        self.largest = max(self.largest, two)
        if two >= one or two > VANISHED * self.largest or not here.equations.vanishes(here, ahead):
            return
        way = two**2 / (one**2 - two**2)
        gone = ahead.unknowns + way * (ahead.unknowns - here.unknowns)
        end = replace(ahead, unknowns=gone, facts=ahead.facts._replace(amplitude=0.0))
        detail = "the cycles of the fold shrink onto steady slip"
        self.marks.append(Mark("bautin", detail, len(self.spots)))
        self.spots.append(end)
        self._stop(CurveEnd.BAUTIN, detail)

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
        first = self.spots[0]
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
    if equations.spread(tangent) @ spot.equations.spread(spot.tangent) < 0:
        tangent = -tangent
    if np.max(np.abs(residual)) > CLOSED:  # what it is measured by is another around it
        return solve(equations, equations.start, tangent)
    facts = equations.facts(equations.start, more)
    return Spot(equations, equations.start, jacobian, tangent, facts)


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
