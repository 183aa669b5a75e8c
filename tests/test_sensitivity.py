"""Derivatives of a sweep: right where they are declared valid, and nothing where they are not."""

import numpy as np
import pytest

from wiperjax import cells, dataset, sensitivity
from wiperjax.spec import SpecError, parse_sweep

CELLS = 208
EXTREMES = ("normal_force_max", "gap_max", "impact_impulse_max")  # of a parabola through nodes


def blades(**extra):
    rng = np.random.default_rng(7)
    return parse_sweep(
        {
            "axes": {
                "attack_angle": {"values": sorted(rng.uniform(-40, 40, 16).tolist())},
                "belt_speed": {"values": sorted(rng.uniform(0.1, 0.9, 13).tolist())},
            },
            "blade": {"support_stiffness": 8000.0},  # flight on the leading side
            "run": {"transient": 0.01, "window": 0.02, "rtol": 1e-9, "samples": 128},
            "sensitivities": {"check": 1.0, "step": 1e-6, "settled": 10.0} | extra,
        },
        "test.toml",
    )


@pytest.fixture(scope="module")
def found():
    """Columns of a sweep, and the differences behind its agreement."""
    seen = {}
    check = sensitivity._check

    def spy(*arguments):
        seen["other"], seen["gaps"] = check(*arguments)
        return seen["other"], seen["gaps"]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensitivity, "_check", spy)
        columns = cells.evaluate(blades(), np.arange(CELLS))
    return columns, seen["gaps"]


@pytest.mark.slow
def test_derivatives_agree_with_central_differences(found):
    columns, gaps = found
    fine = columns["sensitivity_code"] == dataset.VALIDITY["fine"]
    assert fine.sum() >= 0.7 * CELLS
    assert np.any(columns["flight_fraction"][fine] > 0)
    assert np.sum(columns["stick_fraction"][fine] > 0.1) >= 50
    smooth = [gap for (outcome, _), gap in gaps.items() if outcome not in EXTREMES]
    worst = np.max(smooth, axis=0)[fine]
    assert np.median(worst) < 1e-6
    assert np.quantile(worst, 0.95) < 1e-4


@pytest.mark.slow
def test_what_does_not_hold_is_masked(found):
    columns, _ = found
    bad = columns["sensitivity_code"] != dataset.VALIDITY["fine"]
    names = [name for name in columns if name.startswith("d_")]
    assert len(names) == 3 * len(dataset.DIFFERENTIABLE)
    for name in names:
        assert np.all(np.isnan(columns[name][bad])), name
    assert np.all(np.isnan(columns["sensitivity_agreement"][bad]))
    assert np.all((columns["grazing_margin"] >= 0) & (columns["grazing_margin"] <= 1))


@pytest.mark.slow
def test_units_are_those_of_files(found):
    """Degrees: against the closed form of the belt's speed, and the map's own attributes."""
    columns, _ = found
    fine = columns["sensitivity_code"] == dataset.VALIDITY["fine"]
    np.testing.assert_allclose(columns["d_belt_speed_rms_d_belt_speed"][fine], 1.0)
    units = dataset.SCHEMA["d_velocity_rms_d_attack_angle"].attributes()["units"]
    assert units == "(m/s)/(degrees)"


def test_faults_are_one_line():
    with pytest.raises(SpecError, match="sensitivities.parameters: 'atack_angle': .*attack_angle"):
        blades(parameters=["atack_angle"])
    with pytest.raises(SpecError, match="sensitivities.parameters: must not name .* twice"):
        blades(parameters=["neck_stiffness", "neck_stiffness"])


def test_a_sweep_without_them_keeps_its_digest():
    spec = parse_sweep(
        {
            "axes": {"attack_angle": {"start": 0, "stop": 10, "num": 2}},
            "run": {"transient": 0.01, "window": 0.02},
        },
        "test.toml",
    )
    assert "sensitivities" not in spec.canonical()
    assert spec.with_sensitivities().digest() != spec.digest()
    again = parse_sweep(spec.with_sensitivities().document(), "again")
    assert again.sensitivities == spec.with_sensitivities().sensitivities
