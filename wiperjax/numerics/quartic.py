"""The quartic through the five node values of a step, in its part u from 0 to 1."""

import numpy as np

from .elementary import horner
from .runge_kutta import NODES
from .types import Scalar

_TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True))


def powers(values) -> tuple[Scalar, ...]:
    """Return the coefficients of u^0 .. u^4."""
    rows = (zip(row, values, strict=True) for row in _TO_POWERS)
    return tuple(sum(float(w) * x for w, x in row if w) for row in rows)


def integrated(coefficients) -> tuple[Scalar, ...]:
    """Return the coefficients of u^1 .. u^5 of the integral from 0."""
    return tuple(x * (1 / k) for k, x in enumerate(coefficients, 1))


def integral(coefficients, u) -> Scalar:
    """Return the integral from 0 to ``u``."""
    return u * horner(integrated(coefficients), u)
