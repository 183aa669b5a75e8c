"""Reverse mode: the same derivatives as forward mode, to rounding."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax import SteadyBelt, Wiper


def measure(p, **options):
    """A number made of everything that has a derivative; half of the blades start in the air."""
    blade = Wiper(belt=SteadyBelt(p[2]), attack_angle=p[0], normal_load=p[1], restitution=p[3])
    s = wiperjax.solve(
        blade,
        0.005,
        initial_state=((6e-3 * jnp.sin(p[0]), p[4]), (0.0, 0.0)),
        rtol=1e-8,
        max_events=2,
        **options,
    )
    t = s.statistics
    moments = 30 * t.stick_time + 7 * t.output_square_integral + 1e-3 * t.normal_force_integral
    return 300 * s.final_position[0] + 3 * s.final_velocity[0] + moments + t.impulse_max, s.result


@pytest.mark.slow
def test_forward_and_reverse_agree():
    rng = np.random.default_rng(0)
    n = 12
    angle, load, speed = rng.uniform(-0.7, 0.7, n), rng.uniform(5, 30, n), rng.uniform(0.05, 1, n)
    air = np.where(np.arange(n) % 2, 1e-4, 0.0)
    blades = np.stack([angle, load, speed, rng.uniform(0.1, 0.8, n), air], axis=1)
    forward = jax.jit(jax.jacfwd(measure, has_aux=True))
    reverse = jax.jit(jax.grad(lambda p: measure(p, reverse=True, max_steps=1500), has_aux=True))
    for p in blades:
        (a, result), (b, _) = forward(p), reverse(p)
        assert int(result) == wiperjax.Result.FINISHED
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(a).max())


def test_samples_are_refused():
    with pytest.raises(ValueError, match="sample_times must be left out with reverse=True"):
        wiperjax.solve(Wiper(), 0.01, reverse=True, sample_times=jnp.array([0.0]))
