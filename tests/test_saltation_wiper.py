"""Derivatives of the wiper through whole sequences of events: flows and saltation matrices.

See `test_saltation` for the matrices. The motion of the wiper between events is not linear: its
flow, and the derivative of it, come from the variational equation by scipy's integrator, which
knows of no event. Regimes and instants of the events are the engine's; everything else is ours.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_saltation import saltation

import wiperjax
from wiperjax import Event, Regime, SteadyBelt, Wiper
from wiperjax.state import vector_field

BELT = 0.2
TURNS = (Event.CAPTURE, Event.REVERSAL)


def blade(angle, stiffness):
    """Leading blades; every number that differs between cases is traced: one compilation."""
    return Wiper(
        belt=SteadyBelt(BELT),
        attack_angle=jnp.asarray(math.radians(angle)),
        support_stiffness=jnp.asarray(stiffness),
    )


@jax.jit
def push(wiper, start, direction, duration):
    """((state at the end, its log), derivative along ``direction``): one tangent compiles fast."""

    def run(state):
        s = wiperjax.solve(
            wiper,
            duration,
            initial_state=((state[0], state[1]), (state[2], state[3])),
            rtol=1e-11,
            max_events=128,
        )
        return jnp.concatenate([s.final_position, s.final_velocity]), s

    end, tangent, s = jax.jvp(run, (start,), (direction,), has_aux=True)
    return end, tangent, s


def _field(y, wiper, regime, side):
    local = wiper.prepared().on_sides((side,))
    q, v = vector_field(jnp.float64(0), ((y[0], y[1]), (y[2], y[3])), (local, regime))
    return jnp.stack([*q, *v])


field = jax.jit(_field)
slope = jax.jit(jax.jacfwd(_field))


def flow(wiper, regime, side, y, duration):
    """State after ``duration`` in one regime, and its derivative by ``y``."""

    def rates(t, z):
        at, product = z[:4], z[4:].reshape(4, 4)
        here = slope(at, wiper, regime, side) @ product
        return np.concatenate([field(at, wiper, regime, side), np.ravel(here)])

    start = np.concatenate([y, np.eye(4).ravel()])
    # positions are of the order of millimetres, their derivatives by speeds of milliseconds
    z = solve_ivp(rates, (0, duration), start, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return z[:4], z[4:].reshape(4, 4)


def impact(wiper, side, y, complete):
    """(state, time that passes): MODEL.md section 6 for a massless hinge; where ``complete``, of
    the last impact of an accumulating sequence with all that would follow."""
    e, approach = wiper.restitution, -y[3]

    def slowed(blow):
        loss = wiper.law.coefficient(jnp.abs(y[2])) * blow
        return jnp.where(loss >= jnp.abs(y[2]), 0.0, y[2] - jnp.sign(y[2]) * loss)

    first = slowed((1 + e) * approach)
    if not complete:
        return jnp.stack([y[0], 0.0, first, e * approach]), 0.0 * approach
    # the rest moves on as the first impact leaves it, under the free acceleration after it; all
    # blows together are (1 + e) / (1 - e)
    left = jnp.stack([y[0], 0.0, first, e * approach])
    free = _field(left, wiper, int(Regime.FLIGHT), side)
    lasts = 2 * e * approach / (1 - e) / -free[3]
    slip = slowed((1 + e) / (1 - e) * approach) + lasts * free[2]
    return jnp.stack([y[0] + lasts * (first + BELT), 0.0, slip, 0.0]), lasts


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "stiffness", "height", "duration", "kinds"),
    [
        (-35.0, 2000.0, 2e-4, 0.0015, {Event.IMPACT}),
        (-20.0, 2000.0, 0.0, 0.02, {Event.CAPTURE, Event.RELEASE, Event.KINK}),
        (-35.0, 8000.0, 0.0, 0.03, {Event.LIFT_OFF, Event.IMPACT, Event.ZENO}),
    ],
)
def test_the_product_of_all_flows_and_saltation_matrices(angle, stiffness, height, duration, kinds):
    wiper = blade(angle, stiffness)
    start = np.array([6e-3 * math.sin(math.radians(angle)), height, 0.0, 0.0])
    free = [0, 1, 2, 3] if height else [0, 2]
    columns = [push(wiper, start, np.eye(4)[i], duration) for i in free]
    end, _, s = columns[0]
    derivative = np.stack([c[1] for c in columns], axis=-1)
    n = int(s.events.count)
    log = jax.tree.map(lambda x: np.asarray(x)[:n].tolist(), s.events._replace(count=np.zeros(n)))
    assert kinds <= set(log.kind)

    y = start - [0, 0, BELT, 0]  # the system computes with velocities over the glass
    theta = wiper.switches(0.0, (y[0], y[1]), (y[2], y[3]))[0]
    product, now, side = np.eye(4), 0.0, 1.0 if theta > 0 else -1.0
    for t, kind, before, after in zip(log.time, log.kind, log.before, log.after, strict=True):
        hit = t
        if kind == Event.ZENO:
            # logged at its end; falling on until then, the tip would be faster by this factor
            e = wiper.restitution
            later = flow(wiper, before, side, y, t - now)[0]
            hit = t - float(impact(wiper, side, later, True)[1]) * (1 - e) / (1 + e)
        y, here = flow(wiper, before, side, y, hit - now)
        product, now = here @ product, t
        if kind == Event.KINK:
            side = -side  # the vector field is continuous
            continue
        if kind not in (*TURNS, Event.IMPACT, Event.ZENO):
            continue  # release and lift-off: continuous too
        gradient = np.array([0, 0, 1.0, 0] if kind in TURNS else [0, 1.0, 0, 0])
        f_before = np.asarray(field(y, wiper, before, side))
        if kind in TURNS:
            y = y * [1, 1, 0, 1]
            reset, gone = np.eye(4), np.zeros(4)
        else:
            last = kind == Event.ZENO
            reset, gone = jax.jacfwd(lambda y, last=last: impact(wiper, side, y, last))(y)
            y = np.asarray(impact(wiper, side, y, last)[0])
        f_after = np.asarray(field(y, wiper, after, side))
        reset = np.asarray(reset) - np.outer(f_after, gone)
        product = saltation(reset, gradient, f_before, f_after) @ product
    y, here = flow(wiper, int(s.final_regime), side, y, duration - now)
    product = here @ product

    size = np.array([6e-3, 6e-3, BELT, BELT])
    assert np.all(np.abs(y + [0, 0, BELT, 0] - end) < 1e-7 * size)
    scale = np.abs(product[:, free]).max(axis=1, keepdims=True) + size[:, None] / 6e-3 * 1e-3
    # measured: 2.4e-9
    np.testing.assert_allclose(derivative / scale, product[:, free] / scale, rtol=0, atol=2e-8)
