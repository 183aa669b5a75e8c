"""Elementary functions of our own: to rounding, with derivatives, at the ends of their range."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.numerics.elementary import angle, exp, log

DIGIT = {"float64": 2.0**-52, "float32": 2.0**-23}


@pytest.mark.parametrize("dtype", DIGIT)
def test_the_exponential_is_good_to_a_digit(dtype):
    x = np.linspace(-650 if dtype == "float64" else -75, 2, 200_001).astype(dtype)
    found = np.asarray(jax.jit(exp)(x))
    true = np.exp(x.astype(np.longdouble))
    assert found.dtype == dtype
    assert np.max(np.abs(found / true - 1)) < DIGIT[dtype]


@pytest.mark.parametrize("dtype", DIGIT)
def test_the_exponential_at_its_ends(dtype):
    assert exp(jnp.zeros((), dtype)) == 1
    assert 0 <= exp(jnp.asarray(-np.inf, dtype)) < 1e-30
    assert jnp.isnan(exp(jnp.asarray(np.nan, dtype)))


def test_the_derivatives_of_the_exponential():
    assert jax.grad(exp)(0.7) == exp(jnp.asarray(0.7)) == jax.jvp(exp, (0.7,), (1.0,))[1]
    assert jax.grad(jax.grad(exp))(0.7) == exp(jnp.asarray(0.7))


@pytest.mark.parametrize("dtype", DIGIT)
def test_the_angle_is_good_to_a_digit(dtype):
    sin = np.linspace(-1, 1, 100_001).astype(dtype).astype(np.longdouble)
    cos = np.sqrt((1 - sin) * (1 + sin)).astype(dtype)
    found = np.asarray(jax.jit(angle)(sin.astype(dtype), cos))
    true = np.arctan2(sin, cos.astype(np.longdouble))
    assert found.dtype == dtype
    assert np.max(np.abs(found - true)) < 1.5 * DIGIT[dtype]
    assert np.all(found == -np.asarray(jax.jit(angle)(-sin.astype(dtype), cos)))


def test_the_derivative_of_the_angle_is_that_on_the_circle():
    value, slope = jax.jvp(lambda a: angle(jnp.sin(a), jnp.cos(a)), (1.1,), (1.0,))
    assert value == pytest.approx(1.1, rel=1e-15) and slope == pytest.approx(1.0, rel=1e-15)


def test_the_logarithm_of_a_positive_number():
    x = np.geomspace(1e-5, 1e5, 100_001).astype(np.float32)
    found = np.asarray(jax.jit(log)(x))
    assert np.max(np.abs(found - np.log(x.astype(float)))) < 2e-6
    assert log(jnp.float32(np.inf)) > 80  # as good as infinite where it is used
