"""A bilateral contact whose load also drives the slip (W_tn is not zero), against exact motions and
scipy."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from systems import events, trajectory

import wiperjax
from wiperjax import AbstractBeltSystem, Coulomb, Event, Regime, Result, SteadyBelt
from wiperjax.contact.regimes import decide
from wiperjax.contact.space import contact

SPEED, STATIC, DYNAMIC = 0.1, 0.5, 0.4
STIFF, SPRING = 20.0, 5.0  # of the support across the belt, and of the load


class Leaning(AbstractBeltSystem):
    """W = [[1, lean], [lean, 1]]: a unit load accelerates the slip by ``lean``.

    Springs pull x and y back, and the force -1 pushes y against the load: 1, less ``spring`` times
    y, plus ``beat`` times a sine.
    """

    unilateral = False
    coordinates = ("x", "y")
    lean: float = 0.3
    spring: float = 0.0
    beat: float = 0.0
    friction: Coulomb = Coulomb(STATIC, DYNAMIC)
    belt: SteadyBelt = SteadyBelt(SPEED)

    def free_acceleration(self, t, q, v):
        along, across = -q[0], -1.0 - STIFF * q[1] - v[1]
        return along + self.lean * across, self.lean * along + across

    def directions(self, t, q):
        return (1.0, self.lean), (self.lean, 1.0)

    def normal_force(self, t, q, v):
        return 1.0 - self.spring * q[1] + self.beat * jnp.sin(2 * t)

    def default_state(self):
        return (0.0, 0.0), (SPEED, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("lean", [-0.3, 0.0, 0.3])
def test_stick_holds_against_what_the_load_drives(lean):
    """A load that holds y = 0 leaves x = V t to friction, until it is mu. Without the load's part
    in it friction was off by the lean."""
    system = Leaning(lean=jnp.asarray(lean))  # an array, also if it is 0: one program
    run = wiperjax.simulate(system, 5.5, rtol=1e-10, sample_interval=0.5)
    held = run.isel(time=slice(0, 10))
    np.testing.assert_allclose(held.friction_force, SPEED * held.time, atol=1e-9)
    np.testing.assert_allclose(held.position[:, 0], SPEED * held.time, atol=1e-10)
    assert float(run.event_time[0]) == pytest.approx(STATIC / SPEED, abs=1e-8)


def release(lean, static, speed):
    system = Leaning(lean=lean, friction=Coulomb(static, DYNAMIC), belt=SteadyBelt(speed))
    start = ((0.0, 0.0), (speed, 0.0))
    found = wiperjax.solve(system, 8.0, initial_state=start, rtol=1e-10, max_events=1)
    return found.events.time[0]


release_slopes = jax.jit(jax.jacfwd(release, (0, 1, 2)))


@pytest.mark.long
@pytest.mark.parametrize("lean", [-0.3, 0.3])
def test_the_time_of_release_has_the_exact_derivatives(lean):
    """t = mu / V, whatever the lean."""
    slopes = release_slopes(lean, STATIC, SPEED)
    exact = (0.0, 1 / SPEED, -STATIC / SPEED**2)
    np.testing.assert_allclose(slopes, exact, rtol=1e-6, atol=1e-6)


class Grown(AbstractBeltSystem):
    """A block at rest, pushed along by ``drive``, whose load grows."""

    unilateral = False
    mass: float = 1.0
    drive: float = 1.0
    load: float = 0.0
    growth: float = 0.0
    beat: float = 0.0
    turns: float = 1.0  # rad/s
    friction: Coulomb = Coulomb(0.5)
    belt: SteadyBelt = SteadyBelt(0.0)

    def free_acceleration(self, t, q, v):
        return ((self.drive - q[0]) / self.mass,)

    def directions(self, t, q):
        return (1.0 / self.mass,), (0.0,)

    def normal_force(self, t, q, v):
        return self.load + self.growth * t + self.beat * jnp.sin(self.turns * t)


@jax.jit
def grown(drive, load, growth):
    begin = (0.0,), (0.0,)
    system = Grown(drive=drive, load=load, growth=growth)
    run = wiperjax.solve(system, 10.0, initial_state=begin, max_events=8)
    return run.result, run.final_regime, run.final_position[0]


@pytest.mark.slow
@pytest.mark.parametrize("drive", [0.0, 1.0])
def test_what_always_touches_never_flies(drive):
    """It began in flight where its load was below zero, if by rounding only: without friction for
    good, and the run finished."""
    result, _, _ = grown(drive, -1.0, 0.0)
    assert Result(int(result)) == Result.NO_CONSISTENT_REGIME
    for load in (0.0, -1e-17):
        result, regime, place = grown(drive, load, 1.0)
        assert Result(int(result)) == Result.FINISHED and Regime(int(regime)) == Regime.STICK
        slid = 2 - math.atan(2.0)  # x'' = 1 - x - t/2, until it stops
        assert float(place) == pytest.approx(slid * drive, abs=1e-7)


@pytest.mark.slow
def test_a_motion_that_begins_under_a_load_below_zero_ends_there():
    """Its first step, half a second long, was past it: friction drove what it should hold."""
    for load in (-1e-1, -1e-3, -1e-5):
        result, _, place = grown(0.0, load, 1.0)
        assert Result(int(result)) == Result.NO_CONSISTENT_REGIME and float(place) == 0.0


@pytest.mark.long
def test_a_load_that_dips_below_zero_within_a_step_ends_a_motion():
    """By a thousandth, here; looked at where steps end alone, 13 of 64 went on."""

    @jax.jit
    @jax.vmap
    def result(dip, turns, speed):
        belt = SteadyBelt(speed)
        system = Grown(drive=0.2, load=1.0, beat=1 + dip, turns=turns, belt=belt)
        start = (0.0,), (0.0,)
        return wiperjax.solve(system, 20 / turns, initial_state=start).result

    draw = np.random.default_rng(0)
    turns, speed = 10 ** draw.uniform(-1, 2, 64), draw.choice([0.0, 0.3, 3.0], 64)
    assert np.all(result(draw.uniform(5e-4, 2e-3, 64), turns, speed) == Result.NO_CONSISTENT_REGIME)


def test_what_always_touches_never_flies_at_the_edge_of_its_cone():
    """Of 20,000 pushed as hard as friction holds, rounding let 25 neither stick nor slip."""

    @jax.jit
    @jax.vmap
    def regime(mass, load, static):
        system = Grown(mass=mass, drive=static * load, load=load, friction=Coulomb(static))
        zero = jnp.zeros(())
        return decide(system, contact(system, zero, (zero,), (zero,))).regime

    found = regime(*np.random.default_rng(0).uniform(0.1, 10.0, (3, 20_000)))
    assert np.all(np.isin(found, [Regime.STICK, Regime.SLIP_POS]))


def scipys(lean: float, beat: float, stop: float) -> list[tuple[float, Event]]:
    """Captures and releases, by scipy alone: the forces' own equations, not the engine's."""

    def load(t, z):
        return 1 - SPRING * z[1] + beat * np.sin(2 * t)

    def motion(t, z, friction):
        """z' of z = (x, y, x', y')."""
        along, across = friction - z[0], load(t, z) - 1 - STIFF * z[1] - z[3]
        return z[2], z[3], along + lean * across, lean * along + across

    def holding(t, z):  # x'' = 0
        return z[0] - lean * (load(t, z) - 1 - STIFF * z[1] - z[3])

    def released(t, z):
        return STATIC * load(t, z) - abs(holding(t, z))

    def caught(t, z):
        return z[2] - SPEED

    caught.terminal = released.terminal = True
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    now, z, sign, found = 0.0, np.array([0, 0, SPEED, 0.0]), 0.0, []
    while now < stop:
        sticks = sign == 0

        def rates(t, z, sign=sign):
            return motion(t, z, sign * DYNAMIC * load(t, z) if sign else holding(t, z))

        guard = released if sticks else caught
        guard.direction = -1 if sticks else sign
        if not sticks:  # off the guard, which it leaves
            first = solve_ivp(rates, (now, now + 1e-4), z, **exact)
            now, z = first.t[-1], first.y[:, -1]
        done = solve_ivp(rates, (now, stop), z, events=guard, **exact)
        now, z = done.t[-1], done.y[:, -1].copy()
        if done.status != 1:
            break
        z[2] = SPEED
        assert sticks or released(now, z) > 0
        sign = np.sign(holding(now, z)) if sticks else 0.0
        found.append((now, Event.RELEASE if sticks else Event.CAPTURE))
    return found


@pytest.mark.long
@pytest.mark.parametrize("lean", [-0.3, 0.3])
def test_events_under_a_load_that_changes_are_those_of_scipy(lean):
    exact = scipys(lean, 0.2, 30.0)
    assert len(exact) >= 6
    system = Leaning(lean=lean, spring=SPRING, beat=0.2)
    found = events(trajectory(system, 30.0, system.default_state()))
    assert [kind for _, kind in found] == [kind for _, kind in exact]
    times = [time for time, _ in exact]
    np.testing.assert_allclose([time for time, _ in found], times, atol=1e-7)
