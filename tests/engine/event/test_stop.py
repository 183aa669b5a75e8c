"""A stop of a system's own: the same motion as where the engine's contact is the stop."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from own_systems import DrivenBetweenWalls, Walled
from problems import IMPACT_CASES, periodic_impacts
from scipy.optimize import brentq
from systems import turn

import wiperjax
from wiperjax import Result, parameter
from wiperjax.contact import fits
from wiperjax.cycles.branch.follow import follow
from wiperjax.cycles.find import find_cycle
from wiperjax.cycles.return_map import Found
from wiperjax.cycles.shooting import shoot
from wiperjax.maps import estimate
from wiperjax.noise.run_class import assess
from wiperjax.specs.load import parse_sweep
from wiperjax.systems.numbers import direction, traceable
from wiperjax.vocabulary.codes import MECHANISMS


class Struck(wiperjax.AbstractSystem):
    """x'' + x = cos(w t) for x < 0, and a stop at x = 0; without friction."""

    unilateral = False
    coordinates = ("x",)
    stops = (0,)
    frequency: float = parameter(2.5, "rad/s")
    restitution: float = parameter(0.8, low=0, high=1)

    def free_acceleration(self, t, q, v):
        return (jnp.cos(self.frequency * t) - q[0],)

    def directions(self, t, q):
        return (0.0,), (0.0,)

    def normal_force(self, t, q, v):
        return 1.0

    def switches(self, t, q, v):
        return (-q[0],)

    def rebound(self, stop, t, q, v, closed):
        return (-self.restitution * v[0],)

    def output(self, t, q, v):
        return v[0]


@pytest.mark.long
def test_cycle_multipliers_and_branch_are_those_of_the_impact_oscillator():
    """Derivatives pass through the blow, its time among them: e^2 is the determinant."""
    start = ((-0.5,), (0.0,))
    cycle = find_cycle(Struck(), settle=300.0, initial_state=start, period=turn, over="frequency")
    assert cycle.found == Found.FOUND and cycle.word == "blow"
    assert cycle.minimum == pytest.approx(-0.800586609, abs=1e-8)
    (pair,) = IMPACT_CASES[0][-1]
    assert np.min(np.abs(cycle.multipliers - pair)) < 1e-7
    branch = follow(cycle, 2.45, 2.55, step=0.1)
    assert branch.ends == ("the end of the range",) * 2 and len(branch.cycles) >= 3
    for frequency, each in zip(branch.parameters, branch.cycles, strict=True):
        assert np.prod(each.multipliers).real == pytest.approx(0.64, rel=1e-7)
        psi, speed = periodic_impacts(frequency, 0.8)  # rotation times saltation, as there
        bend, period = 1.8 * math.cos(psi) / speed, 2 * math.pi / frequency
        trace = -1.6 * math.cos(period) + bend * math.sin(period)
        assert np.sum(each.multipliers).real == pytest.approx(trace, rel=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_presses_against_a_stop_ends_with_its_code(restitution):
    """With the program of the cycle: under a constant force the blows pile up, or it rests."""
    pressed = traceable(Struck(frequency=0.0, restitution=restitution), "frequency")
    along = direction(pressed, "frequency")
    ended = shoot(pressed, along, np.array([-0.5, 0.0]), 20.0, rtol=1e-10)
    assert ended.result == Result.ZENO_UNRESOLVED
    times = ended.events.time[: int(ended.events.count)]
    # x = 1 - 1.5 cos t, then arcs of 2 atan(v), v half of the last one
    first = np.arccos(2 / 3)
    assert times[0] == pytest.approx(first, abs=1e-9)
    speeds = 1.5 * np.sin(first) * 0.5 ** np.arange(1, 10)
    if restitution:
        assert np.diff(times)[:9] == pytest.approx(2 * np.arctan(speeds), abs=1e-8)
        assert len(times) > 20
    else:
        assert len(times) == 1
    at_once = shoot(pressed, along, np.array([0.0, 0.0]), 20.0, rtol=1e-10)  # begun at rest on it
    assert at_once.result == Result.ZENO_UNRESOLVED


@pytest.mark.slow
def test_blows_that_pile_up_far_from_the_origin_end_too():
    """Flights no higher than the switch's rounding have no end of their own: the place stays."""
    motion = wiperjax.simulate(Walled(), 20.0, initial_state=((0.0,), (1.5,)))
    assert motion.result == Result.ZENO_UNRESOLVED and motion.sizes["event"] < 50
    assert float(motion.final_position[0]) == pytest.approx(0.6, abs=1e-12)


class Pressed(Struck):
    """Pushed against its stop by a constant force, with little lost at a blow."""

    def free_acceleration(self, t, q, v):
        return (1.0 - q[0] - 0.1 * v[0],)


@pytest.mark.long
def test_steps_from_a_stop_without_friction_are_proved():
    """Nothing slips in such a system: no guard of slip has a zero where it is struck."""
    motion = wiperjax.simulate(Struck(), 40.0, initial_state=((-0.5,), (0.0,)))
    assert motion.sizes["event"] > 10 and motion.attrs["unproved_steps"] == 0


@pytest.mark.long
def test_blows_that_pile_up_at_zero_end_where_they_are_rounding():
    """The place of the stop has no digits there, but that of a blow is known no better."""
    motion = wiperjax.simulate(Pressed(), 40.0, initial_state=((-0.5,), (0.0,)))
    assert motion.result == Result.ZENO_UNRESOLVED and motion.attrs["unproved_steps"] == 0
    assert motion.sizes["event"] < 100 and abs(float(motion.final_position[0])) < 1e-12


class Swinging(Struck):
    """A free body before a stop that swings far more quickly than it."""

    amplitude: float = parameter(0.01, "m", above=0)

    @property
    def drive_period(self):
        return 2 * jnp.pi / self.frequency

    def free_acceleration(self, t, q, v):
        return (-q[0],)

    def place(self, t):
        return 0.5 + self.amplitude * jnp.sin(self.frequency * t)

    def switches(self, t, q, v):
        return (self.place(t) - q[0],)

    def rebound(self, stop, t, q, v, closed):
        speed = jax.jvp(self.place, (t,), (jnp.ones_like(t),))[1]
        return (speed - self.restitution * (v[0] - speed),)


@pytest.mark.long
@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_a_stop_that_swings_quickly_is_struck_in_time(rtol):
    """The motion is smooth: by its error alone a step takes some swings, and of 24 such stops two
    or three were struck late, without a flag. The period that the system says bounds its steps."""
    drawn = np.random.default_rng(1).uniform((1.5, -4), (3.5, -1.5), (24, 2))
    quick, wide = 10.0**drawn.T

    def first(frequency, amplitude):
        struck = Swinging(frequency=frequency, amplitude=amplitude)
        motion = wiperjax.solve(
            struck, 1.0, initial_state=((0.0,), (1.0,)), rtol=rtol, max_events=1
        )
        return motion.events.time[0]

    times = jax.jit(jax.vmap(first))(quick, wide)
    fine = np.linspace(0.4, 0.7, 300_001)
    for frequency, amplitude, time in zip(quick, wide, times, strict=True):

        def ahead(t, w=frequency, a=amplitude):
            return 0.5 + a * np.sin(w * t) - np.sin(t)

        behind = np.flatnonzero(ahead(fine) <= 0)[0]
        exact = brentq(ahead, fine[behind - 1], fine[behind], xtol=1e-15)
        assert time == pytest.approx(exact, abs=1e-2 * rtol)


class Lacking(Struck):
    """It says nothing of its blow."""

    rebound = wiperjax.AbstractSystem.rebound


class Beyond(Struck):
    """It has no second switch."""

    stops = (0, 1)


class Wide(Struck):
    """Its blow has a velocity too many."""

    def rebound(self, stop, t, q, v, closed):
        return -v[0], v[0]


MISTAKES = {
    Lacking: "Lacking.rebound is missing: a system with stops must define rebound",
    Beyond: r"Beyond.stops must be a tuple of places of its 1 switches, .*, but was \(0, 1\)",
    Wide: "Wide.rebound must return 1 numbers, one a coordinate, but returned a tuple of 2",
}


@pytest.mark.parametrize("system", MISTAKES)
def test_a_stop_that_says_something_else_than_asked_is_one_line(system):
    with pytest.raises(ValueError, match=f"^{MISTAKES[system]}"):
        fits.check(system(), (-1.0,), (0.0,))


@pytest.mark.long
def test_maps_and_runs_count_blows_and_name_what_they_make():
    """A block driven between two walls strikes both in each period: in the log, the count, and the
    mechanism of a map's cell and of the same motion as a run; where the walls are far, none."""
    common = {"system": DrivenBetweenWalls, "classes": {"quiet_velocity": 1e-3}}
    asked = {"transient": 2.0, "window": 3.0, "event_log": 100}
    spec = parse_sweep(common | {"axes": {"play": {"values": [0.03, 0.5]}}, "run": asked})
    found = wiperjax.sweep(spec)
    foretold = {column.name for column in estimate.columns(spec)}
    assert foretold == set(found.data_vars)
    logged = (found.event_kind == wiperjax.Event.BLOW).sum("event").values
    assert logged[0] == pytest.approx(2 * 3.0 * 3, abs=2) and logged[1] == 0
    assert found.blow_count.values.tolist() == logged.tolist()
    names = [MECHANISMS["vibro_impact"], MECHANISMS["self_excited_slip"]]
    scene = common | {"parameters": {"play": 0.03}, "run": {"duration": 5.0, "transient": 2.0}}
    run = wiperjax.run_scene(scene)
    told = assess(run)
    assert int(run.blow_count) == int(told.blow_count) == logged[0]
    assert [int(told.mechanism), int(found.mechanism[1])] == names
    assert int(found.mechanism[0]) == names[0]
