"""What a trajectory gathers: shares of time, mean and largest force."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Block, times, trajectory

import wiperjax
from wiperjax import Event, Regime, SteadyBelt, Wiper, WipingBelt
from wiperjax.engine.observers.base import Happening
from wiperjax.engine.observers.told import told
from wiperjax.engine.observers.totals import RegimeTotals, Totals, steepest


def test_what_is_told_of_a_cell_does_not_depend_on_its_block():
    """In float32 the last digit of its means did: XLA divides one number by the window, of many it
    multiplies each by the reciprocal."""
    rng, n, window = np.random.default_rng(0), 64, 0.1
    fields = dict.fromkeys(Totals._fields, jnp.asarray(rng.random(n), jnp.float32))
    for name in fields:
        if name.endswith("_count"):
            fields[name] = jnp.asarray(rng.integers(0, 9, n), jnp.int32)
    record = Totals(**fields)
    whole = told(record, window, np.full(n, True))
    for i in range(n):
        alone = told(jax.tree.map(lambda x, i=i: x[i : i + 1], record), window, np.array([True]))
        assert {name: x[0] for name, x in alone.items()} == {k: x[i] for k, x in whole.items()}


def test_a_jam_that_nothing_is_gathered_in_front_of_leaves_derivatives():
    """They were NaN behind a jam at the first instant, or before statistics begin."""
    rule = RegimeTotals()

    def work(time, slip_time):
        record = rule.init(jnp.float64)._replace(friction_work=2 * time, slip_time=slip_time)
        event = Happening(None, time, Event.JAM, Regime.SLIP_POS, Regime.STICK, 0.0, 0.0, 0.0)
        return rule.event(record, event).friction_work

    for slip_time, slope in ((0.0, 2.0), (1e-9, np.nan)):
        change = jax.jvp(lambda t, s=slip_time: work(t, jnp.asarray(s)), (1.0,), (1.0,))[1]
        np.testing.assert_array_equal(change, slope)


@pytest.mark.long
def test_what_a_stick_gathers_is_as_good_as_the_tolerance():
    """A lip that sticks is carried by the belt: x = x0 + V t, and its normal force follows. In its
    motion there is no error that could limit the steps; mean and largest force were off by 2e-7 and
    6e-7 here, whatever the tolerance."""
    length, speed, duration, angle = 6e-3, 0.3, 0.03, 0.0
    start = -0.75 * length
    blade = Wiper(
        attack_angle=angle,
        lip_length=length,
        belt=SteadyBelt(speed),
        normal_load=100.0,
        support_damping=10.0,
        mu_static=10.0,
        mu_minimum=10.0,
    )
    found = jax.jit(
        lambda: wiperjax.solve(
            blade,
            duration,
            initial_state=((start, 0.0), (speed, 0.0)),
            rtol=1e-10,
            max_events=0,
        )
    )().statistics
    node, weight = np.polynomial.legendre.leggauss(60)
    part = np.append(0.5 * (1 + node), np.linspace(0, 1, 10**5))
    sine = (start + speed * duration * part) / length
    lift = length * (np.sqrt(1 - sine**2) - np.cos(angle))
    force = 100.0 + 2000.0 * lift - 10.0 * speed * sine / np.sqrt(1 - sine**2)
    assert found.stick_time == pytest.approx(duration)
    mean = 0.5 * weight @ force[:60]
    np.testing.assert_allclose(found.normal_force_integral / duration, mean, rtol=2e-8)
    np.testing.assert_allclose(found.normal_force_max, force[60:].max(), rtol=2e-8)


def test_statistics_agree_with_the_log():
    s = trajectory(Block(0.4, 0.25, 1.0, 100.0, belt=0.05), 3.0, ((0.0,), (0.05,)))
    stick = 0.0
    before = 0.0
    now = Regime.STICK
    for t, after in zip(times(s), np.asarray(s.events.after), strict=False):
        stick += (t - before) * (now == Regime.STICK)
        before, now = t, Regime(int(after))
    stick += (3.0 - before) * (now == Regime.STICK)
    assert float(s.statistics.stick_time) == pytest.approx(stick, rel=1e-12)
    total = s.statistics.stick_time + s.statistics.slip_time + s.statistics.flight_time
    assert float(total) == pytest.approx(3.0, rel=1e-12)


def test_the_steepest_place_of_a_step_is_found_wherever_it_lies():
    """Waves of random phase, over a step of up to a fifth of a period: at the ends and the middle
    alone their slope was up to 4.5 % too low."""
    rng = np.random.default_rng(5)
    phase, length = rng.uniform(0, 2 * np.pi, 500), rng.uniform(0.1, 1.3, 500)
    nodes = [np.sin(phase + length * share) for share in np.linspace(0, 1, 5)]
    true = np.abs(np.cos(phase + length * np.linspace(0, 1, 1001)[:, None])).max(axis=0)
    np.testing.assert_allclose(steepest(nodes) / length, true, rtol=2e-3)


@pytest.mark.slow
def test_the_largest_acceleration_knows_no_unit():
    """Of a system with periods of nanoseconds it was 0: shorter steps were left out by seconds."""

    def largest(unit):
        block = Block(0.3 / unit, 0.2 / unit, stiffness=1 / unit**2, belt=100.0)
        run = trajectory(block, 20 * unit, ((0.0,), (1.0,)), 1e-8, atol=(1e-8 * unit, 1e-8))
        return unit * float(run.statistics.acceleration_max)

    for unit in (2.0**-30, 2.0**30):
        assert largest(unit) == pytest.approx(largest(1.0), rel=1e-6)


@pytest.mark.long
def test_a_largest_force_at_an_event_has_the_derivative_of_the_force_there():
    """The slip that ends in a capture presses hardest as it ends. The slope of a step's quartic,
    times that of the event's time, made 8 % of it (rtol 1e-9), and more the finer the tolerance."""
    blade = {
        **{"tip_mass": 5.148e-3, "lip_length": 8.572e-3, "hinge_mass": 4.106e-4},
        **{"support_stiffness": 349.6, "support_damping": 2.138, "normal_load": 22.04},
        **{"neck_stiffness": 0.7117, "shoulder_stiffness": 0.351, "shoulder_angle": 0.7567},
        **{"mu_static": 1.682, "mu_minimum": 0.1903, "stribeck_speed": 0.1164, "gravity": 9.81},
        **{"attack_angle": -0.4209, "hinge_damping": 8.824e-5, "viscous_slope": 7.123e-3},
    }
    belt = WipingBelt(1.4523, 28.048, 5.8408)

    def largest(given):
        restitution, height = given
        start = (-1.5824e-3, height), (-0.47626, -0.49029)
        wiper = Wiper(belt=belt, restitution=restitution, **blade)
        found = wiperjax.solve(wiper, 2.3e-3, initial_state=start, rtol=1e-9, max_events=64)
        return found.statistics.normal_force_max, found.events

    program = jax.jit(lambda given, along: jax.jvp(largest, (given,), (along,), has_aux=True))
    given = np.array([0.6461, 3.628e-4])
    for along in np.eye(2):
        _, slope, events = program(given, along)
        step = 1e-5 * given @ along
        apart = [program(given + k * step * along, along) for k in (-2, -1, 1, 2)]
        assert all(np.array_equal(x[2].kind, events.kind) for x in apart)
        low, below, above, high = (float(x[0]) for x in apart)
        difference = (8 * (above - below) - (high - low)) / (12 * step)
        np.testing.assert_allclose(slope, difference, rtol=1e-4)


@pytest.mark.slow
def test_an_observer_of_its_own_start_gathers_all_from_there_on():
    """The step that its start lay in was left out, a fifth of a stick time."""
    block, start = Block(0.4, 0.25, 1.0, 100.0, belt=0.05), ((0.0,), (0.05,))

    @jax.jit
    def gathered(begin):
        options = {"initial_state": start, "max_events": 0}
        own = wiperjax.solve(block, 3.0, observer=wiperjax.RegimeTotals(begin), **options)
        return own.statistics, wiperjax.solve(
            block, 3.0, statistics_start=begin, **options
        ).statistics

    own, usual = gathered(1.234)
    lasted = own.stick_time + own.slip_time + own.flight_time
    assert float(lasted) == pytest.approx(3.0 - 1.234, rel=1e-12)
    assert all(np.array_equal(a, b) for a, b in zip(own, usual, strict=True))


@pytest.mark.long
def test_work_done_on_friction_has_its_derivative():
    """A part of it carried none: it came out small, and of the wrong sign."""

    @jax.jit
    def work(belt):
        options = {"initial_state": ((0.0,), (0.0,)), "rtol": 1e-10, "max_events": 0}

        def of(belt):
            block = Block(0.4, 0.25, 1.0, 100.0, belt=belt)
            return wiperjax.solve(block, 1.0, **options).statistics.friction_work

        return jax.jvp(of, (belt,), (1.0,))

    value, slope = work(0.05)
    assert float(value) > 0
    low, high = (float(work(0.05 + step)[0]) for step in (-1e-5, 1e-5))
    assert float(slope) == pytest.approx((high - low) / 2e-5, rel=1e-6)
