"""Derivatives of the wiper through whole sequences of events.

Flows and saltation matrices (see `saltation`): the motion between events is not linear, so its
flow, and the derivative of it, come from the variational equation by scipy's integrator, which
knows of no event. Regimes and instants of the events are the engine's; everything else is ours.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from saltation import saltation
from scipy.integrate import solve_ivp

import wiperjax
from wiperjax import Event, Regime, TrapezoidBelt, Wiper
from wiperjax.contact.regimes import vector_field
from wiperjax_bench.scenes import hard_contact

LENGTH, BOUNCE = 6e-3, 0.3
BLADE = ("attack_angle", "support_stiffness")
BELT = ("speed", "frequency", "ramp", "phase")
TURNS = (Event.CAPTURE, Event.REVERSAL)


def numbers(angle, stiffness, height=0.0, speed=0.2, frequency=1e-3, ramp=1e-3):
    """Everything that differs between cases, so that one compilation serves: blade, belt and start
    (touching or above the glass, at rest). The belt keeps its speed unless told otherwise."""
    angle = math.radians(angle)
    start = (LENGTH * math.sin(angle), height, 0.0, 0.0)
    return np.array([angle, stiffness, speed, frequency, ramp, 0.5 * math.pi, *start])


def blade(given):
    """The wiper of some `numbers`, on the belt's first piece."""
    belt = TrapezoidBelt(**dict(zip(BELT, given[2:6], strict=True)))
    wiper = Wiper(belt=belt, restitution=BOUNCE, **dict(zip(BLADE, given[:2], strict=True)))
    return wiper.on_piece(wiper.first_piece(jnp.zeros(())))


@jax.jit
def push(given, direction, duration):
    """(state at the end, its derivative along ``direction``, `Solution`)."""

    def run(given):
        x, y, *speeds = given[6:]
        s = wiperjax.solve(
            blade(given), duration, initial_state=((x, y), speeds), rtol=1e-11, max_events=128
        )
        return jnp.concatenate([s.final_position, s.final_velocity]), s

    return jax.jvp(run, (given,), (direction,), has_aux=True)


def _field(y, given, regime, side):
    local = blade(given).prepared().on_sides((side,))
    q, v = vector_field(jnp.float64(0), ((y[0], y[1]), (y[2], y[3])), (local, regime))
    return jnp.stack([*q, *v])


field = jax.jit(_field)
slope = jax.jit(jax.jacfwd(_field))


def flow(given, regime, side, y, duration):
    """State after ``duration`` in one regime, and its derivative by ``y``."""

    def rates(t, z):
        at, product = z[:4], z[4:].reshape(4, 4)
        here = slope(at, given, regime, side) @ product
        return np.concatenate([field(at, given, regime, side), np.ravel(here)])

    start = np.concatenate([y, np.eye(4).ravel()])
    z = solve_ivp(rates, (0, duration), start, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return z[:4], z[4:].reshape(4, 4)


def impact(given, side, complete, y):
    """(state, time that passes): docs/model.md, section 6 for a massless hinge; where
    ``complete``, of the last impact of an accumulating sequence with all that would follow."""
    wiper, e, approach = blade(given), BOUNCE, -y[3]

    def slowed(blow):
        loss = wiper.law.coefficient(jnp.abs(y[2])) * blow
        return jnp.where(loss >= jnp.abs(y[2]), 0.0, y[2] - jnp.sign(y[2]) * loss)

    first = slowed((1 + e) * approach)
    left = jnp.stack([y[0], 0.0, first, e * approach])
    if not complete:
        return left, 0.0 * approach
    # the rest moves on as the first impact leaves it, under the free acceleration after it; all
    # blows together are (1 + e) / (1 - e)
    free = _field(left, given, int(Regime.FLIGHT), side)
    lasts = 2 * e * approach / (1 - e) / -free[3]
    slip = slowed((1 + e) / (1 - e) * approach) + lasts * free[2]
    return jnp.stack([y[0] + lasts * (first + given[2]), 0.0, slip, 0.0]), lasts


@pytest.mark.long
@pytest.mark.parametrize(
    ("angle", "stiffness", "height", "duration", "kinds"),
    [
        (-35.0, 2000.0, 2e-4, 0.0015, {Event.IMPACT, Event.ZENO, Event.REVERSAL}),
        (-20.0, 2000.0, 0.0, 0.02, {Event.CAPTURE, Event.RELEASE, Event.KINK}),
        (-35.0, 8000.0, 0.0, 0.03, {Event.LIFT_OFF, Event.IMPACT, Event.ZENO}),
    ],
)
def test_the_product_of_all_flows_and_saltation_matrices(angle, stiffness, height, duration, kinds):
    given = numbers(angle, stiffness, height)
    speed, start = given[2], given[6:]
    free = [0, 1, 2, 3] if height else [0, 2]
    columns = [push(given, np.eye(10)[6 + i], duration) for i in free]
    end, _, s = columns[0]
    derivative = np.stack([c[1] for c in columns], axis=-1)
    n = int(s.events.count)
    log = jax.tree.map(lambda x: np.asarray(x)[:n].tolist(), s.events._replace(count=np.zeros(n)))
    assert kinds <= set(log.kind)
    totals = s.statistics  # no time is lost, and what moves gets there: a sequence of impacts, too
    lasted = totals.stick_time + totals.slip_time + totals.flight_time
    assert float(lasted) == pytest.approx(duration, rel=1e-12)
    way = float(s.final_position[0] - start[0])
    assert float(totals.output_integral) == pytest.approx(way, abs=1e-9 * LENGTH)

    y = start - [0, 0, speed, 0]  # the system computes with velocities over the glass
    switch = blade(given).switches(0.0, (y[0], y[1]), (y[2], y[3]))[0]
    product, now, side = np.eye(4), 0.0, 1.0 if switch > 0 else -1.0
    for t, kind, before, after in zip(log.time, log.kind, log.before, log.after, strict=True):
        hit, last = t, kind == Event.ZENO
        if last:
            # logged at its end; falling on until then, the tip would be faster by this factor
            later = flow(given, before, side, y, t - now)[0]
            lasts = float(impact(given, side, True, later)[1])
            hit = t - lasts * (1 - BOUNCE) / (1 + BOUNCE)
        y, here = flow(given, before, side, y, hit - now)
        product, now = here @ product, t
        if kind == Event.KINK:
            side = -side  # the vector field is continuous
            continue
        if kind not in (*TURNS, Event.IMPACT, Event.ZENO):
            continue  # release and lift-off: continuous too
        f_before = np.asarray(field(y, given, before, side))
        if kind in TURNS:
            gradient, reset, gone = np.array([0, 0, 1.0, 0]), np.eye(4), np.zeros(4)
            y = y * [1, 1, 0, 1]
        else:
            gradient = np.array([0, 1.0, 0, 0])
            reset, gone = jax.jacfwd(impact, argnums=3)(given, side, last, y)
            y = np.asarray(impact(given, side, last, y)[0])
        f_after = np.asarray(field(y, given, after, side))
        reset = np.asarray(reset) - np.outer(f_after, gone)
        product = saltation(reset, gradient, f_before, f_after) @ product
    y, here = flow(given, int(s.final_regime), side, y, duration - now)
    product = here @ product

    size = np.array([LENGTH, LENGTH, speed, speed])
    assert np.all(np.abs(y + [0, 0, speed, 0] - end) < 1e-7 * size)
    scale = np.abs(product[:, free]).max(axis=1, keepdims=True) + size[:, None] / LENGTH * 1e-3
    # measured: 2.4e-9
    np.testing.assert_allclose(derivative / scale, product[:, free] / scale, rtol=0, atol=2e-8)


@pytest.mark.long
def test_a_belt_of_ramps():
    """By all its parameters, through its reversal and its corners: central differences."""
    given = numbers(10.0, 2000.0, speed=0.3, frequency=15.0, ramp=4e-3)
    duration = 0.03
    seen = np.asarray(push(given, given, duration)[2].events.kind).tolist()
    assert {Event.BELT_REVERSAL, Event.BELT_KINK, Event.CAPTURE, Event.RELEASE} <= set(seen)
    for i, name in enumerate(BLADE + BELT):
        unit = np.eye(10)[i] * given[i]
        found = np.asarray(push(given, unit, duration)[1])
        at = {
            k: np.asarray(push(given + k * 1e-5 * unit, unit, duration)[0]) for k in (-2, -1, 1, 2)
        }
        change = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / 12e-5
        scale = np.array([LENGTH, LENGTH, 0.3, 0.3])
        worst = np.abs(found - change) / np.maximum(np.abs(change), 0.01 * scale)
        print(name, worst.max())
        assert worst.max() < 1e-5, name


@pytest.mark.long
def test_a_jam_has_the_derivative_of_its_time():
    """Slip is braked to D = 0. The time of that was taken for fixed: its derivative was 0, those
    of all behind it were wrong, that of the integral of forces by seven orders."""
    found = hard_contact.near_painleve()
    blade = jax.tree.map(lambda x: x[0] if np.ndim(x) else x, found.wiper)

    def run(speed):
        lip = LENGTH * math.sin(math.atan(0.51427))
        s = wiperjax.solve(
            blade, 1e-3, initial_state=((lip, 0.0), (speed, 0.0)), rtol=1e-11, max_events=4
        )
        outcome = jnp.stack([*s.events.time[:2], s.final_position[0], s.statistics.slip_time])
        return (outcome, s.statistics.normal_force_integral), s.events.kind

    push = jax.jit(lambda speed: jax.jvp(run, (speed,), (1.0,), has_aux=True))
    (before, _), *_ = push(0.6 - 1e-5)
    (after, _), *_ = push(0.6 + 1e-5)
    _, (slope, impulse), kinds = push(0.6)
    assert list(np.asarray(kinds)) == [Event.JAM, *[Event.IMPACT] * 3]
    difference = (after - before) / 2e-5
    np.testing.assert_allclose(slope, difference, rtol=3e-3)
    assert np.all(np.abs(difference) > 1e-4) and np.isnan(impulse)
