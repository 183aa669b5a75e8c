"""A scene in the middle of a small map."""

import jax
import noises
import numpy as np
import pytest

from wiperjax.maps import around_scene
from wiperjax.maps.cells import batch
from wiperjax.maps.cells.linear import slips
from wiperjax.numerics.kept import Kept
from wiperjax.specs.load import load_scene, parse_scene
from wiperjax.vocabulary.thresholds import Thresholds

SCENES = sorted((noises.SWEEPS / "scenes").glob("*.toml"))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
@pytest.mark.parametrize("model", ["block", "lip"])
def test_blades_around_a_scene_are_like_it(path, model):
    scene = load_scene(path, model)
    spec = around_scene.around(scene)
    assert spec.model == model and spec.shape == (around_scene.SIDE,) * 2
    assert spec.run.transient + spec.run.window == scene.run.duration
    assert Thresholds(**spec.classes.model_dump()) == Thresholds(**scene.thresholds().model_dump())
    cells, known = spec.cells(np.arange(spec.size)), scene.parameters()
    assert cells.keys() == known.keys()
    for name, values in cells.items():
        if name in ("normal_load", "belt_speed"):
            assert np.ptp(values) == pytest.approx(2 * around_scene.SPREAD * known[name])
            assert np.mean(values) == pytest.approx(known[name])
            assert values[spec.size // 2] == pytest.approx(known[name], rel=1e-15)
        else:
            assert values == known[name]


def test_settings_that_a_scene_states_hold_around_it():
    """Its own budget of steps did not."""
    stated = {"max_steps": 50, "zeno_time": 1e-9, "rtol": 1e-7, "solver": "tsit5", "max_step": 1e-4}
    run = {"duration": 0.1, "sample_interval": 1e-4}
    spec = around_scene.around(parse_scene({"run": run | stated, "belt": {"speed": 0.3}}))
    assert {name: getattr(spec.settings, name) for name in stated} == stated
    plain = around_scene.around(parse_scene({"run": run, "belt": {"speed": 0.3}}))
    assert plain.settings.solver == "dopri8" and plain.settings.rtol == 1e-6


def test_costs_are_of_a_second_of_motion_and_leave_compiling_out(monkeypatch):
    scenes = {model: load_scene(SCENES[0], model) for model in ("block", "lip")}
    calls, spent = [], {"block": iter([3.0, 1, 2, 9, 4]), "lip": iter([5.0] * 5)}
    monkeypatch.setattr(around_scene, "_motions", lambda spec: lambda: calls.append(spec.model))
    monkeypatch.setattr(around_scene, "_spent", lambda run: (run(), next(spent[calls[-1]]))[1])
    found = around_scene.costs(scenes)
    motion = around_scene.SIDE**2 * scenes["lip"].run.duration
    assert found == pytest.approx({"block": 3 / motion, "lip": 5 / motion})
    assert calls == ["block", "lip"] * 6  # once to compile, then in turns


@pytest.mark.slow
def test_what_is_compiled_ahead_is_what_a_scene_is_named_and_costed_by(monkeypatch):
    """Neither other kinds of arguments nor another place of them, which would be compiled again."""
    compiled = []

    def note(event, duration, **about):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(about.get("fun_name"))

    jax.monitoring.register_event_duration_secs_listener(note)
    monkeypatch.setattr(batch, "compute", Kept(batch.outcomes))  # knows no program yet
    scene = load_scene(noises.SWEEPS / "scenes" / "quiet.toml", "block")
    spec = around_scene.around(scene)
    built, position, _ = batch.prepare(spec, np.arange(spec.size))
    slips(built.wiper, position[0].shape[-1])  # the small program beside it
    around_scene.ready([scene])
    compiled.clear()
    around_scene.middle(scene)
    around_scene._motions(spec)()
    assert len(batch.compute.found) == 1 and "jit(call)" not in compiled
