"""Checks of the reference itself (tests/reference): known answers, identities of mechanics, and
its own convergence.

Nothing here touches the engine. Section numbers are those of docs/model.md; V9 and V10 are cases of
`problems`, V11 is steady slip.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from reference.blade import (
    FLIGHT,
    REFERENCE,
    SLIP_NEG,
    SLIP_POS,
    STICK,
    Mechanics,
    Steady,
    Trapezoid,
    Wiping,
    _earliest_root,
    energy,
    poisson_impact,
    simulate,
)
from reference.impact_ode import integrate_impact
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

CHATTER = dict(attack_angle=math.radians(-35.0), support_stiffness=8000.0)
# Hinge mass, gravity and hinge damping at work: every term of A, h and W counts.
HEAVY = dict(hinge_mass=4e-3, hinge_damping=2e-5, gravity=9.81)


def cycles(run, kind, after):
    """Times of the events `kind` after `after`, for whole-cycle statistics."""
    times = run.times(kind)
    return times[times > after]


# ---- figures of section 10, SCENES
@pytest.mark.slow
@pytest.mark.parametrize("degrees, hertz", [(0.0, 674.4), (5.0, 780.8), (10.0, 906.5)])
def test_squeal_frequency(degrees, hertz):
    run = simulate(dict(attack_angle=math.radians(degrees)), Steady(0.3), 0.04)
    times = cycles(run, "capture", 0.02)
    assert run.result == "finished" and run.regime_time[FLIGHT] == 0.0
    assert 1.0 / np.mean(np.diff(times)) == pytest.approx(hertz, abs=0.05)
    assert np.ptp(np.diff(times)) < 1e-9  # settled on the limit cycle


def test_chattering_without_flight():
    run = simulate(
        dict(attack_angle=math.radians(-30.0)),
        Steady(0.3),
        0.2,
        sample_times=np.linspace(0.1, 0.2, 2001),
    )
    times = cycles(run, "release", 0.09)
    assert 1.0 / np.mean(np.diff(times)) == pytest.approx(39.7, abs=0.1)
    stuck = sum(b - a for a, b in zip(cycles(run, "capture", times[0]), times[1:], strict=False))
    assert stuck / (times[-1] - times[0]) == pytest.approx(0.785, abs=0.01)
    assert run.samples["lambda_n"].max() == pytest.approx(16.7, abs=0.05)


@pytest.mark.slow
def test_chattering_with_flight():
    run = simulate(CHATTER, Steady(0.3), 0.18, sample_times=np.linspace(0.08, 0.18, 20001))
    times = cycles(run, "release", 0.06)
    assert 1.0 / np.mean(np.diff(times)) == pytest.approx(28.2, abs=0.1)
    s = run.samples
    cycle = (s["t"] > times[-2]) & (s["t"] <= times[-1])
    shares = [np.mean(s["regime"][cycle] == r) for r in (STICK, SLIP_NEG, FLIGHT)]
    assert shares == pytest.approx([0.469, 0.469, 0.062], abs=0.003)
    assert s["y"].max() == pytest.approx(0.48e-3, abs=0.005e-3)
    assert max(e.impulse for e in run.events) == pytest.approx(4.5e-3, abs=0.05e-3)
    assert s["lambda_n"].max() == pytest.approx(23.7, abs=0.05)


def test_collapse_is_a_result():
    run = simulate(dict(attack_angle=math.radians(60.0)), Steady(0.3), 0.1)
    assert run.result == "collapsed" and run.events[-1].kind == "collapse"
    assert abs(math.asin(run.position[0] / 6e-3)) == pytest.approx(math.radians(89.0), abs=1e-12)


# ---- V11 equilibrium, growth
@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_growth_rate_beside_the_hopf_point(factor):
    """xi = x - x* obeys m xi'' + c_eff xi' + k_eff xi = 0 (V11); the sign of c_eff changes at
    0.4511 m/s.
    """
    p, speed = REFERENCE, 0.4511 * factor
    length, m = p["lip_length"], p["tip_mass"]
    excess = (p["mu_static"] - p["mu_minimum"]) * math.exp(-speed / p["stribeck_speed"])
    mu = p["mu_minimum"] + excess + p["viscous_slope"] * speed
    slope = -excess / p["stribeck_speed"] + p["viscous_slope"]

    def moment(theta):
        return 0.05 * theta + 1.95 * (max(theta - 0.6, 0.0) + min(theta + 0.6, 0.0))

    def force(phi):
        return 15.0 + 2000.0 * length * (math.cos(phi) - 1.0)

    phi = brentq(
        lambda a: moment(a) - length * force(a) * (math.sin(a) + mu * math.cos(a)),
        0.6,
        1.0,
        xtol=1e-16,
    )
    tau, lever, load = math.tan(phi), length * math.cos(phi), force(phi)
    c_eff = 1.0 * tau * (tau + mu) + slope * load
    k_eff = 2.0 / lever**2 + 2000.0 * tau * (tau + mu) + load * (mu * tau - 1.0) / lever
    assert (c_eff < 0.0) == (factor < 1.0)
    x0, times = length * math.sin(phi), np.linspace(0.0, 0.02, 401)
    still = simulate({}, Steady(speed), 0.02, initial_state=(x0, 0.0, 0.0, 0.0))
    assert abs(still.position[0] - x0) < 1e-12 and still.events == []
    run = simulate(
        {},
        Steady(speed),
        0.02,
        initial_state=(x0 + 1e-6 * length, 0.0, 0.0, 0.0),
        sample_times=times,
    )
    xi, rate = run.samples["x"] - x0, run.samples["vx"]
    gamma = 0.5 * c_eff / m
    omega2 = k_eff / m - gamma**2
    amplitude = (
        np.log(xi**2 + (rate + gamma * xi) ** 2 / omega2) / 2.0
    )  # exactly -gamma t + const if linear
    assert np.polyfit(times, amplitude, 1)[0] == pytest.approx(-gamma, rel=1e-3)


# ---- balance of momentum
def lagrangian_forces(p, x, y, vx, vy):
    """dT/dq' and (dL/dq - dR/dq'), by complex differentiation of T, U and the Rayleigh function R
    in terms of phi, eta.

    Written from sections 2 and 3 in the angle, not from the equations of motion that the reference
    integrates.
    """

    def functions(x, y, vx, vy):
        phi = np.arcsin(x / p["lip_length"])
        eta, eta_rate = y + p["lip_length"] * np.cos(phi), vy - np.tan(phi) * vx
        phi_rate = vx / (p["lip_length"] * np.cos(phi))
        theta = phi - p["attack_angle"]
        size = theta * np.sign(theta.real)
        beyond = np.where(size.real > p["shoulder_angle"], size - p["shoulder_angle"], 0.0)
        kinetic = 0.5 * p["tip_mass"] * (vx**2 + vy**2) + 0.5 * p["hinge_mass"] * eta_rate**2
        rest = eta - p["lip_length"] * np.cos(p["attack_angle"])
        potential = (
            0.5 * p["neck_stiffness"] * theta**2
            + 0.5 * (p["shoulder_stiffness"] - p["neck_stiffness"]) * beyond**2
            + p["normal_load"] * eta
            + 0.5 * p["support_stiffness"] * rest**2
            + p["gravity"] * (p["tip_mass"] * y + p["hinge_mass"] * eta)
        )
        rayleigh = 0.5 * p["support_damping"] * eta_rate**2 + 0.5 * p["hinge_damping"] * phi_rate**2
        return kinetic, potential, rayleigh

    def partial(index):
        arguments = [np.asarray(a, complex) for a in (x, y, vx, vy)]
        arguments[index] = arguments[index] + 1e-30j
        return [f.imag / 1e-30 for f in functions(*arguments)]

    momenta, forces = [], []
    for i in (0, 1):
        kinetic_q, potential_q, _ = partial(i)
        kinetic_v, _, rayleigh_v = partial(i + 2)
        momenta.append(kinetic_v)
        forces.append(kinetic_q - potential_q - rayleigh_v)
    return np.array(momenta), np.array(forces)


SMOOTH_CASES = {
    "squeal": ({}, Steady(0.3), 0.006, None),
    "flight": ({**CHATTER, **HEAVY}, Steady(0.3), 0.004, (-1e-3, 2e-4, 0.8, 0.1)),
    "heavy": ({**HEAVY, "attack_angle": 0.3}, Steady(-0.3), 0.006, None),
    "wiping": ({**HEAVY, "stribeck_shape": 2.0}, Wiping(0.5, 120.0, 0.4), 0.006, None),
    "trapezoid": (
        dict(mu_static=0.7, mu_minimum=0.5),
        Trapezoid(0.5, 100.0, 0.3, 2e-3),
        0.012,
        None,
    ),
}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)


@pytest.mark.parametrize("case", SMOOTH_CASES)
def test_momentum_energy_and_friction_over_smooth_phases(case):
    """Between events: change of momentum = integral of all forces, change of E = work of friction
    and dampers (section 3), and lambda obeys section 4. Gauss quadrature over samples, so an error
    anywhere in A, h, f or lambda shows.
    """
    parameters, belt, duration, start = SMOOTH_CASES[case]
    p = {**REFERENCE, **parameters}
    first = simulate(parameters, belt, duration, start)
    marks = [0.0] + [e.time for e in first.events] + [duration]
    panels = []
    for a, b in pairwise(marks):
        if b - a > 1e-5:
            a, b = (
                a + 1e-3 * (b - a),
                b - 1e-3 * (b - a),
            )  # off the events: velocity jumps stay outside
            edges = np.linspace(
                a, b, 1 + math.ceil((b - a) / 2e-5)
            )  # short: lambda is steep where D is small
            panels += list(pairwise(edges))
    times = np.array(
        [t for a, b in panels for t in (a, *(0.5 * (a + b) + 0.5 * (b - a) * NODES), b)]
    )
    run = simulate(parameters, belt, duration, start, sample_times=times)
    s = {name: column.reshape(len(panels), -1) for name, column in run.samples.items()}
    q, v = (s["x"], s["y"]), (s["vx"], s["vy"])
    weights = np.array([0.5 * (b - a) for a, b in panels])[:, None] * WEIGHTS

    momenta, forces = lagrangian_forces(p, *q, *v)
    forces = forces + np.array([s["lambda_t"], s["lambda_n"]])
    for momentum, force in zip(momenta, forces, strict=True):
        total = np.sum(weights * force[:, 1:-1], axis=1)
        scale = np.sum(weights * 20.0, axis=1)  # 20 N/m acting over the panel
        assert np.max(np.abs(momentum[:, -1] - momentum[:, 0] - total) / scale) < 1e-9

    phi = np.arcsin(s["x"] / p["lip_length"])
    power = (
        s["lambda_t"] * s["vx"]
        - p["support_damping"] * (s["vy"] - np.tan(phi) * s["vx"]) ** 2
        - p["hinge_damping"] * (s["vx"] / (p["lip_length"] * np.cos(phi))) ** 2
    )
    e = np.array(
        [
            [
                energy(parameters, (s["x"][i, j], s["y"][i, j]), (s["vx"][i, j], s["vy"][i, j]))
                for j in (0, -1)
            ]
            for i in range(len(panels))
        ]
    )
    defect = e[:, 1] - e[:, 0] - np.sum(weights * power[:, 1:-1], axis=1)
    assert (
        np.max(np.abs(defect)) < 1e-10 * 1e-2
    )  # 1e-2 J/m: size of the spring and kinetic energies

    def belt_speed(t):
        return belt.piece(t)[0](t)

    slip = s["vx"] - np.vectorize(belt_speed)(s["t"])
    mu = (
        p["mu_minimum"]
        + (p["mu_static"] - p["mu_minimum"])
        * np.exp(-((np.abs(slip) / p["stribeck_speed"]) ** p["stribeck_shape"]))
        + p["viscous_slope"] * np.abs(slip)
    )
    for regime, sign in ((SLIP_POS, 1.0), (SLIP_NEG, -1.0)):
        inside = s["regime"] == regime
        assert np.all(sign * slip[inside] > 0.0) and np.all(s["y"][inside] == 0.0)
        assert s["lambda_t"][inside] == pytest.approx(
            -sign * (mu * s["lambda_n"])[inside], rel=1e-9
        )
    stuck = s["regime"] == STICK
    assert np.all(np.abs(slip[stuck]) < 1e-15)
    assert np.all(np.abs(s["lambda_t"][stuck]) <= p["mu_static"] * s["lambda_n"][stuck])
    assert np.all(s["lambda_n"][s["regime"] != FLIGHT] > 0.0) and np.all(
        s["y"][s["regime"] == FLIGHT] > 0.0
    )
    seen = {
        "squeal": (STICK, SLIP_NEG),
        "flight": (FLIGHT,),
        "heavy": (STICK, SLIP_POS),
        "wiping": (STICK, SLIP_NEG),
        "trapezoid": (STICK, SLIP_NEG),
    }[case]
    assert set(seen) <= set(np.unique(s["regime"]).astype(int))


def test_mirror_symmetry():
    """(alpha, V, x) -> -(alpha, V, x): same event times, slip signs exchanged."""
    parameters = {**CHATTER, **HEAVY}
    start = (-1e-3, 2e-4, 0.8, 0.1)
    a = simulate(parameters, Trapezoid(0.5, 50.0, 0.3, 4e-3), 0.025, start)
    mirrored = {**parameters, "attack_angle": -parameters["attack_angle"]}
    b = simulate(
        mirrored,
        Trapezoid(-0.5, 50.0, 0.3, 4e-3),
        0.025,
        (-start[0], start[1], -start[2], start[3]),
    )
    swap = {STICK: STICK, SLIP_POS: SLIP_NEG, SLIP_NEG: SLIP_POS, FLIGHT: FLIGHT}
    assert len(a.events) > 8 and {"impact", "belt"} <= {e.kind for e in a.events}
    assert [(e.kind, e.before, e.after) for e in a.events] == [
        (e.kind, swap[e.before], swap[e.after]) for e in b.events
    ]
    assert (
        np.max(np.abs([e.time - f.time for e, f in zip(a.events, b.events, strict=True)])) < 1e-13
    )
    assert a.position == pytest.approx(b.position * [-1, 1], abs=1e-14)
    assert a.velocity == pytest.approx(b.velocity * [-1, 1], abs=1e-11)


@pytest.mark.parametrize(
    "parameters, belt, duration",
    [
        ({}, Steady(0.3), 0.01),
        (CHATTER, Steady(0.3), 0.05),
        ({**HEAVY, "attack_angle": 0.3}, Wiping(0.5, 60.0, 0.4), 0.02),
    ],
)
def test_finer_steps_give_the_same_run(parameters, belt, duration):
    coarse = simulate(parameters, belt, duration)
    fine = simulate(parameters, belt, duration, rtol=1e-13, max_step=1.3e-5)
    assert [e[1:4] for e in coarse.events] == [e[1:4] for e in fine.events]
    assert (
        np.max(np.abs([e.time - f.time for e, f in zip(coarse.events, fine.events, strict=True)]))
        < 1e-11
    )
    assert coarse.position == pytest.approx(fine.position, abs=1e-11)
    assert coarse.velocity == pytest.approx(fine.velocity, abs=1e-8)


def test_event_states_lie_on_their_guards():
    """The state just before each event satisfies the condition of section 5 that defines it, to
    round-off.
    """
    first = simulate(CHATTER, Steady(0.3), 0.06)
    run = simulate(CHATTER, Steady(0.3), 0.06, sample_times=[e.time for e in first.events])
    phi_kink = {side: math.radians(-35.0) + 0.6 * side for side in (1, -1)}
    for i, event in enumerate(run.events):
        s = {name: column[i] for name, column in run.samples.items()}
        assert s["t"] == event.time
        if event.kind == "release":
            assert abs(s["lambda_t"]) == pytest.approx(s["lambda_n"], rel=1e-12)  # mu_s = 1
        elif event.kind == "capture":
            assert abs(s["vx"] - 0.3) < 1e-12
        elif event.kind == "lift_off":
            assert abs(s["lambda_n"]) < 1e-11
        elif event.kind == "impact":
            assert abs(s["y"]) < 1e-17 and s["vy"] < 0.0
        elif event.kind == "kink":
            assert min(abs(s["x"] - 6e-3 * math.sin(a)) for a in phi_kink.values()) < 1e-16
    assert {"release", "capture", "lift_off", "impact", "kink", "zeno"} <= set(run.counts())


@pytest.mark.parametrize("depth, found", [(1e-6, True), (-1e-6, False)])
def test_guard_that_dips_between_two_samples(depth, found):
    """A double root unseen by the signs at the samples is found by the derivative test; a near
    miss is not a root.
    """
    points = np.linspace(0.0, 1.0, 9).tolist()
    for centre in (0.03, 0.18, 0.44, 0.97):

        def dip(z, centre=centre):
            return (z - centre) ** 2 - depth

        root = _earliest_root(dip, points, [dip(z) for z in points], False)
        assert root == (pytest.approx(centre - 1e-3, abs=1e-12) if found else None)


# ---- impact, Zeno
def test_closed_form_impact_against_stepped_impulse():
    """Section 6 for random symmetric positive definite W, including v_t = 0, reversal of slip and
    Painleve cases.
    """
    rng = np.random.default_rng(3)
    reversed_slip = 0
    for n in range(150):
        root = rng.normal(size=(2, 2))
        w = root @ root.T + 0.05 * np.eye(2)
        mu, e = rng.uniform(0.0, 3.0), rng.uniform(0.0, 1.0)
        v_t = 0.0 if n % 5 == 0 else rng.normal()
        v_n = 0.0 if n % 11 == 0 else -abs(rng.normal())
        closed = np.array(poisson_impact(w[0, 0], w[0, 1], w[1, 1], mu, e, v_t, v_n))
        stepped = np.array(integrate_impact(w, mu, e, v_t, v_n))
        assert np.max(np.abs(closed - stepped) / (1.0 + np.abs(closed))) < 1e-10
        lost = -0.5 * (closed[2] * (v_t + closed[0]) + closed[3] * (v_n + closed[1]))
        assert lost >= -1e-13 and closed[1] >= 0.0 and abs(closed[2]) <= mu * closed[3] + 1e-15
        reversed_slip += v_t * closed[0] < 0.0
    assert reversed_slip > 5


def test_impact_without_hinge_mass():
    """p_n = (1 + e) m |y'-|, p_t = clip(-m v_t, -mu p_n, mu p_n) (section 6, M_h = 0)."""
    m, e, mu, v_n = 2.4e-3, 0.3, 0.8, -0.2
    for v_t in (-1.0, -0.1, 0.0, 0.05, 0.7):
        p_n = (1.0 + e) * m * 0.2
        p_t = min(max(-m * v_t, -mu * p_n), mu * p_n)
        assert poisson_impact(1.0 / m, 0.0, 1.0 / m, mu, e, v_t, v_n) == pytest.approx(
            (v_t + p_t / m, 0.06, p_t, p_n), rel=1e-13, abs=1e-16
        )


@pytest.mark.parametrize("solver", ["closed", "stepped"])
@pytest.mark.parametrize(
    "e, after, p_t", [(0.0, (0.0, 0.0), -0.4375), (0.5, (0.0, 0.199852016258), -0.502403846154)]
)
def test_impact_without_collision(solver, e, after, p_t):
    """V10: uniform rod at 60 degrees, mu = 5/3, sliding at 1 with no normal velocity."""
    g_tt, g_tn, g_nn = 3.25, 1.299038105677, 1.75
    if solver == "closed":
        result = poisson_impact(g_tt, g_tn, g_nn, 5.0 / 3.0, e, 1.0, 0.0)
    else:
        result = integrate_impact([[g_tt, g_tn], [g_tn, g_nn]], 5.0 / 3.0, e, 1.0, 0.0)
    assert result[:3] == pytest.approx((*after, p_t), abs=1e-12)


def test_bouncing_to_rest():
    """V9: no springs, constant load, upright blade: a ball under N0/m. At rest after
    sqrt(2h/g)(1+e)/(1-e); the belt drags it with the friction of the mean load, and the whole
    normal impulse is N0 t.
    """
    free = dict(
        support_stiffness=0.0,
        support_damping=0.0,
        neck_stiffness=0.0,
        shoulder_stiffness=0.0,
        mu_static=0.4,
        mu_minimum=0.4,
        viscous_slope=0.0,
        restitution=0.5,
    )
    height, pull = 1e-4, 15.0 / 2.4e-3
    start = (0.0, height, 0.0, 0.0)
    at_rest = math.sqrt(2.0 * height / pull) * 3.0
    run = simulate({**free, "normal_load": 15.0}, Steady(0.0), 2.0 * at_rest, start)
    zeno = [e for e in run.events if e.kind == "zeno"]
    assert len(zeno) == 1 and zeno[0].after == STICK and run.regime == STICK
    assert zeno[0].time == pytest.approx(at_rest, abs=1e-14)
    assert sum(e.impulse for e in run.events) == pytest.approx(15.0 * at_rest, rel=1e-12)
    impacts = run.times("impact")
    assert impacts[:3] == pytest.approx(
        math.sqrt(2.0 * height / pull) * np.array([1.0, 2.0, 2.5]), rel=1e-11
    )


def test_zeno_limit_does_not_depend_on_the_resolution():
    """The limit of section 6 replaces the bounces to first order in its duration: 1e-8 s against
    1e-10 s.
    """
    for parameters in (CHATTER, {**CHATTER, "hinge_mass": 2e-4}):
        a, b = (
            simulate(parameters, Steady(0.3), 0.008, (-1e-3, 1e-4, 0.4, 0.0), zeno_time=z)
            for z in (1e-8, 1e-10)
        )
        ends = [[e for e in run.events if e.kind == "zeno"][0] for run in (a, b)]
        assert len(b.times("impact")) > len(a.times("impact"))
        assert (
            ends[0].time == pytest.approx(ends[1].time, abs=1e-12)
            and ends[0].after == ends[1].after
        )
        assert a.position == pytest.approx(b.position, abs=1e-12)
        assert a.velocity == pytest.approx(b.velocity, abs=1e-8)


# ---- Painleve
@pytest.mark.parametrize("phi, threshold", [(0.3, 2.05003601932968), (1.0, 1.90314990246570)])
def test_painleve_threshold(phi, threshold):
    """V10: D changes sign at mu = |tan phi| + (m/M_h)|cot phi|, in one sliding direction only."""
    for sign in (1.0, -1.0):
        signs = []
        for mu in (threshold - 1e-12, threshold + 1e-12):
            mech = Mechanics(
                dict(
                    hinge_mass=1.3,
                    tip_mass=0.7,
                    lip_length=1.0,
                    mu_static=mu,
                    mu_minimum=mu,
                    viscous_slope=0.0,
                )
            )
            signs.append(mech.slip_terms(math.sin(phi), sign, 0.0, sign, 0)[1] > 0.0)
        assert signs == ([True, False] if sign > 0.0 else [True, True])


def test_jam():
    """Slip reaches D = 0 under load at a finite slip speed, and is resolved by the impact without
    collision.

    The approach is checked against an integration in t by another method, which cannot pass D = 0,
    and lambda_n against its (t* - t)^(-1/2) law (section 7).
    """
    parameters = dict(attack_angle=math.radians(-20.0), hinge_mass=0.02)
    belt = Steady(0.2)
    jam = next(e for e in simulate(parameters, belt, 1e-3).events if e.kind == "jam")
    gaps = np.array([1e-9, 4e-9, 1e-6])
    run = simulate(parameters, belt, jam.time, sample_times=sorted(jam.time - gaps))
    s = {name: column[::-1] for name, column in run.samples.items()}
    assert np.all(s["regime"] == SLIP_NEG) and np.all(s["vx"] < 0.2)
    assert s["lambda_n"][0] / s["lambda_n"][1] == pytest.approx(2.0, rel=1e-2)
    mech = Mechanics(parameters)

    def in_time(t, u):
        _, d, numerator, _ = mech.slip_terms(u[0], u[1] - 0.2, 0.2, -1.0, mech.zone(u[0]))
        return u[1], numerator / d

    x0 = 6e-3 * math.sin(math.radians(-20.0))
    other = solve_ivp(
        in_time, (0.0, jam.time - 1e-6), (x0, 0.0), method="Radau", rtol=1e-10, atol=1e-14
    )
    assert other.y[:, -1] == pytest.approx([s["x"][2], s["vx"][2]], rel=1e-7)
    w_tt, w_tn, w_nn = mech.inverse_mass(s["x"][0])
    critical = w_nn / abs(w_tn)  # D = 0 there; a hair above it the impulse starts
    assert mech.mu(0.2 - s["vx"][0]) == pytest.approx(critical, rel=1e-2)
    _, normal, _, impulse = integrate_impact(
        [[w_tt, w_tn], [w_tn, w_nn]], critical * (1.0 + 1e-9), 0.3, s["vx"][0] - 0.2, 0.0
    )
    full = simulate(parameters, belt, jam.time + 1e-12)
    assert jam.after == FLIGHT and jam.impulse == pytest.approx(impulse, rel=2e-2) and impulse > 0.0
    assert full.velocity == pytest.approx([0.2, normal], rel=2e-2) and full.velocity[1] > 1e-3
    dead = simulate({**parameters, "restitution": 0.0}, belt, 1e-3)
    first = next(e for e in dead.events if e.kind == "jam")
    assert first.after == STICK and first.time == pytest.approx(jam.time, abs=1e-15)


def test_jam_is_resolved_although_round_off_leaves_d_positive():
    """At D = 0 the computed D may be +1 ulp; without the `jam` argument compression would end with
    no impulse.
    """
    w_tt, w_tn, w_nn, e = 3.25, 1.299038105677, 1.75, 0.5
    mu = math.nextafter(w_nn / w_tn, 0.0) * (1.0 - 1e-15)
    assert w_nn - mu * w_tn > 0.0
    v_t, v_n, _, p_n = poisson_impact(w_tt, w_tn, w_nn, mu, e, 1.0, 0.0, jam=True)
    p_c = 1.0 / (mu * w_tt - w_tn)  # slip stops; v_n is still zero there
    assert (v_t, p_n) == (0.0, pytest.approx(1.5 * p_c, rel=1e-12))
    assert v_n == pytest.approx(0.5 * p_c * (w_nn - w_tn**2 / w_tt), rel=1e-12)


# ---- belts
def test_belt_functions():
    belt = Trapezoid(0.8, 0.7, math.pi / 2, 0.05)
    times = belt.known_times(0.0, 1.6)
    zeros = [(0.5 - 0.25) / 0.7, (1.0 - 0.25) / 0.7]
    assert times == pytest.approx([z + d for z in zeros for d in (-0.025, 0.0, 0.025)], abs=1e-14)
    values = [
        belt.piece(t)[0](t)
        for t in (0.1, zeros[0] - 0.0125, zeros[0] + 0.0125, 0.6, zeros[1] + 0.0125, 1.2)
    ]
    assert values == pytest.approx([0.8, 0.4, -0.4, -0.8, 0.4, 0.8], abs=1e-14)
    assert (
        belt.piece(zeros[0] + 1e-3)[1](0.0) == pytest.approx(-32.0)
        and belt.piece(0.6)[1](0.6) == 0.0
    )
    wiping = Wiping(0.5, 3.0, 0.4)
    assert all(abs(wiping.piece(t)[0](t)) < 1e-14 for t in wiping.known_times(0.0, 1.0))
    assert len(wiping.known_times(0.0, 1.0)) == 6
    speed, rate = wiping.piece(0.1)
    assert rate(0.1) == pytest.approx((speed(0.1 + 1e-6) - speed(0.1 - 1e-6)) / 2e-6, rel=1e-7)


def test_stick_is_tested_again_at_a_kink_of_the_belt():
    """A blade at rest sticks on a slow plateau; the ramp asks for m V' beyond the cone and it
    slips at the kink itself, backwards relative to the belt's acceleration.
    """
    parameters = dict(
        neck_stiffness=0.0,
        shoulder_stiffness=0.0,
        support_stiffness=0.0,
        support_damping=0.0,
        mu_static=0.2,
        mu_minimum=0.2,
        viscous_slope=0.0,
    )
    belt = Trapezoid(0.01, 5.0, math.pi / 2, 1e-5)  # V' = 2000 m/s^2 = 1.6 mu N0/m
    kink = belt.known_times(0.0, 0.06)[0]
    run = simulate(parameters, belt, 0.06, initial_state=(-1e-5, 0.0, 0.01, 0.0))
    event = run.events[0]
    assert event.kind == "belt" and event.time == kink
    assert (event.before, event.after) == (STICK, SLIP_POS)
