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
    assert f">Velocity and phase portrait: {says}." in heading(run, {}, "a cell", content.part)
    assert "phase portrait" not in heading(run, {}, "too short to be drawn", "")


def test_friction_is_shown_and_named_also_of_a_law_that_is_not_told():
    """The heading named a picture of friction where none was, as of every law of one's own."""
    run = run_of(np.sin(2 * np.pi * 500 * 2e-5 * np.arange(40_001)))
    slip = run["velocity"][:, 0] - run["belt_velocity"]
    force = {"normal_force": 0 * slip + 10, "friction_force": -5 * np.sign(slip)}
    content = content_of(run.assign(slip_speed=slip, **force).assign_attrs(friction="laws:Weak"))
    assert content.part.startswith("Velocity, phase portrait and friction: the last")
    assert "friction" not in content.hidden and len(content.columns["force"]["mu"]) > 100
    assert len(content.columns["law"]["mu"]) == 0 and np.isfinite(content.ranges["mu"]).all()


def test_the_start_of_a_motion_that_dies_away_is_drawn_finely():
    """Its few rounds lay in a hundredth of the samples, and were straight pieces."""
    time = 2e-5 * np.arange(40_001)
    orbit = content_of(run_of(np.exp(-300 * time) * np.sin(1000 * time))).columns["orbit"]
    x = np.concatenate(orbit["x"])
    assert np.abs(np.diff(x)).max() < 0.02 * np.ptp(x)


@pytest.mark.parametrize(("low", "name"), [(400.0, ""), (20.0, "chattering")])
def test_names_of_bands_do_not_lie_over_each_other(low, name):
    """Of a narrow band of chattering just below squeal "chatte" was left, under "squeal"."""
    run = run_of(np.sin(2 * np.pi * 500 * 2e-5 * np.arange(40_001)))
    content = content_of(run.assign_attrs(class_chatter_band=[low, 500.0]))
    assert content.columns["classes"]["name"] == ["squeal", name]
