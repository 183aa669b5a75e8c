"""Errors that mean something for non-smooth motion, against a reference that is confirmed.

Two correct codes part after many events, because a difference of 1e-12 grows until the order of
events changes. So every cell is judged up to its horizon: the last sample at which a start moved by
1e-10 has grown by less than `GROWTH`.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..harness.interface import Answer
from ..rivals import compiled
from ..scenes.scene import Scene

REFERENCE_RTOL = 1e-12
MOVED, GROWTH = 1e-10, 1e4
SLACK = 0.005  # of the duration: an event this near the horizon may fall on either side


class Truth(NamedTuple):
    """The reference of a scene: its motion, and how far each cell may be judged."""

    answer: Answer
    horizon: np.ndarray  # (cells,) s
    counted: np.ndarray  # (cells, samples) bool


class Errors(NamedTuple):
    """Error of a method on a scene; medians over the cells, NaN where it has no such thing."""

    state: float  # largest |dx|, |dy| up to the horizon over the length scale
    state_p90: float  # the same, 90th percentile of the cells
    velocity: float  # of the velocities over the speed scale
    event_time: float  # s, largest up to the horizon
    wrong: float  # share of cells whose events are not those of the reference
    stopped: float  # share of cells in which the method itself reported failure


def truth(scene: Scene) -> Truth:
    """Return the reference: the scalar loop at rtol 1e-12, and its horizon."""
    method = compiled.Compiled("reference", 1)
    answer = method.prepare(scene, REFERENCE_RTOL).answer()
    moved = scene.start.copy()
    x = np.where(moved[:, 0] == 0, scene.scales[0], moved[:, 0])
    moved[:, 0] += MOVED * x
    beside = dataclasses.replace(scene, start=moved)
    other = method.prepare(beside, REFERENCE_RTOL).answer()
    grown = np.max(np.abs(other.position - answer.position), axis=2) / np.abs(MOVED * x)[:, None]
    wild = np.maximum.accumulate(~(grown < GROWTH), axis=1)
    end = np.where(wild.any(axis=1), np.argmax(wild, axis=1), wild.shape[1])
    times = np.concatenate([[0.0], scene.sample_times])
    return Truth(answer, times[end], ~wild)


def judge(scene: Scene, truth: Truth, answer: Answer) -> Errors:
    """Return the errors of ``answer`` for the first cells of the scene (as many as it has)."""
    n = len(answer.stopped)
    reference, counted = truth.answer, truth.counted[:n]

    def largest(found, true, scale):
        size = np.broadcast_to(np.asarray(scale, float), (truth.counted.shape[0],))[:n]
        off = np.max(np.abs(found - true[:n]), axis=2) / size[:, None]
        off = np.where(np.isfinite(off), off, np.inf)
        return np.max(np.where(counted, off, 0.0), axis=1)

    state = largest(answer.position, reference.position, scene.scales[0])
    velocity = largest(answer.velocity, reference.velocity, scene.scales[1])
    judged = counted.any(axis=1)
    if not judged.any():
        judged = np.ones_like(judged)
    event_time = wrong = np.nan
    if answer.event_times is not None and answer.event_kinds is not None:
        pairs = [
            _compare(
                answer.event_times[i], answer.event_kinds[i],
                reference.event_times[i], reference.event_kinds[i],  # type: ignore[index]
                truth.horizon[i], scene.duration,
            )
            for i in range(n)
        ]  # fmt: skip
        late, off = (np.array(column, float) for column in zip(*pairs, strict=True))
        known = np.isfinite(late) & (off == 0)
        event_time = float(np.median(late[known])) if known.any() else np.nan
        wrong = float(np.mean(off))
    return Errors(
        float(np.median(state[judged])),
        float(np.quantile(state[judged], 0.9, method="higher")),
        float(np.median(velocity[judged])),
        event_time,
        wrong,
        float(np.mean(answer.stopped)),
    )


def _compare(times, kinds, true_times, true_kinds, horizon, duration) -> tuple[float, bool]:
    """Return (largest error of the event times up to the horizon, whether an event is wrong)."""
    edge = horizon - SLACK * duration if horizon < duration else np.inf
    n = int(np.sum(true_times <= min(edge, horizon)))
    if len(kinds) < n or not np.array_equal(kinds[:n], true_kinds[:n]):
        return np.nan, True
    if int(np.sum(times <= edge)) > len(true_times[true_times <= horizon]):
        return np.nan, True
    return float(np.max(np.abs(times[:n] - true_times[:n]), initial=0.0)) if n else np.nan, False
