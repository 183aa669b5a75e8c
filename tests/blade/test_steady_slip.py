"""Steady slip: the closed forms of docs/model.md, section 10, and simulations."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax.blade.steady_slip import steady_slip, steady_slip_branches
from wiperjax.vocabulary.declared import SET_BY_THE_ENGINE

HOPF = {-30: 0.5766, -10: 0.5017, 0: 0.4511, 10: 0.3937, 30: 0.2470}  # degrees -> m/s
CELLS = 64


def random_blades(seed, **extra):
    """Blades off the reference, one value a cell; and belt speeds."""
    rng = np.random.default_rng(seed)

    def around(value):
        return value * rng.uniform(0.7, 1.4, CELLS)

    blade = wiperjax.Wiper(
        tip_mass=around(2.4e-3),
        lip_length=around(6e-3),
        support_stiffness=around(2000.0),
        support_damping=around(1.0),
        neck_stiffness=around(0.05),
        shoulder_stiffness=around(2.0),
        shoulder_angle=around(0.6),
        attack_angle=np.radians(rng.uniform(-35, 35, CELLS)),
        normal_load=around(15.0),
        mu_static=around(1.0),
        mu_minimum=around(0.3),
        stribeck_speed=around(0.1),
        stribeck_shape=rng.uniform(1, 2, CELLS),
        **{name: around(value) for name, value in extra.items()},
    )
    return blade, rng.uniform(0.05, 1.0, CELLS)


def friction(w, v):
    """mu and mu' at slip speed v > 0 (docs/model.md, section 4)."""
    ratio = (v / w.stribeck_speed) ** w.stribeck_shape
    step = (w.mu_static - w.mu_minimum) * np.exp(-ratio)
    slope = -step * ratio * w.stribeck_shape / v + w.viscous_slope
    return w.mu_minimum + step + w.viscous_slope * v, slope


def spring(w, theta):
    """M and M' (docs/model.md, section 2)."""
    past = np.maximum(theta - w.shoulder_angle, 0) + np.minimum(theta + w.shoulder_angle, 0)
    rise = w.shoulder_stiffness - w.neck_stiffness
    return (
        w.neck_stiffness * theta + rise * past,
        w.neck_stiffness + rise * (np.abs(theta) > w.shoulder_angle),
    )


@pytest.mark.slow
def test_equilibrium_and_linearisation_are_the_closed_forms():
    w, speed = random_blades(1, hinge_damping=1e-5)
    found = steady_slip_branches(w, speed)
    count = np.asarray(found.exists).sum(axis=-1)
    assert set(count) == {1, 3}
    for branch in range(3):
        r = jax.tree.map(lambda x, i=branch: np.asarray(x)[:, i], found)
        tau, arm, phi = np.tan(r.phi), w.lip_length * np.cos(r.phi), r.phi
        here = r.exists
        mu, slope = friction(w, speed)
        moment, stiffness = spring(w, phi - w.attack_angle)
        sink = w.lip_length * (np.cos(phi) - np.cos(w.attack_angle))
        load = w.normal_load + w.support_stiffness * sink
        c_eff = w.support_damping * tau * (tau + mu) + slope * load + w.hinge_damping / arm**2
        k_eff = (
            stiffness / arm**2
            + w.support_stiffness * tau * (tau + mu)
            + load * (mu * tau - 1) / arm
        )
        balance = moment - w.lip_length * load * (np.sin(phi) + mu * np.cos(phi))
        scale = w.lip_length * load
        assert np.all(np.abs(balance[here]) < 1e-11 * scale[here])
        size = w.support_damping + np.abs(slope * load)
        np.testing.assert_allclose(r.normal_force[here], load[here], rtol=1e-12)
        assert np.all(np.abs(r.c_eff - c_eff)[here] < 1e-10 * size[here])
        np.testing.assert_allclose(r.k_eff[here], k_eff[here], rtol=1e-8)
        np.testing.assert_allclose(r.mass[here], w.tip_mass[here], rtol=1e-14)
        values = np.emath.sqrt(c_eff**2 - 4 * w.tip_mass * k_eff)
        roots = (-c_eff + values) / (2 * w.tip_mass)
        np.testing.assert_allclose(r.growth_rate[here], roots.real[here], rtol=1e-8, atol=1e-6)
        np.testing.assert_allclose(
            r.frequency[here], np.abs(roots.imag[here]) / (2 * np.pi), rtol=1e-8, atol=1e-6
        )
        assert np.all(np.isnan(r.growth_rate[~here])) and np.all(np.isnan(r.x[~here]))


@pytest.mark.slow
def test_hopf_speeds_of_the_reference_blade():
    blade = wiperjax.Wiper(attack_angle=np.radians(list(HOPF)))
    speed = np.array(list(HOPF.values()))
    below, above = (steady_slip(blade, speed + d) for d in (-5e-5, 5e-5))
    assert np.all(below.growth_rate > 0) and np.all(above.growth_rate < 0)
    assert np.all(below.k_eff > 0)


@pytest.mark.long
def test_three_branches_on_the_leading_side_and_their_hopf_speed():
    blade = wiperjax.Wiper(attack_angle=np.radians(-30.0))
    below, above = (steady_slip_branches(blade, 0.2842 + d) for d in (-5e-5, 5e-5))
    assert list(np.asarray(below.exists)) == [True, True, True, False, False]
    assert np.all(np.diff(below.phi[:3]) < 0)
    assert below.k_eff[1] < 0 and below.frequency[1] == 0  # the saddle on the neck
    assert below.growth_rate[2] > 0 > above.growth_rate[2]
    steady = steady_slip(blade, 0.2842 - 5e-5)
    assert steady.phi.shape == () and steady.phi == below.phi[0]


@pytest.mark.slow
def test_branches_are_seen_where_they_are_born():
    """Two are born at a shoulder, the farther one first along the belt: while they lay within 0.35
    degrees of each other the third was taken for the branch that leans farthest. The angles are
    roots of the closed form, found on a grid of 400001."""

    def branches(angle):
        return steady_slip_branches(wiperjax.Wiper(attack_angle=angle, support_damping=1.0), 0.3)

    beside = branches(-0.6530319102837717)
    expected = [-3.0357539371, -3.1288972048, -72.2650005817]
    np.testing.assert_allclose(np.degrees(beside.phi[:3]), expected, rtol=1e-9)
    none, two = -0.6540, -0.6530
    while two - none > 1e-9:
        middle = 0.5 * (none + two)
        born = bool(branches(middle).exists[1])
        none, two = (none, middle) if born else (middle, two)
    assert np.degrees(-np.diff(branches(two).phi[:2])) < 1e-5


@pytest.mark.long
def test_mirror_image():
    blade, speed = random_blades(2)
    mirrored = replace(blade, attack_angle=-blade.attack_angle)
    a, b = steady_slip(blade, speed), steady_slip(mirrored, -speed)
    np.testing.assert_allclose(a.phi, -b.phi, rtol=1e-12)
    np.testing.assert_allclose(a.growth_rate, b.growth_rate, rtol=1e-8, atol=1e-6)


@pytest.mark.slow
def test_no_steady_slip_is_nan_and_shapes_are_broadcast():
    angle = np.radians([[60.0], [5.0]])
    r = steady_slip(wiperjax.Wiper(attack_angle=angle), np.array([0.0, 0.2, 0.3]))
    assert r.phi.shape == (2, 3)
    assert np.array_equal(r.exists, [[False] * 3, [False, True, True]])
    assert np.array_equal(np.isnan(r.growth_rate), ~np.asarray(r.exists))
    # the speed of the belt itself is the default
    own = steady_slip(wiperjax.Wiper(attack_angle=angle, belt=wiperjax.SteadyBelt(0.3)))
    np.testing.assert_array_equal(own.phi, r.phi[:, 2:])


@pytest.mark.slow
def test_steady_slip_that_hardly_presses_is_seen():
    """A stiff support has nearly let go at its lean, 0.08 degrees before the lip lifts off: within
    one interval of the grid of angles."""
    lean, mu = 0.5257029305406067, wiperjax.Wiper().law.coefficient(0.244163595)
    blade = wiperjax.Wiper(
        support_stiffness=25690.64634,
        neck_stiffness=0.007035784581,
        shoulder_stiffness=0.2029603022,
        shoulder_angle=0.3080565969,
        normal_load=5.714850366732287,
        attack_angle=0.44798074154919054,
        belt=wiperjax.SteadyBelt(0.244163595),
    )
    found = steady_slip(blade)
    assert float(found.phi) == pytest.approx(lean, abs=1e-7)
    load, moment = float(found.normal_force), spring(blade, found.phi - blade.attack_angle)[0]
    assert 0 < load < 0.02 * blade.normal_load
    held = blade.lip_length * load * (np.sin(found.phi) + mu * np.cos(found.phi))
    assert float(moment) == pytest.approx(float(held), rel=1e-9)
    assert np.isfinite(found.growth_rate)


def slip_by_hand(w, i, speed, x, velocity):
    """x'' of slip under V > 0 with a hinge mass: docs/model.md, section 3, by hand."""

    def at(name):
        value = getattr(w, name)
        return value[i] if np.ndim(value) else value

    one = type(
        "blade",
        (),
        {name: at(name) for name in vars(w) if name not in ("belt", *SET_BY_THE_ENGINE)},
    )
    m, h, length = one.tip_mass, one.hinge_mass, one.lip_length
    phi = np.arcsin(x / length)
    tau, cos = np.tan(phi), np.cos(phi)
    turn = 1 / (length * cos**3)
    down = (
        one.normal_load
        + one.support_stiffness * length * (cos - np.cos(one.attack_angle))
        - one.support_damping * tau * velocity
    )
    moment = spring(one, phi - one.attack_angle)[0]
    moment += one.hinge_damping * velocity / (length * cos)
    f_t = -moment / (length * cos) + (down + h * one.gravity) * tau
    f_n = -down - (m + h) * one.gravity
    h_t, h_n = h * turn * velocity**2 * tau, -h * turn * velocity**2
    mu = friction(one, speed - velocity)[0]
    # unknown: x'', lambda_n; y'' = 0, lambda_t = mu lambda_n
    matrix = [[m + h * tau**2, -mu], [-h * tau, -1.0]]
    return np.linalg.solve(matrix, [f_t - h_t, f_n - h_n])[0]


@pytest.mark.long
def test_hinge_mass():
    blade, speed = random_blades(3, hinge_mass=1.2e-3, hinge_damping=1e-5, gravity=9.81)
    r = steady_slip(blade, speed)
    assert np.all(r.exists)
    for i in range(0, CELLS, 4):
        length = blade.lip_length[i]

        def acceleration(x, velocity, i=i, length=length):
            return slip_by_hand(blade, i, speed[i], x * length, velocity)

        at, d = float(r.x[i]) / length, 1e-6
        assert abs(acceleration(at, 0.0)) < 1e-7
        by_x = (acceleration(at + d, 0.0) - acceleration(at - d, 0.0)) / (2 * d * length)
        by_v = (acceleration(at, d) - acceleration(at, -d)) / (2 * d)
        values = np.linalg.eigvals([[0.0, 1.0], [by_x, by_v]])
        growth, turn = values.real.max(), np.abs(values.imag).max()
        assert r.growth_rate[i] == pytest.approx(growth, rel=1e-6, abs=1e-3)
        assert 2 * np.pi * r.frequency[i] == pytest.approx(turn, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "hopf", "branch"), [(10.0, 0.3937, 0), (-30.0, 0.2842, 2)])
@pytest.mark.parametrize("side", [0.97, 1.03])
def test_simulations_beside_the_boundary_grow_as_linearised(angle, hopf, branch, side):
    speed = side * hopf
    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(speed), attack_angle=np.radians(angle))
    r = jax.tree.map(lambda x: float(x[branch]), steady_slip_branches(blade))
    period = 1 / r.frequency
    run = wiperjax.simulate(
        blade,
        30 * period,
        initial_state=((r.x + 1e-6 * blade.lip_length, 0.0), (0.0, 0.0)),
        rtol=1e-12,
        sample_interval=period / 20,
    )
    assert run.sizes["event"] == 0
    value = complex(r.growth_rate, 2 * np.pi * r.frequency)
    offset = run.position.sel(axis="x").values - r.x
    wave = run.velocity.sel(axis="x").values - np.conj(value) * offset  # ~ exp(value t)
    growth = np.polyfit(run.time, np.log(np.abs(wave)), 1)[0]
    turn = np.polyfit(run.time, np.unwrap(np.angle(wave)), 1)[0]
    assert (growth > 0) == (side < 1)
    assert growth == pytest.approx(r.growth_rate, rel=2e-5)  # measured: 4e-6
    assert turn == pytest.approx(value.imag, rel=1e-7)


@pytest.mark.long
def test_simulations_beside_the_boundary_all_over_the_map():
    """Random blades, each at 3 % below and above its own Hopf speed, 1e-6 L from equilibrium."""
    blade, _ = random_blades(2)
    speeds = np.geomspace(0.05, 2.0, 24)
    rates = np.array([steady_slip(blade, np.full(CELLS, v)).growth_rate for v in speeds])
    falls = (rates[:-1] > 0) & (rates[1:] < 0)
    place = np.argmax(falls, axis=0)
    low, high = speeds[place], speeds[place + 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        grows = np.asarray(steady_slip(blade, middle).growth_rate) > 0
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    beside = low * np.array([[0.97], [1.03]])
    r = [jax.tree.map(np.asarray, steady_slip(blade, v)) for v in beside]
    # a boundary of oscillation, on one branch
    good = falls.any(axis=0) & (r[0].frequency > 0) & (r[1].frequency > 0)
    good &= (r[0].growth_rate > 0) & (r[1].growth_rate < 0)
    assert good.sum() >= 40
    r = jax.tree.map(lambda *x: np.concatenate([y[good] for y in x]), *r)
    beside = beside[:, good].ravel()
    blade = jax.tree.map(lambda x: jnp.asarray(np.tile(x[good], 2) if np.ndim(x) else x), blade)
    # whole periods, in which the wave changes by less than a factor e: it stays small
    turns = np.floor(np.clip(r.frequency / np.abs(r.growth_rate), 1, 20))
    last = turns / r.frequency

    @jax.jit
    @jax.vmap
    def run(wiper, speed, x, duration):
        wiper = replace(wiper, belt=wiperjax.SteadyBelt(speed))
        start = ((x, 0.0), (0.0, 0.0))
        s = wiperjax.solve(wiper, duration, initial_state=start, rtol=1e-12, max_events=0)
        return s.final_position[0], s.final_velocity[0], s.events.count

    offset = 1e-6 * np.asarray(blade.lip_length)
    blade = jax.tree.map(lambda x: jnp.broadcast_to(x, offset.shape), blade)
    x, v, events = run(blade, beside, r.x + offset, last)
    assert np.all(events == 0)
    value = r.growth_rate + 2j * np.pi * r.frequency
    wave = (v - np.conj(value) * (x - r.x)) / (-np.conj(value) * offset)
    np.testing.assert_array_equal(np.sign(np.log(np.abs(wave))), np.sign(r.growth_rate))
    ratio = np.log(np.abs(wave)) / (r.growth_rate * last)
    assert np.median(np.abs(ratio - 1)) < 1e-4
    np.testing.assert_allclose(ratio, 1, rtol=3e-3)  # measured: 1e-3
    np.testing.assert_allclose(np.angle(wave), 0, atol=3e-3)  # after whole periods


@pytest.mark.long
def test_a_cell_does_not_depend_on_how_many_there_are():
    """Bit for bit: a block of a map may be of any size."""
    angles = np.radians(np.linspace(-40, 40, 140))
    many = steady_slip(wiperjax.Wiper(attack_angle=angles), 0.3)
    for count in (1, 45, 100):
        few = steady_slip(wiperjax.Wiper(attack_angle=angles[:count]), 0.3)
        for one, other in zip(few, many, strict=True):
            np.testing.assert_array_equal(one, other[:count])


def test_shapes_that_do_not_fit_are_named():
    """NumPy counted the numbers of the wiper: "Mismatch is between arg 8 ... and arg 21"."""
    with pytest.raises(ValueError, match=r"fit together, but had \(2,\) and \(3,\)$"):
        steady_slip(wiperjax.Wiper(attack_angle=np.zeros(2)), np.full(3, 0.3))
