"""One step along a branch of cycles: predict along the tangent, correct at that distance."""

from dataclasses import dataclass, replace

import numpy as np

from . import named
from .cycles import Cycle, cycle_at
from .orbit import middle_of_longest, smooth_intervals
from .return_map import Point, Shooting, correct
from .shooting import Chart, chart, stretch


@dataclass(frozen=True)
class Step:
    """A point of the branch with its cycle and the direction of travel."""

    point: Point
    cycle: Cycle
    tangent: np.ndarray  # of the unknowns, in the point's own chart
    sense: float  # derivative of the parameter along the branch


def first_step(shooting: Shooting, cycle: Cycle) -> Step | None:
    """Return the step at a found cycle, or None if it cannot be closed again."""
    assert shooting.over is not None
    where = chart_at(shooting, cycle.system, cycle.state, cycle.phase, cycle.period, cycle.regime)
    parameter = named.value(cycle.system, shooting.over) / shooting.parameter_scale
    unknowns = np.zeros(where.basis.shape[1])
    if shooting.clock is None:
        unknowns = np.append(unknowns, cycle.period / shooting.period_scale)
    point = correct(shooting, where, cycle.phase, np.append(unknowns, parameter))
    return None if point is None else step_at(shooting, point, np.eye(len(unknowns) + 1)[-1])


def chart_at(shooting: Shooting, system, state, phase, period, regime) -> Chart:
    return chart(system, state, phase * period, regime, shooting.scale, shooting.section)


def step_at(shooting: Shooting, point: Point, onward) -> Step:
    """Return the step at ``point`` whose tangent goes with ``onward`` (unknowns of its chart)."""
    tangent = np.linalg.svd(point.jacobian)[2][-1]
    if tangent @ onward < 0:
        tangent = -tangent
    return Step(point, cycle_at(shooting, point), tangent, float(tangent[-1]))


def distance(shooting: Shooting, a: Step, b: Step) -> float:
    """Return the distance of two steps in scaled state, period and parameter."""
    return float(np.linalg.norm(_place(shooting, a) - _place(shooting, b)))


def _place(shooting: Shooting, step: Step) -> np.ndarray:
    """State, period and parameter in scaled numbers."""
    state = step.point.motion.samples[0] / shooting.scale
    rest = step.point.period / shooting.period_scale, step.point.parameter
    return np.array([*state, rest[0], rest[1] / shooting.parameter_scale])


def direction(shooting: Shooting, step: Step) -> np.ndarray:
    """Unit tangent in scaled state, period and parameter."""
    d = step.point.where.basis.shape[1]
    state = step.point.where.basis @ step.tangent[:d] / shooting.scale
    full = np.concatenate([state, step.tangent[d:]])
    return full / np.linalg.norm(full)


def ahead_of(shooting: Shooting, here: Step, length: float, tangent=None) -> Step | None:
    """Return the branch at a distance along the tangent, or None."""
    along = here.tangent if tangent is None else tangent
    guess = here.point.unknowns + length * along
    point = correct(shooting, here.point.where, here.point.phase, guess, along)
    if point is None or np.linalg.norm(point.unknowns - guess) > 2 * length + 1e-6:
        return None
    return step_at(shooting, point, along)


def centred(shooting: Shooting, here: Step) -> Step:
    """Return the step in the chart of its own state; moved on, if an event comes near it."""
    point = here.point
    d = point.where.basis.shape[1]
    state = point.motion.samples[0]
    shift = point.where.basis @ here.tangent[:d]
    phase, regime = point.phase, point.where.regime
    if shooting.clock is not None:
        free = smooth_intervals(point.motion)
        near = max(2, len(free) // 50)
        if not (free[:near].all() and free[-near:].all()):
            index = middle_of_longest(point.motion.regimes[:-1], free)
            moved, state, regime = _moved(shooting, here, index)
            phase = (phase + index / len(free)) % 1.0
            shift = moved
    where = chart_at(shooting, here.cycle.system, state, phase, point.period, regime)
    read = np.linalg.lstsq(where.basis / where.scale[:, None], shift / where.scale, rcond=None)
    unknowns = np.zeros(where.basis.shape[1])
    tangent = np.concatenate([read[0], here.tangent[d:]])
    point = replace(
        point, where=where, phase=phase, unknowns=np.append(unknowns, point.unknowns[d:])
    )
    return replace(here, point=point, tangent=tangent / np.linalg.norm(tangent))


def _moved(shooting: Shooting, here: Step, index: int):
    """Return (tangent of the state, state, regime) at sample ``index`` of the cycle."""
    point = here.point
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


def at_border(shooting: Shooting, here: Step, ahead: Step, border: float) -> Step | None:
    """Return the cycle at the parameter ``border``, between two steps."""
    unknowns = ahead.point.unknowns.copy()
    unknowns[-1] = border / shooting.parameter_scale
    point = correct(shooting, here.point.where, here.point.phase, unknowns)
    return None if point is None else step_at(shooting, point, ahead.tangent)
