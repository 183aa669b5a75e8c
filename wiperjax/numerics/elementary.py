"""Elementary functions that vectorise, where XLA's own cost more than the rest of a step."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import iv

_ASIN_TERMS = {"float64": 17, "float32": 7}  # singular 5.8 radii away: 5.8^-n is below rounding
_EXP_TERMS = {"float64": 11, "float32": 6}
_EXP_LEAST = {"float64": -700.0, "float32": -80.0}  # e^x is as good as zero there
_LN2 = {  # in two parts: multiples of the first are exact
    "float64": (0.693145751953125, 1.42860682030941723e-6),
    "float32": (0.693359375, -2.12194440054690583e-4),
}


def _asin_remainder(terms: int) -> tuple[float, ...]:
    """Power coefficients in u = 4 z - 1 of R(z) = (asin(w) - w) / w^3, z = w^2 in [0, 1/2]."""
    k = np.arange(200)
    # asin's own series, c_k = binom(2k, k) / (4^k (2k + 1)), without its first term
    ratio = np.concatenate([[1.0], np.cumprod((2 * k[1:] - 1) / (2 * k[1:]))])
    series = (ratio / (2 * k + 1))[1:]
    z = np.polynomial.chebyshev.chebpts1(4 * terms) * 0.25 + 0.25
    values = np.polynomial.polynomial.polyval(z, series)
    fit = np.polynomial.chebyshev.chebfit(4 * z - 1, values, terms)
    return tuple(float(c) for c in np.polynomial.chebyshev.cheb2poly(fit))


def _exp_polynomial(terms: int) -> tuple[float, ...]:
    """Power coefficients of e^r on [-ln(2)/2, ln(2)/2]."""
    half = 0.5 * np.log(2.0)
    k = np.arange(terms + 1)
    series = np.where(k == 0, 1, 2) * iv(k, half)  # Chebyshev's, of e^(half u)
    power = np.polynomial.chebyshev.cheb2poly(series)
    return (1.0, *(float(c) for c in (power / half**k)[1:]))  # e^0 is 1


def _log_polynomial(terms: int) -> tuple[float, ...]:
    """Power coefficients in u = 2 m - 3 of ln(m), m in [1, 2]."""
    u = np.polynomial.chebyshev.chebpts1(4 * terms)
    fit = np.polynomial.chebyshev.chebfit(u, np.log(1.5 + 0.5 * u), terms)
    return tuple(float(c) for c in np.polynomial.chebyshev.cheb2poly(fit))


_ASIN = {dtype: _asin_remainder(n) for dtype, n in _ASIN_TERMS.items()}
_EXP = {dtype: _exp_polynomial(n) for dtype, n in _EXP_TERMS.items()}
_LOG = _log_polynomial(7)


# Long polynomials stand in a program dozens of times: traced once, they are copied from then on.
_inlined = partial(jax.jit, inline=True)


def horner(coefficients, x):
    """Value in ``x`` of the polynomial with ``coefficients``, the lowest first: two at least."""
    value = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * x + c
    return value


def in_halves(coefficients, x):
    """What `horner` gives, four coefficients at least, by its even and its odd powers: half as many
    operations that wait for the one before, for one more; the lowest power last, as there, so that
    it rounds as well.
    """
    lowest, *rest = coefficients
    even, odd = (horner(rest[first::2], x * x) for first in (0, 1))
    return (odd * x + even) * x + lowest


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
@_inlined
def angle(sin, cos):
    """Angle in [-pi/2, pi/2] of a given sine and cosine (>= 0), to rounding and without a branch.

    The smaller of the two is inverted. Its derivative is that on the circle, cos dsin - sin dcos.
    """
    far = sin * sin > 0.5
    w = jnp.where(far, cos, sin)
    z = w * w
    small = w + w * z * in_halves(_ASIN[jnp.dtype(z.dtype).name], 4 * z - 1)
    large = 0.5 * np.pi - small
    return jnp.where(far, jnp.where(sin < 0, -large, large), small)


@angle.defjvp
def _angle_jvp(primals, tangents):
    (sin, cos), (d_sin, d_cos) = primals, tangents
    return angle(sin, cos), cos * d_sin - sin * d_cos


@jax.custom_jvp
@_inlined
def exp(x):
    """e^x to rounding, for x below the logarithm of the largest number; half of XLA's cost."""
    dtype = jnp.dtype(x.dtype).name
    high, low = _LN2[dtype]
    x = larger(_EXP_LEAST[dtype], x)
    n = jnp.round(x * float(1 / np.log(2.0)))
    r = (x - n * high) - n * low
    power = in_halves(_EXP[dtype], r)
    # 2^n: beside a large number n lies in the lowest bits, from where it moves into the exponent
    info, bits = jnp.finfo(dtype), jnp.int64 if dtype == "float64" else jnp.int32
    beside = n + float(1.5 * 2.0**info.nmant + 2 ** (info.nexp - 1) - 1)
    scale = jax.lax.bitcast_convert_type(beside, bits) << info.nmant
    return power * jax.lax.bitcast_convert_type(scale, dtype)


@exp.defjvp
def _exp_jvp(primals, tangents):
    power = exp(*primals)
    return power, power * tangents[0]


def log(x):
    """Natural logarithm of a positive number in single precision, to 1e-6; carries no derivative.

    Half of XLA's cost, which also takes care of zero, negative and tiny numbers.
    """
    bits = jax.lax.bitcast_convert_type(x, jnp.int32)
    exponent = (bits >> 23) - 127
    mantissa = jax.lax.bitcast_convert_type((bits & 0x7FFFFF) | 0x3F800000, jnp.float32)  # [1, 2)
    return exponent.astype(jnp.float32) * float(np.log(2.0)) + horner(_LOG, 2 * mantissa - 3)
