"""Brute force up and down a range, of what a clock drives."""

from functools import partial
from typing import ClassVar

import jax.numpy as jnp
import pytest

import wiperjax
from wiperjax import AbstractSystem
from wiperjax.cycles import up_and_down
from wiperjax.systems.oscillator import Oscillator


class Pushed(AbstractSystem):
    """A swing that a shaken elastic wall pushes, once it comes as near."""

    unilateral: ClassVar[bool] = False
    a: float = 0.5

    def free_acceleration(self, t, q, v):
        depth = q[0] - 1.0 - 0.3 * jnp.sin(t)
        return (self.a - q[0] - 0.1 * v[0] - 50 * jnp.maximum(depth, 0.0),)

    def directions(self, t, q):
        return (0.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0] - 100.0


def test_what_is_driven_is_not_swept_without_its_period():
    """Each value, and each second look, began at a time 0 that the state knew nothing of: numbers
    some per cent wrong, without a word; so with a period that is not the belt's."""
    driven = Oscillator(belt=wiperjax.WipingBelt(0.3, 0.5))
    call = partial(up_and_down, driven, "load", [1.0, 1.1], settle=1.0, window=1.0)
    with pytest.raises(
        ValueError, match="^period must be given: .* of Oscillator change with time"
    ):
        call()
    with pytest.raises(ValueError, match="^period must be one after which .* but was 1.3 s$"):
        call(period=lambda system: 1.3)


@pytest.mark.slow
def test_a_drive_that_is_felt_on_the_way_only_is_not_swept_without_its_period():
    rest = (0.0,), (0.0,)
    with pytest.raises(ValueError, match="^period must be given"):
        up_and_down(Pushed(), "a", [0.9, 1.3], settle=100.0, window=20.0, initial_state=rest)
