"""Sweeps whose engine is a stub that costs nothing: their specification, map, store and blocks."""

import contextlib

import h5py
import numpy as np
import pytest
import xarray as xr

from wiperjax.machine import provenance
from wiperjax.maps import driver
from wiperjax.maps.block import evaluate_block
from wiperjax.specs.load import parse_sweep
from wiperjax.store import checksums
from wiperjax.store.blocks import BlockStore
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map
from wiperjax.vocabulary import codes
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
    return driver.sweep(spec, evaluate=evaluate, block=BLOCK, progress=False)


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
    with driver.sweep(
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


def block_files(path):
    return sorted(parts_of(path).glob("block-*.h5"))
