import jax.numpy as jnp
import numpy as np
import pytest

from wiperjax.engine.observers import margins


class Alone:
    """An observer that gathers nothing."""

    start = 0.0

    def init(self, dtype, shape=()):
        return margins.RegimeTotals().init(dtype, shape)

    def stretch(self, record, stretch):
        return record


def margin(monkeypatch, guard, size):
    """That of one stretch, of a guard of five values."""
    monkeypatch.setattr(margins, "extremes", lambda stretch: (jnp.zeros(()),) * 2)
    monkeypatch.setattr(margins, "_ends", lambda stretch: ((jnp.zeros(()),) * 2,) * 2)
    watching = margins.Margins(Alone(), (0,))
    values = tuple(jnp.asarray(x) for x in guard)
    stretch = margins_stretch(values, jnp.asarray(size))
    return watching.stretch(watching.init(jnp.float64), stretch).margin


def margins_stretch(guard, size):
    from wiperjax.engine.observers.base import Stretch

    zero = jnp.zeros(())
    return Stretch(None, zero, zero, zero, zero, (), (guard,), (size,), ())


@pytest.mark.parametrize("length", [3.3e-10, 1e-12, 1e-14])
def test_a_blow_right_behind_the_end_of_a_step_is_no_grazing(monkeypatch, length):
    """Nodes of a stretch of 0.3 ns showed the bend of their rounding: a blow at full speed counted
    as grazing, and the derivatives of its cell were NaN."""
    place = 0.04 - 1.2028 * length * np.linspace(1, 0, 5)  # of a block that meets a wall at 0.04 m
    assert margin(monkeypatch, 0.04 - place, 0.08) > 0.1


def test_an_event_that_hardly_happens_is_grazing(monkeypatch):
    theta = np.linspace(0, 1, 5)
    depth = 1e-5
    root = 1 - np.sqrt(depth)  # of (1 - theta)^2 - depth
    guard = (1 - theta * root) ** 2 - depth
    assert np.isclose(margin(monkeypatch, guard, 1.0), depth, rtol=1e-6)
