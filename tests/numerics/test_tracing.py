"""What is traced once is called as often as it stands, with the same answers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.numerics.known_zeros import absent, plus, times
from wiperjax.numerics.tracing import traced_once


@pytest.fixture
def counted():
    """A function of a factor and a number, traced once, and the factors that it was traced for."""
    seen = []

    @traced_once
    def wave(factor, x):
        seen.append(factor)
        return jnp.sin(x), times(factor, jnp.cos(x))

    return wave, seen


def many(wave, factor, x):
    for _ in range(5):
        x, other = wave(factor, x)
        x = plus(x, other)
    return x


def plain(factor, x):
    for _ in range(5):
        x = np.sin(x) + factor * np.cos(x)
    return x


def test_it_is_traced_for_each_kind_of_arguments_only(counted):
    wave, seen = counted
    for factor in (0.5, 2.0, 0.5):  # numbers of the program: another one each
        found = jax.jit(lambda x, factor=factor: many(wave, factor, x))(0.3)
        assert float(found) == pytest.approx(plain(factor, 0.3), rel=1e-15)
    assert seen == [0.5, 2.0]


def test_what_is_known_to_be_zero_stays_known(counted):
    wave, _ = counted

    def program(x):
        _, other = wave(0, x)
        assert absent(other)
        return x

    jax.jit(program)(0.3)


def test_batches_and_derivatives_of_it_are_those_of_the_function_itself(counted):
    wave, seen = counted
    x = jnp.linspace(-1.0, 1.0, 7)
    slope = jax.jit(jax.vmap(jax.grad(lambda x: many(wave, 0.5, x))))(x)
    step = 1e-6
    difference = (plain(0.5, x + step) - plain(0.5, x - step)) / (2 * step)
    np.testing.assert_allclose(slope, difference, atol=1e-9)
    assert len(seen) == 1


def test_outside_of_a_trace_it_is_the_function_itself(counted):
    wave, seen = counted
    many(wave, 0.5, jnp.asarray(0.3))
    assert len(seen) == 5


def test_another_backend_is_traced_anew(counted, monkeypatch):
    """What is written may depend on it (`fusion_barrier`)."""
    wave, seen = counted
    jax.jit(lambda x: many(wave, 0.5, x)).trace(0.3)
    monkeypatch.setattr(jax, "default_backend", lambda: "another")
    jax.jit(lambda x: many(wave, 0.5, x)).trace(0.3)
    assert len(seen) == 2
