"""The quartic through the five node values of a step, in its part u from 0 to 1."""

import numpy as np

from .runge_kutta import NODES
from .types import Scalar

_TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True))


def powers(values) -> tuple[Scalar, ...]:
    """Return the coefficients of u^0 .. u^4."""
    rows = (zip(row, values, strict=True) for row in _TO_POWERS)
    return tuple(sum(float(w) * x for w, x in row if w) for row in rows)


def integral(coefficients, u) -> Scalar:
    """Return the integral from 0 to ``u``."""
    total = coefficients[-1] * (1 / len(coefficients))
    for k in range(len(coefficients) - 1, 0, -1):
        total = total * u + coefficients[k - 1] * (1 / k)
    return u * total
