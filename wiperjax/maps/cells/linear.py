"""Steady slip of cells, linearised: what a map stores of it, without any motion."""

from typing import Any

import numpy as np

from ...blade.belts import operating_speed
from ...blade.build import build_wiper
from ...blade.steady_slip import steady_slip
from ...blade.wiper import Wiper
from ...numerics.arrays import cellwise


def of_wiper(wiper: Wiper, count: int) -> dict[str, np.ndarray]:
    """Growth rate [1/s] and frequency [Hz] of steady slip, (count,) each."""
    found = steady_slip(wiper, operating_speed(wiper.belt))
    return {
        "growth_rate": cellwise(found.growth_rate, count),
        "linear_frequency": cellwise(found.frequency, count),
    }


def linear(spec: Any, index: np.ndarray) -> dict[str, np.ndarray]:
    """`of_wiper` of the cells `index` of a sweep."""
    wiper = build_wiper(spec.cells(index), spec.belt.kind, spec.blade.friction)
    return of_wiper(wiper, len(index))
