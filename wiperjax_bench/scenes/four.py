"""What scenes at which methods fail have in common: four blades, sixty samples."""

import math
from typing import Any

import numpy as np

from .families import LENGTH
from .scene import Scene

CELLS = 4
SAMPLES = 60
ABOUT_A_BORDER = np.array([-1e-2, -1e-3, 1e-3, 1e-2])  # shares by which cells lie off it


def four(name, about, promise, wiper, start, duration, speed, times=None) -> Scene:
    """Return a scene; ``times`` None: samples evenly over the duration."""
    if times is None:
        times = np.minimum(duration * np.arange(1, SAMPLES + 1) / SAMPLES, duration)
    scales = (float(wiper.lip_length), speed)
    return Scene(name, about, wiper, start, duration, times, scales, promise)


def spread(value: float) -> np.ndarray:
    """Return ``value`` and three values within a percent of it."""
    return value * (1 + 0.01 * np.arange(CELLS) / (CELLS - 1))


def at(
    angle: float, height: Any = 0.0, along: Any = 0.0, upward: Any = 0.0, length: float = LENGTH
) -> np.ndarray:
    """Return starts (cells, 4) of a lip leaning by ``angle``; height and speeds () or (cells,)."""
    start = np.zeros((CELLS, 4))
    start[:, 0] = length * math.sin(angle)
    start[:, 1], start[:, 2], start[:, 3] = height, along, upward
    return start
