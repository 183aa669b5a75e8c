"""One step along a branch of cycles: predict along the tangent, correct at that distance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...systems import numbers
from ..beginning import start_of
from ..cycle import Cycle, cycle_at
from ..return_map import Point, Shooting, correct
from ..roots import root_between

LOCATED = 1e-7  # of a step's unit: how closely a special point is closed in
TOLD = 1e-6  # of a multiplier's distance from 1, and of a tangent: less may be rounding


@dataclass(frozen=True)
class BranchStep:
    """A point of the branch with its cycle and the direction of travel."""

    point: Point
    cycle: Cycle
    tangent: np.ndarray  # of the unknowns, in the point's own chart
    sense: float  # derivative of the parameter along the branch
    begin: int = 0  # sample of the cycle's motion at which the point's chart is

    @property
    def determinant(self) -> float:
        """det(1 - derivative of the return map): its sign is the index of the fixed point."""
        assert self.cycle.multipliers is not None
        return float(np.real(np.prod(1 - self.cycle.multipliers)))

    @property
    def index(self) -> int:
        """Sign of ``determinant`` times ``sense``: +1 or -1, or 0 where that cannot be told.

        All along a branch it is the same, over folds, where both change their sign, and over
        corners: the return map is continuous there, and the index of its fixed points is kept
        (Feigin's rule: di Bernardo, Feigin, Hogan and Homer, Chaos, Solitons & Fractals 10, 1999).
        Only where another branch crosses does it change; else the walk has jumped to another arm.
        """
        if abs(self.determinant) < TOLD or abs(self.sense) < TOLD:
            return 0
        return int(np.sign(self.determinant * self.sense))


Reached = tuple[float, BranchStep]  # distance from the step where one stands, and the step there


def first_step(shooting: Shooting, cycle: Cycle) -> BranchStep | None:
    """Return the step at a found cycle, or None if it cannot be closed again."""
    assert shooting.over is not None
    where = shooting.chart(cycle.system, cycle.state, cycle.phase * cycle.period, cycle.regime)
    parameter = numbers.value(cycle.system, shooting.over) / shooting.parameter_scale
    unknowns = shooting.unknowns(where, cycle.period, parameter)
    point = correct(shooting, where, cycle.phase, unknowns)
    return None if point is None else step_at(shooting, point, np.eye(len(unknowns))[-1])


def step_at(shooting: Shooting, point: Point, onward) -> BranchStep:
    """Return the step at ``point`` whose tangent goes with ``onward`` (unknowns of its chart)."""
    tangent = np.linalg.svd(point.jacobian)[2][-1]
    if tangent @ onward < 0:
        tangent = -tangent
    return BranchStep(point, cycle_at(shooting, point), tangent, float(tangent[-1]))


def place(shooting: Shooting, step: BranchStep) -> np.ndarray:
    """Where the cycle is, wherever it starts, in scaled numbers.

    The first coordinate's extremes; mean and deviation of the others, which samples tell better;
    period and parameter.
    """
    cycle, motion = step.cycle, step.point.motion
    n = len(shooting.scale) // 2
    others = motion.samples[:-1, 1:n] / shooting.scale[1:n]
    first = np.array([cycle.maximum, cycle.minimum]) / shooting.scale[0]
    rest = cycle.period / shooting.period_scale, step.point.parameter / shooting.parameter_scale
    return np.concatenate([first, np.mean(others, axis=0), np.std(others, axis=0), rest])


def swing(shooting: Shooting, cycle: Cycle) -> float:
    """Half the range of the coordinate that swings most, in scaled numbers."""
    assert cycle.motion is not None
    n = len(shooting.scale) // 2
    half = 0.5 * np.ptp(cycle.motion.samples[:, :n], axis=0)
    half[0] = cycle.amplitude  # known between samples, too
    return float(np.max(half / shooting.scale[:n]))


def direction(shooting: Shooting, step: BranchStep) -> np.ndarray:
    """Unit tangent in scaled state, period and parameter."""
    d = step.point.where.basis.shape[1]
    state = step.point.where.basis @ step.tangent[:d] / shooting.scale
    full = np.concatenate([state, step.tangent[d:]])
    return full / np.linalg.norm(full)


def ahead_of(shooting: Shooting, here: BranchStep, length: float) -> BranchStep | None:
    """Return the branch at a distance along the tangent, or None."""
    return near(shooting, here, here.point.unknowns + length * here.tangent, here.tangent)


def near(
    shooting: Shooting, here: BranchStep, guess: np.ndarray, along: np.ndarray
) -> BranchStep | None:
    """Return the branch that goes ``along`` near ``guess`` (both in the chart of ``here``)."""
    point = correct(shooting, here.point.where, here.point.phase, guess, along)
    far = np.linalg.norm(guess - here.point.unknowns)
    if point is None or np.linalg.norm(point.unknowns - guess) > 2 * far + 1e-6:
        return None
    if not np.any(point.motion.by_period) and shooting.clock is None:
        return None  # a state of rest closes, too
    return step_at(shooting, point, along)


def between(
    shooting: Shooting,
    here: BranchStep,
    ends: tuple[Reached, Reached],
    test: Callable[[BranchStep], float],
) -> Reached | None:
    """Return (distance, step) at which ``test`` vanishes between two steps ahead of ``here``."""
    return root_between(lambda far: ahead_of(shooting, here, far), dict(ends), test, LOCATED)


def centred(shooting: Shooting, here: BranchStep) -> BranchStep:
    """Return the step in the chart of its own state; moved on, if that serves no longer."""
    point = here.point
    d = point.where.basis.shape[1]
    start = start_of(shooting, point.where, point.phase, point.motion)
    shift = point.where.basis @ here.tangent[:d]
    if start.index:
        shift = _shifted(shooting, here, start.index)
    where = start.chart(shooting, here.cycle.system, point.period)
    read = np.linalg.lstsq(where.basis / where.scale[:, None], shift / where.scale, rcond=None)
    unknowns = np.zeros(where.basis.shape[1])
    tangent = np.concatenate([read[0], here.tangent[d:]])
    point = replace(
        point, where=where, phase=start.phase, unknowns=np.append(unknowns, point.unknowns[d:])
    )
    tangent = tangent / np.linalg.norm(tangent)
    return replace(here, point=point, tangent=tangent, begin=start.index)


def _shifted(shooting: Shooting, here: BranchStep, index: int) -> np.ndarray:
    """Return the tangent of the state at sample ``index`` of the cycle, (2n,)."""
    point = here.point
    d = point.where.basis.shape[1]
    passed = shooting.motion(
        shooting.at(point.parameter),
        point.motion.samples[0],
        point.period,
        phase=point.phase,
        part=index / (len(point.motion.times) - 1),
        regime=point.where.regime,
    )
    change = here.tangent[-1] * shooting.parameter_scale
    if shooting.clock is None:
        longer = here.tangent[d] * shooting.period_scale
    else:
        longer = shooting.driven_period(point.parameter)[1] * change
    tangent = passed.by_state @ (point.where.basis @ here.tangent[:d])
    return tangent + passed.by_parameter * change + passed.by_period * longer


def with_parameter(shooting: Shooting, step: BranchStep, parameter: float) -> BranchStep:
    """Return the cycle at exactly ``parameter``, next to ``step``; that itself if it is lost."""
    unknowns = step.point.unknowns.copy()
    unknowns[-1] = parameter / shooting.parameter_scale
    point = correct(shooting, step.point.where, step.point.phase, unknowns)
    return step if point is None else step_at(shooting, point, step.tangent)
