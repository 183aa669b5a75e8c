"""Elementary functions that vectorise, where XLA's own cost more than the rest of a step."""

import jax
import jax.numpy as jnp
import numpy as np

_TERMS = 15  # asin's remainder has its nearest singularity 7 radii away: 13.9^-15 is below rounding


def _remainder_coefficients() -> tuple[float, ...]:
    """Power coefficients in u = 8 z - 1 of R(z) = (asin(w) - w) / w^3, z = w^2 in [0, 1/4]."""
    k = np.arange(60)
    # asin's own series, c_k = binom(2k, k) / (4^k (2k + 1)), without its first term
    ratio = np.concatenate([[1.0], np.cumprod((2 * k[1:] - 1) / (2 * k[1:]))])
    series = (ratio / (2 * k + 1))[1:]
    z = np.polynomial.chebyshev.chebpts1(4 * _TERMS) * 0.125 + 0.125
    values = np.polynomial.polynomial.polyval(z, series)
    fit = np.polynomial.chebyshev.chebfit(8 * z - 1, values, _TERMS)
    return tuple(float(c) for c in np.polynomial.chebyshev.cheb2poly(fit))


_REMAINDER = _remainder_coefficients()


@jax.custom_jvp
def arcsin(x):
    """Arc sine for |x| <= 1, to rounding, without a branch: half angles beyond |x| = 1/2."""
    size = jnp.abs(x)
    far = size > 0.5
    z = jnp.where(far, 0.5 * (1 - size), size * size)
    w = jnp.where(far, jnp.sqrt(z), size)
    u = 8 * z - 1
    tail = jnp.full_like(u, _REMAINDER[-1])
    for c in _REMAINDER[-2::-1]:
        tail = tail * u + c
    angle = w + w * z * tail
    return jnp.sign(x) * jnp.where(far, 0.5 * np.pi - 2 * angle, angle)


@arcsin.defjvp
def _arcsin_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    return arcsin(x), dx / jnp.sqrt((1 - x) * (1 + x))
