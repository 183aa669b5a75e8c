"""Where a cycle begins that is followed: away from its events, on a section that crosses it.

A start serves as long as cycles change little. Farther on an event may come to it; or the section
may come to touch the motion there: then a shift along the cycle stays on the section, and the
closing equations are singular where nothing happens to the cycle.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .chart import Across, Chart, chart
from .orbit import event_margin, far_from_events, smooth_intervals
from .return_map import Shooting
from .shooting import Arc

NEAR = 0.05  # of the largest distance from an event: too near for the start of a cycle
STEEP = 0.3  # sine of the angle between motion and section: less is too near to touching


class Start(NamedTuple):
    """Where a cycle is to begin."""

    index: int  # sample of its motion; 0: where that has begun
    state: np.ndarray  # (2n,)
    phase: float
    regime: int
    section: Callable | None

    def chart(self, shooting: Shooting, system, period: float) -> Chart:
        """Coordinates there. Raises `Lost` as `chart`."""
        time = self.phase * period
        return chart(system, self.state, time, self.regime, shooting.scale, self.section)


def start_of(shooting: Shooting, where: Chart, phase: float, motion: Arc) -> Start:
    """Return where the cycle of ``motion`` is to begin: as it did, in ``where``, if that serves.

    If not, in the middle of its longest run without an event; without a clock on the plane across
    the motion there, in scaled numbers.
    """
    free, margin = smooth_intervals(motion), event_margin(motion)
    near, flow = max(2, len(free) // 50), where.read(motion.by_period)
    serves = free[:near].all() and free[-near:].all()
    if shooting.clock is not None or isinstance(where.section, Across):
        serves = serves and margin[0] >= NEAR * margin.max()
    if shooting.clock is None:
        inside = where.read(where.basis)  # orthonormal
        across = flow - inside @ (inside.T @ flow)
        serves = serves and np.linalg.norm(across) >= STEEP * np.linalg.norm(flow)
    if serves:
        return Start(0, motion.samples[0], phase, where.regime, where.section)
    index = far_from_events(motion.regimes[:-1], free, margin) or len(free)
    state, regime = motion.samples[index], int(motion.regimes[index])
    if shooting.clock is not None:
        return Start(index, state, (phase + index / len(free)) % 1.0, regime, None)
    onward = motion.samples[(index + 1) % len(free)] - motion.samples[index - 1]
    return Start(index, state, phase, regime, Across(state, onward / where.scale**2))
