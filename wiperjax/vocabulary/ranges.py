"""Ranges of numbers: what every key of a file and every argument of a function may be.

A range says for itself what a number must be, so that a file, the command line and Python are
answered in the same words. Ranges of the blade's and the belt's parameters stand in
`parameters.py`, all others here. They are wide on purpose: what lies outside is a slip of the
keyboard, or beyond what the arithmetic can carry. Imports no jax.
"""

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`; never NaN, and infinite only where `infinite` says so.

    Attributes:
        low, high: ends; infinite where there is none.
        low_open, high_open: whether that end itself is forbidden.
        whole: whether only whole numbers are meant.
        infinite: whether an infinite number is a value too, and not a slip.
        unit: of the numbers, for the text alone.
    """

    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    high_open: bool = False
    whole: bool = False
    infinite: bool = False
    unit: str = ""

    @property
    def must(self) -> str:
        """What a number must be, as the middle of an error line: `must lie inside (0, 1] m`."""
        kind = "a whole" if self.whole else "a" if self.infinite else "a finite"
        unit = f" {self.unit}" if self.unit else ""
        if math.isfinite(self.low) and math.isfinite(self.high):
            left, right = "(" if self.low_open else "[", ")" if self.high_open else "]"
            must = "must be a whole number in" if self.whole else "must lie inside"
            return f"{must} {left}{_plain(self.low)}, {_plain(self.high)}{right}{unit}"
        if math.isfinite(self.low):
            return (
                f"must be {kind} number {'>' if self.low_open else '>='} {_plain(self.low)}{unit}"
            )
        if math.isfinite(self.high):
            return (
                f"must be {kind} number {'<' if self.high_open else '<='} {_plain(self.high)}{unit}"
            )
        return f"must be {kind} number{unit}"

    def outside(self, values: Any) -> Any:
        """The first of `values` (a number or an array of them) that does not lie in the range; None
        if all do.
        """
        if isinstance(values, int | float):  # most are: no array is made of them
            return None if self._holds(values) else values
        values = np.asarray(values, dtype=np.float64)
        wrong = values[~np.asarray(self._holds(values))]
        return wrong.flat[0] if wrong.size else None

    def _holds(self, x: Any) -> Any:
        above = x > self.low if self.low_open else x >= self.low  # False for NaN
        below = x < self.high if self.high_open else x <= self.high
        fine = above & below
        if not self.infinite or isinstance(x, int):  # one of 400 digits is no float at all
            fine = fine & (abs(x) <= sys.float_info.max)
        if self.whole:
            fine = fine & (x % 1 == 0) if isinstance(x, int | float) else fine & (np.mod(x, 1) == 0)
        return fine


def _plain(number: float) -> str:
    """An end of a range: a whole number that is not large in all its digits, else five."""
    return str(int(number)) if number % 1 == 0 and abs(number) < 2**31 else f"{number:.5g}"


FINITE = Range()
POSITIVE = Range(0, low_open=True)
NON_NEGATIVE = Range(0)
SHARE = Range(0, 1)
COUNT = Range(1, 2**31 - 1, whole=True)  # counters of the engine are 32 bits wide

MOST_VALUES = 10**6  # of one axis
MOST_CELLS = 10**9
MOST_SAMPLES = 2**20  # of one cell: 4 MB
RUN_SAMPLES = 10**7  # of one run: 1 GB

SAMPLES = 2000
"""Intervals between the samples of a run, unless their length is given."""

FEWEST_SETTLED = 64
"""Samples after the transient by which a run is judged, at least."""

TIP: Mapping[str, Range] = MappingProxyType(
    {"position": Range(-1, 1, unit="m"), "velocity": Range(-1e3, 1e3, unit="m/s")}
)
"""Where a wiper's tip may start."""

SETTINGS: Mapping[str, Range] = MappingProxyType(
    {
        # an axis: its values are held to the range of what they are values of
        "num": Range(1, MOST_VALUES, whole=True),
        "start": Range(-1e9, 1e9),
        "stop": Range(-1e9, 1e9),
        "listed": Range(-1e9, 1e9),
        # times [s] of files; those of functions are in units of the system, and only positive
        "transient": Range(0, 1e5, unit="s"),
        "window": Range(1e-6, 1e5, unit="s"),
        "duration": Range(1e-9, 1e5, unit="s"),
        "sample_interval": Range(1e-12, 1e5, unit="s"),
        "zeno_time": Range(1e-15, 1e-2, unit="s"),
        # the integrator: below 1e-13 a step cannot tell its error from rounding
        "rtol": Range(1e-13, 1e-2),
        "atol": Range(1e-20, 1.0),
        "max_steps": COUNT,
        "max_step": Range(1e-12, 1e5, unit="s"),
        # what is kept of a cell
        "samples": Range(16, MOST_SAMPLES, whole=True),
        "raster": Range(1, 2**16, whole=True),
        "event_log": Range(1, 2**16, whole=True),
        # the start
        "angle": Range(-90, 90, low_open=True, high_open=True, unit="degrees"),
        "equilibrium": Range(-1, 1),
        # several starts of a cell, borders of a map: what both draw at random
        "seed": Range(0, 2**31 - 1, whole=True),
        "kick": Range(0, 0.1),
        "random": Range(2, 10_000, whole=True),
        "x": Range(-1, 1, unit="m"),
        "y": Range(-1, 1, unit="m"),
        "vx": Range(-1e3, 1e3, unit="m/s"),
        "vy": Range(-1e3, 1e3, unit="m/s"),
        "levels": Range(1, 20, whole=True),
        "resolution": Range(0, 0.5, low_open=True),
        "max_cells": COUNT,
        "probes": Range(0, 10**7, whole=True),
        "lengthen": Range(1, 1000, whole=True),
        "splits": Range(0, 20, whole=True),
        # derivatives
        "check": SHARE,
        "step": Range(1e-12, 1e-2),
        "grazing": Range(0, 1),
        "settled": Range(1e-12, 10),
    }
)
"""Allowed range of every number of an axis, a run, a start and of sensitivities; those of the
classes stand with them in `thresholds.py`."""
