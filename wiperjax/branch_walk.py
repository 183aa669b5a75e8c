"""The walk along a branch in one direction: its steps, its special points, and why it ended.

Where the event word changes, the place is closed in from the smooth side by bisection, and the
branch taken up again on the other side with the derivatives that hold there.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.optimize

from .bifurcations import TESTS, Special, change, corner_kind, same_word, turning
from .branch_step import Step, ahead_of, at_border, centred, direction
from .orbit import words
from .return_map import Lost, Shooting

LOCATED = 1e-7  # of a step's unit: how closely a special point is closed in
VANISHED = 0.01  # of the largest amplitude: the cycle shrinks onto steady slip


class Walk:
    """One direction of a branch: steps, special points, and why it ended."""

    def __init__(self, shooting, low, high, step, most, sense):
        self.shooting: Shooting = shooting
        self.low, self.high, self.longest, self.most = low, high, step, most
        self.sense = sense
        self.special: list[Special] = []
        self.end = ""
        self.count = 0
        self.largest = 0.0

    def run(self, first: Step) -> Iterator[Step]:
        """Yield the steps after ``first``."""
        tangent = first.tangent * (1.0 if first.sense * self.sense >= 0 else -1.0)
        here = replace(first, tangent=tangent, sense=float(tangent[-1]))
        self.largest = here.cycle.amplitude
        length = 0.3 * self.longest
        while self.count < self.most:
            here = centred(self.shooting, here)
            length = min(length, self._room(here))
            ahead = ahead_of(self.shooting, here, length)
            if ahead is not None and same_word(here.cycle, ahead.cycle):
                turn = float(direction(self.shooting, here) @ direction(self.shooting, ahead))
                if turn < 0.8 and length > 1e-3 * self.longest:
                    length *= 0.5
                    continue
                for point in self._located(here, ahead, length):
                    yield self._counted(point)
                length = min(self.longest, length * (1.4 if turn > 0.98 else 1.0))
            elif ahead is None and length > 1e-2 * self.longest:
                length *= 0.5
                continue
            else:  # the word changes within this step, or there is nothing beyond
                edge, ahead = self._corner(here, length, ahead)
                if edge is not here:
                    yield self._counted(edge)
                if ahead is None:
                    ahead = self._beyond(edge)
                if ahead is None:
                    return
                self._name_corner(edge, ahead)
                length = 0.1 * self.longest
            outside = not self.low <= ahead.point.parameter <= self.high
            if outside:
                border = self.low if ahead.point.parameter < self.low else self.high
                ahead = at_border(self.shooting, here, ahead, border) or ahead
            yield self._counted(ahead)
            self.largest = max(self.largest, ahead.cycle.amplitude)
            if outside:
                self.end = "the end of the range"
                return
            if self._vanishes(here, ahead):
                return
            here = ahead
        self.end = f"{self.most} points"

    def _counted(self, step: Step) -> Step:
        self.count += 1
        return step

    def _room(self, here: Step) -> float:
        """Longest step: no longer than a part of the amplitude, where that vanishes."""
        if self.shooting.clock is not None:
            return self.longest
        return min(self.longest, 0.3 * here.cycle.amplitude / self.shooting.scale[0])

    def _located(self, here: Step, ahead: Step, length: float) -> list[Step]:
        """Return the special points between two steps of one word, in order."""
        found: list[tuple[float, str, str, Step]] = []
        for kind, detail, test in TESTS:
            a, b = test(here), test(ahead)
            if not (np.isfinite(a) and np.isfinite(b)) or a * b >= 0:
                continue
            kept: dict[float, Step] = {0.0: here, length: ahead}

            def value(distance, test=test, kept=kept):
                if distance not in kept:
                    step = ahead_of(self.shooting, here, distance)
                    if step is None:
                        raise Lost("no cycle on the way to a special point")
                    kept[distance] = step
                return test(kept[distance])

            try:
                root = float(scipy.optimize.brentq(value, 0.0, length, xtol=LOCATED))  # type: ignore[arg-type]
            except Lost:
                continue
            if kind == "neimark_sacker" and not turning(kept[root].cycle):
                continue  # a product of two real multipliers passes 1: nothing happens
            found.append((root, kind, detail, kept[root]))
        found.sort(key=lambda item: item[0])
        for place, (_, kind, detail, step) in enumerate(found):
            where = self.count + place
            self.special.append(Special(kind, detail, step.point.parameter, where))
        return [item[3] for item in found]

    def _corner(self, here: Step, length: float, ahead: Step | None):
        """Return (last step of this word, first step beyond or None) by bisection."""
        edge, low, high = here, 0.0, length
        while high - low > LOCATED:
            middle = 0.5 * (low + high)
            step = ahead_of(self.shooting, here, middle)
            if step is not None and same_word(here.cycle, step.cycle):
                edge, low = step, middle
            else:
                high, ahead = middle, step or ahead
                if step is None:
                    ahead = None
        return edge, ahead

    def _beyond(self, edge: Step) -> Step | None:
        """Take the branch up on the other side of a corner on which it turns; None at its end.

        A motion a little further along the tangent, closed or not, has the new word: its
        derivatives give the tangent there, and one of its two senses leads away.
        """
        shooting = self.shooting
        edge = centred(shooting, edge)
        where, phase = edge.point.where, edge.point.phase
        d = where.basis.shape[1]
        for size in (1e-4, 1e-3, 1e-2):
            u = edge.point.unknowns + size * edge.tangent
            period = float(u[d] * shooting.period_scale) if shooting.clock is None else math.nan
            try:
                parameter = u[-1] * shooting.parameter_scale
                _, jacobian, motion = shooting.returned(where, phase, u[:d], period, parameter)
            except Lost as lost:
                self.end = str(lost)
                continue
            word, regimes = words(motion)
            if same_word(edge.cycle, replace(edge.cycle, word=word, regimes=regimes)):
                self.end = "no cycle beyond"
                continue
            tangent = np.linalg.svd(jacobian)[2][-1]
            for along in (tangent, -tangent):
                for length in (size, 10 * size):
                    step = ahead_of(shooting, edge, length, along)
                    if step is not None and not same_word(edge.cycle, step.cycle):
                        return step
            self.end = f"the events change ({change(edge.cycle, word)}), no cycle beyond"
        return None

    def _name_corner(self, edge: Step, ahead: Step) -> None:
        kind = corner_kind(edge.cycle, ahead.cycle)
        turns = edge.sense * ahead.sense < 0
        detail = change(edge.cycle, ahead.cycle.word)
        if self.special:  # to and fro over one corner, closer than it is located: nothing happened
            last = self.special[-1]
            undone = sorted(detail.translate(str.maketrans("+-", "-+")).split())
            near = abs(last.parameter - edge.point.parameter) < 1e-5 * self.shooting.parameter_scale
            if near and sorted(last.detail.split()) == undone:
                self.special.pop()
                return
        name = f"{kind}_fold" if turns else kind
        where = self.count - 1
        self.special.append(Special(name, detail, edge.point.parameter, max(where, 0)))

    def _vanishes(self, here: Step, ahead: Step) -> bool:
        """Whether the cycle has shrunk onto steady slip; then notes where (amplitude^2 -> 0)."""
        if self.shooting.clock is not None:
            return False
        one, two = here.cycle.amplitude, ahead.cycle.amplitude
        if two >= one or two > VANISHED * self.largest:
            return False
        a, b = here.point.parameter, ahead.point.parameter
        at = b - two**2 * (b - a) / (two**2 - one**2)
        self.special.append(
            Special("hopf", "the cycle shrinks onto steady slip", at, self.count - 1)
        )
        self.end = "a Hopf point"
        return True
