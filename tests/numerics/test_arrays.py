"""Writing into an array."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.numerics.arrays import check_settings, put

ARRAY = jnp.arange(5.0)


@pytest.mark.parametrize("search", ["jax_debug_nans", "jax_debug_infs"])
def test_a_search_for_what_fills_gaps_is_refused(search):
    """It ended in a traceback, as if something had gone wrong."""
    check_settings()
    jax.config.update(search, True)
    try:
        with pytest.raises(ValueError, match=f"^{search} must be False, .* but was True$"):
            check_settings()
    finally:
        jax.config.update(search, False)


def test_what_lies_beyond_the_end_is_dropped_and_the_dtype_stays():
    found = put(jnp.arange(5), jnp.asarray([3, 5, 5, 0]), jnp.asarray([7.0, 8.0, 9.0, 6.0]))
    np.testing.assert_array_equal(found, [6, 1, 2, 7, 4])
    assert found.dtype == jnp.arange(5).dtype


def test_its_derivative_is_written_likewise():
    at = jnp.asarray([3, 5, 0])

    def write(array, values):
        return put(array, at, values)

    given, moved = (ARRAY, jnp.asarray([7.0, 8.0, 9.0])), (10 * ARRAY, jnp.asarray([0.7, 0.8, 0.9]))
    _, slope = jax.jvp(write, given, moved)
    np.testing.assert_array_equal(slope, [0.9, 10.0, 20.0, 0.7, 40.0])
    # two writes, and nothing that goes through the whole of it
    program = str(jax.make_jaxpr(lambda *x: jax.jvp(write, given, x))(*moved))
    assert program.count("scatter[") == 2
    assert not any(word in program for word in ("gather[", "scatter-add["))
