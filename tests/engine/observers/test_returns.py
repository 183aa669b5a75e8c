"""Totals of whole periods: a noise's own means, whatever the ends of the window cut of it."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import Block

import wiperjax
from wiperjax import Regime, SteadyBelt, Stribeck
from wiperjax.engine.observers.base import Happening
from wiperjax.engine.observers.returns import SUMS, Returns
from wiperjax.engine.observers.totals import RegimeTotals, Totals
from wiperjax.systems.chain import Chain3

STICK, SLIP = Regime.STICK, Regime.SLIP_NEG


class Told(RegimeTotals):
    """Totals that are told: stick for 0.2 of each second, at whatever rate events come."""

    def event(self, record, happening):
        return record._replace(stick_time=jnp.asarray(0.2 * happening.time))


class Clocked(Block):
    """A block that something drives, every so often."""

    drive_period: float = 1.0


def gathered(events, span=1.0, system=None):
    """The record behind some events (time, before, after, position) of a coordinate that goes over
    a ``span``."""
    rule = Returns(Told(1.0), 1)
    ends = jnp.array([0.5 * span, 0.0])
    record = rule.init(jnp.float64)._replace(low=tuple(-ends), high=tuple(ends))
    for time, before, after, place in events:
        state = (jnp.asarray(place),), (jnp.zeros(()),)
        system = system or Block(1.0, 0.5)
        record = rule.event(
            record, Happening(system, time, 0, before, after, 0.0, 0.0, 0.0, *state)
        )
    return record


def two_slips(until, drift=0.0):
    """A period of 1 s with two slips, of which one begins at 0.1 and one at 0.6, elsewhere."""
    found = []
    for k in range(until):
        for begin, place in ((0.1, 0.3), (0.6, 0.1)):
            there = place + drift * k
            found += [(k + begin, STICK, SLIP, there), (k + begin + 0.2, SLIP, STICK, -there)]
    return found


def test_a_motion_is_back_where_its_state_is():
    """The other slip of a period is no return, nor is what comes before the window."""
    record = gathered(two_slips(5))
    assert record.period == pytest.approx(1.0) and record.count == 3
    totals, time = record.whole(4.0)
    assert time == pytest.approx(3.0)
    np.testing.assert_allclose(totals.stick_time, 0.6)


@pytest.mark.parametrize(("drive", "count", "period"), [(0.5, 3, 1), (2, 1, 2), (0.7, 0, math.nan)])
def test_what_a_clock_drives_comes_back_with_it(drive, count, period):
    """One of few coordinates passes its first state by chance, at any phase of the drive."""
    record = gathered(two_slips(5), system=Clocked(1.0, 0.5, drive_period=drive))
    assert record.count == count
    np.testing.assert_allclose(record.period, period)


@pytest.mark.parametrize("drift", [0.01, -0.01])
def test_a_motion_that_is_still_on_its_way_does_not_come_back(drift):
    record = gathered(two_slips(5, drift))
    totals, time = record.whole(4.0)
    assert math.isnan(record.period) and time == 4.0
    assert totals == record.totals


def returning_after(*periods):
    """The record of a motion of 1 s that is off, but for some of its periods."""
    off = {k: 0.3 if k in (0, *periods) else 0.3 + 0.01 * (k + 1) for k in range(20)}
    return gathered([(1.1 + k, STICK, SLIP, place) for k, place in off.items()])


def test_a_period_at_whose_end_a_motion_was_off_is_one_of_those_counted():
    """It spirals to its end, passes its first state, and was said to have a longer period."""
    record = returning_after(1, 4, 5, 7)
    assert record.count == 7 and record.period == pytest.approx(1.0)
    assert record.whole(19.0)[1] == pytest.approx(7.0)
    record = returning_after(4, 5, 6)  # the shortest time comes later
    assert record.count == 6 and record.period == pytest.approx(1.0)


def test_events_of_one_instant_are_no_return():
    """The time between them is rounding, of which every other is a multiple."""
    at = np.arange(1.1, 6.0)
    twice = [(t, STICK, SLIP, 0.3) for time in at for t in (time, time * (1 + 1e-15))]
    record = gathered(twice)
    assert record.count == 4 and record.period == pytest.approx(1.0)


def test_what_comes_back_at_uneven_times_has_no_period():
    record = returning_after(2, 5, 6)
    totals, time = record.whole(19.0)
    assert record.count == 0 and math.isnan(record.period) and time == 19.0
    assert totals == record.totals


@pytest.mark.long
def test_blocks_that_still_settle_have_the_period_that_they_settle_to():
    """Three blocks, 300 s and 6000 s after their start: it was 1.105 times as long."""
    speed, damping = 2 / 13, 0.06
    chain = Chain3(damping=damping, friction=Stribeck(1.0, 0.4, 0.3), belt=SteadyBelt(speed))

    @jax.jit
    @jax.vmap
    def found(begin):
        rule = Returns(RegimeTotals(begin), 3)
        run = wiperjax.solve(chain, begin + 200.0, observer=rule, max_events=0)
        return run.statistics.period

    early, late = found(jnp.array([300.0, 6000.0]))
    np.testing.assert_allclose(early, late, rtol=1e-5)


def test_rounding_of_what_stands_is_no_motion():
    """A gap that is 0 but for its last digits would never have come back."""
    places = 1e-17 * np.random.default_rng(0).random(4)
    events = [(1.1 + k, STICK, SLIP, place) for k, place in enumerate(places)]
    assert gathered(events, 1e-17).count == 3


def test_all_that_adds_up_is_known():
    assert set(SUMS) < set(Totals._fields)


@pytest.mark.long
def test_derivatives_of_a_noise_are_exact_and_hang_on_no_window():
    """A block that a belt drags by a spring, which sticks for 2 a/V and slips for
    2 (pi - arctan(w a/V))/w, a the difference of the forces of friction over its stiffness: by the
    speed, over windows that end at any phase. Those of the window swing about it for ever."""
    static, dynamic, speed = 1.0, 0.4, 0.7

    def exact(v):
        a = static - dynamic
        stick, slip = 2 * a / v, 2 * (jnp.pi - jnp.arctan(a / v))
        return stick / (stick + slip), stick + slip

    @jax.jit
    def found(v, window):
        rule = Returns(RegimeTotals(20.0), 1)
        start = (static - 0.3,), (v,)
        block = eqx.tree_at(lambda b: b.belt, Block(static, dynamic, belt=speed), v)
        run = wiperjax.solve(
            block, 20.0 + window, initial_state=start, rtol=1e-10, observer=rule, max_events=0
        )
        record = run.statistics
        totals, time = record.whole(window)
        return totals.stick_time / time, record.period, record.totals.stick_time / window

    (share, period), slopes = jax.jvp(exact, (speed,), (1.0,))
    cut = []
    for window in (50.0, 52.0, 54.0, 200.0):
        (shares, periods, _), (by_share, by_period, of_window) = jax.jvp(
            lambda v, w=window: found(v, w), (speed,), (1.0,)
        )
        np.testing.assert_allclose((shares, periods), (share, period), rtol=1e-9)
        np.testing.assert_allclose((by_share, by_period), slopes, rtol=1e-8)
        cut.append(float(of_window))
    assert max(cut) - min(cut) > 0.1
