"""Whether two models say the same of a motion: its class, its frequency, its amplitude."""

from typing import Any, NamedTuple

import numpy as np

from ..vocabulary.codes import LABELS
from ..vocabulary.kinds import MODELS

FREQUENCY, AMPLITUDE = 0.02, 0.10
"""Differences that are tolerated, relative to the better model; the second is that of a reversal's
forces, too."""

*POORER, LIP = MODELS
_UNHEARD = tuple(LABELS[name] for name in ("quiet", "failed", "collapsed"))


class Said(NamedTuple):
    """What a model says of some motions, an array (or a number) each; codes of `vocabulary.codes`.

    Attributes:
        amplitude: standard deviation of the tip velocity [m/s]; of the strokes on a belt that
            reverses, but of a `reversal` the vibration just after it.
        forces: largest normal force around V = 0 over its mean outside; NaN on a steady belt.
    """

    label: np.ndarray
    mechanism: np.ndarray
    band: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    forces: np.ndarray


def said(columns: Any) -> Said:
    """`Said` by columns of a map (a mapping, or a dataset), or by those of `run_class.assess`."""
    label, mechanism, band, frequency = (
        np.asarray(columns[name]) for name in ("label", "mechanism", "band", "dominant_frequency")
    )
    if "normal_force_max_reversal" not in columns:
        amplitude, forces = np.asarray(columns["velocity_rms"]), np.full(label.shape, np.nan)
        return Said(label, mechanism, band, frequency, amplitude, forces)
    reversal = label == LABELS["reversal"]
    kinds = ("vibration_reversal", "velocity_rms_stroke")
    amplitude = np.where(reversal, *(columns[name] for name in kinds))
    largest, mean = (
        np.asarray(columns[f"normal_force_{name}"]) for name in ("max_reversal", "mean_stroke")
    )
    return Said(label, mechanism, band, frequency, amplitude, largest / mean)


def held(model: Any, columns: Any) -> np.ndarray:
    """Where a model is held on the glass that the lip would leave: its numbers are none of the
    lip's there, however near they are. Columns as of `said`; the flight of the lip is its own.
    """
    return (np.asarray(columns["flight_fraction"]) > 0) & (model in POORER)


class Differences(NamedTuple):
    """How motions by a poorer model differ from the same by a better one, an array each.

    Attributes:
        told: whether the better one has a result; where it failed there is nothing to agree with.
        name: whether class, mechanism or band is another.
        frequency, amplitude, forces: relative differences; NaN where there is nothing to compare
            (what is quiet or has no result; the frequency of a reversal, the forces of all else),
            infinite where only one of them has a number.
    """

    told: np.ndarray
    name: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    forces: np.ndarray

    @property
    def tolerated(self) -> np.ndarray:
        """Whether the poorer model says the same."""
        apart = (self.frequency > FREQUENCY) | (self.amplitude > AMPLITUDE)
        return self.told & ~self.name & ~apart & ~(self.forces > AMPLITUDE)


def differences(poorer: Said, better: Said) -> Differences:
    """`Differences` of what two models say of the same motions."""
    heard = ~np.isin(better.label, _UNHEARD)
    reversal = np.asarray(better.label) == LABELS["reversal"]
    name = np.any([there != here for there, here in zip(poorer[:3], better[:3], strict=True)], 0)
    return Differences(
        np.asarray(better.label) != LABELS["failed"],
        name,
        _gap(poorer.frequency, better.frequency, heard & ~reversal),
        _gap(poorer.amplitude, better.amplitude, heard),
        _gap(poorer.forces, better.forces, reversal),
    )


def _gap(there: Any, here: Any, where: np.ndarray) -> np.ndarray:
    there, here = np.asarray(there, dtype=float), np.asarray(here, dtype=float)
    with np.errstate(all="ignore"):
        gap = np.abs(there - here) / np.abs(here)
    none = np.isnan(there) & np.isnan(here)
    gap = np.where(there == here, 0.0, np.nan_to_num(gap, nan=np.inf))
    return np.where(where & ~none, gap, np.nan)
