"""When a wiping belt turns."""

import math

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


def check_strokes(window: float, frequency: float) -> None:
    """Raises Fault where a `window` [s] around V = 0 leaves nothing of the strokes between, on a
    belt of this `frequency` [Hz].
    """
    if window >= (most := 0.25 / frequency):
        must = f"must be below a quarter of the belt's period ({most:g} s)"
        raise Fault("classes.reversal_window", f"{must}, was {window:g}")
