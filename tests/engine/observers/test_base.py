"""What an observer of one's own gives back."""

import jax.numpy as jnp
import pytest

import wiperjax
from wiperjax.engine.observers.base import AbstractObserver
from wiperjax.systems.oscillator import Oscillator


class Odd(AbstractObserver):
    """It returns another record than it was given."""

    odd: str

    def init(self, dtype, shape=()):
        return jnp.zeros(shape, dtype)

    def stretch(self, record, stretch):
        return (record, record) if self.odd == "stretch" else record

    def event(self, record, happening):
        return (record, record) if self.odd == "event" else record


@pytest.mark.parametrize("method", ["stretch", "event"])
def test_a_record_of_another_structure_is_one_line(method):
    """JAX said that pytrees differ at a key path, and of neither class nor method."""
    with pytest.raises(ValueError) as caught:
        wiperjax.solve(Oscillator(), 0.1, observer=Odd(method))
    must = "must return a record of the structure that init returns, PyTreeDef(*)"
    assert str(caught.value) == f"Odd.{method} {must}, but was PyTreeDef((*, *))"
