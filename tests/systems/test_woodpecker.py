"""The woodpecker toy: published numbers, and a code of three contacts that shares nothing with it.

Published: R. I. Leine, Ch. Glocker, D. H. van Campen, "Nonlinear dynamics of the woodpecker toy",
DETC2001/VIB-21608 (period 0.1452 s, its eight events, -0.53 rad, 72.91 Hz, the equilibrium and the
friction it needs); the reference solution of siconos (examples/mechanics/Woodpecker, time stepping
with 2e-5 s).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference import woodpecker as reference

import wiperjax
from wiperjax import Coulomb, Event, Regime, Result
from wiperjax.contact.impact import phased_impact
from wiperjax.systems.woodpecker import Woodpecker

TURN = 0.6 / 5.8  # rad, of the sleeve that an edge stops
START = ((0.0, -TURN, -0.2788), (-0.3411, 0.0, -7.4583))


def simulated(duration, state=None, **parameters):
    """A run, one compiled program for all of them."""
    system = Woodpecker(**parameters)
    return wiperjax.simulate(
        system, duration, initial_state=state, rtol=1e-10, sample_interval=duration / 2000
    )


def log(run):
    """[(time, name)] of the events of a run, but those of the switch between the edges."""
    names = [Event(int(kind)).name.lower() for kind in run.event_kind]
    pairs = zip(run.event_time.values, names, strict=True)
    return [(float(time), name) for time, name in pairs if name != "kink"]


@pytest.fixture(scope="module")
def run():
    return simulated(3.0)


@pytest.mark.long
def test_events_are_those_of_a_code_of_three_contacts(run):
    told, q, v = reference.simulated(*START, 3.0)
    found = log(run)
    assert len(told) > 180
    assert [name for _, name in found] == [name for _, name in told]
    np.testing.assert_allclose([t for t, _ in found], [t for t, _ in told], atol=1e-7)
    np.testing.assert_allclose(run.final_position, q, atol=1e-6)
    np.testing.assert_allclose(run.final_velocity, v, atol=1e-4)


@pytest.mark.slow
def test_its_cycle_is_the_published_one(run):
    events = log(run)
    captures = [i for i, (_, name) in enumerate(events) if name == "capture"]
    (first, last), (begun, ended) = captures[-2:], (events[i][0] for i in captures[-2:])
    assert ended - begun == pytest.approx(0.1452, rel=0.006)
    fig7 = "release lift_off impact blow impact lift_off impact impact capture".split()
    assert [name for _, name in events[first + 1 : last + 1]] == fig7
    cycle = run.isel(event=(run.event_time > begun) & (run.event_time <= ended))
    after = cycle.regime_after.values[cycle.event_kind.values == Event.IMPACT]
    # the upper edge detaches at once, then slides; the lower one slides until it jams
    assert list(after) == [Regime.FLIGHT, Regime.SLIP_POS, Regime.FLIGHT, Regime.SLIP_NEG]
    late = run.sel(time=slice(begun, ended))
    assert float(late.position.sel(axis="bird").min()) == pytest.approx(-0.53, abs=5e-3)
    assert float(late.position.sel(axis="bird").max()) == pytest.approx(0.12, abs=1e-3)


@pytest.mark.slow
def test_its_first_cycle_is_that_of_siconos(run):
    events = log(run)[:15]
    stepped = [0.02166, 0.06124, None, 0.07792, 0.08104, 0.08162, None, 0.11882, None, 0.1677]
    stepped += [0.2073, None, 0.224, 0.2271, 0.22768]
    told = [(t, s) for (t, _), s in zip(events, stepped, strict=True) if s is not None]
    np.testing.assert_allclose(*zip(*told, strict=True), atol=4e-4)


@pytest.mark.slow
def test_its_free_motion_and_its_equilibrium_are_the_published_ones():
    system = Woodpecker()
    v = (jnp.zeros(()),) * 3

    def free(q):
        return jnp.stack(system.free_acceleration(0.0, tuple(q), v))

    squares = -np.linalg.eigvals(jax.jacfwd(free)(jnp.zeros(3))).real
    assert np.sqrt(squares.max()) / (2 * np.pi) == pytest.approx(72.91, abs=5e-3)
    rest = ((0.0, -TURN, -TURN - 0.0045 * 9.81 * 0.015 / 0.0056), (0.0, 0.0, 0.0))
    assert rest[0][2] == pytest.approx(-0.2216, abs=2e-4)
    for mu, held in ((0.286, True), (0.284, False)):  # jamming needs 0.285
        hung = simulated(0.01, rest, friction=Coulomb(mu))
        assert (int(hung.final_regime) == Regime.STICK) == held


@pytest.mark.slow
def test_a_peck_with_a_closed_edge_is_an_impact_of_both():
    start = ((0.0, TURN, 0.11), (-0.1, 0.0, 5.0))
    told, q, v = reference.simulated(*start, 0.02)
    assert [name for _, name in told] == ["blow", "lift_off"]
    found = simulated(0.02, start)
    pecks = found.isel(event=found.event_kind == Event.BLOW)
    assert list(pecks.regime_before) == list(pecks.regime_after) == [Regime.SLIP_NEG]
    assert [name for _, name in log(found)] == ["blow", "lift_off"]
    np.testing.assert_allclose([t for t, _ in log(found)], [t for t, _ in told], atol=1e-9)
    np.testing.assert_allclose(found.final_position, q, atol=1e-9)
    np.testing.assert_allclose(found.final_velocity, v, atol=1e-7)


@pytest.mark.slow
def test_pecks_that_pile_up_end_with_a_code():
    """A longer beak, less weight: the spring would hold it on the pole, while the sleeve jams. Each
    peck throws the sleeve off, three events in a third of the time of those before."""
    start = ((0.0, -TURN, -0.13), (0.0, 0.0, 0.0))
    own = {"beak_length": 0.0249, "gravity": 0.5}
    bounced = simulated(1.0, start, **own)
    assert int(bounced.result) in (Result.ZENO_UNRESOLVED, Result.STEP_TOO_SMALL)
    assert float(bounced.final_time) < 0.03 and bounced.attrs["steps"] < 20_000
    names = [name for _, name in log(bounced)]
    assert names[:12] == ["blow", "impact", "capture"] * 4
    held = simulated(1.0, start, beak_restitution=1e-12, **own)
    assert int(held.result) == Result.ZENO_UNRESOLVED
    assert "a stop" in held.attrs["result_message"]


@pytest.mark.slow
def test_blows_lower_than_a_digit_have_piled_up():
    """A short arm: the next flight is lower than the rounding of the bird's angle. They went on to
    two dozen at one instant."""
    piled = simulated(0.5, bird_arm=0.0101)
    assert int(piled.result) == Result.ZENO_UNRESOLVED
    assert float(piled.final_time) == pytest.approx(0.1642754, abs=1e-6)
    assert piled.event_kind[-1] == Event.BLOW
    assert np.all(np.diff(piled.event_time) > 1e-9)


def test_what_cannot_be_is_refused_in_one_line():
    for radius in (0.004, 0.0031):
        with pytest.raises(
            ValueError, match=r"^pole_radius must be below sleeve_radius \(0.0031\)"
        ):
            Woodpecker(pole_radius=radius)
    with pytest.raises(ValueError, match=r"holds \(the beak is outside the pole\), but was"):
        simulated(1.0, ((0.0, 0.0, 0.2), (0.0, 0.0, 0.0)))


@pytest.mark.slow
def test_blows_are_impacts_by_complementarity():
    rng, n = np.random.default_rng(3), 300
    v = rng.normal(size=(3, n)) * np.array([[0.5], [20.0], [10.0]])
    closed = np.arange(n) % 2 == 0
    side = np.where(rng.random(n) < 0.5, 1.0, -1.0)
    v[1] = np.where(closed, np.where(rng.random(n) < 0.5, 0.0, -side * np.abs(v[1])), v[1])
    v[2] = np.abs(v[2])
    q = (np.zeros(n), side * TURN, np.full(n, 0.12))
    found = jax.jit(lambda *x: Woodpecker().rebound(1, 0.0, *x))(q, tuple(v), closed)
    for i in range(n):
        edge = reference.UPPER if side[i] > 0 else reference.LOWER
        contacts = [reference.BEAK, edge] if closed[i] else [reference.BEAK]
        exact = reference.impact(v[:, i], contacts, 0.5)
        np.testing.assert_allclose([x[i] for x in found], exact, atol=1e-9)


@pytest.mark.slow
def test_a_blow_that_stops_all_is_shared_as_among_equal_springs():
    """Four contacts hold three coordinates: what each takes is not told by rigid bodies."""
    rng, n, stopped = np.random.default_rng(0), 300, 0
    v = np.array([rng.normal(size=n) * 0.1, np.zeros(n), np.abs(rng.normal(size=n)) * 5])
    q = (np.zeros(n), np.full(n, TURN), np.full(n, 0.12))
    rebound = jax.jit(lambda v: jnp.stack(Woodpecker().rebound(1, 0.0, q, tuple(v), True)))
    found = np.asarray(rebound(v))
    moved = np.asarray(rebound(v * (1 + 1e-13 * rng.normal(size=v.shape))))
    np.testing.assert_allclose(found, moved, atol=1e-10)
    for i in range(n):
        contacts = [reference.BEAK, reference.UPPER]
        stopped += np.abs(reference.impact(v[:, i], contacts, 0.0)).max() < 1e-12
        yielding = reference.impact(v[:, i], contacts, 0.5, give=1e-7)
        np.testing.assert_allclose(found[:, i], yielding, atol=1e-5)
    assert stopped > 10


@pytest.mark.slow
def test_what_follows_a_blow_of_a_jammed_sleeve_converges():
    """Where all is stopped, rounding chose: the next event came at 0.69944 s, or 0.69979 s, ..."""
    system, ends = Woodpecker(gravity=1.6), []
    for rtol in (1e-7, 1e-8, 1e-9, 1e-10):
        run = wiperjax.simulate(system, 0.71, rtol=rtol, sample_interval=1e-3)
        times = run.event_time.values
        blow = int(np.flatnonzero(run.event_kind.values == Event.BLOW)[-1])
        assert times[blow] == pytest.approx(0.69171192, abs=1e-7)
        ends.append(float(times[blow + 1]))
    np.testing.assert_allclose(ends, 0.6994809, atol=1e-7)


@pytest.mark.slow
def test_an_edge_at_rest_is_held_by_static_friction():
    def behind(slip, law):
        system = Woodpecker(friction=law)
        return system.rebound(1, 0.0, (0.0, TURN, 0.12), (slip, 0.0, 5.0), jnp.asarray(True))

    for slip, as_by in ((0.0, 0.6), (1e-17, 0.6), (0.05, 0.2)):
        found = behind(slip, Coulomb(0.6, 0.2))
        np.testing.assert_allclose(found, behind(slip, Coulomb(as_by)), atol=1e-12)
        assert abs(found[0] - behind(slip, Coulomb(0.8 - as_by))[0]) > 0.01


@pytest.mark.slow
def test_impacts_of_an_edge_are_those_of_pfeiffer_and_glocker():
    rng, n = np.random.default_rng(4), 600
    ways = np.array([reference.NORMAL[reference.UPPER], reference.ALONG[reference.UPPER]])
    (w_nn, w_tn), (_, w_tt) = ways @ reference.INVERSE @ ways.T
    v = rng.normal(size=(n, 3)) * np.array([0.1, 20.0, 10.0])
    v[:, 1] = np.abs(v[:, 1])
    speeds = ways @ v.T
    blow = phased_impact(w_tt, w_tn, w_nn, reference.MU, 0.0, speeds[1], speeds[0])
    stuck = np.asarray(blow.slip_speed) == 0
    assert 10 < stuck.sum() < n
    turned = np.asarray(blow.slip_speed) * speeds[1] < 0  # where the law is another than Routh's
    assert turned.sum() > 10
    for i in range(n):
        after = ways @ reference.impact(v[i], [reference.UPPER], 0.5)
        assert float(blow.normal_speed[i]) == pytest.approx(after[0], abs=1e-12)
        assert float(blow.slip_speed[i]) == pytest.approx(after[1], abs=1e-12)
