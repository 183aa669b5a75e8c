"""Branches of cycles of blows, where they end."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from own_systems import Falling, Oscillator

import wiperjax
from wiperjax import parameter
from wiperjax.cycles.branch import step
from wiperjax.cycles.branch.follow import follow
from wiperjax.cycles.find import find_cycle


class Hammer(Oscillator):
    """The block, with a stop in its way."""

    stops = (0,)
    wall: float = parameter(0.7, "m", above=0)
    restitution: float = parameter(0.3, low=0, high=1)
    friction: wiperjax.AbstractFriction = Falling(1.0, 2.0)

    def switches(self, t, q, v):
        return (self.wall - q[0],)

    def rebound(self, stop, t, q, v, closed):
        return (-self.restitution * v[0],)


@pytest.mark.long
def test_a_cycle_shrinks_onto_the_stop_to_which_steady_slip_comes():
    """From the fold of a cycle of stick. Friction in steady slip is the spring's force at the stop
    there, 1 / (1 + 2 V) = 0.7: the walk went on to 300 points, each a little smaller."""
    cycle = find_cycle(Hammer(), settle=100.0, over="belt_speed")
    branch = follow(cycle, 0.1, 0.3, step=0.2)
    kinds = [s.kind for s in branch.special]
    assert kinds == ["boundary_equilibrium", "grazing_sliding_fold"]
    assert branch.special[0].parameter == pytest.approx(3 / 14, abs=3e-6)
    assert branch.ends == ("steady slip comes to a stop", "the end of the range")
    assert branch.cycles[0].word == "blow" and len(branch.cycles) < 150


def test_rest_at_a_stop_is_no_cycle_of_a_branch(monkeypatch):
    """Near such an end a state of rest closes, too: the branch ended with an error of numpy's."""
    unknowns = np.zeros(3)
    rest = SimpleNamespace(unknowns=unknowns, motion=SimpleNamespace(by_period=np.zeros(2)))
    monkeypatch.setattr(step, "correct", lambda *_: rest)
    here: Any = SimpleNamespace(point=SimpleNamespace(where=None, phase=0.0, unknowns=unknowns))
    family: Any = SimpleNamespace(clock=None)
    assert step.near(family, here, unknowns, np.ones(3)) is None
