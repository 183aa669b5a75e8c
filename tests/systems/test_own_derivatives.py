"""Derivatives in maps of systems of one's own: closed forms, central differences, refusals."""

import math

import own_systems
import pytest

import wiperjax
from wiperjax.specs.errors import SpecError
from wiperjax.store.whole import open_map
from wiperjax.vocabulary.codes import VALIDITY

PERIOD = 2 * math.pi  # s, of mass 1 on a stiffness of 1
SWEEP = {
    "system": "own_systems:Oscillator",
    "axes": {"steepness": {"values": [0.0, 3.0]}, "belt_speed": {"values": [0.2, 5.0]}},
    "parameters": {"load": 0.5},
    "run": {"transient": 3 * PERIOD, "window": 4 * PERIOD, "samples": 512},
    "classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]},
    "sensitivities": {
        "parameters": ["load", "stiffness", "mass", "tilt", "static", "belt_speed"],
        "check": 1.0,
    },
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The map from its file, for derivatives are stored under the names of the parameters."""
    path = tmp_path_factory.mktemp("maps") / "map.h5"
    wiperjax.sweep(SWEEP, path)
    return open_map(path).load()


@pytest.mark.long
def test_a_block_that_slips_under_constant_friction_has_those_of_its_closed_form(found):
    """Drawn by F = static * load it vibrates with F / sqrt(k m) about a rest position. The window
    of four periods is fixed: a stiffness that changes the period takes a quarter more off the
    mean square."""
    cell = found.sel(steepness=0.0, belt_speed=5.0)
    rms = 0.5 / math.sqrt(2)
    assert float(cell.velocity_rms) == pytest.approx(rms, rel=1e-7)
    exact = {
        "load": rms / 0.5,
        "static": rms,
        "stiffness": -0.75 * rms,
        "mass": -0.25 * rms,
        "tilt": -9.81 / math.sqrt(2) * math.pi / 180,  # of the gravity that a tilt adds
        "belt_speed": 0.0,
    }
    for name, value in exact.items():
        slope = float(cell[f"d_velocity_rms_d_{name}"])
        assert slope == pytest.approx(value, rel=1e-6, abs=1e-9), name
    assert float(cell.d_normal_force_mean_d_load) == pytest.approx(1.0)
    assert float(cell.d_belt_speed_rms_d_belt_speed) == 1.0


@pytest.mark.long
def test_stick_slip_agrees_with_central_differences(found):
    cell = found.sel(steepness=3.0, belt_speed=0.2)
    assert float(cell.stick_count) > 2
    assert int(cell.sensitivity_code) == VALIDITY["fine"]
    assert float(cell.sensitivity_agreement) < 1e-5
    assert abs(float(cell.d_stick_fraction_d_belt_speed)) > 0.1
    # of three periods the line is not known better
    assert float(cell.noise_period * cell.dominant_frequency) == pytest.approx(1.0, rel=1e-2)


@pytest.mark.long
def test_names_units_and_what_another_system_lacks(found):
    names = [str(name) for name in found if str(name).startswith("d_")]
    assert len(names) == 11 * 6
    assert not any("final" in name or "growth" in name or "linear" in name for name in names)
    assert found.d_velocity_rms_d_tilt.attrs["units"] == "(m/s)/(degrees)"
    assert found.d_normal_force_max_d_load.attrs["units"] == "(N)/(N)"
    assert found.d_velocity_rms_d_static.attrs["units"] == "(m/s)"
    assert found.d_velocity_rms_d_belt_speed.attrs["units"] == "(m/s)/(m/s)"


@pytest.mark.long
def test_a_system_made_of_the_wiper_is_checked_by_what_its_map_has():
    """It has no growth rate there, which a cell that was checked was asked for."""
    found = wiperjax.sweep(
        {
            "system": "soft_lip",
            "axes": {"normal_load": {"values": [20.0]}},
            "parameters": {"attack_angle": 10.0},
            "belt": {"kind": "steady", "speed": 0.2},
            "run": {"transient": 0.2, "window": 0.1},
            "sensitivities": {"parameters": ["normal_load", "contact_stiffness"], "check": 1.0},
        }
    ).isel(normal_load=0)
    assert int(found.sensitivity_code) == VALIDITY["fine"]
    assert float(found.sensitivity_agreement) < 1e-4
    assert abs(float(found.d_stick_fraction_d_contact_stiffness)) > 0


def test_left_out_they_are_by_the_axes():
    plain = {name: table for name, table in SWEEP.items() if name != "sensitivities"}
    asked = wiperjax.parse_sweep(plain).with_sensitivities()
    assert asked.sensitivities.parameters == ["steepness", "belt_speed"]
    stated = wiperjax.parse_sweep(plain | {"sensitivities": {}})
    assert stated.digest() == asked.digest()


@pytest.mark.long
def test_a_parameter_that_makes_other_fields_is_refused(monkeypatch):
    """A derivative in its place would miss what is made of it."""

    class Made(own_systems.Oscillator):
        weight: float = 0.0

        def __post_init__(self):
            self.weight = 9.81 * self.mass

    monkeypatch.setattr(own_systems, "Made", Made, raising=False)
    asked = {"system": "own_systems:Made", "sensitivities": {"parameters": ["mass"]}}
    with pytest.raises(ValueError, match="must not name 'mass': own_systems:Made makes other"):
        wiperjax.sweep(SWEEP | asked)
    fine = SWEEP | asked | {"sensitivities": {"parameters": ["mass"], "check": 2.0}}
    with pytest.raises(SpecError, match="sensitivities.check"):
        wiperjax.parse_sweep(fine)
