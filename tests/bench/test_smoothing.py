"""The time-stepping and smoothed rivals of `wiperjax bench`: they converge, and on what."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wiperjax.contact.impact import poisson_impact
from wiperjax_bench.measurements import failures
from wiperjax_bench.rivals import moreau_jean, regularised, siconos_moreau
from wiperjax_bench.rivals.moreau_jean import newton_impact
from wiperjax_bench.rivals.penalty import damping_ratio, rebound
from wiperjax_bench.scenes import exact, families, hard

(MOREAU,) = moreau_jean.RIVALS
(TANH,) = (r for r in regularised.RIVALS if r.name == "tanh, penalty, Tsit5")


def slope(settings, errors):
    return np.polyfit(np.log(settings), np.log(errors), 1)[0]


# ---- laws ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9, 1.5])
def test_rebound_of_a_spring_and_dashpot_that_only_push(ratio):
    """Against the integrated bounce: g'' = -g - 2 ratio g' from g = 0, g' = -1, until it is 0."""
    force = lambda t, s: -s[0] - 2 * ratio * s[1]
    force.terminal, force.direction = True, -1
    run = solve_ivp(lambda t, s: (s[1], force(t, s)), (0, 50), (0.0, -1.0), events=force,
                    rtol=1e-11, atol=1e-13)  # fmt: skip
    assert float(rebound(jnp.asarray(ratio))) == pytest.approx(run.y_events[0][0][1], rel=1e-7)


def test_damping_ratio_is_the_inverse_of_rebound():
    e = jnp.array([0.01, 0.1, 0.3, 0.7, 1.0])
    np.testing.assert_allclose(rebound(damping_ratio(e)), e, rtol=1e-9)


def both_laws(w_tn, mu, e, v_t, v_n):
    w = (1.0, w_tn, 1.5)
    poisson = poisson_impact(*w, mu, e, jnp.asarray(v_t), jnp.asarray(v_n))
    p = newton_impact(((w[0], w_tn), (w_tn, w[2])), mu, v_t, v_n * (1 + e))
    assert bool(p.solved)
    return (poisson.tangential, poisson.normal), (p.tangential, p.normal)


@pytest.mark.parametrize("v_t", [-0.4, 0.0, 0.1, 3.0])
@pytest.mark.parametrize("w_tn", [0.0, 0.3, -0.3])
def test_newton_and_poisson_agree_uncoupled_or_where_slip_keeps_its_sign(w_tn, v_t):
    poisson, newton = both_laws(w_tn, 0.3, 0.5, v_t, -1.0)
    if w_tn == 0 or abs(v_t) == 3.0:
        np.testing.assert_allclose(poisson, newton, rtol=1e-12, atol=1e-15)
    elif v_t == 0.1 and w_tn < 0:
        # slip is stopped on the way: the two laws part
        assert abs(poisson[1] - newton[1]) > 1e-3


# ---- convergence ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_moreau_jean_converges_on_the_exact_block_at_order_one():
    scene = families.block(1)
    x, _, _, _ = exact.block(families.BLOCK_START, 0.5, 0.5, scene.sample_times)
    settings = (1e-3, 2.5e-4, 6.25e-5, 1.5625e-5)
    found = [MOREAU.prepare(scene, s)() for s in settings]
    errors = np.array([np.abs(a.position[0, :, 0] - x) for a in found])
    assert not any(a.stopped.any() for a in found)
    # the error of an event depends on where in its step it falls: 1 only on average
    assert 0.75 < slope(settings, errors.max(axis=1)) < 1.25
    # up to the first event the theta rule is of order 2
    assert slope(settings[:3], errors[:3, 0]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_smoothed_friction_converges_on_the_exact_block():
    scene = families.block(1)
    x, _, _, _ = exact.block(families.BLOCK_START, 0.5, 0.5, scene.sample_times)
    widths = (0.1, 0.03, 0.01)
    errors = [np.abs(TANH.prepare(scene, w)().position[0, :, 0] - x).max() for w in widths]
    assert errors[-1] < 0.02
    assert slope(widths, errors) > 0.7


@pytest.mark.long
def test_penalty_converges_on_rigid_bounces_where_friction_is_constant():
    """With a Stribeck curve it does not: there mu changes during the impact, here it is held."""
    stribeck = hard.zeno().head(1)
    plain = dataclasses.replace(stribeck.wiper, mu_static=0.4, mu_minimum=0.4, viscous_slope=0.0)

    def error(scene, sink):
        answer = TANH.build(scene, 1e-3, sink, 1e-3 * sink)()
        return failures.error(answer, failures.reference(scene))[0]

    constant = dataclasses.replace(stribeck, wiper=plain)
    coarse, fine = (error(constant, sink) for sink in (1e-5, 1e-7))
    assert fine < 5e-3 and fine < 0.25 * coarse
    assert error(stribeck, 1e-7) > 0.03


@pytest.mark.skipif(siconos_moreau.RIVALS[0].available() is not None, reason="no siconos here")
def test_siconos_and_ours_agree():
    scene = hard.zeno().head(1)
    a, b = (r.prepare(scene, 1e-4)() for r in (MOREAU, siconos_moreau.RIVALS[0]))
    assert np.abs(a.position - b.position).max() < 1e-3 * families.LENGTH
