"""Runs of systems of one's own."""

import jax
import jax.numpy as jnp
import numpy as np
import odd_systems
import own_systems
import pytest
from scipy.optimize import brentq

import wiperjax
from wiperjax import Result
from wiperjax.noise.run_class import assess
from wiperjax.runs import dataset
from wiperjax.runs.dataset import OF_A_RUN

CLASSES = {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]}


@pytest.mark.long
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
    assert again.attrs.keys() - of_the_system == OF_A_RUN - {"statistics_start", "max_step"}


def test_a_motion_that_ends_where_it_begins_is_a_run_that_says_so():
    run = wiperjax.simulate(odd_systems.Undefined(), 1.0)
    assert int(run.result) == Result.NON_FINITE and float(run.final_time) == 0.0
    assert "undefined" in run.attrs["result_message"] and run.sizes["event"] == 0


class Started(wiperjax.AbstractBelt):
    """It gathers speed for 0.1 s, and says in which piece a time lies by the ends before it."""

    speed: float = 0.02
    ends: tuple = (0.1, 0.15, 1.0)

    def velocity(self, time, piece):
        return self.speed * jnp.where(piece == 0, time / 0.1, 1.0)

    def break_time(self, piece):
        return jnp.where(piece < 3, jnp.asarray(self.ends)[jnp.minimum(piece, 2)], jnp.inf)

    def first_piece(self, time):
        return jnp.sum(jnp.asarray(self.ends) <= time)

    def reverses(self, piece):
        return False

    peak = rms = property(lambda self: self.speed)


@pytest.mark.long
@pytest.mark.parametrize("interval", [0.05, 0.2])
def test_the_belt_of_a_run_is_asked_for_one_time_after_the_other(interval):
    """All at once, the sum over its ends was that over all times, or the whole run ended in a
    traceback; of three samples the sum went through."""
    block = own_systems.Oscillator(belt=Started())
    run = wiperjax.simulate(block, 0.4, sample_interval=interval)
    exact = 0.02 * np.minimum(run.time / 0.1, 1.0)
    np.testing.assert_allclose(run.belt_velocity, exact, atol=1e-12)
    np.testing.assert_allclose(run.velocity[:, 0], exact, atol=1e-9)  # it sticks


@pytest.mark.slow
def test_a_motion_of_micrometres_whose_scales_are_not_stated_is_noted(caplog):
    """Its events were seconds off, and nothing said so."""

    def notes(size, system=own_systems.Oscillator, atol=None, speed=0.2):
        caplog.clear()
        block = system(load=size, belt=wiperjax.SteadyBelt(speed * size))
        wiperjax.simulate(block, 20.0, atol=atol)
        return [record.getMessage() for record in caplog.records]

    (note,) = notes(1e-6)
    assert note.startswith("note: Oscillator.scales must state the sizes of a motion")
    assert not notes(1.0) and not notes(1e-6, atol=1e-14) and not notes(1.0, speed=0.0)
    stated = {"scales": lambda system, n: ((system.load,),) * 2}
    assert not notes(1e-6, type("Mine", (own_systems.Oscillator,), stated))


@pytest.mark.long
def test_a_push_in_a_long_stick_is_seen_by_steps_as_short_as_it():
    """Between events a step is as long as guards are smooth: the push was stepped over."""
    system = odd_systems.Struck()
    released = brentq(lambda t: float(system.push(t)) - 1e-3 * 0.2 * t - 1.0, 31.0, 33.0)
    scene = {"system": "odd_systems:Struck", "run": {"duration": 60.0}, "classes": CLASSES}
    assert wiperjax.run_scene(scene).sizes["event"] == 0  # as docs/limits.md says
    scene["run"]["max_step"] = 0.1
    run = wiperjax.run_scene(scene)
    assert float(run.event_time[0]) == pytest.approx(released, abs=1e-6)
    assert run.attrs["max_step"] == 0.1
    again = wiperjax.simulate(system, 60.0, max_step=0.1)
    np.testing.assert_allclose(again.event_time, run.event_time, rtol=1e-9)


@pytest.mark.slow
def test_the_longest_step_holds_before_statistics_begin_too():
    system = odd_systems.Struck()
    solve = jax.jit(lambda: wiperjax.solve(system, 60.0, max_step=0.1, statistics_start=50.0))
    assert int(solve().events.count) > 0 and int(solve().steps) >= 600


@pytest.mark.long
def test_a_sweep_takes_the_longest_step_of_its_file():
    sweep = {
        "system": "odd_systems:Struck",
        "axes": {"load": {"start": 1.0, "stop": 4.0, "num": 2}},
        "run": {"transient": 20.0, "window": 40.0, "max_step": 0.1, "rtol": 1e-8},
        "classes": CLASSES,
    }
    found = wiperjax.sweep(sweep, progress=False)
    run = wiperjax.simulate(odd_systems.Struck(), 60.0, max_step=0.1)
    away = float(run.event_time[1] - run.event_time[0]) / 40.0
    np.testing.assert_allclose(found.stick_fraction, [1 - away, 1.0], atol=1e-7)


@pytest.mark.slow
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


def test_a_law_that_is_called_as_one_of_the_package_is_not_taken_for_it():
    """Its run said that it was of that law, whose curve was drawn beside the samples."""
    own = type("Stribeck", (wiperjax.Stribeck,), {"__module__": "laws"})
    named = [dataset._class(law(1.0, 0.3, 0.1)) for law in (wiperjax.Stribeck, own)]
    assert named == ["Stribeck", "laws:Stribeck"]
    assert dataset._class(wiperjax.SteadyBelt(0.3)) == "SteadyBelt"
