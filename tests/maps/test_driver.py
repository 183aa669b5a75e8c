"""Sweeps: the ordinary way, on from where they stopped, and what they refuse."""

import logging
import os
import random
import re
import signal
import time

import h5py
import numpy as np
import pytest
import xarray as xr
from processes import drop_ctrl_c
from stub_sweep import (
    BLOCK,
    assert_same_map,
    block_files,
    data_of,
    evaluate,
    half_done,
    make_spec,
    open_store,
    rewritten,
    run,
    with_events,
)

from wiperjax.cli import main
from wiperjax.machine import provenance
from wiperjax.machine.files import StoreError
from wiperjax.machine.interrupt import heeded
from wiperjax.machine.phases import during
from wiperjax.maps import block, computing, driver
from wiperjax.maps.block import evaluate_block
from wiperjax.maps.verify import verify
from wiperjax.specs.load import parse_sweep
from wiperjax.store import map_file, partial
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map
from wiperjax.vocabulary import cf, codes, schema
from wiperjax.vocabulary.codes import RESULTS


@pytest.mark.parametrize(("start", "left"), [(0, []), (BLOCK, ["map.h5.parts"])])
def test_a_refused_sweep_leaves_what_it_computed_alone(tmp_path, start, left):
    """Else its next try, mended, would be refused for an unfinished one."""

    def refusing(spec, cells):
        if cells[0] >= start:
            raise ValueError("load must be positive, but was -1")
        return evaluate(spec, cells)

    with pytest.raises(ValueError, match="load must be"):
        run(make_spec(), tmp_path / "map.h5", evaluate=refusing)
    assert [entry.name for entry in tmp_path.iterdir()] == left


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


@pytest.mark.parametrize("to_disk", [True, False])
def test_a_map_says_what_its_time_went_into(tmp_path, to_disk):
    def slow(spec, index, finer=1, room=None):
        with during("engine"):
            time.sleep(0.02)
        return evaluate(spec, index, finer)

    started = time.perf_counter()
    ds = run(make_spec(), tmp_path / "map.h5" if to_disk else None, evaluate=slow)
    passed = time.perf_counter() - started
    took = {name: ds.attrs[f"{name}_time"] for name in provenance.PHASES}
    assert took["engine"] >= 8 * 0.02 and took["naming"] > 0 and took["compiling"] == 0
    assert (took["storing"] > 0) == to_disk
    assert all(seconds <= passed for seconds in took.values())


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


def test_a_raster_over_time_is_stored_block_by_block(tmp_path, monkeypatch):
    monkeypatch.setattr(map_file, "SLAB_CELLS", 40)
    monkeypatch.setattr(map_file, "CHUNK_CELLS", 16)
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
    whole_ = driver.sweep(spec, evaluate=with_raster, block=BLOCK, progress=False)
    xr.testing.assert_identical(data_of(ds), data_of(whole_))
    assert verify(path, cells=20, evaluate=with_raster).passed
    with rewritten(path) as file:
        file["regime_raster"][...] = 0
    assert len(verify(path, cells=20, evaluate=with_raster).differing) == 20


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
        whole_ = driver.sweep(spec, evaluate=with_events, block=BLOCK, progress=False)
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
    assert f"room for 5 of each, {(counts > 5).sum()} of 385 cells had more" in said


@pytest.mark.long
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


def damage_by_flip(file):
    content = bytearray(file.read_bytes())
    content[random.Random(file.name).randrange(len(content))] ^= 1
    file.write_bytes(content)


def damage_by_cut(file):
    os.truncate(file, file.stat().st_size // 2)


def damage_by_emptying(file):
    os.truncate(file, 0)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_that_a_callback_drops_is_heeded_after_the_block(tmp_path):
    def pressed(spec, index, *look):
        if index[0] == 3 * BLOCK:  # begun when the first is stored, some behind it perhaps
            drop_ctrl_c()
        return evaluate(spec, index)

    path = tmp_path / "map.h5"
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with pytest.raises(
            driver.SweepInterrupted, match=r" (50|1[05]0|200) of 385 cells are kept"
        ):
            driver.sweep(make_spec(), path, evaluate=pressed, block=BLOCK, progress=False)
        with pytest.raises(KeyboardInterrupt):  # in memory too
            driver.sweep(make_spec(), evaluate=pressed, block=BLOCK, progress=False)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, handler)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_that_a_callback_drops_before_the_blocks_is_heeded_before_them(tmp_path):
    """Four of 45 Ctrl-C in the first two seconds of a sweep were not heard at all."""
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with heeded():  # as around the command
            drop_ctrl_c()
            with pytest.raises(driver.SweepInterrupted, match=r"0 of 385 cells are kept"):
                driver.sweep(make_spec(), tmp_path / "map.h5", evaluate=evaluate, progress=False)
    finally:
        signal.signal(signal.SIGINT, handler)


@pytest.mark.slow
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


def test_notes_on_what_a_mapping_or_a_file_asks_are_logged(tmp_path, caplog):
    """From Python nobody else says them; the command line shows those of its own file."""
    asked = make_spec().document()
    asked["axes"]["attack_angle"] = {"values": [-0.5, 0.5]}
    driver.sweep(asked, evaluate=evaluate, progress=False)
    note = "note: axes.attack_angle reaches 0.5 degrees only; it is not in radians"
    assert caplog.messages == [note]
    driver.sweep(parse_sweep(asked), evaluate=evaluate, progress=False)
    assert len(caplog.messages) == 1


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
    monkeypatch.setattr(computing, "made_by", lambda spec: made | {name: "other"})
    with pytest.raises(StoreError, match=f"{name} was {re.escape(made[name])}, now other"):
        run(spec, path, resume=True)
    assert len(block_files(path)) == 2


@pytest.mark.slow
def test_existing_output_and_unfinished_store_need_a_word(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    path.write_text("precious")
    with pytest.raises(StoreError, match="exists already"):
        run(spec, path)
    with pytest.raises(StoreError, match="has no checksums .* another program made or changed it"):
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


def test_a_number_is_no_workers():
    with pytest.raises(ValueError, match=r"^workers must be those of .*configure.* but was 2$"):
        driver.sweep(make_spec(), evaluate=evaluate, workers=2)
