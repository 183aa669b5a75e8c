"""Finished files that are damaged: every change is noticed and named, and a map is mended.

The engine is the stub of `stub_sweep`, which costs nothing.
"""

import gc
import json
import random
import shutil

import h5py
import numpy as np
import pytest
import stub_sweep as stub
import xarray as xr
from stub_sweep import BLOCK, make_spec

from wiperjax.cli import main
from wiperjax.explorer.explored import open_explored
from wiperjax.machine.files import StoreError
from wiperjax.maps import block as work
from wiperjax.maps import computing
from wiperjax.maps.verify import verify
from wiperjax.plots import plot_file
from wiperjax.store import checksums, manifest, map_file
from wiperjax.store.checksums import REST
from wiperjax.store.manifest import parts_of
from wiperjax.store.mending import _boxes, salvage
from wiperjax.store.whole import damages, open_map, sound, write_dataset

COMMAND = "wiperjax sweep a.toml -o map.h5"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished map of eight blocks, in chunks of 16 cells; never changed."""
    path = tmp_path_factory.mktemp("whole") / "map.h5"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_file, "SLAB_CELLS", 40)
        patch.setattr(map_file, "CHUNK_CELLS", 16)
        stub.run(make_spec(), path, command=COMMAND)
    return path


@pytest.fixture
def path(whole, tmp_path):
    """A copy of the map, to be damaged."""
    return shutil.copy(whole, tmp_path / "map.h5")


def places(path):
    """Variable -> first bytes of its chunks, or of its numbers; `REST` -> a byte of the superblock,
    of a tree of chunks, of a text and of what is between.
    """
    found = {}
    with h5py.File(path) as file:
        for name in file:
            found[name] = [start for start, _ in checksums._runs(file[name])]
    content = path.read_bytes()
    found[REST] = [9, content.index(b"TREE") + 5, content.index(b"wiperjax sweep a.toml") + 4]
    return found


def flip(path, place, bit=3):
    content = bytearray(path.read_bytes())
    content[place] ^= 1 << bit
    path.write_bytes(content)


def mended(path, spec=None, **options):
    """Blocks that `--resume` computes to make a map whole, which is checked against an undamaged
    one.
    """
    calls, spec = [], spec or make_spec()

    def counting(spec, index, finer=1, room=None):
        calls.append(int(index[0]) // BLOCK)
        return stub.evaluate(spec, index, finer, room)

    stub.run(spec, path, resume=True, evaluate=counting, **options)
    stub.assert_same_map(path, spec)
    assert sound(path)
    return sorted(set(calls))


# --- noticed --------------------------------------------------------------------------------------


def random_faults(content, rng, flips, ranges):
    """Single flipped bits, and ranges of 8 to 4096 bytes that become zeros."""
    for _ in range(flips):
        place = rng.randrange(len(content))
        yield place, bytes([content[place] ^ (1 << rng.randrange(8))])
    for _ in range(ranges):
        place = rng.randrange(len(content))
        yield place, bytes(min(int(2 ** rng.uniform(3, 12)), len(content) - place))


def test_every_flipped_bit_and_every_zeroed_range_is_named(whole, tmp_path):
    content, damaged = whole.read_bytes(), tmp_path / "map.h5"
    named = set()
    for place, new in random_faults(content, random.Random(1), 250, 60):
        changed = content[:place] + new + content[place + len(new) :]
        damaged.write_bytes(changed)
        if changed == content:  # zeros that were zeros
            assert sound(damaged)
            continue
        try:
            found = sound(damaged)  # False: the record is not found any more
            assert not found
            named.add("no record")
        except StoreError as error:
            assert str(error).startswith(f"{damaged}: is damaged: ") and "\n" not in str(error)
            named.add(str(error).split(": ")[2].split(";")[0])
    assert len(named) > 20 and REST in named


def test_who_compares_a_map_first_names_the_variable(path, capsys):
    with open_map(path, check=True) as ds:
        expected = ds.load()
    assert main(["info", str(path)]) == 0
    assert "checksums: the file is as it was written" in capsys.readouterr().out
    shutil.copy(path, whole := path.with_name("whole.h5"))
    flip(path, places(path)["belt_speed"][0])  # HDF5 reads it without a word
    with open_map(path) as ds:
        assert not ds.belt_speed.equals(expected.belt_speed)
    for look in (
        lambda: open_map(path, check=True),
        lambda: verify(path, evaluate=stub.evaluate),
        lambda: plot_file(path, path.with_suffix(".png")),  # both drew what they read
        lambda: open_explored(path),
    ):
        with pytest.raises(StoreError, match=r"map.h5: is damaged: belt_speed; .* --resume"):
            look()
    curves = {"picture": "classes", "curves": path}
    with pytest.raises(StoreError, match="map.h5: is damaged"):
        plot_file(whole, path.with_suffix(".png"), **curves)
    others = ["export", "-o", "run.csv"], ["listen", "-o", "run.wav"], ["modes", "-o", "modes.h5"]
    for command, *output in (["info"], *others):
        assert main([command, str(path), *output]) == 1
        assert "is damaged: belt_speed" in capsys.readouterr().err


@pytest.mark.parametrize("cut", [1, 40, 3000])
def test_a_file_that_lost_its_end_has_no_checksums(path, cut):
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(StoreError, match="has no checksums"):
        open_map(path, check=True)


@pytest.mark.long
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_file_that_hdf5_cannot_read_is_one_line(path):
    """What reads it complained again when it was let go, a traceback of eight lines."""
    with h5py.File(path) as file:
        header = h5py.h5o.get_info(file.id).addr
    flip(path, header)
    with pytest.raises(StoreError, match="is not a readable map or run: .*object header"):
        open_map(path)
    gc.collect()


def test_what_another_program_took_from_a_map_is_named(path, capsys):
    """Tracebacks."""
    with h5py.File(path, "r+") as file:
        del file["band"]
        file.attrs["class_squeal_band"] = "high"
    assert main(["info", str(path)]) == 0
    must = "must lie inside [0, 1000000] Hz, but was 'high'"
    note = f"note: its attribute class_squeal_band {must}: another program changed it\n"
    assert capsys.readouterr().err == note  # among the other attributes, as if it were right
    assert main(["plot", str(path)]) == 1
    said = capsys.readouterr().err
    assert said == f"wiperjax: {path}: its attribute class_squeal_band {must}\n"
    with h5py.File(path, "r+") as file:
        del file.attrs["class_squeal_band"], file["label"].attrs["flag_meanings"]
    assert main(["plot", str(path)]) == 1
    said = "wiperjax: label must have names of its codes, but has no flag_meanings\n"
    assert capsys.readouterr().err == said


def test_what_is_missed_in_a_file_that_was_changed_is_one_line(path, capsys):
    """A traceback; in a file as we wrote it, it still is one."""
    with open_map(path) as ds:
        changed = ds.load().assign(event_count=ds["steps"])
    changed.to_netcdf(path, engine="h5netcdf")
    assert main(["info", str(path)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"wiperjax: {path}: cannot be told as it is: event (")
    with open(path, "r+b") as file:
        checksums.add(file)
    with pytest.raises(KeyError):
        main(["info", str(path)])


@pytest.mark.parametrize("command", ["info", "plot"])
def test_numbers_that_hdf5_cannot_unpack_name_their_file(command, path, capsys):
    """`Can't synchronously read data (filter returned failure during read)`, of whatever file."""
    starts = places(path)["label"]
    with open(path, "r+b") as file:
        file.truncate(checksums.length(path))  # as another program leaves it
        for start in starts:
            file.seek(start)
            file.write(b"\0\0\0\0")
    assert main([command, str(path)]) == 1
    assert capsys.readouterr().err.startswith(f"wiperjax: {path}: cannot be read: ")


def test_info_says_where_a_part_was_taken(path, capsys):
    part = path.with_name("part.h5")
    with open_map(path) as ds:
        ds.isel(normal_load=0).load().to_netcdf(part, engine="h5netcdf")
    assert main(["info", str(part)]) == 0
    assert "\ncut at normal_load " in capsys.readouterr().out


def test_a_program_that_writes_into_the_file_removes_the_record(path):
    with h5py.File(path, "r+") as file:
        file.attrs["title"] = "mine"
    assert damages(path) is None


def test_a_run_has_checksums_too(tmp_path, whole):
    path = tmp_path / "run.h5"
    with open_map(whole) as ds:
        write_dataset(ds.load(), path)
    assert sound(path)
    flip(path, places(path)["steps"][0])
    with pytest.raises(StoreError, match="is damaged: steps"):
        sound(path)


# --- mended ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(3))
def test_a_damaged_header_is_mended_without_computing(path, number):
    flip(path, places(path)[REST][number])
    assert mended(path) == []


def test_only_the_blocks_of_a_damaged_chunk_are_computed_again(path, caplog):
    flip(path, places(path)["stick_fraction"][-1] + 5)
    assert mended(path) == [7]
    assert "is damaged: stick_fraction; it is mended" in caplog.text


def test_a_damaged_coordinate_is_that_of_the_sweep_again(path):
    flip(path, places(path)["normal_load"][0])
    assert mended(path) == []


def test_all_at_once(path):
    found = places(path)
    for name in ("steps", "label", "belt_speed", REST):
        flip(path, found[name][0] + 2)
    assert 0 < len(mended(path)) < 8


def test_mending_that_is_killed_goes_on(path):
    class Stop(Exception):
        pass

    def stopping(*_):
        raise Stop

    content = places(path)
    flip(path, content["steps"][0] + 5)
    damaged = path.read_bytes()
    with pytest.raises(Stop):
        stub.run(make_spec(), path, resume=True, evaluate=stopping)
    assert path.read_bytes() == damaged and parts_of(path).is_dir()
    assert 0 < len(mended(path)) < 8


def test_a_map_that_lost_its_end_is_said_to_and_nothing_is_computed(path):
    content = path.read_bytes()[:-3000]
    path.write_bytes(content)
    with pytest.raises(StoreError, match="has no checksums .*: its end is lost.*--force replaces"):
        stub.run(make_spec(), path, resume=True)
    assert path.read_bytes() == content and not parts_of(path).exists()


@pytest.mark.parametrize("damaged", [True, False])
def test_the_map_of_another_sweep_is_left_alone_and_what_differs_is_said(
    path, damaged, monkeypatch
):
    if damaged:
        flip(path, places(path)["steps"][0] + 5)
    content = path.read_bytes()
    for spec, differs in (
        (make_spec(speeds=10), r"axes.belt_speed was 11 values .*, now 10 values from .*"),
        (make_spec(rtol=1e-7), "run.rtol was 1e-06, now 1e-07"),
    ):
        said = (
            rf"map.h5: was made otherwise than this sweep \({differs}\); use --force to replace it"
        )
        with pytest.raises(StoreError, match=said):
            stub.run(spec, path, resume=True)
    made = work.made_by(make_spec())
    monkeypatch.setattr(computing, "made_by", lambda spec: made | {"jax": "0.1"})
    with pytest.raises(StoreError, match=r"than this sweep \(jax was \S+, now 0.1\)"):
        stub.run(make_spec(), path, resume=True)
    assert path.read_bytes() == content and not parts_of(path).exists()


def test_a_run_is_no_map_to_go_on_with(tmp_path):
    path = tmp_path / "run.h5"
    write_dataset(xr.Dataset({"position": ("time", np.zeros(3))}), path)
    with pytest.raises(StoreError, match="run.h5: is not a map that a sweep made"):
        stub.run(make_spec(), path, resume=True)


def test_damaged_checksums_are_refused_and_replaced_by_force(path):
    flip(path, path.stat().st_size - 100)
    with pytest.raises(StoreError, match="its record of checksums is damaged; .* --force"):
        stub.run(make_spec(), path, resume=True)
    stub.run(make_spec(), path, force=True)
    assert sound(path)


@pytest.mark.parametrize("shape", [(13,), (3, 4), (2, 3, 4), (1, 5, 1, 2)])
def test_boxes_are_a_run_of_cells(shape):
    numbers = np.arange(np.prod(shape)).reshape(shape)
    for start in range(numbers.size):
        for stop in range(start + 1, numbers.size + 1):
            run = np.concatenate([numbers[box].ravel() for box in _boxes(shape, start, stop)])
            np.testing.assert_array_equal(run, np.arange(start, stop))


# --- blocks and manifest --------------------------------------------------------------------------


def forged(path, change):
    """Changes the manifest beside `path` and makes its checksum fit."""
    file = parts_of(path) / manifest.MANIFEST
    content = json.loads(file.read_text())
    change(content)
    content["sha256"] = manifest._checksum(content)
    file.write_text(json.dumps(content))


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.update(block=55),
        lambda m: m["map"]["coords"]["belt_speed"]["values"].reverse(),
        lambda m: m["map"]["attrs"].update(tip_mass=1.0),
    ],
)
def test_a_manifest_that_was_changed_knowingly_is_refused(tmp_path, change):
    spec, path = make_spec(), tmp_path / "map.h5"
    stub.half_done(path, spec, 3)
    forged(path, change)
    with pytest.raises(StoreError, match=r"block-.*: is not block 0 of manifest.json beside it"):
        stub.run(spec, path, resume=True)
    with pytest.raises(StoreError, match="is not block 0"):
        open_map(parts_of(path))


def test_a_changed_manifest_without_blocks_changes_no_number(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    stub.half_done(path, spec, 0)
    forged(path, lambda m: m["map"]["coords"]["belt_speed"]["values"].reverse())
    stub.run(spec, path, resume=True)
    stub.assert_same_map(path, spec)


def test_a_block_under_another_number_or_of_another_sweep_is_refused(tmp_path):
    spec, other = make_spec(), make_spec(speeds=10)
    paths = tmp_path / "a.h5", tmp_path / "b.h5"
    for path, made in zip(paths, (spec, other), strict=True):
        stub.half_done(path, made, 2)
    block = next(parts_of(paths[0]).glob("block-00000001-*"))
    renamed = block.rename(block.with_name(block.name.replace("00000001", "00000002")))
    with pytest.raises(StoreError, match=r"is not block 2 .*\(start is 50, must be 100"):
        stub.run(spec, paths[0], resume=True)
    renamed.rename(block)
    (parts_of(paths[1]) / block.name).write_bytes(block.read_bytes())
    next(p for p in parts_of(paths[1]).glob("block-00000001-*") if p.name != block.name).unlink()
    with pytest.raises(StoreError, match=r"is not block 1 .*\(manifest is "):
        stub.run(other, paths[1], resume=True)


def test_blocks_of_a_mended_map_are_those_of_the_sweep(path):
    """What is salvaged has the numbers and types of blocks that were computed."""
    spec = make_spec()
    with stub.open_store(path, spec) as store:
        salvage(path, [], store)
        for number in range(store.count):
            columns, _ = work.evaluate_block(spec, np.arange(*store.span(number)), stub.evaluate)
            found = store.read(number)
            assert found is not None
            for name, values in found[0].items():
                np.testing.assert_array_equal(values, columns[name])
                assert values.dtype == columns[name].dtype
