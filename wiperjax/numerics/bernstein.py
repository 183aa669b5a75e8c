"""Guards along a step as polynomials: proof that one has no zero, and its first zero.

A guard is positive inside its regime. Its values at the five nodes of a step define a quartic in
theta in [0, 1]; the control values of its Bernstein form bound it, so all of them positive proves
that it does not vanish. A guard that starts at an m-fold zero by construction (at lift-off the gap
has a triple one) is divided by theta^m first, so that its own start never fires and a second
crossing in the same step is still seen.
"""

from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from .elementary import larger, smaller, within
from .fusion_barrier import keep
from .runge_kutta import NODES
from .types import Scalar

DEGREE = 4
_POLISHED = 3  # steps of Newton's method
_THETA = np.array(NODES)[:, None]
_BINOMIAL = np.array([1.0, 4.0, 6.0, 4.0, 1.0])
_BERNSTEIN = _BINOMIAL * _THETA ** np.arange(5) * (1 - _THETA) ** (4 - np.arange(5))
_TO_CONTROL = np.linalg.inv(_BERNSTEIN)


def deflated(g, m, highest: int) -> tuple[Scalar, ...]:
    """Return node values of g(theta) / theta^m; at theta = 0 the cubic extrapolation of the others.

    ``g`` holds a guard's five node values; ``m`` (0 to ``highest``) is its known multiplicity at
    the start.
    """
    quotients = []
    for value, theta in zip(g[1:], NODES[1:], strict=True):
        factor = power_of(1 / theta, m, highest).astype(value.dtype)
        quotients.append(value if theta == 1 else value * factor)
    a, b, c, d = quotients
    start = jnp.where(m == 0, g[0], 4 * a - 6 * b + 4 * c - d)
    return (start, a, b, c, d)


def power_of(base: float, m, highest: int) -> Scalar:
    """base^m for a traced integer ``m`` in 0 .. ``highest``, by selection: `pow` is dear."""
    power = jnp.where(m == 0, 1.0, base)
    for k in range(2, highest + 1):
        power = jnp.where(m == k, base**k, power)
    return power


def control_values(nodes) -> tuple[Scalar, ...]:
    """Return Bernstein control values of the quartic through five equidistant node values."""
    return tuple(
        sum(float(w) * x for w, x in zip(row, nodes, strict=True) if abs(w) > 1e-14)
        for row in _TO_CONTROL
    )


def interpolation_error(nodes, order) -> Scalar:
    """Estimate of the error of the quartic: its own highest difference, which is an upper bound
    of the next one for a step that resolves the motion."""
    a, b, c, d, e = nodes
    quartic = jnp.abs(a - 4 * b + 6 * c - 4 * d + e)
    cubic = jnp.abs(-b + 3 * c - 3 * d + e)
    return jnp.where(order == 0, quartic, cubic) / 16


def minimum(values) -> Scalar:
    """Smallest of a tuple of values."""
    return reduce(smaller, values)


def descent_cut(control):
    """A lower bound of any root of a polynomial that starts above zero, 1 where it never goes down.

    The zero of the steepest line from the first control point to another: less sharp than
    `hull_cut`, which looks at negative ones only, and half its price. Enough to rank the guards.
    """
    fall = jnp.zeros_like(control[0])
    for i in range(1, DEGREE + 1):
        fall = larger(fall, (DEGREE / i) * (control[0] - control[i]))
    return control[0] / larger(fall, control[0])


class Root(NamedTuple):
    """Outcome of `first_root`. Neither found nor free: undecided, but free up to ``theta``."""

    theta: Scalar  # the root, or the length of the stretch proved free of roots
    found: Scalar
    free: Scalar
    low: Scalar  # lower bound of the polynomial beyond ``theta`` (where free)


def largest(values) -> Scalar:
    """Largest size of a tuple of values; not for finding a NaN (see `larger`)."""
    return reduce(larger, map(jnp.abs, values))


def power_form(control) -> tuple[Scalar, ...]:
    """Return the coefficients in powers of theta of the polynomial with Bernstein ``control``."""
    a, b, c, d, e = control
    return (
        a,
        4 * (b - a),
        6 * (c - 2 * b + a),
        4 * (d - 3 * c + 3 * b - a),
        e - 4 * d + 6 * c - 4 * b + a,
    )


def value_and_slope(coefficients, at) -> tuple[Scalar, Scalar]:
    """Return the polynomial's value and slope at ``at``."""
    a, b, c, d, e = coefficients
    value = (((e * at + d) * at + c) * at + b) * at + a
    return value, ((4 * e * at + 3 * d) * at + 2 * c) * at + b


def hull_cut(control):
    """First zero of the lower boundary of the control polygon's hull: a lower bound of any root.

    1 where no control value after the first is negative.
    """
    # the steepest line from the first control point to a negative one
    fall = jnp.zeros_like(control[0])
    for i in range(1, DEGREE + 1):
        drop = (DEGREE / i) * (control[0] - control[i])
        fall = larger(fall, jnp.where(control[i] < 0, drop, 0.0))
    crosses = fall > 0
    return jnp.where(crosses, within(0.0, control[0] / jnp.where(crosses, fall, 1.0), 1.0), 1.0)


def first_root(control, beyond, blur) -> Root:
    """First zero on [0, 1] of the polynomial with Bernstein ``control`` values, the first positive.

    Clipping from the left: the polynomial cannot vanish before the lower boundary of its control
    polygon's hull does, so everything left of that is proved free; subdivide there. It never steps
    over a root and ends at once where there is none. Newton polishes the last digits; where that
    fails (nearly double roots) the proved stretch is what is returned, and the next step is
    shorter. A second clip saves 0.02 % of the steps and costs 1 % more arithmetic.

    Where ``beyond`` > 0 the root sought is one on [1, 1 + beyond], to three digits, of the
    polynomial plus ``blur`` (what ``control`` is less for safety); nothing is proved of it.
    """
    n = DEGREE
    size = largest(control)

    left = jnp.where(minimum(control[1:]) < 0, hull_cut(control), 0.0)
    b = list(control)  # de Casteljau: control values of the part to the right
    for level in range(n):
        for i in range(n - level):
            b[i] = b[i] + left * (b[i + 1] - b[i])
    left, b = keep((left, tuple(b)))
    free = minimum(b) > 0

    onward = beyond > 0
    constant, *others = power_form(b)
    c = (jnp.where(onward, constant + blur, constant), *others)
    least, most = jnp.where(onward, 1.0, 0.0), jnp.where(onward, 1 + 2 * beyond, 1.0)
    u = least
    for _ in range(_POLISHED):
        value, slope = value_and_slope(c, u)
        u = larger(least, smaller(most, u - value / jnp.where(slope < 0, slope, -size)))
    value, slope = value_and_slope(c, u)
    fine = jnp.where(onward, 1e-3, 1e-6) * size
    found = (jnp.abs(value) <= fine) & (slope < 0) & jnp.where(onward, u <= 1 + beyond, ~free)
    return Root(jnp.where(found, left + u * (1 - left), left), found, free, minimum(b))
