"""Steady slip of cells, linearised: what a map stores of it, without any motion."""

from typing import Any

import numpy as np

from ...blade.belts import operating_speed
from ...blade.build import build_wiper
from ...blade.steady_slip import SteadySlip, steady_slip
from ...blade.wiper import Wiper
from ...numerics.arrays import cellwise


def slip_of(wiper: Wiper) -> SteadySlip:
    """Steady slip of wipers at the speed that their belt is judged by."""
    return steady_slip(wiper, operating_speed(wiper.belt))


def growth(slip: SteadySlip, count: int) -> dict[str, np.ndarray]:
    """Growth rate [1/s] and frequency [Hz] of steady slip, (count,) each."""
    return {
        "growth_rate": cellwise(slip.growth_rate, count),
        "linear_frequency": cellwise(slip.frequency, count),
    }


def linear(spec: Any, index: np.ndarray) -> dict[str, np.ndarray]:
    """`growth` of the cells `index` of a sweep."""
    wiper = build_wiper(spec.cells(index), spec.belt.kind, spec.blade.friction)
    return growth(slip_of(wiper), len(index))
