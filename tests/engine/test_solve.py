"""Trajectories alone and in batches: results, logs, tolerances, derivatives and compilations."""

import importlib
import math

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from blades import draw, lane
from matching import BLADE, engine, engines
from problems import stop_oscillator
from systems import Ball, Puck, StopOscillator, events, times, trajectory

import wiperjax
from wiperjax import Event, Regime, Result, SteadyBelt, TrapezoidBelt, Wiper, WipingBelt
from wiperjax.engine.arguments import from_start
from wiperjax.engine.carry.problem import Integration, make_case
from wiperjax.engine.solve import begin, run
from wiperjax.systems.oscillator import Oscillator

LANES = 16  # as many as `test_against_reference` has: one program


@pytest.mark.long
def test_a_lane_equals_the_same_trajectory_alone_in_any_order_with_failing_neighbours():
    values, speed = draw(LANES)
    values["normal_load"][2] = np.nan  # cannot be computed
    values["attack_angle"][5] = 1.2  # collapses
    budget = np.full(LANES, 1_000_000)
    budget[3] = 40
    x = BLADE["lip_length"] * np.sin(values["attack_angle"])
    starts = np.stack([x, 0 * x, 0 * x, 0 * x], axis=-1)
    given = {name: np.full(LANES, value) for name, value in BLADE.items()} | values
    together = engines(given, SteadyBelt(speed), starts, 0.02, budget)
    order = np.random.default_rng(0).permutation(LANES)
    turned = {name: x[order] for name, x in given.items()}
    shuffled = engines(turned, SteadyBelt(speed[order]), starts[order], 0.02, budget[order])
    assert Result(int(together.result[2])) == Result.NON_FINITE
    assert Result(int(together.result[5])) == Result.COLLAPSED
    assert Result(int(together.result[3])) == Result.STEP_BUDGET_SPENT
    for i in range(LANES):
        belt, most = SteadyBelt(speed[i]), int(budget[i])
        alone = engine(lane(given, i), belt, starts[i], 0.02, max_steps=most)
        for other in (lane(together, i), lane(shuffled, int(np.flatnonzero(order == i)[0]))):
            assert int(alone.result) == int(other.result)
            if i == 2:
                continue
            if i != 3:
                assert [k for _, k in events(alone)] == [k for _, k in events(other)]
                np.testing.assert_allclose(times(alone), times(other), rtol=1e-8, atol=1e-12)
                np.testing.assert_allclose(
                    alone.final_position, other.final_position, rtol=0, atol=1e-10
                )
    # the place in the batch changes nothing at all
    for i in range(LANES):
        j = int(np.flatnonzero(order == i)[0])
        np.testing.assert_array_equal(together.final_position[i], shuffled.final_position[j])
        np.testing.assert_array_equal(together.events.time[i], shuffled.events.time[j])


@pytest.mark.slow
def test_one_compilation_for_all_parameters():
    traces = []

    @jax.jit
    def solve(gravity, e, height, rtol):
        traces.append(1)
        return wiperjax.solve(
            Ball(gravity, e), 1.0, initial_state=((height,), (0.0,)), rtol=rtol, max_events=8
        )

    for e in (0.1, 0.5, 0.9):
        solve(9.81, e, 1.0, 1e-8)
        solve(1.0 + e, 0.3, 0.3, 1e-5)
    assert len(traces) == 1 and solve._cache_size() == 1


def test_result_codes():
    ball = Ball(9.81, 0.5)
    start = ((1.0,), (0.0,))
    assert Result(int(trajectory(ball, 3.0, start).result)) == Result.FINISHED
    s = trajectory(ball, 3.0, start, max_steps=3)
    assert Result(int(s.result)) == Result.STEP_BUDGET_SPENT and int(s.steps) == 3
    # it gets nowhere: not the whole budget is spent on it
    s = trajectory(ball, 3.0, start, max_step=1e-9, max_steps=10**6)
    assert Result(int(s.result)) == Result.STEP_TOO_SMALL and int(s.steps) < 10**4
    # nor where each step ends with an event
    s = trajectory(Ball(9.81, 1.0), 1e6, ((0.0,), (1e-5,)), max_steps=10**6)
    assert Result(int(s.result)) == Result.STEP_TOO_SMALL and int(s.steps) < 10**4
    s = trajectory(ball, 3.0, ((-0.1,), (0.0,)))
    assert Result(int(s.result)) == Result.INCONSISTENT_START
    s = trajectory(Ball(np.nan, 0.5), 3.0, start)
    assert Result(int(s.result)) == Result.NON_FINITE
    s = trajectory(ball, 3.0, ((np.nan,), (0.0,)))
    assert Result(int(s.result)) == Result.NON_FINITE
    # flights shorter than the clock can tell, with completion switched off
    s = trajectory(ball, 3.0, start, zeno_time=0.0)
    assert Result(int(s.result)) == Result.ZENO_UNRESOLVED
    assert s.event_overflow == (s.events.count > 256)


@pytest.mark.slow
def test_samples_outside_of_the_motion_are_not_known():
    """Before its start they were the first step's polynomial, continued: 1e23 m."""

    @jax.jit
    def fall(times):
        start = ((1.0,), (0.0,))
        return wiperjax.solve(
            Ball(9.81, 0.5), 0.4, initial_state=start, start=0.5, sample_times=times
        ).samples

    found = fall(np.array([0.0, 0.4, 0.5, 0.6, 0.9, 1.0]))
    known = np.array([False, False, True, True, True, False])
    np.testing.assert_array_equal(np.isfinite(found.position[0]), known)
    np.testing.assert_array_equal(found.regime >= 0, known)
    fallen = np.array([0.0, 0.1, 0.4])
    np.testing.assert_allclose(found.position[0][2:5], 1.0 - 0.5 * 9.81 * fallen**2, rtol=1e-9)


@pytest.mark.slow
def test_a_sample_that_rounding_puts_before_the_start_is_one_at_the_start():
    """It was flight without force, as of times within a sequence of impacts."""
    rest = {"initial_state": ((0.0,), (0.0,)), "start": 0.1 * 3}
    found = wiperjax.solve(Ball(9.81, 0.5), 1.0, sample_times=[0.3, 0.5], **rest).samples
    assert 0.3 < rest["start"]
    np.testing.assert_array_equal(found.regime, [Regime.SLIP_POS] * 2)  # without friction
    np.testing.assert_allclose(found.normal_force, [9.81] * 2)


def test_what_is_earlier_than_rounding_is_before_the_start():
    """A thousandth of a second before 1e6 s was answered by the state at the start."""
    rest = {"initial_state": ((0.0,), (0.0,))}
    words = r"^sample_times must begin at start .1000000 s. or later, but began at 999999.999$"
    with pytest.raises(ValueError, match=words):
        wiperjax.solve(Ball(9.81, 0.5), 1.0, start=1e6, sample_times=[1e6 - 1e-3, 1e6], **rest)
    single = np.float32(0.7)  # below 0.7, as a start or as a sample
    np.testing.assert_array_equal(from_start(np.array([single]), 0.7), [0.7])
    after = np.nextafter(single, np.float32(1))
    np.testing.assert_array_equal(from_start(np.array([0.7]), after), [after])
    np.testing.assert_array_equal(from_start(np.array([0.7 - 1e-9]), 0.7), [0.7 - 1e-9])


@pytest.mark.long
def test_a_sample_at_the_very_start_moves_with_its_time():
    @jax.jit
    def slope(first):
        def place(first):
            times = jnp.stack([first, 0.1])
            start = ((1.0,), (0.5,))
            s = wiperjax.solve(Ball(9.81, 0.5), 0.2, initial_state=start, sample_times=times)
            return s.samples.position[0]

        return jax.jacfwd(place)(first)

    np.testing.assert_allclose(slope(0.0), [0.5, 0.0], rtol=1e-12)


class Thrown(Ball):
    """It swings to and fro as it bounces; its output is seen from a clock."""

    def free_acceleration(self, t, q, v):
        return (-400.0 * q[0], -self.gravity)

    def directions(self, t, q):
        return (0.0, 0.0), (0.0, 1.0)

    def gap(self, t, q):
        return q[1]

    def output(self, t, q, v):
        return v[0] - jnp.sin(t)


@pytest.mark.slow
def test_samples_within_a_sequence_of_impacts_and_statistics_that_begin_there():
    """Samples were the next step's polynomial, continued backwards (1e6 m), and their regime that
    of it, though totals count flight; of a sequence in which the statistics begin, all was lost."""
    last, begin = 3 * np.sqrt(2 / 9.81), 1.34  # e = 1/2: the sequence ends there

    @jax.jit
    def thrown(times):
        return wiperjax.solve(
            Thrown(9.81, 0.5),
            3.0,
            initial_state=((1.0, 1.0), (0.0, 0.0)),
            zeno_time=0.02,
            sample_times=times,
            statistics_start=begin,
        )

    found = thrown(np.linspace(last - 0.03, last - 1e-3, 12))
    assert Event.ZENO in np.asarray(found.events.kind)
    assert np.max(np.abs(found.samples.position[0])) <= 1.0 + 1e-6
    assert np.all(found.samples.regime == Regime.FLIGHT)
    assert np.all(found.samples.normal_force == 0) and np.all(found.samples.friction_force == 0)
    lasted = found.statistics.stick_time + found.statistics.slip_time + found.statistics.flight_time
    assert float(lasted) == pytest.approx(3.0 - begin, rel=1e-12)


@pytest.mark.slow
def test_single_precision_goes_with_an_output_that_knows_the_time():
    case = make_case(Thrown(9.81, 0.5), 1.0, ((1.0, 1.0), (0.0, 0.0)), dtype=jnp.float32)
    found = jax.jit(lambda case: run(case.problem, begin(case)))(case)
    assert Result(int(found.result)) == Result.FINISHED
    assert found.observed.output_integral.dtype == jnp.float32


@pytest.mark.long
@pytest.mark.parametrize("belt", [WipingBelt(0.4, 0.1), TrapezoidBelt(0.4, 0.1, 2.0)])
def test_single_precision_goes_with_a_belt_that_knows_the_time(belt):
    """Its speed has the time's double precision: the work of friction ended in a traceback."""
    found = {}
    for dtype in (jnp.float32, jnp.float64):
        integration = Integration(rtol=1e-5)
        case = make_case(Oscillator(belt=belt), 20.0, integration=integration, dtype=dtype)
        state = jax.jit(lambda case: run(case.problem, begin(case)))(case)
        assert Result(int(state.result)) == Result.FINISHED
        found[dtype] = float(state.observed.friction_work)
    assert found[jnp.float32] == pytest.approx(found[jnp.float64], rel=1e-3)


def test_elastic_ball_never_rests_and_keeps_its_energy():
    s = trajectory(Ball(9.81, 1.0), 40.0, ((1.0,), (0.0,)))
    fall = math.sqrt(2 / 9.81)
    exact = fall * (1 + 2 * np.arange(int(s.events.count)))
    np.testing.assert_allclose(times(s), exact, rtol=1e-9)
    assert {k for _, k in events(s)} == {Event.IMPACT}


@pytest.mark.long
def test_event_log_overflow_is_flagged_and_counted():
    s = trajectory(Ball(9.81, 0.5), 3.0, ((1.0,), (0.0,)), max_events=4)
    full = trajectory(Ball(9.81, 0.5), 3.0, ((1.0,), (0.0,)))  # 256
    assert bool(s.event_overflow) and not bool(full.event_overflow)
    assert int(s.events.count) == int(full.events.count) > 4
    np.testing.assert_array_equal(s.events.time, full.events.time[:4])
    none = trajectory(Ball(9.81, 0.5), 3.0, ((1.0,), (0.0,)), max_events=0)
    assert bool(none.event_overflow) and int(none.events.count) == int(full.events.count)
    np.testing.assert_array_equal(s.final_position, full.final_position)


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="explicit"):
        trajectory(Ball(), 1.0, ((1.0,), (0.0,)), solver=diffrax.Euler())
    with pytest.raises(ValueError, match="their lengths were 1 and 2"):
        trajectory(Ball(), 1.0, ((1.0,), (0.0, 0.0)))
    with pytest.raises(ValueError, match="no default start"):
        wiperjax.solve(Ball(), 1.0)
    with pytest.raises(ValueError, match="^start must lie .* but was 1e\\+09 s"):
        wiperjax.solve(Wiper(belt=WipingBelt(0.3, 100.0)), 0.02, start=1e9)


@pytest.mark.long
def test_another_value_compiles_nothing(monkeypatch):
    """By itself a call traced its loop again, 0.8 s, and compiled it anew for every other number,
    3 s: 7 s with a derivative, 19 s backwards."""

    def end(speed, mass, **how):
        block = Oscillator(mass=mass, belt=SteadyBelt(speed))
        return wiperjax.solve(block, 2.0, max_events=4, **how).final_position[0]

    def forwards(speed, mass):
        return jax.jvp(lambda x: end(speed, x), (mass,), (1.0,))

    def backwards(speed, mass):
        return jax.value_and_grad(lambda x: end(speed, x, reverse=True, max_steps=100))(mass)

    for compute in (end, forwards, backwards):
        compute(0.5, 1.0)
    # what is traced needs it
    monkeypatch.delattr(importlib.import_module("wiperjax.engine.solve"), "begin")
    alone, forwards_too, backwards_too = (
        np.asarray(compute(0.6, 1.1)) for compute in (end, forwards, backwards)
    )
    monkeypatch.undo()
    value, slope = forwards_too
    np.testing.assert_allclose(backwards_too, forwards_too, rtol=1e-9)
    np.testing.assert_allclose([value, jax.jit(end)(0.6, 1.1)], alone, rtol=1e-12)
    above, below = end(0.6, 1.1 + 1e-5), end(0.6, 1.1 - 1e-5)
    np.testing.assert_allclose(slope, (above - below) / 2e-5, rtol=1e-5)


@pytest.mark.slow
def test_derivative_of_an_event_time():
    """d/dh of the time of fall sqrt(2 h / g), and of the rebound after it."""

    def fall(height):
        s = wiperjax.solve(
            Ball(9.81, 0.5), 0.6, initial_state=((height,), (0.0,)), rtol=1e-10, max_events=4
        )
        return s.events.time[0], s.final_velocity[0]

    height = 0.8
    _, (slope, rebound) = jax.jit(lambda h: jax.jvp(fall, (h,), (1.0,)))(height)
    assert float(slope) == pytest.approx(1 / math.sqrt(2 * 9.81 * height), rel=1e-9)
    # v = e sqrt(2 g h) - g (t - t1)
    exact = 0.5 * 9.81 / math.sqrt(2 * 9.81 * height) + 9.81 / math.sqrt(2 * 9.81 * height)
    assert float(rebound) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-12])
def test_any_tolerance(rtol):
    problem = stop_oscillator()
    s = trajectory(problem.system, problem.duration, problem.start, rtol)
    assert Result(int(s.result)) == Result.FINISHED
    np.testing.assert_allclose(
        events(s, Event.IMPACT), problem.times, rtol=max(30 * rtol, 1e-12), atol=0
    )


def test_a_puck_that_lands_sliding_stops_and_sticks():
    """Impact with friction, slip, capture: all closed forms of school physics."""
    mu, g = 0.25, 10.0
    s = trajectory(Puck(mu=mu, gravity=g), 3.0, ((0.0, 0.2), (3.0, 0.0)))
    fall = math.sqrt(2 * 0.2 / g)
    after = 3.0 - mu * g * fall
    expected = [(fall, Event.IMPACT), (fall + after / (mu * g), Event.CAPTURE)]
    found = events(s)
    assert [k for _, k in found][-1] == Event.CAPTURE
    np.testing.assert_allclose([found[0][0], found[-1][0]], [e[0] for e in expected], rtol=1e-9)


def test_stop_on_the_other_side_is_the_mirror_image():
    a = trajectory(StopOscillator(load=0.1, restitution=0.7), 9.0, ((1.0,), (0.0,)))
    b = trajectory(StopOscillator(load=-0.1, restitution=0.7, side=-1.0), 9.0, ((-1.0,), (0.0,)))
    np.testing.assert_allclose(times(a), times(b), rtol=1e-12)
    np.testing.assert_allclose(a.final_position, -b.final_position, rtol=1e-9)


def test_a_start_is_looked_at_inside_a_trace_of_something_else():
    """The number of its piece was asked of jax there, and came as a tracer: a traceback."""
    wiper = wiperjax.Wiper(belt=wiperjax.WipingBelt(0.3, 100.0, 0.4))

    def run(x, start):
        rest = (0.0, 0.0)
        return wiperjax.solve(wiper, 1e-3, initial_state=((x, 0.0), rest), start=start).result

    jax.eval_shape(lambda x: run(x, 5.0), 0.0)
    with pytest.raises(ValueError, match="start must lie in one of the first 2147482648 pieces"):
        jax.eval_shape(lambda x: run(x, 1e9), 0.0)
