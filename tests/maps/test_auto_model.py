"""`model = "auto"`: which rung a probe chooses, and that a map keeps to what was chosen for it."""

import json

import numpy as np
import pytest
from stub_sweep import BLOCK, block_files, data_of, evaluate, make_spec

from wiperjax.cli import main
from wiperjax.maps import driver
from wiperjax.maps.auto_model import as_chosen_for, on_chosen_model, probe_cells
from wiperjax.maps.refine.driver import refine
from wiperjax.maps.verify import verify
from wiperjax.specs.load import SpecError, load_scene, parse_sweep
from wiperjax.store.whole import open_map
from wiperjax.vocabulary.codes import RESULTS


def auto(**tables):
    """The sweep of 385 cells of the stub, which asks for a model by `auto`."""
    return parse_sweep(make_spec().document() | {"model": "auto"} | tables)


def engine(louder, asked=None):
    """A stub in which a model's motions are so much louder than the lip's; `asked` gets the model
    of each call."""

    def evaluated(spec, index, *look):
        if asked is not None:
            asked.append(spec.model)
        columns = evaluate(spec, index, *look)
        factor = 1 + louder.get(spec.model, 0.0)
        return columns | {
            "velocity_rms": factor * columns["velocity_rms"],
            "signal": factor * columns["signal"],
        }

    return evaluated


def sweep(spec, path, evaluate, **options):
    given = {"block": BLOCK, "progress": False} | options
    with driver.sweep(spec, path, evaluate=evaluate, **given) as ds:
        return ds.load()


@pytest.mark.parametrize(
    ("louder", "model"),
    [
        ({}, "block"),
        ({"block": 0.09, "bar": 0.2}, "block"),
        ({"block": 0.11, "bar": 0.09}, "bar"),
        ({"block": 0.11, "bar": np.nan}, "lip"),
    ],
)
def test_the_poorest_model_within_the_tolerances_is_chosen(louder, model):
    spec = on_chosen_model(auto(), evaluate=engine(louder))
    assert spec.model == model
    assert spec.digest() == auto().on(model).digest() != auto().digest()
    probe = json.loads(spec.choice["model_probe"])
    assert probe["cells"] == len(probe_cells(auto()))
    for name in ("block", "bar"):
        assert (probe[name]["differing"] == 0) == (louder.get(name, 0) <= 0.1), name
    assert probe["block"]["amplitude"] == pytest.approx(louder.get("block", 0.0), abs=1e-9)
    assert spec.choice["model_choice"].startswith(f"{model}: ")


def test_one_cell_of_a_probe_that_differs_is_enough():
    cells = probe_cells(auto())

    def one_flies(spec, index, *look):
        columns = evaluate(spec, index, *look)
        columns["result"][-1], columns["velocity_rms"][-1] = RESULTS["finished"], 0.1
        columns["flight_fraction"][-1] = 1e-3 * (spec.model == "lip")
        return columns

    chosen = on_chosen_model(auto(), evaluate=one_flies)
    assert chosen.model == "lip"
    failed = json.loads(chosen.choice["model_probe"])["failed"]
    assert failed > 0
    said = f"block is unlike the lip in 1 of {len(cells) - failed} cells (1 by another name)"
    assert said in chosen.choice["model_choice"]


def test_a_model_that_is_held_where_it_would_fly_is_not_the_lip():
    """Its numbers may be near those of the lip there, by chance."""

    def flies(spec, index, *look):
        columns = evaluate(spec, index, *look)
        columns["result"] = np.full(len(index), RESULTS["finished"])
        return columns | {"flight_fraction": np.full(len(index), 0.02 * (spec.model != "block"))}

    chosen = on_chosen_model(auto(), evaluate=flies)
    probe = json.loads(chosen.choice["model_probe"])
    assert chosen.model == "lip" and probe["bar"]["renamed"] == probe["cells"]


@pytest.mark.parametrize(("failing", "model"), [(0.3, "block"), (0.6, "lip")])
def test_a_cell_in_which_the_lip_fails_is_no_evidence(failing, model):
    """The poorer rungs tell something there, or fail as well: both say nothing of them."""

    def fails(spec, index, *look):
        columns = evaluate(spec, index, *look)
        cells = np.arange(len(index)) < failing * len(index)
        lost = cells & ((spec.model == "lip") | (np.arange(len(index)) % 2 == 0))
        columns["result"] = np.where(lost, RESULTS["non_finite"], RESULTS["finished"])
        return columns

    chosen = on_chosen_model(auto(), evaluate=fails)
    words, probe = chosen.choice["model_choice"], json.loads(chosen.choice["model_probe"])
    assert chosen.model == model and probe["failed"] == np.ceil(failing * probe["cells"])
    told = probe["cells"] - probe["failed"]
    if model == "lip":
        assert f"lip: it fails in {probe['failed']} of {probe['cells']} cells" in words
    else:
        start = f"as the lip in all {told} cells of a probe (without {probe['failed']} in which"
        assert start in words and probe["block"]["renamed"] == 0


def test_no_agreement_is_stated_of_what_nothing_was_compared_of():
    def silent(spec, index, *look):
        columns = evaluate(spec, index, *look)
        columns["result"] = np.full(len(index), RESULTS["finished"])
        loud = {"velocity_rms", "signal", "stick_fraction", "flight_fraction"}
        return {name: 0 * x if name in loud else x for name, x in columns.items()}

    chosen = on_chosen_model(auto(), evaluate=silent)
    count = len(probe_cells(auto()))
    words = f"block: as the lip in all {count} cells of a probe ({count} quiet), so in "
    words += "91.1 % of the map or more, 95 % sure"
    assert chosen.choice["model_choice"] == words
    probe = json.loads(chosen.choice["model_probe"])
    assert probe["quiet"] == count and probe["block"]["amplitude"] is None


def test_a_model_that_cannot_stand_for_the_blade_is_not_probed():
    def never(spec, index, *look):
        raise AssertionError("nothing is left to compare")

    spec = on_chosen_model(auto(blade={"hinge_mass": 1e-3}), evaluate=never)
    assert spec.model == "lip"
    assert "hinge_mass" in spec.choice["model_choice"]
    assert json.loads(spec.choice["model_probe"])["cells"] == 0


def test_a_probe_is_spread_over_the_map_and_the_same_every_time():
    spec = auto()
    cells = probe_cells(spec)
    assert len(cells) == 32 and (np.diff(cells) > 0).all()
    assert len(probe_cells(make_spec(3, 2, 11))) == 32  # points that share a cell counted twice
    np.testing.assert_array_equal(cells, probe_cells(auto(title="another title")))
    assert not np.array_equal(cells, probe_cells(auto(blade={"tip_mass": 0.011})))
    for places, count in zip(np.unravel_index(cells, spec.shape), spec.shape, strict=True):
        assert set(3 * places // count) == {0, 1, 2}  # each third of each axis
    large = make_spec(100, 40, 100)
    assert len(probe_cells(large)) == 128
    np.testing.assert_array_equal(probe_cells(make_spec(5, 2, 3)), np.arange(30))


def test_the_map_is_that_of_the_model_and_says_why(tmp_path):
    louder = engine({"block": 0.5, "bar": 0.05})
    ds = data_of(sweep(auto(), tmp_path / "auto.h5", louder))
    named = data_of(sweep(auto().on("bar"), tmp_path / "bar.h5", louder))
    assert ds.attrs.pop("model_choice").startswith("bar: as the lip in all ")
    assert json.loads(ds.attrs.pop("model_probe"))["block"]["differing"] > 0
    assert ds.identical(named)
    assert parse_sweep(json.loads(ds.attrs["specification"])).model == "bar"


@pytest.mark.slow
def test_what_was_chosen_stays_chosen(tmp_path):
    """Resumed, mended, verified and refined, a map is of its model: nothing is probed again."""
    path, begun = tmp_path / "map.h5", engine({"block": 0.5, "bar": 0.05})

    def killed(spec, index, *look):
        if spec.model == "bar" and len(index) == BLOCK and index[0] >= 2 * BLOCK:
            raise KeyboardInterrupt
        return begun(spec, index, *look)

    with pytest.raises(KeyboardInterrupt):
        sweep(auto(), path, killed)
    assert len(block_files(path)) == 2
    assert as_chosen_for(path, auto()).model == "bar"
    assert as_chosen_for(path, auto().on("lip")).model == "lip"  # a person's word counts
    asked = []
    otherwise = engine({"bar": 0.05}, asked)  # a probe now would say: block
    found = sweep(auto(), path, otherwise, resume=True)
    assert set(asked) == {"bar"} and found.model == "bar"
    whole = sweep(auto(), tmp_path / "whole.h5", begun)
    assert data_of(found).identical(data_of(whole))
    asked.clear()
    assert sweep(auto(), path, otherwise, resume=True).model == "bar" and not asked
    assert verify(path, cells=40, evaluate=otherwise).identical
    refine(path, levels=1, evaluate=otherwise, max_cells=50, progress=False)
    assert set(asked) == {"bar"}
    with open_map(path) as ds:
        assert ds.attrs["model_choice"].startswith("bar: ")


@pytest.mark.parametrize(
    ("said", "given"),
    [
        (
            "model: must be a model by name with [starts], was 'auto'",
            {"starts": {"names": ["at_rest"]}},
        ),
        ("model: must be 'lip' with sensitivities, was 'auto'", {"sensitivities": {}}),
        (
            "model: must be left out with system = 'flutter': it has no rungs",
            {"system": "flutter", "axes": {"load": {"values": [0.1, 0.2]}}},
        ),
    ],
)
def test_what_cannot_have_a_model_chosen(said, given):
    with pytest.raises(SpecError) as error:
        auto(**given)
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.long
def test_the_command_says_which_and_goes_on_with_it(tmp_path, monkeypatch, capsys):
    stub = engine({"block": 0.5, "bar": 0.05})
    monkeypatch.setattr("wiperjax.maps.computing.engine", lambda: (stub, {}))
    file, path = tmp_path / "s.toml", tmp_path / "m.h5"
    axes = "[axes]\nattack_angle = { start = -40, stop = 40, num = 5 }\n"
    file.write_text(axes + 'belt_speed = { start = 0.1, stop = 1, num = 4 }\n'
                    '[run]\ntransient = 0\nwindow = 0.2\nsamples = 512\n')  # fmt: skip
    words = ["sweep", str(file), "-o", str(path), "--model", "auto"]
    assert main(words) == 0
    said = "model    bar: as the lip in all 19 cells of a probe (without 1 in which the lip fails, "
    said += "4 quiet, frequency within 0.01 %, amplitude within 5 %); block is unlike the lip in "
    assert said in capsys.readouterr().out
    drawn = path.with_suffix(".png").stat().st_mtime_ns
    path.unlink()  # as if it had been killed: the picture is that of this sweep
    monkeypatch.setattr("wiperjax.maps.computing.engine", lambda: (engine({}), {}))
    assert main([*words, "--resume"]) == 1  # the probe now says: block
    assert main([*words, "--force"]) == 0 and "model    block: " in capsys.readouterr().out
    monkeypatch.setattr("wiperjax.maps.computing.engine", lambda: (stub, {}))
    assert main([*words, "--resume"]) == 0 and "model    block: " in capsys.readouterr().out
    assert path.with_suffix(".png").stat().st_mtime_ns > drawn


@pytest.mark.long
def test_a_scene_has_no_cells_to_probe(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[run]\nduration = 0.1\n")
    with pytest.raises(SpecError, match="model: must be 'block', 'bar' or 'lip', was 'auto'"):
        load_scene(path, "auto")
