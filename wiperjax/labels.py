"""Noise class of each cell from its statistics (MODEL.md section 11), in plain numpy.

The order of the rules matters and is this: what the solver could not finish is `failed`; the phi
limit is `collapsed`; then squeal, chattering, reversal, quiet, other, the first that holds. Squeal
and chattering ask for motion that is not quiet, so rounding noise at 700 Hz is no squeal.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from .dataset import LABELS, flag_names
from .results import RESULTS


@dataclass(frozen=True)
class Thresholds:
    """Borders of the classes; sources disagree on them, so they are stored with every map.

    Attributes:
        quiet_velocity_ratio: std of the tip velocity over the belt speed below which a cell is
            quiet.
        squeal_band: dominant frequency of squeal [Hz], both ends included.
        chatter_band: dominant frequency of chattering [Hz], upper end excluded. On a belt that
            reverses, put the lower end above the first few multiples of the wiping frequency:
            those are the stroke, not the blade.
        reversal_window: time [s] on either side of V = 0 that counts as the reversal (used by the
            engine).
        reversal_ratio: largest normal force there over the mean outside, from which it is a noise.
    """

    quiet_velocity_ratio: float = 0.01
    squeal_band: tuple[float, float] = (500.0, 1000.0)
    chatter_band: tuple[float, float] = (0.0, 100.0)
    reversal_window: float = 0.025
    reversal_ratio: float = 2.0


def label(columns: Mapping[str, Any], thresholds: Any = None) -> np.ndarray:
    """Class codes (`dataset.LABELS`) of cells, int8, of the shape of the columns.

    Arguments:

    - `columns`: name -> array, or a dataset: `result`, `velocity_rms` (m/s), `belt_speed_rms`
        (m/s), `dominant_frequency` (Hz, NaN where the velocity is constant), `stick_fraction`,
        `flight_fraction`; and, for belts that reverse, `normal_force_max_reversal` and
        `normal_force_mean_stroke` (N/m), NaN elsewhere.
    - `thresholds`: `Thresholds`, or anything with its attributes; the defaults if None.

    A finished cell with NaN among the columns its class rests on is `failed`, never silently
    another class.

    A tip that rides on the belt for the whole window is neither quiet, though a steady belt gives
    it a constant velocity (the spring must pull it back sooner or later: the window is too short),
    nor oscillating: it is `other`.

    Raises: `KeyError` if a column is missing.
    """
    limits = thresholds if thresholds is not None else Thresholds()
    result = np.asarray(columns["result"])
    speed = np.asarray(columns["velocity_rms"], dtype=float)
    belt = np.asarray(columns["belt_speed_rms"], dtype=float)
    frequency = np.asarray(columns["dominant_frequency"], dtype=float)
    stick = np.asarray(columns["stick_fraction"], dtype=float)
    flight = np.asarray(columns["flight_fraction"], dtype=float)
    unknown = np.full(result.shape, np.nan)
    peak = np.asarray(columns.get("normal_force_max_reversal", unknown), dtype=float)
    stroke = np.asarray(columns.get("normal_force_mean_stroke", unknown), dtype=float)

    carried = (stick >= 1.0) & (belt > 0.0)
    quiet = (speed <= limits.quiet_velocity_ratio * belt) & ~carried
    low, high = limits.squeal_band
    squeal = ~quiet & ~carried & (frequency >= low) & (frequency <= high)
    low, high = limits.chatter_band
    chattering = (
        ~quiet
        & ~carried
        & (frequency >= low)
        & (frequency < high)
        & ((stick > 0.0) | (flight > 0.0))
    )
    reversal = np.isfinite(peak) & (peak >= limits.reversal_ratio * stroke)

    needed = np.isfinite(speed) & np.isfinite(belt) & np.isfinite(stick) & np.isfinite(flight)
    needed &= np.isfinite(frequency) | quiet | carried  # a constant velocity has no line
    needed &= ~np.isfinite(peak) | np.isfinite(stroke)

    codes = np.select(
        [
            result == RESULTS["collapsed"],
            (result != RESULTS["finished"]) | ~needed,
            squeal,
            chattering,
            reversal,
            quiet,
        ],
        [
            LABELS[name]
            for name in ("collapsed", "failed", "squeal", "chattering", "reversal", "quiet")
        ],
        default=LABELS["other"],
    )
    return codes.astype(np.int8)


def class_table(ds: xr.Dataset, variable: str = "label") -> list[tuple[str, int, float]]:
    """Name, number of cells and share of each class of a map, in the order of the codes; also of
    `result`.

    Cells that are not computed (a partly finished store) are not counted.
    """
    names = flag_names(ds[variable])
    codes, counts = np.unique(np.asarray(ds[variable]), return_counts=True)
    found = {int(code): int(count) for code, count in zip(codes, counts, strict=True) if code >= 0}
    total = max(1, sum(found.values()))
    unnamed = {code: f"code_{code}" for code in found if code not in names}
    return [
        (name, found.get(code, 0), found.get(code, 0) / total)
        for code, name in (names | unnamed).items()
        if code >= 0
    ]
