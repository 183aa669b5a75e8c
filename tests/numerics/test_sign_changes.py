"""Changes of sign on a grid: all that the whole grid shows, for a part of its values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.numerics.sign_changes import PARTS, sign_changes

STRETCHES = 32
GRID = np.linspace(1.0, -1.0, PARTS * STRETCHES + 1)


def on_the_whole_grid(function, count):
    """Numbers of the intervals over which the sign changes, of all values."""
    value, has, room = (np.asarray(x) for x in jax.vmap(function)(jnp.asarray(GRID)))
    up, has = value >= 0, has & (room > 0)
    return np.flatnonzero((up[1:] != up[:-1]) & has[1:] & has[:-1])[:count]


def found(function, count):
    changes = jax.jit(lambda: sign_changes(function, 1.0, -1.0, STRETCHES, count))()
    there = np.asarray(changes.exists)
    assert np.all(there == (np.arange(count) < there.sum()))
    at = np.asarray(changes.before)[there]
    np.testing.assert_allclose(np.asarray(changes.after)[there], at + GRID[1] - GRID[0], rtol=1e-12)
    for place, falls in zip(at, np.asarray(changes.falls)[there], strict=True):
        assert (function(jnp.asarray(place))[0] >= 0) == falls
    return np.searchsorted(-GRID, -at - 1e-9)


def always(function):
    return lambda x: (function(x), jnp.asarray(True), jnp.asarray(1.0))


@pytest.mark.slow
def test_roots_of_a_polynomial():
    roots = np.array([0.91, 0.4, -0.013, -0.5])
    function = always(lambda x: jnp.prod(x - jnp.asarray(roots)))
    for count in (1, 3, 6):
        np.testing.assert_array_equal(found(function, count), on_the_whole_grid(function, count))
    assert len(found(function, 6)) == 4


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.01, 0.02, 0.06])
@pytest.mark.parametrize("middle", [-0.489, 0.011, 0.611])
def test_a_dip_between_two_places_that_are_looked_at(middle, apart):
    for dip in (lambda x: x**2 - (0.5 * apart) ** 2, lambda x: jnp.abs(x) - 0.5 * apart):
        function = always(lambda x, dip=dip: dip(x - middle))
        assert len(on_the_whole_grid(function, 2)) == 2
        np.testing.assert_array_equal(found(function, 2), on_the_whole_grid(function, 2))


@pytest.mark.slow
@pytest.mark.parametrize("apart", [2e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("middle", [-0.489, 0.0002, 0.0623, 0.611])
def test_two_roots_in_one_interval_where_they_are_born(middle, apart):
    """The grid is 0.0078 wide; they lie beside its places, or astride one of those looked at."""
    for dip in (lambda x: x**2 - (0.5 * apart) ** 2, lambda x: jnp.abs(x) - 0.5 * apart):
        function = always(lambda x, dip=dip: dip(x - middle))
        changes = sign_changes(function, 1.0, -1.0, STRETCHES, 3)
        assert list(np.asarray(changes.exists)) == [True, True, False]
        assert list(np.asarray(changes.falls)[:2]) == [True, False]
        for k, root in enumerate((middle + 0.5 * apart, middle - 0.5 * apart)):
            assert changes.after[k] - 1e-9 < root < changes.before[k] + 1e-9


def test_a_pole_is_no_root_and_what_lies_beside_it_is_seen():
    """Beyond 0.3 there is no value; a root lies 0.01 before it, another beyond."""

    def function(x):
        return (x - 0.29) * (x - 0.5) / (x - 0.301), x < 0.3, jnp.asarray(1.0)

    assert len(on_the_whole_grid(function, 3)) == 1
    np.testing.assert_array_equal(found(function, 3), on_the_whole_grid(function, 3))


def test_a_narrow_stretch_with_a_value_between_two_without():
    def function(x):
        return x - 0.3103, jnp.abs(x - 0.3103) < 0.02, jnp.asarray(1.0)

    assert len(on_the_whole_grid(function, 2)) == 1
    np.testing.assert_array_equal(found(function, 2), on_the_whole_grid(function, 2))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [0.3101, 0.3104, 0.3111, 0.35])
def test_a_root_beside_the_end_of_what_it_needs_is_seen_and_one_beyond_is_none(edge):
    """Both lie in one interval of the grid, 0.0078 wide."""

    def function(x):
        return x - 0.31, jnp.asarray(True), edge - x

    assert len(found(function, 2)) == 1
    assert len(found(lambda x: (x - 0.31, jnp.asarray(True), x - edge), 2)) == 0


def test_none():
    assert len(found(always(lambda x: 1.0 + x**2), 2)) == 0


def test_ranks_are_not_promoted():
    """With ``jax_numpy_rank_promotion = "raise"`` steady slip and modes of a wiper were refused, in
    words about shapes that no caller has seen."""
    with jax.numpy_rank_promotion("raise"):
        changes = sign_changes(lambda x: (x, x < 2, x + 2), 1.0, -0.9, STRETCHES, 3)
    assert np.asarray(changes.exists).tolist() == [True, False, False]
