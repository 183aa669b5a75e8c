"""Periodic motion by shooting: the limit cycle that a simulation settles on, and its multipliers.

A cycle is a fixed point of the return map: z(T; z0) = z0. Newton's method on it takes the exact
monodromy matrix, the derivative of the motion through all its events (`shooting`).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from ..contact.system import AbstractSystem
from ..datasets.branch_dataset import EXACT
from ..systems import numbers
from .first_guess import moving
from .orbit import slip_margin, words
from .return_map import Found, Point, Shooting, corrected
from .shooting import UNKNOWN, Arc, Lost

ISOLATED = 1e-6  # distance of a multiplier from 1
NEUTRAL = 1e-9  # of a multiplier within the unit circle: less is rounding
TOLD = 1e-6  # of the size of the motion: how closely a cycle is known that is isolated


@dataclass(frozen=True, eq=False)  # arrays have no one answer to ==
class Cycle:
    """A periodic motion of ``system``. SI units (the system's own); NaN where none was found.

    ``multipliers`` are the eigenvalues of the return map, complex, largest first; the trivial one
    along the orbit (steady belt) is left out, so there are 2 n - 1 of them, and 2 n with a clock.
    A zero is not rounding but a loss of memory: a phase of stick, or of contact, keeps nothing of
    what it does not hold. ``trivial_error`` is by how much the trivial one misses 1: what the
    multipliers are worth.
    """

    system: AbstractSystem
    found: Found
    why: str = ""  # more on a failure; of a found cycle, how little its multipliers are known
    period: float = math.nan
    state: np.ndarray | None = None  # (2n,): position and q' at the start
    phase: float = 0.0  # of the start, in periods of the clock
    regime: int = UNKNOWN  # `Regime` there
    multipliers: np.ndarray | None = None
    trivial_error: float = math.nan
    residual: float = math.nan  # of the return map, of the size of the motion; also if not closed
    word: str = ""  # events of a period, in order
    regimes: str = ""  # regimes of a period, in order
    maximum: float = math.nan  # of the first coordinate
    minimum: float = math.nan
    velocity_rms: float = math.nan  # of the system's output about its mean, over a period
    stick_fraction: float = math.nan
    flight_fraction: float = math.nan
    normal_force_max: float = math.nan
    slip_margin: float = math.nan  # smallest slip speed inside a slip phase: 0 where stick begins
    motion: Arc | None = field(default=None, repr=False)  # one period, sampled
    shooting: Shooting | None = field(default=None, repr=False)

    @property
    def amplitude(self) -> float:
        """Half the range of the first coordinate."""
        return 0.5 * (self.maximum - self.minimum)

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle, by more than rounding: those of a
        system that loses nothing lie on it."""
        if self.multipliers is None:
            return False
        return bool(np.all(np.abs(self.multipliers) < 1 - NEUTRAL))


def shooting_of(cycle: Cycle) -> Shooting:
    """Return the family of a found cycle. Raises ValueError for any other."""
    if cycle.shooting is None or cycle.found != Found.FOUND:
        raise ValueError(f"cycle must be a found one, but was {cycle.found.name.lower()}")
    return cycle.shooting


def close(shooting: Shooting, state, regime: int, period: float, phase: float = 0.0) -> Cycle:
    """Return the cycle near ``state``, in ``regime`` at ``phase``, by Newton's method."""
    parameter = 0.0 if shooting.over is None else numbers.value(shooting.system, shooting.over)
    shooting = replace(shooting, period_scale=period)
    try:
        where = shooting.chart(shooting.system, state, phase * period, regime)
        guess = shooting.unknowns(where, period, parameter / shooting.parameter_scale)
        point = corrected(shooting, where, phase, guess)
    except Lost as lost:
        known = {"why": str(lost), "residual": lost.residual, "shooting": shooting}
        return Cycle(shooting.system, Found.NOT_CONVERGED, **known)
    if not np.any(moving(point.motion.samples, typical(shooting.system, len(where.origin) // 2))):
        return Cycle(shooting.system, Found.AT_REST, shooting=shooting)
    return cycle_at(shooting, point)


def cycle_at(shooting: Shooting, point: Point) -> Cycle:
    """Return everything that is known of the cycle of a `Point`."""
    motion, where = point.motion, point.where
    n = len(where.origin) // 2
    monodromy = where.read(motion.by_state @ where.wide)
    trivial = math.nan
    if shooting.clock is None:
        flow = where.read(motion.by_period)
        trivial = float(np.linalg.norm(monodromy @ flow - flow) / np.linalg.norm(flow))
        across = scipy.linalg.null_space(flow[None])  # not the section, which may touch the flow
        monodromy = across.T @ monodromy @ across
    values = np.zeros(2 * n - (shooting.clock is None), complex)
    found = np.linalg.eigvals(monodromy)
    # a stick makes the map singular; its zero is rounded, on each machine otherwise
    rounding = len(monodromy) * np.finfo(float).eps * np.linalg.norm(monodromy)
    values[: len(monodromy)] = np.where(np.abs(found) > rounding, found, 0.0)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    apart = np.min(np.abs(values - 1))
    # a root lies residual / apart away: a creep to a family of cycles closes, but nowhere near one
    isolated = apart > ISOLATED and point.residual < TOLD * apart
    why = ""
    if not isolated:
        why = f"a multiplier is {apart:.0e} from 1, and it closes to {point.residual:.0e} only"
    elif trivial > EXACT:
        why = f"its multipliers are known to {trivial:.0e} only: a corner in a law or a force?"
    totals, period = motion.totals, point.period
    word, regimes = words(motion)
    return Cycle(
        system=shooting.at(point.parameter),
        found=Found.FOUND if isolated else Found.NOT_ISOLATED,
        why=why,
        period=period,
        state=motion.samples[0],
        phase=point.phase,
        regime=int(motion.regimes[0]),
        multipliers=values,
        trivial_error=trivial,
        residual=point.residual,
        word=word,
        regimes=regimes,
        maximum=float(motion.highest),
        minimum=float(motion.lowest),
        velocity_rms=float(totals.deviation(period)),
        stick_fraction=float(totals.stick_time) / period,
        flight_fraction=float(totals.flight_time) / period,
        normal_force_max=float(totals.normal_force_max),
        slip_margin=slip_margin(motion),
        motion=motion,
        shooting=replace(shooting, section=where.section),
    )


def typical(system, n: int) -> np.ndarray:
    """Typical sizes of a state, (2n,)."""
    return np.concatenate([np.asarray(s, float) for s in system.scales(n)])


def same_word(a: Cycle, b: Cycle) -> bool:
    """Whether two cycles pass the same events and regimes in one order, wherever they start.

    Where a belt reverses nothing happens: that may come before or after another event.
    """
    words = ([n for n in c.word.split() if n != "belt_reversal"] for c in (a, b))
    pairs = tuple(words), (ring(a.regimes), ring(b.regimes))
    return all(one in rotations(two) for one, two in pairs)


def ring(regimes: str) -> list[str]:
    """Regimes of a period without the last one, if that is the first one gone on."""
    names = regimes.split()
    return names[:-1] if len(names) > 1 and names[0] == names[-1] else names


def rotations(names: list[str]) -> list[list[str]]:
    """``names`` as they read from wherever one begins."""
    return [names[k:] + names[:k] for k in range(max(1, len(names)))]
