"""What the stretches of a trajectory hand to each other, and where they write."""

from typing import NamedTuple

import numpy as np


class Limits(NamedTuple):
    """What bounds a trajectory and its steps."""

    t_end: float
    rtol: float
    atol_x: float
    atol_v: float
    zeno_time: float  # a flight shorter than this begins the end of a bounce
    budget: int  # of attempts


class Watch(NamedTuple):
    """Where a cell's motion is written."""

    times: np.ndarray  # of the samples
    taken: np.ndarray  # (samples, 4): x, y, x', y'
    mark: float  # from here on statistics are gathered
    signal: np.ndarray  # x at mark + i interval
    interval: float
    total: np.ndarray  # columns of `statistics`


class Tip(NamedTuple):
    """State of the tip; u = x', vy = y', w the slip speed."""

    t: float
    x: float
    phi: float
    y: float
    u: float
    w: float
    vy: float


class Memory(NamedTuple):
    """What is remembered over events: next steps, and orders of zeros known at the start."""

    h_slip: float
    h_flight: float
    slip_order: int
    flight_order: int
    kinked: int  # side of the shoulder that was just passed


class Counts(NamedTuple):
    """Attempted and rejected steps; next sample and next place of the signal."""

    attempts: int
    rejected: int
    upcoming: int
    ticks: int
