"""Cases with known answers, as user-defined systems through `wiperjax.solve`."""

import math

import jax
import numpy as np
import pytest
from problems import EXACT, IMPACT_CASES, periodic_impacts
from systems import Ball, Block, Rod, StopOscillator, events, trajectory

import wiperjax
from wiperjax import Event, Result
from wiperjax.contact.impact import poisson_impact
from wiperjax.contact.space import contact


@pytest.mark.slow
@pytest.mark.parametrize("problem", EXACT, ids=lambda p: p.name)
def test_event_times_and_final_state(problem):
    s = trajectory(problem.system, problem.duration, problem.start, **problem.options)
    assert Result(int(s.result)) == Result.FINISHED and not s.event_overflow
    found = events(s, *problem.kinds)
    assert len(found) == len(problem.times)
    np.testing.assert_allclose(found, problem.times, rtol=problem.rtol, atol=0)
    if problem.final is not None:
        assert float(s.final_position[0]) == pytest.approx(problem.final, rel=1e-9, abs=1e-10)


def test_velocities_before_the_impacts():
    problem = EXACT[0]
    e, m = problem.system.restitution, problem.system.mass
    s = trajectory(problem.system, problem.duration, problem.start)
    before = -np.asarray(s.events.impulse[:3]) / (m * (1 + e))
    exact = [-316.2587864392096, -284.6329077952903, -256.1696170157566]
    np.testing.assert_allclose(before, exact, rtol=1e-9)


@pytest.mark.parametrize(
    "system, x_max, v_min",
    [
        (Block(1.0, 0.5, belt=0.2), 1.03851648071345, -0.53851648071345),
        (Block(0.4, 0.25, 1.0, 100.0, belt=0.05), 0.00772015325445528, -0.0522015325445528),
    ],
)
def test_extremes(system, x_max, v_min):
    """x_max where v = 0, v_min where the spring carries the friction, at known times."""
    k, v = system.stiffness, system.belt
    fs, fd, w = system.static, system.dynamic, math.sqrt(k / system.mass)
    lag = math.atan2((fs - fd) / k, v / w)  # x = fd/k + amplitude sin(w t + lag) from the release
    start = ((fs / k,), (v,))
    s = trajectory(system, (math.pi / 2 - lag) / w, start)
    assert float(s.final_position[0]) == pytest.approx(x_max, rel=1e-9)
    s = trajectory(system, (math.pi - lag) / w, start)
    assert float(s.final_velocity[0]) == pytest.approx(v_min, rel=1e-9)


def last_reversal(system, start, periods):
    """Time and position of the last reversal of a long run."""
    duration = periods * 2 * math.pi / system.frequency
    first = trajectory(system, duration, start)
    assert Result(int(first.result)) == Result.FINISHED and not first.event_overflow
    last = events(first, Event.REVERSAL)[-1]
    # ends at the very instant of an event, as near as the clock can tell
    again = trajectory(system, last, start)
    assert Result(int(again.result)) == Result.FINISHED
    return last, float(again.final_position[0])


@pytest.mark.parametrize(
    "b, r, x_max",
    [(2.0, 0.3, 0.297676184991529), (1.5, 0.4, 0.653197264742181), (3.0, 0.05, 0.124629079300970)],
)
def test_den_hartog(b, r, x_max):
    """Started on the non-stop steady state, it stays there."""
    v, u = 1 / (1 - b * b), math.sin(math.pi / b) / (b * (1 + math.cos(math.pi / b)))
    # x' = 0 at x_max and phase delta of the force: V cos delta = x_max, V sin delta = -r U
    delta = math.atan2(-r * u / v, x_max / v)
    system = Block(r, r, amplitude=1.0, frequency=b, phase=delta)
    last, position = last_reversal(system, ((x_max,), (0.0,)), 20.25)
    assert abs(position) == pytest.approx(x_max, rel=1e-9)
    assert last == pytest.approx(40 * math.pi / b, rel=1e-9)


def test_den_hartog_from_rest():
    """The transient from rest ends on the steady state."""
    _, position = last_reversal(
        Block(0.3, 0.3, amplitude=1.0, frequency=2.0), ((0.0,), (0.0,)), 120
    )
    assert abs(position) == pytest.approx(0.297676184991529, rel=1e-9)


@pytest.mark.parametrize(
    "b, f, eta", [(2.0, 0.5, 0.968245836551854), (1.5, 0.4, 0.886942313043338)]
)
def test_block_on_a_shaken_surface(b, f, eta):
    """Surface position sin(b t); eta is relative to it."""
    system = Block(f, f, surface=b, frequency=b)
    last, position = last_reversal(system, ((0.0,), (0.0,)), 120)
    assert abs(position - math.sin(b * last)) == pytest.approx(eta, rel=3e-9)


@pytest.mark.parametrize("amplitude", [1.001, 1.05, 2.0, 20.0])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_a_growing_force_releases_a_block_that_does_not_move(amplitude, rtol):
    """a sin(t) = 1 ends stick: until then nothing but the guard tells that time passes."""
    block = Block(static=1.0, dynamic=0.5, amplitude=amplitude, phase=-math.pi / 2)
    release = math.asin(1 / amplitude)
    found = events(trajectory(block, 3.0, ((0.0,), (0.0,)), rtol=rtol), Event.RELEASE)
    assert abs(found[0] / release - 1) < max(0.1 * rtol, 1e-11)


@pytest.mark.parametrize("factor, sticks", [(0.999, False), (1.001, True)])
def test_sticks_for_ever_above_the_threshold(factor, sticks):
    b = 1.2
    f = factor * abs(1 - b * b)
    # in stick x = sin(b t): needs |x + x''| = |1 - b^2| |sin(b t)| <= f
    s = trajectory(Block(f, f, surface=b, frequency=b), 60.0, ((0.0,), (b,)))
    assert (int(s.events.count) == 0) == sticks


@jax.jit
@jax.jacfwd
def advanced(state, system, period):
    """Derivative of the state a period later by the state."""
    s = wiperjax.solve(
        system, period, initial_state=((state[0],), (state[1],)), rtol=1e-10, max_events=4
    )
    return jax.numpy.concatenate([s.final_position, s.final_velocity])


@pytest.mark.long
@pytest.mark.parametrize("w, e, psi, speed, multipliers", IMPACT_CASES)
def test_forced_impact_oscillator(w, e, psi, speed, multipliers):
    phase, v = periodic_impacts(w, e)
    assert v == pytest.approx(speed, rel=1e-12)
    if psi is not None:
        assert phase % (2 * math.pi) == pytest.approx(psi, rel=1e-12)
    period = 2 * math.pi / w
    system = StopOscillator(amplitude=1.0, frequency=w, phase=phase, restitution=e, side=-1.0)
    start = ((0.0,), (-e * v,))
    many = 40 if abs(multipliers[0]) < 1 else 4
    s = trajectory(system, (many + 0.5) * period, start)
    times = events(s, Event.IMPACT)
    np.testing.assert_allclose(times, period * np.arange(1, many + 1), rtol=1e-8)
    np.testing.assert_allclose(s.events.impulse[:many] / (1 + e), v, rtol=1e-7)

    # the multipliers, through one impact: derivative of the solution over one period
    half = trajectory(system, 0.5 * period, start)
    here = np.concatenate([half.final_position, half.final_velocity])
    later = StopOscillator(
        amplitude=1.0, frequency=w, phase=phase + math.pi, restitution=e, side=-1.0
    )

    matrix = np.asarray(advanced(here, later, period))
    values = np.linalg.eigvals(matrix)
    assert np.linalg.det(matrix) == pytest.approx(e * e, rel=1e-7)
    for m in multipliers:
        assert np.min(np.abs(values - m)) < 1e-7


@pytest.mark.slow
def test_lowest_point():
    psi, v = periodic_impacts(2.5, 0.8)
    system = StopOscillator(amplitude=1.0, frequency=2.5, phase=psi, restitution=0.8, side=-1.0)
    period = 2 * math.pi / 2.5
    samples = np.linspace(0, period, 2001)
    s = trajectory(system, period, ((0.0,), (-0.8 * v,)), sample_times=samples)
    x = np.asarray(s.samples.position[0])
    i = int(np.argmin(x[:-1]))
    vertex = x[i] - (x[i + 1] - x[i - 1]) ** 2 / (8 * (x[i + 1] - 2 * x[i] + x[i - 1]))
    assert vertex == pytest.approx(-0.800586609, abs=2e-9)


@pytest.mark.long
def test_rests_after_zeno_with_its_weight():
    e, height = 0.6, 0.4
    end = math.sqrt(2 * height / 9.81) * (1 + e) / (1 - e)
    s = trajectory(
        Ball(9.81, e), end + 1.0, ((height,), (0.0,)), sample_times=np.array([end + 0.5, end + 0.9])
    )
    np.testing.assert_allclose(s.samples.normal_force, 9.81, rtol=1e-12)
    np.testing.assert_array_equal(s.samples.position[0], 0.0)
    assert events(s)[-1][1] == Event.ZENO


@pytest.mark.parametrize(
    "phi, threshold",
    [
        (math.atan(0.733799385705343), 1.46759877141069),
        (0.3, 2.05003601932968),
        (1.0, 1.90314990246570),
    ],
)
def test_pendulum_is_paradoxical_above_the_threshold(phi, threshold):
    m1, m2 = 1.3, 0.7
    blade = wiperjax.Wiper(hinge_mass=m1, tip_mass=m2)
    (_, cross), (_, normal) = blade.directions(0.0, (blade.lip_length * math.sin(phi), 0.0))
    assert float(normal - threshold * cross) == pytest.approx(0, abs=1e-12 * float(normal))
    light = wiperjax.Wiper(hinge_mass=1e-12, tip_mass=m2)
    (_, cross), (_, normal) = light.directions(0.0, (light.lip_length * math.sin(phi), 0.0))
    assert float(normal - 1e6 * abs(cross)) > 0  # the paradox vanishes with the hinge mass


@pytest.mark.parametrize(
    "e, v_n, p_t", [(0.0, 0.0, -0.4375), (0.5, 0.199852016258, -0.502403846154)]
)
def test_impact_without_collision(e, v_n, p_t):
    rod, angle = Rod(restitution=e), math.radians(60)
    c = contact(rod, *jax.tree.map(jax.numpy.asarray, (0.0, *rod.start(angle, 1.0))))
    np.testing.assert_allclose([c.w_nn, c.w_tt, c.w_tn], [1.75, 3.25, 1.299038105677], rtol=1e-12)
    blow = poisson_impact(c.w_tt, c.w_tn, c.w_nn, rod.mu, e, 1.0, 0.0)
    assert float(blow.tangential) == pytest.approx(p_t, abs=1e-12)
    assert float(blow.slip_speed) == 0
    assert float(blow.normal_speed) == pytest.approx(v_n, abs=1e-12)


@pytest.mark.long
def test_impact_without_collision_in_a_trajectory():
    """The inconsistent rod is resolved at once, by an event of its own name."""
    rod, angle = Rod(restitution=0.5, gravity=10.0), math.radians(60)
    s = trajectory(rod, 1e-3, rod.start(angle, 1.0))
    assert events(s)[0] == (0.0, Event.JAM)
    assert Result(int(s.result)) == Result.FINISHED
