"""Onto which instant a step ends, and with what it moves."""

import jax
import numpy as np
import pytest

import wiperjax
from wiperjax.engine.observers.reversal import ReversalTotals
from wiperjax.engine.observers.totals import RegimeTotals
from wiperjax.systems.oscillator import Oscillator


@pytest.mark.long
def test_what_is_asked_for_at_a_break_does_not_move_with_the_break():
    """After whole periods of a belt the end moved with the belt's frequency, and not with the
    duration; statistics from there on moved with it, and not with their beginning."""

    @jax.jit
    @jax.jacfwd
    def slopes(numbers):
        frequency, duration, begin = numbers
        system = Oscillator(belt=wiperjax.WipingBelt(0.3, frequency))
        s = wiperjax.solve(
            system, duration, rtol=1e-10, max_events=0, observer=ReversalTotals(begin, 0.1)
        )
        reversal = s.statistics._asdict()
        return s.final_time, s.final_position, reversal.pop("totals")._asdict(), reversal

    def alike(found, expected):
        for x, y in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-4, atol=2e-5)

    beside = 1e-6  # s; half a period is 2.5
    ends = slopes(np.array([0.2, 5.0, 1.0]))
    # what is near V = 0 turns there: on one side the end is, on the other it is not
    alike(ends[:-1], slopes(np.array([0.2, 5.0 - beside, 1.0]))[:-1])
    assert np.asarray(ends[0]).tolist() == [0.0, 1.0, 0.0]
    alike(slopes(np.array([0.2, 5.3, 2.5])), slopes(np.array([0.2, 5.3, 2.5 + beside])))


@pytest.mark.long
def test_statistics_that_begin_on_a_piece_of_no_length_begin_once():
    """There both the piece and what follows it told how they begin: the time in stick changed by
    -2 s per second of the beginning, and with the belt's frequency, on which it does not hang."""

    @jax.jit
    @jax.jacfwd
    def slopes(numbers):
        frequency, ramp, begin = numbers
        system = Oscillator(belt=wiperjax.TrapezoidBelt(0.3, frequency, ramp))
        observer = RegimeTotals(begin)
        s = wiperjax.solve(system, 6.5, rtol=1e-10, max_events=0, observer=observer).statistics
        return s.stick_time, s.output_integral, s.normal_force_integral

    for begin in (1.25, 3.75):  # the plateaus of the longest ramps
        at, beside = (slopes(np.array([0.2, 2.5, begin + dt])) for dt in (0.0, 1e-6))
        np.testing.assert_allclose(at, beside, rtol=1e-4, atol=2e-5)
        assert float(at[0][2]) == pytest.approx(-1)


@pytest.mark.long
def test_pieces_of_no_length_change_nothing():
    """The plateaus of a trapezoid with the longest ramps begin and end at once, to rounding. One
    that ended a digit before it began let time run backwards (4.5 ms once, with events on the way);
    in one of no length the event that the step before foresaw, a shoulder, was taken for there,
    and friction held the tip with three times what the cone allows."""

    @jax.jit
    def motion(ramp, phase, start):
        belt = wiperjax.TrapezoidBelt(0.5, 10.0, ramp, phase)
        blade = wiperjax.Wiper(belt=belt, attack_angle=0.1)
        return wiperjax.solve(blade, 0.2, start=start, max_events=300)

    for phase, start in ((np.pi / 2, 0.0), (-np.pi / 2, 0.0), (np.pi / 2, 0.7)):
        at, beside = motion(0.05, phase, start), motion(0.05 * (1 - 1e-12), phase, start)
        times = np.asarray(at.events.time)[: int(at.events.count)]
        assert np.all(np.diff(times) >= 0)
        same = ("stick_time", "slip_time", "stick_count", "slip_count", "stick_force_max")
        for name in same:
            found = (float(getattr(x.statistics, name)) for x in (at, beside))
            np.testing.assert_allclose(*found, rtol=1e-8, err_msg=f"{name}, {phase}, {start}")
        np.testing.assert_allclose(at.final_position[0], beside.final_position[0], rtol=1e-8)
