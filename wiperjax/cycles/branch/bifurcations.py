"""What can happen to a cycle along a branch: multipliers that cross, and events that change.

Where the events keep their order the return map is smooth, and a test function changes its sign.
Where they change it has a corner, named by what comes or goes.
"""

from collections import Counter
from collections.abc import Callable
from difflib import SequenceMatcher
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from ..cycle import Cycle, ring, rotations
from ..orbit import phases
from .step import BranchStep

ALIKE = 1e-2  # of the range of a state: how near the two halves of a cycle are at its doubling
TWICE = 1e-6  # of it: how near they are where a cycle is passed twice all along
BRIEF = 8  # shortest phases of a cycle: those that may have begun at a corner
CROSSING = 2e-3  # of a step's unit: how far off the crossing of two branches may be located

KEPT = 0.1  # of a change of the amplitude: a determinant that changes by less keeps its value

Located = list[tuple[float, str, str, BranchStep]]  # distance, kind, detail, step of special points


class Special(NamedTuple):
    """A special point of a branch."""

    kind: str
    detail: str  # what changes
    parameter: float
    index: int  # of the branch's point there, or of the last one before a corner


def _crossed(step: BranchStep) -> float:
    """Zero where another branch crosses; at a fold alone both numbers vanish at the same rate."""
    return step.determinant / (step.sense or np.nan)


def _minus_one(step: BranchStep) -> float:
    """Zero where a multiplier is -1."""
    values = step.cycle.multipliers
    assert values is not None
    return float(np.real(np.prod(1 + values)))


def _products(step: BranchStep) -> float:
    """Zero where two multipliers have the product 1."""
    values = step.cycle.multipliers
    assert values is not None
    pairs = [a * b - 1 for i, a in enumerate(values) for b in values[i + 1 :]]
    return float(np.real(np.prod(pairs))) if pairs else np.nan


def halves_apart(cycle: Cycle, begin: int = 0) -> np.ndarray:
    """How far the state half of a period after a sample is from it, of its ranges, (2n,)."""
    assert cycle.motion is not None
    states = cycle.motion.samples[:-1]
    half, size = (begin + len(states) // 2) % len(states), np.ptp(states, axis=0)
    apart = states[half] - states[begin]
    return np.divide(apart, size, out=np.zeros_like(apart), where=size > 0)


def doubled(cycle: Cycle, alike: float = ALIKE) -> bool:
    """Whether a cycle is one of half its period, passed twice."""
    return bool(np.all(np.abs(halves_apart(cycle)) <= alike))


def exchanged(begun: Cycle, here: BranchStep, ahead: BranchStep) -> bool:
    """Whether halves of cycles change places from ``here`` to the step taken from there: a doubling
    lies between them.

    At a fold of cycles whose halves are merely alike they do not; of a branch that has ``begun`` on
    a cycle passed twice all are, so that only rounding tells their halves apart.
    """
    before, after = halves_apart(here.cycle, here.begin), halves_apart(ahead.cycle)
    return not doubled(begun, TWICE) and bool(before @ after < 0)


def turning(cycle: Cycle) -> bool:
    """Whether a complex pair lies on the unit circle."""
    values = cycle.multipliers
    assert values is not None
    return bool(np.any((np.abs(np.abs(values) - 1) < 1e-4) & (np.abs(np.imag(values)) > 1e-6)))


def onto_stop(here: BranchStep, ahead: BranchStep, change: float) -> bool:
    """Whether a cycle of slip and blows alone, whose amplitude changes by the part ``change``,
    keeps its determinant: all its speeds shrink alike, onto steady slip that comes to the stop (a
    boundary equilibrium: di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008). Where stick is, they shrink with the belt's speed.
    """
    if "blow" not in ahead.cycle.word.split() or ahead.cycle.stick_fraction > 0:
        return False
    return abs(ahead.determinant / here.determinant - 1) < KEPT * change


TESTS: tuple[tuple[str, str, Callable[[BranchStep], float]], ...] = (
    ("fold", "the branch turns back", lambda step: step.sense),
    ("branch_point", "another branch crosses", _crossed),
    ("period_doubling", "a multiplier passes -1", _minus_one),
    ("neimark_sacker", "a complex pair passes the unit circle", _products),
)


def told_once(found: Located) -> Located:
    """Return ``found`` with a fold and a branch point that are one as a branch point alone.

    There the branch itself turns: no cycles merge. Two cycles on crossing branches are told apart
    as the cube root of what a return map is closed to; the turn of the parameter is told best.
    """
    folds, points = ([i for i in found if i[1] == kind] for kind in ("fold", "branch_point"))
    for fold, point in product(folds, points):
        if abs(fold[0] - point[0]) < CROSSING:
            one = (fold[0], *point[1:3], fold[3])
            return [one if item is fold else item for item in found if item is not point]
    return found


def change(cycle: Cycle, word: str) -> str:
    """Return what separates two words of events, as text: ``-kink x2 +capture``.

    Empty if only the regimes between the events are others.
    """
    before = cycle.word.split()
    after, codes = _compared(before, word.split())
    parts: Counter[str] = Counter()
    for a, b, c, d in codes:
        parts.update([f"-{name}" for name in before[a:b]] + [f"+{name}" for name in after[c:d]])
    return " ".join(f"{part} x{n}" if n > 1 else part for part, n in parts.items())


def _compared(before: list[str], after: list[str]):
    """Return ``after``, turned to agree with ``before``, and where they differ: (a, b, c, d) for
    ``before[a:b]``, which is ``turned[c:d]`` there.
    """

    def matcher(turned):
        return SequenceMatcher(None, before, turned, autojunk=False)

    def alike(turned):
        return sum(block.size for block in matcher(turned).get_matching_blocks())

    turned = max(rotations(after), key=alike)
    codes = matcher(turned).get_opcodes()
    return turned, [tuple(places) for deed, *places in codes if deed != "equal"]


def corner_kind(one: Cycle, two: Cycle) -> str:
    """Return the name of the change between the words of two neighbouring cycles.

    The four sliding bifurcations after di Bernardo, Kowalczyk and Nordmark (2002): what they call
    sliding is stick here. ``grazing`` is a contact or an impact that begins with zero speed;
    ``shoulder`` a passage over a corner of the forces, that comes, goes or passes another event.
    """
    short, long = sorted((one, two), key=lambda c: (len(_of_contact(c)), len(ring(c.regimes))))
    before, after = _of_contact(short), _of_contact(long)
    regimes, moved = _compared(ring(short.regimes), ring(long.regimes))
    if before in rotations(after) and not moved:
        return "shoulder"
    turned, codes = _compared(before, after)
    names = {name for a, b, c, d in codes for name in before[a:b] + turned[c:d]}
    if names & {"lift_off", "impact", "zeno", "touch", "blow"}:
        return "grazing"
    brief = _begun(short, long)
    if brief is not None:
        return _sliding([brief[1]], brief[0], brief[2])
    for _, _, c, d in moved:
        if c < d:
            return _sliding(regimes[c:d], regimes[c - 1], regimes[d % len(regimes)])
    return "grazing_sliding" if "capture" in names else "crossing_sliding"


def _sliding(inner: list[str], left: str, right: str) -> str:
    """Return the name of the corner at which ``inner`` begins between two regimes."""
    if "stick" in inner:
        return "grazing_sliding" if left == right else "crossing_sliding"
    return "switching_sliding" if "stick" in (left, right) and left != right else "adding_sliding"


def _begun(short: Cycle, long: Cycle) -> tuple[str, str, str] | None:
    """Return the phase of ``long`` that is not in ``short``, between its neighbours: the shortest
    without which, or without two of which, the regimes are the same.

    The order of regimes alone does not tell stick that begins in slip from slip that begins in
    stick, where both are there already.
    """
    if long.motion is None or not long.regimes:
        return None
    names, lasts = phases(long.motion)
    left = rotations(ring(short.regimes))
    order = [int(k) for k in np.argsort(lasts)[:BRIEF]]
    gone = sorted(
        (g for n in (1, 2) for g in combinations(order, n)), key=lambda g: sum(lasts[[*g]])
    )
    for places in gone:
        kept = [name for k, name in enumerate(names) if k not in places]
        kept = [name for k, name in enumerate(kept) if k == 0 or name != kept[k - 1]]
        if ring(" ".join(kept)) in left:
            k = places[0]
            return names[k - 1], names[k], names[(k + 1) % len(names)]
    return None


def _of_contact(cycle: Cycle) -> list[str]:
    """Events of a cycle at which the contact changes: those of the forces and the belt left out."""
    return [n for n in cycle.word.split() if n not in ("kink", "belt_kink", "belt_reversal")]
