"""No zero of a guard hides inside a step."""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Far, times, trajectory

from wiperjax import AbstractBeltSystem, Coulomb, RegimeTotals, Result, SteadyBelt
from wiperjax.engine.carry.problem import Integration, Recording, make_case
from wiperjax.engine.solve import begin, run, solution
from wiperjax.engine.trial.guard_proof import examine


class Parabola(Far):
    """Free fall through a switching function q - level: two roots, or none."""

    push: ClassVar[float] = -1.0
    level: float = 0.5

    def switches(self, t, q, v):
        return (self.level - q[0],)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-9])
def test_a_double_root_inside_one_step_is_found(depth):
    """The top of the flight is 0.5, at t = 1, inside the last step of a loose tolerance."""
    s = trajectory(Parabola(0.5 - depth), 3.0, ((0.0,), (1.0,)), 1e-3)
    reach = math.sqrt(2 * depth)
    np.testing.assert_allclose(times(s), [1 - reach, 1 + reach], rtol=0, atol=1e-7)
    s = trajectory(Parabola(0.5 + depth), 3.0, ((0.0,), (1.0,)), 1e-3)
    assert int(s.events.count) == 0


@jax.jit
def single_parabola(level):
    case = make_case(
        Parabola(level.astype(jnp.float32)),
        3.0,
        ((0.0,), (1.0,)),
        Integration(rtol=1e-3),
        Recording(max_events=8),
        dtype=jnp.float32,
    )
    return solution(case.problem, run(case.problem, begin(case)))


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1e-3, 1e-4, 1e-5])
def test_a_double_root_is_found_in_single_precision_too(depth):
    """As deep as its digits can tell: 1e-5 is ten times what the guard is off by rounding."""
    s = single_parabola(0.5 - depth)
    reach = math.sqrt(2 * depth)
    assert int(s.events.count) == 2
    # the level is good to 1e-7, the time of a shallow passage to this over its speed
    np.testing.assert_allclose(times(s), [1 - reach, 1 + reach], atol=5e-7 / reach)


class FlyingWaves(Far):
    """Motion through a switching function of three sines.

    It has no error at all: nothing but the guard itself limits the step.
    """

    size: tuple
    number: tuple
    phase: tuple

    def switches(self, t, q, v):
        waves = zip(self.size, self.number, self.phase, strict=True)
        return (sum(a * jnp.sin(k * q[0] + p) for a, k, p in waves),)


class SlidingWaves(FlyingWaves):
    """The same on a smooth table. Slip is expected to last as long as it did before: never so."""

    unilateral: ClassVar[bool] = False
    law: ClassVar[Coulomb] = Coulomb(0.0)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0]


@pytest.mark.parametrize("waves_of", [FlyingWaves, SlidingWaves])
@pytest.mark.long
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_no_zero_hides_between_the_nodes_of_a_step(dtype, waves_of):
    """Every crossing is found and none twice, where the guard changes faster than the motion."""

    @jax.jit
    def crossings(waves, rtol):
        case = make_case(
            waves_of(*(tuple(x.astype(dtype)) for x in waves)),
            10.0,
            ((0.0,), (1.0,)),
            Integration(rtol=rtol),
            Recording(max_events=64),
            dtype=jnp.dtype(dtype),
        )
        return solution(case.problem, run(case.problem, begin(case)))

    rng = np.random.default_rng(1)
    x = np.linspace(0, 10, 200_001)
    for _ in range(250):
        waves = rng.uniform([[0.3], [1], [0]], [[1], [8], [6.28]], (3, 3))
        size, number, phase = waves[:, :, None]
        g = np.sum(size * np.sin(number * x + phase), axis=0)
        true = x[np.flatnonzero(g[1:] * g[:-1] < 0)]
        for rtol in (1e-3, 1e-5):
            s = crossings(waves, rtol)
            assert Result(int(s.result)) == Result.FINISHED
            found = times(s)
            assert len(found) == len(true), (waves, rtol)
            # by what the tolerance leaves where two of them lie close together
            np.testing.assert_allclose(found, true, rtol=0, atol=2 * np.sqrt(rtol))


def test_rounding_at_the_start_of_slip_is_no_root():
    """Slip that begins with v_t ~ t^3 (float32, from a blade that was caught there for ever): over
    theta its guard starts at rounding, where its polynomial dips below zero."""

    def along(*values):
        nodes = tuple(jnp.float32(x) for x in values)
        unsure = jnp.float32(2.3e-4) * (nodes[-1] - nodes[0])
        return examine(nodes, jnp.int32(1), jnp.float32(0.1), unsure, False, 3, 1e-4)

    guard = along(-0.0, 1.4896451e-3, 1.28741749e-2, 4.19373922e-2, 9.30096507e-2)
    assert 0 < guard.start < guard.noise and min(guard.control) < -guard.error
    assert guard.murky and not guard.falls  # a shorter step will tell
    assert along(-0.0, 3.7164764e-4, 1.7030519e-3, 4.3886891e-3, 8.9159730e-3).proved


class Forced(AbstractBeltSystem):
    """Den Hartog's: x'' + x = 2 cos(w t) and a friction of 1, which stops it twice a period. It is
    ``offset`` away from 0, as far as digits are concerned."""

    unilateral: ClassVar[bool] = False
    frequency: float = 0.3
    offset: float = 0.0
    friction: Coulomb = Coulomb(1.0)

    def free_acceleration(self, t, q, v):
        return (self.offset - q[0] + 2 * jnp.cos(self.frequency * t),)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0


@jax.jit
def forced(frequency, offset, speed):
    """Time in stick, of the last 200 s, and result in single precision."""
    system = Forced(belt=SteadyBelt(speed), frequency=frequency, offset=offset)
    recording = Recording(observer=RegimeTotals(100.0), mark=100.0)
    start, control = ((offset,), (0.0,)), Integration(rtol=1e-5)
    case = make_case(system, 300.0, start, control, recording, dtype=jnp.float32)
    s = solution(case.problem, run(case.problem, begin(case)))
    return s.statistics.stick_time, s.result


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 1e-6, 1e-4])
@pytest.mark.parametrize("offset", [0.0, 10.0])
@pytest.mark.parametrize(("frequency", "share"), [(0.1, 0.60007), (0.3, 0.50253), (0.5, 0.17596)])
def test_what_time_does_to_a_cone_is_no_rounding(frequency, share, offset, speed):
    """In stick nothing moves, or less than a digit a step, and the force alone leads to release. It
    was taken for what rounding does to the position: stick of all the time, of 94 and 85 % of it.
    The shares are those of double precision."""
    stick, result = forced(frequency, offset, speed)
    assert Result(int(result)) == Result.FINISHED
    assert float(stick) / 200 == pytest.approx(share, abs=2e-4)


class Undefined(Parabola):
    """A switching function that is no number on a stretch of the way: long enough to be met."""

    def switches(self, t, q, v):
        hole = (q[0] > 0.2) & (q[0] < 0.42)
        return (jnp.where(hole, jnp.nan, 1.0 + q[0]),)


@pytest.mark.slow
@pytest.mark.parametrize("start", [-0.2, 0.0, 0.1, 0.19])
def test_a_guard_that_is_no_number_inside_a_step_is_no_proof(start):
    s = trajectory(Undefined(), 1.5, ((start,), (1.0,)), 1e-3)
    assert Result(int(s.result)) == Result.NON_FINITE
