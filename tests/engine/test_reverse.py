"""Reverse mode: the same derivatives as forward mode, in little memory."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Ball

import wiperjax
from wiperjax import Wiper, WipingBelt

STEPS = 4000
TYPICAL = np.array([0.3, 10.0, 0.3, 0.5, 1e-4])  # sizes of the parameters


def measure(p, phase, **options):
    """A number made of everything that has a derivative."""
    belt = WipingBelt(p[2], 10.0, phase)
    blade = Wiper(belt=belt, attack_angle=p[0], normal_load=p[1], restitution=p[3])
    s = wiperjax.solve(
        blade,
        0.005,
        initial_state=((6e-3 * jnp.sin(p[0]), p[4]), (0.0, 0.0)),
        rtol=1e-11,
        max_events=2,
        **options,
    )
    t = s.statistics
    moments = 30 * t.stick_time + 7 * t.output_square_integral + 1e-3 * t.normal_force_integral
    total = 300 * s.final_position[0] + 3 * s.final_velocity[0] + moments + t.impulse_max
    return total, (s.result, s.steps, t.stick_time > 0, t.flight_time > 0)


@pytest.mark.long
def test_forward_and_reverse_agree():
    """Half of the blades start in the air, and half of them see the belt turn round."""
    rng = np.random.default_rng(0)
    n = 24
    angle, load, speed = rng.uniform(-0.7, 0.7, n), rng.uniform(5, 30, n), rng.uniform(0.05, 1, n)
    air = np.where(np.arange(n) % 2, 1e-4, 0.0)
    blades = np.stack([angle, load, speed, rng.uniform(0.1, 0.8, n), air], axis=1)
    turning = -2 * np.pi * 10.0 * rng.uniform(0.001, 0.004, n)
    phases = np.where(np.arange(n) % 4 < 2, turning, rng.uniform(0.5, 2.0, n))
    forward = jax.jit(jax.jacfwd(measure, has_aux=True))

    def backward(p, phase):
        return measure(p, phase, reverse=True, max_steps=STEPS)

    reverse = jax.jit(jax.grad(backward, has_aux=True))
    steps, sticks, flies = [], 0, 0
    for p, phase in zip(blades, phases, strict=True):
        (a, (result, *seen)), (b, (backwards, *_)) = forward(p, phase), reverse(p, phase)
        assert int(result) == int(backwards) == wiperjax.Result.FINISHED
        a, b = (np.asarray(g) * TYPICAL for g in (a, b))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(a).max())
        steps.append(int(seen[0]))
        sticks, flies = sticks + bool(seen[1]), flies + bool(seen[2])
    assert sticks >= 8 and flies >= 8 and max(steps) > 300


@pytest.mark.long
def test_several_outputs_of_a_motion():
    """jax.jacrev of a motion was NaN: a batch of cotangents computed turns again in another
    program than that of the first ones."""

    def ends(p, **options):
        blade = Wiper(belt=wiperjax.SteadyBelt(p[0]), attack_angle=p[1])
        s = wiperjax.solve(blade, 0.005, rtol=1e-9, max_events=0, **options)
        return jnp.stack([s.final_position[0], s.statistics.stick_time])

    p = np.array([0.3, 0.0873])
    forwards = np.asarray(jax.jit(jax.jacfwd(ends))(p))
    backwards = jax.jit(jax.jacrev(lambda p: ends(p, reverse=True, max_steps=1000)))(p)
    assert np.abs(forwards).max() > 1e-3
    np.testing.assert_allclose(backwards, forwards, rtol=0, atol=1e-12)


@pytest.mark.long
def test_memory_grows_like_the_square_root_of_the_steps():
    """And the gradient of a bouncing ball's speed is exact, whatever the room."""

    def speed(gravity, most_steps):
        ball = Ball(gravity, restitution=0.9)
        start = ((1.0,), (0.0,))
        options = {"initial_state": start, "max_events": 0, "max_steps": most_steps}
        return wiperjax.solve(ball, 1.0, reverse=True, **options).final_velocity[0]

    sizes = []
    for most_steps in (10_000, 1_000_000):
        lowered = jax.jit(jax.grad(speed), static_argnums=1).lower(9.81, most_steps)
        # only a turn and the barriers in it (`fusion_barrier`) stay functions: were all that a turn
        # calls one, it would compile in twice the time and run ten times as long
        marked = re.findall(r"call @(\w+?)[_0-9]*\(.*inlineable", lowered.as_text())
        assert set(marked) == {"turn", "_same"}
        compiled = lowered.compile()
        sizes.append(compiled.memory_analysis().temp_size_in_bytes)
        # one impact at t1 = sqrt(2 h / g): v = e g t1 - g (1 - t1)
        exact = 0.5 * 1.9 * np.sqrt(2.0 / 9.81) - 1.0
        assert float(compiled(9.81)) == pytest.approx(exact, rel=1e-9)
    # outside of a trace a number is one of Python, whose derivative was lost
    assert float(jax.grad(speed)(9.81, 10_000)) == pytest.approx(exact, rel=1e-9)
    assert sizes[1] < 10 * sizes[0] < 1e7


@pytest.mark.slow
def test_backwards_without_reverse_is_refused_by_its_name():
    """JAX names a loop that no caller has seen."""

    def speed(gravity):
        start = ((1.0,), (0.0,))
        return wiperjax.solve(Ball(gravity), 1.0, initial_state=start).final_velocity[0]

    with pytest.raises(ValueError, match=r"^reverse must be True where .* but was False"):
        jax.eval_shape(jax.grad(speed), 9.81)


def test_steps_that_are_traced_are_refused_by_their_name():
    """JAX named a tracer, and no argument."""

    def speed(gravity, most_steps):
        start = ((1.0,), (0.0,))
        options = {"initial_state": start, "reverse": True, "max_steps": most_steps}
        return wiperjax.solve(Ball(gravity), 1.0, **options).final_velocity[0]

    with pytest.raises(ValueError, match=r"^max_steps must be known with reverse=True"):
        jax.eval_shape(jax.grad(speed), 9.81, 1000)
