"""The two shapes of the engine's arrays: a number of a trajectory, a vector of its coordinates."""

from typing import Any

Scalar = Any  # a float, or an array with one entry a lane


Coordinates = tuple[Scalar, ...]
