"""Elementary functions that vectorise, where XLA's own cost more than the rest of a step."""

import jax
import jax.numpy as jnp
import numpy as np

_TERMS = 17  # asin's remainder is singular 5.8 radii away: 5.8^-17 of it is below rounding


def _remainder_coefficients() -> tuple[float, ...]:
    """Power coefficients in u = 4 z - 1 of R(z) = (asin(w) - w) / w^3, z = w^2 in [0, 1/2]."""
    k = np.arange(200)
    # asin's own series, c_k = binom(2k, k) / (4^k (2k + 1)), without its first term
    ratio = np.concatenate([[1.0], np.cumprod((2 * k[1:] - 1) / (2 * k[1:]))])
    series = (ratio / (2 * k + 1))[1:]
    z = np.polynomial.chebyshev.chebpts1(4 * _TERMS) * 0.25 + 0.25
    values = np.polynomial.polynomial.polyval(z, series)
    fit = np.polynomial.chebyshev.chebfit(4 * z - 1, values, _TERMS)
    return tuple(float(c) for c in np.polynomial.chebyshev.cheb2poly(fit))


_REMAINDER = _remainder_coefficients()


def larger(a, b):
    """The larger of two values; of a NaN and another value either, by their places.

    One instruction. `jnp.maximum` costs five: it gives NaN whenever one of both is (so it still
    stands where that is how a failure is found).
    """
    return jnp.where(a > b, a, b)


def smaller(a, b):
    """The smaller of two values, as `larger` gives the larger."""
    return jnp.where(a < b, a, b)


def within(low, x, high):
    """``x``, or the bound that it lies beyond; NaN if x is."""
    return smaller(high, larger(low, x))


@jax.custom_jvp
def angle(sin, cos):
    """Angle in [-pi/2, pi/2] of a given sine and cosine (>= 0), to rounding and without a branch.

    The smaller of the two is inverted. Its derivative is that on the circle, cos dsin - sin dcos.
    """
    square = sin * sin
    far = square > 0.5
    z = jnp.where(far, cos * cos, square)
    w = jnp.where(far, jnp.where(sin < 0, -cos, cos), sin)
    u = 4 * z - 1
    tail = jnp.full_like(u, _REMAINDER[-1])
    for c in _REMAINDER[-2::-1]:
        tail = tail * u + c
    small = w + w * z * tail
    return jnp.where(far, jnp.where(sin < 0, -0.5 * np.pi, 0.5 * np.pi) - small, small)


@angle.defjvp
def _angle_jvp(primals, tangents):
    (sin, cos), (d_sin, d_cos) = primals, tangents
    return angle(sin, cos), cos * d_sin - sin * d_cos
