"""What a slip costs: rate, drop of force, energy, acceleration, against closed forms."""

import math

import numpy as np
import own_systems
import pytest

import wiperjax


@pytest.mark.long
def test_slips_of_a_block_with_two_coefficients_of_friction_are_the_closed_form():
    """A block on a spring, stuck to a belt of speed V until k x = mu_s N, slips back by half a
    period of its spring but for V; energy of a slip: work of the spring between its ends."""
    static, dynamic, load, stiffness, mass, speed = 0.8, 0.5, 2.0, 3.0, 1.5, 0.05
    ds = wiperjax.sweep(
        {
            "system": "own_systems:Oscillator",
            "parameters": {
                "friction": "coulomb", "mu_static": static, "mu_minimum": dynamic, "load": load,
                "mass": mass,
            },
            "belt": {"speed": speed},
            "axes": {"stiffness": {"values": [stiffness]}},
            "run": {"transient": 100.0, "window": 400.0, "samples": 512, "rtol": 1e-9},
            "classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]},
        }
    ).isel(stiffness=0)  # fmt: skip
    omega = math.sqrt(stiffness / mass)
    middle, high = dynamic * load / stiffness, static * load / stiffness
    reach = high - middle  # of the slip about its middle, which begins and ends at the speed V
    radius = math.hypot(reach, speed / omega)
    slip = (math.pi + 2 * math.atan2(speed / omega, reach)) / omega
    stick = 2 * reach / speed
    period = slip + stick
    assert float(ds.slip_rate) == pytest.approx(1 / period, abs=1 / 400)
    assert float(ds.force_drop) == pytest.approx((static - dynamic) * load, rel=1e-9)
    path = speed * slip + 2 * reach  # the block moves back by 2 reach, the belt on
    count = float(ds.slip_rate) * 400
    whole = dynamic * load * path
    assert float(ds.energy_per_slip) == pytest.approx(whole, rel=1.1 / count)
    assert float(ds.acceleration_max) == pytest.approx(omega**2 * radius, rel=2e-3)
    assert ds.force_drop.attrs["units"] == "N" and ds.energy_per_slip.attrs["units"] == "J"


@pytest.mark.long
def test_what_never_sticks_has_no_slips():
    ds = wiperjax.sweep(
        {
            "system": own_systems.Ball,
            "axes": {"restitution": {"values": [0.5, 1.0]}},
            "start": {"position": [1.0]},
            "run": {"transient": 0.0, "window": 2.0},
            "classes": {"quiet_velocity": 0.1},
        }
    )
    np.testing.assert_array_equal(ds.slip_rate, 0.0)
    np.testing.assert_array_equal(ds.force_drop, 0.0)
    np.testing.assert_array_equal(ds.energy_per_slip, 0.0)
    np.testing.assert_allclose(ds.acceleration_max[1], 9.81, rtol=1e-6)
