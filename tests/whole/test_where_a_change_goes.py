"""What `docs/architecture.md` promises: a law, a belt, a statistic come from outside, whole."""

from dataclasses import fields
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import wiperjax
from wiperjax.contact import belts, friction
from wiperjax.engine.observers.totals import Totals
from wiperjax.maps.block import evaluate_block
from wiperjax.noise import run_class
from wiperjax.numerics import runge_kutta
from wiperjax.runs import scene
from wiperjax.specs.load import parse_scene, parse_sweep
from wiperjax.specs.tables import Classes
from wiperjax.specs.windows import flip_time
from wiperjax.systems import numbers
from wiperjax.vocabulary import kinds
from wiperjax.vocabulary.parameters import PARAMETERS
from wiperjax.vocabulary.schema import SCHEMA, Column
from wiperjax.vocabulary.thresholds import Thresholds

SCENE = {"run": {"duration": 0.02}}


class Viscous(wiperjax.AbstractFriction):
    """mu = static + slope |v|: nobody's law but this test's."""

    static: Any
    slope: Any

    def coefficient(self, speed):
        return self.static + self.slope * speed


class Rising(wiperjax.SteadyBelt):
    """V = speed + acceleration t: nobody's belt but this test's."""

    kind = ""
    acceleration: float = 0.0

    def velocity(self, time, piece):
        return self.speed + self.acceleration * time


@pytest.mark.long
def test_a_law_and_a_belt_from_outside():
    """The lip slips on the glass that draws away: friction is the law's, speed the belt's."""
    blade = wiperjax.Wiper(
        friction=Viscous(0.1, 0.5), belt=Rising(1.0, acceleration=2.0), support_damping=50.0
    )
    run = wiperjax.simulate(blade, 0.02)
    assert run.result == wiperjax.Result.FINISHED and run.attrs["friction"] == "Viscous"
    assert "mu_static" not in run.attrs and run.attrs["friction_slope"] == 0.5
    np.testing.assert_allclose(run.belt_velocity, 1.0 + 2.0 * run.time, rtol=1e-14)
    slip = run.velocity.sel(axis="x") - run.belt_velocity
    slides = np.asarray(np.abs(slip) > 1e-9) & np.asarray(run.normal_force > 0)
    assert slides.mean() > 0.9
    mu = -np.sign(slip) * run.friction_force / run.normal_force
    np.testing.assert_allclose(mu[slides], (0.1 + 0.5 * np.abs(slip))[slides], rtol=1e-9)


def test_a_statistic_from_outside(monkeypatch):
    """One entry of the schema and one number: it is stored; without the entry it is refused."""
    spec = parse_sweep(
        {
            "axes": {"attack_angle": {"values": [0.0, 10.0]}},
            "run": {"transient": 0.0, "window": 0.01},
        }
    )

    def evaluate(spec, index, *look):
        ones = np.ones(len(index))
        told = {"result": np.zeros(len(index), int), "velocity_rms": 0.0 * ones}
        told |= {
            "belt_speed_rms": ones,
            "stick_fraction": 0.0 * ones,
            "flight_fraction": 0.0 * ones,
        }
        told |= {"dominant_frequency": np.nan * ones, "wear": 3.0 * ones}
        return told

    with pytest.raises(ValueError, match="but wear are not"):
        evaluate_block(spec, np.arange(2), evaluate)
    monkeypatch.setitem(SCHEMA, "wear", Column("wear", "float64", "J/m", "work of friction"))
    stored, _ = evaluate_block(spec, np.arange(2), evaluate)
    np.testing.assert_array_equal(stored["wear"], [3.0, 3.0])


@pytest.mark.long
def test_a_wiper_with_the_law_of_its_own_numbers_is_the_same_motion():
    law = wiperjax.Stribeck(1.0, 0.3, 0.1, 1.0, 0.02)
    own, given = (
        wiperjax.solve(blade, 0.02, max_events=0)
        for blade in (wiperjax.Wiper(), wiperjax.Wiper(friction=law))
    )
    np.testing.assert_array_equal(own.final_position, given.final_position)


@pytest.mark.long
def test_coulomb_from_a_file_and_from_python_is_one_motion():
    of_file = scene.run_scene(
        parse_scene(SCENE | {"blade": {"friction": "coulomb", "mu_static": 0.6, "mu_minimum": 0.5}})
    )
    of_python = wiperjax.simulate(wiperjax.Wiper(friction=wiperjax.Coulomb(0.6, 0.5)), 0.02)
    # of a file there are levels gathered from its middle on, on which a step ends
    np.testing.assert_allclose(of_file.velocity, of_python.velocity, rtol=0, atol=1e-12)
    assert of_file.attrs["friction"] == "coulomb" and "stribeck_speed" not in of_file.attrs
    assert wiperjax.Coulomb(0.5).dynamic == 0.5


@pytest.mark.parametrize(
    "blade, text",
    [
        ({"friction": "oil"}, "blade.friction: must be 'stribeck', 'coulomb' or an import path"),
        (
            {"friction": "coulomb", "stribeck_speed": 0.1},
            "blade.stribeck_speed: must be left out with blade.friction = 'coulomb'",
        ),
        ({"friction": "coulomb", "mu_static": 0.2}, "blade.mu_minimum: must be at most mu_static"),
    ],
)
def test_a_law_that_cannot_be_meant_is_one_line(blade, text):
    with pytest.raises(ValueError, match=text):
        parse_scene(SCENE | {"blade": blade})


def test_a_number_of_the_law_that_does_not_count_is_refused():
    with pytest.raises(ValueError, match="mu_static must be left out with friction"):
        wiperjax.Wiper(friction=wiperjax.Coulomb(0.5), mu_static=0.8)


def test_the_law_is_part_of_the_digest_only_if_it_is_not_the_first():
    sweep = {"axes": {"normal_load": {"values": [10]}}, "run": {"transient": 0.1, "window": 0.1}}
    plain, stated, other = (
        parse_sweep(sweep | {"blade": blade}).digest()
        for blade in ({}, {"friction": "stribeck"}, {"friction": "coulomb"})
    )
    assert plain == stated != other


def test_every_kind_has_its_class_and_every_class_its_kind():
    assert set(belts.CLASSES) == set(kinds.BELTS) and set(friction.CLASSES) == set(kinds.FRICTIONS)
    assert set(runge_kutta.SOLVERS) == set(kinds.SOLVERS)
    for classes, names in ((belts.CLASSES, kinds.BELTS), (friction.CLASSES, kinds.FRICTIONS)):
        for kind, keys in names.items():
            assert set(keys) == {field.name for field in fields(classes[kind])}
            assert set(keys.values()) <= set(PARAMETERS)
    assert Classes().model_dump() == vars(Thresholds())


@pytest.mark.slow
def test_formulas_of_kinds_are_those_of_the_classes():
    """What pictures and classes of runs work out without jax is what the engine computes."""
    belt = {"belt_speed": -0.6, "belt_frequency": 5.0, "belt_ramp": 0.03, "belt_phase": 0.3}
    for kind, entry in kinds.BELT_KINDS.items():
        made = belts.CLASSES[kind](**{key: belt[name] for key, name in entry.keys.items()})
        time = jnp.linspace(0.0, 0.2, 20_001)[:-1]
        exact = jnp.sqrt(jnp.mean(made.velocity(time, made.first_piece(time)) ** 2))
        assert entry.of(belt) == pytest.approx(float(made.rms), rel=1e-14)
        assert entry.of(belt) == pytest.approx(float(exact), rel=1e-6)
    law = {"mu_static": 0.9, "mu_minimum": 0.2, "stribeck_speed": 0.07, "stribeck_shape": 1.5}
    law |= {"viscous_slope": 0.05}
    speed = np.linspace(0.0, 1.0, 50)
    for kind, entry in kinds.FRICTION_KINDS.items():
        made = friction.CLASSES[kind](**{key: law[name] for key, name in entry.keys.items()})
        computed = made.coefficient(jnp.asarray(speed))
        np.testing.assert_allclose(entry.of(law, speed), computed, rtol=1e-13)


def test_an_unknown_kind_of_belt_is_an_error_everywhere(squeal):
    with pytest.raises(ValueError, match="belt_kind must be one of steady, .*, but was 'bouncing'"):
        run_class.assess(squeal.assign_attrs(belt_kind="bouncing"))
    with pytest.raises(ValueError, match="must be a belt that reverses"):
        flip_time("bouncing", 0.6, 5.0, 0.0, 6e-3)


def test_the_deviation_of_integrals():
    none = dict.fromkeys(Totals._fields, 0.0)
    record = Totals(**none | {"output_integral": 4.0, "output_square_integral": 10.0})
    assert float(record.variance(2.0)) == 1.0 and float(record.deviation(2.0)) == 1.0


def test_numbers_of_a_given_law_are_found_by_the_names_of_files():
    blade = numbers.traceable(wiperjax.Wiper(friction=wiperjax.Coulomb(0.6, 0.5)), "mu_minimum")
    assert numbers.value(blade, "mu_static") == 0.6
    changed = numbers.replaced(blade, "mu_minimum", 0.4)
    assert float(changed.law.coefficient(1.0)) == pytest.approx(0.4, rel=1e-15)
    assert numbers.stored(blade, "mu_minimum")[0] == "mu_minimum"
    along = numbers.direction(blade, "mu_minimum")
    assert float(along.friction.dynamic) == 1.0 and float(along.friction.static) == 0.0
    assert float(along.normal_load) == 0.0 and along.gravity is None  # left out, as it is 0
    moved = numbers.moved(blade, along, 0.4)
    assert float(moved.friction.dynamic) == 0.4 and float(moved.friction.static) == 0.6
    with pytest.raises(ValueError, match="parameter must be a number of Wiper"):
        numbers.value(blade, "stribeck_speed")
