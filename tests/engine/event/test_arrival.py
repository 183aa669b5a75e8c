"""Events in their order, and steps that end on the next of them."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Block, Far, times, trajectory

import wiperjax
from wiperjax import Result
from wiperjax.engine.carry.problem import Integration, make_case
from wiperjax.engine.solve import begin
from wiperjax.engine.step import advance
from wiperjax.systems.oscillator import Oscillator


class Gates(Far):
    """Motion past gates at given places: each is a switching function, once."""

    first: float = 0.3
    second: float = 0.7
    swapped: bool = False

    def switches(self, t, q, v):
        a, b = (q[0] - self.first), (q[0] - self.second)
        return (jnp.where(self.swapped, b, a), jnp.where(self.swapped, a, b))


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_two_events_in_one_step_come_in_order_of_time(swapped):
    s = trajectory(Gates(0.3, 0.3 + 1e-7, swapped), 1.0, ((0.0,), (1.0,)), 1e-4)
    np.testing.assert_allclose(times(s), [0.3, 0.3 + 1e-7], rtol=1e-12)
    s = trajectory(Gates(0.7, 0.2, swapped), 1.0, ((0.0,), (1.0,)), 1e-4)
    np.testing.assert_allclose(times(s), [0.2, 0.7], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_a_tie_is_two_events_at_one_time(swapped):
    s = trajectory(Gates(0.4, 0.4, swapped), 1.0, ((0.0,), (1.0,)))
    np.testing.assert_allclose(times(s), [0.4, 0.4], rtol=1e-12)
    assert Result(int(s.result)) == Result.FINISHED


@pytest.mark.slow
def test_an_event_is_foreseen():
    """The step before it tells where it will be: one step ends there, and none is taken back."""
    solve = jax.jit(
        lambda gate: wiperjax.solve(Gates(gate, 2.0), 1.0, initial_state=((0.0,), (1.0,)))
    )
    through, past = int(solve(2.0).steps), int(solve(0.9).steps)
    assert through >= 3  # 0.9 lies in a later step than the first
    assert past == through + 1


@pytest.mark.slow
def test_a_stay_that_repeats_itself_ends_in_one_step():
    """On a cycle of stick and slip a trial step ends on the next event at once; not before it."""
    case = make_case(Block(1.0, 0.5, belt=0.4), 100.0, ((0.0,), (0.4,)), Integration(rtol=1e-6))
    turn = jax.jit(lambda state: advance(case.problem, state))
    state, tries = begin(case), []
    while len(tries) < 24:
        before, state = state, turn(state)
        if state.events > before.events:
            tries.append(int(before.tries))
    assert max(tries[:4]) > 0
    assert tries[4:] == [0] * 20


@pytest.mark.long
def test_a_stick_that_is_released_to_either_side_in_turn():
    """Den Hartog's problem, on the belt: what a stay before foretells is the other side of the
    cone, and a step may end within a tick of the clock before this one. One cell in thirty died of
    that (STEP_TOO_SMALL); after hours of a clock one in forty did still, whose Newton swung by the
    clock's last digit in steps of two ticks."""
    rate, turns = 2.5, 80  # the last half of them is observed
    period = 2 * np.pi / rate

    @jax.jit
    @partial(jax.vmap, in_axes=(0, None))
    def solve(load, start):
        belt = wiperjax.WipingBelt(rate, 1 / period, 0.5 * np.pi)
        block = Oscillator(load=load, friction=wiperjax.Coulomb(1.0), belt=belt)
        times = {"start": start, "statistics_start": start + turns * period}
        s = wiperjax.solve(block, 2 * turns * period, max_events=0, **times)
        return s.result, s.statistics.stick_time, s.statistics.stick_count

    for start in (0.0, 4000 * period):
        result, stick, count = map(np.asarray, solve(jnp.linspace(3.1, 4.7, 200), start))
        assert np.all(result == Result.FINISHED) and np.all(count == 2 * turns)
        assert np.abs(np.diff(stick, 2)).max() < 1e-2 * stick.mean()  # every period has its sticks
