"""What the records of totals say, by the names of a map's columns: of the cells of a sweep, and of
one run.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .reversal import ReversalRecord
from .totals import Totals

COUNTS = ("impact_count", "blow_count", "stick_count", "lift_off_count")


def smooth(record: Totals, window, xp=jnp) -> dict[str, Any]:
    """Return the outcomes of a ``window`` [s] that have derivatives, an array each of ``xp``
    (jax.numpy or numpy).
    """
    # Of the time as it was added up, which is the window but for rounding: what sticks throughout
    # has the share 1 itself, in any precision. By that `noise.classes` tells a tip that is carried.
    counted = record.stick_time + record.slip_time + record.flight_time
    counted = xp.where(counted > 0, counted, 1.0)
    return {
        "stick_fraction": record.stick_time / counted,
        "slip_fraction": record.slip_time / counted,
        "flight_fraction": record.flight_time / counted,
        "velocity_mean": record.output_integral / window,
        "velocity_rms": record.deviation(window, xp),
        "normal_force_mean": record.normal_force_integral / window,
        "normal_force_max": record.normal_force_max,
        "gap_max": record.gap_max,
        "impact_impulse_max": record.impulse_max,
    }


def told(record: Totals | ReversalRecord, window, finished) -> dict[str, np.ndarray]:
    """Return all that a record says of a ``window`` [s]; but for `COUNTS` it is NaN where a motion
    is not ``finished``, and where no time lay around V = 0, or none outside, what is of that.
    """
    totals = record.totals if isinstance(record, ReversalRecord) else record
    totals: Totals = jax.tree.map(np.asarray, totals)
    # by NumPy: XLA divides by the window in a block of one cell, else multiplies by its reciprocal
    with np.errstate(invalid="ignore", over="ignore"):
        found = smooth(totals, window, np) | {
            "force_drop": _force_drop(totals),
            "slip_rate": totals.slip_count / window,
            "energy_per_slip": _each(totals.friction_work, totals.slip_count),
            "acceleration_max": totals.acceleration_max,
        }
    if isinstance(record, ReversalRecord):
        found |= _of_the_reversal(record)
    settled = {name: np.where(finished, np.asarray(x), np.nan) for name, x in found.items()}
    counts = {name: getattr(totals, name) for name in COUNTS}
    return settled | {name: count for name, count in counts.items() if count is not None}


def _of_the_reversal(record: ReversalRecord) -> dict[str, Any]:
    record = ReversalRecord(record.totals, *map(np.asarray, record[1:]))

    def mean(integral, time):  # what is left of an integral over no time is rounding
        return np.where(time > 0, integral / np.where(time > 0, time, 1.0), np.nan)

    with np.errstate(invalid="ignore"):
        force, vibration = record.force_max_reversal, record.vibration_integral
        return {
            "normal_force_max_reversal": np.where(np.isneginf(force), np.nan, force),
            "normal_force_mean_stroke": mean(record.force_integral_stroke, record.stroke_time),
            "stick_fraction_stroke": mean(record.stick_time_stroke, record.stroke_time),
            "flight_fraction_stroke": mean(record.flight_time_stroke, record.stroke_time),
            "impact_impulse_reversal": record.impulse_max_reversal,
            "velocity_rms_reversal": np.sqrt(mean(vibration, record.vibration_time)),
        }


def _force_drop(totals: Totals) -> np.ndarray:
    """Largest friction force in stick less the smallest in slip; 0 without both."""
    both = (totals.stick_force_max > 0) & np.isfinite(totals.slip_force_min)
    return np.where(both, np.maximum(totals.stick_force_max - totals.slip_force_min, 0.0), 0.0)


def _each(whole, count) -> np.ndarray:
    """A whole shared among some; 0 where there are none."""
    count = np.asarray(count)
    return np.where(count > 0, np.asarray(whole) / np.maximum(count, 1), 0.0)
