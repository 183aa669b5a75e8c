"""One cell phase by phase: a solver with events ends each, `scipy_tip` begins the next."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..scalar import model as m
from .scipy_tip import Cell, Tip

MOST_EVENTS, AT_ONCE = 20_000, 20


class Stage(NamedTuple):
    """What a solver finds of a phase."""

    reached: float  # s
    hit: int | None  # guard that ended it, counted as `Tip.cross` counts; None: it lasted
    contact: int  # guards of the regime's own
    end: tuple  # x, y, x', y' there
    place: Callable  # t -> the same before
    steps: int  # or evaluations, as the solver counts


class Found(NamedTuple):
    """What was found of one cell."""

    samples: np.ndarray  # (samples, 4): x, y, x', y'; NaN where it did not get to
    event_times: list[float]
    event_kinds: list[int]
    stopped: bool
    steps: int


def trajectory(
    cell: Cell, end: float, times: np.ndarray, solve: Callable[[Tip, float], Stage | None]
) -> Found:
    """Return the trajectory of ``cell`` from t = 0 to ``end`` [s], sampled at ``times`` [s].

    ``solve``: a phase from where the tip is, until a time at most; None where it fails.
    """
    tip, steps = Tip(cell), 0
    samples = np.full((len(times), 4), np.nan)
    event_times, event_kinds = [], []
    while tip.t < end and len(event_times) < MOST_EVENTS:
        stop = min(end, cell.breaks[tip.piece])
        stage = solve(tip, stop)
        if stage is None:
            break
        steps += stage.steps
        for i in np.flatnonzero((times > tip.t) & (times <= stage.reached)):
            samples[i] = stage.place(times[i])
        tip.arrive(stage.end, stage.reached, stop if stage.hit is None else stage.reached)
        if stage.hit is None:
            if tip.t >= end:
                break
            kind = tip.pass_break()
        else:
            kind = tip.cross(stage.hit, stage.contact)
        event_times.append(tip.t)
        event_kinds.append(kind)
        if kind == m.COLLAPSE:
            break
        if len(event_times) > AT_ONCE and event_times[-AT_ONCE] == tip.t:
            break  # the same event for ever
    collapsed = bool(event_kinds) and event_kinds[-1] == m.COLLAPSE
    return Found(samples, event_times, event_kinds, tip.t < end and not collapsed, steps)
