"""Pictures of maps of several starts: one start drawn, hatched where the class hangs on it."""

import matplotlib
import numpy as np
import pytest
from pictures import legends

matplotlib.use("Agg")

from wiperjax import plots
from wiperjax.cli import main
from wiperjax.cli.options import cuts
from wiperjax.datasets import map_dataset
from wiperjax.datasets.map_starts import from_start, hangs_on_start
from wiperjax.plots.catalogue import PICTURES
from wiperjax.plots.files import usual_of_file
from wiperjax.plots.preview import preview
from wiperjax.specs.load import parse_sweep
from wiperjax.store.whole import write_dataset
from wiperjax.vocabulary.codes import LABELS

QUIET, SQUEAL = LABELS["quiet"], LABELS["squeal"]


def a_map(**starts):
    """Speeds 1 to 4: quiet from the first start above 3, from the last above 1."""
    spec = parse_sweep(
        {
            "axes": {
                "attack_angle": {"values": [0, 5, 10]},
                "belt_speed": {"values": [1, 2, 3, 4]},
            },
            "run": {"transient": 0.1, "window": 0.1},
            "starts": starts,
        }
    )
    speed = np.tile([1, 2, 3, 4], 3)[:, None]
    lasts = np.linspace(3, 1, spec.starts.count)
    label = np.where(speed <= lasts, SQUEAL, QUIET)
    columns = {
        "label": label,
        "velocity_rms": speed * (label == SQUEAL),
        "class_set": np.bitwise_or.reduce(1 << label, axis=1),
        "growth_rate": np.full(12, -1.0),
    }
    if "random" in starts:
        shares = np.stack([(label == code).mean(axis=1) for code in LABELS.values()], axis=1)
        columns |= {"class_share": shares, "class_share_error": 0 * shares}
    return map_dataset.assemble(spec, columns)


def drawn(ax):
    """Codes of the cells of a plane, and how many runs of cells are hatched."""
    mesh, *hatched = ax.collections
    pieces = sum(len(h.get_paths()) for h in hatched if h.get_hatch())
    return mesh.get_array().reshape(4, 3).data, pieces


@pytest.mark.parametrize(("at", "quiet"), [(None, 1), ({"start": "up"}, 1), ({"start": "down"}, 3)])
def test_the_start_that_is_asked_for_is_drawn_and_what_hangs_on_it_hatched(at, quiet):
    ds = a_map(names=["up", "down"])
    (ax,) = plots.class_map(ds, at=at)
    codes, hatched = drawn(ax)
    assert (codes == QUIET).sum() == 3 * quiet
    assert hatched == 2  # rows of speed 2 and 3, neighbours as one piece
    words = [text.get_text() for legend in legends(ax.figure) for text in legend.get_texts()]
    assert "depends on the start (50.0%)" in words
    loud = plots.value_map(ds, "velocity_rms", at=at).collections[0].get_array()
    assert (loud == 0).sum() == 3 * quiet


@pytest.mark.parametrize("starts", [{"names": ["up", "down"]}, {"random": 9, "x": [0.0, 1e-3]}])
def test_of_cells_that_are_masked_nothing_hangs_on_the_start(starts):
    ds = a_map(**starts)
    (ax,) = plots.class_map(ds.where(ds["belt_speed"] > 2))
    codes, hatched = ax.collections[0].get_array().reshape(4, 3), drawn(ax)[1]
    assert np.ma.getmaskarray(codes)[:2].all() and hatched == 1  # speed 3
    words = [text.get_text() for legend in legends(ax.figure) for text in legend.get_texts()]
    assert "depends on the start (50.0%)" in words  # of speeds 3 and 4


def test_sets_of_classes_are_drawn_by_name():
    """Their bit masks were, on a scale of numbers: 3 is quiet and squeal."""
    ds = from_start(a_map(names=["up", "down"]))
    draw = PICTURES["map"]["value"].draw
    (ax,) = draw(ds, quantity="class_set")
    words = [text.get_text() for legend in legends(ax.figure) for text in legend.get_texts()]
    assert words[:3] == ["quiet (25.0%)", "squeal (25.0%)", "quiet + squeal (50.0%)"]
    for name in ("class_set", "label"):
        with pytest.raises(ValueError, match=f"name must be that of numbers, but {name} has names"):
            plots.value_map(ds, name)
    many = ds.assign(class_set=ds["class_set"].copy(data=np.reshape([-1, *range(3, 14)], (3, 4))))
    (ax,) = draw(many, quantity="class_set")
    words = [text.get_text() for legend in legends(ax.figure) for text in legend.get_texts()]
    assert "further sets (9.1%)" in words  # 3, 5, 6, 7, 9 ... 13 are nine sets of several
    assert "chattering (9.1%)" in words  # 4 is one alone


def test_of_random_starts_the_most_frequent_class_is_drawn():
    ds = a_map(random=9, x=[0.0, 1e-3])
    (ax,) = plots.class_map(ds)
    assert (drawn(ax)[0] == QUIET).sum() == 6
    (ax,) = plots.class_map(ds, at={"start": 8})
    assert (drawn(ax)[0] == QUIET).sum() == 9


def test_shares_of_random_starts_are_stacked_over_an_axis():
    ax = plots.class_shares(a_map(random=9, x=[0.0, 1e-3]))
    quiet, squeal = (band.get_data() for band in ax.patches)  # a step for each cell, not between
    # of 9 starts all squeal at 1, 5 or 4 up to 2, one at 3, none at 4
    np.testing.assert_allclose(quiet.values, [0, 4 / 9, 8 / 9, 1])
    np.testing.assert_allclose(quiet.edges, [0.5, 1.5, 2.5, 3.5, 4.5])
    assert (squeal.values == 1).all() and ax.get_ylim() == (0, 1) and ax.get_xlim() == (0.5, 4.5)
    with pytest.raises(ValueError, match="this map holds no shares"):
        plots.class_shares(a_map(names=["up"]))


@pytest.mark.parametrize("starts", [{"names": ["up", "down"]}, {"random": 9, "x": [0.0, 1e-3]}])
def test_starts_are_no_axis_of_the_usual_picture(starts, tmp_path):
    """Random ones were: over one axis `plot` without -p took the page of two, and failed."""
    path, ds = tmp_path / "map.h5", a_map(**starts)
    for chosen, name in (({}, "overview"), ({"attack_angle": [0]}, "line")):
        write_dataset(ds.isel(chosen), path, force=True)
        assert usual_of_file(path) == name
    write_dataset(ds.isel(attack_angle=[0], belt_speed=[0]), path, force=True)
    with pytest.raises(ValueError, match="has one cell"):
        usual_of_file(path)


def test_the_commands_take_a_start_by_name(tmp_path, capsys):
    path, picture = tmp_path / "map.h5", tmp_path / "down.png"
    write_dataset(a_map(names=["up", "down"]), path)
    plot = ["plot", str(path), "-p", "classes", "-o", str(picture), "--at"]
    assert main([*plot, "start=down"]) == 0 and picture.exists()
    assert main([*plot, "start=sideways", "--force"]) != 0
    assert "'sideways' is not in this map's starts; it holds up, down" in capsys.readouterr().err
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "start up: quiet 25.0%, squeal 75.0%" in said
    assert "the class depends on the start in 6 of 12 cells" in said
    assert cuts(["start=3", "belt_speed=2"]) == {"start": 3.0, "belt_speed": 2.0}
    with pytest.raises(ValueError, match="AXIS=NUMBER"):
        cuts(["belt_speed=down"])


def test_numbers_say_which_start_they_are_of():
    ds = a_map(names=["up", "down"])
    ax = plots.value_map(ds, "velocity_rms", at={"start": "down"})
    assert "start: down (" in ax.figure.get_suptitle()
    some = a_map(names=["up", "down"])[["label", "velocity_rms"]]  # without its class_set
    said = plots.value_map(some, "velocity_rms").figure.get_suptitle()
    assert "start: up (" in said


def test_a_random_start_is_asked_for_by_its_number_also_in_a_part_of_them():
    ds = a_map(random=9, x=[0.0, 1e-3])
    part = ds.isel(start=slice(3, 9))
    for start in (3, 8):
        codes = [drawn(plots.class_map(some, at={"start": start})[0])[0] for some in (part, ds)]
        np.testing.assert_array_equal(*codes)
    said = plots.value_map(part, "velocity_rms", at={"start": 3}).figure.get_suptitle()
    assert "start: number 3 of 9 random ones" in said
    assert "6 of 9 random" in plots.value_map(part, "velocity_rms").figure.get_suptitle()
    with pytest.raises(ValueError, match="one of this map's starts, 3 to 8, was 2"):
        plots.class_map(part, at={"start": 2})


@pytest.mark.parametrize(
    ("starts", "kept", "share"),
    [
        ({"names": ["up", "down", "at_rest"]}, [0, 1], "25.0%"),  # lasts 3, 2, 1
        ({"names": ["up", "down", "at_rest"]}, [0], ""),
        ({"random": 9, "x": [0.0, 1e-3]}, slice(4, 9), "25.0%"),  # lasts 2 to 1
    ],
)
def test_in_a_part_of_the_starts_a_class_hangs_on_those_alone(starts, kept, share):
    part = a_map(**starts).isel(start=kept)
    figure = plots.class_map(part)[0].figure
    words = [text.get_text() for legend in legends(figure) for text in legend.get_texts()]
    hangs = [text for text in words if text.startswith("depends")]
    assert hangs == ([f"depends on the start ({share})"] if share else [])
    assert int(hangs_on_start(part).sum()) == (3 if share else 0)


@pytest.mark.parametrize("starts", [{"names": ["up", "down"]}, {"random": 9, "x": [0.0, 1e-3]}])
def test_one_start_that_was_taken_by_hand_is_said(starts):
    ds = a_map(**starts)
    last = ds["start"].values[-1]
    one = plots.value_map(ds.sel(start=last), "velocity_rms")
    same = plots.value_map(ds, "velocity_rms", at={"start": last})
    assert one.figure.get_suptitle() == same.figure.get_suptitle()
    assert "several" not in one.figure.get_suptitle()
    with pytest.raises(ValueError, match="start must be left out: each cell of this map has"):
        plots.class_map(ds.sel(start=last), at={"start": "left"})


def test_a_number_is_no_name_of_a_start():
    with pytest.raises(ValueError, match="'3' is not in this map's starts; it holds up, down"):
        plots.class_map(a_map(names=["up", "down"]), at={"start": 3})


def test_a_preview_says_which_start_it_shows():
    """Of one start nothing did, and of several none was told from the most frequent class."""
    ds = a_map(random=3, x=[0.0, 1e-3])
    said = "of 3 starts each; start: 3 random ones, the most frequent class"
    assert repr(preview(ds)).endswith(said)
    assert repr(preview(ds.sel(start=2))).endswith("belt_speed); start: number 2 of 3 random ones")
