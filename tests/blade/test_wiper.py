"""The lip at the ends of its shoulders."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax import Event, Result, SteadyBelt, Wiper


@eqx.filter_jit
def overloaded(wiper):
    return wiperjax.solve(wiper, 0.05, rtol=1e-9, max_events=32)


@pytest.mark.long
@pytest.mark.parametrize("side", [-1, 1])
def test_a_lip_meets_its_shoulder_and_collapses_behind_it(side):
    """One switch watches both ends of the stretch that the lip is in, and tells them apart."""
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=side * np.deg2rad(40.0),
        normal_load=40.0,
        shoulder_stiffness=0.1,
        shoulder_angle=np.float64(0.4),
    )
    s = overloaded(wiper)
    assert Result(int(s.result)) == Result.COLLAPSED
    count = int(s.events.count)
    kinds = [Event(int(k)) for k in s.events.kind[:count]]
    assert kinds[-1] == Event.COLLAPSE and Event.COLLAPSE not in kinds[:-1]
    assert kinds.count(Event.KINK) % 2 == 1  # it ends behind a shoulder
    lean = np.rad2deg(np.arcsin(float(s.final_position[0]) / 6e-3))
    assert lean == pytest.approx(side * 89.0, abs=1e-6)
    # without a shoulder in its way it goes straight to the end
    stiff = eqx.tree_at(lambda w: w.shoulder_angle, wiper, np.float64(3.0))
    s = overloaded(stiff)
    kinds = [Event(int(k)) for k in s.events.kind[: int(s.events.count)]]
    assert Event.KINK not in kinds and kinds[-1:] == [Event.COLLAPSE]


@pytest.mark.long
def test_an_attack_angle_behind_the_collapse_does_not_move_it():
    """Neither shoulder can be reached: the lip collapses at its own angle."""
    wiper = Wiper(attack_angle=np.deg2rad(80.0), shoulder_angle=0.1, collapse_angle=np.pi / 3)
    s = wiperjax.solve(wiper, 0.05, initial_state=((0.0, 0.0), (0.0, 0.0)), max_events=32)
    assert Result(int(s.result)) == Result.COLLAPSED
    assert np.rad2deg(np.arcsin(float(s.final_position[0]) / 6e-3)) == pytest.approx(60, abs=1e-4)
    with pytest.raises(ValueError, match="must lie where the model holds"):
        edge = 6e-3 * np.sin(np.pi / 3)
        wiperjax.simulate(wiper, 0.05, initial_state=((edge * 1.001, 0.0), (0.0, 0.0)))


@pytest.mark.parametrize("speed", [1, np.int64(1), np.array(1)])
def test_a_belt_of_whole_metres_a_second_moves_like_any_other(speed):
    found = SteadyBelt(speed).motion(jnp.zeros(()), 0)
    assert [float(x) for x in found] == [1.0, 0.0]


@pytest.mark.parametrize("name", ["piece", "sides", "constants"])
def test_what_the_engine_sets_is_no_argument(name):
    """A lip that begins beyond a shoulder where nothing says so would have another moment."""
    with pytest.raises(TypeError, match=name):
        Wiper(**{name: None})
    assert getattr(Wiper(), name) in (0, None)
    assert name not in repr(Wiper(attack_angle=0.1).prepared())
