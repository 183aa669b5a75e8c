"""The event engine itself: order, energy, batches, failures, ties, logs and compilations."""

import math
from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import Ball, Block, Puck, StopOscillator, events, stop_oscillator, trajectory

import wiperjax
from wiperjax import AbstractSystem, Coulomb, Event, Regime, Result, SteadyBelt, Wiper
from wiperjax.engine.carry.problem import Integration, Recording, make_case
from wiperjax.engine.solve import begin, run, solution
from wiperjax.engine.step import advance
from wiperjax.engine.trial.guard_proof import examine

PARAMETERS = ("attack_angle", "normal_load", "restitution", "mu_static", "support_stiffness")
TIMES = np.linspace(0, 0.02, 16001)


@jax.jit
def blade(values, speed, duration, rtol=1e-10):
    """A wiper of given PARAMETERS, sampled."""
    return wiperjax.solve(
        Wiper(belt=SteadyBelt(speed), **values),
        duration,
        rtol=rtol,
        max_events=128,
        sample_times=TIMES,
    )


@jax.jit
def plain_blade(values, speed, max_steps):
    body = Wiper(belt=SteadyBelt(speed), **values)
    return wiperjax.solve(body, 0.02, rtol=1e-10, max_events=128, max_steps=max_steps)


def draw(count, seed=3):
    rng = np.random.default_rng(seed)
    values = dict(
        attack_angle=rng.uniform(-0.7, 0.7, count),
        normal_load=rng.uniform(5, 30, count),
        restitution=rng.uniform(0, 0.9, count),
        mu_static=rng.uniform(0.4, 1.4, count),
        support_stiffness=rng.uniform(1000, 8000, count),
    )
    return values, rng.uniform(0.05, 1, count)


def lane(tree, i):
    return jax.tree.map(lambda x: x[i], tree)


# --- energy ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("i", range(4))
def test_energy_balance_over_smooth_phases(i):
    """E changes by the work of friction and the dashpot: quadrature between neighbouring events."""
    values, speed = (lane(x, i) for x in draw(4))
    s = blade(values, speed, TIMES[-1], 1e-11)
    assert Result(int(s.result)) == Result.FINISHED
    body = Wiper(belt=SteadyBelt(speed), **values)
    q, v = (np.asarray(x) for x in (s.samples.position, s.samples.velocity))
    energy = np.asarray(jax.vmap(lambda *z: body.energy(z[:2], z[2:]))(*q, *v))
    tau = q[0] / np.sqrt(body.lip_length**2 - q[0] ** 2)
    power = s.samples.friction_force * v[0] - body.support_damping * (v[1] - tau * v[0]) ** 2
    edges = [0.0, *events_times(s), TIMES[-1]]
    checked = 0
    h = TIMES[1]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        inside = np.flatnonzero((a + 1e-9 < TIMES) & (b - 1e-9 > TIMES))
        if len(inside) < 41:
            continue
        n = (len(inside) - 1) // 4 * 4
        p = np.asarray(power)[inside[: n + 1]]
        weights = np.tile([32, 12, 32, 14], n // 4 + 1)[:n]
        work = 2 * h / 45 * (7 * p[0] + weights[:-1] @ p[1:n] + 7 * p[n])
        change = energy[inside[n]] - energy[inside[0]]
        scale = np.max(np.abs(p)) * n * h + abs(change)
        assert change == pytest.approx(work, abs=2e-7 * scale)
        checked += 1
    assert checked >= 1


def events_times(s):
    return [t for t, _ in events(s)]


def test_dissipation_at_impacts_is_not_negative():
    """T- - T+ + V p_t >= 0 at every bounce of a coupled blade on a moving belt."""

    @jax.jit
    def solve(duration):
        return wiperjax.solve(
            Wiper(
                belt=SteadyBelt(0.3),
                hinge_mass=4e-3,
                attack_angle=-0.6,
                support_stiffness=8000.0,
                restitution=0.7,
                mu_static=0.8,
            ),
            duration,
            initial_state=((-0.0034, 5e-4), (0.2, 0.0)),
            rtol=1e-10,
        )

    times = [t for t, k in events(solve(0.01)) if k == Event.IMPACT]
    assert len(times) >= 3
    body = Wiper(hinge_mass=4e-3, attack_angle=-0.6)
    for t in times[:6]:
        before, after = solve(t * (1 - 1e-9)), solve(t * (1 + 1e-9))
        x = float(before.final_position[0])
        along = body.directions(0.0, (x, 0.0))
        inverse = np.array([[float(a) for a in row] for row in along])
        mass = np.linalg.inv(inverse)
        v0, v1 = np.asarray(before.final_velocity), np.asarray(after.final_velocity)
        p_t = float((mass @ (v1 - v0))[0])
        lost = 0.5 * v0 @ mass @ v0 - 0.5 * v1 @ mass @ v1 + 0.3 * p_t
        assert lost >= -1e-9 * (v0 @ mass @ v0)


# --- order ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "solver, order",
    [(diffrax.Tsit5(), 5), (diffrax.Dopri5(), 5), (diffrax.Bosh3(), 3), (diffrax.Dopri8(), 8)],
    ids=lambda x: getattr(type(x), "__name__", ""),
)
def test_event_times_converge_with_the_tolerance(solver, order):
    problem = stop_oscillator()
    tolerances = np.array([1e-4, 1e-6, 1e-8, 1e-10]) if order > 3 else np.array([1e-4, 1e-6, 1e-8])
    errors = []
    for rtol in tolerances:
        s = trajectory(problem.system, problem.duration, problem.start, rtol, solver=solver)
        found = events(s, Event.IMPACT)
        assert len(found) == len(problem.times)
        errors.append(np.max(np.abs(np.array(found) / problem.times - 1)))
    slope = np.polyfit(np.log(tolerances), np.log(np.maximum(errors, 1e-15)), 1)[0]
    assert slope > 0.8 and errors[-1] < 20 * tolerances[-1]


def test_event_times_have_the_order_of_the_solver_with_fixed_steps():
    """The located state is a full Runge-Kutta result: halving the step gains 2^5."""
    problem = stop_oscillator()
    errors = []
    for parts in (8, 16, 32):
        s = trajectory(
            problem.system,
            0.016,
            problem.start,
            1e30,
            atol=1e30,
            max_step=problem.times[0] / (parts + 0.3),
        )
        errors.append(abs(events(s, Event.IMPACT)[1] / problem.times[1] - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 4.5), (errors, orders)


# --- batches --------------------------------------------------------------------------------------


def test_a_lane_equals_the_same_trajectory_alone_in_any_order_with_failing_neighbours():
    values, speed = draw(8)
    values["normal_load"][2] = np.nan  # cannot be computed
    values["attack_angle"][5] = 1.2  # collapses
    budget = np.full(8, 100_000)
    budget[3] = 40
    batch = jax.jit(jax.vmap(plain_blade))
    together = batch(values, speed, budget)
    order = np.random.default_rng(0).permutation(8)
    shuffled = batch({k: v[order] for k, v in values.items()}, speed[order], budget[order])
    assert Result(int(together.result[2])) == Result.NON_FINITE
    assert Result(int(together.result[5])) == Result.COLLAPSED
    assert Result(int(together.result[3])) == Result.STEP_BUDGET_SPENT
    for i in range(8):
        alone = plain_blade(lane(values, i), speed[i], budget[i])
        for other in (lane(together, i), lane(shuffled, int(np.flatnonzero(order == i)[0]))):
            assert int(alone.result) == int(other.result)
            if i == 2:
                continue
            if i != 3:
                assert [k for _, k in events(alone)] == [k for _, k in events(other)]
                np.testing.assert_allclose(
                    events_times(alone), events_times(other), rtol=1e-8, atol=1e-12
                )
                np.testing.assert_allclose(
                    alone.final_position, other.final_position, rtol=0, atol=1e-10
                )
    # the place in the batch changes nothing at all
    for i in range(8):
        j = int(np.flatnonzero(order == i)[0])
        np.testing.assert_array_equal(together.final_position[i], shuffled.final_position[j])
        np.testing.assert_array_equal(together.events.time[i], shuffled.events.time[j])


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


# --- ties, order of listing, several roots in a step ----------------------------------------------


class Far(AbstractSystem):
    """Motion so far above its ground that nothing happens but at its switches."""

    push: ClassVar[float] = 0.0

    def free_acceleration(self, t, q, v):
        return (self.push + 0.0 * t,)

    def directions(self, t, q):
        return (0.0,), (1.0,)

    def gap(self, t, q):
        return 1e3 + q[0]


class Gates(Far):
    """Motion past gates at given places: each is a switching function, once."""

    first: float = 0.3
    second: float = 0.7
    swapped: bool = False

    def switches(self, t, q, v):
        a, b = (q[0] - self.first), (q[0] - self.second)
        return (jnp.where(self.swapped, b, a), jnp.where(self.swapped, a, b))


@pytest.mark.parametrize("swapped", [False, True])
def test_two_events_in_one_step_come_in_order_of_time(swapped):
    s = trajectory(Gates(0.3, 0.3 + 1e-7, swapped), 1.0, ((0.0,), (1.0,)), 1e-4)
    np.testing.assert_allclose(events_times(s), [0.3, 0.3 + 1e-7], rtol=1e-12)
    s = trajectory(Gates(0.7, 0.2, swapped), 1.0, ((0.0,), (1.0,)), 1e-4)
    np.testing.assert_allclose(events_times(s), [0.2, 0.7], rtol=1e-12)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_tie_is_two_events_at_one_time(swapped):
    s = trajectory(Gates(0.4, 0.4, swapped), 1.0, ((0.0,), (1.0,)))
    np.testing.assert_allclose(events_times(s), [0.4, 0.4], rtol=1e-12)
    assert Result(int(s.result)) == Result.FINISHED


class Parabola(Far):
    """Free fall through a switching function q - level: two roots, or none."""

    push: ClassVar[float] = -1.0
    level: float = 0.5

    def switches(self, t, q, v):
        return (self.level - q[0],)


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-9])
def test_a_double_root_inside_one_step_is_found(depth):
    """The top of the flight is 0.5, at t = 1, inside the last step of a loose tolerance."""
    s = trajectory(Parabola(0.5 - depth), 3.0, ((0.0,), (1.0,)), 1e-3)
    reach = math.sqrt(2 * depth)
    np.testing.assert_allclose(events_times(s), [1 - reach, 1 + reach], rtol=0, atol=1e-7)
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


@pytest.mark.parametrize("depth", [1e-3, 1e-4, 1e-5])
def test_a_double_root_is_found_in_single_precision_too(depth):
    """As deep as its digits can tell: 1e-5 is ten times what the guard is off by rounding."""
    s = single_parabola(0.5 - depth)
    reach = math.sqrt(2 * depth)
    assert int(s.events.count) == 2
    # the level is good to 1e-7, the time of a shallow passage to this over its speed
    np.testing.assert_allclose(events_times(s), [1 - reach, 1 + reach], atol=5e-7 / reach)


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
    law: ClassVar[Coulomb] = Coulomb(0.0, 0.0)

    def directions(self, t, q):
        return (1.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def slip_speed(self, t, q, v):
        return v[0]


@pytest.mark.parametrize("waves_of", [FlyingWaves, SlidingWaves])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
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
            found = events_times(s)
            assert len(found) == len(true), (waves, rtol)
            # by what the tolerance leaves where two of them lie close together
            np.testing.assert_allclose(found, true, rtol=0, atol=2 * np.sqrt(rtol))


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


def test_rounding_at_the_start_of_slip_is_no_root():
    """Slip that begins with v_t ~ t^3 (float32, from a blade that was caught there for ever): over
    theta its guard starts at rounding, where its polynomial dips below zero."""

    def along(*values):
        nodes = tuple(jnp.float32(x) for x in values)
        return examine(nodes, jnp.int32(1), jnp.float32(0.1), jnp.float32(2.3e-4), False, 3, 1e-4)

    guard = along(-0.0, 1.4896451e-3, 1.28741749e-2, 4.19373922e-2, 9.30096507e-2)
    assert 0 < guard.start < guard.noise and min(guard.control) < -guard.error
    assert guard.murky and not guard.falls  # a shorter step will tell
    assert along(-0.0, 3.7164764e-4, 1.7030519e-3, 4.3886891e-3, 8.9159730e-3).proved


def test_an_event_is_foreseen():
    """The step before it tells where it will be: one step ends there, and none is taken back."""
    solve = jax.jit(
        lambda gate: wiperjax.solve(Gates(gate, 2.0), 1.0, initial_state=((0.0,), (1.0,)))
    )
    through, past = int(solve(2.0).steps), int(solve(0.9).steps)
    assert through >= 3  # 0.9 lies in a later step than the first
    assert past == through + 1


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


@eqx.filter_jit
def overloaded(wiper):
    return wiperjax.solve(wiper, 0.05, rtol=1e-9, max_events=32)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_lip_meets_its_shoulder_and_collapses_behind_it(side):
    """One switch watches both ends of the stretch that the lip is in, and tells them apart."""
    wiper = Wiper(
        belt=SteadyBelt(0.3),
        attack_angle=side * np.deg2rad(40.0),
        normal_load=40.0,
        shoulder_stiffness=0.1,
        shoulder_angle=0.4,
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
    stiff = eqx.tree_at(lambda w: w.shoulder_angle, wiper, 3.0)
    s = overloaded(stiff)
    kinds = [Event(int(k)) for k in s.events.kind[: int(s.events.count)]]
    assert Event.KINK not in kinds and kinds[-1:] == [Event.COLLAPSE]


def test_an_attack_angle_behind_the_collapse_does_not_move_it():
    """Neither shoulder can be reached: the lip collapses at its own angle."""
    wiper = Wiper(attack_angle=np.deg2rad(80.0), shoulder_angle=0.1, collapse_angle=np.pi / 3)
    s = wiperjax.solve(wiper, 0.05, initial_state=((0.0, 0.0), (0.0, 0.0)), max_events=32)
    assert Result(int(s.result)) == Result.COLLAPSED
    assert np.rad2deg(np.arcsin(float(s.final_position[0]) / 6e-3)) == pytest.approx(60, abs=1e-4)
    with pytest.raises(ValueError, match="must lie where the model holds"):
        edge = 6e-3 * np.sin(np.pi / 3)
        wiperjax.simulate(wiper, 0.05, initial_state=((edge * 1.001, 0.0), (0.0, 0.0)))


# --- how trajectories end -------------------------------------------------------------------------


class Undefined(Parabola):
    """A switching function that is no number on a stretch of the way: long enough to be met."""

    def switches(self, t, q, v):
        hole = (q[0] > 0.2) & (q[0] < 0.42)
        return (jnp.where(hole, jnp.nan, 1.0 + q[0]),)


@pytest.mark.parametrize("start", [-0.2, 0.0, 0.1, 0.19])
def test_a_guard_that_is_no_number_inside_a_step_is_no_proof(start):
    s = trajectory(Undefined(), 1.5, ((start,), (1.0,)), 1e-3)
    assert Result(int(s.result)) == Result.NON_FINITE


def test_result_codes():
    ball = Ball(9.81, 0.5)
    start = ((1.0,), (0.0,))
    assert Result(int(trajectory(ball, 3.0, start).result)) == Result.FINISHED
    s = trajectory(ball, 3.0, start, max_steps=3)
    assert Result(int(s.result)) == Result.STEP_BUDGET_SPENT and int(s.steps) == 3
    # it gets nowhere: not the whole budget is spent on it
    s = trajectory(ball, 3.0, start, max_step=1e-9, max_steps=10**6)
    assert Result(int(s.result)) == Result.STEP_TOO_SMALL and int(s.steps) < 10**4
    s = trajectory(ball, 3.0, ((-0.1,), (0.0,)))
    assert Result(int(s.result)) == Result.INCONSISTENT_START
    s = trajectory(Ball(np.nan, 0.5), 3.0, start)
    assert Result(int(s.result)) == Result.NON_FINITE
    s = trajectory(ball, 3.0, ((np.nan,), (0.0,)))
    assert Result(int(s.result)) == Result.NON_FINITE
    # flights shorter than the clock can tell, with completion switched off
    s = trajectory(ball, 3.0, start, zeno_time=0.0, max_events=64)
    assert Result(int(s.result)) == Result.ZENO_UNRESOLVED and s.event_overflow == (
        s.events.count > 64
    )


def test_elastic_ball_never_rests_and_keeps_its_energy():
    s = trajectory(Ball(9.81, 1.0), 40.0, ((1.0,), (0.0,)))
    fall = math.sqrt(2 / 9.81)
    exact = fall * (1 + 2 * np.arange(int(s.events.count)))
    np.testing.assert_allclose(events_times(s), exact, rtol=1e-9)
    assert {k for _, k in events(s)} == {Event.IMPACT}


def test_event_log_overflow_is_flagged_and_counted():
    s = trajectory(Ball(9.81, 0.5), 3.0, ((1.0,), (0.0,)), max_events=4)
    full = trajectory(Ball(9.81, 0.5), 3.0, ((1.0,), (0.0,)), max_events=64)
    assert bool(s.event_overflow) and not bool(full.event_overflow)
    assert int(s.events.count) == int(full.events.count) > 4
    np.testing.assert_array_equal(s.events.time, full.events.time[:4])
    np.testing.assert_array_equal(s.final_position, full.final_position)


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="explicit"):
        trajectory(Ball(), 1.0, ((1.0,), (0.0,)), solver=diffrax.Euler())
    with pytest.raises(ValueError, match="their lengths were 1 and 2"):
        trajectory(Ball(), 1.0, ((1.0,), (0.0, 0.0)))
    with pytest.raises(ValueError, match="no default start"):
        wiperjax.solve(Ball(), 1.0)


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


def test_statistics_agree_with_the_log():
    s = trajectory(Block(0.4, 0.25, 1.0, 100.0, belt=0.05), 3.0, ((0.0,), (0.05,)))
    stick = 0.0
    before = 0.0
    now = Regime.STICK
    for t, after in zip(events_times(s), np.asarray(s.events.after), strict=False):
        stick += (t - before) * (now == Regime.STICK)
        before, now = t, Regime(int(after))
    stick += (3.0 - before) * (now == Regime.STICK)
    assert float(s.statistics.stick_time) == pytest.approx(stick, rel=1e-12)
    total = s.statistics.stick_time + s.statistics.slip_time + s.statistics.flight_time
    assert float(total) == pytest.approx(3.0, rel=1e-12)


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
    np.testing.assert_allclose(events_times(a), events_times(b), rtol=1e-12)
    np.testing.assert_allclose(a.final_position, -b.final_position, rtol=1e-9)
