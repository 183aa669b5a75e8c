"""Runs of systems of one's own."""

import odd_systems

import wiperjax
from wiperjax import Result
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
