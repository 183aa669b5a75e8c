"""What is differentiated forwards only is as it was, and says what to do where it is not."""

import jax
import jax.numpy as jnp
import pytest

from wiperjax.numerics.forwards_only import forwards_only


def cube(x):
    return forwards_only({"cube": x**3, "count": 2, "sign": jnp.sign(x) > 0}, "go forwards")


def slope(x):
    return jax.jvp(lambda x: cube(x)["cube"], (x,), (jnp.ones_like(x),))[1]


def test_values_and_forward_derivatives_pass_through():
    x = jnp.arange(3.0)
    assert cube(x)["count"] == 2 and cube(x)["cube"].tolist() == [0.0, 1.0, 8.0]
    for derived in (jax.vmap(slope), jax.jit(jax.vmap(slope)), jax.vmap(jax.jacfwd(slope))):
        assert derived(x).tolist() in ([0.0, 3.0, 12.0], [0.0, 6.0, 12.0])
    assert "forwards_only" not in jax.jit(slope).lower(2.0).as_text()


@pytest.mark.parametrize("backwards", [jax.grad, jax.jacrev, lambda f: jax.jit(jax.grad(f))])
def test_backwards_it_says_what_to_do(backwards):
    with pytest.raises(ValueError, match="^go forwards"):
        backwards(lambda x: cube(x)["cube"])(2.0)
