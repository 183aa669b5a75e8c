"""The scenes: class, mechanism, frequency band; and what removes each noise, before and after.

Remedies are those of `sweeps/remedies/`: the first cell of each file is its scene. All cells of one
kind of belt are computed together.
"""

import numpy as np
import pytest
from noises import SWEEPS, Cases, changed, first_cell, parameters, remedies

# scene -> (class, mechanism, frequency [Hz] and its tolerance), remedies as (parameter, value)
STEADY = {
    "squeal": ("squeal", "stick_slip", 780.8, 0.5),
    "squeal_slip": ("squeal", "self_excited_slip", 680.4, 2.0),
    "chatter": ("chattering", "stick_slip", 39.7, 0.3),
    "chatter_flight": ("chattering", "flight", 28.2, 0.5),
    "quiet": ("quiet", "none", None, None),
    "quiet_wet": ("quiet", "none", None, None),
}
TRAPEZOID = {
    "reversal": ("reversal", "reversal_pulse", None, None),
    "reversal_impulse": ("reversal", "reversal_impulse", None, None),
}
WIPING = {
    "squeal_reversal": ("squeal", "stick_slip", 757.0, 80.0),
    "reversal_sine": ("reversal", "reversal_pulse", None, None),
}
REMEDIES = {
    "squeal": (("support_damping", 10), ("mu_static", 0.36)),
    "squeal_slip": (("support_damping", 8), ("mu_static", 0.5)),
    "squeal_reversal": (("support_damping", 40), ("mu_static", 0.32)),
    "chatter": (("support_damping", 3), ("mu_static", 0.6)),
    "chatter_flight": (("support_damping", 8), ("belt_speed", 0.4)),
    "reversal": (("support_stiffness", 5000), ("lip_length", 3e-3)),
    "reversal_impulse": (("support_stiffness", 5000), ("shoulder_angle", 16)),
    "reversal_sine": (("support_stiffness", 5000), ("lip_length", 3e-3)),
}
OTHERS = {  # further cells that a claim rests on
    "chatter mirrored": ("chatter", {"attack_angle": 30}),
    "chatter_flight mirrored": ("chatter_flight", {"attack_angle": 35}),
    "chatter weak remedy": ("chatter", {"support_damping": 2}),
    "squeal_slip less damping": ("squeal_slip", {"support_damping": 3}),
    "reversal damped": ("reversal", {"support_damping": 20}),
}


def evaluated(scenes, run_of):
    """Cells of `scenes`, their remedies and the other cases, keyed by name."""
    cases = {}
    for name in scenes:
        cases[name] = parameters(name)
        for parameter, value in REMEDIES.get(name, ()):
            cases[f"{name}: {parameter}"] = changed(cases[name], **{parameter: value})
    for name, (scene, values) in OTHERS.items():
        if scene in scenes:
            cases[name] = changed(parameters(scene), **values)
    return Cases(remedies(run_of), cases).evaluate()


@pytest.fixture(scope="module")
def cells(steady_scenes):
    turning = evaluated(WIPING, "reversal_sine") | evaluated(TRAPEZOID, "reversal")
    return steady_scenes | turning


SCENES = STEADY | WIPING | TRAPEZOID


def test_every_scene_is_here():
    assert {path.stem for path in (SWEEPS / "scenes").glob("*.toml")} == set(SCENES)
    assert {path.stem for path in (SWEEPS / "remedies").glob("*.toml")} == set(REMEDIES)


@pytest.mark.parametrize("name", REMEDIES)
def test_remedies_start_from_their_scene_and_reach_what_is_claimed(name):
    spec = remedies(name)
    assert first_cell(spec) == pytest.approx(parameters(name), rel=1e-12)
    for parameter, value in REMEDIES[name]:
        values = spec.axes_values()[parameter]
        assert np.any(np.isclose(values, value, rtol=1e-12)) and values[0] != value
    together = [other for other in REMEDIES if remedies(other).belt.kind == spec.belt.kind]
    for other in map(remedies, together):  # one run serves all cells of a kind of belt
        assert (other.run, other.classes) == (spec.run, spec.classes)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_scene_has_its_class(cells, name):
    label, mechanism, frequency, tolerance = SCENES[name]
    cell = cells[name]
    assert (cell["label"], cell["mechanism"]) == (label, mechanism)
    if frequency is not None:
        assert cell["dominant_frequency"] == pytest.approx(frequency, abs=tolerance)
    if name in STEADY and name != "chatter_flight":
        assert cell["settled"] == "yes"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter"), [(n, p) for n, pairs in REMEDIES.items() for p, _ in pairs]
)
def test_remedy_makes_it_quiet(cells, name, parameter):
    assert cells[f"{name}: {parameter}"]["label"] == "quiet"


@pytest.mark.slow
def test_squeal_around_the_turn_is_gone_also_where_the_class_does_not_look(cells):
    """The class judges the strokes; a blade that only turns sticks once or twice at each of two."""
    assert cells["squeal_reversal"]["stick_count"] > 100
    for parameter, _ in REMEDIES["squeal_reversal"]:
        assert cells[f"squeal_reversal: {parameter}"]["stick_count"] <= 4


@pytest.mark.slow
def test_squeal_with_and_without_stick(cells):
    assert 0.4 < cells["squeal"]["stick_fraction"] < 0.5
    slip = cells["squeal_slip"]
    assert slip["stick_count"] == 0 and slip["stick_fraction"] == 0
    # close to the glass's speed all the same, and grown from steady slip that is unstable
    assert 0.4 < slip["velocity_rms"] / 0.21 < 1 / np.sqrt(2) and slip["growth_rate"] > 0
    assert cells["squeal_slip less damping"]["mechanism"] == "stick_slip"


@pytest.mark.slow
def test_chattering_is_on_the_leading_side_only(cells):
    chatter, flight = cells["chatter"], cells["chatter_flight"]
    assert chatter["flight_fraction"] == 0 and chatter["lift_off_count"] == 0
    assert 0.75 < chatter["stick_fraction"] < 0.81
    assert 0.05 < flight["flight_fraction"] < 0.08 and flight["impact_count"] > 50
    assert flight["gap_max"] == pytest.approx(0.48e-3, rel=0.05)
    mirrored = cells["chatter mirrored"]
    assert mirrored["label"] != "chattering" and mirrored["band"] == "high"
    assert cells["chatter_flight mirrored"]["label"] == "quiet"


@pytest.mark.slow
def test_a_remedy_too_small_moves_the_noise(cells):
    """SCENES.md 2: c = 2 turns the rattle into a whistle of 1307 Hz."""
    weak = cells["chatter weak remedy"]
    assert (weak["label"], weak["band"]) == ("other", "high")
    assert weak["dominant_frequency"] == pytest.approx(1307, abs=5)


@pytest.mark.slow
def test_reversal_pulses(cells):
    """SCENES.md 4: a quasi-static pulse of 15 N/m; with a soft neck impacts besides."""

    def ratio(cell):
        return cell["normal_force_max_reversal"] / cell["normal_force_mean_stroke"]

    for name, low, high in (
        ("reversal", 4.0, 4.3),
        ("reversal_sine", 4.2, 4.8),
        ("reversal_impulse", 19, 24),
    ):
        cell = cells[name]
        assert low < ratio(cell) < high
        assert cell["normal_force_max_reversal"] == pytest.approx(15.0, abs=0.1)
        # the strokes are silent: the vibration belongs to the reversal
        assert cell["velocity_rms_stroke"] < 0.01 * cell["belt_speed_rms"]
        assert cell["vibration_reversal"] > 10 * cell["vibration_stroke"]
        for parameter, _ in REMEDIES[name]:
            assert ratio(cells[f"{name}: {parameter}"]) < 2.0
    assert cells["reversal"]["impact_count"] == 0
    blow = cells["reversal_impulse"]
    assert blow["impact_count"] >= 30 and blow["impact_impulse_reversal"] == pytest.approx(
        7.5e-4, rel=0.05
    )
    # damping is no remedy for a slow pulse
    assert cells["reversal damped"]["label"] == "reversal"
    assert ratio(cells["reversal damped"]) > 0.98 * ratio(cells["reversal"])
