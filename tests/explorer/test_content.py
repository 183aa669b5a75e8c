"""What is drawn of a motion: which part of it, and how finely."""

import numpy as np
import pytest
import xarray as xr

from wiperjax.explorer.content import content_of
from wiperjax.explorer.numbers import heading


def run_of(velocity, step=2e-5):
    """A run of a blade that slips with some velocity (m/s) along the glass."""
    time = step * np.arange(velocity.size)
    flags = {"flag_values": np.arange(4), "flag_meanings": "stick slip_pos slip_neg flight"}
    plane = [np.cumsum(velocity) * step, velocity]
    place, speed = (np.column_stack([along, 0 * along]) for along in plane)
    return xr.Dataset(
        {
            "position": (("time", "axis"), place, {"units": "m"}),
            "velocity": (("time", "axis"), speed, {"units": "m/s"}),
            "regime": ("time", np.where(velocity < 0, 2, 1).astype(np.int8), flags),
            "belt_velocity": ("time", np.full(time.size, 0.3), {"units": "m/s"}),
            "result": 0,
            "final_time": time[-1],
        },
        coords={"time": ("time", time, {"units": "s"}), "axis": ["x", "y"]},
        attrs={"duration": float(time[-1])},
    )


@pytest.mark.parametrize(
    ("decay", "says"), [(300.0, "all of the run, its start too"), (0.0, "the last 12 ms")]
)
def test_the_page_says_which_part_of_a_motion_is_drawn(decay, says):
    """The start of a quiet cell is all that is seen of it, and was taken for what it settles to."""
    time = 2e-5 * np.arange(40_001)
    run = run_of(np.exp(-decay * time) * np.sin(2 * np.pi * 500 * time))
    content = content_of(run)
    assert f"phase portrait and friction: {says}." in heading(run, {}, "a cell", content.part)
    assert "phase portrait" not in heading(run, {}, "too short to be drawn", "")


def test_the_start_of_a_motion_that_dies_away_is_drawn_finely():
    """Its few rounds lay in a hundredth of the samples, and were straight pieces."""
    time = 2e-5 * np.arange(40_001)
    orbit = content_of(run_of(np.exp(-300 * time) * np.sin(1000 * time))).columns["orbit"]
    x = np.concatenate(orbit["x"])
    assert np.abs(np.diff(x)).max() < 0.02 * np.ptp(x)
