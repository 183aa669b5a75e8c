"""The walk along a branch in one direction: its steps, its special points, and why it ended."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...vocabulary.codes import CurveEnd
from ..cycle import Cycle, same_word
from ..return_map import Shooting
from ..walk import ROOM, AbstractWalk
from .bifurcations import (
    TESTS,
    Located,
    Special,
    change,
    corner_kind,
    doubled,
    exchanged,
    onto_stop,
    told_once,
    turning,
)
from .corner import SHORT, beyond, edge_of, jumped, smooth
from .step import (
    BranchStep,
    Reached,
    ahead_of,
    between,
    centred,
    direction,
    place,
    swing,
    with_parameter,
)

BESIDE = 0.15  # of a chord: how near to it a cycle lies that was passed between its ends
SAME = 1e-3  # of a chord: how near to each other two cycles are one
FAMILY = 1e-9  # of the closing equations' slopes: none
PASSED = 2.0  # steps: how near the start of a closed branch is when it is passed
ROUNDING = 1e-8  # of a test function: less has no sign


def family(step: BranchStep) -> bool:
    """Whether cycles beside that of ``step`` are cycles of the same parameter, as where a belt that
    turns carries all along: no direction leads on."""
    slopes = np.linalg.svd(step.point.jacobian)[1]
    return bool(slopes.size and slopes[-1] < FAMILY)


class Walk(AbstractWalk[BranchStep]):
    """One direction of a branch, ``sense`` times that of the parameter at its first point."""

    vanished = 0.01

    def __init__(
        self, shooting: Shooting, low: float, high: float, longest: float, most: int, sense: float
    ):
        super().__init__(longest, most)
        self.shooting, self.low, self.high, self.sense = shooting, low, high, sense

    def run(self, first: BranchStep) -> None:
        turned = 1.0 if first.sense * self.sense >= 0 else -1.0
        tangent, sense = turned * first.tangent, turned * first.sense
        super().run(replace(first, tangent=tangent, sense=sense))

    def _amplitude(self, point):
        return swing(self.shooting, point.cycle)

    def _centred(self, point):
        return centred(self.shooting, point)

    def _room(self, here):
        if self.shooting.clock is not None:
            return self.longest
        return ROOM * swing(self.shooting, here.cycle)

    def _shortest(self, here):
        return SHORT * self.longest

    def _turn(self, here, ahead):
        return float(direction(self.shooting, here) @ direction(self.shooting, ahead))

    def _ahead(self, here, length):
        ahead = ahead_of(self.shooting, here, length)
        if ahead is None or not smooth(self.shooting, here, ahead):
            return None
        found = self._located(here, ahead, length)
        crossed = any(kind == "branch_point" for _, kind, _, _ in found)
        if here.index * ahead.index < 0 and not crossed:
            return None  # on another arm of the branch
        return ahead, found

    def _located(self, here: BranchStep, ahead: BranchStep, length: float) -> Located:
        """Return the special points between two steps of one word, in order."""
        found: Located = []
        for kind, detail, test in TESTS:
            for ends in pairwise(self._apart(here, ahead, length, test)):
                if max(abs(test(step)) for _, step in ends) < ROUNDING:
                    continue  # zero all along, as products of a system that loses nothing are
                place = between(self.shooting, here, ends, test)
                if place is None:
                    continue
                if kind == "neimark_sacker" and not turning(place[1].cycle):
                    continue  # a product of two real multipliers passes 1: nothing happens
                found.append((place[0], kind, detail, place[1]))
        return told_once(sorted(found, key=lambda item: item[0]))

    def _apart(
        self, here: BranchStep, ahead: BranchStep, length: float, test: Callable
    ) -> list[Reached]:
        """Return the ends of a step, and between them the place where ``test`` has the other sign.

        It is looked for where the parabola through the step before turns: a tongue in which
        multipliers pass -1, and come back, may be narrower than a step.
        """
        ends = [(0.0, here), (length, ahead)]
        if len(self.points) < 2 or not same_word(self.points[-2].cycle, here.cycle):
            return ends
        spots = [place(self.shooting, step) for step in (self.points[-2], here, ahead)]
        back, on = (float(np.linalg.norm(b - a)) for a, b in pairwise(spots))
        before, one, two = (test(step) for step in (self.points[-2], here, ahead))
        if not (min(back, on) > 0 and np.isfinite(before) and one * two > 0):
            return ends
        bend, slope, _ = np.polyfit([-back / on, 0.0, 1.0], [before, one, two], 2)
        part = -0.5 * slope / bend if bend * one > 0 else 0.0
        if not 0 < part < 1:
            return ends
        at = part * length
        middle = ahead_of(self.shooting, here, at)
        if middle is None or not smooth(self.shooting, here, middle) or test(middle) * one >= 0:
            return ends
        return [ends[0], (at, middle), ends[1]]

    def _take(self, here, ahead, found: Located, length) -> None:
        for number, (distance, kind, _, step) in enumerate(found):
            alike = kind in ("fold", "branch_point") and doubled(step.cycle)
            if alike and exchanged(self.points[0].cycle, here, ahead):
                length, ahead = distance, step  # beyond, they are the same again
                detail = "the cycle is one of half its period, twice"
                found = [*found[:number], (distance, "period_doubling", detail, step)]
                self._stop("a period doubling: half of the cycle is one")
                break
        cut, last = self._cut(here, ahead, length)
        for distance, kind, detail, step in found:
            if distance > cut:
                break
            if kind == "branch_point" and here.sense * ahead.sense < 0:
                detail += (
                    "; the parameter turns back: a walk along symmetric cycles has left them, "
                    "or one along asymmetric cycles meets its mirror image"
                )
            self.special.append(Special(kind, detail, step.point.parameter, len(self.points)))
            self._append(step)
        if last is not None and last is not self.points[-1]:
            self._append(last)
            self._note_vanishing(here, last)

    def _cut(
        self, here: BranchStep, ahead: BranchStep, length: float
    ) -> tuple[float, BranchStep | None]:
        """Return how far the way to ``ahead`` counts, and the step there if it has one."""
        parameter, ends = ahead.point.parameter, ((0.0, here), (length, ahead))
        if not self.low <= parameter <= self.high:
            self._stop("the end of the range", CurveEnd.RANGE)
            border = self.low if parameter < self.low else self.high
            found = between(self.shooting, here, ends, lambda step: step.point.parameter - border)
            if found is None:
                return 0.0, None
            return found[0], with_parameter(self.shooting, found[1], border)
        chord = self._met(ahead)
        if chord is None:
            return length, ahead
        spot, last = (place(self.shooting, step) for step in (ahead, here))
        start = place(self.shooting, self.points[0])
        far = np.linalg.norm(start - spot) > PASSED * np.linalg.norm(spot - last)
        if far or (spot - last) @ chord < 0:  # a closed branch comes back to where it began
            self._stop("the walk came back on itself: a smaller step may go on")
            return 0.0, None
        self._stop("the branch is closed", CurveEnd.CLOSED)
        onward = place(self.shooting, self.points[1]) - start
        found = between(
            self.shooting,
            here,
            ends,
            lambda step: float((place(self.shooting, step) - start) @ onward),
        )
        return (0.0, None) if found is None else found

    def _met(self, ahead: BranchStep) -> np.ndarray | None:
        """Return the chord between two steps walked before if ``ahead`` lies there again, or None.

        It does if they have its word and determinants of its sign (none of them lies on the other
        arm of a fold), and the cycle next to them that has its parameter is the same, speeds too.
        """
        spots = np.array([place(self.shooting, step) for step in self.points])
        spot, chords = place(self.shooting, ahead), np.diff(spots, axis=0)
        square = np.maximum(np.sum(chords**2, axis=1), 1e-30)  # a special point may be met twice
        part = np.sum((spot - spots[:-1]) * chords, axis=1) / square
        aside = np.linalg.norm(spot - spots[:-1] - part[:, None] * chords, axis=1)
        beside = (part >= 0) & (part <= 1) & (aside < BESIDE * np.sqrt(square))
        for k in np.flatnonzero(beside):
            ends = self.points[k : k + 2]
            if not all(
                same_word(e.cycle, ahead.cycle) and e.determinant * ahead.determinant >= 0
                for e in ends
            ):
                continue
            again = with_parameter(self.shooting, ends[int(part[k] > 0.5)], ahead.point.parameter)
            near = SAME * np.sqrt(square[k])
            if np.linalg.norm(place(self.shooting, again) - spot) < near:
                if self._unlike(again.cycle, ahead.cycle) < near:
                    return chords[k]
        return None

    def _unlike(self, one: Cycle, two: Cycle) -> float:
        """Return how far apart the speeds of two cycles are, of their size.

        Of one symmetric coordinate extremes are one number: over the parameter they cross.
        """
        size = self.shooting.scale[len(self.shooting.scale) // 2]
        return abs(one.velocity_rms - two.velocity_rms) / size

    def _stuck(self, here, length):
        """Close in on a corner or a sharp turn, or take the branch up behind a corner."""
        edge = edge_of(self.shooting, here, length)
        if edge is not here:
            reach = float((edge.point.unknowns - here.point.unknowns) @ here.tangent)
            self._take(here, edge, self._located(here, edge, reach), reach)
            return reach
        way = beyond(self.shooting, here, self.longest)
        if isinstance(way, str):
            self._stop(way)
        elif self._met(way[0]) is not None:
            self._stop("no cycle beyond")
        else:
            self._name_corner(here, way[0])
            if family(way[0]):
                self._stop("beyond, cycles are a family: those beside one are cycles too")
                return length
            for step in way:
                if not self.low <= step.point.parameter <= self.high:
                    self._stop("the end of the range", CurveEnd.RANGE)
                    break
                self._append(step)
        return 0.1 * self.longest

    def _name_corner(self, edge: BranchStep, other: BranchStep) -> None:
        """Note a corner as it is met in the order of the branch: a walk back is turned round."""
        onward = self.sense > 0
        before, after = (edge, other) if onward else (other, edge)
        kind = corner_kind(before.cycle, after.cycle)
        name = f"{kind}_fold" if edge.sense * other.sense < 0 else kind
        detail = change(before.cycle, after.cycle.word)
        if jumped(self.shooting, edge, other):
            detail += "; cycles between may have been passed over"
        index = len(self.points) - 1 if onward else len(self.points)
        self.special.append(Special(name, detail, edge.point.parameter, index))

    def _note_vanishing(self, here: BranchStep, ahead: BranchStep) -> None:
        """Note where the cycle shrinks onto steady slip (amplitude^2 -> 0), if it does.

        There det(1 - return map) vanishes as amplitude^2 does. It keeps its value along cycles that
        only become small with the parameter, as those of stick do with the belt's speed.
        """
        far = self._vanishing(here, ahead) if self.shooting.clock is None else None
        if far is None:
            return
        one, two = self._amplitude(here), self._amplitude(ahead)
        kind, detail, end = "hopf", "the cycle shrinks onto steady slip", "a Hopf point"
        if abs(ahead.determinant) * one > abs(here.determinant) * two:
            if not onto_stop(here, ahead, 1 - two / one):
                return
            far = two / (one - two)  # it is as small as steady slip is near
            kind, detail = "boundary_equilibrium", "the cycle shrinks onto a stop"
            end = "steady slip comes to a stop"
        a, b = here.point.parameter, ahead.point.parameter
        self.special.append(Special(kind, detail, b + far * (b - a), len(self.points) - 1))
        self._stop(end)
