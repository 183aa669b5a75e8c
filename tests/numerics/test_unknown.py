"""What has no derivative: NaN where it is asked for, and nowhere else."""

import jax
import jax.numpy as jnp
import numpy as np

from wiperjax.numerics.unknown import unknown


def both(x, where):
    """A number that hangs on no unknown one, and one that is unknown where so."""
    return 3 * x, unknown(2 * x, where)


def test_only_what_is_unknown_has_no_derivative_in_either_mode():
    """Backwards all derivatives of a motion with a jam were NaN: 0 times NaN is."""
    for where, slope in ((True, np.nan), (False, 2.0)):
        for way in (jax.jacfwd, jax.jacrev):
            found = jax.jit(way(both))(1.0, where)
            np.testing.assert_array_equal(jnp.stack(found), [3.0, slope])


def test_so_it_is_of_lanes():
    x, where = jnp.ones(2), jnp.array([True, False])
    for way in (jax.jacfwd, jax.jacrev):
        known, not_known = jax.vmap(way(both))(x, where)
        np.testing.assert_array_equal(known, [3.0, 3.0])
        np.testing.assert_array_equal(not_known, [np.nan, 2.0])
        np.testing.assert_array_equal(jax.vmap(way(both), (0, None))(x, True)[1], [np.nan, np.nan])


def test_it_goes_through_loops_and_once_more():
    def turned(x):
        def turn(carry):
            return carry[0] + 1, unknown(2 * carry[1], carry[0] == 5)

        return jax.lax.while_loop(lambda c: c[0] < 3, turn, (0, x))[1]

    assert float(jax.jvp(turned, (1.0,), (1.0,))[1]) == 8.0
    square = jax.jacfwd(jax.jacfwd(lambda x: unknown(x * x, False)))
    assert float(square(1.0)) == 2.0
