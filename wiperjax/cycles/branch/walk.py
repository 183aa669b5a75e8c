"""The walk along a branch in one direction: its steps, its special points, and why it ended."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..cycle import same_word
from ..return_map import Shooting
from ..shooting import Lost
from .bifurcations import (
    TESTS,
    Located,
    Special,
    change,
    corner_kind,
    doubled,
    exchanged,
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

STRAIGHT = 0.98  # cosine of a turn after which steps grow
BESIDE = 0.15  # of a chord: how near to it a cycle lies that was passed between its ends
SAME = 1e-3  # of a chord: how near to each other two cycles are one
ROUNDING = 1e-8  # of a test function: less has no sign
VANISHED = 0.01  # of the largest amplitude: the cycle shrinks onto steady slip


class Walk:
    """One direction of a branch: steps (the first one too), special points, why it ended."""

    def __init__(self, shooting: Shooting, low: float, high: float, step: float, most: int):
        self.shooting = shooting
        self.low, self.high, self.longest, self.most = low, high, step, most
        self.steps: list[BranchStep] = []
        self.special: list[Special] = []
        self.end = ""
        self.closed = False  # back where it began
        self.largest = 0.0  # swing on the way
        self.sense = 1.0

    def run(self, first: BranchStep, sense: float) -> None:
        """Walk from ``first`` to where the parameter first goes as ``sense`` says."""
        self.sense = sense
        turned = 1.0 if first.sense * sense >= 0 else -1.0
        first = replace(first, tangent=turned * first.tangent, sense=turned * first.sense)
        self._append(first)
        length = 0.3 * self.longest
        while not self.end:
            try:
                length = self._onward(length)
            except Lost as lost:
                self.end = str(lost)

    def _onward(self, length: float) -> float:
        """Go on by ``length``, or find out why not. Returns the length to go on with."""
        here = centred(self.shooting, self.steps[-1])
        length = min(length, self._room(here))
        ahead = ahead_of(self.shooting, here, length)
        found = self._smoothly(here, ahead, length)
        if ahead is not None and found is not None:
            self._take(here, ahead, length, found)
            turn = direction(self.shooting, here) @ direction(self.shooting, ahead)
            return min(self.longest, length * (1.4 if turn > STRAIGHT else 1.0))
        if length > SHORT * self.longest:
            return 0.5 * length
        return self._round(here, length)

    def _append(self, step: BranchStep) -> None:
        self.steps.append(step)
        self.largest = max(self.largest, swing(self.shooting, step.cycle))
        if len(self.steps) > self.most and not self.end:
            self.end = f"{self.most} points: a longer step reaches farther"

    def _room(self, here: BranchStep) -> float:
        """Longest step: no longer than a part of the amplitude, where that vanishes."""
        if self.shooting.clock is not None:
            return self.longest
        return min(self.longest, 0.3 * swing(self.shooting, here.cycle))

    def _smoothly(
        self, here: BranchStep, ahead: BranchStep | None, length: float
    ) -> Located | None:
        """Return the special points on the way if the branch goes smoothly to ``ahead``."""
        if ahead is None or not smooth(self.shooting, here, ahead):
            return None
        found = self._located(here, ahead, length)
        crossed = any(kind == "branch_point" for _, kind, _, _ in found)
        if here.index * ahead.index < 0 and not crossed:
            return None  # on another arm of the branch
        return found

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
        if len(self.steps) < 2 or not same_word(self.steps[-2].cycle, here.cycle):
            return ends
        spots = [place(self.shooting, step) for step in (self.steps[-2], here, ahead)]
        back, on = (float(np.linalg.norm(b - a)) for a, b in pairwise(spots))
        before, one, two = (test(step) for step in (self.steps[-2], here, ahead))
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

    def _take(self, here: BranchStep, ahead: BranchStep, length: float, found: Located) -> None:
        """Append the way to ``ahead``, up to where it ends."""
        for number, (distance, kind, _, step) in enumerate(found):
            alike = kind in ("fold", "branch_point") and doubled(step.cycle)
            if alike and exchanged(self.steps[0].cycle, here.cycle, ahead.cycle):
                length, ahead = distance, step  # beyond, they are the same again
                detail = "the cycle is one of half its period, twice"
                found = [*found[:number], (distance, "period_doubling", detail, step)]
                self.end = "a period doubling: half of the cycle is one"
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
            self.special.append(Special(kind, detail, step.point.parameter, len(self.steps)))
            self._append(step)
        if last is not None and last is not self.steps[-1]:
            self._append(last)
            self._note_vanishing(here, last)

    def _cut(
        self, here: BranchStep, ahead: BranchStep, length: float
    ) -> tuple[float, BranchStep | None]:
        """Return how far the way to ``ahead`` counts, and the step there if it has one."""
        parameter, ends = ahead.point.parameter, ((0.0, here), (length, ahead))
        if not self.low <= parameter <= self.high:
            self.end = "the end of the range"
            border = self.low if parameter < self.low else self.high
            found = between(self.shooting, here, ends, lambda step: step.point.parameter - border)
            if found is None:
                return 0.0, None
            return found[0], with_parameter(self.shooting, found[1], border)
        chord = self._met(ahead)
        if chord is None:
            return length, ahead
        spot, last = (place(self.shooting, step) for step in (ahead, here))
        if (spot - last) @ chord < 0:
            self.end = "the walk came back on itself: a smaller step may go on"
            return 0.0, None
        self.end, self.closed = "the branch is closed", True
        start = place(self.shooting, self.steps[0])
        onward = place(self.shooting, self.steps[1]) - start
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
        arm of a fold), and the cycle next to them that has its parameter is the same.
        """
        spots = np.array([place(self.shooting, step) for step in self.steps])
        spot, chords = place(self.shooting, ahead), np.diff(spots, axis=0)
        square = np.maximum(np.sum(chords**2, axis=1), 1e-30)  # a special point may be met twice
        part = np.sum((spot - spots[:-1]) * chords, axis=1) / square
        aside = np.linalg.norm(spot - spots[:-1] - part[:, None] * chords, axis=1)
        beside = (part >= 0) & (part <= 1) & (aside < BESIDE * np.sqrt(square))
        for k in np.flatnonzero(beside):
            ends = self.steps[k : k + 2]
            if not all(
                same_word(e.cycle, ahead.cycle) and e.determinant * ahead.determinant >= 0
                for e in ends
            ):
                continue
            again = with_parameter(self.shooting, ends[int(part[k] > 0.5)], ahead.point.parameter)
            if np.linalg.norm(place(self.shooting, again) - spot) < SAME * np.sqrt(square[k]):
                return chords[k]
        return None

    def _round(self, here: BranchStep, length: float) -> float:
        """Close in on a corner or a sharp turn, or take the branch up behind a corner.

        Returns the length to go on with.
        """
        edge = edge_of(self.shooting, here, length)
        if edge is not here:
            reach = float((edge.point.unknowns - here.point.unknowns) @ here.tangent)
            self._take(here, edge, reach, self._located(here, edge, reach))
            return reach
        way = beyond(self.shooting, here, self.longest)
        if isinstance(way, str):
            self.end = way
        elif self._met(way[0]) is not None:
            self.end = "no cycle beyond"
        else:
            self._name_corner(here, way[0])
            for step in way:
                if not self.low <= step.point.parameter <= self.high:
                    self.end = "the end of the range"
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
        index = len(self.steps) - 1 if onward else len(self.steps)
        self.special.append(Special(name, detail, edge.point.parameter, index))

    def _note_vanishing(self, here: BranchStep, ahead: BranchStep) -> None:
        """Note where the cycle shrinks onto steady slip (amplitude^2 -> 0), if it does.

        There det(1 - return map) vanishes as amplitude^2 does. It keeps its value along cycles that
        only become small with the parameter, as those of stick do with the belt's speed.
        """
        if self.shooting.clock is not None:
            return
        one, two = (swing(self.shooting, step.cycle) for step in (here, ahead))
        if two >= one or two > VANISHED * self.largest:
            return
        if abs(ahead.determinant) * one > abs(here.determinant) * two:
            return
        a, b = here.point.parameter, ahead.point.parameter
        at = b - two**2 * (b - a) / (two**2 - one**2)
        detail = "the cycle shrinks onto steady slip"
        self.special.append(Special("hopf", detail, at, len(self.steps) - 1))
        self.end = "a Hopf point"
