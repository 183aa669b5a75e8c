"""When a wiping belt turns, and which windows around that see the lip flip over."""

import math
from collections.abc import Mapping

import numpy as np

from ..vocabulary.thresholds import FADE
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


def window_notes(
    kind: str, given: Mapping[str, np.ndarray], around: float, window: float = math.inf
) -> list[str]:
    """Lines on windows that are allowed but rarely meant: whether there is a turn in the `window`
    [s] of a sweep, and a lip flips over within that of its reversal, `around` V = 0 [s], in the
    slowest cell.

    `given`: the values of the numbers of a belt of this `kind`, and of `lip_length`, in SI units.
    """
    lines, stroke = [], 0.5 / given["belt_frequency"].min()
    if window < stroke * (1 - 1e-9):
        seen = f"run.window is {window:g} s, shorter than the longest stroke ({stroke:.3g} s)"
        none = "a cell that comes within classes.reversal_window of no turn"
        lines.append(f"{seen}: {none} is called failed")
    time = flip_time(
        kind,
        given["belt_speed"].min(),
        given["belt_frequency"].min(),
        given["belt_ramp"].max() if "belt_ramp" in given else 0.0,
        given["lip_length"].max(),
    )
    if time <= 1.05 * around:
        return lines
    takes = f"the glass needs up to {time:.2g} s after V = 0 to"
    if math.isinf(time):
        takes = "where it is slowest the glass turns back before it can"
    over = f"carry the lip over ({FLIP:g} lip lengths); later counts as stroke"
    return [*lines, f"classes.reversal_window is {around:g} s, but {takes} {over}"]


def longest_window(frequency: float) -> float:
    """Longest time [s] around V = 0 that, with the fade beside it, leaves something of the strokes
    between, on a belt of this `frequency` [Hz].
    """
    return 0.25 / (1 + FADE) / frequency


def check_strokes(window: float, frequency: float) -> None:
    """Raises Fault where a `window` [s] around V = 0 is longer than `longest_window`."""
    most = longest_window(frequency)
    if window > most * (1 + 1e-9):
        must = f"must be at most a fifth of the belt's period ({most:g} s)"
        raise Fault("classes.reversal_window", f"{must}, was {window:g}")
