"""A cycle followed over a parameter, through folds and changes of its events (pseudo-arclength).

Between two changes of the event word the return map is smooth, and the classical method holds:
predict along the tangent, correct at a prescribed distance. Where the word changes, the map has a
corner, or worse: the branch may turn back on the spot (a stick-slip cycle that meets the slip cycle
on which stick begins). There the place is closed in from the smooth side by bisection, and the
branch taken up again on the other side with the derivatives that hold there (di Bernardo, Budd,
Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, chapters 6 to 8).
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ...systems import numbers
from ...vocabulary import checks
from ...vocabulary.ranges import FINITE, Range
from ..cycle import Cycle, shooting_of
from ..walk import both_ways
from .bifurcations import Special
from .step import first_step, place
from .walk import Walk

MOST_POINTS = 10**6
ROUNDING = 1e-9  # of a range: a cycle so near to its end lies on it


@dataclass(frozen=True, eq=False)  # arrays have no one answer to ==
class Branch:
    """Cycles in order along the branch, its special points, and why either end is one."""

    cycles: list[Cycle] = field(repr=False)
    parameters: np.ndarray = field(repr=False)  # (points,)
    arclength: np.ndarray = field(repr=False)  # (points,) from the start cycle, in scaled numbers
    special: list[Special]
    ends: tuple[str, str]
    over: str
    bounds: tuple[float, float]  # of the parameter


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
    Where a period has more events than are told apart (`shooting.EVENTS`), the walk goes on over a
    change of them without a special point, if the branch does so gently. Over a number that is
    named as a variable of branches (``amplitude``) it makes no `branch_dataset`: rename that first.

    Raises ValueError for a cycle that was not found, is varied over nothing, or outside the range.
    """
    checks.instance("cycle", cycle, Cycle, "a cycle of find_cycle(...)")
    low, high = (checks.number(n, x, FINITE) for n, x in (("low", low), ("high", high)))
    step = checks.number("step", step, Range(1e-6, 1))
    most = checks.whole("most", most, Range(1, MOST_POINTS, whole=True))
    shooting = shooting_of(cycle)
    over = shooting.over
    if over is None:
        raise ValueError("cycle must have been found with over=..., the number to vary")
    if not low < high:
        raise ValueError(f"low must be below high ({high:g}), but was {low:g}")
    own, slack = numbers.value(cycle.system, over), ROUNDING * (high - low)
    if not low - slack <= own <= high + slack:
        raise ValueError(
            f"low to high must hold the cycle's own value {own:g} of {over}, "
            f"but was {low:g} to {high:g}"
        )
    numbers.check_corners("low to high", cycle.system, {over: (low, high)})
    shooting = replace(shooting, parameter_scale=high - low, period_scale=cycle.period)
    first = first_step(shooting, cycle)
    if first is None:
        raise ValueError("cycle could not be closed again from its own state")

    def walked(sense: float) -> Walk:
        walk = Walk(shooting, low, high, step, most, sense)
        walk.run(first)
        return walk

    found = both_ways(walked)
    steps, begin = found.points, found.begin
    far = [np.linalg.norm(place(shooting, a) - place(shooting, b)) for a, b in pairwise(steps)]
    arclength = np.concatenate([[0.0], np.cumsum(far)])
    return Branch(
        cycles=[s.cycle for s in steps],
        parameters=np.array([s.point.parameter for s in steps]),
        arclength=arclength - arclength[begin],
        special=found.special,
        ends=(found.back.end, found.ahead.end),
        over=over,
        bounds=(low, high),
    )
