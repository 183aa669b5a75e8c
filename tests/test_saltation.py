"""Derivatives through single events: flow, saltation, flow in closed form.

A perturbation of the state that passes an event at which the motion changes from f- to f+ after a
reset R, with the event function g, is multiplied by the saltation matrix

    S = DR + (f+ - DR f- - R_t) (g_q + ...) / (g_t + g_x f-)        (x = (q, v); R_t: of R by time)

Leine and Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems" (2004), ch. 7;
di Bernardo, Budd, Champneys and Kowalczyk, "Piecewise-smooth Dynamical Systems" (2008), ch. 2.
The flows beside the event are matrix exponentials where the motion is linear, and otherwise the
derivative of a smooth reference integrator that knows of no event.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import Block, Puck, events
from scipy.linalg import expm

import wiperjax
from wiperjax import Event, SteadyBelt, Wiper
from wiperjax.state import vector_field


def solved(system, duration, n, **options):
    """Return (x, dx/dx0) at the end: jit of state -> Solution and of its derivative."""

    def run(state):
        start = (tuple(state[:n]), tuple(state[n:]))
        s = wiperjax.solve(
            system, duration, initial_state=start, rtol=1e-12, max_events=40, **options
        )
        return jnp.concatenate([s.final_position, s.final_velocity]), s

    return jax.jit(jax.jacfwd(run, has_aux=True))


def saltation(reset, gradient, before, after, rate_t=0.0):
    """S from DR, dg/dx, f- and f+; ``rate_t`` is dg/dt."""
    reset, gradient = np.asarray(reset, float), np.asarray(gradient, float)
    before, after = np.asarray(before, float), np.asarray(after, float)
    return reset + np.outer(after - reset @ before, gradient) / (rate_t + gradient @ before)


def matrix(linear, duration):
    return expm(np.asarray(linear, float) * duration)


def test_capture():
    k, fd, v, start, end = 1.0, 0.3, 0.2, (0.2, -0.4), 3.0
    derivative, s = solved(Block(0.9, fd, 1.0, k, belt=v), end, 1)(np.array(start))
    ((t, kind),) = events(s)
    assert kind == Event.CAPTURE
    slip, stick = [[0, 1], [-k, 0]], [[0, 1], [0, 0]]
    w = math.sqrt(k)
    x = fd / k + (start[0] - fd / k) * math.cos(w * t) + start[1] / w * math.sin(w * t)
    before, after = (v, fd - k * x), (v, 0.0)
    jump = saltation(np.eye(2), (0, -1), before, after)
    closed = matrix(stick, end - t) @ jump @ matrix(slip, t)
    np.testing.assert_allclose(derivative, closed, rtol=0, atol=1e-9)


def test_slip_onset():
    """Only the position: a change of velocity at the start is no stick."""
    k, fs, fd, v, x0, end = 4.0, 0.9, 0.3, 0.5, 0.1, 0.7
    derivative, s = solved(Block(fs, fd, 1.0, k, belt=v), end, 1)(np.array([x0, v]))
    ((t, kind),) = events(s)
    assert kind == Event.RELEASE and t == pytest.approx((fs / k - x0) / v, rel=1e-12)
    jump = saltation(np.eye(2), (-k, 0), (v, 0), (v, fd - fs))
    closed = matrix([[0, 1], [-k, 0]], end - t) @ jump
    np.testing.assert_allclose(derivative[:, 0], closed[:, 0], rtol=0, atol=1e-9)


class Ramp(Puck):
    """A puck whose load falls as it slides on: -g + rise x."""

    rise: float = 3.0

    def free_acceleration(self, t, q, v):
        return self.push + 0 * t, -self.gravity + self.rise * q[0]


def test_lift_off():
    """Nothing jumps there, but the motion after it has one freedom more."""
    mu, g, rise, end = 0.2, 10.0, 3.0, 2.0
    derivative, s = solved(Ramp(mu, 0.5, g, push=1.0, rise=rise), end, 2)(np.array([0, 0, 3.0, 0]))
    ((t, kind),) = events(s)
    assert kind == Event.LIFT_OFF
    slip, flight = np.zeros((4, 4)), np.zeros((4, 4))
    slip[0, 2] = flight[0, 2] = flight[1, 3] = 1
    slip[2, 0], flight[3, 0] = mu * rise, rise
    closed = matrix(flight, end - t) @ matrix(slip, t)
    np.testing.assert_allclose(derivative[:, [0, 2]], closed[:, [0, 2]], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("sticks", [False, True])
def test_impact(sticks):
    mu, e, g, end = 0.4, 0.6, 10.0, 0.5
    start = np.array([0.0, 0.8, 0.5 if sticks else 3.0, -0.3])
    derivative, s = solved(Puck(mu, e, g), end, 2)(start)
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


def test_end_of_a_zeno_sequence():
    """The limit of the product of all its saltation matrices: the series summed."""
    mu, e, g, end = 0.1, 0.5, 10.0, 2.0
    system = Puck(mu, e, g)
    start = np.array([0.0, 0.7, 4.0, 0.0])
    derivative, s = solved(system, end, 2)(start)
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


@jax.jit
def wiper_derivative(wiper, start, duration):
    def run(state):
        s = wiperjax.solve(
            wiper,
            duration,
            initial_state=(tuple(state[:2]), tuple(state[2:])),
            rtol=1e-11,
            max_events=32,
        )
        return jnp.concatenate([s.final_position, s.final_velocity]), s

    return jax.jacfwd(run, has_aux=True)(start)


@jax.jit
def smooth_flow(wiper, regime, side, state, duration):
    """State after ``duration`` in one regime, and its derivative: classical Runge-Kutta."""
    local = wiper.prepared().on_sides((side,))

    def field(y):
        q, v = vector_field(jnp.float64(0), (tuple(y[:2]), tuple(y[2:])), (local, regime))
        return jnp.stack([*q, *v])

    def run(y):
        h = duration / 400

        def step(y, _):
            a = field(y)
            b = field(y + 0.5 * h * a)
            c = field(y + 0.5 * h * b)
            d = field(y + h * c)
            return y + h / 6 * (a + 2 * b + 2 * c + d), None

        return jax.lax.scan(step, y, None, length=400)[0]

    return run(state), jax.jacfwd(run)(state), field(state)


def impact_law(wiper, y):
    """MODEL.md section 6 for a massless hinge."""
    blow = (1 + wiper.restitution) * jnp.abs(y[3])
    limit = wiper.law.coefficient(jnp.abs(y[2])) * blow
    return jnp.stack([y[0], y[1], y[2] + jnp.clip(-y[2], -limit, limit), -wiper.restitution * y[3]])


@pytest.mark.slow
@pytest.mark.parametrize(
    "angle, height, duration, kinds",
    [
        (-35.0, 2e-4, 1.5e-3, {Event.IMPACT}),
        (-20.0, 0.0, 0.02, {Event.CAPTURE, Event.RELEASE, Event.KINK}),
    ],
)
def test_wiper(angle, height, duration, kinds):
    """The product of all flows and saltation matrices on the way."""
    belt = 0.3
    traced = lambda x: jnp.asarray(x) if isinstance(x, float) and x != 0 else x
    wiper = jax.tree.map(
        traced, Wiper(belt=SteadyBelt(belt), attack_angle=math.radians(angle), gravity=9.81)
    )
    start = jnp.array([6e-3 * math.sin(math.radians(angle)), height, 0.0, 0.0])
    derivative, s = wiper_derivative(wiper, start, duration)
    found = events(s)
    assert kinds <= {kind for _, kind in found} and not any(k == Event.ZENO for _, k in found)

    regimes = np.asarray(s.events.before[: len(found)]).tolist() + [int(s.final_regime)]
    y = start - jnp.array([0, 0, belt, 0])  # the system computes with velocities over the glass
    product, now, side = np.eye(4), 0.0, 1.0
    for regime, (t, kind) in zip(regimes, [*found, (duration, None)], strict=True):
        y, flow, _ = smooth_flow(wiper, regime, side, y, t - now)
        product, now = np.asarray(flow) @ product, t
        if kind in (Event.CAPTURE, Event.REVERSAL, Event.IMPACT):
            hits = kind == Event.IMPACT
            gradient = np.array([0, 1.0, 0, 0] if hits else [0, 0, 1.0, 0])
            law = (lambda y: impact_law(wiper, y)) if hits else (lambda y: y.at[2].set(0.0))
            reset = np.asarray(jax.jacfwd(law)(y)) if hits else np.eye(4)
            before = smooth_flow(wiper, regime, side, y, 0.0)[2]
            y = law(y)
            following = regimes[[e[0] for e in found].index(t) + 1]
            after = smooth_flow(wiper, following, side, y, 0.0)[2]
            product = saltation(reset, gradient, before, after) @ product
        elif kind == Event.KINK:
            side = -side
    free = [0, 1, 2, 3] if height else [0, 2]
    scale = np.abs(product[:, free]).max(axis=1, keepdims=True) + 1e-12
    np.testing.assert_allclose(derivative[:, free] / scale, product[:, free] / scale, atol=2e-7)
