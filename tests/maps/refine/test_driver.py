"""A refined map as a file: what is in it, killed and gone on with, and what is refused."""

import json
import shutil
import signal
import weakref
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray as xr
from border_maps import AXES, border_spec, coarse_map, engine, refined
from stub_sweep import rewritten

import wiperjax
from wiperjax.cli import main
from wiperjax.machine.files import StoreError
from wiperjax.machine.provenance import RUN_ATTRIBUTES
from wiperjax.maps import block, computing, driver
from wiperjax.maps.refine.grid import Grid
from wiperjax.maps.refine.points import Points
from wiperjax.maps.refine.search import Search
from wiperjax.maps.verify import verify
from wiperjax.specs.errors import Fault, SpecError
from wiperjax.specs.load import load_sweep
from wiperjax.specs.refine import BESIDE_AXES, Refine, check
from wiperjax.store import checksums
from wiperjax.store.levels import is_refined, read_levels
from wiperjax.store.whole import borders, open_map, write_dataset
from wiperjax.vocabulary import cf
from wiperjax.vocabulary.schema import SCHEMA


def disc(x, y):
    return np.where((x - 0.45) ** 2 + (y - 0.5) ** 2 < 0.3**2, 700.0, 300.0)


DISC = engine(disc)


def same_borders(one, other):
    for ds in (one, other):
        for name in RUN_ATTRIBUTES:
            ds.attrs.pop(name, None)
    xr.testing.assert_identical(one, other)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # what is dropped
def test_ctrl_c_that_python_drops_between_blocks_is_heard(tmp_path, monkeypatch):
    """The search went on to its end."""
    path, find = tmp_path / "map.h5", Search.run
    coarse_map(path, DISC)

    def pressed(search, answers):
        dropped = weakref.WeakSet()  # any object
        ended = weakref.ref(dropped, lambda _: signal.raise_signal(signal.SIGINT))
        del dropped
        find(search, answers)
        del ended

    monkeypatch.setattr(Search, "run", pressed)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with pytest.raises(KeyboardInterrupt, match="go on with the same command"):
            refined(path, DISC, levels=3)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, handler)


def test_a_map_behind_a_link_or_read_only_is_not_replaced(tmp_path, monkeypatch):
    """The link became a map with borders, and the map that it named had none."""
    path, link = tmp_path / "map.h5", tmp_path / "link.h5"
    coarse_map(path, DISC)
    link.symlink_to(path)
    with pytest.raises(StoreError, match=r"link\.h5: cannot be written: it is a link to .*map\.h5"):
        refined(link, DISC, levels=1)
    monkeypatch.setattr("os.access", lambda path, mode, **_: False)  # as for all but root
    with pytest.raises(StoreError, match=r"map\.h5: cannot be written: it is read-only"):
        refined(path, DISC, levels=1)
    assert link.is_symlink()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["link.h5", "map.h5"]


@pytest.mark.slow
def test_the_root_stays_the_map_and_levels_are_grids(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    with open_map(path) as ds:
        before = ds.load()
    found = refined(path, DISC, levels=3)
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
    with open_map(path, check=True) as ds:
        xr.testing.assert_identical(ds.load(), before)
    same_borders(found, borders(path))
    for level in range(4):
        ds = open_map(path, level=level)
        assert ds.sizes == {"attack_angle": 8 * 2**level + 1, "belt_speed": 8 * 2**level + 1}
        done = ds.computed.values == 1
        assert done[:: 2**level, :: 2**level].all() and (level == 0 or not done.all())
        x = (ds.attack_angle + 40) / 80
        y = (ds.belt_speed - 0.1) / 0.8
        truth = disc(*np.meshgrid(x, y, indexing="ij"))
        np.testing.assert_array_equal(ds.dominant_frequency.values[done], truth[done])
        assert np.isnan(ds.dominant_frequency.values[~done]).all()
        assert (ds.label.values[~done] == -1).all()
        np.testing.assert_array_equal(ds.attack_angle[:: 2**level], before.attack_angle)
    names = {"label", "computed", "window_factor"}
    assert set(open_map(path, ["label"], level=2).data_vars) == names
    assert set(open_map(path, ["label", "computed"], level=2).data_vars) == names
    with pytest.raises(StoreError, match=r"map.h5: 'labl' is not in this file; did you mean label"):
        open_map(path, ["labl"], level=2)
    with pytest.raises(StoreError, match="has no level 4; its levels are 0 to 3"):
        open_map(path, level=4)


def test_the_netcdf_library_reads_groups_and_gathered_lists(tmp_path):
    netcdf = pytest.importorskip("netCDF4")
    path = tmp_path / "map.h5"
    coarse_map(path, DISC, axes=tuple(AXES)[:2])
    refined(path, DISC, levels=2)
    ds = open_map(path, level=2)
    with netcdf.Dataset(path) as file:
        file.set_auto_mask(False)
        group = file["level_2"]
        cell = group["cell"]
        assert cell.compress == "attack_angle_fine normal_load_fine"
        assert cell.dimensions == ("cell",)
        shape = tuple(group.dimensions[name].size for name in cell.compress.split())
        assert shape == (33, 21)
        places = np.unravel_index(cell[...], shape)
        np.testing.assert_array_equal(ds.computed.values[places], 1)
        np.testing.assert_array_equal(ds.label.values[places], group["label"][...])
        assert group["attack_angle_fine"].units == "degrees"
        assert file["borders"]["kind"].flag_meanings.startswith("smooth jump")
    tree = xr.open_datatree(path, engine="h5netcdf")
    assert {"level_2", "borders"} <= set(tree.children)
    tree.close()


@pytest.mark.slow
def test_killed_it_goes_on_where_it_was_and_ends_the_same(tmp_path):
    path, other = tmp_path / "map.h5", tmp_path / "other.h5"
    coarse_map(path, DISC)
    shutil.copy(path, other)
    content, calls = path.read_bytes(), []

    def counted(spec, index, finer=1, room=None):
        calls.append(spec.digest())
        return DISC(spec, index)

    whole = refined(other, counted, levels=5)
    every = list(calls)
    assert len(every) > 5
    for last in (0, 3, 3):
        calls.clear()

        def dying(spec, index, finer=1, room=None, last=last):
            if len(calls) > last:
                raise KeyboardInterrupt
            return counted(spec, index)

        with pytest.raises(KeyboardInterrupt, match="go on with the same command"):
            refined(path, dying, levels=5)
        assert path.read_bytes() == content  # readable at all times
    calls.clear()
    same_borders(refined(path, counted, levels=5), whole)
    assert set(calls) < set(every) and len(calls) < len(every)
    for one, two in zip(read_levels(path), read_levels(other), strict=True):
        np.testing.assert_array_equal(one.index, two.index)
        assert all(np.array_equal(v, two.columns[n], True) for n, v in one.columns.items())
    assert not (tmp_path / "map.h5.refine").exists()
    calls.clear()
    refined(path, counted, levels=5)  # done already
    assert not calls


def test_a_map_whose_borders_asked_for_no_point_has_levels_too(tmp_path):
    """It was said to be not refined."""
    path, quiet = tmp_path / "map.h5", engine(lambda x, y: np.full(x.shape, 300.0))
    coarse_map(path, quiet)
    assert refined(path, quiet, levels=3, probes=0).attrs["simulations"] == 0
    for level in range(4):
        fine = open_map(path, level=level)
        assert fine.label.shape == (8 * 2**level + 1,) * 2
        assert int((fine.label >= 0).sum()) == int(fine.computed.sum()) == 81  # the map's cells
    assert verify(path, cells=3, evaluate=quiet).points == 0
    with pytest.raises(StoreError, match="has no level 4; its levels are 0 to 3"):
        open_map(path, level=4)
    refined(path, quiet, levels=2, probes=0)  # no points would be lost
    assert open_map(path, level=2).label.shape == (33, 33)


@pytest.mark.slow
def test_finer_levels_use_the_points_that_are_there(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    refined(path, DISC, levels=3)
    points = sum(len(level.index) for level in read_levels(path))
    seen = []

    def counted(spec, index, finer=1, room=None):
        seen.append(len(index))
        return DISC(spec, index)

    found = refined(path, counted, levels=6)
    assert found.attrs["simulations"] > sum(seen) == found.attrs["fresh_simulations"]
    assert sum(len(level.index) for level in read_levels(path)) == points + sum(seen)
    with pytest.raises(StoreError, match="is refined to level 6"):
        refined(path, DISC, levels=2)


def test_a_map_that_is_replaced_meanwhile_gets_no_borders_of_another(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    content = []

    def replacing(spec, index, *look):
        if not content:
            driver.sweep(border_spec(title="new"), path, evaluate=DISC, force=True, progress=False)
            content.append(path.read_bytes())
        return DISC(spec, index)

    with pytest.raises(StoreError, match=r"map.h5: was changed or replaced meanwhile.*again$"):
        refined(path, replacing, levels=2)
    assert path.read_bytes() == content[0]
    assert (tmp_path / "map.h5.refine").is_dir()  # of the same sweep: they are not computed again

    def none(spec, index, *look):
        raise AssertionError("was computed before")

    refined(path, none, levels=2)
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]


def test_points_are_those_of_a_sweep_that_has_them(tmp_path):
    """The same blocks: a point of the finest level is, bit for bit, a cell of a finer sweep."""
    path = tmp_path / "map.h5"
    spec = coarse_map(path, DISC)
    refined(path, DISC, levels=2)
    fine = border_spec()
    axes = {n: a.model_copy(update={"num": 4 * (a.count - 1) + 1}) for n, a in fine.axes.items()}
    fine = fine.model_copy(update={"axes": axes})
    level = next(one for one in read_levels(path) if one.number == 2)
    columns, _ = block.evaluate_block(fine, level.index, DISC)
    for name, values in level.columns.items():
        np.testing.assert_array_equal(values, columns[name])
    assert spec.digest() != fine.digest()


def damage(path, name):
    """One byte of the numbers of a variable."""
    with open(path, "rb") as file:
        pieces = checksums._read(file).pieces
    place = next(piece.start for piece in pieces if piece.variable == name)
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    with pytest.raises(StoreError, match=f"is damaged: {name}"):
        open_map(path, check=True)


@pytest.mark.long
@pytest.mark.parametrize("name", ["velocity_rms", "belt_speed"])
def test_a_map_is_mended_with_its_borders_and_its_levels(tmp_path, name):
    path, other = tmp_path / "map.h5", tmp_path / "other.h5"
    spec = coarse_map(path, DISC)
    refined(path, DISC, levels=3)
    shutil.copy(path, other)
    damage(path, name)
    driver.sweep(spec, path, evaluate=DISC, resume=True, progress=False).close()
    with open_map(path, check=True) as ds, open_map(other) as whole:
        assert ds.equals(whole)
    xr.testing.assert_identical(borders(path), borders(other))
    for level in range(4):
        xr.testing.assert_equal(open_map(path, level=level), open_map(other, level=level))
    found = refined(path, None, levels=3)  # done already
    assert found.sizes["border"] > 0


@pytest.mark.parametrize("name", ["level_3/velocity_rms", "borders/kind"])
def test_borders_that_are_damaged_are_lost_with_a_word(tmp_path, caplog, name):
    path = tmp_path / "map.h5"
    spec = coarse_map(path, DISC)
    refined(path, DISC, levels=3)
    damage(path, name)
    driver.sweep(spec, path, evaluate=DISC, resume=True, progress=False).close()
    with open_map(path, check=True) as ds, driver.sweep(spec, evaluate=DISC) as whole:
        assert ds.equals(whole)
    assert not is_refined(path)
    assert "borders and finer points are damaged, and are not kept: refine it again" in caplog.text


def test_verify_computes_points_of_the_levels_again(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    refined(path, DISC, levels=3)
    report = verify(path, cells=40, evaluate=DISC)
    assert report.passed and report.points == 40
    with rewritten(path) as file:
        file["level_3/velocity_rms"][...] *= 1 + 1e-6
    report = verify(path, cells=40, evaluate=DISC)
    assert not report.passed and report.largest["velocity_rms"] == pytest.approx(1e-6, rel=1e-3)


def test_verify_finds_axes_of_the_levels_changed(tmp_path):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    refined(path, DISC, levels=2)
    with rewritten(path) as file:
        file["level_1/belt_speed_fine"][3] *= 1.01
    with pytest.raises(StoreError, match="what it says of belt_speed of level 1 is not that of"):
        verify(path, cells=3, evaluate=DISC)


BAD = {
    "refine.levels: must be a whole number in": {"levels": 0},
    "refine.levels: must be given, or resolution": {},
    "refine.on: unknown name 'lable'; did you mean label": {"levels": 2, "on": "lable"},
    # of what every map may hold: neither events nor several starts
    "refine.on: must be label, mechanism, band, settled, result, frequency_told, or NAME=NUMBER": {
        "levels": 2,
        "on": "nothing",
    },
    "refine.on: must be velocity_rms=NUMBER": {"levels": 2, "on": "velocity_rms"},
    "refine.on: must be a variable of names, or NAME=NUMBER": {"levels": 2, "on": "label=3"},
    "refine.box.belt_sped: unknown key; did you mean 'belt_speed'": {
        "levels": 2,
        "box": {"belt_sped": (0, 1)},
    },
    r"refine.box.attack_angle: must be \[low, high\] inside \[-40, 40\]": {
        "levels": 2,
        "box": {"attack_angle": (-50, 5)},
    },
    "refine.resolution: must need at most 20 halvings": {"resolution": 1e-12},
    "refine.resolution: .* spacing; 4.94066e-324 needs 1071": {"resolution": 5e-324},
    "refine.levels: must leave axes.attack_angle at most 1000000 values": {"levels": 20},
    "refine.on: must be of what finer points have too; event_count is": {
        "levels": 2,
        "on": "event_count=3",
    },
    "refine.lengthen: must be left out with on = 'stick_count=2.5': a longer": {
        "levels": 2,
        "on": "stick_count=2.5",
        "lengthen": 4,
    },
    "refine.levls: unknown key; did you mean 'levels'": {"levls": 2},
    "refine.max_cells: must be a whole number": {"levels": 2, "max_cells": 0},
}


@pytest.mark.long
@pytest.mark.parametrize("line", BAD)
def test_what_cannot_be_meant_is_one_clear_line(tmp_path, line):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    with pytest.raises(SpecError, match=line) as error:
        refined(path, DISC, **BAD[line])
    assert "\n" not in str(error.value)
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("map.h5", "--levels or --resolution must say how fine; the map's file does not"),
        ("map.h5 --on lable", "refine.on: unknown name 'lable'; did you mean label?"),
        ("map.h5 --box mass=1:2", "refine.box.mass: unknown key; must be one of attack_angle, "),
        ("run.h5", "run.h5: is not a map that a sweep made"),
    ],
)
def test_what_is_wrong_is_told_before_that_it_says_not_how_fine(
    words, line, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    coarse_map(tmp_path / "map.h5", DISC)
    write_dataset(xr.Dataset({"position": ("time", np.zeros(3))}), "run.h5")
    assert main(["refine", *words.split()]) == 1
    assert capsys.readouterr().err.startswith(f"wiperjax: {line}")


def test_an_axis_that_is_called_as_a_variable_of_borders_is_refused(tmp_path):
    """A system of one's own may have such a parameter; its places were written over."""
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    found, fine = refined(path, DISC, levels=2), open_map(path, level=1)
    with h5py.File(path) as file:
        stored = [name for name in file["level_1"] if not name.endswith("_fine")]
    held = {*found.variables, *found.dims, *fine.variables, *stored} - {*AXES, *SCHEMA}
    assert held == BESIDE_AXES
    own = SimpleNamespace(starts=None, axes_values=lambda: {"level": np.arange(3.0)})
    with pytest.raises(Fault, match="'level' is an axis, and a variable of borders or levels"):
        check(Refine(levels=2), own)


def test_levels_whose_points_have_no_number_are_refused_before_anything_is_computed():
    """Beyond 63 bits numpy counts on with negative ones, and borders would lie anywhere."""
    names = ("attack_angle", "normal_load", "belt_speed", "support_stiffness")
    axes = {n: {"values": [1.0, 2.0, 3.0, 4.0]} for n in names}
    document = {"axes": axes, "run": {"transient": 0.2, "window": 0.2}}
    spec = wiperjax.parse_sweep(document | {"refine": {"levels": 13}})
    assert 4 * (3 * 2.0**13 + 1) ** 4 < 2.0**63 < 4 * (3 * 2.0**14 + 1) ** 4
    last = np.array(Grid(spec.axes, 13).shape) - 1
    assert Grid(spec.axes, 13).flat(last) * 4 > 0
    must = "at most 13 levels, for points of this map to have numbers of 63 bits; was 14"
    with pytest.raises(SpecError, match=f"refine.levels: must be {must}"):
        wiperjax.parse_sweep(document | {"refine": {"levels": 14}})
    with pytest.raises(SpecError, match=f"refine.resolution: must need {must}"):
        wiperjax.parse_sweep(document | {"refine": {"resolution": 2.5e-5}})


def test_a_resolution_finer_than_floating_point_is_refused(tmp_path):
    axes = {"belt_speed": {"start": 0.3, "stop": 0.3 + 4e-15, "num": 3}}
    spec = wiperjax.parse_sweep({"axes": axes, "run": {"transient": 0, "window": 0.1}})

    def flat(spec, index, finer=1, room=None):
        columns = DISC(border_spec(), index)
        return columns | {"dominant_frequency": np.where(index > 0, 700.0, 300.0)}

    driver.sweep(spec, tmp_path / "map.h5", evaluate=flat, progress=False).close()
    with pytest.raises(SpecError, match="that floating point tells apart, but was 12"):
        refined(tmp_path / "map.h5", flat, levels=12)


def test_maps_that_cannot_be_refined(tmp_path, monkeypatch):
    path = tmp_path / "map.h5"
    with pytest.raises(StoreError, match="does not exist"):
        refined(path, DISC, levels=2)
    coarse_map(path, DISC)
    with pytest.raises(StoreError, match="has no borders; 'wiperjax refine' locates"):
        borders(path)
    with pytest.raises(StoreError, match="has no level 1; it is not refined"):
        open_map(path, level=1)
    made = block.made_by(border_spec())
    monkeypatch.setattr(computing, "made_by", lambda spec: made | {"jax": "0.1"})
    with pytest.raises(StoreError, match=r"was made otherwise \(jax was .*, now 0.1\)"):
        refined(path, DISC, levels=2)


def test_a_sweep_file_says_how_and_its_map_is_the_same(tmp_path, capsys):
    text = """
[axes]
attack_angle = { start = -40, stop = 40, num = 9 }
belt_speed = { start = 0.1, stop = 0.9, num = 9 }
[run]
transient = 0.2
window = 0.2
"""
    plain, with_table = tmp_path / "plain.toml", tmp_path / "refine.toml"
    plain.write_text(text)
    with_table.write_text(text + "[refine]\nlevels = 4\nbox.attack_angle = [-10, 20]\n")
    spec = load_sweep(with_table)
    assert spec.digest() == load_sweep(plain).digest()
    assert spec.refine is not None and spec.refine.box == {"attack_angle": (-10, 20)}
    with_table.write_text(text + "[refine]\nlevels = 4\nbox.attack_angle = [-50, 20]\n")
    with pytest.raises(SpecError, match="refine.box.attack_angle: must be .low, high. inside"):
        load_sweep(with_table)
    assert main(["refine", str(tmp_path / "map.h5"), "--levels", "2"]) == 1
    assert "does not exist" in capsys.readouterr().err
    coarse_map(tmp_path / "map.h5", DISC)
    assert main(["refine", str(tmp_path / "map.h5"), "--levels", "2", "--box", "speed"]) == 1
    assert "--box must be AXIS=LOW:HIGH" in capsys.readouterr().err
    assert main(["refine", str(tmp_path / "map.h5")]) == 1
    assert "--levels or --resolution must say how fine" in capsys.readouterr().err


def test_info_says_what_was_found(tmp_path, capsys):
    path = tmp_path / "map.h5"
    coarse_map(path, DISC)
    found = refined(path, DISC, levels=5)
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert f"borders of label: {found.sizes['border']} points" in said
    assert "attack_angle 1/256" in said and "probes in cubes without a border: 0 of" in said
    assert f"{found.attrs['simulations']} simulations beside 81 of the map" in said
    with h5py.File(path, "r+") as file:
        del file["borders"].attrs["on"]
    assert main(["info", str(path)]) == 1  # a traceback
    assert "map.h5: its borders have no attribute 'on'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def of_disc(tmp_path_factory):
    """A refined map; never changed."""
    path = tmp_path_factory.mktemp("disc") / "map.h5"
    coarse_map(path, DISC)
    refined(path, DISC, levels=3)
    return path


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("probes_wrong", np.nan, "probes_wrong, which must be a whole number >= 0, but was nan"),
        ("simulations", -5, "simulations, which must be a whole number >= 0, but was -5"),
        ("cubes_with_border", 1e6, "cubes_with_border 1e+06, of "),
        ("border_probes_wrong", 1e6, "border_probes_wrong 1e+06, of "),
        ("smooth_points", 99, " points, but "),
        ("bracket_share_belt_speed", 0.0, "bracket_share_belt_speed, which must lie inside (0, 1]"),
        ("full_grid_cells", "many", "full_grid_cells, which must be a finite number > 0, but was"),
        ("budget_spent", [0, 1], "budget_spent array([0, 1]), which is not one number"),
    ],
)
def test_what_no_search_says_of_its_borders_is_not_told_as_if_it_were(
    name, value, line, of_disc, tmp_path, capsys
):
    """`info` said `nan of 500`, `-5 simulations`, `1/inf`; or words of numpy without the file."""
    path = shutil.copy(of_disc, tmp_path / "map.h5")
    with h5py.File(path, "r+") as file:
        file["borders"].attrs[name] = value
    assert main(["info", str(path)]) == 1
    said = capsys.readouterr().err
    assert f"{path}: its borders have " in said and line in said and "Traceback" not in said


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("side_high", 9, "side_high 9, which is none of quiet, squeal, "),
        ("axis", 5, "axis 5, which is none of attack_angle, belt_speed"),
        ("attack_angle", np.nan, "attack_angle, which must be a finite number, but was nan"),
        ("bracket_share", 2.0, "bracket_share, which must lie inside (0, 1], but was 2"),
        ("place", -39.0, "beside its bracket of "),
    ],
)
def test_points_that_lie_on_no_border_are_not_drawn(name, value, line, of_disc, tmp_path, capsys):
    """Each was left out, or joined with others, without a word."""
    path = shutil.copy(of_disc, tmp_path / "map.h5")
    with h5py.File(path, "r+") as file:
        group = file["borders"]
        first = int(np.flatnonzero(group["axis"][...] == 0)[0])
        group["attack_angle" if name == "place" else name][first] = value
    for command in ("info", "plot"):
        assert main([command, str(path)]) == 1
        said = capsys.readouterr().err
        assert f"{path}: its borders have " in said and line in said


def test_points_can_be_sent_to_workers():
    import pickle

    spec = border_spec()
    grid = Grid(spec.axes, 3)
    points = Points(spec, grid, np.arange(5), 4)
    sent = pickle.loads(pickle.dumps(points))
    assert sent.digest() == points.digest() and sent.run.window == 4 * spec.run.window
    np.testing.assert_array_equal(
        sent.cells(np.arange(5))["belt_speed"], points.cells(np.arange(5))["belt_speed"]
    )
    assert json.loads(points.canonical())["factor"] == 4
    assert cf.flags({"a": 1})["flag_meanings"] == "a"
