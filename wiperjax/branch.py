"""A cycle followed over a parameter, through folds and changes of its events (pseudo-arclength).

Between two changes of the event word the return map is smooth, and the classical method holds:
predict along the tangent, correct at a prescribed distance. Where the word changes, the map has a
corner, or worse: the branch may turn back on the spot (a stick-slip cycle that meets the slip cycle
on which stick begins). There the place is closed in from the smooth side by bisection, and the
branch taken up again on the other side with the derivatives that hold there (di Bernardo, Budd,
Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, chapters 6 to 8).
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np
import scipy.optimize

from .cycles import (
    Cycle,
    Found,
    Lost,
    Point,
    Shooting,
    correct,
    cycle_at,
    middle_of_longest,
    smooth_intervals,
    words,
)
from .shooting import Chart, chart, stretch

LOCATED = 1e-7  # of a step's unit: how closely a special point is closed in
SMALLEST = 1e-5  # step at which the branch counts as lost
VANISHED = 0.01  # of the largest amplitude: the cycle shrinks onto steady slip


class Special(NamedTuple):
    """A special point of a branch."""

    kind: str
    detail: str  # what changes
    parameter: float
    index: int  # of the branch's point there


@dataclass(frozen=True)
class Step:
    """A point of the branch with its cycle and the direction of travel."""

    point: Point
    cycle: Cycle
    tangent: np.ndarray  # of the unknowns, in the point's own chart
    sense: float  # derivative of the parameter along the branch


@dataclass(frozen=True)
class Branch:
    """Cycles in order along the branch, its special points, and why either end is one."""

    cycles: list[Cycle]
    parameters: np.ndarray  # (points,)
    arclength: np.ndarray  # (points,) from the start cycle, in scaled numbers
    special: list[Special]
    ends: tuple[str, str]
    over: str


def follow(
    cycle: Cycle,
    low: float,
    high: float,
    *,
    step: float = 0.03,
    most: int = 300,
) -> Branch:
    """Return the branch of cycles through ``cycle`` while its parameter lies in [low, high].

    **Main arguments:** ``cycle`` of `find_cycle(..., over=name)`; the ends of the range of that
    number (SI units, radians).

    **Other arguments:** ``step``, largest distance of neighbouring points (1 is the range of the
    parameter, the size of the starting cycle, or its period); ``most``, points in either direction.

    **Returns** a `Branch`; stable and unstable parts alike, since Newton's method does not mind.

    Raises ValueError for a cycle that was not found, or not varied over anything.
    """
    if cycle.shooting is None or cycle.state is None or cycle.found != Found.FOUND:
        raise ValueError(f"cycle must be a found one, but was {cycle.found.name.lower()}")
    over = cycle.shooting.over
    if over is None:
        raise ValueError("cycle must have been found with over=..., the number to vary")
    if not low < high:
        raise ValueError(f"low must be below high, but they were {low:g} and {high:g}")
    shooting = replace(cycle.shooting, parameter_scale=high - low, period_scale=cycle.period)
    first = _start(shooting, cycle)
    if first is None:
        raise ValueError("cycle could not be closed again from its own state")
    sides, ends = [], []
    for sense in (-1.0, 1.0):
        walk = _Walk(shooting, low, high, step, most, sense)
        sides.append((list(walk.run(first)), walk.special))
        ends.append(walk.end)
    (back, before), (ahead, after) = sides
    steps = [*reversed(back), first, *ahead]
    size = len(back)
    special = [s._replace(index=size - 1 - s.index) for s in reversed(before)]
    special += [s._replace(index=size + 1 + s.index) for s in after]
    far = [_distance(shooting, a, b) for a, b in zip(steps[:-1], steps[1:], strict=True)]
    arclength = np.concatenate([[0.0], np.cumsum(far)])
    return Branch(
        cycles=[s.cycle for s in steps],
        parameters=np.array([s.point.parameter for s in steps]),
        arclength=arclength - arclength[size],
        special=special,
        ends=(ends[0], ends[1]),
        over=over,
    )


def _start(shooting: Shooting, cycle: Cycle) -> Step | None:
    where = _chart(shooting, cycle.system, cycle.state, cycle.phase, cycle.period, cycle.regime)
    parameter = float(np.asarray(_parameter(shooting, cycle))) / shooting.parameter_scale
    unknowns = np.zeros(where.basis.shape[1])
    if shooting.clock is None:
        unknowns = np.append(unknowns, cycle.period / shooting.period_scale)
    point = correct(shooting, where, cycle.phase, np.append(unknowns, parameter))
    return None if point is None else _step(shooting, point, np.eye(len(unknowns) + 1)[-1])


def _parameter(shooting: Shooting, cycle: Cycle):
    from . import named

    assert shooting.over is not None
    return named.value(cycle.system, shooting.over)


def _chart(shooting: Shooting, system, state, phase, period, regime) -> Chart:
    return chart(system, state, phase * period, regime, shooting.scale, shooting.section)


def _step(shooting: Shooting, point: Point, onward) -> Step:
    """Return the step at ``point`` whose tangent goes with ``onward`` (unknowns of its chart)."""
    tangent = np.linalg.svd(point.jacobian)[2][-1]
    if tangent @ onward < 0:
        tangent = -tangent
    return Step(point, cycle_at(shooting, point), tangent, float(tangent[-1]))


def _distance(shooting: Shooting, a: Step, b: Step) -> float:
    return float(np.linalg.norm(_place(shooting, a) - _place(shooting, b)))


def _place(shooting: Shooting, step: Step) -> np.ndarray:
    """State, period and parameter in scaled numbers."""
    state = step.point.motion.samples[0] / shooting.scale
    rest = step.point.period / shooting.period_scale, step.point.parameter
    return np.array([*state, rest[0], rest[1] / shooting.parameter_scale])


def same_word(a: Cycle, b: Cycle) -> bool:
    """Whether two cycles pass the same events in the same order, wherever they start."""
    one = list(zip(a.word.split(), strict=True))
    two = list(zip(b.word.split(), strict=True))
    turned = any(one == two[k:] + two[:k] for k in range(max(1, len(two))))
    return turned and sorted(a.regimes.split()) == sorted(b.regimes.split())


class _Walk:
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
            here = self._centred(here)
            length = min(length, self._room(here))
            ahead = self._ahead(here, length)
            if ahead is not None and same_word(here.cycle, ahead.cycle):
                turn = float(self._full(here) @ self._full(ahead))
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
                ahead = self._at_border(here, ahead) or ahead
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

    # --- one step --------------------------------------------------------------------------------

    def _full(self, step: Step) -> np.ndarray:
        """Unit tangent in scaled state, period and parameter."""
        d = step.point.where.basis.shape[1]
        state = step.point.where.basis @ step.tangent[:d] / self.shooting.scale
        full = np.concatenate([state, step.tangent[d:]])
        return full / np.linalg.norm(full)

    def _room(self, here: Step) -> float:
        """Longest step: no longer than a part of the amplitude, where that vanishes."""
        if self.shooting.clock is not None:
            return self.longest
        return min(self.longest, 0.3 * here.cycle.amplitude / self.shooting.scale[0])

    def _ahead(self, here: Step, length: float, tangent=None) -> Step | None:
        """Return the branch at a distance along the tangent, or None."""
        along = here.tangent if tangent is None else tangent
        guess = here.point.unknowns + length * along
        point = correct(self.shooting, here.point.where, here.point.phase, guess, along)
        if point is None or np.linalg.norm(point.unknowns - guess) > 2 * length + 1e-6:
            return None
        return _step(self.shooting, point, along)

    def _centred(self, here: Step) -> Step:
        """Return the step in the chart of its own state; moved on, if an event comes near it."""
        point = here.point
        d = point.where.basis.shape[1]
        state = point.motion.samples[0]
        shift = point.where.basis @ here.tangent[:d]
        phase, regime = point.phase, point.where.regime
        if self.shooting.clock is not None:
            free = smooth_intervals(point.motion)
            near = max(2, len(free) // 50)
            if not (free[:near].all() and free[-near:].all()):
                index = middle_of_longest(point.motion.regimes[:-1], free)
                moved, state, regime = self._moved(here, index)
                phase = (phase + index / len(free)) % 1.0
                shift = moved
        where = _chart(self.shooting, here.cycle.system, state, phase, point.period, regime)
        read = np.linalg.lstsq(where.basis / where.scale[:, None], shift / where.scale, rcond=None)
        unknowns = np.zeros(where.basis.shape[1])
        tangent = np.concatenate([read[0], here.tangent[d:]])
        point = replace(
            point, where=where, phase=phase, unknowns=np.append(unknowns, point.unknowns[d:])
        )
        return replace(here, point=point, tangent=tangent / np.linalg.norm(tangent))

    def _moved(self, here: Step, index: int):
        """Return (tangent of the state, state, regime) at sample ``index`` of the cycle."""
        point, shooting = here.point, self.shooting
        d = point.where.basis.shape[1]
        slope = shooting.driven_period(point.parameter)[1]
        passed = stretch(
            shooting.at(point.parameter),
            shooting.along(),
            point.motion.samples[0],
            point.period,
            phase=point.phase,
            part=index / (len(point.motion.times) - 1),
            regime=point.where.regime,
            rtol=shooting.rtol,
        )
        change = here.tangent[-1] * shooting.parameter_scale
        tangent = passed.by_state @ (point.where.basis @ here.tangent[:d])
        tangent += (passed.by_parameter + slope * passed.by_period) * change
        return tangent, passed.state, int(point.motion.regimes[index])

    # --- special points --------------------------------------------------------------------------

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
                    step = self._ahead(here, distance)
                    if step is None:
                        raise Lost("no cycle on the way to a special point")
                    kept[distance] = step
                return test(kept[distance])

            try:
                root = float(scipy.optimize.brentq(value, 0.0, length, xtol=LOCATED))  # type: ignore[arg-type]
            except Lost:
                continue
            if kind == "neimark_sacker" and not _turning(kept[root].cycle):
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
            step = self._ahead(here, middle)
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
        edge = self._centred(edge)
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
                    step = self._ahead(edge, length, along)
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

    def _at_border(self, here: Step, ahead: Step) -> Step | None:
        """Return the cycle at the end of the range that the last step has passed."""
        border = self.low if ahead.point.parameter < self.low else self.high
        unknowns = ahead.point.unknowns.copy()
        unknowns[-1] = border / self.shooting.parameter_scale
        point = correct(self.shooting, here.point.where, here.point.phase, unknowns)
        return None if point is None else _step(self.shooting, point, ahead.tangent)

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


# --- what is watched -----------------------------------------------------------------------------


def _determinant(sign: float) -> Callable[[Step], float]:
    def test(step: Step) -> float:
        values = step.cycle.multipliers
        assert values is not None
        return float(np.real(np.prod(values + sign)))

    return test


def _products(step: Step) -> float:
    """Zero where two multipliers have the product 1."""
    values = step.cycle.multipliers
    assert values is not None
    pairs = [a * b - 1 for i, a in enumerate(values) for b in values[i + 1 :]]
    return float(np.real(np.prod(pairs))) if pairs else np.nan


def _turning(cycle: Cycle) -> bool:
    """Whether a complex pair lies on the unit circle."""
    values = cycle.multipliers
    assert values is not None
    return bool(np.any((np.abs(np.abs(values) - 1) < 1e-4) & (np.abs(np.imag(values)) > 1e-6)))


TESTS: tuple[tuple[str, str, Callable[[Step], float]], ...] = (
    ("fold", "the branch turns back", lambda step: step.sense),
    ("period_doubling", "a multiplier passes -1", _determinant(1.0)),
    ("neimark_sacker", "a complex pair passes the unit circle", _products),
)


def change(cycle: Cycle, word: str) -> str:
    """Return what separates two words of events, as text: ``-kink -kink +capture``."""
    before, after = cycle.word.split(), word.split()
    parts = []
    for deed, a, b, c, d in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if deed != "equal":
            parts += [f"-{name}" for name in before[a:b]] + [f"+{name}" for name in after[c:d]]
    return " ".join(parts)


def corner_kind(one: Cycle, two: Cycle) -> str:
    """Return the name of the change between the words of two neighbouring cycles.

    The four sliding bifurcations after di Bernardo, Kowalczyk and Nordmark (2002): what they call
    sliding is stick here. ``grazing`` is a contact or an impact that begins with zero speed;
    ``shoulder`` a smooth passage over a switching function of the system.
    """
    short, long = sorted((one, two), key=lambda c: len(c.word.split()))
    extra = change(short, long.word).split()
    names = {part[1:] for part in extra}
    if names <= {"kink", "belt_kink", "belt_reversal"}:
        return "shoulder"
    if names & {"lift_off", "impact", "zeno", "touch"}:
        return "grazing"
    a, b = short.regimes.split(), long.regimes.split()
    for deed, _, _, k, m in SequenceMatcher(None, a, b, autojunk=False).get_opcodes():
        if deed == "equal" or m == k:
            continue
        inner, left, right = b[k:m], b[k - 1], b[m % len(b)]
        if "stick" in inner:
            return "grazing_sliding" if left == right else "crossing_sliding"
        return (
            "switching_sliding" if "stick" in (left, right) and left != right else "adding_sliding"
        )
    return "grazing_sliding" if "capture" in names else "crossing_sliding"
