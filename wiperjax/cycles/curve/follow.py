"""From the special points of a branch to curves in the plane of two parameters."""

from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from ...contact.guards import starting_sides
from ...contact.system import AbstractSystem
from ...systems import numbers
from ...vocabulary import checks
from ...vocabulary.codes import CurveEnd
from ...vocabulary.ranges import FINITE, Range
from ..branch.bifurcations import Special
from ..branch.follow import MOST_POINTS, Branch
from ..chart import chart
from ..clock import check_clock, refuse_a_clock, scattered
from ..cycle import Cycle, same_word, typical
from ..return_map import Shooting
from ..shooting import SAMPLES, Lost, at_state
from ..walk import both_ways
from .equations import Equations, Facts, solve
from .fold import Fold
from .hopf import Hopf
from .plane import Plane
from .touch import AWAY, Touch, fastest
from .walk import Mark, Walk

KINDS = (Hopf.kind, Fold.kind, Touch.kind)
SEEN = 1e-3  # of the ranges: how near to a curve a special point lies that is on it
PARTS = 16  # of a chord between two points of a curve, which is bent
ALIKE = 0.05  # of the size of the motion, and of its period: how near its cycle is to one there


@dataclass(frozen=True, eq=False)  # arrays have no one answer to ==
class Curve:
    """A curve in order: its points in the plane, special points, and why either end is one."""

    kind: str
    system: AbstractSystem
    names: tuple[str, str]
    places: np.ndarray = field(repr=False)  # (points, 2), SI
    facts: list[Facts] = field(repr=False)  # at each point
    special: list[Mark]
    ends: tuple[tuple[CurveEnd, str], tuple[CurveEnd, str]]


def follow_curves(
    branch: Branch, second: str, low: float, high: float, *, step: float = 0.05, most: int = 200
) -> list[Curve]:
    """Return the curves on which the Hopf points and folds of ``branch`` lie in two parameters.

    **Main arguments:** ``branch`` of `follow`; ``second``, name of another number of its system,
    and the ends of its range (SI units, radians), which hold the system's own value. The first
    parameter stays within the range of the branch.

    **Other arguments:** ``step``, largest distance of neighbouring points (1 is a range, or the
    size of the starting cycle, or its period); ``most``, points in either direction.

    **Returns** one `Curve` for each ``hopf``, ``fold`` and ``..._fold`` in ``branch.special``; two
    that lie on one curve give it once. Where one can not be followed, or not on, its ends say so.
    Over a number named as a variable of branches (``amplitude``) they make no `curves_dataset`:
    rename that first.

    Raises ValueError for arguments that cannot be meant.
    """
    checks.instance("branch", branch, Branch, "a branch of follow(...)")
    low, high = (checks.number(n, x, FINITE) for n, x in (("low", low), ("high", high)))
    step = checks.number("step", step, Range(1e-6, 1))
    most = checks.whole("most", most, Range(1, MOST_POINTS, whole=True))
    shooting = branch.cycles[0].shooting
    assert shooting is not None
    if numbers.path(shooting.system, second) == numbers.path(shooting.system, branch.over):
        raise ValueError(f"second must not be {branch.over}, which the branch is over")
    own = numbers.value(shooting.system, second)
    if not low <= own <= high or low == high:
        raise ValueError(
            f"low to high must hold the system's own value {own:g} of {second}, "
            f"but was {low:g} to {high:g}"
        )
    ranges = {branch.over: branch.bounds, second: (low, high)}
    numbers.check_corners("low to high", shooting.system, ranges)
    system = numbers.traceable(shooting.system, branch.over, second)
    shooting = replace(shooting, system=system)
    _check_drive(branch.cycles[0], shooting, second)
    bounds = np.array([*ranges.values()])
    plane = Plane(system, (branch.over, second), bounds[:, 0], bounds[:, 1])
    found: list[Curve] = []
    for special in branch.special:
        if special.kind != Hopf.kind and not special.kind.endswith("fold"):
            continue
        place, cycle = np.array([special.parameter, own]), branch.cycles[special.index]
        if not any(_on(curve, special.kind, place, cycle, plane, shooting) for curve in found):
            found.append(_curve(branch, special, plane, shooting, place, step, most))
    return found


def _check_drive(cycle: Cycle, shooting: Shooting, second: str) -> None:
    """Raises ValueError where ``second`` changes the period of what drives the system, and the
    cycles' one stays as it was, or where it has it driven: the branch did not ask that."""
    assert cycle.motion is not None
    states = cycle.motion.samples[scattered(SAMPLES)]
    if shooting.clock is not None:
        check_clock(shooting.system, shooting.clock, (second,), states)
    else:
        refuse_a_clock(shooting.system, states, cycle.period, (second,))


def _on(
    curve: Curve, kind: str, place: np.ndarray, cycle: Cycle, plane: Plane, shooting: Shooting
) -> bool:
    """Whether a special point lies on a curve that was followed from another one: not only its
    parameters, but its cycle too, for curves of other cycles cross there.
    """
    if curve.kind != kind or len(curve.places) < 2:
        return False
    sizes = shooting.scale[0], shooting.period_scale
    alike = np.array([(f.amplitude, f.period) for f in curve.facts]) / sizes
    spots, spot = curve.places / plane.scale, place / plane.scale
    like = np.divide((cycle.amplitude, cycle.period), sizes)
    # beside a corner a spline swings, and chords are the curve
    return any(_beside(spot, like, *way) for way in ((spots, alike), _finer(spots, alike)))


def _beside(spot: np.ndarray, like: np.ndarray, spots: np.ndarray, alike: np.ndarray) -> bool:
    """Whether ``spot`` lies on the chords through ``spots``, with the cycle that is there."""
    chords = np.diff(spots, axis=0)
    offset = spot - spots[:-1]
    part = np.sum(offset * chords, axis=1) / np.maximum(np.sum(chords**2, axis=1), 1e-30)
    part = np.clip(part, 0, 1)[:, None]
    aside = np.linalg.norm(offset - part * chords, axis=1)
    there = alike[:-1] + part * np.diff(alike, axis=0)
    off = np.max(np.abs(like - there), axis=1)
    return bool(np.any((aside < SEEN) & (off < ALIKE)))


def _finer(spots: np.ndarray, alike: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return more places on a bent curve through ``spots`` (points, 2), and ``alike`` there: its
    chords run by it at a distance of an eighth of their square over its radius."""
    far = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(spots, axis=0), axis=1)))
    distances, kept = np.unique(far, return_index=True)  # a special point may be there twice
    if len(kept) < 2:
        return spots, alike
    at = np.interp(np.arange(PARTS * (len(kept) - 1) + 1) / PARTS, np.arange(len(kept)), distances)
    between = [np.interp(at, distances, column) for column in alike[kept].T]
    return CubicSpline(distances, spots[kept])(at), np.stack(between, axis=1)


def _curve(
    branch: Branch,
    special: Special,
    plane: Plane,
    shooting: Shooting,
    place: np.ndarray,
    step: float,
    most: int,
) -> Curve:
    """Return the curve through one special point, both ways."""
    first = None
    try:
        equations = _seed(branch, special, plane, shooting, place)
        if equations is not None:
            first = solve(equations, equations.start, np.eye(len(equations.start))[-1])
            if first is not None:  # once more, by its own measures
                equations = first.equations.centred(first.facts, first.place)
                first = solve(equations, equations.start, np.eye(len(equations.start))[-1])
            if first is not None:
                _ = first.meant  # raises `Lost`
    except Lost:
        first = None  # it is said below
    if first is None:
        words = special.kind.replace("_", " ")
        detail = f"no solution of the {words} was found near the branch's"
        if special.kind not in KINDS:
            detail = f"curves of {words}s are not followed"
        cycle = branch.cycles[special.index]
        assert cycle.state is not None
        facts = Facts(cycle.state, cycle.amplitude, cycle.period, {}, cycle)
        ends = (CurveEnd.FAILED, detail)
        return Curve(
            special.kind, plane.system, plane.names, place[None], [facts], [], (ends, ends)
        )

    def walked(sense: float) -> Walk:
        walk = Walk(step, most)
        walk.run(replace(first, tangent=sense * first.tangent))
        return walk

    found = both_ways(walked)
    spots = [spot.meant for spot in found.points]
    ends = tuple((walk.code, walk.end) for walk in (found.back, found.ahead))
    return Curve(
        special.kind,
        plane.system,
        plane.names,
        np.array([spot.place for spot in spots]),
        [spot.facts for spot in spots],
        found.special,
        ends,  # type: ignore[arg-type]
    )


def _seed(
    branch: Branch, special: Special, plane: Plane, shooting: Shooting, place: np.ndarray
) -> Equations | None:
    """Return the equations around a special point of a branch, or None for other kinds."""
    scale, cycle = plane.scale, branch.cycles[special.index]
    assert cycle.motion is not None
    if special.kind == Hopf.kind:
        samples = cycle.motion.samples[:-1]
        state = np.mean(samples, axis=0)
        state[len(state) // 2 :] = 0.0
        sizes = typical(plane.system, len(state) // 2)
        where = chart(plane.at(place), state, 0.0, cycle.regime, sizes)
        start = np.concatenate([np.zeros(where.basis.shape[1]), place / scale])
        sides = _sides(plane.at(place), state)
        return Hopf(plane, start, where, sides, 2 * np.pi / cycle.period)
    if special.kind not in KINDS:
        return None
    if special.kind == Touch.kind:
        cycle, left = _slipping(branch, special.index)
        place = np.array([numbers.value(cycle.system, branch.over), place[1]])
    period, phase, own = cycle.period, cycle.phase, cycle.shooting
    assert own is not None
    where = own.chart(plane.at(place), cycle.state, phase * period, cycle.regime)
    start = shooting.unknowns(where, period, *(place / scale))
    around = plane, start, shooting, where, phase
    if special.kind == Fold.kind:
        none = np.empty(0)
        return Fold(*around, none, none).bordered()
    # as near to rest as it is, if that is about right: to come nearer may take many corrections
    return Touch(*around, speed=fastest(cycle), left=float(np.clip(left, 0.5 * AWAY, 2 * AWAY)))


def _slipping(branch: Branch, index: int) -> tuple[Cycle, float]:
    """Return the cycle in whose slip the tip rests as nearly as `Touch` wants it, of those that
    lead to a corner behind point ``index`` without the stick that begins there, and its share of
    slip speed.

    Steps begin tiny behind a corner: how many of them there are to such a cycle, no one knows.
    """
    sides = branch.cycles[index::-1], branch.cycles[index + 1 :]
    way = min((side for side in sides if side), key=lambda side: side[0].word.count("capture"))
    found: list[tuple[Cycle, float]] = []
    for cycle in way:
        if not same_word(cycle, way[0]):
            break
        if cycle.slip_margin > 0:
            found.append((cycle, cycle.slip_margin / fastest(cycle)))
            if found[-1][1] > AWAY:
                break
    if not found:
        raise Lost("no slip leads to the corner")
    return min(found, key=lambda item: abs(np.log(item[1] / AWAY)))


def _sides(system: AbstractSystem, state: np.ndarray) -> tuple[float, ...]:
    """Return the signs of the system's switches at a state (2n,)."""
    time = jnp.zeros(())
    local, q, v = at_state(system, time, jnp.asarray(state))
    return tuple(float(side) for side in starting_sides(local, time, q, v))
