"""Steady slip of cells, linearised: what a map stores of it, without any motion."""

from typing import Any

import numpy as np

from ...blade.steady_slip import SteadySlip, judged_slip
from ...blade.wiper import Wiper
from ...numerics.arrays import cellwise
from ...numerics.kept import Kept, as_arrays
from ...systems.build import build
from ...vocabulary.columns import OF_STEADY_SLIP
from .devices import alike, capacity, spread


def slip_of(wiper: Wiper) -> SteadySlip:
    """Steady slip of wipers at the speed that their belt is judged by."""
    return _slip_of(as_arrays(wiper, "float64"))


def slips(wiper: Wiper, capacity: int) -> SteadySlip:
    """`slip_of` the wipers of a block of a `capacity`, a part on each device."""
    return spread(slip_of, alike(wiper, "float64", capacity))


@Kept
def _slip_of(wiper: Wiper) -> SteadySlip:
    return judged_slip(wiper)


def growth(slip: SteadySlip, count: int) -> dict[str, np.ndarray]:
    """Growth rate [1/s] and frequency [Hz] of steady slip, (count,) each."""
    found = slip.growth_rate, slip.frequency
    return {name: cellwise(x, count) for name, x in zip(OF_STEADY_SLIP, found, strict=True)}


def linear(spec: Any, index: np.ndarray) -> dict[str, np.ndarray]:
    """`growth` of the cells `index` of a sweep of the wiper, by the program of its map: filled up
    with the last, for another number of cells is another program, of some seconds."""
    size = capacity(len(index))
    wiper = build(spec, spec.cells(np.pad(index, (0, size - len(index)), "edge"))).wiper
    assert wiper is not None
    return growth(slips(wiper, size), len(index))
