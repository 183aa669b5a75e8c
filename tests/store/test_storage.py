"""Sweeps that survive: kills at random times, damaged blocks, full disks, two writers, other
specifications.

The engine is a stub that costs nothing; run as a script, this file is the sweep that gets killed.
"""

import contextlib
import errno
import hashlib
import json
import logging
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from wiperjax.cli import main
from wiperjax.machine import provenance
from wiperjax.machine.files import StoreError
from wiperjax.maps import block
from wiperjax.maps import driver as sweep
from wiperjax.maps.block import block_size, evaluate_block
from wiperjax.maps.verify import verify
from wiperjax.specs.load import parse_sweep
from wiperjax.store import checksums, manifest, map_file, partial
from wiperjax.store.blocks import BlockStore
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map, write_dataset
from wiperjax.vocabulary import cf, codes, schema
from wiperjax.vocabulary.codes import RESULTS

BLOCK = 50
IDENTITY = {"precision": "float64", "jax": "0.1"}


def make_spec(angles: int = 7, loads: int = 5, speeds: int = 11, **run):
    """Sweep of 385 cells: eight blocks of 50, the last one short."""
    axes = {
        "attack_angle": {"start": -40, "stop": 40, "num": angles},
        "normal_load": {"start": 5, "stop": 30, "num": loads},
        "belt_speed": {"start": 0.02, "stop": 1.0, "num": speeds, "spacing": "geometric"},
    }
    return parse_sweep(
        {
            "title": "stub",
            "axes": axes,
            "run": {"transient": 0.2, "window": 0.2, "samples": 512} | run,
        }
    )


def evaluate(spec, index, finer=1, room=None):
    """Cells of every class, with the sampled velocity that the engine would return."""
    cells = spec.cells(index)
    speed, angle = (
        np.broadcast_to(cells[name], index.shape) for name in ("belt_speed", "attack_angle")
    )
    time_ = np.arange(finer * spec.samples) * spec.run.window / (finer * spec.samples)
    frequency = np.where(angle < 0, 40.0, 580.0) + 10 * speed
    wave = np.sqrt(2) * speed[:, None] * np.sin(2 * np.pi * frequency[:, None] * time_)
    return {
        "result": np.where(index % 17 == 3, RESULTS["non_finite"], RESULTS["finished"]),
        "velocity_rms": np.where(index % 5 == 0, 0.0, speed),
        "belt_speed_rms": speed,
        "stick_fraction": np.where(angle < 0, 0.7, 0.0),
        "slip_fraction": np.where(angle < 0, 0.3, 1.0),
        "flight_fraction": np.zeros(len(index)),
        "normal_force_max": np.sin(index),
        "steps": index * 3,
        "signal": wave.astype(np.float32),
        "occupancy": 0.9,
    }


def whole(spec):
    """The map that an undisturbed sweep makes."""
    return sweep.run(spec, evaluate=evaluate, block=BLOCK, progress=False)


def data_of(ds):
    """A map without the attributes that differ from run to run."""
    ds = ds.load().copy()
    for name in (*provenance.RUN_ATTRIBUTES, "cells", "block_cells"):
        ds.attrs.pop(name, None)
    return ds


def assert_same_map(path, spec):
    with open_map(path) as ds:
        xr.testing.assert_identical(data_of(ds), data_of(whole(spec)))
    assert not parts_of(path).exists()
    assert [entry.name for entry in path.parent.iterdir() if entry.name.startswith(".")] == []


def run(spec, path, **options):
    with sweep.run(
        spec, path, **{"evaluate": evaluate, "block": BLOCK, "progress": False} | options
    ) as ds:
        return ds.load()


def open_store(path, spec, **options):
    return BlockStore.open(path, spec, **{"block": BLOCK, "identity": IDENTITY} | options)


def fill(store, spec, numbers):
    for number in numbers:
        columns, _ = evaluate_block(spec, np.arange(*store.span(number)), evaluate)
        store.write(number, columns)


def half_done(path, spec, blocks, engine=evaluate, **options):
    """An unfinished sweep that holds `blocks`."""

    class Stop(Exception):
        pass

    def stopping(spec, index):
        if index[0] // BLOCK >= blocks:
            raise Stop
        return engine(spec, index)

    with pytest.raises(Stop):
        run(spec, path, evaluate=stopping, **options)


@contextlib.contextmanager
def rewritten(path):
    """A finished map as HDF5, to be changed; its checksums are then those of what it has become."""
    with h5py.File(path, "r+") as file:
        yield file
    with open(path, "r+b") as file:
        checksums.add(file)


def environment():
    """Environment in which another interpreter finds this wiperjax, installed or not."""
    root = str(Path(sweep.__file__).parents[2])
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    }


# --- the ordinary way -----------------------------------------------------------------------------


def test_a_sweep_makes_one_ordinary_file(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    ds = run(spec, path, command="typed")
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
    assert_same_map(path, spec)
    assert ds.attrs["command"] == "typed" and ds.attrs["cells"] == 385 and ds.attrs["wall_time"] > 0
    assert set(np.unique(ds.label)) == {
        codes.LABELS[n] for n in ("quiet", "squeal", "chattering", "failed")
    }
    finished = ds.result == RESULTS["finished"]
    assert np.isnan(ds.dominant_frequency.where(~finished)).all()
    assert ds.dominant_frequency.where(finished & (ds.attack_angle > 0)).min() > 579
    with h5py.File(path) as file:
        assert (
            file["stick_fraction"].compression == "gzip" and file["stick_fraction"].dims[0].keys()
        )
        assert {file[name].dtype.kind for name in file} <= {"f", "i"}
        assert file["stick_fraction"].maxshape == (7, 5, 11)


def test_one_axis_and_block_larger_than_the_map(tmp_path):
    spec = parse_sweep(
        {
            "axes": {"belt_speed": {"values": [0.1, 0.2, 0.4]}},
            "run": {"transient": 0, "window": 0.1},
        }
    )

    def flat(spec, index):
        return evaluate(spec, index) | {
            "stick_fraction": np.zeros(len(index)),
            "velocity_rms": np.zeros(len(index)),
            "signal": np.ones((len(index), 64)),
        }

    ds = run(spec, tmp_path / "map.h5", evaluate=flat)
    assert ds.stick_fraction.dims == ("belt_speed",) and ds.sizes["belt_speed"] == 3
    assert np.isnan(ds.dominant_frequency).all()


def test_columns_that_the_engine_does_not_return_are_not_stored(tmp_path):
    ds = run(make_spec(), tmp_path / "map.h5")
    assert "gap_max" not in ds and "signal" not in ds


@pytest.mark.parametrize(
    "shape",
    [
        (41, 11, 21),
        (100, 100, 100),
        (5,),
        (10**6,),
        (1000, 1000),
        (3, 4, 5, 6, 70),
        (2, 3000, 3000),
    ],
)
def test_slabs_cover_the_map_once_in_order_and_chunks_fit_in_them(shape):
    chunk = map_file.chunk_shape(shape)
    assert (
        all(1 <= c <= n for c, n in zip(chunk, shape, strict=True))
        and np.prod(chunk) <= map_file.CHUNK_CELLS
    )
    position = 0
    for start, stop, index in map_file.slabs(shape, chunk):
        assert start == position and stop - start <= map_file.SLAB_CELLS
        extents = [part.stop - part.start for part in index]
        assert stop - start == np.prod(extents)
        assert start == np.ravel_multi_index([part.start for part in index], shape)
        for part, c, n in zip(index, chunk, shape, strict=True):
            assert part.start % c == 0 and (part.stop % c == 0 or part.stop == n)
        position = stop
    assert position == np.prod(shape)


def test_a_map_larger_than_a_slab_is_put_together_right(tmp_path, monkeypatch):
    monkeypatch.setattr(map_file.slabs, "__defaults__", (40,))
    monkeypatch.setattr(map_file.chunk_shape, "__defaults__", (16, 40))
    assert_same_map_of = make_spec()
    run(assert_same_map_of, tmp_path / "map.h5", block=33)
    assert_same_map(tmp_path / "map.h5", assert_same_map_of)


def test_a_raster_over_time_is_stored_block_by_block(tmp_path, monkeypatch):
    monkeypatch.setattr(map_file.slabs, "__defaults__", (40,))
    monkeypatch.setattr(map_file.chunk_shape, "__defaults__", (16, 40))
    spec, path = make_spec(raster=7), tmp_path / "map.h5"

    def with_raster(spec, index):
        raster = (index[:, None] * 7 + np.arange(7)) % 4
        raster[index % 17 == 3, 4:] = 255
        return evaluate(spec, index) | {"regime_raster": raster.astype(np.uint8)}

    expected = with_raster(spec, np.arange(385))["regime_raster"].reshape(7, 5, 11, 7)
    with open_store(path, spec) as store:
        columns, _ = evaluate_block(spec, np.arange(50, 100), with_raster)
        store.write(1, columns)
        part = partial.open_partial(parts_of(path)).regime_raster
        store.remove()
    np.testing.assert_array_equal(part.values.reshape(385, 7)[50:100], columns["regime_raster"])
    assert (part.values.reshape(385, 7)[:50] == 255).all()

    ds = run(spec, path, evaluate=with_raster)
    np.testing.assert_array_equal(ds.regime_raster, expected)
    assert ds.regime_raster.dtype == np.uint8 and ds.regime_raster.dims[-1] == "raster_time"
    assert cf.flag_names(ds.regime_raster)[255] == "none"
    step = spec.run.window / spec.samples
    np.testing.assert_allclose(ds.raster_time, np.arange(7) * spec.samples // 7 * step)
    whole_ = sweep.run(spec, evaluate=with_raster, block=BLOCK, progress=False)
    xr.testing.assert_identical(data_of(ds), data_of(whole_))
    assert verify(path, cells=20, evaluate=with_raster).passed
    with rewritten(path) as file:
        file["regime_raster"][...] = 0
    assert len(verify(path, cells=20, evaluate=with_raster).differing) == 20


def with_events(spec, index, *look):
    """`evaluate` with an event log: cells of 0 to 8 events, where there is room for 5."""
    room, count = spec.run.event_log, index % 9
    held = np.arange(room) < count[:, None]
    return evaluate(spec, index, *look) | {
        "event_count": count,
        "event_overflow": count > room,
        "event_time": np.where(held, 1e-3 * np.arange(room) + 1e-6 * index[:, None], np.nan),
        "event_kind": np.where(held, 1 + index[:, None] % 4, codes.NONE),
        "regime_before": np.where(held, 0, codes.NONE),
        "regime_after": np.where(held, 1, codes.NONE),
        "event_impulse": np.where(held, np.cos(index)[:, None], np.nan),
    }


def test_the_event_log_survives_like_all_else(tmp_path, capsys):
    spec, path = make_spec(event_log=5), tmp_path / "map.h5"
    half_done(path, spec, 3, with_events)
    part = partial.open_partial(parts_of(path))
    expected = with_events(spec, np.arange(385))
    for name in ("event_time", "event_kind", "event_impulse"):
        found = part[name].values.reshape(385, 5)
        np.testing.assert_array_equal(found[:150], expected[name][:150])
        none = schema.SCHEMA[name].missing
        np.testing.assert_array_equal(found[150:], np.full((235, 5), none))
    run(spec, path, resume=True, evaluate=with_events)
    with open_map(path) as ds:
        whole_ = sweep.run(spec, evaluate=with_events, block=BLOCK, progress=False)
        xr.testing.assert_identical(data_of(ds), data_of(whole_))
        assert ds.event_time.dims == ("attack_angle", "normal_load", "belt_speed", "event")
        assert cf.flag_names(ds.event_kind)[5] == "impact"
        cell = ds.isel(attack_angle=0, normal_load=0, belt_speed=8)  # as a person reads one cell
        assert int(cell.event_count) == 8 and int(cell.event_overflow) == 1
        assert cell.event_time.dropna("event").size == 5
    assert verify(path, cells=20, evaluate=with_events).passed
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    counts = expected["event_count"]
    assert f"events: {counts.sum()} in the settled windows, 8 in the fullest" in said
    assert f"room for 5 of a cell, {(counts > 5).sum()} of 385 cells had more" in said


def test_the_netcdf_library_itself_reads_a_map(tmp_path):
    """Types, dimensions and attributes as netCDF has them, not as HDF5 would also allow."""
    netcdf = pytest.importorskip("netCDF4")
    spec, path = make_spec(event_log=5), tmp_path / "map.h5"
    ds = run(spec, path, evaluate=with_events)
    with netcdf.Dataset(path) as file:
        file.set_auto_mask(False)
        assert file.data_model == "NETCDF4" and file.Conventions == "CF-1.11"
        sizes = {name: len(dim) for name, dim in file.dimensions.items()}
        assert sizes == {"attack_angle": 7, "normal_load": 5, "belt_speed": 11, "event": 5}
        assert not any(dim.isunlimited() for dim in file.dimensions.values())
        for name, variable in file.variables.items():
            np.testing.assert_array_equal(variable[...], ds[name].values)
            assert variable.long_name and isinstance(variable.dtype, np.dtype)
            if "flag_values" in variable.ncattrs():
                values = np.atleast_1d(variable.flag_values)
                assert values.dtype == variable.dtype
                assert len(values) == len(variable.flag_meanings.split())
            else:
                assert variable.units
        assert file["event_time"].filters()["zlib"] and file["event_time"].chunking()[-1] == 5
        for name in ("specification_text", "versions", "host", "date_created", "seed", "command"):
            assert isinstance(getattr(file, name), str), name
        assert file.wall_time > 0


def test_a_write_that_is_lost_is_noticed(tmp_path, monkeypatch):
    """Of h5netcdf (it drops what lies past the end of a dimension) or of the disk."""
    import h5netcdf

    spec, path = make_spec(), tmp_path / "map.h5"
    true_write = h5netcdf.Variable.__setitem__

    def losing(self, key, value):
        if self.name != "/steps":
            true_write(self, key, value)

    with monkeypatch.context() as patch:
        patch.setattr(h5netcdf.Variable, "__setitem__", losing)
        with pytest.raises(StoreError, match="steps reads back otherwise than it was written"):
            run(spec, path)
    assert not path.exists() and len(block_files(path)) == 8

    class Lossy(map_file.SpillFile):
        def write(self, data):
            if len(memoryview(data).cast("B")) < 1000:
                return super().write(data)
            self._place += len(data)
            self._size = max(self._size, self._place)
            return len(data)

    with monkeypatch.context() as patch:
        patch.setattr(map_file, "SpillFile", Lossy)
        with pytest.raises(StoreError, match="^[^\n]*map.h5[^\n]*$"):
            run(spec, path, resume=True)
    assert not path.exists() and len(block_files(path)) == 8
    run(spec, path, resume=True)
    assert_same_map(path, spec)


def test_memory_is_that_of_a_block(tmp_path, monkeypatch):
    """The same peak for 2 500 cells and for 25 000, event log included, but for the record of
    checksums: 2 kB for each of its chunks, which here have 500 numbers and ordinarily 32 768.
    """
    monkeypatch.setattr(map_file.slabs, "__defaults__", (2000,))
    monkeypatch.setattr(map_file.chunk_shape, "__defaults__", (500, 2000))

    def peak(angles):
        spec = make_spec(angles, 50, 10, event_log=20, samples=16)
        tracemalloc.start()
        with sweep.run(
            spec, tmp_path / f"{angles}.h5", evaluate=with_events, block=500, progress=False
        ):
            found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(2)  # imports
    small, large = peak(5), peak(50)
    with h5py.File(tmp_path / "50.h5") as file:
        chunks = sum(file[name].id.get_num_chunks() for name in file if file[name].chunks)
    assert large < 1.25 * small + 2000 * chunks, (small, large, chunks)


def test_blocks_shrink_as_cells_grow():
    """Memory is that of a block: of few cells where each has much to keep."""
    many = {"angles": 50, "loads": 10, "speeds": 100}
    for room in (2000, 5000, 20_000):
        size = block_size(make_spec(**many, event_log=room))
        assert size * room * 19 <= 2**27 < 2 * size * room * 20
    # few enough to leave lanes idle, but no block outgrows the memory
    assert block_size(make_spec(**many, event_log=65_536)) * 65_536 * 19 <= 2**27
    assert block_size(make_spec(**many, samples=2**20)) * 4 * 2**20 <= 2**27


@pytest.mark.parametrize("belt", ["steady", "wiping"])
def test_samples_are_analysed_in_parts(belt, monkeypatch):
    """Filters and spectra hold many times the memory of the samples; what they find in a cell does
    not depend on which are looked at together."""
    kind = {"kind": belt} | ({"frequency": 20.0} if belt == "wiping" else {})
    spec = parse_sweep(
        {
            "axes": {
                "attack_angle": {"start": -40, "stop": 40, "num": 10},
                "normal_load": {"start": 5, "stop": 30, "num": 5},
            },
            "belt": kind,
            "run": {"transient": 0.2, "window": 0.2, "samples": 4096},
            "classes": {"reversal_window": 0.005},
        }
    )

    def reversing(spec, index, finer=1, room=None):
        count = finer * 4096
        time_ = 0.2 / count * (0.5 + np.arange(count))
        halves = 40 * time_
        columns = evaluate(spec, index, finer) | {
            "since_reversal": (halves - np.round(halves)) / 40, "wiping_frequency": 20.0,
        }  # fmt: skip
        columns["signal"] = columns["signal"] * np.sin(2 * np.pi * 20 * time_)
        return columns | {"signal_inner": 1e-3 * np.square(columns["signal"])}

    engine = evaluate if belt == "steady" else reversing
    found, sizes, analyse = [], [], block.signal_columns

    def watched(signal, *given, **named):
        sizes.append(signal.size)
        return analyse(signal, *given, **named)

    monkeypatch.setattr(block, "signal_columns", watched)
    for samples in (2**30, 2**16):
        monkeypatch.setattr(block, "ANALYSED", samples)
        found.append(evaluate_block(spec, np.arange(50), engine)[0])
    assert sizes[0] == 50 * 4096 and sizes[-1] <= 2**16
    whole_, parts = found
    assert whole_.keys() == parts.keys() and "dominant_frequency" in parts
    assert ("tone_time_after" in parts) == (belt == "wiping")
    for name, values in whole_.items():
        np.testing.assert_array_equal(parts[name], values)


def test_a_closer_look_keeps_to_the_memory_too(monkeypatch):
    looks = []

    def watched(spec, index, finer=1, room=None):
        looks.append(finer)
        return evaluate(spec, index, finer)

    monkeypatch.setattr(block, "untold", lambda columns, limits: np.ones(2, bool))
    for samples, most in ((2**10, [1, 2, 2, 16, 16]), (2**18, [1, 2, 2]), (2**20, [1])):
        looks.clear()
        evaluate_block(make_spec(samples=samples), np.arange(2), watched)
        assert looks == most


def test_blocks_hold_some_time_of_motion_and_are_alike():
    """What a kill can cost is bounded, lanes idle at the end of a block are few, and no short
    block is compiled once more."""
    for angles, window, blocks in ((50, 0.2, 3), (50, 2.0, 14), (2000, 0.2, 98), (2000, 0.01, 62)):
        spec = make_spec(angles=angles, loads=10, speeds=100, window=window)
        size = block_size(spec)
        assert size * (0.2 + window) <= 2**13
        assert size <= 2**15
        assert -(-spec.size // size) == blocks
        assert blocks * size - spec.size < blocks
    assert block_size(make_spec(angles=50, loads=10, speeds=100), workers=4) == 3125
    assert block_size(make_spec(angles=50, loads=10, speeds=100), workers=100) == 1021


# --- interruption ---------------------------------------------------------------------------------


@pytest.mark.parametrize("blocks", [0, 1, 5, 8])
def test_resume_goes_on_where_it_stopped(tmp_path, blocks):
    spec, path, calls = make_spec(), tmp_path / "map.h5", []
    if blocks < 8:
        half_done(path, spec, blocks)

    def counting(spec, index):
        calls.append(index[0] // BLOCK)
        return evaluate(spec, index)

    run(spec, path, resume=True, evaluate=counting)
    assert calls == list(range(blocks if blocks < 8 else 0, 8))
    assert_same_map(path, spec)
    run(spec, path, resume=True, evaluate=counting)  # finished already: nothing is computed
    assert len(calls) == 8 - (blocks if blocks < 8 else 0)


def test_kills_at_random_times(tmp_path):
    """SIGKILL at random times, from before the first block to while the map is put together."""
    spec, path = make_spec(), tmp_path / "map.h5"
    reference = data_of(whole(spec))
    kills, finished, kept, places = 0, 0, 0, set()
    rng = random.Random(0)
    # Processes are forked: a fresh interpreter for each kill would take most of the time. The time
    # of a whole sweep is measured, for the kills must hit all of it on a busy machine, too.
    begun = time.monotonic()
    os.waitpid(subprocess_fork(spec, path, delay=0.004), 0)
    length = time.monotonic() - begun
    path.unlink()
    deadline = begun + 180  # about ten seconds, unless the machine is very busy
    enough = False
    while not enough and time.monotonic() < deadline:
        child = subprocess_fork(spec, path, delay=0.004)
        time.sleep(rng.uniform(0.0, 0.8 * length))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        kills += os.WIFSIGNALED(status)
        if path.exists():
            with open_map(path) as ds:  # whole, or not there
                xr.testing.assert_identical(data_of(ds), reference)
            finished += 1
            path.unlink()
            shutil.rmtree(parts_of(path), ignore_errors=True)
        elif parts_of(path).exists() and (parts_of(path) / "manifest.json").exists():
            done = partial.open_partial(parts_of(path))
            cells = done.done.values.astype(bool)
            kept += bool(cells.any())
            places.add(int(cells.sum()))
            if cells.any():
                same = done.steps.values[cells] == reference.steps.values[cells]
                assert same.all()
        enough = kills >= 20 and kept >= 8 and finished >= 2 and len(places) >= 4
    run(spec, path, resume=True)
    assert_same_map(path, spec)
    counts = f"{kills} kills, {kept} left finished blocks, {finished} maps were finished"
    print(f"{counts}; cells done after a kill: {sorted(places)}")
    assert enough, counts


CALLS = ("mkdir", "ftruncate", "fsync", "replace", "unlink", "rmdir")


def test_a_kill_before_any_call_that_counts(tmp_path):
    """SIGKILL before the first, the second, ... of all the calls that make what was written
    durable, name it or delete it: each time what is left can be read, and goes on to the same map.
    """
    spec, path = make_spec(2, 2, 5), tmp_path / "map.h5"
    options = {"block": 8, "evaluate": evaluate, "progress": False, "resume": True}
    reference = data_of(sweep.run(spec, evaluate=evaluate, block=8, progress=False))
    places, kept, call = 0, set(), 0
    while True:
        child = fork(lambda call=call: killed_at(call, spec, path, options))
        _, status = os.waitpid(child, 0)
        if not os.WIFSIGNALED(status):
            break
        places += 1
        if (parts_of(path) / "manifest.json").exists():
            part = open_map(parts_of(path))
            done = part.done.values == 1
            kept.add(int(done.sum()))
            if done.any():
                assert (part.steps.values[done] == reference.steps.values[done]).all()
        with sweep.run(spec, path, **options) as ds:
            xr.testing.assert_identical(data_of(ds), reference)
        assert [entry.name for entry in tmp_path.iterdir()] == ["map.h5"]
        path.unlink()
        call += 1
    print(f"{places} kills, one before each call")
    assert places > 25 and kept >= {0, 8, 16, 20}


def killed_at(call, spec, path, options):
    """A sweep that kills its process before its call number `call` of `CALLS`."""
    left = iter(range(call + 1))

    def deadly(function):
        def wrapped(*args, **kwargs):
            if next(left, None) == call:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*args, **kwargs)

        return wrapped

    for name in CALLS:
        setattr(os, name, deadly(getattr(os, name)))
    sweep.run(spec, path, **options)


def subprocess_fork(spec, path, delay):
    """Process id of a child that resumes the sweep, each block taking `delay` seconds."""
    return fork(lambda: slow_sweep(spec, path, delay, resume=True))


def fork(work):
    """Process id of a child that does `work` and ends."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", DeprecationWarning
        )  # Python 3.12: fork with threads; the child only sweeps
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # the same from jax, which the child does not use
        child = os.fork()
    if child == 0:
        try:
            block()
        finally:
            os._exit(0)
    return child


def slow_sweep(spec, path, delay, **options):
    def slow(spec, index):
        time.sleep(delay)
        return evaluate(spec, index)

    return sweep.run(spec, path, evaluate=slow, block=BLOCK, progress=False, **options)


def test_ctrl_c_stops_cleanly_and_says_how_to_go_on(tmp_path):
    path = tmp_path / "map.h5"
    child = subprocess.Popen(
        [sys.executable, __file__, path, "0.3"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=environment(),
    )
    deadline = time.monotonic() + 60
    while (
        not list(tmp_path.glob("map.h5.parts/block-*"))
        and child.poll() is None
        and time.monotonic() < deadline
    ):
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 130, said
    assert (
        "cells are kept" in said
        and "wiperjax sweep a.toml -o map.h5 --resume" in said
        and "Traceback" not in said
    )
    assert not path.exists() and parts_of(path).is_dir()
    run(make_spec(), path, resume=True)
    assert_same_map(path, make_spec())


def test_kill_between_the_finished_map_and_the_removal_of_its_parts(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 3)
    shutil.copytree(parts_of(path), tmp_path / "kept")
    run(spec, path, resume=True)
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    (tmp_path / "kept").rename(parts_of(path))

    def never(spec, index):
        raise AssertionError("nothing is left to compute")

    run(spec, path, resume=True, evaluate=never)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == before and not parts_of(path).exists()


# --- damage ---------------------------------------------------------------------------------------


def block_files(path):
    return sorted(parts_of(path).glob("block-*.h5"))


def damage_by_flip(file):
    content = bytearray(file.read_bytes())
    content[random.Random(file.name).randrange(len(content))] ^= 1
    file.write_bytes(content)


def damage_by_cut(file):
    os.truncate(file, file.stat().st_size // 2)


def damage_by_emptying(file):
    os.truncate(file, 0)


@pytest.mark.parametrize("damage", [damage_by_flip, damage_by_cut, damage_by_emptying])
def test_a_damaged_block_is_named_and_computed_again(tmp_path, caplog, damage):
    spec, path, calls = make_spec(), tmp_path / "map.h5", []
    half_done(path, spec, 6)
    bad = block_files(path)[2]
    damage(bad)
    with caplog.at_level(logging.WARNING, "wiperjax"):
        assert (
            partial.open_partial(parts_of(path)).done.sum() == 250
        )  # reading alone deletes nothing
    assert bad.exists()
    caplog.clear()

    def counting(spec, index):
        calls.append(index[0] // BLOCK)
        return evaluate(spec, index)

    with caplog.at_level(logging.WARNING, "wiperjax"):
        run(spec, path, resume=True, evaluate=counting)
    assert calls == [2, 6, 7]
    assert (
        len(caplog.messages) == 1
        and bad.name in caplog.messages[0]
        and "\n" not in caplog.messages[0]
    )
    assert_same_map(path, spec)


def test_every_flipped_byte_is_noticed(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 1)
    (file,) = block_files(path)
    content = file.read_bytes()
    store = BlockStore.peek(parts_of(path))
    logging.getLogger("wiperjax").setLevel(logging.ERROR)
    try:
        for place in random.Random(1).sample(range(len(content)), 300):
            file.write_bytes(
                content[:place] + bytes([content[place] ^ (1 << place % 8)]) + content[place + 1 :]
            )
            store._names[0] = file.name
            assert store.read(0) is None and not store.done()[0]
        file.write_bytes(content)
        store._names[0] = file.name
        assert store.read(0) is not None
    finally:
        logging.getLogger("wiperjax").setLevel(logging.NOTSET)


def test_a_block_damaged_while_the_sweep_runs_stops_the_map_not_the_store(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"

    def spoiling(spec, index):
        if index[0] == 7 * BLOCK:
            damage_by_flip(block_files(path)[4])
        return evaluate(spec, index)

    with pytest.raises(StoreError, match="block 4 is damaged"):
        run(spec, path, evaluate=spoiling)
    assert not path.exists() and len(block_files(path)) == 7
    run(spec, path, resume=True)
    assert_same_map(path, spec)


def test_a_damaged_manifest_is_one_clear_line(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 2)
    (parts_of(path) / "manifest.json").write_text('{"format": 1, "bl')
    with pytest.raises(StoreError, match=r"manifest.json: is damaged"):
        run(spec, path, resume=True)
    with pytest.raises(StoreError, match=r"manifest.json: is damaged"):
        run(spec, path)
    run(spec, path, force=True)
    assert_same_map(path, spec)


def test_every_flipped_byte_of_the_manifest_is_noticed(tmp_path):
    """Or harmless: what says which cells of which map these are cannot change unseen."""
    path = tmp_path / "map.h5"
    open_store(path, make_spec()).close()
    file = parts_of(path) / "manifest.json"
    content, whole_ = file.read_bytes(), manifest.read(parts_of(path))
    noticed = 0
    for place in random.Random(2).sample(range(len(content)), 300):
        changed = bytes([content[place] ^ (1 << place % 7)])
        file.write_bytes(content[:place] + changed + content[place + 1 :])
        try:
            assert manifest.read(parts_of(path)) == whole_, place
        except StoreError as error:
            assert str(error).startswith(f"{file}: ") and "--force" in str(error)
            noticed += 1
    assert noticed > 200


# --- refusals -------------------------------------------------------------------------------------


def test_another_specification_is_refused_and_the_difference_named(tmp_path):
    path = tmp_path / "map.h5"
    half_done(path, make_spec(), 2)
    files = block_files(path)
    with pytest.raises(StoreError, match=r"run.rtol was 1e-06, now 1e-07"):
        run(make_spec(rtol=1e-7), path, resume=True)
    with pytest.raises(StoreError, match=r"axes.attack_angle was 7 values.*now 8 values"):
        run(make_spec(angles=8), path, resume=True)
    assert block_files(path) == files
    run(make_spec(), path, resume=True)


@pytest.mark.parametrize("name", ["wiperjax", "jax", "numpy", "precision"])
def test_a_sweep_by_other_software_is_refused(tmp_path, name, monkeypatch):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 2)
    made = block.made_by(spec)
    monkeypatch.setattr(block, "made_by", lambda spec: made | {name: "other"})
    with pytest.raises(StoreError, match=f"{name} was {re.escape(made[name])}, now other"):
        run(spec, path, resume=True)
    assert len(block_files(path)) == 2


@pytest.mark.parametrize("name", ["precision", "jax"])
def test_another_version_or_precision_is_refused(tmp_path, name):
    path, spec = tmp_path / "map.h5", make_spec()
    open_store(path, spec).close()
    with pytest.raises(StoreError, match=f"{name} was {IDENTITY[name]}, now other"):
        open_store(path, spec, identity=IDENTITY | {name: "other"}, resume=True)


def test_two_writers_are_told_apart(tmp_path):
    path, spec = tmp_path / "map.h5", make_spec()
    with open_store(path, spec) as store:
        fill(store, spec, [0])
        code = (
            "import sys; sys.path[:0] = [sys.argv[2], sys.argv[3]]; import test_storage as t\n"
            "from pathlib import Path\n"
            "try: t.open_store(Path(sys.argv[1]), t.make_spec(), resume=True)\n"
            "except t.StoreError as error: print(error)\n"
        )
        words = [sys.executable, "-c", code, path, Path(__file__).parent]
        said = subprocess.run(words, capture_output=True, text=True, env=environment()).stdout
        assert f"is being written by process {os.getpid()}" in said
        with pytest.raises(StoreError, match="is being written by process"):
            open_store(path, spec, force=True)
        assert store.done()[0]
    open_store(path, spec, resume=True).close()  # a closed store is free


def test_existing_output_and_unfinished_store_need_a_word(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    path.write_text("precious")
    with pytest.raises(StoreError, match="exists already"):
        run(spec, path)
    with pytest.raises(StoreError, match="exists already"):
        run(spec, path, resume=True)
    assert path.read_text() == "precious" and not parts_of(path).exists()
    run(spec, path, force=True)
    assert_same_map(path, spec)
    path.unlink()
    half_done(path, spec, 2)
    with pytest.raises(StoreError, match="unfinished sweep; use --resume"):
        run(spec, path)
    with pytest.raises(StoreError, match="an unfinished sweep is in"):
        open_map(path)
    run(spec, path, force=True)
    assert_same_map(path, spec)


def test_leave_to_replace_outlives_a_kill(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    run(make_spec(rtol=1e-5), path)
    half_done(path, spec, 2, force=True)
    run(spec, path, resume=True)
    assert_same_map(path, spec)


def test_a_folder_that_is_not_ours_is_left_alone(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    parts_of(path).mkdir()
    (parts_of(path) / "thesis.txt").write_text("precious")
    for force in (False, True):
        with pytest.raises(StoreError, match="thesis.txt: is no part of a sweep"):
            run(spec, path, force=force)
    assert (parts_of(path) / "thesis.txt").read_text() == "precious"


def test_places_that_cannot_be_written_to(tmp_path):
    spec = make_spec()
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "map.h5", tmp_path / "none" / "map.h5"):
        with pytest.raises(StoreError, match=f"{path}: cannot be written"):
            run(spec, path)
    with pytest.raises(StoreError, match="it is a folder"):
        run(spec, tmp_path, force=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_read_only_folder(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # root may write anywhere, unless the file system itself says no
        words = ["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", folder]
        if not shutil.which("mount") or subprocess.run(words, capture_output=True).returncode:
            pytest.skip("neither permissions nor mounts can make a folder read-only here")
    try:
        with pytest.raises(
            StoreError, match="cannot be written: (no permission|Read-only file system)"
        ):
            run(make_spec(), folder / "map.h5")
    finally:
        subprocess.run(["umount", folder], capture_output=True)


# --- full disk ------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path):
    """Folder on a file system of 400 KiB."""
    folder = tmp_path / "small"
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", folder]
    if (
        os.geteuid()
        or not shutil.which("mount")
        or subprocess.run(words, capture_output=True).returncode
    ):
        pytest.skip("no small file system can be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_full_disk_loses_no_finished_block(small_disk):
    """At every level of filling: one clear line, finished blocks and other files kept, and room
    makes it go on.
    """
    spec, path, ballast = make_spec(), small_disk / "map.h5", small_disk / "ballast"
    full, stages = 0, set()
    for free in range(0, 400, 24):
        ballast.write_bytes(b"x" * max(0, _free(small_disk) - free * 1024))
        try:
            run(spec, path)
        except StoreError as error:
            full += 1
            assert (
                os.strerror(errno.ENOSPC) in str(error)
                and str(small_disk) in str(error)
                and "\n" not in str(error)
            )
            assert not path.exists()
            if (parts_of(path) / "manifest.json").exists():
                stages.add(int(partial.open_partial(parts_of(path)).done.sum()))
            assert not list(parts_of(path).glob(".*")) if parts_of(path).exists() else True
        ballast.unlink()
        run(spec, path, resume=True)
        assert_same_map(path, spec)
        path.unlink()
    # Full while blocks are written, and (all 385 cells done) while the map is.
    assert full >= 4 and len(stages) >= 3 and 385 in stages, (full, stages)


def _free(folder):
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize


def test_a_file_size_limit_is_an_error_like_a_full_disk(tmp_path):
    """The same without a mount, for machines where that is not allowed."""
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 3)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, before[1]))
    try:
        with pytest.raises(
            StoreError, match=f"block-00000003.*cannot be written: {os.strerror(errno.EFBIG)}"
        ):
            run(spec, path, resume=True)
        with pytest.raises(StoreError, match="ds.h5: cannot be written"):
            write_dataset(whole(spec), tmp_path / "ds.h5")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (
        len(block_files(path)) == 3
        and not list(parts_of(path).glob(".*"))
        and not (tmp_path / "ds.h5").exists()
    )
    run(spec, path, resume=True)
    assert_same_map(path, spec)


# --- reading meanwhile, reading after -------------------------------------------------------------


def test_an_unfinished_store_opens_with_a_mask(tmp_path, capsys):
    spec, path = make_spec(), tmp_path / "map.h5"
    with open_store(path, spec) as store:
        fill(store, spec, [1, 7])
        ds = partial.open_partial(parts_of(path))  # while it is locked by its writer
    cells = np.zeros(385, dtype=bool)
    cells[50:100] = cells[350:] = True
    np.testing.assert_array_equal(ds.done.values.ravel(), cells)
    expected = whole(spec)
    for name in ("stick_fraction", "steps", "label"):
        found = ds[name].values.ravel()
        np.testing.assert_array_equal(found[cells], expected[name].values.ravel()[cells])
        assert (np.isnan(found) if found.dtype.kind == "f" else found == -1)[~cells].all()
    assert cf.flag_names(ds.label)[-1] == "not_computed" and ds.attrs["cells_done"] == 85
    assert list(partial.open_partial(parts_of(path), ["label"]).data_vars) == ["label", "done"]
    with pytest.raises(StoreError, match="not the folder of an unfinished sweep"):
        partial.open_partial(tmp_path)
    xr.testing.assert_identical(open_map(parts_of(path)), ds)
    with pytest.raises(StoreError, match="is not a finished map"):
        verify(parts_of(path), evaluate=evaluate)
    assert main(["info", str(parts_of(path))]) == 0
    said = capsys.readouterr().out
    assert "cells_done: 85" in said and "squeal " in said and "not_computed" not in said


def test_files_that_are_no_maps(tmp_path):
    with pytest.raises(StoreError, match="does not exist"):
        open_map(tmp_path / "none.h5")
    for content in (b"", b"\x89HDF\r\n\x1a\n", b"text"):
        (tmp_path / "bad.h5").write_bytes(content)
        with pytest.raises(StoreError, match="bad.h5: is not a readable map"):
            open_map(tmp_path / "bad.h5")


def test_verify_recomputes_and_finds_a_changed_number(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    run(spec, path)
    report = verify(path, cells=40, seed=1, evaluate=evaluate)
    assert report.passed and report.same_versions and report.cells == 40 and report.columns == 14
    assert set(report.largest) <= {"dominant_frequency"}
    with rewritten(path) as file:
        file["normal_force_max"][...] = file["normal_force_max"][...] * (1 + 1e-6)
    report = verify(path, cells=385, evaluate=evaluate)
    assert not report.passed and len(report.differing) > 380
    assert report.largest["normal_force_max"] == pytest.approx(1e-6, rel=1e-3)
    with pytest.raises(StoreError, match="was not made from this specification"):
        verify(path, spec=make_spec(rtol=1e-7), evaluate=evaluate)


def test_progress_is_silent_without_a_terminal_and_counts_with_one(tmp_path, capfd):
    from io import StringIO

    from rich.console import Console

    from wiperjax.maps.progress import Report

    run(make_spec(), tmp_path / "map.h5", progress=True)
    assert capfd.readouterr() == ("", "")
    screen = StringIO()
    console = Console(file=screen, force_terminal=True, width=150)
    with Report(100, title="stub", console=console) as report:
        report.update(
            {"label": np.array([0] * 30 + [1] * 20), "result": np.zeros(50, dtype=int)}, 50, 0.9
        )
    said = screen.getvalue()
    assert "50 of 100 cells" in said and "quiet 30, squeal 20" in said and "finished 50" in said
    assert "occupancy 90%" in said and "cells/s" in said and "left" in said


def test_manifest_tells_a_person_what_it_is(tmp_path):
    with open_store(tmp_path / "map.h5", make_spec()):
        manifest = json.loads((tmp_path / "map.h5.parts" / "manifest.json").read_text())
    assert (
        manifest["cells"] == 385
        and manifest["block"] == BLOCK
        and manifest["identity"]["precision"] == "float64"
    )
    assert manifest["map"]["coords"]["belt_speed"]["attrs"]["units"] == "m/s"


if __name__ == "__main__":
    # where the tests run in a shell's background, SIGINT comes ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        slow_sweep(
            make_spec(),
            Path(sys.argv[1]),
            float(sys.argv[2]),
            command="wiperjax sweep a.toml -o map.h5 --force",
        )
    except KeyboardInterrupt as stopped:
        print(stopped, file=sys.stderr)
        sys.exit(130)
