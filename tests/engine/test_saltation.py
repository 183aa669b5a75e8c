"""Derivatives through single events: flow, saltation, flow in closed form.

The flows beside the event are matrix exponentials: the motion there is linear.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matching import doubles
from saltation import saltation
from scipy.linalg import expm
from systems import Ball, Block, Puck, events

import wiperjax
from wiperjax import Event


class Ramp(Puck):
    """A puck whose load falls as it slides on: -g + rise x. By itself it does not, so that all that
    has a puck here is one program."""

    rise: float = 0.0

    def free_acceleration(self, t, q, v):
        return self.push + 0 * t, -self.gravity + self.rise * q[0]


@partial(jax.jit, static_argnums=3)
@partial(jax.jacfwd, argnums=2, has_aux=True)
def _solved(system, duration, state, n):
    start = (tuple(state[:n]), tuple(state[n:]))
    s = wiperjax.solve(system, duration, initial_state=start, rtol=1e-12, max_events=40)
    return jnp.concatenate([s.final_position, s.final_velocity]), s


def solved(system, duration, state):
    """Return (dx/dx0 at the end, `Solution`): one program for a class of systems."""
    state = np.array(state, float)
    return _solved(*doubles((system, duration)), state, len(state) // 2)


def matrix(linear, duration):
    return expm(np.asarray(linear, float) * duration)


@pytest.mark.long
def test_capture():
    k, fd, v, start, end = 1.0, 0.3, 0.2, (0.2, -0.4), 3.0
    derivative, s = solved(Block(0.9, fd, 1.0, k, belt=v), end, start)
    ((t, kind),) = events(s)
    assert kind == Event.CAPTURE
    slip, stick = [[0, 1], [-k, 0]], [[0, 1], [0, 0]]
    w = math.sqrt(k)
    x = fd / k + (start[0] - fd / k) * math.cos(w * t) + start[1] / w * math.sin(w * t)
    before, after = (v, fd - k * x), (v, 0.0)
    jump = saltation(np.eye(2), (0, -1), before, after)
    closed = matrix(stick, end - t) @ jump @ matrix(slip, t)
    np.testing.assert_allclose(derivative, closed, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_slip_onset():
    """By the place: what begins in stick has no speed of its own."""
    k, fs, fd, v, x0, end = 4.0, 0.9, 0.3, 0.5, 0.1, 0.7
    derivative, s = solved(Block(fs, fd, 1.0, k, belt=v), end, [x0, v])
    ((t, kind),) = events(s)
    assert kind == Event.RELEASE and t == pytest.approx((fs / k - x0) / v, rel=1e-12)
    jump = saltation(np.eye(2), (-k, 0), (v, 0), (v, fd - fs))
    closed = matrix([[0, 1], [-k, 0]], end - t) @ jump
    np.testing.assert_allclose(derivative[:, 0], closed[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(derivative[:, 1], 0.0, atol=1e-12)


@pytest.mark.long
def test_lift_off():
    """Nothing jumps there, but the motion after it has one freedom more."""
    mu, g, rise, end = 0.2, 10.0, 3.0, 2.0
    derivative, s = solved(Ramp(mu, 0.5, g, push=1.0, rise=rise), end, [0, 0, 3.0, 0])
    ((t, kind),) = events(s)
    assert kind == Event.LIFT_OFF
    slip, flight = np.zeros((4, 4)), np.zeros((4, 4))
    slip[0, 2] = flight[0, 2] = flight[1, 3] = 1
    slip[2, 0], flight[3, 0] = mu * rise, rise
    closed = matrix(flight, end - t) @ matrix(slip, t)
    np.testing.assert_allclose(derivative[:, [0, 2]], closed[:, [0, 2]], rtol=1e-9, atol=1e-9)


@pytest.mark.long
def test_what_begins_to_slip_from_rest_keeps_the_derivative_by_its_speed():
    """And on the ground none by the speed away from it."""
    derivative, _ = solved(Ramp(0.3, push=5.0), 0.7, [0, 0, 0, 0])
    np.testing.assert_allclose(derivative[:2, 2:], [[0.7, 0.0], [0.0, 0.0]], atol=1e-12)


@pytest.mark.slow
def test_a_second_derivative_is_refused():
    """It was zero, to rounding: the saltation was taken for one that does not change."""

    def end(gravity):
        start = ((1.0,), (0.0,))
        return wiperjax.solve(Ball(gravity), 1.0, initial_state=start, max_events=0).final_position

    with pytest.raises(NotImplementedError, match="must be differentiated once, but was twice"):
        jax.eval_shape(jax.jacfwd(jax.jacfwd(end)), 9.81)


@pytest.mark.slow
@pytest.mark.parametrize("sticks", [False, True])
def test_impact(sticks):
    mu, e, g, end = 0.4, 0.6, 10.0, 0.5
    start = np.array([0.0, 0.8, 0.5 if sticks else 3.0, -0.3])
    derivative, s = solved(Ramp(mu, e, g), end, start)
    ((t, kind),) = events(s)
    assert kind == Event.IMPACT
    fall = -0.3 - g * t
    reset = np.diag([1.0, 1.0, 0.0 if sticks else 1.0, -e])
    slip = 0.0
    if not sticks:
        reset[2, 3] = mu * (1 + e)  # p_t = -mu (1 + e) |v_n|
        slip = start[2] + mu * (1 + e) * fall
        assert slip > 0
    before = (start[2], fall, 0, -g)
    after = (slip, -e * fall, 0, -g)
    flight = np.zeros((4, 4))
    flight[0, 2] = flight[1, 3] = 1
    closed = (
        matrix(flight, end - t) @ saltation(reset, (0, 1, 0, 0), before, after) @ matrix(flight, t)
    )
    np.testing.assert_allclose(derivative, closed, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_end_of_a_zeno_sequence():
    """The limit of the product of all its saltation matrices: the series summed."""
    mu, e, g, end = 0.1, 0.5, 10.0, 2.0
    start = np.array([0.0, 0.7, 4.0, 0.0])
    derivative, s = solved(Ramp(mu, e, g), end, start)
    found = events(s)
    assert [k for _, k in found] == [Event.IMPACT] * (len(found) - 1) + [Event.ZENO]

    def series(state):
        x, y, vx, vy = state
        fall = (vy + jnp.sqrt(vy**2 + 2 * g * y)) / g
        time, speed, x = fall, g * fall - vy, x + vx * fall
        for _ in range(80):
            vx = vx - mu * (1 + e) * speed
            speed = e * speed
            flight = 2 * speed / g
            time, x = time + flight, x + vx * flight
        rest = end - time
        return jnp.stack([x + vx * rest - 0.5 * mu * g * rest**2, 0.0, vx - mu * g * rest, 0.0])

    final, closed = series(start), jax.jacfwd(series)(start)
    # the completed rest, of 2e-8 s, moves at the speed at its start
    np.testing.assert_allclose(s.final_position[0], final[0], rtol=1e-12)
    np.testing.assert_allclose(derivative, closed, rtol=0, atol=1e-7)


@pytest.mark.long
def test_an_impact_just_behind_a_known_time():
    """A step of a last digit or two ends at the event: what it tells of bends is rounding, which
    made the derivatives 5e-4 wrong."""
    g, e, end = 9.81, 0.5, 1.0
    fall = np.sqrt(2 / g)

    def speed(height, mark):
        start = ((height,), (0.0,))
        options = {"initial_state": start, "statistics_start": mark, "rtol": 1e-10}
        return wiperjax.solve(Ball(g, e), end, **options).final_velocity[0]

    slopes = jax.jit(jax.vmap(jax.jacfwd(speed, (0, 1)), (None, 0)))
    marks = fall - 1e-16 * np.array([0.0, 1.0, 2.0, 5.0, 10.0, 50.0, 1e2, 1e3, 1e4])
    by_height, by_mark = slopes(1.0, marks)
    # two impacts by then: v = v2 - g (end - t2), with v2 = e^2 g t1 and t2 = t1 (1 + 2 e)
    exact = (e * e * g + g * (1 + 2 * e)) * 0.5 * fall
    np.testing.assert_allclose(by_height, exact, rtol=1e-8)
    np.testing.assert_allclose(by_mark, 0.0, atol=1e-8)
