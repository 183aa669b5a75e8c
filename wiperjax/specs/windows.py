"""Which windows see enough: the settled one periods of a squeal, of a belt that turns its turns and
strokes, and the one around a turn the lip that flips over.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..vocabulary.kinds import STEADY_KINDS, since_reversal
from ..vocabulary.thresholds import FADE, FEWEST_PERIODS
from .errors import Fault

FLIP = 1.5
"""Lip lengths that the glass travels until a lip that lies on its shoulder has flipped over."""


def flip_time(kind: str, speed: float, frequency: float, ramp: float, length: float) -> float:
    """Time [s] after V = 0 until the glass has travelled `FLIP` lip lengths; inf if it turns first.

    **Arguments:** `kind` of belt that reverses (`BELTS`), its peak speed [m/s], frequency [Hz] and
    ramp [s] (of a trapezoid), and the lip's length [m]. Raises ValueError for another kind.
    """
    way = FLIP * length
    if kind == "trapezoid":
        time = math.sqrt(way * ramp / speed)  # V = 2 V0 t/ramp up to t = ramp/2
        time = time if time <= ramp / 2 else ramp / 4 + way / speed
        return time if way <= speed * (0.5 / frequency - 0.5 * ramp) else math.inf
    if kind != "wiping":
        raise ValueError(f"kind must be a belt that reverses, but was {kind!r}")
    turn = 2 * math.pi * frequency
    return math.acos(1 - way * turn / speed) / turn if way * turn <= 2 * speed else math.inf


def settled_notes(
    start: float, window: float, named: str, classes: Any, known: Mapping[str, Any]
) -> list[str]:
    """Lines on a settled `window` [s] from `start` [s] on, `named` as files have it, that is
    allowed but rarely meant: too short for a squeal, or without a turn or a stroke of a belt that
    reverses.

    `known`: the values of the belt's numbers, in SI units.
    """
    lines, lowest = [], classes.squeal_band[0]
    if window * lowest < FEWEST_PERIODS * (1 - 1e-9):
        periods = f"{FEWEST_PERIODS} periods of the lowest squeal ({FEWEST_PERIODS / lowest:.3g} s)"
        seen = f"{named} is {window:g} s, shorter than {periods}"
        lines.append(f"{seen}: what squeals may be called quiet, or other")
    if "belt_frequency" not in known:
        return lines
    frequency, around = np.atleast_1d(known["belt_frequency"]), classes.reversal_window
    turns = np.atleast_1d(known.get("belt_phase", 0.0)) / (2 * math.pi)
    if any(_lacks(start, window, around, frequency, turn).any() for turn in turns):
        seen = f"{named} is {window:g} s, the longest stroke {0.5 / frequency.min():.3g} s"
        lacks = f"shows none of the {around:.3g} s after a turn, or nothing between turns"
        lines.append(f"{seen}: what {lacks}, is called failed")
    return lines


def _lacks(start: float, window: float, around: float, frequency: np.ndarray, turns: float):
    """Whether a settled window lacks the time `around` [s] after a turn, or all between turns."""
    since = since_reversal(start, frequency, turns)
    ahead = np.where(since < 0, 0.0, 0.5 / frequency) - since  # to the next turn
    turn = (since >= 0) & (since <= around) | (ahead < window)
    return ~turn | (np.abs(since) <= around) & (window <= around - since)


def flip_notes(kind: str | None, known: Mapping[str, np.ndarray], around: float) -> list[str]:
    """Lines on a reversal window, `around` V = 0 [s], within which no lip flips over in the slowest
    cell.

    None of a system without a belt (`kind` None) or a lip, or with a belt that never turns.
    `known`: parameter -> its values in SI units.
    """
    if kind in STEADY_KINDS or "lip_length" not in known:
        return []
    time = flip_time(
        kind,
        np.abs(known["belt_speed"]).min(),
        known["belt_frequency"].min(),
        known["belt_ramp"].max() if "belt_ramp" in known else 0.0,
        np.abs(known["lip_length"]).max(),
    )
    if time <= 1.05 * around:
        return []
    takes = f"the glass needs up to {time:.2g} s after V = 0 to"
    if math.isinf(time):
        takes = "where it is slowest the glass turns back before it can"
    over = f"carry the lip over ({FLIP:g} lip lengths); later counts as stroke"
    return [f"classes.reversal_window is {around:g} s, but {takes} {over}"]


def longest_window(frequency: float) -> float:
    """Longest time [s] around V = 0 that, with the fade beside it, leaves something of the strokes
    between, on a belt of this `frequency` [Hz].
    """
    return 0.25 / (1 + FADE) / frequency


def check_strokes(window: float, frequency: float, key: str = "classes.reversal_window") -> None:
    """Raises Fault where a `window` [s] around V = 0, called `key`, is longer than
    `longest_window`.
    """
    most = longest_window(frequency)
    if window > most * (1 + 1e-9):
        must = f"must be at most a fifth of the belt's period ({most:g} s)"
        raise Fault(key, f"{must}, was {window:g}")
