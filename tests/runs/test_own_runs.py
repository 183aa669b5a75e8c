"""Runs of systems of one's own."""

import numpy as np
import odd_systems
import pytest

import wiperjax
from wiperjax import Result
from wiperjax.noise.run_class import assess
from wiperjax.runs.dataset import OF_A_RUN

CLASSES = {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]}


def test_a_parameter_does_not_take_the_place_of_an_attribute_of_the_run():
    """`duration` of a pulse was the length of the run for all that reads it."""
    scene = {"system": "odd_systems:Pulsed", "run": {"duration": 20.0}, "classes": CLASSES}
    run = wiperjax.run_scene(scene)
    assert run.attrs["duration"] == 20.0 and run.attrs["parameter_duration"] == 3.0
    assert "parameter_duration: s" in run.attrs["parameter_units"].split("; ")
    again = wiperjax.simulate(odd_systems.Pulsed(), 20.0)
    assert again.attrs["duration"] == 20.0 and again.attrs["parameter_duration"] == 3.0
    of_the_system = {"mass", "stiffness", "load", "tilt", "friction", "belt", "parameter_duration"}
    of_the_system |= {"friction_static", "friction_steepness", "belt_speed"}
    assert again.attrs.keys() - of_the_system == OF_A_RUN - {"statistics_start"}


def test_a_motion_that_ends_where_it_begins_is_a_run_that_says_so():
    run = wiperjax.simulate(odd_systems.Undefined(), 1.0)
    assert int(run.result) == Result.NON_FINITE and float(run.final_time) == 0.0
    assert "undefined" in run.attrs["result_message"] and run.sizes["event"] == 0


def test_a_slip_costs_what_it_costs_without_a_belt_too():
    """A block that is dragged to and fro over the ground, and judged by what drags it: work is that
    of its own slip, by the samples as by the engine."""
    run = wiperjax.run_scene(
        {
            "system": "own_systems:Pulled",
            "run": {"duration": 120.0, "sample_interval": 0.002},
            "classes": CLASSES | {"quiet_velocity": 1e-3},
        }
    )
    exact = float(run["energy_per_slip"])
    assert exact > 0.5  # J
    assert float(assess(run)["energy_per_slip"]) == exact
    again = assess(run, transient=61.0)  # not gathered from there on
    assert float(again["slip_rate"]) == pytest.approx(2 / (2 * np.pi), rel=0.1)
    assert float(again["energy_per_slip"]) == pytest.approx(exact, rel=0.06)
    assert np.isnan(assess(run.drop_vars("slip_speed"), transient=61.0)["energy_per_slip"])
