"""What holds of every blade, drawn at large: laws of mechanics that no method may break.

One compiled program serves all examples of one motion: blade, belt, start, duration and tolerance
are its arguments; another one those of a batch. A few examples by default; `pytest
--hypothesis-profile many` draws a thousand.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import wiperjax
from wiperjax import Result, SteadyBelt, Wiper
from wiperjax.engine.carry.problem import make_case
from wiperjax.engine.lanes import Pool, run_pool
from wiperjax.engine.observers.base import AbstractObserver
from wiperjax.vocabulary.codes import HITS

MANY = settings.default.max_examples >= 1000  # the profile of conftest.py
few = settings(
    max_examples=settings.default.max_examples if MANY else 12,
    derandomize=not MANY,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

pytestmark = pytest.mark.slow
DURATION = 0.01
FINE = 1e-10
LANES = 8  # cases of a batch


def between(low, high):
    return st.floats(low, high, allow_nan=False)


BLADES = st.fixed_dictionaries(
    dict(
        tip_mass=between(0.005, 0.1),
        lip_length=between(4e-3, 8e-3),
        support_stiffness=between(500.0, 20000.0),
        support_damping=between(0.0, 5.0),
        neck_stiffness=between(1e-3, 0.05),
        attack_angle=between(-0.7, 0.7),
        normal_load=between(5.0, 30.0),
        restitution=between(0.0, 0.8),
        mu_static=between(0.4, 1.4),
        mu_minimum=between(0.1, 0.4),
        speed=between(0.05, 1.0),
        drop=st.just(0.0) | between(0.0, 1e-4),  # m, that the tip is let go above the glass
    )
)


class Balance(AbstractObserver):
    """Integrals of the tangential acceleration that the contact has no part in [m/s], and of the
    power that slip and the dashpot take [J/m]."""

    def init(self, dtype, shape=()):
        return jnp.zeros(shape, dtype), jnp.zeros(shape, dtype)

    def stretch(self, record, stretch):
        wiper, free, power = stretch.system, [], []
        for t, q, v, forces in stretch.nodes:
            lean = q[0] / jnp.sqrt(wiper.lip_length**2 - q[0] ** 2)
            slip = forces.tangential * wiper.slip_speed(t, q, v)
            free.append(wiper.free_acceleration(t, q, v)[0])
            along, up = wiper.rates(t, q, v)
            power.append(wiper.support_damping * (up - lean * along) ** 2 - slip)
        return record[0] + stretch.integral(free), record[1] + stretch.integral(power)

    def event(self, record, happening):
        return record


@eqx.filter_jit
def _move(blade, position, velocity, begin, duration, rtol):
    blade = dict(blade)
    wiper = Wiper(belt=SteadyBelt(blade.pop("speed")), **blade)
    state = position, velocity
    return wiperjax.solve(
        wiper,
        duration,
        initial_state=state,
        rtol=rtol,
        max_events=1024,
        start=begin,
        observer=Balance(),
    )


def move(blade, *, start=None, begin=0.0, duration=DURATION, rtol=FINE):
    """The motion of a blade let go at rest above the glass, or from ``start``."""
    numbers = {name: jnp.asarray(float(value)) for name, value in blade.items()}
    drop = numbers.pop("drop")
    place = (numbers["lip_length"] * jnp.sin(numbers["attack_angle"]), drop)
    position, velocity = start or (place, (0.0, 0.0))
    arrays = (tuple(jnp.asarray(float(x)) for x in part) for part in (position, velocity))
    times = (jnp.asarray(float(x)) for x in (begin, duration, rtol))
    found = _move(numbers, *arrays, *times)
    assume(Result(int(found.result)) == Result.FINISHED)
    return found


@eqx.filter_jit
def _together(numbers):
    numbers = dict(numbers)
    drop = numbers.pop("drop")
    wiper = Wiper(belt=SteadyBelt(numbers.pop("speed")), **numbers)
    place = (wiper.lip_length * jnp.sin(wiper.attack_angle), drop)
    case = make_case(wiper, DURATION, (place, (0.0 * drop, 0.0 * drop)))
    return run_pool(Pool(case, jnp.asarray(LANES)), LANES // 2)[0].tree()


def together(blades):
    """What `blades` leave that run in one batch, of half as many lanes, (cases,) each."""
    found = _together({k: np.array([blade[k] for blade in blades]) for k in blades[0]})
    pairs = (*found.position, *found.velocity)
    return [np.asarray(x) for x in (found.result, found.steps, found.events, *pairs)]


def state(found):
    return np.array([*found.final_position, *found.final_velocity], float)


def size(blade):
    """Sizes of (x, y, x', y'), by which differences are judged."""
    natural = np.sqrt(blade["normal_load"] * blade["lip_length"] / blade["tip_mass"])
    return np.repeat([blade["lip_length"], max(blade["speed"], natural)], 2)


def tame(blade, found):
    """Whether the motion tells a perturbed blade from this one by little: it is not irregular, and
    no event hangs on the last digit."""
    close = move({**blade, "normal_load": blade["normal_load"] * (1 + 1e-9)})
    apart = np.abs(state(close) - state(found)) / size(blade)
    return apart.max() < 1e-7 and int(close.events.count) == int(found.events.count)


@pytest.mark.long
@few
@given(BLADES)
def test_a_glass_at_rest_only_takes_energy(blade):
    blade["speed"] = 0.0
    wiper = Wiper(**{k: v for k, v in blade.items() if k not in ("speed", "drop")})
    place = blade["lip_length"] * np.sin(blade["attack_angle"])
    energies = [float(wiper.energy((place, blade["drop"]), (0.0, 0.0)))]
    for part in (0.25, 0.5, 1.0):
        found = move(blade, duration=part * DURATION)
        energies.append(float(wiper.energy(found.final_position, found.final_velocity)))
    unit = blade["normal_load"] * blade["lip_length"]
    assert np.all(np.diff(energies) <= 1e-8 * unit)


@few
@given(BLADES)
def test_energy_rises_by_no_more_than_the_belt_does(blade):
    """Work of the belt: its speed times the momentum that friction, in blows too, gives the tip.
    What of it is neither in the tip's energy nor lost to slip and dashpot, impacts have taken."""
    found = move(blade)
    wiper = Wiper(**{k: v for k, v in blade.items() if k not in ("speed", "drop")})
    place = blade["lip_length"] * np.sin(blade["attack_angle"])
    rise = wiper.energy(found.final_position, found.final_velocity)
    rise -= wiper.energy((place, blade["drop"]), (0.0, 0.0))
    freely, lost = found.statistics
    work = blade["speed"] * blade["tip_mass"] * (found.final_velocity[0] - freely)
    unit = blade["normal_load"] * blade["lip_length"]
    by_impacts = float(work - rise - lost) / unit
    assert by_impacts >= -1e-6 and lost >= -1e-12 * unit
    if not any(kind in HITS for kind in found.events.kind[: int(found.events.count)]):
        assert by_impacts <= 1e-6


@few
@given(BLADES)
def test_the_mirror_image_moves_as_the_mirror_image(blade):
    found = move(blade)
    mirrored = move({**blade, "attack_angle": -blade["attack_angle"], "speed": -blade["speed"]})
    assert np.allclose(state(mirrored), state(found) * [-1, 1, -1, 1], rtol=0, atol=1e-12)
    assert int(mirrored.events.count) == int(found.events.count)


@pytest.mark.long
@few
@given(BLADES, st.integers(-3, 3), st.integers(-3, 3), st.integers(-3, 3))
def test_units_are_of_no_account(blade, mass, length, time):
    """Another kilogram, metre and second: powers of two, which round nothing themselves."""
    found = move(blade)
    m, l, t = 2.0**mass, 2.0**length, 2.0**time
    units = dict(
        tip_mass=m,
        lip_length=l,
        support_stiffness=m / t**2,
        support_damping=m / t,
        neck_stiffness=m * l**2 / t**2,
        normal_load=m * l / t**2,
        speed=l / t,
        drop=l,
    )
    assume(tame(blade, found))
    scaled = {k: v * units.get(k, 1.0) for k, v in blade.items()}
    # what the others have by default has units, too
    defaults = Wiper()
    for name, unit in dict(
        shoulder_stiffness=m * l**2 / t**2, stribeck_speed=l / t, viscous_slope=t / l
    ).items():
        scaled[name] = float(getattr(defaults, name)) * unit
        blade[name] = float(getattr(defaults, name))
    found, other = move(blade), move(scaled, duration=DURATION * t)
    factor = np.array([l, l, l / t, l / t])
    assert np.allclose(state(other) / factor / size(blade), state(found) / size(blade), atol=1e-6)


@few
@given(BLADES, between(0.1, 0.9))
def test_a_motion_in_two_parts_is_the_motion(blade, part):
    found = move(blade)
    assume(tame(blade, found))
    first = move(blade, duration=part * DURATION)
    second = move(
        blade, start=(first.final_position, first.final_velocity), duration=(1 - part) * DURATION
    )
    assert np.allclose(state(second) / size(blade), state(found) / size(blade), rtol=0, atol=1e-6)


@few
@given(BLADES)
def test_a_tolerance_a_hundred_times_finer_says_the_same(blade):
    found = move(blade, rtol=1e-8)
    assume(tame(blade, move(blade)))
    finer = move(blade)
    assert int(found.events.count) == int(finer.events.count)
    assert np.allclose(state(found) / size(blade), state(finer) / size(blade), rtol=0, atol=1e-5)


@few
@given(BLADES, between(0.0, 100.0))
def test_on_a_steady_belt_no_instant_is_special(blade, start):
    """A motion that begins later is the same motion: by what a clock at ``start`` rounds."""
    found = move(blade)
    assume(tame(blade, found))
    later = move(blade, begin=start)
    assert int(later.events.count) == int(found.events.count)
    assert np.allclose(state(later) / size(blade), state(found) / size(blade), rtol=0, atol=1e-6)


@pytest.mark.long
@few
@given(st.lists(BLADES, min_size=LANES, max_size=LANES), st.permutations(range(LANES)))
def test_lanes_do_not_know_each_other(blades, order):
    """Cases in another order leave the same numbers, bit for bit."""
    first, second = together(blades), together([blades[i] for i in order])
    for ours, theirs in zip(first, second, strict=True):
        np.testing.assert_array_equal(ours[np.array(order)], theirs)
