"""The borders between the classes of noise."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

from . import checks
from .ranges import Range

FADE = 0.25
"""Of `reversal_window`: length of the fade beside it, in which the stroke comes in."""

FEWEST_PERIODS = 2
"""Of what is called periodic in a settled window: less is no period."""


@dataclass(frozen=True)
class Thresholds:
    """Borders of the classes; sources disagree on them, so they are stored with every map.

    Attributes:
        quiet_velocity_ratio: rms of the tip velocity about its mean, over the belt speed, below
            which a cell is quiet.
        quiet_velocity: the same rms [m/s], in place of the ratio, where it is given; a system
            without a belt has no other.
        squeal_band: dominant frequency of squeal [Hz], both ends included.
        chatter_band: dominant frequency of chattering [Hz], upper end excluded.
        reversal_window: time [s] on either side of V = 0 that counts as the reversal.
        reversal_ratio: largest normal force there over the mean outside, from which it is a noise
            if it starts a vibration.
        vibration_ratio: vibration (faster than `chatter_band`) just after V = 0 over that of the
            strokes, from which the reversal is what starts it.
        tone_time: time [s] that a tone around the turn lasts at least; what is shorter is a
            click, or rings down.
        stick_share: share of the time in stick from which an oscillation is stick-slip, and below
            which it is self-excited slip.
        settled_change: most that standard deviation and frequency may change from the first half
            of the window to the second in a settled motion.
    """

    quiet_velocity_ratio: float = 0.01
    quiet_velocity: float | None = None
    squeal_band: tuple[float, float] = (500.0, 1000.0)
    chatter_band: tuple[float, float] = (0.0, 100.0)
    reversal_window: float = 0.025
    reversal_ratio: float = 2.0
    vibration_ratio: float = 2.0
    tone_time: float = 0.015
    stick_share: float = 0.01
    settled_change: float = 0.1

    def __post_init__(self):
        """Raises ValueError for what no file may say: all cells would be of other classes."""
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if value is None and field.default is None:
                continue
            numbers = checks.array(name, value, LIMITS[name]).reshape(-1).tolist()
            pair = isinstance(field.default, tuple)
            if len(numbers) != 1 + pair or pair and not numbers[0] < numbers[1]:
                must = "be [low, high] in Hz with low < high" if pair else "be one number"
                raise ValueError(f"{name} must {must}, but was {numbers}")


LIMITS: Mapping[str, Range] = MappingProxyType(
    {
        "quiet_velocity_ratio": Range(1e-12, 10),
        "quiet_velocity": Range(1e-30, 1e6, unit="m/s"),
        "squeal_band": Range(0, 1e6, unit="Hz"),
        "chatter_band": Range(0, 1e6, unit="Hz"),
        "reversal_window": Range(1e-9, 1e3, unit="s"),
        "reversal_ratio": Range(1e-6, 1e6),
        "vibration_ratio": Range(1e-6, 1e6),
        "tone_time": Range(1e-9, 1e3, unit="s"),
        "stick_share": Range(1e-12, 1),
        "settled_change": Range(1e-12, 10),
    }
)
"""Allowed range of each of them."""


def silence(limits: Any, belt_speed_rms: Any = None) -> Any:
    """Rms velocity [m/s] below which a motion is quiet, on belts of some rms speed [m/s] (None: of
    a system without). `limits`: anything with the attributes of `Thresholds`.

    Raises: ValueError without a belt where `quiet_velocity` is not given.
    """
    if limits.quiet_velocity is not None:
        return limits.quiet_velocity
    if belt_speed_rms is None:
        raise ValueError("quiet_velocity must be given for a system without a belt")
    return limits.quiet_velocity_ratio * belt_speed_rms
