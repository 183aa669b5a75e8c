"""The unrolled Runge-Kutta step is diffrax's own, to rounding, and compiles to little."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax.engine.trial.step_control import step_factor
from wiperjax.numerics.runge_kutta import check_solver, node_states, rk_step

SOLVERS = [diffrax.Tsit5(), diffrax.Dopri5(), diffrax.Dopri8(), diffrax.Bosh3()]


def field(t, y, args):
    (x,), (v,) = y
    return (v,), (args * jnp.sin(3 * x) - 0.3 * v + jnp.cos(t),)


@pytest.mark.slow
@pytest.mark.parametrize("unroll", [True, False])
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: type(s).__name__)
def test_step_and_dense_output_equal_diffrax(solver, unroll):
    term = diffrax.ODETerm(field)
    y0 = ((jnp.asarray(0.3),), (jnp.asarray(-0.7),))
    t0, h, args = jnp.asarray(0.2), jnp.asarray(0.17), jnp.asarray(-2.0)

    def arrive(t, y):
        return field(t, y, args), "seen"

    start = (t0, y0, h, field(t0, y0, args))
    ours = rk_step(solver, term, *start, args, arrive, unroll=unroll)
    state = solver.init(term, t0, t0 + h, y0, args)
    y1, error, dense, _, _ = solver.step(term, t0, t0 + h, y0, args, state, made_jump=False)
    path = solver.interpolation_cls(t0=t0, t1=t0 + h, **dense)
    for a, b in zip(jax.tree.leaves(ours.y1), jax.tree.leaves(y1), strict=True):
        np.testing.assert_allclose(a, b, rtol=4e-16, atol=4e-16)
    for a, b in zip(jax.tree.leaves(ours.error), jax.tree.leaves(error), strict=True):
        # a difference of states near 1: its rounding, on any machine, is some units of theirs
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=2e-15)
    nodes = node_states(solver, y0, ours)
    for theta, node in zip((0.25, 0.5, 0.75), nodes, strict=True):
        expected = path.evaluate(t0 + theta * h)
        for a, b in zip(jax.tree.leaves(node), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(a, b, rtol=2e-13, atol=2e-13)
    assert ours.end == "seen"
    end = field(t0 + h, ours.y1, args)
    for a, b in zip(jax.tree.leaves(ours.rate1), jax.tree.leaves(end), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=0)


def test_steps_shorter_than_a_states_last_digit_add_up():
    """4000 steps of 1e-8 at 1, in single precision: each of them alone is rounded away."""
    still = lambda t, y: ((jnp.ones((), jnp.float32), ()), ())
    term, h = diffrax.ODETerm(lambda t, y, args: still(t, y)[0]), jnp.float32(1e-8)
    start = (jnp.ones((), jnp.float32), ())

    def step(y, rest):
        found = rk_step(diffrax.Tsit5(), term, 0.0, y, h, still(0.0, y)[0], None, still, rest)
        return found.y1, found.rest

    none = jax.tree.map(jnp.zeros_like, start)
    carried = jax.jit(lambda: jax.lax.fori_loop(0, 4000, lambda _, s: step(*s), (start, none)))
    assert carried()[0][0] - 1 == pytest.approx(4e-5, abs=1.2e-7)
    assert step(start, None)[0][0] == 1


@pytest.mark.parametrize(
    "solver", [diffrax.Kvaerno5(), diffrax.Euler(), diffrax.LeapfrogMidpoint()]
)
def test_unsuitable_solvers_are_refused(solver):
    with pytest.raises(ValueError, match="solver must be an explicit diffrax Runge-Kutta"):
        check_solver(solver)


@pytest.mark.long
def test_the_compiled_program_does_not_repeat_itself():
    # 20 480 lines; without the fusion barriers (see `fusion_barrier`) 66 000
    def run(angle):
        return wiperjax.solve(wiperjax.Wiper(attack_angle=angle), 0.01, rtol=1e-8, max_events=8)

    program = jax.jit(run).lower(0.1).compile().as_text()
    assert program.count("\n") < 21_000


def test_the_controller_expects_a_steady_change_to_go_on():
    """Errors that stay while steps shrink by 0.7 each: the next one shrinks by 0.7 as well."""
    even, no_event = 0.9**5, 1.0  # the plain rule would keep the step at this error

    def factor(error, before, growth, ok=True):
        error, before, growth = (jnp.asarray(x, jnp.float64) for x in (error, before, growth))
        return float(step_factor(error, before, growth, jnp.asarray(ok), 5))

    assert factor(even, even, 0.7) == pytest.approx(0.7, rel=1e-5)
    # after an event nothing is expected, and a step that grew is no reason to grow
    pi = 0.9 * even ** (-0.3 / 5)
    assert factor(even, even, np.inf) == pytest.approx(pi, rel=1e-5)
    assert factor(even, even, 3.0) == pytest.approx(pi, rel=1e-5)
    # a refused step is judged by its error alone
    assert factor(32.0, even, 0.3, ok=False) == pytest.approx(0.45, rel=1e-5)
    assert factor(1e9, no_event, 1.0, ok=False) == pytest.approx(0.2, rel=1e-5)
    assert factor(1e-8, no_event, np.inf) == pytest.approx(5.0, rel=1e-5)
