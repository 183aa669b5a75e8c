"""Complex eigenvalues: closed forms, the rigid lip's own linearisation, motions that grow alike."""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import own_systems
import pytest
import xarray as xr
from scipy.optimize import brentq

import wiperjax
from wiperjax import Coulomb
from wiperjax.blade.rungs import on_rung
from wiperjax.cli import main
from wiperjax.datasets.kinds import kind_of
from wiperjax.modes.over import VERDICTS, beside, shares
from wiperjax.modes.table import modes_of
from wiperjax.systems.chain import Chain3
from wiperjax.systems.flutter import ModeCoupling
from wiperjax.systems.head_and_tip import HeadAndTip
from wiperjax.systems.soft_lip import SoftLip


@pytest.mark.long
@pytest.mark.parametrize("mu", [0.0, 0.5, 0.7, 0.8, 1.0])
def test_the_minimal_model_locks_in_as_published(mu):
    """omega^2 = 2 -+ sqrt(1 - 4 mu/3) (Hoffmann et al. 2002)."""
    found = wiperjax.modes(ModeCoupling(friction=Coulomb(mu)))
    assert kind_of(found) == "modes"
    squares = 2 + np.sqrt(1 - 4 * mu / 3 + 0j) * np.array([1, -1])
    exact = 1j * np.sqrt(squares)
    exact = np.where(exact.imag < 0, -exact, exact)
    exact = exact[np.argsort(-exact.real, kind="stable")]
    values = found.real_part.values + 2j * np.pi * found.frequency.values
    for value in values:
        assert np.min(np.abs(exact - value)) < 1e-7
    if mu == 1.0:
        assert values[0] == pytest.approx(0.202072 + 1.428577j, abs=1e-6)
        # friction feeds the mode by the phase between its coordinates
        assert abs(float(found.shape_phase[:, 0].max() - found.shape_phase[:, 0].min())) > 0.5


@pytest.mark.long
def test_a_motion_grows_at_the_rate_of_the_eigenvalue():
    system = ModeCoupling()
    mode = wiperjax.modes(system)
    place = mode.position.values
    start = tuple(place + [1e-7, 0.0]), (0.0, 0.0)
    undamped = ModeCoupling(damping=jnp.zeros(()))  # 0 as an array: of the program with damping
    run = wiperjax.simulate(undamped, 60.0, initial_state=start, sample_interval=0.05, rtol=1e-10)
    size = np.hypot(*(run.position.values - place).T)
    time = run.time.values
    # whole periods of the envelope: the logarithm of its maxima
    peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
    late = peaks[(time[peaks] > 30) & (size[peaks] < 1e-2)]
    rate = np.polyfit(time[late], np.log(size[late]), 1)[0]
    assert rate == pytest.approx(float(mode.real_part[0]), rel=2e-3)


@pytest.mark.slow
def test_growth_ends_where_the_mass_leaves_the_belt():
    system = ModeCoupling(damping=0.05)
    run = wiperjax.simulate(system, 200.0, initial_state=((0.5, 0.0), (0.0, 0.0)))
    assert int(run.result) == 0
    assert float(run.normal_force.min()) == 0.0  # it lifts off, and comes back
    assert float(run.normal_force[-500:].max()) > 0.0
    size = abs(run.position).max("axis")
    assert float(size[1000:].max()) < 1.5 * float(size[:1000].max())  # it grows no more


@pytest.mark.slow
def test_modes_of_the_rigid_lip_are_its_steady_slip():
    wiper = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=math.radians(5))
    slip, found = wiperjax.steady_slip(wiper), wiperjax.modes(wiper)
    assert found.sizes["mode"] == 1
    assert float(found.real_part[0]) == pytest.approx(float(slip.growth_rate), rel=1e-9)
    assert float(found.frequency[0]) == pytest.approx(float(slip.frequency), rel=1e-9)
    assert float(found.normal_force) == pytest.approx(float(slip.normal_force), rel=1e-9)
    ratio = -found.real_part / np.hypot(found.real_part, 2 * np.pi * found.frequency)
    np.testing.assert_allclose(found.damping_ratio, ratio, rtol=1e-12)


@pytest.mark.long
def test_a_belt_that_turns_is_judged_at_its_peak_as_in_a_map():
    """At t = 0 it rests: no steady sliding was found, where a map has its growth rate."""
    turning = wiperjax.Wiper(belt=wiperjax.WipingBelt(0.3, 5.0), attack_angle=math.radians(5))
    steady = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=math.radians(5))
    ramped = wiperjax.Wiper(
        belt=wiperjax.TrapezoidBelt(-0.3, 5.0, 0.02, phase=0.7), attack_angle=math.radians(5)
    )
    for other in (turning, ramped):
        xr.testing.assert_allclose(wiperjax.modes(other), wiperjax.modes(steady), rtol=1e-9)


@pytest.mark.slow
def test_every_lip_on_a_belt_that_turns_is_sought_at_its_peak():
    """A bar was sought where the lip slides at t = 0, and another of its equilibria was found."""
    for phase in (0.0, math.pi + 0.3):
        places = {}
        for belt in (wiperjax.WipingBelt(0.3, 5.0, phase), wiperjax.SteadyBelt(0.3)):
            numbers = {"belt": belt, "attack_angle": math.radians(-30)}
            lip = wiperjax.Wiper(**numbers)
            for system in (lip, on_rung(lip, "bar"), SoftLip(**numbers)):
                places.setdefault(type(system), []).append(system.sliding_near())
        for turning, steady in places.values():
            np.testing.assert_allclose(turning, steady, rtol=1e-9)


class SameWiper(wiperjax.Wiper):
    """A class of one's own that changes nothing."""


@pytest.mark.long
@pytest.mark.parametrize("degrees", [-30, 5, 40])
def test_what_moves_like_the_lip_has_the_modes_of_the_lip(degrees):
    """Of its three equilibria the one that leans farthest with the belt, not a saddle."""
    numbers = {"belt": wiperjax.SteadyBelt(0.3), "attack_angle": math.radians(degrees)}
    lip = wiperjax.modes(wiperjax.Wiper(**numbers))
    for other in (SameWiper(**numbers), on_rung(wiperjax.Wiper(**numbers), "bar")):
        found = wiperjax.modes(other)
        for name in ("real_part", "frequency", "normal_force"):
            np.testing.assert_allclose(found[name], lip[name], rtol=1e-9)


@pytest.mark.long
def test_where_slip_pulls_itself_off_there_is_no_steady_sliding():
    """phi = -20 degrees balances, the glass pressing; but D = W_nn + mu W_nt < 0 there."""
    m, h, mu, phi = 2.4e-3, 0.1, 0.5, -0.3492285791581798
    assert 1 + h / m * math.tan(phi) ** 2 + mu * h / m * math.tan(phi) < 0
    wiper = wiperjax.Wiper(hinge_mass=h, attack_angle=-0.6, friction=Coulomb(mu))
    with pytest.raises(ValueError, match="^Wiper must have a steady sliding near"):
        wiperjax.modes(wiper, near=(6e-3 * math.sin(phi), 0.0))
    assert float(wiperjax.modes(wiper).position[0]) > 0  # another one is sound


@pytest.mark.long
def test_a_stiffer_glass_makes_the_rigid_lip_at_first_order():
    belt, angle = wiperjax.SteadyBelt(0.3), math.radians(5)
    exact = float(wiperjax.steady_slip(wiperjax.Wiper(belt=belt, attack_angle=angle)).growth_rate)
    errors = []
    for stiffness in (1e6, 1e7, 1e8):
        soft = SoftLip(contact_stiffness=stiffness, belt=belt, attack_angle=angle)
        errors.append(abs(float(wiperjax.modes(soft).real_part[0]) - exact))
    orders = np.diff(np.log10(errors))
    np.testing.assert_allclose(orders, -1.0, atol=0.05)


@pytest.mark.long
@pytest.mark.parametrize("weights", [{}, {"hinge_mass": 3e-3, "gravity": -50.0}])
@pytest.mark.parametrize("degrees, speed", [(-30, 0.3), (-37, 0.9), (10, 0.3), (20, -0.5)])
def test_steady_sliding_of_a_soft_lip_is_found_where_moments_balance(degrees, speed, weights):
    """At -30 degrees it was sought from the rigid lip's, 18 degrees away, and none was found."""
    numbers = {"belt": wiperjax.SteadyBelt(speed), "attack_angle": math.radians(degrees)}
    lip = SoftLip(**numbers, **weights)
    k, kc, length, along = 2000.0, 2000.0, 6e-3, math.copysign(1.0, speed)
    tip, hinge = (m * lip.gravity for m in (lip.tip_mass, lip.hinge_mass))
    mu = float(lip.law.coefficient(abs(speed)))

    def depth(phi):  # the support gives way by as much as the tip sinks in
        lift = length * (np.cos(phi) - math.cos(lip.attack_angle))
        return (lip.normal_load + tip + hinge + k * lift) / (k + kc)

    def moment(phi):
        down = kc * depth(phi) - tip
        arms = down * np.sin(phi) + along * mu * kc * depth(phi) * np.cos(phi)
        return length * arms - np.asarray(lip.moment(phi - lip.attack_angle))

    grid = np.linspace(-1.55, 1.55, 1001) * along
    signs = np.sign(moment(grid))
    last = np.flatnonzero(np.diff(signs))[-1]  # the farthest along the belt's motion
    phi = brentq(moment, grid[last], grid[last + 1], xtol=1e-14)
    found = wiperjax.modes(lip)
    exact = length * math.sin(phi), -depth(phi)
    np.testing.assert_allclose(found.position, exact, rtol=1e-9)
    np.testing.assert_allclose(lip.sliding_near(), exact, rtol=1e-9)


@pytest.mark.long
def test_a_soft_glass_flutters_within_the_closed_border():
    """4 k t (mu k_c - k t) > (k + k_c - k t^2 - k_theta)^2, with the geometric part of the load and
    the moment in k_theta."""
    rng, unlike = np.random.default_rng(3), set()
    for _ in range(24):
        k, mu, k1 = rng.uniform(500, 5000), rng.uniform(0.1, 1.5), rng.uniform(0.01, 0.3)
        alpha, kc = rng.uniform(0.05, 0.5), 10 ** rng.uniform(3, 4.5)
        lip = SoftLip(
            contact_stiffness=kc,
            belt=wiperjax.SteadyBelt(0.5),
            attack_angle=alpha,
            friction=Coulomb(mu),
            support_stiffness=k,
            support_damping=0.0,
            neck_stiffness=k1,
            shoulder_stiffness=k1,
        )
        try:
            found = wiperjax.modes(lip)
        except ValueError:
            continue  # it collapses
        length, force = 6e-3, float(found.normal_force)
        sin = float(found.position[0]) / length
        cos, tan = math.sqrt(1 - sin**2), sin / math.sqrt(1 - sin**2)
        moment = k1 * (math.asin(sin) - alpha)
        theta = (k1 + moment * tan) / (length * cos) ** 2 - force / (length * cos**3)
        spread = (k + kc - k * tan**2 - theta) ** 2 - 4 * k * tan * (mu * kc - k * tan)
        if abs(spread) > 1e-6 * (k + kc) ** 2:
            flutters = float(found.real_part[0]) > 0 and float(found.frequency[0]) > 0
            assert flutters == (spread < 0)
            unlike.add(flutters)
    assert unlike == {True, False}


def four_by_hand(system: HeadAndTip):
    """M, C, K of head and tip around steady sliding, and the normal force there."""
    s, c = np.sin(system.attack_angle), np.cos(system.attack_angle)
    along, across = np.array([s, -c]), np.array([c, s])

    def between(axial, bending):
        lip = axial * np.outer(along, along) + bending * np.outer(across, across)
        return np.block([[lip, -lip], [-lip, lip]])

    mu, k, h = system.friction.static, system.contact_stiffness, system.hardening
    stiff = between(system.axial_stiffness, system.bending_stiffness)
    stiff += np.diag([system.support_along, system.support_across, 0, 0])
    damping = between(system.lip_damping, system.lip_damping)
    damping += system.support_damping * np.diag([1.0, 1.0, 0, 0])
    soft = np.linalg.solve(stiff, [0, 0, mu, 1])[3], np.linalg.solve(stiff, [0, 0, 0, 1])[3]
    pressed = brentq(lambda p: k * p * (1 + h * p) - system.load, 0, 1)

    def missed(p):  # the penetration under the force that it makes
        force = k * p * (1 + h * p)
        return pressed - (soft[0] * force - soft[1] * system.load) - p

    depth = brentq(missed, 0, 1)
    slope = k * (1 + 2 * h * depth)
    stiff[2, 3] += mu * slope
    stiff[3, 3] += slope
    mass = np.diag([system.head_mass] * 2 + [system.tip_mass] * 2)
    return mass, damping, stiff, k * depth * (1 + h * depth)


@pytest.mark.slow
@pytest.mark.parametrize("angle, load", [(-20, 15.0), (-5, 30.0), (10, 15.0)])
def test_head_and_tip_have_the_modes_of_matrices_written_out(angle, load):
    system = HeadAndTip(attack_angle=np.radians(angle), load=load)
    found = wiperjax.modes(system)
    mass, damping, stiff, force = four_by_hand(system)
    inverse = np.linalg.inv(mass)
    whole = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ stiff, -inverse @ damping]])
    values = np.linalg.eigvals(whole)
    exact = np.sort_complex(values[values.imag > 0])
    own = np.sort_complex(found.real_part.values + 2j * np.pi * found.frequency.values)
    np.testing.assert_allclose(own, exact, rtol=1e-9)
    assert float(found.normal_force) == pytest.approx(force, rel=1e-10)
    assert (own.real.max() > 0) == (angle < 0)  # chatter of a blade that leans against the belt


@pytest.mark.slow
def test_head_and_tip_are_found_pressed_though_a_search_lifts_them_off():
    """It stalled where the glass pushes no more: 4 of 400 wide draws were refused, this is one."""
    system = HeadAndTip(
        head_mass=0.5521123,
        tip_mass=0.010237891,
        support_along=2822.8517,
        support_across=1174.8598,
        axial_stiffness=974.10057,
        bending_stiffness=126.15394,
        attack_angle=0.077904649,
        load=9.0022062,
        contact_stiffness=3157.9989,
        hardening=11.491265,
        friction=Coulomb(0.83532572),
        belt=wiperjax.SteadyBelt(-0.3),
    )
    force = four_by_hand(replace(system, attack_angle=-system.attack_angle))[-1]  # in a mirror
    assert float(wiperjax.modes(system).normal_force) == pytest.approx(force, rel=1e-9)


@pytest.mark.slow
def test_a_clamped_head_leaves_the_lip_on_soft_glass():
    """K = [[k t^2 + k_b/cos^2, -k t + mu k_c], [-k t, k + k_c]], with errors of first order."""
    angle, mu, kc, k, kb = 0.9, 0.9, 4000.0, 2000.0, 1100.0
    t = np.tan(angle)
    stiff = [[k * t**2 + kb / np.cos(angle) ** 2, -k * t + mu * kc], [-k * t, k + kc]]
    exact = np.linalg.eigvals(-np.array(stiff) / 0.01)
    assert np.all(exact.imag != 0)  # it flutters
    errors = []
    for stiffer in (1e3, 1e4):
        system = HeadAndTip(
            head_mass=1 / stiffer**1.5,
            support_along=1e3 * stiffer,
            support_across=k,
            axial_stiffness=1e3 * stiffer,
            bending_stiffness=kb,
            attack_angle=angle,
            contact_stiffness=kc,
            hardening=0.0,
            support_damping=0.0,
            lip_damping=0.0,
            friction=Coulomb(mu),
        )
        found = wiperjax.modes(system)
        squares = (found.real_part.values + 2j * np.pi * found.frequency.values) ** 2
        near = np.min(np.abs(squares[:, None] - exact), axis=0)
        errors.append(np.max(near / np.abs(exact)))
    assert errors[1] < 1e-2 and errors[0] / errors[1] == pytest.approx(10, rel=0.3)


@pytest.mark.long
def test_a_blade_that_chatters_grows_at_its_eigenvalue_and_then_sticks_and_slips():
    system = HeadAndTip(attack_angle=np.radians(-20))
    mode = wiperjax.modes(system)
    place = mode.position.values
    start = tuple(place + [1e-10, 0.0, 0.0, 0.0]), (0.0,) * 4
    run = wiperjax.simulate(system, 0.8, initial_state=start, sample_interval=1e-4, rtol=1e-10)
    size = np.linalg.norm(run.position.values - place, axis=1)
    time = run.time.values
    peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
    late = peaks[(time[peaks] > 0.15) & (size[peaks] < 1e-5)]
    assert np.polyfit(time[late], np.log(size[late]), 1)[0] == pytest.approx(
        float(mode.real_part[0]), rel=5e-3
    )
    late = run.sel(time=slice(0.7, None))
    assert {"stick", "slip_neg"} <= {
        run.regime.attrs["flag_meanings"].split()[int(k)] for k in np.unique(late.regime)
    }


def test_a_chain_without_damping_rings_at_its_own_frequencies():
    found = wiperjax.modes(Chain3(friction=Coulomb(0.5)))
    exact = 2 * np.sin(np.pi * np.arange(1, 4) / 8) / (2 * np.pi)  # walls at both ends
    np.testing.assert_allclose(np.sort(found.frequency), exact, rtol=1e-12)
    np.testing.assert_allclose(found.real_part, 0.0, atol=1e-12)


def test_modes_that_decay_alike_keep_their_order():
    """Rounding chose which came first: over a parameter they changed colours in the picture."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        stiff = turned @ np.diag([1.0, 2.0, 5.0]) @ turned.T
        matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiff, -0.02 * np.eye(3)]])
        found = modes_of(matrix, np.eye(3))
        squares = np.array([1.0, 2.0, 5.0]) - 1e-4
        np.testing.assert_allclose(found.values[:3], -0.01 + 1j * np.sqrt(squares), rtol=1e-12)
        assert np.isnan(found.values[3:]).all()
        apart = matrix + np.diag([0.0] * 3 + [1e-6] * 3)  # what differs is as it was
        assert np.real(modes_of(apart, np.eye(3)).values[0]) == pytest.approx(-0.01 + 5e-7)


def test_what_does_not_move_has_no_phase():
    """y 0 +180 deg, x 1 -0 deg."""
    basis = np.array([[-1.0], [-0.0]])
    shapes = modes_of(np.array([[0.0, 1.0], [-1.0, 0.1]]), basis).shapes[:, 0]
    np.testing.assert_array_equal(np.angle(shapes), [0.0, 0.0])
    assert not np.signbit(np.angle(shapes)).any() and np.abs(shapes[1]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damping", "mu_static", "said"),
    [
        (0.0, 0.5, "neutral: 2 modes neither grow nor decay"),
        (0.01, 0.5, "stable: 0 modes grow"),
        (0.01, 1.0, "unstable: 1 mode grows"),
    ],
)
def test_what_neither_grows_nor_decays_is_not_called_stable(
    damping, mu_static, said, tmp_path, capsys
):
    scene = tmp_path / "scene.toml"
    numbers = f'[parameters]\nfriction = "coulomb"\nmu_static = {mu_static}\ndamping = {damping}\n'
    scene.write_text(
        f'system = "flutter"\n{numbers}mu_minimum = {mu_static}\n[run]\nduration = 1\n'
    )
    assert main(["modes", str(scene)]) == 0
    assert f"steady sliding is {said}" in capsys.readouterr().out


SWEEP = {
    "system": "oscillator",
    "parameters": {"damping": 0.1},
    "start": {"position": [-1.5]},
    "axes": {"belt_speed": {"start": 0.4, "stop": 2.2, "num": 13}},
    "run": {"transient": 400.0, "window": 50.0, "samples": 256},
    "classes": {"squeal_band": [0.05, 1.0], "chatter_band": [0.0, 0.01]},
}


@pytest.mark.long
def test_modes_over_a_sweep_know_the_range_of_unstable_speeds_and_what_it_misses(tmp_path, capsys):
    found = wiperjax.modes_over(SWEEP)
    assert kind_of(found) == "modes_over"
    speed = found.belt_speed.values
    slope = np.exp(-speed / 0.5)  # mu' = -(0.5/0.5) exp(-v/0.5), load 1
    np.testing.assert_allclose(found.growth_rate, (slope - 0.1) / 2, atol=1e-12)
    simulated = wiperjax.sweep(SWEEP, tmp_path / "map.h5", progress=False)
    judged = beside(found, simulated)
    # far out it starts on the cycle: noisy though stable, between the Hopf point and the fold
    border = brentq(lambda v: np.exp(-v / 0.5) - 0.1, 0.5, 2)
    missed = (judged.verdict == VERDICTS["missed"]).values
    assert missed.any() and np.all(speed[missed] > border)
    assert sum(shares(judged).values()) == pytest.approx(1.0)
    assert shares(judged)["over_predicted"] == 0.0
    simulated.close()
    assert main(["modes", str(tmp_path / "map.h5"), "-o", str(tmp_path / "modes.h5")]) == 0
    said = capsys.readouterr().out
    assert "stable yet noisy: the test misses" in said and (tmp_path / "modes.png").exists()
    assert main(["info", str(tmp_path / "modes.h5")]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[2].startswith("steady sliding in 13 of 13 cells") and set(told[2:8]) <= {
        *said.splitlines()
    }
    (tmp_path / "other.png").write_bytes(b"precious")
    assert main(["modes", str(tmp_path / "map.h5"), "-o", str(tmp_path / "other.h5")]) == 1
    assert "other.png: exists already" in capsys.readouterr().err
    assert not (tmp_path / "other.h5").exists()


@pytest.mark.long
def test_a_map_is_judged_in_the_order_of_its_sweep_only():
    """Cells are paired by their place: of a map that was turned round or cut, none would fit."""
    short = SWEEP | {"run": {"transient": 1.0, "window": 1.0, "samples": 256}}
    simulated, found = wiperjax.sweep(short, progress=False), wiperjax.modes_over(short)
    assert (beside(found, simulated).verdict >= 0).all()
    for changed in (
        simulated.isel(belt_speed=slice(None, None, -1)),
        simulated[{"belt_speed": [1, 2]}],
        simulated.assign_coords(belt_speed=list(map(str, simulated.belt_speed.values))),
    ):
        with pytest.raises(ValueError, match=r"^the map's values of belt_speed must be those of"):
            beside(found, changed)


@pytest.mark.slow
def test_cells_that_were_taken_out_of_a_map_are_not_judged():
    place = {"belt_speed": [0.3, 0.6]}
    rates = {"growth_rate": ("belt_speed", [1.0, -1.0]), "exists": ("belt_speed", [1, 1])}
    found = xr.Dataset(rates, place)
    simulated = xr.Dataset({"label": ("belt_speed", [1, 0])}, place)
    for kept in (0, 1):
        part = simulated.where(simulated.belt_speed == place["belt_speed"][kept])
        verdict = beside(found, part).verdict
        expected = beside(found, simulated).verdict
        assert verdict[kept] == expected[kept] and verdict[1 - kept] == VERDICTS["not_told"]
    with pytest.raises(ValueError, match="label must be whole codes, but had 0.5"):
        beside(found, 0.5 * simulated)


def test_what_has_no_modes_is_one_line():
    with pytest.raises(ValueError, match=r"^system must have friction, but Ball has none$"):
        wiperjax.modes(own_systems.Ball())
    with pytest.raises(ValueError, match=r"^spec must be a sweep, or a mapping"):
        wiperjax.modes_over(3)
    named = {name: SWEEP[name] for name in ("run", "classes")}
    named |= {"system": "odd_systems:Spelled", "axes": {"frequency": {"values": [1.0, 2.0]}}}
    with pytest.raises(ValueError, match=r"^axes must .* modes .*, but had 'frequency': rename"):
        wiperjax.modes_over(named)


@pytest.mark.slow
def test_there_is_no_steady_sliding_behind_a_stop():
    """Friction in slip, 0.5 + 0.5/e on a stiffness of 1, draws the block to x = 0.684; a wall in
    front of it holds it in bounces."""
    free = wiperjax.SteadyBelt(0.5)
    found = wiperjax.modes(own_systems.Walled(wall=0.7, belt=free))
    assert float(found.position[0]) == pytest.approx(0.5 + 0.5 / math.e)
    with pytest.raises(ValueError, match="must have a steady sliding near"):
        wiperjax.modes(own_systems.Walled(wall=0.6, belt=free))
    over = wiperjax.modes_over(
        {
            "system": "own_systems:Walled",
            "parameters": {"friction": "stribeck"},
            "belt": {"kind": "steady", "speed": 0.5},
            "axes": {"wall": {"values": [0.6, 0.7]}},
            "run": {"transient": 60.0, "window": 60.0},
            "classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]},
        }
    )
    assert over.exists.values.tolist() == [0, 1]


@pytest.mark.slow
def test_a_blade_on_a_belt_at_rest_has_none():
    with pytest.raises(ValueError, match=r"^Wiper must have a steady sliding near"):
        wiperjax.modes(wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.0), attack_angle=0.1))


@pytest.mark.slow
def test_a_place_may_be_an_array_of_any_kind():
    blade = wiperjax.Wiper(belt=wiperjax.SteadyBelt(0.3), attack_angle=0.1)
    near = wiperjax.modes(blade).position.values
    for place in (near, jnp.asarray(near), list(near)):
        assert float(wiperjax.modes(blade, near=place).position[0]) == pytest.approx(near[0])
    with pytest.raises(ValueError, match="^near must be 2 finite numbers, one a coordinate, but"):
        wiperjax.modes(blade, near=jnp.zeros((2, 2)))
