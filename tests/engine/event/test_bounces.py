"""Sequences of bounces that end in contact, against closed forms."""

import numpy as np
import pytest
from own_systems import BallOnATable, Rod

import wiperjax
from wiperjax import Regime, Result


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
@pytest.mark.parametrize(("restitution", "table", "amplitude"), [
    *((e, table, 0.0) for e in (0.5, 0.9) for table in (0.0, 1.0, 100.0)),
    *((e, table, 0.1) for e in (0.5, 0.9) for table in (0.0, 1.0)),
])  # fmt: skip
def test_a_ball_comes_to_rest_on_a_table_wherever_it_stands(restitution, table, amplitude, rtol):
    """At a height of 1 m a bounce of 1e-8 s is lower than its gap's last digit: the step shrank to
    nothing in front of an impact whose sign was chance."""
    ball = BallOnATable(restitution=restitution, table=table, amplitude=amplitude)
    run = wiperjax.simulate(ball, 12.0, initial_state=((table + 1.0,), (0.0,)), rtol=rtol)
    assert Result(int(run.result)).name == "FINISHED"
    ends = float(run.event_time[-1])
    height = float(run.final_position[0]) - table - amplitude * np.sin(3.0 * 12.0)
    assert abs(height) <= 1e-12 * (1 + table)
    if amplitude == 0:  # the fall, and twice its time for each bounce, all told
        fall = np.sqrt(2 / 9.81)
        # impacts move with the last digits of the height, and the last bounces with what is dropped
        assert ends == pytest.approx(fall * (1 + restitution) / (1 - restitution), abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("angle", [0.3, 0.9, 1.7, 2.2])
def test_what_is_placed_on_the_ground_begins_there(angle):
    """Its gap and normal speed are differences, 0 but for rounding: a rod that bounced by 1e-17 m
    ended as `zeno_unresolved` where it began."""
    turning, speed = -0.7, 0.4
    place = (0.0, np.sin(angle), angle)
    motion = (speed - np.sin(angle) * turning, np.cos(angle) * turning, turning)
    run = wiperjax.simulate(Rod(), 0.05, initial_state=(place, motion), rtol=1e-9)
    assert int(run.result) == Result.FINISHED and run.sizes["event"] == 0
    assert (run.regime == Regime.SLIP_POS).all() and (run.normal_force > 0).all()
    gap = run.position[:, 1] - np.sin(run.position[:, 2])
    assert abs(gap).max() < 1e-9
