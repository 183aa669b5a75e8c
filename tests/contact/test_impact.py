"""The impact law for any contact inertia: properties, and a fine integration along the impulse.

Energy: for ONE contact, Poisson's law with Coulomb friction never gains kinetic energy in the
frame of the partner, whatever the coupling and wherever slip stops or reverses (no counterexample
in three million draws; property below). Against the ground the belt may do work, V p_t. Nothing is
promised for a mu that changes during the impact, nor for several contacts at once: the engine has
neither.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reference.impact_ode import integrate_impact

from wiperjax.contact.impact import phased_impact, poisson_impact

impact = jax.jit(poisson_impact)


@st.composite
def impacts(draw, coupled=True):
    """(w_tt, w_tn, w_nn, mu, e, v_t, v_n): every W positive definite, scales over decades."""
    w_tt = 10 ** draw(st.floats(-2, 3))
    w_nn = 10 ** draw(st.floats(-2, 3))
    cosine = draw(st.floats(-0.98, 0.98)) if coupled else 0.0
    w_tn = cosine * math.sqrt(w_tt * w_nn)
    mu = draw(st.one_of(st.just(0.0), st.floats(1e-3, 5.0)))
    e = draw(st.floats(0, 1))
    v_t = draw(st.one_of(st.just(0.0), st.floats(0.01, 10), st.floats(-10, -0.01)))
    return w_tt, w_tn, w_nn, mu, e, v_t, -draw(st.floats(0.01, 10))


def energy(w_tt, w_tn, w_nn, v_t, v_n):
    """Kinetic energy of the contact's motion: v^T W^-1 v / 2."""
    det = w_tt * w_nn - w_tn * w_tn
    return 0.5 * (w_nn * v_t * v_t - 2 * w_tn * v_t * v_n + w_tt * v_n * v_n) / det


def collide(case):
    return tuple(float(x) for x in impact(*case))


@settings(max_examples=300, deadline=None)
@given(impacts())
def test_cone_no_penetration_and_balance(case):
    w_tt, w_tn, w_nn, mu, _, v_t, v_n = case
    p_t, p_n, after_t, after_n = collide(case)
    assert p_n > 0 and after_n >= 0
    assert abs(p_t) <= mu * p_n * (1 + 1e-12)
    scale = abs(v_t) + abs(v_n) + w_tt * abs(p_t) + abs(w_tn) * (abs(p_t) + p_n) + w_nn * p_n
    assert after_t == pytest.approx(v_t + w_tt * p_t + w_tn * p_n, abs=1e-11 * scale)
    assert after_n == pytest.approx(v_n + w_tn * p_t + w_nn * p_n, abs=1e-11 * scale)


@settings(max_examples=200, deadline=None)
@given(impacts(coupled=False))
def test_uncoupled_is_newtons_law_and_never_gains(case):
    w_tt, w_tn, w_nn, mu, e, v_t, v_n = case
    p_t, p_n, after_t, after_n = collide(case)
    assert p_n == pytest.approx(-(1 + e) * v_n / w_nn, rel=1e-12)
    assert after_n == pytest.approx(-e * v_n, rel=1e-9, abs=1e-12)
    clipped = min(max(-v_t / w_tt, -mu * p_n), mu * p_n)
    assert p_t == pytest.approx(clipped, rel=1e-12)
    before = energy(w_tt, w_tn, w_nn, v_t, v_n)
    assert energy(w_tt, w_tn, w_nn, after_t, after_n) <= before * (1 + 1e-12)


@settings(max_examples=500, deadline=None)
@given(impacts())
def test_energy_is_never_gained(case):
    before = energy(*case[:3], *case[5:])
    _, _, after_t, after_n = collide(case)
    assert energy(*case[:3], after_t, after_n) <= before * (1 + 1e-10)
    if case[4] == 0:
        assert after_n == 0


def test_energy_is_never_gained_in_many_draws():
    """Vectorised; half of them elastic; impacts without collision included."""
    rng, n = np.random.default_rng(0), 200_000
    w_tn, mu = rng.uniform(-0.999, 0.999, n), 10 ** rng.uniform(-2, 2, n)
    e = np.where(np.arange(n) % 2, rng.uniform(0, 1, n), 1.0)
    v_t = rng.normal(size=n) * 10 ** rng.uniform(-2, 2, n)
    v_n = np.where((rng.random(n) < 0.2) & (1 < np.sign(v_t) * mu * w_tn), 0.0, -rng.random(n))
    one = np.ones(n)
    after = jax.jit(jax.vmap(poisson_impact))(one, w_tn, one, mu, e, v_t, v_n)
    gain = energy(one, w_tn, one, after.slip_speed, after.normal_speed)
    gain = gain / energy(one, w_tn, one, v_t, v_n) - 1
    assert np.max(gain) <= 1e-10 and np.sum(v_n == 0) > 1000


def test_impacts_of_two_phases_push_and_gain_nothing_whatever_the_coupling():
    """Of stick and both slips one fits each phase, where D <= 0, too; there slip jams."""
    rng, n = np.random.default_rng(1), 200_000
    w_tn, mu = rng.uniform(-0.999, 0.999, n), 10 ** rng.uniform(-2, 2, n)
    v_t, e = rng.normal(size=n) * 10 ** rng.uniform(-2, 2, n), rng.uniform(0, 1, n)
    drawn_in = 1 < np.sign(v_t) * mu * w_tn
    v_n = np.where((rng.random(n) < 0.2) & drawn_in, 0.0, -rng.random(n))
    one = np.ones(n)
    blow = jax.jit(jax.vmap(phased_impact))
    p_t, p_n, after_t, after_n = map(np.asarray, blow(one, w_tn, one, mu, e, v_t, v_n))
    assert np.all(p_n > 0) and np.all(after_n >= 0)
    assert np.all(np.abs(p_t) <= mu * p_n * (1 + 1e-12))
    before = energy(one, w_tn, one, v_t, v_n)
    assert np.max(energy(one, w_tn, one, after_t, after_n) / before) <= 1 + 1e-10
    end = blow(one, w_tn, one, mu, 0 * e, v_t, v_n)  # of compression
    slides = np.asarray(end.slip_speed) != 0
    assert 1000 < np.sum(slides) < n - 1000 and np.sum(drawn_in & (v_n == 0)) > 1000
    against = -np.sign(end.slip_speed) * mu * end.normal
    np.testing.assert_allclose(end.tangential[slides], against[slides], rtol=1e-12)
    assert not np.any(slides & drawn_in)


def test_pfeiffer_and_glockers_law_is_one_branch_at_the_border_of_two():
    """Vectorised, the uses of one comparison were computed apart, and rounded apart: half of the
    numbers were those of stick, half of slip."""
    w_tn, w_nn, mu, v_n = 0.7179148509222308, 0.17024528756945445, 0.2339526103657302, -1.36
    case = (3.0686336425139213, w_tn, w_nn, mu, 1.0, 1e-14, v_n)
    for e in (0.0, 1.0):
        given = np.broadcast_to(np.array([*case[:4], e, *case[5:]])[:, None], (7, 8))
        p_t, p_n, after_t, after_n = jax.jit(jax.vmap(phased_impact))(*given)
        np.testing.assert_allclose(after_t, case[5] + case[0] * p_t + w_tn * p_n, atol=1e-9)
        np.testing.assert_allclose(after_n, v_n + w_tn * p_t + w_nn * p_n, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(impacts())
def test_agrees_with_integration_along_the_impulse(case):
    w_tt, w_tn, w_nn, mu, e, v_t, v_n = case
    p_t, p_n, after_t, after_n = collide(case)
    expected = integrate_impact([[w_tt, w_tn], [w_tn, w_nn]], mu, e, v_t, v_n)
    scale = abs(v_t) + abs(v_n) + (w_tt + w_nn) * p_n * (1 + mu)
    np.testing.assert_allclose([after_t, after_n], expected[:2], rtol=0, atol=1e-7 * scale)
    np.testing.assert_allclose([p_t, p_n], expected[2:], rtol=0, atol=1e-7 * p_n * (1 + mu))


@settings(max_examples=60, deadline=None)
@example(cosine=1.0, excess=2.0, e=7e-308, v_t=1.0)  # a restitution in the last of all digits
@given(st.floats(0.05, 1), st.floats(1.05, 3), st.floats(0, 1), st.floats(0.05, 5))
def test_impact_without_collision_agrees_too(cosine, excess, e, v_t):
    """D < 0 at rest along the normal: mu beyond W_nn / W_tn."""
    w_tn = 0.95 * cosine
    mu = excess / w_tn
    p_t, p_n, after_t, after_n = collide((1.0, w_tn, 1.0, mu, e, v_t, 0.0))
    expected = integrate_impact([[1.0, w_tn], [w_tn, 1.0]], mu, e, v_t, 0.0)
    np.testing.assert_allclose(
        [after_t, after_n, p_t, p_n], expected, rtol=0, atol=1e-7 * (1 + mu) * p_n
    )
    assert after_t == 0 and p_n > 0


@pytest.mark.parametrize("law", [poisson_impact, phased_impact])
def test_jam_ends_slip_where_d_is_zero_up_to_rounding(law):
    for rounding in (-1e-15, 0.0, 1e-15):
        case = (1.0, 0.5, 0.5 * 2.0 + rounding, 2.0, 0.5, 1.0, 0.0)
        p_t, p_n, after_t, after_n = (float(x) for x in law(*case, True))
        assert after_t == 0 and p_n > 0 and after_n > 0
        stop = 1.0 / (2.0 * 1.0 - 0.5)
        assert p_n == pytest.approx(1.5 * stop, rel=1e-12)
        assert after_n == pytest.approx(0.5 * stop * (1.0 - 0.25), rel=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_frictionless_contact(e):
    p_t, p_n, after_t, after_n = (float(x) for x in impact(0.0, 0.0, 2.0, 0.7, e, 0.0, -3.0))
    assert (p_t, after_t) == (0, 0)
    assert p_n == pytest.approx((1 + e) * 1.5) and after_n == pytest.approx(3 * e)


@pytest.mark.parametrize("w_tn", [-0.3, 0.0, 0.4])
def test_a_trace_of_slip_is_held_to_first_order(w_tn):
    """Of a contact that lands without slip, and sticks: the derivative by slip was left out."""

    def law(v_t):
        return jnp.stack(poisson_impact(1.3, w_tn, 2.0, 0.5, 0.6, v_t, -1.0))

    h = 1e-3
    difference = (law(h) - law(-h)) / (2 * h)
    np.testing.assert_allclose(jax.jacfwd(law)(0.0), difference, rtol=0, atol=1e-12)
    assert abs(difference[0]) > 0.5
