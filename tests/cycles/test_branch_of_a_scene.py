"""The command ``follow``: what of a scene's numbers it takes, and refuses."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from own_systems import DrivenBetweenWalls

from wiperjax.cycles.branch.from_scene import follow_scene
from wiperjax.datasets.branch_dataset import rest
from wiperjax.plots.style import caption
from wiperjax.specs.load import load_scene, parse_scene

SCENE = """
title = "squeal"
[blade]
attack_angle = 3
[belt]
speed = 0.3
[run]
duration = 0.05
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    return load_scene(tmp_path / "scene.toml")


def test_a_range_may_end_at_the_scenes_own_value(scene, monkeypatch):
    """3 degrees in radians and back are no 3 degrees: it was refused."""
    from wiperjax.cycles.branch import from_scene

    def found(system, **arguments):
        raise RuntimeError("far enough")

    monkeypatch.setattr(from_scene, "find_cycle", found)
    for low, high in ((0.0, 3.0), (3.0, 5.0)):
        with pytest.raises(RuntimeError, match="far enough"):
            follow_scene(scene, "attack_angle", low, high)


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        (4.0, 5.0, "range of attack_angle must hold the scene's own value 3, but was 4 to 5"),
        (5.0, 2.0, "range of attack_angle must go upwards, but was 5 to 2"),
        (3.0, 3.0, "range of attack_angle must go upwards, but was 3 to 3"),
    ],
)
def test_a_range_that_cannot_be_meant_is_refused(scene, low, high, message):
    with pytest.raises(ValueError, match=message):
        follow_scene(scene, "attack_angle", low, high)


def test_a_range_in_which_the_law_is_none_is_refused_before_any_work(monkeypatch):
    """mu_static below mu_minimum was a cycle, or a code 7: numbers were looked at one by one."""
    from wiperjax.cycles.branch import from_scene

    monkeypatch.delattr(from_scene, "find_cycle")
    law = {"friction": "coulomb", "mu_static": 0.5, "mu_minimum": 0.2}
    spec = parse_scene({"blade": law, "run": {"duration": 0.05}, "belt": {"speed": 0.3}})
    said = "range of mu_static must stay within what Coulomb may be, but at mu_static = 0.05: dyn"
    with pytest.raises(ValueError, match=said):
        follow_scene(spec, "mu_static", 0.05, 0.6)
    second = ("mu_minimum", 0.1, 0.4)
    with pytest.raises(ValueError, match=r"at mu_static = 0.3, mu_minimum = 0.4: dynamic must be"):
        follow_scene(spec, "mu_static", 0.3, 0.6, second=second)


def test_a_branch_tells_its_law_as_a_run_does(monkeypatch):
    """Headings named it of a run alone."""
    from wiperjax.cycles.branch import from_scene

    monkeypatch.setattr(from_scene, "find_cycle", lambda *_, **__: SimpleNamespace(found=0))
    monkeypatch.setattr(from_scene, "follow", lambda *_, **__: None)
    monkeypatch.setattr(from_scene, "branch_dataset", lambda branch: xr.Dataset())
    law = {"friction": "coulomb", "mu_static": 0.5, "mu_minimum": 0.2}
    belt = {"kind": "wiping", "amplitude": 0.3, "frequency": 2.0}
    spec = parse_scene({"blade": law, "run": {"duration": 0.05}, "belt": belt})
    found = follow_scene(spec, "mu_static", 0.4, 0.6)
    assert caption.parameters_text(found).endswith("wiping belt, coulomb friction")


@pytest.mark.parametrize(("step", "given"), [(None, {}), (0.2, {"step": 0.2})])
def test_the_step_is_that_of_the_curves_too(step, given, monkeypatch):
    """Curves of 200 points said that a longer step reaches farther, and took none."""
    from wiperjax.cycles.branch import from_scene

    taken = []
    monkeypatch.setattr(from_scene, "find_cycle", lambda *_, **__: SimpleNamespace(found=0))
    monkeypatch.setattr(from_scene, "follow", lambda *_, **words: taken.append(words))
    monkeypatch.setattr(from_scene, "branch_dataset", lambda branch: xr.Dataset())
    monkeypatch.setattr(from_scene, "follow_curves", lambda *_, **words: taken.append(words))
    belt = {"kind": "wiping", "amplitude": 0.3, "frequency": 2.0}
    spec = parse_scene({"run": {"duration": 0.05}, "belt": belt})
    follow_scene(spec, "normal_load", 10.0, 20.0, step, second=("attack_angle", -5.0, 5.0))
    assert taken == [given, given]


def test_what_is_finished_is_handed_on_before_what_takes_long_is_begun(scene, monkeypatch):
    """Curves and simulations take as long again: an error in them lost the branch."""
    from wiperjax.cycles.branch import from_scene

    cycle = SimpleNamespace(found=0, period=1e-3)
    monkeypatch.setattr(from_scene, "find_cycle", lambda *_, **__: cycle)
    monkeypatch.setattr(from_scene, "follow", lambda *_, **__: None)
    monkeypatch.setattr(from_scene, "branch_dataset", lambda _: xr.Dataset())
    monkeypatch.setattr(from_scene, "_with_steady_slip", lambda found, *_: found)

    def lost(*_, **__):
        raise RuntimeError("lost")

    kept = []

    def keep(found, lacks):
        kept.append((lacks, found.attrs["title"]))

    monkeypatch.setattr(from_scene, "up_and_down", lost)
    monkeypatch.setattr(from_scene, "follow_curves", lambda *_, **__: [])
    second = ("normal_load", 10.0, 20.0)
    asked = {"simulate": 3, "second": second, "keep": keep}
    with pytest.raises(RuntimeError, match="lost"):
        follow_scene(scene, "belt_speed", 0.2, 0.4, **asked)
    lacks = ["curves and simulations", "simulations"]
    assert kept == [(each, f"squeal (unfinished: without {each})") for each in lacks]
    kept.clear()
    monkeypatch.setattr(from_scene, "follow_curves", lost)
    with pytest.raises(RuntimeError, match="lost"):
        follow_scene(scene, "belt_speed", 0.2, 0.4, second=second, keep=keep)
    assert [lacks for lacks, _ in kept] == ["curves"]
    assert follow_scene(scene, "belt_speed", 0.2, 0.4, keep=keep).attrs["title"] == "squeal"
    assert len(kept) == 1


@pytest.mark.parametrize("name", ["period", "amplitude"])
def test_a_parameter_named_as_a_variable_of_branches_is_refused_before_any_work(name, monkeypatch):
    """Its values took the place of the cycles' own, without a word."""
    from wiperjax.cycles.branch import from_scene

    monkeypatch.delattr(from_scene, "find_cycle")
    scene = {"system": "odd_systems:Spelled", "run": {"duration": 10.0}}
    spec = parse_scene(scene | {"classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]}})
    for asked in ((name, 0.9, 1.1), ("mass", 0.9, 1.1, 0.03, 0, (name, 0.9, 1.1))):
        with pytest.raises(ValueError, match=f"no variable of a branch has, was '{name}': rename"):
            follow_scene(spec, *asked)


def test_a_parameter_named_as_an_attribute_of_branches_is_refused_before_any_work(monkeypatch):
    """Its value took the place of the name of what is varied, and no picture could be made."""
    from wiperjax.cycles.branch import from_scene

    monkeypatch.delattr(from_scene, "find_cycle")
    scene = {"system": "odd_systems:Overdriven", "run": {"duration": 10.0}}
    spec = parse_scene(scene | {"classes": {"squeal_band": [0.2, 1.0], "chatter_band": [0.0, 0.2]}})
    with pytest.raises(ValueError, match="no parameter of the name 'over', which is that of an"):
        follow_scene(spec, "mass", 0.9, 1.1)


def test_the_longest_step_of_a_scene_holds_for_its_cycles(tmp_path, monkeypatch):
    from wiperjax.cycles.branch import from_scene

    given = {}

    def found(system, **arguments):
        given.update(arguments)
        raise RuntimeError("far enough")

    monkeypatch.setattr(from_scene, "find_cycle", found)
    (tmp_path / "scene.toml").write_text(SCENE + "max_step = 1e-4\n")
    with pytest.raises(RuntimeError, match="far enough"):
        follow_scene(load_scene(tmp_path / "scene.toml"), "attack_angle", 0.0, 5.0)
    assert given["max_step"] == 1e-4


@pytest.mark.slow
def test_all_steady_slip_lies_beside_a_branch(monkeypatch):
    """That which leans farthest, joined over a jump from one equilibrium to another: a stable one
    at -33 degrees was not there, steady slip at -3 mm was.
    """
    from wiperjax.cycles.branch import from_scene

    angle = ("point", [-30.0], {"units": "degrees"})
    variables = {"attack_angle": angle, "maximum": ("point", [0.0], {"long_name": "x"})}
    branch = xr.Dataset(variables, attrs={"over": "attack_angle"})
    monkeypatch.setattr(from_scene, "find_cycle", lambda *_, **__: SimpleNamespace(found=0))
    monkeypatch.setattr(from_scene, "follow", lambda *_, **__: None)
    monkeypatch.setattr(from_scene, "branch_dataset", lambda _: branch)
    scene = {"blade": {"attack_angle": -30.0}, "belt": {"speed": 0.3}, "run": {"duration": 0.05}}
    found = follow_scene(parse_scene(scene), "attack_angle", -45.0, -2.0)
    angles, places, stable = rest(found)
    assert np.nanmax(np.abs(np.diff(places))) < 4e-4
    at = np.abs(angles + 33.0) < 0.11
    high, middle, low = np.flatnonzero(at)[np.argsort(-places[at])]
    assert places[[high, middle, low]] == pytest.approx([1.8e-4, -6.5e-4, -5.55e-3], abs=1e-5)
    assert stable[low] and not stable[high] and not stable[middle]


def test_a_scene_has_the_period_that_its_system_says(monkeypatch):
    """What is driven by more than a belt could be followed from Python alone."""
    from wiperjax.cycles.branch import from_scene

    def found(system, *, period, **arguments):
        raise RuntimeError(f"a period of {period(system):g} s")

    monkeypatch.setattr(from_scene, "find_cycle", found)
    scene = {"system": DrivenBetweenWalls, "parameters": {"drive_frequency": 4.0}}
    spec = parse_scene(scene | {"run": {"duration": 1.0}, "classes": {"quiet_velocity": 0.01}})
    with pytest.raises(RuntimeError, match=r"a period of 0.25 s"):
        follow_scene(spec, "play", 0.02, 0.04)
